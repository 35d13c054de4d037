"""Staggered finite-difference weights and their exact effect on a plane wave.

A first difference of even order 2m between grid points, taken half-way between them:

    u′(x) ≈ Σ_{j=1..m} c_j [u(x + (j−½)h) − u(x − (j−½)h)] / h

Weights: Fornberg, Math. Comp. 51, 699 (1988); here in the closed form of the staggered case.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

ORDERS: tuple[int, ...] = (2, 4, 6, 8, 10, 12)

Float = NDArray[np.float64]


@cache
def difference_weights(order: int) -> tuple[float, ...]:
    """Weights c_1…c_m of the staggered first difference of order 2m.

        c_j = (−1)^{j−1} [(2m−1)!!]² / (2^{2m−2} (m+j−1)! (m−j)! (2j−1)²)

    Args:
        order: 2m, one of ORDERS.

    Raises:
        ValueError: the order is not offered.
    """
    if order not in ORDERS:
        raise ValueError(f"order = {order}: must be one of {', '.join(map(str, ORDERS))}")
    m = order // 2
    odd = math.prod(range(2 * m - 1, 0, -2))
    return tuple(
        (-1) ** (j - 1)
        * odd**2
        / (2 ** (2 * m - 2) * math.factorial(m + j - 1) * math.factorial(m - j) * (2 * j - 1) ** 2)
        for j in range(1, m + 1)
    )


def modified_wavenumber(k: ArrayLike, spacing: float, order: int) -> Float:
    """What the difference makes of ∂ₓ exp(ikx) = ik exp(ikx): k̃ = (2/h) Σ c_j sin((j−½)kh).

    Args:
        k: wavenumbers, any shape, 1/length.
        spacing: h, length.
        order: of the difference.

    Returns:
        k̃, shape of k, 1/length.
    """
    k = np.asarray(k, dtype=float)
    parts = [
        weight * np.sin((j - 0.5) * k * spacing)
        for j, weight in enumerate(difference_weights(order), start=1)
    ]
    return 2 / spacing * np.sum(parts, axis=0)


def difference_norm(spacing: float, order: int) -> float:
    """‖D‖ = (2/h) Σ |c_j| of an endless grid: no difference is larger. Unit 1/length."""
    return 2 / spacing * sum(abs(weight) for weight in difference_weights(order))


def interpolation_weights(
    position: float, first: float, spacing: float, width: int, shift: int = 0
) -> tuple[Float, NDArray[np.int64]]:
    """Lagrange weights that give the value at a position from the nearest grid points.

    Args:
        position: where, length.
        first: position of grid point 0, length.
        spacing: h, length.
        width: number of points, even; the order of the interpolation.
        shift: how many points further up to take them, where the grid ends.

    Returns:
        The weights and the indices of the points, not wrapped to the grid; a single point with
        weight 1 where the position falls on one.
    """
    exact = (position - first) / spacing
    nearest = round(exact)
    if abs(exact - nearest) < 1e-9:
        return np.ones(1), np.array([nearest])
    indices = math.floor(exact) + np.arange(1 - width // 2, width // 2 + 1) + shift
    weights = np.array(
        [np.prod([(exact - j) / (i - j) for j in indices if j != i]) for i in indices]
    )
    return weights, indices
