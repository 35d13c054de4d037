"""Figures of a field alone: space-time, receivers, energy."""

from __future__ import annotations

from functools import partial
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wavesim.figures.style import (
    FOUND,
    HALO,
    LABEL,
    MAP,
    THEORY,
    Drawings,
    as_written,
    decades,
    gap_edges,
    second_axes,
    shade,
    symbol,
    title,
)
from wavesim.material.family import is_macro
from wavesim.material.shown import KHZ, decibels
from wavesim.readings.amplitude_map import amplitude_map, gone_round, tile_ends
from wavesim.readings.record_section import ARRIVED, Section, record_section, spectra
from wavesim.simulation.field import Field

_DECIBELS = 60.0
_RECEIVER = "#2f6f9f"
_PIXELS = (360, 420)
_STYLES = ("-", "--", "-.", ":")
# Receivers named in a legend, and beside their traces, at most.
_MOST_LABELS, _MOST_NAMES = 9, 24
_LONGEST_NAME = 10
# Traces stand at their positions where the least step is this part of the mean one.
_UNEVEN = 0.3
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def spacetime_panel(axes: Axes, field: Field, sector: str) -> Any:
    """Amplitude of one sector over position and time, dB below its peak; returns the image."""
    amplitude = amplitude_map(field, sector, _PIXELS)
    right, early, late = tile_ends(field, _PIXELS)
    image = axes.imshow(
        decibels(amplitude, float(amplitude.max()) or 1.0),
        origin="lower",
        aspect="auto",
        extent=(0, right * 1e3, early * 1e6, late * 1e6),
        cmap=MAP,
        vmin=-_DECIBELS,
        vmax=0,
    )
    axes.set(xlim=(0, field.bar.length * 1e3), ylim=(0, field.t[-1] * 1e6))
    for edge in field.layers.interfaces:
        axes.axvline(edge * 1e3, color="#55606b", lw=0.6, ls="--")
    for number, (name, x) in enumerate(field.receivers.items()):
        axes.axvline(x * 1e3, color=_RECEIVER, lw=0.7, ls=":")
        if number < _MOST_LABELS:
            axes.text(
                x * 1e3, 0.985, as_written(name), rotation=90, ha="center", va="top", fontsize=6.5,
                color=_RECEIVER, bbox=LABEL, transform=axes.get_xaxis_transform(),
            )  # fmt: skip
    for source in field.sources:
        if any(source.field in b.fields for b in field.blocks if b.sector == sector):
            peak = min(source.peak_time, float(field.t[-1])) * 1e6
            axes.plot(
                source.position * 1e3, peak, "v", ms=5, mfc="white", mec="k", clip_on=False,
                zorder=4,
            )  # fmt: skip
    _mark_round(axes, field, sector)
    return image


def _mark_round(axes: Axes, field: Field, sector: str) -> None:
    """Where the fastest wave is once it has gone round the bar."""
    for number, (x, t) in enumerate(gone_round(field, sector)):
        axes.plot(
            np.multiply(x, 1e3), np.multiply(t, 1e6), color="white", lw=1.0, ls="--",
            label=None if number else "gone round the bar",
        )  # fmt: skip
        if number == 0:
            axes.legend(loc="lower right", fontsize=6.5, frameon=True, facecolor="#5f7183",
                        labelcolor="white", framealpha=0.9)  # fmt: skip


def spacetime(field: Field) -> Figure:
    """Amplitude of every sector over position and time, in dB below its peak."""
    sectors, still = _travelling(field)
    columns = 3 if len(sectors) == 3 else min(2, len(sectors))
    rows = -(-len(sectors) // columns)
    figure = Figure(figsize=(3.6 * columns + 0.8, 3.1 * rows + 0.3))
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    medium = field.medium
    for axes in panels[len(sectors) :]:
        axes.remove()
    for number, (axes, sector) in enumerate(zip(panels, sectors, strict=False), start=1):
        image = spacetime_panel(axes, field, sector)
        axes.set_title(title(medium.family.blocks_of(sector)))
        # Numbers and units stand at the outer sides alone.
        if number % columns == 1 % columns:
            axes.set_ylabel("t (µs)")
        if number + columns > len(sectors):
            axes.set_xlabel("x (mm)")
            axes.tick_params(labelbottom=True)
        last = number % columns == 0 or number == len(sectors)
        second_axes(
            axes,
            (1e-3 / medium.length_scale, "x / l") if number <= columns else None,
            (1e-6 / medium.time_scale, f"t / {medium.family.time}") if last else None,
        )
    figure.colorbar(
        image,
        ax=list(panels[: len(sectors)]),
        label="amplitude (dB, peak of the panel = 0)",
        shrink=0.8,
    )
    if still:
        told = "; ".join(title(medium.family.blocks_of(sector)) for sector in still)
        figure.supxlabel(f"not shown, as it stays where it is driven: {told}", fontsize=7)
    return figure


def _travelling(field: Field) -> tuple[list[str], list[str]]:
    """Sectors in which waves travel, and those in which none do; where no wave does, all."""
    sectors = list(dict.fromkeys(block.sector for block in field.blocks))
    moving = [s for s in sectors if any(b.macro for b in field.blocks if b.sector == s)]
    return (moving, [s for s in sectors if s not in moving]) if moving else (sectors, [])


def _power_of_ten(values: Any) -> tuple[float, str]:
    """Factor that brings values to the order of one, and what it puts before their unit."""
    largest = float(np.max(np.abs(values), initial=0.0))
    power = int(np.floor(np.log10(largest))) if largest > 0 else 0
    return 10.0**-power, f"10{str(power).translate(_RAISED)} " if power else ""


def receivers(field: Field) -> Figure:
    """Record section of macro-fields (or, without any, the first field), and their spectra.

    A trace stands at its receiver's position, or, where some stand much closer than others, in
    their order. Traces have one scale where their peaks are alike, else each its own; the title
    says which. Shown is the record until it falls silent, but no more periods than can be told
    apart. The last fifth of the record is tapered for the spectra.
    """
    names = [n for n in field.names if is_macro(n)] or list(field.names[:1])
    order = sorted(field.receivers.items(), key=lambda item: item[1])
    shades = matplotlib.colormaps["viridis"](np.linspace(0, 0.8, len(order)))
    tall = min(2.4 + 0.22 * max(0, len(order) - 4), 4.4, 11.2 / len(names))
    figure = Figure(figsize=(8.2, 0.9 + tall * len(names)))
    rows = figure.subplots(len(names), 2, squeeze=False, width_ratios=(1.25, 1))
    for (section, spectrum), name in zip(rows, names, strict=True):
        own = record_section(field, name)
        hertz, power = spectra(field, own.signals)
        f, power = hertz / 1e3, power * 1e6
        for number, (label, x) in enumerate(order):
            spectrum.plot(
                f, power[number], color=shades[number], ls=_STYLES[number % 4], lw=0.9,
                label=f"{as_written(label)}, {x * 1e3:g} mm",
            )  # fmt: skip
        largest = float(power.max()) or 1.0
        spectrum.set(xlim=(0, field.band * KHZ), ylim=(1e-5 * largest, 2 * largest))
        decades(spectrum)
        one_medium = len(field.layers.layers) == 1
        for sector in dict.fromkeys(b.sector for b in field.blocks if name in b.fields):
            if one_medium:
                shade(spectrum, gap_edges(field.medium, sector))
        spectrum.set_ylabel(f"|∫ {symbol(name)} exp(iωt) dt| ({field.unit(name)} µs)")
        _section(section, field, name, own)
    handles, labels = rows[0, 1].get_legend_handles_labels()
    # Of many receivers some: the others' colours lie between.
    some = np.unique(np.linspace(0, len(labels) - 1, _MOST_LABELS).round().astype(int))
    marks, told = rows[0, 0].get_legend_handles_labels()
    figure.legend(
        [handles[i] for i in some] + marks, [labels[i] for i in some] + told,
        loc="outside upper center", ncols=5,
    )  # fmt: skip
    rows[-1, 0].set_xlabel("t (µs)")
    rows[-1, 1].set_xlabel("ω/2π (kHz)")
    second_axes(
        rows[0, 0], (1e-6 / field.medium.time_scale, f"t / {field.medium.family.time}"), None
    )
    second_axes(rows[0, 1], (field.medium.time_scale / KHZ, "ω̄"), None)
    return figure


def section_panel(axes: Axes, field: Field, name: str) -> None:
    """Record section of one field at the receivers, on given axes."""
    _section(axes, field, name, record_section(field, name))
    axes.set_xlabel("t (µs)")


def _section(axes: Axes, field: Field, name: str, own: Section) -> None:
    """Signals over time, set off by position, with the first arrival on each."""
    x = np.array([position for _, position in own.order]) * 1e3
    shades = matplotlib.colormaps["viridis"](np.linspace(0, 0.8, len(x)))
    steps = np.diff(x)
    placed = not len(steps) or float(steps.min()) >= _UNEVEN * float(steps.mean()) > 0
    base = x if placed else np.arange(len(x), dtype=float)
    step = float(np.diff(base).min()) if len(steps) else 1.0
    shown = field.t <= own.end * (1 + 1e-9)
    traces = base[:, None] + 0.62 * step * own.signals[:, shown] / own.scale[:, None]
    for number, trace in enumerate(traces):
        axes.plot(field.t[shown] * 1e6, trace, color=shades[number], lw=0.8)
    axes.plot(
        field.t[own.first[own.arrived]] * 1e6, base[own.arrived], "|", color=FOUND, ms=9, mew=1.5,
        zorder=3, label=f"first {100 * ARRIVED:g} % of the peak",
    )  # fmt: skip
    every = -(-len(x) // _MOST_NAMES)
    for number in range(0, len(x), every):
        label = as_written(own.order[number][0])
        beside: Any = {"ha": "left", "va": "center"}
        if len(label) > _LONGEST_NAME:  # within, above its trace
            beside = {"ha": "right", "va": "bottom", "path_effects": HALO}
        axes.text(
            0.995 if len(label) > _LONGEST_NAME else 1.01, base[number], label, fontsize=6.5,
            color=shades[number], transform=axes.get_yaxis_transform(), **beside,
        )  # fmt: skip
    if not placed or len(x) <= _MOST_LABELS:
        axes.set_yticks(base[::every], [f"{value:.4g}" for value in x[::every]])
    factor, exponent = _power_of_ten(own.peaks)
    low, high = (f"{value * factor:.3g}" for value in (own.peaks.min(), own.peaks.max()))
    unit = f"{'× ' + exponent if exponent else ''}{field.unit(name)}"
    told = f"one scale, peak {high}" if own.alike else f"each to its peak, {low} to {high}"
    cut = "" if shown.all() else f"; first {own.end * 1e6:.3g} of {field.t[-1] * 1e6:.3g} µs"
    axes.set_title(f"{symbol(name)}, {told} {unit}{cut}", fontsize=8)
    axes.set(
        ylabel=f"{'position' if placed else 'position, in order'} (mm)", xlim=(0, own.end * 1e6),
        ylim=(base[0] - 0.85 * step, base[-1] + 0.85 * step),
    )  # fmt: skip


def energy(field: Field) -> Figure:
    """Kinetic and potential energy, the work of the sources, and what is lost."""
    assert field.energy is not None
    figure = Figure(figsize=(5.2, 3.2))
    axes = figure.subplots()
    factor, exponent = _power_of_ten(field.energy.total)
    kept = field.layers.conserves_energy
    for name, style, colour, width in (
        *([("dissipated", "-.", "#2f6f9f", 0.9)] if field.simulation.lossy and kept else []),
        ("potential", "-", "#b9c4cf", 0.6),
        ("kinetic", "--", "#5f7183", 0.6),
        ("total", "-", THEORY, 1.2),
        ("work", ":", FOUND, 2.4),
    ):
        y = getattr(field.energy, name) * factor
        axes.plot(field.t * 1e6, y, style, color=colour, lw=width, label=name)
    axes.set(xlabel="t (µs)", ylabel=f"energy per area of the section ({exponent}J/m²)")
    second_axes(axes, (1e-6 / field.medium.time_scale, f"t / {field.medium.family.time}"), None)
    if not kept:
        axes.set_title("the equations as printed keep no energy: total is not work − losses")
    figure.legend(loc="outside upper center", ncols=5)
    return figure


def of_field(field: Field) -> Drawings:
    """Figures that show a field alone, by name, not drawn yet."""
    drawings: Drawings = {"spacetime": partial(spacetime, field)}
    if field.receivers:
        drawings["receivers"] = partial(receivers, field)
    if field.energy is not None:
        drawings["energy"] = partial(energy, field)
    return drawings
