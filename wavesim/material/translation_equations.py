"""The translation family: particle displacement u and micro-strain A, Eqs. (10a–b), (20)–(22).

The structure of the rotation family with displacement for rotation, contact stiffnesses K (N/m) for
G, and other inertias; C, E, H are J, M, N with K:

    ∇·(σ + τ) + f = ρ ü,    σ = C : ε,  τ = E : (ε − A),  ε_ij = u_i,j,
    τ + ∇·𝕋 + Φ = ρα Ä,     𝕋 = H ⋮ ∇A;    (σ + τ)·n = t and 𝕋·n = Ψ at ends.

The paper prints no wave equations for it, so its closure is "consistent".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

from wavesim.material.family import Family, granular_blocks
from wavesim.material.granular_equations import GranularMedium
from wavesim.material.parameter import Parameter

TRANSLATION = Family(
    name="translation",
    macro=("u1", "u2", "u3"),
    micro=tuple(f"A{i}{j}" for i in "123" for j in "123"),
    blocks=granular_blocks("u", "A"),
    gaps={
        "longitudinal": ("DLB1", "DLB2"),
        "transverse2": ("DTB1", "DTB2"),
        "transverse3": ("DTB1", "DTB2"),
        "inplane": ("DSB",),
    },
    units=("m", "–"),
    symbols=("u", "A"),
    words=("displacement", "micro-strain"),
    force_units=("N/m²", "N/m"),
    drives={"traction": "surface", "displacement": "prescribed"},
    waves={"longitudinal": "P", "transverse2": "S", "transverse3": "S"},
    time="√(4πρR³/3Kₙᵃ)",
)


@dataclass(frozen=True, repr=False)
class TranslationMedium(GranularMedium):
    """The medium of translation waves; defaults are a granular soil, P 412 m/s and S 357 m/s.

    Args:
        K_n_a: K_n^a, normal contact stiffness for the average strain, N/m.
        K_n_r: K_n^r, normal contact stiffness for the relative strain, N/m.
        K_n_g: K_n^g, normal contact stiffness for the gradient of micro-strain, N/m.
        strain_inertia: α, m²; None stands for R²/5, ⟨y_i y_j⟩ = (R²/5) δ_ij of a sphere.

    Other parameters as of :class:`GranularMedium`, and errors; stiffness_ratio is K_s/K_n.
    """

    K_n_a: Annotated[Any, Parameter("K_n^a", "N/m")] = 1e6
    K_n_r: Annotated[Any, Parameter("K_n^r", "N/m")] = 1e6
    K_n_g: Annotated[Any, Parameter("K_n^g", "N/m", open=False)] = 2.5e-6
    strain_inertia: Annotated[Any, Parameter("α", "m²")] = None

    family = TRANSLATION

    @classmethod
    def closure_missing(cls, closure: str) -> str:
        """Why there is no other closure."""
        return (
            f"closure = {closure!r}: must be consistent; the paper prints wave equations of the "
            "rotation family alone"
        )

    @property
    def stiffnesses(self) -> tuple[Any, Any, Any]:
        """K_n^a, K_n^r, K_n^g, N/m."""
        return self.K_n_a, self.K_n_r, self.K_n_g

    @property
    def alpha(self) -> Any:
        """Micro-inertia of micro-strain α = R²/5 (m²) unless given."""
        return self.particle_radius**2 / 5 if self.strain_inertia is None else self.strain_inertia

    @property
    def inertias(self) -> tuple[Any, Any]:
        """ρ (kg/m³) and ρα (kg/m)."""
        return self.density, self.density * self.alpha

    @property
    def parameters(self) -> dict[str, Any]:
        """Every parameter by name, α as it is where it is left to follow from R."""
        return super().parameters | {"strain_inertia": self.alpha}

    @property
    def macro_scale(self) -> Any:
        """Unit of displacement l, m."""
        return self.branch_length

    @property
    def time_scale(self) -> Any:
        """Unit of time √(4πρR³/3K_n^a) (s): ω̄ = ω times this."""
        return (4 * math.pi * self.density * self.particle_radius**3 / (3 * self.K_n_a)) ** 0.5
