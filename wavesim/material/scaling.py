"""The scaled form of the wave equations: its units, and a block's coefficients in them.

x is in l, t in τ = √(4πρR⁵/3G_n^a), φ in rad and B in 1/(r l) with r² = γ/(β l²), of one reference
medium for the whole bar. A block of the equations (``sectors``) then is

    i_φ φ̈ = ∂ₓ(c_φφ φ′ − c_φB B) + f,    i_B B̈ = c_Bφ φ′ − c_BB B + Γ ∂ₓ²B + g,

with c_Bφ = c_φBᵀ exactly where the closure is symmetric, and i_φ = i_B = 1 in a medium's own units.
Both routes, in time and in frequency, take their coefficients from here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from wavesim.material.medium import Medium
from wavesim.material.sectors import Block
from wavesim.material.wave_equations import CURVATURES, ROTATIONS, flux_form

# Branches are judged between these k̄ where nobody says otherwise.
JUDGED = (0.02, 0.5)


@dataclass(frozen=True)
class Scales:
    """What one unit of each scaled quantity is in SI.

    Attributes:
        length: l, m.
        time: τ = √(4πρR⁵/3G_n^a), s.
        rotation: 1 rad.
        curvature: 1/(r l), 1/m, r² = γ/(β l²).
        moment: body moment k that makes φ̈ = 1, ρβ/τ², N·m/m³.
        double_moment: body double moment Π that makes B̈ = 1, ργ/(r l τ²), N·m²/m³.
        energy: energy per area of the bar's section, ρβ l/τ², J/m².
    """

    length: Any
    time: Any
    rotation: float
    curvature: Any
    moment: Any
    double_moment: Any
    energy: Any

    def unit(self, field: str) -> Any:
        """SI value of one scaled unit of a field."""
        return self.rotation if field in ROTATIONS else self.curvature

    def force(self, field: str) -> Any:
        """SI value of one scaled unit of body (double) moment on a field."""
        return self.moment if field in ROTATIONS else self.double_moment


def scales(medium: Medium) -> Scales:
    """Units of the scaled form, those of a medium; its parameters may be traced by jax."""
    length, time = medium.length_scale, medium.time_scale
    curvature = (medium.beta / medium.gamma) ** 0.5
    moment = medium.density * medium.beta / time**2
    return Scales(
        length=length,
        time=time,
        rotation=1.0,
        curvature=curvature,
        moment=moment,
        double_moment=medium.density * medium.gamma * curvature / time**2,
        energy=moment * length,
    )


@dataclass(frozen=True)
class BlockCoefficients:
    """Coefficients of one block for p rotations and b micro-curvatures; see the head of this file.

    Attributes:
        c_pp, c_pb, c_bp, c_bb, gamma: c_φφ, c_φB, c_Bφ, c_BB, Γ; shapes (…, p, p), (…, p, b),
            (…, b, p), (…, b, b), (…, b, b).
        i_phi, i_B: inertias, scalars.
    """

    c_pp: Any
    c_pb: Any
    c_bp: Any
    c_bb: Any
    gamma: Any
    i_phi: Any = 1.0
    i_B: Any = 1.0

    def scaled(self, units: Scales) -> BlockCoefficients:
        """These, given in SI (N, N, N, N, N·m², kg/m, kg·m), in units of the scaled form."""
        coupling = units.double_moment * units.length
        local = units.double_moment / units.curvature
        return BlockCoefficients(
            c_pp=self.c_pp / (units.moment * units.length**2),
            c_pb=self.c_pb / coupling,
            c_bp=self.c_bp / coupling,
            c_bb=self.c_bb / local,
            gamma=self.gamma / (local * units.length**2),
            i_phi=self.i_phi / (units.moment * units.time**2),
            i_B=self.i_B / (local * units.time**2),
        )

    def per_inertia(self) -> BlockCoefficients:
        """The same equations with inertias of 1."""
        return BlockCoefficients(
            c_pp=self.c_pp / self.i_phi,
            c_pb=self.c_pb / self.i_phi,
            c_bp=self.c_bp / self.i_B,
            c_bb=self.c_bb / self.i_B,
            gamma=self.gamma / self.i_B,
        )


def block_coefficients(medium: Medium, block: Block, units: Scales) -> BlockCoefficients:
    """Scaled coefficients of a block in a medium.

    Args:
        medium: the medium; its parameters may be traced by jax.
        block: one of ``sectors.BLOCKS``.
        units: of the reference medium, from :func:`scales`.

    Raises:
        ValueError: the closure has no wave equations.
    """
    flux = flux_form(medium)
    per_contacts = medium.branch_length**2 * medium.contact_density  # flux is divided by it
    rotation, curvature = block.weights(ROTATIONS), block.weights(CURVATURES)
    return BlockCoefficients(
        c_pp=per_contacts * (rotation @ flux.C_phi_phi @ rotation.T),
        c_pb=per_contacts * (rotation @ flux.C_phi_B @ curvature.T),
        c_bp=per_contacts * (curvature @ flux.C_B_phi @ rotation.T),
        c_bb=per_contacts * (curvature @ flux.C_B_B @ curvature.T),
        gamma=per_contacts * (curvature @ flux.Gamma @ curvature.T),
        i_phi=medium.density * medium.beta,
        i_B=medium.density * medium.gamma,
    ).scaled(units)
