"""Branches ω(k) that go on beyond the Nyquist frequency, where they are seen at 2π/Δt − ω."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.dispersion.folding import FOLDED
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.readings.dispersion.simplest_waves import MORE, QUIET, UNLIKE
from wavesim.records.faults.undersampling import UNDERSAMPLED
from wavesim.records.record import Record

Float = NDArray[Any]

TOO_SELDOM = (
    "this branch goes on beyond the Nyquist frequency π/Δt, where a wave is seen at 2π/Δt − ω, and "
    "nothing tells on which side of it: sample more often, or behind a low-pass filter"
)
AMONG = (
    "signals go on beyond the Nyquist frequency π/Δt, where they are seen at 2π/Δt − ω, among "
    "these waves: sample more often, or behind a low-pass filter"
)
# A branch goes on by a parabola through so many points, to one off it by this part of its step in ω
# and so many cells, after so many wavenumbers at most.
_PIECE, _FEWEST = 5, 3
_OF_STEP, _CELLS, _MISSED = 0.1, 2.0, 3
# What crosses is seen above this part of π/Δt, at steps that can be followed.
_NEAR = 0.7
# Only branches of such steps in ω are not joined as they are.
_COARSE = 0.05
# So many points of it at least are seen before it does.
_BEFORE = 2
# A branch of no cut-off comes to this part of its highest ω at k = 0.
_AT_ZERO = 0.1


def because_undersampled(points: BranchPoints, record: Record) -> BranchPoints:
    """Points of a line of receivers that are none, with this for the reason where it is one."""
    if not any(finding.what == UNDERSAMPLED for finding in record.findings):
        return points
    mixed = ~points.valid & np.isin(points.reason, (QUIET, UNLIKE, MORE, FOLDED))
    return replace(points, reason=np.where(mixed, AMONG, points.reason))


def seen_at(omega: Any, nyquist: float) -> Any:
    """Frequency below Nyquist at which samples show one of any size, rad/s."""
    return np.abs((omega + nyquist) % (2 * nyquist) - nyquist)


def across_nyquist(
    branch: NDArray[Any], k: Float, omega: Float, nyquist: float, cell: float
) -> NDArray[np.bool_]:
    """Points of branches that run through ω = π/Δt and may be on its other side, shape (m,).

    Of two parts that meet there as one smooth curve the one is where it seems that comes to k = 0
    at ω = 0; where neither does, neither is, as one that rises from a cut-off and one that falls
    from beyond look alike.

    Args:
        branch: of each point, −1 for none, shape (m,).
        k: > 0, multiples of one step, rad/m.
        omega: where they are seen, 0 to π/Δt, rad/s.
        nyquist: π/Δt, rad/s.
        cell: resolution in ω, 2π/T, rad/s.
    """
    unsure = np.zeros(len(k), bool)
    step = float(np.diff(np.unique(k)).min(initial=np.inf))
    for place, at, found in _followed(branch, k, omega, step, nyquist, cell):
        known = at[len(at) - len(found) :]
        beyond = known > nyquist
        if not beyond.any() or beyond[:_BEFORE].any():
            continue
        near = np.argsort(np.abs(place))[:_PIECE]
        origin = float(np.polynomial.Polynomial.fit(place[near], at[near], 2)(0.0))
        room, many = _AT_ZERO * nyquist, beyond.sum() >= _FEWEST
        unsure[found[beyond]] |= not (many and abs(2 * nyquist - origin) < room)
        unsure[found[~beyond]] |= many and not abs(origin) < room
    return unsure


def _followed(
    branch: NDArray[Any], k: Float, omega: Float, step: float, nyquist: float, cell: float
) -> Iterator[tuple[Float, Float, NDArray[np.int64]]]:
    """k and ω of each branch and what it goes on through, and the points' numbers, those last."""
    for number in np.unique(branch[branch >= 0]):
        own = np.flatnonzero(branch == number)
        near = len(own) >= _FEWEST and omega[own].max() > _NEAR * nyquist
        for direction in (1, -1) if near else ():
            order = own[np.argsort(direction * k[own])]
            # Coarse steps may have joined what is not one: its first points alone begin too.
            for begin in (order, order[:_FEWEST]):
                known = k[begin], omega[begin], begin
                yield _gone_on(*known, k, omega, direction * step, nyquist, cell)
    # Where ω = 0 at k = 0, ω is odd in k.
    odd = np.array([-1.0, 0.0, 1.0])
    coarse = omega > _COARSE * nyquist
    for first in np.flatnonzero((branch >= 0) & coarse & (k < 1.5 * step)):
        known = odd * k[first], odd * omega[first], np.array([first])
        yield _gone_on(*known, k, omega, step, nyquist, cell)


def _gone_on(
    place: Float,
    at: Float,
    own: NDArray[Any],
    k: Float,
    omega: Float,
    step: float,
    nyquist: float,
    cell: float,
) -> tuple[Float, Float, NDArray[np.int64]]:
    """A curve, with the points that it goes on through.

    Args:
        place, at: k and ω of the curve so far, in the order in which it is followed.
        own: numbers of the points on it.
        k, omega, nyquist, cell: as of :func:`across_nyquist`.
        step: signed, from one wavenumber to the next.
    """
    found, ahead = own.tolist(), 1
    others = np.setdiff1d(np.arange(len(k)), own)
    while ahead <= _MISSED and len(others):
        curve = np.polynomial.Polynomial.fit(place[-_PIECE:], at[-_PIECE:], 2)
        next_ = place[-1] + ahead * step
        there, slope = float(curve(next_)), abs(float(curve.deriv()(place[-1]) * step))
        off = np.abs(omega[others] - seen_at(there, nyquist))
        off[np.abs(k[others] - next_) > abs(step) / 2] = np.inf
        j = int(off.argmin())
        if not off[j] < _OF_STEP * ahead * slope + _CELLS * cell:
            ahead += 1
            continue
        # Of the frequencies that are seen there, the one nearest to the curve.
        seen = np.array([1, -1]) * omega[others[j]]
        real = 2 * nyquist * np.round((there - seen) / 2 / nyquist) + seen
        place, ahead = np.append(place, next_), 1
        at = np.append(at, real[np.abs(real - there).argmin()])
        found.append(int(others[j]))
        others = np.delete(others, j)
    return place, at, np.array(found, int)
