"""Integration in time against routes that share no stepper with it.

Three routes: the exact modal solution of the same semi-discrete equations (``exact.py``: FFT in
space, eigenvectors of the 12 × 12 problem in SI, Gauss sums over the pulses), the matrix
exponential, and diffrax's own Dopri8. What is left to differ is the time integration alone.
"""

from __future__ import annotations

import dataclasses
from functools import cache

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from exact import modal_field
from hypothesis import given, settings
from hypothesis import strategies as st
from jax.flatten_util import ravel_pytree

from wavesim.grid.bar import Bar
from wavesim.material.medium import Medium
from wavesim.material.scaling import block_coefficients, scales
from wavesim.material.sectors import BLOCKS
from wavesim.material.wave_equations import CURVATURES, ROTATIONS
from wavesim.simulation.plan import Plan, plan
from wavesim.sources import Ricker
from wavesim.timedomain.forcing import forcing
from wavesim.timedomain.integration import NotFiniteError, simulate, stream
from wavesim.timedomain.operator import from_fields, semi_discrete, to_fields
from wavesim.timedomain.program import advance
from wavesim.timedomain.response import pulse_tables
from wavesim.timedomain.steppers import (
    TERM,
    Chebyshev,
    Motion,
    Verlet,
    WaveEquation,
    propagate,
    propagator_series,
)
from wavesim.timedomain.timestep import (
    StepTooLongError,
    chebyshev_series,
    cosine,
    schedule,
    series_degree,
    sine,
    spectral_bound,
    stability_limit,
)

CELL = 2.5e-4
DURATION = 12e-6
# Two in the longitudinal sector that overlap in time and space, a point and a Gaussian; one in
# transverse 2 and one in two in-plane blocks, at other times; the amplitudes make all of them tell.
SOURCES = (
    Ricker("phi1", 3.03e-3, 600e3, amplitude=200.0),
    Ricker("B11", 3.4e-3, 450e3, width=6e-4, delay=3.9e-6),
    Ricker("B12", 8.1e-3, 400e3, amplitude=2.0, width=5e-4, delay=4e-6),
    Ricker("B23", 3.2e-3, 700e3, delay=3.5e-6),
)
# The last runs on 256 cells at order 2, where a pulse's reach within a step is less than the bar,
# with sources astride of the bar's ends.
ENDS = (
    Ricker("phi1", 0.9 * CELL, 600e3, amplitude=200.0),
    Ricker("B22", 255.3 * CELL, 450e3, width=6e-4, delay=3.9e-6),
)
CASES = {
    "long steps": ("consistent", Bar(64, CELL, 8), SOURCES, 13, None),
    "short steps": ("consistent", Bar(64, CELL, 8), SOURCES, 97, None),
    "three steps a frame": ("printed", Bar(64, CELL, 8), SOURCES, 25, DURATION / 24 / 2.9),
    "short reach": ("printed", Bar(256, CELL, 2), ENDS, 97, None),
}


@cache
def case(name):
    """The plan and the field of one of CASES; each is integrated once."""
    closure, bar, sources, samples, step = CASES[name]
    medium = Medium(anisotropy=0.4, closure=closure)
    settled = plan(medium, bar, sources, DURATION, samples, step=step)
    return settled, simulate(medium, bar, sources, DURATION, samples, step=step)


@pytest.mark.parametrize("name", CASES)
def test_chebyshev_is_exact(name):
    """Law: the stepper is the exact propagator, whatever its step (1 µs and 1/8 µs; 47 and 6
    radians of the fastest mode), in both closures and with several sources.

    Every field at 7 times, to 1e-10 of its largest value; measured 1.5e-13 (rounding of 12 to 96
    steps of series whose terms are of size 1).
    """
    _, field = case(name)
    frames = np.linspace(0, len(field.t) - 1, 7).astype(int)[1:]
    expected = modal_field(field.medium, field.bar, field.sources, field.t[frames])
    for made in field.names:
        size = np.abs(expected[made]).max()
        assert size > 0
        assert np.abs(field[made][frames] - expected[made]).max() <= 1e-10 * size, made
    # Sectors that no source drives are at rest, and are not integrated.
    largest = {
        kind: max(np.abs(expected[n]).max() for n in kind) for kind in (ROTATIONS, CURVATURES)
    }
    for kind, size in largest.items():
        for idle in set(kind) - set(field.names):
            assert np.abs(expected[idle]).max() <= 1e-12 * size


def test_the_cases_are_what_they_are_meant_to_be():
    steps = {name: case(name)[0].schedule for name in CASES}
    assert steps["long steps"].step == pytest.approx(8 * steps["short steps"].step)
    assert steps["three steps a frame"].steps_per_frame == 3
    assert steps["three steps a frame"].operator_products == 24 * 3 * 2 * (
        steps["three steps a frame"].degree
    )
    # Reach of a pulse on either side within a step, at order 2, against the bar's 256 cells.
    assert 2 * 2 * steps["short reach"].degree + 2 * 8.5 * 6e-4 / CELL < 0.75 * 256


@pytest.mark.parametrize("name", ["long steps", "short steps"])
def test_energy_is_the_work_of_the_sources(name):
    """Law: in the consistent closure kinetic and deformation energy change by the sources' work.

    The work is integrated from the sources and the velocities, not from the energy. To 1e-9 of the
    largest energy at all times and 1e-10 after the last pulse; measured 1e-13 and 4e-14.
    """
    _, field = case(name)
    energy = field.energy
    largest = energy.total.max()
    assert largest > 0
    assert np.abs(energy.total - energy.work).max() <= 1e-9 * largest
    after = field.t > field.quiet_from
    assert after.sum() >= 3
    assert np.ptp(energy.total[after]) <= 1e-10 * largest
    assert np.ptp(energy.kinetic[after]) > 0.01 * largest


def test_no_such_balance_in_the_printed_closure():
    """The counterpart: the printed equations' −½⟨q, Lq⟩ is no energy; it misses by far more."""
    _, field = case("three steps a frame")
    assert np.abs(field.energy.total - field.energy.work).max() > 1e-4 * field.energy.total.max()


def test_kinetic_energy_is_that_of_the_exact_rates():
    """½∫ ρβφ̇² + ργḂ² dx of the modal solution's rates, summed in SI; to 1e-10, measured 6e-14."""
    _, field = case("long steps")
    frames = [4, 8, 12]
    rates = modal_field(field.medium, field.bar, field.sources, field.t[frames], rate=True)
    medium = field.medium
    inertia = dict.fromkeys(ROTATIONS, medium.beta) | dict.fromkeys(CURVATURES, medium.gamma)
    expected = sum(
        0.5 * medium.density * inertia[name] * field.bar.spacing * (rate**2).sum(axis=1)
        for name, rate in rates.items()
    )
    np.testing.assert_allclose(field.energy.kinetic[frames], expected, rtol=1e-10)


def test_dopri8_agrees():
    """diffrax's own Dopri8 on the same term and equation, closure printed, work included.

    Its tolerance of 1e-11 a step leaves 4e-10 after 6 µs (measured); held to 1e-9.
    """
    medium, bar = Medium(anisotropy=0.4, closure="printed"), Bar(64, CELL, 8)
    settled = plan(medium, bar, SOURCES[:2], 6e-6, 9)
    operator = semi_discrete(medium, bar, settled.blocks)
    equation = WaveEquation(operator, forcing(SOURCES[:2], medium, bar, settled.blocks, operator))
    end = settled.duration / medium.time_scale

    @jax.jit
    def integrate(rest):
        return diffrax.diffeqsolve(
            TERM,
            diffrax.Dopri8(),
            t0=0.0,
            t1=end,
            dt0=0.05,
            y0=rest,
            args=equation,
            stepsize_controller=diffrax.PIDController(rtol=1e-11, atol=1e-13),
            max_steps=4096,
        ).ys

    rest = Motion(operator.zero(), operator.zero(), jnp.zeros(()))
    last = jax.tree.map(lambda a: np.asarray(a[0]), integrate(rest))
    *_, chunk = stream(settled)
    expected = to_fields(last.q, settled.blocks, medium)
    for name, values in expected.items():
        size = np.abs(chunk.values[name]).max()
        assert np.abs(chunk.values[name][-1] - values).max() <= 1e-9 * size, name
    assert chunk.energy.work[-1] == pytest.approx(
        float(last.work) * scales(medium).energy, rel=1e-9
    )


def test_verlet_has_order_two():
    """Error against the exact modal solution falls as h², within ±0.1.

    Steps of 0.36 to 0.09 of the stability limit, all fields at the end of 6 µs, where the pulse is
    over; errors 7e-3 to 4e-4. Measured 1.9993.
    """
    medium, bar = Medium(anisotropy=0.4, closure="printed"), Bar(64, CELL, 8)
    source = Ricker("phi1", 4.3e-3, 600e3)
    exact = modal_field(medium, bar, [source], [6e-6])
    errors, steps = [], []
    for count in (400, 800, 1600):
        field = simulate(
            medium, bar, [source], 6e-6, samples=2, solver="verlet", step=6e-6 / count * 1.0001
        )
        assert field.stepper == "verlet"
        assert field.step == pytest.approx(6e-6 / count)
        parts = [
            np.abs(field[n][-1] - exact[n][0]).max() / np.abs(exact[n]).max() for n in field.names
        ]
        errors.append(max(parts))
        steps.append(field.step)
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(2, abs=0.1)
    assert errors[0] < 1e-2


# The same bits however a run is cut


SMALL = (Medium(anisotropy=0.4), Bar(64, CELL, 4), (Ricker("phi1", 4.3e-3, 600e3),), 6e-6, 25)


@pytest.fixture
def of_seven(monkeypatch):
    """Chunks of seven frames in place of one chunk for the whole run."""
    monkeypatch.setattr(Plan, "chunk", property(lambda self: 7))


@cache
def cut(solver):
    """The small run in chunks of seven frames; integrated once."""
    return list(stream(plan(*SMALL, solver=solver)))


@pytest.mark.parametrize("solver", ["chebyshev", "verlet"])
def test_carrying_on_gives_the_same_bits(solver, of_seven):
    """A run taken up from the state after a chunk is the uninterrupted run, bit for bit."""
    settled, chunks = plan(*SMALL, solver=solver), cut(solver)
    assert [(c.first, c.count) for c in chunks] == [(0, 1), (1, 7), (8, 7), (15, 7), (22, 3)]
    taken_up = list(stream(settled, start=(14, chunks[2].motion)))
    assert [(c.first, c.count) for c in taken_up] == [(15, 7), (22, 3)]
    for one, other in zip(chunks[3:], taken_up, strict=True):
        for name in settled.fields:
            np.testing.assert_array_equal(one.values[name], other.values[name])
        for part in ("kinetic", "potential", "work"):
            np.testing.assert_array_equal(getattr(one.energy, part), getattr(other.energy, part))


def test_chunks_do_not_matter(of_seven, monkeypatch):
    """Chunks of seven frames and one chunk of all give the same field and energy, to 1e-13 of the
    largest; measured 0: the same instructions, compiled for another number of frames. The progress
    that is reported with the chunks ends at 1, and "auto" is Chebyshev on so short a bar."""
    chunks = cut("chebyshev")
    monkeypatch.setattr(Plan, "chunk", property(lambda self: 24))
    seen = []
    whole = simulate(*SMALL, receivers={"a": 1e-3}, progress=seen.append)
    assert seen == [1 / 25, 1.0]
    assert whole.stepper == "chebyshev"
    assert whole.receivers == {"a": 1e-3}
    for name in whole.names:
        one = np.concatenate([chunk.values[name] for chunk in chunks])
        size = np.abs(whole[name]).max()
        np.testing.assert_allclose(one, whole[name], rtol=0, atol=1e-13 * size)
    work = np.concatenate([chunk.energy.work for chunk in chunks])
    size = np.abs(whole.energy.work).max()
    np.testing.assert_allclose(work, whole.energy.work, rtol=0, atol=1e-13 * size)


def test_frames_by_default():
    """They hold twice the band of the highest source."""
    medium, bar, sources, *_ = SMALL
    times = plan(medium, bar, sources, 3e-6).times
    assert np.pi / times[1] >= 2 * sources[0].band
    assert np.pi / times[1] < 2.3 * sources[0].band


def test_a_plan_keeps_its_chunks_within_bounds():
    long = plan(SMALL[0], Bar(4096, CELL, 8), SOURCES, 1e-4, 3000)
    assert 4 <= long.chunk <= 128
    assert long.chunk * 8 * 4096 * len(long.fields) <= 24e6
    assert plan(*SMALL[:3], 6e-6, 5).chunk == 4


# Failing


def test_an_unstable_run_is_reported(monkeypatch):
    """Twice the stability limit, the check disabled: diffrax reports success, the field is not
    finite, and NotFiniteError says when, with which step, and what to do."""
    monkeypatch.setattr("wavesim.timedomain.timestep.stability_limit", lambda bound: 1e9)
    medium, bar, sources, *_ = SMALL
    bound = spectral_bound(medium, bar, BLOCKS[:1])
    step = 2 * 2 / np.sqrt(bound) * medium.time_scale
    with pytest.raises(
        NotFiniteError, match=r"not finite at t = .* shorten \[time\] step"
    ) as caught:
        simulate(medium, bar, sources, 600 * step, samples=101, solver="verlet", step=step)
    # A factor of (2 + √3)² a step passes 1e308 after 270 steps.
    assert 0 < caught.value.time <= 600 * step * (1 + 1e-12)


@pytest.mark.parametrize("factor", [1.02, 3.0])
def test_a_step_beyond_the_limit_of_verlet(factor):
    """h < 2/√Λ (Hairer, Lubich & Wanner 2003); the message gives what to multiply the step by."""
    medium, bar, sources, duration, samples = SMALL
    limit = 2 / np.sqrt(spectral_bound(medium, bar, BLOCKS[:1])) * medium.time_scale
    with pytest.raises(StepTooLongError) as caught:
        plan(medium, bar, sources, duration, samples, solver="verlet", step=factor * limit)
    assert caught.value.fraction == pytest.approx(1 / factor, rel=1e-12)
    assert f"{factor:.3g} times the stability limit" in str(caught.value)
    allowed = plan(
        medium, bar, sources, duration, samples, "verlet", factor * limit * caught.value.fraction
    )
    assert allowed.step <= limit * (1 + 1e-12)


def test_what_a_plan_refuses():
    medium, bar, sources, duration, samples = SMALL
    for arguments, message in (
        ((medium, bar, (), duration, samples), r"sources = \[\]: at least one"),
        ((medium, bar, sources, 0.0, samples), r"duration = 0 s: must be greater than 0"),
        ((medium, bar, sources, duration, 1), r"samples = 1: must be at least 2"),
        (
            (medium, bar, sources, duration, samples, "euler"),
            r"solver = 'euler': must be one of auto",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            plan(*arguments)


# Steps and series


@settings(max_examples=40, deadline=None, derandomize=True)
@given(bound=st.floats(1, 1e4), radians=st.floats(0.05, 200))
def test_the_series_ends_where_rounding_begins(bound, radians):
    """Truncated at series_degree the series of C, S/h and LS/√Λ are the functions, and at half that
    degree they are not.

    To 1e-15 (10 + h√Λ): the phase h√λ rounds to that, by itself. Measured 0.3 of it. At half the
    degree C is missed by 3e-8 at least. The step of 200 radians takes degree 130: 0.65 a radian.
    """
    root = np.sqrt(bound)
    step = radians / root
    degree = series_degree(step, bound)
    x = np.linspace(1, -1, 301)
    value = bound * (1 - x) / 2
    for function, size in (
        (lambda e: cosine(step, e), 1.0),
        (lambda e: sine(step, e), step),
        (lambda e: -e * sine(step, e), root),
    ):
        series = chebyshev_series(function, bound, degree)
        assert series.shape == (degree + 1,)
        made = np.polynomial.chebyshev.chebval(x, series)
        assert np.abs(made - function(value)).max() <= 1e-15 * (10 + radians) * size
    short = chebyshev_series(lambda e: cosine(step, e), bound, degree)[: degree // 2]
    missed = np.polynomial.chebyshev.chebval(x, short) - cosine(step, value)
    assert np.abs(missed).max() > 1e-8
    assert degree <= 0.5 * radians + 6 * (1 + radians) ** (1 / 3)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    bound=st.floats(1, 1e4),
    duration=st.floats(0.1, 1e3),
    frames=st.integers(2, 500),
    solver=st.sampled_from(["auto", "chebyshev", "verlet"]),
    part=st.none() | st.floats(0.05, 1),
)
def test_schedule(bound, duration, frames, solver, part):
    """Frames stand exactly on steps, and no step is longer than asked for or than is stable."""
    asked = None if part is None else part * 2 / np.sqrt(bound)
    made = schedule(bound, duration, frames, solver, asked)
    assert made.solver == ("verlet" if solver == "verlet" else "chebyshev")
    assert made.step * made.steps_per_frame * (frames - 1) == pytest.approx(duration, rel=1e-12)
    assert made.steps == made.steps_per_frame * (frames - 1)
    if asked is not None:
        assert made.step <= asked * (1 + 1e-11)
        assert made.steps_per_frame == 1 or 2 * made.step > asked * 0.999
    if made.solver == "verlet":
        assert made.step <= stability_limit(bound) * (1 + 1e-11)
        assert (made.degree, made.operator_products) == (1, made.steps)
    else:
        assert made.step * np.sqrt(bound) <= 200 * (1 + 1e-11)
        assert made.degree > made.step * np.sqrt(bound) / 2
        assert made.operator_products == 2 * made.degree * made.steps


@pytest.mark.parametrize("closure", ["printed", "consistent"])
def test_propagator_is_the_matrix_exponential(closure, rng):
    """(q, v) after a step without sources is exp(h [[0, 1], [L, 0]]) (q, v), by Padé sums.

    Random q and v on 16 cells of all blocks, 20 radians of the fastest mode; to 1e-12 of the
    largest, measured 3e-14.
    """
    medium, bar = Medium(anisotropy=0.8, closure=closure), Bar(16, CELL, 4)
    operator = semi_discrete(medium, bar)
    steps = schedule(spectral_bound(medium, bar, BLOCKS), 2.0, 2)
    flat, unravel = ravel_pytree(operator.zero())
    L = np.asarray(jax.vmap(lambda e: ravel_pytree(operator(unravel(e)))[0])(jnp.eye(flat.size))).T
    q, v = rng.normal(size=(2, flat.size))
    n = flat.size
    generator = np.block([[np.zeros((n, n)), np.eye(n)], [L, np.zeros((n, n))]])
    expected = scipy.linalg.expm(steps.step * generator) @ np.concatenate([q, v])
    made = jax.jit(lambda q, v: propagate(propagator_series(steps), steps.bound, operator, q, v))(
        unravel(jnp.asarray(q)), unravel(jnp.asarray(v))
    )
    made = np.concatenate([np.asarray(ravel_pytree(part)[0]) for part in made])
    for half in (slice(0, n), slice(n, 2 * n)):
        size = np.abs(expected[half]).max()
        assert np.abs(made[half] - expected[half]).max() <= 1e-12 * size


def test_declared_orders():
    assert Verlet().order(TERM) == 2
    settled = plan(*SMALL[:3], 1e-6, 3)
    assert settled.schedule.step * SMALL[0].time_scale == pytest.approx(settled.step)


# Gradients and batches


class Functional:
    """Σ φ₁² over the bar at the end of a run, as a function of the anisotropy, in pure jax.

    The step and the bound are of the fastest medium of the batch, a = 0.8, and the units those of
    one concrete medium, as they must be where the anisotropy is traced.
    """

    medium = Medium(closure="consistent")
    bar = Bar(48, CELL, 4)
    sources = (Ricker("phi1", 4.3e-3, 600e3, amplitude=1e5),)
    duration = 5e-6

    def __init__(self):
        fastest = dataclasses.replace(self.medium, anisotropy=0.8)
        self.plan = plan(fastest, self.bar, self.sources, self.duration, 9)
        assert fastest.time_scale == self.medium.time_scale

    def __call__(self, anisotropy):
        steps = self.plan.schedule
        medium = dataclasses.replace(self.medium, anisotropy=anisotropy)
        operator = semi_discrete(medium, self.bar, self.plan.blocks, reference=self.medium)
        force = forcing(self.sources, self.medium, self.bar, self.plan.blocks, operator)
        stepper = Chebyshev(
            propagator_series(steps), steps.bound, pulse_tables(operator, force, steps)
        )
        rest = Motion(operator.zero(), operator.zero(), jnp.zeros(()))
        _, last = advance(
            WaveEquation(operator, force),
            stepper,
            rest,
            jnp.asarray(0),
            steps.step,
            steps.legs[0],
        )
        return jnp.sum(to_fields(last.q, self.plan.blocks, self.medium)["phi1"] ** 2)

    def exact(self, anisotropy):
        medium = dataclasses.replace(self.medium, anisotropy=anisotropy)
        field = modal_field(medium, self.bar, self.sources, [self.duration])
        return float((field["phi1"] ** 2).sum())


def test_gradient_with_respect_to_the_medium():
    """jax.grad through operator, pulses, series and diffrax, by the anisotropy.

    Against a central difference of the exact modal solution, step 1e-4, good to 1e-8; held to
    1e-6. Measured 2e-9.
    """
    functional = Functional()
    value, slope = jax.jit(jax.value_and_grad(functional))(0.4)
    assert float(value) == pytest.approx(functional.exact(0.4), rel=1e-10)
    small = 1e-4
    expected = (functional.exact(0.4 + small) - functional.exact(0.4 - small)) / (2 * small)
    assert abs(expected) > 0.01 * float(value)
    assert float(slope) == pytest.approx(expected, rel=1e-6)


def test_a_batch_of_media_is_a_loop():
    """jax.vmap over anisotropies gives what one after the other gives, by the exact solution; to
    1e-10, measured 3e-14."""
    functional = Functional()
    batch = [0.0, 0.4, 0.8]
    made = jax.jit(jax.vmap(functional))(jnp.asarray(batch))
    expected = [functional.exact(a) for a in batch]
    np.testing.assert_allclose(made, expected, rtol=1e-10)
    assert np.ptp(expected) > 0.01 * max(expected)


# The field that a run leaves


def test_field_knows_its_axes():
    settled, field = case("long steps")
    assert field.t[0] == 0
    assert field.t[-1] == DURATION
    assert field.interval == pytest.approx(DURATION / 12)
    assert field.names == settled.fields
    assert set(field.names) == {"phi1", "B11", "B22", "B33", "phi2", "B12", "B21", "B23", "B32"}
    assert field.blocks == settled.blocks
    assert field.quiet_from == max(s.end for s in SOURCES)
    np.testing.assert_allclose(
        field.positions("B11") - field.positions("phi1"), CELL / 2, rtol=1e-9
    )
    for name in field.names:
        assert field[name].shape == (13, 64)
        assert not np.any(field[name][0])
    assert field.unit("phi2") == "rad"
    assert field.unit("B32") == "1/m"


def test_receiver_interpolates_to_the_bars_order():
    """On a grid point the stored value; between, the modal field's trigonometric polynomial.

    At seven points to a wavelength eight-point Lagrange interpolation, 0.4 of a cell past a point,
    errs by ∏|0.4 − i|/8! (2π/7)⁸ = 4e-4; most of the field is longer waves. Measured 5e-5.
    """
    _, field = case("long steps")
    for name, cell in (("phi1", 20), ("B12", 33)):
        np.testing.assert_array_equal(
            field.at(float(field.positions(name)[cell]), name), field[name][:, cell]
        )
    frame = 8
    for name in ("phi1", "B12"):
        values = field[name][frame]
        k = 2 * np.pi * np.fft.fftfreq(64, CELL)
        position = float(field.positions(name)[30]) + 0.4 * CELL
        shift = position - field.positions(name)[0]
        expected = (np.fft.fft(values) @ np.exp(1j * k * shift)).real / 64
        assert field.at(position, name)[frame] == pytest.approx(
            expected, abs=4e-4 * np.abs(values).max()
        )


def test_components_are_the_scaled_unknowns():
    """A block's components are its part of the state: orthonormal combinations, one inertia."""
    _, field = case("long steps")
    for block in field.blocks:
        state = from_fields({n: field[n][-1] for n in block.fields}, (block,), field.medium)
        components = field.components(block)
        assert [staggered for _, staggered in components] == [False] * len(block.rotations) + (
            [True] * len(block.curvatures)
        )
        for (values, _), part in zip(components, state[0], strict=True):
            assert values.shape == (13, 64)
            np.testing.assert_allclose(
                values[-1], part[0], rtol=0, atol=1e-14 * np.abs(values).max()
            )
    assert block_coefficients(field.medium, field.blocks[0], scales(field.medium)).c_pp.shape == (
        1,
        1,
    )
