"""Receivers of an even line that their neighbours do not bear out, whatever waves run.

What a receiver shows is told by its neighbours, as far as waves are longer than two spacings:

    u_j ≈ Σ_m c_m (u_{j−m} + u_{j+m}),    m = 1 … M,

with one c for the line, found by least squares from the line itself. A receiver that is off by
e_j(t) leaves e_j where it stands and −c_m e_j beside it; that pattern tells it from a field that
the neighbours do not determine, and whether a factor puts it right.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.channels import Mended, mend
from wavesim.records.faults.finding import Finding

Float = NDArray[Any]
Mask = NDArray[np.bool_]

FEWEST = 8
# M: the shorter, the fewer waves it tells, and the closer may receivers be that are off.
_REACHES = (4, 2, 1)
_FRAMES = 512
# A receiver is off where the pattern leaves no more than this part of what chance would, by this
# part of its power at least, and by so many times what is usual; so many may be.
_UNEXPLAINED, _PART, _ABOVE, _MOST = 0.4, 4e-3, 12.0, 0.2
# A factor explains all but this part of what a mis-scaled receiver is off by; between these it is
# divided out.
_ALONE, _SCALED = 0.1, (0.2, 5.0)
# Least part of the strongest receiver's amplitude that a receiver is looked at for.
_SEEN, _LEAST = 0.02, 4


def unlike_neighbours(
    component: Float, x: Float, labels: tuple[str, ...], unsure: Mask, found: list[Finding]
) -> Mended:
    """Receivers to rescale, to turn, or to leave out.

    Args:
        component: shape (nt, nx), finite, without offset; of evenly spaced receivers.
        x, labels: positions and names of the receivers.
        unsure: which have a size that says nothing: flat tops, gaps.
        found: findings, added to.
    """
    nx = component.shape[1]
    mended = Mended(np.arange(nx), np.ones(nx), np.zeros(nx, bool))
    gaps = np.diff(x)
    if nx < FEWEST or not np.isfinite(x).all() or np.ptp(gaps) > 1e-3 * gaps.mean():
        return mended
    some = np.linspace(0, len(component) - 1, min(len(component), _FRAMES)).astype(int)
    u = component[some]
    off: dict[int, float | None] = {}
    for _ in range(max(1, int(_MOST * nx))):
        tried = (_worst(u, np.array(sorted(off), int), reach) for reach in _REACHES)
        one = next((worst for worst in tried if worst is not None), None)
        if one is None:
            break
        off[one[0]] = one[1]
    else:
        return mended
    for j in [j for j in off if unsure[j]]:
        del off[j]
    scaled = {j: f for j, f in sorted(off.items()) if f is not None}
    if scaled:
        found.append(mend(mended, "mis-scaled", scaled, x, labels))
    out = {j: 0.0 for j, factor in sorted(off.items()) if factor is None}
    if out:
        found.append(mend(mended, "misfit", out, x, labels))
    return mended


def _off_by(u: Float, known: Mask, reach: int) -> tuple[Float, Float, Float, Float]:
    """The pattern of a receiver that is off, what each is off by, its power, and how surely."""
    c = _learned(u, np.flatnonzero(known), reach)
    pattern = np.r_[-c[::-1], 1.0, -c]
    left = _along(u, pattern) * known
    square = _along(known[None].astype(float), pattern**2)[0]
    error = _along(left, pattern) / np.maximum(square, 1e-300)
    about = _along(np.mean(left**2, axis=0)[None], np.ones(len(pattern)))[0]
    wrong = np.mean(error**2, axis=0)
    return pattern, error, wrong, square * wrong / np.maximum(about, 1e-300)


def _worst(u: Float, off: NDArray[np.int64], reach: int) -> tuple[int, float | None] | None:
    """The receiver that its neighbours bear out least, with a factor that puts it right, if any.

    Args:
        u: shape (nt, nx).
        off: receivers known to be off: equations with them do not count.
        reach: M.
    """
    nx = u.shape[1]
    known = np.zeros(nx, bool)
    known[reach : nx - reach] = True
    for j in off:
        known[max(j - reach, 0) : j + reach + 1] = False
    if known.sum() < reach + 2:
        return None
    pattern, error, wrong, explained = _off_by(u, known, reach)
    power = np.mean(u**2, axis=0)
    expected = u - error
    size = np.maximum(np.mean(expected**2, axis=0), power)
    share = wrong / np.maximum(size, 1e-300)
    seen = known & (size > _SEEN**2 * np.median(np.sort(power)[-max(2, nx // 4) :]))
    if seen.sum() < _LEAST:
        return None
    off_by = share > max(_PART, _ABOVE * float(np.median(share[seen])))
    off_by &= wrong > _ABOVE * float(np.median(wrong[known]))
    off_by &= seen & (explained > 1 - _UNEXPLAINED * (1 - 1 / len(pattern)))
    if not off_by.any():
        return None
    j = int(np.argmax(np.where(off_by, wrong, -1)))
    factor = float(np.sum(u[:, j] * expected[:, j]) / np.sum(expected[:, j] ** 2))
    remains = float(np.mean((u[:, j] - factor * expected[:, j]) ** 2))
    alone = remains < _ALONE * wrong[j] + _ABOVE * float(np.median(wrong[known]))
    low, high = _SCALED
    return j, factor if alone and low <= abs(factor) <= high else None


def _along(rows: Float, pattern: Float) -> Float:
    """Σ_m pattern_m rows_{j+m} of each row, m from −M to M; nothing beyond the ends."""
    from scipy.ndimage import correlate1d  # slow to import, and only a fault needs it

    return np.asarray(correlate1d(rows, pattern, axis=1, mode="constant"))


def _learned(u: Float, known: NDArray[np.int64], reach: int) -> Float:
    """c from the receivers given, each weighed alike, those that fit least held down."""
    pairs = np.stack([u[:, known - m] + u[:, known + m] for m in range(1, reach + 1)], axis=-1)
    right = u[:, known]
    scale = np.sqrt(np.mean(pairs[..., 0] ** 2, axis=0)) + np.sqrt(np.mean(right**2, axis=0))
    scale = np.maximum(scale, 0.02 * scale.max(initial=1e-300))
    weight = 1 / scale
    c = np.zeros(reach)
    for _ in range(4):
        a = (pairs * weight[:, None]).reshape(-1, reach)
        normal = a.T @ a
        normal += 1e-9 * np.trace(normal) * np.eye(reach) + 1e-290 * np.eye(reach)
        c = np.linalg.solve(normal, a.T @ (right * weight).ravel())
        worth = np.sqrt(np.mean((right - pairs @ c) ** 2, axis=0)) / scale
        bound = 3 * max(float(np.median(worth)), 1e-12)
        weight = np.minimum(1, bound / np.maximum(worth, 1e-300)) / scale
    return c
