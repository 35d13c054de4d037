"""The command `wavesim transmission`: exact T and R of a case's layers, no simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from wavesim.cli.arguments import (
    BAND,
    CASE,
    JSON,
    OUT,
    SET,
    folder_for,
    print_json,
    read_layers,
    write_json,
    write_table,
    writing,
)
from wavesim.report.terminal import BAD_INPUT, console, new_table, stop

_ROWS = 12


@click.command(short_help="What a case's layers let through, without a run.")
@CASE
@BAND
@click.option("--points", type=click.IntRange(2, 100_000), default=400, show_default=True)
@OUT
@JSON
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
    from wavesim.studies.transmission_study import transmission_study

    known = read_layers(case, overrides)
    try:
        study = transmission_study(known, band, points)
    except ValueError as error:
        stop(f"{case}: {error}", BAD_INPUT)
    answer = study.summary()
    if as_json:
        print_json(answer)
    if out or not as_json:
        folder = folder_for(out, case)
        _write(study, answer, folder)
        if not as_json:
            _tell(study)
            click.echo(f"transmission.json, .csv and .png in {folder}")


def _write(study: Any, answer: Any, folder: Path) -> None:
    from wavesim.figures.bar import transmission_figure
    from wavesim.figures.style import write

    with writing(folder):
        write_json(folder / "transmission.json", answer, indent=None)
        write_table(folder / "transmission.csv", *study.table())
        write({"transmission": lambda: transmission_figure(study)}, folder)


def _tell(study: Any) -> None:
    """A few frequencies of each sector, bands asked for, gaps of the layers there, and notes."""
    import numpy as np

    from wavesim.studies.transmission_study import kept, level

    out = console()
    alike: dict[bytes, list[str]] = {}
    for sector, curve in study.curves.items():
        alike.setdefault(curve.T.tobytes(), []).append(sector)
    # Of several families the family stands above its sectors.
    names = ["\n".join(own).replace("-", "\n") for own in alike.values()]
    frequency = study.frequency
    unit, scale = ("kHz", 1e3) if frequency[-1] >= 1e3 else ("Hz", 1.0)
    table = new_table(unit, *(f"{name}\nT, dB" for name in names), words=0)
    levels = [level(study.curves[own[0]].T) for own in alike.values()]
    for n in np.unique(np.linspace(0, len(frequency) - 1, _ROWS).round().astype(int)):
        values = (f"{one[n]:.2f}" if np.isfinite(one[n]) else "no answer" for one in levels)
        table.add_row(f"{frequency[n] / scale:.1f}", *values)
    out.print(table)
    if study.bands:
        bands = new_table("band", "from kHz", "to kHz", "dB", "T from", "to dB", "")
        for band, highest, lowest in study.bands:
            limits = [f"at most {band.at_most:g}"] if band.at_most is not None else []
            limits += [f"at least {band.at_least:g}"] if band.at_least is not None else []
            word = "kept" if kept(band, highest[0], lowest[0]) else "missed"
            ends = f"{band.low / 1e3:g}", f"{band.high / 1e3:g}"
            span = f"{lowest[0]:.2f}", f"{highest[0]:.2f}"
            told = ", ".join(limits) or "–"
            bands.add_row(band.sector, *ends, told, *span, word if limits else "")
        out.print(bands)
    gaps = new_table("layers", "sector", "gap", f"from {unit}", f"to {unit}", words=3)
    alike_gaps: dict[tuple[str, ...], list[str]] = {}
    for where, sector, name, low, high in study.gaps:
        if low < frequency[-1] and high > frequency[0]:  # the files have all
            ends = f"{low / scale:.2f}", f"{high / scale:.2f}"
            alike_gaps.setdefault((where, name, *ends), []).append(sector)
    for (where, *numbers), sectors in alike_gaps.items():
        gaps.add_row(where, "\n".join(sectors), *numbers)
    if gaps.rows:
        out.print(gaps)
    for note in study.notes:
        out.print(f"Note: {note}.")
