"""Integration in time, in chunks of frames."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.material.layers import Layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.simulation.field import Energy, Field
from wavesim.simulation.plan import Plan, plan
from wavesim.sources import Source
from wavesim.timedomain.assembly import equation_of, stepper_of
from wavesim.timedomain.operator import is_rotation, to_fields
from wavesim.timedomain.program import observed, program
from wavesim.timedomain.steppers import Motion
from wavesim.timedomain.timestep import Leg, Precision


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
    structure = jax.tree.structure(equation_of(settled)[1])
    return jax.tree.unflatten(structure, [jnp.asarray(array) for array in arrays])


@dataclass
class Timing:
    """Seconds spent; filled in as a run goes."""

    compile: float = 0.0
    integrate: float = 0.0


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
    equation, rest = equation_of(settled)
    frame, motion = start or (0, rest)
    steps = settled.schedule
    end, first = 0, start is None
    # What sees the first frame is compiled beside what makes the others.
    with ThreadPoolExecutor(1) as other:
        seen = other.submit(observed, equation, motion) if first else None
        for leg in steps.legs:
            end += leg.frames
            if frame >= end:
                continue
            stepper = stepper_of(settled, equation, leg)
            last = end == steps.frames - 1
            size = min(settled.chunk, leg.frames if last else end - frame)
            run = _several(settled, leg, size, equation, stepper, motion)
            timing.compile += time.perf_counter() - begun
            if seen is not None:
                yield _chunk(settled, 0, seen.result(), 1, motion)
                seen = None
            while frame < end:
                begun = time.perf_counter()
                if not last and end - frame < size:
                    size = end - frame
                    run = _several(settled, leg, size, equation, stepper, motion)
                at = jnp.asarray(frame * steps.steps_per_frame)
                made, motion = run(motion, at)
                made = jax.tree.map(np.asarray, made)
                # The last chunk of all runs past the end, so that one compiled function serves;
                # of another leg it may not, as the next one goes on from its motion.
                wanted = min(size, end - frame)
                chunk = _chunk(settled, frame + 1, made, wanted, motion)
                timing.integrate += time.perf_counter() - begun
                known = [*chunk.values.values(), chunk.energy.total, chunk.energy.work]
                frame += wanted
                if not all(np.isfinite(values).all() for values in known):
                    raise NotFiniteError(frame * settled.duration / (steps.frames - 1), settled)
                yield chunk
            begun = time.perf_counter()


def _several(settled: Plan, leg: Leg, frames: int, equation: Any, stepper: Any, motion: Any) -> Any:
    """What integrates so many frames of a leg."""
    several = dataclasses.replace(leg, frames=frames)
    return program(equation, stepper, motion, settled.schedule.step, several)


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
