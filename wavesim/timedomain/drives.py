"""Sources on a real bar: body moments, surface moments, prescribed rotations, initial fields."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wavesim.bar import Bar
from wavesim.medium import Medium
from wavesim.sectors import Block, grouped, scales
from wavesim.source import InitialField, Source
from wavesim.timedomain.expansion import Drives, Points
from wavesim.timedomain.generator import Generator, Group, State
from wavesim.timedomain.material import module


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
