"""The command `wavesim sweep`: a case measured over ranges of its keys."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from wavesim.cli.arguments import BAND, CASE, OUT, QUIET, SET, folder_for, longest
from wavesim.cli.interrupts import farewell
from wavesim.report.terminal import BAD_INPUT, FAILED, FELL_SHORT, console, stop, unwritable
from wavesim.worker import cores


@click.command(short_help="Measure a case over ranges of its keys.")
@CASE
@click.option(
    "--vary",
    multiple=True,
    required=True,
    metavar="KEY=FROM:TO:N",
    help="A key of the case, such as medium.anisotropy or layers.1.G_n_a, and the range it takes.",
)
@click.option("--sample", type=int, metavar="N", help="Draw N members, in place of the grid.")
@click.option("--sampler", type=click.Choice(["sobol", "lhs"]), default="sobol", show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the sample.")
@click.option(
    "--measure",
    type=click.Choice(["gaps", "transmission", "run"]),
    default="gaps",
    show_default=True,
)
@BAND
@click.option(
    "--points",
    type=click.IntRange(2, 100_000),
    default=200,
    show_default=True,
    help="Of transmission.",
)
@click.option("--workers", type=click.IntRange(1), help="Processes on this machine.")
@click.option("--scheduler", metavar="ADDRESS", help="Of a scheduler of Dask, tcp://HOST:PORT.")
@click.option(
    "--at-most", default="1h", metavar="TIME", help="End what would take longer; 1h by default."
)
@OUT
@click.option("--resume", is_flag=True, help="Carry on a sweep that was ended.")
@SET
@QUIET
def sweep(case: str, out: str | None, quiet: bool, **options: Any) -> None:
    """Measure CASE over ranges of its keys: sweep.zarr, and maps of it.

    Gaps and transmission are computed at once. Runs go to worker processes, as many as there are
    cores unless --workers says otherwise. Exit code 1 if a member failed, or a run fell short of a
    check.
    """
    from wavesim.studies.sweep import sweep as described
    from wavesim.verdict.judgement import measure

    if options["workers"] and options["scheduler"]:
        stop("--workers, --scheduler: give one of the two", BAD_INPUT)
    options["at_most"] = longest(options["at_most"])
    folder = folder_for(out, case)
    named = ("vary", "measure", "sample", "sampler", "seed", "overrides", "band", "points")
    try:
        asked = described(case, folder=folder, judge=measure, **{n: options[n] for n in named})
        data = _measured(asked, options, quiet, folder)
    except OSError as error:
        stop(*unwritable(error, f"--out {error.filename or folder}"))
    _tell(asked, data, folder, quiet)


def _measured(asked: Any, options: dict[str, Any], quiet: bool, folder: Path) -> Any:
    from wavesim.report.progress import counted
    from wavesim.studies.sweep_workers import SweepStoppedError

    workers, address = options["workers"], options["scheduler"]
    if workers is None and address is None and options["measure"] == "run":
        workers = cores()
    members = 0

    def stored() -> str:
        return f"what was done is in {folder}, --resume carries on" if members else ""

    def go_on(done: int, failed: int, of: int) -> None:
        nonlocal members
        members = done
        tell(done, of, failed)

    try:
        with counted("members", quiet) as tell, farewell(stored):
            return asked.go(options["resume"], workers, address, go_on, options["at_most"])
    except SweepStoppedError as error:
        where = f"--scheduler {address}: " if address else ""
        stop("; ".join(part for part in (f"{where}{error}", stored()) if part), FAILED)


def _tell(asked: Any, data: Any, folder: Path, quiet: bool) -> None:
    """What came of it, the maps, and the exit code."""
    from wavesim.figures.style import write
    from wavesim.figures.sweep import sweep_figures

    shown = console(quiet)
    failed, short = asked.store.failed, 0
    for path in write(sweep_figures(data), folder / "figures"):
        shown.print(f"Map {path}")
    if "fell_short" in data:
        short = int((data["fell_short"].values > 0).sum())
    for note in getattr(asked.measure, "notes", ()):
        shown.print(f"Note: {note}.")
    shown.print(f"{asked.count - failed} of {asked.count} members in {asked.store.path}")
    if short:
        shown.print(f"{short} runs fell short of a check; the variable shortfall names it.")
    if failed:
        messages = data["message"].values.ravel()
        first = next(message for message in messages if message)
        shown.print(f"{failed} members failed; the variable message says why. The first: {first}")
    if failed or short:
        sys.exit(FELL_SHORT)
