"""The generator A of a real bar, made from its layers, grid, ends and losses; see ``group.py``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.grid.stencils import difference_weights
from wavesim.material.layers import Layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.material.sectors import Block, grouped
from wavesim.timedomain.banded import banded
from wavesim.timedomain.group import Group, State, Strain
from wavesim.timedomain.material import Losses, Profile, losses, profile


class Generator(eqx.Module):
    """A of all blocks that are integrated."""

    groups: tuple[Group, ...]

    def __call__(self, y: State) -> State:
        """A y."""
        return tuple(group.rate(part) for group, part in zip(self.groups, y, strict=True))

    def zero(self) -> State:
        """The state of rest."""
        return tuple(group.zero() for group in self.groups)

    @property
    def lossy(self) -> bool:
        """Whether a state loses energy by itself."""
        law = self.groups[0].losses
        return law.damped or law.absorbing

    def observe(self, y: State) -> tuple[Strain, ...]:
        """Strains, rates and stresses of a state."""
        return tuple(group.observe(part) for group, part in zip(self.groups, y, strict=True))

    def energy(self, y: State) -> tuple[jax.Array, jax.Array]:
        """Kinetic and stored energy, scaled."""
        parts = [group.energy(part) for group, part in zip(self.groups, y, strict=True)]
        kinetic, stored = zip(*parts, strict=True)
        return jnp.sum(jnp.stack(kinetic)), jnp.sum(jnp.stack(stored))

    def fields(self, y: State) -> Any:
        """The fields in a state, as components for ``operator.to_fields``."""
        return tuple(tuple(part[: group.size]) for group, part in zip(self.groups, y, strict=True))


def generator(
    layers: Layers,
    bar: Bar,
    blocks: Sequence[Block],
    reference: Medium,
    with_gradient: bool,
    plain: Layers | None = None,
) -> Generator:
    """A of a bar.

    Args:
        layers: what it is made of; parameters may be traced by jax.
        bar: its grid.
        blocks: the blocks to integrate.
        reference: the medium whose units to scale by, of plain numbers.
        with_gradient: whether Γ is kept.
        plain: layers of plain numbers, for the absorbers, where the others are traced.
    """
    length = float(scales(reference).length)
    made = bar.differences
    count = len(bar.nodes)
    spare = count - bar.cells
    law = losses(layers, bar, reference, plain)
    law = Losses(
        law.mass_node,
        _padded(law.mass_half, spare),
        _padded(law.stiffness, spare),
        _padded(law.rates, spare),
        _padded(law.strengths, spare),
        law.absorb_node,
        _padded(law.absorb_half, spare),
        _padded(law.calm_half, spare),
        law.damped,
        law.absorbing,
    )
    norm = _padded(made.half_norm / length, spare)
    weights = difference_weights(bar.order)
    diagonals = _padded(made.diagonals * length, spare)
    cell = _padded(bar.cell_sizes / length, spare, np.inf)
    D = banded(made.first, diagonals, weights, 1 / cell, True)
    # Row j of D is column j of Dᵀ: its diagonals are these, moved along and in reverse order.
    offsets = made.first + np.arange(len(diagonals))
    moved = [np.roll(row * norm, offset) for row, offset in zip(diagonals, offsets, strict=True)]
    adjoint = banded(-int(offsets[-1]), np.stack(moved[::-1]), weights, -np.ones(count), False)
    fixed = np.zeros(count, bool)
    fixed[0] = bar.left in ("fixed", "absorbing")
    fixed[-1] = fixed[-1] or bar.right in ("fixed", "absorbing")
    groups = []
    for stacked in grouped(blocks):
        c = profile(layers, bar, stacked, reference, with_gradient)
        half = {name: _padded(getattr(c, name), spare) for name in ("c_pp", "c_pb", "c_bp", "c_bb")}
        c = Profile(**half, gamma=c.gamma, m_phi=c.m_phi, i_B=_padded(c.i_B, spare, 1.0))
        groups.append(
            Group(
                D,
                adjoint,
                norm,
                made.node_norm / length,
                c,
                np.where(fixed, 0.0, 1.0) / c.m_phi,
                law,
                with_gradient,
            )
        )
    return Generator(tuple(groups))


def _padded(values: Any, spare: int, by: float = 0.0) -> Any:
    xp = jnp if isinstance(values, jax.Array) else np
    return xp.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, spare)], constant_values=by)
