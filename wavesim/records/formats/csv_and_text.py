"""Tables of text: their times, values, and where the receivers stand."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.axes import INTERVALS, RATES, STARTS
from wavesim.records.content import Content, RecordError
from wavesim.records.evenness import unrounded
from wavesim.records.faults.clock import on_one_clock
from wavesim.records.formats.clock_columns import clocks_of, counted_on, counts_rows
from wavesim.records.formats.text_table import Table, read_table
from wavesim.records.units import (
    NUMBER,
    factor,
    is_time,
    position_in,
    size_of_values,
    unit_in,
    unit_of_time_said,
    unknown_unit_in,
)


def from_text(path: Path) -> Content:
    """Times, values and positions of a table of text."""
    return of_table(read_table(path))


def of_table(table: Table) -> Content:
    """Times, values and positions of a table.

    Raises:
        RecordError: no column is a clock.
    """
    notes = list(table.notes)
    kept = list(range(table.data.shape[1]))
    sampling = sampling_of(table.metadata)
    counted = False
    if len(kept) > 1 and counts_rows(table, kept, sampling is not None):
        notes.append(f"column {table.columns[kept[0]]} numbers the rows: left out")
        kept, counted = kept[1:], True
    notes += counted_on(table, kept)
    clocks = clocks_of(table, kept, counted)
    channels = [c for c in kept if c not in clocks]
    if not channels:
        raise RecordError(
            "holds times alone: no column of values stands beside them; give one for each receiver"
        )
    arrays: dict[str, NDArray[Any]] = {"values": table.data[:, channels]}
    units: dict[str, str] = {}
    said_in: dict[str, str] = {}
    settled: set[str] = set()
    if clocks:
        first = clocks[0]
        _check_time(table, first)
        arrays["t"] = table.data[:, first]
        _check_long(table, arrays["t"], channels)
        heading = _unit_of(table, first)
        unit = heading or table.units[first]
        if factor(unit, "time") is not None:
            units["t"] = unit
            text = table.headings[first].strip() if heading else unit
            said_in["t"] = f"row {table.rows[0 if heading else 1]} ({text[:40]!r})"
        elif unit or (unit := unknown_unit_in(table.headings[first]) or ""):
            units["t"] = unit
        elif above := _unit_above(table.metadata):
            units["t"], said_in["t"] = above
        if first in table.dated:
            settled.add("t")
        if sampling is not None:
            scale = factor(units.get("t", ""), "time") or 1.0
            if unrounded(arrays, sampling[0] / scale):
                notes.append(f"times are rounded so that they repeat: taken by {sampling[2]}")
        if len(clocks) > 1:
            notes += _one_clock(table, clocks, channels, arrays)
    elif sampling is not None and (np.isfinite(sampling[1]) or len(channels) > 1):
        # Of one channel alone nothing is known but when it came.
        interval, start, said, sure = sampling
        if not np.isfinite(start):
            start, said = 0.0, f"{said}; the first is taken as 0"
        arrays["t"] = start + interval * np.arange(len(table.data))
        if sure:
            settled.add("t")
        notes.append(f"times by {said}")
    notes += _of_one_size(arrays["values"], table, channels)
    labels = [table.headings[c].strip() or f"column {table.columns[c]}" for c in channels]
    labels = [
        label if labels.count(label) == 1 else f"{label} (column {table.columns[c]})"
        for label, c in zip(labels, channels, strict=True)
    ]
    overload = {label: table.overload[c] for label, c in zip(labels, channels, strict=True)
                if table.overload[c]}  # fmt: skip
    columns = tuple(table.columns[c] for c in channels)
    found = Content(arrays, units, tuple(labels), columns, notes, overload, said_in=said_in,
                    settled=settled)  # fmt: skip
    _positions(found, table, channels)
    return found


def _of_one_size(values: NDArray[Any], table: Table, channels: list[int]) -> list[str]:
    """Columns in V and mV, put in the unit of the first."""
    said = [size_of_values(table.headings[c], table.units[c]) for c in channels]
    known = [one for one in said if one is not None]
    if len(known) < len(said) or len(set(known)) < 2 or len({of for of, _ in known}) > 1:
        return []
    values *= np.array([size for _, size in known]) / known[0][1]
    return [f"columns differ in their unit of {known[0][0]}: all put in that of the first"]


_NO_TIME = re.compile(r"(freq|frequenz|fréquence|wavenumber|wavelength)", re.IGNORECASE)


def _check_time(table: Table, clock: int) -> None:
    """Refuse a first column of frequencies or places, by its name or its unit."""
    heading, unit = table.headings[clock].strip(), table.units[clock]
    if is_time(heading) or factor(unit, "time") is not None or unit_in(heading, "time"):
        return
    kinds = {"frequency": "frequencies", "position": "places"}
    what = next((w for k, w in kinds.items() if unit_in(heading, k) or factor(unit, k)), "")
    if what or _NO_TIME.match(heading):
        raise RecordError(
            f"column {table.columns[clock]} ({heading[:40]!r}) holds {what or 'no times'}: a row "
            "for each time is needed, and a column for each receiver"
        )


def _check_long(table: Table, t: NDArray[Any], channels: list[int]) -> None:
    """Refuse a row for each time and place."""
    places = next(
        (c for c in channels if _OF_PLACES.match(table.headings[c].strip(' "').replace("_", " "))),
        None,
    )
    if places is not None and 2 * len(np.unique(t)) <= len(t):
        raise RecordError(
            f"column {table.columns[places]} ({table.headings[places].strip()[:40]!r}) holds "
            "places, and each time stands in several rows: a row for each time is needed, and a "
            "column for each receiver"
        )


def _unit_above(rows: list[list[str]]) -> tuple[str, str] | None:
    """The unit of time that a row or a comment says, and which."""
    for row in rows:
        text = ", ".join(cell.strip() for cell in row if cell.strip())
        if unit := unit_of_time_said(text):
            return unit, f"{text[:40]!r} above the numbers"
    return None


# What only rows above numbers mean by these.
_INTERVALS = (*INTERVALS, "increment", "clock")
_STARTS = (*STARTS, "x0", "start", "t0")
_VALUE = re.compile(rf"({NUMBER})\s*([^\W\d_]*(?:/s)?)$")


def sampling_of(rows: list[list[str]]) -> tuple[float, float, str, bool] | None:
    """Interval and start, s, that rows above the numbers say, in which words, and whether their
    unit is said; or None.

    As a name with its number beside it, below it, or behind = or :, such as "Sample Interval,2E-6",
    "Sample Interval,2,us", "#CLOCK=2uS", "X0"; the start is NaN where none is said.
    """
    rows = [re.split(r"[,;\t]", row[0]) if len(row) == 1 else row for row in rows]
    interval, start, said, began, words, sure = 0.0, math.nan, "", "", "", False
    for row, below in zip(rows, [*rows[1:], []], strict=False):
        for j, cell in enumerate(row):
            name, _, own = re.sub("[=:]", "=", cell).partition("=")
            name = name.strip(' #%"')
            key = re.sub(r"[^a-z0-9]", "", re.split(r"[(\[]", name.lower())[0])
            near = [own, *row[j + 1 : j + 2], *below[j : j + 1]]
            values = (_VALUE.match(_bare(part)) for part in near)
            value = next((found for found in values if found), None)
            if value is None:
                continue
            number, rate = float(value.group(1)), key in RATES
            unit = value.group(2) or unit_in(name, "frequency" if rate else "time") or ""
            if not unit and row[j + 2 : j + 3] and value.string == _bare(row[j + 1]):
                beside = _bare(row[j + 2])  # number and unit in a cell each
                unit = beside if factor(beside, "frequency" if rate else "time") else ""
            seconds = number * (factor(unit or "s", "time") or math.nan)
            if rate and number > 0:
                seconds = 1 / number / (factor(unit or "Hz", "frequency") or math.nan)
            # "Start" may count samples where an origin stands beside it.
            if key in _STARTS and math.isfinite(seconds) and began in ("", "start"):
                start, began, words = seconds, key, f" and {name} = {seconds:g} s"
            elif key in (*_INTERVALS, *RATES) and seconds > 0 and not said:
                interval, said = seconds, f"{name} of the file, {seconds:g} s apart"
                sure = bool(unit) or rate
    return (interval, start, said + words, sure) if said else None


def _bare(cell: str) -> str:
    return cell.strip(' "').replace(",", ".")


def _one_clock(
    table: Table, clocks: list[int], channels: list[int], arrays: dict[str, NDArray[Any]]
) -> list[str]:
    """Channels with clocks of their own, put on one."""
    text = f"{len(clocks)} columns are clocks, not receivers"
    before = [max((k for k in clocks if k < c), default=clocks[0]) for c in channels]
    unit = _seconds_of(table, clocks[0])
    own = [table.data[:, k] * (_seconds_of(table, k) / unit) for k in before]
    values, t, _, said = on_one_clock(arrays["values"][None], np.stack(own, axis=1))
    if not said:
        return [text]
    arrays["values"], arrays["t"] = values[0], t
    return [f"{text}; channels put on one: {said}"]


def _seconds_of(table: Table, clock: int) -> float:
    """Unit of a column of times, s; 1 where none is said."""
    return factor(_unit_of(table, clock) or table.units[clock], "time") or 1.0


def _unit_of(table: Table, clock: int) -> str | None:
    """The unit of time that a column's heading says, or is."""
    heading = table.headings[clock].strip(" ()[]")
    alone = heading if factor(heading, "time") is not None else None
    return unit_in(table.headings[clock], "time") or alone


def _positions(found: Content, table: Table, channels: list[int]) -> None:
    """Positions that headings say, or a row of them above the numbers."""
    said = [position_in(table.headings[c]) for c in channels]
    first = next((n for n, s in zip(found.labels, said, strict=True) if s), "")
    where = f"the heading {first[:40]!r}"
    if not any(said):
        said, where = _row_of_positions(table, channels)
    if not any(said):
        return
    keep = [j for j, s in enumerate(said) if s is not None]
    out = [j for j, s in enumerate(said) if s is None]
    found.place([s for s in said if s is not None], where)
    found.unplaced = {found.labels[j]: found.arrays["values"][:, j] for j in out}
    found.unplaced_columns = {found.labels[j]: found.columns[j] for j in out}
    found.arrays["values"] = found.arrays["values"][:, keep]
    found.labels = tuple(found.labels[j] for j in keep)
    found.columns = tuple(found.columns[j] for j in keep)


_OF_PLACES = re.compile(r"(x|pos(itions?)?|offsets?|dist(ance)?|depths?)\b[^\d]*$", re.I)


def _row_of_positions(
    table: Table, channels: list[int]
) -> tuple[list[tuple[float, str | None] | None], str]:
    """Numbers in a row or a comment named "x (m)" or "depth [mm]", or headings under a corner
    t_s/x_m, and which row says so."""
    for row in (*table.above, *table.metadata):
        cells = [cell.strip(" ,").replace(",", ".") for cell in row]
        name, *listed = re.split(rf"[\s:=]+(?={NUMBER}(?:\s|$))", " ".join(cells).strip())
        corner = name if len(listed) == len(channels) else (cells or [""])[0]
        corner_of_both = re.search(r"[/\\|]\s*(x|position|offset)\b.*$", corner, re.I)
        if not (_OF_PLACES.match(corner.replace("_", " ")) or corner_of_both):
            continue
        unit = unit_in(corner_of_both.group() if corner_of_both else corner, "position")
        try:
            own = listed if corner == name else [cells[table.columns[c] - 1] for c in channels]
            numbers = [float(one) for one in own]
        except (ValueError, IndexError):
            continue
        if unit is not None and len(set(numbers)) == len(numbers):
            return [(n, unit) for n in numbers], f"the row {corner[:40]!r}"
    return [None] * len(channels), ""
