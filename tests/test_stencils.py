"""Staggered differences and interpolation: weights, order of accuracy, effect on a plane wave."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from wavesim.grid.bar import Bar
from wavesim.grid.stencils import (
    ORDERS,
    difference_norm,
    difference_weights,
    interpolation_weights,
    modified_wavenumber,
)


def slope(x, y) -> float:
    """Exponent n of y ∝ xⁿ, least squares on the logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def difference(u, h, order, forward):
    """D u from the nodes of a ring of the program to its half-nodes, or −N⁻¹ DᵀH u back."""
    made = Bar(u.shape[-1], h, order).differences
    rows = np.arange(u.shape[-1])
    D = np.zeros((len(rows), len(rows)))
    for offset, diagonal in enumerate(made.diagonals, start=made.first):
        D[rows, (rows + offset) % len(rows)] += diagonal
    back = -(D.T * made.half_norm) / made.node_norm[:, None]
    return u @ (D if forward else back).T


@pytest.mark.parametrize("order", ORDERS)
def test_weights_solve_the_taylor_conditions(order):
    """Σ_j 2 c_j (j−½)^(2p−1) = δ_p1, p = 1…m: a Vandermonde system, solved in rationals."""
    m = order // 2
    points = [sp.Rational(2 * j - 1, 2) for j in range(1, m + 1)]
    conditions = sp.Matrix(m, m, lambda p, j: 2 * points[j] ** (2 * p + 1))
    exact = conditions.solve(sp.Matrix([1] + [0] * (m - 1)))
    made = difference_weights(order)
    assert len(made) == m
    for weight, fraction in zip(made, exact, strict=True):
        assert weight == pytest.approx(float(fraction), rel=4e-16)


@pytest.mark.parametrize("order", ORDERS)
def test_difference_has_its_declared_order(order):
    """Error of D sin at 20 to 33 points per wavelength falls as h^order, within ±0.1.

    In 40 digits, since at order 12 the error is 4e-12 to 9e-15; below that the weights' own
    rounding shows, above it the next term of the series. Measured: 1.998 … 11.958. The leading
    term, of which 1 − k̃/k is made, is [(2m−1)!!]² / (4^m (2m+1)!) (kh)^2m, met within 3 %.
    """
    m = order // 2
    counts = [20, 24, 28, 33]
    spacings, errors = [], []
    with mpmath.workdps(40):
        x = mpmath.mpf("0.4")
        for count in counts:
            h = 2 * mpmath.pi / count
            total = mpmath.mpf(0)
            for j, weight in enumerate(difference_weights(order), start=1):
                shift = (j - mpmath.mpf(1) / 2) * h
                total += mpmath.mpf(weight) * (mpmath.sin(x + shift) - mpmath.sin(x - shift))
            errors.append(float(abs(total / h - mpmath.cos(x)) / mpmath.cos(x)))
            spacings.append(float(h))
    assert slope(spacings, errors) == pytest.approx(order, abs=0.1)
    odd = math.prod(range(2 * m - 1, 0, -2))
    leading = odd**2 / (4**m * math.factorial(2 * m + 1)) * spacings[-1] ** order
    assert errors[-1] == pytest.approx(leading, rel=0.03)


@pytest.mark.parametrize("order", [2, 4, 6, 8])
def test_order_on_the_grid_of_the_program(order):
    """The difference as a bar has it, in float64, on u = exp(sin x), both ways.

    64 to 128 cells a period: errors 8e-4 to 6e-12, far above rounding (1e-14). Measured slopes
    1.999, 3.995, 5.98, 7.96, either way. Above order 8 rounding comes before the asymptotic
    range.
    """
    for forward in (True, False):
        spacings, errors = [], []
        for cells in (64, 80, 96, 128):
            h = 2 * np.pi / cells
            x = np.arange(cells) * h + (0 if forward else h / 2)
            y = x + (h / 2 if forward else -h / 2)
            made = difference(np.exp(np.sin(x)), h, order, forward)
            errors.append(np.sqrt(np.mean((made - np.cos(y) * np.exp(np.sin(y))) ** 2)))
            spacings.append(h)
        assert slope(spacings, errors) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("forward", [True, False])
def test_modified_wavenumber_is_what_the_difference_does_to_a_plane_wave(order, forward):
    """D exp(ikx) = i k̃ exp(ik(x ± h/2)) for every wavenumber of the grid, 0 to Nyquist.

    To 1e-13 of the largest k̃: phases kx up to 200 rad round to 4e-14; measured 3e-14.
    """
    cells, h = 64, 0.37
    index = np.arange(cells // 2 + 1)
    k = 2 * np.pi * index / (cells * h)
    x = h * np.arange(cells) + (0 if forward else h / 2)
    y = x + (h / 2 if forward else -h / 2)
    wave = np.exp(1j * np.multiply.outer(k, x))
    made = difference(wave, h, order, forward)
    expected = 1j * modified_wavenumber(k, h, order)[:, None] * np.exp(1j * np.multiply.outer(k, y))
    size = difference_norm(h, order)
    np.testing.assert_allclose(made, expected, rtol=0, atol=1e-13 * size)


@pytest.mark.parametrize("order", ORDERS)
def test_modified_wavenumber_rises_up_to_nyquist(order):
    """No fold: k̃ rises over the whole band, so a staggered grid holds no backward wave, never
    exceeds k, and its largest value stands at Nyquist."""
    h = 0.8
    k = np.linspace(0, np.pi / h, 4001)
    kt = modified_wavenumber(k, h, order)
    assert np.all(np.diff(kt) > 0)
    assert np.all(kt <= k * (1 + 1e-15))
    assert kt[-1] == pytest.approx(difference_norm(h, order), rel=1e-14)
    assert np.all(modified_wavenumber(-k, h, order) == -kt)


@pytest.mark.parametrize(
    ("order", "expected"),
    [(4, ("9.2", "16.4", "52.0")), (8, ("4.6", "6.3", "11.3")), (12, ("3.7", "4.6", "6.9"))],
)
def test_points_per_wavelength(order, expected):
    """2π/kh at which the phase error 1 − k̃/k is 1e-3, 1e-4, 1e-6; the figures a user chooses an
    order by. To the digits given."""

    def error(kh: float, wanted: float) -> float:
        return 1 - float(modified_wavenumber(kh, 1.0, order)) / kh - wanted

    made = [2 * np.pi / brentq(error, 0.05, np.pi, args=(e,)) for e in (1e-3, 1e-4, 1e-6)]
    assert tuple(f"{points:.1f}" for points in made) == expected


@pytest.mark.parametrize("order", [0, 1, 3, 14, -2])
def test_an_order_that_is_not_offered(order):
    with pytest.raises(ValueError, match=rf"order = {order}: must be one of 2, 4, 6, 8, 10, 12"):
        difference_weights(order)


@pytest.mark.parametrize("width", [2, 4, 6, 8, 10, 12])
@settings(max_examples=25, deadline=None, derandomize=True)
@given(offset=st.floats(0.02, 0.98), seed=st.integers(0, 2**32 - 1))
def test_interpolation_is_exact_for_polynomials(width, offset, seed):
    """Degree width − 1 and no less, at any position; rounding of the sum alone, 1e-13 of the
    polynomial's largest value in reach (measured 4e-15)."""
    first, h = -0.3, 0.25
    position = first + (7 + offset) * h
    weights, indices = interpolation_weights(position, first, h, width)
    assert len(weights) == len(indices) == width
    # The nearest points: as many on either side.
    assert list(indices) == list(range(8 - width // 2, 8 + width // 2))
    polynomial = np.polynomial.Polynomial(np.random.default_rng(seed).uniform(-1, 1, width))
    values = polynomial(indices - 7.5)
    expected = polynomial(offset - 0.5)
    assert weights @ values == pytest.approx(expected, abs=1e-13 * np.abs(values).max())
    # One degree higher is missed, by ∏(x − x_i) exactly: the order is not more than declared.
    monomial = (indices - 7.5) ** width
    missed = weights @ monomial - (offset - 0.5) ** width
    product = np.prod(offset + 7.0 - indices)
    assert missed == pytest.approx(-product, abs=1e-12 * np.abs(monomial).max())


@pytest.mark.parametrize("width", [2, 4, 6, 8, 10, 12])
def test_interpolation_has_its_declared_order(width):
    """Error of the interpolated sine falls as h^width, within ±0.1.

    The point lies 0.3 of a cell past a grid point at each resolution, 20 to 40 points per
    wavelength. In 30 digits for the sine; at order 12 the errors are 5e-11 to 1e-14. Measured
    within 0.05 of the order.
    """
    spacings, errors = [], []
    with mpmath.workdps(30):
        for count in (20, 24, 30, 40):
            h = 2 * math.pi / count
            position = 0.3 * h
            weights, indices = interpolation_weights(position, 0.0, h, width)
            # The sine's phase puts its maximum there, where the error's leading term is largest.
            value = sum(
                mpmath.mpf(float(w)) * mpmath.cos((mpmath.mpf(int(i)) - mpmath.mpf("0.3")) * h)
                for w, i in zip(weights, indices, strict=True)
            )
            errors.append(float(abs(value - 1)))
            spacings.append(h)
    assert slope(spacings, errors) == pytest.approx(width, abs=0.1)


def test_interpolation_on_a_grid_point_is_that_point():
    """Also where the position is a grid point but for rounding, as 0.1 + 0.2 is 0.3."""
    weights, indices = interpolation_weights(0.1 + 0.2, 0.0, 0.1, 8)
    assert (list(weights), list(indices)) == ([1.0], [3])
    weights, indices = interpolation_weights(-0.05, 0.05, 0.1, 4)
    assert (list(weights), list(indices)) == ([1.0], [-1])
