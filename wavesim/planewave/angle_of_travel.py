"""Plane waves at an angle to the axis of symmetry, closure "consistent".

For k = k n, n = (cos θ, sin θ, 0), the tensors J, M, N of Appendix B are contracted with n:

    C_φφ = (J + M)_ijkl n_j n_l,   C_φB = M_ijkl n_j,   C_BB = M_ijkl,   Γ = N_ijklmn n_k n_n,

twelve coupled fields for one θ. At θ = 0 they are Eqs. (26)–(37) with M in every equation. The
mirror x₃ → −x₃ splits them into two kinds at every θ: seven fields with φ₁, φ₂ and five with φ₃.

In the limit Γ → 0 each ω has three pairs ±k, from a Christoffel matrix that depends on ω:

    k² D(ω², n) Φ = ω² Φ,   D_ik = [J + M − M (M − ω²)⁻¹ M]_ijkl n_j n_l.
"""

from __future__ import annotations

import itertools
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
from wavesim.material.granular import GranularMedium
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, scales
from wavesim.planewave.eigenproblem import Complex, Eigenmodes, Float, solve

# The mirror x₃ → −x₃ changes the sign of the fields with an odd number of indices 3 and no others,
# or (where the macro-field is an axial vector) of all but these; a wave holds the one kind or the
# other.
KINDS: tuple[str, ...] = ("in-plane", "out-of-plane")
_TWO = list(itertools.product(range(3), repeat=2))
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


def _normal(theta: float) -> Float:
    return np.array([math.cos(theta), math.sin(theta), 0.0])


def direction_form(medium: Medium, theta: float) -> BlockCoefficients:
    """Scaled coefficients of the twelve fields for waves along n(θ).

    Args:
        medium: the medium; its tensors are used in every equation, as closure "consistent".
        theta: θ, angle between the direction of travel and the axis x₁, rad.

    Returns:
        Coefficients for p = 3 macro- and b = 9 micro-fields, in the order of the family's.
    """
    return _contract(scaled_tensors(medium), _normal(theta))


def _contract(tensors: BlockCoefficients, n: Float) -> BlockCoefficients:
    coupling = np.einsum("ijkl,j->ikl", tensors.c_pb, n).reshape(3, 9)
    return BlockCoefficients(
        c_pp=np.einsum("ijkl,j,l->ik", tensors.c_pp, n, n),
        c_pb=coupling,
        c_bp=coupling.T,
        c_bb=tensors.c_bb.reshape(9, 9),
        gamma=np.einsum("ijklmn,k,n->ijlm", tensors.gamma, n, n).reshape(9, 9),
    )


def kind_form(form: BlockCoefficients, kind: str) -> BlockCoefficients:
    """The part of the twelve fields' coefficients that holds one of KINDS."""
    odd = kind == KINDS[1]
    p = [i for i in range(3) if (i == 2) == odd]
    b = [n for n, (i, j) in enumerate(_TWO) if ((i == 2) != (j == 2)) == odd]
    return BlockCoefficients(
        form.c_pp[np.ix_(p, p)],
        form.c_pb[np.ix_(p, b)],
        form.c_bp[np.ix_(b, p)],
        form.c_bb[np.ix_(b, b)],
        form.gamma[np.ix_(b, b)],
    )


def _modes(medium: Medium, theta: float, k: ArrayLike) -> tuple[Float, Eigenmodes]:
    scaled = np.atleast_1d(np.asarray(k, dtype=float)) * float(medium.length_scale)
    return scaled, solve(direction_form(medium, theta), scaled)


def frequencies(medium: Medium, theta: float, k: ArrayLike) -> Float:
    """ω(k) of the twelve waves along n(θ), ascending at each k.

    Args:
        medium: the medium, as closure "consistent".
        theta: θ, rad.
        k: wavenumbers, shape (n,), rad/m.

    Returns:
        Angular frequencies, shape (n, 12), rad/s.
    """
    _, modes = _modes(medium, theta, k)
    return np.sqrt(np.maximum(modes.squares, 0.0)) / float(medium.time_scale)


def group_velocity(medium: Medium, theta: float, k: ArrayLike) -> Float:
    """∂ω/∂(k₁, k₂) of the twelve waves along n(θ), in the order of :func:`frequencies`.

    Each is vᵀ (∂K/∂k_j) v / 2ω. Where waves share a frequency their velocities are those of the
    modes that the eigenproblem happens to give.

    Args:
        medium: the medium, as closure "consistent".
        theta: θ, rad.
        k: wavenumbers, shape (n,), not 0, rad/m.

    Returns:
        Velocities, shape (n, 12, 2), m/s.

    Raises:
        ValueError: a k is 0, where no direction of travel is defined.
    """
    scaled, modes = _modes(medium, theta, k)
    if (scaled == 0).any():
        raise ValueError("k = 0: must not be 0; the direction of travel is lost there")
    tensors = scaled_tensors(medium)
    wave = scaled[:, None] * _normal(theta)
    slopes = np.zeros((len(scaled), 3, 12, 12))
    travelling = np.einsum("ijkl,nl->njik", tensors.c_pp, wave)
    slopes[:, :, :3, :3] = travelling + np.swapaxes(travelling, -1, -2)
    coupling = tensors.c_pb.transpose(1, 0, 2, 3).reshape(3, 3, 9)
    slopes[:, :, :3, 3:] = -coupling
    slopes[:, :, 3:, :3] = -np.swapaxes(coupling, -1, -2)
    gradient = np.einsum("ijklmx,nx->nkijlm", tensors.gamma, wave).reshape(-1, 3, 9, 9)
    slopes[:, :, 3:, 3:] = gradient + np.swapaxes(gradient, -1, -2)
    rising = np.einsum("nam,njab,nbm->nmj", modes.left, slopes[:, :2], modes.right)
    omega = np.sqrt(np.maximum(modes.squares, 0.0))[..., None]
    return rising / (2 * omega) * float(medium.length_scale) / float(medium.time_scale)


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
