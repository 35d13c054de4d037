"""How many waves a line holds at each frequency: the simplest sum that none betters by far.

Of one or two pairs ±k, one way or both, with the error of each k and why it may be no wave.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, stdtrit

from wavesim.readings.dispersion.line_fit import LineFit, fit_line, unknowns
from wavesim.readings.dispersion.points import COMPLEX_BAR, BranchPoints

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
MORE = "unexplained power: more waves than sought, or uneven noise"
QUIET = "no wave stands above the noise: drive more of it, or listen nearer"
# Of two wavenumbers one is told by so many times the noise's power less that it leaves over.
_RIVAL = 20.0
# Left over up to so many times the noise's power is noise.
_NOISE_SPREAD = 1.5
# … and of more, so much of what one wave hears of it is added.
_HEARD = 2.0
# What a 95 % bar leaves out.
_OUTSIDE = 0.05


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
    n = len(omega)
    count = used.sum(axis=1)
    chosen = np.zeros(n, int)
    best = fits[0][2].residual.copy()
    for number, (pairs, both, one) in enumerate(fits[1:], start=1):
        spare = count > unknowns(pairs, both)
        # Not below the noise: what is left there is no wave.
        better = spare & (one.residual * _BETTER < best) & (best > level**2)
        better |= spare & (one.residual * 1e4 < best)
        chosen[better] = number
        best = np.where(better, one.residual, best)
    columns: dict[str, list[Any]] = {
        name: []
        for name in (
            "omega",
            "k",
            "amplitude",
            "error",
            "residual",
            "reason",
            "excess",
            "weak",
            "loud",
            "alike",
        )
    }
    for i in range(n):
        pairs, both, one = fits[chosen[i]]
        # What noise does not explain may be another wave, which receivers hear together.
        excess = max(one.residual[i] - _NOISE_SPREAD * level[i] ** 2, 0.0)
        noise = np.sqrt(max(one.residual[i], level[i] ** 2) + _HEARD * one.alike[i] * excess)
        few = count[i] < unknowns(pairs, both)
        if excess:
            # … and is known from no more receivers than there are to spare.
            spare = max(int(count[i]) - unknowns(pairs, both), 1)
            # Gains alone are off along one direction of the complex plane.
            noise *= -stdtrit(spare, _OUTSIDE / 2) / COMPLEX_BAR
        for p in range(pairs):
            columns["omega"].append(omega[i])
            columns["k"].append(one.k[i, p])
            columns["amplitude"].append(np.hypot(one.forward[i, p], one.backward[i, p]))
            columns["error"].append(np.nan if few else noise * one.unit[i, p])
            columns["residual"].append(one.unexplained[i])
            columns["weak"].append(_weak(one, i, count[i], unknowns(pairs, both), level[i]))
            columns["loud"].append(one.residual[i] > _LOUD * level[i] ** 2)
            columns["excess"].append(one.residual[i] > EXCESS * level[i] ** 2)
            columns["alike"].append(one.rival[i] < _RIVAL * max(one.residual[i], level[i] ** 2))
            columns["reason"].append(FEW if few else "")
    reason = np.array(columns["reason"], object)
    unexplained = np.array(columns["residual"]) > _UNEXPLAINED
    more = unexplained & np.array(columns["excess"], bool) & (reason == "")
    weak = np.array(columns["weak"], bool) & (reason == "")
    loud = np.array(columns["loud"], bool)
    reason[weak & ~loud] = QUIET
    reason[weak & loud] = UNLIKE
    more &= ~weak
    reason[more] = MORE
    reason[np.array(columns["alike"], bool) & (reason == "")] = ANY
    points = BranchPoints(
        "space",
        np.array(columns["k"]),
        np.array(columns["omega"]),
        np.zeros(len(reason)),
        np.array(columns["amplitude"]),
        np.array(columns["error"]),
        np.array(columns["residual"]),
        reason == "",
        reason,
        np.full(len(reason), -1),
    )
    return points, chosen


def _weak(one: LineFit, i: int, count: int, free: int, level: float) -> bool:
    """Whether noise alone might be explained as well, by an F test.

    Few receivers to spare tell of no noise: there its level is held against the power.
    """
    spare = count - free
    power = float(np.sum(one.forward[i] ** 2 + one.backward[i] ** 2))
    if spare < 1 or (spare <= _FEW_TO_SPARE and one.residual[i] <= _LOUD * level**2):
        return power < _WITHOUT_SPARE * level**2
    left = max(float(one.unexplained[i]), 1e-290)
    ratio = (1 - left) / free / (left / spare)
    y = betaincinv(spare, free, _BY_CHANCE / count)  # of F with 2 free, 2 spare degrees
    return bool(ratio < spare * (1 - y) / (free * y))
