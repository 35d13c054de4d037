"""wavesim bands: what the plane-wave solver says of the media of a case.

A case needs no more than its [medium] for that, or its [[layers]].
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from wavesim.cli.arguments import (
    CASE,
    JSON,
    SET,
    print_json,
    read_layers,
    write_json,
    writing,
)
from wavesim.report.terminal import console

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
