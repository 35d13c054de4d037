"""What diffrax integrates: ẏ = A y + Σ_j G_j s_j(t), together with the work of its sources.

Where nothing is lost and the closure is symmetric, energy = work is a check of the stepper, as
neither is made from the other; with losses, work − energy is what was dissipated: it never falls.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.operator import Group, Operator, State, States
from wavesim.timedomain.source_terms import SourceTerms


def energy(A: Operator, y: States) -> tuple[jax.Array, jax.Array]:
    """Kinetic and stored energy of a state, per area of the section, scaled.

        E = ½ Σ m v² + ½ Σ H e·C e (1 − Σ_l Y_l) + ½ Σ_l Σ H Y_l (e − ζ_l)·C (e − ζ_l)
            + ½ Σ N g·Γ g,

    v = (φ̇, Ḃ), e = (κ, B), by the norms N, H of the grid: kinetic, and stored in strains and in
    the springs of the solids.
    """
    parts = [_of_group(group, part) for group, part in zip(A.groups, y, strict=True)]
    kinetic, stored = zip(*parts, strict=True)
    return sum(kinetic[1:], start=kinetic[0]), sum(stored[1:], start=stored[0])


def power(A: Operator, sources: SourceTerms, y: States, signals: Any) -> Any:
    """Power of the sources in a state: Σ_j s_j ⟨G_j, v⟩ in the norm of kinetic energy.

    Besides, for each macro-field that is prescribed, its rate times the force that holds it.
    """
    moving = [
        (of_phi * part.phi_rate, of_B * part.B_rate)
        for part, (of_phi, of_B) in zip(y, (group.mass for group in A.groups), strict=True)
    ]
    total = jnp.sum(signals * sources.read(moving))
    if sources.turning:
        pairs = zip(A.groups, y, strict=True)
        holding = [(_holding(group, part), part.B_rate) for group, part in pairs]
        forces = sources.read(holding)
        total = total + jnp.sum(
            (rates(sources, y) * forces)[np.array([ends[0] for ends in sources.turning])]
        )
    return total


def rates(sources: SourceTerms, y: States) -> Any:
    """G_jᵀ v, shape (sources,): of a prescribed φ the rate of its end."""
    return sources.read([(part.phi_rate, part.B_rate) for part in y])


def _holding(group: Group, y: State) -> Any:
    """Forces that the nodes put up against their φ: what holds a fixed one."""
    sigma, _ = group.stress(*group.strains(y))
    force = group.QT(sigma)
    if group.losses.damped:
        force = force + group.c.node_mass * group.losses.mass_node * y.phi_rate
    return force


def _of_group(group: Group, y: State) -> tuple[jax.Array, jax.Array]:
    """Kinetic energy, and what is stored in the strains and in the solids' springs."""
    law = group.losses
    of_phi, of_B = group.mass
    kinetic = _total(of_phi * y.phi_rate**2, of_B * y.B_rate**2)
    if not len(law.strengths):
        return kinetic / 2, _stored(group, y.kappa, y.B) / 2
    # The strains, and what each mechanism has not followed yet, with its part of the stiffness.
    share = jnp.concatenate([1 - jnp.sum(law.strengths, axis=0, keepdims=True), law.strengths])
    kappa = jnp.concatenate([y.kappa[None], y.kappa - y.zeta_kappa])
    B = jnp.concatenate([y.B[None], y.B - y.zeta_B])
    stored = jax.vmap(lambda *own: _stored(group, *own))(kappa, B, share)
    return kinetic / 2, jnp.sum(stored) / 2


def _stored(group: Group, kappa: Any, B: Any, share: Any = None) -> jax.Array:
    """⟨e, C share e⟩ over the bar, e = (κ, B), the gradient term with it."""
    norm = group.half_norm if share is None else group.half_norm * share
    sigma, tau = group.stress(kappa, B)
    parts = [norm * kappa * sigma, norm * B * tau]
    if group.c.gradient is not None:
        slope, force = group.bending(B)
        if share is not None:
            _, force = group.bending(share * B)
        parts.append(group.node_norm * slope * force)
    return _total(*parts)


def _total(*parts: Any) -> jax.Array:
    """Sum of all numbers of some arrays."""
    return functools.reduce(jnp.add, [jnp.sum(part) for part in parts])


class Motion(NamedTuple):
    """State of a run, scaled.

    Attributes:
        y: fields, rates and memory.
        work: done by the sources since the start, energy per area of the section.
    """

    y: States
    work: Any


class Equation(eqx.Module):
    """ẏ = A y + Σ_j G_j s_j(t), and Ẇ the power of the sources.

    Attributes:
        operator: A.
        sources: Σ_j G_j s_j(t).
    """

    operator: Operator
    sources: SourceTerms

    def __call__(self, t: Any, motion: Motion) -> Motion:
        """Rate of a motion at a scaled time."""
        signals = self.sources.at(t)
        rate = self.sources.add(self.operator(motion.y), signals)
        return Motion(rate, power(self.operator, self.sources, motion.y, signals))

    def observe(self, motion: Motion) -> Any:
        """(φ, B) of each group, kinetic and stored energy, and work."""
        kinetic, stored = energy(self.operator, motion.y)
        return [(part.phi, part.B) for part in motion.y], kinetic, stored, motion.work


class Run(eqx.Module):
    """An equation in time counted in steps from where an integration begins.

    Attributes:
        equation: what is integrated.
        at: number of steps taken before.
        h: the step, scaled.
    """

    equation: Any
    at: Any
    h: Any

    def time(self, steps: Any) -> Any:
        """Scaled time after so many steps."""
        return (self.at + steps) * self.h

    def rate(self, steps: Any, motion: Motion) -> Motion:
        """Change of a motion in a step, by its rate."""
        rate: Motion = self.equation(self.time(steps), motion)
        return jax.tree.map(lambda part: self.h * part, rate)
