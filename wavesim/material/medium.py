"""The granular medium: the parameters of Table 1 and the units that the program scales by.

Source of every equation number: Yu, Liu, Shi, Chen, Appl. Sci. 2022, 12, 6129,
doi 10.3390/app12126129.
"""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass, fields
from typing import Any, Literal

from wavesim.material.damping import UNDAMPED, Damping

Closure = Literal["printed", "consistent"]
SpectralClosure = Literal["printed", "consistent", "appendix_c"]

CLOSURES: tuple[str, ...] = ("printed", "consistent")  # those with wave equations
SPECTRAL_CLOSURES: tuple[str, ...] = (*CLOSURES, "appendix_c")

# Admissible ranges. Outside −1 ≤ a ≤ 2 the contact density ξ(n) is negative in some direction
# (Eq. 18); outside η ≥ 0, or with a stiffness, length or inertia that is not positive, the
# deformation energy or the kinetic energy is not positive.
_BOUNDS: dict[str, tuple[float, float, str]] = {
    "anisotropy": (-1.0, 2.0, "the contact density is negative in some direction outside it"),
    "stiffness_ratio": (0.0, math.inf, "a tangential stiffness can't be negative"),
}
_POSITIVE = (
    "branch_length",
    "particle_radius",
    "contact_density",
    "density",
    "G_n_a",
    "G_n_r",
    "rotation_inertia",
    "curvature_inertia",
)
_NOT_NEGATIVE = ("G_n_g",)


@dataclass(frozen=True)
class Medium:
    """A transversely isotropic granular medium; its axis of symmetry is x₁, the bar's axis.

    Every parameter may be a float or a scalar ``jax`` array, so that gradients and batches go
    through; the range of a plain number is checked on construction.

    Args:
        anisotropy: fabric anisotropy a of Eq. (19), –, in [−1, 2]; 0 is isotropic.
        stiffness_ratio: η = G_s/G_n, tangential to normal rotation stiffness, –, ≥ 0.
        branch_length: l, distance between the centres of two particles in contact, m.
        particle_radius: R, m.
        contact_density: N_p, contacts per volume, 1/m³.
        density: ρ, of the medium, kg/m³.
        G_n_a: G_n^a, normal rotation stiffness for the average rotation, N·m.
        G_n_r: G_n^r, normal rotation stiffness for the relative rotation, N·m.
        G_n_g: G_n^g, normal rotation stiffness for the gradient of micro-curvature, N·m.
        closure: "printed", Eqs. (26)–(37) as the paper prints them, or "consistent", the paper's
            Appendix-B tensors in every equation. They differ where a ≠ 0 (docs/physics.md). A
            third, "appendix_c", the dispersion coefficients of Appendix C, is for the spectral
            solver alone: it has no wave equations.
        rotation_inertia: β, m²; None stands for the paper's 2R²/5.
        curvature_inertia: γ, m⁴; None stands for the paper's 12R⁴/35.
        damping: its loss law; lossless by default.

    Raises:
        ValueError: a parameter is outside its admissible range; the message names it.
    """

    anisotropy: Any = 0.0
    stiffness_ratio: Any = 0.5
    branch_length: Any = 1e-3
    particle_radius: Any = 5e-4
    contact_density: Any = 1e9
    density: Any = 1570.0
    G_n_a: Any = 5.0
    G_n_r: Any = 5.0
    G_n_g: Any = 1.25e-11
    closure: SpectralClosure = "printed"
    rotation_inertia: Any = None
    curvature_inertia: Any = None
    damping: Damping = UNDAMPED

    def __post_init__(self) -> None:
        if self.closure not in SPECTRAL_CLOSURES:
            allowed = ", ".join(SPECTRAL_CLOSURES)
            raise ValueError(f"closure = {self.closure!r}: must be one of {allowed}")
        for name in PARAMETERS:
            value = getattr(self, name)
            if isinstance(value, numbers.Real):
                check_parameter(name, float(value))

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
    def conserves_energy(self) -> bool:
        """Whether its equations conserve energy, losses apart: all closures do where a = 0."""
        return self.closure == "consistent" or bool(self.anisotropy == 0)

    @property
    def length_scale(self) -> Any:
        """Unit of length l (m): k̄ = k l/2π."""
        return self.branch_length

    @property
    def time_scale(self) -> Any:
        """Unit of time √(4πρR⁵/3G_n^a) (s): ω̄ = ω times this; 1/785 kHz/2π with Table 1."""
        return (4 * math.pi * self.density * self.particle_radius**5 / (3 * self.G_n_a)) ** 0.5


PARAMETERS: tuple[str, ...] = tuple(
    f.name for f in fields(Medium) if f.name not in ("closure", "damping")
)


def check_parameter(name: str, value: float) -> None:
    """Hold one parameter of the medium to its admissible range.

    Args:
        name: a field of :class:`Medium` other than closure.
        value: its value, in that field's unit.

    Raises:
        ValueError: the value is not finite or not admissible.
    """
    if not math.isfinite(value):
        raise ValueError(f"{name} = {value}: must be finite")
    if name in _POSITIVE and value <= 0:
        raise ValueError(f"{name} = {value:g}: must be greater than 0")
    if name in _NOT_NEGATIVE and value < 0:
        raise ValueError(f"{name} = {value:g}: must be 0 or greater")
    if name in _BOUNDS:
        low, high, why = _BOUNDS[name]
        if not low <= value <= high:
            allowed = f"between {low:g} and {high:g}" if math.isfinite(high) else f"≥ {low:g}"
            raise ValueError(f"{name} = {value:g}: must be {allowed} ({why})")
