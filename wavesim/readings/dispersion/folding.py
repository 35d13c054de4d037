"""Whether a mode's wavenumber, known up to 2π/d from receivers d apart, is where it seems."""

from __future__ import annotations

from itertools import pairwise, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[Any]

FOLDED = (
    "folded: phases run on by more than half a turn between receivers, or every other one is of "
    "reversed polarity, so that k is ambiguous; space receivers closer, turn those round, or have "
    "wavesim pulse follow a pulse's arrivals"
)
TURNED = (
    "waves come to ω = 0 at k = π/d and none at k = 0, as where every other receiver is of "
    "reversed polarity: turn those round"
)
# Where there are two receivers alone.
OR_BOTH_WAYS = (
    "folded, or of waves both ways, which three receivers tell and two do not: k is ambiguous; add "
    "a receiver, nearer to one of them than half a wavelength"
)
# A mode points to k = 0 within this part of 2π/d.
_TO_ZERO = 0.3
# A slope is told where Re k changes by this part of π/d, and is so many errors.
_LEAST_CHANGE = 0.02
_ERRORS = 4.0
# A straight mode points to a multiple of 2π/d to this part of it, or past this part of the first.
_NEAR, _FAR = 0.08, 0.5
_FEWEST = 3
# What is left of a line through a mode that is curved, or far from straight: this part of it all,
# and from one frequency to the next this part of that, where of noise it is all.
_CURVED, _BENT, _SMOOTH = 1e-3, 0.2, 0.2
# Such a mode stays within this part of π/d.
_WITHIN = 0.5
# Points of a mode, at least, that is believed beside others that are folded.
_FEW = 5
# A mode goes on by lines through so many points that meet to this part of 2π/d, and after this part
# of ω at most.
_PIECE, _MEETS, _SOON = 12, 0.05, 0.1
# A mode is followed towards k = 0 by lines through so many points, to those off it by less than
# this part of the last step beside the resolution, over this many steps at most.
_LINE, _OFF, _BREAK = 4, 0.5, 3.5
# A branch goes on where points miss its curve by this part of its step in ω, so many on at most;
# k = 0 is at that end where ω, if that falls to this part of its most, or its slope is by this
# part less.
_LEVEL, _MISSED, _STILL, _CLEARLY = 0.1, 2, 0.1, 0.5
# What is at k = π/d is told by a branch that reaches this part of it.
_REACHES = 0.7


def _straight(k: Float, omega: Float) -> tuple[float, float, float, float]:
    """Slope dk/dω of a mode, its error; k of that straight line at ω = 0, its error."""
    away = omega - omega.mean()
    size = float(np.sum(away**2))
    slope = float(np.sum(away * (k - k.mean())) / size)
    left = k - k.mean() - slope * away
    unsure = float(np.sqrt(np.sum(left**2) / (len(k) - 2) / size))
    middle = float(omega.mean())
    return slope, unsure, float(k.mean()) - slope * middle, unsure * middle


def _bends(k: Float, omega: Float, part: float) -> bool:
    """Whether a mode is a smooth curve, this part of it all off straight."""
    slope, _, offset, _ = _straight(k, omega)
    left = k - offset - slope * omega
    smooth = np.sum(np.diff(left) ** 2) / 2 < _SMOOTH * np.sum(left**2)
    return bool(smooth and np.sum(left**2) > part * np.sum((k - k.mean()) ** 2))


def is_folded(k: Float, omega: Float, gap: float) -> bool:
    """Whether a mode is seen at k − 2πn/d, n ≠ 0.

    Energy goes the way of dω/dk, and with it phases, unless a wave runs backward. So k has the sign
    of dω/dk; and a straight mode, ω = c(k + 2πn/d), must point to k = 0, not to another multiple of
    2π/d. Where waves decay, as in a gap, k falls and rises again, far from ±π/d.

    Args:
        k: signed, along a mode, shape (m,), rad/m.
        omega: shape (m,), ascending, rad/s.
        gap: d, the distance of receivers on an even line that folds at the same k, m.
    """
    if len(k) < _FEWEST:
        return False
    slope, unsure, offset, blur = _straight(k, omega)
    if abs(slope) * np.ptp(omega) < _LEAST_CHANGE * np.pi / gap or abs(slope) < _ERRORS * unsure:
        return False
    if float(np.median(k)) * slope < 0:
        return not (np.abs(k).max() < _WITHIN * np.pi / gap and _bends(k, omega, _BENT))
    turns, blur = offset * gap / (2 * np.pi), blur * gap / (2 * np.pi)
    near = abs(round(turns)) >= 1 and abs(turns - round(turns)) < _NEAR and blur < _NEAR
    return bool(near or (abs(turns) - blur > _FAR and not _bends(k, omega, _CURVED)))


def points_to_zero(k: Float, omega: Float, gap: float) -> bool:
    """Whether a mode as a straight line meets ω = 0 nearer to k = 0 than to ±2π/d, surely.

    Args:
        k, omega, gap: as of :func:`is_folded`.
    """
    if len(k) < _FEWEST:
        return False
    _, _, offset, blur = _straight(k, omega)
    return bool(abs(offset) + blur < _TO_ZERO * 2 * np.pi / gap)


def through_zero(own: NDArray[Any], k: Float, omega: Float, cell: float) -> bool:
    """Whether a mode comes from beyond k = 0 without a halt, as none does but at ω = 0.

    ω is even in k, so that dω/dk = 0 at k = 0 (a cut-off); what runs on to k of the other sign is
    seen at k − 2πn/d. At lower frequencies it may be so weak, or known so badly, that it is of no
    branch.

    Args:
        own: points of the mode, ascending in ω.
        k, omega: of all points, as of :func:`is_folded`.
        cell: resolution of the line of receivers, 2π/X, rad/m.
    """
    steps = np.unique(omega)
    if len(own) < _FEWEST or len(steps) < _FEWEST:
        return False
    sign = np.sign(_straight(k[own], omega[own])[0])
    step = float(np.diff(steps).min())
    first = int(np.flatnonzero(np.append(-1.0, sign * k[own]) <= 0)[-1])
    own = own[first:][:_LINE]
    if len(own) < 2:
        return False
    place, at = (sign * k[own]).tolist(), omega[own].tolist()
    while place[0] > -cell:
        slope = np.polyfit(at[:_LINE], place[:_LINE], 1)[0]
        below = np.flatnonzero((omega < at[0] - step / 2) & (omega > at[0] - _BREAK * step))
        away = slope * (at[0] - omega[below])
        off = np.abs(sign * k[below] - place[0] + away)
        near = np.flatnonzero(off < _OFF * away + cell / 2)
        if not len(near):
            return False
        # The next one, and of several there the nearest.
        there = near[omega[below[near]] == omega[below[near]].max()]
        found = below[there[np.argmin(off[there])]]
        place.insert(0, float(sign * k[found]))
        at.insert(0, float(omega[found]))
    return True


def folded_branches(
    branch: NDArray[Any],
    k: Float,
    omega: Float,
    gap: float,
    beyond: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """Points of branches whose Re k has run through ±π/d, shape (m,).

    Args:
        branch: of each point, joined by |k|, −1 for none, shape (m,).
        k, omega, gap: as of :func:`is_folded`, in any order.
        beyond: those known to, shape (m,).
    """
    folded = np.zeros(len(k), bool) if beyond is None else beyond.copy()
    own = [np.flatnonzero(branch == number) for number in np.unique(branch[branch >= 0])]
    for at in own:
        at = at[np.argsort(omega[at])]
        folded[at] |= _in_pieces(k[at], omega[at], gap)
    # What goes on where a folded one ends, or ends where one begins, is the same mode.
    own = sorted((at[np.argsort(omega[at])] for at in own), key=lambda at: float(omega[at[0]]))
    meeting = [(a, b) for a, b in permutations(own, 2) if _meet(k, omega, a, b, gap)]
    for before, after in meeting:
        folded[after] |= folded[before[-1]]
    for before, after in reversed(meeting):
        folded[before] |= folded[after[0]] and not folded[before].any()
    # A few points by themselves are no mode that is not, where many others are.
    found = int(folded.sum())
    for at in own:
        left = int((~folded[at]).sum())
        if left < _FEW and 2 * left < found:
            folded[at] = True
    return folded


def mirrored_branches(
    branch: NDArray[Any], k: Float, omega: Float, gap: float
) -> NDArray[np.bool_]:
    """Points of branches ω(k) that go on as others beyond k = π/d, seen at 2π/d − k, shape (m,).

    Of two that meet at π/d as one smooth curve that is not level there, that one is where it seems
    which comes to k = 0 at ω = 0, as no wave does elsewhere, or else level, as ω² is even in k;
    where nothing tells, neither is. A few points by themselves that go on from a branch are its
    own.

    Args:
        branch: of each point, −1 for none, shape (m,).
        k: ≥ 0, multiples of one step, rad/m.
        omega, gap: as of :func:`is_folded`.
    """
    folded = np.zeros(len(k), bool)
    edge, step = np.pi / gap, float(np.diff(np.unique(k)).min(initial=np.inf))
    for number in np.unique(branch[branch >= 0]):
        own = np.flatnonzero(branch == number)
        if len(own) < _FEWEST:
            continue
        own = own[np.argsort(k[own])]
        beyond, place, at = _beyond(own, k, omega, edge, step)
        if not len(beyond):
            continue
        ends = [_at_end(end, place, at, step) for end in (0.0, 2 * edge)]
        still = min(value for value, _ in ends) < _STILL * float(at.max())
        here, there = (value if still else slope for value, slope in ends)
        many = len(beyond) >= _FEWEST
        folded[own] |= many and not here < _CLEARLY * there
        folded[beyond] |= not many or not there < _CLEARLY * here
    return folded


def turned_in_turn(branch: NDArray[Any], k: Float, omega: Float, gap: float) -> bool:
    """Whether waves round a ring are seen at π/d − k, as where every other receiver is reversed.

    What moves as a whole has no frequency: ω = 0 is at k = 0, and not at π/d alone.

    Args:
        branch, k, omega, gap: as of :func:`mirrored_branches`.
    """
    step, ends = float(np.diff(np.unique(k)).min(initial=np.inf)), []
    for number in np.unique(branch[branch >= 0]):
        own = np.flatnonzero(branch == number)
        if len(own) >= _FEWEST:
            here, there = (_at_end(end, k[own], omega[own], step)[0] for end in (0.0, np.pi / gap))
            ends.append((here, there if k[own].max() > _REACHES * np.pi / gap else np.inf))
    lowest, edge = np.min(ends, axis=0) if ends else (0.0, 0.0)
    still = _STILL * float(omega[branch >= 0].max(initial=0.0))
    return bool(edge < still < _CLEARLY * lowest)


def _at_end(end: float, place: Float, at: Float, step: float) -> tuple[float, float]:
    """|ω| of a curve ω = at(place) at k = end, by a parabola, and by how much it changes a step."""
    away = np.abs(place - end)
    near = np.argsort(away)[: _FEWEST + int(away.min() / step)]
    curve = np.polynomial.Polynomial.fit(place[near] - end, at[near], 2)
    return abs(float(curve(0.0))), abs(float(curve.deriv()(0.0))) * step


def _beyond(
    branch: NDArray[Any], k: Float, omega: Float, edge: float, step: float
) -> tuple[NDArray[np.int64], Float, Float]:
    """Points that a branch goes on through beyond k = π/d, each where a parabola goes on.

    Args:
        branch: numbers of its points, ascending in k.
        k, omega: of all points.
        edge: π/d, rad/m.
        step: of the wavenumbers, rad/m.

    Returns:
        Their numbers; and k and ω of the whole curve.
    """
    place, at, found, ahead = k[branch], omega[branch], [], 1
    others = np.setdiff1d(np.arange(len(k)), branch)
    while ahead <= _MISSED and len(others):
        curve = np.polynomial.Polynomial.fit(place[-_FEWEST:], at[-_FEWEST:], 2)
        next_ = place[-1] + ahead * step
        seen = abs(next_ - 2 * edge * round(next_ / (2 * edge)))
        here = np.abs(k[others] - seen) < step / 2
        off = np.where(here, np.abs(omega[others] - curve(next_)), np.inf)
        j = int(off.argmin())
        if not off[j] < _LEVEL * ahead * step * abs(curve.deriv()(place[-1])):
            ahead += 1
            continue
        place, at, ahead = np.append(place, next_), np.append(at, omega[others[j]]), 1
        if next_ > edge + step / 4:
            found.append(int(others[j]))
    return np.array(found, int), place, at


def _meet(k: Float, omega: Float, first: Any, last: Any, gap: float) -> bool:
    """Whether one branch goes on where another ended: as straight lines they meet there."""
    first, last = first[-_PIECE:], last[:_PIECE]
    if min(len(first), len(last)) < _FEWEST or omega[last[0]] < omega[first[-1]]:
        return False
    if omega[last[0]] - omega[first[-1]] > _SOON * omega[last[0]]:
        return False
    at = (omega[first[-1]] + omega[last[0]]) / 2
    lines = [_straight(k[own], omega[own]) for own in (first, last)]
    turns = (lines[0][2] + lines[0][0] * at - lines[1][2] - lines[1][0] * at) * gap / (2 * np.pi)
    return bool(lines[0][0] * lines[1][0] > 0 and abs(turns) < _MEETS)


def _in_pieces(k: Float, omega: Float, gap: float) -> NDArray[np.bool_]:
    """Where a branch joined by |k| is folded: each run of one sign is looked at by itself.

    Args:
        k: signed, along the branch, shape (m,), rad/m.
        omega: ascending, shape (m,), rad/s.
        gap: as of :func:`is_folded`.
    """
    edges = np.flatnonzero(np.diff(np.sign(k)) != 0) + 1
    # Of waves that run both ways |k| alone is known: it turns back where it comes to π/d.
    top = int(np.abs(k).argmax())
    back = abs(k[-1]) < _BACK * abs(k[top]) and abs(k[top]) > _TURNS * np.pi / gap
    if back and len(k) - top > _FEWEST:
        edges = np.union1d(edges, top + 1)
    # From one edge ±π/d to the other, from one frequency to the next.
    across = np.abs(k[1:]) + np.abs(k[:-1]) > _EDGE * 2 * np.pi / gap
    result = np.zeros(len(k), bool)
    beyond = False
    pieces = np.split(np.arange(len(k)), edges)
    for piece in pieces:
        beyond |= bool(piece[0] and across[piece[0] - 1])
        result[piece] = beyond or is_folded(k[piece], omega[piece], gap)
    # What goes on through k = 0 is one mode, of which the longer piece tells, or that is folded.
    for before, after in [*pairwise(pieces), *reversed([*pairwise(pieces)])]:
        both = np.concatenate([before, after])
        through = k[after[0]] * k[before[-1]] < 0 and not across[before[-1]]
        short = min(len(before), len(after)) < _FEWEST
        if through and (short or _goes_on(k, omega, before, after)):
            result[both] |= result[both].any()
    return result


def _goes_on(k: Float, omega: Float, before: NDArray[Any], after: NDArray[Any]) -> bool:
    """Whether both pieces of a mode run to the same side, through k = 0."""
    slopes = [_straight(k[own], omega[own])[0] for own in (before, after)]
    return bool(slopes[0] * slopes[1] > 0 and slopes[0] * (k[after[0]] - k[before[-1]]) > 0)


# A step from near π/d to near −π/d passes through it.
_EDGE = 0.7
# |k| turns back above this part of π/d, to this part of where it was.
_TURNS, _BACK = 0.85, 0.95
