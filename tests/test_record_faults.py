"""The everyday faults of instruments, on a record whose truth is known: read rightly, or refused.

The law: a pulse that goes along eight receivers at c = 3000 m/s without loss or dispersion, so that
k = ω/c exactly, with white noise of a thousandth of its peak. With each fault the points are as
those without it: median error within a factor 3, 95 % bars that hold 90 % of them and more.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, get_window, lfilter

from wavesim.records.faults.hum import hum_at_rest
from wavesim.records.files import Layout, from_arrays
from wavesim.records.fitness import for_k_at_frequency
from wavesim.records.inspection import inspect
from wavesim.records.of_medium import RecordOfMedium
from wavesim.records.record import RecordError, record
from wavesim.verdict.record import attenuation, dispersion

SPEED, N = 3000.0, 8
T = np.arange(1000) * 5e-7
X = 0.02 + 0.005 * np.arange(N)


def ricker(t, f=5e4):
    u = (np.pi * f * (t - 1.5 / f)) ** 2
    return (1 - 2 * u) * np.exp(-u)


CLEAN = ricker(T[:, None] - X / SPEED) + 1e-3 * np.random.default_rng(1).standard_normal((1000, N))


def along(values, t=T, x=X, **layout):
    """Error of k over k, median; share within 95 % bars; how many valid; the record."""
    found = from_arrays({"t": t, "x": x, "values": values}, Layout(**layout))
    (one,) = attenuation([RecordOfMedium("a", found)], (1e4, 1e5), 24)
    points = one.points.take(one.points.valid)
    assert len(points), one.points.reason
    off = np.abs(points.k - points.omega / SPEED)
    return np.median(off / np.abs(points.k)), np.mean(off <= points.bar), len(points), one


BEST = along(CLEAN)[0]


def changed(change):
    values = CLEAN.copy()
    change(values)
    return values


def put(value, *where):
    return lambda v: v.__setitem__(where, value)


def swap(v):
    v[:, [1, 5]] = v[:, [5, 1]]


def spikes(v):
    v[[84, 200, 90, 500], [1, 3, 5, 5]] += 0.4


S = slice(None)
LATE = np.roll(CLEAN[:, 4], 3)
CURED = {
    "offset": (CLEAN + 0.1, "offset"),
    "offset of thirty peaks": (CLEAN + 30, "offset"),
    "offsets of their own": (CLEAN + 0.1 * np.arange(N), "offset"),
    "offset binary": ((np.round(CLEAN * 100) + 128).astype("u1"), "offset"),
    "hum": (CLEAN + 0.05 * np.sin(2 * np.pi * 50 * T + 1)[:, None], "drift"),
    "drift": (CLEAN + (T / T[-1])[:, None] ** 2, "drift"),
    "one of eight bits": (changed(put(np.round(CLEAN[:, 2] * 128) / 128, S, 2)), "quantised"),
    "fill value": (changed(put(1e20, 100, 3)), "fill value"),
    "ten fill values": (changed(put(-999, slice(90, 100), 3)), "fill value"),
    "spikes": (changed(spikes), "spikes"),
    "gap": (changed(put(np.nan, slice(90, 100), 3)), "gaps"),
    "stuck": (changed(put(CLEAN[100, 3], slice(100, 120), 3)), "stuck"),
    "dead": (changed(put(0.0, S, 3)), "dead"),
    "nothing but noise": (changed(put(np.roll(CLEAN[::-1, 0], 3) * 1e-3, S, 3)), "dead"),
    "duplicate": (changed(put(CLEAN[:, 2], S, 3)), "duplicate"),
    "reversed": (changed(put(-CLEAN[:, 4], S, 4)), "reversed"),
    "swapped": (changed(swap), "swapped"),
    "delayed": (changed(put(LATE, S, 4)), "delayed"),
    "mis-scaled": (changed(put(0.7 * CLEAN[:, 4], S, 4)), "mis-scaled"),
    "first clipped": (changed(put(np.clip(CLEAN[:, 0], -0.5, 0.5), S, 0)), "clipped"),
}


@pytest.mark.parametrize("name", CURED)
def test_a_fault_costs_nothing_and_is_said(name):
    values, what = CURED[name]
    error, inside, count, one = along(values)
    assert error < 3 * BEST
    assert inside >= 0.9
    assert count >= 22
    assert what in {finding.what for finding in one.origin.record.findings}
    assert one.origin.record.notes


def test_any_two_of_a_few_sparse_receivers_that_are_exchanged_are_put_back(rng):
    """Five of 0.4 wavelengths apart."""
    clean = ricker(T[:, None] - 0.02 * np.arange(1, 6) / SPEED, 6e4)
    clean += 1e-3 * rng.standard_normal(clean.shape)
    for a, b in zip(*np.triu_indices(5, 1), strict=True):
        values = clean.copy()
        values[:, [a, b]] = clean[:, [b, a]]
        found = from_arrays({"t": T, "x": 0.02 * np.arange(1, 6), "values": values})
        assert [f.what for f in found.findings] == ["swapped"], (a, b)


@pytest.mark.parametrize("size", [0.1, 1.0])
def test_hum_of_many_periods_is_taken_out(size):
    t, x = np.arange(4000) * 1e-4, 2 + 0.25 * np.arange(N)
    clean = ricker(t[:, None] - 0.15 - x / 300, 200.0)
    clean = clean + 1e-3 * np.random.default_rng(3).standard_normal(clean.shape)
    hum = size * np.sin(2 * np.pi * 49.97 * t + 0.3)[:, None]
    errors = []
    for values in (clean, clean + hum):
        found = from_arrays({"t": t, "x": x, "values": values})
        (one,) = attenuation([RecordOfMedium("a", found)], (60.0, 400.0), 24)
        points = one.points.take(one.points.valid)
        assert len(points) >= 22
        errors.append(np.median(np.abs(points.k * 300 / points.omega - 1)))
    assert errors[1] < 2 * errors[0]
    assert "hum" in {f.what for f in found.findings}


def test_multiples_of_the_mains_frequency_go_with_it(rng):
    """Twice of a rectifier, three, five and seven times of a saturated core."""
    t, x = np.arange(3000) * 5e-4 - 0.2, 5 + 3.0 * np.arange(8)
    u = ricker(t[:, None] - x / 220, 20)
    noise = 2e-3 * rng.normal(size=u.shape)
    hum = sum(
        size * np.sin(2 * np.pi * 50.02 * n * t[:, None] + rng.uniform(0, 6, 8))
        for n, size in ((1, 0.2), (2, 0.1), (3, 0.08), (5, 0.04), (7, 0.02))
    )
    left = record(u + noise + hum, t, x).values[0] - u - noise
    assert np.sqrt(np.mean(left**2)) < 1e-3


@pytest.mark.parametrize("tones", [(50,), (60, 120), (150,), (350,), (50, 100, 250)])
def test_a_steady_shaker_at_multiples_of_the_mains_frequency_is_no_hum(tones, rng):
    """Its phase runs on along the line, as no hum's does, or the mains' own frequency is not in it:
    nothing of it is taken out. 170 m/s, 12 receivers over 22 m, noise of 1 %."""
    t, x = np.arange(1000) * 5e-4, 2 + 2.0 * np.arange(12)
    u = sum(np.sin(2 * np.pi * f * (t[:, None] - x / 170)) for f in tones)
    u = u + 0.01 * rng.standard_normal(u.shape)
    assert np.abs(record(u, t, x).values[0] - u).max() < 0.02


def test_hum_is_taken_out_at_four_samples_to_its_period():
    """Sampled at 200 Hz, 50 Hz and its triple are one series of numbers."""
    t, x = np.arange(600) * 5e-3, 5.0 * np.arange(1, N + 1)
    clean = ricker(t[:, None] - 1.5 - x / 300, 12.0)
    clean = clean + 1e-3 * np.random.default_rng(3).standard_normal(clean.shape)
    hum = 0.2 * np.sin(2 * np.pi * 50 * t + 0.3)[:, None]
    found = from_arrays({"t": t, "x": x, "values": clean + hum})
    assert np.abs(found.values - clean).max() < 0.01


def test_a_tone_at_a_nyquist_frequency_just_below_the_mains_is_no_hum():
    """A part of a second sampled at 98 Hz, 49 Hz at most."""
    t = np.arange(60) / 98.0
    v = np.cos(2 * np.pi * 48.0 * t + 0.3)
    assert hum_at_rest(v, t, np.ones(len(t), bool), 1.0) is None


@pytest.mark.parametrize(("mains", "step"), [(50, 1e-3), (60, 2e-3)])
def test_a_wave_of_the_mains_frequency_in_coarse_steps_is_no_hum(mains, step):
    """Nothing of it stands before the wave, and its coda at the record's end was taken for hum: up
    to half of the wave's peak was taken out of it."""
    t, x = np.arange(1024) * 2e-4, 2.0 * np.arange(24)
    s = np.maximum(t[:, None] - 0.05 - 0.0012 * np.arange(24), 0)
    rings = np.sin(2 * np.pi * mains * s) * s * np.exp(-s / 0.05)
    size = np.geomspace(0.12, 0.009, 24) / rings.max()
    noise = 1.5e-4 * np.random.default_rng(5).standard_normal(rings.shape)
    values = np.round((size * rings - 0.0025 + noise) / step) * step
    found = from_arrays({"t": t, "x": x, "values": values})
    assert "hum" not in {f.what for f in found.findings}
    assert np.abs(found.values[0] - size * rings).max() < 2 * step


def test_no_fault_is_found_where_there_is_none():
    """Nor where a single sine begins and ends with a kink, between samples or on one."""
    assert from_arrays({"t": T, "x": X, "values": CLEAN}).findings == ()
    t = np.arange(-60, 240) * 1e-6
    tau = t[:, None] - np.array([1.0, 1.43, 1.77]) * 5e-5
    kinked = np.where((tau >= 0) & (tau <= 4e-5), np.sin(2 * np.pi * tau / 4e-5), 0.0)
    assert from_arrays({"t": t, "x": [0.1, 0.143, 0.177], "values": kinked}).findings == ()


def test_a_crest_cut_off_at_two_samples_is_seen_and_noise_alone_is_not(rng):
    """No two samples beside noise are alike by chance."""
    u = CLEAN * 0.9 ** np.arange(N)
    limit = np.sort(np.abs(u), axis=None)[-3]
    for values, what in ((u, []), (np.clip(u, -limit, limit), ["clipped"])):
        found = from_arrays({"t": T, "x": X, "values": values}).findings
        assert [f.what for f in found] == what


@pytest.mark.parametrize("seed", range(6))
def test_two_modes_are_no_fault_of_a_receiver_and_hide_none(seed):
    """Two dispersive modes that spread as r^-1/2, 3 % of noise: all stay but one that is late."""
    rng = np.random.default_rng(seed)
    t, x = np.arange(1000) * 1e-3, 5.0 + np.arange(rng.choice([12, 16, 24, 36]))
    f = np.fft.rfftfreq(8192, 1e-3)
    speeds = 150 + 150 / (1 + (f / 18) ** 2), 240 + 260 * np.exp(-f / 25)
    sent = np.fft.rfft(ricker(np.arange(8192) * 1e-3 - 0.03, 28.0))
    late = 0.012 * (np.arange(len(x)) == rng.integers(1, len(x) - 1))
    for delay in (0 * x, late):
        away = (size * np.exp(-2j * np.pi * f * (x[:, None] / c + delay[:, None]))
                for size, c in zip((1.0, 0.4), speeds, strict=True))  # fmt: skip
        u = (np.fft.irfft(sent * sum(away), 8192)[:, :1000] / np.sqrt(x[:, None])).T
        u = u / np.abs(u).max() + 0.03 * rng.standard_normal(u.shape)
        for layout, kept in ((Layout(), delay == 0), (Layout(as_recorded=True), delay < 1)):
            found = from_arrays({"t": t, "x": x, "values": u}, layout)
            assert found.x.tolist() == x[kept].tolist()
    with pytest.raises(RecordError, match="only along a line"):
        from_arrays({"t": t, "x": x, "values": u}, Layout(as_recorded=True, ring=True))


def test_two_waves_of_different_speed_make_no_receiver_mis_scaled():
    """What came with the pulse stands beside a wave that fades, and one of five is dead."""
    t = np.arange(4096) * 2e-6 - 4e-4
    x = np.array([0.1, 0.15, 0.2, 0.25, 0.3])

    def burst(s):
        own = np.sin(4e4 * np.pi * s) * np.sin(5e3 * np.pi * s) ** 2
        return np.where((s >= 0) & (s <= 2e-4), own, 0.0)

    for seed in range(8):
        both = 3 * burst(t)[:, None] + burst(t[:, None] - x / 250) * np.exp(-3 * x)
        both += 1e-2 * np.random.default_rng(seed).standard_normal(both.shape)
        both[:, 1] = 1e-6 * both[::-1, 1] / 3
        found = from_arrays({"t": t, "x": x, "values": both})
        assert {finding.what for finding in found.findings} == {"dead"}


@pytest.mark.parametrize("held", [2, 5])
def test_samples_there_several_times_are_taken_once(held):
    t = np.arange(held * len(T)) * 5e-7 / held
    error, _, _, one = along(np.repeat(CLEAN, held, axis=0), t)
    assert error == pytest.approx(BEST, rel=1e-6)
    assert len(one.origin.record.t) == len(T)


def test_rounded_axes_are_even_and_their_bars_hold_what_that_leaves_open():
    assert along(CLEAN.astype("f4"), T.astype("f4"), X.astype("f4"))[0] < 1.1 * BEST
    assert along(CLEAN, T + 1.6e9)[0] < 10 * BEST  # doubles of today's date: 0.24 us apart
    for digits in (7, 8):
        assert along(CLEAN, np.round(T, digits))[0] < 1.1 * BEST
    # Rates that are whole numbers come back whole: 2.4 MHz to 100 ns.
    found = from_arrays({"t": np.round(np.arange(1000) / 2.4e6, 7), "x": X, "values": CLEAN})
    assert abs(found.interval * 2.4e6 - 1) < 3 * found.interval_error + 1e-12
    with pytest.raises(RecordError, match=r"times are rounded to 1e-06 s.*give --interval"):
        from_arrays({"t": np.round(np.arange(1000) / 2.4e6, 6), "x": X, "values": CLEAN})


def test_a_record_that_begins_late_loses_the_receivers_that_it_cuts():
    t, x = T[50:], 0.02 + 0.005 * np.arange(24)
    noise = 1e-3 * np.random.default_rng(2).standard_normal((950, 24))
    error, inside, _, one = along(ricker(t[:, None] - x / SPEED) + noise, t, x)
    assert len(one.origin.record.x) < 24
    assert error < 1e-3
    # Errors of one record hang together over frequencies.
    assert inside > 0.7
    with pytest.raises(RecordError, match="begins inside the signal at all 8 receivers"):
        along(CLEAN[70:], T[70:])


def test_a_rumble_of_the_ground_is_no_signal_that_the_record_begins_inside():
    """Slow noise, as loud before the pulse as long after it, and no part of the pulse."""
    t, x = np.arange(2000) * 5e-7, 0.02 + 0.005 * np.arange(24)
    pulse = ricker(t[:, None] - 1e-5 - x / SPEED)
    for seed in range(4):
        white = np.random.default_rng(seed).standard_normal((3000, 24))
        rumble = lfilter(*butter(2, 1e4, fs=2e6), white, axis=0)[1000:]
        rumble *= 0.03 / rumble.std()
        assert not record(pulse + rumble, t, x).begun.any()
        cut = record((pulse + rumble)[90:], t[90:], x).begun
        late = t[90] - 1e-5 - x / SPEED - 1.5 / 5e4
        assert cut[np.abs(late) < 2e-6].all()
        assert not cut[late < -4e-5].any()


def test_a_first_row_of_zeros_beside_an_offset_is_left_out():
    """As some scopes write it; without an offset it is a frame like any other."""
    spoilt = CLEAN + 25.0
    spoilt[0] = 0.0
    found = record(spoilt, T, X)
    assert found.t[0] == T[1]
    assert np.abs(found.values[0] - CLEAN[1:]).max() < 1e-3
    assert len(record(np.r_[0 * CLEAN[:1], CLEAN[1:]], T, X).t) == len(T)


@pytest.mark.parametrize(
    ("values", "x", "message"),
    [
        (CLEAN + 1j * CLEAN, X, "complex values.*give one real component"),
        (np.clip(CLEAN, -0.5, 0.5), X, "flat tops at all 8 receivers: turn the gain down"),
        (CLEAN, X * 1e6, "faster than light.*--time-unit or --position-unit"),
        (CLEAN, X * 1e3, "faster than waves in any solid.*--time-unit or --position-unit"),
        (CLEAN, X * 1e-6, "slower than any wave.*--time-unit or --position-unit"),
        (ricker(T[:, None] - np.abs(X - 0.0375) / SPEED), X, r"name it with --source 0\.037"),
    ],
    ids=["complex", "clipped", "light", "mm", "us", "source within"],
)
def test_what_cannot_be_read_is_refused_for_its_cause(values, x, message):
    with pytest.raises(RecordError, match=message):
        along(values, x=x)


def ring(branches=8, nx=32):
    """Waves of ω = 2000 k both ways round a ring, at times that no frequency is whole in."""
    rng = np.random.default_rng(5)
    x, t = np.arange(nx) * 1e-3, np.arange(500) * 2.1e-7
    k = 2 * np.pi * np.arange(1, branches + 1) / (nx * 1e-3)
    phases = rng.uniform(0, 2 * np.pi, (2, branches))
    u = sum(np.cos(s * k * x[:, None] - 2000 * k * t[:, None, None] + p).sum(axis=-1)
            for s, p in zip((1, -1), phases, strict=True))  # fmt: skip
    return t, x, u + 1e-3 * rng.standard_normal(u.shape)


@pytest.mark.parametrize("fault", ["none", "offset", "fill", "twice", "float32", "int16"])
def test_a_ring_with_faults_is_read_as_without(fault):
    t, x, u = ring()
    if fault == "offset":
        u = u + 30
    elif fault == "fill":
        u[300, [5, 20]] = 1e20
    elif fault == "twice":
        u, x = np.c_[u, u[:, 0]], np.r_[x, 0.032]
    elif fault == "float32":
        t, x = t.astype("f4"), x.astype("f4")
    elif fault == "int16":
        u = np.round(u * 2000).astype("i2")
    found = from_arrays({"t": t, "x": x, "values": u}, Layout(ring=True))
    (one,) = dispersion([RecordOfMedium("ring", found)], "harmonic", 1700.0)
    points = one.points.take(one.points.valid)
    assert len(points) == 8
    assert np.abs(points.omega / (2000 * points.k) - 1).max() < 1e-5


def test_channels_round_a_ring_are_held_against_its_waves():
    t, x, u = ring()
    u[:, 7] *= -1
    found = from_arrays({"t": t, "x": x, "values": u}, Layout(ring=True))
    assert [(f.what, f.where) for f in found.findings] == [("reversed", "x = 0.007 m")]


BAD = {
    "dead": lambda u, j: 0.3,
    "missing": lambda u, j: np.nan,
    "half": lambda u, j: 0.5 * u[:, j],
    "late": lambda u, j: np.roll(u[:, j], 7),
    "exchanged": lambda u, j: u[:, -j],
}


@pytest.mark.parametrize("bad", BAD)
def test_a_ring_tells_what_a_bad_receiver_lacks(bad):
    """Frequencies are as of the whole ring to 1e-5, whatever one or two receivers show."""
    t, x, u = ring()
    spoilt = u.copy()
    spoilt[:, 3] = BAD[bad](u, 3)
    if bad == "exchanged":
        spoilt[:, -3] = u[:, 3]
    found = from_arrays({"t": t, "x": x, "values": spoilt}, Layout(ring=True))
    whole = from_arrays({"t": t, "x": x, "values": u}, Layout(ring=True))
    clean, points = (
        dispersion([RecordOfMedium("ring", one)], "harmonic", 1700.0)[0].points
        for one in (whole, found)
    )
    clean, points = clean.take(clean.valid), points.take(points.valid)
    assert np.array_equal(points.k, clean.k)
    assert np.abs(points.omega / clean.omega - 1).max() < 1e-5
    assert "x = 0.003" in found.findings[-1].where


@pytest.mark.parametrize("noise", [1e-3, 0.03])
def test_magnitudes_are_no_signals(noise, rng):
    """√(a² + b²) of two normal parts is Rayleigh's at rest."""
    u = np.exp(-(((T[:, None] - 1.5e-4 - X / SPEED) / 2e-5) ** 2)) * np.exp(1j * np.arange(N))
    u = u + noise * (rng.normal(size=u.shape) + 1j * rng.normal(size=u.shape))
    with pytest.raises(RecordError, match="values are magnitudes"):
        record(np.abs(u), T, X)
    record(u.real + 1.9 * noise, T, X)


def test_a_frame_written_twice_counts_once():
    found = record(np.insert(CLEAN, 200, CLEAN[200], axis=0), np.insert(T, 200, T[200]), X)
    assert found.t == pytest.approx(T, rel=1e-12)
    assert [f.what for f in found.findings] == ["frames twice"]


def test_a_ring_driven_within_the_record_asks_when_it_is_free():
    t, x, u = ring()
    driven = u * np.minimum(1, np.maximum(0, t / t[-1] - 0.1) * 3)[:, None] ** 2
    found = from_arrays({"t": t, "x": x, "values": driven}, Layout(ring=True))
    with pytest.raises(
        RecordError, match="name the time from which on none does with --quiet-from"
    ):
        dispersion([RecordOfMedium("ring", found)])


def test_inspection_tells_what_is_wrong_and_what_can_be_done():
    values = CURED["reversed"][0] + 0.1
    found = inspect(record(values, T, X))
    assert {f.what: f.done for f in found.findings} == {"offset": "cured", "reversed": "cured"}
    summary = found.summary()
    assert summary["usable"] == {"attenuation": "", "dispersion": "", "pulse": ""}
    assert [c["position_m"] for c in summary["receivers"]] == pytest.approx(list(X))
    assert summary["receivers"][0]["noise"] == pytest.approx(1e-3, rel=0.2)


def test_what_was_done_to_all_channels_is_told_or_refused(rng):
    """Channels divided by their size, or by a gain control, have lost their decay, rectified ones
    their frequencies."""
    x, t = 0.02 + 0.005 * np.arange(8), np.arange(1000) * 5e-7
    late = t[:, None] - 4e-5 - x / 3000
    a = (np.pi * 5e4 * late) ** 2
    u = (1 - 2 * a) * np.exp(-a) * np.exp(-8 * x) + 1e-3 * rng.normal(size=late.shape)
    own = record(u / np.abs(u).max(axis=0), t, x)
    assert "normalised" in [one.what for one in own.findings]
    with pytest.raises(RecordError, match="divided by its own"):
        for_k_at_frequency(own)
    assert "normalised" not in [one.what for one in record(u, t, x).findings]
    levelled = np.stack([np.convolve(v**2, np.ones(150), "same") for v in u.T], axis=1) ** 0.5
    for many in (u / u.std(axis=0), u / np.sqrt(np.mean(u**2, axis=0)), u / levelled):
        with pytest.raises(RecordError, match="amplitudes along them tell nothing"):
            for_k_at_frequency(record(many, t, x))
    burst = np.sin(2 * np.pi * 5e4 * late) * np.exp(-((late / 4e-5) ** 2))
    full = (burst - burst.min()) / np.ptp(burst)  # from end to end of a range, and not rectified
    assert "offset" in [one.what for one in record(full, t, x).findings]
    burst += 1e-3 * rng.normal(size=late.shape)
    with pytest.raises(RecordError, match="rectified"):
        record(np.abs(burst), t, x)
    assert len(record(burst, t, x).x) == 8
    # Pulses that swing down by a tenth, above an offset of that: a P wave ahead of its S wave.
    one_sided = np.exp(-((late / 8e-6) ** 2)) - 0.12 * np.exp(-(((late - 1.5e-5) / 8e-6) ** 2))
    ahead = 0.2 * np.roll(one_sided, -120, axis=0)
    above = one_sided + ahead + 0.12 + 0.02 * rng.normal(size=late.shape)
    assert above[:, :1].min() > -0.02
    assert len(record(above[:, :1], t, x[:1], placed=False).x) == 1


def test_noise_that_a_wave_brings_with_it_is_no_gain(rng):
    """Fine waves scattered behind the wave, that die away as it goes on; under e^{at} all grows."""
    x, t = 0.02 + 0.005 * np.arange(8), np.arange(1000) * 5e-7
    late = t[:, None] - 1.8e-4 - x / 3000
    a = (np.pi * 5e4 * late) ** 2
    u = (1 - 2 * a) * np.exp(-a) * np.exp(-8 * x)
    coda = 3e-3 * np.exp(-1e3 * np.maximum(late, 0.0)) * (late > 0)
    u += np.hypot(3e-4, coda) * rng.normal(size=late.shape)
    for values, gained in ((u, False), (u * np.exp(6e3 * t)[:, None], True)):
        told = [one.what for one in record(values, t, x).findings]
        assert ("normalised" in told) is gained


def test_an_exponential_window_over_all_samples_is_a_gain(rng):
    """e^{-at} lessens the noise too, before the wave as well: α would be off by a over c."""
    x, t = 0.02 + 0.005 * np.arange(16), np.arange(1200) * 5e-7
    u = ricker(t[:, None] - 2e-4 - x / 500) + 1e-3 * rng.normal(size=(1200, 16))
    assert not record(u, t, x).findings
    bent = record(u * np.exp(-5e3 * t)[:, None], t, x)
    assert "normalised" in [one.what for one in bent.findings]
    with pytest.raises(RecordError, match="a window"):
        for_k_at_frequency(bent)


@pytest.mark.parametrize("window", ["hann", "blackman", ("tukey", 0.5), ("gaussian", 200)])
def test_a_window_is_told_by_the_noise_behind_a_wave_that_comes_early(window, rng):
    """It lessens noise to nothing, ever faster; what a wave leaves behind dies away e^{-t/s}."""
    x, t = 0.02 + 0.005 * np.arange(8), np.arange(1200) * 5e-7
    late = t[:, None] - 5e-5 - x / 3000
    u, noise = ricker(late), 1e-3 * rng.normal(size=late.shape)
    coda = np.hypot(1, 10 * np.exp(-np.maximum(late, 0) / 1e-4) * (late > 0))
    assert "normalised" not in [one.what for one in record(u + coda * noise, t, x).findings]
    bent = record((u + noise) * get_window(window, 1200, False)[:, None], t, x)
    assert "normalised" in [one.what for one in bent.findings]


def test_the_foot_of_a_wave_of_few_samples_a_period_is_no_window(rng):
    """Of constant Q = 5, Kramers and Kronig's: high frequencies come first, loud as noise that
    grows; under Hann's window noise grows from the first sample on."""
    x, f0, dt = 0.02 * np.arange(1, 61) / 60 + 0.02, 1e5, 1 / 3.9e5
    omega = 2 * np.pi * np.fft.rfftfreq(2048, dt)
    omega[0] = 1.0
    k = omega / 300 * (1 - np.log(omega / (2 * np.pi * f0)) / (np.pi * 5)) + omega * 1j / 3000
    late = (np.arange(2048) * dt - 1.1e-4) * f0
    sent = np.exp(-((late / 2.3) ** 2)) * np.cos(2 * np.pi * late)
    each = np.conj(np.conj(np.fft.rfft(sent))[:, None] * np.exp(1j * k[:, None] * (x - x[0])))
    u = np.fft.irfft(each, axis=0)[:190] + 1e-3 * rng.normal(size=(190, 60))
    t = dt * np.arange(190)
    assert "normalised" not in [one.what for one in record(u, t, x).findings]


def test_few_receivers_that_are_left_of_many_with_flat_tops_tell_of_no_several_waves():
    """Of twelve, seven clipped: five are read. Eight: refused."""
    x, t = 0.02 + 0.005 * np.arange(12), np.arange(1000) * 5e-7
    u = ricker(t[:, None] - x / 3000, 5e4) * np.exp(-20 * x)
    for many in (7, 8):
        values = u.copy()
        for j in range(many):
            values[:, j] = np.minimum(u[:, j], 0.6 * u[:, j].max())
        found = record(values, t, x)
        assert found.clipped.sum() == many
        if many == 7:
            assert len(for_k_at_frequency(found).x) == 5
        else:
            with pytest.raises(RecordError, match="5 receivers at least"):
                for_k_at_frequency(found)
