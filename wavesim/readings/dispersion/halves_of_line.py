"""Whether both halves of a line hear the same wave: where they don't, no one k is the line's.

A fit along the line follows the receivers that are loudest, nearest to the source. There the field
of a source is not yet a wave, and ground or specimen may differ from what lies farther on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.dispersion.line_fit import LineFit, deviation, fit_line, unknowns
from wavesim.readings.dispersion.points import COMPLEX_BAR, BranchPoints

Float = NDArray[Any]

# Receivers of a half beyond the fit's unknowns; of what is so many times as loud as the noise.
_SPARE, _LOUD = 2, 3.0
# A side of so many receivers or more is late by so many deviations.
_SIDE, _SURELY_LATE = 3, 5.0
# … and where it begins it is told by this part at least of what tells one elsewhere.
_TELLS = 1e-6
# k is off by no more than a bar of so many standard errors then, for what is late is so by a little
# more or less from receiver to receiver.
_BAR = 1.4


def with_unlike_halves(
    points: BranchPoints,
    U: Any,
    x: Float,
    used: NDArray[np.bool_],
    level: Float,
    models: Sequence[tuple[int, bool, LineFit]],
) -> BranchPoints:
    """Errors no smaller than half the line and half differ by, beyond what either is unsure of.

    Args:
        points: of the whole line.
        U, x, used: amplitudes, positions and which receivers count; of ``line_fit.fit_line``.
        level: noise of U, shape (nω,).
        models: at each frequency the number of pairs ±k, whether both ways, and the fit.
    """
    step = np.repeat(np.arange(len(U)), [pairs for pairs, _, _ in models])
    error, omega = points.error.copy(), points.omega.real[np.unique(step, return_index=True)[1]]
    used = used & (np.abs(U) > _LOUD * level[:, None])

    def late_side(rows: list[int]) -> Float:
        power = np.abs(U[rows]) ** 2 * used[rows]
        mean = np.sum(power, axis=1, keepdims=True) / np.sum(used[rows], axis=1, keepdims=True)
        weight, own = power / mean, level[rows] ** 2 / mean[:, 0] / 2
        away = x - (weight @ x / np.sum(weight, axis=1))[:, None]
        k = np.array([models[i][2].k[i, 0].real for i in rows])
        return of_a_late_side(U[rows], omega[rows], k, weight, away, own)

    rank, count = np.cumsum(used, axis=1), used.sum(axis=1)
    near = used & (rank <= (count + 1)[:, None] // 2)
    for both in (False, True):
        free = unknowns(1, both)
        rows = [i for i, (pairs, b, _) in enumerate(models) if (pairs, b) == (1, both)]
        rows = [i for i in rows if count[i] // 2 >= free + _SPARE]
        if not rows:
            continue
        found, unsure = [], []
        for half in (near, used & ~near):
            start = np.array([models[i][2].k[i] for i in rows])
            one = fit_line(U[rows], x, half[rows], 1, both, start)
            spare = half[rows].sum(axis=1) - free
            found.append(one.k[:, 0])
            unsure.append(deviation(one, spare, level[rows] ** 2) * one.unit[:, 0])
        apart, own = np.abs(found[0] - found[1]) / COMPLEX_BAR, np.hypot(*unsure)
        of_row = np.zeros(len(U))
        of_row[rows] = np.where(apart > own, apart + own, 0.0)
        error = np.maximum(error, of_row[step])
        if not both:
            of_row[rows] = late_side(rows)
            error = np.hypot(error, of_row[step])
    return replace(points, error=error)


def of_a_late_side(U: Any, omega: Float, k: Float, weight: Float, away: Float, own: Float) -> Float:
    """Standard error of k where one side of the line is late, by a clock, a cable or a place.

    A step ωτ of the phases is laid through what straight lines leave of them, at all frequencies
    together; of a step a line makes a slope.

    Args:
        U: shape (n, nx).
        omega, k: of the straight lines, shape (n,), rad/s and rad/m.
        weight, away: of receivers, and their places about the middle, shape (n, nx), – and m.
        own: variance of a phase by noise, shape (n,).

    Returns:
        Shape (n,), rad/m; 0 where τ is no more than chance makes.
    """
    turned = U * np.exp(-1j * k[:, None] * away)
    middle = np.sum(weight * turned / np.maximum(np.abs(turned), 1e-290), axis=1, keepdims=True)
    phase = np.angle(turned * np.conj(middle))
    total = np.maximum(weight.sum(axis=1, keepdims=True), 1e-290)
    lever = np.maximum(np.sum(weight * away**2, axis=1, keepdims=True), 1e-290)
    phase = phase - np.sum(weight * phase, axis=1, keepdims=True) / total
    left = phase - np.sum(weight * away * phase, axis=1, keepdims=True) / lever * away
    behind = slice(_SIDE, weight.shape[1] - _SIDE + 1)
    late, some, slope = (np.sum(v, axis=1, keepdims=True) - np.cumsum(v, axis=1) + v
                         for v in (weight * left, weight, weight * away))  # fmt: skip
    size = some - some**2 / total - slope**2 / lever
    scatter = np.maximum(own, np.sum(weight * left**2, axis=1) / total[:, 0]) + 1e-290
    told = (omega / scatter) @ late
    known = (omega**2 / scatter) @ np.maximum(size, 0)
    # Of one loud receiver and others far weaker no step is told from a line.
    tells = known > _TELLS * known.max(initial=0.0)
    gain = np.where(tells, told**2 / np.maximum(known, 1e-290), 0.0)[behind]
    if not len(gain) or gain.max() < _SURELY_LATE**2:
        return np.zeros(len(U))
    j = int(gain.argmax()) + _SIDE
    return np.asarray(np.abs(omega * told[j] / known[j] * slope[:, j] / lever[:, 0])) / _BAR
