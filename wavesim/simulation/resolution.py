"""Which waves a grid resolves: those that its differences slow down by no more than 1 %."""

from __future__ import annotations

import functools
import math

import numpy as np

from wavesim.grid.bar import Bar
from wavesim.grid.stencils import modified_wavenumber
from wavesim.material.layers import Layers
from wavesim.sources import Chirp, InitialField, Recorded, Source, ToneBurst

_PHASE_ERROR = 0.01


def check_carried(source: Source, layers: Layers, bar: Bar) -> None:
    """Hold a source's frequency to what the grid can carry in every layer of the bar.

    Raises:
        ValueError: the frequency is above :func:`highest_carried`; of an initial field, it is
            too narrow.
    """
    if isinstance(source, InitialField):
        limit = largest_phase(bar.order) / bar.spacing
        if source.highest_wavenumber > limit:
            least = source.width * source.highest_wavenumber / limit
            raise ValueError(
                f"width = {source.width:g}: the grid carries wavenumbers up to {limit:.4g} rad/m "
                f"(order {bar.order}; there a wave's phase is off by 1 %); take at least "
                f"{least:.3g}, or a finer [bar] spacing"
            )
        return
    key, frequency = _peak(source)
    highest = highest_carried(layers, bar)
    if frequency > highest:
        spacing = bar.spacing * highest / frequency
        raise ValueError(
            f"{key} = {frequency:g}: the grid carries at most "
            f"{highest:.4g} Hz (order {bar.order}; there the fastest wave's phase is off by 1 %); "
            f"lower it, or take [bar] spacing ≤ {spacing:.3g}"
        )


def _peak(source: Source) -> tuple[str, float]:
    """The key that says how high a source goes, and that frequency, Hz."""
    if isinstance(source, ToneBurst):
        return "frequency", source.frequency
    if isinstance(source, Chirp):
        return "high", source.high
    if isinstance(source, Recorded):
        return "peak of the recorded spectrum", source.peak_frequency
    return "peak_frequency", source.peak_frequency


def highest_carried(layers: Layers, bar: Bar) -> float:
    """Frequency at which the grid's phase error on the fastest wave of some layer reaches 1 %, Hz.

    The fastest wave has c_∞ = √(C_φφ/m_φ); at a given frequency it is the longest.
    """
    cells = min(
        medium.fastest / size
        for layer, (_, size) in zip(layers.layers, bar.all_stretches, strict=True)
        for medium in layer.sampled()
    )
    return cells * largest_phase(bar.order) / (2 * math.pi)


@functools.cache
def largest_phase(order: int) -> float:
    """kh at which differences of an order slow a wave down by 1 %."""
    phase = np.linspace(1e-3, math.pi, 20001)
    slowing = 1 - modified_wavenumber(phase, 1.0, order) / phase
    return float(np.interp(_PHASE_ERROR, slowing, phase))
