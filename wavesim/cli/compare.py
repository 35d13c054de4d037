"""The command ``compare``: a measured record beside a case's own signals.

Exit codes: 0 all well; 1 more is left than --tolerance allows; 2 bad input.
"""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from wavesim.cli.record_options import record_options
from wavesim.report.terminal import BAD_INPUT, FELL_SHORT, console, stop


def laid_beside(record: str, case: str, field: str | None, overrides: Any, layout: Any) -> Any:
    """A case and a record matched to its receivers; what is wrong ends the command with a line."""
    from wavesim.case.load import load
    from wavesim.case.schema import CaseError
    from wavesim.readings.measured import MatchError, matched
    from wavesim.records.content import RecordError
    from wavesim.records.of_pulse_test import of_pulse_file

    try:
        loaded = load(case, overrides)
    except CaseError as error:
        stop(str(error), BAD_INPUT)
    try:
        tests = of_pulse_file(record, layout)
    except RecordError as error:
        stop(str(error), BAD_INPUT)
    if any(not test.placed for test in tests) and len(tests) > 1:
        # Columns without places are receivers by their names.
        first = tests[0]
        merged = {k: v for test in tests for k, v in test.signals.items()}
        places = {k: v for test in tests for k, v in test.positions.items()}
        tests = [replace(first, name=record, signals=merged, positions=places)]
    try:
        return loaded, matched(tests[0], loaded.simulation, field)
    except MatchError as error:
        stop(f"{record}: {error}", BAD_INPUT)


def stated(option: str, value: float | None) -> float | None:
    """A number that an option states, if it can be used."""
    if value is not None and not math.isfinite(value):
        stop(f"{option} {value}: must be a finite number", BAD_INPUT)
    return value


@click.command()
@click.argument("record", type=click.Path())
@click.argument("case", type=click.Path())
@click.option(
    "--field",
    metavar="NAME",
    help="What the record is of, such as phi1 or u1; what is driven where not given.",
)
@click.option("--lag", type=float, help="Of the record's clock, s; fitted where not given.")
@click.option(
    "--scale", type=float, help="Unit of the record over that of the field; fitted where not given."
)
@click.option("--tolerance", type=float, help="Exit with 1 where the residual is more, –.")
@click.option("--out", type=click.Path(), help="Folder for numbers and the figure.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="TABLE.KEY=VALUE",
    help="Lay a value over the case's.",
)
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
    loaded, measured = laid_beside(record, case, field, overrides, layout)
    lag, scale = stated("--lag", lag), stated("--scale", scale)
    from wavesim.readings.pulse.answers import plain
    from wavesim.studies import comparison
    from wavesim.studies.least_squares import FitError

    try:
        found = comparison.compare(loaded, measured, lag, scale)
    except (ValueError, FitError) as error:
        stop(f"{case}: {error}", BAD_INPUT)
    answer = plain(found.summary())
    if as_json:
        click.echo(json.dumps(answer, ensure_ascii=False))
    else:
        from wavesim.report.fit_tables import show_comparison

        show_comparison(console(), found)
    if out:
        _write(answer, found, Path(out), as_json)
    if tolerance is not None and not found.residual <= tolerance:
        sys.exit(FELL_SHORT)


def _write(answer: Any, found: Any, folder: Path, quiet: bool) -> None:
    from wavesim.figures.comparison import write

    try:
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(answer, ensure_ascii=False, indent=1)
        (folder / "compare.json").write_text(text + "\n", encoding="utf-8")
        write(found, folder / "compare.png")
    except OSError as error:
        stop(f"--out {folder}: can't be written: {error.strerror}; name another folder", BAD_INPUT)
    if not quiet:
        click.echo(f"compare.json, compare.png in {folder}")
