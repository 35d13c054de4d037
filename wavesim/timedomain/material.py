"""What a bar of layers is made of, point by point: coefficients, inertias and losses on its grid.

A stretch of the grid belongs to each layer, and a layer's medium stands at its own points only, so
that nothing is averaged across an interface but the inertia of the one node there, to which each
side adds its own. A graded layer is sampled at a few Chebyshev points of its grading variable w:
coefficients are polynomials of degree 8 at most in w, which twelve samples give exactly.
Scaled units throughout.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.grid.summation_by_parts import chain
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, Scales, block_coefficients, scales
from wavesim.material.sectors import Block
from wavesim.simulation.plan import absorption

_SAMPLES = 12
_NAMES = tuple(field.name for field in dataclasses.fields(BlockCoefficients))
_PROFILE = 3  # power of the depth by which absorption grows
_CALM = 2.5e-3


class Losses(eqx.Module):
    """What is lost, point by point; shapes (half-nodes,) or (nodes,), scaled.

    Attributes:
        mass_node, mass_half: α.
        stiffness: β_d/m_U at half-nodes.
        rates, strengths: ω_l and Y_l at half-nodes, shape (mechanisms, half-nodes).
        absorb_node, absorb_half: d of the absorbing ends.
        calm_half: what calms B within them.
        damped, absorbing: whether any of the first, or of the last, is there.
    """

    mass_node: Any
    mass_half: Any
    stiffness: Any
    rates: Any
    strengths: Any
    absorb_node: Any
    absorb_half: Any
    calm_half: Any
    damped: bool = eqx.field(static=True)
    absorbing: bool = eqx.field(static=True)

    @property
    def mechanisms(self) -> int:
        """Number of relaxation mechanisms."""
        return int(self.rates.shape[0])


class Profile(eqx.Module):
    """Coefficients of one group of blocks over the grid.

    Attributes:
        c_pp, c_pb, c_bp, c_bb: at half-nodes, the unrelaxed modulus in them, shapes
            (row, column, blocks, half-nodes).
        gamma: Γ at nodes, 0 at the ends of a bar that is not periodic (the natural condition),
            shape (row, column, blocks, nodes).
        m_phi: inertia times length of each node, shape (blocks, nodes).
        i_B: inertia at half-nodes, shape (blocks, half-nodes).
    """

    c_pp: Any
    c_pb: Any
    c_bp: Any
    c_bb: Any
    gamma: Any
    m_phi: Any
    i_B: Any


def _graded(layer: Layer, x: np.ndarray) -> np.ndarray:
    """w at positions within a layer."""
    s = np.clip((x - layer.start) / layer.thickness, 0.0, 1.0)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2) if layer.grading == "smooth" else s)


def _along(layer: Layer, block: Block, units: Scales, x: np.ndarray) -> dict[str, Any]:
    """Coefficients of a block at positions within a layer, {name: (…, positions)}."""
    if layer.last is None:
        alone = _named(layer.medium, block, units)
        return {name: _spread(value, len(x)) for name, value in alone.items()}
    nodes = (1 - np.cos(np.pi * (np.arange(_SAMPLES) + 0.5) / _SAMPLES)) / 2
    straight = dataclasses.replace(layer, grading="linear")
    at = [straight.at(layer.start + w * layer.thickness) for w in nodes]
    if module(*jax.tree.leaves(at)) is np:
        made = [_named(medium, block, units) for medium in at]
        sampled = {name: np.stack([sample[name] for sample in made]) for name in _NAMES}
    else:  # one batch, for a trace a twelfth as long
        batch = jax.tree.map(lambda *v: jnp.stack([jnp.asarray(x, float) for x in v]), *at)
        sampled = jax.vmap(lambda medium: _named(medium, block, units))(batch)
    w = _graded(layer, x)
    basis = np.polynomial.chebyshev.chebvander(2 * w - 1, _SAMPLES - 1) @ np.linalg.inv(
        np.polynomial.chebyshev.chebvander(2 * nodes - 1, _SAMPLES - 1)
    )
    found = {}
    for name, values in sampled.items():
        xp = module(values)
        found[name] = xp.tensordot(xp.moveaxis(values, 0, -1), xp.asarray(basis.T), 1)
    return found


def _named(medium: Medium, block: Block, units: Scales) -> dict[str, Any]:
    made = block_coefficients(medium, block, units)
    return {name: getattr(made, name) for name in _NAMES}


def _spread(value: Any, count: int) -> Any:
    xp = module(value)
    value = xp.asarray(value)
    return xp.broadcast_to(value[..., None], (*value.shape, count))


def profile(
    layers: Layers, bar: Bar, blocks: Sequence[Block], reference: Medium, with_gradient: bool
) -> Profile:
    """Coefficients of blocks of one shape over a bar.

    Args:
        layers: what the bar is made of; parameters may be traced by jax.
        bar: its grid, with a stretch for each layer.
        blocks: as many rotations each.
        reference: the medium whose units to scale by, of plain numbers.
        with_gradient: whether Γ is wanted.

    Returns:
        The coefficients.
    """
    made = [_of_block(layers, bar, block, reference, with_gradient) for block in blocks]
    return Profile(
        **{
            name: module(*(m[name] for m in made)).stack([m[name] for m in made], axis=-2)
            for name in made[0]
        }
    )


def _stretches(layers: Layers, bar: Bar) -> list[tuple[Layer, slice, np.ndarray, np.ndarray]]:
    """Each layer with its cells, the norm of its nodes and their positions, all scaled in m."""
    found, first = [], 0
    stretches = bar.stretches or ((bar.cells, bar.spacing),)
    for layer, (cells, spacing) in zip(layers.layers, stretches, strict=True):
        if bar.uniform and bar.periodic:
            norm = np.full(cells + 1, spacing)
            norm[[0, -1]] /= 2
        else:
            norm = chain(bar.order, (cells,), (spacing,)).node_norm
        x = layer.start + np.arange(cells + 1) * spacing
        found.append((layer, slice(first, first + cells), norm, x))
        first += cells
    return found


def _joined(bar: Bar, values: Any) -> Any:
    """Values at N + 1 nodes, with the last added to the first where the bar is periodic."""
    if not bar.periodic:
        return values
    return values[..., :-1] + values[..., -1:] * np.eye(1, bar.cells)[0]


def _of_block(
    layers: Layers, bar: Bar, block: Block, reference: Medium, with_gradient: bool
) -> dict[str, Any]:
    units = scales(reference)
    length = float(units.length)
    halves: dict[str, list[Any]] = {name: [] for name in ("c_pp", "c_pb", "c_bp", "c_bb", "i_B")}
    b, nodes = len(block.curvatures), bar.cells + 1
    mass: Any = np.zeros(nodes)
    bending: list[Any] = []
    for layer, cells, norm, x in _stretches(layers, bar):
        unrelaxed = layer.medium.damping.unrelaxed
        both = _along(layer, block, units, np.concatenate([(x[1:] + x[:-1]) / 2, x]))
        at_half = {name: values[..., : len(x) - 1] for name, values in both.items()}
        at_node = {name: values[..., len(x) - 1 :] for name, values in both.items()}
        for name, parts in halves.items():
            parts.append(at_half[name] * (1.0 if name == "i_B" else unrelaxed))
        around = (cells.start, nodes - cells.stop - 1)
        mass = mass + _placed(at_node["i_phi"] * (norm / length), around)
        if with_gradient:
            bending.append(at_node["gamma"] * (unrelaxed * length / norm))
    gamma: Any = np.zeros((b, b, len(bar.nodes)))
    if with_gradient:
        gamma = _in_series(bending, bar.periodic) * (bar.differences.node_norm / length)
        if not bar.periodic:
            gamma = gamma * np.concatenate([[0.0], np.ones(nodes - 2), [0.0]])
    joined = {name: module(*parts).concatenate(parts, axis=-1) for name, parts in halves.items()}
    return joined | {"gamma": gamma, "m_phi": _joined(bar, mass)}


def module(*values: Any) -> Any:
    """jax.numpy where jax traces or holds a value, numpy else: plain media cost no compilation."""
    return jnp if any(isinstance(value, jax.Array) for value in values) else np


def _placed(values: Any, around: tuple[int, int]) -> Any:
    """Values with zeros before and after along the last axis."""
    return module(values).pad(values, [(0, 0)] * (values.ndim - 1) + [around])


def _in_series(parts: Sequence[Any], periodic: bool) -> Any:
    """Γ over length at the nodes of a bar, from those of its stretches, (b, b, cells + 1) each.

    Compliances add where stretches meet: Γ ∂ₓB is continuous there, as σ is.
    """
    joined: list[Any] = []
    for number, part in enumerate(parts):
        first = part[..., :1]
        if number or periodic:
            first = _parallel(parts[number - 1][..., -1:], first)
        joined += [first, part[..., 1:-1]]
    if not periodic:
        joined.append(parts[-1][..., -1:])
    return module(*joined).concatenate(joined, axis=-1)


def _parallel(one: Any, other: Any) -> Any:
    """(one⁻¹ + other⁻¹)⁻¹ of symmetric matrices (b, b, 1), as one (one + other)⁺ other.

    So written it holds for singular ones, 0 among them, and stays smooth where their common range
    does not change.
    """
    xp = module(one, other)
    left, right = one[..., 0], other[..., 0]
    return (left @ xp.linalg.pinv(left + right, hermitian=True) @ right)[..., None]


def losses(layers: Layers, bar: Bar, reference: Medium, plain: Layers | None = None) -> Losses:
    """Loss laws and absorbers over a bar.

    The absorbing layer stretches ∂ₓ to ∂ₓ/(1 + d/∂ₜ), d = d₀ (depth/W)³ with d₀ of
    ``plan.absorption``. In a gap, where D(ω²) < 0, such a layer gives energy instead of taking it,
    and a wave caught in a layer next to it, whose tail reaches its end, would grow, by 1e-3 in a
    unit of time at the worst that was found. So deep inside, where no propagating wave comes, B is
    calmed by friction α_B = 2.5e-3 d₀ (depth/W)¹²: growth then is rounding where W is eight branch
    lengths, 1e-8 at four.

    Args:
        layers: what the bar is made of; parameters may be traced by jax.
        bar: its grid.
        reference: the medium whose units to scale by.
        plain: layers of plain numbers, for the absorbers, where the others are traced.
    """
    time = float(scales(reference).time)
    count = max(len(layer.medium.damping.rates) for layer in layers.layers)
    nodes = bar.cells + 1
    weighted: Any = np.zeros(nodes)
    mass: Any = np.zeros(nodes)
    half = {name: np.zeros(bar.cells) for name in ("mass", "stiffness")}
    rates, strengths = np.zeros((count, bar.cells)), np.zeros((count, bar.cells))
    for layer, cells, norm, x in _stretches(layers, bar):
        law = layer.medium.damping
        half["mass"][cells] = law.mass * time
        half["stiffness"][cells] = law.stiffness / time / law.unrelaxed
        for number, (rate, strength) in enumerate(zip(law.rates, law.strengths, strict=True)):
            rates[number, cells], strengths[number, cells] = rate * time, strength
        # Only at the ends of a stretch do others share the node; elsewhere any inertia will do.
        ends = [_rotation_inertia(layer, position) for position in x[[0, -1]]]
        xp = module(*ends)
        at = np.append(np.zeros(len(x) - 1, int), 1)
        inertia = _placed(
            xp.stack([xp.asarray(end) for end in ends])[at] * norm,
            (cells.start, nodes - cells.stop - 1),
        )
        weighted = weighted + law.mass * time * inertia
        mass = mass + inertia
    node = _joined(bar, weighted) / _joined(bar, mass)
    absorbers = [np.zeros(len(bar.nodes)), np.zeros(bar.cells)]
    calm = np.zeros(bar.cells)
    for end in ("left", "right"):
        most = absorption(plain or layers, bar, end) * time
        if most:
            for values, x in zip(absorbers, (bar.nodes, bar.half_nodes), strict=True):
                inward = x if end == "left" else bar.length - x
                depth = np.clip(1 - inward / bar.absorber, 0, 1)
                values += most * depth**_PROFILE
            calm += _CALM * most * depth ** (4 * _PROFILE)
    damped = any(layer.medium.damping for layer in layers.layers)
    absorbing = "absorbing" in (bar.left, bar.right)
    return Losses(
        mass_node=node,
        mass_half=half["mass"],
        stiffness=half["stiffness"],
        rates=rates,
        strengths=strengths,
        absorb_node=absorbers[0],
        absorb_half=absorbers[1],
        calm_half=calm,
        damped=damped,
        absorbing=absorbing,
    )


def _rotation_inertia(layer: Layer, position: float) -> Any:
    medium = layer.at(position)
    return medium.density * medium.beta
