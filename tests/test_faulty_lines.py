"""Lines of a few receivers that are folded, or that waves spread along: told, or read rightly."""

from __future__ import annotations

import numpy as np
import pytest
from test_waves_along_line import passing

from wavesim.material.medium import Medium
from wavesim.planewave.dispersion_relation import wavenumber
from wavesim.readings.dispersion.direction_of_travel import GROWS
from wavesim.readings.dispersion.folding import folded_branches, through_zero
from wavesim.readings.dispersion.frequency_at_wavenumber import chosen_method, in_time
from wavesim.readings.dispersion.line_fit import deviation, fit_line
from wavesim.readings.dispersion.spreading import exponent, spreads
from wavesim.readings.dispersion.wavenumber_at_frequency import in_space
from wavesim.records.fitness import for_frequency_at_k, for_k_at_frequency
from wavesim.records.record import RecordError, record

T = np.arange(1000) * 5e-7
SPEED = 3000.0


def plain(omega):
    return omega / SPEED


def read(x, amplitude, band, **more):
    rng = np.random.default_rng(1)
    u = passing(x, [(plain, amplitude)], 5e4, T)
    u += 1e-4 * rng.normal(size=u.shape)
    sources = (0.0,) if more.pop("named", False) else ()
    omega = 2 * np.pi * np.linspace(*band, 30)
    return in_space(record(u, T, x, sources=sources), omega, **more)


@pytest.mark.parametrize("band", [(2.5e4, 7e4), (4e4, 7e4), (7.8e4, 1.1e5)])
def test_folded_wavenumbers_are_refused(band):
    """Receivers 40 mm apart: k is known between ±78.5 rad/m, 37.5 kHz, and folded beyond."""
    points = read(0.02 + 0.04 * np.arange(8), lambda x: 1 + 0 * x, band)
    own = points.take(points.valid)
    assert np.abs(own.k - own.omega / SPEED).max(initial=0.0) < 1e-2 * 78
    beyond = points.omega.real / (2 * np.pi) > 3.8e4
    assert not points.valid[beyond].any()
    assert any(reason.startswith("folded") for reason in points.reason[beyond])


def test_spreading_is_no_loss():
    """r^−½ from a source 50 mm before the line: refused as plane, α of 0 to 0.02/m once named."""
    x = 0.05 + 0.005 * np.arange(24)
    band = (2e4, 1e5)
    for named in (False, True):
        told = read(x, lambda r: r**-0.5, band, named=named)
        assert not told.valid.any()
        assert all("--spreading" in reason for reason in told.reason)
    points = read(x, lambda r: r**-0.5, band, named=True, spreading=0.5)
    own = points.take(points.valid)
    assert len(own) == 30
    off = np.abs(own.k - own.omega / SPEED)
    assert np.median(off) < 0.02
    assert np.mean(off <= own.bar) >= 0.85
    with pytest.raises(RecordError, match="none is named: give --source"):
        read(x, lambda r: r**-0.5, band, spreading=0.5)


def test_losses_and_unequal_receivers_are_no_spreading(rng):
    """p of plane waves with any loss is 0 within its error; gains of 10 % make that error."""
    x = 0.05 + 0.005 * np.arange(24)
    U = np.exp(np.outer(np.linspace(-40, -1, 20), x))
    power, *_ = exponent(U, x, np.ones(U.shape, bool), 0.0)
    assert abs(power) < 1e-9
    gains = np.exp(0.1 * rng.normal(size=24))
    power, error, _ = exponent(U * gains, x, np.ones(U.shape, bool), 0.0)
    assert abs(power) < 4 * error


def test_line_fits_survive_any_weights():
    """No receiver, one, or all: the fit ends, with NaN where there is nothing to fit."""
    x = np.linspace(0, 1, 6)
    U = np.exp(3j * x) * np.ones((4, 6))
    used = np.zeros((4, 6), bool)
    used[1, 2] = used[2, 1:5] = used[3] = True
    found = fit_line(U, x, used, 1, True).k[:, 0]
    assert np.isnan(found[:2]).all()
    assert np.abs(found[2:] - 3).max() < 1e-9


def from_the_middle(count=128):
    """A lump let go in the middle of a line, in waves of c = 2000 m/s at most, both ways; the
    exact solution on a ring four times as long."""
    d, t = 1e-3, np.arange(200) * 1.2e-7
    k = 2 * np.pi * np.fft.fftfreq(4 * count, d)
    rate = 8e6 * np.abs(np.sin(k * d / 4))
    shape = np.exp(-((2e-3 * k) ** 2) / 2)
    u = np.fft.ifft(shape * np.cos(np.outer(t, rate)), axis=1).real
    u = np.roll(u, count // 2, axis=1)[:, :count]
    return u / np.abs(u).max(), t, d * np.arange(count)


@pytest.mark.parametrize(
    ("factor", "late", "said"),
    [(0.5, 0, "mis-scaled"), (-1.0, 0, "mis-scaled"), (0.0, 0, "dead"), (1.0, 8, "misfit")],
)
def test_one_bad_receiver_among_waves_both_ways(factor, late, said):
    """Its neighbours on both sides tell it; a factor is divided out, all else left out: no point
    is off."""
    u, t, x = from_the_middle()
    u[:, 60] = factor * np.roll(u[:, 60], late)
    u += 1e-3 * np.random.default_rng(0).normal(size=u.shape)
    made = record(u, t, x)
    assert said in {finding.what for finding in made.findings}
    points = in_time(made, method="auto")
    own = points.take(points.valid)
    off = np.abs(own.omega - 8e6 * np.abs(np.sin(own.k * 2.5e-4)))
    assert len(own) >= (30 if said == "mis-scaled" else 4)
    assert (off <= 2 * own.bar).all()
    assert np.mean(off <= own.bar) >= 0.9


@pytest.mark.parametrize(("spacing", "receivers"), [(4.04, 13), (4.26, 6), (4.6, 10), (4.72, 9)])
def test_no_single_frequency_of_a_folded_line_is_believed(spacing, receivers, rng):
    """Receivers several wavelengths apart, a burst of the band: k is folded at all of it."""
    f, n = 2e4, 4
    x = SPEED / f * (1 + spacing * np.arange(receivers))
    t = np.arange(int((x[-1] / SPEED + 14 / f) * 25 * f)) / f / 25
    s = t[:, None] - x / SPEED
    u = np.sin(2 * np.pi * f * s) * np.sin(np.pi * f * s / n) ** 2
    u = np.where((s >= 0) & (s <= n / f), u, 0.0) + 3e-3 * rng.normal(size=s.shape)
    omega = 2 * np.pi * f * np.linspace(0.5, 1.5, 40)
    points = in_space(record(u, t, x, sources=(0.0,)), omega)
    assert any(reason.startswith("folded") for reason in points.reason)
    assert not points.valid.any()


@pytest.mark.parametrize("sign", [1, -1])
def test_where_waves_run_both_ways_a_mode_folds_by_its_modulus(sign):
    """|k| rises to π/d and falls from there; below nothing is folded."""
    true = np.linspace(0.2, 1.5, 40) * np.pi
    seen = sign * np.abs((true + np.pi) % (2 * np.pi) - np.pi)
    there = np.abs(seen) < 0.97 * np.pi
    folded = folded_branches(np.zeros(there.sum(), int), seen[there], 2e3 * true[there], 1.0)
    assert np.array_equal(folded, true[there] > np.pi)


def test_waves_that_decay_about_a_gap_are_not_folded():
    """Re k(ω + iσ) of a medium falls and rises again from 0.6 to 1.2 MHz; it is a tenth
    of π/d at most of cells of l/8."""
    omega = 2 * np.pi * np.linspace(6e5, 1.2e6, 40)
    medium = Medium(closure="consistent", anisotropy=0.25, stiffness_ratio=0.5)
    k = wavenumber(medium, "longitudinal", omega + 3.6e5j).real
    assert np.abs(k).max() < 0.1 * np.pi / 1.25e-4
    assert not folded_branches(np.zeros(40, int), k, omega, 1.25e-4).any()


def test_a_mode_that_runs_through_zero_is_folded_on_either_side_of_it():
    """k − 2π/d of a dispersive mode: below 0 its phases run back, and what is above is the same."""
    omega = np.linspace(0.8, 1.4, 40) * 1e3
    true = np.pi * (2 * omega / 1e3 + 0.3 * (omega / 1e3) ** 2)
    seen = true - 2 * np.pi * np.round(true.mean() / (2 * np.pi))
    assert (seen < 0).sum() < (seen > 0).sum()
    assert folded_branches(np.zeros(40, int), seen, omega, 1.0).all()
    assert not folded_branches(np.zeros(40, int), true / 4, omega, 1.0).any()


def test_a_straight_mode_nearer_to_another_multiple_than_to_zero_is_folded(rng):
    """k ∝ ω^1.3 at k − 2π/d, as noise lets it be seen, points past −2π/d; one of a cut-off, k² ∝
    ω² − ω₀², is where it seems, and bends; as does the first without what is taken away."""
    omega = np.linspace(0.94, 1.06, 12)
    true = 2.6 * np.pi * omega**1.3
    for seen, folded in ((true - 2 * np.pi, True), (true / 4, False)):
        seen = seen + 0.02 * rng.normal(size=12)
        assert folded_branches(np.zeros(12, int), seen, omega, 1.0).all() == folded
    for low in (1.02, 1.1, 1.2):
        omega = np.linspace(low, 1.5, 40)
        k = 0.8 * np.pi * np.sqrt(omega**2 - 1)
        assert not folded_branches(np.zeros(40, int), k, omega, 1.0).any()


def test_a_gain_that_turns_a_wave_round_is_refused(rng):
    """Two receivers, the nearer of a tenth of the gain: what decays toward the source is no wave
    that comes from there."""
    f = 2e4
    x = SPEED / f * np.array([2.0, 2.3])
    s = np.arange(400) / f / 25 - x[:, None] / SPEED
    u = np.where(
        (s >= 0) & (s <= 4 / f), np.sin(2 * np.pi * f * s) * np.sin(np.pi * f * s / 4) ** 2, 0
    )
    u = (u + 1e-3 * rng.normal(size=s.shape)).T
    omega = 2 * np.pi * f * np.linspace(0.8, 1.2, 9)
    for gain, reason in ((1.0, ""), (0.1, "amplitudes grow")):
        points = in_space(record(u * [gain, 1], np.arange(400) / f / 25, x), omega)
        assert all(r.startswith(reason) for r in points.reason)
        assert points.valid.all() == (gain == 1)


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("turns", [2.3, 5.7, 10.6])
def test_a_pulse_that_runs_for_turns_between_receivers_has_k_where_it_is_unfolded_alone(
    count, turns, rng
):
    """Constant speed, α from 1/Q = 0.03: k = ω(1 + i/2Q)/c exactly; half a turn is passed within
    the band, and what is called valid is right to 2 % or three of its bars."""
    f, x = 5e4, 0.01 + turns * SPEED / 5e4 * np.arange(count)
    n, t = 8192, 5e-7 * np.arange(8192)
    s = (np.pi * f * (t - 4e-5)) ** 2
    omega = 2 * np.pi * np.fft.rfftfreq(n, 5e-7)
    spectrum = np.fft.rfft((1 - 2 * s) * np.exp(-s))
    u = np.fft.irfft(spectrum * np.exp(1j * omega * x[:, None] / SPEED * (-1 + 0.015j)), n).T
    u = u[: int((x[-1] / SPEED + 2e-4) / 5e-7)]
    u += 0.003 * np.abs(u[:, -1]).max() * rng.normal(size=u.shape)
    read = 2 * np.pi * np.linspace(8e3, 1.2e5, 40)
    points = in_space(record(u, t[: len(u)], x, sources=(0.0,)), read)
    own = points.valid
    off = np.abs(points.k[own].real - points.omega[own].real / SPEED)
    assert (off <= np.maximum(3 * points.bar[own], 0.02 * points.omega[own].real / SPEED)).all()
    assert sum(reason.startswith("folded") for reason in points.reason) > 20


@pytest.mark.parametrize("turn", [1.2, 1.6])
def test_a_wave_whose_phases_run_against_its_decay_is_folded(turn, rng):
    """Receivers turn/2 of a wavelength apart: phases seem to run back while amplitudes fall.

    Energy goes the way that a wave fades, so that k = turn·π/d is seen at (turn − 2)π/d: at two
    frequencies as at forty none may pass for a wave.
    """
    f = 2e4
    x = 0.1 + turn / 2 * SPEED / f * np.arange(19)
    t = np.arange(4000) / f / 40
    s = t[:, None] - x / SPEED - 3 / f
    u = (
        np.exp(-0.4 * turn * np.arange(19))
        * np.cos(2 * np.pi * f * s)
        * np.exp(-((f * s / 3) ** 2))
    )
    u = u + 1e-4 * rng.normal(size=s.shape)
    for count in (2, 40):
        points = in_space(record(u, t, x), 2 * np.pi * f * np.linspace(0.9, 1.1, count))
        assert not points.valid.any()


def test_a_mode_that_shows_at_some_frequencies_is_in_the_bars_of_all(rng):
    """c₁ = 3000 m/s beside a guided mode, k₂ = √(ω² − ω_c²)/c₂, which comes as near as 2π/X to it.

    Where both are too close to be told apart one k is found, between theirs. Bars that count the
    second only where it shows hold either of them at 66 % of the frequencies.
    """
    n, dt, f0 = 8192, 1e-6, 4e4
    x = 0.1 + 0.008 * np.arange(40)
    z = 2 * np.pi * np.fft.rfftfreq(n, dt) + 12j / (n * dt)
    s = (z / f0) ** 2 * np.exp(-((z / f0 / 2 / np.pi) ** 2) + 3j * z / f0)
    ks = [lambda w: w / 3000, lambda w: np.sqrt((w + 2e3j) ** 2 - 1.2e5**2 + 0j) / 2850]
    U = sum(
        a * np.exp(1j * k(z)[:, None] * x) * s[:, None] for a, k in zip((1, 0.6), ks, strict=True)
    )
    u = np.fft.irfft(np.conj(U), n, axis=0) * np.exp(12 * np.arange(n) / n)[:, None]
    u = (u / np.abs(u).max())[:1200]
    u = np.round(64 * u) / 64
    omega = 2 * np.pi * f0 * np.linspace(0.3, 2, 40)
    points = in_space(record(u, np.arange(len(u)) * dt, x), omega)
    own = points.take(points.valid)
    off = np.min([np.abs(own.k - k(own.omega)) for k in ks], axis=0)
    assert points.valid.sum() >= 10
    assert np.mean(off <= own.bar) >= 0.9


def test_receivers_as_good_as_at_one_place_are_read_as_a_line_without_one(rng):
    """One more receiver, 1e-9 of the line beside another, changes no k by more than its bar."""
    x, t = 0.1 + 0.01 * np.arange(8), np.arange(1500) * 1e-6
    x = np.sort(np.append(x, x[3] + 1e-10))
    s = (2e4 * (t[:, None] - x / SPEED - 2e-4) * np.pi) ** 2
    points = in_space(
        record((1 - 2 * s) * np.exp(-s) + 1e-4 * rng.normal(size=s.shape), t, x),
        2 * np.pi * np.linspace(1e4, 4e4, 10),
    )
    assert points.valid.all()
    assert (np.abs(points.k - points.omega / SPEED) < 1.5 * points.bar).all()


@pytest.mark.parametrize("at", [2e-4, 4e-4, 1.2e-3])
def test_a_step_that_all_receivers_hear_at_once_is_no_source_among_them(at, rng):
    """A pulse of 3000 m/s beside a step of its size that is common to all: no arm, no source."""
    x, t = 0.1 + 0.01 * np.arange(16), np.arange(1500) * 1e-6
    s = (2e4 * np.pi * (t[:, None] - x / SPEED - 2e-4)) ** 2
    u = (1 - 2 * s) * np.exp(-s) + 1e-3 * rng.normal(size=s.shape) + 1.0 * (t > at)[:, None]
    assert record(u, t, x).source_seen is None


@pytest.mark.parametrize("gains", [(0.327, -0.143, 0.009, -0.033, -0.241),
                                   (-0.102, 0.061, -0.05, -0.005, 0.065),
                                   (-0.234, 0.112, -0.105, -0.047, 0.165)])  # fmt: skip
def test_gains_at_random_of_five_receivers_show_none_that_is_mis_scaled(gains, rng):
    """Four of five lie on some line by chance: the fifth is no fault for that. One three times as
    loud as four of gains of 1 % is."""
    x, t = np.array([0.02, 0.027, 0.039, 0.046, 0.062]), np.arange(1000) * 5e-7
    s = (np.pi * 5e4 * (t[:, None] - 3e-5 - x / SPEED)) ** 2
    u = (1 - 2 * s) * np.exp(-s - 8 * x)
    u += 1e-3 * rng.normal(size=u.shape)
    loud = 1 + 0.01 * np.sign(gains) + 2.0 * (x == 0.039)
    for gain, named in ((1 + np.array(gains), 0), (loud, 1)):
        found = record(u * gain, t, x).findings
        assert sum(one.what == "mis-scaled" for one in found) == named


@pytest.mark.parametrize("fault", ["reversed", "delayed"])
def test_a_side_of_a_line_that_is_reversed_or_late_is_told(fault):
    """Two cards of a digitiser, or two cables: seven and nine receivers of one wave. Turned round,
    or left out; as it is, side lobes of the jump are waves of wrong speeds to `dispersion`."""
    x = 0.02 + 0.005 * np.arange(16)
    u = passing(x, [(plain, lambda r: 1 + 0 * r)], 5e4, T)
    late = 20 if fault == "delayed" else 0
    u[:, :7] = -u[:, :7] if not late else np.roll(u[:, :7], late, axis=0)
    u += 1e-3 * np.random.default_rng(1).normal(size=u.shape)
    found = record(u, T, x)
    assert [one.what for one in found.findings] == [fault]
    assert len(found.x) == (16 if fault == "reversed" else 9)
    points = in_space(found, 2 * np.pi * np.linspace(2e4, 9e4, 30))
    own = points.take(points.valid)
    assert len(own) >= 28
    assert np.mean(np.abs(own.k - own.omega / SPEED) <= own.bar) >= 0.85
    if late:
        told = float(found.findings[0].size.split()[2].rstrip(","))
        assert told == pytest.approx(late * 5e-7, rel=0.02)


def test_a_folded_mode_that_breaks_off_and_goes_on_is_folded():
    """ω ∝ (k + 2π/d)², a bending wave: k runs from −0.9 to 0.9 of π/d through 0, joined in three
    pieces, of which the last alone might be a wave that begins at a cutoff."""
    d = 0.5
    k = np.linspace(-0.9, 0.9, 121) * np.pi / d
    omega = (k + 2 * np.pi / d) ** 2
    branch = np.digitize(k * d / np.pi, (-0.2, 0.3))
    branch[[40, 41, 82, 83]] = -1
    own = branch >= 0
    assert folded_branches(branch, k, omega, d)[own].all()
    upper = np.where(branch == 2, 2, -1)
    assert not folded_branches(upper, k, omega, d).any()


def test_levels_that_bend_otherwise_at_each_frequency_are_no_spreading(rng):
    """r^−0.3 at low and r^−3 at high frequencies, as near a source that is struck too hard: the one
    exponent of all of them, near 1, is no wave's; r^−1 at all of them is."""
    x = 0.05 + 0.005 * np.arange(24)
    loss = np.outer(np.linspace(-40, -1, 20), x) + 0.02 * rng.normal(size=(20, 24))
    low = np.arange(20)[:, None] < 16
    for power, told in ((np.where(low, 0.3, 3.0), False), (1.0, True)):
        U = np.exp(loss - power * np.log(x))
        assert bool(spreads(U, x, np.ones(U.shape, bool), 0.0)) == told


@pytest.mark.parametrize("second", [0.3, 0.6])
def test_two_modes_are_refused_where_receivers_are_too_few_to_tell_them(second, rng):
    """Of 2000 and 3400 m/s at four: frequencies at which they look like one are off either."""
    x, t = 0.03 + 0.006 * np.arange(4), np.arange(1000) * 5e-7
    waves = [(lambda w: w / 2000, lambda r: 1.0), (lambda w: w / 3400, lambda r: second)]
    for modes in (1, 2):
        u = passing(x, waves[:modes], 5e4, t) + 1e-3 * rng.normal(size=(len(t), 4))
        points = in_space(record(u, t, x), 2 * np.pi * np.linspace(1e4, 1.3e5, 60))
        off = np.min([np.abs(points.k - points.omega / c) for c in (2000, 3400)], axis=0)
        assert (
            np.mean(off[points.valid] <= points.bar[points.valid]) >= 0.9
            if modes == 1
            else (not points.valid.any())
        )


@pytest.mark.parametrize(
    ("power", "spacing", "cycles", "count"), [(0.57, 3.24, 1.5, 18), (0.5, 2.53, 3, 21)]
)
def test_a_curved_mode_that_comes_from_beyond_zero_is_folded_where_it_is_weak_too(
    power, spacing, cycles, count
):
    """k ∝ ω^p by receivers three wavelengths apart: at a tenth to a third of the burst's frequency
    k is seen at k − 2π/d, as a mode from near 0 to π/d, and nothing is joined to it below."""
    f, speed, n = 2e4, 500.0, 8192
    x = speed / f * (1 + spacing * np.arange(count))
    t = np.arange(n) / f / 15
    omega = 2 * np.pi * np.fft.rfftfreq(n, t[1])
    k = 2 * np.pi * f / speed * (omega / (2 * np.pi * f)) ** power
    burst = np.sin(2 * np.pi * f * t) * np.sin(np.pi * np.minimum(f * t / cycles, 1)) ** 2
    u = np.fft.irfft(np.fft.rfft(burst)[:, None] * np.exp(-1j * k[:, None] * x), n, axis=0)
    u = u[: int(15 * (1.3 * power * x[-1] / speed * f + cycles + 6))]
    u = u / np.abs(u).max() + 1e-4 * np.random.default_rng(2).normal(size=u.shape)
    points = in_time(record(u, t[: len(u)], x, sources=(0.0,)), method="auto")
    right = 2 * np.pi * f / speed * (points.omega.real / (2 * np.pi * f)) ** power
    assert (np.abs(points.k / right - 1)[points.valid] < 0.2).all()
    assert sum(reason.startswith("folded") for reason in points.reason) > 20


def test_a_mode_that_halts_at_zero_as_at_a_cut_off_does_not_come_from_beyond_it():
    """k² ∝ ω² − ω₀², and its mirror image of waves that come back; ω ∝ k; against k² ∝ ω − 2π."""
    omega = np.linspace(0.5, 2, 61)
    cut = np.sqrt(np.maximum(omega**2 - 1, 0))
    seen = omega > 1.01
    both = np.concatenate([cut[seen], -cut[seen]])
    own = np.arange(int(seen.sum()))
    assert not through_zero(own, both, np.concatenate([omega[seen]] * 2), 0.1)
    assert not through_zero(np.arange(61), omega, omega, 0.1)
    assert through_zero(np.arange(30, 61), 6 * np.sqrt(omega) - 6, omega, 0.1)


@pytest.mark.parametrize("rate", [1.003, 0.997])
def test_the_loss_of_a_line_of_two_clocks_holds_the_step_between_them(rate):
    """Half the receivers' clock runs 0.3 % fast or slow: less late than is seen in any phase, and
    at all frequencies alike. Bars hold k; those of one clock are as they were."""
    x = 0.05 + 0.01 * np.arange(12)
    rng, bars = np.random.default_rng(5), []
    for own in (rate, 1.0):
        one, other = (passing(x, [(plain, lambda r: np.exp(-r))], 5e4, T * c) for c in (1.0, own))
        u = np.where(x > x.mean(), other, one)
        u += 1e-2 * rng.normal(size=u.shape)
        omega = 2 * np.pi * np.linspace(2.5e4, 8e4, 30)
        points = in_space(record(u, T, x), omega)
        points = points.take(points.valid)
        assert np.mean(np.abs(points.k - points.omega / SPEED - 1j) <= points.bar) > 0.9
        bars.append(points.bar)
    assert np.median(bars[1]) < 0.7 * np.median(bars[0])


@pytest.mark.parametrize("unlike", ["gains", "two modes"])
def test_what_is_off_at_all_frequencies_is_where_noise_hides_it(unlike):
    """Gains off by 5 %, and a second mode: k is as far off of a wave of 0.3 of the amplitude, of
    which noise hides what is left over."""
    x, k = 0.01 * np.arange(4), 120.0 + 0.2j
    wave = np.exp(1j * k * x)
    off = np.array([0.05, -0.05, -0.05, 0.05]) if unlike == "gains" else 0.05 * np.exp(-220j * x)
    sizes = np.array([1.0, 0.9, 1.0, 0.3, 0.3])
    fit = fit_line(sizes[:, None] * wave * (1 + off), x, np.ones((5, 4), bool), 1, False)
    bars = deviation(fit, np.full(5, 2), np.full(5, 0.02**2)) * fit.unit[:, 0]
    assert np.abs(np.diff(fit.k[:, 0])).max() < 1e-6
    assert bars[3:].min() > 0.99 * bars[:3].max()


@pytest.mark.parametrize(("fault", "said"), [("noisy", "misfit"), ("coupled", "misfit"),
                                             ("late", "delayed")])  # fmt: skip
def test_a_channel_is_late_where_that_is_all_that_is_off(fault, said):
    """Law: u(t − τ) is all told by the others and τ; a hiss of its own, or a part of its neighbour
    a third of a wavelength away, is not."""
    u = passing(0.02 + 0.02 * np.arange(12), [(plain, lambda x: 1 + 0 * x)], 5e4, T)
    u += 1e-3 * np.random.default_rng(2).normal(size=u.shape)
    own, size = u[:, 5], np.abs(u).max()
    if fault == "noisy":
        u[:, 5] = own + 0.15 * size * np.random.default_rng(3).normal(size=len(T))
    elif fault == "coupled":
        u[:, 5] = own + 0.35 * u[:, 4]
    else:
        u[:, 5] = np.roll(own, 4)
    (found,) = record(u, T, 0.02 + 0.02 * np.arange(12)).findings
    assert found.what == said
    assert "x = 0.12 m" in found.where


@pytest.mark.parametrize("backward", [False, True])
def test_a_record_that_runs_backward_has_no_loss(backward):
    """Q = 10. In a medium Im k(ω + iσ) ≥ σ dRe k/dω; of frames turned round waves fade at ω + iσ
    still, by σ/c less what is lost, and at real frequencies they grow."""
    k = lambda w: w / SPEED * (1 + 0.05j)  # noqa: E731
    x, t = 0.02 + 0.01 * np.arange(12), T[:400]
    u = passing(x, [(k, lambda x: 1 + 0 * x)], 5e4, t)
    u += 1e-4 * np.random.default_rng(1).normal(size=u.shape)
    omega = 2 * np.pi * np.linspace(3e4, 8e4, 30)
    points = in_space(record(u[::-1] if backward else u, t, x), omega)
    assert points.valid.sum() == (0 if backward else 30)
    assert np.mean(points.reason == GROWS) > 0.5 or not backward


def test_signals_muted_into_the_wave_are_no_waves(rng):
    """Muted before a line through the wave's first crests, a pulse leaves other frequencies' power
    at each; well before it, nothing."""
    x = 0.05 + 0.005 * np.arange(20)
    u = passing(x, [(plain, lambda x: 1 + 0 * x)], 5e4, T)
    u += 1e-3 * rng.normal(size=u.shape)
    arrive = x / SPEED + 1e-5
    omega = 2 * np.pi * np.linspace(3e4, 8e4, 20)
    for into, told in ((-2e-5, 0), (1.5e-5, 20)):
        cut = arrive + into * (1 if into < 0 else np.linspace(0.5, 1.5, 20))
        seen = record(u * np.clip((T[:, None] - cut) / 6e-6, 0, 1), T, x)
        assert seen.begun.sum() == told
        assert [finding.what for finding in seen.findings] == ["muted"] * (told > 0)
        own = in_time(seen, method="auto")
        own = own.take(own.valid)
        assert len(own) > 20 or told
        assert np.sum(np.abs(own.omega - SPEED * own.k) <= own.bar) >= 0.9 * len(own)
        if told:
            with pytest.raises(RecordError, match="muted into the wave at all 20 receivers"):
                for_k_at_frequency(seen)
        else:
            points = in_space(for_k_at_frequency(seen), omega)
            off = np.abs(points.k - points.omega / SPEED)[points.valid]
            assert np.mean(off <= points.bar[points.valid]) >= 0.9


def test_an_undersampled_pulse_along_a_line_is_driven_by_no_source_within(rng):
    """All noise beyond a sixth of the sampling frequency is signal, folded: what moves at the ends
    of the line enters there, and harmonic inversion refuses that."""
    x = 0.05 + 0.03 * np.arange(12)
    u = passing(x, [(plain, lambda x: 1 + 0 * x)], 5e4, T)[::30]
    seen = record(u + 1e-3 * rng.normal(size=u.shape), T[::30], x)
    assert chosen_method(for_frequency_at_k(seen)) == "fft"
