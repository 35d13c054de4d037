"""ẏ = A y + Σ_j G_j s_j(t) of a real bar, with the work of its sources and what it loses."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.drives import Drives
from wavesim.timedomain.generator import Generator
from wavesim.timedomain.group import State


class BarMotion(NamedTuple):
    """State of a run of a real bar, scaled.

    Attributes:
        y: fields, rates and memory.
        work: done by the sources since the start, energy per area of the section.
        lost: what damping and absorbing ends have taken since, likewise.
    """

    y: State
    work: jax.Array
    lost: jax.Array


class BarEquation(eqx.Module):
    """ẏ = A y + Σ_j G_j s_j(t), with work and losses.

    The power of the sources is Σ_j s_j ⟨G_j, v⟩ in the norm of kinetic energy, and besides, for
    each rotation that is prescribed, its rate times the force that holds it. These linear
    functionals of the state are O_e: those of all sources first, then those of the ``held`` ones.
    """

    generator: Generator
    drives: Drives
    balanced: bool = eqx.field(static=True)

    def __call__(self, t: jax.Array, motion: BarMotion) -> BarMotion:
        amounts = self.drives.signals(t)
        rate = self.drives.add(self.generator(motion.y), amounts)
        factors = jnp.concatenate([amounts, self.held_rates(motion.y)])
        work = jnp.sum(factors * self.responses(motion.y))
        lost = self.lost(motion.y) if self.accounted else jnp.zeros(())
        return BarMotion(rate, work, lost)

    def observe(self, motion: BarMotion) -> tuple[Any, ...]:
        """Fields, kinetic and stored energy, work and, where it is known, what is lost."""
        kinetic, stored = self.generator.energy(motion.y)
        seen = (self.generator.fields(motion.y), kinetic, stored, motion.work)
        return (*seen, motion.lost) if self.accounted else seen

    @property
    def accounted(self) -> bool:
        """Whether losses are accounted for."""
        return self.balanced and self.generator.lossy

    def start(self, y: State) -> BarMotion:
        """The motion that begins with a state."""
        return BarMotion(y, jnp.zeros(()), jnp.zeros(()))

    @property
    def held(self) -> np.ndarray:
        """Which sources prescribe a rotation."""
        drives = [source.drive for source in self.drives.sources]
        return np.flatnonzero([drive == "rotation" for drive in drives])

    def held_rates(self, y: State) -> jax.Array:
        """Rate of what each of them holds; where two hold one point, 0 for the second."""
        sources = [self.drives.sources[j] for j in self.held]
        places = [(source.field, source.position) for source in sources]
        first = np.array([places.index(place) == n for n, place in enumerate(places)], float)
        return self.drives.read(y)[self.held] * first

    def responses(self, y: State) -> jax.Array:
        """All O_e y."""
        inert, holding = [], []
        for group, parts in zip(self.generator.groups, y, strict=True):
            rates = parts[group.size : 2 * group.size]
            moving = tuple(m * v for m, v in zip(group.mass, rates, strict=True))
            fields, rest = parts[: group.size], parts[2 * group.size :]
            inert.append((*fields, *moving, *rest))
            holding.append((*fields, *(group.holding(parts) if len(self.held) else rates), *rest))
        forces = self.drives.read(tuple(holding))[self.held]
        return jnp.concatenate([self.drives.read(tuple(inert)), forces])

    def lost(self, y: State) -> jax.Array:
        """Power that damping and absorbing ends take."""
        return self.lost_between(jax.tree.map(lambda part: part[None], y))[0, 0]

    def lost_between(self, states: State) -> jax.Array:
        """Symmetric form whose diagonal is the power that states lose, (states, states).

        Args:
            states: several, along a first axis.
        """
        return sum(
            (
                group.lost(jax.vmap(group.observe)(parts))
                for group, parts in zip(self.generator.groups, states, strict=True)
            ),
            start=jnp.zeros(()),
        )
