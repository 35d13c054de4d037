"""Figures beyond the paper's: gap maps over two parameters, and waves over directions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from wavesim.figures.style import FOUND
from wavesim.material.medium import Medium
from wavesim.material.parameter import PARAMETERS
from wavesim.material.shown import KHZ
from wavesim.planewave.angle_of_travel import POLARISATIONS, directed_waves
from wavesim.planewave.gap_map import GapMap, edge_families


def _label(name: str) -> str:
    """A parameter of a medium beside an axis."""
    known = PARAMETERS[name]
    words = "" if known.symbol.startswith(name[:2]) else name.replace("_", " ") + " "
    symbol = f"${known.symbol}$" if "_" in known.symbol else known.symbol
    return f"{words}{symbol}" + (f" ({known.unit})" if known.unit else "")


def gap_map_figure(gaps: GapMap, band: tuple[float, float] | None = None) -> Figure:
    """Widths of the gaps and of the widest full gap over two parameters, in kHz.

    Contours are drawn over the colours, so that values can be read in grey; white is closed.

    Args:
        gaps: what :func:`wavesim.planewave.gap_map.gap_map` returned.
        band: rad/s; hatched where a gap holds all of it.
    """
    names, families = (*gaps.lower, "full"), edge_families(gaps.medium)
    x = np.ravel(getattr(gaps.medium, gaps.x))
    y = np.ravel(getattr(gaps.medium, gaps.y))
    rows = -(-len(names) // 3)
    figure = Figure(figsize=(11.0, 3.3 * rows), layout="constrained")
    panels = figure.subplots(rows, 3, sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat[len(names) :]:
        axes.remove()
    for axes, name in zip(panels.flat, names, strict=False):
        title = "widest full gap" if name.endswith("full") else name
        several = len(gaps.medium.parts) > 1
        axes.set_title(f"{title}, {families[name]}" if several else title, fontsize=10)
        width = gaps.width(name) * KHZ
        top = float(np.nanmax(width))
        if not top > 0:
            axes.text(0.5, 0.5, "closed", transform=axes.transAxes, ha="center", va="center")
            continue
        shown = np.ma.masked_invalid(np.where(width > 1e-6 * max(top, 1e-300), width, np.nan))
        image = axes.pcolormesh(x, y, shown, cmap="viridis", vmin=0.0, shading="auto")
        levels = MaxNLocator(7).tick_values(0.0, top)[1:]
        if band is not None and gaps.covers(name, band).any():
            held = gaps.covers(name, band).astype(float)
            axes.contourf(x, y, held, [0.5, 1.5], colors="none", hatches=["xx"])
            axes.contour(x, y, held, [0.5], colors=FOUND, linewidths=1.8)
        lines = axes.contour(x, y, shown.filled(0.0), levels, colors="white", linewidths=0.7)
        axes.clabel(lines, fontsize=7, fmt="%.0f")
        figure.colorbar(image, ax=axes, label="width (kHz)")
    for axes in panels.flat[max(0, len(names) - 3) : len(names)]:  # the lowest of each column
        axes.set_xlabel(_label(gaps.x))
        axes.tick_params(labelbottom=True)
    for axes in panels[:, 0]:
        axes.set_ylabel(_label(gaps.y))
    told = "white: closed"
    if band is not None:
        low, high = (KHZ * end for end in band)
        told += f"; hatched: holds all of {low:g} to {high:g} kHz"
    figure.suptitle(
        f"{gaps.medium.family.name}, closure {gaps.medium.closure}; {told}", fontsize=10
    )
    return figure


# Slowness is shown up to so many times the least: near an asymptote it has no bound.
_SHOWN = 4.0


def direction_figure(medium: Medium, omega_bars: tuple[float, ...] = (0.2, 0.6, 0.75)) -> Figure:
    """Slowness and group velocity of the three waves over directions, one column a frequency.

    Args:
        medium: the medium, as closure "consistent".
        omega_bars: frequencies ω̄; a wave that is evanescent in a direction leaves a break there.
    """
    theta = np.linspace(0.0, 2 * math.pi, 721)
    colours = colormaps["viridis"]((0.05, 0.45, 0.72))
    figure = Figure(figsize=(3.6 * len(omega_bars) + 0.6, 7.4), layout="constrained")
    panels = figure.subplots(2, len(omega_bars), squeeze=False)
    handles: list[Line2D] = []
    for column, omega_bar in zip(panels.T, omega_bars, strict=True):
        waves = directed_waves(medium, omega_bar / float(medium.time_scale), theta)
        slowness = np.where(waves.slowness.imag == 0, waves.slowness.real, np.nan) * 1e6
        shown = min(_SHOWN * float(np.nanmin(slowness)), 1.1 * float(np.nanmax(slowness)))
        slowness = np.where(slowness < _SHOWN * np.nanmin(slowness), slowness, np.nan)
        handles = []
        for i, (colour, dash) in enumerate(zip(colours, ("-", "--", "-."), strict=True)):
            label = POLARISATIONS[i]
            handles += column[0].plot(
                slowness[:, i] * np.cos(theta),
                slowness[:, i] * np.sin(theta),
                color=colour,
                ls=dash,
                lw=1.5,
                label=label,
            )
            column[1].plot(*waves.group_velocity[:, i].T, color=colour, ls=dash, lw=1.5)
        column[0].set_title(f"$\\bar\\omega$ = {omega_bar:g}", fontsize=10)
        for axes, quantity in zip(
            column, ("slowness {} (µs/m)", "group velocity {} (m/s)"), strict=True
        ):
            axes.set_aspect("equal", "box")
            axes.set_xlabel(quantity.format("$x_1$"))
            axes.axhline(0.0, color="0.85", lw=0.6, zorder=0)
            axes.axvline(0.0, color="0.85", lw=0.6, zorder=0)
        column[0].set(xlim=(-shown, shown), ylim=(-shown, shown))
        reach = 1.1 * float(np.nanmax(np.abs(waves.group_velocity)))
        column[1].set(xlim=(-reach, reach), ylim=(-reach, reach))
        column[0].set_ylabel("slowness $x_2$ (µs/m)")
        column[1].set_ylabel("group velocity $x_2$ (m/s)")
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle(
        f"{replace(medium, closure='consistent').in_words}; $x_1$ is the axis of symmetry",
        fontsize=10,
    )
    return figure
