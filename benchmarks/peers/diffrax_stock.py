"""diffrax's own Tsit5 and Dopri8 on wavesim's operator, adaptive, as fast as they go.

Two settings make them faster than as they come: ``scan_kind="lax"`` runs the stages of a step in a
plain loop rather than a checkpointed one, and ``ForwardMode`` does the same for the steps; both
give up reverse-mode gradients only. ``TsitDefault`` and ``DopriDefault`` leave both as they come.
"""

from __future__ import annotations

from typing import Any, ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from contestant import Solution
from problem import Drive, Problem

from wavesim.material.sectors import BLOCKS, grouped
from wavesim.timedomain.operator import Operator, State, semi_discrete, to_fields
from wavesim.timedomain.steppers import TERM

Phase = tuple[State, State]


class _Waves(eqx.Module):
    """d(q, v)/dt = (v, L q + f), the forces added at their points as long as they act."""

    operator: Operator
    drives: tuple[Drive, ...] = eqx.field(static=True)
    places: tuple[tuple[int, int, int, int], ...] = eqx.field(static=True)
    quiet_from: float = eqx.field(static=True)

    def __call__(self, t: Any, y: Phase) -> Phase:
        q, v = y
        acceleration = self.operator(q)
        driven = jax.lax.cond(
            t < self.quiet_from, lambda: self._driven(t, acceleration), lambda: acceleration
        )
        return v, driven

    def _driven(self, t: Any, acceleration: State) -> State:
        rows = [list(group) for group in acceleration]
        for drive, (group, component, block, cell) in zip(self.drives, self.places, strict=True):
            force = drive.strength * drive.pulse.signal(t * drive.time_scale)
            rows[group][component] = rows[group][component].at[block, cell].add(force)
        return tuple(tuple(group) for group in rows)


def _places(problem: Problem) -> tuple[tuple[int, int, int, int], ...]:
    """Group, component, block and cell in wavesim's state of each drive."""
    order = []
    for group, stacked in enumerate(grouped(BLOCKS)):
        for block, member in enumerate(stacked):
            size = len(member.rotations) + len(member.curvatures)
            order += [(group, component, block) for component in range(size)]
    return tuple((*order[d.component], d.cell) for d in problem.drives)


_MOST_STEPS = 1_000_000


class Peer:
    kind: ClassVar[str] = "tolerance"
    least_steps = 0
    # Evaluations of the vector field in a step, the first being the last of the step before.
    stages: ClassVar[int] = 6
    tuned: ClassVar[bool] = True

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        operator = semi_discrete(problem.without_gradient, problem.bar, BLOCKS)
        self.waves = _Waves(operator, problem.drives, _places(problem), problem.quiet_from)
        self.rest = (operator.zero(), operator.zero())
        self._solve = jax.jit(self._integrate)

    def _solver(self) -> Any:
        return diffrax.Tsit5(scan_kind="lax") if self.tuned else diffrax.Tsit5()

    def _integrate(self, waves: _Waves, rest: Phase, end: Any, tolerance: Any) -> Any:
        found = diffrax.diffeqsolve(
            TERM,
            self._solver(),
            t0=0.0,
            t1=end,
            dt0=1e-2,
            y0=rest,
            args=waves,
            saveat=diffrax.SaveAt(t1=True),
            # From rest nothing bounds the first steps: they must not pass over the pulses.
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance, dtmax=1.0),
            max_steps=_MOST_STEPS,
            adjoint=(diffrax.ForwardMode() if self.tuned else diffrax.RecursiveCheckpointAdjoint()),
        )
        return found.ys, found.stats["num_steps"]

    def _to(self, end: float, tolerance: float) -> Any:
        arguments = jnp.asarray(end), jnp.asarray(tolerance)
        return jax.block_until_ready(self._solve(self.waves, self.rest, *arguments))

    def warm_up(self, setting: float) -> None:
        self._to(0.02, setting)

    def run(self, setting: float) -> Solution:
        (last, _), steps = self._to(self.problem.duration, setting)
        q = jax.tree.map(lambda c: np.asarray(c)[-1], last)
        fields = to_fields(q, BLOCKS, self.problem.medium)
        return Solution(fields, int(steps) * self.stages)


class Dopri8(Peer):
    stages: ClassVar[int] = 13

    def _solver(self) -> Any:
        return diffrax.Dopri8(scan_kind="lax") if self.tuned else diffrax.Dopri8()


class TsitDefault(Peer):
    tuned: ClassVar[bool] = False


class DopriDefault(Dopri8):
    tuned: ClassVar[bool] = False
