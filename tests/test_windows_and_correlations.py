"""Windows, densities, correlations, envelopes and assignments are those of scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import fft, ndimage, signal
from scipy.optimize import linear_sum_assignment

from wavesim.material.assignment import assigned
from wavesim.readings.pulse.first_break import envelope
from wavesim.records.windows import blackman_harris, fast_length, hann, moving_mean, noise_density
from wavesim.simulation.bandlimited import cross_correlation


@pytest.mark.parametrize("count", [1, 2, 3, 64, 101])
def test_windows_are_sums_of_cosines(count):
    assert np.allclose(hann(count), signal.windows.hann(count), rtol=0, atol=1e-14)
    known = signal.windows.blackmanharris(count)
    assert np.allclose(blackman_harris(count), known, rtol=0, atol=1e-14)


@pytest.mark.parametrize("count", [16, 17, 65, 400])
def test_noise_density_is_welch_s(count, rng):
    noise, dt = rng.normal(size=count), 2e-6
    f, one_sided = signal.welch(noise, 1 / dt, nperseg=max(16, count // 4))
    assert noise_density(noise, dt, f[1:-1]) == pytest.approx(one_sided[1:-1] / 2, rel=1e-12)


@pytest.mark.parametrize("size", [1, 4, 7, 31])
def test_moving_mean_mirrors_the_ends(size, rng):
    u = rng.normal(size=31)
    assert moving_mean(u, size) == pytest.approx(ndimage.uniform_filter1d(u, size), abs=1e-13)


@pytest.mark.parametrize("least", [1, 13, 1024, 7919, 1_299_709])
def test_length_of_a_quick_fft_is_the_next_one(least):
    assert fast_length(least) == fft.next_fast_len(least)


@pytest.mark.parametrize("counts", [(5, 1), (1, 5), (100, 37)])
def test_correlation_is_the_sum_over_samples(counts, rng):
    u, r = (rng.normal(size=count) for count in counts)
    assert cross_correlation(u, r) == pytest.approx(np.correlate(u, r, "full"), abs=1e-13)


def test_envelope_is_that_of_the_analytic_signal(rng):
    u = rng.normal(size=101)
    assert envelope(u) == pytest.approx(np.abs(signal.hilbert(u, 202))[:101], abs=1e-13)


def test_assignment_is_of_least_cost(rng):
    for _ in range(300):
        cost = rng.normal(size=rng.integers(1, 7, 2))
        rows, columns = assigned(cost)
        assert len(rows) == min(cost.shape) == len(set(columns))
        assert (np.diff(rows) > 0).all()
        least = cost[linear_sum_assignment(cost)].sum()
        assert cost[rows, columns].sum() == pytest.approx(least, abs=1e-12)
