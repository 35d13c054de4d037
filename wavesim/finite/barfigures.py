"""Figures of what was read from a bar with layers or ends, beside the exact frequency domain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wavesim.damping import quality
from wavesim.equations import ROTATIONS
from wavesim.field import Field
from wavesim.figures import FOUND, GAP, SYMBOLS, THEORY, TITLES, Drawings, second_axes
from wavesim.finite.cells import Cells
from wavesim.finite.pulsetest import PulseTest
from wavesim.finite.reading import Reading
from wavesim.finite.ringing import Ringing
from wavesim.finite.twowaves import Scattered
from wavesim.layers import Layers
from wavesim.medium import Medium
from wavesim.planewave import gaps
from wavesim.pulse import pulsefigures

_KHZ = 1 / (2e3 * np.pi)
_POINT: dict[str, Any] = {"ms": 3.2, "mfc": "white", "mew": 0.8, "ls": ""}
_REFLECTED = "#2f6f9f"
_LABEL: dict[str, Any] = {"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 0.8}
_DEEPEST = -80.0
_MOST_LABELS = 12


def _named(axes: Axes, low: float, high: float, name: str) -> None:
    """Shade frequencies, in kHz, with a name at the top."""
    axes.axvspan(low, high, **GAP)
    axes.text(
        (low + high) / 2, 0.97, name, rotation=90, ha="center", va="top", fontsize=7, bbox=_LABEL,
        transform=axes.get_xaxis_transform(), clip_on=True,
    )  # fmt: skip


def _inner_media(layers: Layers) -> list[Medium]:
    """Media of a specimen between two buffers, each once; a graded layer's two ends."""
    inner = layers.layers[1:-1] or layers.layers
    found = [m for layer in inner for m in (layer.medium, layer.last) if m is not None]
    return list(dict.fromkeys(found))


def _shade(axes: Axes, field: Field, sector: str, named: bool = True) -> None:
    """Shade the local gaps of a specimen that is of one medium; of several, none."""
    assert field.layers is not None
    media = _inner_media(field.layers)
    if len(media) > 1:
        return
    for gap in gaps(media[0], sector):
        if gap.upper > gap.lower:
            _named(axes, gap.lower * _KHZ, gap.upper * _KHZ, gap.name if named else "")


def transmission(field: Field, found: Scattered) -> Figure:
    """Transmission and reflection against frequency, and how far they are off."""
    figure = Figure(figsize=(6.4, 5.4))
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1))
    f, judged = found.omega * _KHZ, found.judged
    _shade(upper, field, found.sector)
    for label, value, exact, colour, mark in (
        ("T", found.T, found.T_exact, FOUND, "o"),
        ("R", found.R, found.R_exact, _REFLECTED, "s"),
    ):
        level = 20 * np.log10(np.maximum(np.abs(exact), 1e-15))
        upper.plot(f, level, "-" if label == "T" else "--", color=THEORY, lw=0.9,
                   label=f"{label}, exact")  # fmt: skip
        seen = 20 * np.log10(np.maximum(np.abs(value[judged]), 1e-15))
        upper.plot(f[judged], seen, mark, mec=colour, label=f"{label}, measured", **_POINT)
        lower.plot(f[judged], np.abs(value - exact)[judged], mark, mec=colour, **_POINT)
    upper.set(ylabel="amplitude over incident (dB)", ylim=(_DEEPEST, 8), xlim=(f[0], f[-1]))
    lower.axhline(1e-3, color=THEORY, lw=0.7, ls=":")
    lower.set_yscale("log")
    lower.set(xlabel="ω/2π (kHz)", ylabel="|measured − exact|")
    second_axes(upper, (2e3 * np.pi * field.medium.time_scale, "ω̄, of the first layer"), None)
    figure.legend(loc="outside upper center", ncols=4)
    return figure


def bloch(field: Field, found: Cells) -> Figure:
    """Bloch wavenumber against frequency: phase and decay in one period."""
    figure = Figure(figsize=(6.4, 5.0))
    upper, lower = figure.subplots(2, 1, sharex=True)
    f, shown = found.omega * _KHZ, found.judged
    for axes, part, label in (
        (upper, np.real, "Re qL/π"),
        (lower, np.imag, "Im qL"),
    ):
        scale = found.period / np.pi if part is np.real else found.period
        axes.plot(f, part(found.q_exact) * scale, "-", color=THEORY, lw=0.9, label="exact")
        axes.plot(
            f[shown], part(found.q[shown]) * scale, "o", mec=FOUND, label="measured", **_POINT
        )
        axes.set(ylabel=label, xlim=(f[0], f[-1]))
    deep = np.imag(found.q_exact[shown]) * found.period if shown.any() else np.ones(1)
    lower.set_ylim(0, 1.15 * float(np.nanmax(deep)))
    lower.set_xlabel("ω/2π (kHz)")
    handles, labels = upper.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure


def eigenfrequencies(field: Field, found: Ringing) -> Figure:
    """Spectrum of the receivers with the exact eigenfrequencies on it, and the differences."""
    figure = Figure(figsize=(6.4, 5.0))
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    f = found.omega * _KHZ
    last = float(found.exact[-1] * _KHZ)
    shown = f <= 1.08 * last
    upper.plot(
        f[shown], 20 * np.log10(np.maximum(found.level[shown], 1e-8)), color="#55606b", lw=0.6
    )
    for number, omega in enumerate(found.exact):
        upper.axvline(omega * _KHZ, ymin=0.92, ymax=0.99, color=THEORY, lw=0.9,
                      label="exact eigenfrequency" if number == 0 else None)  # fmt: skip
    heights = np.interp(found.found, found.omega, found.level)
    upper.plot(
        found.found * _KHZ, 20 * np.log10(heights), "o", mec=FOUND, label="measured", **_POINT
    )
    lower.plot(found.exact * _KHZ, np.abs(found.found / found.exact - 1), "o", mec=FOUND, **_POINT)
    lower.axhline(1e-6, color=THEORY, lw=0.7, ls=":")
    lower.set_yscale("log")
    upper.set(ylabel="receivers together (dB)", ylim=(-110, 14), xlim=(0, 1.08 * last))
    lower.set(xlabel="ω/2π (kHz)", ylabel="|Δω|/ω")
    handles, labels = upper.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure


def signals(field: Field, reading: Reading) -> Figure:
    """Rotations at every receiver: simulated, exact, and the difference a thousandfold."""
    names = [name for name in field.names if name in ROTATIONS]
    receivers = list(reading.exact)[:_MOST_LABELS]
    figure = Figure(figsize=(7.0, 0.9 + 1.15 * len(receivers) * len(names)))
    rows = figure.subplots(len(receivers) * len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, receiver) in zip(
        rows, ((n, r) for n in names for r in receivers), strict=True
    ):
        exact = reading.exact[receiver][name]
        measured = field.at(field.receivers[receiver], name)
        size = float(np.abs(exact).max()) or 1.0
        t = field.t * 1e6
        axes.plot(t, exact / size, "-", color=THEORY, lw=1.6, alpha=0.45, label="exact")
        axes.plot(t, measured / size, "--", color=FOUND, lw=0.8, label="simulated")
        axes.plot(
            t, 1e3 * (measured - exact) / size, color=_REFLECTED, lw=0.6, label="difference × 1000"
        )
        axes.set(xlim=(0, t[-1]), ylim=(-1.2, 1.2), yticks=[-1, 0, 1])
        where = field.receivers[receiver] * 1e3
        axes.set_ylabel(SYMBOLS[name], rotation=0, labelpad=10)
        axes.text(
            0.995, 0.9, f"{receiver}, {where:g} mm", ha="right", va="top", fontsize=7, bbox=_LABEL,
            transform=axes.transAxes,
        )  # fmt: skip
    rows[-1].set_xlabel("t (µs)")
    handles, labels = rows[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def bar_section(field: Field, sectors: Sequence[str]) -> Figure:
    """What the bar is made of: gaps of each sector along it, and where everything stands."""
    assert field.layers is not None
    layers, bar = field.layers, field.bar
    x = np.linspace(0, layers.length, 601)
    figure = Figure(figsize=(6.6, 0.8 + 2.1 * len(sectors)))
    rows = figure.subplots(len(sectors), 1, sharex=True, squeeze=False)[:, 0]
    media = [layers.at(float(position)) for position in x]
    known: dict[Medium, dict[str, Any]] = {}
    for medium in media:
        known.setdefault(medium, {s: gaps(medium, s) for s in sectors})
    top = field.band * _KHZ
    for axes, sector in zip(rows, sectors, strict=True):
        for number in range(len(known[media[0]][sector])):
            edges = np.array(
                [(known[m][sector][number].lower, known[m][sector][number].upper) for m in media]
            )
            name = known[media[0]][sector][number].name
            axes.fill_between(x * 1e3, *(edges.T * _KHZ), color="#aeb8c2", lw=0, step="mid")
            axes.text(
                x[8] * 1e3, edges[8].mean() * _KHZ, name, fontsize=7, va="center", bbox=_LABEL
            )
            top = max(top, 1.05 * edges.max() * _KHZ)
        for end in (0, 1):
            low, high = ((0, bar.clear[0]), (bar.clear[1], layers.length))[end]
            if high > low:
                axes.axvspan(low * 1e3, high * 1e3, color="#f2d7d9", lw=0, zorder=-2)
        for edge in layers.interfaces:
            axes.axvline(edge * 1e3, color="#55606b", lw=0.5)
        for source in field.sources:
            axes.plot(source.position * 1e3, source.peak_frequency / 1e3, "v", mfc="white", mec="k",
                      ms=5, clip_on=False, zorder=5)  # fmt: skip
        for position in field.receivers.values():
            axes.plot(position * 1e3, 0.02 * top, "^", color=FOUND, ms=4)
        axes.set(title=f"gaps, {TITLES[sector]}", ylabel="ω/2π (kHz)", ylim=(0, top))
        axes.set_xlim(0, layers.length * 1e3)
    rows[-1].set_xlabel("x (mm); ▽ source at its peak frequency, ▲ receiver, red: absorber")
    return figure


def _pulse_drawings(test: PulseTest) -> Drawings:
    result = test.result
    shaded = [
        (g.name, g.lower / 2 / np.pi, g.upper / 2 / np.pi) for g in test.gaps if g.upper > g.lower
    ]
    known = test.exact.loss
    exact = known.omega / 2 / np.pi, np.where(known.valid, known.level, np.nan)
    curves = {}
    if test.k_exact is not None:
        f = result.dispersion.omega / 2 / np.pi
        other = test.exact.dispersion
        curves = {
            name: (f, getattr(other, name))
            for name in ("phase_velocity", "group_velocity", "attenuation")
        }
    if test.medium is not None and test.medium.damping:
        omega = result.dispersion.omega
        curves["quality"] = omega / 2 / np.pi, quality(test.medium.damping, omega)
    # One speed across several layers would be the speed of nothing.
    line = "envelope" if test.medium is not None else None
    name = test.name
    record = result.record
    arrived = np.concatenate([picks.time for picks in result.arrivals.values()])
    span = float(record.t[0]), min(float(record.t[-1]), 3 * float(np.nanmax(arrived, initial=0.0)))
    drawings: Drawings = {
        f"arrivals_{name}": lambda: pulsefigures.record_section(result, line=line, span=span),
        f"loss_{name}": lambda: pulsefigures.transmission(result, shaded, exact),
    }
    if test.medium is not None:
        drawings[f"velocities_{name}"] = lambda: pulsefigures.velocities_and_losses(
            result, shaded, curves
        )
    return drawings


def of_reading(field: Field, reading: Reading) -> Drawings:
    """Figures of a reading, by name, not drawn yet."""
    sectors = [block.sector for block in field.blocks if block.rotations]
    drawings: Drawings = {}
    if sectors:
        drawings["bar"] = lambda: bar_section(field, sectors)
    if reading.exact and any(name in ROTATIONS for name in field.names):
        drawings["signals"] = lambda: signals(field, reading)
    for one in reading.scattered:
        drawings[f"transmission_{one.sector}"] = lambda one=one: transmission(field, one)  # type: ignore[misc]
    for two in reading.cells:
        drawings[f"bloch_{two.sector}"] = lambda two=two: bloch(field, two)  # type: ignore[misc]
    for three in reading.ringing:
        drawings[f"eigenfrequencies_{three.sector}"] = lambda three=three: eigenfrequencies(  # type: ignore[misc]
            field, three
        )
    for test in reading.pulses:
        drawings |= _pulse_drawings(test)
    return drawings
