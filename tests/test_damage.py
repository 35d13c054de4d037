"""Nothing damaged is taken for whole, and one run at a time writes into a folder."""

import os
import signal
import subprocess
import sys

import h5py
import numpy as np
import pytest

from wavesim.io import result_reader as resultfile
from wavesim.io.folder_lock import NAME, locked
from wavesim.io.packing import Taking


def contents(path):
    """All that a reader of a result asks for; StorageError where it is damaged."""
    stored = resultfile.describe(path)
    with resultfile.reading(path) as file:
        found = {"case": stored.case, "status": stored.status}
        for group in ("t", "x", "fields", "receivers", "energy", "dispersion", "attenuation"):
            item = file[group]
            if isinstance(item, h5py.Dataset):
                found[group] = item[()].tobytes()
            else:
                item.visititems(
                    lambda name, one: (
                        found.update({one.name: one[()].tobytes()})
                        if isinstance(one, h5py.Dataset)
                        else None
                    )
                )
    return found


def test_damage_is_told_and_never_read_as_numbers(small_run, tmp_path, rng):
    """A flipped byte, or a file cut short, at 80 places, dense where the metadata is: what is read
    is what was written, or an error of one line."""
    sound = small_run.result.read_bytes()
    clean = contents(small_run.result)
    path, told = tmp_path / "broken.h5", []
    places = np.concatenate([rng.integers(8, 20_000, 40), rng.integers(8, len(sound), 40)])
    for number, at in enumerate(places):
        flipped = sound[:at] + bytes([sound[at] ^ 0xFF]) + sound[at + 1 :]
        path.write_bytes(sound[:at] if number % 8 == 0 else flipped)
        try:
            assert contents(path) == clean, at
        except resultfile.StorageError as error:
            told.append(str(error))
    assert len(told) > 20
    assert all(str(path) in one and "\n" not in one for one in told)


def test_a_damaged_field_is_told_by_its_name(small_run, tmp_path):
    with h5py.File(small_run.result) as file:
        chunk = file["fields/phi1"].id.get_chunk_info(3)
    data = bytearray(small_run.result.read_bytes())
    data[chunk.byte_offset + chunk.size // 2] ^= 1
    path = tmp_path / "broken.h5"
    path.write_bytes(data)
    field = resultfile.read(path, small_run.loaded.simulation)
    with pytest.raises(resultfile.StorageError, match=r"broken\.h5: fields/phi1: damaged"):
        field["phi1"]


def test_a_flipped_bit_of_a_single_number_is_told(small_run, tmp_path):
    """Each array that HDF5 itself keeps no checksum of, by one bit of each."""
    with h5py.File(small_run.result) as file:
        found = []
        file.visititems(lambda name, one: found.append(one))
        plain = [one for one in found if isinstance(one, h5py.Dataset) and not one.chunks]
        places = [one.id.get_offset() for one in plain if one.id.get_storage_size()]
    assert places
    for at in places:
        data = bytearray(small_run.result.read_bytes())
        data[at] ^= 4
        path = tmp_path / "broken.h5"
        path.write_bytes(data)
        with pytest.raises(resultfile.StorageError, match="damaged"):
            resultfile.describe(path)


def test_a_folder_has_one_run(tmp_path):
    with locked(tmp_path):
        text = (tmp_path / NAME).read_text()
        assert f"process {os.getpid()} on " in text
        assert "since 20" in text
        with (
            pytest.raises(resultfile.StorageError, match=f"another run .*process {os.getpid()}"),
            locked(tmp_path),
        ):
            pass
    assert not (tmp_path / NAME).exists()


def test_a_killed_run_leaves_its_folder_free(tmp_path):
    program = (
        "import sys, time, pathlib; from wavesim.io.folder_lock import locked\n"
        "with locked(pathlib.Path(sys.argv[1])): print('there', flush=True); time.sleep(600)"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "there\n"
    with pytest.raises(resultfile.StorageError, match="another run"), locked(tmp_path):
        pass
    process.send_signal(signal.SIGKILL)
    process.communicate()
    with locked(tmp_path):
        assert f"process {os.getpid()}" in (tmp_path / NAME).read_text()


def test_a_disk_that_fills_does_not_upset_the_library(tmp_path):
    """Whatever is written, the library ends well; the error is there afterwards."""
    raw = Taking(tmp_path / "full.h5", "w+")
    with raw:
        raw.failed = OSError(28, "No space left on device")
        with h5py.File(raw, "w") as file:
            file["some"] = np.arange(10_000.0)
    assert raw.failed.errno == 28
