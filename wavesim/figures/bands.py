"""Real and complex bands of a medium; and axes of every figure of bands: sector colours, shaded
gaps, SI beside ω̄ and k̄."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wavesim.figures.style import gap_edges, second_axes, shade
from wavesim.material.family import Family, sector_words
from wavesim.material.medium import Medium
from wavesim.material.shown import KHZ
from wavesim.planewave.dispersion_relation import block_frequencies, full_gaps, gaps, wavenumber

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


def shade_gaps(axes: Axes, medium: Medium, sector: str) -> None:
    """Shade the gaps of one sector on axes with ω̄ upwards, each with its name."""
    shade(axes, gap_edges(medium, sector, float(medium.time_scale)), upright=False)


def hatch_full_gaps(axes: Axes, medium: Medium, unit: float | None = None) -> None:
    """Hatch the frequencies at which no wave of any sector propagates: ω times unit, ω̄ if None."""
    scale = float(medium.time_scale) if unit is None else unit
    hatched: Any = {"facecolor": "none", "edgecolor": "0.6", "hatch": "////", "lw": 0}
    for low, high in full_gaps(medium):
        axes.axhspan(low * scale, high * scale, **hatched, zorder=1)


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


def _complex_panel(axes: Axes, medium: Medium, sector: str, omega: np.ndarray) -> None:
    decay = wavenumber(medium, sector, omega).imag * 1e-3
    decay[decay <= 0] = np.nan
    axes.plot(decay, omega * KHZ, color=colour_of(medium.family, sector), lw=1.6)
    axes.set_xlabel("Im k (rad/mm)")


def _real_panel(axes: Axes, medium: Medium, sector: str, k: np.ndarray) -> None:
    bands = [
        (name, branch)
        for block in medium.family.blocks_of(sector)
        for name, branch in zip(block.branches, block_frequencies(medium, block, k).T, strict=True)
    ]
    for (name, omega), style in zip(bands, itertools.cycle(LINE_STYLES), strict=False):
        axes.plot(
            k * 1e-3, omega * KHZ, color=colour_of(medium.family, sector), ls=style, lw=1.6,
            label=name,
        )  # fmt: skip
    axes.set_xlabel("k (rad/mm)")


def band_figure(
    medium: Medium, k_bar_max: float = 0.5, omega_bar_max: float | None = None
) -> Figure:
    """Real bands ω(k) and complex bands k(ω) of every sector, side by side; a row for each family.

    Where waves travel the left panel is Im k of the one root that decays, the right panel the real
    branches; a sector of micro-fields alone has no propagating root.

    Args:
        medium: the medium.
        k_bar_max: largest k̄ shown, –.
        omega_bar_max: largest ω̄ shown, –; a little above the highest gap by default.

    Returns:
        The figure, not yet saved.
    """
    widths = [_widths(part) for part in medium.parts]
    size = (1.6 * max(map(sum, widths)) + 0.2, 5.2 * len(widths))
    figure = Figure(figsize=size, layout="constrained")
    rows = figure.subfigures(len(widths), 1, squeeze=False)[:, 0]
    for row, part, own in zip(rows, medium.parts, widths, strict=True):
        _of_family(row, part, own, k_bar_max, omega_bar_max)
    return figure


def _widths(medium: Medium) -> list[float]:
    """Of panels: wide ones for real branches, a narrow one of complex k before what travels."""
    family = medium.family
    return [w for s in family.unlike for w in ((1, 1.7) if s in family.travelling else (1.7,))]


def _of_family(
    figure: Any, medium: Medium, widths: list[float], k_bar_max: float, omega_bar_max: float | None
) -> None:
    sectors, travelling = medium.family.unlike, medium.family.travelling
    edges = [gap.upper for sector in sectors for gap in gaps(medium, sector)]
    scale = float(medium.time_scale)
    top = omega_bar_max / scale if omega_bar_max else 1.45 * max(edges)
    end = k_bar_max * 2 * math.pi / float(medium.length_scale)
    k, omega = np.linspace(0.0, end, 601), np.linspace(1e-3 * top, top, 4001)

    panels = figure.subplots(
        1, len(widths), sharey=True, squeeze=False, gridspec_kw={"width_ratios": widths}
    )[0]
    left_over = iter(panels)
    for sector in sectors:
        if sector in travelling:
            left = next(left_over)
            _complex_panel(left, medium, sector, omega)
            left.set_xlim(end * 1e-3, 0.0)
            left.set_title("evanescent", fontsize=9)
            shade(left, gap_edges(medium, sector), upright=False, named=False)
        right = next(left_over)
        _real_panel(right, medium, sector, k)
        right.set_title(heading(medium.family, sector), fontsize=10)
        shade(right, gap_edges(medium, sector), upright=False)
        right.set_xlim(0.0, end * 1e-3)
        right.legend(loc="lower right", fontsize=8, framealpha=0.95)
    for axes in panels:
        hatch_full_gaps(axes, medium, KHZ)
        second_axes(axes, (1e3 * float(medium.length_scale) / 2 / math.pi, "k̄ = k l/2π"), None)
        axes.set_ylim(0.0, top * KHZ)
    panels[0].set_ylabel("ω/2π (kHz)")
    second_axes(panels[-1], None, (scale / KHZ, "ω̄"))
    figure.suptitle(
        f"{medium.in_words};  grey: gap, hatched: no wave of any kind",
        fontsize=10,
    )
