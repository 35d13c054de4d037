"""Filters that bend waves are told by the noise that they leave.

The law: pulses that go along a line at c = 3000 m/s; each receiver has white noise of its own.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import median_filter
from test_waves_along_line import passing

from wavesim.records.record import RecordError, record

T = np.arange(800) * 5e-7
RNG = np.random.default_rng(8)


def line(count, noise=1e-2):
    x = 0.02 + 0.005 * np.arange(count)
    u = passing(x, [(lambda w: np.sqrt(w * 3e5) / 3000, lambda r: 1.0)], 5e4, T)
    return x, u + noise * np.abs(u).max() * RNG.normal(size=u.shape)


def of_singular_values(u, many):
    left, size, right = np.linalg.svd(u, full_matrices=False)
    return (left[:, :many] * size[:many]) @ right[:many]


@pytest.mark.parametrize(("count", "many"), [(5, 2), (6, 3), (24, 3)])
@pytest.mark.parametrize("kind", [float, np.float32])
def test_noise_of_fewer_dimensions_than_receivers_is_a_filter_s(count, many, kind):
    x, u = line(count)
    record(u.astype(kind), T, x)
    with pytest.raises(RecordError, match=f"all but {many} singular values"):
        record(of_singular_values(u, many).astype(kind), T, x)


def test_receivers_put_in_between_others_are_no_filter_s():
    x, u = line(9)
    fine = np.linspace(x[0], x[-1], 17)
    record(np.stack([np.interp(fine, x, row) for row in u]), T, fine)


@pytest.mark.parametrize("width", [3, 5])
def test_medians_repeat_their_samples(width):
    x, u = line(6)
    with pytest.raises(RecordError, match="as medians of several"):
        record(median_filter(u, (width, 1)), T, x)


@pytest.mark.parametrize("digits", ["%.2e", "%.3g", "%.5f"])
def test_samples_of_few_digits_repeat_themselves_by_these(digits):
    x, u = line(6)
    record(np.vectorize(lambda v: float(digits % v))(u), T, x)
