"""Axes of every figure of bands: sector colours, shaded gaps, and SI beside ω̄ and k̄."""

from __future__ import annotations

import math

from matplotlib import colormaps
from matplotlib.axes import Axes

from wavesim.figures.style import gap_edges, second_axes, shade
from wavesim.material.family import Family, sector_words
from wavesim.material.medium import Medium
from wavesim.planewave.dispersion_relation import full_gaps

_VIRIDIS = colormaps["viridis"]
SECTOR_COLOURS = (_VIRIDIS(0.05), _VIRIDIS(0.45), _VIRIDIS(0.72))
LINE_STYLES = ("-", "--", "-.")


def heading(family: Family, sector: str) -> str:
    """A sector in words, and how many are like it."""
    same = [s for s in family.sectors if family.gap_names(s) == family.gap_names(sector)]
    return sector_words(*same) + (f" ({len(same)} alike)" if len(same) > 1 else "")


def colour_of(family: Family, sector: str) -> tuple[float, ...]:
    """The colour of a sector among those of its family that differ."""
    return SECTOR_COLOURS[family.unlike.index(sector) % len(SECTOR_COLOURS)]


def shade_gaps(axes: Axes, medium: Medium, sector: str, label: bool = True) -> None:
    """Shade the gaps of one sector on axes with ω̄ upwards, each with its name."""
    edges = gap_edges(medium, sector, float(medium.time_scale))
    shade(axes, edges, upright=False, named=label)


def hatch_full_gaps(axes: Axes, medium: Medium, unit: float | None = None) -> None:
    """Hatch the frequencies at which no wave of any sector propagates: ω times unit, ω̄ if None."""
    scale = float(medium.time_scale) if unit is None else unit
    for low, high in full_gaps(medium):
        axes.axhspan(
            low * scale,
            high * scale,
            facecolor="none",
            edgecolor="0.6",
            hatch="////",
            lw=0,
            zorder=1,
        )


def add_hertz_axis(axes: Axes, medium: Medium) -> None:
    """Frequency in kHz on the right, beside ω̄ on the left."""
    per_bar = 1e-3 / (2 * math.pi * float(medium.time_scale))
    second_axes(axes, None, (per_bar, "frequency (kHz)"))


def add_wavenumber_axis(axes: Axes, medium: Medium) -> None:
    """Wavenumber in rad/mm at the top, beside k̄ at the bottom."""
    per_bar = 2e-3 * math.pi / float(medium.length_scale)
    second_axes(axes, (per_bar, "k (rad/mm)"), None)
    top = axes.child_axes[-1]
    top.xaxis.label.set_fontsize(8)
    top.tick_params(labelsize=8)
