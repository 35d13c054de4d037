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
    from wavesim.case.schema import CaseError
    from wavesim.io.result_reader import StorageError
    from wavesim.records.run_folder import open_run
    from wavesim.runner import begun_beside, measure

    target = Path(out) if out else Path(folder) / "figures"
    with begun_beside() as beside:
        try:
            run = open_run(folder)
            whole = run.status == "complete"
            found = measure(run.case, run.field).shown if whole else None
            job = beside.each("wavesim.figures.drawing.some", target, run.field, found, only, kind)
            written = [path for paths in job.result() for path in paths]
        except (StorageError, CaseError) as error:
            stop(str(error), BAD_INPUT)
        except KeyError as error:
            name, known = error.args
            more = "" if whole else "; the others need a run that came to its end"
            stop(f"--only {name}: must be one of {', '.join(known)}{more}", BAD_INPUT)
        except OSError as error:
            stop(f"--out {target}: can't be written: {error.strerror}", BAD_INPUT)
    if not whole:
        click.echo(
            f"wavesim: warning: {folder}: the run is {run.status}, so only its field is drawn; "
            "wavesim run --resume carries it on",
            err=True,
        )
    click.echo(f"{', '.join(sorted(path.name for path in written))} in {target}")
