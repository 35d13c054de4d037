"""Complex wavenumbers: the fit on exact exponentials, the transform on pulses known in closed form,
and both together against the spectral solver on a run."""

import numpy as np
import pytest
from madeup import made_field

from wavesim import planewave
from wavesim.grid.bar import Bar
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.readings.damped_transform import damped_transform
from wavesim.readings.dispersion import decay_along_ring as transmission
from wavesim.readings.dispersion.decay_along_ring import (
    FEWEST_POINTS,
    attenuation,
    free_stretch,
    wavenumbers,
)
from wavesim.readings.dispersion.extract import extract
from wavesim.sources import Ricker

LONGITUDINAL, TRANSVERSE = ROTATION.blocks[0], ROTATION.blocks[1]


def wavenumber_of_decay(U, x, floor):
    return wavenumbers(np.asarray(U, complex)[None], x, np.array([floor / 30]))[0][0]


@pytest.mark.parametrize("k", [3000.0 + 0.0j, 700 + 40j, 0.0 + 900j, -1500 + 3j, 5 + 1e-3j])
def test_wavenumber_of_exact_exponential(k):
    """Exact to rounding: 1e-12 of |k|, at distances from 2 to 14 mm."""
    x = np.arange(2e-3, 14e-3, 1.25e-4)
    found = wavenumber_of_decay((0.3 - 2j) * np.exp(1j * k * x), x, 0.0)
    assert abs(found - k) <= 1e-12 * max(abs(k), 1 / x[-1])


def test_fit_stops_where_the_amplitude_first_sinks_below_the_floor():
    """What follows may be anything, also if it rises above the floor again."""
    k = 300 + 800j
    x = np.arange(2e-3, 14e-3, 1.25e-4)
    U = np.exp(1j * k * x)
    floor = abs(U[30])
    for rest in (0.0, 5.0 + 1j):
        spoilt = np.where(np.arange(len(x)) >= 31, rest, U)
        spoilt[30] = 0.5 * floor
        assert abs(wavenumber_of_decay(spoilt, x, floor) - k) <= 1e-12 * abs(k)


def test_fewer_than_six_points_are_not_measured():
    x = np.arange(40) * 1e-4
    U = np.exp(-900 * x)
    enough = wavenumber_of_decay(U, x, U[FEWEST_POINTS] * 1.0001)
    assert enough == pytest.approx(900j, rel=1e-12)
    assert np.isnan(wavenumber_of_decay(U, x, U[FEWEST_POINTS - 1] * 1.0001))
    assert np.isnan(wavenumber_of_decay(U, x, 2.0))


def test_stronger_points_count_more():
    """Errors of 1e-6 of the first amplitude all along a wave that sinks to 1e-4 of it: with weights
    |U| k is off by 1e-6 of |k|, measured 1.0e-6; a plain straight line would be off by 1.2e-4."""
    k = 1000j
    x = np.linspace(0, 9.2e-3, 60)
    U = np.exp(1j * k * x)
    rng = np.random.default_rng(5)
    U = U + 1e-6 * np.exp(2j * np.pi * rng.uniform(size=60))
    assert abs(wavenumber_of_decay(U, x, 0.0) - k) <= 5e-6 * abs(k)


@pytest.mark.parametrize("k", [50.0j, 30 + 50j, 400 + 50j, 2000 + 40j])
def test_waves_that_went_round_a_ring_are_waves(k):
    """From a source on a ring of length L both ways: U ∝ exp(ikx) + exp(ik(L − x)). Exact to
    what rounding leaves of a curvature, 1e-9."""
    length = 0.016
    x = np.arange(2e-3, 0.125 * length + 4e-3, 1.25e-4)
    U = np.exp(1j * k * x) + np.exp(1j * k * (length - x))
    assert abs(wavenumber_of_decay(U, x, 0.0) - k) <= 1e-9 * abs(k)


def test_what_is_wrong_with_the_amplitudes_is_in_the_error_bar_of_k():
    """A smooth part of 1e-4 to 1e-8 of U that is no wave: of long waves, whose k shows in the
    curvature alone, it moves k by up to 2 %, and by less than the bar everywhere."""
    x = np.arange(2e-3, 14e-3, 1.25e-4)
    k = np.array([20, 60, 200, 1000, 4000]) + 30j
    for part in (1e-4, 1e-5, 1e-6, 1e-8):
        spoilt = np.exp(1j * np.outer(k, x)) + part * np.cosh((x - x.mean()) / 6e-3) * np.exp(0.3j)
        found, error = wavenumbers(spoilt, x, np.full(len(k), 1.5 * part))
        assert (np.abs(found - k) <= error).all()
        assert error[-1] <= part * k[-1].real


def ricker_transform(f_p, t_0, omega, sigma):
    """∫ (1 − 2u²) e^{−u²} e^{i(ω+iσ)t} dt by Gauss's rule on 32 panels of a seventh of a period."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    edges = t_0 + np.linspace(-2.2, 2.2, 33) / f_p
    half = (edges[1] - edges[0]) / 2
    t = (edges[:-1, None] + half * (nodes + 1)).ravel()
    u = (np.pi * f_p * (t - t_0)) ** 2
    values = (1 - 2 * u) * np.exp(-u + 1j * (omega + 1j * sigma) * t)
    return np.sum(np.tile(half * weights, 32) * values)


def test_damped_transform_of_a_ricker_pulse():
    """The pulse lies whole in the record, and ten frames to its period leave an alias of
    exp(−64): to 1e-13 of the largest value. Measured 2e-15."""
    f_p = 1e6
    pulse = Ricker("phi1", 0.0, f_p, amplitude=2.0)
    t = np.arange(0, 3e-5, 1 / (10 * f_p))
    omega = 2 * np.pi * f_p * np.array([0.1, 0.5, 1.0, 1.4, 2.0])
    for sigma in (0.0, 2e5, 6e5):
        found = damped_transform(pulse.signal(t), t, omega, sigma)
        exact = np.array([2 * ricker_transform(f_p, 2 / f_p, w, sigma) for w in omega])
        assert np.abs(found - exact).max() <= 1e-13 * np.abs(exact).max()


def test_damped_transform_of_a_long_record_at_many_even_frequencies():
    """As that of the pulse alone, in 30,000 samples at 9,000 frequencies: what is summed by chirps
    to 1e-11 of the largest value, as their phases are many turns. Measured 1.0e-13."""
    f_p = 1e6
    t = np.arange(30_000) / (10 * f_p)
    omega = 2 * np.pi * f_p * np.linspace(0.01, 3.0, 9_000)
    peaks = 2 / f_p, 1e-3
    values = np.stack([Ricker("phi1", 0.0, f_p, delay=t_0).signal(t) for t_0 in peaks], axis=1)
    for sigma in (0.0, 2e3):
        found = damped_transform(values, t, omega, sigma)
        for column, t_0 in enumerate(peaks):
            exact = np.array([ricker_transform(f_p, t_0, w, sigma) for w in omega])
            error = np.abs(found[:, column] - exact).max() / np.abs(exact).max()
            assert error <= 1e-11


def test_damped_transform_keeps_the_shape_of_the_field():
    t = np.linspace(0, 1, 50)
    values = np.random.default_rng(1).normal(size=(50, 3, 2))
    found = damped_transform(values, t, np.array([1.0, 2.0]), 0.5)
    assert found.shape == (2, 3, 2)
    single = damped_transform(values[:, 2, 1], t, np.array([1.0, 2.0]), 0.5)
    np.testing.assert_allclose(found[:, 2, 1], single, rtol=1e-12)


BAR = Bar(800, 1.25e-4, 8)  # 0.1 m


def empty_field(*sources):
    return made_field(np.array([0.0, 1.0]), {}, Medium(), BAR, sources)


def at(position, width=0.0, field="phi1"):
    return Ricker(field, position, 1e6, width=width)


@pytest.mark.parametrize(
    ("sources", "begin", "length"),
    [
        ((at(0.03),), 0.03, 0.1),
        ((at(0.03), at(0.03)), 0.03, 0.1),
        ((at(0.02), at(0.05)), 0.05, 0.07),
        ((at(0.01), at(0.08)), 0.01, 0.07),
        ((at(0.08), at(0.01)), 0.01, 0.07),
        ((at(0.01), at(0.05), at(0.07)), 0.01, 0.04),
        # a Gaussian ends six widths from its middle
        ((at(0.05, 1e-3),), 0.056, 0.088),
        ((at(0.02, 1e-3), at(0.05)), 0.05, 0.064),
        # one within the reach of another
        ((at(0.05, 2e-3), at(0.055)), 0.062, 0.076),
        # round the end of the ring
        ((at(0.099, 1e-3),), 0.105, 0.088),
        # sources of another block count for nothing
        ((at(0.02), at(0.07, field="phi2")), 0.02, 0.1),
        ((at(0.02), at(0.06, field="B22")), 0.06, 0.06),
    ],
)
def test_free_stretch(sources, begin, length):
    start, stretch = free_stretch(empty_field(*sources), LONGITUDINAL)
    assert stretch == pytest.approx(length, rel=1e-12)
    assert start == pytest.approx(begin, rel=1e-12)


@pytest.mark.parametrize("position", [0.05, 0.0971, 0.0])
def test_pulse_that_travels_without_dispersion(position):
    """φ = s(t − r/c): k = (ω + iσ)/c exactly, wherever the source stands on the ring. What is
    cut off at the end of the record comes after the pulse has passed the stretch, so that only
    rounding is left: 1e-12. Measured 3e-15."""
    c = 2000.0
    source = Ricker("phi1", position, 1e6)
    t = np.linspace(0, 5e-5, 601)
    r = np.mod(BAR.nodes - position, BAR.length)
    values = source.signal(t[:, None] - r / c)
    field = made_field(t, {"phi1": values}, Medium(), BAR, (source,))
    omega = 2 * np.pi * np.linspace(0.2e6, 2e6, 31)
    curve = attenuation(field, LONGITUDINAL, omega, 18.0)
    assert curve.sigma == pytest.approx(18.0 / 5e-5, rel=1e-14)
    exact = (omega + 1j * curve.sigma) / c
    assert np.abs(curve.k / exact - 1).max() <= 1e-12
    # From two branch lengths to an eighth of the ring, and −20 log₁₀ e · σ x/c in level.
    assert 2e-3 <= curve.distance[0] < 2e-3 + BAR.spacing
    assert 0.0125 - BAR.spacing < curve.distance[-1] <= 0.0125 + BAR.spacing
    level = -20 / np.log(10) * curve.sigma / c * (curve.distance - curve.distance[0])
    np.testing.assert_allclose(curve.level, np.tile(level, (31, 1)), atol=1e-6)


def test_wave_that_arrives_too_weak_is_not_a_number():
    """Where nothing stands above 30 exp(−σT) of the largest amplitude there is no k."""
    source = Ricker("phi1", 0.05, 1e6)
    t = np.linspace(0, 5e-5, 601)
    r = np.mod(BAR.nodes - 0.05, BAR.length)
    values = source.signal(t)[:, None] * np.exp(-2e4 * r)
    field = made_field(t, {"phi1": values}, Medium(), BAR, (source,))
    curve = attenuation(field, LONGITUDINAL, np.array([5e6]), 18.0)
    assert np.isnan(curve.k).all()


def test_block_without_a_rotation_is_refused():
    with pytest.raises(ValueError, match="has no macro-field: no wave travels in it"):
        attenuation(empty_field(at(0.05, field="B23")), ROTATION.blocks[3], np.array([1e6]), 18.0)


def test_bar_too_short_to_measure_along_gives_no_attenuation():
    """Sources all along the ring leave no stretch of six points."""
    sources = tuple(at(p) for p in np.arange(0, 0.1, 0.01))
    values = np.zeros((64, 800))
    fields = dict.fromkeys(LONGITUDINAL.fields, values)
    field = made_field(np.linspace(0, 5e-6, 64), fields, Medium(), BAR, sources)
    (measured,) = extract(field)
    assert measured.attenuation is None


def test_run_agrees_with_the_spectral_solver(small_run, small_held):
    """Law: U ∝ exp(ikx) at ω + iσ with the plane-wave root k(ω + iσ). Grid of 8 cells to a branch
    length, order 8; σT = 18. The phase error of the grid, (kh)⁸ · 4e-4 at k̄ = 0.5, is below 1e-6.
    Bar 1e-3, measured 3e-7 in RLB1 and 5e-6 in the bands."""
    medium = small_run.field.medium
    curve = small_held[0].measured.attenuation
    exact = planewave.wavenumber(medium, "longitudinal", curve.omega + 1j * curve.sigma)
    error = np.abs(curve.k / exact - 1)
    gap = planewave.gaps(medium, "longitudinal")[0]
    inside = (curve.omega > gap.lower) & (curve.omega < gap.upper)
    bands = np.ones_like(inside)
    for g in planewave.gaps(medium, "longitudinal"):
        bands &= (curve.omega < g.lower) | (curve.omega > g.upper)
    assert inside.sum() >= 5
    assert bands.sum() >= 5
    assert error[inside].max() <= 1e-5
    assert error[bands].max() <= 1e-4


def test_damping_does_not_matter_to_the_agreement(small_run):
    """σT of 12 and of 24 see other complex frequencies, and agree there as well: to what the cut at
    the end leaves, 100 exp(−σT) = 6e-4 over the weakest point of the fit at 12, and to 1e-7 at 24.
    Measured 4.6e-4 and 5e-9."""
    field = small_run.field
    gap = planewave.gaps(field.medium, "longitudinal")[0]
    omega = np.linspace(gap.lower, gap.upper, 9)[1:-1]
    for damping, bar in ((12.0, 1e-3), (24.0, 1e-7)):
        curve = attenuation(field, LONGITUDINAL, omega, damping)
        exact = planewave.wavenumber(
            field.medium, "longitudinal", omega + 1j * damping / field.t[-1]
        )
        assert np.abs(curve.k / exact - 1).max() <= bar


def test_plain_fourier_ratio_is_wrong_in_a_gap(small_run):
    """Why the window is there: without it (σT = 0) the ringing of the band edges makes k inside
    RLB1 wrong by more than half. Measured 130 to 200 %."""
    field = small_run.field
    gap = planewave.gaps(field.medium, "longitudinal")[0]
    omega = np.linspace(gap.lower, gap.upper, 9)[1:-1]
    curve = attenuation(field, LONGITUDINAL, omega, 1e-9)
    transform = damped_transform(field["phi1"], field.t, omega, 0.0)
    steps = np.arange(16, 128)
    seen = transform[:, 512 + steps]
    k = np.array([wavenumber_of_decay(u, steps * 1.25e-4, 0.0) for u in seen])
    exact = planewave.wavenumber(field.medium, "longitudinal", omega)
    assert np.median(np.abs(k / exact - 1)) > 0.5
    assert np.isnan(curve.k).all()


def test_record_read_in_parts_is_the_record(small_run, monkeypatch):
    """1024 columns at a time are as few as are read; the field of 1024 is doubled, so that there
    are two parts. k, the floor and the level are those of one part, to rounding: 1e-12."""
    field = small_run.field
    bar = Bar(2048, field.bar.spacing)
    doubled = made_field(
        field.t,
        {"phi1": np.hstack([field["phi1"], 0.5 * field["phi1"][:, ::-1]])},
        field.medium,
        bar,
        (at(0.12),),
    )
    omega = 2 * np.pi * np.linspace(2e5, 1.5e6, 9)
    whole = attenuation(doubled, LONGITUDINAL, omega, 18.0)
    monkeypatch.setattr(transmission, "_AT_ONCE", 1.0)
    part = attenuation(doubled, LONGITUDINAL, omega, 18.0)
    np.testing.assert_allclose(part.k, whole.k, rtol=1e-12)
    np.testing.assert_allclose(part.level, whole.level, atol=1e-9)
    assert np.isfinite(whole.k).any()
