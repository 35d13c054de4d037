"""The four sectors of the twelve equations, their blocks, and the scaled form both routes solve.

About the axis of symmetry x₁ the twelve fields fall apart into blocks that never exchange
energy. Three hold one rotation and two micro-curvatures and have three branches each; three hold
one micro-curvature alone and have one branch each: twelve waves.

Scaled unknowns: x in l, t in √(4πρR⁵/3G_n^a), φ as it is, and B as r l B with r² = γ/(β l²), so
that every unknown has the same inertia:

    φ̈ = ∂ₓ(c_pp φ′ − c_pb B) + f,    B̈ = c_bp φ′ − c_bb B + γ ∂ₓ²B + g

and c_bp = c_pbᵀ exactly where the closure is symmetric.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.material.medium import Medium
from wavesim.material.wave_equations import CURVATURES, FIELDS, ROTATIONS, flux_form

_HALF = math.sqrt(0.5)


@dataclass(frozen=True)
class Block:
    """Fields that are coupled with each other and with no others.

    Attributes:
        name: unique among BLOCKS.
        sector: longitudinal, transverse2, transverse3 or inplane.
        rotations: components, each {field: weight}, an orthonormal combination of rotations.
        curvatures: likewise of micro-curvatures.
        branches: names of its branches, ascending in frequency.
    """

    name: str
    sector: str
    rotations: tuple[dict[str, float], ...]
    curvatures: tuple[dict[str, float], ...]
    branches: tuple[str, ...]

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields that this block's components combine."""
        used = {name for component in self.rotations + self.curvatures for name in component}
        return tuple(name for name in FIELDS if name in used)

    def weights(self, names: tuple[str, ...]) -> np.ndarray:
        """Matrix from the named fields to this block's components, shape (components, names)."""
        components = self.rotations if names == ROTATIONS else self.curvatures
        rows = [[component.get(name, 0.0) for name in names] for component in components]
        return np.array(rows).reshape(len(components), len(names))


BLOCKS: tuple[Block, ...] = (
    Block(
        "longitudinal",
        "longitudinal",
        ({"phi1": 1.0},),
        ({"B11": 1.0}, {"B22": _HALF, "B33": _HALF}),
        ("LA", "LO1", "LO2"),
    ),
    Block(
        "transverse2",
        "transverse2",
        ({"phi2": 1.0},),
        ({"B21": 1.0}, {"B12": 1.0}),
        ("TA", "TO1", "TO2"),
    ),
    Block(
        "transverse3",
        "transverse3",
        ({"phi3": 1.0},),
        ({"B31": 1.0}, {"B13": 1.0}),
        ("TA", "TO1", "TO2"),
    ),
    Block("inplane[23]", "inplane", (), ({"B23": _HALF, "B32": -_HALF},), ("TSO[23]",)),
    Block("inplane(23)", "inplane", (), ({"B23": _HALF, "B32": _HALF},), ("TSO(23)",)),
    Block("inplane(22-33)", "inplane", (), ({"B22": _HALF, "B33": -_HALF},), ("TSO(22-33)",)),
)
SECTORS: tuple[str, ...] = ("longitudinal", "transverse2", "transverse3", "inplane")


def blocks_of(sector: str) -> tuple[Block, ...]:
    """Blocks of a sector.

    Raises:
        ValueError: no sector has that name.
    """
    found = tuple(block for block in BLOCKS if block.sector == sector)
    if not found:
        raise ValueError(f"sector {sector!r}: must be one of {', '.join(SECTORS)}")
    return found


def excited_blocks(fields: Sequence[str]) -> tuple[Block, ...]:
    """Blocks that sources on these fields set in motion."""
    return tuple(block for block in BLOCKS if set(block.fields) & set(fields))


def grouped(blocks: Sequence[Block]) -> list[tuple[Block, ...]]:
    """Blocks that lie side by side and have as many rotations, together."""
    groups = itertools.groupby(blocks, key=lambda block: len(block.rotations))
    return [tuple(members) for _, members in groups]


@dataclass(frozen=True)
class BlockForm:
    """Scaled coefficients of one block in one medium; see the head of this file.

    Attributes:
        c_pp, c_pb, c_bp, c_bb, gamma: shapes (p, p), (p, b), (b, p), (b, b), (b, b) for p
            rotations and b micro-curvatures, dimensionless.
    """

    c_pp: Any
    c_pb: Any
    c_bp: Any
    c_bb: Any
    gamma: Any


@dataclass(frozen=True)
class Scales:
    """What one unit of each scaled quantity is in SI.

    Attributes:
        length: l, m.
        time: √(4πρR⁵/3G_n^a), s.
        rotation: 1 rad.
        curvature: 1/(r l), 1/m, r² = γ/(β l²).
        moment: body moment k that makes φ̈ = 1, ρβ/time², N·m/m³.
        double_moment: body double moment Π that makes B̈ = 1, ργ/(r l time²), N·m²/m³.
        energy: energy per area of the bar's section, ρβ l/time², J/m².
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
    """Units of the scaled form in a medium."""
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


def block_form(medium: Medium, block: Block, reference: Medium | None = None) -> BlockForm:
    """Scaled coefficients of a block in a medium.

    Args:
        medium: the medium.
        block: one of BLOCKS.
        reference: the medium whose units to scale by; the medium itself by default.

    Returns:
        The coefficients; jax arrays where the medium's parameters are.
    """
    flux = flux_form(medium)
    units = scales(reference or medium)
    rotation, curvature = block.weights(ROTATIONS), block.weights(CURVATURES)
    per_phi = units.time**2 / flux.m_phi / units.length
    per_B = units.time**2 / flux.m_B
    return BlockForm(
        c_pp=per_phi / units.length * (rotation @ flux.C_phi_phi @ rotation.T),
        c_pb=per_phi * units.curvature * (rotation @ flux.C_phi_B @ curvature.T),
        c_bp=per_B / (units.curvature * units.length) * (curvature @ flux.C_B_phi @ rotation.T),
        c_bb=per_B * (curvature @ flux.C_B_B @ curvature.T),
        gamma=per_B / units.length**2 * (curvature @ flux.Gamma @ curvature.T),
    )


@dataclass(frozen=True)
class BlockCoefficients:
    """Stiffness and inertia of one block apart, in the units of a reference medium.

        i_phi φ̈ = ∂ₓ(c_pp φ′ − c_pb B) + f,    i_B B̈ = c_bp φ′ − c_bb B + γ ∂ₓ²B + g

    Media of one bar so share their units, and c_bp = c_pbᵀ wherever the closure is symmetric.

    Attributes:
        c_pp, c_pb, c_bp, c_bb, gamma: shapes as of :class:`BlockForm`.
        i_phi, i_B: inertias, scalars.
    """

    c_pp: Any
    c_pb: Any
    c_bp: Any
    c_bb: Any
    gamma: Any
    i_phi: Any
    i_B: Any


def block_coefficients(medium: Medium, block: Block, units: Scales) -> BlockCoefficients:
    """Coefficients of a block in a medium, in given units.

    Args:
        medium: the medium.
        block: one of BLOCKS.
        units: of the reference medium, from :func:`scales`.
    """
    flux = flux_form(medium)
    stiffness = medium.branch_length**2 * medium.contact_density  # flux is divided by it
    rotation, curvature = block.weights(ROTATIONS), block.weights(CURVATURES)
    per_length = stiffness / (units.moment * units.length)
    coupling = per_length * units.curvature
    local = stiffness * units.curvature / units.double_moment
    return BlockCoefficients(
        c_pp=per_length / units.length * (rotation @ flux.C_phi_phi @ rotation.T),
        c_pb=coupling * (rotation @ flux.C_phi_B @ curvature.T),
        c_bp=coupling * (curvature @ flux.C_B_phi @ rotation.T),
        c_bb=local * (curvature @ flux.C_B_B @ curvature.T),
        gamma=local / units.length**2 * (curvature @ flux.Gamma @ curvature.T),
        i_phi=medium.density * medium.beta / (units.moment * units.time**2),
        i_B=medium.density * medium.gamma * units.curvature / (units.double_moment * units.time**2),
    )
