"""Gradient of a simulation: a run as a pure jax function of its media.

``jax.grad`` and ``jax.vmap`` go from the parameters of every layer through the field to what is
recorded of it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.material.family import is_macro
from wavesim.material.layers import Layer, Layers, as_layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.simulation.simulation import Simulation
from wavesim.timedomain.chebyshev_stepper import ChebyshevSeries, series
from wavesim.timedomain.equation import Equation, Motion
from wavesim.timedomain.integrate import advance
from wavesim.timedomain.operator import Operator, operator
from wavesim.timedomain.scaled_fields import to_fields
from wavesim.timedomain.source_terms import initial_state, source_terms
from wavesim.timedomain.time_step import TimeStep, highest_frequency, time_step


class _Recorded(Equation):
    """A bar's equation without work and energy, seen as a whole or at receivers.

    Attributes:
        nodes, halves: (weights, indices) that interpolate macro- and micro-fields at the
            receivers, shape (receivers, points) each; None for the whole field.
    """

    nodes: Any
    halves: Any

    def observe(self, motion: Motion) -> Any:
        """(φ, B) of each group at the receivers."""
        seen = [(part.phi, part.B) for part in motion.y]
        if self.nodes is None:
            return seen
        places = (self.nodes, self.halves)
        return [
            tuple(jnp.sum(w * a[..., at], axis=-1) for a, (w, at) in zip(pair, places, strict=True))
            for pair in seen
        ]


def traced_fields(
    layers: Medium | Layers | Sequence[Layer],
    planned: Simulation,
    receivers: Sequence[float] | None = None,
    *,
    law: tuple[Any, Any] | None = None,
    fastest: Layers | None = None,
    forward: bool = False,
) -> dict[str, jax.Array]:
    """The fields of a run as jax arrays, a pure function of the media's parameters.

    Grid, step and degree of the series are those of a simulation of plain numbers. Its media must
    be at least as fast as any that is traced: a step of the series is exact for all frequencies up
    to the highest of the plan, and grows without bound beyond. Layers of plain numbers are held to
    that. Within a trace values are not known, and the caller sees to it: plan for the largest
    stiffnesses and the smallest inertias, and keep to media whose waves do not grow (a question
    with closure "printed" only).

    Losses, absorbers, sources and units are those of the plan, but for what ``law`` says. A
    gradient term that the plan leaves out as negligible is kept where it has a jax array in it.
    Derivatives are of reverse mode (diffrax's RecursiveCheckpointAdjoint): ``jax.grad``,
    ``jax.vjp``, ``jax.jacrev``; the checkpoints in memory grow as the root of the number of steps.
    For few parameters and many values ``forward`` gives ``jax.jvp`` and ``jax.jacfwd`` instead.

    Args:
        layers: what the bar is made of; parameters of media may be traced. Boundaries, closures
            and loss laws must be those of the plan.
        planned: the simulation.
        receivers: positions, m; None for the whole grid.
        law: unrelaxed modulus m_U over the medium's own, –, and strengths Y_l, shape (mechanisms,),
            in place of those of the plan's law, which must be one for all layers; may be traced.
        fastest: layers for which the step is chosen, in place of the plan's.
        forward: whether derivatives are of forward mode.

    Returns:
        {field: shape (frames, receivers) or (frames, points)}, rad or 1/m, at ``planned.times``.

    Raises:
        ValueError: the layers differ from the plan's in more than parameters, a receiver is
            outside the bar, or media of plain numbers are faster than those of the plan.
    """
    given = as_layers(layers, planned.bar.length)
    quickest = planned if fastest is None else dataclasses.replace(planned, layers=fastest)
    _check(given, planned, quickest)
    step = _in_units_of(planned, quickest, time_step(_by_series(quickest)))
    medium, bar, blocks = planned.medium, planned.bar, planned.blocks
    traced_gradient = any(
        isinstance(value, jax.Array)
        for layer in given.layers
        for one in _ends(layer)
        for value in one.of_gradient
    )
    with_gradient = planned.with_gradient or traced_gradient
    A = operator(given, bar, blocks, medium, with_gradient, plain=planned.layers)
    if law is not None:
        A = _under_law(A, planned, *law)
    known = planned.sources, medium, bar, blocks, A
    places = [_places(bar, receivers, staggered) for staggered in (False, True)]
    equation = _Recorded(A, source_terms(*known), *places)
    start = jax.tree.map(jnp.asarray, Motion(initial_state(*known), 0.0))
    seen, _ = advance(
        equation,
        ChebyshevSeries(series(step)),
        (start, None),
        0,
        step.step,
        step.frames - 1,
        step.per_frame,
        diffrax.ForwardMode() if forward else diffrax.RecursiveCheckpointAdjoint(),
    )
    first = equation.observe(start)
    whole = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, seen)
    fields = to_fields(whole, blocks, medium)
    if receivers is None:
        fields = {n: f if is_macro(n) else f[:, : bar.cells] for n, f in fields.items()}
    return fields


def _by_series(planned: Simulation) -> Simulation:
    return dataclasses.replace(planned, solver="chebyshev")


def _in_units_of(planned: Simulation, other: Simulation, step: TimeStep) -> TimeStep:
    """A time step in the scaled time of one simulation, from that of another."""
    ratio = float(scales(other.medium).time) / float(scales(planned.medium).time)
    return dataclasses.replace(
        step, step=step.step * ratio, radius=step.radius / ratio, shift=step.shift / ratio
    )


def _under_law(A: Operator, planned: Simulation, unrelaxed: Any, strengths: Any) -> Operator:
    """The operator with another unrelaxed modulus and other strengths of relaxation."""
    (own, *others) = [layer.medium.damping for layer in planned.layers.layers]
    if any(other != own for other in others) or own.mass or own.stiffness:
        raise ValueError("law: the plan's layers must have one law of relaxations for all")
    factor = unrelaxed / own.unrelaxed
    groups = []
    for group in A.groups:
        c = dataclasses.replace(
            group.c,
            stiffness=group.c.stiffness * factor,
            gradient=None if group.c.gradient is None else group.c.gradient * factor,
        )
        placed = jnp.where(group.losses.strengths > 0, strengths[:, None], 0.0)
        losses = dataclasses.replace(group.losses, strengths=placed)
        groups.append(dataclasses.replace(group, c=c, losses=losses))
    return Operator(tuple(groups))


def _check(given: Layers, planned: Simulation, quickest: Simulation) -> None:
    """Hold layers to those of the plan, as far as their numbers are known."""
    of_plan = planned.layers.layers
    if len(given.layers) != len(of_plan):
        raise ValueError(f"layers: {len(given.layers)} given for a plan of {len(of_plan)}")
    known = []
    for number, (layer, plain) in enumerate(zip(given.layers, of_plan, strict=True), start=1):
        for name in ("start", "end", "grading"):
            if getattr(layer, name) != getattr(plain, name):
                raise ValueError(
                    f"{name} = {getattr(layer, name)} (layer {number}): the plan has "
                    f"{getattr(plain, name)}; only parameters of media may differ"
                )
        for name in ("closure", "damping"):
            if getattr(layer.medium, name) != getattr(plain.medium, name):
                raise ValueError(f"{name} (layer {number}): must be that of the plan's layer")
        known.append(_plain(layer) or plain)
    # Both in Hz: each has the units of its own medium.
    unit = float(scales(planned.medium).time)
    most = highest_frequency(quickest) / float(scales(quickest.medium).time) * unit
    here = highest_frequency(planned, Layers(tuple(known)))
    if here > most * (1 + 1e-9):
        raise ValueError(
            f"layers: their highest frequency is {here / most:.4g} times that of the plan; make "
            "the plan for the fastest media of all"
        )


def _ends(layer: Layer) -> list[Medium]:
    """The medium of a layer, or both of a graded one."""
    return [layer.medium] + ([] if layer.last is None else [layer.last])


def _plain(layer: Layer) -> Layer | None:
    """A layer with its parameters as floats; None where one of them is traced."""
    made = []
    for medium in _ends(layer):
        values = {name: getattr(medium, name) for name in medium.known()}
        if any(isinstance(value, jax.core.Tracer) for value in values.values()):
            return None
        plain: dict[str, Any] = {name: v if v is None else float(v) for name, v in values.items()}
        made.append(dataclasses.replace(medium, **plain))
    return dataclasses.replace(layer, medium=made[0], last=made[1] if made[1:] else None)


def _places(bar: Bar, receivers: Sequence[float] | None, staggered: bool) -> Any:
    """Weights and indices of all receivers; None where the whole field is wanted."""
    if receivers is None:
        return None
    weights, indices = zip(*(bar.sampling(x, staggered) for x in receivers), strict=True)
    return np.stack(weights), np.stack(indices)
