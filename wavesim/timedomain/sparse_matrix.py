"""The operator A as a sparse matrix: for tables, tests and other integrators."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from wavesim.timedomain.operator import Difference, Group, Operator, State, States


def sparse_matrix(operator: Operator | Group) -> sp.csr_array:
    """A, acting on states made flat by :func:`flat`.

    Args:
        operator: of plain numbers; or one of its groups.

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
    law, c, p = group.losses, group.c, group.c.rotations
    rest = group.rest
    blocks, n = rest.B.shape[1:]
    starts = np.cumsum([0, *(array.size for array in rest)])
    total = int(starts[-1])

    def part(number: int) -> Any:
        """Takes one part of a state out of it."""
        size = rest[number].size
        return sp.eye_array(size, total, k=int(starts[number]), format="csr")

    def along(values: Any, components: int) -> Any:
        """Multiplies each component by values, shape (points,) or (blocks, points)."""
        spread = np.broadcast_to(np.asarray(values), (components, blocks, n))
        return sp.diags_array(spread.ravel(), format="csr")

    def difference(matrix: Difference, components: int) -> Any:
        return sp.kron(sp.eye_array(components * blocks), _matrix(matrix, n), format="csr")

    def pointwise(matrix: Any) -> Any:
        """Σ_j matrix[i, j] u_j at each point, matrix of shape (i, j, blocks, points)."""
        rows = [[sp.diags_array(np.ravel(one)) for one in row] for row in np.asarray(matrix)]
        return sp.csr_array(sp.block_array(rows, format="csr"))

    phi, B, phi_rate, B_rate, psi, chi = (part(number) for number in range(6))
    f, b = p + rest.B.shape[0], rest.B.shape[0]
    D = difference(group.D, p)
    kappa, rate = D @ phi, D @ phi_rate
    if law.absorbing and p:
        kappa = kappa - psi
        rate = rate - along(law.absorb_half, p) @ kappa
    e, e_rate = sp.vstack([kappa, B]), sp.vstack([rate, B_rate])
    zeta = []
    for number in range(len(law.rates)):
        own = [
            sp.eye_array(m * blocks * n, total, k=int(starts[at] + number * m * blocks * n))
            for at, m in ((6, p), (7, b))
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
    on_phi = -along(group.free, p) @ difference(group.QT, p) @ sigma
    on_B = along(1 / c.inertia, b) @ force
    if law.absorbing:
        on_phi = on_phi - chi if p else on_phi
        on_B = on_B - along(law.calm, b) @ B_rate
    memory = [psi, chi]
    if law.absorbing and p:
        memory = [along(law.absorb_half, p) @ kappa, along(law.absorb_node, p) @ on_phi]
    if law.damped:
        free = np.where(group.free == 0, 0.0, law.mass_node)
        on_phi = on_phi - along(free, p) @ phi_rate
        on_B = on_B - along(law.mass_half, b) @ B_rate
    relaxing = [along(r, f) @ (e - own) for r, own in zip(law.rates, zeta, strict=True)]
    of_kappa = [one[: p * blocks * n] for one in relaxing]
    of_B = [one[p * blocks * n :] for one in relaxing]
    rows = [phi_rate, B_rate, on_phi, on_B, *memory, *of_kappa, *of_B]
    return sp.vstack([row for row in rows if row.shape[0]], format="csr")


def _matrix(difference: Difference, n: int) -> sp.csr_array:
    """A difference of n points as a matrix."""
    weights = np.broadcast_to(np.asarray(difference.weights), (len(difference.weights), n))
    rows = np.broadcast_to(np.arange(n), weights.shape)
    columns = rows + difference.first + np.arange(len(weights))[:, None]
    kept = weights != 0
    if difference.ring:
        columns = columns % n
    else:
        kept &= (columns >= 0) & (columns < n)
    entries = weights[kept], (rows[kept], columns[kept])
    return sp.csr_array(sp.coo_array(entries, shape=(n, n)))


def indices(state: State, points: Sequence[int] | np.ndarray) -> State:
    """Where the numbers of a group at some points stand among its flat ones, a state of indices."""
    made, at = [], 0
    for array in state:
        shape = np.shape(array)
        numbers = at + np.arange(int(np.prod(shape))).reshape(shape)
        made.append(numbers[..., np.asarray(points)])
        at += int(np.prod(shape))
    return State(*made)
