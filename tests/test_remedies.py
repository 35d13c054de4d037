"""Each check that falls short says what to change: the cause is found, the key named, the number
of the case told."""

from __future__ import annotations

import dataclasses
import json
import re

import numpy as np
import pytest
from click.testing import CliRunner
from madeup import (
    LOSSY,
    PLACES,
    SOFT,
    STIFF,
    chain,
    field_of,
    made_field,
    plain_field,
    pulsed,
    reading_of,
    scattered_of,
)

from wavesim import planewave
from wavesim.cli import main as cli
from wavesim.grid.bar import Bar, layered_bar
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.readings.bar.eigenfrequencies import Ringing
from wavesim.records.relations import OfMedium
from wavesim.simulation.field import Energy
from wavesim.sources import Ricker, ToneBurst
from wavesim.verdict import remedies
from wavesim.verdict.bar import judge_bar
from wavesim.verdict.bar_answers import bar_notes
from wavesim.verdict.check import Check
from wavesim.verdict.foreseen_errors import of_frequencies, of_wavenumbers
from wavesim.verdict.receivers_and_energy import energy_checks

LONGITUDINAL = ROTATION.blocks[0]
MEDIUM = Medium(closure="consistent", anisotropy=0.25)
# A key of the case file, as it is named in a remedy.
KEY = re.compile(r"\[\[?[a-z]+\]\]? (\"\w+\" )?[a-zA-Z_]+")


def endless(order=8, spacing=1.25e-4, stepper="propagator", **more):
    sources = (Ricker("phi1", 0.064, 1e6),)
    bar = Bar(1024, spacing, order)
    t = np.linspace(0, 5e-5, 501)
    return made_field(t, {}, MEDIUM, bar, sources, stepper=stepper, **more)


def test_only_a_check_that_falls_short_has_its_remedy_in_its_row():
    good, bad = (Check("a", value, 0.0, 1e-3, remedy="do that") for value in (0.0, 1.0))
    assert "remedy" not in good.row()
    assert bad.row() == {
        "name": "a", "measured": 1.0, "reference": 0.0, "tolerance": 1e-3, "unit": "–",
        "remedy": "do that", "passed": False,
    }  # fmt: skip
    assert "remedy" not in Check("a", 1.0, 0.0, 1e-3).row()


def test_a_finer_grid_is_told_where_the_grid_explains_the_error():
    """By its modified wavenumber: ω(k̃(k)) of LA is 8e-4 low at order 2 and l/8, 1e-8 at order 8."""
    k = np.linspace(125, 3142, 40)
    coarse, fine = endless(2), endless(8)
    slow = OfMedium(MEDIUM, LONGITUDINAL, coarse.bar).omega(k)
    error = np.abs(slow / planewave.block_frequencies(MEDIUM, LONGITUDINAL, k) - 1)[:, 0].max()
    assert error == pytest.approx(8.08e-4, rel=0.01)
    _, by_grid = of_frequencies(coarse, LONGITUDINAL, k)
    assert by_grid[:, 0].max() == pytest.approx(error)
    told = remedies.of_frequencies(coarse, LONGITUDINAL, k, 0, error)
    assert re.match(
        r"take \[bar\] order = 8 \(now 2\), or \[bar\] spacing = \S+ \(\d+ cells\) or finer",
        told,
    )
    for field, off in ((fine, error), (coarse, 100 * error), (coarse, np.nan)):
        told = remedies.of_frequencies(field, LONGITUDINAL, k, 0, off)
        assert told.startswith("lengthen [time] duration to 0.0001 or more (now 5e-05 s)")
    # A higher order mends little, as ends and interfaces have none higher.
    told = remedies.finer(endless(8))
    assert told == "take [bar] spacing = 6.25e-05 (2048 cells) or finer (now 0.000125 m)"


def test_a_shorter_step_is_told_where_a_solver_is_not_exact_in_time():
    """Of an error that the grid does not explain, 1e-3 at order 8."""
    k = np.linspace(125, 3142, 40)
    told = remedies.of_frequencies(endless(stepper="Tsit5", step=1e-8), LONGITUDINAL, k, 2, 1e-2)
    assert told == (
        'leave [time] solver (now "Tsit5") at "auto", which is exact in time, or take [time] '
        "step = 2e-09 or shorter (now 1e-08 s)"
    )
    for stepper in ("propagator", "chebyshev"):
        field = endless(stepper=stepper, step=1e-8)
        assert "duration" in remedies.of_frequencies(field, LONGITUDINAL, k, 2, 1e-2)


def test_wavenumbers_tell_the_grid_from_the_end_of_the_record():
    omega = np.linspace(1e6, 4e6, 30) + 3e5j
    field = endless(2)
    exact, slow = (
        OfMedium(MEDIUM, LONGITUDINAL, bar).wavenumber(omega) for bar in (None, field.bar)
    )
    error = np.abs(slow / exact - 1)
    assert of_wavenumbers(field, LONGITUDINAL, omega) == pytest.approx(error)
    assert "[bar] spacing" in remedies.of_wavenumbers(field, LONGITUDINAL, omega, error)
    told = remedies.of_wavenumbers(endless(8), LONGITUDINAL, omega, error)
    assert told.startswith("raise [analysis] damping to 21 (now 15)")
    told = remedies.of_wavenumbers(endless(8), LONGITUDINAL, omega.real + 6e5j, error)
    assert told.startswith("lengthen [time] duration")


@pytest.mark.parametrize(
    ("stepper", "told"),
    [
        ("chebyshev", "[time] step = 2e-09"),
        ("Dopri8", 'leave [time] solver (now "Dopri8") at "auto"'),
    ],
)
def test_energy_that_does_not_close(stepper, told):
    ramp = np.linspace(0, 1, 501)
    energy = Energy(0.5 * ramp, 0.5 * ramp, 1.1 * ramp)
    checks = energy_checks(endless(stepper=stepper, step=1e-8, energy=energy))
    assert not checks[0].passed
    assert told in checks[0].remedy


SLAB = chain((0.02, STIFF), (0.006, SOFT), (0.02, STIFF))


def slab(absorber=8e-3, receivers=None, frequency=3e5, source=None):
    bar = layered_bar(SLAB, 1.25e-4, 8, "absorbing", "absorbing", absorber)
    source = source or Ricker("phi1", 0.01, frequency)
    return field_of(SLAB, bar, [source], receivers or {"a": 0.015, "b": 0.0205})


def test_a_signal_that_is_off():
    """By a face: away from it. Else, if the absorber is short, that; else the grid."""
    field = slab()
    far, near = (remedies.of_signal(field, name) for name in "ab")
    assert far.startswith("take [bar] spacing = 5e-05 (920 cells) or finer (now 0.000125 m)")
    assert "[[sources]] peak_frequency below 300000" in far
    assert near.startswith(
        'move [[receivers]] "b" more than 0.001 m (8 cells) from the interface or end at 0.02 m '
        "(now at 0.0205)"
    )
    short = remedies.of_signal(slab(1e-3), "b")
    assert short == (
        "lengthen [bar] absorber to 0.008 (now 0.001 m): below 0.004 it reflects too much"
    )
    assert remedies.whatever_the_grid(slab(4e-3)) is None
    burst = slab(source=ToneBurst("phi1", 0.01, 3e5, window="hann"))
    assert 'window = "cos4"' in remedies.of_grid(burst)


def test_transmission_that_is_off_close_below_an_asymptote_of_a_buffer():
    edge = planewave.asymptotes(STIFF, "longitudinal")[0]
    omega = np.array([0.5, 0.8, 0.98]) * edge
    half = np.full(3, 0.5 + 0j)
    found = scattered_of(omega, 1e5, half, half, half, half, np.ones(3, bool))
    told = remedies.of_scattering(slab(), found, np.array([0.0, 1e-4, 1e-2]))
    assert f"furthest off at {omega[2] / 2e3 / np.pi:.4g} kHz, close below an asymptote" in told
    assert "[[sources]] peak_frequency below 300000" in told
    told = remedies.of_scattering(slab(), found, np.array([0.0, 1e-2, 1e-4]))
    assert f"furthest off at {omega[1] / 2e3 / np.pi:.4g} kHz: take [bar] spacing" in told
    # Where nothing judged is off there.
    only = dataclasses.replace(found, judged=np.array([True, True, False]))
    assert "asymptote" not in remedies.of_scattering(slab(), only, np.array([0.0, 1e-4, 1e-2]))


def test_eigenfrequencies_not_heard():
    """By the grid where those heard are off; else there is none at the receivers."""
    omega = np.linspace(1e5, 2e6, 5)
    right = Ringing("longitudinal", omega, omega, omega, np.ones(5), 1e3)
    silent = dataclasses.replace(right, found=np.where(omega > 1e6, np.nan, omega))
    off = dataclasses.replace(silent, found=silent.found * (1 + 1e-5))
    heard = {}
    for name, ringing in (("silent", silent), ("off", off)):
        checks = judge_bar(plain_field(), reading_of(ringing=(ringing,)))
        heard[name] = checks[0]
        assert not checks[0].passed
    assert heard["silent"].remedy.startswith("add [[receivers]] elsewhere")
    assert heard["off"].remedy.startswith("take [bar] spacing = 6.25e-05")


def test_readings_of_a_pulse_test_that_are_off():
    """What the exact signals show too is the window's: behind a gate an echo, or the record's end
    if that closes it; what they do not show is the grid's, or a short absorber's."""
    gated, test = pulsed(chain((0.06, STIFF)), "free", PLACES)
    told = remedies.of_window(gated, test)
    assert told.startswith("lengthen [bar] length to 0.12 (now 0.06 m)")
    cut, test = pulsed(chain((0.6, STIFF)), "free", PLACES)
    assert remedies.of_window(cut, test).startswith("lengthen [time] duration to 0.0")
    open_, test = pulsed(chain((0.06, LOSSY)), "absorbing", PLACES, absorber=8e-3)
    told = remedies.of_window(open_, test)
    assert told.startswith("lengthen [time] duration to 0.0002")
    short, test = pulsed(chain((0.06, LOSSY)), "absorbing", PLACES, absorber=1e-3)
    assert "[bar] absorber to 0.008" in remedies.of_grid(short)
    known = np.array([1e-5, 2e-5])
    told = remedies.of_arrival(open_, np.array([1e-5, np.nan]), known)
    assert told.startswith("take [bar] spacing")
    late = np.array([1e-5, 0.99e-4])
    told = remedies.of_arrival(open_, np.array([1e-5, np.nan]), late)
    assert told.startswith("lengthen [time] duration")
    assert "[bar] spacing" in remedies.of_arrival(open_, known + 1e-6, known)


def test_a_record_too_short_for_eigenfrequencies_is_noted():
    exact = {name: {} for name in PLACES}
    ring = Ringing("longitudinal", *(np.ones(1),) * 4, 1e3)
    (note,) = bar_notes(reading_of(exact=exact), plain_field())
    assert "no eigenfrequency was judged: none that a record of 0.0001 s" in note
    assert "lengthen [time] duration" in note
    assert bar_notes(reading_of(exact=exact, ringing=(ring,)), plain_field()) == []
    assert bar_notes(reading_of(exact=exact), plain_field(absorbing=True)) == []


TINY = """
[medium]
closure = "consistent"
[bar]
cells = 96
left = "free"
right = "free"
[[sources]]
field = "phi1"
position = 0.004
peak_frequency = 1.5e6
[[receivers]]
name = "by the end"
position = 0.0117
[time]
duration = 2e-5
"""


def test_each_failing_check_of_a_run_prints_its_remedy(tmp_path):
    """Below the table, one for each, with a key of the case; the same as in summary.json."""
    (tmp_path / "tiny.toml").write_text(TINY)
    result = CliRunner().invoke(
        cli.main, ["run", str(tmp_path / "tiny.toml"), "--out", str(tmp_path / "out")]
    )
    assert result.exit_code == 1, result.output
    checks = json.loads((tmp_path / "out" / "summary.json").read_text())["checks"]
    failing = [check for check in checks if not check["passed"]]
    assert failing
    text = " ".join(result.stdout.split())
    assert text.count("FAIL signal at by the end: move [[receivers]]") == 1
    for check in failing:
        assert KEY.search(check["remedy"]), check
        assert " ".join(check["remedy"].split()) in text
    assert all("remedy" not in check for check in checks if check["passed"])


def test_a_ring_too_short_to_follow_its_branches_is_to_be_lengthened_and_then_passes(tmp_path):
    """Four wavenumbers are too few to join a steep branch by, however long the record is; the
    length told makes them eight."""
    case = tmp_path / "short.toml"
    case.write_text(
        '[medium]\nclosure = "consistent"\nanisotropy = 0.385\nstiffness_ratio = 0.833\n[bar]\n'
        "order = 12\ncells = 133\nspacing = 6.25e-5\n[time]\nduration = 4.178e-5\n[[sources]]\n"
        'field = "B22"\nposition = 0.0020188\nwidth = 0.000435\nkind = "initial"\n'
    )

    def told(*changes):
        out = tmp_path / "out"
        CliRunner().invoke(cli.main, ["run", str(case), "--out", str(out), *changes])
        checks = json.loads((out / "summary.json").read_text())["checks"]
        return {check["name"]: check for check in checks if not check["passed"]}

    for longer in ((), ("--set", "time.duration=8.356e-5")):
        remedy = told(*longer)["waves present"]["remedy"]
        assert "[time]" not in remedy
        cells = re.search(r"lengthen \[bar\] length to 0\.016625 \((\d+) cells\)", remedy)
    assert told("--set", f"bar.cells={cells[1]}") == {}
