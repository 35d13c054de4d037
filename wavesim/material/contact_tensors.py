"""The constitutive tensors of Appendix B, by exact averages over contact directions.

J, M, N of rotation; C, E, H of translation are the same averages with K for G.

ξ(n) = (δ_pq + F_pq) n_p n_q / 4π, F = diag(a, −a/2, −a/2)  (Eqs. 18, 19), and
∫ n₁^2α n₂^2β n₃^2γ dΩ/4π = (2α−1)!!(2β−1)!!(2γ−1)!!/(2(α+β+γ)+1)!!, zero for any odd power.
"""

from __future__ import annotations

import itertools
import math
from functools import cache
from typing import Any

import numpy as np

from wavesim.material.medium import Medium


def _double_factorial(n: int) -> int:
    return math.prod(range(n, 0, -2))


@cache
def direction_moments(order: int) -> np.ndarray:
    """Isotropic direction moments ∫ n_i₁…n_i_m dΩ/4π (Appendix A).

    Args:
        order: m, the number of indices, even.

    Returns:
        Array of shape (3,)*m, dimensionless, read-only.
    """
    moments = np.zeros((3,) * order)
    for index in itertools.product(range(3), repeat=order):
        powers = [index.count(axis) for axis in range(3)]
        if all(power % 2 == 0 for power in powers):
            top = math.prod(_double_factorial(power - 1) for power in powers)
            moments[index] = top / _double_factorial(order + 1)
    moments.setflags(write=False)
    return moments


def fabric_moments(anisotropy: Any, order: int) -> Any:
    """Direction moments under the contact density, ⟨n_i₁…n_i_m⟩ = ∫ n_i₁…n_i_m ξ dΩ.

    (δ_pq + F_pq) n_p n_q = 1 + a (3n₁² − 1)/2, so a moment of order m is one of order m plus a
    times one of order m + 2.

    Args:
        anisotropy: a, –.
        order: m, even.

    Returns:
        Array of shape (3,)*m, dimensionless.
    """
    isotropic, slope = _fabric_terms(order)
    return isotropic + anisotropy * slope


@cache
def _fabric_terms(order: int) -> tuple[np.ndarray, np.ndarray]:
    """What :func:`fabric_moments` is made of: itself at a = 0, and its slope in a."""
    isotropic = direction_moments(order)
    along_axis = direction_moments(order + 2)[..., 0, 0]
    return isotropic, 1.5 * along_axis - 0.5 * isotropic


@cache
def _spread_terms(order: int) -> tuple[np.ndarray, np.ndarray]:
    """The same, times δ_ik."""
    isotropic, slope = (np.multiply.outer(np.eye(3), part) for part in _fabric_terms(order))
    return isotropic, slope


def _contact_stiffness_average(medium: Medium, normal: Any, order: int) -> Any:
    """⟨G_ik n_j…⟩ with G = (G_n − G_s) n⊗n + G_s I (Eq. 15), order = number of n's beside G.

    Index order of the result: i, k, then the n's. Shape (3,)*(order + 2), unit of the stiffness.
    """
    tangential = medium.stiffness_ratio * normal
    aligned = fabric_moments(medium.anisotropy, order + 2)
    isotropic, slope = _spread_terms(order)
    spread = isotropic + medium.anisotropy * slope
    return (normal - tangential) * aligned + tangential * spread


def average_stiffness(medium: Medium) -> Any:
    """J_ijkl = l² N_p ⟨G^a_ik n_j n_l⟩, of μ = J : κ (Eq. 23). Shape (3, 3, 3, 3), N; Pa."""
    average = _contact_stiffness_average(medium, medium.stiffnesses[0], 2)
    return medium.per_contacts * average.transpose(0, 2, 1, 3)


def relative_stiffness(medium: Medium) -> Any:
    """M_ijkl = l² N_p ⟨G^r_ik n_j n_l⟩, of υ = M : (κ − B) (Eq. 24). Shape (3, 3, 3, 3), N; Pa."""
    average = _contact_stiffness_average(medium, medium.stiffnesses[1], 2)
    return medium.per_contacts * average.transpose(0, 2, 1, 3)


def gradient_stiffness(medium: Medium) -> Any:
    """N_ijklmn = l⁴ N_p/4 ⟨G^g_il n_j n_k n_m n_n⟩, of 𝕍 = N ⋮ ∇B (Eq. 25).

    Shape (3,)*6, N·m²; N.
    """
    scale = medium.branch_length**4 * medium.contact_density / 4
    average = _contact_stiffness_average(medium, medium.stiffnesses[2], 4)
    return scale * average.transpose(0, 2, 3, 1, 4, 5)
