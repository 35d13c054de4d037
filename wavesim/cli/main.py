"""The commands: arguments, progress and exit codes. Nothing imports this module.

Exit codes: 0 all well; 1 a check of the run fell short; 2 bad input; 3 the integration failed; 130
interrupted from the keyboard.
"""

from __future__ import annotations

import os
import shlex
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from wavesim.cli import record_commands as labcli
from wavesim.cli.figures import figures as figures_of
from wavesim.cli.inspect import inspect
from wavesim.cli.media import bands, gaps, print_all_bands
from wavesim.cli.pulse import pulse
from wavesim.cli.score import score
from wavesim.cli.sweep import sweep
from wavesim.report.terminal import BAD_INPUT, FELL_SHORT, SET
from wavesim.report.terminal import console as _console
from wavesim.report.terminal import stop as _stop

NOT_FINITE, INTERRUPTED = 3, 130


def _load(case: str, overrides: tuple[str, ...]) -> Any:
    from wavesim.case.load import load

    return _read(load, case, overrides)


def _read(load: Callable[..., Any], case: str, overrides: tuple[str, ...]) -> Any:
    from wavesim.case.schema import CaseError

    try:
        return load(case, overrides)
    except CaseError as error:
        _stop(str(error), BAD_INPUT)


def _planned(case: str, loaded: Any) -> Any:
    """How the simulation of a case is stepped."""
    from wavesim.timedomain.time_step import time_step

    try:
        return time_step(loaded.simulation)
    except ValueError as error:
        _stop(f"{case}: [time] {error}", BAD_INPUT)


_CASE = click.argument("case", type=click.Path())


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="wavesim")
def main() -> None:
    """Rotation waves in granular bars: simulate, extract dispersion, hold against theory."""


@main.command()
@_CASE
@click.option("--out", type=click.Path(), help="Folder for results; outputs/<case> by default.")
@SET
@click.option("--resume", is_flag=True, help="Carry on an interrupted run of the same case.")
@click.option("--figures", is_flag=True, help="Draw all figures too, as wavesim figures does.")
@click.option("--quiet", is_flag=True, help="Print nothing but errors.")
def run(
    case: str,
    out: str | None,
    overrides: tuple[str, ...],
    resume: bool,
    figures: bool,
    quiet: bool,
) -> None:
    """Integrate CASE, measure its waves, and hold them against the plane-wave solver."""
    from wavesim.runner import begun_beside

    # It loads what it needs while this process reads the case.
    with begun_beside() as beside:
        _whole(case, out, overrides, resume, figures, quiet, beside)


def _whole(
    case: str,
    out: str | None,
    overrides: tuple[str, ...],
    resume: bool,
    figures: bool,
    quiet: bool,
    beside: Any,
) -> None:
    loaded = _load(case, overrides)
    steps = _planned(case, loaded)
    from wavesim.report import tables as report
    from wavesim.report.progress import progress
    from wavesim.verdict.foreseen import warnings

    folder = Path(out) if out else Path("outputs") / Path(case).stem
    warned = warnings(loaded, steps)
    _tell(case, loaded, warned)
    console = _console(quiet)
    with progress(loaded.simulation.frames, quiet) as tell:
        outcome = _run(loaded, folder, resume, tell, beside, figures, _typed(case, overrides))
    report.found(console, outcome.summary)
    report.verdict(console, outcome.summary)
    for note in outcome.notes:
        console.print(f"Note: {note}.")
    if warned:
        console.print(f"{_count(warned)} before the run, told again by wavesim check.")
    click.echo(f"The page: {folder / 'report.html'}") if not quiet else None
    if not outcome.passed:
        sys.exit(FELL_SHORT)


def _typed(case: str, overrides: tuple[str, ...]) -> str:
    """What runs the case once more, as it would be typed."""
    changes = [word for change in overrides for word in ("--set", change)]
    return shlex.join(["wavesim", "run", case, *changes])


def _run(
    loaded: Any,
    folder: Path,
    resume: bool,
    tell: Callable[[str, float], None],
    beside: Any,
    figures: bool,
    rerun: str,
) -> Any:
    from wavesim import runner

    pressed = False

    def interrupt(number: int, frame: Any) -> None:
        nonlocal pressed
        pressed = True
        raise KeyboardInterrupt

    def go_on(stage: str, part: float) -> None:
        # Python drops an interrupt that is raised in a callback, as jax has one for garbage.
        if pressed:
            raise KeyboardInterrupt
        tell(stage, part)

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    try:
        return runner.run(loaded, folder, resume, go_on, beside, figures, rerun)
    except runner.RunError as error:
        _stop(str(error), NOT_FINITE if error.unstable else BAD_INPUT)
    except KeyboardInterrupt:
        _stop(f"interrupted; what was done is in {folder}, --resume carries on", INTERRUPTED)


@main.command()
@_CASE
@SET
def check(case: str, overrides: tuple[str, ...]) -> None:
    """Say everything about CASE that can be said before integrating."""
    loaded = _load(case, overrides)
    steps = _planned(case, loaded)
    from wavesim.report import tables as report
    from wavesim.verdict.foreseen import warnings

    report.survey(_console(), loaded, steps)
    print_all_bands(loaded.simulation)
    # Last, and counted with the rest, as the tables before may be long.
    found = warnings(loaded, steps)
    click.echo(f"\n{_count(found) if found else 'No warnings'}.")
    _tell(case, loaded, found)
    if found:
        sys.exit(FELL_SHORT)


def _tell(case: str, loaded: Any, warned: list[str]) -> None:
    """What was taken otherwise than written, and what will fall short."""
    for kind, texts in (("note", loaded.notes), ("warning", warned)):
        for text in texts:
            click.echo(f"wavesim: {kind}: {case}: {text}", err=True)


def _count(warnings: list[str]) -> str:
    return f"{len(warnings)} warning{'s' if len(warnings) > 1 else ''}"


@main.command()
@click.option(
    "--out", type=click.Path(), default="outputs/paper", show_default=True, help="Folder for it."
)
def paper(out: str) -> None:
    """Draw the paper's Figures 3-6 anew, judge its claims by closure, list what is misprinted."""
    from wavesim.paper.claims import CLOSURES
    from wavesim.paper.reproduction import reproduce

    try:
        result = reproduce(Path(out))
    except OSError as error:
        _stop(f"--out {out}: can't be written: {error.strerror}", BAD_INPUT)
    click.echo("claim  " + "  ".join(f"{closure:<10}" for closure in CLOSURES))
    for claim in result["claims"]:
        verdicts = "  ".join(f"{claim['verdicts'][closure]:<10}" for closure in CLOSURES)
        click.echo(f"{claim['number']:>5}  {verdicts}")
    click.echo(f"Page, figures and numbers in {out}")


def entry() -> None:
    """The command: as :func:`main`, but that it ends at once.

    jax takes half a second to take itself down; all that a command writes is written before.
    """
    code: Any = 0
    try:
        main()
    except SystemExit as stop:
        code = stop.code
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code if isinstance(code, int) else bool(code))


_COMMANDS = (
    *labcli.COMMANDS,
    bands,
    figures_of,
    gaps,
    inspect,
    pulse,
    score,
    sweep,
)
for _command in _COMMANDS:
    main.add_command(_command)


if __name__ == "__main__":
    entry()
