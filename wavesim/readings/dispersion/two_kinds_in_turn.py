"""Receivers of two kinds in turn round a ring, which show each wave at two wavenumbers.

Receivers of the responses a + b and a − b in turn, b ≠ 0 at any frequency, as of two sensors, or of
channels of which every other one is late, show a wave A e^{ikx} as

    (a + b cos(πx/d)) A e^{ikx} = a A e^{ikx} + b A e^{i(k + π/d)x},

at k and at π/d − k, at one frequency. Which of the two is the wave nothing tells: responses may be
opposed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError

Float = NDArray[Any]

# Points are of one frequency within this part of 2π/T and so many standard errors.
_SAME, _ERRORS = 0.02, 4.0
# Strong points are so much of the strongest; at so many pairs more than so many times those by
# chance, and at this part of the strong points, receivers are of two kinds.
_STRONG, _FEWEST, _BY_CHANCE, _MOST = 0.05, 2, 4.0, 0.7


def check_one_kind(
    order: NDArray[np.int64], omega: Float, amplitude: Float, error: Float, cell: float, count: int
) -> None:
    """Refuse a ring whose waves all stand at k and at π/d − k alike.

    Args:
        order: m of each point's k = 2πm/X, shape (n,).
        omega, amplitude, error: frequency, amplitude and standard error of ω, shape (n,).
        cell: 2π/T, unit of ω.
        count: of receivers.

    Raises:
        RecordError: they do.
    """
    other = count // 2 - order
    told = (error < cell) & (other > 0) & (other != order)
    if count % 2 or told.sum() < 2 * _FEWEST:
        return
    order, other, omega, amplitude, error = (
        one[told] for one in (order, other, omega, amplitude, error)
    )
    width = _SAME * cell + _ERRORS * (error[:, None] + error)
    same = np.abs(omega[:, None] - omega) < width
    partner = order[:, None] == other
    # At the frequency of a flat branch, or of what leaks, there are others too.
    alone = ~(same & ~partner & (order[:, None] != order)).any(axis=1)
    paired = alone & (same & partner).any(axis=1)
    by_chance = float(np.sum(width[partner])) / max(float(np.ptp(omega)), cell)
    strong = amplitude > _STRONG * amplitude.max()
    many = paired.sum() / 2 >= _FEWEST + _BY_CHANCE * by_chance
    if many and np.mean(paired[strong]) > _MOST:
        raise RecordError(
            "each wave round the ring stands at k and at π/d − k, at one frequency: its receivers "
            "are of two kinds in turn, as of two sensors or cards, or every other one is late; "
            "give every other receiver alone, or say --lattice where they are all the sites of "
            "one with two in a cell"
        )
