"""A transversely isotropic granular medium: what both of its families share.

Source of every equation number: Yu, Liu, Shi, Chen, Appl. Sci. 2022, 12, 6129,
doi 10.3390/app12126129.
"""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from wavesim.material.contact_tensors import (
    average_stiffness,
    gradient_stiffness,
    relative_stiffness,
)
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
        scale = self.per_contacts
        first = average_stiffness(self) / scale
        relative = relative_stiffness(self) / scale
        gradient = gradient_stiffness(self) / scale
        macro, micro = self.inertias
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
