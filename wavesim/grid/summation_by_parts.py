"""Staggered differences on a stretch with two ends, and on stretches joined end to end.

Cells of size h, φ on the nodes x_i = i h (i = 0…N), σ on the half-nodes. D takes φ to φ′ at the
half-nodes. With diagonal norms H_n (nodes), H_h (half-nodes) and Q = H_h D, all in units of h,

    (Qᵀσ)_i = δ_iN σ(x_N) − δ_i0 σ(x_0) − H_n,i σ′(x_i)

for polynomials σ, so that −H_n⁻¹QᵀCD is ∂ₓ C ∂ₓ with σ = Cφ′ = 0 at both ends, symmetric and
negative semi-definite in H_n: energy is kept, whatever C(x). No value of σ at an end is needed.
Dropping an end node holds it fixed. Stretches that share a node (norms and Qᵀσ add there, as finite
elements do) keep φ continuous exactly and σ as accurately as the rest.

In the interior D is the stencil of order 2m and the norms are 1; next to an end a block of Q and
the norms are free. All conditions are linear in them. Both norms must integrate polynomials of
degree 2q−2, as summation by parts implies; for q > m the conditions contradict each other (tried
to m = 4).

Cf. O'Reilly, Lundquist, Dunham & Nordström, J. Comput. Phys. 336, 572 (2017). Here what polynomials
leave free is fixed by least squares on plane waves (see _solve), on first use, in milliseconds.

    order  q  r   c  cells  radius   ω error at 8, 12, 16, 24 points to the wavelength
        2  1  1   2     2    1.00    2.6e-2   1.1e-2   6.4e-3   2.9e-3
        4  2  4   6     8    1.00    2.1e-3   3.0e-4   1.1e-4   2.4e-5
        6  3  6   9    13    1.00    7.4e-4   1.6e-4   2.1e-5   7.3e-7
        8  3  8  12    16    1.04    1.6e-3   9.2e-5   1.9e-6   2.1e-8
       10  3  8  13    16    1.02    1.6e-3   9.1e-5   1.8e-6   2.0e-8
       12  3  8  14    16    1.01    1.6e-3   9.1e-5   1.8e-6   2.0e-8

D is (r, c) next to an end; a stretch needs so many cells; the spectral radius of H_n⁻¹QᵀD is over
the interior's (2Σ|c_j|/h)²; the error is that of ω of ten wavelengths between two free or two
fixed ends, most of which comes from the ends: it falls with their distance. It is of the kind that
the coefficients were chosen by; two random layers, 70 cells, gave up to 3e-3, 2e-4, 1e-5, 6e-7 at
order 8. As h → 0 ω errs as h^2q, φ and σ at worst (next to an end) as h^(q+1); φ of the ten
wavelengths by 4e-2, 6e-3, 1e-3, 2e-4 at order 8. Larger q is to be had with positive norms (4 from
r = 8 on, 5 from 11, 6 from 15), but at 24 points and fewer none that was tried is better on the
whole.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from wavesim.grid.stencils import difference_weights

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Closure:
    """D and the norms next to a left end, in units of h; a right end mirrors it, with −D.

    Args:
        degree: q, up to which D and its adjoint are exact on polynomials.
        cells: the least number of cells of a stretch, so that its two closures keep apart.
        weights: of D in the first r half-nodes over the first c nodes, (r, c), unit 1/h.
        node_norm: H_n of the first c nodes, (c,), unit h; 1 beyond.
        half_norm: H_h of the first r half-nodes, (r,), unit h; 1 beyond.
    """

    degree: int
    cells: int
    weights: Float
    node_norm: Float
    half_norm: Float


@dataclass(frozen=True)
class Differences:
    """The difference D from nodes to half-nodes, by diagonals, and the norms of the points.

        (Dφ)_j = Σ_w diagonals[w, j] φ_{j + first + w},

    counted round a ring; else a diagonal is 0 wherever it leaves the nodes. No row reaches across a
    node that two stretches share. There the norm is of both, in proportion to their h: the mass of
    densities ρ₁, ρ₂ on it is H_n (ρ₁h₁ + ρ₂h₂)/(h₁ + h₂). −H_n⁻¹ Dᵀ H_h is the difference back.

    Args:
        first: offset of the first diagonal, ≤ 0.
        diagonals: (width, half-nodes), 1/m.
        node_norm: H_n, length that each node stands for, m.
        half_norm: H_h, that of each half-node, m.
    """

    first: int
    diagonals: Float
    node_norm: Float
    half_norm: Float


# Of each order: degree q; half-nodes r and nodes n whose r × n block of Q is free.
_SHAPES = {2: (1, 1, 1), 4: (2, 4, 4), 6: (3, 6, 7), 8: (3, 8, 8), 10: (3, 8, 8), 12: (3, 8, 8)}

# What fixes the coefficients that polynomials leave free: waves up to kh = 0.7 (9 points to the
# wavelength) and, a hundredfold, squares of waves up to 0.25 by the norms; both weighted by k^−3,
# towards fine grids. Found by search: errors at 8 to 24 points against the spectral radius.
_WAVES, _SQUARES, _POWER, _NORMS = 0.7, 0.5, 3, 100.0


@cache
def closure(order: int) -> Closure:
    """The closure of the staggered difference of an order at an end.

    Args:
        order: 2m, one of stencils.ORDERS.

    Raises:
        ValueError: the order is not offered.
    """
    interior = difference_weights(order)
    degree, rows, nodes = _SHAPES[order]
    q, node_norm, half_norm = _solve(interior, degree, rows, nodes)
    arrays = q / half_norm[:, None], node_norm, half_norm
    for array in arrays:
        array.setflags(write=False)
    return Closure(degree, max(2 * rows, 2 * nodes - 1, q.shape[1] - 1), *arrays)


def check_stretches(order: int, stretches: Sequence[tuple[int, float]]) -> None:
    """Hold stretches, (cells, h in m) of each, to what :func:`chain` can join.

    Raises:
        ValueError: the order is not offered, a spacing is not positive, or a stretch has too few
            cells for its two closures.
    """
    least = closure(order).cells
    for number, (count, h) in enumerate(stretches, start=1):
        if not (math.isfinite(h) and h > 0):
            raise ValueError(f"spacings = {h:g} (stretch {number}): must be greater than 0")
        if count < 1:
            raise ValueError(f"cells = {count} (stretch {number}): must be 1 or more")
        if count < least:
            # Rounded down, so that what it says is enough.
            digits = 10.0 ** (2 - math.floor(math.log10(count * h / least)))
            remedy = math.floor(count * h / least * digits) / digits
            raise ValueError(
                f"cells = {count} (layer {number}, {count * h:g} m thick): order {order} needs "
                f"at least {least}; take a spacing of {remedy:g} m or less, or a lower order"
            )


def chain(order: int, cells: Sequence[int], spacings: Sequence[float]) -> Differences:
    """Stretches joined end to end, n cells and n + 1 nodes in all.

    Args:
        order: 2m, one of stencils.ORDERS.
        cells: of each stretch.
        spacings: h of each stretch, m.

    Raises:
        ValueError: the order is not offered, there is no stretch, a spacing is not positive, or a
            stretch has too few cells for its two closures.
    """
    if not cells or len(cells) != len(spacings):
        raise ValueError(
            f"spacings: {len(spacings)} given for {len(cells)} stretches; give one for each, at "
            "least one"
        )
    check_stretches(order, tuple(zip(cells, spacings, strict=True)))
    end = closure(order)
    interior = difference_weights(order)
    rows, width = end.weights.shape
    entries = [(int(j), int(i)) for j, i in zip(*np.nonzero(end.weights), strict=True)]
    reach = max(len(interior), *(max(i - j, j - i + 1) for j, i in entries))
    first = 1 - reach
    total = sum(cells)
    diagonals = np.zeros((2 * reach, total))
    node_norm, half_norm = np.zeros(total + 1), np.empty(total)
    start = 0
    for count, h in zip(cells, spacings, strict=True):
        own = slice(start, start + count)
        for j, weight in enumerate(interior):
            diagonals[j + 1 - first, own] = weight / h
            diagonals[-j - first, own] = -weight / h
        left, right = start + np.arange(rows), start + count - 1 - np.arange(rows)
        diagonals[:, left] = diagonals[:, right] = 0.0
        for j, i in entries:
            diagonals[i - j - first, left[j]] = end.weights[j, i] / h
            diagonals[j - i + 1 - first, right[j]] = -end.weights[j, i] / h
        norm = np.ones(count + 1)
        norm[:width] += end.node_norm - 1
        norm[-width:] += end.node_norm[::-1] - 1
        node_norm[start : start + count + 1] += h * norm
        half_norm[own] = h
        half_norm[start : start + rows] = h * end.half_norm
        half_norm[start + count - rows : start + count] = h * end.half_norm[::-1]
        start += count
    for array in (diagonals, node_norm, half_norm):
        array.setflags(write=False)
    return Differences(first, diagonals, node_norm, half_norm)


def _solve(
    interior: Sequence[float], degree: int, rows: int, nodes: int
) -> tuple[Float, Float, Float]:
    """Q of the first rows, H_n and H_h: exact on polynomials, best on plane waves.

    Unknowns are the block of Q, row by row, then H_n, then H_h. Polynomials are taken as Legendre's
    over the closure, which keeps rounding at 1e-15; whatever they leave free is fixed by least
    squares. The error of an eigenfrequency is, to first order, that of the norms as a quadrature of
    σ² and φ², hence the last set: norms should integrate waves of twice the wavenumber.

    Args:
        interior: c_1…c_m.
        degree: q.
        rows, nodes: r half-nodes, whose rows of Q are free in their first nodes.

    Returns:
        Q (r, c), H_n (c,), H_h (r,) with c = r + m.
    """
    m = len(interior)
    width = rows + m
    x, half = np.arange(width + m + 1.0), np.arange(width + m) + 0.5
    q = np.zeros((len(half), len(x)))
    for j, weight in enumerate(interior):
        q += weight * (np.eye(*q.shape, j + 1) - np.eye(*q.shape, -j))
    rest = q.copy()
    rest[:rows, :nodes] = 0.0
    own = np.eye(width, nodes)

    def conditions(f: Any, df: Any) -> tuple[Any, Any]:
        """Q f = H_h f′ in the first rows; Qᵀf = −δ_i0 f(0) − H_n f′ in the first columns."""
        none, slopes = np.zeros((rows, nodes)), np.diag(df(half[:rows]))
        forward = np.hstack([np.kron(np.eye(rows), f(x[:nodes])), none, -slopes])
        adjoint = np.hstack(
            [np.kron(f(half[:rows]), own), df(x[:width])[:, None] * own, np.zeros((width, rows))]
        )
        known = -(rest.T @ f(half))[:width] - np.eye(width)[0] * f(x[:1])
        known[nodes:] -= df(x[nodes:width])
        return np.vstack([forward, adjoint]), np.concatenate([-(rest @ f(x))[:rows], known])

    def polynomial(k: int) -> tuple[Any, Any]:
        p = legendre.Legendre.basis(k, domain=[0.0, x[-1]])
        return conditions(p, p.deriv())

    def wave(k: float, largest: float) -> tuple[Any, Any]:
        weight = (largest / k) ** _POWER / largest
        matrix, known = conditions(
            lambda x: np.exp(1j * k * x), lambda x: 1j * k * np.exp(1j * k * x)
        )
        return weight * matrix, weight * known

    def quadrature(k: float, largest: float) -> tuple[Any, Any]:
        """Σ H exp(ikx) = ∫₀^∞ exp(ikx) dx = i/k, of both norms."""
        weight = _NORMS * (largest / k) ** _POWER
        matrix = np.zeros((2, rows * nodes + nodes + rows), dtype=complex)
        matrix[0, rows * nodes : -rows] = np.exp(1j * k * x[:nodes])
        matrix[1, -rows:] = np.exp(1j * k * half[:rows])
        beyond = np.exp(1j * k * np.array([nodes, rows + 0.5])) / (1 - np.exp(1j * k))
        return weight * matrix, weight * (1j / k - beyond)

    demanded = [polynomial(k) for k in range(degree + 1)]
    exact, value = (np.concatenate(a) for a in zip(*demanded, strict=True))
    u, s, vt = np.linalg.svd(exact)
    rank = int(np.sum(s > 1e-9 * s[0]))
    inverse = (vt[:rank].T / s[:rank]) @ u[:, :rank].T
    particular = inverse @ value
    free = vt[rank:].T
    points = (np.arange(8) + 0.5) / 8
    wanted = [wave(k, _WAVES) for k in _WAVES * points]
    wanted += [quadrature(k, _SQUARES) for k in _SQUARES * points]
    matrix, known = (np.concatenate(a) / math.sqrt(len(points)) for a in zip(*wanted, strict=True))
    matrix = np.vstack([matrix.real, matrix.imag])
    known = np.concatenate([known.real, known.imag])
    chosen = np.linalg.lstsq(matrix @ free, known - matrix @ particular)[0]
    solution = particular + free @ chosen
    solution += inverse @ (value - exact @ solution)  # What rounding left.
    found = q[:rows, :width].copy()
    found[:, :nodes] = solution[: rows * nodes].reshape(rows, nodes)
    node_norm = np.ones(width)
    node_norm[:nodes] = solution[rows * nodes : -rows]
    return found, node_norm, solution[-rows:].copy()
