"""The commands ``inspect``, ``synthesize`` and ``score``: of records and their truth."""

from __future__ import annotations

import importlib.util
import math
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from wavesim.cli.arguments import (
    FILES,
    INPUT,
    JSON,
    NOT_NEGATIVE,
    NUMBER,
    POSITIVE,
    RING,
    SOURCES,
    medium_of,
    print_json,
    record_options,
    write_json,
    write_table,
    writing,
)
from wavesim.report.terminal import BAD_INPUT, FELL_SHORT, console, new_table, stop


def _relation(medium: str | None, sector: str, function: str | None) -> Any:
    if (medium is None) == (function is None):
        stop("give either --medium CASE.toml or --relation FILE.py:NAME, one of the two", BAD_INPUT)
    if medium is not None:
        from wavesim.records.relations import OfMedium

        made = medium_of(medium)
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


@click.command(short_help="Write a record of known truth.")
@click.argument("file", type=click.Path())
@click.option("--medium", metavar="CASE.toml", help="Waves of this case's medium …")
@click.option("--sector", default="longitudinal", show_default=True)
@click.option("--relation", metavar="FILE.py:NAME", help="… or of a function ω(k) of your own.")
@click.option("--receivers", type=click.IntRange(2, 65536), default=48, show_default=True)
@click.option("--spacing", type=POSITIVE, required=True, help="Between receivers, m.")
@click.option("--first", type=NUMBER, default=0.0, help="Position of the first, m.")
@click.option("--duration", type=POSITIVE, required=True, help="s")
@click.option("--samples", type=click.IntRange(16, 1_000_000), required=True)
@click.option("--peak-frequency", type=POSITIVE, required=True, help="Of the Ricker pulse, Hz.")
@click.option("--source", type=NUMBER, default=0.0, help="Its position, m.")
@click.option(
    "--width", type=NOT_NEGATIVE, default=0.0, help="Standard deviation in x, m; 0 a point."
)
@click.option("--length", type=POSITIVE, help="Of the ring, m; far longer than the record else.")
@click.option("--ring", is_flag=True, help="Receivers go round the whole ring.")
@click.option("--k-max", type=POSITIVE, help="Highest wavenumber in it, rad/m.")
@click.option("--noise", type=NOT_NEGATIVE, default=0.0, help="Over the peak, –.")
@click.option("--jitter", type=NOT_NEGATIVE, default=0.0, help="Of the times, s.")
@click.option("--misplacement", type=NOT_NEGATIVE, default=0.0, help="Of the receivers, m.")
@click.option("--dead", type=click.IntRange(0), default=0, help="Receivers that give nothing.")
@click.option("--bits", type=click.IntRange(0), default=0, help="Of the digitiser.")
@click.option("--seed", type=click.IntRange(0), default=0)
def synthesize(file: str, medium: str | None, sector: str, relation: str | None, **o: Any) -> None:
    """Write a record of known truth to FILE (.npz with the truth, or .csv)."""
    waves = _relation(medium, sector, relation)
    import numpy as np

    from wavesim.records import synthetic
    from wavesim.records.files import write

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
    of = "" if relation else f", {sector} waves"
    click.echo(f"{file}: {len(made.t)} frames, {len(made.x)} receivers{of}")
    told = file if Path(file).suffix == ".npz" else ""
    next_to_do = f"wavesim score {told} POINTS.csv" if told else "an .npz carries the truth as well"
    click.echo(f"Then: wavesim dispersion {file}; {next_to_do}")


@click.command(short_help="Points of any program against a record's truth.")
@click.argument("truth", type=click.Path())
@click.argument("points", type=click.Path())
@click.option("--k-max", type=POSITIVE,
              help="Highest wavenumber at which waves can be missed, rad/m.")  # fmt: skip
@click.option("-o", "--out", metavar="FILE.json|csv",
              help="The score, or each point with its branch and how far it is off.")  # fmt: skip
@JSON
def score(truth: str, points: str, k_max: float | None, out: str | None, as_json: bool) -> None:
    """Hold the points of POINTS.csv against the record TRUTH.npz that synthesize made, or that
    carries arrays truth_k (n,), rad/m, and truth_omega (n, branches), rad/s, of your own beside its
    values, t and x.

    POINTS has columns k and omega (rad/m, rad/s; or frequency in Hz, or another unit in the
    heading) and perhaps error, one standard error; or what dispersion and attenuation write with
    --out.
    """
    if out and Path(out).suffix.lower() not in (".json", ".csv"):
        stop(f"--out {out}: must end in .json or .csv", BAD_INPUT)
    from wavesim.records.content import RecordError
    from wavesim.records.files import own_result, read
    from wavesim.records.point_table import read_points
    from wavesim.verdict.score import points_of
    from wavesim.verdict.score import score as held

    if own_result(truth):
        stop(
            f"{truth}: is a run, of waves of several kinds, which wavesim dispersion holds against "
            "the exact ones; points of another program need a record of one kind, of wavesim "
            "synthesize FILE.npz --medium CASE --sector NAME",
            BAD_INPUT,
        )
    record = read(Path(truth))
    columns = read_points(points)
    found = points_of(columns["k"], columns["omega"], columns.get("error"), columns.get("valid"))
    try:
        result = held(record, found, k_max)
    except RecordError as error:
        stop(f"{truth}: {error}", BAD_INPUT)
    if out:
        _write_score(Path(out), result)
    if as_json:
        print_json(result.row())
        return
    _show_score(result)


def _write_score(path: Path, result: Any) -> None:
    """A score as JSON, or its points as a table."""
    with writing(path.parent):
        if path.suffix.lower() == ".json":
            write_json(path, result.row())
            return
        columns = {name: one.real for name, one in result.each.items()}
        parts = {"k_imag": result.each["k"].imag, "sigma": result.each["omega"].imag}
        columns |= parts if parts["k_imag"].any() else {}
        rows = list(zip(*columns.values(), strict=True))
        write_table(path, list(columns), rows, "%.9g")


def _show_score(result: Any) -> None:
    """A line for each branch, and what is false."""
    table = new_table("branch", "at (kHz)", "waves", "found", "missed at (kHz)", "median\nerror",
                      "95 %\nbelow", "in\nbars", words=0)  # fmt: skip
    for row in result.branches:
        if not row["present"] and not row["points"]:
            continue
        missed = [_range(ends) for ends in row["missed_Hz"]]
        more = f" … {len(missed) - _MOST_RANGES} more" if len(missed) > _MOST_RANGES else ""
        errors = (row["median_error"], row["error_95"])
        within = row["within_bars"]
        table.add_row(
            str(row["branch"]), _range(row["frequencies_Hz"]), str(row["present"]),
            str(row["found"]), ", ".join(missed[:_MOST_RANGES]) + more,
            *("–" if one is None else f"{one:.1e}" for one in errors),
            "–" if within is None else f"{within:.0%}",
        )  # fmt: skip
    false = result.each["omega"].real[result.each["branch"] == 0] / math.tau
    if len(false):
        table.add_row("false", _range([false.min(), false.max()]), str(len(false)))
    console().print(table)
    console().print(result.said() + ".")


def _range(ends: Sequence[float]) -> str:
    """Frequencies in kHz, "12 – 15.3", or the one; "–" for none."""
    told = list(dict.fromkeys(f"{f / 1e3:.4g}" for f in ends))
    return " – ".join(told) or "–"


_WIDTH = 80
# Ranges of missed frequencies that a line holds.
_MOST_RANGES = 4


@click.command(short_help="What is wrong with a record, and what can use it.")
@FILES
@JSON
@INPUT
@SOURCES
@RING
@record_options
def inspect(
    files: tuple[str, ...],
    as_json: bool,
    column: str | None,
    places: tuple[float, ...],
    ring: bool,
    layout: Any,
) -> None:
    """What is wrong with the record FILE, what was done about it, and which commands can use it.

    FILE is a run's folder or result.h5, a table of text (.csv, .txt, .tsv, .dat, …), .npz, .npy,
    HDF5, MATLAB's .mat, netCDF, and with obspy SEG-Y, SEG-2, SU, SAC, miniSEED; or several of one
    record, each of a receiver, as SAC's.

    Exit code 0: some can, as it is or with an option that is named; 1: none can; 2: it can't be
    read.
    """
    from wavesim.readings.crosstalk_findings import crosstalk_findings
    from wavesim.records.inspection import inspect as look_over
    from wavesim.records.layout import told_files

    column = None if column is not None and Path(column).is_file() else column
    found = look_over(
        files if len(files) > 1 else files[0],
        replace(layout, input=column, sources=places, ring=ring),
    )
    if not (found.run or ring):
        found = replace(found, findings=(*found.findings, *crosstalk_findings(found.record)))
    summary = {"file": told_files(files)} | found.summary()
    if as_json:
        print_json(summary)
    else:
        _show(summary)
    if all(summary["usable"].values()) and not summary["lacking"]:
        sys.exit(FELL_SHORT)


def _show(summary: dict[str, Any]) -> None:
    channels = summary["receivers"]
    x = [c["position_m"] for c in channels]
    where = "positions not known" if None in x else f"x = {min(x):.6g} to {max(x):.6g} m"
    end = summary["start_s"] + summary["interval_s"] * (summary["frames"] - 1)
    unit = ("point" if summary["run"] else "receiver") + ("s" if len(channels) > 1 else "")
    _say(
        f"{summary['file']}: {summary['frames']} frames, {summary['interval_s']:.6g} s apart, from "
        f"{summary['start_s']:.6g} to {end:.6g} s; {len(channels)} "
        f"{unit}, {where}"
    )
    if summary["run"]:
        _say(f"It is {summary['run']}.")
    for assumed in summary["assumed"]:
        _say(f"Assumed: {assumed}.")
    findings = summary["findings"]
    if findings:
        click.echo()
        table = new_table("what", "where", "size", "done", words=4)
        for finding in findings:
            table.add_row(*(str(finding[name]) for name in ("what", "where", "size", "done")))
        console().print(table)
        click.echo()
    else:
        click.echo("Nothing is wrong with it.")
    for command, reason in summary["usable"].items():
        no = "not yet" if command in summary["lacking"] else "no"
        _say(f"{command}: " + (f"{no}: {reason}" if reason else "can use it"))


def _say(text: str) -> None:
    click.echo(textwrap.fill(text, _WIDTH, subsequent_indent="  ", break_on_hyphens=False))
