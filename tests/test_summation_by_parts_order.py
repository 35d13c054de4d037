"""How fast eigenfrequencies and modes converge on stretches with closures; the table of that."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse
from scipy.sparse.linalg import eigsh
from stretches import PLAIN, exact_two, impedance, modes, positions, slope

from wavesim.grid import summation_by_parts as closures
from wavesim.grid.stencils import ORDERS, difference_norm
from wavesim.grid.summation_by_parts import chain, closure

COUNTS = (64, 80, 100, 128, 160)


@pytest.mark.parametrize("order", ORDERS)
def test_eigenfrequencies_of_a_uniform_bar(order):
    """Free, fixed and mixed ends: ω_n = nπ (or (n − ½)π) c/L with error h^2q, q = degree.

    Largest error of modes 2 to 4 under the three conditions, 64 to 160 cells (32 to 160 points per
    wavelength). Measured slopes: 2.00, 4.16, 5.75, 5.66, 5.66, 5.66; bound 2q − 0.5, as the next
    terms of the series still show. A closure of degree q − 1 would give 2q − 2.
    """
    q = closure(order).degree
    errors = []
    for n in COUNTS:
        found = []
        for fixed in ((False, False), (True, True), (False, True)):
            omega, _, _ = modes(order, (n,), (1 / n,), (PLAIN,), fixed)
            numbers = np.arange(2, 5) - (0.5 if fixed == (False, True) else 0)
            first = 2 if fixed == (False, False) else 1
            found.append(np.abs(omega[first : first + 3] / (numbers * np.pi) - 1).max())
        errors.append(max(found))
    assert slope(1 / np.array(COUNTS), errors) > 2 * q - 0.5


def end_error(order, end, cells, mode):
    """Relative error of a standing wave of φ̈ = φ″ between like ends: the eigenvalue nearest it."""
    made = chain(order, (cells,), (1 / cells,))
    D = scipy.sparse.diags_array(
        [row[max(0, -first) :] for first, row in enumerate(made.diagonals, start=made.first)],
        offsets=range(made.first, made.first + len(made.diagonals)),
        shape=(cells, cells + 1),
    )
    half, node = np.sqrt(made.half_norm), np.sqrt(made.node_norm)
    G = scipy.sparse.diags_array(half) @ D @ scipy.sparse.diags_array(1 / node)
    G = G.tocsc()[:, 1:-1] if end == "fixed" else G
    # Singular values as eigenvalues, so that none is squared and loses half its digits.
    both = scipy.sparse.block_array([[None, G], [G.T, None]], format="csc")
    k = np.pi * mode
    (found,) = eigsh(both, 1, sigma=k * (1 + 1e-4), return_eigenvectors=False)
    return abs(found / k - 1)


@pytest.mark.parametrize(("order", "declared"), [(2, 2), (4, 4), (8, 7)])
@pytest.mark.parametrize("end", ["free", "fixed"])
def test_order_of_a_standing_wave(order, declared, end):
    """Declared order of eigenfrequencies at an end, ±0.1: 2, 4 and, at order 8, 7 (the closures are
    exact to degree 3, and errors of eigenfrequencies have twice that order, or one more). Fitted
    between 128 and 192 cells to a wavelength (order 4: 768 to 1536, where it has settled); measured
    2.00, 4.03 and 3.94, 6.93 and 6.93."""
    points, mode = ((768, 1536), 2) if order == 4 else ((128, 192), 8)
    errors = [end_error(order, end, mode * p // 2, mode) for p in points]
    assert slope(1 / np.array(points), errors) == pytest.approx(declared, abs=0.1)


BARS = {
    "waves": (((1.0, 1.0, 0.0, 1.0), (3.0, 1.7, 0.0, 1.0)), 18.0),
    "oscillators": (((1.0, 1.0, 12.0, 400.0), (3.0, 1.7, 20.0, 900.0)), 12.0),
}


@pytest.mark.parametrize("bar", BARS)
@pytest.mark.parametrize("order", [2, 4, 6, 8])
def test_two_layers(order, bar):
    """A jump of c, ρ (and b, w) and of h, free ends: ω and a mode against the exact solution.

    "oscillators" has dispersive layers, ω² = k²(c − b²/(w − ω²))/ρ. Errors of ω (the largest of
    modes 3 and up) fall as h^2q, those of the highest mode's φ and σ, in the maximum norm, as
    h^(q+1). Bounds are 2q − 0.5 and q + 0.9, as the next terms still show. Measured slopes of ω, φ,
    σ at orders 2, 4, 6, 8 without oscillators: 2.00, 2.00, 2.00; 4.19, 3.40, 3.33; 5.57, 4.09,
    4.93; 6.37, 4.18, 4.93; with them: 2.00, 2.00, 2.00; 3.78, 3.00, 3.00; 6.46, 4.12, 3.92; 6.52,
    4.04, 4.29. Order 8 ends at 3e-9 in ω, 4e-6 in φ. Orders 10 and 12 have its closure and errors.
    """
    layers, highest = BARS[bar]
    roots = exact_two((0.5, 0.5), layers, highest)
    assert len(roots) >= 4
    omega = roots[-1]
    (c1, s1), (c2, s2) = (impedance(layer, omega) for layer in layers)
    other = np.cos(omega * s1 / 2) / np.cos(omega * s2 / 2)
    found = []
    for n in COUNTS:
        cells = (5 * n // 8, 3 * n // 8)
        spacings = (0.5 / cells[0], 0.5 / cells[1])
        values, phi, sigma = modes(order, cells, spacings, layers)
        x, y = positions(cells, spacings)
        left, inside = np.arange(len(x)) <= cells[0], np.arange(len(y)) < cells[0]
        mode = np.where(left, np.cos(omega * s1 * x), other * np.cos(omega * s2 * (1 - x)))
        stress = np.where(
            inside,
            -c1 * s1 * omega * np.sin(omega * s1 * y),
            other * c2 * s2 * omega * np.sin(omega * s2 * (1 - y)),
        )
        v, s = phi[:, len(roots)], sigma[:, len(roots)]
        factor = (v @ mode) / (v @ v)
        found.append(
            (
                np.abs(values[3 : len(roots) + 1] / roots[2:] - 1).max(),
                np.abs(v * factor - mode).max() / np.abs(mode).max(),
                np.abs(s * factor - stress).max() / np.abs(stress).max(),
            )
        )
    q = closure(order).degree
    slopes = [slope(1 / np.array(COUNTS), errors) for errors in zip(*found, strict=True)]
    assert slopes[0] > 2 * q - 0.5
    assert min(slopes[1:]) > q + 0.9


def table():
    """The table of the module's docstring, by order."""
    rows = [line.split() for line in closures.__doc__.splitlines()]
    return {
        int(row[0]): [float(value) for value in row[1:]]
        for row in rows
        if len(row) > 9 and row[0].isdigit()
    }


@pytest.mark.parametrize("order", ORDERS)
def test_table_of_the_docstring(order):
    """q, r, c, least cells, spectral radius; ω errors of ten wavelengths at 8, 12, 16, 24 points.

    The larger error of free and fixed ends, against 20π/L. Printed to two digits, so 6 %.
    """
    end = closure(order)
    q, r, c, cells, radius, *errors = table()[order][:9]
    assert (q, (r, c), cells) == (end.degree, end.weights.shape, end.cells)
    omega, _, _ = modes(order, (96,), (1.0,), (PLAIN,))
    assert (omega[-1] / difference_norm(1.0, order)) ** 2 == pytest.approx(radius, abs=0.006)
    for points, printed in zip((8, 12, 16, 24), errors, strict=True):
        n = 10 * points
        found = []
        for fixed in (False, True):
            omega, _, _ = modes(order, (n,), (1 / n,), (PLAIN,), (fixed, fixed))
            found.append(abs(omega[19 if fixed else 20] / (20 * np.pi) - 1))
        assert max(found) == pytest.approx(printed, rel=0.06)
