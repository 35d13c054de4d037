"""A measured record over a case's signals, receiver by receiver, with what is left."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from wavesim.figures.style import FOUND, THEORY, as_written
from wavesim.readings.misfit import Comparison

_MOST = 10
_GREY = "#8a949e"


def overlay(found: Comparison) -> Figure:
    """Record, case and residual of each receiver, all on one scale."""
    shown = found.receivers[:_MOST]
    t = found.measured.t * 1e6
    largest = float(np.nanmax(np.abs(found.measured.values - found.measured.values.mean(axis=0))))
    figure = Figure(figsize=(6.8, 1.1 + 1.15 * len(shown)))
    rows = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for j, (axes, one) in enumerate(zip(rows, shown, strict=True)):
        u, there = found.measured.values[:, j], found.simulated[:, j]
        base = float(np.nanmean(u))
        axes.plot(t, (u - base) / largest, color=FOUND, lw=1.1, label="record")
        axes.plot(t, (there - base) / largest, color=THEORY, lw=0.9, ls="--", label="case")
        axes.plot(t, (u - there) / largest, color=_GREY, lw=0.7, label="difference")
        where = f"{as_written(one.name)}\n{one.position * 1e3:.4g} mm"
        axes.set_ylabel(where, rotation=0, ha="right", va="center")
        axes.set_yticks([])
        told = f"{one.residual:.1%} left, {one.arrival * 1e9:+.3g} ns, × {one.amplitude:.3g}"
        axes.text(0.995, 0.94, told, ha="right", va="top", fontsize=7, transform=axes.transAxes)
    rows[-1].set_xlabel("t (µs)")
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure
