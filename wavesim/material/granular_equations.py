"""A transversely isotropic granular medium: its rotation family, and its translation family.

Rotation, φ and micro-curvature B, has Eqs. (23)–(37): the φ equations (26)–(28) and the gradient
terms agree with the tensors of Appendix B; in the B equations (29)–(37) the relative stiffness is
another matrix, `_PRINTED_RELATIVE`. Translation, displacement u and micro-strain A, has the same
structure with contact stiffnesses K (N/m) for G, C, E, H for J, M, N, and other inertias, Eqs.
(10a–b), (20)–(22):

    ∇·(σ + τ) + f = ρ ü,    σ = C : ε,  τ = E : (ε − A),  ε_ij = u_i,j,
    τ + ∇·𝕋 + Φ = ρα Ä,     𝕋 = H ⋮ ∇A;    (σ + τ)·n = t and 𝕋·n = Ψ at ends.

The paper prints no wave equations for it, so its closure is "consistent".

Source of every equation number: Yu, Liu, Shi, Chen, Appl. Sci. 2022, 12, 6129,
doi 10.3390/app12126129.
"""

from __future__ import annotations

import abc
import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from wavesim.material.contact_tensors import (
    average_stiffness,
    gradient_stiffness,
    relative_stiffness,
)
from wavesim.material.family import Family, granular_blocks
from wavesim.material.medium import FluxForm, Medium
from wavesim.material.parameter import Parameter

_NEGATIVE_CONTACTS = "the contact density is negative in some direction outside it"
# Gradient stiffness over the relative one, below which nothing grows for it.
_FELT = 1e-6
_NEGATIVE_STIFFNESS = "a tangential stiffness can't be negative"


@dataclass(frozen=True, repr=False)
class GranularMedium(Medium):
    """Grains in contact; the axis of symmetry is x₁, the bar's axis.

    Args:
        anisotropy: fabric anisotropy a of Eq. (19), –, in [−1, 2]; 0 is isotropic.
        stiffness_ratio: η, tangential to normal contact stiffness, –, ≥ 0.
        branch_length: l, distance between the centres of two particles in contact, m.
        particle_radius: R, m.
        contact_density: N_p, contacts per volume, 1/m³.
        density: ρ, of the medium, kg/m³.

    Raises:
        ValueError: a parameter is outside its admissible range; the message names it.
    """

    # Outside −1 ≤ a ≤ 2 ξ(n) of Eq. (18) is negative somewhere; outside the other ranges the energy
    # of deformation, or of motion, is not positive.
    anisotropy: Annotated[Any, Parameter("a", "", -1.0, 2.0, False, _NEGATIVE_CONTACTS)] = 0.0
    stiffness_ratio: Annotated[Any, Parameter("η", "", open=False, why=_NEGATIVE_STIFFNESS)] = 0.5
    branch_length: Annotated[Any, Parameter("l", "m")] = 1e-3
    particle_radius: Annotated[Any, Parameter("R", "m")] = 5e-4
    contact_density: Annotated[Any, Parameter("N_p", "1/m³")] = 1e9
    density: Annotated[Any, Parameter("ρ", "kg/m³")] = 1570.0

    @property
    @abc.abstractmethod
    def stiffnesses(self) -> tuple[Any, Any, Any]:
        """Normal contact stiffness of the average, the relative and the gradient deformation."""

    @property
    def length_scale(self) -> Any:
        """Unit of length l (m): k̄ = k l/2π."""
        return self.branch_length

    @property
    def of_gradient(self) -> tuple[Any, ...]:
        """The contact stiffness of the gradient."""
        return self.stiffnesses[2:]

    @property
    def stable(self) -> bool:
        """Of closure "consistent": each strain costs energy, as every contact's does; of "printed"
        where it is :attr:`settled`."""
        if self.closure == "consistent":
            return True
        return self.closure == "printed" and bool(np.all(self.settled))

    @property
    def settled(self) -> Any:
        """Whether a and η are within 0 to 1 and no gradient is felt, where the equations as printed
        have real ω at every k, as scans have found; of each where parameters are arrays."""
        a, eta = self.anisotropy, self.stiffness_ratio
        _, normal, gradient = self.stiffnesses
        return (a >= 0) & (a <= 1) & (eta >= 0) & (eta <= 1) & (gradient <= _FELT * normal)

    @property
    def in_words(self) -> str:
        """Family, closure, a and η."""
        a, eta = float(self.anisotropy), float(self.stiffness_ratio)
        return f"{super().in_words}, a = {a:g}, η = {eta:g}"

    @property
    def settings(self) -> str:
        """anisotropy and stiffness_ratio."""
        a, eta = float(self.anisotropy), float(self.stiffness_ratio)
        return f"anisotropy = {a:g} with stiffness_ratio = {eta:g}"

    @property
    def per_contacts(self) -> Any:
        """l²N_p (1/m), by which the paper's equations are divided."""
        return self.branch_length**2 * self.contact_density

    def flux_form(self) -> FluxForm:
        """The twelve wave equations by the tensors of Appendix B, over l²N_p."""
        scale, (macro, micro) = self.per_contacts, self.inertias
        first, relative, gradient = (
            made(self) / scale
            for made in (average_stiffness, relative_stiffness, gradient_stiffness)
        )
        return FluxForm(
            m_phi=macro / scale,
            m_B=micro / scale,
            C_phi_phi=(first + relative)[:, 0, :, 0],
            C_phi_B=relative[:, 0].reshape(3, 9),
            C_B_phi=relative.reshape(9, 3, 3)[:, :, 0],
            C_B_B=relative.reshape(9, 9),
            Gamma=gradient[:, :, 0, :, :, 0].reshape(9, 9),
            per=scale,
        )


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

# Relative stiffness in Eqs. (29)–(37) as printed: by the factors of p₁, p₂, a·p₁, a·p₂, in the row
# of which field, and of which field's D = κ − B, they stand; and the other way round.
_PRINTED_RELATIVE: dict[tuple[int, int, int, int], str] = {
    (5, 16, 4, 8): "B11 B11",
    (5, 16, -2, -4): "B22 B22, B33 B33",
    (5, 2, 1, 0): "B12 B12, B21 B21, B13 B13, B31 B31",
    (5, 2, -2, 0): "B23 B23, B32 B32",
    (0, 7, 0, 1): "B11 B22, B11 B33, B12 B21, B13 B31",
    (0, 7, 0, -2): "B22 B33, B23 B32",
}
_PATTERNS = np.zeros((4, 9, 9))
for _factors, _entries in _PRINTED_RELATIVE.items():
    for _entry in _entries.split(", "):
        _i, _j = map(ROTATION.micro.index, _entry.split())
        _PATTERNS[:, _i, _j] = _PATTERNS[:, _j, _i] = _factors


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
