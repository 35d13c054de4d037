"""Complex frequencies at which a field is looked at, and how strongly its sources drive them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.family import Block
from wavesim.simulation.field import Field
from wavesim.sources import Source, excitation, excited_band, unfolded

# A frequency is judged where a source has this part of its peak spectrum.
JUDGED = 0.01
# Part of the Nyquist frequency of the frames up to which they are looked at.
_NYQUIST = 0.95
# Points of an exact line to σ, and of the whole line at most.
_TO_SIGMA = 6.0
_MOST = 4000


def pulses(field: Field, block: Block) -> list[Source]:
    """Sources with a signal that drive a block; an initial field has no spectrum to judge by."""
    return [s for s in field.sources if s.field in block.fields and s.acts != "initial"]


def contour(
    field: Field,
    sources: Sequence[Source],
    frequencies: int,
    damping: float,
    also: Sequence[Any] = (),
) -> tuple[NDArray[Any], float, NDArray[Any]]:
    """Frequencies ω + iσ over what sources excite.

    Args:
        field: for the length and the interval of its record.
        sources: at least one, of :func:`pulses`.
        frequencies: how many.
        damping: σT of the exponential window.
        also: further ω, rad/s, an array each; those beyond what the frames show are left out.

    Returns:
        ω, shape (n,), and σ, rad/s; the largest |spectrum| of a source over its own peak at each ω,
        0 where the frames fold on it what is driven beyond them.
    """
    low, high = excited_band(sources)
    # From the first bin on, where a signal has a mean value.
    low = low or 2 * np.pi / float(field.t[-1])
    end = _NYQUIST * np.pi / field.interval
    omega = np.linspace(low, min(high, end), frequencies)
    if also:
        omega = np.unique(np.concatenate([omega, *also]))
        omega = omega[omega <= max(end, low)]
    size = excitation(sources, omega) * unfolded(sources, omega, field.interval)
    return omega, damping / float(field.t[-1]), size


def line(omega: NDArray[Any], sigma: float) -> NDArray[Any]:
    """Frequencies at which to draw what is exact at ω + iσ: nothing there is narrower than σ.

    Args:
        omega: those that were measured, shape (n,), ascending, rad/s.
        sigma: rad/s.

    Returns:
        Even, from the first to the last, six to σ but no fewer than measured, rad/s.
    """
    span = float(omega[-1] - omega[0])
    count = np.clip(np.ceil(_TO_SIGMA * span / sigma) + 1, len(omega), _MOST)
    return np.linspace(omega[0], omega[-1], int(count))
