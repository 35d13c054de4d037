"""T(ω) in jax: held to the scattering matrices of layered/, to energy, to finite differences."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from wavesim import layered, planewave
from wavesim.case.layered_case import bar_layers, varied_key
from wavesim.case.schema import parse
from wavesim.differentiable.coefficients import sine_and_cosine
from wavesim.differentiable.stack_transmission import transmission
from wavesim.differentiable.traced_layers import traced_layers
from wavesim.material.damping import Damping, constant_quality
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium

SECTORS = ("longitudinal", "transverse2")
OMEGA = 2 * np.pi * np.linspace(1e5, 1.2e6, 120)
found_of = jax.jit(transmission, static_argnames=("sector", "steps"))


def random_stack(rng, count, quality=None, closure="consistent", graded=False):
    """Layers of 0.2 to 6 mm, G of 3 to 40 N·m, between stiff half-spaces."""
    law = Damping() if quality is None else constant_quality(quality, (1e5, 1.5e6))
    stiff = Medium(closure=closure, G_n_a=40.0, G_n_r=40.0, damping=law)
    layers, end = [Layer(0.0, 1e-3, stiff)], 1e-3
    for _ in range(count):
        G_a, G_r = rng.uniform(3, 40, 2)
        medium = Medium(
            closure=closure, anisotropy=rng.uniform(0, 1), stiffness_ratio=rng.uniform(0.1, 1),
            density=rng.uniform(800, 3000), G_n_a=G_a, G_n_r=G_r, damping=law,
        )  # fmt: skip
        last = dataclasses.replace(medium, G_n_a=1.3 * G_a, density=2e3) if graded else None
        start, end = end, end + rng.uniform(2e-4, 6e-3)
        layers.append(Layer(start, end, medium, last))
    return Layers((*layers, Layer(end, end + 2e-3, stiff)))


def clear(layers, sector, omega, share):
    """Where ω is further than a share from every asymptote; there no route has any digits."""
    edges = np.concatenate([planewave.asymptotes(m, sector) for m in layers.media])
    return np.abs(omega[:, None] / edges - 1).min(axis=1) > share


CASES = [
    (1, "longitudinal", None, "consistent"),
    (12, "transverse2", None, "printed"),
    (60, "longitudinal", None, "consistent"),
    (12, "longitudinal", 10.0, "printed"),
    (40, "transverse2", 1e4, "consistent"),
]


@pytest.mark.parametrize(("count", "sector", "quality", "closure"), CASES)
def test_it_is_the_transmission_of_the_scattering_matrices(count, sector, quality, closure, rng):
    """T and R to 1e-10 over 1 to 60 layers, T in gaps relatively to 1e-8 down to 1e-12.

    Within 1e-4 of an asymptote rounding of the coefficients alone moves either route by more
    (against 40 digits both are off alike). Measured 3e-11 and 6e-10.
    """
    for _ in range(2):
        layers = random_stack(rng, count, quality, closure)
        known = layered.transmission(layers, sector, OMEGA, gradient=False)
        found = found_of(traced_layers(layers), sector, OMEGA)
        here = clear(layers, sector, OMEGA, 1e-4 if quality is None else 0)
        assert here.sum() > 60
        for one, two in ((known.T, found.T), (known.R, found.R)):
            assert np.abs(one - two)[here].max() <= 1e-10
        deep = here & (np.abs(known.T) >= 1e-12)
        assert np.abs(found.T / known.T - 1)[deep].max() <= 1e-8
        both = np.isfinite(known.power_T) & here
        assert np.abs(known.power_T - found.power_T)[both].max(initial=0.0) <= 1e-10


@pytest.mark.parametrize("quality", [None, 1e4])
def test_graded_layers_too(quality, rng):
    """T and R to 1e-10 however near an asymptote comes where something is lost; where nothing is,
    there is no answer between the asymptotes of a layer's ends. Measured 6e-12."""
    layers = random_stack(rng, 2, quality, graded=True)
    omega, inside = OMEGA, np.zeros(len(OMEGA), bool)
    if quality is None:
        for layer in layers.layers:
            edges = np.array([planewave.asymptotes(m, "longitudinal") for m in layer.sampled()])
            low, high = edges.min(axis=0)[:, None], edges.max(axis=0)[:, None]
            inside |= ((low < omega) & (omega < high)).any(axis=0)
    found = found_of(traced_layers(layers), "longitudinal", omega)
    assert (np.isnan(found.T) == inside).all()
    known = layered.transmission(layers, "longitudinal", omega[~inside])
    assert (~inside).sum() > 40
    assert np.abs(known.T - found.T[~inside]).max() <= 1e-10
    assert np.abs(known.R - found.R[~inside]).max() <= 1e-10


def test_an_unrelaxed_modulus_counts_where_nothing_is_lost(rng):
    """A law of m_U = 1.3 alone: that of layers 1.3 times as stiff, by scattering matrices."""
    layers = random_stack(rng, 3)
    stiffer = layers.mapped(
        lambda m: dataclasses.replace(m, G_n_a=1.3 * m.G_n_a, G_n_r=1.3 * m.G_n_r)
    )
    lawful = layers.mapped(lambda m: dataclasses.replace(m, damping=Damping(unrelaxed=1.3)))
    known = layered.transmission(stiffer, "longitudinal", OMEGA, gradient=False)
    found = transmission(traced_layers(lawful), "longitudinal", OMEGA)
    here = clear(stiffer, "longitudinal", OMEGA, 1e-4)
    assert np.abs(known.T - found.T)[here].max() <= 1e-10


def test_what_comes_in_goes_out(rng):
    """Reflected and transmitted energy sum to 1 to 1e-10; measured 3e-14."""
    for _ in range(3):
        found = found_of(traced_layers(random_stack(rng, 12)), "longitudinal", OMEGA)
        assert np.abs(found.power_T + found.power_R - 1).max() <= 1e-10


# Of a difference of order ten.
WEIGHTS = {1: 5 / 6, 2: -5 / 21, 3: 5 / 84, 4: -5 / 504, 5: 1 / 1260}


def test_gradients_are_those_of_differences_of_high_order(rng):
    """d/dp of mean |T|² and of the level at one ω, to 1e-8 of a tenth-order difference; of graded
    layers between uniform ones."""
    layers = random_stack(rng, 4, 30.0, graded=True)
    stack, omega = traced_layers(layers), jnp.asarray(OMEGA[::3])

    def value(thickness, G, a):
        own = dataclasses.replace(
            stack.with_values("G_n_r", [2, 4], G).with_values("anisotropy", 3, a),
            thickness=thickness,
        )
        found = transmission(own, "longitudinal", omega)
        return jnp.mean(jnp.abs(found.T) ** 2) + 1e-3 * found.level[7]

    at = (stack.thickness, jnp.asarray(12.0), jnp.asarray(0.4))
    both = jax.jit(jax.value_and_grad(value, argnums=(0, 1, 2)))
    gradient = both(*at)[1]

    def difference(move, h):
        parts = [w * (both(*move(n * h))[0] - both(*move(-n * h))[0]) for n, w in WEIGHTS.items()]
        return float(sum(parts)) / h

    G = difference(lambda d: (at[0], at[1] + d, at[2]), 1e-2)
    a = difference(lambda d: (at[0], at[1], at[2] + d), 1e-3)
    h = difference(lambda d: (at[0].at[3].add(d), at[1], at[2]), 2e-6)
    for exact, found in ((gradient[1], G), (gradient[2], a), (gradient[0][3], h)):
        assert found == pytest.approx(float(exact), rel=1e-8)


def test_a_batch_is_its_members(rng):
    """jax.vmap over thicknesses and a parameter; to rounding."""
    stack = traced_layers(random_stack(rng, 5))
    scales = jnp.asarray([0.9, 1.0, 1.2])

    def one(scale):
        own = stack.with_values("density", [1, 2], 1500 * scale)
        return transmission(
            dataclasses.replace(own, thickness=stack.thickness * scale), "longitudinal", OMEGA
        ).T

    whole, single = jax.jit(jax.vmap(one))(scales), jax.jit(one)
    for row, scale in zip(whole, scales, strict=True):
        assert np.abs(row - single(scale)).max() <= 1e-11


def test_sine_and_cosine_are_those_of_the_library():
    """To 4e-16 up to 1e6, in value and derivative."""
    x = jnp.asarray(np.concatenate([np.linspace(-40, 40, 4001), np.geomspace(50, 1e6, 2001)]))
    sine, cosine = sine_and_cosine(x)
    assert np.abs(sine - np.sin(x)).max() <= 4e-16
    assert np.abs(cosine - np.cos(x)).max() <= 4e-16
    assert np.abs(jax.vmap(jax.grad(lambda x: sine_and_cosine(x)[0]))(x) - cosine).max() == 0


def with_gradient(layers, rng):
    """The same with Γ of a share of up to some per cent, another in each layer."""
    least = -5 if all(layer.last is None for layer in layers.layers) else -2.5

    def of(medium):
        return dataclasses.replace(
            medium, G_n_g=10 ** rng.uniform(least, -2) if medium.G_n_r < 40 else 1e-2
        )

    return layers.mapped(of)


@pytest.mark.parametrize(
    ("sector", "count", "quality", "graded"),
    [
        ("longitudinal", 60, None, False),
        ("longitudinal", 12, 10.0, False),
        ("inplane(23)", 3, None, False),
        ("longitudinal", 1, None, True),
    ],
)
def test_waves_of_the_gradient_term_too(sector, count, quality, graded, rng):
    """Where Γ counts: T and R of the scattering matrices to 1e-10, energy to 1e-10; in-plane waves,
    which Γ alone carries, are those of a micro-field. Measured 5e-11 and 2e-14."""
    layers = with_gradient(random_stack(rng, count, quality, graded=graded), rng)
    omega = OMEGA * (4 if sector[:2] == "in" else 1)
    if graded:  # no asymptote is left in it, so that there is an answer throughout
        omega = omega[20::40]
    known = layered.transmission(layers, sector, omega)
    found = found_of(traced_layers(layers), sector, omega)
    for name in ("T", "R", "power_T", "power_R"):
        one, two = getattr(known, name), getattr(found, name)
        assert (np.isfinite(one) == np.isfinite(two)).all()
        assert np.nanmax(np.abs(one - two), initial=0.0) <= 1e-10
    deep = np.abs(known.T) >= 1e-12
    assert np.abs(found.T / known.T - 1)[deep].max() <= 1e-8
    if quality is None:
        assert np.nanmax(np.abs(found.power_T + found.power_R - 1)) <= 1e-10


def test_gradients_of_waves_of_the_gradient_term(rng):
    """By Γ and a thickness, to 1e-8 of a tenth-order difference."""
    stack = traced_layers(with_gradient(random_stack(rng, 3, 30.0), rng))
    omega = jnp.asarray(OMEGA[::12])

    def value(p):
        own = stack.with_values("G_n_g", 2, p[0]).with_values("thickness", 1, p[1])
        return jnp.mean(jnp.abs(transmission(own, "longitudinal", omega).T) ** 2)

    at = jnp.asarray([1e-2, 2e-3])
    both = jax.jit(jax.value_and_grad(value))  # one compilation for all
    for exact, step in zip(both(at)[1], jnp.diag(at) * 3e-3, strict=True):
        moved = [w * (both(at + n * step)[0] - both(at - n * step)[0]) for n, w in WEIGHTS.items()]
        assert float(sum(moved) / step.sum()) == pytest.approx(float(exact), rel=1e-8)


def test_what_has_no_answer_is_refused(rng):
    layers = random_stack(rng, 1)
    with pytest.raises(ValueError, match="nothing travels"):
        transmission(traced_layers(layers), "inplane", OMEGA)
    with pytest.raises(ValueError, match=r"take one of inplane\[23\]"):
        transmission(traced_layers(with_gradient(layers, rng)), "inplane", OMEGA)
    thin = Medium(G_n_g=1e-9, closure="consistent")
    graded = Layers((Layer(0.0, 1.0, thin, dataclasses.replace(thin, G_n_a=6.0)),))
    with pytest.raises(ValueError, match=r"die out within .* leave the term out"):
        traced_layers(graded, gradient=True)


CASE = """\
bar = { left = "half-space", right = "half-space" }
[[layers]]
thickness = 1e-3
density = 2e3
[[layers]]
repeat = 2
layers = [{ thickness = 2e-3, G_n_a = [4.0, 6.0] }, { thickness = 1e-3 }]
"""
REACHED = {
    "medium.density": ("density", (0, 2, 3, 4, 5, 6), "both"),
    "layers.0.density": ("density", (1,), "both"),
    "layers.1.layers.0.thickness": ("thickness", (2, 4), "both"),
    "layers.1.layers.0.G_n_a.1": ("G_n_a", (2, 4), "last"),
}


@pytest.mark.parametrize("key", REACHED)
def test_a_key_reaches_the_layers_that_have_it(key):
    known = bar_layers(parse(CASE, "my.toml"), "my.toml")
    found = varied_key(known, key)
    assert (found.name, found.layers, found.end) == REACHED[key]
    # The case read anew with that value has it there and nowhere else.
    if found.end == "both":
        other = bar_layers(parse(CASE, "my.toml", [f"{key}=3e-3"]), "my.toml")
        changed = [
            n for n, (a, b) in enumerate(zip(known.stretches, other.stretches, strict=True))
            if (a.medium, a.last) != (b.medium, b.last) or abs(a.thickness - b.thickness) > 1e-12
        ]  # fmt: skip
        assert tuple(changed) == found.layers


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("layers.0.thicknes", "did you mean thickness"),
        ("layers.5.thickness", "name one of layers.0, layers.1.layers.0, layers.1.layers.1"),
        ("time.duration", "'duration' can't be varied"),
        ("layers.0.density.1", "is no pair there"),
        ("medium.thickness", "no layer stands at medium"),
    ],
)
def test_a_key_that_reaches_nothing_is_told(key, told):
    known = bar_layers(parse(CASE, "my.toml"), "my.toml")
    with pytest.raises(ValueError, match=r"^key = ") as caught:
        varied_key(known, key)
    assert told in str(caught.value)
