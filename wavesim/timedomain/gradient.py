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
from wavesim.grid.points import sampling
from wavesim.grid.stencils import difference_norm
from wavesim.material.family import is_macro
from wavesim.material.layers import Layer, Layers, as_layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales, to_fields
from wavesim.simulation.simulation import Simulation
from wavesim.timedomain.chebyshev_stepper import ChebyshevSeries, series
from wavesim.timedomain.equation import Equation, Motion
from wavesim.timedomain.integrate import advance
from wavesim.timedomain.moments_in_time import signals
from wavesim.timedomain.operator import operator
from wavesim.timedomain.source_terms import initial_state, source_terms
from wavesim.timedomain.time_step import (
    TimeStep,
    bound_matrix,
    closure_factor,
    highest_frequency,
    time_step,
)
from wavesim.timedomain.traced_grid import TracedGrid


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
    thicknesses: Any = None,
    *,
    forward: bool = False,
) -> dict[str, jax.Array]:
    """The fields of a run as jax arrays, a pure function of its media and its layers' thicknesses.

    Grid, step and degree of the series are those of a simulation of plain numbers. Its media must
    be at least as fast as any that is traced, and its layers at most as thick: a series is exact
    for all frequencies up to the highest of the plan, and grows without bound beyond. Layers of
    plain numbers are held to that; what is traced goes unseen, and where it is beyond the plan the
    fields are NaN. Plan for the largest stiffnesses, the smallest inertias and the thinnest layers,
    and keep to media whose waves do not grow (a question with closure "printed" only).

    Losses, absorbers, sources and units are those of the plan, and so are the positions of sources
    and receivers, in m, and the number of cells of each layer. Derivatives are of reverse mode:
    ``jax.grad``, ``jax.vjp``, ``jax.jacrev``. At receivers of a bar without losses the cost is one
    product with L a moment (``chebyshev_moments.py``), under ``jax.vmap`` one product serves all
    members, and a gradient needs no more memory than a value. Else diffrax's
    RecursiveCheckpointAdjoint keeps checkpoints, as many as the root of the number of steps.

    A gradient term that is negligible (a share below 1e-9 of ω²) is left out at receivers, and with
    losses, unless it has a jax array in it.

    Args:
        layers: what the bar is made of; parameters of media may be traced. Boundaries, closures
            and loss laws must be those of the plan.
        planned: the simulation.
        receivers: positions, m; None for the whole grid.
        thicknesses: of the layers, shape (layers,), m, in place of those that they have; may be
            traced.
        forward: whether derivatives are of forward mode, ``jax.jvp`` and ``jax.jacfwd``: for few
            parameters and many values.

    Returns:
        {field: shape (frames, receivers) or (frames, points)}, in its unit, at ``planned.times``.

    Raises:
        ValueError: the layers differ from the plan's in more than parameters, a receiver is
            outside the bar, or media of plain numbers are faster than those of the plan.
    """
    sizes = _sizes(thicknesses, planned)
    if sizes is not None:
        layers = _placed(layers, planned)
    given = as_layers(layers, planned.bar.length)
    step = time_step(dataclasses.replace(planned, solver="chebyshev"))
    _check(given, planned)
    medium, bar, blocks = planned.medium, planned.bar, planned.blocks
    by_moments = receivers is not None and not planned.lossy and not forward
    kept = planned.with_gradient
    if by_moments:
        kept = planned.gradient_felt
    kept = kept or any(
        isinstance(value, jax.Array)
        for layer in given.layers
        for one in layer.ends
        for value in one.of_gradient
    )
    A = operator(given, bar, blocks, medium, kept, planned.layers, sizes)
    grid = None if sizes is None else TracedGrid(bar, sizes)
    terms = source_terms(planned.sources, medium, bar, blocks, A, grid)
    start = initial_state(planned.sources, medium, bar, blocks, A)
    places = [_places(bar, receivers, staggered, grid) for staggered in (False, True)]
    if by_moments:
        initial = any(source.acts == "initial" for source in planned.sources)
        pairs = signals(A, terms, start if initial else None, places, bar, step)
    else:
        pairs = _integrated(_Recorded(A, terms, *places), start, step, forward)
    fields = to_fields(pairs, blocks, medium)
    if receivers is None:
        fields = {n: f if is_macro(n) else f[:, : bar.cells] for n, f in fields.items()}
    fits = _fits(given, planned, sizes)
    return {name: jnp.where(fits, values, jnp.nan) for name, values in fields.items()}


def _integrated(equation: _Recorded, start: Any, step: TimeStep, forward: bool) -> Any:
    """(φ, B) of each group as the series steps them, with a first axis of frames."""
    begun = jax.tree.map(jnp.asarray, Motion(start, 0.0))
    seen, _ = advance(
        equation,
        ChebyshevSeries(series(step)),
        (begun, None),
        0.0,
        step.step,
        step.frames - 1,
        step.per_frame,
        diffrax.ForwardMode() if forward else diffrax.RecursiveCheckpointAdjoint(),
    )
    first = equation.observe(begun)
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, seen)


def _sizes(thicknesses: Any, planned: Simulation) -> Any:
    """Sizes of the cells of each layer, m; None where they are the plan's."""
    if thicknesses is None:
        return None
    cells = np.array([cells for cells, _ in planned.bar.all_stretches])
    if np.shape(thicknesses) != cells.shape:
        raise ValueError(
            f"thicknesses: shape {np.shape(thicknesses)} given for {len(cells)} layers; one for "
            "each, in m"
        )
    if any(source.acts == "initial" for source in planned.sources):
        raise ValueError("thicknesses: not beside initial fields; take a source with a signal")
    return jnp.asarray(thicknesses, float) / cells.astype(float)


def _placed(layers: Medium | Layers | Sequence[Layer], planned: Simulation) -> Any:
    """Layers at the places of the plan's, whatever theirs."""
    if isinstance(layers, Medium):
        return layers
    own = layers.layers if isinstance(layers, Layers) else tuple(layers)
    places = planned.layers.layers
    if len(own) != len(places):
        return layers
    return [
        dataclasses.replace(layer, start=place.start, end=place.end)
        for layer, place in zip(own, places, strict=True)
    ]


def _fits(given: Layers, planned: Simulation, sizes: Any) -> Any:
    """Whether no frequency is above the highest of the plan; True where that is known before."""
    if sizes is None and all(_plain(layer) is not None for layer in given.layers):
        return True
    most = highest_frequency(planned) / closure_factor(planned.bar)
    units, bar = scales(planned.medium), planned.bar
    squares = []
    for number, (layer, (_, spacing)) in enumerate(
        zip(given.layers, bar.all_stretches, strict=True)
    ):
        size = spacing if sizes is None else sizes[number]
        norm = difference_norm(1.0, bar.order) * float(units.length) / size
        for medium in layer.ends:
            for block in planned.blocks:
                matrix = bound_matrix(medium, block, units, norm, jnp)
                squares.append(_largest(jax.lax.stop_gradient(matrix)))
    return jnp.max(jnp.stack(squares)) <= most**2 * 1.0001


def _largest(matrix: Any) -> Any:
    """The spectral radius of a matrix, at most 0.4 % too large: ‖M^128‖^(1/128)."""
    log, power = jnp.zeros(()), matrix
    for doubling in range(7):
        size = jnp.sqrt(jnp.sum(power**2))
        log, power = log + jnp.log(size) / 2**doubling, (power / size) @ (power / size)
    return jnp.exp(log + jnp.log(jnp.sqrt(jnp.sum(power**2))) / 2**7)


def _check(given: Layers, planned: Simulation) -> None:
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
    most = highest_frequency(planned)
    here = highest_frequency(planned, Layers(tuple(known)))
    if here > most * (1 + 1e-9):
        raise ValueError(
            f"layers: their highest frequency is {here / most:.4g} times that of the plan; make "
            "the plan for the fastest media of all"
        )


def _plain(layer: Layer) -> Layer | None:
    """A layer with its parameters as floats; None where one of them is traced."""
    numbers = jax.tree.leaves(layer.ends)
    if any(isinstance(value, jax.core.Tracer) for value in numbers):
        return None
    return layer.mapped(lambda medium: jax.tree.map(float, medium))


def _places(
    bar: Bar, receivers: Sequence[float] | None, staggered: bool, grid: TracedGrid | None
) -> Any:
    """Weights and indices of all receivers; None where the whole field is wanted."""
    if receivers is None:
        return None
    plain = [sampling(bar, x, staggered) for x in receivers]
    if grid is not None:
        traced = [grid.sampling(x, staggered) for x in receivers]
        weights, indices = zip(*traced, strict=True)
        return jnp.stack(weights), jnp.stack(indices)
    width = max(len(weights) for weights, _ in plain)
    padded = [np.pad(np.stack(pair), [(0, 0), (0, width - len(pair[0]))]) for pair in plain]
    return np.array([w for w, _ in padded]), np.array([i for _, i in padded]).astype(int)
