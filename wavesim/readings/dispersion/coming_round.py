"""What comes round a ring from its other side, along the stretch from one source to the next."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.dispersion.points import COMPLEX_BAR, BranchPoints

Float = NDArray[Any]
Complex = NDArray[np.complex128]


def with_coming_back(points: BranchPoints, x: Float, stretch: float, models: Any) -> BranchPoints:
    """Errors with what comes round a ring from its other side, where the model has no such wave:
    of a part R = e^{−Im k (S − 2x)} of the stretch S between like sources, 2R/X at most."""
    one_way = np.repeat([not both for _, both in models], [pairs for pairs, _ in models])
    part = np.where(one_way, coming_back(points.k, x, stretch), 0.0)
    return replace(points, error=np.hypot(points.error, 2 * part / float(np.ptp(x)) / COMPLEX_BAR))


def coming_back(k: Complex, x: Float, stretch: float) -> Float:
    """R of waves on a stretch; 0 where nothing comes round, S then being infinite."""
    longer = stretch - x[0] - x[-1]
    return np.exp(-np.maximum(k.imag, 0) * longer) if np.isfinite(longer) else np.zeros(len(k))
