"""Sources on a real bar: body moments, surface moments, prescribed rotations, initial fields."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.bar import Bar
from wavesim.medium import Medium
from wavesim.sectors import Block, grouped, scales
from wavesim.timedomain.expansion import Drives, Points
from wavesim.timedomain.generator import Generator, State


def acting(sources: Sequence[Any]) -> list[Any]:
    """The sources that have a signal: all but initial fields."""
    return [source for source in sources if _drive(source) != "initial"]


def _drive(source: Any) -> str:
    return str(getattr(source, "drive", "body"))


def drives(
    sources: Sequence[Any], medium: Medium, bar: Bar, blocks: Sequence[Block], generator: Generator
) -> Drives:
    """Lay sources on the grid of a bar.

    A body moment k on a rotation adds k/m_φ to φ̈ at its points, a double moment Π on B likewise; a
    surface moment is a body moment on the end node, to which the end terms of the difference
    reduce; a prescribed rotation g moves the end node, held fixed otherwise, by g̈.

    Args:
        sources: any kinds; initial fields are left to :func:`initial_state`.
        medium: whose units the generator is scaled by, of plain numbers.
        bar: the grid.
        blocks: those of the generator.
        generator: for the shape and the inertias of its states.
    """
    kept = acting(sources)
    time = float(scales(medium).time)
    lines = [_line(source, medium, bar) for source in kept]
    points = tuple(
        _points(kept, lines, stacked, group)
        for group, stacked in zip(generator.groups, grouped(blocks), strict=True)
    )
    functions = [_signal(source, time) for source in kept]

    def signals(t: jax.Array) -> jax.Array:
        if not functions:
            return jnp.zeros((0, *jnp.shape(t)))
        return jnp.stack([function(t) for function in functions])

    end = max((source.end for source in kept), default=0.0) / time
    return Drives(points, signals, end, any(_drive(s) == "rotation" for s in kept))


def _signal(source: Any, time: float) -> Callable[[jax.Array], jax.Array]:
    def signal(t: jax.Array) -> jax.Array:
        return jnp.asarray(source.signal(t * time))

    if _drive(source) != "rotation":
        return signal

    def rate(t: jax.Array) -> jax.Array:
        return jax.jvp(signal, (t,), (jnp.ones_like(t),))[1]

    return lambda t: jax.jvp(rate, (t,), (jnp.ones_like(t),))[1]


def _line(source: Any, medium: Medium, bar: Bar) -> tuple[np.ndarray, np.ndarray]:
    """Nodes or half-nodes that a source acts on, and its scaled force there."""
    if _drive(source) == "rotation":
        return np.array([0 if source.position < bar.length / 2 else bar.cells]), np.ones(1)
    units = scales(medium)
    density, indices = bar.spread(source.position, source.width, source.staggered)
    norms = bar.differences
    norm = norms.half_norm if source.staggered else norms.node_norm
    unit = float(units.force(source.field) * units.length)
    return indices, density * norm[indices] / unit


def _points(sources: Sequence[Any], lines: Sequence[Any], stacked: Any, group: Any) -> Points:
    """G of all sources on one group."""
    where: list[np.ndarray] = []
    weights = []
    for index, (source, (nodes, force)) in enumerate(zip(sources, lines, strict=True)):
        for b, block in enumerate(stacked):
            for i, component in enumerate(block.rotations + block.curvatures):
                weight = component.get(source.field, 0.0)
                if weight:
                    at = np.full(len(nodes), group.size + i)
                    where.append(np.stack([0 * at + index, at, 0 * at + b, nodes]))
                    held = _drive(source) == "rotation"
                    inertia = 1.0 if held else group.mass[i, b, nodes]
                    weights.append(jnp.asarray(weight * force) / inertia)
    if not where:
        none = np.zeros(0, int)
        return Points(none, none, none, none, jnp.zeros(0))
    number, track, block, node = np.concatenate(where, axis=1)
    return Points(number, track, block, node, jnp.concatenate(weights))


def initial_state(
    sources: Sequence[Any], medium: Medium, bar: Bar, blocks: Sequence[Block], generator: Generator
) -> State:
    """State at t = 0: the initial fields among the sources, and else rest."""
    units = scales(medium)
    state = list(generator.zero())
    for source in sources:
        if _drive(source) != "initial":
            continue
        staggered = source.staggered
        x = bar.half_nodes if staggered else bar.nodes
        distance = x - source.position
        if bar.periodic:
            distance = (distance + bar.length / 2) % bar.length - bar.length / 2
        shape = source.amplitude * np.exp(-((distance / source.width) ** 2) / 2)
        line = np.zeros(len(bar.nodes))
        line[: len(x)] = shape / float(units.unit(source.field))
        for g, (group, stacked) in enumerate(zip(generator.groups, grouped(blocks), strict=True)):
            for b, block in enumerate(stacked):
                for i, component in enumerate(block.rotations + block.curvatures):
                    weight = component.get(source.field, 0.0)
                    held = group.free[b] == 0 if i < group.rotations else False
                    state[g] = state[g].at[i, b].add(jnp.where(held, 0.0, weight * line))
    return tuple(state)
