"""Leapfrog in Devito: space order 8 on a staggered grid, double precision.

The stress σ is a function of its own, so that each derivative is one eight-point stencil. B and σ
are kept at index i for the half-node i + ½, and derivatives are taken half a cell ahead or behind.
Two operators share the fields: one with the sources, for as long as they act, and one without.
The halo stays 0: nothing reaches the bar's ends.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from contestant import Solution
from devito import (
    Eq,
    Function,
    Grid,
    Operator,
    SparseTimeFunction,
    TimeFunction,
    configuration,
    solve,
)
from leapfrog import forces, least_steps
from problem import COMPONENTS, ORDER, Problem

configuration["log-level"] = "ERROR"

_MOST_DRIVEN_STEPS = 200_000


class Peer:
    kind: ClassVar[str] = "steps"
    language: ClassVar[str] = "C"

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.least_steps = least_steps(problem)
        cells = problem.bar.cells
        self.grid = Grid((cells,), ((cells - 1) * problem.spacing,), dtype=np.float64)
        self.fields = [
            TimeFunction(name=f"u{i}", grid=self.grid, space_order=ORDER, time_order=2)
            for i in range(COMPONENTS)
        ]
        self.sources = [
            SparseTimeFunction(name=f"s{i}", grid=self.grid, npoint=1, nt=_MOST_DRIVEN_STEPS)
            for i in range(len(problem.drives))
        ]
        options = {"language": self.language}
        self.free = Operator(self._equations(), name="UndrivenSteps", **options)
        self.driven = Operator(
            self._equations() + self._injections(), name="DrivenSteps", **options
        )

    def _equations(self) -> list[Eq]:
        (x,) = self.grid.dimensions
        half = x.spacing / 2
        made, first = [], 0

        def step(u: TimeFunction, acceleration: Any) -> Eq:
            return Eq(u.forward, solve(u.dt2 - acceleration, u.forward))

        for number, form in enumerate(self.problem.forms):
            p, size = len(form.c_pp), len(form.c_pp) + len(form.c_bb)
            rotations, curvatures = (
                self.fields[first : first + p],
                self.fields[first + p : first + size],
            )
            first += size
            row = [-sum(c * b for c, b in zip(line, curvatures, strict=True)) for line in form.c_bb]
            if rotations:
                slope = rotations[0].dx(x0=x + half)
                sigma = Function(name=f"sigma{number}", grid=self.grid, space_order=ORDER)
                pull = sum(c * b for c, b in zip(form.c_pb[0], curvatures, strict=True))
                made.append(Eq(sigma, form.c_pp[0, 0] * slope - pull))
                row = [r + c * slope for r, c in zip(row, form.c_bp[:, 0], strict=True)]
                made.append(step(rotations[0], sigma.dx(x0=x - half)))
            made += [step(b, r) for b, r in zip(curvatures, row, strict=True)]
        return made

    def _injections(self) -> list[Any]:
        made: list[Any] = []
        for source, drive in zip(self.sources, self.problem.drives, strict=True):
            source.coordinates.data[0, 0] = drive.cell * self.problem.spacing
            made += source.inject(field=self.fields[drive.component].forward, expr=source)
        return made

    def warm_up(self, setting: float) -> None:
        self.driven.apply(time_m=0, time_M=1, dt=self.problem.duration / setting)
        self.free.apply(time_m=2, time_M=3, dt=self.problem.duration / setting)

    def run(self, setting: float) -> Solution:
        q = self.part(setting, int(setting))
        return Solution(self.problem.fields(q), int(setting))

    def part(self, setting: float, steps: int) -> np.ndarray:
        h = self.problem.duration / int(setting)
        signal, driven = forces(self.problem, int(setting))
        for field in self.fields:
            field.data_with_halo[:] = 0.0
        for source, values in zip(self.sources, signal.T, strict=True):
            source.data[:driven, 0] = values
        last = min(driven, steps) - 1
        self.driven.apply(time_m=0, time_M=last, dt=h)
        if steps > driven:
            self.free.apply(time_m=driven, time_M=steps - 1, dt=h)
        return np.stack([np.asarray(field.data[steps % 3]) for field in self.fields])


class Threads(Peer):
    """Every loop shared by all cores."""

    language: ClassVar[str] = "openmp"
