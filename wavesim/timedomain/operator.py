"""The semi-discrete operator A of ẏ = A y + Σ_j G_j s_j(t), on the staggered grid, scaled.

One operator for every bar: endless ring, layers, ends, absorbers, losses. In rates and strains,

    m_φ φ̈ = −Qᵀσ − m_φ (α + d) φ̇ − m_φ α d φ,     Q = H D,
    i_B B̈ = −τ + D(Γ g(B̂)) − i_B (α + α_B) Ḃ,      g = −N⁻¹ Qᵀ,
    (σ, τ) = C (κ̂, B̂),   κ̇ = D φ̇ − d κ,   (κ̂, B̂) = e + β_d ė − Σ_l Y_l ζ_l,   e = (κ, B),
    ζ̇_l = ω_l (e − ζ_l) :

D with its closures and norms N, H from the bar; C, Γ, inertias and loss laws from its layers; d and
α_B of the absorbing ends (``absorber.py``), where ∂ₓ is stretched to ∂ₓ/(1 + d/∂ₜ); ζ_l of the
standard linear solids. κ = φ′ is a part of the state: each difference so is taken once. Energy is
kept exactly where the closure is symmetric, as only Q and Qᵀ occur.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.grid.stencils import difference_weights
from wavesim.material.family import Block, grouped
from wavesim.material.layers import Layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.timedomain.coefficients_on_grid import (
    Coefficients,
    Losses,
    at_half,
    coefficients,
    losses,
    node_norm,
    stretched,
)


class State(NamedTuple):
    """State of blocks of one shape, scaled; each array of shape (components, blocks, points).

    Values at half-nodes stand at the node to their left; on a bar with ends the last of them is 0.

    Attributes:
        phi, B: the fields.
        phi_rate, B_rate: φ̇, Ḃ.
        kappa: κ.
        zeta_kappa, zeta_B: ζ_l of κ and of B, with a first axis of mechanisms.
    """

    phi: Any
    B: Any
    phi_rate: Any
    B_rate: Any
    kappa: Any
    zeta_kappa: Any
    zeta_B: Any


# Where more of the rows than this are near an interface, weights for each row are the faster.
_MANY = 0.1

States = tuple[State, ...]  # of all groups of blocks that are integrated


class Difference(eqx.Module):
    """A difference of the grid: one stencil in every row, but for some near ends and interfaces.

    Row j takes scale_j Σ_w stencil_w u_{j + first + w}; those of ``rows`` take Σ_c factors_c u at
    their own columns instead.

    Attributes:
        stencil: plain numbers; none where each row has its own weights, and ``rows`` are none.
        weights: of each row then, shape (width, points).
        scale: shape (points,), or one number.
        rows: shape (r,), ascending; columns, factors: shape (r, c).
        first: offset of the stencil's first point.
        ring: whether points are counted round the bar; else those beyond its ends count as 0.
    """

    stencil: tuple[float, ...] = eqx.field(static=True)
    weights: Any
    scale: Any
    rows: Any
    columns: Any
    factors: Any
    first: int = eqx.field(static=True)
    ring: bool = eqx.field(static=True)

    def __call__(self, u: jax.Array) -> jax.Array:
        """The product with u along its last axis."""
        weights = self.stencil or self.weights
        width, n = len(weights), u.shape[-1]
        left, right = -self.first, width - 1 + self.first
        # Whatever is fused with a padding is computed element by element, many times slower.
        u = jax.lax.optimization_barrier(u)
        if self.ring:
            padded = jnp.concatenate([u[..., n - left :], u, u[..., :right]], axis=-1)
        else:
            padded = jnp.pad(u, [(0, 0)] * (u.ndim - 1) + [(left, right)])
        padded = jax.lax.optimization_barrier(padded)
        taps = (weights[w] * padded[..., w : w + n] for w in range(width))
        made = functools.reduce(jnp.add, taps) * self.scale
        if not len(self.rows):
            return made
        special = jnp.sum(self.factors * u[..., self.columns], axis=-1)
        where = made.at[..., self.rows]
        return where.set(special, unique_indices=True, indices_are_sorted=True)


class Group(eqx.Module):
    """A of blocks of one shape.

    Attributes:
        D, QT: from nodes to half-nodes, and Qᵀ back.
        half_norm, node_norm: H and N, shape (points,).
        c: stiffnesses and inertias.
        free: 1/m_φ, 0 at nodes that are held, shape (blocks, points).
        losses: over the grid.
    """

    D: Difference
    QT: Difference
    half_norm: Any
    node_norm: Any
    c: Coefficients
    free: Any
    losses: Losses

    @property
    def rest(self) -> State:
        """The state of rest, of zeros."""
        p, b = self.c.macro, self.c.stiffness.shape[0] - self.c.macro
        mechanisms, size = len(self.losses.rates), self.free.shape
        sizes = [(p,), (b,), (p,), (b,), (p,), (mechanisms, p), (mechanisms, b)]
        return State(*(np.zeros((*n, *size)) for n in sizes))

    @property
    def mass(self) -> tuple[Any, Any]:
        """Inertia times length of each point, of φ and of B, shape (blocks, points) each."""
        return self.c.node_mass, self.half_norm * self.c.inertia

    def strains(self, y: State) -> tuple[Any, Any]:
        """κ̂ and B̂, the strains with the memory in them, each (components, blocks, points)."""
        law = self.losses
        kappa, B = y.kappa, y.B
        if law.viscous:
            B = B + law.stiffness * y.B_rate
            if self.c.macro:
                kappa = kappa + law.stiffness * self.strain_rate(y)
        for strength, of_kappa, of_B in zip(law.strengths, y.zeta_kappa, y.zeta_B, strict=True):
            kappa, B = kappa - strength * of_kappa, B - strength * of_B
        return kappa, B

    def strain_rate(self, y: State) -> Any:
        """κ̇."""
        rate = self.D(y.phi_rate)
        return rate - self.losses.absorb_half * y.kappa if self.losses.absorbing else rate

    def stress(self, kappa: Any, B: Any) -> tuple[Any, Any]:
        """(σ, τ) = C (κ, B), the gradient term apart."""
        C, p = self.c.stiffness, self.c.macro
        strains = [*kappa, *B]
        first, *others = (C[:, j] * one for j, one in enumerate(strains))
        total = sum(others, start=first)
        return total[:p], total[p:]

    def bending(self, B: Any) -> tuple[Any, Any]:
        """Slope g(B) at nodes, and Γ g over the length of each."""
        slope = -self.QT(B) / self.node_norm
        first, *others = (self.c.gradient[:, j] * one for j, one in enumerate(slope))
        return slope, sum(others, start=first)

    def rate(self, y: State) -> State:
        """A y."""
        law = self.losses
        kappa_hat, B_hat = self.strains(y)
        sigma, tau = self.stress(kappa_hat, B_hat)
        B_rate = -tau
        if self.c.gradient is not None:
            B_rate = B_rate + self.D(self.bending(B_hat)[1])
        B_rate = B_rate / self.c.inertia
        if law.lossy:
            B_rate = B_rate - law.drag_half * y.B_rate
        phi_rate, kappa_rate = y.phi, y.kappa
        if self.c.macro:
            phi_rate, kappa_rate = -self.free * self.QT(sigma), self.strain_rate(y)
            if law.lossy:
                # A held node is moved by its source alone.
                free = self.free != 0
                phi_rate = phi_rate - jnp.where(free, law.drag_node, 0.0) * y.phi_rate
                if law.absorbing and law.damped:
                    phi_rate = phi_rate - jnp.where(free, law.spring_node, 0.0) * y.phi
        rates = law.rates[:, None, None]
        return State(
            y.phi_rate,
            y.B_rate,
            phi_rate,
            B_rate,
            kappa_rate,
            rates * (y.kappa - y.zeta_kappa),
            rates * (y.B - y.zeta_B),
        )


class Operator(eqx.Module):
    """A of all blocks that are integrated, those of one shape stacked in a group."""

    groups: tuple[Group, ...]

    def __call__(self, y: States) -> States:
        """A y."""
        return tuple(group.rate(part) for group, part in zip(self.groups, y, strict=True))

    @property
    def rest(self) -> States:
        """The state of rest."""
        return tuple(group.rest for group in self.groups)


def operator(
    layers: Layers,
    bar: Bar,
    blocks: Sequence[Block],
    reference: Medium,
    with_gradient: bool,
    plain: Layers | None = None,
    sizes: Any = None,
) -> Operator:
    """A of a bar.

    Args:
        layers: what it is made of; parameters may be traced by jax.
        bar: its grid.
        blocks: the blocks to integrate.
        reference: the medium whose units to scale by, of plain numbers.
        with_gradient: whether Γ is kept.
        plain: layers of plain numbers, for the absorbers, where the others are traced.
        sizes: of the cells of each stretch, m, in place of the bar's; may be traced.
    """
    length = float(scales(reference).length)
    known = differences(bar, length)
    if sizes is not None:
        D, QT, half_norm, _ = known
        ratio = stretched(bar, sizes)
        D = dataclasses.replace(
            D, scale=D.scale / ratio, factors=D.factors / ratio[D.rows][:, None]
        )
        known = D, QT, half_norm * ratio, node_norm(layers, bar, sizes) / length
    held = held_nodes(bar)
    groups = []
    for stacked in grouped(blocks):
        law = losses(layers, bar, stacked[0], reference, plain, sizes)
        c = coefficients(layers, bar, stacked, reference, with_gradient, sizes)
        free = np.where(held, 0.0, 1.0) / c.node_mass
        groups.append(Group(*known, c, free, law))
    return Operator(tuple(groups))


def held_nodes(bar: Bar) -> np.ndarray:
    """Whether each node is held: at fixed ends, and at the far ends of absorbing layers."""
    held = np.zeros(len(bar.nodes), bool)
    held[0] = bar.left in ("fixed", "absorbing")
    held[-1] = held[-1] or bar.right in ("fixed", "absorbing")
    return held


def differences(bar: Bar, length: float) -> tuple[Difference, Difference, Any, Any]:
    """D, Qᵀ, H and N of a bar, scaled by a length in m."""
    made, ring = bar.differences, bar.periodic
    half_norm = at_half(bar, made.half_norm / length)
    diagonals = at_half(bar, made.diagonals * length)
    weights = np.array(difference_weights(bar.order))
    weights = np.concatenate([-weights[::-1], weights])
    across = at_half(bar, length / bar.cell_sizes)
    D = _difference(diagonals, made.first, weights, across, 1 - len(weights) // 2, ring)
    # Row j of D is column j of Dᵀ: its diagonals are these, moved along and in reverse order.
    offsets = made.first + np.arange(len(diagonals))
    moved = [np.roll(d * half_norm, by) for d, by in zip(diagonals, offsets, strict=True)]
    transposed, one = np.stack(moved[::-1]), np.ones(len(bar.nodes))
    QT = _difference(transposed, -offsets[-1], -weights, one, -(len(weights) // 2), ring)
    return D, QT, half_norm, made.node_norm / length


def _difference(
    diagonals: np.ndarray,
    offset: int,
    weights: np.ndarray,
    scale: np.ndarray,
    first: int,
    ring: bool,
) -> Difference:
    """A matrix of diagonals (width, points), the first at an offset, as stencil and exceptions."""
    width, n = diagonals.shape
    plain = np.zeros_like(diagonals)
    plain[first - offset : first - offset + len(weights)] = weights[:, None] * scale
    away = np.abs(diagonals - plain).max(axis=0) > 1e-13 * np.abs(diagonals).max()
    rows = np.flatnonzero(away)
    if len(rows) > _MANY * n:
        none = np.zeros((0, width))
        return Difference(
            (), diagonals, np.ones(()), rows[:0], none.astype(int), none, int(offset), ring
        )
    columns = (rows[:, None] + offset + np.arange(width)) % n
    even = scale[0] if np.ptp(scale) == 0 else scale
    stencil, factors = tuple(weights.tolist()), diagonals[:, rows].T
    return Difference(stencil, None, np.asarray(even), rows, columns, factors, first, ring)
