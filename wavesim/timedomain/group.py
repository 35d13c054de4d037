"""A of ẏ = A y + forces: a bar of layers, with ends, absorbers and losses, in scaled units.

    m_φ φ̈ = −Qᵀσ − m_φ χ − α m_φ φ̇,              σ = c_pp κ̂ − c_pb B̂,       Q = H D
    i_B B̈ = c_bp κ̂ − c_bb B̂ + D(Γ g(B̂)) − α i_B Ḃ,   g = −N⁻¹ Qᵀ,
    κ = Dφ − ψ,   (κ̂, B̂) = e + β_d ė − Σ_l Y_l ζ_l,   e = (κ, B),   ζ̇_l = ω_l (e − ζ_l),
    ψ̇ = d κ,   χ̇ = d (−Qᵀσ/m_φ − χ),   and α_B on Ḃ in absorbing ends besides :

D with its closures and norms N, H from the bar; ψ, χ of the absorbing ends; ζ_l of the standard
linear solids. Energy is kept exactly where the closure is symmetric, as only Q and Qᵀ occur.

The state holds, for each group of blocks of one shape, components of shape (blocks, nodes): φ, B,
φ̇, Ḃ and, where they are needed, ψ, χ and the ζ_l. Values at half-nodes stand at the node to their
left; on a bar with ends the last of them is 0.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.banded import Banded
from wavesim.timedomain.material import Losses, Profile

Parts = tuple[jax.Array, ...]  # components of one kind, each of shape (blocks, nodes)


class Strain(NamedTuple):
    """What the rates, the energy and the losses of a state are made of; see the head of this file.

    Attributes:
        e, e_rate, e_hat: (κ, B), its rate, and with the memory in it.
        lag: e − ζ_l for each mechanism.
        v: (φ̇, Ḃ).
        sigma: σ; psi_rate, chi: of the absorbing ends, one for each rotation.
    """

    e: Parts
    e_rate: Parts
    e_hat: Parts
    lag: tuple[Parts, ...]
    v: Parts
    sigma: Parts
    psi_rate: Parts
    chi: Parts


class Group(eqx.Module):
    """A of blocks of one shape.

    Attributes:
        D, QT: from nodes to half-nodes, and Qᵀ back.
        norm, node_norm: H and N, shape (nodes,).
        c: coefficients, padded to the nodes.
        free: 1/m_φ, 0 at fixed nodes, shape (blocks, nodes).
        losses: over the grid, padded.
    """

    D: Banded
    QT: Banded
    norm: Any
    node_norm: Any
    c: Profile
    free: Any
    losses: Losses
    with_gradient: bool = eqx.field(static=True)

    @property
    def rotations(self) -> int:
        """Number of rotations in each block."""
        return int(self.c.c_pp.shape[0])

    @property
    def size(self) -> int:
        """Number of fields in each block."""
        return self.rotations + int(self.c.c_bb.shape[0])

    @property
    def tracks(self) -> int:
        """Number of components of a state."""
        absorbing = 2 * self.rotations if self.losses.absorbing else 0
        return self.size * (2 + self.losses.mechanisms) + absorbing

    def zero(self) -> Parts:
        """The state of rest."""
        return tuple(jnp.zeros(self.free.shape) for _ in range(self.tracks))

    def observe(self, y: Parts) -> Strain:
        """Strains, rates and stress of a state."""
        p, f, law = self.rotations, self.size, self.losses
        q, v = y[:f], y[f : 2 * f]
        at = 2 * f + (2 * p if law.absorbing else 0)
        memory = y[2 * f : at]
        zeta = [y[at + f * n : at + f * (n + 1)] for n in range(law.mechanisms)]
        kappa, kappa_rate = _each(self.D, q[:p]), _each(self.D, v[:p])
        psi_rate = chi = _each(jnp.zeros_like, kappa)
        if law.absorbing:
            kappa = _minus(kappa, memory[:p])
            psi_rate, chi = _times(law.absorb_half, kappa), memory[p:]
            kappa_rate = _minus(kappa_rate, psi_rate)
        e, e_rate = kappa + q[p:], kappa_rate + v[p:]
        e_hat = e
        if law.damped:
            e_hat = tuple(a + law.stiffness * b for a, b in zip(e, e_rate, strict=True))
        for part, strength in zip(zeta, law.strengths, strict=True):
            e_hat = _minus(e_hat, _times(strength, part))
        lag = tuple(_minus(e, part) for part in zeta)
        return Strain(e, e_rate, e_hat, lag, v, self.stress(e_hat), psi_rate, chi)

    def stress(self, e: Parts) -> Parts:
        """σ of strains (κ, B)."""
        p = self.rotations
        return _minus(_product(self.c.c_pp, e[:p]), _product(self.c.c_pb, e[p:]))

    def force(self, e: Parts) -> Parts:
        """What strains (κ, B) do to B, over H."""
        p = self.rotations
        force = _product(self.c.c_bb, e[p:])
        force = _minus(_product(self.c.c_bp, e[:p]), force) if p else _times(-1.0, force)
        if self.with_gradient:
            bent = _product(self.c.gamma, _each(self.slope, e[p:]))
            force = tuple(f + self.D(b) for f, b in zip(force, bent, strict=True))
        return force

    def slope(self, B: jax.Array) -> jax.Array:
        """∂ₓB at nodes, −N⁻¹ Qᵀ B; at the ends of a bar it is not used."""
        return -self.QT(B) / self.node_norm

    def rate(self, y: Parts) -> Parts:
        """A y."""
        p, law = self.rotations, self.losses
        s = self.observe(y)
        pull = tuple(-self.free * self.QT(sigma) for sigma in s.sigma)
        B_rate = tuple(force / self.c.i_B for force in self.force(s.e_hat))
        phi_rate = _minus(pull, s.chi) if law.absorbing else pull
        memory = s.psi_rate + _times(law.absorb_node, phi_rate) if law.absorbing else ()
        if law.absorbing:
            B_rate = _minus(B_rate, _times(law.calm_half, s.v[p:]))
        if law.damped:
            # A held node is moved by its source alone.
            free = jnp.where(self.free == 0, 0.0, law.mass_node)
            phi_rate = _minus(phi_rate, _times(free, s.v[:p]))
            B_rate = _minus(B_rate, _times(law.mass_half, s.v[p:]))
        relaxing: Parts = ()
        for lag, rates in zip(s.lag, law.rates, strict=True):
            relaxing += _times(rates, lag)
        return s.v + phi_rate + B_rate + memory + relaxing

    def holding(self, y: Parts) -> Parts:
        """Forces that the nodes put up against their rotations: what holds a fixed one."""
        p, s = self.rotations, self.observe(y)
        zero = jnp.zeros_like(self.free)
        drag = self.c.m_phi * self.losses.mass_node if self.losses.damped else 0.0
        forces = tuple(self.QT(a) + drag * v for a, v in zip(s.sigma, s.v[:p], strict=True))
        return forces + (zero,) * (self.size - p)

    @property
    def mass(self) -> Any:
        """Inertia times length of each point of the fields, shape (fields, blocks, nodes)."""
        b = self.size - self.rotations
        xp = jnp if isinstance(self.c.m_phi, jax.Array) else np
        return xp.stack([self.c.m_phi] * self.rotations + [self.norm * self.c.i_B] * b)

    def form(self, one: Parts, other: Parts) -> jax.Array:
        """Elastic form ⟨e₁, C e₂⟩ of two strains (κ, B), over the bar."""
        # The gradient term of the force is −H⁻¹ gᵀ N Γ g: in the sum with H it is that of energy.
        dual = self.stress(other) + _times(-1.0, self.force(other))
        return sum(
            (jnp.sum(self.norm * a * b) for a, b in zip(one, dual, strict=True)),
            start=jnp.zeros(()),
        )

    def energy(self, y: Parts) -> tuple[jax.Array, jax.Array]:
        """Kinetic energy, and what is stored in the strains and in the solids' springs."""
        s, law = self.observe(y), self.losses
        kinetic = jnp.sum(self.mass * jnp.stack(s.v) ** 2)
        stored = self.form(s.e, _times(1 - np.sum(law.strengths, axis=0), s.e))
        for lag, strength in zip(s.lag, law.strengths, strict=True):
            stored = stored + self.form(lag, _times(strength, lag))
        return kinetic / 2, stored / 2

    def lost(self, seen: Strain) -> jax.Array:
        """Symmetric form whose diagonal is the power that states lose, (states, states).

        Args:
            seen: of several states, along a first axis.
        """
        p, law = self.rotations, self.losses
        count = seen.v[0].shape[0]
        total = jnp.zeros((count, count))

        def paired(one: Parts, other: Parts) -> jax.Array:
            return sum(
                (
                    a.reshape(count, -1) @ b.reshape(count, -1).T
                    for a, b in zip(one, other, strict=True)
                ),
                start=jnp.zeros((count, count)),
            )

        def elastic(one: Parts, other: Parts) -> jax.Array:
            """⟨e₁, C e₂⟩ over the bar, as :meth:`form`."""
            dual = jax.vmap(self.stress)(other) + _times(-1.0, jax.vmap(self.force)(other))
            return paired(one, _times(self.norm, dual))

        if law.damped:
            damped = _times(law.mass_node, seen.v[:p]) + _times(law.mass_half, seen.v[p:])
            inert = tuple(m * d for m, d in zip(self.mass, damped, strict=True))
            total = total + paired(seen.v, inert)
            total = total + elastic(seen.e_rate, _times(law.stiffness, seen.e_rate))
            for lag, rate, strength in zip(seen.lag, law.rates, law.strengths, strict=True):
                total = total + elastic(lag, _times(rate * strength, lag))
        if law.absorbing:
            taken = paired(_times(self.c.m_phi, seen.v[:p]), seen.chi)
            taken = taken + paired(_times(self.norm, seen.sigma), seen.psi_rate)
            total = total + (taken + taken.T) / 2
            calmed = _times(law.calm_half, seen.v[p:])
            inert = tuple(m * c for m, c in zip(self.mass[p:], calmed, strict=True))
            total = total + paired(seen.v[p:], inert)
        return total


def _each(function: Callable[[jax.Array], jax.Array], parts: Parts) -> Parts:
    return tuple(function(part) for part in parts)


def _times(factor: Any, parts: Parts) -> Parts:
    return tuple(factor * part for part in parts)


def _minus(one: Parts, other: Parts) -> Parts:
    return tuple(a - b for a, b in zip(one, other, strict=True))


def _product(matrix: jax.Array, parts: Parts) -> Parts:
    """Σ_j matrix[i, j] parts[j], point by point; shape of the matrix (i, j, blocks, nodes)."""
    return tuple(
        functools.reduce(jnp.add, (row[j] * part for j, part in enumerate(parts)))
        for row in (matrix[i] for i in range(matrix.shape[0]))
    )


State = tuple[Parts, ...]
