"""A power law through a series of velocities, V = a pᵇ, robust against single ones that are off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[Any]

# A record is set aside from this many deviations of the others on, and from this part of V.
_AWAY = 4.0
_LEAST = 0.03
FEWEST = 3


@dataclass(frozen=True)
class PowerLaw:
    """V = a pᵇ.

    Attributes:
        a, a_error: V at p = 1 in the parameter's unit, and its standard error, m/s.
        b, b_error: the power and its standard error, –.
        outliers: indices of what was set aside.
        scatter: root of the mean square of ln V about the law, without these, –.
    """

    a: float
    a_error: float
    b: float
    b_error: float
    outliers: tuple[int, ...]
    scatter: float


def power_law(p: Float, velocity: Float, noise: Float, common: Float) -> PowerLaw | None:
    """Fit the law to what is known of it.

    Args:
        p: the parameter, > 0, shape (n,).
        velocity: shape (n,), m/s; NaN where there is none.
        noise: standard error of each, independent of the others', over V, shape (n,), –.
        common: what the reading leaves open of each, the same way for all, over V, shape (n,), –.

    Returns:
        The law; None where fewer than three velocities at two values of p are known, or a value of
        p is not above 0. The errors hold the scatter, and what is open: its mean in a, its trend
        with p in b.
    """
    own = np.isfinite(velocity) & (velocity > 0)
    if own.sum() < FEWEST or not (p > 0).all() or np.ptp(p[own]) == 0:
        return None
    x, y = np.log(p), np.log(np.where(own, velocity, 1.0))
    kept = own.copy()
    for _ in range(len(p)):
        b, a = np.polyfit(x[kept], y[kept], 1)
        off = np.abs(y - a - b * x)
        level = 1.4826 * float(np.median(off[kept]))
        worst = int(np.argmax(np.where(kept, off, -1.0)))
        # With the worst one out, the others must agree much better than it does with them.
        limit = max(_AWAY * level, _LEAST, 2 * float(np.nan_to_num(noise[worst])))
        if off[worst] <= limit or kept.sum() <= max(FEWEST, 0.6 * own.sum()):
            break
        kept[worst] = False
    n, centre = int(kept.sum()), float(x[kept].mean())
    spread = float(np.sum((x[kept] - centre) ** 2))
    scatter = float(np.sqrt(np.sum(off[kept] ** 2) / max(n - 2, 1)))
    each = max(scatter, float(np.sqrt(np.mean(np.nan_to_num(noise[kept]) ** 2))))
    open_b = abs(float(np.sum((x[kept] - centre) * common[kept]) / spread))
    open_a = float(np.hypot(np.mean(common[kept]), centre * open_b))
    b_error = float(np.hypot(each / np.sqrt(spread), open_b))
    a_error = np.exp(a) * np.sqrt(each**2 * (1 / n + centre**2 / spread) + open_a**2)
    aside = tuple(int(i) for i in np.flatnonzero(own & ~kept))
    return PowerLaw(float(np.exp(a)), float(a_error), float(b), b_error, aside, scatter)
