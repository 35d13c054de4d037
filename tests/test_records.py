"""Records from anywhere: what is read, what is remedied, what is refused and in which words."""

from __future__ import annotations

import dataclasses

import h5py
import numpy as np
import pytest
from chains import MassInMass

from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
from wavesim.records.files import Layout, from_arrays, read, write
from wavesim.records.record import RecordError, record
from wavesim.records.synthetic import Pulse, Spoil, positions, synthesize

CHAIN = MassInMass(0.01, 1e6, 0.01, 2e5, 0.005)
T = np.linspace(0, 0.04, 1600)
X = positions(61, 0.01)


@pytest.fixture(scope="module")
def made():
    return synthesize(CHAIN, T, X, Pulse(1500.0, 0.3), 0.61, ring=True, lattice=True)


def same(found, made, accuracy=0.0):
    assert found.x == pytest.approx(made.x, rel=1e-8, abs=1e-12)
    assert found.t == pytest.approx(made.t, rel=1e-7, abs=1e-10)
    assert np.abs(found.values - made.values).max() <= accuracy * np.abs(made.values).max()


def test_the_same_record_from_every_kind_of_file(tmp_path, made):
    write(tmp_path / "a.npz", made)
    again = read(tmp_path / "a.npz")
    same(again, made)
    assert again.ring
    assert again.quiet_from == made.quiet_from
    assert again.sources == (0.3,)
    assert np.array_equal(again.answer["omega"], made.answer["omega"])
    write(tmp_path / "a.csv", made)
    same(read(tmp_path / "a.csv"), made, 1e-8)
    semicolons = (tmp_path / "a.csv").read_text().replace(",", ";")
    (tmp_path / "b.txt").write_text("# of a laboratory\n" + semicolons)
    same(read(tmp_path / "b.txt"), made, 1e-8)
    np.save(tmp_path / "a.npy", made.values[0])
    same(read(tmp_path / "a.npy", Layout(interval=T[1], spacing=0.01)), made)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["scan/velocity"], file["scan/time"], file["scan/x"] = made.values[0].T, T, X
    # Found by name and shape, the other way round: receivers first.
    same(read(tmp_path / "a.h5"), made)
    same(from_arrays({"u": made.values[0], "t": T, "x": X}), made)


def passing(rng, receivers=24, frames=600):
    """A pulse that passes receivers 5 mm apart at 2500 m/s, and noise; (frames, receivers)."""
    t, x = 1e-6 * np.arange(frames)[:, None], 5e-3 * np.arange(receivers)
    at = (np.pi * 4e4 * (t - 6e-5 - x / 2500)) ** 2
    return (1 - 2 * at) * np.exp(-at) + 0.01 * rng.standard_normal((frames, receivers))


def test_an_array_lies_as_it_begins_at_rest():
    """An interval and a spacing tell no axis: frames are those of which the first are at rest, of
    few receivers and of more than there are frames. A field that spreads from its middle is at
    rest at its ends: that asks."""
    rng, steps = np.random.default_rng(1), {"dt": 1e-6, "dx": 5e-3}
    few, many = passing(rng), passing(rng, 300, 250)
    for stored, u in ((few, few), (few.T, few), (many, many)):
        assert np.array_equal(from_arrays({"u": stored} | steps).values[0], u)
    i, j = np.arange(40)[:, None], np.arange(300)
    spreads = sum(np.exp(-(((j - 150 + way * i) / 6) ** 2)) for way in (1, -1))
    with pytest.raises(RecordError, match="--receivers 40 or --receivers 300"):
        from_arrays({"u": spreads} | steps)


def test_what_never_rests_lies_as_it_is_said_to():
    """Of waves all along the record: frames down where they are the more; else --receivers asks,
    or a number of the file's that is called so tells."""
    i, j = np.arange(300)[:, None], np.arange(40)
    u, steps = np.cos(0.3 * i - 0.4 * j) + np.cos(0.2 * i + 0.3 * j), {"dt": 1e-6, "dx": 5e-3}
    assert from_arrays({"u": u} | steps).values.shape[-2:] == (300, 40)
    with pytest.raises(RecordError, match="--receivers 40 or --receivers 300"):
        from_arrays({"u": u.T} | steps)
    for more, layout in (({}, Layout(receivers=40)), ({"nch": 40}, Layout())):
        assert np.array_equal(from_arrays({"u": u.T} | steps | more, layout).values[0], u)
    with pytest.raises(RecordError, match="--receivers 7: the record is of shape"):
        from_arrays({"u": u} | steps, Layout(receivers=7))


def test_a_fibres_file_is_read_by_its_own_names(tmp_path):
    """PRODML: microseconds since 1970, a spatial sampling interval with its unit of measure."""
    u = passing(np.random.default_rng(3)).astype("f4")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("Acquisition")
        group.attrs["SpatialSamplingInterval"], group.attrs["SpatialSamplingInterval.uom"] = 5, "mm"
        group["Raw[0]/RawData"] = u.T
        group["Raw[0]/RawDataTime"] = 1_700_000_000_000_000 + np.arange(600)
    found = read(tmp_path / "a.h5")
    assert np.array_equal(found.values[0], u)
    assert found.t == pytest.approx(1e-6 * np.arange(600), abs=1e-12)
    assert found.x == pytest.approx(5e-3 * np.arange(24))


@pytest.mark.parametrize(
    ("second", "layout", "receivers"),
    [("received", {}, 1), ("received", {"spacing": 0.5}, 2), ("received", {"positions": (0, 1)}, 2),
     ("incident bar", {}, 2)],
)  # fmt: skip
def test_a_transmitter_among_receivers_is_none(second, layout, receivers, tmp_path):
    """Where positions are given that it has too, or beside what is incident."""
    u = passing(np.random.default_rng(4), 2)
    rows = "".join(f"{1e-6 * i:.7f},{a:.5f},{b:.5f}\n" for i, (a, b) in enumerate(u))
    (tmp_path / "a.csv").write_text(f"time (s),{second},transmitter\n{rows}")
    found = read(tmp_path / "a.csv", Layout(placed=False, transmitter=True, **layout))
    assert found.values.shape[-1] == receivers


@pytest.mark.parametrize(
    ("arrays", "layout", "message"),
    [
        ({"u": np.ones((40, 5))}, {}, r"no times of 40 entries.*--time, or give --interval"),
        ({"u": np.ones((40, 5)), "t": np.arange(40)}, {}, r"no positions.*--spacing"),
        ({"t": np.arange(40)}, {}, "no array of two axes"),
        ({"u": np.ones((40, 5)), "v": np.ones((40, 5))}, {}, "2 arrays of shape .* name one"),
        ({"u": np.ones((40, 5))}, {"values": "w"}, r"no array 'w'; arrays are u \(40, 5\)"),
        ({"u": np.ones((40, 5))}, {"interval": -1.0, "spacing": 1.0}, r"interval = -1: must be"),
        ({"u": np.ones((8, 5))}, {"interval": 1.0, "spacing": 1.0}, "8 frames: at least 16"),
        ({"u": np.ones((0, 5))}, {"interval": 1.0, "spacing": 1.0}, "0 frames: at least 16"),
        ({"u": np.ones((40, 1))}, {"interval": 1.0, "spacing": 1.0}, "1 receiver: at least 2"),
    ],
)  # fmt: skip
def test_arrays_that_do_not_say_enough(arrays, layout, message):
    with pytest.raises(RecordError, match=message):
        from_arrays(arrays, Layout(**layout))


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "1,2,3\n4,5,6\n", "no heading"),
        ("a.csv", "t,x=0,x=1\n0,1\n", "row 2 has 2 cells; the heading has 3"),
        ("a.csv", "t,x=0,x=1\n0,1,one\n", "no number"),
        ("a.csv", "\n", "no table"),
        ("a.h5", "not HDF5", "can't be read as HDF5"),
        ("a.npz", "not NumPy", "can't be read as NumPy's"),
        ("a.wav", "", r"of a kind that is not known \(\.wav\)"),
    ],
)  # fmt: skip
def test_files_that_cannot_be_read(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(RecordError, match=message) as caught:
        read(tmp_path / name)
    assert name in str(caught.value)
    with pytest.raises(RecordError, match="no such file"):
        read(tmp_path / "none.csv")


def error(points):
    points = points.take(points.valid)
    exact = CHAIN.omega(points.k)
    assert len(points) > 40
    return np.abs(points.omega[:, None] / exact - 1).min(axis=1).max()


def again(made, values, t=T, **options):
    return record(values, t, X, ring=True, lattice=True, quiet_from=made.quiet_from, **options)


def test_frames_left_out_or_empty_cost_nothing(made):
    # 70 of 1600 frames gone, by NaN or from the times. Measured 3e-14 either way.
    values = made.values[0].copy()
    values[400:450] = values[900:920] = np.nan
    holed = again(made, values)
    assert holed.missing.sum() == 70
    assert "70 of 1600 frames count as missing" in holed.notes[0]
    assert error(in_time(holed)) < 1e-10
    kept = np.isfinite(values).all(axis=1)
    shorter = again(made, values[kept], T[kept])
    assert shorter.missing.sum() == 70
    assert error(in_time(shorter)) < 1e-10


def test_what_is_missing_is_missing_in_the_file_too(made, tmp_path):
    values = made.values[0].copy()
    values[400:450] = np.nan
    values[500:520, 3] = np.nan
    for name in ("a.npz", "a.csv"):
        write(tmp_path / name, again(made, values))
        found = read(tmp_path / name)
        assert np.array_equal(found.missing, again(made, values).missing)
    write(tmp_path / "a.npz", record(values, T, X))
    assert read(tmp_path / "a.npz").driven


def pulses(t, x):
    """A wave of 2,000 m/s, and what sends it."""
    u = np.pi * 5e4 * (t[..., None] - 6e-5 - np.r_[0, x] / 2000)
    both = (1 - 2 * u**2) * np.exp(-(u**2))
    return both[..., 1:], both[..., 0]


def late(found):
    """How much later a wave is at each receiver than it is sent, s, by centres of energy."""
    centre = lambda v: np.sum(found.t * v**2) / np.sum(v**2)  # noqa: E731
    return np.array([centre(v) - centre(found.input) for v in found.values[0].T])


def test_what_is_sent_keeps_its_time_beside_what_arrives():
    """Of uneven times, and of samples that are there four times, from whichever of them on; to a
    tenth of a frame."""
    x = 0.02 + 0.01 * np.arange(6)
    t = np.r_[np.arange(60), 60 + 1.6 * np.arange(140)] * 1e-6
    values, sent = pulses(t, x)
    found = record(values, t, x, input=sent)
    assert np.abs(late(found) - x / 2000).max() <= 1e-7
    fine = np.arange(800) * 2.5e-7
    noise = 1e-3 * np.random.default_rng(1).normal(size=(800, 7))
    for first in range(4):
        own = (np.arange(800) + first) // 4
        values, sent = pulses(own * 1e-6, x)
        values, sent = values + noise[own, 1:], sent + noise[own, 0]
        found = record(values, fine, x, input=sent)
        assert len(found.input) == len(found.t) <= 201
        assert np.abs(late(found) - x / 2000).max() <= 1e-7


def test_clocks_of_their_own_with_samples_missing():
    """What is missing stays so: neither an error, nor a spline across a gap."""
    x = 0.02 + 0.01 * np.arange(6)
    t = np.arange(200)[:, None] * 1e-6 + np.linspace(0, 5e-7, 6)
    values = np.stack([pulses(t[:, j], x)[0][:, j] for j in range(6)], axis=1)
    values[70:95, 3] = np.nan
    found = record(values, t, x)
    assert 25 <= found.missing.sum() <= 27
    off = found.values[0] - pulses(t[:, 0], x)[0]
    assert np.abs(off[~found.missing]).max() <= 1e-3


def test_a_gap_in_the_signal_makes_no_receiver_too_small():
    """Of a wave that crosses a gap each receiver has lost another part."""
    t, x = np.arange(400) * 1e-6, 0.02 + 0.01 * np.arange(8)
    values, _ = pulses(t, x)
    holed = values.copy()
    holed[100:140] = np.nan
    found = record(holed, t, x)
    assert np.abs(found.values[0] - values)[~found.missing].max() <= 1e-6
    assert [one.what for one in found.findings] == ["frames missing"]


def test_lone_samples_are_bridged_and_said(made):
    values = made.values[0].copy()
    values[500, 7] = values[700, 20] = values[701, 20] = np.nan
    bridged = again(made, values)
    assert not bridged.missing.any()
    assert "3 missing samples bridged" in bridged.notes[0]
    # The spline's error at about seven samples to the shortest period: measured 4e-5 of the peak.
    off = np.abs(bridged.values - made.values).max() / np.abs(made.values).max()
    assert 0 < off < 5e-3


def test_uneven_times_are_resampled_and_said(made):
    # Times off by 5 % of their interval, known: law, spline error (ωΔt)⁴/384-like. ωΔt is up to
    # 0.5 here; measured 6e-5 in ω.
    rng = np.random.default_rng(0)
    t = T + 0.05 * T[1] * rng.uniform(-1, 1, len(T))
    uneven = synthesize(CHAIN, t, X, Pulse(1500.0, 0.3), 0.61, ring=True, lattice=True)
    assert "resampled" in uneven.notes[0]
    assert error(in_time(uneven, dynamic_range=1e-2)) < 1e-3


def test_dead_receivers_are_left_out_of_a_stretch(made):
    values = made.values[0].copy()
    values[:, [4, 30]] = 0.0
    values[:, 50] = np.nan
    found = record(values, T, X)
    assert len(found.x) == 58
    told = " ".join(found.notes)
    assert all(
        f"{what} receivers left out (x = {x} m)" in told
        for what, x in (("dead", "0.04, 0.3"), ("mostly missing", "0.5"))
    )
    with pytest.raises(RecordError, match="not evenly spaced"):
        in_time(found)
    # Round a ring the others tell what they lack, but where many waves have one frequency.
    points = in_time(again(made, values), dynamic_range=1e-3)
    points = points.take(points.valid)
    assert len(points) > 25
    assert np.abs(points.omega[:, None] / CHAIN.omega(points.k) - 1).min(axis=1).max() < 1e-6


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda v, t, x: (v, t[::-1], x), "times must ascend"),
        (lambda v, t, x: (v, t, np.r_[x[:-1], x[0]]), "two receivers stand there"),
        (lambda v, t, x: (v[:, 1:], t, x), "must be .frames, receivers. = .1600, 61."),
        (lambda v, t, x: (v * np.nan, t, x), "dead or mostly missing"),
        (lambda v, t, x: (v, np.where(t > 0.02, t * 40, t), x), "longest interval"),
        (lambda v, t, x: (v, t, x * np.nan), "not finite"),
    ],
)
def test_records_that_cannot_be_used(made, change, message):
    with pytest.raises(RecordError, match=message):
        record(*change(made.values[0], T, X))


def test_spoilt_records_are_still_recovered_within_their_bars():
    # 1 % noise, 12 bits: 95 % bars hold the truth for 90 to 99 % of the points. Measured, four
    # seeds: all 60 points stand above the noise, 0.98 to 1 of them within their bars.
    spoilt = synthesize(
        CHAIN, T, X, Pulse(1500.0, 0.3), 0.61, ring=True, lattice=True,
        spoil=Spoil(noise=0.01, bits=12, seed=2),
    )  # fmt: skip
    points = in_time(spoilt)
    points = points.take(points.valid)
    off = np.abs(points.omega[:, None] - CHAIN.omega(points.k)).min(axis=1)
    assert len(points) >= 58
    assert 0.88 <= np.mean(off <= points.bar) <= 1.0


@pytest.mark.parametrize("noise", [0.003, 0.01])
def test_unequal_gains_cost_no_point_and_make_none(noise):
    """2 % each: one set of gains for all frequencies, which noise has not. Measured: 60 points,
    none off by more than its bar twice over."""
    clean = synthesize(CHAIN, T, X, Pulse(1500.0, 0.3), 0.61, ring=True, lattice=True,
                       spoil=Spoil(noise=noise, seed=3))  # fmt: skip
    gains = 1 + 0.02 * np.random.default_rng(3).normal(size=len(X))
    points = in_time(dataclasses.replace(clean, values=clean.values * gains))
    points = points.take(points.valid)
    off = np.abs(points.omega[:, None] - CHAIN.omega(points.k)).min(axis=1)
    assert len(points) >= 58
    assert (off < 2 * points.bar).all()
    assert np.mean(off <= points.bar) >= 0.88


def test_a_stretch_that_waves_leave_is_refused_by_inversion():
    left = synthesize(CHAIN, T, X, Pulse(1500.0, 0.3), 6.1)
    with pytest.raises(RecordError, match="waves reach the ends of the receivers"):
        in_time(left)
    kept = synthesize(CHAIN, T[:800], positions(401, 0.01), Pulse(1500.0, 2.0), 8.0, lattice=True)
    # While they are on their way the transform is exact at every k. Measured 2e-13.
    points = in_time(kept, k_max=250.0)
    assert error(points) < 1e-8
