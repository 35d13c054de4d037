"""Strides of many steps in one: against exact solutions, other steppers and energy."""

import dataclasses
from functools import cache

import jax
import numpy as np
import pytest
import scipy.linalg
from exact import modal_field
from hypothesis import given, settings
from hypothesis import strategies as st
from jax.flatten_util import ravel_pytree
from test_propagator import CELL, SOURCES

from wavesim.grid.bar import Bar
from wavesim.material.medium import Medium
from wavesim.material.sectors import BLOCKS
from wavesim.simulation.plan import Plan, plan
from wavesim.sources import GaussianDerivative
from wavesim.timedomain import timestep
from wavesim.timedomain.circulant import circulant
from wavesim.timedomain.integration import simulate, stream
from wavesim.timedomain.operator import semi_discrete
from wavesim.timedomain.propagator import block_kernels
from wavesim.timedomain.timestep import LARGEST_RING, schedule

# (closure, cells, order, s, frames), and the legs as (frames, steps, stride): the last frame alone,
# a source in the first of three, in two of nine, and a ring of an odd number of cells.
CASES = {
    "one frame": (("printed", 512, 8, 90e-6, 2), [(1, 3, 31)]),
    "a stride after the pulses": (("consistent", 4096, 8, 60e-6, 4), [(1, 2, 5), (2, 0, 7)]),
    "pulses in two frames": (("consistent", 384, 2, 30e-6, 10), None),
    "odd": (("printed", 257, 12, 30e-6, 6), None),
}


@pytest.fixture(autouse=True)
def strides_wherever_they_can_be(monkeypatch):
    """Also where they save less than a second program takes to compile."""
    monkeypatch.setattr(timestep, "WORTH_A_PROGRAM", 0)


def settled(name):
    closure, cells, order, duration, frames = CASES[name][0]
    medium, bar = Medium(anisotropy=0.4, closure=closure), Bar(cells, CELL, order)
    return plan(medium, bar, SOURCES, duration, frames)


@cache
def run(name):
    made = settled(name)
    return simulate(made.medium, made.bar, SOURCES, made.duration, made.schedule.frames)


def parts(leg):
    return leg.frames, leg.steps, leg.stride


@pytest.mark.parametrize("name", CASES)
def test_it_is_exact(name):
    """Law: the semi-discrete equations are solved exactly, however long a stride is.

    Every field at every frame against the modal solution, to 1e-10 of its largest value; measured
    6e-12 (444 units of time, closure printed).
    """
    field, schedule_ = run(name), settled(name).schedule
    assert schedule_.legs[-1].stride
    if CASES[name][1]:
        assert [parts(leg) for leg in schedule_.legs] == CASES[name][1]
    expected = modal_field(field.medium, field.bar, field.sources, field.t[1:])
    for made in field.names:
        size = np.abs(expected[made]).max()
        assert size > 0
        assert np.abs(field[made][1:] - expected[made]).max() <= 1e-10 * size, made


@pytest.mark.parametrize("name", ["a stride after the pulses", "pulses in two frames"])
def test_energy_is_the_work_of_the_sources(name):
    """Law: closure consistent, energy is the sources' work; to 1e-10, measured 9e-14."""
    energy = run(name).energy
    assert np.abs(energy.total - energy.work).max() <= 1e-10 * energy.total.max()
    assert energy.work[-1] > 0.5 * energy.total.max()


@pytest.mark.parametrize("size", [1, 2, 3])
@pytest.mark.parametrize("name", ["pulses in two frames", "odd"])
def test_carrying_on_gives_the_same_bits(name, size, monkeypatch):
    """From every chunk of every leg; chunks end where legs do."""
    monkeypatch.setattr(Plan, "chunk", property(lambda self: size))
    chunks = list(stream(settled(name)))
    assert sum(chunk.count for chunk in chunks) == settled(name).schedule.frames
    for n in range(1, len(chunks) - 1):
        after = (chunks[n].first + chunks[n].count - 1, chunks[n].motion)
        carried = list(stream(settled(name), start=after))
        assert len(carried) == len(chunks) - n - 1
        for one, other in zip(chunks[n + 1 :], carried, strict=True):
            assert one.first == other.first
            np.testing.assert_array_equal(one.energy.work, other.energy.work)
            for field in one.values:
                np.testing.assert_array_equal(one.values[field], other.values[field])


def test_carrying_on_from_anywhere(monkeypatch):
    """From a frame that is no end of a chunk of the leg it lies in: the chunks of that leg are cut
    where the next one begins. To 1e-12 of a run by single frames, whose steps round otherwise."""
    monkeypatch.setattr(Plan, "chunk", property(lambda self: 1))
    closure, cells, order, _, _ = CASES["pulses in two frames"][0]
    medium, bar = Medium(anisotropy=0.4, closure=closure), Bar(cells, CELL, order)
    late = dataclasses.replace(SOURCES[2], delay=2e-5)
    made = plan(medium, bar, (*SOURCES[:2], late), 60e-6, 20)
    driven = made.schedule.legs[0].frames
    assert driven >= 6
    single = list(stream(made))
    monkeypatch.setattr(Plan, "chunk", property(lambda self: 4))
    for frame in (driven - 5, driven - 3):
        carried = list(stream(made, start=(frame, single[frame].motion)))
        found = np.concatenate([chunk.values["phi1"] for chunk in carried])
        known = np.concatenate([chunk.values["phi1"] for chunk in single[frame + 1 :]])
        assert np.abs(found - known).max() <= 1e-12 * np.abs(known).max()


@pytest.mark.parametrize("step", [None, 0.7e-6], ids=["strides", "steps"])
def test_a_mean_rotation_does_not_drift(step):
    """A pulse that leaves a mean rotation behind, which nothing holds back: 3,000 units of time, to
    1e-9 of the largest rotation. Measured 1e-10 by strides and 3e-11 by 858 steps; it was 3e-9
    and 2e-9 where a kernel's sum was left to rounding."""
    medium, bar = Medium(anisotropy=0.4, closure="consistent"), Bar(512, CELL)
    sources, duration = [GaussianDerivative("phi1", 16e-3, 700e3)], 3000 * medium.time_scale
    field = simulate(medium, bar, sources, duration, 2, step=step)
    expected = modal_field(medium, bar, sources, [duration])["phi1"][0]
    assert abs(expected.mean()) > 0.1 * np.abs(expected).max()
    assert np.abs(field["phi1"][-1] - expected).max() <= 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("closure", ["printed", "consistent"])
@pytest.mark.parametrize("cells", [160, 161])
def test_a_stride_is_the_matrix_exponential(closure, cells, rng):
    """Random (q, v) of one block after five steps is exp(5h [[0, 1], [L, 0]]) (q, v), by Padé sums,
    to 1e-12 of the largest; measured 9e-14. Stepping one at a time gives the same to 1e-12."""
    medium, bar, h = Medium(anisotropy=0.8, closure=closure), Bar(cells, CELL, 4), 1.0
    for block in (BLOCKS[0], BLOCKS[3]):
        operator = semi_discrete(medium, bar, [block])
        flat, unravel = ravel_pytree(operator.zero())
        n = flat.size
        L = jax.vmap(lambda e: ravel_pytree(operator(unravel(e)))[0])(np.eye(n)).T  # noqa: B023
        generator = np.block([[np.zeros((n, n)), np.eye(n)], [np.asarray(L), np.zeros((n, n))]])
        q, v = rng.normal(size=(2, n))
        expected = scipy.linalg.expm(5 * h * generator) @ np.concatenate([q, v])
        kernels = block_kernels(medium, bar, [block], h)
        once, five = (circulant(kernels, cells, count) for count in (1, 5))
        strided, stepped = five(unravel(q), unravel(v)), (unravel(q), unravel(v))
        for _ in range(5):
            stepped = once(*stepped)
        for made in (strided, stepped):
            for part, known in zip(made, (expected[:n], expected[n:]), strict=True):
                error = np.abs(np.asarray(ravel_pytree(part)[0]) - known).max()
                assert error <= 1e-12 * np.abs(known).max()


@settings(max_examples=80, deadline=None, derandomize=True)
@given(
    duration=st.floats(1, 3e3),
    frames=st.integers(2, 60),
    quiet=st.floats(0, 1),
    cells=st.integers(200, 5000),
)
def test_legs(duration, frames, quiet, cells):
    """All of the time is stepped, sources by h and nothing else, in no more steps than without."""
    known = (334.0, duration, frames, "auto", None, 7.0, cells)
    made, plain = schedule(*known, quiet * duration), schedule(*known)
    assert sum(leg.frames for leg in made.legs) == frames - 1
    assert all(leg.steps + leg.stride == made.steps_per_frame for leg in made.legs)
    assert made.step == plain.step
    assert made.steps <= plain.steps
    first = made.legs[0]
    stepped = first.steps if first.stride else first.frames * first.steps
    everything = len(made.legs) == 1 and not first.stride
    assert everything or made.step * stepped >= quiet * duration * (1 - 1e-12)
    # No stride is but one step, and none where the sources act to the end.
    assert all(leg.stride != 1 for leg in made.legs)
    assert schedule(*known, duration).legs == plain.legs


def test_a_ring_too_small():
    (kernels,) = block_kernels(Medium(), Bar(4096, CELL), BLOCKS[:1], 5.0)
    with pytest.raises(ValueError, match="too far for a bar of 100"):
        circulant([kernels], 100, 2)


def test_a_second_leg_must_be_worth_its_program(monkeypatch):
    """Steps saved times cells, against what a program takes to compile; a single leg always is."""
    monkeypatch.undo()
    known = (334.0, 900.0, 31, "auto", None, 7.0)
    few, many = (schedule(*known, cells, 25.0) for cells in (4096, 100_000))
    assert (few.quiet, few.steps) == (None, 90)
    assert [parts(leg) for leg in many.legs] == [(1, 3, 0), (29, 0, 3)]
    assert schedule(*known[:2], 2, *known[3:], 4096, 25.0).steps == 3


def test_where_there_are_none():
    """A step that was asked for, single precision and very long bars are stepped as before."""
    name = "one frame"
    made = settled(name)
    known = made.medium, made.bar, SOURCES, made.duration, 2
    assert made.schedule.quiet
    assert plan(*known, step=made.step).schedule.quiet is None
    assert plan(*known, precision="single").schedule.quiet is None
    large = dataclasses.replace(made.bar, cells=LARGEST_RING + 1)
    assert plan(made.medium, large, SOURCES, made.duration, 2).schedule.quiet is None
