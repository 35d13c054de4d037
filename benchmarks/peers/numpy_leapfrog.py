"""Leapfrog in NumPy, L a SciPy sparse matrix: one product and two sums a step."""

from __future__ import annotations

import numpy as np


class Peer:
    """Setting: steps from one frame to the next."""

    def __init__(self, given, setting: float) -> None:
        self.given, self.per_frame = given, int(setting)
        self.L = given.L * (given.interval / self.per_frame) ** 2
        force = given.g[given.rates]
        self.at = np.flatnonzero(force)
        self.strength = force[self.at]

    def run(self, frames: int) -> np.ndarray:
        signal = self.given.driven(self.per_frame, frames)
        q, change = np.zeros(self.L.shape[0]), np.zeros(self.L.shape[0])
        made = np.zeros((frames, len(q)))
        for step in range(self.per_frame * (frames - 1)):
            change += self.L @ q
            if step < len(signal):
                change[self.at] += self.strength * signal[step]
            q += change
            if (step + 1) % self.per_frame == 0:
                made[(step + 1) // self.per_frame] = q
        return made
