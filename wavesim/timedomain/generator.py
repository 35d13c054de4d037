"""A of ẏ = A y + forces: a bar of layers, with ends, absorbers and losses, in scaled units.

    m_φ φ̈ = −Qᵀσ − m_φ χ − α m_φ φ̇,              σ = c_pp κ̂ − c_pb B̂,       Q = H D
    i_B B̈ = c_bp κ̂ − c_bb B̂ + D(Γ g(B̂)) − α i_B Ḃ,   g = −N⁻¹ Qᵀ,
    κ = Dφ − ψ,   (κ̂, B̂) = e + β_d ė − Σ_l Y_l ζ_l,   e = (κ, B),   ζ̇_l = ω_l (e − ζ_l),
    ψ̇ = d κ,   χ̇ = d (−Qᵀσ/m_φ − χ) :

D with its closures and norms N, H from the bar; ψ, χ of the absorbing ends; ζ_l of the standard
linear solids. Energy is kept exactly where the closure is symmetric, as only Q and Qᵀ occur.

The state holds an array for each group of blocks of one shape: (tracks, blocks, nodes), its tracks
φ, B, φ̇, Ḃ and, where they are needed, ψ, χ and the ζ_l. Values at half-nodes stand at the node to
their left; on a bar with ends the last of them is 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.bar import Bar
from wavesim.layers import Layers
from wavesim.medium import Medium
from wavesim.sectors import Block, grouped, scales
from wavesim.timedomain.material import Losses, Profile, losses, profile

Tracks = jax.Array


class Banded(eqx.Module):
    """A banded matrix on a grid, by diagonals: row j takes column j + first + w, modulo n."""

    diagonals: jax.Array
    first: int = eqx.field(static=True)

    def __call__(self, u: jax.Array) -> jax.Array:
        """The product with u along its last axis, shape (…, n)."""
        width, n = self.diagonals.shape
        left, right = max(0, -self.first), max(0, self.first + width - 1)
        padded = jnp.concatenate([u[..., n - left :], u, u[..., :right]], axis=-1)
        at = left + self.first
        terms = (self.diagonals[w] * padded[..., at + w : at + w + n] for w in range(width))
        return sum(terms, start=jnp.zeros_like(u))

    def transposed(self, weights: np.ndarray) -> Banded:
        """Of diag(weights) times this matrix, the transpose."""
        width = self.diagonals.shape[0]
        offsets = self.first + np.arange(width)
        rows = [np.roll(np.asarray(self.diagonals[w]) * weights, o) for w, o in enumerate(offsets)]
        return Banded(jnp.asarray(np.stack(rows[::-1])), -int(offsets[-1]))


class Strain(eqx.Module):
    """What the rates, the energy and the losses of a state are made of; see the head of this file.

    Attributes:
        e, e_rate, e_hat: (κ, B), its rate, and with the memory in it, (fields, blocks, nodes).
        lag: e − ζ_l, (mechanisms, fields, blocks, nodes).
        v: (φ̇, Ḃ).
        sigma: σ; psi_rate, chi: of the absorbing ends, (rotations, blocks, nodes).
    """

    e: jax.Array
    e_rate: jax.Array
    e_hat: jax.Array
    lag: jax.Array
    v: jax.Array
    sigma: jax.Array
    psi_rate: jax.Array
    chi: jax.Array


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
    norm: jax.Array
    node_norm: jax.Array
    c: Profile
    free: jax.Array
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
        """Length of the state's first axis."""
        absorbing = 2 * self.rotations if self.losses.absorbing else 0
        return self.size * (2 + self.losses.mechanisms) + absorbing

    def zero(self) -> Tracks:
        """The state of rest."""
        return jnp.zeros((self.tracks, *self.free.shape))

    def observe(self, y: Tracks) -> Strain:
        """Strains, rates and stress of a state."""
        p, f, law = self.rotations, self.size, self.losses
        q, v = y[:f], y[f : 2 * f]
        at = 2 * f + (2 * p if law.absorbing else 0)
        memory, zeta = y[2 * f : at], y[at:].reshape(law.mechanisms, f, *y.shape[1:])
        kappa, kappa_rate = self.D(q[:p]), self.D(v[:p])
        psi_rate = chi = jnp.zeros_like(kappa)
        if law.absorbing:
            kappa = kappa - memory[:p]
            psi_rate, chi = law.absorb_half * kappa, memory[p:]
            kappa_rate = kappa_rate - psi_rate
        e = jnp.concatenate([kappa, q[p:]])
        e_rate = jnp.concatenate([kappa_rate, v[p:]])
        e_hat = e + law.stiffness * e_rate if law.damped else e
        lag = e[None] - zeta
        if law.mechanisms:
            e_hat = e_hat - jnp.einsum("ln,lfbn->fbn", law.strengths, zeta)
        return Strain(e, e_rate, e_hat, lag, v, self._stress(e_hat), psi_rate, chi)

    def _stress(self, e: jax.Array) -> jax.Array:
        p = self.rotations
        return _product(self.c.c_pp, e[:p]) - _product(self.c.c_pb, e[p:])

    def _force(self, e: jax.Array) -> jax.Array:
        """What strains do to B, over H."""
        p = self.rotations
        force = _product(self.c.c_bp, e[:p]) - _product(self.c.c_bb, e[p:])
        if self.with_gradient:
            force = force + self.D(_product(self.c.gamma, self.slope(e[p:])))
        return force

    def slope(self, B: jax.Array) -> jax.Array:
        """∂ₓB at nodes, −N⁻¹ Qᵀ B; at the ends of a bar it is not used."""
        return -self.QT(B) / self.node_norm

    def rate(self, y: Tracks) -> Tracks:
        """A y."""
        p, law = self.rotations, self.losses
        s = self.observe(y)
        pull = -self.free * self.QT(s.sigma)
        acceleration = jnp.concatenate([pull - s.chi, self._force(s.e_hat) / self.c.i_B])
        if law.damped:
            acceleration = acceleration - jnp.concatenate(
                [law.mass_node * s.v[:p], law.mass_half * s.v[p:]]
            )
        parts = [s.v, acceleration]
        if law.absorbing:
            parts += [s.psi_rate, law.absorb_node * (pull - s.chi)]
        if law.mechanisms:
            relaxing = law.rates[:, None, None, :] * s.lag
            parts.append(relaxing.reshape(-1, *y.shape[1:]))
        return jnp.concatenate(parts)

    def form(self, one: jax.Array, other: jax.Array) -> jax.Array:
        """Elastic form ⟨e₁, C e₂⟩ of two strains (κ, B), over the bar."""
        p = self.rotations
        total = jnp.sum(self.norm * one[:p] * self._stress(other))
        # The gradient term of the force is −H⁻¹ gᵀ N Γ g: in the sum with H it is that of energy.
        return total - jnp.sum(self.norm * one[p:] * self._force(other))

    def inertia(self, one: jax.Array, other: jax.Array) -> jax.Array:
        """⟨v₁, m v₂⟩ of two rates (φ̇, Ḃ), over the bar."""
        p = self.rotations
        total = jnp.sum(self.c.m_phi * one[:p] * other[:p])
        return total + jnp.sum(self.norm * self.c.i_B * one[p:] * other[p:])

    def energy(self, y: Tracks) -> tuple[jax.Array, jax.Array]:
        """Kinetic energy, and what is stored in the strains and in the solids' springs."""
        s, law = self.observe(y), self.losses
        relaxed = 1 - jnp.sum(law.strengths, axis=0)
        stored = self.form(s.e, relaxed * s.e)
        for lag, strength in zip(s.lag, law.strengths, strict=True):
            stored = stored + self.form(lag, strength * lag)
        return self.inertia(s.v, s.v) / 2, stored / 2

    @property
    def mass(self) -> jax.Array:
        """Inertia times length of each point of the fields, shape (fields, blocks, nodes)."""
        half = self.norm * self.c.i_B
        b = self.size - self.rotations
        parts = [self.c.m_phi[None]] * self.rotations + [half[None]] * b
        return jnp.concatenate(parts)

    def lost(self, seen: Strain) -> jax.Array:
        """Symmetric form whose diagonal is the power that states lose, (states, states).

        Args:
            seen: of several states, along a first axis.
        """
        p, law = self.rotations, self.losses
        count = seen.v.shape[0]
        total = jnp.zeros((count, count))

        def paired(one: jax.Array, other: jax.Array) -> jax.Array:
            return one.reshape(count, -1) @ other.reshape(count, -1).T

        def elastic(one: jax.Array, other: jax.Array) -> jax.Array:
            """⟨e₁, C e₂⟩ over the bar, as :meth:`form`."""
            force = jax.vmap(self._force)(other)
            dual = jnp.concatenate([jax.vmap(self._stress)(other), -force], axis=1)
            return paired(one, self.norm * dual)

        if law.damped:
            damped = jnp.concatenate(
                [law.mass_node * seen.v[:, :p], law.mass_half * seen.v[:, p:]], axis=1
            )
            total = total + paired(seen.v, self.mass * damped)
            total = total + elastic(seen.e_rate, law.stiffness * seen.e_rate)
            for number in range(law.mechanisms):
                lag = seen.lag[:, number]
                total = total + elastic(lag, law.rates[number] * law.strengths[number] * lag)
        if law.absorbing:
            taken = paired(self.c.m_phi * seen.v[:, :p], seen.chi)
            taken = taken + paired(self.norm * seen.sigma, seen.psi_rate)
            total = total + (taken + taken.T) / 2
        return total


def _product(matrix: jax.Array, parts: jax.Array) -> jax.Array:
    """Σ_j matrix[i, j] parts[j], points one by one; shapes (i, j, blocks, n) and (j, blocks, n)."""
    rows, columns = matrix.shape[:2]
    if not rows or not columns:
        return jnp.zeros((rows, *parts.shape[1:]))
    return jnp.stack([sum(matrix[i, j] * parts[j] for j in range(columns)) for i in range(rows)])


State = tuple[Tracks, ...]


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
        return tuple(
            tuple(part[i] for i in range(group.size))
            for group, part in zip(self.groups, y, strict=True)
        )


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
    law = losses(plain or layers, bar, reference)
    law = Losses(
        law.mass_node,
        _padded(law.mass_half, spare),
        _padded(law.stiffness, spare),
        _padded(law.rates, spare),
        _padded(law.strengths, spare),
        law.absorb_node,
        _padded(law.absorb_half, spare),
        law.damped,
        law.absorbing,
    )
    norm = _padded(made.half_norm / length, spare)
    D = Banded(jnp.asarray(_padded(made.diagonals * length, spare)), made.first)
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
                D.transposed(norm),
                jnp.asarray(norm),
                jnp.asarray(made.node_norm / length),
                c,
                jnp.where(fixed, 0.0, 1 / c.m_phi),
                law,
                with_gradient,
            )
        )
    return Generator(tuple(groups))


def _padded(values: Any, spare: int, by: float = 0.0) -> Any:
    xp = jnp if isinstance(values, jax.Array) else np
    return xp.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, spare)], constant_values=by)
