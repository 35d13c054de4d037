"""What a run costs, counted and not timed: steps, products, compilations.

A bound here is a promise that a change must keep or restate. Each says where it comes from: a law
where there is one, and else the value counted when it was written plus a stated margin.
"""

import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jax import monitoring
from media import any_media

import wavesim as ws
from wavesim.grid.stencils import difference_norm
from wavesim.material.granular_equations import ROTATION
from wavesim.planewave.dispersion_relation import block_frequencies
from wavesim.simulation.simulation import simulation
from wavesim.timedomain import cost as costs
from wavesim.timedomain.time_step import time_step

MEDIUM = ws.Medium(anisotropy=0.25, closure="consistent")
CELL = 1.25e-4
UNITS = 200.0  # of time


def settled(medium=MEDIUM, cells=4096, frames=401, solver="auto", order=8, cell=CELL):
    """The steps of a run of twelve fields from pulses amid a ring."""
    bar = ws.Bar(cells, cell, order)
    names = ("phi1", "phi2", "phi3", "B22", "B23")
    sources = [ws.Ricker(name, bar.length / 2, 785e3) for name in names]
    asked = medium, bar, sources, UNITS * medium.time_scale, frames
    return time_step(simulation(*asked, solver=solver))


@settings(max_examples=20, deadline=None, derandomize=True)
@given(
    medium=any_media(),
    cells_to_length=st.floats(0.5, 20),
    order=st.sampled_from([2, 4, 8, 12]),
    cells=st.sampled_from([64, 65]),
)
def test_the_highest_frequency_is_bounded_closely(medium, cells_to_length, order, cells):
    """Law: no wave of the grid is faster than R, and the fastest comes within 4 % of it, half of
    which is a margin and half what a ring of an odd number of cells misses of Nyquist's k̃."""
    cell = medium.branch_length / cells_to_length
    k = np.linspace(0, difference_norm(cell, order), 257)
    fastest = max(block_frequencies(medium, block, k).max() for block in ROTATION.blocks)
    radius = settled(medium, cells, 3, "chebyshev", order, cell).radius / medium.time_scale
    assert fastest <= radius <= 1.04 * fastest


def series_bound(step):
    """Products of one step: hR and a tail that grows as its third root, as Bessel functions fall;
    rounded up to eight. Counted 9 + 30, 47 + 48, 193 + 70."""
    phase = step.step * step.radius
    return phase + 12 * (1 + phase) ** (1 / 3) + 16


@pytest.mark.parametrize("frames", [2, 51, 401])
def test_products_of_the_series(frames):
    """At most 200 radians of the fastest mode a step, and a frame takes no more than a step of its
    own where its interval is shorter than that."""
    step = settled(frames=frames, solver="chebyshev")
    assert step.steps <= max(frames - 1, np.ceil(step.radius * UNITS / 190))
    assert step.operator_products <= step.steps * series_bound(step)


@pytest.mark.parametrize("frames", [2, 51, 401])
def test_products_of_the_propagator(frames):
    """Law: one product a step, and a step as long as its frame's interval while the wave at c∞,
    0.883 l a unit of time, stays within 128 cells on either side."""
    step = settled(frames=frames)
    assert step.solver == "propagator"
    longest = 128 * CELL / (0.883 * MEDIUM.branch_length)
    assert step.steps <= max(frames - 1, np.ceil(UNITS / (0.8 * longest)))
    assert step.operator_products == step.steps


@pytest.mark.parametrize("solver", ["propagator", "chebyshev", "Tsit5"])
def test_steps_do_not_grow_with_the_bar(solver):
    """Nor their degree, nor the reach of their tables: of 4,096 cells as of a million."""
    small, large = (settled(cells=cells, frames=21, solver=solver) for cells in (4096, 10**6))
    assert dataclasses.replace(large, radius=small.radius) == small
    assert large.radius == pytest.approx(small.radius, rel=1e-12)


def test_shipped_runs_take_as_few_products(shipped):
    """What was counted is what a run tells: lossless ones one a frame; with losses and absorbers
    at most three steps a frame, whose decay sets them."""
    for name in ("bandgap_pulse", "free_bar", "slab", "pulse_test"):
        run = shipped(name)
        steps, frames = run.summary["steps"], len(run.field.t)
        planned = time_step(run.loaded.simulation)
        assert run.summary["operator_products"] == planned.operator_products
        if run.loaded.simulation.lossy:
            assert steps <= 3 * (frames - 1)
            assert planned.operator_products <= steps * series_bound(planned)
        else:
            assert (steps, planned.operator_products) == (frames - 1, frames - 1)


SOFT = ws.Medium(anisotropy=0.3, closure="consistent")
LOSSY = dataclasses.replace(SOFT, damping=ws.constant_quality(30.0, (2e5, 2e6)))


def stack(medium, ends=("free", "fixed")):
    stiff = dataclasses.replace(medium, G_n_a=9.0, density=2000.0)
    edges = (0.0, 0.0053, 0.0104, 0.0213)
    made = zip(edges, edges[1:], (medium, stiff, medium), strict=False)
    layers = ws.Layers(tuple(ws.Layer(*each) for each in made))
    bar = ws.layered_bar(layers, CELL, 8, *ends, 8e-3 if "absorbing" in ends else 0.0)
    return layers, bar, [ws.Ricker("phi1", 0.0151, 785e3)], 4e-6, 9


@pytest.mark.parametrize(
    ("of", "medium"),
    [
        (stack, SOFT),
        (lambda medium: stack(medium, ("free", "absorbing")), LOSSY),
    ],
    ids=["lossless", "lossy"],
)
def test_a_second_run_compiles_nothing(of, medium):
    """Nor does one of another medium whose steps are of the same degree."""
    compiled = []

    def listener(event, seconds, **_):
        if "backend_compile" in event:
            compiled.append(seconds)

    other = dataclasses.replace(medium, anisotropy=0.29)
    monitoring.register_event_duration_secs_listener(listener)
    try:
        ws.simulate(*of(medium))
        assert compiled
        compiled.clear()
        for again in (medium, other):
            ws.simulate(*of(again))
            assert not compiled
    finally:
        monitoring.unregister_event_duration_listener(listener)


def test_disk_is_foreseen(shipped):
    """To 30 % of what runs of shipped cases took, once they are done. (Their memory is that of the
    process that runs the tests.)"""
    for name in ("bandgap_pulse", "free_bar", "slab"):
        run = shipped(name)
        simulated = run.loaded.simulation
        found = costs.cost(simulated, time_step(simulated))
        disk = sum(path.stat().st_size for path in run.folder.rglob("*") if path.is_file())
        assert found.disk == pytest.approx(disk, rel=0.3)


def test_what_does_not_fit_is_refused_with_what_would(tmp_path, monkeypatch):
    monkeypatch.setattr(costs, "slowness", lambda: (1.0, 1.0))
    bar = ws.Bar(512_000, CELL)
    made = simulation(MEDIUM, bar, [ws.Ricker("phi1", 32.0, 4e5)], 0.2, 4000)
    found = costs.cost(made, time_step(made))
    assert re.search(r"\d (hours|days|weeks), .*GB of memory and .*GB of disk", found.in_words)
    with pytest.raises(ValueError, match=r"longer than .*at most duration = \S+, or .*--at-most"):
        costs.check_cost(made, dataclasses.replace(found, memory=1e9), folder=None)
    costs.check_cost(made, dataclasses.replace(found, memory=1e9), at_most=2 * found.seconds)
    with pytest.raises(ValueError, match=r"more memory than .* take at most \d+ cells"):
        costs.check_cost(made, dataclasses.replace(found, memory=1e15))
    with pytest.raises(ValueError, match=r"more disk than .* take at most \d+ \[time\] samples"):
        costs.check_cost(made, dataclasses.replace(found, disk=1e15, memory=1e9), folder=tmp_path)
    with pytest.raises(ValueError, match="longer than"):
        ws.simulate(MEDIUM, ws.Bar(4096, CELL), [ws.Ricker("phi1", 0.2, 4e5)],
                    1e-4, 101, at_most=1e-3)  # fmt: skip


@pytest.mark.parametrize(
    ("text", "seconds"), [("90", 90), ("1.5s", 1.5), ("30min", 1800), ("2h", 7200), ("1d", 86400)]
)
def test_times_are_read(text, seconds):
    assert costs.seconds_of(text) == seconds
    for wrong in ("", "h", "-1s", "nan", "2 fortnights", "1e999"):
        with pytest.raises(ValueError, match="such as 90s"):
            costs.seconds_of(wrong)
