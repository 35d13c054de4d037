"""wavesim bands and wavesim gaps: what the plane-wave solver says of the media of a case.

A case needs no more than its [medium] for that, or its [[layers]].
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from wavesim.cli.arguments import (
    BAND,
    CASE,
    JSON,
    NUMBER,
    OUT,
    SET,
    folder_for,
    print_json,
    read_layers,
    write_json,
    write_table,
    writing,
)
from wavesim.report.terminal import BAD_INPUT, console, stop

_POINTS = 101
# Media of one case whose bands are told; nobody reads more.
_TOLD, _STORED = 12, 200


def distinct(known: Any) -> list[tuple[str, float | None, Any]]:
    """Each medium of a case once: where it is first, in words and in m, and the medium.

    Args:
        known: what has a medium and, or None, layers: the material of a case, a simulation.
    """
    layers = known.layers.layers if known.layers is not None else ()
    if len(layers) < 2 and not any(layer.last for layer in layers):
        return [("", None, known.medium)]
    found: dict[Any, tuple[str, float | None, Any]] = {}
    for number, layer in enumerate(layers, start=1):
        for medium, at, word in (
            (layer.medium, layer.start, "from"),
            (layer.last, layer.end, "to"),
        ):
            if medium is not None and medium not in found:
                found[medium] = f"Layer {number}, {word} {at * 1e3:.6g} mm", at, medium
    return list(found.values())


def print_bands(medium: Any) -> None:
    """Branches and gaps of a medium, as a table."""
    from wavesim.material.shown import HERTZ
    from wavesim.planewave import bands as content
    from wavesim.planewave.dispersion_relation import full_gaps
    from wavesim.report import tables

    to_bar = float(medium.time_scale)
    free = [
        (low * HERTZ, high * HERTZ, low * to_bar, high * to_bar)
        for low, high in full_gaps(medium, divided=False)
    ]
    tables.bands(console(), content.table(medium), free, HERTZ / to_bar)


def print_all_bands(known: Any) -> None:
    """Those of the first media of a case, each under the layer it is first in."""
    found = distinct(known)
    for place, _, medium in found[:_TOLD]:
        if place:
            click.echo(f"\n{place}:")
        for part in medium.parts:
            if len(medium.parts) > 1:
                click.echo(f"\n{part.family.name.capitalize()}:")
            print_bands(part)
        if len(medium.parts) > 1:
            _print_full_gaps(medium)
    _leave_out(len(found))


def _print_full_gaps(medium: Any) -> None:
    """Where no wave of any of its families propagates."""
    from wavesim.material.shown import KHZ
    from wavesim.planewave.dispersion_relation import full_gaps

    free = [
        f"{low * KHZ:.2f} – {high * KHZ:.2f} kHz" for low, high in full_gaps(medium, divided=False)
    ]
    if free:
        click.echo(f"\nNo wave of any family propagates between {', '.join(free)}.")
    else:
        click.echo("\nAt every frequency some wave of one family or another propagates.")


def _leave_out(media: int) -> None:
    """Say how many of a case's media are not told of."""
    if media > _TOLD:
        click.echo(f"\n{media - _TOLD} more media are left out; ask about fewer layers at a time.")


@click.command(short_help="Branches and gaps of a medium, or of each layer's.")
@CASE
@click.option("-o", "--out", type=click.Path(), help="Folder to write bands.json and bands.png to.")
@JSON
@SET
def bands(case: str, out: str | None, as_json: bool, overrides: tuple[str, ...]) -> None:
    """Branches and gaps of CASE's medium, or of each layer's, by the plane-wave solver alone.

    CASE needs no more than [medium]. The JSON object is of [medium]; where there are layers it has
    one more of each under "layers", of the first 200 media.
    """
    known = read_layers(case, overrides)
    from wavesim.planewave import bands as content

    media, answer = distinct(known), {}
    if as_json or out:
        answer = content.summary(known.medium)
        if len(media) > 1:
            answer["layers"] = [
                {"place": place, "position": at} | content.summary(medium)
                for place, at, medium in media[:_STORED]
            ]
    if as_json:
        print_json(answer)
    else:
        print_all_bands(known)
    if out:
        from wavesim.figures.bands import band_figure
        from wavesim.figures.style import write

        folder = Path(out)
        with writing(folder):
            write_json(folder / "bands.json", answer, indent=None)
            for number, (_, _, medium) in enumerate(media[:_TOLD], start=1):
                name = "bands" if len(media) == 1 else f"bands_{number}"
                write({name: partial(band_figure, medium)}, folder)


def _tell_covering(found: Any, band: tuple[float, float]) -> None:
    """Which gaps hold all of a band, over how much of the map, and the best place of each."""
    import numpy as np

    from wavesim.material.shown import KHZ
    from wavesim.planewave.gap_map import room

    ends = "{:g} to {:g} kHz".format(*(end * 1e-3 for end in band))
    keys, inside = found["status"].dims, room(found, band)
    for name in found["gap"].values:
        own = inside.sel(gap=name).values
        if not (own >= 0).any():
            continue
        at = dict(zip(keys, np.unravel_index(int(np.nanargmax(own)), own.shape), strict=True))
        there = found.isel(at).sel(gap=name)
        place = ", ".join(f"{key} = {float(there[key]):.4g}" for key in keys)
        low, high = (KHZ * float(there[side]) for side in ("lower", "upper"))
        click.echo(
            f"{name} holds {ends} over {100 * np.mean(own >= 0):.3g} % of the map; best at "
            f"{place}: {low:.4g} to {high:.4g} kHz"
        )
    if not (inside >= 0).any():
        click.echo(f"no gap holds all of {ends} anywhere on the map: take other keys or ranges")


_AXIS = (str, NUMBER, NUMBER)


@click.command(short_help="Map the gaps of a medium over two parameters.")
@CASE
@click.option(
    "--x",
    type=_AXIS,
    default=("anisotropy", 0.0, 1.0),
    show_default="anisotropy 0 1",
    metavar="KEY FROM TO",
    help="Abscissa.",
)
@click.option(
    "--y",
    type=_AXIS,
    default=("stiffness_ratio", 0.0, 1.0),
    show_default="stiffness_ratio 0 1",
    metavar="KEY FROM TO",
    help="Ordinate.",
)
@click.option("--points", type=click.IntRange(2, 2000), default=_POINTS, show_default=True)
@BAND
@OUT
@SET
def gaps(
    case: str,
    x: tuple[str, float, float],
    y: tuple[str, float, float],
    points: int,
    band: tuple[float, float] | None,
    out: str | None,
    overrides: tuple[str, ...],
) -> None:
    """Map the gaps of CASE's medium over two parameters: gap_map.csv and gap_map.png.

    With --band each gap is told, and hatched in the map, where it holds all of that band.

    CASE needs no more than [medium]. Where there are layers each distinct medium has a map of its
    own: gap_map_1, gap_map_2, …
    """
    media = distinct(read_layers(case, overrides))
    import numpy as np

    from wavesim.figures.style import write
    from wavesim.figures.sweep import sweep_figures
    from wavesim.planewave.gap_map import gap_map, table

    folder = folder_for(out, case)
    for number, (place, _, medium) in enumerate(media[:_TOLD], start=1):
        try:
            found = gap_map(
                medium,
                (x[0].removeprefix("medium."), np.linspace(x[1], x[2], points)),
                (y[0].removeprefix("medium."), np.linspace(y[1], y[2], points)),
            )
        except ValueError as error:
            stop(str(error), BAD_INPUT)
        found.attrs["band"] = band
        header, rows = table(found)
        name = "gap_map" if len(media) == 1 else f"gap_map_{number}"
        with writing(folder):
            write_table(folder / f"{name}.csv", header, rows, fmt="%.6g")
            write({name: sweep_figures(found)["gaps"]}, folder)
        told = f"{place}: " if place else ""
        click.echo(f"{told}{name}.csv and {name}.png in {folder}")
        if band is not None:
            _tell_covering(found, band)
    _leave_out(len(media))
