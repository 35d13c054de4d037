"""Closures at the ends of a stretch, and stretches joined: exactness, norms, spectra, errors."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stretches import dense, positions

from wavesim.grid.stencils import ORDERS, difference_norm, difference_weights
from wavesim.grid.summation_by_parts import chain, closure


@pytest.mark.parametrize("order", ORDERS)
def test_polynomials_to_degree_q_are_differentiated_exactly(order):
    """D x^k = k x^{k−1} and −H_n⁻¹(Qᵀx^k + end) = k x^{k−1}, k = 0…q, at every point of two ends.

    The stored numbers are summed in rationals, so that what is left is their own rounding: 1e-13
    of the largest term. Measured: 2e-15 (D), 4e-15 (adjoint). Both fail by 1e-2 at k = q + 1.
    """
    end = closure(order)
    q, n = end.degree, end.cells
    made = chain(order, (n,), (1.0,))
    d = [[Fraction(v) for v in row] for row in dense(made)]
    node, half = ([Fraction(v) for v in norm] for norm in (made.node_norm, made.half_norm))
    # From the middle, so that both ends are alike and powers stay of the same size.
    x = [Fraction(2 * i - n, n) for i in range(n + 1)]
    y = [Fraction(2 * j + 1 - n, n) for j in range(n)]
    scale = Fraction(n, 2)
    worst = []
    for k in range(q + 2):
        slope_x, slope_y = ([k * v ** (k - 1) if k else 0 for v in at] for at in (x, y))
        forward = [
            sum(w * v**k for w, v in zip(row, x, strict=True)) * scale - s
            for row, s in zip(d, slope_y, strict=True)
        ]
        adjoint = []
        for i in range(n + 1):
            total = sum(half[j] * d[j][i] * y[j] ** k for j in range(n))
            total += (i == 0) * x[0] ** k - (i == n) * x[n] ** k
            adjoint.append(-total / node[i] * scale - slope_x[i])
        worst.append(float(max(map(abs, forward + adjoint))))
    assert max(worst[: q + 1]) < 1e-13 * q * n
    assert worst[q + 1] > 1e-3


@pytest.mark.parametrize("order", ORDERS)
def test_a_chain_of_unlike_stretches_is_as_exact(order):
    """The same on three stretches of unlike h: nothing is lost where they meet.

    Tolerance 1e-12 of the slope, from cancellation among weights/h. Measured: up to 7e-14.
    """
    end = closure(order)
    cells, spacings = (end.cells, end.cells + 1, 2 * end.cells), (0.3, 1.0, 0.21)
    made = chain(order, cells, spacings)
    x, y = positions(cells, spacings)
    length = x[-1]
    d = dense(made)
    for k in range(end.degree + 1):
        slope_x, slope_y = (k * (at / length) ** max(k - 1, 0) for at in (x, y))
        assert d @ (x / length) ** k * length == pytest.approx(slope_y, abs=1e-12 * max(k, 1))
        total = d.T @ (made.half_norm * (y / length) ** k)
        total[0] += k == 0
        total[-1] -= 1
        assert -total / made.node_norm * length == pytest.approx(slope_x, abs=1e-12 * max(k, 1))


@pytest.mark.parametrize("order", ORDERS)
def test_norms_are_positive_and_integrate(order):
    """Σ H x^p = ∫x^p for p ≤ 2q − 1 (2q − 2 by parts, one more by symmetry), not for 2q.

    Tolerance 1e-13, rounding; measured 4e-16, and 3e-8 to 1e-2 at p = 2q. Norms are 0.34 or more.
    """
    end = closure(order)
    cells, spacings = (end.cells, end.cells + 3), (1.0, 0.7)
    made = chain(order, cells, spacings)
    for norm, points in zip(
        (made.node_norm, made.half_norm), positions(cells, spacings), strict=True
    ):
        assert norm.min() > 0.3 * 0.7
        s = points / sum(n * h for n, h in zip(cells, spacings, strict=True))
        length = points[0] / s[0] if s[0] else points[-1] / s[-1]
        errors = [abs(norm @ s**p * (p + 1) / length - 1) for p in range(2 * end.degree + 1)]
        assert max(errors[:-1]) < 1e-13
        assert errors[-1] > 1e-8
    assert min(end.node_norm.min(), end.half_norm.min()) > 0.3


@pytest.mark.parametrize("order", ORDERS)
def test_second_difference_is_real_and_bounded(order):
    """−H_n⁻¹QᵀD has real eigenvalues ≥ 0, a single 0, and hardly more than the interior's largest.

    Rounding 1e-13 of the largest. Spectral radius over (2Σ|c_j|/h)²: measured 0.999 to 1.040, the
    least stretch and joined ones included; the bound is 1.05.
    """
    least = closure(order).cells
    for cells in ((least,), (48,), (least, least + 1, least)):
        made = chain(order, cells, (1.0,) * len(cells))
        d = dense(made)
        values = np.linalg.eigvals((d.T * made.half_norm) @ d / made.node_norm[:, None])
        largest = difference_norm(1.0, order) ** 2
        assert np.abs(values.imag).max() < 1e-13 * largest
        squares = np.sort(values.real)
        assert abs(squares[0]) < 1e-13 * largest
        assert squares[1] > 0.5 * (np.pi / sum(cells)) ** 2
        assert squares[-1] < 1.05 * largest


@pytest.mark.parametrize("order", ORDERS)
def test_mirror_image(order):
    """A chain read from the right is the chain of the reversed stretches with −D, to the bit."""
    n = closure(order).cells
    one, other = chain(order, (n, n + 2), (1.0, 0.5)), chain(order, (n + 2, n), (0.5, 1.0))
    assert np.array_equal(dense(one), -dense(other)[::-1, ::-1])
    assert np.array_equal(one.half_norm, other.half_norm[::-1])
    assert np.array_equal(one.node_norm, other.node_norm[::-1])


@pytest.mark.parametrize("order", ORDERS)
def test_interior_is_the_plain_stencil(order):
    """Away from ends D has the weights c_j/h, and the norms are h."""
    n, h = closure(order).cells + 9, 0.25
    made = chain(order, (n,), (h,))
    row, m = dense(made)[n // 2], order // 2
    weights = np.array(difference_weights(order)) / h
    assert row[n // 2 + 1 : n // 2 + 1 + m] == pytest.approx(weights, rel=1e-15)
    assert row[n // 2 + 1 - m : n // 2 + 1] == pytest.approx(-weights[::-1], rel=1e-15)
    assert np.count_nonzero(row) == order
    assert made.half_norm[n // 2] == h == made.node_norm[n // 2]


@settings(max_examples=25, deadline=None)
@given(
    order=st.sampled_from(ORDERS),
    more=st.lists(st.integers(0, 9), min_size=1, max_size=4),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_chain_differentiates_a_constant_alone_to_zero(order, more, seed):
    """So that no wave but rigid motion is without energy, whatever the stretches.

    The least singular value of H_h^½ D H_n^−½ beside that of the constant is that of the first
    eigenmode, π/length, within 2 % (order 2's own error at 10 cells is 0.4 %); norms sum to the
    length within rounding.
    """
    rng = np.random.default_rng(seed)
    cells = tuple(closure(order).cells + 8 + extra for extra in more)
    spacings = tuple(rng.uniform(1, 3, len(cells)))
    made = chain(order, cells, spacings)
    g = np.sqrt(made.half_norm)[:, None] * dense(made) / np.sqrt(made.node_norm)
    assert np.abs(g @ np.sqrt(made.node_norm)).max() < 1e-12
    values = np.linalg.svd(g, compute_uv=False)
    assert len(values) == sum(cells)
    length = sum(n * h for n, h in zip(cells, spacings, strict=True))
    assert made.node_norm.sum() == pytest.approx(length, rel=1e-14)
    assert made.half_norm.sum() == pytest.approx(length, rel=1e-14)
    assert values[-1] * length / np.pi == pytest.approx(1, abs=0.02)


def test_errors_name_the_stretch():
    least = closure(8).cells
    with pytest.raises(
        ValueError,
        match=r"cells = 9 \(layer 2, 0.009 m thick\): order 8 needs at least 16; "
        r"take a spacing of 0.000562 m or less, or a lower order",
    ):
        chain(8, (least, 9), (1e-3, 1e-3))
    with pytest.raises(ValueError, match=r"spacings = -1 \(stretch 1\): must be greater than 0"):
        chain(8, (least,), (-1.0,))
    with pytest.raises(ValueError, match="spacings: 1 given for 2 stretches"):
        chain(8, (least, least), (1.0,))
    with pytest.raises(ValueError, match="at least one"):
        chain(8, (), ())
    with pytest.raises(ValueError, match="order = 7: must be one of"):
        closure(7)


@pytest.mark.parametrize("order", ORDERS)
def test_arrays_are_kept_and_cannot_be_written(order):
    end, made = closure(order), chain(order, (closure(order).cells,), (1.0,))
    assert closure(order) is end
    for array in (end.weights, end.node_norm, end.half_norm, made.diagonals, made.node_norm):
        with pytest.raises(ValueError, match="read-only"):
            array.flat[0] = 0.0
