"""Differences of a bar with ends and interfaces: one stencil, with exceptions in a few rows."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.operator import difference


class Banded(eqx.Module):
    """A difference on a grid: one antisymmetric stencil, but for some rows near ends.

    Row j takes the stencil of the points about it, times scale[j]; the rows named in ``rows`` take
    the columns and weights given for them instead.

    Attributes:
        weights: c_1 … c_m.
        forward: True where row j lies between columns j and j + 1, False: between j − 1 and j.
        scale: shape (n,), or one number.
        rows: shape (r,); columns, factors: shape (r, c).
    """

    weights: tuple[float, ...] = eqx.field(static=True)
    forward: bool = eqx.field(static=True)
    scale: Any
    rows: Any
    columns: Any
    factors: Any

    def __call__(self, u: jax.Array) -> jax.Array:
        """The product with u along its last axis, shape (…, n)."""
        made = difference(u, self.weights, self.forward) * self.scale
        if not len(self.rows):
            return made
        special = jnp.einsum("rc,...rc->...r", self.factors, u[..., self.columns])
        return made.at[..., self.rows].set(special, unique_indices=True)


def banded(
    first: int,
    diagonals: np.ndarray,
    weights: tuple[float, ...],
    scale: np.ndarray,
    forward: bool,
) -> Banded:
    """A matrix given by diagonals, as stencil and exceptions.

    Args:
        first: column of the first diagonal in row 0; columns count modulo n.
        diagonals: shape (width, n).
        weights: of the stencil.
        scale: factor of the stencil in each row, shape (n,).
        forward: see :class:`Banded`.
    """
    width, n = diagonals.shape
    m = len(weights)
    plain = np.zeros_like(diagonals)
    for j, weight in enumerate(weights):
        plain[(j + 1 if forward else j) - first] = weight * scale
        plain[(-j if forward else -j - 1) - first] = -weight * scale
    assert 2 * m <= width
    away = np.abs(diagonals - plain).max(axis=0) > 1e-13 * np.abs(diagonals).max()
    rows = np.flatnonzero(away)
    columns = (rows[:, None] + first + np.arange(width)) % n
    even = np.ptp(scale) == 0
    return Banded(
        weights, forward, float(scale[0]) if even else scale, rows, columns, diagonals[:, rows].T
    )
