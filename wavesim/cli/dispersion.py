"""The commands ``dispersion`` and ``attenuation``: points of a record from anywhere, told of.

Exit codes: 0 all well; 1 a check fell short, or no point is valid; 2 bad input.
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from shutil import move
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import click

from wavesim.cli.arguments import (
    BAND,
    FILES,
    GAINS,
    JSON,
    NOT_NEGATIVE,
    POSITIVE,
    RING,
    SOURCES,
    TIME,
    WRITTEN,
    NumberIn,
    medium_of,
    options,
    print_json,
    record_options,
    write_columns,
    write_json,
    writing,
)
from wavesim.report.terminal import BAD_INPUT, FELL_SHORT, console, new_table, stop
from wavesim.worker import Here, Worker

# So many frequencies are shown; the files have all.
_FEW = 10
_DRAWING = "wavesim.figures.record"
# What both kinds of extraction take.
_OPTIONS = options(
    FILES,
    click.option("--medium", metavar="CASE.toml", help="Lay this case's medium over it."),
    click.option("--sector", default="longitudinal", show_default=True),
    WRITTEN,
    JSON,
    click.option("--fit", "parameters", metavar="NAME,…", help="Fit the medium's parameters."),
    click.option("--quiet-from", type=TIME, help="Time in s or as 20us from which no source acts."),
    SOURCES,
    RING,
    click.option("--lattice", is_flag=True, help="Receivers are all the sites there are."),
    record_options,
)


def _layout(given: dict[str, Any]) -> Any:
    own = {name: given[name] for name in ("quiet_from", "ring", "lattice")}
    return replace(given["layout"], **own, sources=given["places"])


def _extract(given: dict[str, Any], kind: str, **asked: Any) -> None:
    """Read, extract, fit, show, write: what both commands do."""
    from wavesim.records.layout import told_files
    from wavesim.studies.least_squares import FitError

    file = told_files(given["files"])
    drawn = click.get_current_context().with_resource(TemporaryDirectory())
    results = _recovered(file, given, kind, asked, Path(drawn) if given["out"] else None)
    fit = None
    if given["parameters"]:
        start = medium_of(given["medium"], (one.origin for one in results))
        if start is None:
            stop("--fit: needs --medium CASE.toml to start from", BAD_INPUT)
        try:
            fit = _fitted(results, start, [n.strip() for n in given["parameters"].split(",")])
        except FitError as error:
            stop(f"--fit {given['parameters']}: {error}", BAD_INPUT)
    answer = _summary(results, fit)
    if given["as_json"]:
        print_json(answer)
    else:
        _show(results, answer)
    if given["out"]:
        _write(results, answer, kind, Path(given["out"]), Path(drawn))
    if not any(one.points.valid.any() for one in results):
        from wavesim.readings.dispersion.fft_peaks import BROAD
        from wavesim.readings.dispersion.simplest_waves import QUIET

        # Frequencies beside the signal's are quiet in every record: others tell more.
        reasons = [r for one in results for r in one.points.reason if r not in ("", QUIET)]
        why = max(set(reasons), key=reasons.count, default=BROAD if kind == "dispersion" else QUIET)
        stop(f"{file}: no valid point: {why}", FELL_SHORT)
    if not answer["passed"]:
        sys.exit(FELL_SHORT)


def _recovered(
    file: str, given: dict[str, Any], kind: str, asked: dict[str, Any], drawn: Path | None
) -> list[Any]:
    """Waves of a record, or of each sector of a run; while one is read the last one is drawn."""
    from wavesim.planewave.dispersion_relation import NotHyperbolicError
    from wavesim.records.faults.finding import left_out
    from wavesim.records.files import own_result
    from wavesim.records.of_medium import of_files, sectors
    from wavesim.records.record import RecordError
    from wavesim.report.progress import working

    files, draw = given["files"], Here().ask
    if len(files) == 1 and (path := own_result(files[0])):
        if drawn:
            # By the process itself, one after the other: what it drew helps it with the next.
            draw = click.get_current_context().with_resource(Worker()).prepare
            draw("importlib.import_module", _DRAWING)
        origins = sectors(path, travelling=kind == "attenuation")
    else:
        medium = medium_of(given["medium"])
        origins = iter([of_files(files, _layout(given), medium, given["sector"])])
    from wavesim.verdict import record  # takes a while, and the worker loads in the meantime

    work = record.attenuation if kind == "attenuation" else record.dispersion
    results, drawings = [], []
    with working("reading waves off the record"):
        for origin in origins:
            try:
                found = work([origin], **asked)
            except (RecordError, NotHyperbolicError) as error:
                stop("; ".join([f"{file}: {error}", *left_out(origin.record.findings)]), BAD_INPUT)
            if drawn:
                drawings.append(draw(f"{_DRAWING}.write", found, drawn))
            results += [one.without_values() for one in found]
        for one in drawings:
            one.result()
    return results


def _fitted(results: Sequence[Any], start: Any, parameters: Sequence[str]) -> Any:
    """Parameters of the medium that the points tell of."""
    from wavesim.studies.medium_fit import Observed, fit

    observed = [
        Observed(
            one.origin.block,
            one.points,
            one.origin.bar,
            math.hypot(one.origin.record.interval_error, one.origin.record.spacing_error),
        )
        for one in results
        if one.origin.block is not None
    ]
    return fit(observed, start, parameters)


def _summary(results: Sequence[Any], fit_of: Any = None) -> dict[str, Any]:
    """All that was found as one object for JSON, SI units, NaN as null."""
    from wavesim.material.shown import plain
    from wavesim.verdict.record import checks
    from wavesim.verdict.recovered_points import Matched

    entries = []
    for one in results:
        points, record = one.points, one.origin.record
        entry: dict[str, Any] = {
            "name": one.origin.name,
            "method": points.method,
            "frames": len(record.t),
            "receivers": len(record.x),
            "notes": list(record.notes),
            "branches": len(points.branches),
            "points": {n: plain(column) for n, column in points.columns().items()},
        }
        if isinstance(one.matched, Matched):
            entry["waves"] = one.matched.rows()
            entry["false_points"] = len(one.matched.false_k)
        elif one.matched is not None:
            entry["error_grid"] = plain(one.matched.error(False))
            entry["error_continuum"] = plain(one.matched.error(True))
        if one.score is not None:
            entry["score"] = one.score.row()
        entries.append(entry)
    found = checks(results)
    answer: dict[str, Any] = {
        "records": entries,
        "checks": [check.row() for check in found],
        "passed": all(check.passed for check in found)
        and any(one.points.valid.any() for one in results),
    }
    if fit_of is not None:
        answer["fit"] = {
            "values": fit_of.values,
            "standard_errors": fit_of.errors,
            "chi_square": fit_of.chi_square,
            "points": fit_of.points,
        }
    return answer


def _show(results: Sequence[Any], answer: dict[str, Any]) -> None:
    from wavesim.material.shown import with_error
    from wavesim.readings.dispersion.points import METHODS
    from wavesim.report.tables import show_short

    shown = console()
    for one, entry in zip(results, answer["records"], strict=True):
        points = one.points
        shown.print(
            f"{entry['name']}: {entry['frames']} frames, {entry['receivers']} receivers; "
            f"{int(points.valid.sum())} of {len(points)} points valid"
        )
        branches = _count(entry["branches"], "branch", "branches")
        shown.print(f"  {branches}, {METHODS[points.method]}")
        for note in entry["notes"]:
            shown.print(f"  Note: {note}.")
        if (near := _splitting(points)) is not None:
            shown.print(f"  {near}.")
        for reason in dict.fromkeys(r for r in points.reason if r):
            shown.print(f"  {int((points.reason == reason).sum())} refused: {reason}.")
        if entry.get("waves"):
            shown.print(_waves(entry["waves"], one.origin.bar is not None))
        elif points.in_space and points.valid.any():
            shown.print(_decays(points.take(points.valid)))
            sigma = float(max(points.omega.imag, default=0.0))
            if sigma > 0:
                shown.print(f"Read at ω + iσ, σ = {sigma:.4g} 1/s: by σ/v_g more than is lost.")
        else:
            _show_branches(shown, points)
        if one.score is not None:
            shown.print(f"  {one.score.said()}.")
    if answer["checks"]:
        short, count = [c for c in answer["checks"] if not c["passed"]], len(answer["checks"])
        shown.print(f"{count - len(short)} of {count} checks against the medium passed.")
        show_short(shown, short)
    if "fit" in answer:
        fit = answer["fit"]
        for name, value in fit["values"].items():
            bar = 1.96 * fit["standard_errors"][name]
            shown.print(f"{name} = {with_error(value, bar)} (95 %)")
        shown.print(f"χ² per degree of freedom {fit['chi_square']:.3g}, {fit['points']} numbers")


def _splitting(points: Any) -> str | None:
    """How near to each other two waves pass for one, where the bars do not hold that."""
    if points.splitting is None or points.method not in ("harmonic", "space"):
        return None
    own = points.take(points.valid)
    if not (apart := [s for s in own.splitting if math.isfinite(s)]):
        return None
    size, unit = (own.k, "rad/m of k") if points.in_space else (own.omega, "rad/s of ω")
    middle = median(apart)
    part = 100 * middle / median(abs(size))
    return f"Two waves within {middle:.2g} {unit} ({part:.2g} %) pass for one, beyond its bar"


def _count(number: int, one: str, more: str) -> str:
    return f"{number} {one if number == 1 else more}"


def _waves(rows: Sequence[dict[str, Any]], on_grid: bool) -> Any:
    """Each wave: where found, |Δω|/ω against the continuum and, of a simulated field, its grid."""
    kinds = ("grid", "continuum") if on_grid else ("continuum",)
    of = [f"\n{kind}" if on_grid else "" for kind in kinds]
    errors = [text for kind in of for text in (f"|Δω|/ω{kind}\nmedian", f"{kind}\nlargest")]
    table = new_table("wave", "found", "missed", *errors, "in 95 %\nbar")
    table.padding = (0, 0)  # no wider than 80 columns
    for row in rows:
        inside = row["within_bar"]
        numbers = [row[f"{part}_{kind}"] for kind in kinds for part in ("median", "largest")]
        table.add_row(
            row["wave"],
            f"{row['found']} of {row['present']}",
            str(row["missed"]),
            *("–" if n is None else f"{n:.1e}" for n in numbers),
            "–" if inside is None else f"{100 * inside:.0f} %",
        )
    return table


def _show_branches(shown: Any, points: Any) -> None:
    from wavesim.material.shown import HERTZ

    longest = Counter(points.branch[points.branch >= 0].tolist()).most_common()
    for branch, number in sorted(longest[:_FEW]):
        own = points.take(points.branch == branch)
        f, k, many = own.omega * HERTZ, own.k, _count(number, "point", "points")
        text = f"{f.min():.5g} to {f.max():.5g} Hz over k {k.min():.4g} to {k.max():.4g} rad/m, "
        text += f"median 95 % bar {median(own.bar / own.omega):.1e} of ω"
        shown.print(f"  branch {branch + 1}: {many}, {text}")
    if rest := longest[_FEW:]:
        shown.print(f"  and {len(rest)} more, of {rest[0][1]} points at most")


def _decays(own: Any) -> Any:
    """Complex wavenumbers over frequency, no more than a few of them."""
    from wavesim.material.shown import DECIBELS, in_frequency, in_wavenumber

    to_f, hertz = in_frequency(own.omega.real.max())
    to_k, length = in_wavenumber(abs(own.k).max())
    table = new_table(f"frequency\n{hertz}", f"Im k\ndB/{length}", f"Re k\nrad/{length}",
                      "95 % bar\nof |k|", f"one of\n{len(own)}", words=0)  # fmt: skip
    for n in range(0, len(own), max(1, -(-len(own) // _FEW))):
        k, at = complex(own.k[n]), f"{to_f * own.omega[n].real:.5g}"
        size = f"{own.bar[n] / abs(k):.1e}" if k else "–"
        loss, real = f"{to_k * DECIBELS * k.imag:.4g}", f"{to_k * k.real:.4g}"
        table.add_row(at, loss, real, size, str(n + 1))
    return table


def _write(found: Any, answer: dict[str, Any], kind: str, folder: Path, drawn: Path) -> None:
    with writing(folder):
        write_json(folder / f"{kind}.json", answer, indent=None)
        for one in found:
            write_columns(folder / f"{kind}_{one.origin.label}.csv", one.points.columns())
        for figure in drawn.iterdir():
            move(figure, folder / figure.name)


@click.command(short_help="Branches ω(k) of a space-time record.")
@_OPTIONS
@click.option(
    "--method", type=click.Choice(("auto", "harmonic", "fft")), default="auto", show_default=True
)
@click.option("--k-max", type=POSITIVE, help="Highest wavenumber, rad/m.")
@click.option("--most", type=click.IntRange(1, 40), default=12, help="Most waves at one k.")
@click.option("--undamped", is_flag=True, help="Hold every decay in time to 0.")
def dispersion(method: str, k_max: float | None, most: int, undamped: bool, **given: Any) -> None:
    """Branches ω(k) of the record FILE: a run, or what `wavesim inspect` reads."""
    options = {"method": method, "k_max": k_max, "most": most, "damped": not undamped}
    _extract(given, "dispersion", **options)


@click.command(short_help="Complex k(ω) of a record, in bands and gaps.")
@_OPTIONS
@BAND
@click.option("--frequencies", type=click.IntRange(1, 4096), default=40, show_default=True)
@click.option("--damping", type=NumberIn(4, 30), help="σT of the exponential window; by the noise.")
@click.option("--pairs", type=click.IntRange(1, 2), default=1, help="Most pairs ±k sought.")
@click.option("--clear", type=NOT_NEGATIVE, help="Distance to keep from sources, m.")
@click.option("--spreading", type=click.Choice(("plane", "cylindrical", "spherical")),
              default="plane", help="How waves spread from --source; plane: not.")  # fmt: skip
@GAINS
def attenuation(**given: Any) -> None:
    """Complex k(ω), in bands and gaps, of the record FILE: a run, or what `inspect` reads."""
    own = ("band", "frequencies", "damping", "pairs", "clear", "spreading", "gain_error")
    _extract(given, "attenuation", **{name: given.pop(name) for name in own})
