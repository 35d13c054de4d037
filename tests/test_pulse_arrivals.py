"""Arrival times and velocities of pulses whose arrival is known in closed form."""

import numpy as np
import pytest
from pulses import named, ricker
from scipy.optimize import brentq

from wavesim.readings.pulse.arrivals import CONVENTIONS, arrivals, correlation, top
from wavesim.readings.pulse.first_break import AT_THE_END, onset
from wavesim.readings.pulse.signals import PulseError, pulse_record
from wavesim.readings.pulse.transmission_record import transmission_record
from wavesim.readings.pulse.velocity import arrival_velocity, told
from wavesim.simulation.bandlimited import between

C, F, STEP, DELAY = 2000.0, 5e5, 5e-8, 4e-6
# Begins before 0, and no receiver's arrival falls on a sample.
T = -2.013e-5 + STEP * np.arange(1500)
X = np.array([0.01, 0.0137, 0.0181, 0.0252])


def recorded(noise=0.0, rng=None, gains=(1, 1, 1, 1)):
    values = ricker(T[:, None] - X / C, F, DELAY) * np.array(gains, float)
    if noise:
        values = values + noise * rng.standard_normal(values.shape)
    return pulse_record(T, *named(values, X))


def test_interpolation_between_samples():
    """Against the closed form at places between samples; the Ricker pulse is above 1e-7 of its
    spectrum's peak up to 4.3 f_p = 0.22 of the Nyquist frequency. Bar 1e-6, the error stated for
    the window; measured 4e-8."""
    values = ricker(T, F, DELAY)
    s = np.linspace(450.0, 550.0, 997)
    error = between(values, s) - ricker(T[0] + STEP * s, F, DELAY)
    assert np.abs(error).max() <= 1e-6
    assert top(values, int(np.argmax(values))) == pytest.approx((DELAY - T[0]) / STEP, abs=1e-6)


def test_interpolation_where_a_record_ends_that_still_rings():
    """A cosine of 0.6 of the Nyquist frequency up to its last sample, against itself. Bars stated
    with the weights, 4e-3 of the peak before the last sample and 4e-5 four earlier; measured
    3.1e-3 and 2.2e-5, where the window alone is off by 0.2 and 4e-2."""
    end, turn = 299, 0.6 * np.pi
    for s, bar in ((np.linspace(270.0, end, 997), 4e-3), (np.linspace(270.0, end - 4, 997), 4e-5)):
        found = between(np.cos(turn * np.arange(end + 1)), s, moving=True)
        assert np.abs(found - np.cos(turn * s)).max() <= bar


@pytest.mark.parametrize("fraction", [0.2, 0.5, 0.9])
def test_threshold_without_noise(fraction):
    """Truth: the root of |s| = fraction on the flank where it is first reached (0.2 on the trough,
    which is 0.446 deep, the others on the peak). Error from interpolation, 1e-6 of the peak over a
    slope of 0.06 per sample and more: bar 2e-5 samples; measured 4e-7."""

    def past(u):
        return abs((1 - 2 * u**2) * np.exp(-(u**2))) - fraction

    u = brentq(past, -4, -(1.5**0.5)) if fraction < 0.4 else brentq(past, -(0.5**0.5), 0)
    truth = DELAY + X / C + u / (np.pi * F)
    found = arrivals(recorded(), "threshold", fraction)
    assert np.abs(found.time - truth).max() <= 2e-5 * STEP
    assert found.reason == ("",) * 4


def test_envelope_and_correlation_without_noise():
    """Both are exact by symmetry: the envelope peaks where the pulse does. Correlation is exact to
    interpolation, 1e-6 samples; the parabola through samples that lie unevenly about the peak, by
    half a sample in 9, to the fourth order left out: bar 1e-3 samples. Measured 3e-13 and 7e-5."""
    record = recorded(gains=(1, 0.6, 0.4, 0.3))
    truth = DELAY + X / C
    peak = arrivals(record, "envelope")
    assert np.abs(peak.time - truth).max() <= 1e-3 * STEP
    lag = arrivals(record, "correlation")
    assert np.abs(np.diff(lag.time - truth)).max() <= 1e-6 * STEP
    source = arrivals(record, "correlation", reference=ricker(T, F, DELAY))
    assert np.abs(np.diff(source.time - truth)).max() <= 1e-6 * STEP


@pytest.mark.parametrize("convention", ["threshold", "envelope", "correlation"])
def test_errors_hold_the_truth_at_the_stated_rate(convention, rng):
    """Law: (found − true)/error has unit variance. 120 records of 4 receivers, white noise of 1 %
    of the peak. The rms of 480 such numbers is 1 ± 0.03, of partly shared noise less surely:
    0.85 to 1.15 (measured 1.04, 1.07, 0.98); 95 % ± 3 % of them lie within 1.96 errors (94, 94,
    95). The errors are 0.07, 0.15 and 0.02 samples, of 40 to a period."""
    truth = DELAY + X / C
    exact = arrivals(recorded(), convention).time - truth
    scores = []
    for _ in range(120):
        found = arrivals(recorded(0.01, rng), convention)
        # A convention's own shift, the same at all receivers, is no error.
        late = found.time - truth - exact
        if convention == "correlation":
            # Errors are those of differences from the first; its own is counted by the others.
            own = np.hypot(found.error[1:], found.error[0])
            scores.extend((late[1:] - late[0]) / own)
        else:
            scores.extend(late / found.error)
    scores = np.array(scores)
    assert 0.85 <= np.sqrt(np.mean(scores**2)) <= 1.15
    assert 0.92 <= np.mean(np.abs(scores) <= 1.96) <= 0.98


def test_first_break_of_an_abrupt_onset(rng):
    """u = e^{−s/60} cos(s/6) from sample 600 on, in noise of 2 %: the break is at 600 within one
    sample in 95 of 100 and more, and never more than 3 off. Measured 100 of 100 at 0."""
    s = np.arange(1500) - 600
    clean = np.where(s >= 0, np.exp(-np.maximum(s, 0) / 60) * np.cos(s / 6), 0)
    off = []
    for _ in range(100):
        place, error, reason = onset(clean + 0.02 * rng.standard_normal(1500))
        assert reason == ""
        assert 0.28 < error < 2
        off.append(abs(place - 600))
    assert np.mean(np.array(off) <= 1) >= 0.95
    assert max(off) <= 3


def test_first_break_does_not_mind_the_noise_level(rng):
    """A Ricker pulse has no beginning, and is picked later for more noise: with 1 to 5 % of the
    peak between the trough's foot (|s| = 1e-3, 36 samples before the peak) and its lowest point
    (15.6 before)."""
    for noise in (0.01, 0.03, 0.05):
        early = (DELAY + X / C - arrivals(recorded(noise, rng), "first break").time) / STEP
        assert early.max() <= 37
        assert early.min() >= 15


def test_velocity_of_arrivals(rng):
    """Law: t = t₀ + x/c, slope and error as numpy's weighted polyfit gives them (another route)."""
    error = np.array([1e-9, 2e-9, 3e-9, 2e-9])
    time = 3e-6 + X / C + error * rng.standard_normal(4)
    found = arrival_velocity(X, time, error)
    (b, a), covariance = np.polyfit(X, time, 1, w=1 / error, cov="unscaled")
    left = (time - a - b * X) / error
    scale = max(1, np.sum(left**2) / 2)
    assert found.velocity == pytest.approx(1 / b, rel=1e-10)
    assert found.intercept == pytest.approx(a, rel=1e-8)
    assert found.error == pytest.approx(np.sqrt(covariance[0, 0] * scale) / b**2, rel=1e-8)


def test_velocity_holds_the_truth_at_the_stated_rate(rng):
    """1000 lines through four arrivals of known errors: c within 1.96 standard errors in 95 % and
    more, as the error is only ever enlarged; measured 95.6 %."""
    error = np.array([1e-9, 2e-9, 3e-9, 2e-9])
    hits = 0
    for _ in range(1000):
        found = arrival_velocity(X, 3e-6 + X / C + error * rng.standard_normal(4), error)
        hits += abs(found.velocity - C) <= 1.96 * found.error
    assert 0.94 <= hits / 1000 <= 0.995


def test_velocity_of_two_arrivals_and_of_one():
    two = arrival_velocity(X[:2], X[:2] / C, np.array([1e-9, 1e-9]))
    # var(1/c) = 2 (1e-9)²/d².
    assert two.error == pytest.approx(C**2 * 2**0.5 * 1e-9 / (X[1] - X[0]), rel=1e-9)
    assert np.isnan(arrival_velocity(X[:2], X[:2] / C, np.full(2, np.nan)).error)
    one = arrival_velocity(X[:2], np.array([1e-6, np.nan]), np.full(2, 1e-9))
    assert np.isnan(one.velocity)
    assert one.reason == "fewer than two arrivals"


def test_where_there_is_no_arrival_there_is_a_reason(rng):
    values = ricker(T[:, None] - X / C, F, DELAY) + 0.02 * rng.standard_normal((1500, 4))
    values[:, 2] = 0.02 * rng.standard_normal(1500)
    values[:, 3] = 0
    record = pulse_record(T, *named(values, X), quiet_until=2e-6)
    for convention in CONVENTIONS:
        found = arrivals(record, convention, fraction=0.3)
        assert np.isfinite(found.time[:2]).all(), convention
        assert np.isnan(found.time[2:]).all(), convention
        assert all(found.reason[2:]), convention
    low = arrivals(record, "threshold", fraction=0.05)
    assert low.reason[0] == "the threshold lies in the noise: raise the fraction"
    # A record that begins just before the pulse says when, but not how surely.
    late = T > 7e-6
    short = pulse_record(T[late], *named(values[late][:, :2], X[:2]))
    found = arrivals(short, "envelope")
    assert np.isfinite(found.time[0])
    assert np.isnan(found.error[0])
    assert "begins too shortly" in found.reason[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": T[::-1]}, "t: must ascend in even steps"),
        ({"t": T[:20]}, "20 samples; must be one row"),
        ({"signals": {"a": 0 * T}, "positions": {"a": 0.0}}, "1 receivers; at least 2"),
        ({"positions": {"a": 0.0, "c": 1.0}}, "receiver 'b': must have both"),
        ({"positions": {"a": 0.0, "b": 0.0}}, "must be finite and all different"),
        ({"signals": {"a": T, "b": T[1:]}}, "signal 'b': must be 1500 real"),
    ],
)
def test_what_does_not_fit_is_refused(change, message):
    given = {"t": T, "signals": {"a": T, "b": T}, "positions": {"a": 0.0, "b": 1.0}}
    with pytest.raises(PulseError, match=message):
        pulse_record(**{**given, **change})


def test_unknown_conventions_are_refused():
    with pytest.raises(PulseError, match="convention = 'eye': take one of first break"):
        arrivals(recorded(), "eye")
    with pytest.raises(PulseError, match="fraction = 1: must lie between"):
        arrivals(recorded(), "threshold", 1.0)
    with pytest.raises(PulseError, match="must be sampled as the signals, 1500"):
        arrivals(recorded(), "correlation", reference=T[1:])


@pytest.mark.parametrize("speeds", [(178.0, 1400.0, 3900.0), (2900.0, 2920.0, 3000.0)])
@pytest.mark.parametrize("bar", [1.0, np.nan])
def test_a_velocity_is_told_with_an_error_or_a_reason_stands_in_its_place(speeds, bar):
    """Of three conventions: none without an error of its own, and none where they are of no one
    wave, as about a gap, however small the errors of each."""
    read = {
        str(c): arrival_velocity(X[:2], X[:2] / c, np.full(2, bar * 1e-4 * X[1] / c))
        for c in speeds
    }
    found = told(read)
    for one in found.values():
        assert np.isfinite(one.velocity) == np.isfinite(one.error) == (not one.reason)
        assert not one.reason or "receiver" in one.reason
        assert bool(one.reason) == (np.isnan(bar) or speeds[0] < 200)
        away = max(abs(one.velocity - c) for c in speeds)
        assert one.reason or away <= 1.96 * one.error <= 1.5 * away


def test_a_square_rises_at_once_and_a_faded_burst_in_half_of_its_fade():
    """At its first sample, though it turns over later; sin² over 500 µs is at half after 125 µs."""
    t = np.arange(-1e-3, 3e-3, 1e-6)
    on = (t >= 0) & (t < 5e-4)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(t))
    for sent, rise in (
        (np.where(on, np.sign(np.sin(2 * np.pi * 2e3 * t) + 1e-9), 0), 0.0),
        (np.where(on, np.sin(2 * np.pi * 2e4 * t) * np.sin(np.pi * t / 5e-4) ** 2, 0), 1.25e-4),
    ):
        made = transmission_record(t, np.roll(sent, 900) + noise, sent)
        assert made.start + made.rise == pytest.approx(rise, abs=3e-6)


def test_a_pulse_that_the_records_end_cuts_tells_no_lag():
    """It ends with the middle of the second Ricker pulse, half of whose energy is beyond."""
    t = np.arange(400) * 1e-7
    first, second = ricker(t, 5e5, 1e-5), ricker(t, 5e5, 2e-5)
    whole, cut = t < 3e-5, t < 2e-5
    place, _, why = correlation(second[whole], first[whole], 1e-3, 1e-3)
    assert not why
    assert place == pytest.approx(100, abs=0.01)
    assert correlation(second[cut], first[cut], 1e-3, 1e-3)[2] == AT_THE_END
