"""wavesim by its Python call, ``ws.simulate``."""

from __future__ import annotations

import numpy as np
from problems import FRAMES, problem

import wavesim as ws
from wavesim.timedomain.integrate import Timing

simulate = ws.simulate


class Default:
    """The default stepper. Its set-up and compilation are within the call, which tells of them."""

    solver = "auto"

    def __init__(self, name: str, setting: float, other: bool) -> None:
        self.arguments = problem(name, other)

    def run(self, frames: int) -> ws.Field:
        medium, bar, sources, seconds = self.arguments
        seconds *= (frames - 1) / (FRAMES - 1)
        timing = Timing()
        field = simulate(medium, bar, sources, seconds, frames, self.solver, timing=timing)
        self.prepared = timing.compile
        return field

    def stacked(self, field: ws.Field) -> np.ndarray:
        """Fields × frames × points, SI."""
        cells = field.bar.cells
        return np.stack([field[name][:, :cells] for name in sorted(field.names)])


class Chebyshev(Default):
    """The series of exp(hA)."""

    solver = "chebyshev"


class Tsit5(Default):
    """diffrax's Tsit5 at its fixed step."""

    solver = "Tsit5"
