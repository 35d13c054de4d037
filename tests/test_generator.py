"""A of a bar with layers, ends and losses: energy, losses, stability, ends, interfaces."""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from realbars import CELL, EVERYTHING, LOSSY, SOFT, STIFF, built, dense, fitted, lossy, three

from wavesim.bar import Bar, layered_bar
from wavesim.closures import chain
from wavesim.layeredwave import resonances
from wavesim.layers import Layer, Layers, as_layers
from wavesim.medium import Medium
from wavesim.sectors import BLOCKS, scales
from wavesim.timedomain.generator import banded

ENDS = [("free", "free"), ("fixed", "free"), ("fixed", "fixed"), ("periodic", "periodic")]


def random_state(A, rng, held=True):
    """A random state of A that keeps to its fixed nodes."""
    flat, unravel = ravel_pytree(A.zero())
    y = unravel(jnp.asarray(rng.normal(size=flat.size)))
    parts = []
    for group, components in zip(A.groups, y, strict=True):
        p, f = group.rotations, group.size
        still = np.asarray(group.free) == 0
        beyond = np.asarray(group.norm) == 0
        made = []
        for track, part in enumerate(components):
            gone = still if track < p or f <= track < f + p else beyond
            if track >= 2 * f and group.losses.absorbing and track >= 2 * f + p:
                gone = still
            made.append(jnp.where(gone, 0.0, part))
        parts.append(tuple(made))
    return tuple(parts)


def energy_rate(A, y):
    """d/dt of the energy along A, by jax."""
    total = lambda s: sum(A.energy(s))  # noqa: E731
    return float(jax.jvp(total, (y,), (A(y),))[1])


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("with_gradient", [False, True])
def test_energy_is_kept(ends, with_gradient, rng):
    """Law: lossless and consistent, E is a first integral of ẏ = A y at every state, whatever the
    layers, their cells and the ends. To 1e-12 of the energy in a unit of time times the highest
    frequency, 19; measured 3e-15."""
    layers = three()
    if with_gradient:
        layers = Layers(
            tuple(
                dataclasses.replace(
                    layer,
                    medium=dataclasses.replace(layer.medium, G_n_g=2.0),
                    last=layer.last and dataclasses.replace(layer.last, G_n_g=3.0),
                )
                for layer in layers.layers
            )
        )
    A = built(layers, fitted(layers, *ends), BLOCKS, with_gradient)
    y = random_state(A, rng)
    energy = float(sum(A.energy(y)))
    assert energy > 0
    assert abs(energy_rate(A, y)) <= 1e-12 * 19 * energy


@pytest.mark.parametrize("damping", [LOSSY, EVERYTHING], ids=["solids", "all"])
@pytest.mark.parametrize("ends", [("free", "fixed"), ("free", "absorbing")])
def test_energy_falls_by_what_is_lost(ends, damping, rng):
    """Law: −dE/dt is the power that dampers and absorbers take, which is formed without E. To 1e-11
    of the power; measured 5e-14."""
    layers = three(damping=damping)
    A = built(layers, fitted(layers, *ends), BLOCKS)
    y = random_state(A, rng)
    seen = jax.vmap(A.groups[0].observe)(jax.tree.map(lambda part: part[None], y[0]))
    lost = float(A.groups[0].lost(seen)[0, 0])
    other = jax.vmap(A.groups[1].observe)(jax.tree.map(lambda part: part[None], y[1]))
    lost += float(A.groups[1].lost(other)[0, 0])
    assert lost != 0
    assert abs(energy_rate(A, y) + lost) <= 1e-11 * abs(lost)


def test_dampers_only_take(rng):
    """Law: what dampers take is a sum of squares: never negative, for any state."""
    layers = three(damping=EVERYTHING)
    A = built(layers, fitted(layers, "free", "fixed"))
    for _ in range(20):
        y = random_state(A, rng)
        seen = jax.vmap(A.groups[0].observe)(jax.tree.map(lambda part: part[None], y[0]))
        assert float(A.groups[0].lost(seen)[0, 0]) > 0


@pytest.mark.parametrize("closure", ["printed", "consistent"])
@pytest.mark.parametrize("damping", [None, EVERYTHING], ids=["lossless", "lossy"])
@pytest.mark.parametrize("ends", [("free", "fixed"), ("absorbing", "absorbing")])
def test_nothing_grows(closure, damping, ends):
    """Law: no eigenvalue of A has a positive real part, so that runs of 1e5 units of time are
    stable: e^{1e5 Re λ} stays below 1.01. A free mode λ = 0 of φ is double, and rounding of 1e-16
    splits it by its root times the highest frequency, some 1e-7; others measured below 1e-12."""
    layers = three(closure, damping)
    A = built(layers, fitted(layers, *ends))
    values = np.linalg.eigvals(dense(A)[0])
    moving = np.abs(values) > 1e-4
    assert values.real[moving].max() <= 1e-7
    assert np.abs(values[~moving]).max(initial=0.0) <= 2e-6


def test_the_two_differences_are_adjoint(rng):
    """Qᵀ stands for Dᵀ H to the last bits, stretches of unlike cells and all ends included."""
    layers = three()
    for ends in ENDS:
        A = built(layers, fitted(layers, *ends))
        group = A.groups[0]
        u, s = (jnp.asarray(rng.normal(size=group.free.shape)) for _ in range(2))
        s = jnp.where(group.norm == 0, 0.0, s)
        one = float(jnp.sum(group.norm * s * group.D(u)))
        other = float(jnp.sum(u * group.QT(s)))
        assert one == pytest.approx(other, rel=1e-12)


def test_stencil_and_exceptions_are_the_matrix_of_the_chain(rng):
    """A banded matrix as one stencil with exceptions near ends is the one given by diagonals."""
    made = chain(8, (20, 24), (1e-4, 1.2e-4))
    n = made.diagonals.shape[1]
    matrix = np.zeros((n, n + 1))
    for w, row in enumerate(made.diagonals):
        for j in range(n):
            if 0 <= j + made.first + w <= n:
                matrix[j, j + made.first + w] = row[j]
    layers = Layers((Layer(0, 2e-3, SOFT), Layer(2e-3, 2e-3 + 24 * 1.2e-4, STIFF)))
    bar = Bar(44, 1.2e-4, 8, "free", "free", stretches=((20, 1e-4), (24, 1.2e-4)))
    A = built(layers, bar)
    u = rng.normal(size=n + 1)
    length = float(scales(SOFT).length)
    got = np.asarray(A.groups[0].D(jnp.asarray(u)[None]))[0, :n]
    np.testing.assert_allclose(got, matrix @ u * length, rtol=0, atol=1e-11)
    with pytest.raises(AssertionError):
        banded(0, np.ones((4, 10)), (1.0, 2.0, 3.0), np.ones(10), True)


@functools.cache
def frequencies(order, ends, cells, length=8e-3):
    """Highest-accuracy eigenfrequencies of a uniform bar with ends, from A, rad/s."""
    bar = Bar(cells, length / cells, order, *ends)
    A = built(as_layers(SOFT, length), bar)
    values = np.linalg.eigvals(dense(A)[0])
    found = np.sort(values.imag[values.imag > 1e-3])
    return found / float(SOFT.time_scale)


@pytest.mark.parametrize("ends", [("free", "free"), ("fixed", "fixed"), ("fixed", "free")])
def test_eigenfrequencies_of_finite_bars(ends):
    """Law: eigenfrequencies of a bar between ends are ω(k), cos or sin of kL = 0.

    The lowest six of the exact solver, which has no grid, on 96 cells of order 8: the sixth has 32
    cells to a wavelength. To 1e-6; measured 4e-8 and less.
    """
    exact = resonances(as_layers(SOFT, 8e-3), *ends, "longitudinal", (1e4, 3.6e6))[:6]
    found = frequencies(8, ends, 96)
    nearest = np.array([found[np.argmin(np.abs(found - w))] for w in exact])
    assert len(exact) == 6
    assert np.abs(nearest / exact - 1).max() <= 1e-6


def end_error(order, ends, cells):
    """Relative error of the eighth standing wave of φ̈ = φ″ between ends, by singular values."""
    made = chain(order, (cells,), (1 / cells,))
    n = made.diagonals.shape[1]
    D = np.zeros((n, n + 1))
    for w, row in enumerate(made.diagonals):
        j = np.arange(n)
        inside = (j + made.first + w >= 0) & (j + made.first + w <= n)
        D[j[inside], j[inside] + made.first + w] = row[inside]
    scaled = np.sqrt(made.half_norm)[:, None] * D / np.sqrt(made.node_norm)
    kept = scaled[:, (ends[0] == "fixed") : n + 1 - (ends[1] == "fixed")]
    found = np.linalg.svd(kept, compute_uv=False)
    k = np.pi * 8
    return float(np.abs(found - k).min() / k)


@pytest.mark.parametrize("order, declared", [(2, 2), (4, 4), (8, 7)])
@pytest.mark.parametrize("end", ["free", "fixed"])
def test_order_at_ends(order, declared, end):
    """Declared order of eigenfrequencies at an end, ±0.1: 2, 4 and, at order 8, 7 (the closures are
    exact to degree 3, and errors of eigenfrequencies have twice that order, or one more). Fitted
    between 128 and 192 cells to a wavelength (order 4: 384 to 768, where it has settled); measured
    2.00, 4.03 and 3.92, 6.93 and 6.93."""
    waves = 4  # wavelengths of the eighth standing wave in the bar
    points = (384, 768) if order == 4 else (128, 192)
    errors = [end_error(order, (end, end), waves * p) for p in points]
    slope = np.log(errors[0] / errors[1]) / np.log(points[1] / points[0])
    assert slope == pytest.approx(declared, abs=0.1)


def test_order_at_a_jump():
    """Declared order at an interface: eigenfrequencies of two layers, unlike cells, order 8, fall
    with the seventh power of the cell size or faster, against the exact solver: between 96 and 144
    cells by more than 1.5^5.9 (the error turns sign near 1e-8, so that a slope fitted there
    scatters); measured 3e-9 and 2e-10 for the fourth."""
    layers = Layers((Layer(0.0, 4e-3, SOFT), Layer(4e-3, 7e-3, STIFF)))
    exact = resonances(layers, "free", "fixed", "longitudinal", (1e4, 3.2e6))[3]
    errors = []
    for cells in (72, 108):
        bar = layered_bar(layers, 7e-3 / cells, 8, "free", "fixed")
        values = np.linalg.eigvals(dense(built(layers, bar))[0])
        found = values.imag[values.imag > 1e-3] / float(SOFT.time_scale)
        errors.append(np.abs(found / exact - 1).min())
    assert errors[0] <= 1e-6
    assert errors[1] <= errors[0] / 1.5**5.9


def test_a_free_bar_turns_without_effort():
    """Law: a rotation that is the same everywhere strains nothing, graded layers included."""
    layers = three()
    A = built(layers, fitted(layers, "free", "free"))
    (components,) = A.zero()
    phi = jnp.ones_like(components[0])
    _, stored = A.groups[0].energy((phi, *components[1:]))
    assert abs(float(stored)) <= 1e-24


def test_mass_is_that_of_the_layers():
    """Inertias of all nodes sum to ∫ρβ dx, half-nodes' to ∫ργ dx; exact for uniform layers."""
    layers = Layers((Layer(0.0, 3e-3, SOFT), Layer(3e-3, 6.5e-3, STIFF)))
    A = built(layers, fitted(layers, "free", "free"))
    units = scales(SOFT)
    for row, inertia in ((0, "beta"), (1, "gamma")):
        unit = units.moment * units.time**2 * units.length
        if inertia == "gamma":
            unit *= float(SOFT.gamma / SOFT.beta)
        made = float(np.sum(A.groups[0].mass[row])) * unit
        expected = sum(
            layer.thickness * layer.medium.density * getattr(layer.medium, inertia)
            for layer in layers.layers
        )
        assert made == pytest.approx(expected, rel=1e-12)


def test_coefficients_of_a_graded_layer_are_those_of_its_media():
    """Interpolated from twelve samples, they are those of the medium at each place, to 1e-12."""
    first, last = SOFT, dataclasses.replace(STIFF, branch_length=1.2e-3, stiffness_ratio=0.8)
    layers = Layers((Layer(0.0, 4e-3, first, last),))
    bar = Bar(32, CELL, 8, "free", "free")
    A = built(layers, bar, with_gradient=False)
    group = A.groups[0]
    for j in (0, 7, 19, 31):
        x = (j + 0.5) * CELL
        alone = built(as_layers(layers.at(x), 4e-3), bar)
        one = generator_at(layers.at(x), first)
        for name in ("c_pp", "c_pb", "c_bp", "c_bb"):
            got = np.asarray(getattr(group.c, name))[..., j]
            np.testing.assert_allclose(got[..., 0], getattr(one, name), rtol=1e-11)
        assert float(group.c.i_B[0, j]) == pytest.approx(one.i_B, rel=1e-12)
        assert alone.groups[0].c.i_B[0, j] == pytest.approx(1.0)


def generator_at(medium: Medium, reference: Medium):
    from wavesim.sectors import block_coefficients

    return block_coefficients(medium, BLOCKS[0], scales(reference))


def test_losses_of_layers_do_not_mix():
    """Each half-node has its own layer's law; the node between shares α by inertia."""
    law = dataclasses.replace(LOSSY, mass=1e5)
    layers = Layers((Layer(0.0, 3e-3, SOFT), Layer(3e-3, 6e-3, lossy(STIFF, law))))
    A = built(layers, fitted(layers, "free", "free"))
    found = A.groups[0].losses
    assert not np.any(found.strengths[:, :24])
    np.testing.assert_allclose(
        found.strengths[:, 24:48], np.array(law.strengths)[:, None] * np.ones(24)
    )
    share = (STIFF.density * STIFF.beta) / (STIFF.density * STIFF.beta + SOFT.density * SOFT.beta)
    time = float(SOFT.time_scale)
    assert found.mass_node[24] == pytest.approx(1e5 * time * share)
