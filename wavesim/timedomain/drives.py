"""Sources on a real bar: body moments, surface moments, prescribed rotations, initial fields."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.material.sectors import Block, grouped
from wavesim.sources import InitialField, Source
from wavesim.timedomain.generator import Generator
from wavesim.timedomain.group import Group, State
from wavesim.timedomain.material import module


class Points(eqx.Module):
    """Where sources act on one rate of one group: accelerations at points, one entry each.

    Attributes:
        source: which signal, shape (entries,).
        block, node: which point, shape (entries,).
        weight: acceleration there for a signal of 1, shape (entries,).
    """

    source: Any
    block: Any
    node: Any
    weight: Any


class Drives(eqx.Module):
    """The sources: Σ_j G_j s_j(t), as forces on the state.

    Attributes:
        points: G_j, for each group and each of its rates φ̇, Ḃ.
        sources: whose signals are s_j; none of an initial field.
        time: s in one scaled unit of time.
    """

    points: tuple[tuple[Points, ...], ...]
    sources: tuple[Source, ...] = eqx.field(static=True)
    time: float = eqx.field(static=True)

    @property
    def end(self) -> float:
        """Scaled time from which on none acts."""
        return max((source.end for source in self.sources), default=0.0) / self.time

    def signals(self, t: jax.Array) -> jax.Array:
        """s_j at scaled times t of any shape, (sources, *shape of t); g̈ for a rotation g."""
        if not self.sources:
            return jnp.zeros((0, *jnp.shape(t)))
        made = []
        for source in self.sources:
            signal = self._signal(source)
            held = source.drive == "rotation"
            made.append((derivative(derivative(signal)) if held else signal)(t))
        return jnp.stack(made)

    def sampled(self, t: jax.Array, nodes: jax.Array, weights: jax.Array, h: float) -> jax.Array:
        """Signals ŝ_j of the step from t, at its nodes, shape (sources, nodes).

        That of a rotation is g̈ with a linear part added, such that ∫ŝ and ∫∫ŝ over the step are
        the changes of ġ and g: an end follows g where g̈ has kinks or jumps too, and does not drift.
        """
        made = self.signals(t + nodes)
        ends = jnp.asarray(t) + jnp.array([0.0, h])
        for j, source in enumerate(self.sources):
            if source.drive == "rotation":
                signal = self._signal(source)
                g, rate = signal(ends), derivative(signal)(ends)
                mean = (rate[1] - rate[0] - weights @ made[j]) / h
                rest = g[1] - g[0] - h * rate[0] - (weights * (h - nodes)) @ made[j]
                slope = 3 * mean - 6 / h**2 * rest
                made = made.at[j].add(mean + slope * (2 * nodes / h - 1))
        return jnp.where(t < self.end, made, 0.0)

    def _signal(self, source: Source) -> Callable[[jax.Array], jax.Array]:
        return lambda t: jnp.asarray(source.signal(t * self.time))

    def add(self, y: State, amounts: jax.Array) -> State:
        """y + Σ_j G_j amounts_j."""
        made = []
        for points, parts in zip(self.points, y, strict=True):
            new = list(parts)
            for track, p in enumerate(points, start=len(points)):
                if len(p.source):
                    push = p.weight * amounts[p.source]
                    new[track] = new[track].at[p.block, p.node].add(push)
            made.append(tuple(new))
        return tuple(made)

    def read(self, y: State) -> jax.Array:
        """G_jᵀ y, shape (sources,)."""
        total = jnp.zeros(len(self.sources))
        for points, parts in zip(self.points, y, strict=True):
            for track, p in enumerate(points, start=len(points)):
                if len(p.source):
                    total = total.at[p.source].add(p.weight * parts[track][p.block, p.node])
        return total


def derivative(function: Callable[[jax.Array], jax.Array]) -> Callable[[jax.Array], jax.Array]:
    return lambda t: jax.jvp(function, (t,), (jnp.ones_like(t),))[1]


def acting(sources: Sequence[Source]) -> list[Source]:
    """The sources that have a signal: all but initial fields."""
    return [source for source in sources if source.drive != "initial"]


def drives(
    sources: Sequence[Source],
    medium: Medium,
    bar: Bar,
    blocks: Sequence[Block],
    generator: Generator,
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
    return Drives(points, tuple(kept), time)


def _line(source: Source, medium: Medium, bar: Bar) -> tuple[np.ndarray, np.ndarray]:
    """Nodes or half-nodes that a source acts on, and its scaled force there."""
    if source.drive == "rotation":
        return np.array([0 if source.position < bar.length / 2 else bar.cells]), np.ones(1)
    units = scales(medium)
    density, indices = bar.spread(source.position, source.width, source.staggered)
    norms = bar.differences
    norm = norms.half_norm if source.staggered else norms.node_norm
    unit = float(units.force(source.field) * units.length)
    return indices, density * norm[indices] / unit


def _points(
    sources: Sequence[Source], lines: Sequence[Any], stacked: Sequence[Block], group: Group
) -> tuple[Points, ...]:
    """G of all sources on one group, for each of its rates."""
    made = []
    for i in range(group.size):
        where: list[np.ndarray] = [np.zeros((3, 0), int)]
        weights: list[Any] = [np.zeros(0)]
        for index, (source, (nodes, force)) in enumerate(zip(sources, lines, strict=True)):
            for b, block in enumerate(stacked):
                weight = (block.rotations + block.curvatures)[i].get(source.field, 0.0)
                if weight:
                    zero = 0 * nodes
                    where.append(np.stack([zero + index, zero + b, nodes]))
                    held = source.drive == "rotation"
                    inertia = 1.0 if held else group.mass[i, b, nodes]
                    weights.append(weight * force / inertia)
        number, block_, node = np.concatenate(where, axis=1)
        made.append(Points(number, block_, node, module(*weights).concatenate(weights)))
    return tuple(made)


def initial_state(
    sources: Sequence[Source],
    medium: Medium,
    bar: Bar,
    blocks: Sequence[Block],
    generator: Generator,
) -> State:
    """State at t = 0: the initial fields among the sources, and else rest."""
    units = scales(medium)
    state = [list(part) for part in generator.zero()]
    for source in sources:
        if not isinstance(source, InitialField):
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
                    free = group.free[b] != 0 if i < group.rotations else True
                    state[g][i] = state[g][i].at[b].add(weight * line * free)
    return tuple(tuple(part) for part in state)
