"""What a bar is made of, point by point: stiffnesses, inertias and losses on its grid, scaled.

A stretch of the grid belongs to each layer, and a layer's medium stands at its own points only, so
that nothing is averaged across an interface but the inertia of the one node there, to which each
side adds its own. A graded layer is sampled at a few Chebyshev points of its grading variable w:
coefficients are polynomials of degree 8 at most in w, which twelve samples give exactly.

Values at half-nodes stand at the node to their left; on a bar with ends, which has one node more,
the last of them is 0.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.material.family import Block
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium, with_each_class
from wavesim.material.scaling import Scales, block_coefficients, scales
from wavesim.timedomain.absorber import absorption


def _as_pytree(kind: type[Medium]) -> None:
    """A medium is a pytree: jax.grad and jax.vmap go through its parameters.

    jax makes some that hold no numbers: what a caller is held to is not asked of them.
    """
    known = (*kind.declared(), *kind.nested)
    others = tuple(f.name for f in dataclasses.fields(kind) if f.name not in known)
    keys = tuple(jax.tree_util.GetAttrKey(name) for name in known)

    def apart(medium: Medium) -> tuple[list[tuple[Any, Any]], tuple[Any, ...]]:
        values = [(key, getattr(medium, name)) for key, name in zip(keys, known, strict=True)]
        return values, tuple(getattr(medium, name) for name in others)

    def made(said: tuple[Any, ...], values: Iterable[Any]) -> Medium:
        medium = object.__new__(kind)
        for name, value in zip((*known, *others), (*values, *said), strict=True):
            object.__setattr__(medium, name, value)
        return medium

    jax.tree_util.register_pytree_with_keys(kind, apart, made)


with_each_class(_as_pytree)

_SAMPLES = 12


class Coefficients(eqx.Module):
    """Stiffnesses and inertias of blocks of one shape, of p macro- and b micro-fields each.

    Attributes:
        stiffness: C of (σ, τ) = C (κ, B), the unrelaxed modulus in it, at half-nodes, shape
            (p + b, p + b, blocks, points): [[c_pp, −c_pb], [−c_bp, c_bb]].
        gradient: Γ over the length of each node, 0 at the ends of a bar that is not periodic (the
            natural condition), shape (b, b, blocks, points); None where it is left out.
        node_mass: inertia times length of each node, shape (blocks, points).
        inertia: of B at half-nodes, shape (blocks, points).
        macro: p.
    """

    stiffness: Any
    gradient: Any
    node_mass: Any
    inertia: Any
    macro: int = eqx.field(static=True)


def coefficients(
    layers: Layers,
    bar: Bar,
    blocks: Sequence[Block],
    reference: Medium,
    with_gradient: bool,
    sizes: Any = None,
) -> Coefficients:
    """Coefficients of blocks of one shape over a bar.

    Args:
        layers: what the bar is made of; parameters may be traced by jax.
        bar: its grid, with a stretch for each layer.
        blocks: as many macro- and micro-fields each.
        reference: the medium whose units to scale by, of plain numbers.
        with_gradient: whether Γ is wanted.
        sizes: of the cells of each stretch, m, in place of the bar's; may be traced.
    """
    units = scales(reference)
    made = [_of_block(layers, bar, block, units, with_gradient, sizes) for block in blocks]
    stacked = [
        None if parts[0] is None else module(*parts).stack(parts, axis=-2)
        for parts in zip(*made, strict=True)
    ]
    stiffness, gradient, node_mass, inertia = stacked
    return Coefficients(stiffness, gradient, node_mass, inertia, len(blocks[0].macro))


def module(*values: Any) -> Any:
    """jax.numpy where jax traces or holds a value, numpy else: plain media cost no compilation."""
    return jnp if any(isinstance(value, jax.Array) for value in values) else np


def at_half(bar: Bar, values: Any, spare: float = 0.0) -> Any:
    """Values at half-nodes, (…, cells), made as long as the nodes."""
    missing = len(bar.nodes) - bar.cells
    if not missing:
        return values
    around = [(0, 0)] * (values.ndim - 1) + [(0, missing)]
    return module(values).pad(values, around, constant_values=spare)


def node_norm(layers: Layers, bar: Bar, sizes: Any = None) -> Any:
    """Length that each node stands for, m; arguments as of :func:`coefficients`."""
    if sizes is None:
        return bar.differences.node_norm
    parts = [placed(norm, cells, bar) for _, cells, norm, _ in stretches(layers, bar, sizes)]
    return joined(bar, functools.reduce(jnp.add, parts))


def stretched(bar: Bar, sizes: Any = None) -> Any:
    """Size of each cell over that of the bar, as long as the nodes; 1 where sizes are the bar's."""
    if sizes is None:
        return 1.0
    cells, own = zip(*bar.all_stretches, strict=True)
    ratio = jnp.repeat(sizes / np.array(own), np.array(cells), total_repeat_length=bar.cells)
    return at_half(bar, ratio, 1.0)


def _of_block(
    layers: Layers, bar: Bar, block: Block, units: Scales, with_gradient: bool, sizes: Any
) -> tuple[Any, Any, Any, Any]:
    """Stiffness, gradient, node mass and inertia of one block, each (…, points)."""
    length, inner = float(units.length), slice(1, bar.cells)
    stiffness, inertia, bending = [], [], []
    mass: Any = np.zeros(bar.cells + 1)
    for layer, cells, norm, x in stretches(layers, bar, sizes):
        unrelaxed = layer.medium.damping.unrelaxed
        n = len(x) - 1
        c = _along(layer, block, units, np.concatenate([(x[1:] + x[:-1]) / 2, x]))
        c_pp, c_pb, c_bp, c_bb = (c[name][..., :n] for name in ("c_pp", "c_pb", "c_bp", "c_bb"))
        xp = module(c_pp, c_pb, c_bp, c_bb)
        upper = xp.concatenate([c_pp, -c_pb], axis=1)
        lower = xp.concatenate([-c_bp, c_bb], axis=1)
        stiffness.append(xp.concatenate([upper, lower]) * unrelaxed)
        inertia.append(c["i_B"][:n])
        mass = mass + placed(c["i_phi"][n:] * (norm / length), cells, bar)
        bending.append(c["gamma"][..., n:] * (unrelaxed * length / norm))
    gradient: Any = None
    if with_gradient:
        gradient = _in_series(bending, bar.periodic) * (node_norm(layers, bar, sizes) / length)
        if not bar.periodic:
            ends = np.zeros(len(bar.nodes))
            ends[inner] = 1.0
            gradient = gradient * ends
    return (
        at_half(bar, module(*stiffness).concatenate(stiffness, axis=-1)),
        gradient,
        joined(bar, mass),
        at_half(bar, module(*inertia).concatenate(inertia), 1.0),
    )


def _along(layer: Layer, block: Block, units: Scales, x: np.ndarray) -> dict[str, Any]:
    """Coefficients of a block at positions within a layer, {name: (…, positions)}."""

    def named(medium: Medium) -> dict[str, Any]:
        made = block_coefficients(medium, block, units)
        return {field.name: getattr(made, field.name) for field in dataclasses.fields(made)}

    if layer.last is None:
        found = {}
        for name, value in named(layer.medium).items():
            xp = module(value)
            value = xp.asarray(value)
            found[name] = xp.broadcast_to(value[..., None], (*value.shape, len(x)))
        return found
    nodes = (1 - np.cos(np.pi * (np.arange(_SAMPLES) + 0.5) / _SAMPLES)) / 2
    straight = dataclasses.replace(layer, grading="linear")
    at = [straight.at(layer.start + w * layer.thickness) for w in nodes]
    if module(*jax.tree.leaves(at)) is np:
        made = [named(medium) for medium in at]
        sampled = {name: np.stack([sample[name] for sample in made]) for name in made[0]}
    else:  # one batch, for a trace a twelfth as long
        batch = jax.tree.map(lambda *v: jnp.stack([jnp.asarray(one, float) for one in v]), *at)
        sampled = jax.vmap(named)(batch)
    at_x, at_nodes = (
        np.polynomial.chebyshev.chebvander(2 * w - 1, _SAMPLES - 1)
        for w in (layer.weight(x), nodes)
    )
    basis = at_x @ np.linalg.inv(at_nodes)
    return {
        name: module(values).tensordot(values, basis.T, (0, 0)) for name, values in sampled.items()
    }


def stretches(
    layers: Layers, bar: Bar, sizes: Any = None
) -> list[tuple[Layer, slice, Any, np.ndarray]]:
    """Each layer with its cells, the norm of its nodes, and their positions on the bar, m."""
    found, first = [], 0
    each = zip(layers.layers, bar.all_stretches, bar.stretch_norms, strict=True)
    for number, (layer, (cells, spacing), norm) in enumerate(each):
        x = layer.start + np.arange(cells + 1) * spacing
        norm = norm if sizes is None else norm * (sizes[number] / spacing)
        found.append((layer, slice(first, first + cells), norm, x))
        first += cells
    return found


def joined(bar: Bar, values: Any) -> Any:
    """Values at N + 1 nodes, with the last added to the first where the bar is periodic."""
    if not bar.periodic:
        return values
    return values[..., :-1] + values[..., -1:] * np.eye(1, bar.cells)[0]


def placed(values: Any, cells: slice, bar: Bar) -> Any:
    """Values at the nodes of a stretch, (nodes,), among zeros at all others, (cells + 1,)."""
    return module(values).pad(values, (cells.start, bar.cells - cells.stop))


def _in_series(parts: Sequence[Any], periodic: bool) -> Any:
    """Γ over length at the nodes of a bar, from those of its stretches, (b, b, cells + 1) each.

    Compliances add where stretches meet: Γ ∂ₓB is continuous there, as σ is.
    """
    made: list[Any] = []
    for number, part in enumerate(parts):
        first = part[..., :1]
        if number or periodic:
            first = _parallel(parts[number - 1][..., -1:], first)
        made += [first, part[..., 1:-1]]
    if not periodic:
        made.append(parts[-1][..., -1:])
    return module(*made).concatenate(made, axis=-1)


def _parallel(one: Any, other: Any) -> Any:
    """(one⁻¹ + other⁻¹)⁻¹ of symmetric matrices (b, b, 1), as one (one + other)⁺ other.

    So written it holds for singular ones, 0 among them, and stays smooth where their common range
    does not change.
    """
    xp = module(one, other)
    left, right = one[..., 0], other[..., 0]
    return (left @ xp.linalg.pinv(left + right, hermitian=True) @ right)[..., None]


class Losses(eqx.Module):
    """What is lost, point by point, shape (points,) unless it says otherwise.

    Attributes:
        mass_node: α at nodes.
        drag_node, drag_half: α + d on φ̇, α + α_B on Ḃ.
        spring_node: α d on φ.
        stiffness: β_d over the unrelaxed modulus, at half-nodes.
        rates, strengths: ω_l and Y_l of the standard linear solids, at half-nodes, shape
            (mechanisms, points).
        absorb_half: d at half-nodes.
        damped, viscous, absorbing: whether there is a loss law, one with β_d, an absorbing end.
    """

    mass_node: Any
    drag_node: Any
    drag_half: Any
    spring_node: Any
    stiffness: Any
    rates: Any
    strengths: Any
    absorb_half: Any
    damped: bool = eqx.field(static=True)
    viscous: bool = eqx.field(static=True)
    absorbing: bool = eqx.field(static=True)

    @property
    def lossy(self) -> bool:
        """Whether anything is lost."""
        return self.damped or self.absorbing


def losses(
    layers: Layers,
    bar: Bar,
    block: Block,
    reference: Medium,
    plain: Layers | None = None,
    sizes: Any = None,
) -> Losses:
    """Loss laws and absorbers over a bar.

    Args:
        layers: what the bar is made of; parameters may be traced by jax.
        bar: its grid.
        block: one of those that it is for: absorbers and what layers that meet are to it differ by
            family.
        reference: the medium whose units to scale by.
        plain: layers of plain numbers, for the absorbers, where the others are traced.
        sizes: as of :func:`coefficients`; absorbers stay as they are.
    """
    time = float(scales(reference).time)
    layers = layers.mapped(lambda medium: medium.part(block))
    plain = layers if plain is None else plain.mapped(lambda medium: medium.part(block))
    laws = [layer.medium.damping for layer in layers.layers]
    count, points = max(len(law.rates) for law in laws), len(bar.nodes)
    mass_half, stiffness = np.zeros(points), np.zeros(points)
    rates, strengths = np.zeros((count, points)), np.zeros((count, points))
    drag: Any = np.zeros(bar.cells + 1)
    inertia: Any = np.zeros(bar.cells + 1)
    for layer, cells, norm, x in stretches(layers, bar, sizes):
        law = layer.medium.damping
        mass_half[cells] = law.mass * time
        stiffness[cells] = law.stiffness / time / law.unrelaxed
        for number, (rate, strength) in enumerate(zip(law.rates, law.strengths, strict=True)):
            rates[number, cells], strengths[number, cells] = rate * time, strength
        # Only at the ends of a stretch do others share the node; elsewhere any inertia will do.
        ends = [layer.at(position) for position in x[[0, -1]]]
        of_ends = [end.inertias[0] for end in ends]
        at = np.append(np.zeros(len(x) - 1, int), 1)
        xp = module(*of_ends)
        own = placed(xp.stack([xp.asarray(end) for end in of_ends])[at] * norm, cells, bar)
        drag, inertia = drag + law.mass * time * own, inertia + own
    at_node, _ = absorption(plain, bar, bar.nodes)
    inner, calm = absorption(plain, bar, bar.half_nodes)
    mass_node = joined(bar, drag) / joined(bar, inertia)
    return Losses(
        mass_node=mass_node,
        drag_node=mass_node + time * at_node,
        drag_half=mass_half + at_half(bar, time * calm),
        spring_node=mass_node * time * at_node,
        stiffness=stiffness,
        rates=rates,
        strengths=strengths,
        absorb_half=at_half(bar, time * inner),
        damped=any(laws),
        viscous=bool(stiffness.any()),
        absorbing="absorbing" in (bar.left, bar.right),
    )
