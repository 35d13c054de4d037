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

from wavesim.material.contact_tensors import (
    average_stiffness,
    gradient_stiffness,
    relative_stiffness,
)
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, scales
from wavesim.planewave.eigenproblem import Eigenmodes, Float, solve

# The mirror x₃ → −x₃ changes the sign of the fields with an odd number of indices 3 and no others,
# or (where the macro-field is an axial vector) of all but these; a wave holds the one kind or the
# other.
KINDS: tuple[str, ...] = ("in-plane", "out-of-plane")
_TWO = list(itertools.product(range(3), repeat=2))


def scaled_tensors(medium: Medium) -> BlockCoefficients:
    """The tensors of Appendix B, scaled: J + M as c_pp, M as c_pb, c_bp, c_bb, and N as gamma."""
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
