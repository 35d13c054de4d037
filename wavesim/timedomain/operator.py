"""The semi-discrete operator: q̈ = L q + forces, on the staggered grid, in scaled units.

D takes rotations from nodes to half-nodes and −Dᵀ takes σ back, so that with symmetric
coefficients L is symmetric to the last bit and no closure near any point is needed:

    φ̈ = −Dᵀ(c_pp Dφ − c_pb B),    B̈ = c_bp Dφ − c_bb B − γ D Dᵀ B

Blocks of the same shape are stacked and go through together: a component of the state has shape
(blocks, cells). A state is a tuple over such groups of tuples of components.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.grid.stencils import difference_weights
from wavesim.material.medium import PARAMETERS, Medium
from wavesim.material.scaling import block_coefficients, scales
from wavesim.material.sectors import BLOCKS, Block, grouped
from wavesim.material.wave_equations import ROTATIONS

# The scheme needs double precision; ``single.py`` has what may be rounded.
jax.config.update("jax_enable_x64", True)
# A medium is a pytree: jax.grad and jax.vmap go through its parameters.
jax.tree_util.register_dataclass(
    Medium, data_fields=tuple(PARAMETERS), meta_fields=("closure", "damping")
)

Component = jax.Array
State = tuple[tuple[Component, ...], ...]


def difference(u: Any, weights: tuple[float, ...], forward: bool) -> Any:
    """Staggered first difference along the last axis of a periodic grid.

    Args:
        u: values, shape (…, N), numpy or jax.
        weights: c_j/h, j = 1…m.
        forward: True from nodes to half-nodes (D), False from half-nodes to nodes (−Dᵀ).

    Returns:
        Differences, shape (…, N).
    """
    m, n = len(weights), u.shape[-1]
    left = m - 1 if forward else m
    xp = np if isinstance(u, np.ndarray) else jnp
    padded = xp.concatenate([u[..., n - left :], u, u[..., : 2 * m - 1 - left]], axis=-1)
    ahead = (padded[..., m + j : m + j + n] for j in range(m))
    behind = (padded[..., m - 1 - j : m - 1 - j + n] for j in range(m))
    return sum(
        (c * (a - b) for c, a, b in zip(weights, ahead, behind, strict=True)),
        start=xp.zeros_like(u),
    )


class Group(eqx.Module):
    """Blocks of one shape, stacked. Coefficients have shape (row, column, blocks, 1)."""

    c_pp: jax.Array
    c_pb: jax.Array
    c_bp: jax.Array
    c_bb: jax.Array
    gamma: jax.Array
    weights: tuple[float, ...] = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True)
    with_gradient: bool = eqx.field(static=True)

    @property
    def rotations(self) -> int:
        """Number of rotations in each block."""
        return self.c_pp.shape[0]

    @property
    def adjoint(self) -> Group:
        """The group of Lᵀ."""
        return Group(
            c_pp=self.c_pp.swapaxes(0, 1),
            c_pb=self.c_bp.swapaxes(0, 1),
            c_bp=self.c_pb.swapaxes(0, 1),
            c_bb=self.c_bb.swapaxes(0, 1),
            gamma=self.gamma.swapaxes(0, 1),
            weights=self.weights,
            names=self.names,
            with_gradient=self.with_gradient,
        )

    def apply(self, components: tuple[Component, ...]) -> tuple[Component, ...]:
        """L q of this group's components."""
        phi, B = components[: self.rotations], components[self.rotations :]
        kappa = [difference(f, self.weights, forward=True) for f in phi]
        sigma = [_combine(self.c_pp[i], kappa) - _combine(self.c_pb[i], B) for i in range(len(phi))]
        phi_rate = [difference(s, self.weights, forward=False) for s in sigma]
        B_rate = [-_combine(self.c_bb[i], B) for i in range(len(B))]
        if phi:
            B_rate = [r + _combine(self.c_bp[i], kappa) for i, r in enumerate(B_rate)]
        if self.with_gradient:
            slope = [difference(b, self.weights, forward=False) for b in B]
            moment = [_combine(self.gamma[i], slope) for i in range(len(B))]
            B_rate = [
                r + difference(g, self.weights, forward=True)
                for r, g in zip(B_rate, moment, strict=True)
            ]
        return (*phi_rate, *B_rate)

    def potential(self, components: tuple[Component, ...]) -> jax.Array:
        """−½ Σ q·Lq of this group, its differences summed by parts to save half of them:

        ½ Σ [Dφ·(c_pp Dφ − c_pb B) − B·(c_bp Dφ − c_bb B) + DᵀB·γDᵀB].
        """
        phi, B = components[: self.rotations], components[self.rotations :]
        kappa = [difference(f, self.weights, forward=True) for f in phi]
        pairs = [
            (k, _combine(self.c_pp[i], kappa) - _combine(self.c_pb[i], B))
            for i, k in enumerate(kappa)
        ]
        pairs += [(b, _combine(self.c_bb[i], B)) for i, b in enumerate(B)]
        if phi:
            pairs += [(b, -_combine(self.c_bp[i], kappa)) for i, b in enumerate(B)]
        if self.with_gradient:
            slope = [difference(b, self.weights, forward=False) for b in B]
            pairs += [(g, _combine(self.gamma[i], slope)) for i, g in enumerate(slope)]
        return 0.5 * jnp.sum(sum(a * b for a, b in pairs))


def _combine(row: jax.Array, components: Sequence[jax.Array]) -> Any:
    return sum(row[j] * component for j, component in enumerate(components))


class Operator(eqx.Module):
    """L of all the blocks that are integrated.

    Attributes:
        groups: the blocks, stacked by shape.
        spacing: cell size, scaled.
        cells: number of cells.
    """

    groups: tuple[Group, ...]
    spacing: float = eqx.field(static=True)
    cells: int = eqx.field(static=True)

    def __call__(self, q: State) -> State:
        """L q."""
        return tuple(group.apply(c) for group, c in zip(self.groups, q, strict=True))

    @property
    def adjoint(self) -> Operator:
        """Lᵀ: rows and columns of the coefficients exchanged."""
        return Operator(tuple(g.adjoint for g in self.groups), self.spacing, self.cells)

    def zero(self) -> State:
        """The state of rest."""
        return tuple(
            tuple(jnp.zeros((len(group.names), self.cells)) for _ in range(_size(group)))
            for group in self.groups
        )

    def kinetic(self, v: State) -> jax.Array:
        """Kinetic energy ½⟨v, v⟩, scaled."""
        return 0.5 * inner(v, v) * self.spacing

    def potential(self, q: State) -> jax.Array:
        """−½⟨q, L q⟩: the deformation energy where the closure is symmetric, scaled."""
        parts = [group.potential(c) for group, c in zip(self.groups, q, strict=True)]
        return sum(parts, start=jnp.zeros(())) * self.spacing


def _size(group: Group) -> int:
    return group.c_pp.shape[0] + group.c_bb.shape[0]


def inner(a: Any, b: Any) -> jax.Array:
    """Sum over all entries of a·b of two states."""
    products = jax.tree.map(lambda x, y: jnp.sum(x * y), a, b)
    return jax.tree.reduce(jnp.add, products)


def semi_discrete(
    medium: Medium,
    bar: Bar,
    blocks: Sequence[Block] = BLOCKS,
    reference: Medium | None = None,
) -> Operator:
    """Operator of a medium on a bar.

    Args:
        medium: its parameters may be traced by jax.
        bar: the grid.
        blocks: the blocks to integrate.
        reference: the medium whose units to scale by, of plain numbers; needed where `medium` is
            traced, and the medium itself otherwise.

    Returns:
        The operator, in scaled units.
    """
    spacing = float(bar.spacing / (reference or medium).length_scale)
    weights = tuple(c / spacing for c in difference_weights(bar.order))
    groups = []
    for stacked in grouped(blocks):
        forms = [
            block_coefficients(medium, block, scales(reference or medium)).per_inertia()
            for block in stacked
        ]
        coefficients = {
            name: _stack([getattr(form, name) for form in forms])
            for name in ("c_pp", "c_pb", "c_bp", "c_bb", "gamma")
        }
        groups.append(
            Group(
                **coefficients,
                weights=weights,
                names=tuple(block.name for block in stacked),
                with_gradient=not (isinstance(medium.G_n_g, float | int) and medium.G_n_g == 0),
            )
        )
    return Operator(tuple(groups), spacing, bar.cells)


def _stack(matrices: list[Any]) -> Any:
    """Coefficients of several blocks, (row, column, blocks, 1); numpy where all of them are."""
    traced = any(isinstance(matrix, jax.Array) for matrix in matrices)
    return (jnp if traced else np).stack(matrices, axis=-1)[..., None]


def from_fields(fields: dict[str, Any], blocks: Sequence[Block], medium: Medium) -> State:
    """State (scaled) of fields in SI; fields not named are 0. Inverse of :func:`to_fields`."""
    units = scales(medium)
    shape = np.shape(next(iter(fields.values())))
    state = []
    for stacked in grouped(blocks):
        components = []
        for row in zip(*(b.rotations + b.curvatures for b in stacked), strict=True):
            parts = [
                sum(
                    (w / units.unit(f) * fields[f] for f, w in component.items() if f in fields),
                    start=np.zeros(shape),
                )
                for component in row
            ]
            components.append(jnp.stack([jnp.asarray(p) for p in parts]))
        state.append(tuple(components))
    return tuple(state)


def to_fields(q: State, blocks: Sequence[Block], medium: Medium) -> dict[str, Any]:
    """The fields in SI of a state (or of a stack of states along leading axes).

    Args:
        q: components of shape (…, blocks, N), scaled; numpy or jax.
        blocks: those of the operator.
        medium: that of the operator.

    Returns:
        {field: array of shape (…, N)}, rad or 1/m, of every field the blocks combine.
    """
    units = scales(medium)
    fields: dict[str, Any] = {}
    for components, stacked in zip(q, grouped(blocks), strict=True):
        for s, block in enumerate(stacked):
            parts = block.rotations + block.curvatures
            for component, array in zip(parts, components, strict=True):
                for name, weight in component.items():
                    term = weight * units.unit(name) * array[..., s, :]
                    fields[name] = fields[name] + term if name in fields else term
    ordered = [name for block in blocks for name in block.fields]
    return {name: fields[name] for name in dict.fromkeys(ordered) if name in fields}


def is_rotation(field: str) -> bool:
    """Whether a field lives on the nodes."""
    return field in ROTATIONS
