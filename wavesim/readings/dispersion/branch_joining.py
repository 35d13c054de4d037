"""Points joined into branches, from one wavenumber to the next, by continuity alone.

At each wavenumber the points are assigned to the branches so far with the least total distance
from their continuation: a parabola through the last three points, a line through two. Nothing
here knows a dispersion relation or how many branches there should be.
"""

from __future__ import annotations

from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.assignment import assigned

Float = NDArray[Any]

# A branch may miss this many wavenumbers and go on; one of fewer points is no branch.
LONGEST_BREAK = 3
SHORTEST_BRANCH = 5
# A point may be off its continuation by this many resolution cells, and by these parts of the last
# change of the branch: after one, two and three points.
_CELLS = 2.0
_OF_CHANGE = (0.0, 1.0, 0.5)
# How much a change of amplitude by a factor of ten weighs, in distances allowed.
_AMPLITUDE = 0.5
# Points scatter beyond their errors where by this factor, over so many differences.
_SCATTER = 1.6
_FEWEST_DIFFERENCES = 6
# Quantiles of the modulus of a normal variable of variance 1.
_PARTS, _NORMAL = (0.5, 0.8), (0.6745, 1.2816)
# The sixth of six even points, on the parabola that is nearest to the first five.
_NEXT = np.array([0.6, -0.6, -0.8, 0.0, 1.8])
# A branch of one point reaches this part of the way to its nearest neighbour.
_OF_GAP = 0.6


def join(
    step: NDArray[np.int64],
    value: Float,
    amplitude: Float,
    cell: float,
    shortest: int = SHORTEST_BRANCH,
) -> NDArray[np.int64]:
    """Number of the branch of each point.

    Args:
        step: index of the point's wavenumber in an even sequence, shape (m,).
        value: its frequency, shape (m,), any unit.
        amplitude: shape (m,), > 0.
        cell: resolution in the unit of value.
        shortest: fewest points of a branch.

    Returns:
        Branch numbers, ascending in the median of value; −1 for points of none; shape (m,).
    """
    order = np.argsort(step, kind="stable")
    tracks: list[list[int]] = []
    for at in np.unique(step):
        here = order[np.searchsorted(step[order], at) : np.searchsorted(step[order], at + 1)]
        live = [track for track in tracks if at - step[track[-1]] <= LONGEST_BREAK + 1]
        room = _room(live, step, value) if live else np.zeros(0)
        taken: set[int] = set()
        # Branches that have a slope and a bend choose before those that have just begun.
        for begun in (False, True):
            rows = [i for i, track in enumerate(live) if (len(track) < 3) == begun]
            free = np.array([point for point in here if int(point) not in taken], int)
            if not rows or not len(free):
                continue
            guess = np.array([_continued(live[i], step, value, at) for i in rows])
            reach = cell * _CELLS + guess[:, 1:]
            single = np.array([len(live[i]) == 1 for i in rows])
            reach[single] += _OF_GAP * room[rows][single, None]
            distance = np.abs(guess[:, :1] - value[free]) / reach
            last = amplitude[[live[i][-1] for i in rows]][:, None]
            change = np.abs(np.log10(amplitude[free] / last))
            cost = np.where(distance <= 1, distance + _AMPLITUDE * change, 1e6)
            for row, column in zip(*assigned(cost), strict=True):
                if cost[row, column] < 1e6:
                    live[rows[row]].append(int(free[column]))
                    taken.add(int(free[column]))
        tracks += [[int(point)] for point in here if int(point) not in taken]
    kept = [track for track in tracks if len(track) >= shortest]
    kept.sort(key=lambda track: float(np.median(value[track])))
    branch = np.full(len(step), -1)
    for number, track in enumerate(kept):
        branch[track] = number
    return branch


def scatter(step: NDArray[np.int64], value: Float, error: Float) -> float:
    """What a branch's points scatter about it beyond their errors, a standard deviation.

    Differences of order m of a smooth branch vanish as m grows, while those of errors that know
    nothing of each other keep their variance, (2m choose m) times the errors': the least of the
    orders 2 to 5 is the scatter.

    Args:
        step: of the points of one branch, shape (m,).
        value: theirs, shape (m,).
        error: standard errors, shape (m,), unit of value.

    Returns:
        0 where their errors explain it, or where there are too few points.
    """
    order = np.argsort(step)
    step, value, error = step[order], value[order], error[order]
    whole = np.diff(step) == 1
    ratios, excess = [], []
    for m in range(2, 6):
        even = np.array([whole[i : i + m].all() for i in range(len(step) - m)], bool)
        if even.sum() < _FEWEST_DIFFERENCES:
            return 0.0
        size = np.diff(value, m)[even] / np.sqrt(comb(2 * m, m))
        weight = np.array([comb(m, j) ** 2 for j in range(m + 1)]) / comb(2 * m, m)
        known = np.sqrt(np.convolve(error**2, weight, "valid"))[even]
        # Quantiles: a few points that are off do not make all the others unsure.
        spread = float(np.max(np.quantile(np.abs(size), _PARTS) / _NORMAL))
        ratios.append(spread / float(np.median(known)))
        excess.append(max(spread**2 - float(np.median(known)) ** 2, 0.0))
    return float(np.sqrt(min(excess))) if min(ratios) > _SCATTER else 0.0


def _continued(track: list[int], step: Any, value: Float, at: int) -> tuple[float, float]:
    """Where a branch is expected at a step, and how far from there it may be."""
    last = track[-3:]
    if len(last) == 1:
        return float(value[last[0]]), 0.0
    s, v = step[last].astype(float), value[last]
    slope = (v[-1] - v[-2]) / (s[-1] - s[-2])
    ahead = at - s[-1]
    guess = v[-1] + slope * ahead
    if len(last) == 3:
        earlier = (v[-2] - v[-3]) / (s[-2] - s[-3])
        bend = (slope - earlier) / (s[-1] - s[-3])
        guess += bend * ahead * (at - s[-2])
    five = track[-5:]
    if len(five) == 5 and at - step[five[0]] == 5:
        guess = float(_NEXT @ value[five])  # the same of more points, which scatter less
    return float(guess), _OF_CHANGE[len(last) - 1] * abs(float(slope * ahead))


def _room(live: list[list[int]], step: Any, value: Float) -> Float:
    """Distance of each branch's last value to the nearest other branch's, or to 0."""
    last = np.array([value[track[-1]] for track in live])
    apart = np.abs(last[:, None] - last) + np.where(np.eye(len(last), dtype=bool), np.inf, 0)
    # A single point that nothing went on from bounds no other.
    at = np.array([step[track[-1]] for track in live])
    ended = np.array([len(track) == 1 for track in live]) & (at < at.max())
    apart[:, ended] = np.inf
    return np.minimum(apart.min(axis=1), np.abs(last))
