"""Figure of what layers let through at real frequencies, with the gaps of their media."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wavesim.figures.style import FOUND, THEORY, gap_edges, legend_entries, shade
from wavesim.material.shown import decibels

if TYPE_CHECKING:  # a run's pictures need none of the studies
    from wavesim.layered.transmission import Transmission
    from wavesim.studies.transmission_study import Study

_REFLECTED = "#2f6f9f"
_DEEPEST = -120.0


def transmission_figure(study: Study) -> Figure:
    """T and R in dB against frequency, one panel for each sector.

    Curves that are alike, as those of the two transverse sectors, share a panel.
    """
    masks = [band for band, *_ in study.bands]
    panels: list[tuple[list[str], Transmission]] = []
    for sector, curve in study.curves.items():
        for names, other in panels:
            if np.allclose(curve.T, other.T, atol=1e-9, equal_nan=True):
                names.append(sector)
                break
        else:
            panels.append(([sector], curve))
    figure = Figure(figsize=(6.8, 0.9 + 2.7 * len(panels)))
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    inner = {medium for layer in study.specimen.inside for medium in layer.ends}
    for axis, (names, curve) in zip(axes, panels, strict=True):
        if len(inner) == 1 and not masks:  # the gaps of several are no specimen's
            shade(axis, gap_edges(next(iter(inner)), names[0]))
        f = study.frequency / 1e3
        # Where the half-space has a gap no wave comes in, and ratios to one say nothing.
        dark = ~np.isfinite(curve.power_T) & np.isfinite(curve.power_T).any()
        T, R = (np.where(dark, np.nan, decibels(value, 1.0)) for value in (curve.T, curve.R))
        axis.plot(f, R, "--", color=_REFLECTED, lw=0.9, label="R")
        axis.plot(f, T, "-", color=THEORY, lw=1.2, label="T")
        lowest = max(_DEEPEST, float(np.nanmin(T, initial=0.0)))
        lowest = min(lowest, draw_masks(axis, [mask for mask in masks if mask.sector in names]))
        axis.set(xlim=(f[0], f[-1]), ylim=(1.08 * lowest - 2, 6))
        axis.set_title(" and ".join(names), loc="left")
        axis.set_ylabel("amplitude over incident (dB)")
    axes[-1].set_xlabel("frequency (kHz), real ω")
    figure.legend(*legend_entries(*axes), loc="outside upper center", ncols=4)
    return figure


def draw_masks(axes: Axes, masks: Sequence[Any]) -> float:
    """Where T must not be, of bands with low, high (Hz), at_most and at_least (dB or None).

    Returns:
        A level below the lowest of them, 0 where there is none.
    """
    lowest = 0.0
    told: str | None = "where T must not be (real ω)"
    for mask in masks:
        low, high = mask.low / 1e3, mask.high / 1e3
        for limit, end in ((mask.at_most, 20.0), (mask.at_least, -400.0)):
            if limit is not None:
                ends = [low, high]
                axes.fill_between(ends, limit, end, color=FOUND, alpha=0.15, lw=0, label=told)
                told = None
                axes.plot(ends, [limit] * 2, "-", color=FOUND, lw=1.2)
                lowest = min(lowest, limit - 15)
        if mask.at_most is None and mask.at_least is None:
            axes.axvspan(low, high, color=FOUND, alpha=0.08, lw=0)
    return lowest
