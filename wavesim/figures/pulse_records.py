"""Figures of pulse tests of single receivers: what was heard, arrivals in it, a series' law."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from wavesim.figures import pulse_test
from wavesim.figures.style import FOUND, POINT, THEORY, Drawings, as_written, legend_entries
from wavesim.material.shown import with_error
from wavesim.readings.pulse.reading import Reading
from wavesim.readings.pulse.series_reading import Series

_GREY = "#8a949e"
_MOST_SHOWN = 24


def drawings(readings: Sequence[Reading], series: Series | None) -> Drawings:
    """Figures of what was read, by name, not drawn yet."""
    found: Drawings = {}
    own = [i for i, one in enumerate(readings) if one.record is not None]
    if own:
        single = [readings[i] for i in own]
        varied = (None, "") if series is None else (series.values[own], series.parameter)
        found["pulse_records"] = partial(waveforms, single, *varied)
    if series is not None and any(one.best.valid for one in readings):
        found["pulse_series"] = partial(law, readings, series)
    several = [one.result for one in readings if one.result is not None]
    for number, result in enumerate(several, start=1):
        tail = f"_{number}" if len(several) > 1 else ""
        found[f"pulse_section{tail}"] = partial(pulse_test.record_section, result)
        found[f"pulse_velocities{tail}"] = partial(pulse_test.velocities_and_losses, result)
    return found


def waveforms(
    readings: Sequence[Reading], values: np.ndarray | None = None, name: str = ""
) -> Figure:
    """Signals one above the other, each to its own peak, from what was sent on, with the arrivals.

    Args:
        readings: of single receivers.
        values: of what they differ in, which orders them; their own order where None.
        name: of it.
    """
    order = np.argsort(values, kind="stable") if values is not None else np.arange(len(readings))
    order = order[:: -(-len(order) // _MOST_SHOWN)]
    figure = Figure(figsize=(6.6, 1.7 + 0.42 * max(len(order), 3)))
    axes = figure.subplots()
    last = 0.0
    ticks = []
    for row, index in enumerate(order.tolist()):
        one = readings[index]
        record = one.record
        assert record is not None
        tau = (record.t - record.start) * 1e3
        u = record.got / (float(np.abs(record.got).max()) or 1.0)
        begun = tau >= -0.05 * tau[-1]
        axes.plot(tau[begun], row + 0.45 * u[begun], color="#37424d", lw=0.8)
        if record.crosstalk:
            raw = (record.raw + record.crosstalk_taken) / (float(np.abs(record.got).max()) or 1.0)
            hidden = (record.t >= record.start) & (record.t <= record.blank)
            axes.plot(tau[hidden], row + 0.45 * np.clip(raw[hidden], -1, 1), color=_GREY, lw=0.7,
                      label="crosstalk, left out")  # fmt: skip
        best = one.best
        shift = one.receivers[0].arrivals
        if np.isfinite(best.time) and shift:
            at = best.time + one.delay
            axes.errorbar(
                at * 1e3, row, xerr=best.error * 1e3, fmt="|", ms=14, mew=1.6, elinewidth=1.0,
                color=FOUND if best.valid else _GREY,
                label="direct wave ± standard error" if best.valid else "refused", zorder=4,
            )  # fmt: skip
            last = max(last, 3.4 * at * 1e3)
        for packet in one.packets:
            named = bool(packet.wave) and packet.name != "reflected"
            if packet.name != "direct" and (named or packet.size >= 0.15):
                # Ahead of a larger packet a break is vague.
                place = packet.top if named else packet.begins
                label = f"top of a {packet.name}" if named else "other packets"
                axes.plot(place * 1e3, row - 0.3, "^", ms=4, mec=THEORY, mew=0.8,
                          mfc=THEORY if named else "white", label=label)  # fmt: skip
        ticks.append(
            f"{values[index]:g}" if values is not None else as_written(Path(one.file).stem[-24:])
        )
    axes.set_yticks(range(len(ticks)), ticks)
    high = last if last else float(tau[-1])
    axes.set(xlim=(-0.04 * high, min(high, float(tau[-1]))), ylim=(-0.7, len(order) - 0.3),
             xlabel="time after what was sent begins (ms)", ylabel=name)  # fmt: skip
    figure.legend(*legend_entries(axes), loc="outside upper center", ncols=4)
    return figure


def law(readings: Sequence[Reading], series: Series) -> Figure:
    """Velocities of a series with its power law."""
    figure = Figure(figsize=(5.4, 3.8))
    axes = figure.subplots()
    valid = np.array([one.best.valid for one in readings])
    v = np.array([one.best.velocity for one in readings])
    e = np.array([one.best.velocity_error for one in readings])
    p = series.values
    found = series.law
    aside = np.zeros(len(v), bool)
    if found is not None:
        aside[list(found.outliers)] = True
        curve = np.geomspace(p[valid].min(), p[valid].max(), 100)
        told = (
            f"V = a p$^b$, p the {series.parameter}\n"
            f"a = {with_error(found.a, found.a_error)} m/s, "
            f"b = {with_error(found.b, found.b_error)}"
        )
        axes.plot(curve, found.a * curve**found.b, "-", color=THEORY, lw=1.0, label=told)
        axes.set(xscale="log", yscale="log")
    for own, mark, label in (
        (valid & ~aside, "o", "measured ± standard error"),
        (aside, "x", "set aside"),
    ):
        if own.any():
            axes.errorbar(p[own], v[own], e[own], fmt=mark, **POINT, mec=FOUND, ecolor=FOUND,
                          elinewidth=0.8, label=label)  # fmt: skip
    axes.set(xlabel=series.parameter, ylabel="velocity (m/s)")
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            axis.set_major_locator(LogLocator(subs=(1, 1.5, 2, 3, 5, 7)))
            axis.set_minor_formatter("")
        axis.set_major_formatter("{x:g}")
    figure.legend(loc="outside upper center", ncols=3)
    return figure
