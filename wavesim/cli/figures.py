"""wavesim figures and animate: pictures of a run, drawn from its folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from wavesim.cli.arguments import write_table, writing
from wavesim.report.terminal import BAD_INPUT, stop, told

_FOLDER = click.argument("folder", type=click.Path(file_okay=True))


def _incomplete(run: Any) -> None:
    if run.status != "complete":
        told(f"{run.folder}: the run is {run.status}, so only its field is drawn", "warning")


@click.command(short_help="Draw the figures of a run, from its FOLDER.")
@_FOLDER
@click.option("--only", multiple=True, metavar="NAME", help="One figure; may be repeated.")
@click.option("--format", "kind", type=click.Choice(("png", "pdf", "svg", "csv")), default="png",
              show_default=True, help="csv: the receivers' signals as tables.")  # fmt: skip
@click.option("-o", "--out", type=click.Path(), help="Folder for them; FOLDER/figures by default.")
def figures(folder: str, only: tuple[str, ...], kind: str, out: str | None) -> None:
    """Draw the figures of a run from the FOLDER of its results.

    With --format csv the signals at its receivers are written in place of pictures, a table for
    each field, receivers_phi1.csv and so on: times in s, then a column for each receiver, with its
    name, its position in mm and the field's unit in the heading.
    """
    from wavesim.records.run_folder import open_run
    from wavesim.report.progress import counted
    from wavesim.report.run_files import begun_beside, reached
    from wavesim.verdict.judgement import measure

    with begun_beside() as process:
        run = open_run(folder)
        target = Path(out) if out else run.folder / "figures"
        if kind == "csv":
            _write_signals(run.field, only, target)
            return
        beside = reached(run.field.simulation, process)
        found = measure(run.case, run.field).shown if run.status == "complete" else None
        try:
            names = beside.ask("wavesim.figures.drawing.names", run.field, found, only).result()
        except KeyError as error:
            name, known = error.args
            stop(f"--only {name}: must be one of {', '.join(known)}", BAD_INPUT)
        written: list[Path] = []
        with writing(target), counted("figures") as tell:
            jobs = [
                beside.ask("wavesim.figures.drawing.draw", target, run.field, found, name, kind)
                for name in names
            ]
            for job in jobs:
                tell(len(written), len(jobs))
                written.append(job.result())
    _incomplete(run)
    click.echo(f"{', '.join(sorted(path.name for path in written))} in {target}")


def _write_signals(field: Any, only: tuple[str, ...], target: Path) -> None:
    """The receivers' signals, a table for each field."""
    import numpy as np

    tables = {f"receivers_{name}": name for name in field.names}
    if not field.receivers:
        stop("--format csv: the run has no receivers; add [[receivers]] to the case", BAD_INPUT)
    if wrong := [name for name in only if name not in tables]:
        stop(f"--only {wrong[0]}: must be one of {', '.join(tables)}", BAD_INPUT)
    places = sorted(field.receivers.items(), key=lambda item: item[1])
    with writing(target):
        for table in only or tables:
            name = tables[table]
            unit = field.unit(name)
            heads = [f"{receiver} x={x * 1e3:.9g} mm ({unit})" for receiver, x in places]
            signals = [field.at(x, name) for _, x in places]
            rows = np.column_stack([field.t, *signals])
            write_table(target / f"{table}.csv", ["t (s)", *heads], rows, "%.12g")
    click.echo(f"{', '.join(f'{table}.csv' for table in only or tables)} in {target}")


@click.command(short_help="The pulse on its way, as a GIF or MP4, of a run's FOLDER.")
@_FOLDER
@click.option("--field", "name", help="The field shown, such as phi2; the first by default.")
@click.option("--format", "kind", type=click.Choice(("gif", "mp4")), default="gif",
              show_default=True)  # fmt: skip
@click.option("--frames", type=click.IntRange(2, 2000), default=120, show_default=True)
@click.option("--rate", type=click.IntRange(1, 60), default=20, show_default=True, help="A second.")
@click.option("-o", "--out", type=click.Path(), help="The file; FOLDER/FIELD.gif by default.")
def animate(
    folder: str, name: str | None, kind: str, frames: int, rate: int, out: str | None
) -> None:
    """Animate the pulse on its way, from the FOLDER of a run's results."""
    from wavesim.figures.animation import animate as made
    from wavesim.figures.animation import field_of
    from wavesim.records.run_folder import open_run
    from wavesim.report.progress import counted

    run = open_run(folder)
    shown = field_of(run.field, name)
    path = Path(out) if out else run.folder
    if path.is_dir():
        path = path / f"{shown}.{kind}"
    elif path.suffix.lower() not in (".gif", ".mp4"):
        path = path.with_name(f"{path.name}.{kind}")
    with writing(path.parent), counted("frames") as tell:
        made(path, run.field, shown, frames, rate, tell)
    _incomplete(run)
    click.echo(f"{shown} over {run.field.t[-1] * 1e6:.4g} µs in {path}")
