"""What receivers of unequal gains leave open of the decay along a line, all frequencies together.

A gain g_j is the same at all frequencies, so that noise that hides it at each hides it less in all:

    ln|U_j(ω)| = a(ω) − α(ω) x_j + ln g_j + noise.

The mean over frequencies of what straight lines leave shows gains but for a level and a slope, by
which α is off. Of N receivers N − 2 tell their size σ: a bar is Student's t times what σ does to α,
and no more than what sensors that are calibrated do. Two receivers tell nothing of it, and are
taken to be no better than those.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from wavesim.readings.dispersion.line_fit import LineFit
from wavesim.readings.dispersion.points import BAR, COMPLEX_BAR, BranchPoints

Float = NDArray[Any]

_FEWEST, _OUTSIDE = 3, 0.05
# Receivers are loud at so many times the noise, where ln|U| is straight.
_LOUD = 5.0
# Sensors are calibrated to this part (rms) where nothing else is known.
CALIBRATED = 0.1
OF_TWO = (
    "two receivers tell neither whether their gains are alike nor whether one wave alone passes: "
    "bars take gains to be alike to {:g} % (--gain-error), and one wave for granted; a third "
    "receiver tells more"
)
UNKNOWN = (
    "what receivers' gains may differ by leaves a bar as large as k: say how alike they are with "
    "--gain-error, or place receivers further apart, or more of them"
)


def with_unequal_gains(
    points: BranchPoints,
    U: Any,
    x: Float,
    used: NDArray[np.bool_],
    level: Float,
    models: Sequence[tuple[int, bool, LineFit]],
    calibrated: float,
) -> BranchPoints:
    """Errors no smaller than what the gains of receivers leave open of waves one way; noise, which
    is in what tells them too, counts once.

    Args:
        points: of the whole line.
        U, x, used: amplitudes, positions and which receivers count; of ``line_fit.fit_line``.
        level: noise of U, shape (nω,).
        models: at each frequency the number of pairs ±k, whether both ways, and the fit.
        calibrated: standard deviation of gains, relative, whatever few receivers show, –.
    """
    size = np.abs(U)
    one_way = np.array([(pairs, both) == (1, False) for pairs, both, _ in models])
    rows = one_way & used.all(axis=1) & (size > _LOUD * level[:, None]).all(axis=1)
    told = len(x) >= _FEWEST and bool(rows.any())
    wide = BAR * calibrated
    if told:
        away, left = x - x.mean(), np.log(size[rows])
        left = left - left.mean(axis=1, keepdims=True)
        left -= (left @ away / (away @ away))[:, None] * away
        worth = 1 / np.mean((level[rows, None] / size[rows]) ** 2 + 1e-24, axis=1)
        mean, spare = worth @ left / worth.sum(), len(x) - 2
        shown = -float(stdtrit(spare, _OUTSIDE / 2)) * float(np.sqrt(mean @ mean / spare))
        wide = min(wide, shown)
    else:
        one_way &= used.sum(axis=1) < _FEWEST
    # α of a fit to amplitudes is a mean of gains by their squares.
    weight = np.where(used, size, 0.0) ** 2 + 1e-290
    away = x - np.sum(weight * x, axis=1, keepdims=True) / np.sum(weight, axis=1, keepdims=True)
    unit = np.sqrt(np.sum((weight * away) ** 2, axis=1)) / np.sum(weight * away**2, axis=1)
    step = np.repeat(np.arange(len(U)), [pairs for pairs, _, _ in models])
    error = np.maximum(points.error, wide / COMPLEX_BAR * (unit * one_way)[step])
    known = points.valid & (points.bar < np.abs(points.k))
    points = replace(points, error=error)
    return points.refused(known & ~(points.bar < np.abs(points.k)), UNKNOWN)
