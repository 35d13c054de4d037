"""Figures of a pulse test: record section, transmission loss, velocities with attenuation and Q."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wavesim.figures.style import (
    FOUND,
    LABEL,
    POINT,
    THEORY,
    as_written,
    legend_entries,
    second_axes,
    shade,
)
from wavesim.material.shown import DECIBELS, KHZ, with_error
from wavesim.readings.pulse.measurement import PulseResult

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
# From Np/m to dB/mm.
_DECIBELS = 1e-3 * DECIBELS


def record_section(
    result: PulseResult, conventions: Sequence[str] = ("first break", "envelope"),
    line: str | None = "envelope", span: tuple[float, float] | None = None,
) -> Figure:  # fmt: skip
    """Signals, each to its own peak and set off by distance, with arrivals and the fitted line.

    Args:
        result: what was read.
        conventions: whose arrivals are marked.
        line: the convention whose velocity is drawn; None for none.
        span: times shown, s; the whole record where None.
    """
    record = result.record
    speed = result.velocities[line] if line is not None else None
    low, high = span or (float(record.t[0]), float(record.t[-1]))
    x = record.x * 1e3
    room = float(np.min(np.diff(x))) * 0.48
    figure = Figure(figsize=(6.6, 1.8 + 0.45 * min(max(len(x), 5), 12)))
    axes = figure.subplots()
    shown = (record.t >= low) & (record.t <= high)
    for j, name in enumerate(record.names):
        u = record.values[:, j] / (np.abs(record.values[:, j]).max() or 1.0)
        axes.plot(record.t[shown] * 1e6, x[j] + room * u[shown], color="#55606b", lw=0.8)
        if len(x) <= 12:
            axes.text(
                1.01, x[j], as_written(name), ha="left", va="center", fontsize=7,
                transform=axes.get_yaxis_transform(),
            )  # fmt: skip
    if speed is not None and np.isfinite(speed.velocity):
        ends = np.array([x[0] - 1.5 * room, x[-1] + 1.5 * room])
        axes.plot(
            (speed.intercept + ends * 1e-3 / speed.velocity) * 1e6, ends, "--", color=FOUND, lw=1.0,
            label=f"{line}: {with_error(speed.velocity, speed.error, 'm/s')}",
        )  # fmt: skip
    for convention in conventions:
        mark, face, edge = _MARKS[convention]
        picks = result.arrivals[convention]
        axes.errorbar(
            picks.time * 1e6, x, xerr=np.nan_to_num(picks.error) * 1e6, fmt=mark, mfc=face,
            mec=edge, ecolor=edge, ms=11 if mark == "|" else 5.5, mew=1.4 if mark == "|" else 1.0,
            elinewidth=0.8, label=convention, zorder=3,
        )  # fmt: skip
    axes.set(
        xlim=(low * 1e6, high * 1e6), ylim=(x[0] - 2.2 * room, x[-1] + 2.2 * room),
        xlabel="t (µs)", ylabel="position (mm)",
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
    frequency = found.omega * KHZ
    figure = Figure(figsize=(6.2, 7.4))
    speed, loss, factor = figure.subplots(3, 1, sharex=True, height_ratios=(1.3, 1, 1))
    every = max(1, -(-len(frequency) // _MOST_POINTS))
    parts: tuple[tuple[Axes, str, str, str, str], ...] = (
        (speed, "phase_velocity", "phase_error", "phase velocity", "o"),
        (speed, "group_velocity", "group_error", "group velocity", "^"),
        (loss, "attenuation", "attenuation_error", "", "o"),
        (factor, "quality", "quality_error", "", "o"),
    )
    labels = {speed: "velocity (m/s)", loss: "attenuation (dB/mm)", factor: "Q = ω/2α$v_g$"}
    for axes, label in labels.items():
        shade(axes, gaps, named=axes is speed)
        axes.set_ylabel(label)
    seen: dict[Axes, list[Any]] = {speed: [], loss: [], factor: []}
    for axes, name, error_name, label, mark in parts:
        unit = _DECIBELS if axes is loss else 1.0
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
            at, curve = exact[name]
            style, told = ("-", "exact") if mark == "o" else ("--", "group velocity, exact")
            axes.plot(at, unit * np.asarray(curve), style, color=THEORY, lw=0.9, label=told)
    for axes, values in seen.items():
        _limit(axes, np.concatenate(values))
    figure.legend(*legend_entries(*seen), loc="outside upper center", ncols=4)
    second_axes(loss, None, (1 / _DECIBELS, "Np/m"))
    factor.set(xlim=_ends(frequency), xlabel="ω/2π (kHz)")
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
