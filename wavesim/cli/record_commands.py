"""Commands for records from anywhere: dispersion, attenuation, synthesize.

Exit codes: 0 all well; 1 a check fell short; 2 bad input.
"""

from __future__ import annotations

import csv
import importlib.util
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from wavesim.cli.record_options import record_options
from wavesim.report.terminal import BAD_INPUT, FELL_SHORT, console, stop


def _options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Options that both kinds of extraction take."""
    given = [
        click.argument("file", type=click.Path()),
        click.option("--medium", metavar="CASE.toml", help="Lay this case's medium over it."),
        click.option("--sector", default="longitudinal", show_default=True),
        click.option("--out", type=click.Path(), help="Folder for points, numbers and figures."),
        click.option("--json", "as_json", is_flag=True, help="Print one JSON object."),
        click.option("--fit", "parameters", metavar="NAME,…", help="Fit the medium's parameters."),
        click.option("--quiet-from", type=float, help="Time in s from which no source acts."),
        click.option("--source", "places", type=float, multiple=True, help="Position in m."),
        click.option("--ring", is_flag=True, help="Receivers go evenly round a periodic bar."),
        click.option("--lattice", is_flag=True, help="Receivers are all the sites there are."),
    ]
    function = record_options(function)
    for option in reversed(given):
        function = option(function)
    return function


def _layout(options: dict[str, Any]) -> Any:
    own = {name: options[name] for name in ("quiet_from", "ring", "lattice")}
    return replace(options["layout"], **own, sources=options["places"])


def _medium(case: str | None, sources: Sequence[Any] = ()) -> Any:
    if case is None:
        return next((s.medium for s in sources if s.medium is not None), None)
    from wavesim.case.load import load
    from wavesim.case.schema import CaseError

    try:
        return load(case).simulation.medium
    except CaseError as error:
        stop(str(error), BAD_INPUT)


def _extract(options: dict[str, Any], work: Callable[[Any], Any]) -> None:
    """Read, extract, fit, show, write: what both commands do."""
    from wavesim.cli import record_work
    from wavesim.planewave.dispersion_relation import NotHyperbolicError
    from wavesim.records.of_medium import of_file
    from wavesim.records.record import RecordError
    from wavesim.studies.medium_fit import FitError

    file = options["file"]
    try:
        medium = _medium(options["medium"])
        found = of_file(Path(file), _layout(options), medium, options["sector"])
    except RecordError as error:
        stop(str(error), BAD_INPUT)
    fit = None
    try:
        results = work(found)
        if options["parameters"]:
            start = _medium(options["medium"], found)
            if start is None:
                stop("--fit: needs --medium CASE.toml to start from", BAD_INPUT)
            names = [name.strip() for name in options["parameters"].split(",")]
            fit = record_work.fitted(results, start, names)
    except (RecordError, NotHyperbolicError) as error:
        stop(f"{file}: {error}", BAD_INPUT)
    except FitError as error:
        stop(f"--fit {options['parameters']}: {error}", BAD_INPUT)
    answer = record_work.summary(results, fit)
    if options["as_json"]:
        click.echo(json.dumps(answer, ensure_ascii=False))
    else:
        _show(results, answer)
    if options["out"]:
        _write(results, answer, Path(options["out"]))
    if not answer["passed"]:
        sys.exit(FELL_SHORT)


def _show(results: Sequence[Any], answer: dict[str, Any]) -> None:
    from wavesim.report.tables import show_checks

    shown = console()
    for one, entry in zip(results, answer["records"], strict=True):
        points = one.points
        shown.print(
            f"{entry['name']}: {entry['frames']} frames, {entry['receivers']} receivers; "
            f"{int(points.valid.sum())} of {len(points)} points valid, "
            f"{entry['branches']} branches ({points.method})"
        )
        for note in entry["notes"]:
            shown.print(f"  Note: {note}.")
        for reason in dict.fromkeys(r for r in points.reason if r):
            shown.print(f"  {int((points.reason == reason).sum())} refused: {reason}.")
        if entry.get("waves"):
            shown.print(_waves(entry["waves"], one.origin.bar is not None))
        elif not entry.get("error_grid"):
            _show_branches(shown, points)
        if one.score is not None:
            shown.print(f"  {one.score.said()}.")
    if answer["checks"]:
        show_checks(shown, answer["checks"])
    if "fit" in answer:
        fit = answer["fit"]
        for name, value in fit["values"].items():
            bar = 1.96 * fit["standard_errors"][name]
            shown.print(f"{name} = {value:.9g} ± {bar:.2g} (95 %)")
        shown.print(f"χ² per degree of freedom {fit['chi_square']:.3g}, {fit['points']} numbers")


def _waves(rows: Sequence[dict[str, Any]], on_grid: bool) -> Any:
    """Each wave: where found, |Δω|/ω against the continuum and, of a simulated field, its grid."""
    from rich import box
    from rich.table import Table

    kinds = ("grid", "continuum") if on_grid else ("continuum",)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("wave", "found", "missed"):
        table.add_column(heading, justify="left" if heading == "wave" else "right", no_wrap=True)
    for kind in kinds:
        where = f"\n{kind}" if on_grid else ""
        table.add_column(f"|Δω|/ω{where}\nmedian", justify="right", no_wrap=True)
        table.add_column(f"{where}\nlargest", justify="right", no_wrap=True)
    table.add_column("in 95 %\nbar", justify="right", no_wrap=True)
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
    for branch in points.branches:
        own = points.take(points.branch == branch)
        if points.in_space:
            text = (f"|k| {abs(own.k).min():.4g} to {abs(own.k).max():.4g} rad/m, median 95 % bar "
                    f"{_median(own.bar / abs(own.k)):.1e} of |k|")  # fmt: skip
        else:
            hertz = own.omega / 6.283185307179586
            text = (f"{hertz.min():.5g} to {hertz.max():.5g} Hz over k {own.k.min():.4g} to "
                    f"{own.k.max():.4g} rad/m, median 95 % bar {_median(own.bar / own.omega):.1e}"
                    " of ω")  # fmt: skip
        shown.print(f"  branch {branch + 1}: {len(own)} points, {text}")


def _median(values: Any) -> float:
    return float(sorted(values)[len(values) // 2])


def _write(results: Sequence[Any], answer: dict[str, Any], folder: Path) -> None:
    from wavesim.figures.record import write

    kind = "attenuation" if results[0].points.in_space else "dispersion"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(answer, ensure_ascii=False)
        (folder / f"{kind}.json").write_text(text + "\n", encoding="utf-8")
        for one in results:
            columns = one.points.columns()
            path = folder / f"{kind}_{one.origin.label}.csv"
            with path.open("w", newline="", encoding="utf-8") as file:
                table = csv.writer(file)
                table.writerow(columns)
                table.writerows(zip(*columns.values(), strict=True))
        write(results, folder)
    except OSError as error:
        stop(f"--out {folder}: can't be written: {error.strerror}", BAD_INPUT)


@click.command()
@_options
@click.option(
    "--method", type=click.Choice(("auto", "harmonic", "fft")), default="auto", show_default=True
)
@click.option("--k-max", type=float, help="Highest wavenumber, rad/m.")
@click.option("--most", type=click.IntRange(1, 40), default=12, help="Most waves at one k.")
@click.option("--undamped", is_flag=True, help="Hold every decay in time to 0.")
def dispersion(method: str, k_max: float | None, most: int, undamped: bool, **given: Any) -> None:
    """Branches ω(k) of the space-time record FILE: result.h5, other HDF5, NPZ or CSV."""

    def work(found: Any) -> Any:
        from wavesim.verdict import record

        return record.dispersion(found, method, k_max, most=most, damped=not undamped)

    _extract(given, work)


@click.command()
@_options
@click.option("--band", type=float, nargs=2, help="Lowest and highest frequency, Hz.")
@click.option("--frequencies", type=click.IntRange(1, 4096), default=40, show_default=True)
@click.option("--damping", type=click.FloatRange(4, 30),
              help="σT of the exponential window; by the noise where not given.")  # fmt: skip
@click.option("--pairs", type=click.IntRange(1, 2), default=1, help="Most pairs ±k sought.")
@click.option("--clear", type=float, help="Distance to keep from sources, m.")
@click.option("--spreading", type=click.Choice(("plane", "cylindrical", "spherical")),
              default="plane", help="How waves spread from --source; plane: not.")  # fmt: skip
def attenuation(
    band: tuple[float, float] | None,
    frequencies: int,
    damping: float | None,
    pairs: int,
    clear: float | None,
    spreading: str,
    **given: Any,
) -> None:
    """Complex k(ω) of the record FILE, in bands and gaps: result.h5, other HDF5, NPZ or CSV."""
    if band is not None and not 0 < band[0] < band[1]:
        stop(f"--band {band[0]:g} {band[1]:g}: must ascend, from above 0 Hz", BAD_INPUT)

    def work(found: Any) -> Any:
        from wavesim.verdict import record

        return record.attenuation(found, band, frequencies, damping, pairs, clear, spreading)

    _extract(given, work)


def _relation(medium: str | None, sector: str, function: str | None) -> Any:
    if (medium is None) == (function is None):
        stop("give either --medium CASE.toml or --relation FILE.py:NAME, one of the two", BAD_INPUT)
    if medium is not None:
        from wavesim.records.relations import OfMedium

        made = _medium(medium)
        try:
            return OfMedium(made, made.family.blocks_of(sector)[0])
        except ValueError as error:
            stop(f"--sector: {error}", BAD_INPUT)
    assert function is not None
    file, _, name = function.rpartition(":")
    if not file or not Path(file).is_file():
        stop(f"--relation {function}: must be FILE.py:NAME of a file that is there", BAD_INPUT)
    spec = importlib.util.spec_from_file_location("relation", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
        return getattr(module, name)
    except Exception as error:
        stop(f"--relation {function}: {type(error).__name__}: {error}", BAD_INPUT)


@click.command()
@click.argument("file", type=click.Path())
@click.option("--medium", metavar="CASE.toml", help="Waves of this case's medium …")
@click.option("--sector", default="longitudinal", show_default=True)
@click.option("--relation", metavar="FILE.py:NAME", help="… or of a function ω(k) of your own.")
@click.option("--receivers", type=click.IntRange(2, 65536), default=48, show_default=True)
@click.option("--spacing", type=float, required=True, help="Between receivers, m.")
@click.option("--first", type=float, default=0.0, help="Position of the first, m.")
@click.option("--duration", type=float, required=True, help="s")
@click.option("--samples", type=click.IntRange(16, 1_000_000), required=True)
@click.option("--peak-frequency", type=float, required=True, help="Of the Ricker pulse, Hz.")
@click.option("--source", type=float, default=0.0, help="Its position, m.")
@click.option("--width", type=float, default=0.0, help="Standard deviation in x, m; 0 a point.")
@click.option("--length", type=float, help="Of the ring, m; far longer than the record else.")
@click.option("--ring", is_flag=True, help="Receivers go round the whole ring.")
@click.option("--k-max", type=float, help="Highest wavenumber in it, rad/m.")
@click.option("--noise", type=float, default=0.0, help="Over the peak, –.")
@click.option("--jitter", type=float, default=0.0, help="Of the times, s.")
@click.option("--misplacement", type=float, default=0.0, help="Of the receivers, m.")
@click.option("--dead", type=int, default=0, help="Receivers that give nothing.")
@click.option("--bits", type=int, default=0, help="Of the digitiser.")
@click.option("--seed", type=int, default=0)
def synthesize(file: str, medium: str | None, sector: str, relation: str | None, **o: Any) -> None:
    """Write a record of known truth to FILE (.npz with the truth, or .csv)."""
    waves = _relation(medium, sector, relation)
    import numpy as np

    from wavesim.records import synthetic
    from wavesim.records.files import write
    from wavesim.records.record import RecordError

    for name in ("spacing", "duration", "peak_frequency"):
        if not o[name] > 0:
            stop(f"--{name.replace('_', '-')} {o[name]:g}: must be greater than 0", BAD_INPUT)
    try:
        x = synthetic.positions(o["receivers"], o["spacing"], o["first"])
        t = np.linspace(0, o["duration"], o["samples"])
        spoil = synthetic.Spoil(
            o["noise"], o["jitter"], o["misplacement"], o["dead"], o["bits"], o["seed"]
        )
        length = o["receivers"] * o["spacing"] if o["ring"] else o["length"]
        if length is None:
            length = 16 * max(float(np.ptp(x)), abs(o["source"] - o["first"]), o["spacing"])
        pulse = synthetic.Pulse(o["peak_frequency"], o["source"], width=o["width"])
        made = synthetic.synthesize(waves, t, x, pulse, length, o["k_max"], spoil, ring=o["ring"])
        write(file, made)
    except RecordError as error:
        stop(str(error), BAD_INPUT)
    click.echo(f"{file}: {len(made.t)} frames, {len(made.x)} receivers")


COMMANDS = (dispersion, attenuation, synthesize)
