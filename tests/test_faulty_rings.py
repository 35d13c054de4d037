"""Rings with the faults of instruments and of matter: no leakage, and no random line, is a wave."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.signal import lfilter

from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
from wavesim.records.fitness import for_frequency_at_k
from wavesim.records.record import RecordError, record

X, T = np.arange(64) * 1e-3, np.arange(600) * 2e-7
BRANCHES = (lambda k: 2000.0 * k, lambda k: np.sqrt(2e6**2 + (1500 * k) ** 2))


def ringing(seed=0):
    """Two branches, both ways round a ring, at random phases."""
    rng = np.random.default_rng(seed)
    k = 2 * np.pi * np.arange(1, 28) / 0.064
    u = np.zeros((len(T), len(X)))
    for omega, amplitude in zip(BRANCHES, (1.0, 0.7), strict=True):
        for sign in (1, -1):
            phase = rng.uniform(0, 2 * np.pi, len(k))
            wave = np.exp(1j * (sign * np.outer(k, X) + phase[:, None]))
            u += amplitude * (np.exp(-1j * np.outer(T, omega(k))) @ wave).real
    return u / np.abs(u).max() + 1e-3 * rng.normal(size=u.shape), rng


@pytest.mark.parametrize("method", ["harmonic", "fft"])
@pytest.mark.parametrize("gain", [0.003, 0.01, 0.03])
def test_unequal_gains_make_no_waves(method, gain):
    """Gains of 0.3 to 3 % leak every wavenumber into every other, at 1e-3 of its amplitude."""
    u, rng = ringing()
    found = in_time(record(u * (1 + gain * rng.normal(size=64)), T, X, ring=True), method=method)
    own = found.take(found.valid)
    exact = np.stack([omega(own.k) for omega in BRANCHES])
    off = np.abs(exact - own.omega)
    assert len(found.branches) == 2
    assert len(own) >= 40
    assert (off.min(axis=0) / own.omega).max() < 0.01
    assert np.mean(off.min(axis=0) <= own.bar) >= 0.88


@pytest.mark.parametrize("missing", [1, 2])
def test_a_ring_without_its_last_receivers_is_no_ring(missing):
    """All k = 2πm/X would be as much too large as the ring is taken for too small."""
    rng = np.random.default_rng(missing)
    k = 2 * np.pi * np.arange(1, 8) / 0.064
    u = 1e-3 * rng.normal(size=(len(T), len(X)))
    for sign in (1, -1):
        wave = np.exp(1j * (sign * np.outer(k, X) + rng.uniform(0, 2 * np.pi, len(k))[:, None]))
        u += (np.exp(-1j * np.outer(T, 5000 * k)) @ wave).real
    for_frequency_at_k(record(u, T, X, ring=True))
    told = rf"with {missing} more receivers? between the last and the first"
    with pytest.raises(RecordError, match=told):
        for_frequency_at_k(record(u[:, :-missing], T, X[:-missing], ring=True))


@pytest.mark.parametrize("every", [1, 2, 3])
def test_what_too_few_receivers_show_beyond_their_wavenumbers_is_folded(every, rng):
    """A lattice's branch, ω = 4 MHz sin(ka/2), goes on at 2π/d − k, and through k = 0."""
    x, k = np.arange(96) * 1e-3, 2 * np.pi * np.arange(1, 48) / 0.096
    u = np.zeros((len(T), len(x)))
    for sign in (1, -1):
        wave = np.exp(1j * (sign * np.outer(k, x) + rng.uniform(0, 2 * np.pi, len(k))[:, None]))
        u += (np.exp(-1j * np.outer(T, 4e6 * np.sin(5e-4 * k))) @ wave).real
    u = u / np.abs(u).max() + 1e-4 * rng.normal(size=u.shape)
    found = in_time(record(u[:, ::every], T, x[::every], ring=True))
    own = found.take(found.valid)
    assert np.abs(own.omega - 4e6 * np.sin(5e-4 * own.k)).max() < 1e-4 * 4e6
    assert len(own) >= 0.8 * 48 / every
    assert sum("folded" in reason for reason in found.reason) >= 0.8 * 48 * (1 - 1 / every)


@pytest.mark.parametrize("relation", [
    lambda k: 2000.0 * k, BRANCHES[1], lambda k: 3e6 - 0.1 * k**2
], ids=["acoustic", "optical", "falling"])  # fmt: skip
def test_a_branch_whose_weak_end_passes_half_a_turn_is_where_it_begins(relation, rng):
    """Waves up to 0.7 of 2π/d, amplitudes e^{−(k/k_c)²}, k_c = 0.4π/d: those beyond π/d are few.

    ω = 0 or dω/dk = 0 at k = 0, and at 2π/d neither."""
    x, k = np.arange(19) * 1e-3, 2 * np.pi * np.arange(1, 14) / 0.019
    wave = np.exp(1j * (np.outer(k, x) + rng.uniform(0, 2 * np.pi, len(k))[:, None]))
    size = np.exp(-((k * 1e-3 / (0.4 * np.pi)) ** 2))
    u = ((np.exp(-1j * np.outer(T, relation(k))) * size) @ wave).real
    found = in_time(record(u / np.abs(u).max() + 1e-7 * rng.normal(size=u.shape), T, x, ring=True))
    own = found.take(found.valid)
    assert np.abs(own.omega - relation(own.k)).max() < 1e-4 * own.omega.max()
    assert len(own) >= 8
    assert sum("folded" in reason for reason in found.reason) >= 3


@pytest.mark.parametrize("fault", ["hum", "clocks", "unmended clocks", "interpolated"])
def test_what_receivers_differ_by_makes_no_waves(fault, rng):
    """A hum of unequal gains, clocks off by 0.003 to 0.1 of a period, samples between others by
    straight lines: each leaks waves into all wavenumbers at one frequency, no flat branch."""
    count = 24
    x, t = np.arange(count) * 1e-3, np.arange(1000) * 2e-7
    late = {"clocks": 1e-8, "unmended clocks": 3e-7, "interpolated": 1e-7}.get(fault, 0.0)
    late = late * (rng.uniform(0, 1, count) if fault == "interpolated" else rng.normal(size=count))
    k = 2 * np.pi * np.arange(1, 11) / (count * 1e-3)
    phase = rng.uniform(0, 2 * np.pi, (2, len(k)))
    u = np.zeros((len(t), count))
    for sign, own in zip((1, -1), phase, strict=True):
        for q, begin in zip(k, own, strict=True):
            w = 2000.0 * q
            steps = np.floor(late / 2e-7) * 2e-7, np.ceil(late / 2e-7) * 2e-7
            part = (late - steps[0]) / 2e-7 if fault == "interpolated" else 0.0
            first, second = (late, late) if fault != "interpolated" else steps
            for share, moved in ((1 - part, first), (part, second)):
                u += share * np.cos(sign * q * x - w * (t[:, None] - moved) + begin)
    u = u / np.abs(u).max() + 1e-5 * rng.normal(size=u.shape)
    if fault == "hum":
        u += 0.05 * np.sin(2 * np.pi * 31e3 * t)[:, None] * np.exp(0.2 * rng.normal(size=count))
    found = in_time(for_frequency_at_k(record(u, t, x, ring=True, quiet_from=0.0)))
    own = found.take(found.valid)
    assert (np.abs(own.omega - 2000 * own.k) < 0.01 * own.omega).sum() >= 0.95 * len(own)
    assert len(own) >= (0 if fault == "unmended clocks" else 8)


@pytest.mark.parametrize("met", [0.01, 0.5])
def test_a_weak_flat_branch_is_one_though_another_meets_it(met, rng):
    """A branch of 0.05 of the acoustic one's amplitude, which that meets at m + ½ or near m."""
    count = 24
    x, t = np.arange(count) * 1e-3, np.arange(1000) * 2e-7
    k = 2 * np.pi * np.arange(1, 11) / (count * 1e-3)
    flat = 2000.0 * (k[4] + met * k[0])
    u = np.zeros((len(t), count))
    for q in k:
        for size, w in ((1.0, 2000.0 * q), (0.05, flat)):
            u += size * np.cos(q * x - w * t[:, None] + rng.uniform(0, 2 * np.pi))
    found = in_time(for_frequency_at_k(record(u, t, x, ring=True, quiet_from=0.0)))
    own = found.take(found.valid)
    assert (np.abs(own.omega - flat) < 1e-3 * flat).sum() >= 8


def heated(seed, coherent, count=64, frames=2000):
    """A chain, ω = 10⁶ |sin(ka/2)|, driven at random: lines of so many half-widths 1/T."""
    rng, a, dt = np.random.default_rng(seed), 1e-3, 5e-7
    x, t = np.arange(count) * a, np.arange(frames) * dt
    fall = np.exp(-coherent / frames)
    u = np.zeros((frames, count), complex)
    for m in range(-count // 2, count // 2):
        if not m:
            continue
        k = 2 * np.pi * m / (count * a)
        kicks = (rng.normal(size=frames) + 1j * rng.normal(size=frames)) / np.sqrt(2)
        kicks[1:] *= np.sqrt(1 - fall**2)
        omega = 1e6 * abs(np.sin(k * a / 2))
        amplitude = lfilter([1.0], [1.0, -fall], kicks)
        u += np.outer(amplitude * np.exp(-1j * omega * t), np.exp(1j * k * x))
    return record(u.real, t, x, ring=True, lattice=True)


@pytest.fixture(scope="module")
def thermal():
    return heated(2, 2.0)


@pytest.mark.parametrize("coherent", [8.0, 12.0, 16.0])
def test_crests_beside_a_random_line_s_middle_are_within_bars(coherent):
    """A line broader than 2π/T shows several crests, of which any may be the highest."""
    off = []
    for seed in range(4):
        found = in_time(heated(seed, coherent, 48), method="fft")
        own = found.take(found.valid)
        off += list(np.abs(own.omega - 1e6 * np.abs(np.sin(own.k * 5e-4))) / own.bar)
    assert len(off) >= 25
    assert np.mean(np.array(off) <= 1) >= 0.9


def test_a_thermal_chain_has_one_branch(thermal):
    """Its bars are those of a random line, √(2γ/T) = 2,000 rad/s and more, not of white noise."""
    found = in_time(thermal, method="fft")
    own = found.take(found.valid)
    off = np.abs(own.omega - 1e6 * np.abs(np.sin(own.k * 5e-4)))
    assert len(found.branches) == 1
    assert len(own) >= 25
    assert np.mean(off <= own.bar) >= 0.8
    assert 1000 < np.median(own.error) < 8000


@pytest.mark.parametrize("coherent", [2.0, 10.0, 20.0])
def test_harmonic_inversion_says_that_lines_are_random(coherent):
    """Many sinusoids crowd under a random line of a few 2π/T; of one that is broader, a sinusoid or
    two leave a fifth and more, as they leave of no line that only decays."""
    found = in_time(heated(2, coherent, 24, 1500), method="harmonic")
    assert not found.valid.any()
    assert any("broad and random" in reason for reason in found.reason)


def test_free_waves_that_decay_as_fast_are_sinusoids():
    """Lines as broad as random ones, of waves that nothing drives: ω = 10⁶ |sin(ka/2)|, γT = 10."""
    rng, x, t = np.random.default_rng(3), np.arange(24) * 1e-3, np.arange(1500) * 5e-7
    k = 2 * np.pi * np.arange(1, 12) / 0.024
    omega = 1e6 * np.sin(k * 5e-4)
    u = np.zeros((1500, 24))
    for sign in (1, -1):
        waves = np.exp(1j * (sign * np.outer(k, x) + rng.uniform(0, 6.28, (len(k), 1))))
        u += (np.exp(-np.outer(t, 1j * omega + 10 / t[-1])) @ waves).real
    found = in_time(record(u + 1e-3 * rng.normal(size=u.shape), t, x, ring=True, lattice=True))
    own = found.take(found.valid)
    assert len(own) >= 10
    assert np.mean(np.abs(own.omega - 1e6 * np.sin(own.k * 5e-4)) <= own.bar) >= 0.9


def test_a_wave_of_the_mains_frequency_is_no_hum():
    """Waves round a ring are steady tones, one of 50 Hz among them: it stays at every receiver."""
    x, t = np.arange(32.0), np.arange(900) * 2e-3
    k = 2 * np.pi * np.arange(1, 15) / 32
    omega = 2 * np.pi * 50 * k / k[6]
    rng = np.random.default_rng(1)
    phase = rng.uniform(0, 2 * np.pi, (2, len(k)))
    size = np.where(np.arange(len(k)) == 6, 1.0, 0.02)
    waves = [(size * np.cos(s * k * x[:, None] - omega * t[:, None, None] + p)).sum(axis=-1)
             for s, p in zip((1, -1), phase, strict=True)]  # fmt: skip
    found = record(sum(waves) + 1e-3 * rng.normal(size=(900, 32)), t, x, ring=True)
    assert not any(one.what == "hum" for one in found.findings)


def test_a_dead_receiver_s_waves_are_read_from_the_others_as_well_as_from_all():
    """Waves of two branches; bars are no more than three times those of the whole ring."""
    x, t, k = np.arange(32) * 1e-3, np.arange(400) * 2e-7, 2 * np.pi * np.arange(1, 14) / 0.032
    rng, u = np.random.default_rng(2), np.zeros((400, 32))
    for omega in (2000 * k, np.sqrt(2e6**2 + (1500 * k) ** 2)):
        for sign in (1, -1):
            phase = 1j * rng.uniform(0, 2 * np.pi, (len(k), 1))
            waves = np.exp(1j * sign * np.outer(k, x) + phase)
            u += (np.exp(-1j * np.outer(t, omega)) @ waves).real
    u = u / np.abs(u).max() + 1e-3 * rng.normal(size=u.shape)
    bars = []
    for spoilt in (u, np.where(np.arange(32) == 9, 0.0, u)):
        points = in_time(for_frequency_at_k(record(spoilt, t, x, ring=True)))
        own = points.take(points.valid)
        assert len(own) >= 25
        bars.append(np.median(own.bar))
    assert bars[1] < 3 * bars[0]


def test_a_line_whose_frequency_moves_is_no_pair_of_waves():
    """Of a specimen that softens by 0.2 % in a record each line is, by any record of its length,
    two, of which one grows: refused; in a quarter of the record it is one, and read."""
    rng = np.random.default_rng(5)
    x, t = np.arange(48) * 1e-3, np.arange(900) * 4e-7
    k = 2 * np.pi * np.arange(1, 19) / 0.048
    omega, slow = 1e6 * np.sin(k * 5e-4), t * (1 - 0.002 * t / t[-1])
    u = np.zeros((len(t), len(x)))
    for sign in (1, -1):
        wave = np.exp(1j * (sign * np.outer(k, x) + rng.uniform(0, 2 * np.pi, len(k))[:, None]))
        u += (np.exp(-1j * np.outer(slow, omega)) @ wave).real
    u = u / np.abs(u).max() + 1e-3 * rng.normal(size=u.shape)
    found = in_time(record(u, t, x, ring=True))
    assert found.valid.sum() <= 4
    assert sum(reason.startswith("its frequency moves") for reason in found.reason) >= 28
    found = in_time(record(u[:225], t[:225], x, ring=True))
    own = found.take(found.valid)
    mean = 1e6 * np.sin(own.k * 5e-4) * (1 - 0.002 * t[225] / t[-1])
    assert len(own) >= 16
    assert np.mean(np.abs(own.omega - mean) <= own.bar) >= 0.85


@pytest.mark.parametrize("differ", ["sensors", "clocks"])
def test_receivers_of_two_kinds_in_turn_are_told_from_two_waves(differ):
    """Every other one shows H(ω) of a wave: both stand at k and at π/d − k. Half of them are right;
    a lattice of two sites in a cell shows it too, and there both wavenumbers are its waves'."""
    rng, count = np.random.default_rng(11), 32
    x, k = np.arange(count) * 1e-3, 2 * np.pi * np.arange(1, 8) / 0.032
    omega = 4e6 * np.sin(5e-4 * k)
    H = 1 / (1 - (omega / 2e6) ** 2 - 0.6j * omega / 2e6)
    H = np.exp(2e-7j * omega) if differ == "clocks" else H / np.abs(H).mean()
    u = np.zeros((len(T), count))
    for sign in (1, -1):
        wave = np.exp(1j * (sign * np.outer(k, x) + rng.uniform(0, 2 * np.pi, len(k))[:, None]))
        tones = np.exp(-1j * np.outer(T, omega))
        u += np.where(np.arange(count) % 2, ((tones * H) @ wave).real, (tones @ wave).real)
    u = u / np.abs(u).max() + 1e-3 * rng.normal(size=u.shape)
    with pytest.raises(RecordError, match="two kinds in turn"):
        in_time(record(u, T, x, ring=True))
    found = in_time(record(u[:, ::2], T, x[::2], ring=True))
    own = found.take(found.valid)
    assert len(own) == len(k)
    assert (np.abs(own.omega - omega) <= 2 * own.bar).all()
    assert in_time(record(u, T, x, ring=True, lattice=True)).valid.sum() >= 2 * len(k) - 2


@pytest.mark.parametrize(("count", "late"), [(16, 3), (32, 1)])
def test_a_late_half_of_a_ring_of_few_lines_is_found(count, late):
    """Few waves take a part of the jump of their phase along, at its place and beside it alike."""
    rng = np.random.default_rng(count)
    x, k = np.arange(count) * 1e-3, 2 * np.pi * np.arange(1, count // 4) / (count * 1e-3)
    k, at = k[:7], T[:450, None] - 2e-7 * late * (np.arange(count) >= count // 2)
    u = np.zeros(at.shape)
    for q in k:
        for sign, phase in zip((1, -1), rng.uniform(0, 2 * np.pi, 2), strict=True):
            u += np.cos(sign * q * x - 4e6 * np.sin(5e-4 * q) * at + phase)
    u = u / np.abs(u).max() + 1e-3 * rng.normal(size=u.shape)
    with pytest.raises(RecordError) as told:
        record(u, T[:450], x, ring=True, quiet_from=0.0)
    said = re.search(r"are ([\d.]+) frames later than those before", str(told.value))
    assert said is not None
    assert float(said[1]) == pytest.approx(late, rel=0.1)


def test_a_late_block_of_a_ring_is_told_from_waves(rng):
    """Receivers 17 to 33 of 48 two frames late: e^{ikx} stands at k ± 2πn/X too, at its ω."""
    x, k = np.arange(48) * 1e-3, 2 * np.pi * np.arange(1, 9) / 0.048
    u, late = {0.0: 0.0, 4e-7: 0.0}, (x > 0.0165) & (x < 0.0335)
    for sign in (1, -1):
        phase = rng.uniform(0, 2 * np.pi, len(k))[:, None]
        wave = np.exp(1j * (sign * np.outer(k, x) + phase))
        for by in u:
            u[by] = u[by] + (np.exp(-1j * np.outer(T - by, 4e6 * np.sin(5e-4 * k))) @ wave).real
    noise = 1e-3 * rng.normal(size=u[0.0].shape)
    found = in_time(for_frequency_at_k(record(u[0.0] + noise, T, x, ring=True)))
    assert found.valid.sum() >= 7
    with pytest.raises(RecordError, match="a part of its receivers is late"):
        in_time(
            for_frequency_at_k(record(np.where(late, u[4e-7], u[0.0]) + noise, T, x, ring=True))
        )


def test_a_ring_of_two_receivers_is_refused_for_its_wavenumbers(rng):
    t = np.arange(400) * 1e-6
    u = np.sin(2e5 * t[:, None] + np.array([0.0, 1.0])) + 1e-3 * rng.normal(size=(400, 2))
    with pytest.raises(RecordError, match="wavenumbers apart"):
        in_time(for_frequency_at_k(record(u, t, np.array([0.0, 1e-2]), ring=True)))


@pytest.mark.parametrize("interval", [0.5, 0.8, 1.25])
def test_an_interval_that_changes_within_a_ring_s_record_makes_no_waves(interval):
    """Times that go on evenly put waves at ω dt′/dt in a second half taken dt′ apart: no wave
    appears round a ring in which no source acts."""
    rng = np.random.default_rng(3)
    x, k = np.arange(32) * 1e-3, 2 * np.pi * np.arange(1, 14) / 0.032
    steps = np.where(np.arange(600) < 300, 1.0, interval) * 4e-7
    true = np.append(0, np.cumsum(steps)[:-1])
    for taken in (4e-7 * np.arange(600), true):
        u = np.zeros((600, 32))
        for sign in (1, -1):
            wave = np.exp(1j * (sign * np.outer(k, x) + rng.uniform(0, 2 * np.pi, 13)[:, None]))
            u += (np.exp((-1e3 - 2000j * k) * taken[:, None]) @ wave).real
        u += 1e-3 * np.abs(u).max() * rng.normal(size=u.shape)
        ring = record(u, 4e-7 * np.arange(600), x, ring=True)
        if taken is not true:
            own = in_time(for_frequency_at_k(ring))
            assert own.valid.sum() >= 12
            continue
        with pytest.raises(RecordError, match="the interval between frames changes"):
            for_frequency_at_k(ring)
