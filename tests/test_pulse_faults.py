"""Everyday faults of instruments in a pulse test of several receivers: cured, or named, left out.

The wave has c(500 kHz) = 3000 m/s and Q = 50; correlation alone reads 3000.8 m/s of the clean one.
"""

import math

import numpy as np
import pytest
from pulses import named, ricker, through

from wavesim.material.damping import constant_quality
from wavesim.readings.pulse.array_reading import read_array
from wavesim.readings.pulse.arrivals import threshold
from wavesim.readings.pulse.either_way import read_either_way
from wavesim.readings.pulse.measurement import measure
from wavesim.readings.pulse.quality_over_band import Quality, all_alike, left_to_gains
from wavesim.readings.pulse.signals import PulseError
from wavesim.readings.pulse.velocity import weighted_line
from wavesim.records.faults.clipping import clipped
from wavesim.records.faults.quantisation import quanta
from wavesim.records.layout import Layout
from wavesim.records.of_pulse_test import of_pulse_file

F, C = 5e5, 3000.0
T = -2e-5 + 2e-8 * np.arange(4000)
X = np.array([0.02, 0.03, 0.04, 0.05, 0.06])
LOSSY = constant_quality(50, (4e4, 3e6), F)
EXPECTED = (F, C)


@pytest.fixture(scope="module")
def clean():
    tau = T - 3e-6
    burst = np.where((tau >= 0) & (tau <= 6e-6), np.sin(np.pi * tau / 6e-6) ** 2, 0)
    u = through(lambda w: LOSSY.lossless(w) / C, T, burst * np.sin(2 * np.pi * F * tau), X)
    return u / np.abs(u).max() + 1e-3 * np.random.default_rng(5).standard_normal(u.shape)


def speed(values, x=X, t=T):
    found = measure(t, *named(values, x), expected=EXPECTED)
    return found, found.speeds["correlation"]


@pytest.mark.parametrize("offset", [0.1, 1.0, -30.0])
def test_an_offset_is_taken_out(clean, offset):
    """As without it, to the standard error."""
    _, exact = speed(clean)
    found, one = speed(clean + offset)
    assert abs(one.velocity - exact.velocity) <= 0.05
    assert "offset of" in found.record.notes[0]
    assert found.quality.quality == pytest.approx(50, abs=3 * found.quality.error + 0.5)


def test_a_straight_drift_is_taken_out_and_another_refuses(clean):
    _, exact = speed(clean)
    found, one = speed(clean + 0.1 * (T / T[-1])[:, None] * np.array([1, -1, 0.5, 2, 0]))
    assert abs(one.velocity - exact.velocity) <= 0.05
    assert "drift of" in found.record.notes[0]
    found, one = speed(clean + 0.1 * np.sin(2 * np.pi * 2e4 * T + 1)[:, None])
    assert np.isnan(one.velocity)
    assert "wanders" in found.record.notes[-1]


def test_errors_hold_a_level_that_moves_beneath_the_wave_where_it_is_not_seen(clean):
    """Law: a jump L turns the phase of U by up to L/ω|U|, at all frequencies alike; of one of two
    receivers or three, at its peak, where no jump is seen."""
    held, bars = [], []
    for seed, size in enumerate([0.01, -0.02, 0.03, -0.04, 0.05, 0.06]):
        u = clean[:, : 2 + seed % 2] + 1e-3 * np.random.default_rng(seed).standard_normal((4000, 1))
        bars.append([])
        for jump in (0.0, size):
            j = seed % u.shape[1]
            later = np.arange(len(T)) >= np.argmax(np.abs(u[:, j]))
            bad = u + jump * np.abs(u).max() * later[:, None] * (np.arange(u.shape[1]) == j)
            found = measure(T, *named(bad, X[: u.shape[1]]), expected=EXPECTED)
            one = found.dispersion
            own = np.isfinite(one.phase_error) & (np.abs(one.omega / (2 * np.pi * F) - 1) < 0.5)
            truth = one.omega[own] / (LOSSY.lossless(one.omega[own]) / C).real
            bars[-1].append(np.median(one.phase_error[own]))
            if jump:
                held.append(
                    np.mean(np.abs(one.phase_velocity[own] - truth) <= 1.96 * one.phase_error[own])
                )
    assert np.mean(held) >= 0.85
    assert (np.diff(bars) >= 0).all()


@pytest.mark.parametrize("when", [-5e-6, 1.1e-5])
@pytest.mark.parametrize("sizes", [[0.3, -0.15, 0.06, 0.24, 0.03], [0, 0, 0.4, 0, 0]])
def test_a_level_that_jumps_is_put_back(clean, when, sizes):
    """Law: what jumps at all receivers at once, or at one alone, is no wave; of the clean record
    it leaves c and Q, before the wave and within it."""
    exact, _ = speed(clean)
    found, _ = speed(clean + (when < T)[:, None] * np.array(sizes))
    assert "levels that jump at t" in found.record.notes[0]
    for name, one in found.velocities.items():
        assert one.velocity == pytest.approx(exact.velocities[name].velocity, rel=5e-3), name
    assert found.quality.quality == pytest.approx(50, abs=3 * found.quality.error + 0.5)


def test_a_level_that_moves_slowly_names_itself(clean):
    """Half a peak, in a period: beyond it first breaks alone were read, of the base's movement."""
    moved = -np.expm1(-np.maximum(T + 1e-5, 0) / 2e-6)[:, None] * np.full(5, 0.5)
    found, one = speed(clean + moved)
    assert np.isnan(one.velocity)
    assert "ends at another level" in found.record.notes[-1]


def test_a_wave_that_leaves_its_level_behind_is_no_jump():
    """Law: a step that travels comes to each receiver later, and is left as it is."""
    values = 1.0 * (T[:, None] > X / C) + 1e-3 * np.random.default_rng(5).standard_normal((4000, 5))
    found, _ = speed(values)
    assert "jump" not in " ".join(found.record.notes)


@pytest.mark.parametrize("told", [True, False])
def test_of_receivers_about_a_source_one_side_is_read(tmp_path, told):
    """Law: the wave runs both ways from the source, so that |x| is its path; by the file's word for
    it, or, where receivers are many, by the earliest arrivals."""
    x = 0.01 * np.array([-2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 3.5])
    values = np.stack([ricker(T - abs(place) / C, F, 3e-6) for place in x], axis=1)
    values += 1e-3 * np.random.default_rng(6).standard_normal(values.shape)
    told_by = {"sources": np.array([0.0])} if told else {}
    np.savez(tmp_path / "split.npz", t=T, x=x, u=values, **told_by)
    (test,) = of_pulse_file(tmp_path / "split.npz", Layout())
    assert list(test.positions.values()) == pytest.approx([0.005, 0.015, 0.025, 0.035], abs=6e-4)
    best = read_array("", test.t, test.signals, test.positions).best
    assert best.velocity == pytest.approx(C, abs=2 * best.velocity_error)
    assert best.valid


def test_marks_of_overload_and_flat_tops_leave_a_receiver_out(clean):
    _, exact = speed(clean)
    for spoil, word in ((lambda u: np.where(np.arange(len(u)) == 100, 9.99e37, u), "9.99e+37"),
                        (lambda u: np.clip(u, -0.3, 0.3), "flat tops")):  # fmt: skip
        values = clean.copy()
        values[:, 2] = spoil(values[:, 2])
        found, one = speed(values)
        assert abs(one.velocity - exact.velocity) <= 0.2
        assert any(
            ("r2" in note or "x = 0.04 m" in note) and word in note for note in found.record.notes
        )
        assert np.isnan(found.arrivals["envelope"].time[2])
    found, one = speed(np.clip(clean, -0.1, 0.1))
    assert np.isnan(one.velocity)
    assert not found.dispersion.valid.any()
    assert set(found.dispersion.reason) == {"flat tops: the signal is clipped; lower the gain"}


@pytest.mark.parametrize("which", range(5))
def test_a_reversed_receiver_is_turned_over(clean, which):
    _, exact = speed(clean)
    values = clean.copy()
    values[:, which] *= -1
    found, one = speed(values)
    assert abs(one.velocity - exact.velocity) <= 0.05
    assert any(f"r{which}: reversed" in note for note in found.record.notes)


def test_noise_is_at_least_that_of_the_digitisers_steps(clean):
    """LSB/√12 of 8 bits: the line lies within five of its errors of the clean one's."""
    pair, x = clean[:, [0, 3]], X[[0, 3]]
    _, exact = speed(pair, x)
    step = 1 / 128
    found, one = speed(np.round(pair / step) * step, x)
    assert (found.record.noise >= step / np.sqrt(12) * 0.999).all()
    assert abs(one.velocity - exact.velocity) <= 5 * one.error
    assert one.error < 1


def test_a_padding_of_zeros_tells_nothing_of_the_noise(clean):
    noisy = clean + 0.01 * np.random.default_rng(0).standard_normal(clean.shape)
    noisy[T < 3e-6] = 0
    found, one = speed(noisy)
    assert found.record.noise == pytest.approx(0.01, rel=0.25)
    assert abs(one.velocity - 3000.8) <= 5 * one.error


def test_rounded_times_are_even_and_a_late_start_is_refused(clean):
    found, one = speed(clean, t=np.round(T, 9))
    assert abs(one.velocity - 3000.8) <= 0.3
    t = T[1600:]  # 12 µs, within the signal of the first receiver
    found, one = speed(clean[1600:], t=t)
    assert "begins within" in found.record.unusable[0]
    assert any("begins within the signal" in note for note in found.record.notes)
    assert np.isnan(found.arrivals["correlation"].time[0])


def test_a_line_survives_weights_far_apart():
    """Slope of two points is Δy/Δx whatever their weights: to 1e-12."""
    x, y = np.array([0.02, 0.05]), np.array([1.0, 1.3])
    for weights in ([1, 1e26], [1e26, 1], [1e-30, 1e30]):
        b, a, _ = weighted_line(x, y, np.array(weights))
        assert b == pytest.approx(10, rel=1e-12)
        assert a == pytest.approx(0.8, rel=1e-9)


def test_an_echo_is_cut_off_before_it_comes(clean):
    """Reflected at 0.1 m with 0.8 of the amplitude: Q and velocity as without it."""
    far = through(lambda w: LOSSY.lossless(w) / C, T, clean[:, 0], 0.2 - X - X[0])
    reading = read_array("made", T, *named(clean + 0.8 * far, X), expected=EXPECTED)
    assert any("before the first echo" in note for note in reading.notes)
    assert reading.best.velocity == pytest.approx(3000.8, abs=1)
    q = reading.result.quality
    assert abs(q.quality - 50) <= 3 * q.error
    assert q.error < 2


def test_velocity_and_loss_are_those_of_the_direct_wave_though_each_specimen_has_its_echo():
    """Three specimens, an echo of each at three times its length: c and α of the loss law in closed
    form, within two errors at nearly all frequencies, none off by more than 3.5. No moment lies
    after the direct wave of all and before the first echo."""
    x, t = np.array([0.04, 0.08, 0.12]), np.arange(-4e-5, 2e-4, 1e-7)

    def k(w):
        return LOSSY.lossless(w) / C

    sent = ricker(t, 3e5, 6e-6)
    values = through(k, t, sent, x) + 0.5 * through(k, t, sent, 3 * x)
    values += 1e-3 * values.max() * np.random.default_rng(1).standard_normal(values.shape)
    reading = read_array("made", t, *named(values, x))
    assert "later at each" in "; ".join(reading.notes)
    found = reading.result.dispersion
    own = np.isfinite(found.attenuation_error)
    assert own.sum() >= 8
    truth = k(found.omega[own])
    for measured, exact, error in (
        (found.phase_velocity, found.omega[own] / truth.real, found.phase_error),
        (found.attenuation, truth.imag, found.attenuation_error),
    ):
        off = np.abs(measured[own] - exact) / error[own]
        assert np.mean(off < 2) >= 0.8
        assert off.max() < 3.5


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("part", "dead"), [(0.0, 1), (0.2, None), (3.0, None), (3.0, 3)])
def test_crosstalk_and_dead_receivers_are_left_out(clean, part, dead, known):
    """What was sent comes to all at once, whatever the distance, and one receiver is dead: speed
    and c(f) are those of the wave, and crosstalk is no wave of 10 km/s and more."""
    tau = T - 3e-6
    sent = np.where((tau >= 0) & (tau <= 6e-6), np.sin(np.pi * tau / 6e-6) ** 2, 0)
    sent *= np.sin(2 * np.pi * F * tau)
    x = X + 0.02
    later = clean[np.maximum(np.arange(len(T)) - 333, 0)]
    values = later + part * sent[:, None]
    if dead is not None:
        values[:, dead] = 1e-6 * np.random.default_rng(1).standard_normal(len(T))
    read = read_array("a", T, *named(values, x), sent if known else None, EXPECTED)
    one, found = read.best, read.result.dispersion
    assert one.valid
    assert abs(one.velocity - C) <= 2 * one.velocity_error + 2
    own = found.valid & (np.abs(found.omega / F / 2 / np.pi - 1) < 0.3)
    assert own.sum() >= 5
    assert np.abs(found.phase_velocity[own] / C - 1).max() < 0.03
    assert len(read.receivers) == (5 if dead is None else 4)


@pytest.mark.parametrize("sweep", [0.0, 3e9], ids=["tone", "chirp"])
@pytest.mark.parametrize("rise", [1e-6, 8e-6])
def test_a_record_that_ends_while_it_is_sent_holds_the_truth_or_tells_nothing(sweep, rise):
    """What is sent lasts, from 300 kHz on; 20 mm are reached at 10 µs, 60 mm at 23 µs; the record
    ends at 24, 32 and 44 µs, within its rise where that is slow. Exact c there is 2990 m/s."""
    tau = np.clip(T - 3e-6, 0, None)
    sent = np.sin(2 * np.pi * (3e5 + sweep * tau / 2) * tau) * np.minimum(tau / rise, 1)
    values = through(lambda w: LOSSY.lossless(w) / C, T, sent, X)
    answered = 0
    for n in (2200, 2600, 3200):
        best = read_array("a", T[:n], *named(values[:n], X), sent[:n], EXPECTED).best
        answered += best.valid
        assert not best.valid or abs(best.velocity - 2990) <= 2 * best.velocity_error
    assert answered


def test_crosstalk_that_lasts_into_the_wave_is_refused_where_nobody_knows_it(clean):
    tau = T + 1e-6
    sent = np.where((tau >= 0) & (tau <= 3e-5), np.sin(2 * np.pi * F * tau), 0)
    with pytest.raises(PulseError, match=r"as crosstalk, and .*: name what was sent"):
        read_array("a", T, *named(clean + 2 * sent[:, None], X))


@pytest.mark.parametrize("x", [X, X[::2], X[::4]], ids=["five", "three", "two"])
def test_two_waves_are_told_apart_or_refused_as_one(x):
    """P at 3000 m/s and S at 1700 m/s: no speed of one, no loss, where nothing is lost, and the one
    that is meant where about how fast it is has been said."""

    def ricker(t):
        a = (np.pi * 3e5 * (t - 4e-6)) ** 2
        return (1 - 2 * a) * np.exp(-a)

    u = np.stack([ricker(T - p / 3000) + 1.5 * ricker(T - p / 1700) for p in x], axis=1)
    u += 2e-3 * np.random.default_rng(3).standard_normal(u.shape)
    found = read_array("two", T, *named(u, x))
    assert not found.best.valid
    assert "--expected" in found.best.reason
    assert not found.result.dispersion.valid.any()
    assert found.result.quality.reason
    for speed_of in (3000, 1700):
        best = read_array("two", T, *named(u, x), expected=(3e5, 1.05 * speed_of)).best
        assert best.valid, best.reason
        assert abs(best.velocity - speed_of) <= 2 * best.velocity_error
        assert best.velocity == pytest.approx(speed_of, rel=0.03)


@pytest.mark.parametrize(
    ("peaks", "part", "expected"), [((8e4, 2e5), 0.1, None), ((1e5, 2.5e5), 0.3, (3.2e5, 3000.0))]
)
def test_where_another_wave_takes_over_the_phase_velocity_is_of_one_wave_or_not_said(
    peaks, part, expected
):
    """One of 1000 m/s, and a part of it of 3000 m/s at higher frequencies, in closed form: c is
    within 3 errors of the one that is followed, from low frequencies or where it is foreseen. Past
    the mixture the multiple of 2π is not known: it was told up to 390 errors off."""
    x, t = np.array([0.02, 0.03, 0.042, 0.055, 0.066, 0.08]), np.arange(-4e-5, 2e-4, 2e-7)
    values = through(lambda w: w / 1000, t, ricker(t, peaks[0], 1.5e-5), x)
    values += part * through(lambda w: w / 3000, t, ricker(t, peaks[1], 6e-6), x)
    values += 2e-3 * np.random.default_rng(1).standard_normal(values.shape)
    found = read_array("made", t, *named(values, x), expected=expected).result.dispersion
    own = np.isfinite(found.phase_error)
    assert own.sum() > 30
    off = np.abs(found.phase_velocity[own] - (3000 if expected else 1000)) / found.phase_error[own]
    assert off.max() < 3


@pytest.mark.parametrize("gains", [(1.0, 0.5), (1.0, 0.45, 0.6)])
def test_what_falls_at_all_frequencies_alike_is_no_loss(gains):
    """Waves that spread, as from 3 m to 6 m in a cross-hole test, or unlike gains: no Q of half the
    truth, by α; the spectral ratio has the truth, and α of equal gains has it too."""
    x = 0.02 + 0.02 * np.arange(len(gains))
    tau = T - 3e-6
    burst = np.where((tau >= 0) & (tau <= 6e-6), np.sin(np.pi * tau / 6e-6) ** 2, 0)
    u = through(lambda w: LOSSY.lossless(w) / C, T, burst * np.sin(2 * np.pi * F * tau), x)
    noise = 1e-3 * np.random.default_rng(6).standard_normal(u.shape)
    for factors in (np.ones(len(gains)), np.array(gains)):
        one = read_array("a", T, *named(factors * u / np.abs(u).max() + noise, x)).result
        ratio = one.constant_quality
        assert abs(ratio.inverse - 1 / 50) < 3 * ratio.inverse_error
        if (factors == 1).all():
            assert not one.quality.reason
            assert one.quality.inverse == pytest.approx(1 / 50, abs=3 * one.quality.inverse_error)
        else:
            assert one.quality.reason
            told = one.dispersion
            exact = (LOSSY.lossless(told.omega) / C).imag
            off = np.abs(told.attenuation - exact) / told.attenuation_error
            assert not (off > 3).any()


def test_what_the_spectral_ratio_has_otherwise_is_held_of_alpha():
    """α = ω/2cQ, Q = 100: velocities change by 1/πQ, and the ratio's 1/Q is less by 1/πQ²; beside a
    ratio of half, (0.01 − 0.005) ω/2c is open at the middle of the band."""
    omega, c = np.linspace(2e5, 2e6, 60), np.full(60, 300.0)
    alpha = omega / (2 * c * 100) + 1e-9
    assert not all_alike(omega, c, alpha, 0.01 * alpha, 0.05, 1e-4)

    def of(inverse, error):
        return Quality(1 / inverse, error / inverse**2, inverse, error, 60)

    def held(ratio):
        return left_to_gains(of(0.01, 7e-5), of(ratio, 1.4e-4), omega, c)

    assert held(0.01 - 0.01**2 / np.pi) == 0
    assert held(0.005) == pytest.approx(0.005 * 1.1e6 / 600, rel=0.01)


def test_waves_that_spread_have_velocities_and_no_loss():
    """Spherical ones from 20 mm before twelve receivers: c to 0.1 % as of plane ones, whose α and
    Q are read; no α of 10 to 50 Np/m that is none."""
    x = np.linspace(0.02, 0.075, 12)
    tau = T - 3e-6
    burst = np.where((tau >= 0) & (tau <= 6e-6), np.sin(np.pi * tau / 6e-6) ** 2, 0)
    u = through(lambda w: LOSSY.lossless(w) / C, T, burst * np.sin(2 * np.pi * F * tau), x)
    noise = 1e-4 * np.random.default_rng(5).standard_normal(u.shape)
    for power in (0.0, 1.0):
        falling = u * x**-power
        one = read_array("a", T, *named(falling / np.abs(falling).max() + noise, x)).result
        own = one.dispersion.valid & (np.abs(one.dispersion.omega / (2 * np.pi * F) - 1) < 0.1)
        exact = one.dispersion.omega / (LOSSY.lossless(one.dispersion.omega) / C).real
        assert own.sum() >= 5
        assert np.abs(one.dispersion.phase_velocity / exact - 1)[own].max() < 1e-3
        told = np.isfinite(one.dispersion.attenuation[own])
        assert told.all() if power == 0 else not told.any()
        assert bool(one.quality.reason) == bool(power)
    assert "--spreading" in one.quality.reason


@pytest.mark.parametrize("size", [lambda u: np.abs(u).max(0), lambda u: u.std(0)])
def test_receivers_divided_by_their_size_have_no_loss(clean, size, tmp_path):
    test = from_file(tmp_path, clean / size(clean))
    one = read_array("a", test.t, test.signals, test.positions, levelled=test.levelled)
    found = one.result.dispersion
    assert "divided by its own" in one.result.quality.reason
    assert found.valid.any()
    assert not np.isfinite(found.attenuation).any()
    assert not one.result.loss.valid.any()
    assert one.result.speeds["correlation"].velocity == pytest.approx(C, rel=1e-3)
    assert not from_file(tmp_path, clean).levelled


@pytest.mark.parametrize(("split", "gain"), [(4, 2.0), (6, 0.8), (3, 0.1)])
def test_receivers_of_two_gains_have_velocities_and_no_loss(split, gain):
    """Ten receivers, those beyond one through another amplifier: α would be off by ln g over the
    line. Velocities are what they are without; gains that differ by 3 % at random are no second."""
    x = 0.02 + 0.004 * np.arange(10)
    rng = np.random.default_rng(11)
    values = through(lambda w: LOSSY.lossless(w) / C, T, ricker(T, F, 4e-6), x)
    values = values + 1e-3 * rng.standard_normal(values.shape)
    plain = read_array("made up", T, *named(values * np.exp(0.03 * rng.standard_normal(10)), x))
    assert plain.result.quality.quality == pytest.approx(50, rel=0.5)
    beyond = values * np.where(np.arange(10) < split, 1.0, gain)
    one = read_array("made up", T, *named(beyond, x))
    why = one.result.quality.reason
    assert f"x = {x[split]:.4g} m" in why
    assert float(why.split("are ")[1].split()[0]) == pytest.approx(gain, rel=0.05)
    assert not np.isfinite(one.result.dispersion.attenuation).any()
    assert one.best.velocity == pytest.approx(C, rel=0.01)


def from_file(folder, values):
    np.savez(folder / "record.npz", t=T, x=X, values=values, t_unit="s", x_unit="m")
    (test,) = of_pulse_file(folder / "record.npz", Layout())
    return test


@pytest.mark.parametrize("steps", [256, 4096, 0])
@pytest.mark.parametrize("noise", [0.003, 0.01, 0.02])
def test_tops_cut_flat_are_told_beside_noise_and_none_where_none_are_cut(steps, noise):
    """A burst of 8 kHz cut at 0.5 of its peak after noise is on it; of 8 and 12 bits, or none."""
    t = 8e-7 * np.arange(2500)
    u = np.exp(-(((t - 6e-4) / 2e-4) ** 2)) * np.sin(2 * np.pi * 8e3 * t)
    told = []
    for seed in range(10):
        one = u + noise * np.random.default_rng(seed).standard_normal(len(t))
        one = np.round(one * steps / 2.4) * 2.4 / steps if steps else one
        limit = np.floor(0.5 * steps / 2.4) * 2.4 / steps if steps else 0.5
        pair = np.stack([one, np.clip(one, -limit, limit)], axis=1)[None]
        told.append(clipped(pair, quanta(pair))[0])
    assert not np.any(told, axis=0)[0]
    if noise * (steps or np.inf) > 1:
        assert np.all(told, axis=0)[1]


@pytest.mark.parametrize("steps", [0.0, 0.5])
@pytest.mark.parametrize("length", [1, 15])
def test_noise_alone_has_no_velocity(steps, length):
    """Law: receivers of noise alone, white or through a low pass of so many samples, rounded to
    half a deviation or not, tell no velocity, by no convention; 4 records of four receivers."""
    t, x = 5e-8 * np.arange(1000), 8e-3 * np.arange(1, 5)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        noise = rng.standard_normal((len(t), len(x)))
        noise = np.stack([np.convolve(u, np.hanning(length + 2), "same") for u in noise.T], axis=1)
        noise = np.round(noise / steps) * steps if steps else noise
        found = read_array("noise", t, *named(noise, x))
        assert not found.best.valid, (seed, found.best)
        assert found.result is not None
        assert not [v for v in found.result.velocities.values() if np.isfinite(v.velocity)], seed


def test_a_threshold_that_a_sample_meets_is_passed_there():
    """Law: the threshold is passed between the last sample below it and the first that is not,
    in whole numbers too, of which some meet it but for rounding; 100 samples of noise."""
    for seed in (124, 159, 294, *range(20)):
        u = np.round(2 * np.random.default_rng(seed).standard_normal(100))
        place, _, reason = threshold(u, 0.5, math.nan)
        if not np.isfinite(place):
            assert reason
            continue
        first = int(np.ceil(place - 1e-6))
        assert np.abs(u[:first]).max() < np.abs(u[first])
        assert np.abs(u[first]) >= np.abs(u).max() / 2


def test_of_two_receivers_one_of_reversed_polarity_is_named():
    u = np.stack([ricker(T, F, 1e-5 + (x - X[0]) / C) for x in X[:2]], axis=1)
    u = u * [1, -1] + 1e-3 * np.random.default_rng(4).standard_normal(u.shape)
    found = read_either_way("turned", T, *named(u, X[:2]))
    assert not found.best.valid or abs(found.best.velocity - C) < 2 * found.best.velocity_error
    told = [found.best.reason, *found.notes]
    assert any("r1 correlates better with r0 when turned over" in one for one in told)


def test_a_receiver_on_the_sources_other_side_is_named():
    """Four on one side, read as 3000 m/s without the first."""
    x = np.array([-0.02, 0.02, 0.03, 0.045, 0.06])
    u = np.stack([ricker(T, F, 1e-5 + abs(d) / C) for d in x], axis=1)
    u = u + 1e-3 * np.random.default_rng(4).standard_normal(u.shape)
    best = read_either_way("about", T, *named(u, x)).best
    assert not best.valid
    assert "with r0 the receivers hear no one wave, without it one of 3000 ±" in best.reason


def test_waves_that_leave_a_long_tail_are_no_crosstalk():
    """A step that decays over the record: its median lies above where all rest before it."""
    late = T[:, None] - X / C
    u = np.where(late > 0, (1 - np.exp(-np.maximum(late, 0) * F * 3)), 0.0)
    u = u * np.exp(-np.maximum(late, 0) / 1.2e-5)
    u = u + 2e-3 * np.random.default_rng(4).standard_normal(u.shape)
    best = read_array("tail", T, *named(u, X)).best
    assert best.valid, best.reason
    assert abs(best.velocity - C) < 2 * best.velocity_error
