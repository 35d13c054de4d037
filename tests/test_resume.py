"""Runs that were stopped and carried on, against runs that were not."""

import json
import subprocess
import sys

import h5py
import numpy as np
import pytest
from runs import call, run

from wavesim import runner
from wavesim.case.load import load
from wavesim.io.result_reader import StorageError

# Losses, an absorber and a moment at an end: all that a state can hold.
BAR = """\
[medium]
closure = "consistent"
anisotropy = 0.25
quality_factor = 60.0
quality_band = [5.0e4, 2.0e6]

[bar]
length = 0.024
spacing = 2.5e-4
left = "free"
right = "absorbing"

[[sources]]
kind = "tone-burst"
field = "phi1"
drive = "moment"
end = "left"
frequency = 3.0e5
cycles = 4
window = "cos4"

[[receivers]]
name = "1"
position = 0.008

[time]
duration = 2.0e-5
samples = 301
"""
RING = """\
[bar]
length = 0.032
spacing = 1.25e-4

[[sources]]
field = "phi1"
position = 0.016
peak_frequency = 6.0e5

[time]
duration = 1.6e-5
samples = 301
"""


@pytest.fixture(scope="module")
def bar_run(tmp_path_factory, shared):
    path = tmp_path_factory.mktemp("case") / "lossy_bar.toml"
    path.write_text(BAR)
    return run(path, shared)


@pytest.fixture(scope="module")
def ring_run(tmp_path_factory, shared):
    path = tmp_path_factory.mktemp("case") / "ring.toml"
    path.write_text(RING)
    return run(path, shared)


def different(one, other, only=""):
    """Names of the data sets that differ in any bit."""
    found = []
    with h5py.File(one, "r") as first, h5py.File(other, "r") as second:

        def look(name, item):
            if not isinstance(item, h5py.Dataset) or name.startswith("restart/ends"):
                return
            if name.startswith(only) and not np.array_equal(
                item[()], second[name][()], equal_nan=item.dtype.kind in "fc"
            ):
                found.append(name)

        first.visititems(look)
    return found


def checks(folder):
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))["checks"]


def test_interrupted_run_resumes_bit_for_bit(bar_run, tmp_path):
    """Stopped after a part, while memory variables and the moment at the end are at work; --resume
    completes it, and every stored number is that of the run that was not stopped."""

    def stop(stage, part):
        if stage == "integrate" and part > 0.1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        runner.run(bar_run.loaded, tmp_path, progress=stop)
    with h5py.File(tmp_path / "result.h5", "r") as file:
        assert file.attrs["status"] == "running"
        assert 1 < len(file["t"]) < len(bar_run.field.t)
        assert file["t"][-1] < bar_run.field.sources[0].end
    resumed = call("run", bar_run.case, "--out", tmp_path, "--resume")
    assert resumed.exit_code == bar_run.exit_code == 0, resumed.output
    assert different(bar_run.result, tmp_path / "result.h5") == []
    assert checks(tmp_path) == bar_run.summary["checks"]


def test_resolved_case_runs_to_the_same_bits(bar_run, tmp_path):
    """Every default written out settles to the same run."""
    written = bar_run.folder / "resolved.toml"
    taken = bar_run.summary["stepper"], bar_run.summary["step"]
    assert load(written).resolved(*taken) == written.read_text(encoding="utf-8")
    result = call("run", written, "--out", tmp_path, "--quiet")
    assert (result.exit_code, result.output) == (0, "")
    for group in ("fields", "receivers", "exact", "energy"):
        assert different(bar_run.result, tmp_path / "result.h5", group) == []


def test_killed_run_resumes_bit_for_bit(ring_run, tmp_path):
    """SIGKILL in the middle of `wavesim run`; --resume completes it; every stored number is that
    of the run that was not interrupted."""
    # The run pauses after its second chunk, so that the kill comes in the middle of it, and after
    # the first, as what is stored is shown every two seconds.
    program = (
        "import sys, time; from wavesim.io import result_writer as storage\n"
        "from wavesim.cli.main import main\n"
        "append = storage.Results.append\n"
        "def slow(self, first, *rest):\n"
        "    append(self, first, *rest)\n"
        "    if first == 0: time.sleep(2.1)\n"
        "    if first > 1: print('there', flush=True); time.sleep(600)\n"
        "storage.Results.append = slow\n"
        "main(sys.argv[1:])\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program, "run", str(ring_run.case), "--out", str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "there\n"
    process.kill()
    process.communicate()
    result = tmp_path / "result.h5"
    with h5py.File(result, "r") as file:
        assert file.attrs["status"] == "running"
        count = len(file["t"])
        assert 1 < count < len(ring_run.field.t)
        for name in ring_run.field.names:
            np.testing.assert_array_equal(file["fields"][name][()], ring_run.field[name][:count])
    resumed = runner.run(ring_run.loaded, tmp_path, resume=True)
    assert resumed.passed is ring_run.summary["passed"]
    assert different(ring_run.result, result) == []
    assert checks(tmp_path) == ring_run.summary["checks"]
    assert not (tmp_path / "result.h5.parts").exists()

    # Once complete it can be resumed again: nothing is integrated, everything measured anew.
    again = runner.run(ring_run.loaded, tmp_path, resume=True)
    assert again.summary["timing"]["integrate"] == 0
    assert again.summary["checks"] == resumed.summary["checks"]

    # Another case is refused, and nothing in the folder is touched.
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    other = load(ring_run.case, ["medium.anisotropy=0.26"])
    with pytest.raises(StorageError, match="made by another case") as caught:
        runner.run(other, tmp_path, resume=True)
    assert "run without --resume, or name another folder" in str(caught.value)
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before


@pytest.mark.parametrize("damage", ["field", "state"])
def test_a_run_shorter_than_a_chunk_resumes_once_complete(bar_run, tmp_path, damage):
    """None of its frames ever filled a chunk of a part. A field that is not there is told, and a
    state of single precision, which would go on to other bits."""
    short = bar_run.case, "--set", "time.samples=20", "--out", tmp_path, "--quiet"
    call("run", *short)
    before = tmp_path / "before.h5"
    before.write_bytes((tmp_path / "result.h5").read_bytes())
    resumed = call("run", *short, "--resume")
    assert resumed.exit_code in (0, 1), resumed.output
    assert different(before, tmp_path / "result.h5") == []
    with h5py.File(tmp_path / "result.h5", "r+") as file:
        if damage == "field":
            del file["fields/phi1"]
        else:
            state = file["restart/state/0"][()]
            del file["restart/state/0"]
            file["restart/state/0"] = state.astype(np.float32)
    damaged = call("run", *short, "--resume")
    assert damaged.exit_code == 2
    assert "damaged" in damaged.output
