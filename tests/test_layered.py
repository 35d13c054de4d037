"""The banded propagator of real bars against the series of exp(hA) and against expm."""

import dataclasses
import itertools
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from wavesim.grid.bar import Bar, layered_bar
from wavesim.material.damping import Damping
from wavesim.material.layers import Layer, Layers, as_layers
from wavesim.material.medium import Medium
from wavesim.simulation.plan import Plan, plan
from wavesim.sources import Ricker
from wavesim.timedomain.generator import generator
from wavesim.timedomain.integration import simulate, stream
from wavesim.timedomain.layered import piecewise
from wavesim.timedomain.pieces import cut

CELL = 1.25e-4
FIRST = Medium(anisotropy=0.3, closure="consistent")
SECOND = Medium(anisotropy=0.0, closure="consistent", G_n_a=9.0, density=2000.0)
THIRD = dataclasses.replace(FIRST, anisotropy=0.8)


def as_printed(layers):
    """The same layers in the closure "printed"."""
    made = [
        dataclasses.replace(
            layer,
            medium=dataclasses.replace(layer.medium, closure="printed"),
            last=layer.last and dataclasses.replace(layer.last, closure="printed"),
        )
        for layer in layers.layers
    ]
    return Layers(tuple(made))


def stack(*thicknesses, media=(FIRST, SECOND, THIRD)):
    """Layers of these thicknesses in cells, of media in turn; a pair of them is a graded layer."""
    ends = np.cumsum([0.0, *thicknesses]) * CELL
    made = []
    for n, (start, end) in enumerate(itertools.pairwise(ends)):
        medium = media[n % len(media)]
        first, last = medium if isinstance(medium, tuple) else (medium, None)
        made.append(Layer(float(start), float(end), first, last))
    return Layers(tuple(made))


# Cells of a size of their own in each layer, as 100.4 of them are none.
APART = stack(150.4, 199.7, 161)
# Interfaces within each other's reach, and one layer that is all closures.
NEAR = stack(150, 24, 16, 57, 120)
GRADED = stack(120, 90, 110, media=(FIRST, (FIRST, THIRD), THIRD))
STIFF = stack(150, 160, media=(dataclasses.replace(FIRST, G_n_g=2.0), SECOND))
# (layers, order, left, right, step in units of time)
BARS = {
    "fixed": (APART, 12, "fixed", "free", 1.5),
    "near": (NEAR, 8, "free", "free", 0.5),
    "near, periodic": (NEAR, 2, "periodic", "periodic", 0.5),
    "periodic, printed": (as_printed(APART), 4, "periodic", "periodic", 0.7),
    "graded, printed": (as_printed(GRADED), 6, "free", "fixed", 0.3),
    "gradient term": (STIFF, 8, "fixed", "fixed", 0.3),
    "short": (as_layers(SECOND, 40 * CELL), 8, "free", "free", 1.0),
}


def settled(layers, order, left, right, step):
    """Plan whose step is so many units of time, and the generator of some blocks."""
    bar = layered_bar(layers, CELL, order, left, right)
    # A source of low frequency does not limit the step.
    fields = ("phi1", "phi2", "B23") if layers is STIFF else ("phi1", "phi2")
    sources = [Ricker(name, layers.length / 3, 1e4) for name in fields]
    duration = 4 * step * layers.first.time_scale
    made = plan(layers, bar, sources, duration, 5, solver="propagator")
    assert made.schedule.step == pytest.approx(step)
    return made, generator(layers, bar, made.blocks, layers.first, made.with_gradient)


@jax.jit
def exponential(group, step, y):
    """exp(hA) y by Taylor's series, sixteen times over a sixteenth of the step."""

    def part(_, y):
        def term(k, carry):
            total, last = carry
            last = tuple(step / 16 / k * rate for rate in group.rate(last))
            return tuple(a + b for a, b in zip(total, last, strict=True)), last

        return jax.lax.fori_loop(1, 32, term, (y, y))[0]

    return jax.lax.fori_loop(0, 16, part, y)


@pytest.mark.parametrize("name", BARS)
def test_one_product_is_the_exponential(name, rng):
    """Law: C is the block of exp(hA) that takes q to q.

    Random fields in all blocks, by Taylor's series of the exponential in sixteen parts, which
    shares with the propagator only the generator; to 4e-13 of the largest,
    measured 4e-14 for order 12 and the longest step, 1e-15 to 6e-15 otherwise.
    """
    made, A = settled(*BARS[name])
    for group in A.groups:
        parts = piecewise(
            cut(made.layers, made.bar, group, made.schedule, float(made.medium.length_scale))
        )
        blocks, points = group.free.shape
        q = rng.normal(size=(1, blocks, group.size, points))
        q[:, :, group.rotations :, made.bar.cells :] = 0.0
        found = np.asarray(parts(jnp.asarray(q)))[0]

        still = [jnp.zeros((blocks, points))] * group.size
        y = (*jnp.moveaxis(jnp.asarray(q[0]), 1, 0), *still)
        expected = np.stack(exponential(group, made.schedule.step, y)[: group.size], axis=1)
        assert np.abs(found - expected).max() <= 4e-13 * np.abs(expected).max()


# Two sectors, points and a Gaussian, one next to an interface and one next to an end.
SOURCES = (
    Ricker("phi1", 1.1 * CELL, 700e3),
    Ricker("B22", 18.9e-3, 900e3, amplitude=3e-4, width=3e-4),
)
# The last of three layers graded.
LAYERS = stack(150.4, 199.7, 90, media=(FIRST, SECOND, (SECOND, THIRD)))


@cache
def run(solver):
    bar = layered_bar(LAYERS, CELL, 8, "free", "fixed")
    return simulate(LAYERS, bar, SOURCES, 1e-4, 801, solver)


def test_a_long_run_agrees_with_the_series():
    """Law: both steppers solve the same equations exactly, whatever acts on the bar.

    The series is held against other things elsewhere. Every field at every frame, to 1e-10 of its
    largest; measured 1e-12 after 800 steps (rounding of the recurrence, the frequencies of whose
    fastest modes are known to 1e-15 of themselves); the work to 1e-12, measured 1e-14.
    """
    banded, series = run("propagator"), run("chebyshev")
    assert (banded.stepper, series.stepper) == ("propagator", "chebyshev")
    for made in series.names:
        size = np.abs(series[made]).max()
        assert size > 0
        assert np.abs(banded[made] - series[made]).max() <= 1e-10 * size, made
    work = series.energy.work
    assert np.abs(banded.energy.work - work).max() <= 1e-12 * np.abs(work).max()


def test_energy_is_the_work_of_the_sources():
    """Law: no losses, energy is the sources' work; to 1e-9 of its maximum, and to 1e-11
    of it constant after the last pulse; measured 2e-14 either way."""
    field = run("propagator")
    energy, largest = field.energy, field.energy.total.max()
    assert energy.dissipated is None
    assert np.abs(energy.total - energy.work).max() <= 1e-9 * largest
    assert np.ptp(energy.total[field.t > 8e-6]) <= 1e-11 * largest


def test_carrying_on_gives_the_same_bits(monkeypatch):
    """Taken up while the pulses act, in the step after, and later."""
    monkeypatch.setattr(Plan, "chunk", property(lambda self: 7))
    bar = layered_bar(APART, CELL)
    settled = plan(APART, bar, SOURCES[:1], 1.4e-5, 142, "propagator")
    assert settled.schedule.steps_per_frame == 1
    chunks = list(stream(settled))
    for taken in (4, 8, 16):
        start = chunks[taken].first + chunks[taken].count - 1
        carried = list(stream(settled, start=(start, chunks[taken].motion)))
        for one, other in zip(chunks[taken + 1 :], carried, strict=True):
            for name in settled.fields:
                np.testing.assert_array_equal(one.values[name], other.values[name])
            np.testing.assert_array_equal(one.energy.work, other.energy.work)


def test_auto_takes_it_where_it_pays():
    """On a long bar of uniform layers, one of them graded or none; on a bar graded throughout,
    where every row would be a matrix's own, it was timed to be no faster than the series."""
    unit = FIRST.time_scale

    def chosen(layers):
        bar = layered_bar(layers, CELL)
        pulse = [Ricker("phi1", 0.1, 785e3)]
        return plan(layers, bar, pulse, 200 * unit, 401).schedule.solver

    assert chosen(stack(*[512] * 8)) == "propagator"
    assert chosen(stack(2000, 100, 1996, media=(FIRST, (FIRST, THIRD), THIRD))) == "propagator"
    assert chosen(stack(4096, media=((FIRST, THIRD),))) == "chebyshev"


def test_losses_are_refused():
    pulse = [Ricker("phi1", 0.02, 785e3)]
    lossy = dataclasses.replace(FIRST, damping=Damping(mass=1e4))
    absorbing = Bar(512, CELL, 8, "absorbing", "free", 8e-3)
    for medium, bar in ((lossy, Bar(512, CELL, 8, "free", "free")), (FIRST, absorbing)):
        with pytest.raises(ValueError, match="solver = 'propagator': is for bars without losses"):
            plan(medium, bar, pulse, 1e-5, 21, solver="propagator")
    short = stack(30, 30)
    bar = layered_bar(short, CELL, 8, "periodic", "periodic")
    with pytest.raises(ValueError, match="'propagator': the bar of 60 cells is too short"):
        plan(short, bar, [Ricker("phi1", 1e-3, 785e3)], 1e-5, 21, solver="propagator")
