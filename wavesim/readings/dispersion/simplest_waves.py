"""How many waves a line holds at each frequency: the simplest sum that none betters by far.

Of one or two pairs ±k, one way or both, with the error of each k and why it may be no wave.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv

from wavesim.readings.dispersion.line_fit import LineFit, deviation, fit_line, unknowns
from wavesim.readings.dispersion.points import BranchPoints

Float = NDArray[Any]

# More waves are sought where they lower the power left over, per free parameter, by this factor.
_BETTER = 6.0
# Largest part of the power that may be left unexplained, and largest relative error.
_UNEXPLAINED = 0.05
# Chance that noise passes for a wave at one of the wavenumbers told apart; with no receiver to
# spare, the power that a wave must have over the noise's.
_BY_CHANCE = 1e-6
_WITHOUT_SPARE = 25.0
_FEW_TO_SPARE = 2
# Left over above this many times the noise's and truncation's power, it is not theirs.
EXCESS = 9.0
# A signal that so many times the noise's power is left over of is no noise.
_LOUD = 9.0
UNLIKE = (
    "receivers are loud, but not as few waves make them: modes that interfere, crosstalk, or "
    "receivers unlike each other; wavesim dispersion reads phases alone, wavesim pulse takes "
    "crosstalk out"
)
FEW = (
    "too few receivers above the record's truncation and noise: place some nearer to the source, "
    "or lengthen the record"
)
ANY = (
    "the receivers heard fit another wavenumber as well: drive more of it, listen nearer, or space "
    "receivers closer"
)
MORE = "unexplained power: more waves than sought, receivers unlike each other, or uneven noise"
QUIET = "no wave stands above the noise: drive more of it, or listen nearer"
# Of two wavenumbers one is told by so many times the noise's power less that it leaves over.
_RIVAL = 20.0


def line_fits(U: Any, x: Float, used: Any, pairs: int) -> list[tuple[int, bool, LineFit]]:
    """Each sum that the receivers are enough for: its pairs, whether both ways, and its fit."""
    found = []
    for p in range(1, pairs + 1):
        for both in (False, True):
            if len(x) >= unknowns(p, both):
                found.append((p, both, fit_line(U, x, used, p, both)))
    return found


def simplest(
    fits: list[tuple[int, bool, LineFit]], used: Any, omega: Any, level: Float
) -> tuple[BranchPoints, NDArray[np.int64]]:
    """At each frequency the simplest model that a richer one does not better by far; and which."""
    count = used.sum(axis=1)
    chosen = np.zeros(len(omega), int)
    best = fits[0][2].residual.copy()
    for number, (pairs, both, one) in enumerate(fits[1:], start=1):
        spare = count > unknowns(pairs, both)
        # Not below the noise: what is left there is no wave.
        better = spare & (one.residual * _BETTER < best) & (best > level**2)
        better |= spare & (one.residual * 1e4 < best)
        chosen[better] = number
        best = np.where(better, one.residual, best)
    parts = [_judged(one, np.flatnonzero(chosen == number), unknowns(pairs, both), count, level)
             for number, (pairs, both, one) in enumerate(fits)]  # fmt: skip
    row, k, amplitude, error, left, reason = (np.concatenate(p) for p in zip(*parts, strict=True))
    order = np.argsort(row, kind="stable")
    row, reason = row[order], reason[order]
    nil = np.zeros(len(row))
    points = BranchPoints(
        "space", k[order], omega[row], nil, amplitude[order], error[order], left[order],
        reason == "", reason, nil.astype(int) - 1,
    )  # fmt: skip
    return points, chosen


def _judged(one: LineFit, rows: Any, free: int, count: Any, level: Float) -> tuple[Any, ...]:
    """Of a sum's waves at some frequencies: row, k, amplitude, error, unexplained, why no wave."""
    left, spare, own = one.residual[rows], count[rows] - free, level[rows] ** 2
    noise = deviation(one, spare, own, rows)
    unexplained = one.unexplained[rows]
    alike = one.rival[rows] < _RIVAL * np.maximum(left, own)
    weak, loud = _weak(one, rows, count[rows], free, own), left > _LOUD * own
    more = (unexplained > _UNEXPLAINED) & (left > EXCESS * own)
    reason = np.select(
        [spare < 0, weak & ~loud, weak, more, alike], [FEW, QUIET, UNLIKE, MORE, ANY], ""
    ).astype(object)
    pairs = one.k.shape[1]
    size = np.hypot(one.forward, one.backward)
    each = (np.repeat(v, pairs) for v in (unexplained, reason))
    error = noise[:, None] * one.unit[rows]
    row = np.repeat(rows, pairs)
    return row, one.k[rows].ravel(), size[rows].ravel(), error.ravel(), *each


def _weak(one: LineFit, rows: Any, count: Any, free: int, noise: Float) -> Any:
    """Whether noise alone might be explained as well, by an F test.

    Few receivers to spare tell of no noise: there its level is held against the power.
    """
    spare = count - free
    power = np.sum(one.forward[rows] ** 2 + one.backward[rows] ** 2, axis=1)
    left, some = np.maximum(one.unexplained[rows], 1e-290), np.maximum(spare, 1)
    ratio = (1 - left) / free / (left / some)
    y = betaincinv(some, free, _BY_CHANCE / np.maximum(count, 1))  # of F with 2 free, 2 spare
    few = (spare < 1) | ((spare <= _FEW_TO_SPARE) & (one.residual[rows] <= _LOUD * noise))
    return np.where(few, power < _WITHOUT_SPARE * noise, ratio < some * (1 - y) / (free * y))
