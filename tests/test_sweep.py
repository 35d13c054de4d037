"""Sweeps: each member is what it is alone, and what was finished stays, whatever ends the sweep."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import dask
import numpy as np
import pytest
import xarray
from runs import SHIPPED, call

import wavesim as ws
from wavesim import planewave
from wavesim.case.layered_case import load_layers
from wavesim.figures.sweep import sweep_figures
from wavesim.material.medium import Medium
from wavesim.planewave.many_media import growing
from wavesim.studies.sweep_store import Layout, Store, Variable
from wavesim.studies.sweep_workers import pool
from wavesim.studies.transmission_study import transmission_study
from wavesim.studies.variation import SweepError, variation
from wavesim.verdict.check import Check

MAIN = SHIPPED["bandgap_pulse"]
SHORT = """\
[medium]
closure = "consistent"
anisotropy = 0.25
[bar]
length = 0.016
order = 4
spacing = 2.5e-4
[[sources]]
field = "phi1"
position = 0.006
peak_frequency = 3.0e5
[[receivers]]
name = "far"
position = 0.011
[time]
duration = 6.0e-6
"""


def test_what_is_not_there_is_nan_of_every_kind_of_number(tmp_path):
    """Of a member that failed and of one to come, a T of 0 would be a perfect filter's, and 0
    checks that fell short a perfect run's."""
    kinds = {"T": "c16", "lower": "f8", "fell_short": "i4"}
    layout = Layout({name: Variable((), "1", name, kind) for name, kind in kinds.items()})
    store = Store(tmp_path / "a.zarr", variation(["medium.anisotropy=0:1:3"]), layout, {})
    store.create()
    store.write(store.blocks[0], {name: [0] for name in kinds}, [""], 1.0, 1.0)
    store.write(store.blocks[1], {}, ["waves grow"], 1.0, 1.0)
    data = store.open()
    assert np.array_equal(data["status"], [1, 2, 0])
    for name in kinds:
        assert np.array_equal(np.isnan(data[name].values), [False, True, True])
        assert data[name].values[0] == 0


@pytest.fixture
def short(tmp_path):
    """File of a case whose run takes no time once it is compiled."""
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    return path


def test_gaps_of_a_sweep_are_those_of_each_medium(tmp_path):
    """Two routes: all members at once, and one case after the other, by planewave.gaps; to 1e-12.

    The medium of the buffers varies by one key, that of a layer in the repeated group by another.
    """
    case = SHIPPED["stack"]
    vary = ["medium.density=1000:2000:3", "layers.0.layers.1.anisotropy=0:0.6:2"]
    data = ws.sweep(case, vary, folder=tmp_path).go()
    assert data["lower"].attrs["units"] == "rad/s"
    assert data["medium.density"].attrs["units"] == "kg/m³"
    assert set(data["status"].values.ravel()) == {1}
    for density in data["medium.density"].values:
        for a in data["layers.0.layers.1.anisotropy"].values:
            own = [f"medium.density={density}", f"layers.0.layers.1.anisotropy={a}"]
            layers = ws.load(case, own).simulation.layers
            one = data.sel({"medium.density": density, "layers.0.layers.1.anisotropy": a})
            assert one.sizes["medium"] == len(layers.media)
            for medium, at in zip(layers.media, one["medium"].values, strict=True):
                for sector in ("longitudinal", "transverse2", "inplane"):
                    for gap in planewave.gaps(medium, sector):
                        edges = one.sel(gap=gap.name, medium=at)
                        assert float(edges["lower"]) == pytest.approx(gap.lower, rel=1e-12)
                        assert float(edges["upper"]) == pytest.approx(gap.upper, rel=1e-12)


STACK = """\
[medium]
closure = "consistent"
G_n_a = 40.0
G_n_r = 40.0
[bar]
left = "half-space"
right = "half-space"
[[layers]]
repeat = 2
[[layers.layers]]
thickness = 1.5e-3
G_n_a = 5.0
G_n_r = 5.0
[[layers.layers]]
thickness = 2.0e-3
G_n_a = GRADED
"""


BOTH = """\
[medium]
family = ["rotation", "translation"]
closure = "consistent"
K_n_a = 8.0e6
"""


def test_what_does_not_change_is_drawn_so(tmp_path):
    """RSB knows no G_n^a: its width differs by rounding, over which no axis spreads."""
    data = ws.sweep(MAIN, ["medium.G_n_a=5:40:3"], folder=tmp_path).go()
    panels = {axes.get_title(): axes for axes in sweep_figures(data)["gaps"]().axes}
    low, high = panels["width of RSB"].get_ylim()
    assert high - low > 1e-3 * high
    drawn = panels["width of RLB1"].lines[0].get_ydata()
    width = (data["upper"] - data["lower"]).sel(gap="RLB1").values / (2e3 * np.pi)
    assert np.abs(drawn / width - 1).max() <= 1e-12


def test_gaps_of_a_sweep_of_two_families_bear_their_names(tmp_path):
    """Each as planewave.gaps has it of a medium of its family alone; to 1e-12."""
    case = tmp_path / "both.toml"
    case.write_text(BOTH)
    vary = ["medium.anisotropy=0:1:3", "medium.K_n_r=1e6:2e6:2"]
    data = ws.sweep(case, vary, folder=tmp_path).go().load()
    assert dict(zip(data["gap"].values, data["family"].values, strict=True))["DSB"] == "translation"
    for a in data["medium.anisotropy"].values.tolist():
        for K in data["medium.K_n_r"].values.tolist():
            one = data.sel({"medium.anisotropy": a, "medium.K_n_r": K})
            turned = Medium(closure="consistent", anisotropy=a)
            moved = Medium(family="translation", anisotropy=a, K_n_a=8e6, K_n_r=K)
            for medium in (turned, moved):
                for sector in medium.family.sectors:
                    for gap in planewave.gaps(medium, sector):
                        edges = one.sel(gap=gap.name)
                        assert edges["family"] == medium.family.name
                        assert float(edges["lower"]) == pytest.approx(gap.lower, rel=1e-12)
                        assert float(edges["upper"]) == pytest.approx(gap.upper, rel=1e-12)


@pytest.mark.parametrize("G", ["10.0", "[10.0, 12.0]"], ids=["uniform", "graded"])
def test_transmission_of_a_sweep_is_that_of_each_stack(G, tmp_path):
    """As batches in jax, and one by one by the exact solver; to 1e-9 of the incident wave. Of
    graded layers without losses too, where there is no answer near an asymptote. A layer of no
    thickness, and a medium that can't be, are told of."""
    case = tmp_path / "stack.toml"
    case.write_text(STACK.replace("GRADED", G))
    vary = ["layers.0.layers.0.thickness=-1e-3:2e-3:3", "layers.0.layers.1.anisotropy=0.5:2.5:3"]
    data = ws.sweep(case, vary, "transmission", folder=tmp_path, points=21).go().load()
    assert np.array_equal(data["status"].values, [[2, 2, 2], [1, 1, 2], [1, 1, 2]])
    assert "thickness" in str(data["message"].values[0, 0])
    assert "anisotropy = 2.5: must be between" in str(data["message"].values[1, 2])
    for i, j in np.argwhere(data["status"].values == 1):
        one = data.isel({data["status"].dims[0]: i, data["status"].dims[1]: j})
        own = [f"{axis}={float(one[axis])}" for axis in data["status"].dims]
        band = (float(data["frequency"][0]), float(data["frequency"][-1]))
        exact = transmission_study(load_layers(case, own), band, 21)
        for sector, curve in exact.curves.items():
            found = one.sel(sector=sector)
            for name, expected in (
                ("T", curve.T),
                ("R", curve.R),
                ("transmitted", curve.power_T),
                ("reflected", curve.power_R),
            ):
                values = found[name].values
                assert np.array_equal(np.isnan(values), np.isnan(expected))
                assert np.nanmax(np.abs(values - expected)) <= 1e-9


def test_what_takes_too_long_or_too_much_disk_is_refused_with_what_fits(tmp_path, monkeypatch):
    """What was done stays, and more time carries it on; a hundred million members are refused
    before any is made."""
    vary = ["--vary", "medium.anisotropy=0:1:200", "--vary", "medium.stiffness_ratio=0.05:1:100"]
    many = call("sweep", MAIN, "--vary", "medium.anisotropy=0:1:100000000", "--out", tmp_path)
    assert many.exit_code == 2
    assert "at most 10,000,000" in many.output
    long = call("sweep", MAIN, *vary, "--out", tmp_path, "--at-most", "1e-6s")
    assert long.exit_code == 2
    assert "20000 members: the 10000 left take about" in long.output
    assert (xarray.open_zarr(tmp_path / "sweep.zarr")["status"].values == 1).sum() == 10000
    on = call("sweep", MAIN, *vary, "--out", tmp_path, "--resume")
    assert on.exit_code == 0
    assert "20000 of 20000 members" in on.output
    monkeypatch.setattr("wavesim.studies.sweep_store.free", lambda folder: 1e6)
    full = call("sweep", MAIN, *vary, "--out", tmp_path / "full")
    assert full.exit_code == 2
    assert "of disk; more than 1 MB" in full.output
    assert not (tmp_path / "full" / "sweep.zarr").exists()


def test_a_member_that_fails_is_told_of_and_stops_nothing(tmp_path):
    """By exit code and on the terminal too; its numbers are NaN, those of the others are there."""
    vary = ["--vary", "medium.anisotropy=0.5:2.5:5", "--vary", "medium.stiffness_ratio=0.5:2:2"]
    answer = call("sweep", MAIN, *vary, "--out", tmp_path)
    assert answer.exit_code == 1, answer.output
    data = xarray.open_zarr(tmp_path / "sweep.zarr")
    failed = data["status"].values == 2
    assert np.array_equal(failed, np.isnan(data["lower"].values).any(axis=-1))
    assert np.array_equal(failed, data["message"].values != "")
    told = data["message"].sel({"medium.anisotropy": 2.5, "medium.stiffness_ratio": 0.5})
    assert "anisotropy = 2.5: must be between -1 and 2" in str(told.values)
    assert "unstable" in str(data["message"].values[2, 1])
    assert f"{failed.sum()} members failed" in answer.stdout
    assert (tmp_path / "figures" / "gaps.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("given", "plain"),
    [
        ("layers.1.thickness=3mm:0.6 cm:4", "layers.1.thickness=0.003:0.006:4"),
        ("sources.0.peak_frequency=0.1MHz:300 kHz:3", "sources.0.peak_frequency=1e5:3e5:3"),
        ("layers.0.G_n_a.1=1e3N·m:2e3:2", "layers.0.G_n_a.1=1e3:2e3:2"),
    ],
)
def test_a_range_with_units_is_the_same_in_si(given, plain):
    assert np.array_equal(variation([given]).values, variation([plain]).values)


def test_media_whose_waves_grow_are_found(rng):
    """All at once by discriminants, and one by one by check_hyperbolic, which solves at all k."""
    a, eta = rng.uniform(-1, 2, 40), rng.uniform(0.05, 2, 40)
    found = growing(Medium(anisotropy=a, stiffness_ratio=eta), 40)
    for member, at in enumerate(zip(a, eta, strict=True)):
        try:
            planewave.check_hyperbolic(Medium(anisotropy=at[0], stiffness_ratio=at[1]))
        except planewave.NotHyperbolicError:
            assert found[member], at
        else:
            assert not found[member], at
    assert 3 < found.sum() < 37


@pytest.mark.parametrize("sampler", ["sobol", "lhs"])
def test_a_sample_fills_its_box_evenly(sampler):
    """Each half of each range has half of 16 members; the same seed gives the same members."""
    axes = ["medium.density=1000:2000", "medium.anisotropy=0:1:7"]
    made = variation(axes, 16, sampler, seed=3)
    assert made.dimensions == ("member",)
    assert np.array_equal((made.values > [1500, 0.5]).sum(axis=0), [8, 8])
    assert ((made.values >= [1000, 0]) & (made.values <= [2000, 1])).all()
    assert np.array_equal(made.values, variation(axes, 16, sampler, seed=3).values)
    assert not np.array_equal(made.values, variation(axes, 16, sampler, seed=4).values)


def test_runs_of_a_sweep_are_runs(short, tmp_path):
    """Signals of each member are those of its case alone, to the bit; one that can't be run says
    why, with another duration the frames are as many as it has. A check of a number that is none
    falls short, wherever it stands, and so the worst is above 1; of a member without a run there
    are no checks."""
    made_up = [Check("a", 0.5, 0.0, 1.0), Check("b", np.nan, 0.0, 1.0), Check("c", 0.0, 0.0, 0.0)]

    def judge(case, field):
        return SimpleNamespace(checks=made_up if field.t[-1] < 4e-6 else made_up[::2])

    vary = ["time.duration=3e-6:6e-6:2", "receivers.0.position=0.011:0.017:3"]
    data = ws.sweep(short, vary, "run", folder=tmp_path, judge=judge).go()
    assert np.array_equal(data["status"].values, [[1, 1, 2], [1, 1, 2]])
    for name, values in ("worst", (np.inf, 0.5)), ("fell_short", (1, 0)):
        told = np.array([[value, value, np.nan] for value in values])
        assert np.array_equal(data[name].values, told, equal_nan=True)
    assert "position = 0.017" in str(data["message"].values[0, 2])
    for duration in data["time.duration"].values:
        for x in data["receivers.0.position"].values[:2]:
            case = ws.load(short, [f"time.duration={duration}", f"receivers.0.position={x}"])
            field = ws.integrate(case.simulation)
            one = data.sel({"time.duration": duration, "receivers.0.position": x}, method="nearest")
            count = len(field.t)
            assert np.array_equal(one["time"].values[:count], field.t)
            assert np.isnan(one["signal"].values[..., count:]).all()
            for name in field.names:
                own = one["signal"].sel(receiver="far", field=name)
                assert np.array_equal(own.values[:count], field.at(x, name))
                assert str(own["unit"].values) == field.unit(name)


SWEEP = """\
import sys, wavesim as ws
vary = ["medium.anisotropy=0:0.5:25"]
ws.sweep(sys.argv[1], vary, "run", folder=sys.argv[2]).go(resume=len(sys.argv) > 3)
"""


def test_what_is_finished_outlives_a_kill(short, tmp_path):
    """A sweep is killed (−9) when some members are there; carried on, those are not done again, all
    others are, and all agree with a sweep that nothing befell."""
    command = [sys.executable, "-c", SWEEP, short, tmp_path / "killed"]
    process = subprocess.Popen(command)
    path = tmp_path / "killed" / "sweep.zarr"
    before = np.zeros(25, bool)
    while before.sum() < 3 and process.poll() is None:
        time.sleep(0.02)
        if path.exists():
            before = xarray.open_zarr(path)["status"].values != 0
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    killed = xarray.open_zarr(path).load()
    done = killed["status"].values == 1
    assert 3 <= done.sum() < 25
    assert np.isfinite(killed["signal"].values[done]).all()
    vary = ["medium.anisotropy=0:0.5:25"]
    again = ws.sweep(short, vary, "run", folder=tmp_path / "killed").go(resume=True).load()
    assert (again["status"] == 1).all()
    assert np.array_equal(again["finished"].values[done], killed["finished"].values[done])
    assert (again["finished"].values[~done] > killed["finished"].values[done].max()).all()
    calm = ws.sweep(short, vary, "run", folder=tmp_path / "calm").go().load()
    assert np.abs(again["signal"] - calm["signal"]).max() <= 1e-12 * np.abs(calm["signal"]).max()
    with pytest.raises(SweepError, match=r"of another sweep .vary differs"):
        ws.sweep(short, ["medium.anisotropy=0:0.4:25"], "run", folder=tmp_path / "killed").go(True)


def test_a_worker_that_is_lost_loses_nothing(tmp_path):
    """A worker that ends in the middle of a job (−9): another takes the job, and each result comes
    once, though the scheduler gives up what it was at."""
    import distributed  # noqa: F401  # else its settings go when this one is put back

    mark = tmp_path / "ended"

    def square(number):
        import os
        import signal
        from pathlib import Path

        if number == 3 and not Path(mark).exists():
            Path(mark).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return number**2

    with dask.config.set({"distributed.scheduler.allowed-failures": 0}), pool(1) as work:
        found = sorted(work(square, ((number, number) for number in range(6))))
    assert found == [(number, number**2) for number in range(6)]
    assert mark.exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["medium.anisotropi=0:1:3"], "anisotropi = 0.0: unknown key; did you mean anisotropy"),
        (["medium.anisotropy=1:0:3"], "the range from 1 to 0 is empty"),
        (["medium.anisotropy=0:1"], "a grid needs the number of values"),
        (["medium.anisotropy=0:1:x"], "N = x: must be a whole number"),
        (["medium.anisotropy=3:4:2"], "anisotropy = 3: must be between -1 and 2"),
        (["bar.length=0.1:0.2:3"], "does not matter to --measure gaps"),
        (["medium.density=1:2:2", "--vary", "medium.density=1:2:2"], "given twice"),
        (["medium.density=1:2:2", "--scheduler", "tcp://127.0.0.1:9"], "no scheduler of Dask"),
        (["medium.density=1:2:2", "--resume"], "no sweep in"),
    ],
)
def test_bad_input_is_told_in_one_line(arguments, said, tmp_path):
    answer = call("sweep", MAIN, "--vary", *arguments, "--out", tmp_path)
    assert answer.exit_code == 2
    assert said in answer.stderr
    assert answer.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
