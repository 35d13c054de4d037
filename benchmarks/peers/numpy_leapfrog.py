"""Leapfrog in NumPy, L a SciPy sparse matrix."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from contestant import Solution
from leapfrog import forces, least_steps
from problem import COMPONENTS, Problem
from sparse import operator_matrix


class Peer:
    kind: ClassVar[str] = "steps"

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.L = operator_matrix(problem)
        self.least_steps = least_steps(problem)
        cells = problem.bar.cells
        self.at = np.array([d.component * cells + d.cell for d in problem.drives])

    def warm_up(self, setting: float) -> None:
        self.part(setting, 3)

    def run(self, setting: float) -> Solution:
        q = self.part(setting, int(setting))
        return Solution(self.problem.fields(q.reshape(COMPONENTS, -1)), int(setting))

    def part(self, setting: float, steps: int) -> np.ndarray:
        h = self.problem.duration / int(setting)
        L = self.L * h**2
        signal, driven = forces(self.problem, int(setting))
        q, change = np.zeros(L.shape[0]), np.zeros(L.shape[0])
        for n in range(steps):
            change += L @ q
            if n < driven:
                np.add.at(change, self.at, signal[n])
            q += change
        return q
