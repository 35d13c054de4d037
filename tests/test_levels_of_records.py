"""What instruments add to every channel at once: levels that jump, and lines beside the band.

The law: the pulse of `test_record_faults.py`, k = ω/c exactly, in white noise.
"""

from __future__ import annotations

import numpy as np
import pytest
from test_record_faults import CLEAN, SPEED, N, T, X, along, ricker

from wavesim.records.faults.clipping import tell_processed
from wavesim.records.record import RecordError, record

BEST, _, MANY, _ = along(CLEAN)
GAINS = np.random.default_rng(7).uniform(-1, 1, N)
# Before the wave comes, 18 to 28 µs into the record.
TRIGGER = 12.25e-6


def decay(tau, begin=TRIGGER):
    after = np.maximum(T - begin, 0)
    return np.where(begin <= T, np.exp(-after / tau), 0.0)[:, None]


JUMPS = {
    "returns": 0.7 * decay(1e-4) * np.ones(N),
    "of each its own, in half the record": decay(2.5e-4) * GAINS,
    "long, of each its own": 1.5 * decay(1e-3) * GAINS,
    "stays": 0.5 * decay(np.inf) * GAINS,
    "rises within three frames": decay(1e-4) * (1 - decay(3e-7) * (T >= TRIGGER)[:, None]) * GAINS,
    "before the record begins": decay(1e-4, -2e-5) * GAINS,
}


@pytest.mark.parametrize("bits", [0, 9])
@pytest.mark.parametrize("how", JUMPS)
def test_a_level_that_jumps_and_returns_costs_nothing(how, bits):
    """b + A exp(-(t - t₀)/τ) of known A, τ and t₀ is taken out: k is as without."""
    u = CLEAN + JUMPS[how]
    u = np.round(u * 2**bits) / 2**bits if bits else u
    error, held, many, _ = along(u)
    told = {f.what: f for f in record(u, T, X).findings}
    assert told["level jumps"].done == "cured"
    assert error < 4 * BEST
    assert held >= 0.9
    assert many >= 0.9 * MANY


def test_a_level_that_goes_on_otherwise_is_told_with_a_remedy_that_helps():
    """Of two exponentials; subtracting what the trigger alone makes leaves the pulse."""
    odd = 1.5 * (decay(4e-5) - 0.6 * decay(1.2e-4)) * np.ones(N)
    (told,) = record(CLEAN + odd, T, X).findings[:1]
    assert (told.what, told.done) == ("level jumps", "told")
    assert "subtract" in told.said
    alone = odd + 1e-3 * np.random.default_rng(8).standard_normal(odd.shape)
    error, held, _, _ = along(CLEAN + odd - alone)
    assert error < 4 * BEST
    assert held >= 0.9


def test_a_pulse_on_a_level_is_not_rectified():
    """Troughs that do not come down to rest are none of |u| or u²."""
    t, x = np.arange(3000) * 1e-7, np.array([0.01, 0.02, 0.035, 0.05, 0.07, 0.09])
    pulse = ricker(t[:, None] - 4.5e-5 - x / 1900, 1e5) * np.exp(-5.6 * (x - x[0]))
    noise = 1e-3 * np.random.default_rng(3).standard_normal(pulse.shape)
    level = np.where(t > 4e-5, 0.55 * np.exp(-(t - 4e-5) / 1.5e-4), 0)[:, None]
    nothing = np.zeros(6)
    tell_processed((pulse + level + noise)[None], nothing > 0, nothing, [])
    for rectified in (np.abs(pulse), pulse**2, np.abs(pulse + noise) - noise):
        with pytest.raises(RecordError, match="rectified"):
            tell_processed((rectified + noise)[None], nothing > 0, nothing, [])


def test_a_wave_is_no_level_that_jumps():
    """Steps that pass at c, a receiver after the other, and one that has no wave beside it."""
    late = T[:, None] - 1.5e-5 - (X - X[0]) / SPEED
    step = np.where(late > 0, np.exp(-late / 1e-4), 0) + 1e-3 * (CLEAN - CLEAN.mean(axis=0))
    assert not any(f.what == "level jumps" for f in record(step, T, X).findings)
