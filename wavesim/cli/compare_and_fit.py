"""The commands ``compare`` and ``fit``: a case beside a measured record, and fitted to one.

Exit codes: 0 all well; 1 more is left than --tolerance allows, the data do not tell a parameter, or
the fit did not settle; 2 bad input.
"""

from __future__ import annotations

import json
import math
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from wavesim.cli.arguments import (
    BESIDE,
    JSON,
    NOT_NEGATIVE,
    POSITIVE,
    SET,
    WRITTEN,
    print_json,
    read_case,
    read_layers,
    record_options,
    write_json,
    writing,
)
from wavesim.report.terminal import BAD_INPUT, FELL_SHORT, console, stop


def _laid_beside(
    record: str,
    case: str,
    field: str | None,
    lag: float | None,
    scale: float | None,
    overrides: Any,
    layout: Any,
) -> Any:
    """A case and a record matched to its receivers; what is wrong ends the command with a line."""
    from wavesim.readings.matched_record import MatchError, matched
    from wavesim.records.of_pulse_test import of_pulse_file
    from wavesim.records.point_table import is_points

    if scale == 0:
        stop("--scale 0: must not be 0; leave it out, and it is fitted", BAD_INPUT)
    if is_points(Path(record)):
        stop(f"{record}: is a table of points, which wavesim fit takes", BAD_INPUT)
    loaded = read_case(case, overrides)
    tests = of_pulse_file(record, layout)
    if any(not test.placed for test in tests) and len(tests) > 1:
        # Columns without places are receivers by their names.
        merged = {k: v for test in tests for k, v in test.signals.items()}
        places = {k: v for test in tests for k, v in test.positions.items()}
        tests = [replace(tests[0], name=record, signals=merged, positions=places)]
    try:
        return loaded, matched(tests[0], loaded.simulation, field, lag or 0.0)
    except MatchError as error:
        stop(f"{record}: {error}", BAD_INPUT)


def _write(
    name: str, answer: Any, comparison: Any, folder: Path, quiet: bool, **texts: str
) -> None:
    """The answer as NAME.json, other files' texts by their stems, and the overlay as NAME.png."""
    written = [f"{name}.json", *(f"{stem}.toml" for stem in texts)]
    with writing(folder):
        write_json(folder / f"{name}.json", answer)
        for stem, text in texts.items():
            (folder / f"{stem}.toml").write_text(text, encoding="utf-8")
        if comparison is not None:
            from wavesim.figures.record import overlay
            from wavesim.figures.style import write

            written += [path.name for path in write({name: lambda: overlay(comparison)}, folder)]
    if not quiet:
        click.echo(f"{', '.join(written)} in {folder}")


@click.command(short_help="A record beside a case's signals: lag, scale, misfit.")
@click.argument("record", type=click.Path())
@click.argument("case", type=click.Path())
@BESIDE
@click.option("--tolerance", type=NOT_NEGATIVE, help="Exit with 1 where the residual is more, –.")
@WRITTEN
@JSON
@SET
@record_options
def compare(
    record: str,
    case: str,
    field: str | None,
    lag: float | None,
    scale: float | None,
    tolerance: float | None,
    out: str | None,
    as_json: bool,
    overrides: tuple[str, ...],
    layout: Any,
) -> None:
    """Lay the signals of CASE over those of RECORD, receiver by receiver, and tell them apart."""
    loaded, measured = _laid_beside(record, case, field, lag, scale, overrides, layout)
    from wavesim.material.shown import plain
    from wavesim.studies import comparison

    try:
        found = comparison.compare(loaded, measured, lag, scale)
    except ValueError as error:
        stop(f"{case}: {error}", BAD_INPUT)
    answer = plain(found.summary())
    if as_json:
        print_json(answer)
    else:
        from wavesim.report.tables import show_comparison

        show_comparison(console(), found)
    if out:
        _write("compare", answer, found, Path(out), as_json)
    if tolerance is not None and not found.residual <= tolerance:
        if not as_json:
            click.echo(f"That is more than --tolerance {tolerance:g}.")
        sys.exit(FELL_SHORT)


@click.command(short_help="Fit a case's parameters to a record, or to points.")
@click.argument("record", type=click.Path())
@click.argument("case", type=click.Path(), required=False)
@click.argument("more", metavar="[KEY]…", nargs=-1)
@click.option(
    "--vary",
    "keys",
    metavar="KEY",
    multiple=True,
    help="What to fit: medium.anisotropy, medium.quality_factor, layers.0.density …",
)
@BESIDE
@click.option(
    "--held",
    metavar="[NAME=]PART",
    multiple=True,
    help="How well what is not varied is known, of its size, as 1%, or medium.density=0.2%; the "
    "errors hold it.",
)
@click.option(
    "--sector",
    metavar="NAME",
    help="Of points, such as transverse2 or translation-longitudinal; as the file's name ends, or "
    "longitudinal, where not given.",
)
@click.option(
    "--also",
    metavar="FILE",
    multiple=True,
    help="Points of another sector beside those of RECORD, whose sector its name ends in.",
)
@click.option(
    "--speeds",
    nargs=2,
    type=POSITIVE,
    metavar="V_P V_S",
    help="Of long waves, m/s: fit CASE to them.",
)
@click.option(
    "--speed-errors",
    nargs=2,
    type=NOT_NEGATIVE,
    metavar="E_P E_S",
    help="One standard error of each.",
)
@click.option(
    "--shear", metavar="FILE", help="pulse.json of S waves; RECORD is that of P waves then."
)
@WRITTEN
@JSON
@SET
@record_options
def fit(out: str | None, as_json: bool, **given: Any) -> None:
    """Fit parameters of CASE, named by --vary KEY…, to RECORD: waveforms at its receivers, or the
    points that wavesim dispersion or attenuation wrote, or another program, with columns k, omega
    (rad/m, rad/s, or units in the headings) and error.

    From speeds of P and S waves to K_n_a and stiffness_ratio of a medium of the translation family:
    wavesim fit CASE --speeds V_P V_S, or, of two series of pulse tests, wavesim fit P.json CASE
    --shear S.json.
    """
    from wavesim.material.shown import plain
    from wavesim.report.progress import working

    given["held"] = dict(map(_part, given["held"]))
    of_speeds = given["speeds"] or given["shear"]
    with working("fit"):
        found, comparison = (_of_speeds if of_speeds else _of_record)(**given)
    answer = plain(found)
    if as_json:
        print_json(answer)
    else:
        from wavesim.report.tables import show_fit

        show_fit(console(), answer)
    if out:
        text = _fitted(given["case"] or given["record"], given["overrides"], answer)
        _write("fit", answer, comparison, Path(out), as_json, fitted=text)
    if not answer["valid"]:
        sys.exit(FELL_SHORT)


def _part(told: str) -> tuple[str, float]:
    """What is held ("" for all else), and the part of its size that it is known to."""
    name, _, part = told.rpartition("=")
    with suppress(ValueError):
        known_to = float(part.rstrip(" %")) * (0.01 if "%" in part else 1)
        if 0 <= known_to < 1:
            return name.strip(), known_to
    stop(f"--held {told}: must be [NAME=]PART, PART from 0 to 1, as 0.01 or 1%", BAD_INPUT)


def _of_record(
    record: str,
    case: str | None,
    keys: tuple[str, ...],
    more: tuple[str, ...],
    sector: str | None,
    also: tuple[str, ...],
    held: dict[str, float],
    overrides: tuple[str, ...],
    **beside: Any,
) -> tuple[dict[str, Any], Any]:
    """What a record, or a table of points, says of parameters; and the record beside the case."""
    if case is None:
        stop("CASE: required after RECORD, but not given; add it", BAD_INPUT)
    if not keys:
        stop("--vary: required, but not given; name what to fit, as medium.anisotropy", BAD_INPUT)
    named = [part for key in (*keys, *more) for part in key.split(",") if part.strip()]
    from wavesim.records.content import RecordError
    from wavesim.records.point_table import is_points
    from wavesim.studies.fit_answer import of_waveforms
    from wavesim.studies.least_squares import FitError
    from wavesim.studies.points_and_speeds import of_points

    field, lag, scale, layout = (beside[name] for name in ("field", "lag", "scale", "layout"))
    measured: Any = None
    of_table = is_points(Path(record))
    if also and not of_table:
        stop("--also: takes points of another sector; RECORD is no table of points", BAD_INPUT)
    if of_table:
        loaded = read_case(case, overrides)
    else:
        loaded, measured = _laid_beside(record, case, field, lag, scale, overrides, layout)
    try:
        if of_table:
            found = of_points([Path(record), *map(Path, also)], loaded, named, sector, held)
        else:
            found = of_waveforms(loaded, measured, named, lag, scale, held)
    except (FitError, RecordError):
        raise
    except ValueError as error:
        stop(f"{record}: {error}", BAD_INPUT)
    return found.summary(), found.comparison


def _of_speeds(
    record: str,
    case: str | None,
    speeds: tuple[float, float] | None,
    speed_errors: tuple[float, float] | None,
    shear: str | None,
    held: dict[str, float],
    overrides: tuple[str, ...],
    **_: Any,
) -> tuple[dict[str, Any], None]:
    """What speeds, or two series of them, say of the contacts."""
    from wavesim.studies import points_and_speeds

    if speeds and (shear or case is not None):
        stop("--speeds: takes CASE alone, without RECORD and --shear", BAD_INPUT)
    if shear and case is None:
        stop(
            "--shear: takes RECORD, pulse.json of P waves, and CASE; add what is missing", BAD_INPUT
        )
    start = read_layers(case or record, overrides).medium
    if not speeds:
        return points_and_speeds.of_series(_series(record), _series(shear or ""), start, held), None
    errors = speed_errors or (math.nan, math.nan)
    return points_and_speeds.of_speeds(*speeds, start, errors, held).summary(), None


def _series(path: str) -> Any:
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
        return found["records"] and found
    except (OSError, UnicodeDecodeError) as error:
        stop(f"{path}: can't be read: {error}; name pulse.json of wavesim pulse --out", BAD_INPUT)
    except (ValueError, KeyError, TypeError):
        stop(f"{path}: not what wavesim pulse --json writes; name its pulse.json", BAD_INPUT)


def _fitted(case: str, overrides: tuple[str, ...], answer: Any) -> str:
    """The case file with the values that were found."""
    import tomli_w

    from wavesim.case.schema import tables_of
    from wavesim.case.toml_text import lay_over

    tables, _ = tables_of(case, overrides)
    found = {key: one["value"] for key, one in answer["parameters"].items()}
    for key, value in (found | answer["along"]).items():
        if value is not None:  # a fit without an answer
            lay_over(tables, f"{key}={value!r}")
    return tomli_w.dumps(tables)
