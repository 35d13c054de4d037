"""Which way waves along a line go: by when they come, by their phases, by their amplitudes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.dispersion.points import BranchPoints

Float = NDArray[Any]

GROWS = (
    "amplitudes grow the way that the waves go, by when they come: receivers differ in gain; make "
    "those equal, or add receivers"
)
# Arrivals tell a direction by so many errors.
_SURELY = 4.0


def _direction(come: Float, x: Float, period: float) -> float:
    """1 where the signal goes along x by when it comes to receivers, shape (nx,), s; −1 against."""
    away = x - x.mean()
    late = float(away @ come / (away @ away))
    left = come - come.mean() - late * away
    error = float(np.sqrt(left @ left / max(len(x) - 2, 1) / (away @ away)))
    sure = abs(late) > _SURELY * error and abs(late) * np.ptp(x) > period / 12
    return float(np.sign(late)) if sure else 0.0


def against_travel(points: BranchPoints, come: Float, x: Float, models: Any) -> tuple[Any, Any]:
    """Waves one way, of which phases run another than they come; of which amplitudes grow so.

    Args:
        points: in the order of the models.
        come: when the signal comes to receivers, shape (nx,), s.
        x: positions, shape (nx,), m.
        models: number of pairs, whether both ways, and the fit of each frequency.
    """
    goes = _direction(come, x, 2 * np.pi / float(np.median(points.omega.real)))
    turned = np.concatenate([fit.backward[i, :pairs] > fit.forward[i, :pairs]
                             for i, (pairs, _, fit) in enumerate(models)])  # fmt: skip
    alone = np.repeat([not both for _, both, _ in models], [pairs for pairs, _, _ in models])
    fades = np.where(turned, -1, 1)
    # Where arrivals tell nothing, a wave goes the way that it fades.
    along = points.k.real * (fades * goes if goes else points.k.imag > points.bar)
    folded = alone & (along < -points.bar)
    grows = alone & points.valid & bool(goes) & (fades != goes) & (points.k.imag > points.bar)
    return folded, grows & (2 * grows.sum() > points.valid.sum())
