"""Records as oscilloscopes leave them: triggered as the pulse is sent, coarse, averaged, muted.

The wave is what was sent, delayed by L/c, of half its size; nothing of it spreads or disperses.
"""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from pulses import named, ricker
from scipy.signal import bilinear, butter, lfilter, sosfilt
from transducers import INTERVAL, record

from wavesim.cli.main import main
from wavesim.readings.pulse.array_reading import read_array
from wavesim.readings.pulse.one_receiver import read_one
from wavesim.readings.pulse.quality_over_band import mean_quality
from wavesim.readings.pulse.series_reading import read_series
from wavesim.readings.pulse.signals import PulseError
from wavesim.readings.pulse.transmission_record import transmission_record
from wavesim.records.faults.clipping import without_stuck
from wavesim.records.faults.quantisation import quanta

L, F = 0.1, 1e4
SENT = {
    "sine": lambda x: np.where((x >= 0) & (x < 1), np.sin(2 * np.pi * x), 0.0),
    "cosine": lambda x: np.where((x >= 0) & (x < 1), np.cos(2 * np.pi * x), 0.0),
    "square": lambda x: np.where((x >= 0) & (x < 0.5), 1.0, 0.0),
    "step": lambda x: np.where(x >= 0, 1.0, 0.0),
}


def scope(kind, start, speed=150.0, noise=0.005, crosstalk=0.0, samples=2000, f=F, seed=0):
    """t, sent, received of 1.5 ms from a time (s) on, in volts: ten are sent."""
    r = np.random.default_rng(seed)
    t = start + np.linspace(0, 1.5e-3, samples)
    sent = SENT[kind](f * t)
    # A receiver hears no constant, and as crosstalk how fast that changes.
    heard = SENT["sine" if kind == "step" else kind](f * (t - L / speed))
    rate = sent - SENT[kind](f * (t - 2e-6))
    got = 0.5 * heard + crosstalk * rate / np.abs(rate).max(initial=1e-9)
    return t, 10 * sent, got + 0.5 * noise * r.standard_normal(len(t))


@pytest.mark.parametrize("crosstalk", [0.0, 0.3])
@pytest.mark.parametrize("kind", ["sine", "cosine", "square"])
def test_a_record_that_begins_as_the_pulse_is_sent_is_read_as_one_that_begins_before(
    kind, crosstalk
):
    """L/c = 0.667 ms, both within two errors of it, and apart by a tenth of a period at most."""
    read = []
    for start in (0.0, -2e-4):
        t, sent, got = scope(kind, start, crosstalk=crosstalk)
        best = read_one(transmission_record(t, got, sent), L, {}).best
        assert best.valid, best.reason
        assert abs(best.time - L / 150) <= 2 * best.error
        read.append(best.time)
    assert abs(read[0] - read[1]) <= 0.1 / F


@pytest.mark.parametrize("start", [-2e-4, -3.75e-4, 0.0])
def test_a_step_is_sent_as_it_rises_wherever_the_record_begins(start):
    """Of one that has risen by the first sample nothing is seen, and that is the reason given."""
    t, sent, got = scope("step", start)
    if start == 0:
        with pytest.raises(PulseError, match="a step must be sent after the record begins"):
            transmission_record(t, got, sent)
    else:
        assert transmission_record(t, got, sent).start == pytest.approx(0, abs=2 * (t[1] - t[0]))


@pytest.mark.parametrize("start", [-1e-4, 0.0])
def test_without_what_was_sent_a_record_must_begin_before_it(start):
    """One that begins at t = 0 may have been sent at any time after: half the speed is refused, and
    read where that time is said."""
    t, _, got = scope("sine", 0.0)
    late = transmission_record(t + start + 6e-4, got) if start else transmission_record(t, got)
    best = read_one(late, L, {}).best
    assert not best.valid
    assert "--input" in best.reason
    assert "--delay" in best.reason
    delays = dict.fromkeys(("first break", "threshold", "envelope", "correlation"), 0.0)
    said = read_one(transmission_record(t, got), L, delays).best
    assert said.valid
    assert abs(said.time - L / 150) <= 2 * said.error
    t, _, got = scope("sine", -1e-4)
    assert read_one(transmission_record(t, got), L, {}).best.valid


@pytest.mark.parametrize("how", [0.27, -0.27, 0.0])
def test_a_series_whose_frequency_is_changed_from_state_to_state_drifts_by_no_cycle(how):
    """f in proportion to p^how, V = 60 p^0.27: each time within two errors, and as late as the
    others to a fifth of a period."""
    p = np.array([10, 20, 40, 80, 160.0])
    V, f = 60 * p**0.27, F * (p / 40) ** how
    records = []
    for i, (c, frequency) in enumerate(zip(V, f, strict=True)):
        t, sent, got = scope("sine", -2e-4, c, f=frequency, seed=i, samples=3000)
        records.append(transmission_record(t, got, sent))
    readings, series = read_series(records, L, {}, "stress", p.tolist())
    off = np.array([one.best.time for one in readings]) - L / V
    assert all(one.best.valid for one in readings)
    assert (np.abs(off) <= 2 * np.array([one.best.error for one in readings])).all()
    assert np.ptp(off * f) <= 0.2
    assert series.law.b == pytest.approx(0.27, abs=0.01)


def test_noise_of_a_coarsely_sampled_record_does_not_count_as_signal():
    """Twelve samples a period, 3 % of noise: the period is the one that was sent, to a third."""
    t, sent, got = scope("square", -2e-4, noise=0.03, crosstalk=2.0, samples=180)
    found = transmission_record(t, got, sent)
    assert found.sampled == pytest.approx(t[1] - t[0])
    assert found.period * F == pytest.approx(1, rel=1 / 3)


def test_an_average_of_coarse_sweeps_does_not_stand_still_on_its_crest():
    """Eight sweeps of eight bits, with less noise than a step: crests of equal samples are no
    stretches that stand still; one that does is."""
    r = np.random.default_rng(2)
    t = np.linspace(0, 2e-3, 2500)
    u = np.sin(2 * np.pi * 3e3 * t) * np.exp(-(((t - 8e-4) / 3e-4) ** 2))
    sweeps = [np.round((u + 5e-4 * r.standard_normal(len(t))) * 200) / 200 for _ in range(8)]
    for stands in (False, True):
        values = np.mean(sweeps, axis=0)[None, :, None]
        if stands:
            values[0, 950:1000] = values[0, 950]
        found = []
        without_stuck(values, t, np.zeros(1), ("u",), quanta(values), found)
        assert bool(found) == stands


@pytest.mark.parametrize("muted", [False, True])
def test_signals_muted_after_the_wave_tell_velocities_alone(muted):
    """Muted 1.5 periods after each arrival a wave has no spectrum any more, but its speed."""
    x, t = np.array([0.04, 0.06, 0.08, 0.1]), np.arange(-1e-4, 1.5e-3, 1e-6)
    u = np.stack([ricker(t, F, 1e-4 + p / 150) for p in x], axis=1)
    u += 0.004 * np.random.default_rng(1).standard_normal(u.shape)
    if muted:
        u[t[:, None] > 1e-4 + x / 150 + 1.5 / F] = 0
    one = read_array("made", t, *named(u, x))
    assert one.best.valid
    assert abs(one.best.velocity - 150) <= 2 * one.best.velocity_error + 0.1
    assert one.result.dispersion.valid.any() != muted
    assert any("muted" in note for note in one.notes) == muted


def test_one_note_tells_of_all_receivers_with_a_fault(tmp_path):
    """Four receivers, the last two clipped: a line for both."""
    x, t = np.array([0.04, 0.06, 0.08, 0.1]), np.arange(-1e-4, 1.5e-3, 1e-6)
    u = np.stack([ricker(t, F, 1e-4 + p / 150) for p in x], axis=1)
    u += 0.004 * np.random.default_rng(1).standard_normal(u.shape)
    u[:, 2:] = np.clip(u[:, 2:], -0.4, 0.4)
    heads = ",".join(["t (s)", *(f"x={1e3 * p:g} mm" for p in x)])
    file = tmp_path / "four.csv"
    np.savetxt(file, np.column_stack([t, u]), delimiter=",", header=heads, comments="")
    told = json.loads(CliRunner().invoke(main, ["pulse", str(file), "--json"]).output)["records"][0]
    (said,) = (note for note in told["notes"] if "lower the gain" in note)
    assert said.startswith("x=80 mm, x=100 mm: ")


def test_edges_of_a_long_pulse_are_one_wave():
    """A trapezoid of 160 µs through two Hopkinson bars, L/c = 0.314 ms: what is heard is what was
    sent, once, and its falling edge is no second wave."""
    t = np.arange(-1e-4, 1e-3, 2e-7)
    sent = np.interp(t, [0, 1e-5, 1.5e-4, 1.6e-4], [0.0, 1, 1, 0])
    got = np.interp(t - 1.6 / 5100, t, sent) + 0.003 * np.random.default_rng(4).standard_normal(
        len(t)
    )
    best = read_one(transmission_record(t, got, sent), 1.6, {}).best
    assert best.valid
    assert abs(best.time - 1.6 / 5100) <= 2 * best.error
    assert best.error < 0.05 * best.time


def test_a_copy_of_what_was_sent_that_comes_first_and_is_the_largest_went_straight():
    """A bar struck at one end: what comes back at twice the time is its echo, no slower wave."""
    t = np.arange(-1e-4, 1e-3, 2e-7)
    sent = np.sin(np.pi * np.clip(t / 6e-5, 0, 1)) ** 2
    got = np.interp(t - 2.2e-4, t, sent) - 0.42 * np.interp(t - 4.5e-4, t, sent)
    got += 0.003 * np.random.default_rng(5).standard_normal(len(t))
    best = read_one(transmission_record(t, got, sent), 1.178, {}).best
    assert abs(best.time - 2.2e-4) <= 1.96 * best.error
    assert best.valid
    assert best.error < 0.1 * best.time


def test_where_loss_is_seen_at_each_frequency_no_bound_of_q_is_told():
    """1/Q in proportion to f, from 0.1 to 2, known to 1 %: Q changes with frequency."""
    omega = 2 * np.pi * np.linspace(50, 1000, 40)
    k = omega / 2.0 * (1 + 0.5j * omega / 3000)
    error = 0.01 * k.imag
    found = mean_quality(omega, k, error, np.full(40, 2.0), np.full(40, 0.02), 0.1)
    assert not np.isfinite(found.at_least) or found.at_least < 1
    assert "above" not in found.reason


def test_what_comes_back_to_the_gauge_on_the_input_bar_is_not_sent_again():
    """The pulse of a Hopkinson bar, reflected at its specimen until the record ends, and what went
    through: L/c = 0.392 ms."""
    t, r = np.arange(-2e-5, 7e-4, 1e-6), np.random.default_rng(3)

    def pulse(t):
        return np.interp(t, [0, 1.5e-5, 1.6e-4, 1.8e-4], [0.0, 1, 1, 0])

    sent = pulse(t) - 0.8 * pulse(t - 3.9e-4) + 0.4 * pulse(t - 6e-4)
    got = 0.4 * pulse(t - 2.0 / 5100)
    sent, got = (u + 0.003 * r.standard_normal(len(t)) for u in (sent, got))
    best = read_one(transmission_record(t, got, sent), 2.0, {}).best
    assert best.valid
    assert abs(best.time - 2.0 / 5100) <= 2 * best.error
    assert best.error < 0.05 * best.time


@pytest.mark.parametrize("seed", [0, 1])
def test_noise_that_ends_with_an_amplifiers_band_is_no_signal(seed):
    """Noise of 6 % up to 50 kHz lies far below the highest frequencies, where a digitiser's white
    noise is looked for, and far above the wave's 10 kHz: its period is that of the quiet record to
    30 %, with or without what was sent, and so are the velocity's bars, a part of a period."""
    t, sent, got = record(150.0, guided=0.3, noise=0.0, bits=14)
    band = butter(2, 5e4, fs=1 / INTERVAL, output="sos")
    noise = sosfilt(band, np.random.default_rng(seed).standard_normal(len(t)))
    loud = got + 0.06 * np.abs(got).max() / noise.std() * noise
    for what in (sent, None):
        quiet = transmission_record(t, got, what).period
        assert transmission_record(t, loud, what).period == pytest.approx(quiet, rel=0.3)
    best = read_one(transmission_record(t, loud, sent), 0.12, {}).best
    assert best.valid
    assert abs(best.velocity - 150) < 2 * best.velocity_error


@pytest.mark.parametrize(("speed", "size"), [(500.0, 0.2), (500.0, 0.3), (600.0, 0.3)])
def test_a_small_wave_that_runs_into_the_direct_one_is_a_precursor(speed, size):
    """A P wave 1.7 times as fast, of 20 or 30 % of the S wave, runs into it over two wavelengths:
    one packet that breaks early. Apart, a wave so small is no rival, and so it is none here: the
    bar holds the S wave, with no word of which is meant, and not the P wave."""
    t, sent, got = record(speed, precursor=size, guided=0.2, crosstalk=0.0, creep=0.0)
    best = read_one(transmission_record(t, got, sent), 0.12, {}).best
    assert best.valid
    assert abs(best.velocity - speed) < 1.96 * best.velocity_error < 0.2 * speed


@pytest.mark.parametrize(("speed", "size", "over"), [(550.0, -0.2, 1.0), (350.0, 0.2, 1.15)])
def test_the_first_cycle_of_transducers_that_ring_is_no_precursor(speed, size, over):
    """Both resonate about where they are driven, so that cycles grow one after the other: what
    stands ahead of the largest may be the wave's own, and the bar reaches back to it."""
    t, sent, got = record(speed, precursor=size, guided=0.6, crosstalk=0.0, creep=0.0, noise=0.0)
    omega = 2 * np.pi * F * over
    b, a = bilinear([omega**2], [1, 2 * 0.25 * omega, omega**2], 1 / INTERVAL)
    heard = lfilter(b, a, lfilter(b, a, got))
    heard += 0.01 * np.abs(heard).max() * np.random.default_rng(1).standard_normal(len(t))
    best = read_one(transmission_record(t, heard, sent), 0.12, {}).best
    assert best.valid
    assert abs(best.velocity - speed) < 1.96 * best.velocity_error
