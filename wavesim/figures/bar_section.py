"""The figure of what a bar is made of: its layers and ends, what stands where, gaps along it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from wavesim.figures.style import FOUND, title
from wavesim.material.damping import quality
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium
from wavesim.material.shown import KHZ
from wavesim.planewave.dispersion_relation import gaps
from wavesim.simulation.field import Field

_GAP, _ABSORBER, _EDGE = "#aeb8c2", "#f2d7d9", "#55606b"
# Light enough for a letter to be read on, and apart in lightness.
_MEDIA = ("#e9eef2", "#c6dbe8", "#f3e3b8", "#d5e4c3", "#e3cfe0", "#f0cdb8")
_MOST_MEDIA = 8
# A layer is lettered where it takes this part of the bar.
_WIDE = 0.012
# Places at which the gaps of a graded layer are drawn.
_POINTS = 81


def bar_section(field: Field, sectors: Sequence[str]) -> Figure:
    """Layers, ends, sources and receivers along the bar; below, the gaps of each sector."""
    layers, bar = field.layers, field.bar
    kinds = _kinds(layers)
    figure = Figure(figsize=(7.4, 1.9 + 0.17 * min(len(kinds), _MOST_MEDIA) + 2.1 * len(sectors)))
    places, made, *rows = figure.subplots(
        2 + len(sectors), 1, sharex=True, height_ratios=[0.3, 0.4] + [2.4] * len(sectors)
    )
    _stand(places, field)
    _media(made, layers, kinds, (bar.left, bar.right))
    top = field.band * KHZ
    for axes, sector in zip(rows, sectors, strict=True):
        reached = max(top, _gaps(axes, layers, sector))
        for low, high in ((0, bar.clear[0]), (bar.clear[1], layers.length)):
            if high > low:
                axes.axvspan(low * 1e3, high * 1e3, color=_ABSORBER, lw=0, zorder=-2)
        for edge in layers.interfaces:
            axes.axvline(edge * 1e3, color=_EDGE, lw=0.5)
        for source in field.sources:
            if np.isfinite(source.peak_frequency):
                axes.axhline(source.peak_frequency / 1e3, color=FOUND, lw=0.9, ls="--")
        axes.set_title(f"gaps, {title(layers.first.family.blocks_of(sector))}")
        axes.set(ylabel="ω/2π (kHz)", ylim=(0, reached))
    rows[-1].set(xlabel="x (mm)", xlim=(0, layers.length * 1e3))
    figure.legend(handles=_key(field), loc="outside upper center", ncols=5)
    figure.legend(
        handles=[Patch(facecolor="none", label=text) for text in _told(kinds)],
        loc="outside lower left", fontsize=7, handlelength=0, handletextpad=0, labelspacing=0.25,
    )  # fmt: skip
    return figure


Kind = tuple[Medium, Medium | None]


def _kinds(layers: Layers) -> list[Kind]:
    """What layers are of: each medium, or pair that one is graded between, once."""
    return list(dict.fromkeys((layer.medium, layer.last) for layer in layers.layers))


def _stand(axes: Axes, field: Field) -> None:
    """A lane with sources and receivers."""
    for source in field.sources:
        axes.plot(source.position * 1e3, 0.5, "v", mfc="white", mec="k", ms=6, clip_on=False)
    for position in field.receivers.values():
        axes.plot(position * 1e3, 0.5, "^", color=FOUND, ms=4.5, clip_on=False)
    axes.set(ylim=(0, 1), yticks=[])
    axes.tick_params(bottom=False)
    for side in ("top", "left", "right", "bottom"):
        axes.spines[side].set_visible(False)


def _media(axes: Axes, layers: Layers, kinds: Sequence[Kind], ends: tuple[str, str]) -> None:
    """A lane with the layers, lettered by what they are of, and the ends beside it."""
    for layer in layers.layers:
        number = kinds.index((layer.medium, layer.last))
        axes.axvspan(
            layer.start * 1e3, layer.end * 1e3, facecolor=_MEDIA[number % len(_MEDIA)],
            edgecolor=_EDGE, lw=0.5, hatch="///" if layer.last else None,
        )  # fmt: skip
        if layer.thickness >= _WIDE * layers.length:
            axes.text(
                (layer.start + layer.end) * 500, 0.47, _letter(number), ha="center", va="center",
                fontsize=7, bbox=_plate(layer, number),
            )  # fmt: skip
    for place, name, side in ((-0.008, ends[0], "right"), (1.008, ends[1], "left")):
        axes.text(place, 0.5, name, ha=side, va="center", fontsize=7, transform=axes.transAxes)
    axes.set(ylim=(0, 1), yticks=[])
    axes.tick_params(bottom=False)


def _plate(layer: Layer, number: int) -> dict[str, Any] | None:
    """What a letter stands on where there are hatches."""
    colour = _MEDIA[number % len(_MEDIA)]
    return {"facecolor": colour, "linewidth": 0, "pad": 1.2} if layer.last else None


def _gaps(axes: Axes, layers: Layers, sector: str) -> float:
    """Shade a sector's gaps along the bar; where the highest ends, with room, kHz."""
    places = [
        (x, layer.at(float(x)))
        for layer in layers.layers
        for x in np.linspace(layer.start, layer.end, 2 if layer.last is None else _POINTS)
    ]
    x, media = np.array([x for x, _ in places]), [medium for _, medium in places]
    known = {medium: gaps(medium, sector) for medium in dict.fromkeys(media)}
    top = 0.0
    for number, first in enumerate(known[media[0]]):
        edges = np.array([(known[m][number].lower, known[m][number].upper) for m in media]) * KHZ
        axes.fill_between(x * 1e3, edges[:, 0], edges[:, 1], color=_GAP, lw=0)
        axes.text(
            1.005, edges[-1].mean(), first.name, fontsize=7, va="center",
            transform=axes.get_yaxis_transform(),
        )  # fmt: skip
        top = max(top, 1.05 * float(edges.max()))
    return top


def _key(field: Field) -> list[Any]:
    """Entries of the legend: only of what is there."""
    drawn: dict[str, Any] = {"ls": "", "ms": 5.5}
    found: list[Any] = [
        Line2D([], [], marker="v", mfc="white", mec="k", label="source", **drawn),
    ]
    if field.receivers:
        found.append(Line2D([], [], marker="^", color=FOUND, label="receiver", **drawn))
    if any(np.isfinite(source.peak_frequency) for source in field.sources):
        line = Line2D([], [], color=FOUND, lw=0.9, ls="--", label="peak frequency of a source")
        found.append(line)
    found.append(Patch(color=_GAP, label="band gap"))
    if field.bar.absorber:
        found.append(Patch(color=_ABSORBER, label="absorber"))
    return found


def _letter(number: int) -> str:
    return chr(ord("A") + number) if number < 26 else str(number + 1)


def _told(kinds: Sequence[Kind]) -> list[str]:
    """A line for each: its keys of the case file that differ among them, or the main ones."""
    media = [m for kind in kinds for m in kind if m is not None]
    every = ("closure", *media[0].known())
    names = [name for name in every if len({getattr(m, name) for m in media}) > 1] or every[:3]
    lines = []
    for number, (first, last) in enumerate(kinds[:_MOST_MEDIA]):
        parts = []
        for name in names:
            values = [getattr(m, name) for m in (first, last) if m is not None]
            shown = dict.fromkeys("default" if v is None else _text(v) for v in values)
            parts.append(f"{name} {' → '.join(shown)}")
        lines.append(f"{_letter(number)}:  " + ", ".join(parts) + _losses(first))
    if len(kinds) > _MOST_MEDIA:
        lines.append(f"and {len(kinds) - _MOST_MEDIA} more")
    return lines


def _text(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _losses(medium: Medium) -> str:
    law = medium.damping
    if not law:
        return ""
    if not law.rates:
        return f", mass_damping {law.mass:g} 1/s, stiffness_damping {law.stiffness:g} s"
    middle = float(np.sqrt(law.rates[0] * law.rates[-1]))
    return f", Q {float(quality(law, middle)):.3g} at {middle * KHZ:.3g} kHz"
