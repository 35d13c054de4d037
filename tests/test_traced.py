"""Runs as pure jax functions of their media, against plain runs and central differences of them."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from wavesim.grid.bar import Bar, layered_bar
from wavesim.material.damping import Damping
from wavesim.material.layers import Layer, Layers, as_layers
from wavesim.material.medium import Medium
from wavesim.material.sectors import BLOCKS
from wavesim.simulation.plan import plan
from wavesim.sources import Ricker
from wavesim.timedomain.generator import generator
from wavesim.timedomain.integration import simulate
from wavesim.timedomain.operator import semi_discrete
from wavesim.timedomain.traced import traced_fields

# The fastest medium of the bar, so that one plan holds for all; its gradient term counts.
HOST = Medium(closure="consistent", anisotropy=0.6, G_n_a=9.0, G_n_g=1.0)
BEYOND = 0.0201  # m, past slab and graded layer
DURATION, FRAMES = 8e-6, 17
SOURCES = (Ricker("phi1", 3e-3, 6e5),)
AT = {"anisotropy": 0.3, "stiffness_ratio": 0.5, "G_n_g": 0.3, "density": 1700.0, "last": 6.0}


def layers(p, slab=HOST):
    """A slab, and a layer graded to G_n_a = p["last"], within HOST."""
    own = {name: value for name, value in p.items() if name != "last"}
    return Layers(
        (
            Layer(0.0, 0.007, HOST),
            Layer(0.007, 0.013, dataclasses.replace(slab, G_n_a=5.0, **own)),
            Layer(0.013, 0.019, HOST, dataclasses.replace(HOST, G_n_a=p["last"])),
            Layer(0.019, 0.024, HOST),
        )
    )


BAR = layered_bar(layers(AT), 2.5e-4, 4)


@functools.cache
def settled():
    made = plan(layers(AT), BAR, SOURCES, DURATION, FRAMES)
    assert made.with_gradient
    return made


def transmitted(p):
    """Σ φ₁² at the receiver, about 1 at AT."""
    return jnp.sum(traced_fields(layers(p), settled(), [BEYOND])["phi1"] ** 2) * 1e13


@functools.cache
def plain_run(p):
    return simulate(layers(dict(p)), BAR, SOURCES, DURATION, FRAMES)


def plain(p):
    """The same of a plain run."""
    return float((plain_run(tuple(p.items())).at(BEYOND, "phi1") ** 2).sum()) * 1e13


@functools.cache
def slopes():
    return jax.jit(jax.value_and_grad(transmitted))


@pytest.mark.parametrize("anisotropy", [0.3, 0.0])
def test_gradients(anisotropy):
    """By a slab's parameters, and by the last medium of a graded layer, at a = 0 too.

    Against differences of order 4 of plain runs at steps of 2e-3 of the parameter, which err by
    (2e-3)⁴ of it times what five derivatives bring, and by 1e-14/2e-3. Held to 1e-8 of the larger
    of value and slope times parameter; measured 5e-10 by the density, 1e-11 by the others.
    """
    at = AT | {"anisotropy": anisotropy}
    value, slope = slopes()(at)
    assert float(value) == pytest.approx(plain(at), rel=1e-12)
    for name in at:
        size = at[name] or 1.0
        ahead = [plain(at | {name: at[name] + n * 2e-3 * size}) for n in (-2, -1, 1, 2)]
        expected = float(np.dot([1, -8, 8, -1], ahead)) / (12 * 2e-3)
        assert abs(expected) > 1e-4 * float(value), name
        largest = max(float(value), abs(expected))
        assert abs(float(slope[name]) * size - expected) <= 1e-8 * largest, name


@pytest.mark.parametrize("G_n_g", [1.25e-11, 0.0])
@pytest.mark.parametrize("anisotropy", [0.0, 0.5])
def test_a_vanishing_gradient_term(G_n_g, anisotropy):
    """With Table 1's G_n_g and with none every slope is finite, and that by it is the limit.

    Against a one-sided difference of order 4 of plain runs, of steps of 1e-4, where host and slab
    meet in series as everywhere: good to (1e-4)⁴ and 1e-14/1e-4. Held to 1e-6; measured 4e-10.
    """
    at = AT | {"anisotropy": anisotropy, "G_n_g": G_n_g}
    value, slope = slopes()(at)
    assert all(np.isfinite(float(x)) for x in (value, *slope.values()))
    step = 1e-4
    values = [plain(at | {"G_n_g": G_n_g + n * step}) for n in range(5)]
    expected = float(np.dot([-25, 48, -36, 16, -3], values)) / (12 * step)
    assert abs(expected) > 1e-2 * float(value)
    assert float(slope["G_n_g"]) == pytest.approx(expected, rel=1e-6)


def test_a_batch_is_a_loop():
    """jax.vmap over media gives what plain runs of one after the other give; all fields at all
    times to 1e-12 of the largest value, measured 2e-15.

    The last medium is faster than the plan knows: there the series grows.
    """
    batch = {
        "anisotropy": [0.0, 0.3, 0.6],
        "stiffness_ratio": [0.5, 0.1, 0.5],
        "G_n_g": [0.0, 1.25e-11, 0.3],
        "density": [1700.0, 1600.0, 200.0],
        "last": [5.0, 9.0, 3.0],
    }
    made = jax.jit(jax.vmap(lambda p: traced_fields(layers(p), settled())))(
        {name: jnp.asarray(values) for name, values in batch.items()}
    )
    for n in range(2):
        field = plain_run(tuple((name, values[n]) for name, values in batch.items()))
        assert set(made) == set(field.names)
        for name in field.names:
            size = np.abs(field[name]).max()
            assert size > 0
            assert np.abs(made[name][n] - field[name]).max() <= 1e-12 * size, name
    assert not np.abs(made["phi1"][2]).max() < 1e6 * np.abs(made["phi1"][1]).max()


def test_media_beyond_the_plan_are_refused():
    """Where values are known: outside a trace."""
    fast = layers(AT | {"density": jnp.asarray(200.0)})
    with pytest.raises(ValueError, match=r"highest frequency is 2.* the fastest media"):
        traced_fields(fast, settled())
    with pytest.raises(ValueError, match=r"damping .layer 2.: must be that of the plan"):
        traced_fields(layers(AT, dataclasses.replace(HOST, damping=Damping(mass=1.0))), settled())
    with pytest.raises(ValueError, match="layers: 1 given for a plan of 4"):
        traced_fields(HOST, settled())
    moved = [dataclasses.replace(layer, grading="linear") for layer in layers(AT).layers]
    with pytest.raises(ValueError, match=r"grading = linear .layer 1.: the plan has smooth"):
        traced_fields(moved, settled())


def test_a_uniform_periodic_bar():
    """Its plan is for another stepper, which shares neither generator nor series with this one:
    to 1e-11 of the largest value, measured 1e-14."""
    bar = Bar(160, 2.5e-4, 4)
    field = simulate(HOST, bar, SOURCES, 4e-6, 5)
    assert field.stepper == "propagator"
    made = traced_fields(HOST, plan(HOST, bar, SOURCES, 4e-6, 5))
    for name in field.names:
        size = np.abs(field[name]).max()
        assert np.abs(made[name] - field[name]).max() <= 1e-11 * size, name


# The generator of a real bar, on random states


def random(state, rng):
    return jax.tree.map(lambda part: jnp.asarray(rng.normal(size=part.shape)), state)


def test_a_ring_has_no_seam(rng):
    """On a uniform periodic bar B̈ and φ̈ are L q of the plain operator, first node included; to
    1e-13 of the largest, measured 4e-16."""
    bar = Bar(48, 2.5e-4)
    A = generator(as_layers(HOST, bar.length), bar, BLOCKS, HOST, True)
    L = semi_discrete(HOST, bar, BLOCKS)
    q = random(L.zero(), rng)
    y = tuple((*part, *rest) for part, rest in zip(q, L.zero(), strict=True))
    for made, expected in zip(A(y), L(q), strict=True):
        for one, other in zip(made[len(expected) :], expected, strict=True):
            size = np.abs(other).max()
            assert np.abs(one - other).max() <= 1e-13 * size


def test_losses_of_traced_media():
    """A with all losses and an absorbing end is the same, traced or not; each of its arrays to
    1e-14 of its largest value, measured 5e-16."""
    lossy = dataclasses.replace(
        HOST, damping=Damping(1e5, 1e-9, rates=(3e6, 9e6), strengths=(0.02, 0.01))
    )
    bar = layered_bar(layers(AT), 2.5e-4, 4, "fixed", "absorbing", 3e-3)

    def arrays(p):
        A = generator(layers(p, lossy), bar, BLOCKS[:1], HOST, True, plain=layers(AT, lossy))
        return jax.tree.leaves(A)

    traced, plain = jax.jit(arrays)(AT), arrays(AT)
    assert any(np.ptp(array) > 0 for array in plain)
    for one, other in zip(traced, plain, strict=True):
        largest = np.abs(other).max(initial=0.0)
        assert np.abs(one - other).max(initial=0.0) <= 1e-14 * largest
