"""Receivers of two kinds round a ring, which show each wave at two wavenumbers or more.

Receivers of the responses a + b and a − b in turn, b ≠ 0 at any frequency, as of two sensors, or of
channels of which every other one is late, show a wave A e^{ikx} as

    (a + b cos(πx/d)) A e^{ikx} = a A e^{ikx} + b A e^{i(k + π/d)x},

at k and at π/d − k, at one frequency. Which of the two is the wave nothing tells: responses may be
opposed. Receivers of which a part, one beside another, is late or of another response show it at
the wavenumbers beside its own, a few of them, at one frequency.
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
_STRONG, _FEWEST, _BY_CHANCE, _MOST, _PART = 0.05, 2, 4.0, 0.7, 0.6
# Of points as exact as this part of 2π/T, what a part of the receivers shows beside a wave is this
# part of it, at more frequencies than there are flat branches.
_EXACT, _LEAST, _FAINTER, _FLAT, _BESIDE = 0.1, 0.01, 0.7, 2, 2.0


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


def check_no_part_is_unlike(
    order: NDArray[np.int64], omega: Float, amplitude: Float, error: Float, cell: float
) -> None:
    """Refuse a ring whose waves nearly all stand at the wavenumbers on both sides too, fainter.

    A branch that does not move with k has its own waves there, but no more frequencies than there
    are such branches.

    Args:
        order, omega, amplitude, error, cell: as of :func:`check_one_kind`.

    Raises:
        RecordError: they do.
    """
    told = error < _EXACT * cell
    order, omega, amplitude, error = (one[told] for one in (order, omega, amplitude, error))
    if not len(order):
        return
    width = _SAME * cell + _ERRORS * (error[:, None] + error)
    other = (np.abs(omega[:, None] - omega) < width) & (order[:, None] != order)
    strong = amplitude > _STRONG * amplitude.max()
    first = strong & ~(other & (amplitude > amplitude[:, None])).any(axis=1)
    part = amplitude / amplitude[:, None]
    fainter = other & (part > _LEAST) & (part < _FAINTER)
    sides = [order == order[:, None] + side for side in (-1, 1)]
    low = order == order.min()
    span = max(float(np.ptp(omega)), cell)
    shown, chance = first.copy(), np.ones(len(order))
    for side, free in zip(sides, (low, False), strict=True):
        shown &= (fainter & side).any(axis=1) | free
        chance *= np.where(free, 1.0, np.minimum(np.sum(width * side, axis=1) / span, 1.0))
    by_chance = float(chance[first].sum())
    if shown.sum() > _FLAT + _BESIDE * by_chance and shown.sum() > _PART * first.sum():
        raise RecordError(
            "each wave round the ring stands at the wavenumbers beside its own too, at one "
            "frequency: a part of its receivers is late, or of another sensor, card or gain; put "
            "them right, or give the receivers of one kind alone, as a line"
        )
