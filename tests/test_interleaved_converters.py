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


@pytest.mark.parametrize("wave", ["four samples a period", "square", "driven"])
def test_a_signal_about_a_quarter_of_the_sampling_frequency_is_no_image(wave):
    """Law: converters of one board differ by few per cent. A pulse of four samples a period is its
    own image, and the harmonics of a source of an even number of samples a period are each
    other's: they are as large as the signal, or a third, and stay.
    """
    at = np.arange(1024.0)[:, None] - 100 - 7.3 * np.arange(6)
    values = {
        "four samples a period": np.cos(np.pi / 2 * at) * np.exp(-((at / 6) ** 2)),
        "square": np.sign(np.sin(2 * np.pi * at / 16)),
        "driven": np.cos(2 * np.pi * at / 6) + 0.3 * np.cos(4 * np.pi * at / 6 + 1),
    }[wave]
    values = values[None] + 1e-4 * np.random.default_rng(3).normal(size=(1, 1024, 6))
    found = []
    assert np.array_equal(one_converter(values, np.arange(6.0), [""] * 6, found), values)
    assert not found
