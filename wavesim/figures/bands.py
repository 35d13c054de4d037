"""Figure of the real and complex bands of a medium, with SI and non-dimensional axes."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wavesim.figures.band_axes import (
    LINE_STYLES,
    SECTOR_COLOURS,
    TITLES,
    add_hertz_axis,
    add_wavenumber_axis,
    hatch_full_gaps,
    shade_gaps,
)
from wavesim.material.medium import Medium
from wavesim.material.sectors import blocks_of
from wavesim.planewave.dispersion_relation import block_frequencies, gaps, wavenumber


def _complex_panel(axes: Axes, medium: Medium, sector: str, omega_bar: np.ndarray) -> None:
    k = wavenumber(medium, sector, omega_bar / medium.time_scale)
    decay = k.imag * float(medium.length_scale) / (2 * math.pi)
    decay[decay <= 0] = np.nan
    axes.plot(decay, omega_bar, color=SECTOR_COLOURS[sector], lw=1.6)
    axes.set_xlabel("Im $\\bar k$")


def _real_panel(axes: Axes, medium: Medium, sector: str, k_bar: np.ndarray) -> None:
    k = k_bar * 2 * math.pi / float(medium.length_scale)
    bands = [
        (name, branch)
        for block in blocks_of(sector)
        for name, branch in zip(block.branches, block_frequencies(medium, block, k).T, strict=True)
    ]
    for (name, omega), style in zip(bands, LINE_STYLES, strict=True):
        omega_bar = omega * float(medium.time_scale)
        axes.plot(k_bar, omega_bar, color=SECTOR_COLOURS[sector], ls=style, lw=1.6, label=name)
    axes.set_xlabel("$\\bar k = kl/2\\pi$")


def band_figure(
    medium: Medium, k_bar_max: float = 0.5, omega_bar_max: float | None = None
) -> Figure:
    """Real bands ω(k) and complex bands k(ω) of every sector, side by side.

    For the longitudinal and the transverse waves the left panel is Im k of the one root that
    decays, the right panel the real branches; the in-plane waves have no propagating root.

    Args:
        medium: the medium.
        k_bar_max: largest k̄ shown, –.
        omega_bar_max: largest ω̄ shown, –; a little above the highest gap by default.

    Returns:
        The figure, not yet saved.
    """
    sectors = ("longitudinal", "transverse2", "inplane")
    edges = [gap.upper for sector in sectors for gap in gaps(medium, sector)]
    top = omega_bar_max or 1.45 * max(edges) * float(medium.time_scale)
    k_bar = np.linspace(0.0, k_bar_max, 601)
    omega_bar = np.linspace(1e-3 * top, top, 4001)

    figure = Figure(figsize=(11.5, 5.2), layout="constrained")
    panels = figure.subplots(1, 5, sharey=True, gridspec_kw={"width_ratios": [1, 1.7, 1, 1.7, 1.7]})
    for sector, (left, right) in zip(sectors, (panels[:2], panels[2:4]), strict=False):
        _complex_panel(left, medium, sector, omega_bar)
        _real_panel(right, medium, sector, k_bar)
        left.set_xlim(k_bar_max, 0.0)
        left.set_title("evanescent", fontsize=9)
        right.set_title(TITLES[sector], fontsize=10)
        shade_gaps(left, medium, sector, label=False)
        shade_gaps(right, medium, sector)
    _real_panel(panels[4], medium, "inplane", k_bar)
    panels[4].set_title(TITLES["inplane"], fontsize=10)
    shade_gaps(panels[4], medium, "inplane")
    for axes in panels:
        hatch_full_gaps(axes, medium)
        add_wavenumber_axis(axes, medium)
        axes.set_ylim(0.0, top)
    for axes in (panels[1], panels[3], panels[4]):
        axes.set_xlim(0.0, k_bar_max)
        axes.legend(loc="lower right", fontsize=8, framealpha=0.95)
    panels[0].set_ylabel("$\\bar\\omega$")
    add_hertz_axis(panels[4], medium)
    figure.suptitle(
        f"closure {medium.closure}, a = {float(medium.anisotropy):g}, "
        f"η = {float(medium.stiffness_ratio):g};  grey: gap, hatched: no wave of any kind",
        fontsize=10,
    )
    return figure
