"""Plane waves at an angle to the axis of symmetry, closure "consistent".

For k = k n, n = (cos θ, sin θ, 0), the tensors J, M, N of Appendix B couple all twelve fields. In
the limit Γ → 0 each ω has three pairs ±k, from a Christoffel matrix that depends on ω:

    k² D(ω², n) Φ = ω² Φ,   D_ik = [J + M − M (M − ω²)⁻¹ M]_ijkl n_j n_l.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wavesim.material.contact_tensors import (
    average_stiffness,
    gradient_stiffness,
    relative_stiffness,
)
from wavesim.material.granular_equations import GranularMedium
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, scales
from wavesim.planewave.eigenproblem import Complex, Float

POLARISATIONS: tuple[str, ...] = ("longitudinal", "transverse2", "transverse3")


def scaled_tensors(medium: Medium) -> BlockCoefficients:
    """The tensors of Appendix B in scaled form, whatever the medium's closure.

    Args:
        medium: whose own units are used.

    Returns:
        J + M as c_pp, M as c_pb, c_bp and c_bb, each (3, 3, 3, 3), and N as gamma, (3,)*6.

    Raises:
        ValueError: the medium is not a granular one, which has tensors.
    """
    if len(medium.parts) > 1:
        raise ValueError(f"family {medium.family.name}: take one of them, medium.parts[0]")
    if not isinstance(medium, GranularMedium):
        raise ValueError(f"family {medium.family.name}: has no tensors, so waves along x₁ only")
    J, M = average_stiffness(medium), relative_stiffness(medium)
    tensors = BlockCoefficients(J + M, M, M, M, gradient_stiffness(medium), *medium.inertias)
    return tensors.scaled(scales(medium))


@dataclass(frozen=True)
class DirectedWaves:
    """The three waves of one frequency over directions, in the limit Γ → 0.

    Attributes:
        theta: shape (n,), rad.
        omega: rad/s.
        polarisations: POLARISATIONS, named by what each wave is at θ = 0.
        slowness: k/ω, shape (n, 3), s/m; imaginary where the wave is evanescent.
        group_velocity: ∂ω/∂(k₁, k₂), shape (n, 3, 2), m/s; NaN where it is evanescent.
    """

    theta: Float
    omega: float
    polarisations: tuple[str, ...]
    slowness: Complex
    group_velocity: Float


def directed_waves(medium: Medium, omega: float, theta: ArrayLike) -> DirectedWaves:
    """Slowness and group velocity of the three waves of one frequency over directions.

    Args:
        medium: the medium, as closure "consistent".
        omega: angular frequency, rad/s, > 0, not a cutoff.
        theta: angles to the axis of symmetry, shape (n,), rad.

    Returns:
        The waves; longitudinal is the one of the two with a macro-field in the plane (x₁, x₂) whose
        Φ is nearer to n, which is how it is followed as the other crosses it.

    Raises:
        ValueError: omega is not positive.
    """
    if not omega > 0:
        raise ValueError(f"omega = {omega:g}: must be greater than 0 (rad/s)")
    angles = np.atleast_1d(np.asarray(theta, dtype=float))
    tensors = scaled_tensors(medium)
    square = (omega * float(medium.time_scale)) ** 2
    inner = tensors.c_bb.reshape(9, 9) - square * np.eye(9)
    coupling = tensors.c_pb.reshape(9, 9)
    back = np.linalg.solve(inner, coupling.T)
    effective = tensors.c_pp - (coupling @ back).reshape(3, 3, 3, 3)
    change = -(back.T @ back).reshape(3, 3, 3, 3)  # dD/dω²
    normals = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    christoffel = np.einsum("ijkl,nj,nl->nik", effective, normals, normals)
    values, vectors = np.linalg.eigh(christoffel)
    order = _by_polarisation(vectors, normals)
    values = np.take_along_axis(values, order, axis=-1)
    vectors = np.take_along_axis(vectors, order[:, None, :], axis=-1)
    slowness = 1 / np.sqrt(values.astype(complex))
    wave = np.where(values > 0, np.sqrt(square / np.abs(values)), np.nan)
    rising = np.einsum("nim,ijkl,nl,nkm->nmj", vectors, effective, normals, vectors)
    drop = np.einsum("nim,ijkl,nj,nl,nkm->nm", vectors, change, normals, normals, vectors)
    velocity = wave[..., None] * rising / (math.sqrt(square) * (1 - wave**2 * drop)[..., None])
    to_speed = float(medium.length_scale) / float(medium.time_scale)
    return DirectedWaves(
        angles, float(omega), POLARISATIONS, slowness / to_speed, velocity[..., :2] * to_speed
    )


def _by_polarisation(vectors: Float, normals: Float) -> Any:
    """Places of the longitudinal, in-plane transverse and out-of-plane wave at each angle."""
    out = np.argmax(np.abs(vectors[:, 2, :]), axis=-1)
    along = np.abs(np.einsum("nim,ni->nm", vectors, normals))
    along[np.arange(len(out)), out] = -1
    longitudinal = np.argmax(along, axis=-1)
    return np.stack([longitudinal, 3 - longitudinal - out, out], axis=-1)
