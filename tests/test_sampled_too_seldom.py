"""Waves beyond the Nyquist frequency, seen at 2π/Δt − ω: no wave is said to be there."""

from __future__ import annotations

import numpy as np
import pytest

from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
from wavesim.records.of_medium import RecordOfMedium
from wavesim.records.record import record
from wavesim.verdict.record import attenuation

X = np.arange(48) * 1e-3
NO_CUT_OFF = [lambda k: 2000.0 * k, lambda k: 4e6 * np.sin(5e-4 * k)]


def ring(omega, part, rng, damping=0.0):
    """Waves both ways round a ring, of which the fastest is so many times Nyquist's frequency."""
    k = 2 * np.pi * np.arange(1, 20) / 0.048
    t = np.arange(500) * part * np.pi / omega(k).max()
    u = 1e-3 * rng.normal(size=(len(t), len(X)))
    for sign in (1, -1):
        wave = np.exp(1j * (sign * np.outer(k, X) + rng.uniform(0, 2 * np.pi, len(k))[:, None]))
        u += (np.exp(-1j * np.outer(t, omega(k) - 1j * damping)) @ wave).real / len(k)
    return record(u, t, X, ring=True)


@pytest.mark.parametrize("method", ["harmonic", "fft"])
@pytest.mark.parametrize("omega", NO_CUT_OFF)
@pytest.mark.parametrize("part", [1.15, 1.5, 1.9])
def test_no_branch_turns_back_at_the_nyquist_frequency(method, omega, part, rng):
    """What runs on beyond π/Δt comes down again: that part is refused, the one from k = 0 read."""
    ringing = ring(omega, part, rng)
    found = in_time(ringing, method=method)
    own = found.take(found.valid)
    below = omega(own.k) < np.pi / ringing.interval
    assert np.all(below)
    assert len(own) >= 0.55 * 19 / part
    assert np.mean(np.abs(own.omega - omega(own.k)) <= own.bar) >= 0.85
    assert any("beyond the Nyquist" in reason for reason in found.reason)


@pytest.mark.parametrize("sign", [1, -1])
def test_what_rises_from_a_cut_off_and_what_falls_to_it_look_alike(sign, rng):
    """ω₀ ± bk² about π/Δt: by samples each is the other, so that neither is said to be there."""
    nyquist, k_end = 2e6, 2 * np.pi * 19 / 0.048

    def omega(k):
        return nyquist * (1 - sign * 0.4 + sign * 0.8 * (k / k_end) ** 2)

    found = in_time(ring(omega, omega(np.array([2 * np.pi / 0.048, k_end])).max() / nyquist, rng))
    assert not found.valid.any()
    assert sum("beyond the Nyquist" in reason for reason in found.reason) >= 15


@pytest.mark.parametrize("part", [0.5, 0.9])
@pytest.mark.parametrize("omega", NO_CUT_OFF)
def test_branches_below_the_nyquist_frequency_stay(part, omega, rng):
    found = in_time(ring(omega, part, rng))
    assert found.valid.all()


def test_a_line_sampled_too_seldom_is_told_and_is_the_reason(rng):
    """A pulse of 100 kHz at 16 receivers, 2000 m/s: half of it above Nyquist, as one of 8 below."""
    x = 0.02 + 0.005 * np.arange(16)

    def read_at(per_period):
        t = np.arange(0, 6e-4, 1e-5 / per_period)
        late = (np.pi * 1e5 * (t[:, None] - 6e-5 - x / 2000)) ** 2
        u = (1 - 2 * late) * np.exp(-late) + 2e-3 * rng.normal(size=(len(t), len(x)))
        return attenuation([RecordOfMedium("line", record(u, t, x))])[0]

    told = [f.what for f in read_at(2.2).origin.record.findings]
    assert "sampled too seldom" in told
    reasons = read_at(2.2).points.reason
    assert any("beyond the Nyquist" in reason for reason in reasons)
    assert not any("drive more" in reason for reason in reasons)
    fine = read_at(8.0)
    assert not fine.origin.record.findings
    own = fine.points.take(fine.points.valid)
    assert len(own) >= 15
    assert np.mean(np.abs(own.k - own.omega / 2000) <= own.bar) >= 0.9
