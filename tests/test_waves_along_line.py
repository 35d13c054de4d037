"""Modes of a line that waves leave: phases along it, whatever amplitudes do."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
from wavesim.readings.dispersion.noise_level import noise_variance
from wavesim.readings.dispersion.wavenumber_at_frequency import in_space
from wavesim.records.fitness import for_frequency_at_k
from wavesim.records.record import RecordError, record

T = np.arange(500) * 1e-6


def passing(x, waves, f0=4e4, t=T):
    """Pulses sent through U = S(ω) Σ A(x) e^{ikx}: each wave is (k(ω), A(x))."""
    n = 8 * len(t)
    arg = (np.pi * f0 * (np.arange(n) * (t[1] - t[0]) - 1.5 / f0)) ** 2
    spectrum = np.fft.rfft((1 - 2 * arg) * np.exp(-arg))
    omega = 2 * np.pi * np.fft.rfftfreq(n, t[1] - t[0])
    columns = []
    for place in x:
        U = sum(amplitude(place) * np.exp(1j * k(omega) * place) for k, amplitude in waves)
        columns.append(np.fft.irfft(spectrum * np.conj(U), n)[: len(t)])
    u = np.stack(columns, axis=1)
    return u / np.abs(u).max()


def read(u, x, **more):
    points = in_time(record(u, T, x, **more), method="auto")
    return points, points.take(points.valid)


def one(x):
    return 1.0 + 0 * x


def dispersive(omega):
    """c from 2000 to 2300 m/s."""
    return omega / (2000 + 300 / (1 + (omega / 3e5) ** 2))


def test_a_clean_pulse_is_one_mode_and_no_side_lobe():
    """ω(k) of a dispersive wave, even receivers or not: what is off is what the record's end cuts
    off, measured 2e-6 and 2e-5 at most."""
    for x in (0.02 + 0.005 * np.arange(48), np.sort(0.2 * np.random.default_rng(1).random(40))):
        points, own = read(passing(x, [(dispersive, one)]), x)
        assert len(points.branches) == 1
        assert len(own) > 30
        off = np.abs(own.k - dispersive(own.omega))
        assert (off / own.k).max() < 1e-4
        assert (off <= own.k_error * 1.96).mean() > 0.9


@pytest.mark.parametrize("frames", [slice(60, 500), slice(120), slice(60, 140)])
def test_a_record_cut_inside_its_pulse_has_no_waves_but_the_pulse_s(frames):
    """Its edges have a spectrum of their own, beside the waves of other frequencies: what is valid
    is the wave, by the receivers that are not cut there."""
    x = 0.02 + 0.005 * np.arange(48)
    cut = record(passing(x, [(dispersive, one)])[frames], T[frames], x)
    points = in_time(for_frequency_at_k(cut, harmonic=False), method="auto")
    own = points.take(points.valid)
    assert len(own) > 5
    assert np.mean(np.abs(own.k - dispersive(own.omega)) < 1.96 * own.k_error) >= 0.95
    assert (own.bar < own.omega / 2).all()
    assert any(reason.startswith("the record begins or ends") for reason in points.reason)


def test_the_foot_of_a_pulse_is_no_noise(rng):
    """A burst of which a twentieth is there when the record begins: noise is what is there when it
    has gone. Variance within a factor 2 of 80 samples' and no more, in the burst's band."""
    t = np.arange(2000) - 150.0
    u = np.exp(-((t / 87) ** 2)) * np.cos(0.3 * t) + 0.01 * rng.normal(size=2000)
    variance = noise_variance(u[:, None], 1.0, np.array([0.25, 0.3, 0.35]))
    assert (variance > 0.25e-4).all()
    assert (variance < 4e-4).all()


def test_a_third_mode_that_two_waves_stand_for_is_in_their_bars():
    """3000 and 2850 m/s, an eighth of 2π/X apart at 40 kHz, beside 1600 m/s: at 1 % of noise two
    waves stand for three, and each bar holds a mode (bars of noise alone: half of them)."""
    rng = np.random.default_rng(3)
    x = 0.05 + 0.005 * np.arange(36)
    speeds = 3000.0, 2850.0, 1600.0
    u = passing(x, [(lambda w, c=c: w / c, one) for c in speeds])
    _, own = read(u + 0.01 * rng.normal(size=u.shape), x)
    off = np.abs(own.k - own.omega / np.array(speeds)[:, None]).min(axis=0)
    assert len(own) > 30
    assert np.mean(off <= 1.96 * own.k_error) >= 0.95


def test_a_tone_is_one_wave_and_none_at_other_frequencies():
    """A steady 40 kHz that the record begins and ends in: all else is what its ends leave of it."""
    x = 0.02 + 0.005 * np.arange(24)
    omega = 2 * np.pi * 4e4
    u = np.cos(dispersive(omega) * x - omega * T[:, None])
    _, own = read(u + 1e-3 * np.random.default_rng(0).normal(size=u.shape), x)
    assert len(own) == 1
    assert abs(own.omega[0] - omega) < 4 * np.pi / np.ptp(T)
    assert abs(own.k[0] - dispersive(own.omega[0])) < own.bar[0] / 2000 < 0.1 * own.k[0]


@pytest.mark.parametrize("seed", range(3))
def test_losses_spreading_and_coupling_do_not_count(seed):
    """Amplitude as r^−½ e^{−30 r}, gains of 25 %, noise of 1 %: c within its bars and to 2 %."""
    rng = np.random.default_rng(seed)
    x = 0.05 + 0.005 * np.arange(24)
    u = passing(x, [(dispersive, lambda r: np.exp(-30 * r) / np.sqrt(r))])
    u = u * np.exp(0.25 * rng.normal(size=24)) + 0.01 * np.abs(u).max() * rng.normal(size=u.shape)
    points, own = read(u, x)
    assert len(points.branches) <= 2  # one that is broken off, at most
    true = own.omega / dispersive(own.omega)
    off = np.abs(own.phase_velocity - true)
    assert len(own) > 20
    assert np.median(off / true) < 0.02
    assert np.mean(off <= 1.96 * own.phase_velocity_error) >= 0.9


def test_two_modes_are_both_found():
    """1200 and 2000 m/s, 1 to 0.5, told apart by 48 receivers over 0.235 m; measured 1e-9."""
    x = 0.005 * np.arange(48)
    waves = [(lambda w: w / 1200, one), (lambda w: w / 2000, lambda r: 0.5 + 0 * r)]
    points, own = read(passing(x, waves), x)
    speeds = np.array([1200.0, 2000.0])
    off = np.abs(own.phase_velocity[:, None] - speeds).min(axis=1)
    assert len(points.branches) == 2
    assert (off / own.phase_velocity).max() < 1e-3
    bar = 1.96 * own.phase_velocity_error + 1e-9 * own.phase_velocity
    assert np.mean(off <= bar) > 0.9


def test_a_folded_wave_is_refused():
    """Receivers 40 mm apart, 3000 m/s: above 37.5 kHz k is known up to 2π/d alone."""
    x = 0.02 + 0.04 * np.arange(10)
    u = passing(x, [(lambda w: w / 3000, one)], 5e4)
    u += 1e-3 * np.random.default_rng(0).normal(size=u.shape)
    points, own = read(u, x)
    assert np.abs(own.phase_velocity / 3000 - 1).max() < 0.02
    beyond = points.omega / (2 * np.pi) > 4e4
    assert any(reason.startswith("folded") for reason in points.reason[beyond])


@pytest.mark.parametrize("seed", [2, 17, 19, 23])
def test_a_wave_of_one_frequency_no_louder_than_noise_is_no_tone(seed):
    """Of the frequencies of a long record some are in line by chance; a tone beside noise is one
    point, where it is."""
    rng = np.random.default_rng(seed)
    x, t = 0.5 * np.arange((9, 24, 53)[seed % 3]), np.arange(1400) * 1e-4
    noise = rng.normal(size=(1400, len(x)))
    assert not in_time(record(noise, t, x), method="fft").valid.any()
    tone = 2 * np.cos(2 * x - 2 * np.pi * 800 * t[:, None])
    found = in_time(record(noise + tone, t, x), method="fft")
    assert np.allclose(found.omega[found.valid], 2 * np.pi * 800, rtol=0.02)
    assert found.valid.sum() == 1


def test_noise_alone_has_no_mode(rng):
    points, own = read(rng.normal(size=(500, 24)), 0.005 * np.arange(24))
    assert len(own) == 0
    assert all(points.reason)


def test_one_clipped_receiver_of_many_is_left_out():
    """The others' waves are within their bars; harmonic inversion, which needs it, names it."""
    x = 0.05 + 0.005 * np.arange(24)
    u = passing(x, [(dispersive, one)]) + 1e-3 * np.random.default_rng(0).normal(size=(500, 24))
    u[:, 5] = np.clip(u[:, 5], -0.4, 0.4)
    left = for_frequency_at_k(record(u, T, x), harmonic=False)
    points = in_time(left, method="auto")
    own = points.take(points.valid)
    assert x[5] not in left.x
    assert len(own) > 20
    assert np.mean(np.abs(own.k - dispersive(own.omega)) < 1.96 * own.k_error) >= 0.9
    with pytest.raises(RecordError, match=r"flat tops at x = 0.075 m: without these"):
        for_frequency_at_k(record(u, T, x), harmonic=True)


def test_a_ring_that_is_not_said_to_be_one_is_asked_about():
    """Random phases both ways round: along a line no valid point does not hold the truth."""
    rng = np.random.default_rng(0)
    x, t = 1e-3 * np.arange(64), 2e-7 * np.arange(600)
    k = 2 * np.pi * np.arange(1, 29) / 0.064 * np.array([[1], [-1]])
    waves = np.exp(1j * (k[..., None] * x + rng.uniform(0, 2 * np.pi, (*k.shape, 1))))
    u = np.einsum("tk,skx->tx", np.exp(-2000j * np.outer(t, k[0])), waves).real
    found = record(u + 0.01 * u.std() * rng.normal(size=u.shape), t, x)
    assert any("say so with --ring" in note for note in found.notes)
    for points in (in_time(found, method="auto"), in_space(found, np.linspace(1e5, 2e6, 40))):
        own = points.take(points.valid)
        bar = own.bar if own.in_space else 1.96 * own.k_error
        assert (np.abs(own.k - own.omega / 2000) <= bar).all()
    x = 0.05 + 0.005 * np.arange(24)
    with pytest.raises(RecordError, match="leave out --ring"):
        record(passing(x, [(dispersive, one)]), T, x, ring=True, quiet_from=0.0)


def test_waves_that_run_against_x_are_read_as_well():
    x = 0.005 * np.arange(32)
    _, own = read(passing(0.3 - x, [(dispersive, one)]), x)
    assert len(own) > 30
    assert np.abs(own.k / dispersive(own.omega) - 1).max() < 1e-5


def test_rounded_positions_widen_the_bars():
    x = 0.02 + 0.005 * np.arange(48)
    made = record(passing(x, [(dispersive, one)]), T, x)
    unsure = in_time(dataclasses.replace(made, spacing_error=0.01), method="auto")
    own = unsure.take(unsure.valid)
    assert np.median(own.k_error / own.k) == pytest.approx(0.01, rel=1e-3)


def test_too_few_receivers_beside_the_source_are_refused():
    x = 0.005 * np.arange(8)
    with pytest.raises(RecordError, match="4 receivers stand on one side of the sources"):
        in_time(record(passing(x, [(dispersive, one)]), T, x, sources=(0.0175,)), method="fft")
