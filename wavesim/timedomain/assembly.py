"""The equation and the stepper of a plan: the one place that knows them all."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import diffrax
import jax.numpy as jnp

from wavesim.material.scaling import scales
from wavesim.simulation.plan import Plan
from wavesim.timedomain.barequation import BarEquation
from wavesim.timedomain.barseries import Series, series
from wavesim.timedomain.barwork import work
from wavesim.timedomain.circulant import Driven, Strides, circulant
from wavesim.timedomain.drives import acting, drives, initial_state
from wavesim.timedomain.ends import Ends
from wavesim.timedomain.expansion import Expansion
from wavesim.timedomain.forcing import forcing
from wavesim.timedomain.generator import generator
from wavesim.timedomain.layered import LayeredPropagator, piecewise
from wavesim.timedomain.operator import semi_discrete
from wavesim.timedomain.pieces import cut
from wavesim.timedomain.propagator import Propagator, bar_kernels, block_kernels
from wavesim.timedomain.pushes import pushes
from wavesim.timedomain.response import pulse_tables
from wavesim.timedomain.steppers import (
    Chebyshev,
    Motion,
    Verlet,
    WaveEquation,
    propagator_series,
)
from wavesim.timedomain.timestep import Leg
from wavesim.timedomain.within import Within, within


def equation_of(settled: Plan) -> tuple[Any, Any]:
    """The equation that a plan integrates, and its state at t = 0."""
    medium, bar, blocks = settled.medium, settled.bar, settled.blocks
    if settled.real:
        A = generator(settled.layers, bar, blocks, medium, settled.with_gradient)
        sources = drives(settled.sources, medium, bar, blocks, A)
        start = initial_state(settled.sources, medium, bar, blocks, A)
        equation = BarEquation(A, sources, settled.balanced)
        return equation, equation.start(start)
    operator = semi_discrete(medium, bar, blocks)
    force = forcing(settled.sources, medium, bar, blocks, operator)
    return WaveEquation(operator, force), Motion(operator.zero(), operator.zero(), jnp.zeros(()))


def stepper_of(settled: Plan, equation: Any, leg: Leg | None = None) -> diffrax.AbstractSolver:
    """The stepper of a plan, with all its tables, for its equation and a leg, the first if None."""
    if settled.schedule.shift is not None:
        ends = [source.spectral_end for source in acting(settled.sources)]
        band = max(ends, default=0.0) * float(settled.medium.time_scale)
        made, at = series(settled.schedule, band), (settled.schedule.reach, settled.bar.periodic)
        if settled.schedule.solver == "chebyshev":
            # The compiler works in one thread.
            with ThreadPoolExecutor(1) as other:
                tables = other.submit(work, equation, made, *at)
                losses: Within | Ends | None = None
                if equation.accounted:
                    kinks = math.isinf(band)
                    losses = within(equation, made, *at) if kinks else Ends(made.step)
                return Expansion(made, tables.result(), losses)
        return _layered(settled, equation, made)
    if settled.schedule.solver == "verlet":
        return Verlet()
    steps, leg = settled.schedule, leg or settled.schedule.legs[0]
    known = settled.medium, settled.bar, settled.blocks, steps.step
    if not leg.steps:
        return Strides(circulant(block_kernels(*known), settled.bar.cells, leg.stride))
    pulses = pulse_tables(equation.operator, equation.forcing, steps)
    if steps.solver == "chebyshev":
        return Chebyshev(propagator_series(steps), steps.bound, pulses)
    if not leg.stride:
        return Propagator(bar_kernels(*known, settled.precision), pulses)
    of_groups = block_kernels(*known)
    once, stride = (circulant(of_groups, settled.bar.cells, n) for n in (1, leg.stride))
    return Strides(stride, Driven(once, pulses))


def _layered(settled: Plan, equation: BarEquation, made: Series) -> LayeredPropagator:
    steps, bar = settled.schedule, settled.bar
    length, at = float(scales(settled.medium).length), (steps.reach, bar.periodic)
    with ThreadPoolExecutor(1) as other:
        tables = other.submit(work, equation, made, *at)
        pushed = pushes(equation, made, made.pulses, *at)
        parts = tuple(
            piecewise(cut(settled.layers, bar, group, steps, length))
            for group in equation.generator.groups
        )
        return LayeredPropagator(parts, pushed, made, tables.result())
