"""The banded exact propagator against the exact modal solution and the Chebyshev recurrence."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from exact import modal_field
from hypothesis import given, settings
from hypothesis import strategies as st

from wavesim.grid.bar import Bar
from wavesim.material.medium import Medium
from wavesim.material.scaling import block_coefficients, scales
from wavesim.material.sectors import BLOCKS
from wavesim.material.wave_equations import fastest_speed
from wavesim.simulation.plan import Plan, plan
from wavesim.sources import Ricker
from wavesim.timedomain.integration import simulate, stream
from wavesim.timedomain.kernels import convolution, convolve, convolve_all, kernels
from wavesim.timedomain.operator import semi_discrete
from wavesim.timedomain.propagator import bar_kernels
from wavesim.timedomain.steppers import propagate, propagator_series
from wavesim.timedomain.timestep import reach_within, schedule, spectral_bound

CELL = 1.25e-4
# Points and Gaussians, in three sectors, overlapping in time and space, one astride of the end.
SOURCES = (
    Ricker("phi1", 0.9 * CELL, 700e3),
    Ricker("B22", 15.03e-3, 900e3, amplitude=3e-4, width=4e-4),
    Ricker("phi2", 15.1e-3, 800e3, delay=3.1e-6),
    Ricker("B23", 20e-3, 800e3, amplitude=3e-4),
)
# (closure, order, cells, frames over 12 µs): steps of 0.6, 7.4 and 2.3 units of time.
CASES = {
    "short steps": ("printed", 8, 257, 97),
    "long steps": ("consistent", 8, 512, 9),
    "low order": ("consistent", 2, 384, 27),
}


@cache
def run(name):
    closure, order, cells, frames = CASES[name]
    medium, bar = Medium(anisotropy=0.4, closure=closure), Bar(cells, CELL, order)
    return simulate(medium, bar, SOURCES, 12e-6, frames, solver="propagator")


@pytest.mark.parametrize("name", CASES)
def test_it_is_exact(name):
    """Law: the stepper solves the semi-discrete equations exactly, whatever its step.

    Every field at four times, to 1e-10 of its largest value; measured 3e-13 (rounding of the
    kernels, whose entries are known to 1e-16 for each radian of the fastest mode in a step).
    """
    field = run(name)
    assert field.stepper == "propagator"
    frames = np.linspace(0, len(field.t) - 1, 5).astype(int)[1:]
    expected = modal_field(field.medium, field.bar, field.sources, field.t[frames])
    for made in field.names:
        size = np.abs(expected[made]).max()
        assert size > 0
        assert np.abs(field[made][frames] - expected[made]).max() <= 1e-10 * size, made


@pytest.mark.parametrize("name", ["long steps", "low order"])
def test_energy_is_the_work_of_the_sources(name):
    """Law: closure consistent, energy changes by the sources' work; to 1e-9 of its maximum while
    they act and to 1e-10 after; measured 3e-14."""
    energy = run(name).energy
    largest = energy.total.max()
    assert np.abs(energy.total - energy.work).max() <= 1e-9 * largest
    assert np.ptp(energy.total[run(name).t > run(name).quiet_from]) <= 1e-10 * largest
    assert energy.work[-1] > 0.5 * largest


def test_a_long_run_stays_exact():
    """3,000 steps of the two-term recurrence, whose rounding could grow as n^{3/2}; 1,200 units of
    time, closure printed. To 1e-9 of the largest value; measured 5e-11."""
    medium, bar = Medium(anisotropy=0.25), Bar(256, CELL)
    source = Ricker("phi1", 16e-3, 1e6)
    duration = 1200 * medium.time_scale
    field = simulate(medium, bar, [source], duration, 3001, solver="propagator")
    expected = modal_field(medium, bar, [source], field.t[-1:])
    for name in field.names:
        size = np.abs(expected[name]).max()
        assert np.abs(field[name][-1] - expected[name]).max() <= 1e-9 * size, name


def test_carrying_on_gives_the_same_bits(monkeypatch):
    monkeypatch.setattr(Plan, "chunk", property(lambda self: 7))
    settled = plan(Medium(anisotropy=0.4), Bar(256, CELL), SOURCES[:2], 6e-6, 29)
    assert settled.schedule.solver == "propagator"
    chunks = list(stream(settled))
    carried = list(stream(settled, start=(14, chunks[2].motion)))
    assert len(carried) == 2
    for one, other in zip(chunks[3:], carried, strict=True):
        for name in settled.fields:
            np.testing.assert_array_equal(one.values[name], other.values[name])
        np.testing.assert_array_equal(one.energy.work, other.energy.work)


@pytest.mark.parametrize("closure", ["printed", "consistent"])
def test_one_product_is_one_step_of_the_recurrence(closure, rng):
    """C, S and LS of random fields by dense products and by the Chebyshev recurrence in L, which
    shares only the operator's coefficients; to 1e-12 of the largest, measured 7e-14."""
    medium, bar = Medium(anisotropy=0.7, closure=closure), Bar(301, CELL, 6)
    operator, step = semi_discrete(medium, bar), 3.0
    steps = schedule(spectral_bound(medium, bar, BLOCKS), step, 2)
    parts = bar_kernels(medium, bar, BLOCKS, step)
    state = jax.tree.map(lambda c: jnp.asarray(rng.normal(size=c.shape)), operator.zero())
    rest = operator.zero()
    whole = jax.jit(lambda q, v: propagate(propagator_series(steps), steps.bound, operator, q, v))
    one_track = jax.tree.map(lambda c: c[None], state)
    C, S, LS = convolve_all(parts, one_track)
    expected = (whole(state, rest)[0], whole(rest, state)[0], whole(state, rest)[1])
    for made, known in zip((C, S, LS), expected, strict=True):
        for one, other in zip(jax.tree.leaves(made), jax.tree.leaves(known), strict=True):
            assert np.abs(one[0] - other).max() <= 1e-12 * np.abs(other).max()
    for one, other in zip(
        jax.tree.leaves(C), jax.tree.leaves(convolve(parts, one_track)), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-14)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    anisotropy=st.floats(0, 1),
    ratio=st.floats(0, 1),
    order=st.sampled_from([2, 4, 6, 8, 10, 12]),
    step=st.floats(0.1, 12),
    cells_to_length=st.floats(2, 16),
)
def test_the_reach_is_bounded(anisotropy, ratio, order, step, cells_to_length):
    """The kernels end within reach_within, which plans and pulse windows rely on."""
    medium = Medium(anisotropy=anisotropy, stiffness_ratio=ratio, closure="consistent")
    bar = Bar(4096, medium.branch_length / cells_to_length, order)
    speed = fastest_speed(medium) * medium.time_scale / bar.spacing
    for block in BLOCKS[:2]:
        bound = spectral_bound(medium, bar, [block])
        kernel = kernels(
            block_coefficients(medium, block, scales(medium)),
            1 / cells_to_length,
            order,
            step,
            bound,
        )
        assert (kernel.shape[-1] - 1) / 2 <= reach_within(step, speed)


def test_a_short_bar_takes_the_recurrence():
    """Where the reach goes round the bar "auto" takes Chebyshev, and asking is refused."""
    medium = Medium()
    assert plan(medium, Bar(64, CELL), SOURCES[:1], 1e-6, 9).schedule.solver == "chebyshev"
    with pytest.raises(ValueError, match=r"solver = 'propagator': needs at least \d+ cells, the"):
        plan(medium, Bar(64, CELL), SOURCES[:1], 1e-6, 9, solver="propagator")
    kernel = kernels(block_coefficients(medium, BLOCKS[0], scales(medium)), 0.125, 8, 4.0, 330.0)
    with pytest.raises(ValueError, match="too far for a bar of 150"):
        convolution([kernel], 150)


def test_long_intervals_are_divided():
    """A frame interval whose kernel would be too wide is divided into equal steps."""
    medium, bar = Medium(), Bar(4096, CELL)
    made = plan(medium, bar, SOURCES[:1], 200 * medium.time_scale, 2).schedule
    assert made.solver == "propagator"
    assert made.reach <= 160
    assert made.step * made.steps_per_frame == pytest.approx(200)
    # One step fewer would reach too far.
    longer = made.step * made.steps_per_frame / (made.steps_per_frame - 1)
    assert reach_within(longer, fastest_speed(medium) * medium.time_scale / CELL) > 160
