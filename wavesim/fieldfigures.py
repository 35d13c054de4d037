"""Figures of a field alone: space-time, receivers, energy."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from scipy.signal.windows import tukey

from wavesim.equations import ROTATIONS
from wavesim.field import Field
from wavesim.figures import (
    FOUND,
    MAP,
    SYMBOLS,
    THEORY,
    TITLES,
    Drawings,
    decibels,
    second_axes,
    shade_gaps,
    tiles,
)
from wavesim.sectors import SECTORS

_DECIBELS = 60.0
_PIXELS = (900, 700)
# Frames are read so many at a time that they fit into these bytes.
_AT_ONCE = 64e6
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _amplitude(field: Field, sector: str) -> np.ndarray:
    """Largest amplitude of a sector in each tile of the record, (times, positions)."""
    blocks = [block for block in field.blocks if block.sector == sector]
    high, wide = (-(-n // p) for n, p in zip((len(field.t), field.bar.cells), _PIXELS, strict=True))
    rows = high * max(1, int(_AT_ONCE / (32 * field.bar.cells * high)))
    found = []
    for low in range(0, len(field.t), rows):
        square: Any = 0.0
        for block in blocks:
            for values, _ in field.components(block, slice(low, low + rows)):
                values *= values
                square = square + values[:, : field.bar.cells]
        found.append(tiles(tiles(square, 0, high), 1, wide))
    amplitude = np.sqrt(np.concatenate(found))
    if not field.bar.uniform:
        # A picture has even columns: each shows the tile that its place lies in.
        x = field.bar.half_nodes[::wide]
        even = (np.arange(len(x)) + 0.5) * field.bar.length / len(x)
        amplitude = amplitude[:, np.clip(np.searchsorted(x, even) - 1, 0, len(x) - 1)]
    return amplitude


def spacetime(field: Field) -> Figure:
    """Amplitude of every sector over position and time, in dB below its peak."""
    sectors = [s for s in SECTORS if any(b.sector == s for b in field.blocks)]
    columns = min(2, len(sectors))
    rows = -(-len(sectors) // columns)
    figure = Figure(figsize=(3.6 * columns + 0.8, 3.1 * rows + 0.3))
    panels = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    medium, bar = field.medium, field.bar
    for axes in panels[len(sectors) :]:
        axes.remove()
    for axes, sector in zip(panels, sectors, strict=False):
        amplitude = _amplitude(field, sector)
        image = axes.imshow(
            decibels(amplitude, float(amplitude.max()) or 1.0),
            origin="lower",
            aspect="auto",
            extent=(0, bar.length * 1e3, 0, field.t[-1] * 1e6),
            cmap=MAP,
            vmin=-_DECIBELS,
            vmax=0,
            interpolation="nearest",
        )
        for edge in field.layers.interfaces if field.layers is not None else ():
            axes.axvline(edge * 1e3, color="#55606b", lw=0.6, ls="--")
        for source in field.sources:
            if any(source.field in b.fields for b in field.blocks if b.sector == sector):
                axes.plot(
                    source.position * 1e3, source.peak_time * 1e6, "v", ms=5, mfc="white", mec="k"
                )
        axes.set(title=TITLES[sector], xlabel="x (mm)", ylabel="t (µs)")
        second_axes(
            axes,
            (1e-3 / medium.length_scale, "x / l"),
            (1e-6 / medium.time_scale, "t / √(4πρR⁵/3Gₙᵃ)"),
        )
    figure.colorbar(
        image,
        ax=list(panels[: len(sectors)]),
        label="amplitude (dB, peak of the panel = 0)",
        shrink=0.8,
    )
    return figure


def _power_of_ten(values: Any) -> tuple[float, str]:
    """Factor that brings values to the order of one, and what it puts before their unit."""
    largest = float(np.max(np.abs(values), initial=0.0))
    power = int(np.floor(np.log10(largest))) if largest > 0 else 0
    return 10.0**-power, f"10{str(power).translate(_RAISED)} " if power else ""


def _end_taper(count: int) -> np.ndarray:
    """1 over the record but for its last fifth, where it falls to 0 as a cosine.

    It leaves early arrivals as they are, so that spectra at different distances compare.
    """
    return np.asarray(tukey(2 * count, 0.2)[count:])


def receivers(field: Field) -> Figure:
    """Rotations (or, without any, the first field) at every receiver, and their spectra.

    The last fifth of the record is tapered for the spectra.
    """
    names = [n for n in field.names if n in ROTATIONS] or list(field.names[:1])
    figure = Figure(figsize=(7.4, 0.6 + 2.4 * len(names)))
    rows = figure.subplots(len(names), 2, squeeze=False)
    shades = matplotlib.colormaps["viridis"](np.linspace(0, 0.85, len(field.receivers)))
    styles = ["-", "--", "-.", ":"]
    for (signal, spectrum), name in zip(rows, names, strict=True):
        largest = 0.0
        signals = [field.at(position, name) for position in field.receivers.values()]
        factor, exponent = _power_of_ten(signals)
        labels = [f"{label}, {x * 1e3:g} mm" for label, x in field.receivers.items()]
        for number, (label, u) in enumerate(zip(labels, signals, strict=True)):
            kind = {"color": shades[number], "ls": styles[number % 4], "lw": 0.9}
            signal.plot(field.t * 1e6, u * factor, label=label, **kind)
            f = np.fft.rfftfreq(4 * len(u), field.interval) / 1e3
            power = np.abs(np.fft.rfft(u * _end_taper(len(u)), 4 * len(u))) * field.interval * 1e6
            largest = max(largest, float(power.max()))
            spectrum.plot(f, power, **kind)
        highest = field.band / (2e3 * np.pi)
        spectrum.set(xlim=(0, highest), ylim=(1e-5 * (largest or 1), 2 * (largest or 1)))
        spectrum.set_yscale("log")
        one_medium = field.layers is None or len(field.layers.layers) == 1
        for sector in dict.fromkeys(b.sector for b in field.blocks if name in b.fields):
            if one_medium:
                shade_gaps(spectrum, field, sector, upright=True)
        signal.set(
            ylabel=f"{SYMBOLS[name]} ({exponent}{field.unit(name)})", xlim=(0, field.t[-1] * 1e6)
        )
        spectrum.set_ylabel(f"|∫ {SYMBOLS[name]} e$^{{iωt}}$ dt| ({field.unit(name)} µs)")
    handles, labels = rows[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=max(1, min(5, len(labels))))
    rows[-1, 0].set_xlabel("t (µs)")
    rows[-1, 1].set_xlabel("ω/2π (kHz)")
    second_axes(rows[0, 0], (1e-6 / field.medium.time_scale, "t / √(4πρR⁵/3Gₙᵃ)"), None)
    second_axes(rows[0, 1], (2e3 * np.pi * field.medium.time_scale, "ω̄"), None)
    return figure


def energy(field: Field) -> Figure:
    """Kinetic and potential energy, the work of the sources, and what is lost."""
    assert field.energy is not None
    figure = Figure(figsize=(5.2, 3.2))
    axes = figure.subplots()
    factor, exponent = _power_of_ten(field.energy.total)
    dissipated = field.energy.dissipated is not None
    for name, style, colour, width in (
        *([("dissipated", "-.", "#2f6f9f", 0.9)] if dissipated else []),
        ("potential", "-", "#b9c4cf", 0.6),
        ("kinetic", "--", "#5f7183", 0.6),
        ("total", "-", THEORY, 1.2),
        ("work", ":", FOUND, 2.4),
    ):
        y = getattr(field.energy, name) * factor
        axes.plot(field.t * 1e6, y, style, color=colour, lw=width, label=name)
    axes.set(xlabel="t (µs)", ylabel=f"energy per area of the section ({exponent}J/m²)")
    second_axes(axes, (1e-6 / field.medium.time_scale, "t / √(4πρR⁵/3Gₙᵃ)"), None)
    axes.legend()
    return figure


def of_field(field: Field) -> Drawings:
    """Figures that show a field alone, by name, not drawn yet."""
    drawings: Drawings = {"spacetime": lambda: spacetime(field)}
    if field.receivers:
        drawings["receivers"] = lambda: receivers(field)
    if field.energy is not None:
        drawings["energy"] = lambda: energy(field)
    return drawings
