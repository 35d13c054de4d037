"""The command `wavesim transmission`: exact T and R of a case's layers, no simulation."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from wavesim.cli.arguments import CASE, SET
from wavesim.report.terminal import BAD_INPUT, console, stop

_ROWS = 12


@click.command()
@CASE
@click.option("--band", type=(float, float), metavar="F1 F2", help="Frequencies, Hz.")
@click.option("--points", type=click.IntRange(2, 100_000), default=400, show_default=True)
@click.option("--out", type=click.Path(), help="Folder; outputs/<case> by default.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of a table.")
@SET
def transmission(
    case: str,
    band: tuple[float, float] | None,
    points: int,
    out: str | None,
    as_json: bool,
    overrides: tuple[str, ...],
) -> None:
    """What CASE's layers let through and send back at real frequencies, without a simulation.

    T and R are amplitudes over the incident wave, at the faces of what stands between the first and
    the last layer, which go on for ever. Writes transmission.json, .csv and .png.
    """
    from wavesim.case.design_tables import distinct
    from wavesim.case.layered_case import bar_layers
    from wavesim.case.schema import CaseError, read
    from wavesim.studies.transmission_study import transmission_study

    try:
        file = read(case, overrides)
        known = bar_layers(file, case)
    except CaseError as error:
        stop(str(error), BAD_INPUT)
    try:
        asked = distinct([*file.analysis.bands, *file.design.bands])
        study = transmission_study(known, band, points, asked)
    except ValueError as error:
        where = f"--{error}" if str(error).startswith("band") else f"{case}: {error}"
        stop(where, BAD_INPUT)
    answer = json.dumps(study.summary())
    if as_json:
        click.echo(answer)
    if out or not as_json:
        folder = Path(out) if out else Path("outputs") / Path(case).stem
        _write(study, answer, folder)
        if not as_json:
            _tell(study)
            click.echo(f"transmission.json, .csv and .png in {folder}")


def _write(study: Any, answer: str, folder: Path) -> None:
    import numpy as np

    from wavesim.figures.style import write
    from wavesim.figures.transmission import transmission_figure

    masks = [band for band, *_ in study.bands]
    heads, columns = study.table()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "transmission.json").write_text(answer + "\n", encoding="utf-8")
        np.savetxt(
            folder / "transmission.csv", columns, delimiter=",", header=",".join(heads), comments=""
        )
        write({"transmission": lambda: transmission_figure(study, masks)}, folder)
    except OSError as error:
        stop(f"--out {folder}: can't be written: {error.strerror}", BAD_INPUT)


def _tell(study: Any) -> None:
    """A few frequencies of each sector, the gaps of the layers, and notes."""
    import numpy as np
    from rich.table import Table

    from wavesim.studies.transmission_study import decibels, kept

    out = console()
    table = Table(box=None, pad_edge=False)
    for head in ("kHz", *(f"{curve.sector} T, dB" for curve in study.curves)):
        table.add_column(head, justify="right")
    frequency = study.curves[0].frequency
    levels = [decibels(curve.T) for curve in study.curves]
    for n in np.unique(np.linspace(0, len(frequency) - 1, _ROWS).round().astype(int)):
        table.add_row(f"{frequency[n] / 1e3:.1f}", *(f"{level[n]:.2f}" for level in levels))
    out.print(table)
    gaps = Table("layers", "sector", "gap", "from kHz", "to kHz", box=None, pad_edge=False)
    for where, sector, name, low, high in study.gaps:
        gaps.add_row(where, sector, name, f"{low / 1e3:.2f}", f"{high / 1e3:.2f}")
    out.print(gaps)
    if study.bands:
        bands = Table("band", "from kHz", "to kHz", "dB", "T from", "to dB", "", box=None,
                      pad_edge=False)  # fmt: skip
        for band, highest, lowest in study.bands:
            limits = [f"at most {band.at_most:g}"] if band.at_most is not None else []
            limits += [f"at least {band.at_least:g}"] if band.at_least is not None else []
            word = "kept" if kept(band, highest[0], lowest[0]) else "missed"
            ends = f"{band.low / 1e3:g}", f"{band.high / 1e3:g}"
            span = f"{lowest[0]:.2f}", f"{highest[0]:.2f}"
            told = ", ".join(limits) or "–"
            bands.add_row(band.sector, *ends, told, *span, word if limits else "")
        out.print(bands)
    for note in study.notes:
        out.print(f"Note: {note}.")
