"""The rotation family: particle rotation φ and micro-curvature B, Eqs. (23)–(37).

The paper's φ equations (26)–(28) and its gradient terms agree with the tensors of Appendix B; in
its B equations (29)–(37) the relative stiffness is another matrix, `_PRINTED_RELATIVE`.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from wavesim.material.family import Family, granular_blocks
from wavesim.material.granular_equations import GranularMedium
from wavesim.material.medium import FluxForm, Medium
from wavesim.material.parameter import Parameter

Closure = Literal["printed", "consistent"]
CLOSURES: tuple[str, ...] = ("printed", "consistent")  # those with wave equations
SPECTRAL_CLOSURES: tuple[str, ...] = (*CLOSURES, "appendix_c")

ROTATION = Family(
    name="rotation",
    macro=("phi1", "phi2", "phi3"),
    micro=tuple(f"B{i}{j}" for i in "123" for j in "123"),
    blocks=granular_blocks("phi", "B"),
    gaps={
        "longitudinal": ("RLB1", "RLB2"),
        "transverse2": ("RTB1", "RTB2"),
        "transverse3": ("RTB1", "RTB2"),
        "inplane": ("RSB",),
    },
    units=("rad", "1/m"),
    symbols=("φ", "B"),
    words=("rotation", "micro-curvature"),
    force_units=("N·m/m²", "N"),
    drives={"moment": "surface", "rotation": "prescribed"},
    time="√(4πρR⁵/3Gₙᵃ)",
)

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
        i, j = ROTATION.micro.index(row), ROTATION.micro.index(column)
        patterns[:, i, j] = patterns[:, j, i] = factors
    return patterns


_PATTERNS = _printed_patterns()


@dataclass(frozen=True, repr=False)
class RotationMedium(GranularMedium):
    """The medium of rotation waves; defaults are those of Table 1.

    Args:
        G_n_a: G_n^a, normal rotation stiffness for the average rotation, N·m.
        G_n_r: G_n^r, normal rotation stiffness for the relative rotation, N·m.
        G_n_g: G_n^g, normal rotation stiffness for the gradient of micro-curvature, N·m.
        closure: "printed", Eqs. (26)–(37) as the paper prints them, or "consistent", the paper's
            Appendix-B tensors in every equation. They differ where a ≠ 0 (docs/physics.md). A
            third, "appendix_c", the dispersion coefficients of Appendix C, is for the spectral
            solver alone: it has no wave equations.
        rotation_inertia: β, m²; None stands for the paper's 2R²/5.
        curvature_inertia: γ, m⁴; None stands for the paper's 12R⁴/35.

    Other parameters as of :class:`GranularMedium`, and errors.
    """

    G_n_a: Annotated[Any, Parameter("G_n^a", "N·m")] = 5.0
    G_n_r: Annotated[Any, Parameter("G_n^r", "N·m")] = 5.0
    G_n_g: Annotated[Any, Parameter("G_n^g", "N·m", open=False)] = 1.25e-11
    closure: str = dataclasses.field(default="printed", kw_only=True)
    rotation_inertia: Annotated[Any, Parameter("β", "m²")] = None
    curvature_inertia: Annotated[Any, Parameter("γ", "m⁴")] = None

    family = ROTATION
    closures = SPECTRAL_CLOSURES

    @property
    def stiffnesses(self) -> tuple[Any, Any, Any]:
        """G_n^a, G_n^r, G_n^g, N·m."""
        return self.G_n_a, self.G_n_r, self.G_n_g

    @property
    def beta(self) -> Any:
        """Micro-inertia of rotation β = 2R²/5 (m²) unless given."""
        if self.rotation_inertia is None:
            return 2 * self.particle_radius**2 / 5
        return self.rotation_inertia

    @property
    def gamma(self) -> Any:
        """Micro-inertia of micro-curvature γ = 12R⁴/35 (m⁴) unless given."""
        if self.curvature_inertia is None:
            return 12 * self.particle_radius**4 / 35
        return self.curvature_inertia

    @property
    def inertias(self) -> tuple[Any, Any]:
        """ρβ (kg/m) and ργ (kg·m)."""
        return self.density * self.beta, self.density * self.gamma

    @property
    def parameters(self) -> dict[str, Any]:
        """Every parameter by name, β and γ as they are where they are left to follow from R."""
        found = super().parameters
        return found | {"rotation_inertia": self.beta, "curvature_inertia": self.gamma}

    @property
    def conserves_energy(self) -> bool:
        """Whether its equations conserve energy, losses apart: all closures do where a = 0."""
        return self.closure == "consistent" or bool(self.anisotropy == 0)

    @property
    def time_scale(self) -> Any:
        """Unit of time √(4πρR⁵/3G_n^a) (s): ω̄ = ω times this; 1/785 kHz/2π with Table 1."""
        return (4 * math.pi * self.density * self.particle_radius**5 / (3 * self.G_n_a)) ** 0.5

    def flux_form(self) -> FluxForm:
        """The wave equations (26)–(37), for the closure, over l²N_p."""
        if self.closure not in CLOSURES:
            raise ValueError(
                f"closure = {self.closure!r} has no wave equations, only dispersion coefficients: "
                f"for a time-domain run take one of {', '.join(CLOSURES)}"
            )
        form = super().flux_form()
        if self.closure == "consistent":
            return form
        printed = printed_relative_stiffness(self)
        there = printed.reshape(9, 3, 3)[:, :, 0]
        return dataclasses.replace(form, C_B_phi=there, C_B_B=printed)


def printed_relative_stiffness(medium: Medium) -> Any:
    """The 9 × 9 relative stiffness of Eqs. (29)–(37) as printed, over l²N_p, N·m."""
    assert isinstance(medium, RotationMedium)
    normal, tangential = medium.G_n_r, medium.stiffness_ratio * medium.G_n_r
    p1, p2 = (normal + 6 * tangential) / 105, (normal - tangential) / 105
    a = medium.anisotropy
    return sum(
        factor * pattern
        for factor, pattern in zip((p1, p2, a * p1, a * p2), _PATTERNS, strict=True)
    )
