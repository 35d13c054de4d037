"""Eigenfrequencies of a bar with reflecting ends, from how its receivers ring."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.layered.eigenfrequencies import resonances
from wavesim.material.family import Block
from wavesim.planewave.dispersion_relation import wavenumber
from wavesim.readings.dispersion.spectrum import LOBE_BINS, Spectrum, analysed_from, peaks
from wavesim.records.windows import blackman_harris, fast_length
from wavesim.simulation.field import Field

Float = NDArray[Any]

_PADDING = 8
# Judged where every layer's wave has this many cells to a wavelength at least.
_CELLS = 20
# A peak counts above this part of the strongest, and within this many bins of the theory.
_LEAST = 1e-4
_NEAR = 1.0
# Signals tell an eigenfrequency where it is read off the exact ones to this part.
_TOLD = 5e-7


@dataclass(frozen=True)
class Ringing:
    """Eigenfrequencies of one sector.

    Attributes:
        sector: whose.
        exact: of the exact solver, those that stand clear of their neighbours and can be heard at
            the receivers, ascending, rad/s.
        found: the peak next to each, rad/s; NaN where there is none.
        omega, level: spectrum of the receivers together, rad/s and relative to its peak.
        bin: resolution 2π/T, rad/s.
    """

    sector: str
    exact: Float
    found: Float
    omega: Float
    level: Float
    bin: float


def audible(field: Field, block: Block) -> Float | None:
    """The eigenfrequencies that stand clear of their neighbours, of a bar that no wave leaves.

    Args:
        field: of a lossless bar with fixed, free or joined ends, with receivers; no value of it is
            looked at.
        block: one with a macro-field.

    Returns:
        Of the exact solver, ascending, rad/s; None where the bar is no such bar or none is clear.
    """
    layers, bar = field.layers, field.bar
    if field.simulation.lossy or not field.receivers:
        return None
    width = _resolution(field)
    own = [source.excited for source in field.sources if source.field in block.fields]
    low = max(min(low for low, _ in own), 2 * LOBE_BINS * width)
    high = min(_highest(field, block), max(high for _, high in own), 0.9 * np.pi / field.interval)
    if high <= low:
        return None
    exact = resonances(
        layers, bar.left, bar.right, block.sector, (low, high), spacing=2 * LOBE_BINS * width
    )
    apart = np.diff(np.concatenate([[-np.inf], exact, [np.inf]]))
    clear = exact[np.minimum(apart[:-1], apart[1:]) >= 2 * LOBE_BINS * width]
    return clear if len(clear) else None


def ringing(
    field: Field,
    block: Block,
    exact: Float,
    signals: Mapping[str, Mapping[str, Float]] | None = None,
) -> Ringing:
    """Measure the eigenfrequencies of a bar that no wave leaves.

    Args:
        field: the field, with receivers.
        block: one with a macro-field.
        exact: of :func:`audible`.
        signals: {receiver: {field: signal (nt,)}} of the exact solver: of the eigenfrequencies
            those are looked for that these tell, as a mode is silent at its nodes, and a weak one
            is drawn off its place by what rings beside it; all where None.
    """
    (name,) = block.macro[0]
    first = analysed_from(field)
    width = _resolution(field)
    heard = [field.at(position, name)[first:] for position in field.receivers.values()]
    spectrum = _together(field, heard, width)
    found = _nearest(spectrum, exact)
    foreseen = [own[name][first:] for own in (signals or {}).values()]
    if foreseen:
        told = _nearest(_together(field, foreseen, width), exact)
        there = np.abs(told / exact - 1) <= _TOLD
        exact, found = exact[there], found[there]
    level = np.sqrt(spectrum.power[0])
    return Ringing(block.sector, exact, found, spectrum.omega, level, width)


def _together(field: Field, signals: Sequence[Float], width: float) -> Spectrum:
    """Spectrum of some signals together, relative to its peak."""
    frames = len(signals[0])
    padded = fast_length(_PADDING * frames)
    window = blackman_harris(frames)
    omega = 2 * np.pi * np.arange(padded // 2 + 1) / (padded * field.interval)
    power = np.zeros(len(omega))
    for signal in signals:
        power += np.abs(np.fft.rfft(signal * window, padded)) ** 2
    power /= power.max() or 1.0
    return Spectrum(np.zeros(1), omega, power[None], width)


def _nearest(spectrum: Spectrum, exact: Float) -> Float:
    """The peak next to each eigenfrequency, NaN where there is none, shape of exact."""
    tops, heights = peaks(spectrum, 0)
    strong = tops[heights >= _LEAST**2]
    found = np.full(len(exact), np.nan)
    for number, value in enumerate(exact):
        if len(strong):
            nearest = strong[np.argmin(np.abs(strong - value))]
            if abs(nearest - value) <= _NEAR * spectrum.bin:
                found[number] = nearest
    return found


def _resolution(field: Field) -> float:
    """2π/T of the frames that are looked at, rad/s."""
    return 2 * np.pi / ((len(field.t) - analysed_from(field)) * field.interval)


def _highest(field: Field, block: Block) -> float:
    """Frequency up to which the grid has so many cells to each wavelength, rad/s."""
    omega = np.linspace(0, np.pi / field.interval, 4001)[1:]
    fine = np.ones(len(omega), bool)
    for layer, (_, spacing) in zip(field.layers.layers, field.bar.all_stretches, strict=True):
        for medium in layer.ends:
            k = wavenumber(medium, block.sector, omega)
            fine &= np.abs(k.real) * spacing <= 2 * np.pi / _CELLS
    return float(omega[-1] if fine.all() else np.append(0.0, omega)[np.argmin(fine)])
