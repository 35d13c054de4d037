"""Records that break: frames lost while times go on, a side of a line late, values wrapped round.

The law: pulses that go along a line at c = 3000 m/s without loss or dispersion, so that k = ω/c.
"""

from __future__ import annotations

import numpy as np
import pytest
from pulses import ricker
from runs import call
from test_waves_along_line import passing

from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
from wavesim.records.record import RecordError, record

SPEED = 3000.0
T = np.arange(1000) * 5e-7
X = 0.02 + 0.005 * np.arange(16)


def noisy(u, part=1e-3):
    return u + part * np.random.default_rng(1).normal(size=u.shape)


def line(modes=1, x=X):
    waves = [(lambda w: w / SPEED, lambda r: 1.0), (lambda w: w / 1900, lambda r: 0.6)]
    return noisy(passing(x, waves[:modes], 5e4, T))


def held(points, share=0.9):
    own = points.take(points.valid)
    assert np.mean(np.abs(own.omega - SPEED * own.k) <= own.bar) >= share
    return own


BROKEN = {
    "lost": lambda u: np.delete(u, slice(90, 93), axis=0),
    "a block lost": lambda u: np.delete(u, slice(90, 115), axis=0),
    "twice": lambda u: np.concatenate([u[:90], u[86:]]),
    "exchanged": lambda u: np.concatenate([u[:90], np.roll(u[90:], 1, axis=1)]),
}


@pytest.mark.parametrize("how", BROKEN)
def test_what_breaks_off_at_all_receivers_at_once_is_no_wave(how):
    """Times that only count frames go on where frames are lost: refused, with the time."""
    u = BROKEN[how](line())
    with pytest.raises(RecordError, match=r"t = 4\.[45].*e-05 to .* break off at once"):
        record(u, T[: len(u)] if len(u) <= len(T) else 5e-7 * np.arange(len(u)), X)


@pytest.mark.parametrize("frames", [16, 24])
@pytest.mark.parametrize("count", [4, 16])
def test_blocks_of_frames_that_change_places_break_off_three_times(frames, count):
    """As packets that come in another order: one break is near another."""
    own, at = np.arange(len(T)), 90 - frames
    own[at : at + 2 * frames] = np.roll(own[at : at + 2 * frames], frames)
    u = line(x=X[:count])
    with pytest.raises(RecordError, match="break off at once"):
        record(u[own], T, X[:count])


def test_a_ring_that_loses_a_frame_is_refused():
    """Standing waves of all wavenumbers, c = 2000 m/s."""
    x, t = np.arange(32) * 1e-3, np.arange(500) * 2e-7
    k = 2 * np.pi * np.arange(1, 13) / 0.032
    phase = np.random.default_rng(2).uniform(0, 2 * np.pi, len(k))
    u = noisy(np.cos(np.outer(t, 2000 * k)) @ np.cos(np.outer(k, x) + phase[:, None]))
    assert not record(u, t, x, ring=True).findings
    with pytest.raises(RecordError, match="break off at once"):
        record(np.delete(u, 200, axis=0), t[:-1], x, ring=True)


def test_a_step_that_all_receivers_pick_up_is_no_break():
    """Of one sign and one shape, or at receivers at rest too."""
    step = 0.3 * (np.arange(len(T)) >= 92)[:, None]
    gains = np.random.default_rng(3).uniform(0.5, 1.5, len(X))
    for pick_up in (step, step * gains, step * gains * (-1) ** np.arange(len(X))):
        record(line() + pick_up, T, X)


def on_another_clock(ratio):
    """The line by its nearest samples at an interval so many times as long, and the times there."""
    t = T[0] + ratio * 5e-7 * np.arange(int((len(T) - 1) / ratio))
    return line()[np.rint((t - T[0]) / 5e-7).astype(int)], t


def test_a_record_put_on_a_finer_clock_by_its_nearest_samples_is_taken_back():
    """Each sample once, at the interval of its own clock: within what rounded times leave open."""
    one = record(*on_another_clock(0.77), X)
    assert one.findings[0].what == "samples repeated"
    assert one.interval == pytest.approx(5e-7, rel=3 * one.interval_error)
    assert one.interval_error < 1e-3
    held(in_time(one, method="auto"))


@pytest.mark.parametrize("ratio", [1.07, 1.3])
def test_a_record_put_on_a_coarser_clock_by_its_nearest_samples_is_refused(ratio):
    """Frames δ late leave parts of a wave at other frequencies, with its k: no wave is there."""
    with pytest.raises(RecordError, match="off their times by"):
        record(*on_another_clock(ratio), X)


def test_a_clock_that_jitters_is_refused_and_noise_that_all_receivers_share_is_none(rng):
    """Each frame a tenth of an interval off its time; or a signal of its own added at all."""
    late = 0.1 * 5e-7 * rng.normal(size=len(T))
    with pytest.raises(RecordError, match="off their times by"):
        record(noisy(ricker((T + late)[:, None] - X / SPEED, 5e4, 3e-5)), T, X)
    record(line() + 0.02 * rng.normal(size=(len(T), 1)), T, X)


def test_bars_hold_a_clock_that_jitters_a_little(rng):
    """Each frame a thirtieth of an interval off its time: a noise that goes with the slope."""
    late = 5e-7 / 30 * rng.normal(size=len(T))
    u = noisy(ricker((T + late)[:, None] - X / SPEED, 5e4, 3e-5))
    assert len(held(in_time(record(u, T, X), method="auto"))) > 20


def test_edges_sharper_than_an_interval_are_no_clock_that_jitters():
    """Square pulses of 16 µs that go on without dispersion, two intervals from each of eight
    receivers to the next: all frames are of their times."""
    t, x, speed = T[:400], X[:8], 5000.0
    since = t[:, None] - x / speed - 3e-5
    points = in_time(record(noisy(1.0 * ((since > 0) & (since < 1.6e-5))), t, x), method="auto")
    own = points.take(points.valid)
    assert len(own) > 5
    assert np.mean(np.abs(own.omega - speed * own.k) <= own.bar) >= 0.9


@pytest.mark.parametrize("fault", ["reversed", "delayed"])
def test_a_side_of_a_line_is_told_beside_two_modes(fault):
    """Seven of sixteen receivers of two modes turned round, or ten samples late and left out."""
    u = line(2)
    ours = u.copy()
    ours[:, :7] = -u[:, :7] if fault == "reversed" else np.roll(u[:, :7], 10, axis=0)
    found = record(ours, T, X)
    assert [one.what for one in found.findings] == [fault]
    if fault == "reversed":
        assert found.values[0] * np.sign(np.sum(found.values[0, :, 0] * u[:, 0])) == (
            pytest.approx(u)
        )
    else:
        assert len(found.x) == 9


@pytest.mark.parametrize("late", [{4: 5e-6}, {4: -5e-6}, {2: 3e-6, 7: 6e-6}])
def test_receivers_late_or_early_by_themselves_are_not_out_of_order(late):
    """One or two of ten, by several times what passes from one to the next: these are left out."""
    delay = np.array([late.get(j, 0.0) for j in range(10)])
    found = record(noisy(ricker(T[:, None] - X[:10] / SPEED - delay, 5e4, 2e-5)), T, X[:10])
    assert [one.what for one in found.findings] == ["delayed"]
    assert found.x == pytest.approx(np.delete(X[:10], list(late)))


@pytest.mark.parametrize("late", [1e-3, 1e-2, 0.1])
def test_bars_hold_a_side_that_is_a_little_late(late):
    """A part of a period of 20 µs: a line through two parallel ones is of neither's slope."""
    u = np.stack([ricker(T, 5e4, 3e-5 + p / SPEED + 2e-5 * late * (p > 0.05)) for p in X], axis=1)
    points = in_time(record(noisy(u), T, X), method="fft")
    assert len(held(points)) > 20


def test_slopes_of_modes_are_no_noise_in_a_long_record():
    """30,000 frames of which 500 hold the pulse, 2 % of noise: neighbouring frequencies are so
    close that noise alone tells their k apart."""
    u = np.zeros((30_000, 8))
    u[15_000:16_000] = passing(X[:8], [(lambda w: w / SPEED, lambda r: 1.0)], 5e4, T)
    points = in_time(record(noisy(u, 0.02), 5e-7 * np.arange(len(u)), X[:8]), method="fft")
    assert len(held(points)) > 40


WRAPPED = {
    "signed read as unsigned": lambda u: np.round(3e4 * u).astype(np.int16).astype(np.uint16),
    "8 bits": lambda u: np.round(100 * u).astype(np.int8).astype(np.uint8),
    "overflow": lambda u: np.round(4.5e4 * u).astype(np.int64).astype(np.int16),
    "phase": lambda u: np.angle(np.exp(5j * u)),
}


@pytest.mark.parametrize("how", WRAPPED)
def test_wrapped_values_are_put_right(how):
    """Up to a factor and an offset they are the signals that were."""
    u = line()
    found = record(WRAPPED[how](u), T, X)
    assert found.findings[0].what == "wrapped"
    right = found.values[0]
    factor = np.sum(right * u) / np.sum(u * u)
    assert np.abs(right / factor - u).max() < 0.02
    assert not any(one.what == "wrapped" for one in record(np.round(100 * u), T, X).findings)


GAINS = {
    "as it is": lambda u: 0 * u + 1,
    **{
        f"automatic, of {n} frames": lambda u, n=n: (
            np.stack([np.convolve(v**2, np.ones(n) / n, "same") for v in u.T], axis=1) ** -0.5
        )
        for n in (20, 60, 200)
    },
    "e^at": lambda u: np.exp(np.arange(len(u)) / len(u))[:, None],
    "t": lambda u: np.arange(len(u))[:, None] / len(u),
}


@pytest.mark.parametrize("how", GAINS)
def test_a_gain_that_changes_in_time_shows_in_the_noise(how):
    """That of an instrument is as loud all through, before the signal, beneath it and after."""
    found = record(line() * GAINS[how](line()), T, X)
    assert ("normalised" in {one.what for one in found.findings}) == (how != "as it is")


def test_units_of_a_field_shot_are_those_of_the_field(tmp_path):
    """A pulse of 20 Hz at 200 m/s, receivers 2 m apart: hertz and metres, no 0.02 kHz."""
    x, t = 10.0 + 2 * np.arange(12), np.arange(1000) * 1e-3
    u = ricker(t[:, None] - x / 200, 20, 0.08)
    np.savez(tmp_path / "shot.npz", t=t, x=x, values=noisy(u))
    said = call("attenuation", tmp_path / "shot.npz", "--band", 10, 30)
    assert said.exit_code == 0
    assert all(unit in said.output for unit in ("Hz", "dB/m", "rad/m"))
    assert not any(unit in said.output for unit in ("kHz", "dB/mm", "rad/mm"))


def test_receivers_in_another_order_than_their_positions_are_told():
    """Odd channels before even ones, or each card of eight the other way round: by no wave."""
    u = line()
    for order in (np.r_[0:16:2, 1:16:2], np.r_[7:-1:-1, 15:7:-1]):
        with pytest.raises(RecordError, match="do not stand in the order of their positions"):
            record(u[:, order], T, X)
    record(u[:, ::-1], T, X)  # as a wave that comes from the other side


def test_a_ring_of_which_a_side_is_reversed_is_turned_round_and_a_late_one_told():
    """Standing waves of all wavenumbers, c = 2000 m/s; 12 of 32 receivers."""
    x, t = np.arange(32) * 1e-3, np.arange(500) * 2e-7
    k = 2 * np.pi * np.arange(1, 13) / 0.032
    phase = np.random.default_rng(2).uniform(0, 2 * np.pi, len(k))
    u = noisy(np.cos(np.outer(t, 2000 * k)) @ np.cos(np.outer(k, x) + phase[:, None]))
    ours = u.copy()
    ours[:, 20:] *= -1
    found = record(ours, t, x, ring=True)
    assert [one.what for one in found.findings] == ["reversed"]
    assert found.values[0] == pytest.approx(u)
    ours[3:, 20:] = -ours[:-3, 20:]
    with pytest.raises(RecordError, match=r"from x = 0.02 m on are 3\S* frames later"):
        record(ours[3:], t[3:], x, ring=True)


def test_samples_that_are_blank_within_a_signal_are_missing():
    """Twelve of one receiver, as of a beam that lost its spot."""
    u = line()
    u[95:107, 8] = 0.0
    found = record(u, T, X)
    assert {one.what for one in found.findings} >= {"stuck"}
    assert found.broken[8]


def test_times_that_are_all_alike_ask_for_the_interval():
    """Seconds since 1970 in single precision are 128 s apart."""
    with pytest.raises(RecordError, match="hold none between; give --interval"):
        record(line(), (1.7e9 + T).astype(np.float32), X)


def test_compressed_samples_are_refused():
    """µ-law and decibels hold less noise on crests than at rest; no other record here does."""
    u = line()
    law = np.sign(u) * np.log1p(255 * np.abs(u)) / np.log(256)
    for samples in (np.round(127 * law), 20 * np.log10(np.abs(u) + 1e-4)):
        with pytest.raises(RecordError, match="compressed"):
            record(samples, T, X)


@pytest.mark.parametrize("beside", [0.1, 0.2, 0.3])
def test_a_short_pulse_between_quantised_rests_keeps_its_clock(beside):
    """Frames at rest are equal by right, and so is one at a crest: no sample was held."""
    i = np.arange(300)[:, None]
    for per_period in np.linspace(4, 20, 60):
        late = (i - 100.3 - beside * per_period * np.arange(2)) / per_period
        u = np.round(20 * np.exp(-(late**2)) * np.cos(2 * np.pi * late)) / 20
        found = record(u, 1e-6 * i[:, 0], 0.01 + 0.002 * np.arange(2))
        assert len(found.t) == 300
        assert np.isclose(found.interval, 1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_bursts_at_one_receiver_at_a_time_are_no_clock_of_all(seed):
    """As the speckle of a laser's spot makes them: the noise of one is along its own slope."""
    rng = np.random.default_rng(seed)
    u = line()
    for j in range(16):
        for at in rng.integers(0, 990, 3):
            u[at : at + 4, j] += rng.normal(0, 1, 4)
    held(in_time(record(u, T, X), method="auto"))


@pytest.mark.parametrize("gone", [[0], range(900, 960), [*range(700, 703), *range(990, 1000)]])
def test_frames_lost_where_all_is_quiet_take_nothing_along(gone):
    u = line()
    whole, u[list(gone)] = in_time(record(u, T, X), method="auto"), np.nan
    points = held(in_time(record(u, T, X), method="auto"))
    assert len(points) > 0.9 * whole.valid.sum()


def test_noise_of_a_dead_channel_makes_no_clock_jitter():
    """Eight receivers of a lossy pulse, one of noise alone: it was laid through waves, and left
    them along their own slope, as a clock would, in one record of ten."""
    omega = 2 * np.pi * np.fft.rfftfreq(4096, 1e-6)
    x = 0.03 + 0.005 * np.arange(8)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        tone, speed, loss = rng.uniform([4e4, 1500, 2], [6e4, 3200, 8])
        w = omega / (2 * np.pi * tone)
        k = omega / speed * (1 + rng.uniform(-0.04, 0.04) * np.minimum(w, 3))
        k = k - 1j * loss * np.minimum(w, 3)
        spectrum = w**2 * np.exp(-(w**2) - 6e-5j * omega)
        u = np.fft.irfft(spectrum[:, None] * np.exp(-1j * k[:, None] * x), axis=0)[:1200]
        u = noisy(u / np.abs(u).max(), 3e-3)
        dead = int(rng.integers(1, 7))
        u[:, dead] = 1e-4 * rng.normal(size=len(u))
        found = record(u, 1e-6 * np.arange(1200), x)
        assert x[dead] not in found.x
        assert len(found.x) == 7


def test_frames_that_a_restart_wrote_again_are_there_once():
    """A program that goes on from its last stored state writes again what came after it."""
    u = line()
    again = np.r_[:120, 90:400, 380:1000]
    found = record(u[again], T[again], X)
    (one,) = found.findings
    assert (one.what, one.size) == ("frames twice", "50 frames")
    np.testing.assert_array_equal(found.values[0], u)
    other = u[again] + np.where(np.arange(len(again)) < 120, 1e-3, 0)[:, None]
    with pytest.raises(RecordError, match="times must ascend"):
        record(other, T[again], X)


@pytest.mark.parametrize("which", [slice(8, 16), slice(0, 16, 3)])
def test_channels_of_a_slower_clock_filled_in_are_left_out(which):
    """Each sample held until the next is late by half the slower interval, and no flat top."""
    u = line()
    u[:, which] = np.repeat(u[::4, which], 4, axis=0)
    found = record(u, T, X)
    (one,) = found.findings
    assert (one.what, one.size) == ("samples held", "4 times")
    np.testing.assert_array_equal(found.x, np.delete(X, which))
    held(in_time(found, method="auto"))


def test_a_late_block_of_a_chain_s_sites_shows_each_wave_beside_its_own():
    """ω = 4·10⁶ sin(ka/2); 14 of 48 sites 0.4 µs late. Of the chain alone nothing is told."""
    rng, x, t = np.random.default_rng(6), 1e-3 * np.arange(48), np.arange(900) * 2.5e-7
    k = 2 * np.pi * np.arange(1, 22) / 0.048
    omega = 4e6 * np.sin(k * 5e-4)
    late = np.where((x > 0.0095) & (x < 0.0235), 4e-7, 0.0)
    for tau in (0.0 * x, late):
        u = np.zeros((900, 48))
        for sign in (1, -1):
            for q, w, p in zip(k, omega, rng.uniform(0, 6.28, len(k)), strict=True):
                u += np.cos(sign * q * x - w * (t[:, None] - tau) + p)
        own = record(noisy(u, 1e-2), t, x, ring=True, lattice=True)
        if not tau.any():
            assert in_time(own).valid.sum() >= 20
            continue
        with pytest.raises(RecordError, match="wavenumbers beside its own"):
            in_time(own)
