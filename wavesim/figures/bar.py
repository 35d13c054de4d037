"""Figures of what was read from a bar with layers or ends, beside the exact frequency domain; and
of what its layers let through at real frequencies, without a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wavesim.figures import pulse_test as pulsefigures
from wavesim.figures.bar_section import bar_section
from wavesim.figures.style import (
    FOUND,
    POINT,
    RECORD,
    RECORD_MARK,
    THEORY,
    Drawings,
    as_written,
    decades,
    gap_edges,
    legend_entries,
    second_axes,
    shade,
    symbol,
    tiles,
)
from wavesim.material.damping import quality
from wavesim.material.family import is_macro
from wavesim.material.shown import KHZ, decibels
from wavesim.readings.bar.bloch import Cells
from wavesim.readings.bar.eigenfrequencies import Ringing
from wavesim.readings.bar.pulse_test import PulseTest
from wavesim.readings.bar.reading import Reading
from wavesim.readings.bar.transmission import Scattered
from wavesim.readings.pulse.reading import Best
from wavesim.simulation.field import Field
from wavesim.verdict.bar import RESONANCE_TOLERANCE
from wavesim.verdict.foreseen_errors import AMPLITUDE_TOLERANCE, SIGNAL_TOLERANCE

if TYPE_CHECKING:  # a run's pictures need none of the studies
    from wavesim.layered.transmission import Transmission
    from wavesim.studies.transmission_study import Study

_DEEPEST, _DEEPEST_STEADY = -80.0, -120.0
_REFLECTED = "#2f6f9f"
_MOST_LABELS = 12
_STYLES = ("-", "--", "-.", ":")
# Of a signal no more periods are shown than can be told apart; of a difference so many points.
_MOST_PERIODS = 90
_MUCH = 0.7
_MOSTPOINTS = 400


def transmission(field: Field, found: Scattered) -> Figure:
    """Transmission and reflection against frequency, and how far they are off."""
    figure = Figure(figsize=(6.4, 5.4))
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1))
    level_panel(upper, field, found)
    f, judged = found.omega * KHZ, found.judged
    for value, exact, mark in ((found.T, found.T_exact, "o"), (found.R, found.R_exact, "s")):
        lower.plot(f[judged], np.abs(value - exact)[judged], mark, mec=RECORD_MARK, **POINT)
    lower.axhline(AMPLITUDE_TOLERANCE, color=THEORY, lw=0.7, ls=":", label="tolerance")
    decades(lower)
    lower.set(xlabel=f"ω/2π (kHz), at ω + iσ, σ/2π = {found.sigma * KHZ:.3g} kHz",
              ylabel="|simulated − exact|")  # fmt: skip
    second_axes(upper, (field.medium.time_scale / KHZ, "ω̄, of the first layer"), None)
    figure.legend(loc="outside upper center", ncols=2)
    return figure


def level_panel(axes: Axes, field: Field, found: Scattered) -> None:
    """Transmission and reflection in decibels, measured and exact, on given axes."""
    f, judged = found.omega * KHZ, found.judged
    media = field.layers.inner_media
    if len(media) == 1:  # the gaps of several are no specimen's
        shade(axes, gap_edges(media[0], found.sector))
    fine, *lines, at_real = found.line
    steady, recorded = "steady wave (real ω): exact", "record (ω + iσ): "
    level = decibels(at_real)
    axes.plot(fine * KHZ, level, "-", color=FOUND, lw=1.5, zorder=2.5, label=f"T, {steady}")
    for label, value, curve, mark, line in (
        ("T", found.T, lines[0], "o", "-"),
        ("R", found.R, lines[1], "s", "--"),
    ):
        told, seen = f"{label}, {recorded}", decibels(value[judged])
        axes.plot(fine * KHZ, decibels(curve), line, color=RECORD, lw=0.9, label=f"{told}exact")
        axes.plot(f[judged], seen, mark, mec=RECORD_MARK, label=f"{told}simulated", **POINT)
    draw_masks(axes, [band.asked for band in found.bands])
    axes.set(ylabel="amplitude over incident (dB)", ylim=(_DEEPEST, 8), xlim=(f[0], f[-1]))


def bloch(field: Field, found: Cells) -> Figure:
    """Bloch wavenumber against frequency: phase and decay in one period."""
    figure = Figure(figsize=(6.4, 5.0))
    upper, lower = figure.subplots(2, 1, sharex=True)
    f, shown = found.omega * KHZ, found.judged
    fine, exact = found.line
    for axes, part, scale, label in (
        (upper, np.real, found.period / np.pi, "Re qL/π"),
        (lower, np.imag, found.period, "Im qL"),
    ):
        axes.plot(fine * KHZ, part(exact) * scale, "-", color=THEORY, lw=0.9, label="exact")
        axes.plot(
            f[shown], part(found.q[shown]) * scale, "o", mec=FOUND, label="simulated", **POINT
        )
        axes.set(ylabel=label, xlim=(f[0], f[-1]))
    deep = np.imag(found.q_exact[shown]) * found.period if shown.any() else np.ones(1)
    lower.set_ylim(0, 1.15 * float(np.nanmax(deep)))
    lower.set_xlabel(f"ω/2π (kHz), at ω + iσ, σ/2π = {found.sigma * KHZ:.3g} kHz")
    figure.legend(*upper.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def eigenfrequencies(field: Field, found: Ringing) -> Figure:
    """Spectrum of the receivers with the exact eigenfrequencies on it, and the differences."""
    figure = Figure(figsize=(6.4, 5.0))
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    ringing_panel(upper, found)
    lower.plot(found.exact * KHZ, np.abs(found.found / found.exact - 1), "o", mec=FOUND, **POINT)
    lower.axhline(RESONANCE_TOLERANCE, color=THEORY, lw=0.7, ls=":", label="tolerance")
    decades(lower)
    lower.set(xlabel="ω/2π (kHz)", ylabel="|Δω|/ω")
    figure.legend(loc="outside upper center", ncols=3)
    return figure


def ringing_panel(axes: Axes, found: Ringing) -> None:
    """Spectrum of the receivers together, with eigenfrequencies, on given axes."""
    f = found.omega * KHZ
    last = float(found.exact[-1] * KHZ)
    shown = f <= 1.08 * last
    axes.plot(f[shown], decibels(found.level[shown]), color="#55606b", lw=0.6)
    for number, omega in enumerate(found.exact):
        axes.axvline(omega * KHZ, ymin=0.92, ymax=0.99, color=THEORY, lw=0.9,
                     label="exact eigenfrequency" if number == 0 else None)  # fmt: skip
    heights = np.interp(found.found, found.omega, found.level)
    axes.plot(found.found * KHZ, decibels(heights), "o", mec=FOUND, label="simulated", **POINT)
    axes.set(ylabel="receivers together (dB)", ylim=(-110, 14), xlim=(0, 1.08 * last))


def signals(field: Field, reading: Reading) -> Figure:
    """Rotations at receivers, simulated and exact; below, how far all fields are off.

    Of long records the signals' beginning is shown. The difference is over the whole record, the
    largest of all fields, each in units of its own largest value there. (The verdict takes the
    largest within half a wavelength, which is more where a field has a node at the receiver.)
    """
    names = [name for name in field.names if is_macro(name)]
    receivers = sorted(reading.exact, key=lambda name: field.receivers[name])
    some = np.unique(np.linspace(0, len(receivers) - 1, _MOST_LABELS // len(names)).round())
    shown = [receivers[int(i)] for i in some]
    count = len(shown) * len(names)
    figure = Figure(figsize=(7.4, 2.7 + min(1.0 * count, 8.2)))
    *rows, below = figure.subplots(
        count + 1, 1, height_ratios=[1.0] * count + [max(1.7, 0.3 * count)]
    )
    t = field.t * 1e6
    peak = max(s.peak_frequency if np.isfinite(s.peak_frequency) else 0 for s in field.sources)
    end = _MOST_PERIODS / peak * 1e6 if peak else np.inf
    end = end if end < _MUCH * t[-1] else t[-1]
    for axes, (name, receiver) in zip(rows, ((n, r) for n in names for r in shown), strict=True):
        exact = reading.exact[receiver][name]
        measured = field.at(field.receivers[receiver], name)
        size = float(np.abs(exact).max()) or 1.0
        axes.plot(t, exact / size, "-", color=THEORY, lw=1.8, alpha=0.4, label="exact")
        axes.plot(t, measured / size, "--", color=FOUND, lw=0.8, label="simulated")
        axes.set(xlim=(0, end), ylim=(-1.15, 1.15), yticks=[-1, 0, 1])
        axes.set_ylabel(symbol(name), rotation=0, labelpad=10)
        if axes is not rows[-1]:
            axes.set_xticklabels([])
        axes.text(
            1.01, 0.5, f"{as_written(receiver)}\n{field.receivers[receiver] * 1e3:g} mm",
            va="center", fontsize=7, transform=axes.transAxes,
        )  # fmt: skip
    shades = matplotlib.colormaps["viridis"](np.linspace(0, 0.8, len(receivers)))
    tops = []
    for number, receiver in enumerate(receivers):
        at, worst = _worst_in_time(field, reading, receiver)
        tops.append(worst.max())
        below.plot(at * 1e6, worst, color=shades[number], ls=_STYLES[number % 4], lw=0.9,
                   label=as_written(receiver) if receiver in shown else None)  # fmt: skip
    below.axhline(SIGNAL_TOLERANCE, color=THEORY, lw=0.9, ls=":", label="tolerance")
    decades(below)
    top = max(10 * SIGNAL_TOLERANCE, 3 * float(np.nanmax(tops, initial=0.0)))
    below.set(
        xlim=(0, t[-1]), ylim=(1e-6 * min(top, 1e-2), top), xlabel="t (µs)",
        ylabel="|simulated − exact|\nover peak, all fields",
    )  # fmt: skip
    below.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, handlelength=1.4)
    part = f"; first {end:.3g} of {t[-1]:.3g} µs" if end < t[-1] else ""
    more = f"; {len(shown)} of {len(receivers)} receivers" if len(shown) < len(receivers) else ""
    rows[0].set_title(f"each signal to its own peak{part}{more}", fontsize=8)
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def _worst_in_time(field: Field, reading: Reading, receiver: str) -> tuple[Any, Any]:
    """Times, s, and the largest difference of any field about each, over the field's peak."""
    worst: Any = np.zeros(len(field.t))
    for name, exact in reading.exact[receiver].items():
        off = np.abs(field.at(field.receivers[receiver], name) - exact)
        worst = np.maximum(worst, off / (float(np.abs(exact).max()) or 1.0))
    wide = -(-len(worst) // _MOSTPOINTS)
    return field.t[::wide], np.maximum(tiles(worst, 0, wide), 1e-18)


def _pulse_drawings(test: PulseTest) -> Drawings:
    result, medium, name = test.result, test.medium, test.name
    shaded = [] if medium is None else gap_edges(medium, test.sector)
    known = test.exact.loss
    exact = known.omega * KHZ, np.where(known.valid, known.level, np.nan)
    curves = {}
    if test.k_exact is not None:
        f, other = result.dispersion.omega * KHZ, test.exact.dispersion
        curves = {
            quantity: (f, getattr(other, quantity))
            for quantity in ("phase_velocity", "group_velocity", "attenuation")
        }
    if medium is not None and medium.damping:
        omega = result.dispersion.omega
        curves["quality"] = omega * KHZ, quality(medium.damping, omega)
    # One speed across several layers would be the speed of nothing.
    speed = result.velocities["envelope"]
    told = speed.velocity, speed.error, math.isfinite(speed.velocity)
    best = Best("envelope", math.nan, math.nan, *told, "") if medium is not None else None
    record = result.record
    arrived = np.concatenate([picks.time for picks in result.arrivals.values()])
    span = float(record.t[0]), min(float(record.t[-1]), 3 * float(np.nanmax(arrived, initial=0.0)))
    section = partial(pulsefigures.record_section, result, best, span)
    drawings: Drawings = {
        f"arrivals_{name}": section,
        f"loss_{name}": partial(pulsefigures.transmission, result, shaded, exact),
    }
    if medium is not None:
        speeds = partial(pulsefigures.velocities_and_losses, result, shaded, curves)
        drawings[f"velocities_{name}"] = speeds
    return drawings


def of_reading(field: Field, reading: Reading) -> Drawings:
    """Figures of a reading, by name, not drawn yet."""
    sectors = [block.sector for block in field.blocks if block.macro]
    drawings: Drawings = {}
    if sectors:
        drawings["bar"] = partial(bar_section, field, sectors)
    if reading.exact and any(is_macro(name) for name in field.names):
        drawings["signals"] = partial(signals, field, reading)
    for one in reading.scattered:
        drawings[f"transmission_{one.sector}"] = partial(transmission, field, one)
    for two in reading.cells:
        drawings[f"bloch_{two.sector}"] = partial(bloch, field, two)
    for three in reading.ringing:
        drawings[f"eigenfrequencies_{three.sector}"] = partial(eigenfrequencies, field, three)
    for test in reading.pulses:
        drawings |= _pulse_drawings(test)
    return drawings


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
        lowest = max(_DEEPEST_STEADY, float(np.nanmin(T, initial=0.0)))
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
