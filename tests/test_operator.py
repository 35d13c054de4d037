"""The semi-discrete operator: symmetry, its symbol, its spectral bound, its energy, reciprocity."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jax.flatten_util import ravel_pytree

from wavesim.grid.bar import Bar
from wavesim.grid.stencils import ORDERS, difference_weights, modified_wavenumber
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.material.sectors import BLOCKS
from wavesim.material.wave_equations import CURVATURES, FIELDS, ROTATIONS, flux_form
from wavesim.planewave.dispersion_relation import block_frequencies
from wavesim.sources import Ricker
from wavesim.timedomain.integration import simulate
from wavesim.timedomain.operator import (
    difference,
    from_fields,
    inner,
    is_rotation,
    semi_discrete,
    to_fields,
)
from wavesim.timedomain.timestep import spectral_bound

ratios = st.floats(0, 2)
moduli = st.floats(0.5, 20)
parameters = {
    "branch_length": st.floats(5e-4, 2e-3),
    "particle_radius": st.floats(2e-4, 1e-3),
    "contact_density": st.floats(1e8, 1e10),
    "density": st.floats(500, 5e3),
    "G_n_a": moduli,
    "G_n_r": moduli,
    # From nothing to where the gradient term is as large as the rest.
    "G_n_g": st.sampled_from([0.0, 1.25e-11, 1.0, 10.0]),
}
consistent_media = st.builds(
    Medium,
    anisotropy=st.floats(-1, 2),
    stiffness_ratio=ratios,
    closure=st.just("consistent"),
    **parameters,
)
# "printed" has real frequencies in this range, not everywhere.
printed_media = st.builds(
    Medium,
    anisotropy=st.floats(0, 1),
    stiffness_ratio=st.floats(0, 1),
    closure=st.just("printed"),
    **parameters,
)


def dense(operator) -> np.ndarray:
    """L as a matrix over the flattened state, by its action on each unit state."""
    flat, unravel = ravel_pytree(operator.zero())
    columns = jax.vmap(lambda e: ravel_pytree(operator(unravel(e)))[0])(jnp.eye(flat.size))
    return np.asarray(columns).T


@pytest.mark.parametrize("order", ORDERS)
def test_the_two_differences_are_adjoint(order):
    """From half-nodes to nodes stands −Dᵀ of D from nodes to half-nodes, to the last bit."""
    weights = tuple(c / 0.3 for c in difference_weights(order))
    unit = jnp.eye(max(16, 2 * order))
    forward = np.asarray(difference(unit, weights, forward=True)).T
    backward = np.asarray(difference(unit, weights, forward=False)).T
    np.testing.assert_array_equal(backward, -forward.T)
    assert np.count_nonzero(forward) == forward.shape[0] * order
    np.testing.assert_allclose(forward.sum(axis=1), 0, atol=1e-15 * np.abs(forward).max())


@settings(max_examples=15, deadline=None, derandomize=True)
@given(medium=consistent_media, cell=st.floats(0.1, 2))
def test_operator_is_symmetric(medium, cell):
    """Law: a deformation energy exists, so L = Lᵀ. 12 fields × 16 cells of order 8, as a dense
    matrix, any admissible medium: to 1e-14 of the largest entry; measured 2e-16 (c_bp and c_pb are
    scaled by different products of the same numbers). No eigenvalue is above 0, to rounding."""
    bar = Bar(16, cell * medium.branch_length, 8)
    L = dense(semi_discrete(medium, bar))
    size = np.abs(L).max()
    assert L.shape == (192, 192)
    assert np.abs(L - L.T).max() <= 1e-14 * size
    assert np.linalg.eigvalsh((L + L.T) / 2)[-1] <= 1e-13 * size


def test_operator_is_not_symmetric_in_the_printed_closure():
    """The counterpart: the printed equations have no such energy where a ≠ 0; they do at a = 0."""
    bar = Bar(16, 2.5e-4, 8)
    for anisotropy, symmetric in ((0.5, False), (0.0, True)):
        L = dense(semi_discrete(Medium(anisotropy=anisotropy, closure="printed"), bar))
        assert bool(np.abs(L - L.T).max() <= 1e-14 * np.abs(L).max()) is symmetric


def plane_wave_matrix(medium: Medium, k: float) -> np.ndarray:
    """d²/dt² of (φ, B) exp(ikx) in SI, (12, 12), from Eqs. (26)–(37) in flux form."""
    form = flux_form(medium)
    A = np.zeros((12, 12), dtype=complex)
    A[:3, :3] = -(k**2) * form.C_phi_phi / form.m_phi
    A[:3, 3:] = -1j * k * form.C_phi_B / form.m_phi
    A[3:, :3] = 1j * k * form.C_B_phi / form.m_B
    A[3:, 3:] = (-form.C_B_B - k**2 * form.Gamma) / form.m_B
    return A


@pytest.mark.parametrize("closure", ["printed", "consistent"])
@pytest.mark.parametrize("order", [2, 8, 12])
def test_symbol_is_the_plane_wave_matrix_at_the_modified_wavenumber(closure, order, rng):
    """Law: on a uniform grid L acts on exp(ikx) as the plane-wave problem does at k̃(k).

    All twelve fields in SI through from_fields, L, to_fields, for each wavenumber of a bar of 48
    cells of l/4, 0 to Nyquist, with the gradient term made visible. Each field to 1e-12 of its
    largest rate over all wavenumbers; measured 3e-14 (phases of up to 150 rad).
    """
    medium = Medium(anisotropy=0.6, closure=closure, G_n_g=1.0)
    bar = Bar(48, 2.5e-4, order)
    operator = semi_discrete(medium, bar)
    unit = scales(medium)
    amplitude = rng.uniform(-1, 1, 12) + 1j * rng.uniform(-1, 1, 12)
    amplitude *= [unit.unit(name) for name in FIELDS]

    apply = jax.jit(lambda q: operator(q))
    made, expected = [], []
    for k in bar.wavenumbers:
        wave = {
            name: a * np.exp(1j * k * (bar.nodes if name in ROTATIONS else bar.half_nodes))
            for name, a in zip(FIELDS, amplitude, strict=True)
        }
        rates = []
        for part in (np.real, np.imag):
            q = from_fields({name: part(w) for name, w in wave.items()}, BLOCKS, medium)
            rates.append(to_fields(jax.tree.map(np.asarray, apply(q)), BLOCKS, medium))
        made.append([(rates[0][n] + 1j * rates[1][n]) / unit.time**2 for n in FIELDS])
        A = plane_wave_matrix(medium, float(modified_wavenumber(k, bar.spacing, order)))
        expected.append(
            [c * wave[n] / a for n, c, a in zip(FIELDS, A @ amplitude, amplitude, strict=True)]
        )
    made, expected = np.array(made), np.array(expected)
    size = np.abs(expected).max(axis=(0, 2), keepdims=True)
    np.testing.assert_allclose(made / size, expected / size, rtol=0, atol=1e-12)


@pytest.mark.parametrize("closure", ["printed", "consistent"])
def test_spectrum_is_that_of_the_spectral_solver(closure):
    """All 12 × 32 eigenvalues of the dense −L are ω²(k̃) of the plane-wave solver.

    To 1e-12 of the largest; measured 6e-15.
    """
    medium = Medium(anisotropy=0.5, closure=closure)
    bar = Bar(32, 2.5e-4, 8)
    made = np.sort(np.linalg.eigvals(-dense(semi_discrete(medium, bar))).real)
    k = 2 * np.pi * np.fft.fftfreq(bar.cells, bar.spacing)
    kt = np.abs(modified_wavenumber(k, bar.spacing, bar.order))
    squares = [
        (block_frequencies(medium, block, kt) * medium.time_scale).ravel() ** 2 for block in BLOCKS
    ]
    expected = np.sort(np.concatenate(squares))
    np.testing.assert_allclose(made, expected, rtol=0, atol=1e-12 * expected[-1])


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    medium=consistent_media | printed_media,
    cell=st.floats(0.05, 3),
    order=st.sampled_from([2, 8]),
    cells=st.sampled_from([16, 17]),
)
def test_spectral_bound(medium, cell, order, cells):
    """Λ bounds the spectrum of −L and is within a few % of its end.

    1 % is added to the eigenvalue at the largest k̃, which a grid of an even number of cells
    holds; 17 cells have kh up to 16π/17 and so fall short of it, by up to 1 − sin²(8π/17) =
    0.9 % at order 2. Measured Λ/max: 1.0100 for 16 cells and 1.0106 to 1.0187 for 17.
    """
    bar = Bar(cells, cell * medium.branch_length, order)
    L = dense(semi_discrete(medium, bar))
    fastest = np.abs(np.linalg.eigvals(-L)).max()
    bound = spectral_bound(medium, bar, BLOCKS)
    assert bound > fastest * (1 + 1e-3)
    assert bound < fastest * (1.011 if cells == 16 else 1.03)


def test_spectral_bound_of_some_blocks_alone():
    """Blocks that are not integrated do not count: in-plane fields alone are far slower."""
    medium = Medium(anisotropy=0.2)
    bar = Bar(32, 1e-4, 8)
    for block in BLOCKS:
        L = dense(semi_discrete(medium, bar, (block,)))
        fastest = np.abs(np.linalg.eigvals(-L)).max()
        assert spectral_bound(medium, bar, (block,)) == pytest.approx(1.01 * fastest, rel=1e-10)


# Fields and states


def test_state_and_fields_round_trip(rng):
    """to_fields(from_fields(·)) is the identity, to rounding; so is the other way round."""
    medium = Medium(anisotropy=0.3)
    fields = {name: rng.normal(size=40) for name in FIELDS}
    back = to_fields(from_fields(fields, BLOCKS, medium), BLOCKS, medium)
    assert set(back) == set(FIELDS)
    for name in FIELDS:
        np.testing.assert_allclose(back[name], fields[name], rtol=0, atol=1e-14)
    operator = semi_discrete(medium, Bar(40, 1e-4))
    state = jax.tree.map(lambda c: jnp.asarray(rng.normal(size=c.shape)), operator.zero())
    again = from_fields(to_fields(state, BLOCKS, medium), BLOCKS, medium)
    for one, other in zip(jax.tree.leaves(again), jax.tree.leaves(state), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-14)


def test_fields_that_are_not_named_are_at_rest(rng):
    medium = Medium()
    blocks = BLOCKS[:1]
    q = from_fields({"B22": rng.normal(size=24)}, blocks, medium)
    fields = to_fields(q, blocks, medium)
    assert list(fields) == ["phi1", "B11", "B22", "B33"]
    assert not np.any(fields["phi1"])
    assert not np.any(fields["B11"])
    # B22 alone is half B22 + B33 and half B22 − B33, and only the first is in this block.
    np.testing.assert_array_equal(fields["B22"], fields["B33"])


def test_stacks_of_states_convert_like_single_ones(rng):
    medium = Medium()
    operator = semi_discrete(medium, Bar(24, 1e-4))
    stack = jax.tree.map(lambda c: rng.normal(size=(3, *c.shape)), operator.zero())
    whole = to_fields(stack, BLOCKS, medium)
    for frame in range(3):
        single = to_fields(jax.tree.map(lambda c, f=frame: c[f], stack), BLOCKS, medium)
        for name in FIELDS:
            np.testing.assert_array_equal(whole[name][frame], single[name])


def test_rotations_live_on_the_nodes():
    assert [is_rotation(name) for name in FIELDS] == [True] * 3 + [False] * 9


@settings(max_examples=10, deadline=None, derandomize=True)
@given(medium=consistent_media | printed_media, seed=st.integers(0, 2**32 - 1))
def test_kinetic_energy(medium, seed):
    """½∫ ρβφ̇² + ργḂ² dx per area, by a sum over the grid in SI; to 1e-13, measured 4e-16."""
    rng = np.random.default_rng(seed)
    bar = Bar(24, 0.2 * medium.branch_length)
    operator = semi_discrete(medium, bar)
    unit = scales(medium)
    rates = {name: unit.unit(name) / unit.time * rng.normal(size=24) for name in FIELDS}
    v = from_fields({name: r * unit.time for name, r in rates.items()}, BLOCKS, medium)
    beta, gamma = 0.4 * medium.particle_radius**2, 12 / 35 * medium.particle_radius**4
    expected = (
        0.5
        * medium.density
        * bar.spacing
        * (
            beta * sum((rates[n] ** 2).sum() for n in ROTATIONS)
            + gamma * sum((rates[n] ** 2).sum() for n in CURVATURES)
        )
    )
    assert float(operator.kinetic(v)) * unit.energy == pytest.approx(expected, rel=1e-13)


def contact_energy(medium: Medium, length: float, kappa, B, slope) -> float:
    """Deformation energy per area, from the contacts themselves.

    ½ N_p ∫∫ ξ(n) [l²(κn)·G^a(κn) + l²(Dn)·G^r(Dn) + l⁴/4 (∇B:nn)·G^g(∇B:nn)] dΩ dx with
    D = κ − B and ∇B along x₁: no tensor is formed. A Gauss sum over the sphere, exact for the
    polynomials in n that stand here, and the mean over even points, exact for the few harmonics.

    Args:
        kappa, B, slope: κ_ij, B_ij, ∂ₓB_ij at even points of the bar, shape (points, 3, 3), SI.
    """
    c, weight = np.polynomial.legendre.leggauss(8)
    angle = 2 * np.pi * np.arange(12) / 12
    s = np.sqrt(1 - c**2)
    n = np.stack(
        [
            np.repeat(c, 12),
            np.multiply.outer(s, np.cos(angle)).ravel(),
            np.multiply.outer(s, np.sin(angle)).ravel(),
        ],
        axis=1,
    )
    a, eta, el = medium.anisotropy, medium.stiffness_ratio, medium.branch_length
    xi = np.repeat(weight / 24, 12) * (1 + a * (n[:, 0] ** 2 - (n[:, 1] ** 2 + n[:, 2] ** 2) / 2))

    def stored(vector, modulus):
        """∫ ξ u·G u, u of shape (points, directions, 3): the part along n and the rest."""
        along = np.einsum("xdi,di->xd", vector, n) ** 2
        rest = (vector**2).sum(axis=-1) - along
        return modulus * ((along + eta * rest) @ xi)

    total = stored(el * np.einsum("xij,dj->xdi", kappa, n), medium.G_n_a)
    total += stored(el * np.einsum("xij,dj->xdi", kappa - B, n), medium.G_n_r)
    bend = el**2 / 2 * np.einsum("xij,dj,d->xdi", slope, n, n[:, 0])
    total += stored(bend, medium.G_n_g)
    return 0.5 * medium.contact_density * total.mean() * length


@settings(max_examples=10, deadline=None, derandomize=True)
@given(medium=consistent_media, seed=st.integers(0, 2**32 - 1))
def test_potential_energy_is_what_the_contacts_store(medium, seed):
    """Law: −½⟨q, Lq⟩ is the deformation energy of the consistent closure.

    Fields of three harmonics with analytic derivatives on 128 cells of l/4 at order 12, 43 points
    to the shortest wavelength, where the differences err by 4e-16; the gradient term from nothing
    to as large as the rest. To 1e-12; measured 2e-15.
    """
    rng = np.random.default_rng(seed)
    bar = Bar(128, 0.25 * medium.branch_length, 12)
    operator = semi_discrete(medium, bar)
    unit = scales(medium)
    harmonics = 2 * np.pi * np.arange(4) / bar.length
    amounts = rng.normal(size=(12, 4)) * np.array([unit.unit(n) for n in FIELDS])[:, None]
    phases = rng.uniform(0, 2 * np.pi, size=(12, 4))

    def value(i, x, derivative=0):
        waves = np.exp(1j * (np.multiply.outer(x, harmonics) + phases[i]))
        return ((1j * harmonics) ** derivative * waves).real @ amounts[i]

    q = from_fields(
        {
            name: value(i, bar.nodes if name in ROTATIONS else bar.half_nodes)
            for i, name in enumerate(FIELDS)
        },
        BLOCKS,
        medium,
    )
    x = bar.length * np.arange(16) / 16
    kappa = np.zeros((16, 3, 3))
    kappa[:, :, 0] = np.stack([value(i, x, 1) for i in range(3)], axis=-1)
    B = np.stack([value(i, x) for i in range(3, 12)], axis=-1).reshape(-1, 3, 3)
    slope = np.stack([value(i, x, 1) for i in range(3, 12)], axis=-1).reshape(-1, 3, 3)
    expected = contact_energy(medium, bar.length, kappa, B, slope)
    assert expected > 0
    assert float(operator.potential(q)) * unit.energy == pytest.approx(expected, rel=1e-12)


def test_the_gradient_term_counts_in_that_energy(rng):
    """The counterpart: without G_n^g the same fields store less, so the term is really seen."""
    medium = Medium(closure="consistent", G_n_g=10.0)
    bar = Bar(32, 2.5e-4)
    q = from_fields({n: rng.normal(size=32) for n in CURVATURES}, BLOCKS, medium)
    energies = [
        float(semi_discrete(dataclasses.replace(medium, G_n_g=g), bar).potential(q))
        for g in (10.0, 0.0)
    ]
    assert energies[0] > 1.5 * energies[1]


def test_inner_product_is_over_every_entry(rng):
    operator = semi_discrete(Medium(), Bar(16, 1e-4))
    a, b = (
        jax.tree.map(lambda c: jnp.asarray(rng.normal(size=c.shape)), operator.zero())
        for _ in range(2)
    )
    flat = [np.concatenate([np.ravel(c) for c in jax.tree.leaves(s)]) for s in (a, b)]
    assert float(inner(a, b)) == pytest.approx(flat[0] @ flat[1], rel=1e-13)


# Reciprocity


def test_reciprocity():
    """Law: L = Lᵀ and a receiver is the transpose of a source, so that a unit moment on φ₁ here is
    felt in B₁₁ there as a unit double moment on B₁₁ there is felt in φ₁ here. Neither stands on a
    grid point. To 1e-10 of the signal's peak; measured 2e-14."""
    medium = Medium(anisotropy=0.7, closure="consistent")
    bar = Bar(64, 2.5e-4, 8)
    here, there = 3.03e-3, 7.77e-3
    pulse = {"peak_frequency": 500e3}
    one = simulate(medium, bar, [Ricker("phi1", here, **pulse)], 12e-6, samples=40)
    other = simulate(medium, bar, [Ricker("B11", there, **pulse)], 12e-6, samples=40)
    one, other = one.at(there, "B11"), other.at(here, "phi1")
    peak = np.abs(one).max()
    # Nothing before a wave can have come, a signal at last.
    assert 0 < np.abs(one[:4]).max() < 1e-15 * peak
    assert np.abs(one - other).max() <= 1e-10 * peak
