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
# A pulse's k is about sω to this part.
_ABOUT = 0.3


def slowness(come: Float, x: Float, period: float) -> float:
    """Of the signal along x by when it comes to receivers, shape (nx,), s; 0 where it is unsure."""
    away = x - x.mean()
    late = float(away @ come / (away @ away))
    left = come - come.mean() - late * away
    error = float(np.sqrt(left @ left / max(len(x) - 2, 1) / (away @ away)))
    sure = abs(late) > _SURELY * error and abs(late) * np.ptp(x) > period / 12
    return late if sure else 0.0


def runs_on(points: BranchPoints, late: float, gap: float, width: float) -> NDArray[np.bool_]:
    """Points of a pulse whose phases run on by more than a turn within its band.

    Its phases between receivers d apart change by d s dω: those below half a turn lie in no more
    than a turn of it, whatever part of them seems to; at its begin, where k is about sω.

    Args:
        points: of waves.
        late: s, its slowness, s/m.
        gap: d, of receivers on an even line that folds at the same k, m.
        width: of its band, whatever part of that is asked for, rad/s.
    """
    expected = abs(late) * points.omega.real
    near = np.abs(np.abs(points.k.real) - expected) < _ABOUT * expected
    begins = near & (expected * gap < np.pi)
    return ~begins & bool(abs(late) * gap * width > 2 * np.pi)


def against_travel(points: BranchPoints, late: float, models: Any) -> tuple[Any, Any]:
    """Waves one way, of which phases run another than they come; of which amplitudes grow so.

    Args:
        points: in the order of the models.
        late: of :func:`slowness`.
        models: number of pairs, whether both ways, and the fit of each frequency.
    """
    goes = float(np.sign(late))
    turned = np.concatenate([fit.backward[i, :pairs] > fit.forward[i, :pairs]
                             for i, (pairs, _, fit) in enumerate(models)])  # fmt: skip
    alone = np.repeat([not both for _, both, _ in models], [pairs for pairs, _, _ in models])
    fades = np.where(turned, -1, 1)
    # Where arrivals tell nothing, a wave goes the way that it fades.
    along = points.k.real * (fades * goes if goes else points.k.imag > points.bar)
    folded = alone & (along < -points.bar)
    grows = alone & points.valid & bool(goes) & (fades != goes) & (points.k.imag > points.bar)
    return folded, grows & (2 * grows.sum() > points.valid.sum())
