"""What a run found, told in words and short tables: for the terminal and for the page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from wavesim.material.family import sector_words

Summary = Mapping[str, Any]
Row = Mapping[str, Any]

# By kind of quantity: what one SI unit is in the unit shown, its name, and how many digits count.
KINDS: dict[str, tuple[float, str, int]] = {
    "frequency": (1e-3, "kHz", 6),
    "decay": (1e-3, "dB/mm", 5),
    "velocity": (1.0, "m/s", 5),
    "error of velocity": (1.0, "m/s", 2),
    "wavenumber": (1e-3, "rad/mm", 4),
    "level": (1.0, "dB", 4),
    "number": (1.0, "", 5),
    "error of number": (1.0, "", 2),
    "time": (1e6, "µs", 5),
    "length": (1e3, "mm", 5),
}


@dataclass(frozen=True)
class Column:
    """One column of an answer.

    Attributes:
        name: its heading.
        key: of the number in a row of summary.json.
        kind: of quantity, see KINDS; "" for words.
        below, above: of what says in a row that the number is no more than an upper, or a lower,
            bound; "" where none does.
    """

    name: str
    key: str
    kind: str = ""
    below: str = ""
    above: str = ""

    @property
    def unit(self) -> str:
        """Of the number as it is shown; "" of words."""
        return KINDS[self.kind][1] if self.kind else ""

    def bound(self, row: Row) -> str:
        """What stands behind the number."""
        return " or less" if row.get(self.below) else " or more" if row.get(self.above) else ""

    def shown(self, row: Row) -> str:
        """Of a row, in the unit of its kind, or a word; – where there is none."""
        return shown(row.get(self.key), self.kind) + self.bound(row)


@dataclass(frozen=True)
class Answer:
    """One answer as a table.

    Attributes:
        title: of the table.
        columns: of it.
        rows: of summary.json, SI.
        note: how to read it.
    """

    title: str
    columns: tuple[Column, ...]
    rows: Sequence[Row]
    note: str = ""


# Rows of a table of receivers, at most.
_MOST_RECEIVERS = 12

_OF_A_GAP = (
    Column("from", "lower", "frequency"),
    Column("to", "upper", "frequency"),
    Column("at", "frequency", "frequency"),
    Column("steady\nwave", "attenuation_at_real_frequency", "decay"),
    Column("20 dB\nwithin", "twenty_decibels_within", "length"),
)
_LAYOUT: dict[str, tuple[str, tuple[Column, ...], str]] = {
    "medium": (
        "Band gaps of the medium, and how strongly they attenuate in their middle",
        (
            Column("gap", "gap"),
            Column("waves", "sector"),
            Column("of", "medium"),
            *_OF_A_GAP,
        ),
        "Exact, of the medium alone. Steady wave: what a wave that never ends loses there; it has "
        "lost 20 dB, a tenth of it left, within the distance beside.",
    ),
    "gap": (
        "Band gaps, and how strongly they attenuate in their middle",
        (
            Column("gap", "gap"),
            Column("waves", "sector"),
            *_OF_A_GAP,
            Column("record:\nsimulated", "attenuation", "decay"),
            Column("record:\nexact", "attenuation_exact", "decay"),
        ),
        "Steady wave: what a wave that never ends loses there, exact: the number to take. A record "
        "that ends tells it blurred, at a complex frequency ω + iσ: simulated, beside what is "
        "exact there. These two must agree with each other, and come near the steady wave's the "
        "longer the record is. Edges are the medium's, exact. Within the distance beside a steady "
        "wave has lost 20 dB: a tenth of it is left.",
    ),
    "distance": (
        "What a steady wave in the middle of a gap has lost at each receiver",
        (
            Column("receiver", "receiver"),
            Column("from a source", "distance", "length"),
        ),
        "Attenuation times the distance to the nearest source, echoes apart. A gap shows in a "
        "spectrum from about 20 dB on; as a record ends, no more than 30 to 40 dB are seen of it "
        "in a plain spectrum, some 80 where the record is faded out.",
    ),
    "stopped": (
        "Where none of these waves travels",
        (
            Column("from", "lower", "frequency"),
            Column("to", "upper", "frequency"),
        ),
        "",
    ),
    "wave": (
        "Phase velocity of long waves",
        (
            Column("wave", "wave"),
            Column("waves", "sector"),
            Column("at k", "wavenumber", "wavenumber"),
            Column("simulated", "velocity", "velocity"),
            Column("exact", "velocity_exact", "velocity"),
        ),
        "",
    ),
    "where": (
        "Transmission",
        (
            Column("where", "where"),
            Column("waves", "sector"),
            Column("from", "lower", "frequency", below="lower_open"),
            Column("to", "upper", "frequency", above="upper_open"),
            Column("at", "frequency", "frequency"),
            Column("steady\nwave", "level_at_real_frequency", "level"),
            Column("record:\nsimulated", "level", "level"),
            Column("record:\nexact", "level_exact", "level"),
        ),
        "Steady wave: T of a wave that never ends, exact: the number to take, and what wishes are "
        "held against. A stop band is where it is below −20 dB; an edge past what the run tells of "
        "is marked “or less” or “or more”. A record that ends tells T blurred, at a complex "
        "frequency ω + iσ, where late waves count less: simulated, beside what is exact there. "
        "These two must agree with each other, not with the steady wave's.",
    ),
    "mode": (
        "Eigenfrequencies, the lowest",
        (
            Column("mode", "mode"),
            Column("waves", "sector"),
            Column("simulated", "frequency", "frequency"),
            Column("exact", "frequency_exact", "frequency"),
        ),
        "",
    ),
    "arrival": (
        "First breaks at the farthest receiver",
        (
            Column("arrival", "arrival"),
            Column("field", "field"),
            Column("receiver", "receiver"),
            Column("simulated", "time", "time"),
            Column("ahead", "ahead", "time"),
        ),
        "A precursor comes ahead of the wave that the test is after, of another kind.",
    ),
    "by": (
        "Velocity of the pulse between receivers",
        (
            Column("by", "by"),
            Column("field", "field"),
            Column("simulated", "velocity", "velocity"),
            Column("±", "velocity_error", "error of velocity"),
            Column("exact signals", "velocity_exact", "velocity"),
        ),
        "A velocity depends on what counts as the arrival; exact signals are read in the same way.",
    ),
    "quality": (
        "Q between receivers, its median",
        (
            Column("field", "field"),
            Column("at", "frequency", "frequency"),
            Column("Q", "quality", "number"),
            Column("±", "quality_error", "error of number"),
            Column("law", "quality_exact", "number"),
        ),
        "",
    ),
}


def answers(summary: Summary) -> list[Answer]:
    """What was found, a table for each question that the run answers."""
    found = []
    for rows in summary.get("answers", {}).values():
        name = next((key for key in _LAYOUT if rows and key in rows[0]), None)
        if name is not None:
            title, columns, note = _LAYOUT[name]
            if name == "distance":
                columns += tuple(Column(key, key, "level") for key in [*rows[0]][len(columns) :])
            shown = _once(rows, columns)
            if name == "distance" and len(rows) > _MOST_RECEIVERS:
                title += f", {_MOST_RECEIVERS} of {len(rows)}"
                last = len(rows) - 1
                places = (n * last // (_MOST_RECEIVERS - 1) for n in range(_MOST_RECEIVERS))
                shown = [rows[place] for place in places]
            found.append(Answer(title, columns, shown, _untold(rows, name) + note))
    return found


def _once(rows: Sequence[Row], columns: Sequence[Column]) -> list[Row]:
    """Rows, those once that show the same of both transverse sectors."""
    if "sector" not in rows[0]:
        return list(rows)
    alike: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        same = (c.shown(row) for c in columns if c.key != "sector")
        alike.setdefault((sector_words(row["sector"], ""), *same), []).append(row)
    return [{**own[0], "sector": ", ".join(row["sector"] for row in own)} for own in alike.values()]


def _untold(rows: Sequence[Mapping[str, Any]], name: str) -> str:
    """Why some rows have no measured number, each reason once."""
    why: dict[str, dict[str, None]] = {}
    for row in rows:
        if row.get("untold"):
            why.setdefault(row["untold"], {})[str(row[name])] = None
    told = "; ".join(f"{', '.join(these)}: {reason}" for reason, these in why.items())
    return f"– {told}. " if told else ""


def shown(value: Any, kind: str) -> str:
    """A number of a row in the unit of its kind, or a word; – where there is none."""
    if value is None:
        return "–"
    if kind:
        factor, _, digits = KINDS[kind]
        # Rounded twice, so that 160 is not 1.6e+02; a level of less than 1e-4 dB is 0.
        figure = float(f"{value * factor:.{digits}g}")
        return f"{round(figure, 4) + 0.0 if kind == 'level' else figure:.6g}"
    return sector_words(*str(value).split(", "))


def number(value: float | None) -> str:
    """A number of a check, six digits of it; none where it is no number."""
    if value is None or not math.isfinite(value):
        return "none"
    if value == int(value) and abs(value) < 1e5:
        return f"{value:.0f}"
    return f"{value:.6g}" if 1e-2 <= abs(value) < 1e9 else f"{value:.2e}"


def checked_in(check: Row) -> tuple[float, str]:
    """The factor and the name of the unit in which a check is shown: Hz in kHz, as all else."""
    return KINDS["frequency"][:2] if check["unit"] == "Hz" else (1.0, check["unit"])


def measured_and_allowed(check: Row) -> tuple[str, str]:
    """What was measured where a check fell short, and what was allowed, each with its unit."""
    factor, unit = checked_in(check)
    unit = "" if unit == "–" else f" {unit}"
    measured, reference, tolerance = (
        number(None if check[key] is None else check[key] * factor)
        for key in ("measured", "reference", "tolerance")
    )
    about = f"{reference} ± " if check["reference"] else ""
    return f"{measured}{unit}", f"{about}{tolerance}{unit}"


def verdict(summary: Summary) -> str:
    """The verdict of a run in a sentence; where checks fell short, the name of the first."""
    checks = summary["checks"]
    short = [check for check in checks if not check["passed"]]
    if not checks:
        return "Nothing was checked: the notes say why."
    passed = f"{len(checks) - len(short)} of {len(checks)} checks passed"
    if not short and all(check["name"].startswith("energy") for check in checks):
        return f"{passed}, of energy alone: the notes say why nothing else was checked."
    if not short:
        own = any(check["name"].endswith("beside thirds of the cells") for check in checks)
        other = (
            "itself on cells a third as long: the notes say why" if own else "the exact solution"
        )
        return f"{passed}: the simulation agrees with {other}."
    more = f" and {len(short) - 1} more" if len(short) > 1 else ""
    return f"{passed}; “{short_name(short[0]['name'])}”{more} fell short: see what to change."


def short_name(name: str) -> str:
    """A check's name without what was compared."""
    for mark in (": |", ": difference", " over "):
        name = name.split(mark)[0]
    return name
