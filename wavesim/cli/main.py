"""The commands: arguments, progress and exit codes. Nothing imports this module.

Exit codes: 0 all well; 1 a check of the run fell short; 2 bad input; 3 the integration failed; 130
interrupted from the keyboard.
"""

from __future__ import annotations

import json
import math
import os
import shlex
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from wavesim.cli import record_commands as labcli
from wavesim.cli.compare import compare
from wavesim.cli.figures import figures as figures_of
from wavesim.cli.fit import fit
from wavesim.cli.pulse import pulse
from wavesim.cli.sweep import sweep
from wavesim.report.terminal import BAD_INPUT, FELL_SHORT
from wavesim.report.terminal import console as _console
from wavesim.report.terminal import stop as _stop

NOT_FINITE, INTERRUPTED = 3, 130


def _load(case: str, overrides: tuple[str, ...]) -> Any:
    from wavesim.case.load import load

    return _read(load, case, overrides)


def _medium(case: str, overrides: tuple[str, ...]) -> Any:
    """[medium] of a case that need not be one of a simulation."""
    from wavesim.case.layered_case import load_layers

    return _read(load_layers, case, overrides).medium


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
_SET = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="TABLE.KEY=VALUE",
    help="Lay a value over the case's, such as bar.order=10 or sources.0.field='\"phi2\"'.",
)


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="wavesim")
def main() -> None:
    """Rotation waves in granular bars: simulate, extract dispersion, hold against theory."""


@main.command()
@_CASE
@click.option("--out", type=click.Path(), help="Folder for results; outputs/<case> by default.")
@_SET
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
@_SET
def check(case: str, overrides: tuple[str, ...]) -> None:
    """Say everything about CASE that can be said before integrating."""
    loaded = _load(case, overrides)
    steps = _planned(case, loaded)
    from wavesim.report import tables as report
    from wavesim.verdict.foreseen import warnings

    report.survey(_console(), loaded, steps)
    layers = loaded.simulation.layers.layers
    shown: list[Any] = []
    for number, layer in enumerate(layers, start=1):
        for medium, where in ((layer.medium, "from"), (layer.last, "to")):
            if medium is None or medium in shown:
                continue
            shown.append(medium)
            if len(layers) > 1:
                place = layer.start if where == "from" else layer.end
                click.echo(f"\nLayer {number}, {where} {place * 1e3:g} mm:")
            _print_bands(medium)
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


def _print_bands(medium: Any) -> None:
    from wavesim.planewave import bands as content
    from wavesim.planewave.dispersion_relation import full_gaps
    from wavesim.report import tables as report

    to_hertz, to_bar = 1 / (2 * math.pi), float(medium.time_scale)
    free = [
        (low * to_hertz, high * to_hertz, low * to_bar, high * to_bar)
        for low, high in full_gaps(medium)
    ]
    report.bands(_console(), content.table(medium), free)


@main.command()
@_CASE
@click.option("--out", type=click.Path(), help="Folder to write bands.json and bands.png to.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of tables.")
@_SET
def bands(case: str, out: str | None, as_json: bool, overrides: tuple[str, ...]) -> None:
    """Branches, cutoffs, asymptotes and gaps of CASE's medium, by the plane-wave solver alone."""
    medium = _medium(case, overrides)
    from wavesim.planewave import bands as content

    answer = json.dumps(content.summary(medium))
    if as_json:
        click.echo(answer)
    else:
        _print_bands(medium)
    if out:
        from wavesim.figures.bands import band_figure

        folder = Path(out)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "bands.json").write_text(answer + "\n", encoding="utf-8")
            band_figure(medium).savefig(folder / "bands.png", dpi=160)
        except OSError as error:
            _stop(
                f"--out {out}: can't be written: {error.strerror}; name another folder", BAD_INPUT
            )


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


_AXIS = (str, float, float)


@main.command()
@_CASE
@click.option(
    "--x", type=_AXIS, default=("anisotropy", 0.0, 1.0), metavar="KEY FROM TO", help="Abscissa."
)
@click.option(
    "--y",
    type=_AXIS,
    default=("stiffness_ratio", 0.0, 1.0),
    metavar="KEY FROM TO",
    help="Ordinate.",
)
@click.option("--points", type=click.IntRange(2, 2000), default=200, show_default=True)
@click.option("--out", type=click.Path(), help="Folder; outputs/<case> by default.")
@_SET
def gaps(
    case: str,
    x: tuple[str, float, float],
    y: tuple[str, float, float],
    points: int,
    out: str | None,
    overrides: tuple[str, ...],
) -> None:
    """Map the gaps of CASE's medium over two parameters: gap_map.csv and gap_map.png."""
    medium = _medium(case, overrides)
    import numpy as np

    from wavesim.figures.gap_map import gap_map_figure
    from wavesim.planewave.gap_map import gap_map, table

    try:
        found = gap_map(
            medium,
            (x[0], np.linspace(x[1], x[2], points)),
            (y[0], np.linspace(y[1], y[2], points)),
        )
    except ValueError as error:
        _stop(str(error), BAD_INPUT)
    folder = Path(out) if out else Path("outputs") / Path(case).stem
    header, rows = table(found)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        np.savetxt(
            folder / "gap_map.csv", rows, delimiter=",", header=",".join(header), comments=""
        )
        gap_map_figure(found).savefig(folder / "gap_map.png", dpi=160)
    except OSError as error:
        _stop(f"--out {folder}: can't be written: {error.strerror}", BAD_INPUT)
    click.echo(f"gap_map.csv and gap_map.png in {folder}")


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


for _command in (*labcli.COMMANDS, figures_of, pulse, compare, fit, sweep):
    main.add_command(_command)


if __name__ == "__main__":
    entry()
