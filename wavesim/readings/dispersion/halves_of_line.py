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
    error = points.error.copy()
    used = used & (np.abs(U) > _LOUD * level[:, None])
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
    return replace(points, error=error)
