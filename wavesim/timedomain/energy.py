"""Energy and work of a run: ẏ = A y + Σ_j G_j s_j(t) together with the work of its sources.

The power of the sources is Σ_j s_j ⟨G_j, v⟩ in the norm of kinetic energy, v = (φ̇, Ḃ), and besides,
for each rotation that is prescribed, its rate times the moment that holds it. Energy never enters:
where nothing is lost and the closure is symmetric, energy = work is a check of the stepper; with
losses, work − energy is what was dissipated, which never falls.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.operator import Group, Operator, State, States
from wavesim.timedomain.source_terms import SourceTerms


class Motion(NamedTuple):
    """State of a run, scaled.

    Attributes:
        y: fields, rates and memory.
        work: done by the sources since the start, energy per area of the section.
    """

    y: States
    work: Any


class Equation(eqx.Module):
    """ẏ = A y + Σ_j G_j s_j(t), with the work of the sources: what diffrax integrates."""

    operator: Operator
    sources: SourceTerms

    def __call__(self, t: Any, motion: Motion) -> Motion:
        """Rate of a motion at a scaled time."""
        signals = self.sources.at(t)
        rate = self.sources.add(self.operator(motion.y), signals)
        return Motion(rate, self.power(motion.y, signals))

    def power(self, y: States, signals: Any) -> Any:
        """Of the sources, from their signals, shape (sources,)."""
        groups = self.operator.groups
        moving = [
            (of_phi * part.phi_rate, of_B * part.B_rate)
            for part, (of_phi, of_B) in zip(y, (group.mass for group in groups), strict=True)
        ]
        total = jnp.sum(signals * self.sources.read(moving))
        if len(self.turning):
            rates = self.rates(y)
            holding = [
                (_holding(group, part), part.B_rate) for group, part in zip(groups, y, strict=True)
            ]
            forces = self.sources.read(holding)
            total = total + jnp.sum((rates * forces)[self.turning])
        return total

    def rates(self, y: States) -> Any:
        """G_jᵀ v, shape (sources,): of a prescribed rotation the rate of its end."""
        return self.sources.read([(part.phi_rate, part.B_rate) for part in y])

    @property
    def turning(self) -> np.ndarray:
        """Sources whose prescribed rotation does work; of two that hold one point, one."""
        kept: dict[tuple[str, float], int] = {}
        for j in self.sources.turning:
            source = self.sources.sources[j]
            kept.setdefault((source.field, source.position), j)
        return np.array(list(kept.values()), int)

    def observe(self, motion: Motion) -> Any:
        """(φ, B) of each group, kinetic and stored energy, and work."""
        kinetic, stored = self.operator.energy(motion.y)
        return [(part.phi, part.B) for part in motion.y], kinetic, stored, motion.work


def _holding(group: Group, y: State) -> Any:
    """Moments that the nodes put up against their rotations: what holds a fixed one."""
    sigma, _ = group.stress(*group.strains(y))
    moment = group.QT(sigma)
    if group.losses.damped:
        moment = moment + group.c.node_mass * group.losses.mass_node * y.phi_rate
    return moment
