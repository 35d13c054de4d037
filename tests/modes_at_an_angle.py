"""All twelve waves at an angle to the axis of symmetry, the gradient term kept.

For k = k n, n = (cos θ, sin θ, 0), the tensors of Appendix B are contracted with n:

    C_φφ = (J + M)_ijkl n_j n_l,   C_φB = M_ijkl n_j,   C_BB = M_ijkl,   Γ = N_ijklmn n_k n_n.

At θ = 0 they are Eqs. (26)–(37) with M in every equation. The mirror x₃ → −x₃ splits them into two
kinds at every θ: seven fields with φ₁, φ₂ and five with φ₃.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import ArrayLike

from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients
from wavesim.planewave.angle_of_travel import scaled_tensors
from wavesim.planewave.eigenproblem import Eigenmodes, Float, solve

# The mirror x₃ → −x₃ changes the sign of the fields with an odd number of indices 3 and no others,
# or (where the macro-field is an axial vector) of all but these; a wave holds the one kind or the
# other.
KINDS: tuple[str, ...] = ("in-plane", "out-of-plane")
_TWO = list(itertools.product(range(3), repeat=2))


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
    return contract(scaled_tensors(medium), _normal(theta))


def contract(tensors: BlockCoefficients, n: Float) -> BlockCoefficients:
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
