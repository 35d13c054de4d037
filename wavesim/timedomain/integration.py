"""Integration in time: the only caller of ``diffrax.diffeqsolve``, in chunks of frames."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.bar import Bar
from wavesim.field import Energy, Field
from wavesim.layers import Layers
from wavesim.medium import Medium
from wavesim.plan import Plan, plan
from wavesim.sectors import scales
from wavesim.source import Source
from wavesim.timedomain.barequation import BarEquation
from wavesim.timedomain.barseries import Series, series
from wavesim.timedomain.barwork import work
from wavesim.timedomain.drives import acting, drives, initial_state
from wavesim.timedomain.expansion import Expansion
from wavesim.timedomain.forcing import forcing
from wavesim.timedomain.generator import generator
from wavesim.timedomain.layered import LayeredPropagator, piecewise
from wavesim.timedomain.operator import is_rotation, semi_discrete, to_fields
from wavesim.timedomain.pieces import cut
from wavesim.timedomain.propagator import Propagator, bar_kernels
from wavesim.timedomain.pushes import pushes
from wavesim.timedomain.response import pulse_tables
from wavesim.timedomain.steppers import (
    TERM,
    Chebyshev,
    Motion,
    Verlet,
    WaveEquation,
    propagator_series,
)
from wavesim.timedomain.timestep import Precision, Schedule
from wavesim.timedomain.within import within


class NotFiniteError(RuntimeError):
    """The integration produced values that are not finite.

    Attributes:
        time: end of the chunk in which it was found, s.
    """

    def __init__(self, at: float, plan: Plan) -> None:
        self.time = at
        remedy = (
            "shorten [time] step or take solver 'chebyshev'"
            if plan.schedule.solver == "verlet"
            else "lower the sources' amplitude, or check the medium's parameters"
        )
        super().__init__(
            f"the field is not finite at t = {at:.4g} s (solver {plan.schedule.solver!r}, step "
            f"{plan.step:.4g} s): {remedy}"
        )


@dataclass(frozen=True)
class Chunk:
    """Consecutive frames of a run.

    Attributes:
        first: index of the first frame.
        values: {field: (frames, N)}, SI.
        energy: of these frames, J/m².
        motion: scaled state at the last frame, to carry on from; but past it in the last chunk of a
            run, of which a part may not be wanted.
    """

    first: int
    values: dict[str, np.ndarray]
    energy: Energy
    motion: Any

    @property
    def count(self) -> int:
        """Number of frames."""
        return len(self.energy.work)


def pack(motion: Motion) -> list[np.ndarray]:
    """A state as plain arrays, to be stored."""
    return [np.asarray(leaf) for leaf in jax.tree.leaves(motion)]


def unpack(arrays: Sequence[np.ndarray], settled: Plan) -> Any:
    """Inverse of :func:`pack`, for a run of the same plan."""
    structure = jax.tree.structure(_equation(settled)[1])
    return jax.tree.unflatten(structure, [jnp.asarray(array) for array in arrays])


def _equation(settled: Plan) -> tuple[Any, Any]:
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


@dataclass
class Timing:
    """Seconds spent; filled in as a run goes."""

    compile: float = 0.0
    integrate: float = 0.0


def _stepper(settled: Plan, equation: Any) -> diffrax.AbstractSolver:
    if settled.schedule.shift is not None:
        ends = [source.spectral_end for source in acting(settled.sources)]
        band = max(ends, default=0.0) * float(settled.medium.time_scale)
        made, at = series(settled.schedule, band), (settled.schedule.reach, settled.bar.periodic)
        if settled.schedule.solver == "chebyshev":
            # As in _program, the compiler works in one thread.
            with ThreadPoolExecutor(1) as other:
                tables = other.submit(work, equation, made, *at)
                losses = within(equation, made, *at) if equation.accounted else None
                return Expansion(made, tables.result(), losses)
        return _layered(settled, equation, made)
    if settled.schedule.solver == "verlet":
        return Verlet()
    steps = settled.schedule
    pulses = pulse_tables(equation.operator, equation.forcing, steps)
    if steps.solver == "chebyshev":
        return Chebyshev(propagator_series(steps), steps.bound, pulses)
    kernels = bar_kernels(
        settled.medium, settled.bar, settled.blocks, steps.step, settled.precision
    )
    return Propagator(kernels, pulses)


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


def advance(
    equation: Any,
    stepper: Any,
    motion: Any,
    start: jax.Array,
    step: float,
    steps_per_frame: int,
    frames: int,
    stepper_state: Any = None,
    adjoint: Any = None,
) -> Any:
    """Integrate some frames from a state; pure, so that jax transforms go through.

    The stepper's own state, of :func:`prepare`, is made here if it is not given.
    """

    def observe(t: Any, y: Any, args: Any) -> Any:
        return equation.observe(y)

    count = frames * steps_per_frame
    times = (start + jnp.arange(count + 1)).astype(float) * step
    solution = diffrax.diffeqsolve(
        TERM,
        stepper,
        t0=times[0],
        t1=times[-1],
        dt0=None,
        y0=motion,
        args=equation,
        saveat=diffrax.SaveAt(
            subs=(
                diffrax.SubSaveAt(steps=steps_per_frame, fn=observe),
                diffrax.SubSaveAt(t1=True),
            ),
        ),
        stepsize_controller=diffrax.StepTo(ts=times),
        max_steps=count,
        solver_state=stepper_state,
        adjoint=diffrax.RecursiveCheckpointAdjoint() if adjoint is None else adjoint,
    )
    seen, last = solution.ys
    return seen, jax.tree.map(lambda a: a[-1], last)


def prepare(equation: Any, stepper: Any, motion: Any, start: jax.Array, step: float) -> Any:
    """The stepper's own state at a motion.

    It is made anew for each chunk: a run that is carried on from a stored motion is the
    uninterrupted one to the last bit.
    """
    t = jnp.asarray(start).astype(float) * step
    return stepper.init(TERM, t, t + step, motion, equation)


# Compiled functions, by all that they depend on: a second run of one shape compiles nothing.
_COMPILED: dict[Any, Any] = {}


def _compiled(function: Callable[..., Any], arguments: Any, **settings: Any) -> Any:
    """A function compiled for arguments of these shapes and for settings, its keywords."""
    leaves, structure = jax.tree.flatten(arguments)
    shapes = tuple((np.shape(leaf), str(jnp.result_type(leaf))) for leaf in leaves)
    key = (function, structure, shapes, tuple(settings.items()))
    if key not in _COMPILED:
        whole = functools.partial(function, **settings)
        _COMPILED[key] = jax.jit(whole).lower(*arguments).compile()
    return _COMPILED[key]


def _program(equation: Any, stepper: Any, motion: Any, steps: Schedule, frames: int) -> Any:
    """What integrates so many frames from a motion and a number of steps.

    The compiler works in one thread: two functions beside each other take less than one.
    """
    known = (equation, stepper, motion, jnp.asarray(0))
    kept = jax.eval_shape(functools.partial(prepare, step=steps.step), *known)
    counts = {"steps_per_frame": steps.steps_per_frame, "frames": frames}
    with ThreadPoolExecutor(1) as other:
        first = other.submit(_compiled, prepare, known, step=steps.step)
        then = _compiled(_carried, (*known, kept), step=steps.step, **counts)
        begin = first.result()

    def run(motion: Any, at: jax.Array) -> Any:
        return then(equation, stepper, motion, at, begin(equation, stepper, motion, at))

    return run


def _carried(
    equation: Any,
    stepper: Any,
    motion: Any,
    start: jax.Array,
    stepper_state: Any,
    **settings: Any,
) -> Any:
    return advance(equation, stepper, motion, start, stepper_state=stepper_state, **settings)


def stream(
    settled: Plan, start: tuple[int, Any] | None = None, timing: Timing | None = None
) -> Iterator[Chunk]:
    """Integrate a plan and give its frames chunk by chunk, the state of rest at t = 0 first.

    Args:
        settled: the plan.
        start: (frame index, state) to carry on after; None begins at rest.
        timing: where to note the seconds spent.

    Yields:
        Chunks, in order.

    Raises:
        NotFiniteError: the integration failed.
    """
    timing = timing or Timing()
    begun = time.perf_counter()
    equation, rest = _equation(settled)
    stepper = _stepper(settled, equation)
    steps, size = settled.schedule, settled.chunk
    frame, motion = start or (0, rest)
    run = _program(equation, stepper, motion, steps, size)
    timing.compile += time.perf_counter() - begun
    if start is None:
        first = jax.tree.map(lambda a: np.asarray(a)[None], equation.observe(motion))
        yield _chunk(settled, 0, first, 1, motion)
    while frame < steps.frames - 1:
        begun = time.perf_counter()
        at = jnp.asarray(frame * steps.steps_per_frame)
        seen, motion = run(motion, at)
        seen = jax.tree.map(np.asarray, seen)
        # The last chunk runs past the end, so that one compiled function serves all chunks.
        wanted = min(size, steps.frames - 1 - frame)
        chunk = _chunk(settled, frame + 1, seen, wanted, motion)
        timing.integrate += time.perf_counter() - begun
        known = [*chunk.values.values(), chunk.energy.total, chunk.energy.work]
        if not all(np.isfinite(values).all() for values in known):
            raise NotFiniteError((frame + wanted) * settled.duration / (steps.frames - 1), settled)
        yield chunk
        frame += wanted


def _chunk(settled: Plan, first: int, seen: Any, wanted: int, motion: Motion) -> Chunk:
    q, *energies = seen
    q = jax.tree.map(lambda a: np.asarray(a)[:wanted], q)
    unit = float(scales(settled.medium).energy)
    # A run that has become unstable is reported by its caller, not by warnings.
    with np.errstate(over="ignore", invalid="ignore"):
        energy = Energy(*(unit * np.asarray(part)[:wanted] for part in energies))
        values = to_fields(q, settled.blocks, settled.medium)
    halves = len(settled.bar.half_nodes)
    kept = {n: values[n] if is_rotation(n) else values[n][:, :halves] for n in settled.fields}
    kept = {n: part.astype(settled.stored, copy=False) for n, part in kept.items()}
    return Chunk(first, kept, energy, motion)


def simulate(
    medium: Medium | Layers,
    bar: Bar,
    sources: Sequence[Source],
    duration: float,
    samples: int | None = None,
    solver: str = "auto",
    step: float | None = None,
    receivers: Mapping[str, float] | None = None,
    progress: Callable[[float], None] | None = None,
    timing: Timing | None = None,
    precision: Precision = "double",
) -> Field:
    """Integrate the wave equations on a bar from rest and keep the field in memory.

    Args:
        medium: what the bar is made of, a medium or layers.
        bar: the grid; of layers, that of ``layered_bar``.
        sources: pulses that drive it, at least one.
        duration: s.
        samples: number of frames, the start among them; None stores twice the sources' band.
        solver: "auto", "chebyshev" or "verlet".
        step: longest step allowed, s; None lets the stepper choose.
        receivers: {name: position in m}.
        progress: called with the part done, 0 to 1, after each chunk.
        timing: where to note the seconds spent.
        precision: "double", or "single" where solver "propagator" serves: products of steps and
            the field in float32.

    Returns:
        The field; only the sectors that the sources set in motion are in it.

    Raises:
        ValueError: a value that can't be used; the message names it.
        NotFiniteError: the integration failed.
    """
    settled = plan(medium, bar, sources, duration, samples, solver, step, precision)
    chunks = []
    for chunk in stream(settled, timing=timing):
        chunks.append(chunk)
        if progress is not None:
            progress((chunk.first + chunk.count) / settled.schedule.frames)
    return Field(
        t=settled.times,
        values={
            name: np.concatenate([chunk.values[name] for chunk in chunks])
            for name in settled.fields
        },
        medium=settled.medium,
        bar=bar,
        sources=settled.sources,
        receivers=dict(receivers or {}),
        energy=Energy(
            *(
                np.concatenate([getattr(chunk.energy, part) for chunk in chunks])
                for part in chunks[0].energy.parts
            )
        ),
        stepper=settled.schedule.solver,
        step=settled.step,
        layers=settled.layers,
        precision=settled.precision,
    )
