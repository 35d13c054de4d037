"""The commands: arguments, progress and exit codes. Nothing imports this module.

Exit codes: 0 all well; 1 a check of the run fell short; 2 bad input; 3 the integration or the
writing of its results failed; 130 interrupted.
"""

from __future__ import annotations

import gc
import os
import shlex
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

import click

from wavesim.cli.arguments import (
    CASE,
    OUT,
    QUIET,
    SET,
    affordable,
    folder_for,
    planned,
    read_case,
)
from wavesim.cli.bands_and_gaps import bands, gaps, print_all_bands
from wavesim.cli.compare_and_fit import compare, fit
from wavesim.cli.design import design
from wavesim.cli.dispersion import attenuation, dispersion
from wavesim.cli.figures import animate
from wavesim.cli.figures import figures as figures_of
from wavesim.cli.init_and_cases import cases, completion, init, schema
from wavesim.cli.interrupts import farewell
from wavesim.cli.pulse import pulse
from wavesim.cli.records import inspect, score, synthesize
from wavesim.cli.sweep import sweep
from wavesim.cli.transmission import transmission
from wavesim.report.terminal import (
    BAD_INPUT,
    FELL_SHORT,
    INTERRUPTED,
    console,
    failed,
    stop,
    told,
    unwritable,
)
from wavesim.worker import end_all

# A run that takes so long (s) is told before what its grid will do; a shorter one tells it itself.
_WORTH_IT = 20.0


def _misused(error: click.UsageError) -> NoReturn:
    """End with what is wrong of a command's words, and how it is used."""
    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        raise error
    said = error.format_message().rstrip(".")
    if error.ctx is not None:
        said += f"{'' if said.endswith('?') else '.'} {error.ctx.get_usage()}"
    stop(" ".join(said.split()), BAD_INPUT)


class _Commands(click.Group):
    """Commands that end with a line, and its exit code, where wavesim or click finds a fault."""

    def make_context(self, *given: Any, **extra: Any) -> click.Context:
        try:
            return super().make_context(*given, **extra)
        except click.UsageError as error:
            _misused(error)

    def invoke(self, context: click.Context) -> Any:
        try:
            return super().invoke(context)
        except click.UsageError as error:
            _misused(error)
        except Exception as error:
            if not type(error).__module__.startswith("wavesim."):
                raise
            sys.exit(failed(error))


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(package_name="wavesim")
def main() -> None:
    """Rotation waves in granular bars: simulate, extract dispersion, hold against theory."""


@main.command(short_help="Simulate a case, and hold it against the exact solution.")
@CASE
@OUT
@SET
@click.option("--at-most", default="1h", metavar="TIME", help="Refuse a longer run; 1h by default.")
@click.option("--resume", is_flag=True, help="Carry on an interrupted run of the same case.")
@click.option("--figures", is_flag=True, help="Draw all figures too, as wavesim figures does.")
@QUIET
def run(**given: Any) -> None:
    """Integrate CASE, measure its waves, and hold them against the plane-wave solver."""
    gc.disable()  # what is loaded stays: to look through it for garbage takes a twentieth of a run
    from wavesim.report.run_files import begun_beside

    # It loads what it needs while this process reads the case.
    with begun_beside() as beside:
        _whole(beside, **given)


def _whole(
    beside: Any,
    case: str,
    out: str | None,
    overrides: tuple[str, ...],
    resume: bool,
    at_most: str,
    figures: bool,
    quiet: bool,
) -> None:
    loaded = read_case(case, overrides)
    folder = folder_for(out, case)
    if resume:
        from wavesim.io.result_reader import stored

        stored(folder / "result.h5")
    steps = planned(case, loaded)
    taken = affordable(case, loaded, steps, at_most, folder)
    from wavesim.report import tables as report
    from wavesim.report.progress import progress
    from wavesim.verdict.warnings_before_run import foreseen

    errors = None
    if taken.seconds >= _WORTH_IT:
        from wavesim.verdict.foreseen_errors import foretold

        errors = foretold(loaded.simulation, loaded.analysis, loaded.k_range)
    warned = foreseen(loaded, steps, errors)
    _tell(case, loaded, warned)
    shown = console(quiet)
    with progress(loaded.simulation.frames, quiet, taken.stages) as tell:
        outcome = _run(loaded, folder, resume, tell, beside, figures, _typed(case, overrides))
    report.found(shown, outcome.summary)
    report.verdict(shown, outcome.summary)
    for note in outcome.notes:
        shown.print(f"Note: {note}.")
    if warned:
        shown.print(f"{_count(warned)} before the run, told again by wavesim check.")
    if not quiet:
        click.echo(f"The page: {folder / 'report.html'}")
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

    done = 0.0

    def go_on(stage: str, part: float) -> None:
        nonlocal done
        if stage == "integrate":
            done = max(done, part)
            if not gc.isenabled():
                gc.freeze()
                gc.enable()
        tell(stage, part)

    def stored() -> str:
        result = folder / "result.h5"
        if not (done or resume) or not result.exists():
            return ""
        return f"what was done is in {folder}, --resume carries on"

    try:
        with farewell(stored):
            return runner.run(loaded, folder, resume, go_on, beside, figures, rerun)
    except KeyboardInterrupt:  # where this is not the command, but called by a program
        more = stored()
        stop(f"interrupted; {more}" if more else "interrupted", INTERRUPTED)


@main.command(short_help="What can be said of a case before it runs.")
@CASE
@SET
def check(case: str, overrides: tuple[str, ...]) -> None:
    """Say everything about CASE that can be said before integrating."""
    loaded = read_case(case, overrides)
    steps = planned(case, loaded)
    from wavesim.report import tables as report
    from wavesim.timedomain.cost import check_cost, cost
    from wavesim.verdict.foreseen_errors import foretold
    from wavesim.verdict.warnings_before_run import foreseen

    taken = cost(loaded.simulation, steps, k_max=loaded.k_range[1] or None)
    errors = foretold(loaded.simulation, loaded.analysis, loaded.k_range)
    report.survey(console(), loaded, steps, taken, errors)
    print_all_bands(loaded.simulation)
    # Last, and counted with the rest, as the tables before may be long.
    found = foreseen(loaded, steps, errors)
    try:
        check_cost(loaded.simulation, taken, folder=folder_for(None, case))
    except ValueError as error:
        found.append(f"[time] {error}")
    click.echo(f"\n{_count(found) if found else 'No warnings'}.")
    _tell(case, loaded, found)
    if found:
        sys.exit(FELL_SHORT)


def _tell(case: str, loaded: Any, warned: list[str]) -> None:
    """What was taken otherwise than written, and what will fall short."""
    for kind, texts in (("note", loaded.notes), ("warning", warned)):
        for text in texts:
            told(f"{case}: {text}", kind)


def _count(found: list[str]) -> str:
    return f"{len(found)} warning{'s' if len(found) > 1 else ''}"


@main.command(short_help="The paper's figures anew, its claims judged.")
@click.option(
    "-o",
    "--out",
    type=click.Path(),
    default="outputs/paper",
    show_default=True,
    help="Folder for it.",
)
def paper(out: str) -> None:
    """Draw the paper's Figures 3-6 anew, and judge its claims by closure."""
    from wavesim.paper.claims import CLOSURES
    from wavesim.paper.reproduction import reproduce
    from wavesim.report.progress import counted

    try:
        with counted("figures") as tell:
            result = reproduce(Path(out), tell=tell)
    except OSError as error:
        stop(*unwritable(error, f"--out {out}"))
    click.echo("claim  " + "  ".join(f"{closure:<10}" for closure in CLOSURES))
    for claim in result["claims"]:
        verdicts = "  ".join(f"{claim['verdicts'][closure]:<10}" for closure in CLOSURES)
        click.echo(f"{claim['number']:>5}  {verdicts}")
    click.echo(f"Page, figures and numbers in {out}")


def entry() -> None:
    """The command: as :func:`main`, but that it ends at once, and never by a traceback.

    jax takes half a second to take itself down; all that a command writes is written before.
    """
    code: Any = 0
    # Matrices are small here: threads that wait for each other's parts keep all cores busy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        if not sys.warnoptions:
            warnings.simplefilter("ignore")  # what is amiss a command says itself
            sys.warnoptions.append("ignore")  # and of processes beside it too
        main()
    except SystemExit as ended:
        code = ended.code
    except BaseException as error:
        code = failed(error)
    with suppress(OSError, ValueError):  # whoever read it may be gone
        sys.stdout.flush()
        sys.stderr.flush()
    end_all()
    os._exit(code if isinstance(code, int) else bool(code))


_COMMANDS = (
    animate,
    attenuation,
    bands,
    cases,
    compare,
    completion,
    design,
    dispersion,
    figures_of,
    fit,
    gaps,
    init,
    inspect,
    pulse,
    schema,
    score,
    sweep,
    synthesize,
    transmission,
)
for _command in _COMMANDS:
    main.add_command(_command)


if __name__ == "__main__":
    entry()
