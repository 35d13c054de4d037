"""The granular medium: the parameters of Table 1 and the units that the program scales by.

Source of every equation number: Yu, Liu, Shi, Chen, Appl. Sci. 2022, 12, 6129,
doi 10.3390/app12126129.
"""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal, get_origin, get_type_hints

from wavesim.material.damping import UNDAMPED, Damping
from wavesim.material.shown import Shown

Closure = Literal["printed", "consistent"]
SpectralClosure = Literal["printed", "consistent", "appendix_c"]

CLOSURES: tuple[str, ...] = ("printed", "consistent")  # those with wave equations
SPECTRAL_CLOSURES: tuple[str, ...] = (*CLOSURES, "appendix_c")
_NEGATIVE_CONTACTS = "the contact density is negative in some direction outside it"
_NEGATIVE_STIFFNESS = "a tangential stiffness can't be negative"


@dataclass(frozen=True)
class Parameter:
    """What is said once of a parameter of a medium.

    Attributes:
        symbol: the paper's, such as "G_n^a".
        unit: SI, "" for none.
        low, high: the admissible range.
        open: whether low itself is outside it.
        why: what is wrong outside it.
    """

    symbol: str
    unit: str
    low: float = 0.0
    high: float = math.inf
    open: bool = True
    why: str = ""

    @property
    def allowed(self) -> str:
        """The range in words."""
        if math.isfinite(self.high):
            text = f"between {self.low:g} and {self.high:g}"
        else:
            text = f"greater than {self.low:g}" if self.open else f"{self.low:g} or greater"
        return f"{text} ({self.why})" if self.why else text

    def admits(self, value: float) -> bool:
        """Whether a value is in the range."""
        return self.low < value <= self.high or (value == self.low and not self.open)


@dataclass(frozen=True, repr=False)
class Medium(Shown):
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

    # Outside −1 ≤ a ≤ 2 ξ(n) of Eq. (18) is negative somewhere; outside the other ranges the energy
    # of deformation, or of motion, is not positive.
    anisotropy: Annotated[Any, Parameter("a", "", -1.0, 2.0, False, _NEGATIVE_CONTACTS)] = 0.0
    stiffness_ratio: Annotated[Any, Parameter("η", "", open=False, why=_NEGATIVE_STIFFNESS)] = 0.5
    branch_length: Annotated[Any, Parameter("l", "m")] = 1e-3
    particle_radius: Annotated[Any, Parameter("R", "m")] = 5e-4
    contact_density: Annotated[Any, Parameter("N_p", "1/m³")] = 1e9
    density: Annotated[Any, Parameter("ρ", "kg/m³")] = 1570.0
    G_n_a: Annotated[Any, Parameter("G_n^a", "N·m")] = 5.0
    G_n_r: Annotated[Any, Parameter("G_n^r", "N·m")] = 5.0
    G_n_g: Annotated[Any, Parameter("G_n^g", "N·m", open=False)] = 1.25e-11
    closure: SpectralClosure = "printed"
    rotation_inertia: Annotated[Any, Parameter("β", "m²")] = None
    curvature_inertia: Annotated[Any, Parameter("γ", "m⁴")] = None
    damping: Damping = UNDAMPED

    def __post_init__(self) -> None:
        if self.closure not in SPECTRAL_CLOSURES:
            allowed = ", ".join(SPECTRAL_CLOSURES)
            raise ValueError(f"closure = {self.closure!r}: must be one of {allowed}")
        for name in PARAMETERS:
            value = getattr(self, name)
            if isinstance(value, numbers.Real):
                check_parameter(name, float(value))

    def __repr__(self) -> str:
        changed = {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if getattr(self, field.name) is not field.default
            and not _same(getattr(self, field.name), field.default)
        }
        return f"Medium({', '.join(f'{name}={value!r}' for name, value in changed.items())})"

    def told(self) -> dict[str, str]:
        """Every parameter with its symbol and unit."""
        told: dict[str, str] = {"closure": self.closure}
        for name, value in self.parameters.items():
            own = PARAMETERS[name]
            shown = f"{float(value):.6g}" if isinstance(value, numbers.Real) else str(value)
            told[f"{own.symbol}, {name}"] = f"{shown} {own.unit}".rstrip()
        return told | {"damping": str(self.damping) if self.damping else "none"}

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
    def parameters(self) -> dict[str, Any]:
        """Every parameter by name, β and γ as they are where they are left to follow from R."""
        given = {name: getattr(self, name) for name in PARAMETERS}
        return given | {"rotation_inertia": self.beta, "curvature_inertia": self.gamma}

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


PARAMETERS: dict[str, Parameter] = {
    name: hint.__metadata__[0]
    for name, hint in get_type_hints(Medium, include_extras=True).items()
    if get_origin(hint) is Annotated
}
"""What the case file, gap maps and fits know of the parameters of a medium, by name."""


def _same(value: Any, default: Any) -> bool:
    """Whether a parameter is a plain number or word that equals its default."""
    return isinstance(value, str | numbers.Real) and value == default


def check_parameter(name: str, value: float) -> None:
    """Hold one parameter of the medium to its admissible range.

    Args:
        name: one of PARAMETERS.
        value: its value, in that parameter's unit.

    Raises:
        ValueError: the value is not finite or not admissible.
    """
    if not math.isfinite(value):
        raise ValueError(f"{name} = {value}: must be finite")
    if not PARAMETERS[name].admits(value):
        raise ValueError(f"{name} = {value:g}: must be {PARAMETERS[name].allowed}")
