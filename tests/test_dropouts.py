"""Bursts of bad samples, as of a laser on a rough grain: taken out, and a wave is none."""

from __future__ import annotations

import numpy as np
import pytest

from wavesim.records.of_medium import RecordOfMedium
from wavesim.records.record import Record, record
from wavesim.verdict.record import attenuation, dispersion

DT, D, F0 = 5e-7, 2.5e-3, 4e4
T = np.arange(1500) * DT - 1e-4


def wave(x, peak=F0, speed=700.0, Q=60.0):
    """A Ricker wavelet that goes along x, k = ω/c (1 − i/2Q), exact."""
    f = np.fft.rfftfreq(8 * len(T), DT)
    k = 2 * np.pi * f / speed * (1 - 0.5j / Q)
    sent = (f / peak) ** 2 * np.exp(-((f / peak) ** 2) - 2j * np.pi * f * (1e-4 + 1.5 / peak))
    u = np.fft.irfft(sent[:, None] * np.exp(-1j * k[:, None] * (x + 0.02)), axis=0)[: len(T)]
    return u / np.abs(u).max()


def with_bursts(u, rng, often):
    """Bursts of 4 to 30 samples, each up or down, a few to a receiver."""
    bad = u.copy()
    for j in range(u.shape[1]):
        for _ in range(rng.poisson(often)):
            part = slice(i := int(rng.integers(len(T))), i + int(rng.integers(4, 30)))
            size = bad[part, j].shape
            bad[part, j] = rng.choice([-1, 1], size) * rng.uniform(0.5, 3, size)
    return bad


def told(made: Record) -> list[str]:
    return [found.what for found in made.findings]


@pytest.mark.parametrize("often", [0.3, 1.5])
def test_waves_beside_bursts_of_bad_samples_are_read_within_their_bars(often, rng):
    x = D * np.arange(16)
    u = wave(x) + 0.003 * rng.standard_normal((len(T), len(x)))
    made = record(with_bursts(u, rng, often), T, x)
    (read,) = attenuation([RecordOfMedium("scan", made)])
    own = read.points.take(read.points.valid)
    exact = own.omega / 700.0 * (1 + 0.5j / 60)
    off = np.minimum(np.abs(own.k - exact), np.abs(own.k + exact.conj()))
    (along,) = dispersion([RecordOfMedium("scan", made)])
    seen = along.points.take(along.points.valid)
    assert "dropouts" in told(made)
    assert len(seen.k) >= 25
    assert np.median(np.abs(seen.omega.real / (700.0 * seen.k.real) - 1)) < 0.01
    assert len(own.omega) >= 25
    assert np.mean(off <= own.bar) >= 0.85
    assert np.median(off / np.abs(exact)) < 0.01


@pytest.mark.parametrize("Q", [5.0, 60.0])
def test_a_wave_sampled_too_seldom_at_the_near_receivers_is_no_burst(Q, rng):
    x = D * np.arange(16)
    u = wave(x, peak=0.35 / DT, Q=Q) + 1e-3 * rng.standard_normal((len(T), len(x)))
    assert "dropouts" not in told(record(u, T, x))


def test_bursts_at_all_receivers_at_once_came_from_without(rng):
    x = D * np.arange(16)
    u = wave(x) + 0.003 * rng.standard_normal((len(T), len(x)))
    u[1200:1215] += rng.choice([-1.0, 1.0], (15, 1))
    assert "dropouts" not in told(record(u, T, x))
