"""The semi-discrete operator A: energy, losses, stability, ends, interfaces, absorbers."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest
import scipy.sparse
from scipy.sparse.linalg import eigs, splu

from wavesim.grid.bar import Bar, layered_bar
from wavesim.layered import resonances
from wavesim.material.damping import Damping, constant_quality
from wavesim.material.granular_equations import ROTATION
from wavesim.material.layers import Layer, Layers, as_layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import block_coefficients, scales
from wavesim.planewave import gaps, wavenumber
from wavesim.simulation.simulation import simulation
from wavesim.sources import Ricker
from wavesim.timedomain.equation import energy
from wavesim.timedomain.operator import operator
from wavesim.timedomain.sparse_matrix import flat, second_order, sparse_matrix, unflat
from wavesim.timedomain.time_step import series_coefficients, time_step

CELL = 1.25e-4
SOFT = Medium(anisotropy=0.3, closure="consistent")
STIFF = Medium(closure="consistent", G_n_a=9.0, G_n_r=7.0, density=2000.0, particle_radius=6e-4)
LOSSY = constant_quality(30.0, (2e5, 2e6))
EVERYTHING = dataclasses.replace(LOSSY, mass=1e5, stiffness=2e-9)
TWO_SOLIDS = dataclasses.replace(
    EVERYTHING, rates=LOSSY.rates[1::2], strengths=LOSSY.strengths[1::2]
)
ENDS = [("free", "free"), ("fixed", "free"), ("fixed", "fixed"), ("periodic", "periodic")]


def three(closure="consistent", damping=None, gradient=None, size=1e-3):
    """Soft, graded and stiff layers of 3, 4 and 3 mm, or of another size."""

    def of(medium):
        changes = {"closure": closure} | ({} if damping is None else {"damping": damping})
        return dataclasses.replace(medium, **changes, G_n_g=gradient or medium.G_n_g)

    soft, stiff = of(SOFT), of(STIFF)
    return Layers(
        (
            Layer(0.0, 3 * size, soft),
            Layer(3 * size, 7 * size, soft, stiff),
            Layer(7 * size, 10 * size, stiff),
        )
    )


def fitted(layers, left, right, cell=CELL):
    """The bar of some layers."""
    return layered_bar(layers, cell, 8, left, right, 4e-3 if "absorbing" in (left, right) else 0.0)


applied = jax.jit(lambda A, y: A(y))


def built(layers, bar, blocks=ROTATION.blocks[:1], with_gradient=False):
    """A of a bar, in units of the soft medium."""
    return operator(layers, bar, blocks, SOFT, with_gradient)


def random_state(A, rng):
    """A random state of A that keeps to its held nodes, its strains those of its fields."""
    made = []
    for group, rest in zip(A.groups, A.rest, strict=True):
        still, beyond = group.free == 0, group.half_norm == 0
        parts = {
            name: np.where(still if "phi" in name else beyond, 0.0, rng.normal(size=array.shape))
            for name, array in rest._asdict().items()
        }
        made.append(rest._replace(**parts))
    return tuple(made)


def energy_rate(A, y):
    """d/dt of the energy along A: half the difference of a quadratic form's values at y ± A y."""
    rate = unflat(sparse_matrix(A) @ flat(y), y)
    ahead, behind = (jax.tree.map(lambda u, v, n=n: u + n * v, y, rate) for n in (1.0, -1.0))
    return float(sum(energy(A, ahead)) - sum(energy(A, behind))) / 2


def moving(layers, bar):
    """A without φ, on which nothing depends, dense."""
    A = built(layers, bar)
    assert not np.any(A.groups[0].losses.spring_node)
    phi = A.rest[0].phi.size
    return sparse_matrix(A)[phi:, phi:].toarray()


@pytest.mark.parametrize(
    ("ends", "cell"),
    [
        *((ends, CELL) for ends in (*ENDS, ("absorbing", "free"), ("fixed", "absorbing"))),
        (("fixed", "absorbing"), CELL / 8),
        (("periodic", "periodic"), CELL / 8),
    ],
)
def test_as_jax_applies_it_is_the_sparse_matrix(ends, cell, rng):
    """The operator in jax and the sparse matrix, formed apart from the same coefficients, agree to
    rounding: layers, a graded one, every loss, Γ, all blocks; measured 7e-16 of the largest."""
    layers = three(damping=EVERYTHING, gradient=1e-3)
    A = built(layers, fitted(layers, *ends, cell), ROTATION.blocks, with_gradient=True)
    y = random_state(A, rng)
    by_matrix = sparse_matrix(A) @ flat(y)
    assert np.abs(flat(applied(A, y)) - by_matrix).max() <= 1e-14 * np.abs(by_matrix).max()
    assert np.array_equal(flat(unflat(flat(y), y)), flat(y))


def test_in_second_order_it_is_the_same_operator(rng):
    """Without losses q̈ = F K G q of q = (φ, B) is what A makes of rates of strains, κ = φ′; to
    rounding, measured 4e-16 of the largest."""
    layers = three(gradient=1e-3)
    A = built(layers, fitted(layers, "fixed", "free"), ROTATION.blocks[:1], with_gradient=True)
    (group,), (y,) = A.groups, random_state(A, rng)
    F, K, G = second_order(group)
    y = y._replace(kappa=np.asarray(group.D(y.phi)))
    (rate,) = unflat(sparse_matrix(A) @ flat((y,)), (y,))
    found = F @ (K @ (G @ np.concatenate([y.phi.ravel(), y.B.ravel()])))
    known = np.concatenate([rate.phi_rate.ravel(), rate.B_rate.ravel()])
    assert np.abs(found - known).max() <= 1e-14 * np.abs(known).max()


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("with_gradient", [False, True])
def test_energy_is_kept(ends, with_gradient, rng):
    """Law: lossless and consistent, E is a first integral of ẏ = A y at every state, whatever the
    layers, their cells and the ends. To 1e-12 of the energy in a unit of time times the highest
    frequency, 19; measured 3e-15."""
    layers = three(gradient=2.0 if with_gradient else None)
    A = built(layers, fitted(layers, *ends), ROTATION.blocks, with_gradient)
    y = random_state(A, rng)
    total = float(sum(energy(A, y)))
    assert total > 0
    assert abs(energy_rate(A, y)) <= 1e-12 * 19 * total


@pytest.mark.parametrize("damping", [LOSSY, EVERYTHING], ids=["solids", "all"])
def test_dampers_only_take(damping, rng):
    """Law: what dampers take is a sum of squares: the energy of no state rises by itself."""
    layers = three(damping=damping)
    A = built(layers, fitted(layers, "free", "fixed"), ROTATION.blocks)
    for _ in range(10):
        assert energy_rate(A, random_state(A, rng)) < 0


@pytest.mark.parametrize("closure", ["printed", "consistent"])
@pytest.mark.parametrize("damping", [None, TWO_SOLIDS], ids=["lossless", "lossy"])
def test_nothing_grows_between_ends(closure, damping):
    """Law: no eigenvalue of A has a positive real part: measured 1e-12 and less, of 19 in
    size."""
    layers = three(closure, damping, size=2 / 3 * 1e-3)
    values = np.linalg.eigvals(moving(layers, fitted(layers, "free", "fixed")))
    assert values.real.max() <= 1e-10


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
        layers = Layers((Layer(0.0, 10e-3, soft), Layer(10e-3, 12e-3, stiff)))
        ends = ("absorbing", "fixed")
    values = np.linalg.eigvals(moving(layers, layered_bar(layers, CELL, 8, *ends, 8e-3)))
    assert values.real.max() <= 1e-7


ABSORBED = {
    "printed": Medium(anisotropy=0.25),
    "consistent": Medium(anisotropy=0.25, closure="consistent"),
    "translation": Medium(family="translation", anisotropy=0.25),
}


@pytest.mark.parametrize("kind", ABSORBED)
@pytest.mark.parametrize("sector", ["longitudinal", "transverse2"])
def test_what_absorbing_ends_reflect(kind, sector):
    """Amplitude that the default absorber, eight branch lengths, sends back at each frequency.

    Steady waves of A in a uniform bar, split into those to and fro with the exact k(ω). At most
    1e-5 on nine tenths of the bands below ω̄ = 2 (in units of rotation's cutoffs), and at most
    1e-3 up to 2 % of their edges; measured 0.91 to 0.93, and 1.4e-5 to 2.7e-5 (rotation) and
    3.5e-4 (translation, beside the lowest asymptote).
    """
    medium = ABSORBED[kind]
    top = 2.0 * (np.sqrt(12 / 7) if kind == "translation" else 1.0)
    step = top / 100
    (block,) = medium.family.blocks_of(sector)
    cells = 128
    bar = Bar(cells, CELL, 8, "free", "absorbing", 8e-3)
    A = operator(as_layers(medium, cells * CELL), bar, (block,), medium, False)
    matrix = sparse_matrix(A)
    unit = scipy.sparse.eye_array(matrix.shape[0])
    rest = A.rest[0]
    at = np.s_[rest.phi.size + rest.B.size :]
    force = np.zeros(matrix.shape[0])
    force[at][4] = 1.0
    edges = [
        (gap.lower * medium.time_scale, gap.upper * medium.time_scale)
        for gap in gaps(medium, sector)
    ]
    omega = np.arange(step, top, step)
    inside = [all(w < 0.98 * low or w > 1.02 * high for low, high in edges) for w in omega]
    x, reflected = np.arange(16, 60), []
    for w in omega[inside]:
        phi = splu((-1j * w * unit - matrix).tocsc()).solve(force + 0j)[x]
        k = wavenumber(medium, sector, w / medium.time_scale)[0] * CELL
        design = np.exp(np.multiply.outer(x - x[0], [1j * k, -1j * k]))
        ahead, back = np.linalg.lstsq(design, phi, rcond=None)[0]
        reflected.append(abs(back / ahead))
    reflected = np.array(reflected)
    width = edges[0][0] + edges[1][0] - edges[0][1] + top - edges[1][1]
    assert np.sum(reflected <= 1e-5) * step >= 0.9 * width
    assert reflected.max() <= 1e-3
    assert reflected.max() > 1e-7


def nearest(layers, bar, omega):
    """The eigenfrequency of A nearest to one, rad/s."""
    unit = float(SOFT.time_scale)
    matrix = sparse_matrix(built(layers, bar)).tocsc().astype(complex)
    (found,) = eigs(matrix, 1, sigma=1j * omega * unit * (1 + 1e-4), return_eigenvectors=False)
    return found.imag / unit


@pytest.mark.parametrize("ends", [("free", "free"), ("fixed", "fixed"), ("fixed", "free")])
def test_eigenfrequencies_of_finite_bars(ends):
    """Law: eigenfrequencies of a bar between ends are ω(k), cos or sin of kL = 0.

    The lowest four of the exact solver, which has no grid, on 96 cells of order 8: the fourth has
    48 cells to a wavelength. To 1e-6; measured 2e-8 and less.
    """
    layers, bar = as_layers(SOFT, 8e-3), Bar(96, 8e-3 / 96, 8, *ends)
    exact = resonances(layers, *ends, "longitudinal", (1e4, 4.2e6))[:4]
    assert len(exact) == 4
    for omega in exact:
        assert abs(nearest(layers, bar, omega) / omega - 1) <= 1e-6


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
        errors.append(abs(nearest(layers, bar, exact) / exact - 1))
    assert errors[0] <= 1e-6
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(6, abs=0.2)


def test_a_free_bar_turns_without_effort():
    """Law: a rotation that is the same everywhere strains nothing, graded layers included."""
    layers = three()
    A = built(layers, fitted(layers, "free", "free"))
    (group,), (rest,) = A.groups, A.rest
    kappa = np.asarray(group.D(np.ones_like(rest.phi)))
    assert np.abs(kappa).max() <= 1e-12
    assert float(energy(A, (rest._replace(phi=np.ones_like(rest.phi)),))[1]) == 0


def test_mass_is_that_of_the_layers():
    """Inertias of all nodes sum to ∫ρβ dx, half-nodes' to ∫ργ dx; exact for uniform layers."""
    layers = Layers((Layer(0.0, 3e-3, SOFT), Layer(3e-3, 6.5e-3, STIFF)))
    A = built(layers, fitted(layers, "free", "free"))
    units = scales(SOFT)
    for row, inertia in ((0, "beta"), (1, "gamma")):
        unit = units.energy * units.time**2
        if inertia == "gamma":
            unit *= float(SOFT.gamma / SOFT.beta)
        made = float(np.sum(A.groups[0].mass[row])) * unit
        expected = sum(
            layer.thickness * layer.medium.density * getattr(layer.medium, inertia)
            for layer in layers.layers
        )
        assert made == pytest.approx(expected, rel=1e-12)


def test_coefficients_of_a_graded_layer_are_those_of_its_media():
    """Interpolated from twelve samples, they are those of the medium at each place, to 1e-11."""
    first, last = SOFT, dataclasses.replace(STIFF, branch_length=1.2e-3, stiffness_ratio=0.8)
    layers = Layers((Layer(0.0, 4e-3, first, last),))
    (group,) = built(layers, Bar(32, CELL, 8, "free", "free")).groups
    for j in (0, 7, 19, 31):
        one = block_coefficients(layers.at((j + 0.5) * CELL), ROTATION.blocks[0], scales(first))
        whole = np.block([[one.c_pp, -one.c_pb], [-one.c_bp, one.c_bb]])
        np.testing.assert_allclose(group.c.stiffness[..., 0, j], whole, rtol=1e-11)
        assert float(group.c.inertia[0, j]) == pytest.approx(float(one.i_B), rel=1e-12)


def test_losses_of_layers_do_not_mix():
    """Each half-node has its own layer's law; the node between shares α by inertia."""
    law = dataclasses.replace(LOSSY, mass=1e5)
    stiff = dataclasses.replace(STIFF, damping=law)
    layers = Layers((Layer(0.0, 3e-3, SOFT), Layer(3e-3, 6e-3, stiff)))
    found = built(layers, fitted(layers, "free", "free")).groups[0].losses
    assert not np.any(found.strengths[:, :24])
    expected = np.array(law.strengths)[:, None] * np.ones(24)
    np.testing.assert_allclose(found.strengths[:, 24:48], expected)
    share = (STIFF.density * STIFF.beta) / (STIFF.density * STIFF.beta + SOFT.density * SOFT.beta)
    assert found.mass_node[24] == pytest.approx(1e5 * float(SOFT.time_scale) * share)


def test_absorbed_waves_of_a_damped_medium_obey_the_stretched_equations(rng):
    """Law: with ∂ₓ stretched to ∂ₓ/(1 + d/∂ₜ), m(φ̈ + αφ̇) = ∂ₜσ′/(∂ₜ + d): at a frequency, A gives
    (−iω + d)(−iω + α)φ = −QᵀC κ/m and (−iω + d)κ = −iω Dφ. To 1e-12."""
    medium = dataclasses.replace(SOFT, damping=Damping(mass=3e5))
    bar = Bar(128, CELL, 8, "free", "absorbing", 8e-3)
    A = built(as_layers(medium, 128 * CELL), bar)
    (group,), omega = A.groups, 0.7
    phi = np.where(group.free == 0, 0.0, rng.normal(size=(1, *group.free.shape)))
    law = group.losses
    kappa = -1j * omega * np.asarray(group.D(phi)) / (law.absorb_half - 1j * omega)
    rest = group.rest
    y = rest._replace(phi=phi, phi_rate=-1j * omega * phi, kappa=kappa)
    made = unflat(sparse_matrix(A) @ flat((y,)), (rest,))[0]
    np.testing.assert_allclose(made.kappa, -1j * omega * kappa, atol=1e-12 * np.abs(kappa).max())
    d, alpha = law.drag_node - law.mass_node, law.mass_node
    sigma = group.c.stiffness[:1, 0] * kappa
    pull = -group.free * (np.asarray(group.QT(sigma.real)) + 1j * np.asarray(group.QT(sigma.imag)))
    stretched = -1j * omega * pull / (d - 1j * omega) / (alpha - 1j * omega)
    by_A = made.phi_rate + (d + alpha) * y.phi_rate + d * alpha * phi
    inner = group.free != 0
    left = ((d - 1j * omega) * (alpha - 1j * omega) * stretched / (-1j * omega))[:, inner]
    scale = np.abs(pull).max()
    np.testing.assert_allclose(by_A[:, inner], left, atol=1e-12 * scale)


def test_a_fast_mode_that_loses_nothing_is_stepped_beside_an_absorber():
    """A thin layer has the fastest modes, the ends damp others: of the series of exp(hλ) at λ = iω
    of such a mode no term is so large that its rounding is felt above 1e-7."""
    stiff = Medium(closure="consistent", G_n_a=40.0, G_n_r=40.0)
    soft = dataclasses.replace(stiff, G_n_a=3.0, G_n_r=24.0)
    layers = Layers((Layer(0.0, 0.024, stiff), Layer(0.024, 0.02426, soft),
                     Layer(0.02426, 0.048, stiff)))  # fmt: skip
    bar = layered_bar(layers, (5e-5, 1.6e-5, 5e-5), 8, "absorbing", "absorbing", 8e-3)
    made = time_step(simulation(layers, bar, (Ricker("phi1", 0.012, 3e5),), 1e-4, 11))
    c = series_coefficients(np.array([made.step]), made.radius, made.shift, made.degree)[0]
    fastest = 1j * made.radius / 1.05
    X = (fastest + made.shift) / made.radius
    before, here, largest = 1.0, X, 0.0
    for factor in c[1:]:
        largest = max(largest, abs(factor * here))
        before, here = here, 2 * X * here + before
    assert largest * 1e-16 <= 1e-7
