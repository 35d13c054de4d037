"""Waves that spread: amplitudes along a line that fall as a power of the distance.

A plane wave's amplitude falls as e^{−αx}, that of a cylindrical one as r^{−½} besides, of a
spherical one as 1/r. Taken for plane, such waves seem to lose p/r nepers a metre that they keep.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[Any]

# Exponents p of r^{−p}.
KINDS = {"plane": 0.0, "cylindrical": 0.5, "spherical": 1.0}
# Spreading is told where p is above this and so many of its errors; beyond the second value no wave
# spreads.
_LEAST, _MOST = 0.25, 2.0
_ERRORS = 8.0
# Of lower and of higher frequencies it is one to this, or to so many errors.
_ALIKE, _APART = 0.3, 4.0
_FEWEST = 6
# Distances of a source that is not named from the first receiver, over the line's length.
_DISTANCES = np.geomspace(0.02, 3.0, 40)


def exponent(
    U: Any, x: Float, used: Any, source: float | None
) -> tuple[float, float, float | None]:
    """p of amplitudes r^{−p} e^{−αx}, α different at each frequency, and its standard error.

    What each receiver's level is off the straight line at each frequency is fitted by −p ln r; how
    the receivers, each at all frequencies together, scatter about that is its error.

    Args:
        U: amplitudes, shape (nω, nx).
        x: positions, ascending, shape (nx,), m.
        used: which count, shape (nω, nx).
        source: where the waves come from, m; where None, the place that fits best.

    Returns:
        p and its error, –, 0 and ∞ where too few receivers tell; and the place, m.
    """
    rows = used.sum(axis=1) >= _FEWEST
    if rows.sum() < 2:
        return 0.0, np.inf, source
    w = used[rows].astype(float)
    count = w.sum(axis=1, keepdims=True)
    away = (x - (w @ x)[:, None] / count) * w
    steep = np.sum(away**2, axis=1, keepdims=True)

    def bent(level: Any) -> Any:
        """What a level is off a straight line of the receivers used, shape (nω, nx)."""
        slope = np.sum(away * level, axis=1, keepdims=True) / steep
        return (level - np.sum(w * level, axis=1, keepdims=True) / count) * w - slope * away

    left = bent(np.log(np.maximum(np.abs(U[rows]), 1e-290)))
    length, nx = float(np.ptp(x)), int(w.any(axis=0).sum())
    places = [source] if source is not None else list(x[0] - _DISTANCES * length)
    best: tuple[float, float, float, float | None] = (np.inf, 0.0, np.inf, source)
    for place in places:
        shape = bent(-np.log(np.abs(x - place))[None])
        size = float(np.sum(shape**2))
        power = float(np.sum(shape * left)) / size
        rest = left - power * shape
        error = float(np.sqrt(np.sum(np.sum(shape * rest, axis=0) ** 2))) / size
        error *= np.sqrt(nx / (nx - 3 - (source is None)))
        if (least := float(np.sum(rest**2))) < best[0]:
            best = (least, power, error, place)
    return best[1:]


def spreads(U: Any, x: Float, used: Any, source: float | None) -> str:
    """Why amplitudes are no plane waves', "" where nothing tells.

    Args:
        U, x, used, source: as of :func:`exponent`.
    """
    power, error, place = exponent(U, x, used, source)
    if not (_LEAST < power < _MOST and power > _ERRORS * error):
        return ""
    # Waves of all frequencies spread alike; what bends levels otherwise is no spreading.
    rows = np.flatnonzero(used.sum(axis=1) >= _FEWEST)
    halves = [exponent(U[own], x, used[own], place)[:2] for own in np.array_split(rows, 2)]
    (one, off), (other, unsure) = halves
    if abs(one - other) > max(_ALIKE, _APART * float(np.hypot(off, unsure))):
        return ""
    if source is None:
        return (
            "amplitudes fall as those of waves that spread, not of plane ones: name --source, and "
            "--spreading cylindrical or spherical"
        )
    kind = "cylindrical" if power < 0.75 else "spherical"
    return (
        f"amplitudes fall as r^-{power:.2g} besides a loss, as of waves that spread, not of plane "
        f"ones: take --spreading {kind}"
    )
