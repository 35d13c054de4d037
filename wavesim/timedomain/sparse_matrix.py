"""The operator A as a sparse matrix: for tables, tests and other integrators."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import scipy.sparse as sp

from wavesim.timedomain.operator import Difference, Group, Operator, State, States


def sparse_matrix(operator: Operator | Group) -> sp.csr_array:
    """A, acting on states made flat by :func:`flat`.

    Returns:
        Shape (unknowns, unknowns), scaled.
    """
    groups = operator.groups if isinstance(operator, Operator) else (operator,)
    return sp.csr_array(sp.block_diag([_of_group(group) for group in groups], format="csr"))


def flat(y: States | State) -> np.ndarray:
    """All numbers of a state, in order of groups, their parts, components, blocks and points."""
    parts = [y] if isinstance(y, State) else y
    return np.concatenate([np.ravel(array) for state in parts for array in state])


def unflat(values: np.ndarray, like: States) -> States:
    """Inverse of :func:`flat`: a state of the shapes of another."""
    made, at = [], 0
    for state in like:
        arrays = []
        for array in state:
            size = int(np.prod(np.shape(array)))
            arrays.append(values[at : at + size].reshape(np.shape(array)))
            at += size
        made.append(State(*arrays))
    return tuple(made)


def _of_group(group: Group) -> Any:
    law, c, p = group.losses, group.c, group.c.macro
    rest = group.rest
    blocks, n = rest.B.shape[1:]
    starts = np.cumsum([0, *(array.size for array in rest)])
    total = int(starts[-1])

    def part(number: int) -> Any:
        """Takes one part of a state out of it."""
        size = rest[number].size
        return sp.eye_array(size, total, k=int(starts[number]), format="csr")

    along = functools.partial(_along, (blocks, n))
    difference = functools.partial(_difference, (blocks, n))
    pointwise = _pointwise

    phi, B, phi_rate, B_rate, kappa = (part(number) for number in range(5))
    f, b = p + rest.B.shape[0], rest.B.shape[0]
    kappa_rate = difference(group.D, p) @ phi_rate - along(law.absorb_half, p) @ kappa
    e, e_rate = sp.vstack([kappa, B]), sp.vstack([kappa_rate, B_rate])
    zeta = []
    for number in range(len(law.rates)):
        own = [
            sp.eye_array(m * blocks * n, total, k=int(starts[at] + number * m * blocks * n))
            for at, m in ((5, p), (6, b))
        ]
        zeta.append(sp.vstack(own))
    e_hat = e + along(law.stiffness, f) @ e_rate
    for strength, own in zip(law.strengths, zeta, strict=True):
        e_hat = e_hat - along(strength, f) @ own
    stress = pointwise(c.stiffness) @ e_hat
    sigma, tau = stress[: p * blocks * n], stress[p * blocks * n :]
    force = -tau
    if c.gradient is not None:
        slope = along(-1 / group.node_norm, b) @ difference(group.QT, b)
        bending = difference(group.D, b) @ pointwise(c.gradient) @ slope
        force = force + bending @ e_hat[p * blocks * n :]
    free = group.free != 0
    on_phi = -along(group.free, p) @ difference(group.QT, p) @ sigma
    on_phi = on_phi - along(np.where(free, law.drag_node, 0.0), p) @ phi_rate
    on_phi = on_phi - along(np.where(free, law.spring_node, 0.0), p) @ phi
    on_B = along(1 / c.inertia, b) @ force - along(law.drag_half, b) @ B_rate
    relaxing = [along(r, f) @ (e - own) for r, own in zip(law.rates, zeta, strict=True)]
    of_kappa = [one[: p * blocks * n] for one in relaxing]
    of_B = [one[p * blocks * n :] for one in relaxing]
    rows = [phi_rate, B_rate, on_phi, on_B, kappa_rate, *of_kappa, *of_B]
    return sp.vstack([row for row in rows if row.shape[0]], format="csr")


def second_order(group: Group) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
    """F, K and G of q̈ = F K G q of a group without losses, q = (φ, B) flat.

    G takes strains: κ = Dφ, B, and slopes −N⁻¹QᵀB where Γ counts; K, at each point, stresses of
    them; F what these do: φ̈ = −Qᵀσ/m_φ, B̈ = (−τ + D Γ∂B)/i_B. The three have half as many entries
    as their product.
    """
    c, p, (blocks, n) = group.c, group.c.macro, group.free.shape
    b = c.stiffness.shape[0] - p
    shape = blocks, n
    G = [[_difference(shape, group.D, p), None], [None, _along(shape, 1.0, b)]]
    K = [[_pointwise(c.stiffness), None]]
    per_inertia = _along(shape, 1 / c.inertia, b)
    F = [
        [-_along(shape, group.free, p) @ _difference(shape, group.QT, p), None],
        [None, -per_inertia],
    ]
    if c.gradient is not None:
        slope = _along(shape, -1 / group.node_norm, b) @ _difference(shape, group.QT, b)
        G.append([None, slope])
        K = [[K[0][0], None], [None, _pointwise(c.gradient)]]
        F[0].append(None)
        F[1].append(per_inertia @ _difference(shape, group.D, b))
    if not p:
        G, F = [row[1:] for row in G[1:]], [row[1:] for row in F[1:]]
    return tuple(sp.block_array(one, format="csr") for one in (F, K, G))


def _along(shape: tuple[int, int], values: Any, components: int) -> Any:
    """Multiplies each component by values, shape (points,) or (blocks, points)."""
    spread = np.broadcast_to(np.asarray(values, float), (components, *shape)).ravel()
    at = np.arange(len(spread) + 1)
    return sp.csr_array((spread, at[:-1], at), shape=(len(spread), len(spread)))


def _difference(shape: tuple[int, int], difference: Difference, components: int) -> Any:
    """Takes a difference of each component."""
    blocks, n = shape
    one, count = difference_matrix(difference, n), components * blocks
    at = np.arange(count)[:, None]
    ends = np.append((one.indptr[:-1] + at * one.nnz).ravel(), count * one.nnz)
    made = np.tile(one.data, count), (one.indices + n * at).ravel(), ends
    return sp.csr_array(made, shape=(count * n, count * n))


def _pointwise(matrix: Any) -> Any:
    """Σ_j matrix[i, j] u_j at each point, matrix of shape (i, j, blocks, points)."""
    values = np.asarray(matrix)
    values = values.reshape(*values.shape[:2], -1)
    count, width, points = values.shape
    columns = np.arange(points)[:, None] + points * np.arange(width)
    ends = width * np.arange(count * points + 1)
    made = np.moveaxis(values, 1, 2).ravel(), np.tile(columns.ravel(), count), ends
    return sp.csr_array(made, shape=(count * points, width * points))


def difference_matrix(difference: Difference, n: int) -> sp.csr_array:
    """A difference of n points as a matrix."""
    alike = np.array(difference.stencil)[:, None]
    weights = (alike if difference.stencil else difference.weights) * np.broadcast_to(
        difference.scale, n
    )
    rows = np.broadcast_to(np.arange(n), weights.shape)
    columns = rows + difference.first + np.arange(len(weights))[:, None]
    kept = np.ones(weights.shape, bool)
    kept[:, difference.rows] = False
    if difference.ring:
        columns = columns % n
    else:
        kept &= (columns >= 0) & (columns < n)
    own = np.broadcast_to(np.asarray(difference.rows)[:, None], difference.columns.shape)
    entries = np.concatenate([weights[kept], np.ravel(difference.factors)])
    where = (
        np.concatenate([rows[kept], np.ravel(own)]),
        np.concatenate([columns[kept], np.ravel(difference.columns)]),
    )
    return sp.csr_array(sp.coo_array((entries, where), shape=(n, n)))
