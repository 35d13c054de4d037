"""scipy.sparse.linalg.expm_multiply on the sparse A.

The pulse is over after an eighth of the time. On that stretch it is its own Fourier series, to
rounding, whose harmonics are oscillators appended to A: s = Σ_m a_m cos ω_m t + b_m sin ω_m t.
Two calls give all frames: one with the pulse, one without.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import expm_multiply

# Harmonics to 6.5 times the pulse's peak frequency, where its spectrum is 1e-17 of the peak.
_HIGHEST = 6.5


class Peer:
    """No setting: exact to rounding."""

    def __init__(self, given, setting: float) -> None:
        self.given, self.A = given, given.A
        self.driven = math.ceil(given.quiet_from / given.interval)  # frames
        length = self.driven * given.interval
        count = math.ceil(_HIGHEST * 2 * given.peak * length / (2 * math.pi))
        samples = 4 * count
        t = length / samples * np.arange(samples)
        spectrum = np.fft.rfft(given.signal(t))[: count + 1] / samples
        spectrum[1:] *= 2
        omega = 2 * math.pi / length * np.arange(count + 1)
        # c + id of each harmonic turns as e^{iωt}; s is the sum of all c.
        turning = sp.kron(sp.diags_array(omega), [[0.0, -1.0], [1.0, 0.0]])
        pulls = sp.kron(np.ones((1, count + 1)), [[1.0, 0.0]])
        g = sp.csr_array(given.g[:, None])
        self.appended = sp.block_array([[self.A, g @ pulls], [None, turning]], format="csr")
        self.signal = np.stack([spectrum.real, spectrum.imag], axis=1).ravel()

    def run(self, frames: int) -> np.ndarray:
        given, h, n = self.given, self.given.interval, len(self.given.g)
        made = np.zeros((frames, len(given.fields)))
        last = min(self.driven, frames - 1)
        y = np.concatenate([np.zeros(n), self.signal])
        known = expm_multiply(self.appended, y, 0.0, last * h, last + 1, endpoint=True)[:, :n]
        made[: last + 1] = known[:, given.fields]
        rest = frames - 1 - last
        if rest:
            known = expm_multiply(self.A, known[-1], 0.0, rest * h, rest + 1, endpoint=True)
            made[last:] = known[:, given.fields]
        return made
