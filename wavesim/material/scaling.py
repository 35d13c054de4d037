"""The scaled form of the wave equations: its units, and a block's coefficients in them.

x is in l, t in τ, φ in φ₀ and B in φ₀/r, with r² = m_B/m_φ (γ/β for rotation, α for translation),
of one reference medium for the whole bar. A block of the equations (``family``) then is

    i_φ φ̈ = ∂ₓ(c_φφ φ′ − c_φB B) + f,    i_B B̈ = c_Bφ φ′ − c_BB B + Γ ∂ₓ²B + g,

with c_Bφ = c_φBᵀ exactly where the closure is symmetric, and i_φ = i_B = 1 in a medium's own units.
Both routes, in time and in frequency, take their coefficients from here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.material.family import Block, Family, grouped, known_field
from wavesim.material.medium import Medium

# Branches are judged between these k̄ where nobody says otherwise.
JUDGED = (0.02, 0.5)


def judged_range(medium: Medium) -> tuple[float, float]:
    """The same in a medium, rad/m."""
    low, high = (2 * math.pi * k / float(medium.length_scale) for k in JUDGED)
    return low, high


@dataclass(frozen=True)
class Scales:
    """What one unit of each scaled quantity is in SI.

    Attributes:
        length: l, m.
        time: τ, s.
        macro: φ₀, unit of a macro-field.
        micro: φ₀/r, unit of a micro-field.
        energy: energy per area of the bar's section, m_φ φ₀² l/τ², J/m².
        others: families besides the first, with the units of their macro- and micro-fields, in
            which an energy is as many units.
    """

    length: Any
    time: Any
    macro: Any
    micro: Any
    energy: Any
    others: tuple[tuple[Family, Any, Any], ...] = ()

    def of(self, family: Family) -> Scales:
        """Those of one family where several share a bar."""
        for one, macro, micro in self.others:
            if one is family:
                return Scales(self.length, self.time, macro, micro, self.energy)
        return self

    def unit(self, field: str) -> Any:
        """SI value of one scaled unit of a field."""
        known = known_field(field)
        own = self.of(known.family)
        return own.macro if known.macro else own.micro

    def force(self, field: str) -> Any:
        """SI value of what acts per volume on a field and makes its scaled acceleration 1."""
        return self.energy / (self.length * self.unit(field))


def scales(medium: Medium) -> Scales:
    """Units of the scaled form, those of a medium; its parameters may be traced by jax."""
    length, time, unit = medium.length_scale, medium.time_scale, medium.macro_scale
    macro, micro = medium.inertias
    others = []
    for part in medium.parts[1:]:
        its_macro, its_micro = part.inertias
        as_much = [unit * (macro / its) ** 0.5 for its in (its_macro, its_micro)]
        others.append((part.family, *as_much))
    return Scales(
        length=length,
        time=time,
        macro=unit,
        micro=unit * (macro / micro) ** 0.5,
        energy=macro * (unit / time) ** 2 * length,
        others=tuple(others),
    )


@dataclass(frozen=True)
class BlockCoefficients:
    """Coefficients of one block for p macro- and b micro-fields; see the head of this file.

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
        """These, given in SI, in units of the scaled form."""
        coupling = units.energy / (units.macro * units.micro)
        along = units.energy * units.length / units.macro**2
        local = units.energy / (units.length * units.micro**2)
        return BlockCoefficients(
            c_pp=self.c_pp / along,
            c_pb=self.c_pb / coupling,
            c_bp=self.c_bp / coupling,
            c_bb=self.c_bb / local,
            gamma=self.gamma / (local * units.length**2),
            i_phi=self.i_phi / (along * (units.time / units.length) ** 2),
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
        block: one of its family's.
        units: of the reference medium, from :func:`scales`.

    Raises:
        ValueError: the closure has no wave equations.
    """
    medium = medium.part(block)
    form, family = medium.form, medium.family
    macro, micro = block.projections(family)
    inertias = medium.inertias
    return BlockCoefficients(
        c_pp=form.per * (macro @ form.C_phi_phi @ macro.T),
        c_pb=form.per * (macro @ form.C_phi_B @ micro.T),
        c_bp=form.per * (micro @ form.C_B_phi @ macro.T),
        c_bb=form.per * (micro @ form.C_B_B @ micro.T),
        gamma=form.per * (micro @ form.Gamma @ micro.T),
        i_phi=inertias[0],
        i_B=inertias[1],
    ).scaled(units.of(family))


def to_scaled(fields: Mapping[str, Any], blocks: Sequence[Block], medium: Medium) -> list[Any]:
    """Fields in SI as components (φ, B) of each group; fields not named are 0.

    Args:
        fields: {field: shape (…, points)}.
        blocks: those of the operator.
        medium: whose units it is scaled by.

    Returns:
        (φ, B) of each group, shapes (components, blocks, …, points).
    """
    units = scales(medium)
    shape = np.shape(next(iter(fields.values())))
    found: list[Any] = []
    for stacked in grouped(blocks):
        pair = []
        for kinds in zip(*((block.macro, block.micro) for block in stacked), strict=True):
            values = np.zeros((len(kinds[0]), len(stacked), *shape))
            for s, parts in enumerate(kinds):
                for i, part in enumerate(parts):
                    for name in set(part) & set(fields):
                        values[i, s] += part[name] / units.unit(name) * fields[name]
            pair.append(values)
        found.append(tuple(pair))
    return found


def to_fields(pairs: Sequence[Any], blocks: Sequence[Block], medium: Medium) -> dict[str, Any]:
    """The fields in SI of (φ, B) of each group; inverse of :func:`to_scaled`.

    Args:
        pairs: shapes (…, components, blocks, points) each, numpy or jax.
        blocks: those of the operator.
        medium: whose units it is scaled by.

    Returns:
        {field: shape (…, points)}, of every field that the blocks combine.
    """
    units = scales(medium)
    fields: dict[str, Any] = {}
    for (phi, B), stacked in zip(pairs, grouped(blocks), strict=True):
        for s, block in enumerate(stacked):
            for values, parts in ((phi, block.macro), (B, block.micro)):
                for i, part in enumerate(parts):
                    for name, weight in part.items():
                        term = weight * units.unit(name) * values[..., i, s, :]
                        fields[name] = fields[name] + term if name in fields else term
    ordered = [name for block in blocks for name in block.fields]
    return {name: fields[name] for name in dict.fromkeys(ordered)}
