"""SciPy's DOP853 on the sparse A."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp


class Peer:
    """Setting: relative and absolute tolerance."""

    def __init__(self, given, setting: float) -> None:
        self.given, self.tolerance = given, setting
        self.A, self.at = given.A, np.flatnonzero(given.g)
        self.strength = given.g[self.at]

    def _rate(self, t: float, y: np.ndarray) -> np.ndarray:
        rate = self.A @ y
        if t < self.given.quiet_from:
            rate[self.at] += self.strength * self.given.signal(t)
        return rate

    def run(self, frames: int) -> np.ndarray:
        t = self.given.interval * np.arange(frames)
        found = solve_ivp(
            self._rate,
            (0.0, t[-1]),
            np.zeros(len(self.given.g)),
            method="DOP853",
            t_eval=t,
            rtol=self.tolerance,
            atol=self.tolerance,
            # From rest nothing else keeps the first steps from passing over the pulse.
            max_step=1.0,
        )
        return found.y[self.given.fields].T
