"""Stretches of a bar joined end to end: their modes by closures, and exactly.

The model problem is ρφ̈ = ∂ₓσ, σ = cφ′ − bB, B̈ = bφ′ − wB, in one layer or two; with b = 0 it is
the plain wave equation. A layer is (c, ρ, b, w).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from wavesim.grid.summation_by_parts import chain

PLAIN = (1.0, 1.0, 0.0, 1.0)


def dense(made):
    """D as a matrix; what a diagonal has beyond the nodes must be 0."""
    n = made.diagonals.shape[1]
    matrix = np.zeros((n, n + 1))
    for offset, diagonal in enumerate(made.diagonals, start=made.first):
        columns = np.arange(n) + offset
        inside = (columns >= 0) & (columns <= n)
        assert not diagonal[~inside].any()
        matrix[np.arange(n)[inside], columns[inside]] = diagonal[inside]
    return matrix


def positions(cells, spacings):
    """Nodes, half-nodes, m."""
    ends = np.cumsum([0.0, *(n * h for n, h in zip(cells, spacings, strict=True))])
    nodes, half = [np.zeros(1)], []
    for start, n, h in zip(ends, cells, spacings, strict=False):
        nodes.append(start + h * np.arange(1, n + 1))
        half.append(start + h * (np.arange(n) + 0.5))
    return np.concatenate(nodes), np.concatenate(half)


def modes(order, cells, spacings, layers, fixed=(False, False)):
    """ω and modes (φ at the nodes, σ at the half-nodes), ascending in ω.

    At a shared node each stretch adds its own density times its own norm, which is as its h.
    """
    made = chain(order, cells, spacings)
    d = dense(made)
    c, _, b, w = (
        np.concatenate([np.full(n, layer[k]) for n, layer in zip(cells, layers, strict=True)])
        for k in range(4)
    )
    density = np.zeros(len(made.node_norm))
    share = np.zeros(len(made.node_norm))
    start = 0
    for n, h, layer in zip(cells, spacings, layers, strict=True):
        density[start : start + n + 1] += layer[1] * h
        share[start : start + n + 1] += h
        start += n
    mass = made.node_norm * density / share
    kept = np.ones(len(mass), dtype=bool)
    kept[[0, -1]] = [not end for end in fixed]
    g = (np.sqrt(made.half_norm)[:, None] * d / np.sqrt(mass))[:, kept]
    if b.any():
        k = np.block([[g.T @ (c[:, None] * g), -g.T * b], [-b[:, None] * g, np.diag(w)]])
        squares, vectors = np.linalg.eigh(k)
        omega = np.sqrt(np.maximum(squares, 0.0))
        internal = vectors[g.shape[1] :] / np.sqrt(made.half_norm)[:, None]
    else:  # By singular values, which keep small ω to more digits.
        _, values, vt = np.linalg.svd(np.sqrt(c)[:, None] * g)
        nulls = g.shape[1] - len(values)
        omega = np.concatenate([np.zeros(max(nulls, 0)), values[::-1]])
        vectors, internal = vt[::-1].T, 0.0
    phi = np.zeros((len(mass), vectors.shape[1]))
    phi[kept] = vectors[: g.shape[1]] / np.sqrt(mass[kept])[:, None]
    return omega, phi, c[:, None] * (d @ phi) - b[:, None] * internal


def impedance(layer, omega):
    """Effective c and k/ω of a layer at ω below its resonance."""
    c, rho, b, w = layer
    effective = c - b**2 / (w - omega**2)
    return effective, np.sqrt(rho / effective)


def exact_two(lengths, layers, highest):
    """ω of a free-free bar of two layers: roots of c₁k₁ sin₁ cos₂ + c₂k₂ cos₁ sin₂."""

    def mismatch(omega):
        (c1, s1), (c2, s2) = (impedance(layer, omega) for layer in layers)
        one, two = omega * s1 * lengths[0], omega * s2 * lengths[1]
        return c1 * s1 * np.sin(one) * np.cos(two) + c2 * s2 * np.cos(one) * np.sin(two)

    grid = np.linspace(1e-3 * highest, highest, 4001)
    values = mismatch(grid)
    return np.array(
        [
            brentq(mismatch, low, high, xtol=1e-15, rtol=1e-14)
            for low, high, a, b in zip(grid, grid[1:], values, values[1:], strict=False)
            if a * b < 0
        ]
    )


def slope(x, y):
    """Exponent n of y ∝ xⁿ, least squares on the logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
