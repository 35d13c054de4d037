"""wavesim figures: the figures of a run, drawn from its folder."""

from __future__ import annotations

from pathlib import Path

import click

from wavesim.report.terminal import BAD_INPUT, stop

KINDS = ("png", "pdf", "svg")


@click.command()
@click.argument("folder", type=click.Path())
@click.option("--only", multiple=True, metavar="NAME", help="One figure; may be repeated.")
@click.option("--format", "kind", type=click.Choice(KINDS), default="png", show_default=True)
@click.option("--out", type=click.Path(), help="Folder for them; FOLDER/figures by default.")
def figures(folder: str, only: tuple[str, ...], kind: str, out: str | None) -> None:
    """Draw the figures of a run from the FOLDER of its results."""
    from wavesim.runner import RunError, begun_beside, opened

    with begun_beside() as beside:
        target = Path(out) if out else Path(folder) / "figures"
        try:
            run = opened(Path(folder))
            found = run.measured() if run.complete else None
            job = beside.each("wavesim.figures.drawing.some", target, run.field, found, only, kind)
            written = [path for paths in job.result() for path in paths]
        except RunError as error:
            stop(str(error), BAD_INPUT)
        except KeyError as error:
            name, known = error.args
            more = "" if run.complete else "; the others need a complete run"
            stop(f"--only {name}: must be one of {', '.join(known)}{more}", BAD_INPUT)
        except OSError as error:
            stop(f"--out {target}: can't be written: {error.strerror}", BAD_INPUT)
    if not run.complete:
        click.echo(f"wavesim: warning: {folder}: {run.why}", err=True)
    click.echo(f"{', '.join(sorted(path.name for path in written))} in {target}")
