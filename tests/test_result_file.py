"""result.h5: its layout, and that it is whole at every instant, crash or not."""

import dataclasses
import gc
import os
import resource
import signal
import subprocess
import sys
import time
import weakref
import zlib
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator

from wavesim import runner
from wavesim.case.load import load
from wavesim.io import result_reader as resultfile
from wavesim.io import result_writer as storage
from wavesim.io.packing import PACKED, deflated, fletcher32, pack, packed_dataset
from wavesim.io.result_layout import FORMAT_VERSION
from wavesim.material.granular_equations import ROTATION
from wavesim.planewave.dispersion_relation import block_frequencies
from wavesim.records.run_folder import open_run
from wavesim.simulation.field import Energy

CELLS, RECEIVER = 64, 5.03e-3


TOLD = {"case": "title = 'by hand'", "title": "by hand", "stepper": "propagator", "step": 1e-7}


@pytest.fixture
def simulation(tmp_path):
    """A simulation of 64 cells and 40 frames, to be written by hand; its case is hand.toml."""
    path = tmp_path / "hand.toml"
    path.write_text(
        f"title = 'by hand'\n[bar]\ncells = {CELLS}\n"
        "[[sources]]\nfield = 'phi1'\nposition = 4e-3\npeak_frequency = 6e5\n"
        f"[[receivers]]\nname = 'near.1'\nposition = {RECEIVER}\n"
        "[time]\nduration = 4e-6\nsamples = 40\n"
    )
    return load(path).simulation


def writer(path, simulation):
    return storage.Results(path, simulation, TOLD)


def frames(simulation, first, count):
    """Arguments of Results.append: every number is told by frame, field and cell."""
    number = np.arange(first, first + count)[:, None] + np.arange(CELLS) / CELLS
    values = {n: number + 1000.0 * i for i, n in enumerate(simulation.fields)}
    energy = Energy(*(float(i) + np.arange(first, first + count) for i in range(3)))
    return first, values, energy, [np.full((2, CELLS), first + count - 1.0), np.array(0.5)]


def whole_frames(path, simulation):
    """How many frames a file shows, every one of them held to what was written."""
    with h5py.File(path, "r") as file:
        assert file.attrs["status"] == "running"
        count = len(file["t"])
        _, values, energy, _ = frames(simulation, 0, count)
        for name, data in values.items():
            np.testing.assert_array_equal(file[f"fields/{name}"][()], data)
            assert len(file[f"receivers/near.1/{name}"]) == count
        np.testing.assert_array_equal(file["energy/work"][()], energy.work)
    return count


def test_layout_is_the_contract(small_run):
    loaded, field = small_run.loaded, small_run.field
    with h5py.File(small_run.result) as file:
        attributes = dict(file.attrs)
        assert attributes["format"] == "wavesim"
        assert attributes["format_version"] == FORMAT_VERSION
        assert attributes["status"] == "complete"
        taken = attributes["stepper"], attributes["step"]
        assert attributes["case"] == loaded.resolved(*taken)
        assert attributes["fourier_convention"].startswith("exp(i(kx - omega t))")
        assert attributes["created_utc"].endswith("+00:00")
        assert {"wavesim", "jax", "diffrax", "numpy"} <= set(attributes)

        nt, nx = len(field.t), field.bar.cells
        np.testing.assert_allclose(file["t"][()], np.linspace(0, 5e-5, nt), rtol=1e-14)
        np.testing.assert_allclose(file["x"][()], np.arange(nx) * 1.25e-4, rtol=1e-14)
        np.testing.assert_allclose(file["x_half"][()], (np.arange(nx) + 0.5) * 1.25e-4, rtol=1e-14)
        assert {n: file[n].attrs["units"] for n in ("t", "x", "x_half")} == {
            "t": "s", "x": "m", "x_half": "m",
        }  # fmt: skip

        # phi1 drives the longitudinal sector; B22 that and B22 − B33 of the in-plane one.
        assert set(file["fields"]) == {"phi1", "B11", "B22", "B33"}
        for name, data in file["fields"].items():
            assert data.shape == (nt, nx)
            assert data.dtype == np.float64
            assert data.chunks is not None
            assert data.compression is not None
            assert not data.is_virtual
            assert data.attrs["units"] == ("rad" if name in ROTATION.macro else "1/m")
            assert data.dims[0][0] == file["t"]
            assert data.dims[1][0] == file["x" if name in ROTATION.macro else "x_half"]
        assert set(file["receivers"]) == {"near", "far"}
        for name in ("near", "far"):
            assert set(file["receivers"][name]) == {"phi1", "B11", "B22", "B33"}
            assert file["receivers"][name].attrs["position"] == field.receivers[name]
            assert file["receivers"][name]["B11"].attrs["units"] == "1/m"
        assert set(file["energy"]) == {"t", "kinetic", "potential", "work", "total"}
        total = file["energy/kinetic"][()] + file["energy/potential"][()]
        np.testing.assert_array_equal(file["energy/total"][()], total)
        assert file["energy/total"].attrs["units"] == "J/m²"
        np.testing.assert_array_equal(file["energy/t"][()], file["t"][()])
        assert file["source/1"].attrs["field"] == "B22"
        assert file["source/1/signal"].shape == (nt,)

        assert set(file["dispersion"]) == {"longitudinal", "inplane"}
        for sector in file["dispersion"].values():
            assert sector["power"].shape == (len(sector["k"]), len(sector["omega"]))
            assert sector["k"].attrs["units"] == "rad/m"
            assert sector["omega"].attrs["units"] == "rad/s"
        branches = file["dispersion/longitudinal/branches"]
        assert set(branches) == {"LA", "LO1", "LO2"}
        for number, name in enumerate(("LA", "LO1", "LO2")):
            k, exact = branches[name]["k"][()], branches[name]["omega_exact"][()]
            expected = block_frequencies(field.medium, ROTATION.blocks[0], k)[:, number]
            np.testing.assert_allclose(exact, expected, rtol=1e-14)
            assert branches[name]["omega"].shape == k.shape
        curve = file["attenuation/longitudinal"]
        assert curve["k"].dtype == curve["k_exact"].dtype == np.complex128
        assert curve["omega"].shape == curve["k"].shape == curve["k_exact"].shape
    assert sorted(p.name for p in small_run.folder.iterdir()) == [
        "overview.png", "report.html", "resolved.toml", "result.h5", "summary.json",
    ]  # fmt: skip


def test_receiver_is_the_polynomial_through_the_eight_nearest_points(small_run):
    """Bar of order 8, receiver at cell 544.8: the polynomial of degree 7 through nodes 541 to 548,
    or half-nodes 540.5 to 548.5 less the farthest, here by the barycentric formula. To rounding
    of the weights, 1e-12 of the maximum; measured 2e-15."""
    field = small_run.field
    with h5py.File(small_run.result) as file:
        found = {name: file[f"receivers/near/{name}"][()] for name in ("phi1", "B11")}
    for name, shift in (("phi1", 0.0), ("B11", 0.5)):
        first = int(np.floor(544.8 - shift)) - 3
        at = np.arange(first, first + 8)
        exact = BarycentricInterpolator(at + shift, field[name][:, at].T)(544.8)
        assert np.abs(found[name] - exact).max() <= 1e-12 * np.abs(exact).max()


def test_file_is_readable_in_the_middle_of_a_run(simulation, tmp_path):
    """After each chunk, and by a reader that had it open before the chunk came."""
    path = tmp_path / "result.h5"
    results = writer(path, simulation)
    results.create()
    results.append(*frames(simulation, 0, 1))
    assert whole_frames(path, simulation) == 1
    for first in (1, 8, 15):
        with h5py.File(path, "r") as before:
            results.append(*frames(simulation, first, 7))
            assert len(before["t"]) == first
            np.testing.assert_array_equal(
                before["fields/phi1"][()], frames(simulation, 0, first)[1]["phi1"]
            )
        assert whole_frames(path, simulation) == first + 7
    with h5py.File(path, "r") as file:
        data = file["fields/B11"]
        assert data.dims[0][0] == file["t"]
        assert data.dims[1][0] == file["x_half"]
        assert data.attrs["units"] == "1/m"
    stored = resultfile.describe(path)
    assert (stored.status, stored.frames, stored.case) == ("running", 22, TOLD["case"])


def test_finish_gathers_the_parts(simulation, tmp_path):
    path = tmp_path / "result.h5"
    results = writer(path, simulation)
    results.create()
    for first, count in ((0, 1), (1, 20), (21, 19)):
        results.append(*frames(simulation, first, count))
    results.finish("complete")
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith("result")] == ["result.h5"]
    with h5py.File(path, "r") as file:
        assert file.attrs["status"] == "complete"
        for name, data in frames(simulation, 0, 40)[1].items():
            assert not file[f"fields/{name}"].is_virtual
            np.testing.assert_array_equal(file[f"fields/{name}"][()], data)


@pytest.mark.parametrize("cells", [64, 1024, 2500], ids=["one chunk", "whole chunks", "edges"])
def test_chunks_are_read_by_the_library_as_any(cells, tmp_path):
    """Written past the HDF5 library's filters, read through them: every bit is there, zeros,
    noise and what is not a number too, and chunks of nothing but noise."""
    rng = np.random.default_rng(3)
    values = rng.normal(size=(37, cells))
    values[:20, : cells // 2], values[5, -1] = 0.0, np.nan
    path = tmp_path / "some.h5"
    with h5py.File(path, "w") as file:
        pack(packed_dataset(file, "fields/phi1", 37, cells), values)
    with h5py.File(path, "r") as file:
        data = file["fields/phi1"]
        assert (data.compression, data.shuffle, data.fletcher32) == ("gzip", True, True)
        np.testing.assert_array_equal(data[()], values)
    # The library's own filters make chunks that are read alike, checksums included.
    with h5py.File(path, "w") as file:
        file.create_dataset("own", data=values, chunks=(16, min(cells, 1024)), **PACKED)
        _, chunk = file["own"].id.read_direct_chunk((0, 0))
    assert fletcher32(chunk[:-4]) == int.from_bytes(chunk[-4:], "little")


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize("quiet", [0.0, 0.02, 0.5, 1.0])
def test_deflated_chunks_are_what_the_filters_undo(kind, quiet, rng):
    """Fields that move, that are part at rest, that are at rest: back through zlib to the last bit,
    and no larger than 1.01 times what zlib's own fastest level makes of them."""
    chunk = rng.normal(size=(16, 1024)).astype(kind)
    chunk[:, : int(quiet * 1024)] = 0
    shuffled = chunk.reshape(-1).view(np.uint8).reshape(-1, chunk.itemsize).T.tobytes()
    made = deflated(chunk)
    assert zlib.decompress(made) == shuffled
    assert len(made) <= 1.01 * len(zlib.compress(shuffled, 1))


def test_what_was_gathered_is_thrown_away_when_the_run_stops(simulation, tmp_path):
    """An interrupt while measuring: the file is as it was before, and nothing lies beside it."""
    path = tmp_path / "result.h5"
    results = writer(path, simulation)
    results.create()
    results.append(*frames(simulation, 0, 5))
    with pytest.raises(KeyboardInterrupt), results.gathering():
        raise KeyboardInterrupt
    assert whole_frames(path, simulation) == 5
    assert not list(tmp_path.glob("**/*.tmp"))
    writer(path, simulation).carry_on()


def test_carry_on_gives_the_last_state_and_goes_on(simulation, tmp_path):
    path = tmp_path / "result.h5"
    results = writer(path, simulation)
    results.create()
    results.append(*frames(simulation, 0, 1))
    results.append(*frames(simulation, 1, 9))
    with h5py.File(path, "r") as file:
        created = file.attrs["created_utc"]
    again = writer(path, simulation)
    frame, state = again.carry_on()
    assert frame == 9
    np.testing.assert_array_equal(state[0], np.full((2, CELLS), 9.0))
    assert state[1] == 0.5
    again.append(*frames(simulation, 10, 5))
    assert whole_frames(path, simulation) == 15
    with h5py.File(path, "r") as file:
        assert file.attrs["created_utc"] == created


def test_of_chunks_that_are_stored_nothing_is_held(simulation, tmp_path):
    """A run that is larger than the memory must not gather there, chunk by chunk."""
    from wavesim.io.storing import Storing

    results = writer(tmp_path / "result.h5", simulation)
    results.create()
    left = []
    with Storing(results, {}) as storing:
        for first in range(0, 36, 6):
            _, values, energy, state = frames(simulation, first, 6)
            chunk = SimpleNamespace(first=first, count=6, values=values, energy=energy, state=state)
            left.append(weakref.ref(values["phi1"]))
            storing.add(chunk)
            del chunk, values, energy, state
        storing.wait()
    gc.collect()
    assert sum(one() is not None for one in left) <= 1
    assert whole_frames(tmp_path / "result.h5", simulation) > 0


def kill_and_look(case, path, kills):
    """Kill a writer that appends as fast as it can at random instants; frames left each time.

    Run in a process of its own, which holds no threads that a fork would break.
    """
    simulation = dataclasses.replace(load(case).simulation, samples=4000)
    rng = np.random.default_rng(40)
    seen = []
    for several in rng.uniform(0.0, 10.0, kills):
        results = writer(path, simulation)
        results.create()
        begun = time.monotonic()
        results.append(*frames(simulation, 0, 1))
        wait = several * (time.monotonic() - begun)  # of so many of them
        child = os.fork()
        if child == 0:
            for first in range(1, 10**6, 3):
                results.append(*frames(simulation, first, 3))
        time.sleep(wait)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        count = whole_frames(path, simulation)
        again = writer(path, simulation)
        frame, state = again.carry_on()
        assert state[0][0, 0] == frame == count - 1
        again.append(*frames(simulation, count, 3))
        assert whole_frames(path, simulation) == count + 3
        seen.append(count)
    return seen


def test_killed_at_any_instant_leaves_whole_frames(tmp_path, simulation):
    """40 kills in the middle of appending. Each time the file opens as any HDF5 file does, holds
    whole chunks of three frames after the first frame, and can be carried on."""
    program = (
        "import sys, pathlib; sys.path.insert(0, sys.argv[1]); import test_result_file as t\n"
        "print(*t.kill_and_look(sys.argv[2], pathlib.Path(sys.argv[3]), 40))"
    )
    case, path = tmp_path / "hand.toml", tmp_path / "result.h5"
    here = Path(__file__).parent
    done = subprocess.run(
        [sys.executable, "-c", program, str(here), str(case), str(path)],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    seen = [int(count) for count in done.stdout.split()]
    assert len(seen) == 40
    assert all(count % 3 == 1 for count in seen)
    assert len(set(seen)) > 3


def test_resume_of_a_failed_run_is_refused(simulation, tmp_path):
    results = writer(tmp_path / "result.h5", simulation)
    results.create()
    results.append(*frames(simulation, 0, 2))
    results.finish("failed")
    assert resultfile.describe(tmp_path / "result.h5").status == "failed"
    with pytest.raises(resultfile.StorageError, match=r"failed, and would again; change the case"):
        writer(tmp_path / "result.h5", simulation).carry_on()


def test_what_is_read_while_a_run_goes_on_and_ends_stays_what_it_was(
    simulation, tmp_path, monkeypatch
):
    """Of the frames that were there, though more are added, and though the parts that a file
    presents are taken away between its being opened and read."""
    path = tmp_path / "result.h5"
    results = writer(path, simulation)
    results.create()
    results.append(*frames(simulation, 0, 10))
    results.present()
    field = resultfile.read(path, simulation)
    results.append(*frames(simulation, 10, 30))
    results.present()

    def opened(*given):
        file = h5py.File(*given)
        if file.attrs["status"] == "running":
            results.finish("complete")
        return file

    monkeypatch.setattr(resultfile, "h5py", SimpleNamespace(File=opened))
    _, expected, _, _ = frames(simulation, 0, 10)
    for name, values in field.values.items():
        np.testing.assert_array_equal(values[:, 3], expected[name][:, 3])
        np.testing.assert_array_equal(values, expected[name])
        np.testing.assert_array_equal(values[-2:], expected[name][-2:])
        np.testing.assert_array_equal(values[np.arange(10) > 6], expected[name][7:])
    assert not (tmp_path / "result.h5.parts").exists()
    assert len(field.t) == 10


def test_resume_with_a_part_gone_is_refused(simulation, tmp_path):
    results = writer(tmp_path / "result.h5", simulation)
    results.create()
    results.append(*frames(simulation, 0, 2))
    results.append(*frames(simulation, 2, 70))
    next((tmp_path / "result.h5.parts").glob("*64.h5")).unlink()
    with pytest.raises(resultfile.StorageError, match=r"64\.h5: is missing.*run without --resume"):
        writer(tmp_path / "result.h5", simulation).carry_on()


def test_what_is_not_a_result_is_told(simulation, tmp_path):
    path = tmp_path / "other.h5"
    with pytest.raises(resultfile.StorageError, match="no such file; run the case first"):
        resultfile.describe(path)
    path.write_text("not HDF5")
    with pytest.raises(resultfile.StorageError, match="is not a readable HDF5 file"):
        resultfile.describe(path)
    with h5py.File(path, "w") as file:
        file["t"] = [0.0]
    with pytest.raises(resultfile.StorageError, match="is not a result of wavesim"):
        resultfile.describe(path)
    results = writer(tmp_path / "result.h5", simulation)
    results.create()
    results.append(*frames(simulation, 0, 1))
    with pytest.raises(resultfile.StorageError, match="holds 1 frames; at least 2 are needed"):
        resultfile.read(tmp_path / "result.h5", simulation)


def test_disk_that_fills_is_told_and_what_was_written_stays(simulation, tmp_path):
    """A real failure to write: the system refuses files beyond a size, as a full disk does."""
    path = tmp_path / "result.h5"
    results = writer(path, simulation)
    results.create()
    results.append(*frames(simulation, 0, 1))
    results.append(*frames(simulation, 1, 4))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size // 2, limits[1]))
    try:
        with pytest.raises(resultfile.StorageError) as caught:
            results.append(*frames(simulation, 5, 4))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    message = str(caught.value)
    assert message.startswith(f"{path}: can't be written: File too large")
    assert "ulimit -f" in message
    assert "\n" not in message
    assert whole_frames(path, simulation) == 5
    assert not list(tmp_path.glob("**/*.tmp"))


def test_too_little_room_for_the_final_file_is_told_before_it_is_written(
    simulation, tmp_path, monkeypatch
):
    path = tmp_path / "result.h5"
    results = writer(path, simulation)
    results.create()
    results.append(*frames(simulation, 0, 5))
    usage = storage.shutil.disk_usage(tmp_path)._replace(free=1000)
    monkeypatch.setattr(storage.shutil, "disk_usage", lambda folder: usage)
    with pytest.raises(
        resultfile.StorageError, match=r"disk has 0 MB left; make room and .*--resume"
    ):
        results.finish("complete")
    assert whole_frames(path, simulation) == 5


@pytest.mark.parametrize(
    "error",
    [OSError(28, "No space left on device"), MemoryError("800 GB"), MemoryError()],
    ids=["disk", "memory", "memory, without a word"],
)
def test_errors_of_the_machine_are_run_errors(small_case, tmp_path, monkeypatch, error):
    def append(*arguments):
        raise error

    monkeypatch.setattr(storage.Results, "append", append)
    with pytest.raises(runner.RunError) as caught:
        runner.run(load(small_case), tmp_path / "out")
    assert caught.value.code == (3 if isinstance(error, OSError) else 2)
    assert ("No space left" in str(caught.value)) or ("into memory" in str(caught.value))


def test_new_run_takes_away_the_old_verdict(small_case, tmp_path, monkeypatch):
    """Nothing of an earlier run may stand beside one that failed before it stored anything."""
    from wavesim.timedomain import integrate

    old = [tmp_path / name for name in ("summary.json", "report.html", "result.h5")]
    for path in old:
        path.write_text("{}")

    def stream(*arguments):
        raise integrate.NotFiniteError(1e-6, "propagator", 1e-7)
        yield

    monkeypatch.setattr(integrate, "stream", stream)
    with pytest.raises(runner.RunError) as caught:
        runner.run(load(small_case), tmp_path)
    assert caught.value.code == 3
    assert not any(path.exists() for path in old)


def test_a_stored_field_is_indexed_as_an_array_is(small_run):
    """Backward, by a mask, out of order: what NumPy takes of an array is taken of a stored one."""
    stored = open_run(small_run.result).field["phi1"]
    values = np.asarray(stored)
    mask = np.arange(len(values)) % 3 == 1
    for key in (np.s_[::-1], np.s_[5:1:-2], np.s_[:, ::-1], np.s_[-1], np.s_[mask], np.s_[[3, 1]]):
        assert (stored[key] == values[key]).all()
