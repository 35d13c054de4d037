"""A run as a pure jax function of its media: ``jax.grad`` and ``jax.vmap`` go from the parameters
of every layer through the field to what is recorded of it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.material.layers import Layer, Layers, as_layers
from wavesim.material.medium import PARAMETERS, Medium
from wavesim.simulation.plan import Plan, fastest_loss, highest_band, highest_frequency
from wavesim.timedomain.barequation import BarEquation, BarMotion
from wavesim.timedomain.barseries import series
from wavesim.timedomain.barstep import bar_schedule
from wavesim.timedomain.drives import acting, drives, initial_state
from wavesim.timedomain.expansion import Expansion
from wavesim.timedomain.generator import generator
from wavesim.timedomain.operator import is_rotation, to_fields
from wavesim.timedomain.program import advance
from wavesim.timedomain.timestep import Schedule


class _Recorded(BarEquation):
    """A bar's equation without its energy, seen as a whole or at receivers.

    Attributes:
        nodes, halves: (weights, indices) that interpolate rotations and micro-curvatures at the
            receivers, shape (receivers, points) each; None for the whole field.
    """

    nodes: Any
    halves: Any

    def observe(self, motion: BarMotion) -> Any:
        seen = self.generator.fields(motion.y)
        if self.nodes is None:
            return seen
        made = []
        for group, parts in zip(self.generator.groups, seen, strict=True):
            places = [self.nodes] * group.rotations + [self.halves] * (len(parts) - group.rotations)
            pairs = zip(parts, places, strict=True)
            made.append(tuple(jnp.sum(w * part[:, at], axis=-1) for part, (w, at) in pairs))
        return tuple(made)


def traced_fields(
    layers: Medium | Layers | Sequence[Layer],
    settled: Plan,
    receivers: Sequence[float] | None = None,
) -> dict[str, jax.Array]:
    """The fields of a run as jax arrays, a pure function of the media's parameters.

    Grid, step and degree of the series are settled by a plan for plain numbers. Its media must be
    at least as fast as any that is traced: a step of the series is exact for all frequencies up to
    the highest of the plan, and grows without bound beyond. Layers of plain numbers are held to
    that. Within a trace values are not known, and the caller sees to it: plan for the largest
    stiffnesses and the smallest inertias, and keep to media whose waves do not grow (a question
    with closure "printed" only).

    Losses, absorbers, sources and units are those of the plan. A gradient term that the plan leaves
    out as negligible is kept where a G_n_g is a jax array. Derivatives are of reverse mode
    (diffrax's RecursiveCheckpointAdjoint): ``jax.grad``, ``jax.vjp``, ``jax.jacrev``. Measured on
    bars of 512 and 2,048 cells over 244 and 487 steps, value and gradient take 3.4 to 3.8 times the
    processor time of the run alone, by any number of parameters, and the memory of 60 to 70 states
    where that takes 7; the checkpoints among them grow as the root of the number of steps.

    Args:
        layers: what the bar is made of; parameters of media may be traced. Boundaries, closures
            and loss laws must be those of the plan.
        settled: the plan.
        receivers: positions, m; None for the whole grid.

    Returns:
        {field: shape (frames, receivers) or (frames, points)}, rad or 1/m, at ``settled.times``.

    Raises:
        ValueError: the layers differ from the plan's in more than parameters, a receiver is
            outside the bar, or media of plain numbers are faster than those of the plan.
    """
    given = as_layers(layers, settled.bar.length)
    steps = _schedule(given, settled)
    medium, bar, blocks = settled.medium, settled.bar, settled.blocks
    traced_gradient = any(
        isinstance(one.G_n_g, jax.Array) for layer in given.layers for one in _ends(layer)
    )
    with_gradient = settled.with_gradient or traced_gradient
    A = generator(given, bar, blocks, medium, with_gradient, plain=settled.layers)
    forces = drives(settled.sources, medium, bar, blocks, A)
    places = [_places(bar, receivers, staggered) for staggered in (False, True)]
    equation = _Recorded(A, forces, False, *places)
    motion = equation.start(initial_state(settled.sources, medium, bar, blocks, A))
    ends = [source.spectral_end for source in acting(settled.sources)]
    band = max(ends, default=0.0) * float(medium.time_scale)
    seen, _ = advance(
        equation,
        Expansion(series(steps, band)),
        motion,
        jnp.asarray(0),
        steps.step,
        steps.legs[0],
    )
    first = equation.observe(motion)
    whole = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, seen)
    fields = to_fields(whole, blocks, medium)
    if receivers is None:
        halves = len(bar.half_nodes)
        fields = {n: f if is_rotation(n) else f[:, :halves] for n, f in fields.items()}
    return fields


def _schedule(given: Layers, settled: Plan) -> Schedule:
    """Steps of the series for a plan, checked against what is known of the layers given."""
    bar, blocks, medium = settled.bar, settled.blocks, settled.medium
    planned = settled.layers.layers
    if len(given.layers) != len(planned):
        raise ValueError(f"layers: {len(given.layers)} given for a plan of {len(planned)}")
    known = []
    for number, (layer, plain) in enumerate(zip(given.layers, planned, strict=True), start=1):
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
    most = highest_frequency(settled.layers, bar, blocks, medium)
    here = highest_frequency(Layers(tuple(known)), bar, blocks, medium)
    if here > most * (1 + 1e-9):
        raise ValueError(
            f"layers: their highest frequency is {here / most:.4g} times that of the plan; make "
            "the plan for the fastest media of all"
        )
    unit = float(medium.time_scale)
    loss = fastest_loss(settled.layers, bar, most)
    band = highest_band(settled.sources, medium) * unit
    frames = settled.schedule.frames
    return bar_schedule(most, loss, band, settled.duration / unit, frames, "chebyshev")


def _ends(layer: Layer) -> list[Medium]:
    """The medium of a layer, or both of a graded one."""
    return [layer.medium] + ([] if layer.last is None else [layer.last])


def _plain(layer: Layer) -> Layer | None:
    """A layer with its parameters as floats; None where one of them is traced."""
    made = []
    for medium in _ends(layer):
        values = {name: getattr(medium, name) for name in PARAMETERS}
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
