"""The command ``compare``: a measured record beside a case's own signals.

Exit codes: 0 all well; 1 more is left than --tolerance allows; 2 bad input.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from wavesim.cli.arguments import (
    BESIDE,
    JSON,
    NOT_NEGATIVE,
    SET,
    WRITTEN,
    print_json,
    read_case,
    record_options,
    write_json,
    writing,
)
from wavesim.report.terminal import BAD_INPUT, FELL_SHORT, console, stop


def laid_beside(
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

    if scale == 0:
        stop("--scale 0: must not be 0; leave it out, and it is fitted", BAD_INPUT)
    loaded = read_case(case, overrides)
    tests = of_pulse_file(record, layout)
    if any(not test.placed for test in tests) and len(tests) > 1:
        # Columns without places are receivers by their names.
        first = tests[0]
        merged = {k: v for test in tests for k, v in test.signals.items()}
        places = {k: v for test in tests for k, v in test.positions.items()}
        tests = [replace(first, name=record, signals=merged, positions=places)]
    try:
        return loaded, matched(tests[0], loaded.simulation, field, lag or 0.0)
    except MatchError as error:
        stop(f"{record}: {error}", BAD_INPUT)


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
    loaded, measured = laid_beside(record, case, field, lag, scale, overrides, layout)
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
        _write(answer, found, Path(out), as_json)
    if tolerance is not None and not found.residual <= tolerance:
        sys.exit(FELL_SHORT)


def _write(answer: Any, found: Any, folder: Path, quiet: bool) -> None:
    from wavesim.figures.record import overlay
    from wavesim.figures.style import write

    with writing(folder):
        write_json(folder / "compare.json", answer)
        write({"compare": lambda: overlay(found)}, folder)
    if not quiet:
        click.echo(f"compare.json, compare.png in {folder}")
