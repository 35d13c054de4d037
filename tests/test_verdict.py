"""The verdict: that it passes what is right, and above all that it fails what is wrong."""

import dataclasses

import numpy as np
import pytest
from madeup import made_field

from wavesim import planewave
from wavesim.case.load import build
from wavesim.case.schema import parse
from wavesim.grid.bar import Bar
from wavesim.material.granular_equations import ROTATION
from wavesim.material.layers import as_layers
from wavesim.material.medium import Medium
from wavesim.planewave.dispersion_relation import driven_waves
from wavesim.readings.dispersion.extract import Measured, extract
from wavesim.readings.dispersion.spectrum import LOBE_BINS, Ridge, Spectrum
from wavesim.simulation.field import Energy
from wavesim.sources import EXCITED, Ricker, excitation
from wavesim.timedomain.integrate import integrate
from wavesim.verdict.branches import Branch, faint, hold, tables
from wavesim.verdict.check import Check
from wavesim.verdict.endless import judge
from wavesim.verdict.judgement import measure

LONGITUDINAL = ROTATION.blocks[0]
MEDIUM = Medium(anisotropy=0.25, closure="consistent")
BAR = Bar(1024, 1.25e-4, 8)
K_RANGE = (125.0, 3142.0)


def test_check_passes_within_its_tolerance_alone():
    assert Check("", 1.0, 1.0, 0.0).passed
    assert Check("", 1.25, 1.0, 0.25).passed
    assert Check("", 0.75, 1.0, 0.25).passed
    assert not Check("", 1.2500001, 1.0, 0.25).passed
    for wrong in (np.nan, np.inf, -np.inf):
        assert Check("", wrong, 0.0, 1e-3).passed is False
        assert Check("", 0.0, wrong, 1e-3).passed is False
    assert Check("", np.nan, np.nan, np.inf).passed is False


def field(*sources, medium=MEDIUM, **more):
    """A field of zeros: what is held here is made by hand."""
    sources = sources or (Ricker("phi1", 0.064, 1e6), Ricker("B11", 0.064, 1e6))
    return made_field(np.linspace(0, 5e-5, 501), {}, medium, BAR, sources, **more)


def measured(*ridges, top=5e6, width=2 * np.pi / 5e-5):
    """A measurement with these ridges, at wavenumbers that the bar holds."""
    k = BAR.wavenumbers[:80]
    spectrum = Spectrum(k, np.array([0.0, 2 * np.pi * top]), np.zeros((80, 2)), width)
    return Measured(LONGITUDINAL, spectrum, list(ridges), None)


def exact(number, first=1, last=80, factor=1.0):
    """A ridge on a branch of the theory, from one wavenumber of the bar to another."""
    k = BAR.wavenumbers[first:last]
    omega = planewave.block_frequencies(MEDIUM, LONGITUDINAL, k)[:, number]
    return Ridge(k, factor * omega, np.ones(len(k)))


def test_ridges_go_to_the_branch_they_are_nearest_to():
    """In any order, in pieces, and a little off; what lies between two branches goes to neither."""
    middle = Ridge(
        exact(0).k, (0.45 * exact(1).omega + 0.55 * exact(2).omega), np.ones(79)
    )  # as far from one as from the other, nearly
    pieces = [exact(2, factor=1.002), exact(0, 40), exact(1), exact(0, 1, 40), middle]
    held = hold(field(), measured(*pieces), K_RANGE)
    assert [b.name for b in held.branches] == ["LA", "LO1", "LO2"]
    assert held.strays == [middle]
    for number, branch in enumerate(held.branches):
        np.testing.assert_array_equal(branch.k, exact(number).k)
        np.testing.assert_allclose(branch.omega_exact, exact(number).omega, rtol=1e-12)
        assert branch.present
    np.testing.assert_allclose(held.branches[2].error, 0.002, rtol=1e-9)
    assert held.branches[0].error.max() < 1e-12


def test_what_is_judged():
    """Within the range of k, excited above EXCITED, below the highest frequency kept, and four
    bins clear of the neighbours and of its own mirror at −ω: each criterion by itself."""
    k = BAR.wavenumbers[:80]
    omega = planewave.block_frequencies(MEDIUM, LONGITUDINAL, k)
    ridges = [exact(0), exact(1), exact(2)]

    def judged(found, number, expected, sources=()):
        held = hold(field(*sources), found, K_RANGE)
        branch = held.branches[number]
        np.testing.assert_array_equal(np.isin(k[1:], branch.k[branch.judged]), expected[1:])
        assert branch.expected == expected.sum()

    inside = (k >= K_RANGE[0]) & (k <= K_RANGE[1])
    fine = 2 * np.pi / 1.0
    judged(measured(*ridges, width=fine), 0, inside)
    judged(measured(*ridges, width=fine), 2, inside)
    # four bins to the nearest, where LO1 and LO2 are closest by 0.3 of RLB2's neighbourhood
    least = (omega[:, 2] - omega[:, 1]).min()
    width = 1.1 * least / LOBE_BINS
    apart = omega[:, 2] - omega[:, 1] >= LOBE_BINS * width
    assert 0 < (apart & inside).sum() < inside.sum()
    below = omega[:, 1] - omega[:, 0] >= LOBE_BINS * width
    judged(measured(*ridges, width=width), 2, inside & apart)
    judged(measured(*ridges, width=width), 1, inside & apart & below)
    mirror = 2 * omega[:, 0] >= LOBE_BINS * width
    judged(measured(*ridges, width=width), 0, inside & below & mirror)
    # frequencies kept
    top = omega[60, 2]
    judged(measured(*ridges, width=fine, top=top / 2 / np.pi), 2, inside & (omega[:, 2] <= top))
    # excitation
    slow = Ricker("B11", 0.064, 0.4e6)
    excited = excitation([slow], omega[:, 2]) >= EXCITED
    assert 0 < (excited & inside).sum() < inside.sum()
    judged(measured(*ridges, width=fine), 2, inside & excited, (slow,))
    # a source of another block excites nothing here
    judged(measured(*ridges, width=fine), 2, inside & excited, (slow, Ricker("phi2", 0.064, 1e6)))


def test_branches_are_as_strong_as_the_source_drives_them(small_run, small_held):
    """Power of the ridges over what eigenvectors and the source's spectrum foretell is one number,
    for all branches and wavenumbers: to 1e-3, as the parabola through a peak is off by 2e-4."""
    field = small_run.field
    for held in small_held:
        block, found = held.measured.block, held.measured.spectrum
        own = [s for s in field.sources if s.field in block.fields]
        omega, size = driven_waves(field.medium, block, own, found.k)
        ratio = []
        for ridge in held.measured.ridges:
            at = np.searchsorted(found.k, ridge.k)
            branch = int(np.abs(omega[at].real - ridge.omega[:, None]).sum(axis=0).argmin())
            judged = np.isin(ridge.k, held.branches[branch].k[held.branches[branch].judged])
            ratio.append((ridge.power / size[at, branch] ** 2)[judged])
        every = np.concatenate(ratio)
        assert len(every) > 20
        np.testing.assert_allclose(every, np.median(every), rtol=1e-3)


def test_a_branch_that_is_hardly_driven_is_not_judged():
    """φ₁ at 385 kHz drives LO2, at 1.1 MHz, 5e-8 as strongly as LA: told, not held against it."""
    ridges = [exact(0), exact(1)]
    held = hold(field(Ricker("phi1", 0.064, 0.385e6)), measured(*ridges), K_RANGE)
    assert [b.expected > 0 for b in held.branches] == [True, True, False]
    assert "longitudinal LO2" in faint([held])
    held = hold(field(Ricker("B11", 0.064, 1e6)), measured(*ridges), K_RANGE)
    assert held.branches[2].expected > 0
    assert faint([held]) is None


def test_a_ridge_that_goes_straight_on_where_branches_avoid_each_other():
    """Its points are each branch's own on its side, as those of two ridges would be."""
    low, high = exact(1), exact(2)
    swap = np.argmin(high.omega - low.omega)
    first = np.arange(len(low.k)) < swap
    straight = Ridge(low.k, np.where(first, high.omega, low.omega), low.power)
    other = Ridge(low.k, np.where(first, low.omega, high.omega), low.power)
    held = hold(field(), measured(exact(0), straight, other, width=2 * np.pi * 1e3), K_RANGE)
    for number in (1, 2):
        np.testing.assert_array_equal(held.branches[number].k, exact(number).k)
        assert held.branches[number].error.max() < 1e-12


def test_what_creeps_is_no_ridge_of_a_wave():
    """A strain that a loss law lets go on for longer than the record is a peak within one bin of
    ω = 0, as e^{−t/τ} cos 0t is; what swings more than once is one that no branch explains."""
    k, width = BAR.wavenumbers[20:60], 2 * np.pi / 5e-5
    for turns, strays in ((0.2, 0), (3.0, 1)):
        ridge = Ridge(k, np.full(len(k), turns * width), np.ones(len(k)))
        assert len(hold(field(), measured(exact(0), ridge), K_RANGE).strays) == strays


def test_a_branch_beyond_the_frames_is_no_ridge_of_another():
    """Of LO2 frames of a Nyquist frequency ω_N below it show 2ω_N − ω: no branch, and no fault."""
    there, made = exact(2), field()
    nyquist = 0.95 * there.omega.min()
    slow = dataclasses.replace(made, t=made.t * (np.pi / made.interval / nyquist))
    back = np.abs(np.mod(there.omega + nyquist, 2 * nyquist) - nyquist)
    seen = measured(exact(0), dataclasses.replace(there, omega=back))
    for one, right in ((slow, True), (made, False)):
        held = hold(one, seen, K_RANGE)
        worst = max(b.error.max(initial=0) for b in held.branches)
        assert (worst < 1e-12 and not held.strays) == right


def test_presence_is_nine_tenths_of_what_is_expected():
    name, k = "LA", np.arange(20.0)
    for found, present in ((18, True), (17, False), (0, False)):
        judged = np.arange(20) < found
        assert Branch(name, k, k, k, judged, 20).present is present
    assert not Branch(name, k, k, k, np.zeros(20, bool), 0).present


def verdict(*ridges, **options):
    held = hold(field(), measured(*ridges, **options), K_RANGE)
    return {check.name: check for check in judge(field(), [held])}


def test_everything_right_passes():
    checks = verdict(exact(0), exact(1), exact(2), width=2 * np.pi / 1e-3)
    assert len(checks) == 2 + 6 + 4
    assert all(check.passed for check in checks.values())
    assert checks["waves present"].measured == checks["waves present"].reference == 3


def test_missing_branch_fails():
    checks = verdict(exact(0), exact(2), width=2 * np.pi / 1e-3)
    assert not checks["waves present"].passed
    assert checks["waves present"].measured == 2
    for what in ("median", "maximum"):
        check = checks[f"longitudinal LO1: |Δω|/ω, {what}"]
        assert np.isnan(check.measured)
        assert not check.passed


def test_ridge_of_no_wave_fails():
    between = Ridge(exact(1).k, 0.5 * (exact(1).omega + exact(2).omega), np.ones(79))
    checks = verdict(exact(0), exact(1), exact(2), between, width=2 * np.pi / 1e-3)
    assert not checks["ridges of no wave"].passed


@pytest.mark.parametrize(("off", "median", "maximum"), [(5e-4, 1, 1), (2e-3, 0, 1), (2e-2, 0, 0)])
def test_branch_that_is_off_fails(off, median, maximum):
    checks = verdict(exact(0), exact(1, factor=1 + off), exact(2), width=2 * np.pi / 1e-3)
    check = checks["longitudinal LO1: |Δω|/ω, median"]
    assert check.measured == pytest.approx(off, rel=1e-9)
    assert check.passed == median
    assert checks["longitudinal LO1: |Δω|/ω, maximum"].passed == maximum


def test_single_point_off_fails_the_maximum_alone():
    spoilt = exact(1)
    omega = spoilt.omega.copy()
    omega[30] *= 1.02
    checks = verdict(exact(0), dataclasses.replace(spoilt, omega=omega), exact(2), width=6e3)
    assert checks["longitudinal LO1: |Δω|/ω, median"].passed
    assert not checks["longitudinal LO1: |Δω|/ω, maximum"].passed


def test_gap_edges_are_the_extremes_of_the_branches():
    """RLB1 lies between the top of LA and the bottom of LO1 over the judged range, to one bin
    of 1/T; a branch shifted by 0.9 bins passes, by 1.1 bins not."""
    duration = 1e-3
    k = BAR.wavenumbers[1:80]
    inside = (k >= K_RANGE[0]) & (k <= K_RANGE[1])
    edge = exact(0).omega[inside].max() / 2 / np.pi
    for bins, passes in ((0.0, True), (0.9, True), (1.1, False), (-0.9, True), (-1.1, False)):
        lower = dataclasses.replace(exact(0), omega=exact(0).omega + 2 * np.pi * bins / duration)
        checks = verdict(lower, exact(1), exact(2), width=2 * np.pi / duration)
        check = checks["longitudinal top of LA below RLB1, at judged k"]
        assert check.reference == pytest.approx(edge, rel=1e-12)
        assert check.measured == pytest.approx(edge + bins / duration, rel=1e-9)
        assert (check.tolerance, check.unit) == (pytest.approx(1 / duration), "Hz")
        assert check.passed == passes
        assert checks["longitudinal bottom of LO1 above RLB1, at judged k"].passed


def test_run_passes_with_the_medium_it_was_made_with(small_run):
    checks = small_run.summary["checks"]
    assert [c["name"] for c in checks if not c["passed"]] == []
    names = [c["name"] for c in checks]
    assert any("longitudinal k in RLB1" in name for name in names)
    assert any("TSO(22-33)" in name for name in names)


@pytest.mark.parametrize(
    "wrong",
    [
        {"anisotropy": 0.255},
        {"anisotropy": 0.245},
        {"stiffness_ratio": 0.505},
        {"density": 1570 * 1.01},
        {"closure": "printed"},
    ],
    ids=str,
)
def test_run_fails_with_another_medium(small_run, wrong):
    """The same field held against a medium that differs in one parameter by 1 or 2 %, or in the
    closure alone: more than one kind of check falls short."""
    field_, k_range = small_run.field, small_run.loaded.k_range
    medium = dataclasses.replace(field_.medium, **wrong)
    layers = as_layers(medium, field_.bar.length)
    wrongly = dataclasses.replace(field_.simulation, layers=layers)
    other = dataclasses.replace(field_, simulation=wrongly, energy=None)
    held = [hold(other, m, k_range) for m in extract(other, k_range[1])]
    failed = [check for check in judge(other, held) if not check.passed]
    assert any("|Δω|/ω, median" in check.name for check in failed)
    assert any("|Δk|/|k|" in check.name for check in failed)


def energies(total, work, **medium):
    half = np.asarray(total) / 2
    energy = Energy(half, half, np.asarray(work))
    made = Medium(**medium)
    return [c.passed for c in judge(field(medium=made, energy=energy), [])]


def test_energy_is_judged_where_it_is_conserved():
    """In the closure "consistent", and in the printed one where a = 0; there alone."""
    constant = np.ones(501)
    constant[0] = 0.0  # from rest
    assert energies(constant, constant, closure="consistent", anisotropy=0.5) == [True, True]
    assert energies(constant, constant, closure="printed", anisotropy=0.0) == [True, True]
    assert energies(constant, constant, closure="printed", anisotropy=0.1) == []
    assert energies(0 * constant, 0 * constant) == []
    assert judge(field(), []) == []


def test_energy_checks_can_fail():
    """The pulse ends at 4 µs, frame 40: 2e-9 of the work missing fails the balance; a drift of
    2e-10 afterwards fails the constancy, and does no harm before the pulse's end."""
    work = np.ones(501)
    work[0] = 0.0  # from rest
    assert energies(work * (1 - 2e-9), work) == [False, True]
    late, early = work.copy(), work.copy()
    late[300] += 2e-10
    early[30] += 2e-10
    assert energies(late, work) == [True, False]
    assert energies(early, work) == [True, True]
    assert energies(np.full(501, np.nan), work) == [False, False]


def test_what_is_stored_of_blocks_of_one_sector_shares_its_axes_and_adds_its_powers():
    one, other = (measured(exact(0)) for _ in range(2))
    power = [np.full((80, n), float(n)) for n in (3, 2)]
    shown = [
        dataclasses.replace(m, spectrum=dataclasses.replace(m.spectrum, power=p))
        for m, p in zip((one, other), power, strict=True)
    ]
    held = [hold(field(), m, K_RANGE) for m in shown]
    stored = tables(held)
    np.testing.assert_array_equal(
        stored["dispersion/longitudinal/power"][0], np.tile([5.0, 5.0, 3.0], (80, 1))
    )
    values, unit = stored["dispersion/longitudinal/branches/LA/omega_exact"]
    np.testing.assert_allclose(values, exact(0).omega, rtol=1e-14)
    assert unit == "rad/s"
    assert not any(path.startswith("attenuation") for path in stored)


DRIVEN_LONG = """
[medium]
closure = "consistent"
anisotropy = 0.156
stiffness_ratio = 0.367
[bar]
cells = 331
spacing = 1.25e-4
[[sources]]
field = "{field}"
position = 0.0165
{width}
kind = "chirp"
low = 2.7e5
high = 8.1e5
duration = {duration}
[time]
duration = 1.1e-4
"""


@pytest.mark.parametrize(
    ("field", "width", "duration"),
    [("B21", "width = 6.5e-4", 2.9e-5), ("phi2", "", 5.5e-5)],
    ids=["wide on a micro-field", "for half of the run"],
)
def test_a_ring_that_is_driven_for_long_is_judged_by_what_is_left(field, width, duration):
    """Its branches are free waves once the source has ended: TA and an optical one are judged, each
    to 1e-4 of the plane-wave solver's, and nothing of a right run falls short."""
    text = DRIVEN_LONG.format(field=field, width=width, duration=duration)
    case = build(parse(text, "ring.toml"), "ring.toml")
    checks = measure(case, integrate(case.simulation)).checks
    assert all(one.passed for one in checks), [one.name for one in checks if not one.passed]
    worst = {one.name.split(":")[0]: one.measured for one in checks if "|Δω|/ω, max" in one.name}
    assert "transverse2 TA" in worst
    assert len(worst) >= 2
    assert max(worst.values()) <= 1e-4
