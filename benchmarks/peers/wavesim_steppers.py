"""wavesim through its public Python function, by stepper; the last frame alone or 401 frames."""

from __future__ import annotations

from typing import ClassVar

from contestant import Solution
from leapfrog import least_steps
from problem import Problem

import wavesim as ws
from wavesim.simulation.plan import Plan, plan
from wavesim.timedomain.integration import Timing, stream
from wavesim.timedomain.timestep import Precision

# A run of more steps than this is not made twice just to warm up.
_WARM_STEPS = 50_000


class Peer:
    """The default stepper, at its own step."""

    kind: ClassVar[str] = "none"
    least_steps = 0
    solver: ClassVar[str] = "auto"
    samples: ClassVar[int] = 2
    precision: ClassVar[Precision] = "double"

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def _step(self, setting: float) -> float | None:
        return None

    def _plan(self, setting: float) -> Plan:
        p = self.problem
        step = self._step(setting)
        return plan(
            p.medium, p.bar, p.sources, p.seconds, self.samples, self.solver, step, self.precision
        )

    def warm_up(self, setting: float) -> None:
        self.run(setting)

    def run(self, setting: float) -> Solution:
        p = self.problem
        field = ws.simulate(
            p.medium,
            p.bar,
            p.sources,
            p.seconds,
            self.samples,
            self.solver,
            self._step(setting),
            precision=self.precision,
        )
        products = self._plan(setting).schedule.operator_products
        return Solution({name: field[name][-1] for name in field.names}, products)

    def integration(self, setting: float) -> float:
        """Seconds of a warm run that go into integration and handing out the frames."""
        timing = Timing()
        for _ in stream(self._plan(setting), timing=timing):
            pass
        return timing.integrate


class Frames(Peer):
    samples: ClassVar[int] = 401


class Single(Frames):
    precision: ClassVar[Precision] = "single"


class Chebyshev(Peer):
    solver: ClassVar[str] = "chebyshev"


class Verlet(Peer):
    kind: ClassVar[str] = "steps"
    solver: ClassVar[str] = "verlet"

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.least_steps = least_steps(problem)

    def warm_up(self, setting: float) -> None:
        if setting <= _WARM_STEPS:
            self.run(setting)
        else:
            self.part(setting, _WARM_STEPS // 10)

    def _step(self, setting: float) -> float | None:
        return self.problem.seconds / setting * (1 + 1e-9) if setting else None

    def part(self, setting: float, steps: int) -> None:
        p = self.problem
        seconds = p.seconds * steps / setting
        ws.simulate(p.medium, p.bar, p.sources, seconds, 2, self.solver, self._step(setting))
