"""Figures of a pulse test: record section, transmission loss, velocities with attenuation and Q."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import NDArray

from wavesim.figures.style import (
    FOUND,
    LABEL,
    POINT,
    THEORY,
    Drawings,
    as_written,
    legend_entries,
    second_axes,
    shade,
)
from wavesim.material.shown import DECIBELS, KHZ, in_frequency, in_time, in_wavenumber, with_error
from wavesim.readings.pulse.measurement import PulseResult
from wavesim.readings.pulse.reading import Best, Reading
from wavesim.readings.pulse.series_law import Series

Gaps = Sequence[tuple[str, float, float]]
Curve = tuple[NDArray[Any], NDArray[Any]]

# By convention: mark, face, edge. They are told apart by shape and filling, not by colour alone.
_MARKS = {
    "first break": ("|", THEORY, THEORY),
    "threshold": ("v", "white", "#0b3954"),
    "envelope": ("o", "white", FOUND),
    "correlation": ("x", "#0b3954", "#0b3954"),
}
_MOST_POINTS = 90
# Per cent of the values at either end that an axis' range may leave out, so that a few wild ones
# near the edges of a gap don't flatten all others.
_WILD = 2.0


def record_section(
    result: PulseResult, best: Best | None, span: tuple[float, float] | None = None
) -> Figure:
    """Signals, each to its own peak and set off by distance, with arrivals and the fitted line.

    Args:
        result: what was read.
        best: the velocity that counts, by the convention whose line is drawn; None for none.
        span: times shown, s; the whole record where None.
    """
    record = result.record
    low, high = span or (float(record.t[0]), float(record.t[-1]))
    counted = best.convention if best else "envelope"
    per, second = in_time(high - low)
    units, length = (1.0, "m") if record.x[-1] >= 10 else (1e3, "mm")
    x = record.x * units
    room = float(np.min(np.diff(x))) * 0.48
    figure = Figure(figsize=(6.6, 1.8 + 0.45 * min(max(len(x), 5), 12)))
    axes = figure.subplots()
    shown = (record.t >= low) & (record.t <= high)
    for j, name in enumerate(record.names):
        u = record.values[:, j] / (np.abs(record.values[:, j]).max() or 1.0)
        axes.plot(record.t[shown] * per, x[j] + room * u[shown], color="#55606b", lw=0.8)
        if len(x) <= 12:
            axes.text(
                1.01, x[j], as_written(name), ha="left", va="center", fontsize=7,
                transform=axes.get_yaxis_transform(),
            )  # fmt: skip
    arrivals = result.arrivals[counted].time
    if best and best.valid and np.isfinite(arrivals).any():
        begin = float(np.nanmean(arrivals - record.x / best.velocity))
        told = with_error(best.velocity, best.velocity_error, "m/s")
        ends = np.array([x[0] - 1.5 * room, x[-1] + 1.5 * room])
        axes.plot(
            (begin + ends / units / best.velocity) * per, ends, "--", color=FOUND, lw=1.0,
            label=f"velocity by {counted}: {told}",
        )  # fmt: skip
    for convention in dict.fromkeys(("first break", counted)):
        mark, face, edge = _MARKS[convention]
        picks = result.arrivals[convention]
        axes.errorbar(
            picks.time * per, x, xerr=np.nan_to_num(picks.error) * per, fmt=mark, mfc=face,
            mec=edge, ecolor=edge, ms=11 if mark == "|" else 5.5, mew=1.4 if mark == "|" else 1.0,
            elinewidth=0.8, label=convention, zorder=3,
        )  # fmt: skip
    axes.set(
        xlim=(low * per, high * per), ylim=(x[0] - 2.2 * room, x[-1] + 2.2 * room),
        xlabel=f"t ({second})", ylabel=f"position ({length})",
    )  # fmt: skip
    figure.legend(loc="outside upper center", ncols=3)
    return figure


def transmission(result: PulseResult, gaps: Gaps = (), exact: Curve | None = None) -> Figure:
    """Transmission between two receivers against frequency.

    Args:
        result: what was read.
        gaps: (name, lowest, highest frequency in kHz), shaded.
        exact: (frequency in kHz, level in dB), drawn as a line.
    """
    loss = result.loss
    frequency = loss.omega * KHZ
    figure = Figure(figsize=(6.2, 3.6))
    axes = figure.subplots()
    shade(axes, gaps)
    levels = [loss.level[loss.valid]]
    if exact is not None:
        axes.plot(*exact, "-", color=THEORY, lw=1.0, label="exact")
    if np.isfinite(loss.floor).any():
        name = "floor: noise, record's end"
        axes.plot(frequency, loss.floor, ":", color="#55606b", lw=1.1, label=name)
        levels.append(loss.floor[np.isfinite(loss.floor) & loss.valid])
    axes.errorbar(
        frequency[loss.valid], loss.level[loss.valid], np.nan_to_num(loss.error[loss.valid]),
        fmt="o", ecolor=FOUND, elinewidth=0.8, label="measured", **POINT, mec=FOUND,
    )  # fmt: skip
    refused = frequency[~loss.valid]
    if len(refused):
        axes.plot(
            refused, np.full(len(refused), 0.03), "|", color="#55606b", ms=6, mew=0.8,
            transform=axes.get_xaxis_transform(), label="does not count",
        )  # fmt: skip
    together = np.concatenate(levels)
    if not len(together):
        _empty(axes)
    else:
        low, high = float(together.min()), float(together.max())
        axes.set_ylim(low - 0.16 * max(high - low, 1), high + 0.12 * max(high - low, 1))
    axes.set(
        xlim=_ends(frequency), xlabel=_at(result),
        ylabel=f"|U({as_written(loss.last)})/U({as_written(loss.first)})| (dB)",
    )  # fmt: skip
    figure.legend(loc="outside upper center", ncols=4)
    return figure


def velocities_and_losses(
    result: PulseResult, gaps: Gaps = (), exact: Mapping[str, Curve] | None = None
) -> Figure:
    """Phase and group velocity, attenuation, and Q, against frequency, with their errors.

    Args:
        result: what was read.
        gaps: (name, lowest, highest frequency in kHz), shaded.
        exact: curves (frequency in kHz, SI values) under any of the keys "phase_velocity",
            "group_velocity", "attenuation" (Np/m), "quality".
    """
    found, exact = result.dispersion, exact or {}
    per, hertz = in_frequency(float(found.omega.max(initial=0.0)))
    share, length = in_wavenumber(float(np.nanmax(found.k.real, initial=0.0)))
    frequency, decibels = found.omega * per, DECIBELS * share
    gaps = [(name, low * per / KHZ, high * per / KHZ) for name, low, high in gaps]
    figure = Figure(figsize=(6.2, 7.4))
    speed, loss, factor = figure.subplots(3, 1, sharex=True, height_ratios=(1.3, 1, 1))
    every = max(1, -(-len(frequency) // _MOST_POINTS))
    parts: tuple[tuple[Axes, str, str, str, str], ...] = (
        (speed, "phase_velocity", "phase_error", "phase velocity", "o"),
        (speed, "group_velocity", "group_error", "group velocity", "^"),
        (loss, "attenuation", "attenuation_error", "", "o"),
        (factor, "quality", "quality_error", "", "o"),
    )
    for axes in (speed, loss, factor):
        shade(axes, gaps, named=axes is speed)
    speed.set_ylabel("velocity (m/s)")
    loss.set_ylabel(f"attenuation (dB/{length})")
    factor.set_ylabel("Q = ω/2α$v_g$")
    seen: dict[Axes, list[Any]] = {speed: [], loss: [], factor: []}
    for axes, name, error_name, label, mark in parts:
        unit = decibels if axes is loss else 1.0
        value, error = unit * getattr(found, name), unit * getattr(found, error_name)
        # A ratio known to no better than half tells nothing; attenuation may well be 0.
        counts = ~(error > 0.5 * np.abs(value)) | (name == "attenuation")
        if axes is not loss:
            for _, low, high in gaps:
                counts &= (frequency < low) | (frequency > high)
        own = np.flatnonzero(counts & np.isfinite(value))[::every]
        colour = FOUND if mark == "o" else "#0b3954"
        axes.errorbar(
            frequency[own], value[own], np.nan_to_num(error[own]), fmt=mark, ecolor=colour,
            elinewidth=0.8, label=label or None, **POINT, mec=colour,
        )  # fmt: skip
        seen[axes].append(value[own])
        if name in exact:
            at, curve = exact[name][0] * per / KHZ, unit * np.asarray(exact[name][1])
            style, told = ("-", "exact") if mark == "o" else ("--", "group velocity, exact")
            axes.plot(at, curve, style, color=THEORY, lw=0.9, label=told)
    for axes, values in seen.items():
        _limit(axes, np.concatenate(values))
    figure.legend(*legend_entries(*seen), loc="outside upper center", ncols=4)
    second_axes(loss, None, (1 / decibels, "Np/m"))
    factor.set(xlim=_ends(frequency), xlabel=f"ω/2π ({hertz})")
    return figure


def _at(result: PulseResult) -> str:
    """The axis of frequency: at ω + iσ where the record was weighted by exp(−σt)."""
    sigma = result.dispersion.sigma
    return f"ω/2π (kHz), at ω + iσ, σ/2π = {sigma * KHZ:.3g} kHz" if sigma else "ω/2π (kHz)"


def _ends(frequency: NDArray[Any]) -> tuple[float, float]:
    """Limits of the axis of frequency; a single one stands in the middle."""
    low, high = float(frequency[0]), float(frequency[-1])
    room = 0.015 * (high - low)  # for the last marks
    return (low - room, high + room) if high > low else (0.9 * low, 1.1 * low)


def _limit(axes: Axes, values: NDArray[Any]) -> None:
    if not len(values):
        _empty(axes)
        return
    wild = _WILD if len(values) > _MOST_POINTS / 2 else 0.0
    low, high = np.percentile(values, [wild, 100 - wild])
    room = 0.15 * max(high - low, 0.05 * abs(high), 1e-300)
    axes.set_ylim(low - room, high + 1.6 * room)


def _empty(axes: Axes) -> None:
    """Say that nothing was measured; what is known exactly stays."""
    axes.text(0.5, 0.9, "nothing measured that counts", ha="center", va="top", bbox=LABEL,
              transform=axes.transAxes)  # fmt: skip
    drawn = [line for line in axes.lines if line.get_transform() == axes.transData]
    if not any(np.isfinite(np.asarray(line.get_ydata(), float)).any() for line in drawn):
        axes.set_yticks([])


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
    several = [one for one in readings if one.result is not None]
    for number, one in enumerate(several, start=1):
        assert one.result is not None
        tail = f"_{number}" if len(several) > 1 else ""
        found[f"pulse_section{tail}"] = partial(record_section, one.result, one.best)
        found[f"pulse_velocities{tail}"] = partial(velocities_and_losses, one.result)
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
