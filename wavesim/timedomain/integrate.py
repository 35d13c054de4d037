"""Integration in time by diffrax, in chunks of frames; the only caller of ``diffeqsolve``."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import diffrax
import jax
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.material.family import is_macro
from wavesim.material.layers import Layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales, to_fields
from wavesim.simulation.field import Energy, Field
from wavesim.simulation.simulation import Simulation, check_carried, simulation
from wavesim.sources import Source
from wavesim.timedomain.chebyshev_stepper import ChebyshevSeries, ExactStepper, series
from wavesim.timedomain.compiled import compiled
from wavesim.timedomain.cost import HOUR, check_cost, cost
from wavesim.timedomain.equation import Equation, Motion, Run
from wavesim.timedomain.lossless_propagator import Propagator, propagator
from wavesim.timedomain.operator import operator
from wavesim.timedomain.source_terms import initial_state, source_terms
from wavesim.timedomain.sources_within_step import driven, work
from wavesim.timedomain.time_step import TimeStep, chunk_frames, time_step

_TERM = diffrax.ODETerm(lambda steps, motion, run: run.rate(steps, motion))
# Exact steppers take the equation itself, and diffrax would trace it seven times for its shape.
_NO_TERM = diffrax.ODETerm(lambda steps, motion, run: motion)


class CarryOnError(ValueError):
    """A state that an integration can't be carried on from."""


class NotFiniteError(RuntimeError):
    """The integration produced values that are not finite.

    Attributes:
        time: end of the chunk in which it was found, s.
    """

    def __init__(self, at: float, solver: str, step: float) -> None:
        self.time = at
        exact = solver in ("propagator", "chebyshev")
        remedy = (
            "lower the sources' amplitude, or check the medium's parameters"
            if exact
            else "shorten [time] step or take solver 'chebyshev'"
        )
        super().__init__(
            f"the field is not finite at t = {at:.4g} s (solver {solver!r}, step {step:.4g} s): "
            f"{remedy}"
        )


@dataclass(frozen=True)
class Chunk:
    """Consecutive frames of a run.

    Attributes:
        first: index of the first frame.
        values: {field: (frames, N)}, SI.
        energy: of these frames, J/m².
        state: arrays to carry on from after the last frame; of no use after the last chunk of a
            run, which goes past its end.
    """

    first: int
    values: dict[str, np.ndarray]
    energy: Energy
    state: list[np.ndarray]

    @property
    def count(self) -> int:
        """Number of frames."""
        return len(self.energy.work)


@dataclass
class Timing:
    """Seconds spent; filled in as a run goes."""

    compile: float = 0.0
    integrate: float = 0.0


def equation_of(simulated: Simulation) -> tuple[Equation, Motion]:
    """The equation of a simulation of plain numbers, and its motion at t = 0, scaled."""
    medium, bar, blocks = simulated.medium, simulated.bar, simulated.blocks
    A = operator(simulated.layers, bar, blocks, medium, simulated.with_gradient)
    known = simulated.sources, medium, bar, blocks, A
    return Equation(A, source_terms(*known)), Motion(initial_state(*known), np.zeros(()))


def stepper_of(
    simulated: Simulation, step: TimeStep, equation: Equation, start: Motion
) -> diffrax.AbstractSolver:
    """The stepper of a simulation of plain numbers, with its tables."""
    if step.solver not in ("propagator", "chebyshev"):
        return getattr(diffrax, step.solver)()
    near = driven(equation, step.reach, simulated.bar.periodic)
    if step.solver == "chebyshev":
        return ChebyshevSeries(series(step), work(equation, near, step))
    return propagator(equation, simulated.bar, step, start.y, near)


def advance(
    equation: Any,
    stepper: Any,
    carried: Any,
    at: Any,
    h: Any,
    frames: int,
    per_frame: int,
    adjoint: Any = None,
) -> Any:
    """Integrate some frames from a motion; pure, so that jax transforms go through.

    To diffrax a step is of length 1, and the first begins at 0: plain numbers, of which nothing is
    left to compile.

    Args:
        equation: with what it shows of a motion, ``observe``.
        stepper: a solver of diffrax.
        carried: motion and the stepper's own memory, None at the start of a run.
        at: number of steps taken before.
        h: the step, scaled.
        frames, per_frame: how many frames, of how many steps each.
        adjoint: how diffrax differentiates; None forbids reverse mode.

    Returns:
        What is seen of each frame, and what is carried on.
    """
    motion, memory = carried
    term = _NO_TERM if isinstance(stepper, ExactStepper) else _TERM
    count = frames * per_frame
    run = Run(equation, at, h)
    if memory is None:
        memory = stepper.init(term, 0.0, 1.0, motion, run)
    solution = diffrax.diffeqsolve(
        term,
        stepper,
        t0=0.0,
        t1=float(count),
        dt0=1.0,
        y0=motion,
        args=run,
        saveat=diffrax.SaveAt(
            subs=(
                diffrax.SubSaveAt(steps=per_frame, fn=lambda _, y, run: run.equation.observe(y)),
                diffrax.SubSaveAt(t1=True),
            ),
            solver_state=True,
        ),
        max_steps=count,
        solver_state=memory,
        adjoint=adjoint or diffrax.ForwardMode(),
        throw=False,
    )
    seen, last = solution.ys
    return seen, (jax.tree.map(lambda a: a[-1], last), solution.solver_state)


def stream(
    simulated: Simulation,
    carry_on: tuple[int, Sequence[np.ndarray]] | None = None,
    timing: Timing | None = None,
    meanwhile: Callable[[], object] = lambda: None,
) -> Iterator[Chunk]:
    """Integrate a simulation and give its frames chunk by chunk, that at t = 0 first.

    Args:
        simulated: of plain numbers.
        carry_on: (index of a frame, state after it) of an earlier run; None begins at t = 0.
        timing: where to note the seconds spent.
        meanwhile: called once, when Python has nothing to do until all is compiled.

    Yields:
        Chunks, in order.

    Raises:
        ValueError: the solver is not there, or not for such a bar.
        CarryOnError: the state has other shapes or types than this simulation's.
        NotFiniteError: the integration failed.
    """
    timing = timing or Timing()
    begun = time.perf_counter()
    step = time_step(simulated)
    equation, motion = equation_of(simulated)
    stepper = stepper_of(simulated, step, equation, motion)
    h, last = np.asarray(step.step), step.frames - 1
    size, frame = chunk_frames(simulated), 0
    carried = (motion, _memory(stepper, equation, motion, h))
    if carry_on is not None:
        frame, arrays = carry_on
        alike = [(np.shape(a), np.asarray(a).dtype) for a in arrays]
        if alike != [(np.shape(a), np.asarray(a).dtype) for a in jax.tree.leaves(carried)]:
            raise CarryOnError("the state to carry on from is not of this simulation")
        carried = jax.tree.unflatten(jax.tree.structure(carried), list(arrays))
    known = (equation, stepper, carried, np.asarray(0.0), h)
    settings = {"frames": size, "per_frame": step.per_frame}
    run = compiled(advance, known, meanwhile, isinstance(stepper, Propagator), **settings)
    timing.compile += time.perf_counter() - begun

    def integrated(frame: int, carried: Any) -> Any:
        """What jax is at work on from here on, if there is any more."""
        if frame >= last:
            return None
        return run(equation, stepper, carried, np.asarray(float(frame * step.per_frame)), h)

    ahead = integrated(frame, carried)
    if carry_on is None:
        yield _chunk(simulated, 0, _seen_at_start(equation, motion), 1, carried)
    while frame < last:
        begun = time.perf_counter()
        made, carried = ahead
        wanted = min(size, last - frame)
        # The next chunk is integrated while this one is put into SI, and stored.
        ahead = integrated(frame + wanted, carried)
        chunk = _chunk(simulated, frame + 1, made, wanted, carried)
        timing.integrate += time.perf_counter() - begun
        frame += wanted
        known_ = [*chunk.values.values(), chunk.energy.total, chunk.energy.work]
        if not all(np.isfinite(values).all() for values in known_):
            at = frame * simulated.interval
            raise NotFiniteError(at, step.solver, step.step * float(scales(simulated.medium).time))
        yield chunk


def _memory(stepper: Any, equation: Equation, motion: Motion, h: Any) -> Any:
    """What a stepper keeps beside the motion, at t = 0."""
    run = Run(equation, np.asarray(0.0), h)
    if isinstance(stepper, ExactStepper):
        return stepper.init(_NO_TERM, 0.0, 1.0, motion, run)
    made = jax.eval_shape(functools.partial(stepper.init, _TERM), 0.0, 1.0, motion, run)
    return jax.tree.map(lambda a: np.zeros(a.shape, a.dtype), made)


def _seen_at_start(equation: Equation, motion: Motion) -> Any:
    """What is seen of the first frame, with a first axis of one."""
    if any(np.any(array) for array in jax.tree.leaves(motion)):
        seen = compiled(Equation.observe, (equation, motion))(equation, motion)
    else:
        seen = jax.eval_shape(Equation.observe, equation, motion)
        seen = jax.tree.map(lambda a: np.zeros(a.shape, a.dtype), seen)
    return jax.tree.map(lambda a: np.asarray(a)[None], seen)


def _chunk(simulated: Simulation, first: int, seen: Any, wanted: int, carried: Any) -> Chunk:
    seen = jax.tree.map(lambda a: np.asarray(a)[:wanted], seen)
    pairs, *energies = seen
    unit = float(scales(simulated.medium).energy)
    # A run that has become unstable is reported by its caller, not by warnings.
    with np.errstate(over="ignore", invalid="ignore"):
        energy = Energy(*(unit * part for part in energies))
        values = to_fields(pairs, simulated.blocks, simulated.medium)
    halves = simulated.bar.cells
    kept = {n: values[n] if is_macro(n) else values[n][:, :halves] for n in simulated.fields}
    state = [np.asarray(leaf) for leaf in jax.tree.leaves(carried)]
    return Chunk(first, kept, energy, state)


def integrate(
    simulated: Simulation,
    progress: Callable[[float], None] | None = None,
    timing: Timing | None = None,
    at_most: float = HOUR,
) -> Field:
    """Integrate a simulation and keep the field in memory.

    Args:
        simulated: of plain numbers.
        progress: called with the part done, 0 to 1, after each chunk.
        timing: where to note the seconds spent.
        at_most: longest time that it may be expected to take, s.

    Raises:
        ValueError: as of :func:`stream`; it takes more than that, or more memory than there is.
        NotFiniteError: as of :func:`stream`.
    """
    check_cost(simulated, cost(simulated, time_step(simulated), page=False), at_most)
    chunks = []
    for chunk in stream(simulated, timing=timing):
        chunks.append(chunk)
        if progress is not None:
            progress((chunk.first + chunk.count) / simulated.frames)
    step = time_step(simulated)
    return Field(
        simulation=simulated,
        t=simulated.times,
        values={
            name: np.concatenate([chunk.values[name] for chunk in chunks])
            for name in simulated.fields
        },
        energy=Energy.joined([chunk.energy for chunk in chunks]),
        stepper=step.solver,
        step=step.step * float(scales(simulated.medium).time),
    )


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
    at_most: float = HOUR,
) -> Field:
    """Integrate the wave equations on a bar and keep the field in memory.

    Args:
        medium: what the bar is made of, a medium or layers.
        bar: the grid; of layers, that of ``layered_bar``.
        sources: what drives it, at least one.
        duration: s.
        samples: number of frames, the start among them; None stores twice the sources' band.
        solver: "auto", "propagator", "chebyshev", or an explicit solver of diffrax by its name.
        step: longest step allowed, s; None lets the stepper choose.
        receivers: {name: position in m}.
        progress: called with the part done, 0 to 1, after each chunk.
        timing: where to note the seconds spent.
        at_most: longest time that it may be expected to take, s; one of more is refused.

    Returns:
        The field; only the sectors that the sources set in motion are in it.

    Raises:
        ValueError: a value that can't be used; the message names it.
        NotFiniteError: the integration failed.
    """
    known = medium, bar, sources, duration, samples, receivers, solver, step
    simulated = simulation(*known)
    for number, source in enumerate(simulated.sources):
        try:
            check_carried(source, simulated.layers, bar)
        except ValueError as error:
            raise ValueError(f"sources[{number}]: {error}") from None
    return integrate(simulated, progress, timing, at_most)
