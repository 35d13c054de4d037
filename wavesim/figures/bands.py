"""Figure of the real and complex bands of a medium, with SI and non-dimensional axes."""

from __future__ import annotations

import itertools
import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wavesim.figures.band_axes import (
    LINE_STYLES,
    TITLES,
    add_hertz_axis,
    add_wavenumber_axis,
    colour_of,
    hatch_full_gaps,
    shade_gaps,
)
from wavesim.material.medium import Medium
from wavesim.planewave.dispersion_relation import block_frequencies, gaps, wavenumber


def _complex_panel(axes: Axes, medium: Medium, sector: str, omega_bar: np.ndarray) -> None:
    k = wavenumber(medium, sector, omega_bar / medium.time_scale)
    decay = k.imag * float(medium.length_scale) / (2 * math.pi)
    decay[decay <= 0] = np.nan
    axes.plot(decay, omega_bar, color=colour_of(medium.family, sector), lw=1.6)
    axes.set_xlabel("Im $\\bar k$")


def _real_panel(axes: Axes, medium: Medium, sector: str, k_bar: np.ndarray) -> None:
    k = k_bar * 2 * math.pi / float(medium.length_scale)
    bands = [
        (name, branch)
        for block in medium.family.blocks_of(sector)
        for name, branch in zip(block.branches, block_frequencies(medium, block, k).T, strict=True)
    ]
    for (name, omega), style in zip(bands, itertools.cycle(LINE_STYLES), strict=False):
        omega_bar = omega * float(medium.time_scale)
        axes.plot(
            k_bar, omega_bar, color=colour_of(medium.family, sector), ls=style, lw=1.6, label=name
        )
    axes.set_xlabel("$\\bar k = kl/2\\pi$")


def band_figure(
    medium: Medium, k_bar_max: float = 0.5, omega_bar_max: float | None = None
) -> Figure:
    """Real bands ω(k) and complex bands k(ω) of every sector, side by side.

    Where waves travel the left panel is Im k of the one root that decays, the right panel the real
    branches; a sector of micro-fields alone has no propagating root.

    Args:
        medium: the medium.
        k_bar_max: largest k̄ shown, –.
        omega_bar_max: largest ω̄ shown, –; a little above the highest gap by default.

    Returns:
        The figure, not yet saved.
    """
    sectors, travelling = medium.family.unlike, medium.family.travelling
    edges = [gap.upper for sector in sectors for gap in gaps(medium, sector)]
    top = omega_bar_max or 1.45 * max(edges) * float(medium.time_scale)
    k_bar = np.linspace(0.0, k_bar_max, 601)
    omega_bar = np.linspace(1e-3 * top, top, 4001)

    # Wide panels are real branches; a narrow one of complex k stands before each that travels.
    widths = [w for s in sectors for w in ((1, 1.7) if s in travelling else (1.7,))]
    figure = Figure(figsize=(1.6 * sum(widths) + 0.2, 5.2), layout="constrained")
    panels = figure.subplots(
        1, len(widths), sharey=True, squeeze=False, gridspec_kw={"width_ratios": widths}
    )[0]
    left_over = iter(panels)
    for sector in sectors:
        if sector in travelling:
            left = next(left_over)
            _complex_panel(left, medium, sector, omega_bar)
            left.set_xlim(k_bar_max, 0.0)
            left.set_title("evanescent", fontsize=9)
            shade_gaps(left, medium, sector, label=False)
        right = next(left_over)
        _real_panel(right, medium, sector, k_bar)
        right.set_title(TITLES.get(sector, sector), fontsize=10)
        shade_gaps(right, medium, sector)
        right.set_xlim(0.0, k_bar_max)
        right.legend(loc="lower right", fontsize=8, framealpha=0.95)
    for axes in panels:
        hatch_full_gaps(axes, medium)
        add_wavenumber_axis(axes, medium)
        axes.set_ylim(0.0, top)
    panels[0].set_ylabel("$\\bar\\omega$")
    add_hertz_axis(panels[-1], medium)
    figure.suptitle(
        f"{medium.family.name}, {medium.in_words};  grey: gap, hatched: no wave of any kind",
        fontsize=10,
    )
    return figure
