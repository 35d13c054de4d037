"""SciPy's DOP853 on the first-order system, L one assembled sparse matrix."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from contestant import Solution
from problem import COMPONENTS, Problem
from scipy.integrate import solve_ivp
from sparse import operator_matrix


class Peer:
    kind: ClassVar[str] = "tolerance"
    least_steps = 0

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.L = operator_matrix(problem)
        self.size = COMPONENTS * problem.bar.cells
        cells = problem.bar.cells
        self.at = [self.size + d.component * cells + d.cell for d in problem.drives]
        self.rate = np.empty(2 * self.size)

    def _rate(self, t: float, y: np.ndarray) -> np.ndarray:
        rate = np.empty(2 * self.size)
        rate[: self.size] = y[self.size :]
        rate[self.size :] = self.L @ y[: self.size]
        if t < self.problem.quiet_from:
            for at, drive in zip(self.at, self.problem.drives, strict=True):
                rate[at] += drive.strength * drive.signal(t)
        return rate

    def warm_up(self, setting: float) -> None:
        self._rate(0.0, np.zeros(2 * self.size))

    def run(self, setting: float) -> Solution:
        found = solve_ivp(
            self._rate,
            (0.0, self.problem.duration),
            np.zeros(2 * self.size),
            method="DOP853",
            t_eval=[self.problem.duration],
            rtol=setting,
            atol=setting,
            # From rest nothing bounds the first steps: they must not pass over the pulses.
            max_step=1.0,
        )
        q = found.y[: self.size, -1].reshape(COMPONENTS, -1)
        return Solution(self.problem.fields(q), int(found.nfev))
