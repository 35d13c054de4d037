"""The tensors of Appendix B by three routes: symbolic integrals, the printed page, Gauss sums.

Law: J, M ∝ ⟨G_ik n_j n_l⟩ and N ∝ ⟨G_il n_j n_k n_m n_n⟩ under ξ(n) (Eqs. 15, 18, 19, 23–25).
"""

from __future__ import annotations

import itertools
from collections import Counter
from functools import cache

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from wavesim.material.contact_tensors import (
    average_stiffness,
    direction_moments,
    fabric_moments,
    gradient_stiffness,
    relative_stiffness,
)
from wavesim.material.medium import Medium

a, Gn, Gs = sp.symbols("a G_n G_s")
F = sp.diag(a, -a / 2, -a / 2)

# Components as docs/physics.md section 2 prints them. In the shorthand of Appendix B:
p1, p2 = (Gn + 6 * Gs) / 105, (Gn - Gs) / 105
w1, w2 = (Gn + 8 * Gs) / 945, (Gn - Gs) / 945

# M_ijkl / (l²N_p); with G^a in place of G^r they are J's.
PRINTED_M = {
    "1111": (5 + 2 * a) * p1 + (16 + 10 * a) * p2,
    "1122": (7 + a) * p2,
    "1133": (7 + a) * p2,
    "2222": (5 - a) * p1 + (16 - 5 * a) * p2,
    "3333": (5 - a) * p1 + (16 - 5 * a) * p2,
    "2121": (5 + 2 * a) * p1 + (2 - a) * p2,
    "3131": (5 + 2 * a) * p1 + (2 - a) * p2,
    "1212": (5 - a) * p1 + (2 + 2 * a) * p2,
    "1313": (5 - a) * p1 + (2 + 2 * a) * p2,
    "1221": (7 + a) * p2,
    "1331": (7 + a) * p2,
    "2323": (5 - a) * p1 + (2 - a) * p2,
    "3232": (5 - a) * p1 + (2 - a) * p2,
    "2332": (7 - 2 * a) * p2,
    "2233": (7 - 2 * a) * p2,
}
# N_ij1lm1 / (l⁴N_p/4), key (ij, lm).
PRINTED_N = {
    ("11", "11"): (21 + 12 * a) * w1 + (114 + 78 * a) * w2,
    ("11", "22"): (27 + 9 * a) * w2,
    ("11", "33"): (27 + 9 * a) * w2,
    ("22", "22"): (7 + a) * w1 + (20 - a) * w2,
    ("33", "33"): (7 + a) * w1 + (20 - a) * w2,
    ("22", "33"): 9 * w2,
    ("12", "12"): (7 + a) * w1 + (20 + 8 * a) * w2,
    ("13", "13"): (7 + a) * w1 + (20 + 8 * a) * w2,
    ("12", "21"): (27 + 9 * a) * w2,
    ("13", "31"): (27 + 9 * a) * w2,
    ("21", "21"): (21 + 12 * a) * w1 + (6 - 3 * a) * w2,
    ("31", "31"): (21 + 12 * a) * w1 + (6 - 3 * a) * w2,
    ("23", "23"): (7 + a) * w1 + (2 - a) * w2,
    ("32", "32"): (7 + a) * w1 + (2 - a) * w2,
    ("23", "32"): 9 * w2,
}
PAIRS = [i + j for i in "123" for j in "123"]


def printed_M(pair: str, other: str) -> sp.Expr:
    """Component (ij | kl), zero where the page lists neither it nor its mirror image."""
    return PRINTED_M.get(pair + other, PRINTED_M.get(other + pair, sp.Integer(0)))


def printed_N(pair: str, other: str) -> sp.Expr:
    return PRINTED_N.get((pair, other), PRINTED_N.get((other, pair), sp.Integer(0)))


@cache
def sphere_average(powers: tuple[int, int, int]) -> sp.Expr:
    """∫ n₁^α n₂^β n₃^γ dΩ / 4π, integrated: n = (c, s cos φ, s sin φ), s² = 1 − c², dΩ = dc dφ.

    Over φ by residues: with z = e^{iφ} the mean is the constant term in z. It vanishes unless β + γ
    is even, and then s^(β+γ) is a polynomial in c.
    """
    alpha, beta, gamma = powers
    z, c = sp.symbols("z c")
    circle = sp.expand(((z + 1 / z) / 2) ** beta * ((z - 1 / z) / (2 * sp.I)) ** gamma)
    mean = circle.coeff(z, 0)
    if mean == 0:
        return sp.Integer(0)
    assert (beta + gamma) % 2 == 0
    along = sp.integrate(sp.expand(c**alpha * (1 - c**2) ** ((beta + gamma) // 2)), (c, -1, 1))
    return sp.nsimplify(mean * along / 2)


@cache
def fabric_average(counts: tuple[int, int, int]) -> sp.Expr:
    """⟨n₁^α n₂^β n₃^γ⟩ under ξ(n) = (δ_pq + F_pq) n_p n_q / 4π (F is diagonal)."""
    terms = []
    for p in range(3):
        powers = list(counts)
        powers[p] += 2
        terms.append((1 + F[p, p]) * sphere_average(tuple(powers)))
    return sp.expand(sum(terms))


def average(*indices: int) -> sp.Expr:
    count = Counter(indices)
    return fabric_average((count[0], count[1], count[2]))


def stiffness_average(i: int, k: int, *normals: int) -> sp.Expr:
    """⟨G_ik n n …⟩, G = (G_n − G_s) n⊗n + G_s I."""
    aligned = (Gn - Gs) * average(i, k, *normals)
    return sp.expand(aligned + (Gs * average(*normals) if i == k else 0))


def test_the_fabric_is_a_probability_density():
    assert fabric_average((0, 0, 0)) == 1
    assert sp.expand(fabric_average((2, 0, 0)) - (sp.Rational(1, 3) + 2 * a / 15)) == 0


def test_printed_relative_components_are_the_integrals():
    """All 81 components symbolically: the listed ones, and no others, are not zero."""
    for pair, other in itertools.product(PAIRS, PAIRS):
        i, j, k, ell = (int(s) - 1 for s in pair + other)
        derived = stiffness_average(i, k, j, ell)
        assert sp.expand(derived - printed_M(pair, other)) == 0, (pair, other)


def test_printed_gradient_components_are_the_integrals():
    """All 81 components N_ij1lm1 symbolically."""
    for pair, other in itertools.product(PAIRS, PAIRS):
        i, j, ell, m = (int(s) - 1 for s in pair + other)
        derived = stiffness_average(i, ell, j, 0, m, 0)
        assert sp.expand(derived - printed_N(pair, other)) == 0, (pair, other)


anisotropies = st.floats(-1, 2)
ratios = st.floats(0, 3)
moduli = st.floats(0.1, 50)
lengths = st.floats(1e-4, 1e-2)
densities = st.floats(1e7, 1e11)
some_media = st.builds(
    Medium,
    anisotropy=anisotropies,
    stiffness_ratio=ratios,
    branch_length=lengths,
    contact_density=densities,
    G_n_a=moduli,
    G_n_r=moduli,
    G_n_g=moduli,
)


@pytest.fixture(scope="module")
def components():
    """The printed components as functions of (a, G_n, G_s), both (9, 9)."""
    M = sp.Matrix(9, 9, lambda r, c: printed_M(PAIRS[r], PAIRS[c]))
    N = sp.Matrix(9, 9, lambda r, c: printed_N(PAIRS[r], PAIRS[c]))
    return sp.lambdify((a, Gn, Gs), M), sp.lambdify((a, Gn, Gs), N)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(medium=some_media)
def test_program_has_the_printed_components(components, medium):
    """Each entry to 1e-13 of the largest; measured 5e-16."""
    M_of, N_of = components
    eta = medium.stiffness_ratio
    scale = medium.branch_length**2 * medium.contact_density
    for made, modulus in ((average_stiffness, medium.G_n_a), (relative_stiffness, medium.G_n_r)):
        expected = scale * M_of(medium.anisotropy, modulus, eta * modulus)
        size = np.abs(expected).max()
        np.testing.assert_allclose(made(medium).reshape(9, 9), expected, rtol=0, atol=1e-13 * size)
    expected = (
        medium.branch_length**2
        * scale
        / 4
        * N_of(medium.anisotropy, medium.G_n_g, eta * medium.G_n_g)
    )
    made = gradient_stiffness(medium)[:, :, 0, :, :, 0].reshape(9, 9)
    np.testing.assert_allclose(made, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


def gauss_sphere(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions (n, 3) and weights of sum 1, exact for polynomials of this degree."""
    c, weight = np.polynomial.legendre.leggauss(degree // 2 + 1)
    angle = 2 * np.pi * np.arange(degree + 1) / (degree + 1)
    s = np.sqrt(1 - c**2)
    n = np.stack(
        [
            np.broadcast_to(c[:, None], (len(c), len(angle))),
            np.multiply.outer(s, np.cos(angle)),
            np.multiply.outer(s, np.sin(angle)),
        ],
        axis=-1,
    )
    return n.reshape(-1, 3), np.repeat(weight / 2 / len(angle), len(angle))


@settings(max_examples=30, deadline=None, derandomize=True)
@given(medium=some_media)
def test_all_components_are_the_gauss_sum_over_directions(medium):
    """All 81 of J and M and all 729 of N, to 1e-13 of the largest; measured 3e-15."""
    n, weight = gauss_sphere(10)
    density = weight * (1 + medium.anisotropy * (n**2 @ np.array([1.0, -0.5, -0.5])))
    eta = medium.stiffness_ratio
    per_volume = medium.branch_length**2 * medium.contact_density
    G = (1 - eta) * n[:, :, None] * n[:, None, :] + eta * np.eye(3)
    four = per_volume * np.einsum("x,xik,xj,xl->ijkl", density, G, n, n)
    six = np.einsum("x,xil,xj,xk,xm,xn->ijklmn", density, G, n, n, n, n, optimize=True)
    six *= medium.branch_length**2 * per_volume / 4
    for made, expected in (
        (average_stiffness(medium), medium.G_n_a * four),
        (relative_stiffness(medium), medium.G_n_r * four),
        (gradient_stiffness(medium), medium.G_n_g * six),
    ):
        np.testing.assert_allclose(made, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("order", [2, 4, 6, 8])
def test_direction_moments_are_the_integrals(order):
    made = direction_moments(order)
    for powers in itertools.product(range(order + 1), repeat=3):
        if sum(powers) == order:
            index = (0,) * powers[0] + (1,) * powers[1] + (2,) * powers[2]
            assert made[index] == pytest.approx(float(sphere_average(powers)), abs=1e-16)
            assert made[index[::-1]] == made[index]


def test_fabric_moments_are_the_integrals():
    for index in [(0, 0), (1, 1), (0, 0, 0, 0), (0, 0, 1, 1), (1, 1, 2, 2), (2, 2, 2, 2)]:
        expected = float(average(*index).subs(a, 0.75))
        assert fabric_moments(0.75, len(index))[index] == pytest.approx(expected, abs=1e-16)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(medium=some_media)
def test_major_symmetry(medium):
    """An energy exists: J_ijkl = J_klij, M likewise, N_ijklmn = N_lmnijk; measured 0."""
    for tensor in (average_stiffness(medium), relative_stiffness(medium)):
        np.testing.assert_allclose(
            tensor, tensor.transpose(2, 3, 0, 1), rtol=0, atol=1e-15 * np.abs(tensor).max()
        )
    N = gradient_stiffness(medium)
    np.testing.assert_allclose(
        N, N.transpose(3, 4, 5, 0, 1, 2), rtol=0, atol=1e-15 * np.abs(N).max()
    )


@settings(max_examples=30, deadline=None, derandomize=True)
@given(medium=some_media, angle=st.floats(0, 2 * np.pi))
def test_transversal_isotropy(medium, angle):
    """A rotation about x₁ leaves every tensor as it is, to 1e-13 of the largest; measured 4e-16."""
    c, s = np.cos(angle), np.sin(angle)
    Q = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    for tensor in (average_stiffness(medium), relative_stiffness(medium)):
        turned = np.einsum("ai,bj,ck,dl,ijkl->abcd", Q, Q, Q, Q, tensor, optimize=True)
        np.testing.assert_allclose(turned, tensor, rtol=0, atol=1e-13 * np.abs(tensor).max())
    N = gradient_stiffness(medium)
    turned = np.einsum("ai,bj,ck,dl,em,fn,ijklmn->abcdef", Q, Q, Q, Q, Q, Q, N, optimize=True)
    np.testing.assert_allclose(turned, N, rtol=0, atol=1e-13 * np.abs(N).max())


def test_the_axis_is_distinguished_where_the_fabric_is():
    """The counterpart: a rotation about x₃ does change the tensors for a ≠ 0, and not for a = 0."""
    Q = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for anisotropy, isotropic in ((0.0, True), (0.5, False)):
        M = relative_stiffness(Medium(anisotropy=anisotropy))
        turned = np.einsum("ai,bj,ck,dl,ijkl->abcd", Q, Q, Q, Q, M, optimize=True)
        assert np.allclose(turned, M, rtol=0, atol=1e-13 * np.abs(M).max()) is isotropic


@settings(max_examples=60, deadline=None, derandomize=True)
@given(medium=some_media)
def test_deformation_costs_energy(medium):
    """ξ ≥ 0 and G positive semi-definite make J, M, N positive semi-definite, to 1e-14 of the
    largest eigenvalue (rounding; the smallest is 0 at the ends of the admissible ranges)."""
    for tensor in (
        average_stiffness(medium).reshape(9, 9),
        relative_stiffness(medium).reshape(9, 9),
        gradient_stiffness(medium).reshape(27, 27),
    ):
        values = np.linalg.eigvalsh(tensor)
        assert values[0] >= -1e-14 * values[-1]
