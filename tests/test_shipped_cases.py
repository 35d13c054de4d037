"""Every shipped case: nothing to warn of before it runs, and every check passes after."""

import h5py
import numpy as np
import pytest
from runs import SHIPPED, call

from wavesim import planewave
from wavesim.case.load import load
from wavesim.timedomain.time_step import time_step


@pytest.mark.parametrize("name", SHIPPED)
def test_check_says_what_can_be_said_before_integrating(name):
    """Shipped cases give no warning; the numbers printed are those of the settled run."""
    result = call("check", SHIPPED[name])
    assert (result.exit_code, result.stderr) == (0, "")
    simulation = load(SHIPPED[name]).simulation
    assert f"{simulation.bar.cells} cells" in result.stdout
    assert f"{time_step(simulation).steps} steps" in result.stdout
    low, high = planewave.gaps(simulation.medium, "longitudinal")[0].lower, 2e3 * np.pi
    assert f"{low / high:.2f}" in result.stdout
    for gap in simulation.medium.family.all_gaps:
        assert gap in result.stdout
    exact = "receivers, against the exact solution in the frequency domain"
    assert (exact in result.stdout) is not simulation.endless


@pytest.mark.parametrize("name", SHIPPED)
def test_run_gives_0_and_tells_that_every_check_passed(name, shipped):
    run = shipped(name)
    assert (run.exit_code, run.stderr) == (0, "")
    checks = run.summary["checks"]
    assert [check["name"] for check in checks if not check["passed"]] == []
    assert run.summary["passed"] is True
    assert len(checks) >= (15 if run.loaded.simulation.endless else 8)
    for check in checks:
        assert abs(check["measured"] - check["reference"]) <= check["tolerance"]
    if run.stdout:
        assert f"{len(checks)} of {len(checks)} checks passed" in " ".join(run.stdout.split())
        # Of two receivers what they tell of a velocity; of what conserves no energy that.
        told = run.stdout.replace("Note: pulse velocity", "").replace("Note: no pulse velocity", "")
        conserved = run.loaded.simulation.layers.conserves_energy
        assert told.count("Note") == told.count("Note: energy was not judged") == 1 - conserved
    with h5py.File(run.result, "r") as file:
        assert file.attrs["status"] == "complete"
    assert not (run.folder / "result.h5.parts").exists()
    assert (run.folder / "resolved.toml").exists()
    # Fields at rest and noise take what compression leaves; the largest was measured at 172 MB.
    assert run.result.stat().st_size < 200e6
