"""Sources on the grid of a bar: G_j and s_j(t) of ẏ = A y + Σ_j G_j s_j(t), and initial fields.

A body force k on φ adds k/m_φ to φ̈ at its points, a double force Π on B likewise; what loads a free
end is a body force on the end node, to which the end terms of the difference reduce; a prescribed φ
of g moves the end node, held otherwise, by g̈.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.grid.points import gaussian, spread
from wavesim.material.family import Block, grouped, known_field
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales, to_scaled
from wavesim.sources import InitialField, Source
from wavesim.timedomain.coefficients_on_grid import at_half, module
from wavesim.timedomain.operator import Group, Operator, States, held_nodes
from wavesim.timedomain.traced_grid import TracedGrid

# What a signal does not depend on, set alike for all, and its amplitude.
_ALONE: dict[str, Any] = {"position": 0.0, "width": 0.0, "amplitude": 1.0}


class Points(eqx.Module):
    """Where sources act on one kind of field, φ or B, of one group; one entry for each point.

    Attributes:
        source, component, block, point: which, shape (entries,).
        weight: acceleration there for a signal of 1, shape (entries,).
    """

    source: Any
    component: Any
    block: Any
    point: Any
    weight: Any

    def add(self, rate: Any, amounts: Any) -> Any:
        """A rate with Σ_j G_j amounts_j added."""
        if not len(self.source):
            return rate
        where = (self.component, self.block, self.point)
        return jnp.asarray(rate).at[where].add(self.weight * amounts[self.source])

    def read(self, values: Any, count: int) -> Any:
        """G_jᵀ of values at all points, shape (count,)."""
        if not len(self.source):
            return jnp.zeros(count)
        felt = self.weight * values[self.component, self.block, self.point]
        return jnp.zeros(count).at[self.source].add(felt)


class SourceTerms(eqx.Module):
    """Σ_j G_j s_j(t).

    Attributes:
        points: G_j on φ and on B, for each group.
        amplitude: of each source that has a signal, an initial field has none; shape (sources,).
        time: s in one scaled unit of time.
        signals: their signals at amplitude 1, each once; which: of them is each source's.
        turning: sources that prescribe φ at an end, those of one end together: it moves by the sum
            of their signals, and the first stands for the work.
    """

    points: tuple[tuple[Points, Points], ...]
    amplitude: Any
    time: Any
    signals: tuple[Source, ...] = eqx.field(static=True)
    which: tuple[int, ...] = eqx.field(static=True)
    turning: tuple[tuple[int, ...], ...] = eqx.field(static=True)

    @property
    def count(self) -> int:
        """Number of sources."""
        return len(self.which)

    @property
    def end(self) -> Any:
        """Scaled time from which on none acts."""
        return max((signal.end for signal in self.signals), default=0.0) / self.time

    def at(self, t: Any) -> Any:
        """s_j at scaled times t of any shape, (sources, *shape of t); g̈ for a prescribed g."""
        return self._of_each([self._driving(source)(t) for source in self.signals], t)

    def sampled(self, t: Any, nodes: Any, weights: Any, h: Any) -> Any:
        """ŝ_j of the step from t, at its nodes, shape (sources, nodes).

        That of a prescribed g is g̈ with a linear part added, such that ∫ŝ and ∫∫ŝ over the step are
        the changes of ġ and g: an end follows g where g̈ has kinks or jumps too, and does not drift.
        """
        made = []
        for source in self.signals:
            own = self._driving(source)(t + nodes)
            if source.acts == "prescribed":
                signal = self._signal(source)
                ends = jnp.stack([t, t + h])
                g, rate = signal(ends), derivative(signal)(ends)
                mean = (rate[1] - rate[0] - weights @ own) / h
                rest = g[1] - g[0] - h * rate[0] - (weights * (h - nodes)) @ own
                slope = 3 * mean - 6 / h**2 * rest
                own = own + mean + slope * (2 * nodes / h - 1)
            made.append(own)
        return jnp.where(t < self.end, self._of_each(made, nodes), 0.0)

    def _of_each(self, made: list[Any], t: Any) -> Any:
        """Signals of all sources, from those that are held once."""
        if not made:
            return jnp.zeros((0, *jnp.shape(t)))
        amplitude = self.amplitude.reshape(-1, *(1 for _ in jnp.shape(t)))
        return amplitude * jnp.stack(made)[np.array(self.which)]

    def _driving(self, source: Source) -> Callable[[Any], Any]:
        """What drives: a signal, or the second derivative of a prescribed φ."""
        signal = self._signal(source)
        return derivative(derivative(signal)) if source.acts == "prescribed" else signal

    def _signal(self, source: Source) -> Callable[[Any], Any]:
        return lambda t: jnp.asarray(source.signal(t * self.time))

    def add(self, y: States, amounts: Any) -> States:
        """y + Σ_j G_j amounts_j."""
        return tuple(
            part._replace(
                phi_rate=on_phi.add(part.phi_rate, amounts), B_rate=on_B.add(part.B_rate, amounts)
            )
            for part, (on_phi, on_B) in zip(y, self.points, strict=True)
        )

    def read(self, y: Sequence[tuple[Any, Any]]) -> Any:
        """G_jᵀ of (values on φ, values on B) of each group, shape (sources,)."""
        count = self.count
        total = jnp.zeros(count)
        for (phi, B), (on_phi, on_B) in zip(y, self.points, strict=True):
            total = total + on_phi.read(phi, count) + on_B.read(B, count)
        return total


def derivative(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """d/dt of a function of t, at t of any shape."""
    return lambda t: jax.jvp(function, (t,), (jnp.ones_like(t),))[1]


def source_terms(
    sources: Sequence[Source],
    medium: Medium,
    bar: Bar,
    blocks: Sequence[Block],
    A: Operator,
    grid: TracedGrid | None = None,
) -> SourceTerms:
    """Lay sources on the grid of a bar.

    Args:
        sources: any kinds; initial fields are left to :func:`initial_state`.
        medium: whose units the operator is scaled by, of plain numbers.
        bar: the grid.
        blocks: those of the operator.
        A: for the shape, the norms and the inertias of its states.
        grid: the bar with cells of other sizes.
    """
    kept = [source for source in sources if source.acts != "initial"]
    lines = [_line(source, medium, bar, A.groups[0], grid) for source in kept]
    points = tuple(
        (
            _points(kept, lines, [block.macro for block in stacked], group, 0),
            _points(kept, lines, [block.micro for block in stacked], group, 1),
        )
        for group, stacked in zip(A.groups, grouped(blocks), strict=True)
    )
    alone = [
        dataclasses.replace(
            cast(Any, source), field=known_field(source.field).family.macro[0], **_ALONE
        )
        for source in kept
    ]
    signals = list(dict.fromkeys(alone))
    which = tuple(signals.index(one) for one in alone)
    units = scales(medium)
    # What is prescribed is a field: its amplitude is in the field's unit, and G takes it as it is.
    own = [float(units.unit(s.field)) if s.acts == "prescribed" else 1.0 for s in kept]
    amplitude = np.array([source.amplitude for source in kept]) / own
    turned: dict[tuple[str, float], list[int]] = {}
    for j, source in enumerate(kept):
        if source.acts == "prescribed":
            turned.setdefault((source.field, source.position), []).append(j)
    turning = tuple(map(tuple, turned.values()))
    time = np.asarray(float(units.time))
    return SourceTerms(points, amplitude, time, tuple(signals), which, turning)


def _line(
    source: Source, medium: Medium, bar: Bar, group: Group, grid: TracedGrid | None
) -> tuple[Any, Any]:
    """Nodes or half-nodes that a source acts on, and its scaled force there."""
    units = scales(medium)
    end = np.array([0 if source.position < bar.length / 2 else bar.cells])
    if source.acts == "prescribed":
        return end, np.ones(1)
    if grid is not None:
        known = group.half_norm if source.staggered else group.node_norm
        own: Any = end
        force: Any = np.ones(1)
        if source.acts == "body":
            place = source.position, source.width, source.staggered
            force, own = grid.spread(*place, known * float(units.length))
        force = force / float(units.force(source.field) * units.length)
        if not source.staggered:
            force = jnp.where(jnp.asarray(held_nodes(bar))[own], 0.0, force)
        return own, force
    density, indices = spread(bar, source.position, source.width, source.staggered)
    norms = bar.differences
    norm = norms.half_norm if source.staggered else norms.node_norm
    unit = float(units.force(source.field) * units.length)
    force = density * norm[indices] / unit
    if not source.staggered:
        force = np.where(held_nodes(bar)[indices], 0.0, force)  # what holds a node takes it
    return indices, force


def _points(
    sources: Sequence[Source], lines: Sequence[Any], parts: Sequence[Any], group: Group, kind: int
) -> Points:
    """G of all sources on the macro-fields (kind 0) or micro-fields (1) of a group."""
    where: list[Any] = [np.zeros((3, 0), int)]
    points: list[Any] = [np.zeros(0, int)]
    weights: list[Any] = [np.zeros(0)]
    for number, (source, (nodes, force)) in enumerate(zip(sources, lines, strict=True)):
        for b, components in enumerate(parts):
            for i, component in enumerate(components):
                weight = component.get(source.field, 0.0)
                if weight:
                    where.append(np.repeat([[number], [i], [b]], len(nodes), axis=1))
                    points.append(nodes)
                    turning = source.acts == "prescribed"
                    inertia = 1.0 if turning else group.mass[kind][b, nodes]
                    weights.append(weight * force / inertia)
    made = [module(*parts).concatenate(parts) for parts in (points, weights)]
    return Points(*np.concatenate(where, axis=1), *made)


def initial_state(
    sources: Sequence[Source], medium: Medium, bar: Bar, blocks: Sequence[Block], A: Operator
) -> States:
    """State at t = 0: the initial fields among the sources, and else rest."""
    fields: dict[str, Any] = {}
    for source in sources:
        if not isinstance(source, InitialField):
            continue
        x = bar.half_nodes if source.staggered else bar.nodes
        line = np.zeros(len(bar.nodes))
        line[: len(x)] = source.amplitude * gaussian(bar, x, source.position, source.width)
        if not source.staggered:
            line[held_nodes(bar)] = 0.0
        fields[source.field] = fields.get(source.field, 0.0) + line
    if not fields:
        return A.rest
    made, D = [], bar.difference_matrix * float(scales(medium).length)
    for group, (phi, B) in zip(A.groups, to_scaled(fields, blocks, medium), strict=True):
        kappa = at_half(bar, (D @ phi.reshape(-1, phi.shape[-1]).T).T)
        made.append(group.rest._replace(phi=phi, B=B, kappa=kappa.reshape(phi.shape)))
    return tuple(made)
