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

from wavesim.grid.bar import Bar, layered_bar
from wavesim.grid.summation_by_parts import chain
from wavesim.layered import resonances
from wavesim.material.layers import Layer, Layers, as_layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.material.sectors import BLOCKS
from wavesim.planewave.dispersion_relation import gaps, wavenumber
from wavesim.timedomain.banded import banded

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


def growth(layers, bar):
    """Largest Re λ of A, but for the double λ = 0 of a free rotation, which rounding splits."""
    values = np.linalg.eigvals(dense(built(layers, bar))[0])
    moving = np.abs(values) > 1e-4
    assert np.abs(values[~moving]).max(initial=0.0) <= 2e-6
    return float(values.real[moving].max())


@pytest.mark.parametrize("closure", ["printed", "consistent"])
@pytest.mark.parametrize("damping", [None, EVERYTHING], ids=["lossless", "lossy"])
def test_nothing_grows_between_ends(closure, damping):
    """Law: no eigenvalue of A has a positive real part: measured 1e-12 and less, of 19 in size."""
    layers = three(closure, damping)
    assert growth(layers, fitted(layers, "free", "fixed")) <= 1e-10


@pytest.mark.parametrize("closure", ["printed", "consistent"])
@pytest.mark.parametrize("place", ["uniform", "caught"])
def test_absorbing_ends_are_stable(closure, place):
    """Law: runs of 1e5 units of time are stable: e^{1e5 Re λ} ≤ 1.01.

    The default absorber of eight branch lengths on a uniform bar and on one with a layer beside it
    that catches waves in the gap of its neighbour, whose tails an absorber without friction on B
    feeds: growth of 2e-4 there. Two branch lengths lie between; at one it is 7e-6 for "printed".
    Measured 1e-14 and less.
    """
    soft = dataclasses.replace(SOFT, closure=closure)
    if place == "uniform":
        layers, ends = as_layers(soft, 20e-3), ("absorbing", "absorbing")
    else:
        stiff = dataclasses.replace(STIFF, closure=closure)
        layers, ends = (
            Layers((Layer(0.0, 10e-3, soft), Layer(10e-3, 12e-3, stiff))),
            (
                "absorbing",
                "fixed",
            ),
        )
    bar = layered_bar(layers, CELL, 8, *ends, 8e-3)
    assert growth(layers, bar) <= 1e-7


@pytest.mark.parametrize("closure", ["printed", "consistent"])
@pytest.mark.parametrize("block", BLOCKS[:2], ids=["longitudinal", "transverse"])
def test_what_absorbing_ends_reflect(closure, block):
    """Amplitude that the default absorber, eight branch lengths, sends back at each frequency.

    Steady waves of A in a uniform bar, split into those to and fro with the exact k(ω). At most
    1e-5 on nine tenths of the bands below ω̄ = 2, and at most 1e-3 up to 2 %
    of their edges; measured 0.91 to 0.94, and 2e-5 (longitudinal) and 1e-5.
    """
    medium = Medium(anisotropy=0.25, closure=closure)
    cells, step = 128, 0.02
    bar = Bar(cells, CELL, 8, "free", "absorbing", 8e-3)
    A = built(as_layers(medium, cells * CELL), bar, (block,))
    matrix, _ = dense(A)
    force = np.zeros(len(matrix))
    force[A.groups[0].size * (cells + 1) + 4] = 1.0
    edges = [
        (gap.lower * medium.time_scale, gap.upper * medium.time_scale)
        for gap in gaps(medium, block.sector)
    ]
    omega = np.arange(step, 2, step)
    inside = [all(w < 0.98 * low or w > 1.02 * high for low, high in edges) for w in omega]
    omega = omega[inside]
    x = np.arange(16, 60)
    reflected = []
    for w in omega:
        phi = np.linalg.solve(-1j * w * np.eye(len(matrix)) - matrix, force)[: cells + 1][x]
        k = wavenumber(medium, block.sector, w / medium.time_scale)[0] * CELL
        design = np.exp(np.multiply.outer(x - x[0], [1j * k, -1j * k]))
        ahead, back = np.linalg.lstsq(design, phi, rcond=None)[0]
        reflected.append(abs(back / ahead))
    reflected = np.array(reflected)
    width = edges[0][0] + edges[1][0] - edges[0][1] + 2 - edges[1][1]
    assert np.sum(reflected <= 1e-5) * step >= 0.9 * width
    assert reflected.max() <= 1e-3
    assert reflected.max() > 1e-7


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

    The lowest four of the exact solver, which has no grid, on 96 cells of order 8: the fourth has
    48 cells to a wavelength. To 1e-6; measured 2e-8 and less.
    """
    exact = resonances(as_layers(SOFT, 8e-3), *ends, "longitudinal", (1e4, 4.2e6))[:4]
    found = frequencies(8, ends, 96)
    nearest = np.array([found[np.argmin(np.abs(found - w))] for w in exact])
    assert len(exact) == 4
    assert np.abs(nearest / exact - 1).max() <= 1e-6


def end_error(order, ends, cells, mode):
    """Relative error of a standing wave of φ̈ = φ″ between ends, by singular values."""
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
    k = np.pi * mode
    return float(np.abs(found - k).min() / k)


@pytest.mark.parametrize(("order", "declared"), [(2, 2), (4, 4), (8, 7)])
@pytest.mark.parametrize("end", ["free", "fixed"])
def test_order_at_ends(order, declared, end):
    """Declared order of eigenfrequencies at an end, ±0.1: 2, 4 and, at order 8, 7 (the closures are
    exact to degree 3, and errors of eigenfrequencies have twice that order, or one more). Fitted
    between 128 and 192 cells to a wavelength (order 4: 768 to 1536, where it has settled); measured
    2.00, 4.03 and 3.94, 6.93 and 6.93."""
    points, mode = ((768, 1536), 2) if order == 4 else ((128, 192), 8)
    errors = [end_error(order, (end, end), mode * p // 2, mode) for p in points]
    slope = np.log(errors[0] / errors[1]) / np.log(points[1] / points[0])
    assert slope == pytest.approx(declared, abs=0.1)


def test_order_at_a_jump():
    """Declared order at an interface: 6 ± 0.2 at order 8, twice the degree of the closures.

    The fourth eigenfrequency of two layers with unlike cells, against the exact solver, fitted over
    96 to 180 cells; measured 6.1, errors 1.2e-8 to 2.7e-10.
    """
    layers = Layers((Layer(0.0, 4e-3, SOFT), Layer(4e-3, 7e-3, STIFF)))
    exact = resonances(layers, "free", "fixed", "longitudinal", (1e4, 3.2e6))[3]
    counts, errors = (96, 120, 144, 180), []
    for cells in counts:
        bar = layered_bar(layers, 7e-3 / cells, 8, "free", "fixed")
        values = np.linalg.eigvals(dense(built(layers, bar))[0])
        found = values.imag[values.imag > 1e-3] / float(SOFT.time_scale)
        errors.append(np.abs(found / exact - 1).min())
    assert errors[0] <= 1e-6
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(6, abs=0.2)


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
    from wavesim.material.scaling import block_coefficients

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
