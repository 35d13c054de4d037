"""Bars of a decay along a line hold what gains of the receivers make of it, noise or none."""

import numpy as np
from pulses import ricker

from wavesim.readings.dispersion.wavenumber_at_frequency import in_space
from wavesim.records.record import record

T = np.arange(1000) * 5e-7
X = 0.02 + 0.005 * np.arange(3)


def test_gains_of_three_receivers_that_noise_hides_are_held():
    """k = ω/c without loss, gains that scatter by 5 %, noise of 1 % of the peak: what one receiver
    to spare shows of them at one frequency is mostly noise, and by chance may be nothing."""
    omega, held = 2 * np.pi * np.linspace(5e4, 1.5e5, 8), []
    clean = ricker(T[:, None] - X / 3000 - 2e-5, 1e5, 3e-5)
    for seed in range(30):
        rng = np.random.default_rng(seed)
        u = clean * (1 + 0.05 * rng.standard_normal(3))
        points = in_space(record(u + 0.01 * rng.standard_normal(u.shape), T, X), omega)
        own = points.take(points.valid)
        held += [*(np.abs(own.k - own.omega / 3000) <= own.bar)]
    assert len(held) > 100
    assert np.mean(held) >= 0.95
