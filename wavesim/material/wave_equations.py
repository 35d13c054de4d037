"""The twelve wave equations (26)–(37) in flux form, by closure, and their split into sectors.

    m_φ φ̈ = ∂ₓσ + k,             σ = C_φφ φ′ − C_φB B
    m_B B̈ = C_Bφ φ′ − C_BB B + Γ ∂ₓ²B + Π

Every matrix is divided by l² N_p, as the paper's equations are. Closure "consistent" takes M from
Appendix B everywhere. The paper's φ equations (26)–(28) and its gradient terms agree with that;
in its B equations (29)–(37) the relative stiffness is another matrix, `_PRINTED_RELATIVE`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.material.contact_tensors import (
    average_stiffness,
    gradient_stiffness,
    relative_stiffness,
)
from wavesim.material.medium import CLOSURES, Medium

ROTATIONS: tuple[str, ...] = ("phi1", "phi2", "phi3")
CURVATURES: tuple[str, ...] = tuple(f"B{i}{j}" for i in "123" for j in "123")
FIELDS: tuple[str, ...] = ROTATIONS + CURVATURES
UNITS: dict[str, str] = dict.fromkeys(ROTATIONS, "rad") | dict.fromkeys(CURVATURES, "1/m")

# Relative stiffness in Eqs. (29)–(37) as printed: row field, column field of D = κ − B, and the
# factors of p₁, p₂, a·p₁, a·p₂.
_PRINTED_RELATIVE: dict[tuple[str, str], tuple[int, int, int, int]] = {
    ("B11", "B11"): (5, 16, 4, 8),
    ("B11", "B22"): (0, 7, 0, 1),
    ("B11", "B33"): (0, 7, 0, 1),
    ("B22", "B22"): (5, 16, -2, -4),
    ("B33", "B33"): (5, 16, -2, -4),
    ("B22", "B33"): (0, 7, 0, -2),
    ("B12", "B12"): (5, 2, 1, 0),
    ("B21", "B21"): (5, 2, 1, 0),
    ("B12", "B21"): (0, 7, 0, 1),
    ("B13", "B13"): (5, 2, 1, 0),
    ("B31", "B31"): (5, 2, 1, 0),
    ("B13", "B31"): (0, 7, 0, 1),
    ("B23", "B23"): (5, 2, -2, 0),
    ("B32", "B32"): (5, 2, -2, 0),
    ("B23", "B32"): (0, 7, 0, -2),
}


def _printed_patterns() -> np.ndarray:
    patterns = np.zeros((4, 9, 9))
    for (row, column), factors in _PRINTED_RELATIVE.items():
        i, j = CURVATURES.index(row), CURVATURES.index(column)
        patterns[:, i, j] = patterns[:, j, i] = factors
    return patterns


_PATTERNS = _printed_patterns()


def _printed_relative_stiffness(medium: Medium) -> Any:
    """The 9 × 9 relative stiffness of Eqs. (29)–(37) as printed, over l²N_p, N·m."""
    normal, tangential = medium.G_n_r, medium.stiffness_ratio * medium.G_n_r
    p1, p2 = (normal + 6 * tangential) / 105, (normal - tangential) / 105
    a = medium.anisotropy
    return sum(
        factor * pattern
        for factor, pattern in zip((p1, p2, a * p1, a * p2), _PATTERNS, strict=True)
    )


@dataclass(frozen=True)
class FluxForm:
    """Coefficients of the flux form above, over l²N_p; any 1D linear micromorphic medium fits.

    Attributes:
        m_phi: ρβ/(l²N_p), kg.
        m_B: ργ/(l²N_p), kg·m².
        C_phi_phi: C_φφ, shape (3, 3), N·m.
        C_phi_B: C_φB, shape (3, 9), N·m; columns in the order of CURVATURES.
        C_B_phi: C_Bφ, shape (9, 3), N·m; equals C_φBᵀ for closure "consistent".
        C_B_B: C_BB, shape (9, 9), N·m.
        Gamma: Γ, shape (9, 9), N·m³.
    """

    m_phi: Any
    m_B: Any
    C_phi_phi: Any
    C_phi_B: Any
    C_B_phi: Any
    C_B_B: Any
    Gamma: Any


def flux_form(medium: Medium) -> FluxForm:
    """The wave equations (26)–(37) of a medium, for its closure.

    Args:
        medium: its parameters.

    Returns:
        The coefficient matrices, for waves along x₁.

    Raises:
        ValueError: the closure has no wave equations.
    """
    if medium.closure not in CLOSURES:
        raise ValueError(
            f"closure = {medium.closure!r} has no wave equations, only dispersion coefficients: "
            f"for a time-domain run take one of {', '.join(CLOSURES)}"
        )
    scale = medium.branch_length**2 * medium.contact_density
    J = average_stiffness(medium) / scale
    M = relative_stiffness(medium) / scale
    N = gradient_stiffness(medium) / scale
    in_curvature_equations = (
        M.reshape(9, 9) if medium.closure == "consistent" else _printed_relative_stiffness(medium)
    )
    return FluxForm(
        m_phi=medium.density * medium.beta / scale,
        m_B=medium.density * medium.gamma / scale,
        C_phi_phi=(J + M)[:, 0, :, 0],
        C_phi_B=M[:, 0].reshape(3, 9),
        C_B_phi=in_curvature_equations.reshape(9, 3, 3)[:, :, 0],
        C_B_B=in_curvature_equations,
        Gamma=N[:, :, 0, :, :, 0].reshape(9, 9),
    )


def fastest_speed(medium: Medium) -> float:
    """Speed of the fastest wave at short wavelengths, c_∞ = √(m_U max C_φφ/m_φ), m/s."""
    flux = flux_form(medium)
    unrelaxed = medium.damping.unrelaxed
    return float(np.sqrt(unrelaxed * np.linalg.eigvalsh(flux.C_phi_phi).max() / flux.m_phi))
