"""Shipped cases of bars with layers and ends, run whole: files, verdict, resume, and bad input."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from wavesim.case.problem import load
from wavesim.cli.main import main
from wavesim.material.wave_equations import CURVATURES, ROTATIONS, UNITS, flux_form
from wavesim.timedomain import integration

FOLDER = Path(__file__).parent.parent / "cases"
NAMES = ["free_bar", "lossy", "pulse_test", "rainbow", "slab", "stack"]
FIELDS = ("phi1", "B11", "B22", "B33")


def call(*arguments):
    """Run a command in this process; an exception that is not an exit fails the test."""
    return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


def run_of(name, folder):
    """(problem, result of the command, folder) of a shipped case."""
    case = FOLDER / f"{name}.toml"
    return load(case), call("run", case, "--out", folder), folder


@pytest.fixture(scope="module")
def pulse(tmp_path_factory):
    """The pulse test: losses, two free ends, a surface moment, five receivers."""
    return run_of("pulse_test", tmp_path_factory.mktemp("pulse"))


@pytest.fixture(scope="module")
def slab(tmp_path_factory):
    """The slab between two buffers whose ends absorb."""
    return run_of("slab", tmp_path_factory.mktemp("slab"))


def test_every_bar_that_is_not_endless_is_listed():
    real = [path.stem for path in FOLDER.glob("*.toml") if not load(path).plan.endless]
    assert sorted(real) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_check_has_nothing_to_warn_of(name):
    result = call("check", FOLDER / f"{name}.toml")
    assert (result.exit_code, result.stderr) == (0, "")
    assert "receivers, against the exact solution in the frequency domain" in result.stdout
    assert "ends" in result.stdout


@pytest.mark.parametrize("name", ["pulse", "slab"])
def test_run_gives_0_and_tells_every_check(name, request):
    problem, result, folder = request.getfixturevalue(name)
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["passed"] is True
    text = " ".join(result.stdout.split())
    assert f"{len(summary['checks'])} of {len(summary['checks'])} checks passed" in text
    names = [check["name"] for check in summary["checks"]]
    for receiver in problem.receivers:
        assert any(name.startswith(f"signal at {receiver}:") for name in names)
    assert "energy + dissipated − work over energy" in names
    for check in summary["checks"]:
        assert abs(check["measured"] - check["reference"]) <= check["tolerance"]
    made = {path.stem for path in (folder / "figures").glob("*.png")}
    wanted = {"bar", "signals", "spacetime", "receivers", "energy"}
    wanted |= {
        "pulse": {"arrivals_phi1", "velocities_phi1", "loss_phi1"},
        "slab": {"transmission_longitudinal"},
    }[name]
    assert made >= wanted
    assert not (folder / "result.h5.parts").exists()


@pytest.mark.parametrize("name", ["pulse", "slab"])
def test_layout_of_the_result(name, request):
    """N + 1 nodes, N half-nodes; every field on t and on its own points; units throughout."""
    problem, _, folder = request.getfixturevalue(name)
    with h5py.File(folder / "result.h5", "r") as file:
        assert file.attrs["status"] == "complete"
        cells = problem.plan.bar.cells
        assert (file["x"].shape, file["x_half"].shape) == ((cells + 1,), (cells,))
        np.testing.assert_array_equal(file["x"][()], problem.plan.bar.nodes)
        np.testing.assert_allclose(
            file["x_half"][()], (file["x"][1:] + file["x"][:-1]) / 2, rtol=1e-12
        )
        assert set(file["fields"]) == set(FIELDS)
        for field in FIELDS:
            data = file[f"fields/{field}"]
            along = "x" if field in ROTATIONS else "x_half"
            assert data.dims[0][0] == file["t"]
            assert data.dims[1][0] == file[along]
            assert data.shape == (len(file["t"]), len(file[along]))
            assert data.attrs["units"] == UNITS[field]
        for receiver in problem.receivers:
            for field in FIELDS:
                for group in ("receivers", "exact"):
                    data = file[f"{group}/{receiver}/{field}"]
                    assert data.shape == file["t"].shape
                    assert data.attrs["units"] == UNITS[field]
        for group in ("transmission", "pulse", "energy"):
            for data in file.get(group, {}).values():
                parts = data.values() if isinstance(data, h5py.Group) else [data]
                assert all("units" in part.attrs for part in parts)


@pytest.mark.parametrize("name", ["pulse", "slab"])
def test_receivers_agree_with_the_exact_solver_and_with_the_stored_field(name, request):
    """Against the frequency domain 1e-4 of each field's peak, from the file itself; and the
    polynomial through the eight nearest points of the stored field, barycentric, to 1e-10."""
    from scipy.interpolate import BarycentricInterpolator

    problem, _, folder = request.getfixturevalue(name)
    with h5py.File(folder / "result.h5", "r") as file:
        for receiver, position in problem.receivers.items():
            for field in FIELDS:
                found, exact = (file[f"{g}/{receiver}/{field}"][()] for g in ("receivers", "exact"))
                peak = np.abs(exact).max()
                assert peak > 0
                assert np.abs(found - exact).max() <= 1e-4 * peak
                x = file["x" if field in ROTATIONS else "x_half"][()]
                near = np.sort(np.argsort(np.abs(x - position), kind="stable")[:8])
                values = file[f"fields/{field}"][:, near[0] : near[-1] + 1]
                through = BarycentricInterpolator(x[near], values.T)(position)
                assert np.abs(through - found).max() <= 1e-10 * peak


@pytest.mark.parametrize("name", ["pulse", "slab"])
def test_energy_and_what_is_lost_are_the_work(name, request):
    """Kinetic + potential + dissipated = work, 1e-8 of the largest energy; what is lost only grows
    (1e-12 of it), and by the end is more than a tenth: this could fail."""
    _, _, folder = request.getfixturevalue(name)
    with h5py.File(folder / "result.h5", "r") as file:
        energy = {key: data[()] for key, data in file["energy"].items()}
    size = energy["total"].max()
    np.testing.assert_allclose(energy["total"], energy["kinetic"] + energy["potential"], rtol=1e-13)
    balance = energy["total"] + energy["dissipated"] - energy["work"]
    assert np.abs(balance).max() <= 1e-8 * size
    assert np.diff(energy["dissipated"]).min() >= -1e-9 * size
    assert energy["dissipated"][-1] > 0.1 * size


def stiffness(medium, s):
    """D(s) and k(s) of D φ″ = −m_φ s² φ, longitudinal, Γ → 0: the wave equations in SI with B taken
    out, D = C_φφ − C_φB (C_BB − m_B s²)⁻¹ C_Bφ; Im k > 0."""
    flux = flux_form(medium)
    at = [CURVATURES.index(name) for name in FIELDS[1:]]
    D = np.empty(len(s), complex)
    for row, w in enumerate(s):
        inner = flux.C_B_B[np.ix_(at, at)] - flux.m_B * w**2 * np.eye(3)
        D[row] = flux.C_phi_phi[0, 0] - flux.C_phi_B[0, at] @ np.linalg.solve(
            inner, flux.C_B_phi[at, 0]
        )
    k = np.sqrt(flux.m_phi * s**2 / D)
    return D, np.where(k.imag > 0, k, -k)


def test_transmission_of_the_slab_by_its_closed_form(slab):
    """A slab of thickness d and Z₂ = D₂k₂ between half-spaces of Z₁, φ and Dφ′ continuous:

        T = 4 Z₁Z₂/N,   R = (Z₁² − Z₂²)(e^{−ik₂d} − e^{ik₂d})/N,
        N = (Z₁ + Z₂)² e^{−ik₂d} − (Z₁ − Z₂)² e^{ik₂d},

    at ω + iσ. The stored exact values to 1e-6 (slivers of buffer), the measured ones to 1e-3 where
    judged; in the gaps T falls below −40 dB."""
    problem, _, folder = slab
    outer, inner = (problem.plan.layers.layers[n] for n in (0, 1))
    with h5py.File(folder / "result.h5", "r") as file:
        stored = {key: data[()] for key, data in file["transmission/longitudinal"].items()}
    s = stored["omega"] + 1j * stored["sigma"]
    (D1, k1), (D2, k2) = stiffness(outer.medium, s), stiffness(inner.medium, s)
    Z1, Z2 = D1 * k1, D2 * k2
    ahead, back = np.exp(1j * k2 * inner.thickness), np.exp(-1j * k2 * inner.thickness)
    whole = (Z1 + Z2) ** 2 * back - (Z1 - Z2) ** 2 * ahead
    exact = {"T": 4 * Z1 * Z2 / whole, "R": (Z1**2 - Z2**2) * (back - ahead) / whole}
    judged = stored["judged"].astype(bool)
    assert judged.sum() >= 50
    for name, value in exact.items():
        assert np.abs(stored[f"{name}_exact"] - value)[judged].max() <= 1e-6
        assert np.abs(stored[name] - value)[judged].max() <= 1e-3
    assert np.abs(exact["T"][judged]).min() < 1e-2
    assert np.abs(exact["T"][judged]).max() > 0.5


def compare(one, other, only=""):
    """Names of the data sets that differ in any bit."""
    different = []
    with h5py.File(one, "r") as first, h5py.File(other, "r") as second:

        def look(name, item):
            if not isinstance(item, h5py.Dataset) or name.startswith("restart/ends"):
                return
            if name.startswith(only) and not np.array_equal(
                item[()], second[name][()], equal_nan=item.dtype.kind in "fc"
            ):
                different.append(name)

        first.visititems(look)
    return different


def test_interrupted_run_resumes_bit_for_bit(pulse, tmp_path, monkeypatch):
    """Stopped after its first chunk, while memory variables and the moment at the end are at work;
    --resume completes it, and every stored number is that of the run that was not stopped."""
    _, _, folder = pulse
    whole = integration.stream

    def stopped(*arguments):
        for chunk in whole(*arguments):
            yield chunk
            if chunk.first + chunk.count > 1:
                raise KeyboardInterrupt

    case, out = FOLDER / "pulse_test.toml", tmp_path / "out"
    with monkeypatch.context() as patched:
        patched.setattr(integration, "stream", stopped)
        result = call("run", case, "--out", out)
    assert result.exit_code == 130
    with h5py.File(out / "result.h5", "r") as file, h5py.File(folder / "result.h5", "r") as whole_:
        assert file.attrs["status"] == "running"
        assert 1 < len(file["t"]) < len(whole_["t"])
    resumed = call("run", case, "--out", out, "--resume")
    assert resumed.exit_code == 0, resumed.output
    assert compare(folder / "result.h5", out / "result.h5") == []
    checks = [json.loads((f / "summary.json").read_text())["checks"] for f in (folder, out)]
    assert checks[0] == checks[1]


def test_resolved_case_runs_to_the_same_signals(pulse, tmp_path):
    """Every default written out settles to the same plan, and to the same bits."""
    problem, _, folder = pulse
    again = load(folder / "resolved.toml")
    assert again.plan.schedule == problem.plan.schedule
    assert again.plan.bar == problem.plan.bar
    assert again.resolved == problem.resolved
    result = call("run", folder / "resolved.toml", "--out", tmp_path / "out", "--quiet")
    assert (result.exit_code, result.output) == (0, "")
    for group in ("receivers", "exact", "energy"):
        assert compare(folder / "result.h5", tmp_path / "out" / "result.h5", group) == []


def test_pulse_test_is_in_the_summary(pulse):
    """The first wave of a medium goes no faster than c_∞ = √(C_φφ/ρβ); arrivals ascend with x."""
    problem, _, folder = pulse
    (test,) = json.loads((folder / "summary.json").read_text())["pulse_tests"]
    assert (test["field"], test["sector"]) == ("phi1", "longitudinal")
    flux = flux_form(problem.plan.medium)
    unrelaxed = problem.plan.medium.damping.unrelaxed
    fastest = np.sqrt(unrelaxed * flux.C_phi_phi[0, 0] / flux.m_phi)
    picks = [a for a in test["arrivals"] if a["convention"] == "threshold"]
    assert [a["receiver"] for a in picks] == list(problem.receivers)
    times = [a["time_s"] for a in picks]
    assert (np.diff(times) > 0).all()
    for pick in picks:
        assert pick["time_s"] >= pick["position_m"] / fastest


@pytest.mark.parametrize("command", ["dispersion", "attenuation"])
def test_a_bar_with_ends_is_no_ring_to_the_laboratory(command, pulse):
    """ω(k) and k(ω) of a ring are not to be had from it: one line, and where its readings are."""
    _, _, folder = pulse
    result = call(command, folder / "result.h5")
    assert result.exit_code == 2
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"wavesim: {folder / 'result.h5'}: is of a bar with layers or ends")
    assert "summary.json" in line


GOOD = """\
[bar]
length = 0.032
spacing = 1.25e-4
left = "free"
right = "fixed"

[[layers]]
from = 0.0
to = 0.020

[[layers]]
from = 0.020
to = 0.032
density = 2000.0

[[sources]]
field = "phi1"
position = 0.008
peak_frequency = 2.0e5

[[receivers]]
name = "a"
position = 0.024

[time]
duration = 4.0e-6
"""
BAD = {
    "overlap": ("layers.1.from=0.019", "[[layers]] number 2: from = 0.019", "begin it at 0.02"),
    "gap": ("layers.1.from=0.021", "[[layers]] number 2: from = 0.021", "begin this one at 0.02"),
    "no thickness": ("layers.0.to=0.0", "[[layers]] number 1: to = 0", "thickness"),
    "short of the end": ("layers.1.to=0.031", "to = 0.031", "end it with the bar"),
    "receiver outside": ("receivers.0.position=0.033", "position = 0.033", "0 to 0.032 m"),
    "graded closure": ("layers.0.mass_damping=[1, 2]", "mass_damping = [1, 2]", "can't be graded"),
}


def told(path, *overrides):
    """The one line that `run` and `check` both refuse a case with."""
    lines = set()
    for command in ("run", "check"):
        extra = [word for override in overrides for word in ("--set", override)]
        result = call(command, path, *extra)
        assert result.exit_code == 2
        assert result.stdout == ""
        (line,) = result.stderr.splitlines()
        lines.add(line)
    (line,) = lines
    assert line.startswith(f"wavesim: {path}: ")
    return line


@pytest.fixture
def good(tmp_path):
    path = tmp_path / "bar.toml"
    path.write_text(GOOD)
    assert not load(path).plan.endless
    return path


@pytest.mark.parametrize("what", BAD)
def test_bad_layers_give_2_and_one_line(what, good):
    override, given, remedy = BAD[what]
    line = told(good, override)
    assert given in line
    assert remedy in line.partition(given)[2]


def test_a_layer_too_thin_for_the_grid_gives_2_and_one_line(good):
    """16 cells of order 8 take a spacing of a sixteenth of a millimetre for 1 mm."""
    line = told(good, "layers.0.to=0.031", "layers.1.from=0.031")
    assert "[[layers]] number 2: from = 0.031, to = 0.032: 0.001 m is 8 cells" in line
    assert "take [bar] spacing = 6.25e-05, a lower [bar] order, or a thicker layer" in line
    fine = ["layers.0.to=0.031", "layers.1.from=0.031", "bar.spacing=6.25e-5"]
    assert not load(good, fine).plan.endless


def test_a_recorded_signal_with_a_hole_gives_2_and_one_line(good, tmp_path):
    t = np.arange(200) * 1e-7
    rows = [f"{a:.9e},{np.exp(-(((a - 8e-6) / 2e-6) ** 2)):.9e}" for a in t]
    (tmp_path / "signal.csv").write_text("\n".join(["t,value", *rows]))
    recorded = 'kind = "recorded"\nfile = "signal.csv"'
    good.write_text(GOOD.replace("peak_frequency = 2.0e5", recorded))
    assert load(good).plan.sources[0].kind == "recorded"
    (tmp_path / "signal.csv").write_text("\n".join(["t,value", *rows[:90], *rows[93:]]))
    line = told(good)
    assert 'file = "signal.csv": line 92' in line
    assert "fill it in by interpolation" in line
