"""Axes of every figure of bands: sector colours, shaded gaps, and SI beside ω̄ and k̄."""

from __future__ import annotations

import math
from typing import Any

from matplotlib import colormaps
from matplotlib.axes import Axes

from wavesim.material.medium import Medium
from wavesim.planewave.dispersion_relation import full_gaps, gaps

_VIRIDIS = colormaps["viridis"]
SECTOR_COLOURS = {
    "longitudinal": _VIRIDIS(0.05),
    "transverse2": _VIRIDIS(0.45),
    "inplane": _VIRIDIS(0.72),
}
LINE_STYLES = ("-", "--", "-.")
GAP_GREY = "0.87"
TITLES = {
    "longitudinal": "longitudinal",
    "transverse2": "transverse (two alike)",
    "inplane": "in-plane shear",
}


def shade_gaps(axes: Axes, medium: Medium, sector: str, label: bool = True) -> None:
    """Shade the gaps of one sector on axes with ω̄ upwards, each with its name."""
    scale = float(medium.time_scale)
    for gap in gaps(medium, sector):
        if gap.upper > gap.lower:
            low, high = gap.lower * scale, gap.upper * scale
            axes.axhspan(low, high, facecolor=GAP_GREY, edgecolor="none", zorder=0)
            if label:
                axes.text(
                    0.97,
                    (low + high) / 2,
                    gap.name,
                    transform=axes.get_yaxis_transform(),
                    ha="right",
                    va="center",
                    fontsize=8,
                    color="0.2",
                    bbox={"facecolor": GAP_GREY, "edgecolor": "none", "pad": 0.6},
                )


def hatch_full_gaps(axes: Axes, medium: Medium) -> None:
    """Hatch the frequencies at which no wave of any sector propagates, ω̄ upwards."""
    scale = float(medium.time_scale)
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


def _scaled(factor: float) -> tuple[Any, Any]:
    """A linear axis transform and its inverse."""
    return (lambda value: value * factor, lambda value: value / factor)


def add_hertz_axis(axes: Axes, medium: Medium) -> None:
    """Frequency in kHz on the right, beside ω̄ on the left."""
    per_bar = 1e-3 / (2 * math.pi * float(medium.time_scale))
    axes.secondary_yaxis("right", functions=_scaled(per_bar)).set_ylabel("frequency (kHz)")


def add_wavenumber_axis(axes: Axes, medium: Medium) -> None:
    """Wavenumber in rad/mm at the top, beside k̄ at the bottom."""
    per_bar = 2e-3 * math.pi / float(medium.length_scale)
    top = axes.secondary_xaxis("top", functions=_scaled(per_bar))
    top.set_xlabel("k (rad/mm)", fontsize=8)
    top.tick_params(labelsize=8)
