"""What will make a run fall short is said before it, with the key and the remedy."""

import re

import numpy as np
import pytest

import wavesim as ws
from wavesim.case.load import build
from wavesim.case.schema import parse
from wavesim.readings.bar.loudness import Loudness
from wavesim.report.answers import verdict
from wavesim.timedomain.time_step import time_step
from wavesim.verdict.foreseen_errors import foretold, limit_of, untold
from wavesim.verdict.judgement import measure
from wavesim.verdict.warnings_before_run import foreseen as said

ENDED = """
[medium]
closure = "consistent"
[bar]
length = 0.032
spacing = 1.25e-4
left = "fixed"
right = "free"
[[sources]]
field = "phi1"
position = 0.012
peak_frequency = 4.0e5
[[receivers]]
name = "near"
position = 0.018
[time]
duration = 3e-5
"""
RING = """
[bar]
cells = 512
spacing = 1.25e-4
[[sources]]
field = "phi1"
position = 0.032
peak_frequency = 6e5
[time]
duration = 4e-5
"""
SLOW = RING.replace(
    "peak_frequency = 6e5", 'kind = "tone-burst"\nfrequency = 1e5\ncycles = 3\nwindow = "cos4"'
)
BETWEEN = """
[medium]
closure = "consistent"
[bar]
spacing = 1.25e-4
left = "half-space"
right = "half-space"
[[layers]]
thickness = 0.012
[[layers]]
thickness = 0.004
density = 2500.0
[[layers]]
thickness = 0.01
[[sources]]
field = "phi1"
position = 0.011
peak_frequency = 2.5e5
[[receivers]]
name = "front"
position = 0.018
[time]
duration = 4e-5
"""
LAYERS = """
[[layers]]
from = 0.0
to = 0.016
[[layers]]
from = 0.016
to = 0.032
anisotropy = 0.25
"""
# Graded to its right end, which absorbs over the last 8 mm.
GRADED_END = (
    (ENDED + LAYERS)
    .replace('"free"', '"absorbing"')
    .replace("anisotropy = 0.25", "anisotropy = [0.0, 0.25]")
)


def built(text, *overrides):
    return build(parse(text, "my.toml", overrides), "my.toml")


def foreseen(text, *overrides):
    case = built(text, *overrides)
    return said(case, time_step(case.simulation))


@pytest.mark.parametrize(
    ("text", "overrides", "told"),
    [
        (RING, ("bar.cells=65536",), ("[bar] length = 8.192", "stays at rest; shorten it")),
        (ENDED, ("sources.0.position=0",), ("within half a cell of the fixed end", "inward")),
        (ENDED, ("sources.0.position=6e-5",), ("within half a cell of the fixed end", "inward")),
        (ENDED, ("receivers.0.position=0",), ('"near" position = 0', "no rotation moves")),
        (ENDED + LAYERS, ("receivers.0.position=0.016",), ("on the interface at 0.016 m", "jump")),
        (ENDED, ("receivers.0.position=0.032", "time.duration=6e-6"), ("nothing reaches it",)),
        (ENDED, ("sources.0.delay=1e-3",), ("begins only at", "nothing moves", "delay")),
        (ENDED, ("sources.0.delay=2.8e-5",), ("acts until", "lengthen the run")),
        (ENDED, ("sources.0.position=0.0175",), ('"near" position', "cells of a point source")),
        (GRADED_END, (), ("the medium changes in the absorbing layer", "0.024 to 0.032 m")),
        (ENDED, ("time.samples=30",), ("alias", "take at least")),
        (
            ENDED,
            ("medium.quality_factor=50", "medium.quality_band=[1e3, 2e4]"),
            ("quality_band", "outside of it"),
        ),
        (ENDED, ("time.step=1e-10",), ("products for 256 cells", 'step (now 1e-10 s) at "auto"')),
        (SLOW, ("analysis.k_min=1e4", "analysis.k_max=2e4"), ("which no source excites",)),
    ],
)  # fmt: skip
def test_what_will_fall_short_is_said(text, overrides, told):
    """And nothing else is, where that is all that is amiss."""
    assert foreseen(ENDED) == foreseen(RING) == []
    found = foreseen(text, *overrides)
    assert any(all(part in one for part in told) for one in found), found
    assert len(found) <= 2


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (ENDED, r"\w+ at \"near\""),
        (RING, r"k\(ω\) of longitudinal waves"),
        (BETWEEN, r"(R of longitudinal waves|\w+ at \"front\")"),
    ],
    ids=["ends", "ring", "half-spaces"],
)
def test_a_grid_that_is_too_coarse_is_told_with_the_cells_that_would_do(text, what):
    """Whose errors then are foreseen within what is allowed. (That a run has the errors that its
    grid is reckoned to have, to 1e-7 of a peak, is held by test_simulate_bars.)"""
    case = built(text, "bar.spacing=5e-4", "bar.order=4")
    errors = foretold(case.simulation, case.analysis, case.k_range)
    (told,) = said(case, time_step(case.simulation), errors)
    found = re.match(
        rf"\[bar\] spacing = 0.0005: by this grid {what} will be off by \S+ \(allowed \S+\)"
        r".*; take (\[bar\] order = 8 \(now 4\), or )?"
        r"\[bar\] spacing = (?P<spacing>\S+) \(\d+ cells\) or finer$",
        told,
    )
    assert found, told
    fine = built(text, f"bar.spacing={found['spacing']}", "bar.order=4")
    finer = foretold(fine.simulation, fine.analysis, fine.k_range)
    assert finer
    assert all(one.passed for one in finer)
    assert float(found["spacing"]) > 5e-5


def test_waves_shorter_than_the_grid_carries_are_said():
    """Close below the acoustic asymptote a wave of the default grid has two cells to its length;
    where nothing is judged that a grid's errors would show in."""
    text = ENDED[: ENDED.index("[[receivers]]")] + ENDED[ENDED.index("[time]") :]
    found = foreseen(text, "sources.0.peak_frequency=6e5", "bar.spacing=4e-4", "bar.order=2")
    assert any("cells to its length" in one and "spacing" in one for one in found), found


def test_what_is_too_much_to_work_out_beforehand_is_none_and_named():
    """A chirp over 800 periods of its highest frequency, whose transform takes seconds; more cells
    than can be eliminated at enough frequencies."""
    medium = ws.Medium(closure="consistent")
    layers = ws.Layers((ws.Layer(0.0, 0.032, medium),))
    bar = ws.Bar(128, 2.5e-4, left="fixed", right="free")
    known = {"duration": 6e-5, "receivers": {"far": 0.024}}
    long = ws.Chirp("phi1", 0.012, 1e5, 8e5, 1e-3)
    pulse = (ws.Ricker("phi1", 0.012, 2e5),)
    many = ws.Bar(40_000, 8e-7, left="fixed", right="free")
    for simulated, told in (
        (ws.Simulation(layers, bar, (long,), **known), "signal"),
        (ws.Simulation(layers, many, pulse, **known), "40000 cells"),
    ):
        assert foretold(simulated) is None
        assert told in limit_of(simulated)
    assert foretold(ws.Simulation(layers, bar, pulse, **known))
    assert not limit_of(ws.Simulation(layers, bar, pulse, **known))
    # Of a ring the branches are told, and that its receivers are not.
    round_about = ws.Bar(4000, 8e-6)
    ring = ws.Simulation(layers, round_about, pulse, **known)
    errors = foretold(ring)
    assert errors
    assert not any("far" in one.what for one in errors)
    assert "4000 cells" in untold(ring, errors)
    assert untold(ws.Simulation(layers, round_about, pulse, 6e-5), errors) == ""


AMID_A_SOURCE = """
[medium]
closure = "consistent"
anisotropy = -0.19
[bar]
spacing = 2.5e-4
left = "fixed"
right = "free"
[[layers]]
thickness = 0.012
[[layers]]
thickness = 0.012
density = 1200.0
[[sources]]
kind = "tone-burst"
field = "B22"
frequency = 2.4e5
cycles = 3
position = 0.0171
width = 8e-4
[[receivers]]
name = "in the source"
position = 0.0179
[[receivers]]
name = "by the interface"
position = 0.0117
[time]
duration = 3e-5
"""


LATE = """
[medium]
family = "translation"
anisotropy = 0.482
stiffness_ratio = 0.679
[bar]
cells = 397
spacing = 2.5e-4
left = "fixed"
right = "fixed"
[[sources]]
field = "A12"
position = 0.011947
kind = "chirp"
low = 180200.0
high = 540600.0
duration = 2.09e-05
[[receivers]]
name = "far"
position = 0.08768
[time]
duration = 1.68e-4
samples = 789
"""


def test_a_wave_that_arrives_late_is_foreseen():
    """After the part of a run that would tell of its grid where a wave comes sooner: its error is
    that of the same run where there is all the time, and not none."""
    case = built(LATE)
    (one,) = foretold(case.simulation)
    found = ws.integrate(case.simulation).at(0.08768, "u2")
    fine = built(LATE, "bar.cells=794", "bar.spacing=1.25e-4")
    exact = ws.integrate(fine.simulation).at(0.08768, "u2")
    off = np.abs(found - exact).max() / np.abs(exact).max()
    assert one.error == pytest.approx(off, rel=0.3)
    assert one.error > 100 * one.allowed


@pytest.mark.parametrize(
    ("text", "overrides", "told", "followed"),
    [
        (
            ENDED,
            ["sources.0.delay=5e-7"],
            r"delay = 5e-07: .* take at least (\S+) s",
            "sources.0.delay",
        ),
        (ENDED, [], r"lengthen \[time\] duration to (\S+) or more, or move", "time.duration"),
    ],
    ids=["jump", "eigenfrequencies"],
)
def test_what_is_told_to_change_mends_it(text, overrides, told, followed):
    """A signal that begins with a jump, which no grid mends; neighbours among eigenfrequencies."""

    def said(*changes):
        case = built(text, *overrides, *changes)
        found = measure(case, ws.integrate(case.simulation))
        lines = [one.remedy for one in found.checks if not one.passed] + found.notes
        return next((match for one in lines if (match := re.search(told, one))), None)

    assert said(f"{followed}={said()[1]}") is None


LET_GO = """
[medium]
stiffness_damping = 2e-9
[bar]
spacing = 4e-4
order = 4
left = "fixed"
right = "free"
[[layers]]
thickness = 0.012
[[layers]]
thickness = 0.012
stiffness_damping = 8e-9
[[sources]]
kind = "initial"
field = "phi1"
position = 0.012
width = 1e-3
[[receivers]]
name = "r"
position = 0.018
[time]
duration = 2e-5
samples = 120
"""


def test_a_bar_that_the_exact_solver_refuses_is_judged_beside_thirds_of_its_cells():
    """By as much as a run on a sixth of its cells tells; the verdict and a note say so. It is
    foreseen as well."""
    case, fine = built(LET_GO), built(LET_GO, "bar.spacing=6.6e-5", "bar.order=8")
    run, exact = (ws.integrate(one.simulation) for one in (case, fine))
    found = measure(case, run)
    (check,) = (one for one in found.checks if "signal" in one.name)
    name = re.search(r"\((\w+)\)", check.name)[1]
    off = np.abs(run.at(0.018, name) - exact.at(0.018, name)).max()
    assert check.measured == pytest.approx(off / Loudness(run).about(0.018, name), rel=0.1)
    assert not check.passed
    assert any("not known exactly" in note for note in found.notes)
    (told,) = foretold(case.simulation)
    assert told.error == pytest.approx(check.measured, rel=0.5)
    of_fine = {"checks": [one.row() for one in measure(fine, exact).checks]}
    assert "agrees with itself on cells a third as long" in verdict(of_fine)


def test_transmission_of_a_graded_bar_is_foreseen():
    """T and R of a run are as far off as thirds of its cells tell, to a fifth."""
    graded = BETWEEN.replace("density = 2500.0", "density = [1570.0, 2500.0]")
    case = built(graded, "bar.spacing=5e-4", "bar.order=2")
    told = {one.what[0]: one.error for one in foretold(case.simulation) if " of " in one.what}
    found = measure(case, ws.integrate(case.simulation)).checks
    for letter in "TR":
        (check,) = (one for one in found if f"|Δ{letter}|" in one.name)
        assert told[letter] == pytest.approx(check.measured, rel=0.2)


GRADED = AMID_A_SOURCE.replace("density = 1200.0", "density = [1570.0, 1200.0]")


@pytest.mark.parametrize("text", [AMID_A_SOURCE, GRADED], ids=["uniform", "graded"])
def test_a_run_finds_what_was_foreseen_of_it(text):
    """At each receiver the same field is furthest off, by as much to a fifth, what moves without
    travelling included: it is there in the source, and in the size that others are held against."""
    case = built(text)
    foreseen_of = {
        re.search(r'"(.*)"', one.what)[1]: one
        for one in foretold(case.simulation, case.analysis, case.k_range)
        if " at " in one.what
    }
    checks = measure(case, ws.integrate(case.simulation)).checks
    found = {
        re.search("signal at (.*): ", one.name)[1]: one for one in checks if "signal" in one.name
    }
    assert set(found) == set(foreseen_of) == set(case.simulation.receivers)
    for name, check in found.items():
        assert foreseen_of[name].what.split()[0] == re.search(r"\((\w+)\)", check.name)[1]
        assert foreseen_of[name].error == pytest.approx(check.measured, rel=0.2)
        assert foreseen_of[name].passed == check.passed
