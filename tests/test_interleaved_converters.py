"""Samples taken in turn by two converters: what differs between them makes no waves.

The law: y = s + (−1)ⁿ (b + ε s − τ ṡ), of which each wave has an image at π/Δt − ω.
"""

from __future__ import annotations

import numpy as np
import pytest

from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
from wavesim.records.faults.interleaved import one_converter
from wavesim.records.record import record

T, X = np.arange(900) * 4e-7, np.arange(48) * 1e-3
K = 2 * np.pi * np.arange(1, 19) / 0.048
OMEGA = 1e6 * np.sin(K * 5e-4)


def ringing(rng, times):
    u = np.zeros((len(times), len(X)))
    for sign in (1, -1):
        wave = np.exp(1j * (sign * np.outer(K, X) + rng.uniform(0, 2 * np.pi, len(K))[:, None]))
        u += (np.exp(-1j * np.outer(times, OMEGA)) @ wave).real
    return u / np.abs(u).max()


@pytest.mark.parametrize(("gain", "level", "late"), [(0.04, 0.02, 0.0), (0.01, 0, 0.1), (0, 0, 0)])
def test_a_ring_has_no_images_of_its_waves(gain, level, late):
    odd = np.arange(len(T)) % 2
    u = ringing(np.random.default_rng(5), T - late * 4e-7 * odd)
    u = u * (1 + gain * odd)[:, None] + level * odd[:, None]
    u += 1e-3 * np.random.default_rng(6).normal(size=u.shape)
    one = record(u, T, X, ring=True)
    assert ("interleaved" in {found.what for found in one.findings}) == bool(gain or late)
    found = in_time(one)
    own = found.take(found.valid)
    assert len(own) == len(K)
    # Half of the delay shifts all times alike, which is no frequency.
    assert np.mean(np.abs(1e6 * np.sin(own.k * 5e-4) - own.omega) <= own.bar) >= 0.85


@pytest.mark.parametrize("part", [0.05, 0.3])
def test_noise_and_short_pulses_have_no_converter_of_their_own(part, rng):
    """Up to the Nyquist frequency: what is broad is not alike in turn."""
    t = np.arange(600.0)
    pulse = np.exp(-(((t[:, None] - 200 - 3 * np.arange(12)) / 2.0) ** 2))
    values = pulse + part * rng.normal(size=(600, 12))
    # … nor has a record that breaks.
    broken = np.delete(pulse, slice(210, 225), axis=0) + 1e-4 * rng.normal(size=(585, 12))
    one_broken = one_converter(broken[None], np.arange(12.0), [""] * 12, [])
    assert np.array_equal(one_broken, broken[None])
    one = record(values, t * 1e-6, np.arange(12) * 5e-3)
    assert "interleaved" not in {found.what for found in one.findings}
