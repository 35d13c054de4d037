"""Signals at receivers as pure jax functions, against runs that step the whole field."""

import dataclasses
import functools
import itertools
import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import wavesim as ws
from wavesim.simulation.simulation import simulation

HOST = ws.Medium(closure="consistent", anisotropy=0.5, G_n_a=9.0)
DURATION, FRAMES = 1.2e-5, 25
SEEN = (0.0035, 0.0121, 0.0202)  # the first on a node
THICK = (0.007, 0.006, 0.005, 0.006)
THIN = tuple(0.985 * thickness for thickness in THICK)  # of as many cells


def layers(p=(0.3, 6.0), thicknesses=THICK, host=HOST):
    """A slab of anisotropy p[0], and a layer graded to G_n_a = p[1], within a host."""
    a, last = p
    edges = np.concatenate([[0.0], np.cumsum(thicknesses)])
    media = (
        (host, None),
        (dataclasses.replace(host, G_n_a=5.0, anisotropy=a), None),
        (host, dataclasses.replace(host, G_n_a=last)),
        (host, None),
    )
    ends = itertools.pairwise(edges)
    return ws.Layers(tuple(ws.Layer(*x, *own) for x, own in zip(ends, media, strict=True)))


CASES = {
    # all twelve fields, free ends, Γ too small to count
    "free": (HOST, ("free", "free"), ("phi1", "phi2", "phi3", "B23", "B22"), "body"),
    "one": (HOST, ("free", "free"), ("phi1",), "body"),
    # equations that are not symmetric; an end that is turned
    "printed": (
        dataclasses.replace(HOST, closure="printed"), ("fixed", "free"), ("phi1",), "rotation",
    ),
}  # fmt: skip


def planned(name, at=(0.5, 9.0), thicknesses=THICK):
    host, ends, fields, drive = CASES[name]
    bar = ws.layered_bar(layers(thicknesses=thicknesses), 2.5e-4, 4, *ends)
    place = 0.0 if drive == "rotation" else 3.1e-3
    sources = [ws.Ricker(field, place, 5e5, drive=drive) for field in fields]
    return simulation(layers(at, thicknesses, host), bar, sources, DURATION, FRAMES)


def stepped(plan):
    """{field: (frames, receivers)} of a run of the whole field."""
    field = ws.integrate(plan)
    return {name: np.stack([field.at(x, name) for x in SEEN], axis=1) for name in field.names}


@pytest.mark.parametrize("name", ["free", "printed"])
def test_a_batch_at_receivers_is_a_loop_of_runs(name):
    """Each field at each receiver, to 1e-9 of its largest value, as Γ, of a share of 1e-12, is left
    out; measured 2e-11. Members: the plan itself, and softer ones."""
    plan, host = planned(name), CASES[name][0]
    members = jnp.asarray([[0.5, 9.0], [0.1, 9.0], [0.4, 4.0]])
    batch = jax.jit(
        jax.vmap(lambda p: ws.traced_fields(layers((p[0], p[1]), host=host), plan, SEEN))
    )(members)
    for number, member in enumerate(members.tolist()):
        expected = stepped(planned(name, tuple(member)))
        assert set(batch) == set(expected)
        for field, values in expected.items():
            size = np.abs(values).max()
            assert size > 0
            assert np.abs(batch[field][number] - values).max() <= 1e-9 * size, field


def test_an_initial_field_at_receivers():
    """Beside a source, on a ring, with a Γ that counts; to 1e-11 of the largest value.

    The field is as wide as the ring allows, laid round it: at t = 0 it is its Fourier series."""
    bar, place, width = ws.Bar(96, 2.5e-4, 4), 9e-3, 4e-3
    sources = (ws.Ricker("phi1", 3e-3, 5e5, amplitude=1e4), ws.InitialField("phi1", place, width))
    medium = dataclasses.replace(HOST, G_n_g=0.5)
    plan = simulation(medium, bar, sources, DURATION, FRAMES)
    found = ws.traced_fields(medium, plan, SEEN)
    run = stepped(plan)
    for name, values in run.items():
        assert np.abs(found[name] - values).max() <= 1e-11 * np.abs(values).max(), name
    k = 2 * np.pi * np.arange(1, 20) / bar.length
    series = 1 + 2 * np.exp(-((k * width) ** 2) / 2) @ np.cos(k * (SEEN[0] - place))
    expected = np.sqrt(2 * np.pi) * width / bar.length * series
    assert run["phi1"][0, 0] == pytest.approx(expected, rel=1e-11)


def loss(p, thicknesses, plan, host=HOST):
    seen = ws.traced_fields(layers((p[0], p[1]), host=host), plan, SEEN, thicknesses)["phi1"]
    return jnp.sum(seen[:, 2] ** 2) * 1e14


def test_gradients_of_a_batch_by_media_and_thicknesses():
    """By the media of one and the thicknesses of the other, along a way on which all of them move,
    against differences of order 4 of whole runs of its own layers; sources and receivers stay where
    they are. To 1e-7 of both."""
    plan = planned("one", thicknesses=THIN)
    members = jnp.asarray([[0.3, 6.0], [0.45, 8.0]])
    sizes = jnp.asarray([THICK, (0.00705, 0.006, 0.00505, 0.0061)])
    both = jax.value_and_grad(functools.partial(loss, plan=plan), (0, 1))
    values, (by_media, by_size) = jax.jit(jax.vmap(both))(members, sizes)

    def plain(p, thicknesses):
        bar = ws.layered_bar(layers(p, thicknesses), 2.5e-4, 4)
        assert [n for n, _ in bar.stretches] == [n for n, _ in plan.bar.stretches]
        field = ws.simulate(layers(p, thicknesses), bar, plan.sources, DURATION, FRAMES)
        return float((field.at(SEEN[2], "phi1") ** 2).sum()) * 1e14

    for member, slopes in enumerate((by_media[0], by_size[1])):
        known = [members[member].tolist(), sizes[member].tolist()]
        at, value = known[member], float(values[member])
        assert value == pytest.approx(plain(*known), rel=1e-9)
        way = np.array([1.0, -0.7, 0.8, -0.9][: len(at)]) * at
        ahead = []
        for n in (-2, -1, 1, 2):
            moved = (np.array(at) + 2e-3 * n * way).tolist()
            ahead.append(plain(*(moved if own is at else own for own in known)))
        slope = float(np.dot([1, -8, 8, -1], ahead)) / (12 * 2e-3)
        found = float(np.dot(np.asarray(slopes), way))
        assert abs(found - slope) <= 1e-7 * max(abs(slope), value)


def test_thicknesses_of_a_bar_that_absorbs():
    """Its receivers by the series, with losses and a source narrower than a cell; to 1e-9 of a run
    of those layers."""
    host = dataclasses.replace(HOST, damping=ws.Damping(1e4, rates=(3e6,), strengths=(0.02,)))

    def whole(thicknesses):
        own = layers((0.3, 6.0), thicknesses, host)
        bar = ws.layered_bar(own, 2.5e-4, 4, "free", "absorbing", 3e-3)
        source = ws.Ricker("phi1", 3e-3, 5e5, width=1e-4)
        return simulation(own, bar, (source,), DURATION, FRAMES)

    plan, other = whole((0.007, 0.00592, 0.00495, 0.006)), THICK
    sizes = jnp.asarray(other)
    found = jax.jit(lambda t: ws.traced_fields(plan.layers, plan, SEEN, t))(sizes)
    for name, values in stepped(whole(other)).items():
        assert np.abs(found[name] - values).max() <= 1e-9 * np.abs(values).max(), name


def test_what_is_beyond_the_plan_is_not_a_number():
    """A member that is faster than the plan knows, or thinner; the others are there."""
    plan = planned("one", thicknesses=THIN)
    at = jax.jit(jax.vmap(functools.partial(loss, plan=plan)))
    members = jnp.asarray([[0.5, 9.0], [0.5, 12.0], [0.5, 9.0]])
    sizes = jnp.asarray([THICK, THICK, (0.007, 0.006, 0.004, 0.006)])
    assert np.isfinite(at(members, sizes)).tolist() == [True, False, False]
    with pytest.raises(ValueError, match=r"thicknesses: shape \(3,\) given for 4 layers"):
        ws.traced_fields(plan.layers, plan, SEEN, jnp.ones(3))


def test_neither_are_media_that_are_little_beyond():
    """Free ends leave room above the highest frequency of an endless bar, which is not for faster
    media."""
    host = dataclasses.replace(HOST, damping=ws.constant_quality(20.0, (1e5, 1e6)))
    bar = ws.Bar(96, 2.5e-4, 4, "free", "free")
    plan = simulation(host, bar, [ws.Ricker("phi1", 3.1e-3, 5e5)], DURATION, FRAMES)

    def seen(faster):
        medium = dataclasses.replace(host, G_n_a=9.0 * faster, G_n_r=5.0 * faster)
        return ws.traced_fields(medium, plan, SEEN)["phi1"].sum()

    found = jax.jit(jax.vmap(seen))(jnp.asarray([0.99, 1.08]))
    assert np.isfinite(found).tolist() == [True, False]


def test_the_example_shapes_a_pulse():
    """The program of docs/through-the-pulse.md, searched for less long: of each start less of the
    energy goes astray, of all together a third less."""
    page = Path(__file__).parents[1] / "docs" / "through-the-pulse.md"
    program = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)[0]
    shorter = program.replace('"maxiter": 15', '"maxiter": 5').replace("(4, 8)", "(2, 8)")
    assert shorter.count("(2, 8)") == 1
    names = {}
    with jax.numpy_dtype_promotion("standard"):
        exec(shorter, names)
    before, after = np.asarray(names["before"]), np.asarray(names["after"])
    assert (after < before).all()
    assert after.sum() < 0.7 * before.sum()
