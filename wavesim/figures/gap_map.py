"""Maps of the gaps over two parameters of a medium."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from wavesim.figures.style import FOUND
from wavesim.material.parameter import PARAMETERS
from wavesim.material.shown import KHZ
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
