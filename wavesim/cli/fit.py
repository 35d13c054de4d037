"""The command ``fit``: parameters of a case from recorded waveforms, or from points.

Exit codes: 0 all well; 1 the data do not tell a parameter, or the fit did not settle; 2 bad input.
"""

from __future__ import annotations

import json
import math
import sys
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
from wavesim.cli.compare import laid_beside
from wavesim.report.terminal import BAD_INPUT, FELL_SHORT, console, stop


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
    "--sector",
    metavar="NAME",
    help="Of points, such as transverse2 or translation-longitudinal; as the file's name ends, or "
    "longitudinal, where not given.",
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
def fit(
    record: str,
    case: str | None,
    more: tuple[str, ...],
    keys: tuple[str, ...],
    field: str | None,
    sector: str | None,
    speeds: tuple[float, float] | None,
    speed_errors: tuple[float, float] | None,
    shear: str | None,
    lag: float | None,
    scale: float | None,
    out: str | None,
    as_json: bool,
    overrides: tuple[str, ...],
    layout: Any,
) -> None:
    """Fit parameters of CASE, named by --vary KEY…, to RECORD: waveforms at its receivers, or the
    points that wavesim dispersion or attenuation wrote.

    From speeds of P and S waves to K_n_a and stiffness_ratio of a medium of the translation family:
    wavesim fit CASE --speeds V_P V_S, or, of two series of pulse tests, wavesim fit P.json CASE
    --shear S.json.
    """
    if speeds or shear:
        _of_speeds(record, case, speeds, speed_errors, shear, out, as_json, overrides)
        return
    if case is None:
        stop("CASE: required after RECORD, but not given; add it", BAD_INPUT)
    if not keys:
        stop("--vary: required, but not given; name what to fit, as medium.anisotropy", BAD_INPUT)
    named = [part for key in (*keys, *more) for part in key.split(",") if part.strip()]
    from wavesim.material.shown import plain
    from wavesim.studies.fit_answer import is_points, of_points, of_waveforms
    from wavesim.studies.least_squares import FitError

    of_table = is_points(Path(record))
    if of_table:
        loaded = read_case(case, overrides)
    else:
        loaded, measured = laid_beside(record, case, field, lag, scale, overrides, layout)
    try:
        if of_table:
            found = of_points(Path(record), loaded, named, sector)
        else:
            found = of_waveforms(loaded, measured, named, lag, scale)
    except FitError:
        raise
    except ValueError as error:
        stop(f"{record}: {error}", BAD_INPUT)
    answer = plain(found.summary())
    if as_json:
        print_json(answer)
    else:
        from wavesim.report.tables import show_fit

        show_fit(console(), answer)
    if out:
        _write(answer, found, case, overrides, Path(out), as_json)
    if not answer["valid"]:
        sys.exit(FELL_SHORT)


def _of_speeds(
    record: str,
    case: str | None,
    speeds: tuple[float, float] | None,
    errors: tuple[float, float] | None,
    shear: str | None,
    out: str | None,
    as_json: bool,
    overrides: tuple[str, ...],
) -> None:
    from wavesim.material.shown import plain
    from wavesim.studies.speed_fit import fit_speeds

    if speeds and (shear or case is not None):
        stop("--speeds: takes CASE alone, without RECORD and --shear", BAD_INPUT)
    if shear and case is None:
        stop(
            "--shear: takes RECORD, pulse.json of P waves, and CASE; add what is missing", BAD_INPUT
        )
    path = case or record
    start = read_layers(path, overrides).medium
    if speeds:
        found = fit_speeds(*speeds, start, errors or (math.nan, math.nan)).summary()
    else:
        found = _of_series(record, shear or "", start)
    answer = plain(found)
    if as_json:
        print_json(answer)
    else:
        _show_speeds(answer)
    if out:
        _write(answer, None, path, overrides, Path(out), as_json)
    if not answer["valid"]:
        sys.exit(FELL_SHORT)


def _series(path: str) -> Any:
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
        return found["records"] and found
    except (OSError, UnicodeDecodeError) as error:
        stop(f"{path}: can't be read: {error}; name pulse.json of wavesim pulse --out", BAD_INPUT)
    except (ValueError, KeyError, TypeError):
        stop(f"{path}: not what wavesim pulse --json writes; name its pulse.json", BAD_INPUT)


def _of_series(p: str, s: str, start: Any) -> Any:
    """The fits of two series, as plain data: the first state's, and all under "series"."""
    from wavesim.studies.speed_fit import fit_series

    of_p = _series(p)
    fits, law = fit_series(of_p, _series(s), start)
    rows = [{"parameter": one.parameter} | one.summary()["parameters"] for one in fits]
    reasons = [one.reason for one in fits if one.reason]
    answer = fits[0].summary()
    name = (of_p.get("series") or {}).get("parameter") or "state"
    first = f"parameters, and fitted.toml of --out, are those at {name} = {fits[0].parameter:g}"
    of_all = {"series": rows, "parameter": name, "law": law, "valid": not reasons}
    return answer | of_all | {"notes": [first, *answer["notes"]]}


def _show_speeds(answer: dict[str, Any]) -> None:
    """Print a series of fits, a line for each state; of a pair, as any fit."""
    from wavesim.material.shown import with_error
    from wavesim.report.tables import show_fit

    if "series" not in answer:
        one = answer["parameters"]["medium.K_n_a"]
        if one["reason"]:
            console().print(f"No medium has these speeds: {one['reason']}.", markup=False)
        else:
            show_fit(console(), answer)
        return
    for row in answer["series"]:
        parts = []
        for key in ("medium.K_n_a", "medium.stiffness_ratio"):
            one = row[key]
            if one["reason"]:
                parts = [one["reason"]]
                break
            value = with_error(one["value"], one["error"] or math.nan)
            parts.append(f"{key.partition('.')[2]} = {value}")
        state = f"{answer['parameter']} = {row['parameter']:g}"
        console().print(f"{state}: {', '.join(parts)}", markup=False)
    if answer["law"]:
        law = answer["law"]
        console().print(
            f"K_n_a = {law['c']:.4g} · {answer['parameter']}^({law['b']:.3f} ± "
            f"{law['b_error']:.2g})",
            markup=False,
        )
    for note in answer["notes"]:
        console().print(f"Note: {note}.", markup=False)


def _write(
    answer: Any, found: Any, case: str, overrides: tuple[str, ...], folder: Path, quiet: bool
) -> None:
    written = ["fit.json", "fitted.toml"]
    with writing(folder):
        write_json(folder / "fit.json", answer)
        (folder / "fitted.toml").write_text(_fitted(case, overrides, answer), encoding="utf-8")
        if found is not None and found.comparison is not None:
            from wavesim.figures.record import overlay
            from wavesim.figures.style import write

            write({"fit": lambda: overlay(found.comparison)}, folder)
            written.append("fit.png")
    if not quiet:
        click.echo(f"{', '.join(written)} in {folder}")


def _fitted(case: str, overrides: tuple[str, ...], answer: Any) -> str:
    """The case file with the values that were found."""
    import tomli_w

    from wavesim.case.schema import tables_of
    from wavesim.case.toml_text import lay_over

    tables, _ = tables_of(case, overrides)
    found = {key: one["value"] for key, one in answer["parameters"].items()}
    for key, value in (found | answer.get("along", {})).items():
        if value is not None:  # a fit without an answer
            lay_over(tables, f"{key}={value!r}")
    return tomli_w.dumps(tables)
