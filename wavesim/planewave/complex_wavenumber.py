"""Complex wavenumbers k(ω): what decays, how fast, and what propagates.

With the gradient term kept, ω² v = K(k) v at given ω is a quadratic eigenproblem in k. Only k²
enters: with b = k c it becomes the linear problem det(s P − Q) = 0 in s = k²,

    P = | c_pp  −c_pb |      Q = | ω²        0      |
        |  0      γ   |          | c_bp   ω² − c_bb |

of degree 1 + rank γ for one macro-field: the pair ±k of the closed form below and, for each rank of
γ, a pair whose wavelength or decay length is of the size √(Γ/C_BB), which with Table 1 is 1e-6 of a
particle. With Γ → 0 there is one pair, k² = ω²/D(ω²), D = c_pp − c_pb (c_bb − ω²)⁻¹ c_bp.

Where the medium has a loss law every ω stands for Ω(ω) = ω √(ι/m) (``material.damping``).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import ArrayLike

from wavesim.material.damping import UNDAMPED
from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients
from wavesim.planewave.eigenproblem import Complex, Float, spectral_form


@dataclass(frozen=True)
class ComplexWaves:
    """All plane waves of one block at given frequencies, one of each pair ±k.

    Attributes:
        sector, block: where they live.
        omega: angular frequencies, shape (n,), rad/s, real or complex.
        k: wavenumbers, shape (n, r), rad/m. Column 0 is the one that the closed form gives as
            Γ → 0 where the block has a macro-field; the others ascend in |k|.
    """

    sector: str
    block: str
    omega: Complex
    k: Complex

    @property
    def decay_length(self) -> Float:
        """1/Im k, over which the amplitude falls by e, shape (n, r), m; inf where it does not."""
        with np.errstate(divide="ignore"):
            return np.where(self.k.imag > 0, 1 / self.k.imag, np.inf)

    @property
    def propagates(self) -> Any:
        """Whether the wave carries energy away without decay, shape (n, r)."""
        return (self.k.imag == 0) & (self.k.real != 0)


def _outward(square: Any, rises: Any, omega: Any) -> Complex:
    """The root of k² that decays towards +x or, if k is real, carries energy there.

    For real k the group velocity ∂ω/∂k has the sign of k/ω · dk²/dω²; ω + i0 then gives Im k > 0.
    """
    k = np.sqrt(np.asarray(square, dtype=complex))
    k = np.where(k.imag < 0, -k, k)
    return np.where((k.imag == 0) & (np.real(rises) * np.real(omega) < 0), -k, k)


def wavenumber(medium: Medium, sector: str, omega: ArrayLike) -> Complex:
    """k(ω) of the one pair ±k of a sector with a macro-field, in the limit Γ → 0.

        k² = ω² / D(ω²),    D = c_pp − c_pb (c_bb − ω²)⁻¹ c_bp

    Args:
        medium: the medium.
        sector: longitudinal, transverse2 or transverse3.
        omega: angular frequencies, real or complex, shape (n,), rad/s.

    Returns:
        The root that decays towards +x (Im k > 0) or, where it does not decay, carries energy
        towards +x, shape (n,), complex, rad/m. ω + i0 is meant where ω is real; in a gap k is
        imaginary.

    Raises:
        ValueError: the sector has no macro-field, so nothing propagates in it.
    """
    (block, *others) = medium.family.blocks_of(sector)
    if others or not block.macro:
        raise ValueError(f"sector {sector!r} has no propagating wave: k(ω) is not defined")
    scaled = _lossless(medium, np.atleast_1d(np.asarray(omega))) * medium.time_scale
    return _closed_form(spectral_form(medium, block), scaled) / medium.length_scale


def _lossless(medium: Medium, omega: Any) -> Any:
    """Ω(ω), rad/s; ω itself, untouched, where the medium has no loss law."""
    if medium.damping == UNDAMPED:
        return omega
    felt = medium.damping.lossless(omega)
    return felt if medium.damping or np.iscomplexobj(omega) else felt.real


def _closed_form(form: BlockCoefficients, omega: Any) -> Complex:
    """k(ω) with Γ → 0, scaled: det(s P − Q) is then linear in s, with no pole at a cutoff."""
    without = BlockCoefficients(form.c_pp, form.c_pb, form.c_bp, form.c_bb, 0 * form.gamma)
    values, rates = _polynomial(without, omega**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        square = -values[:, 0] / values[:, 1]
        return _outward(square, -(rates[:, 0] + rates[:, 1] * square) / values[:, 1], omega)


def _polynomial(form: BlockCoefficients, square: Any) -> tuple[Any, Any]:
    """Coefficients of F = det(s P − Q) in s and those of ∂F/∂ω², ascending; (n, m + 1) each.

    The determinant is linear in each row: a coefficient is the sum over the ways to take that
    many rows from P and the others from −Q, and ∂F/∂ω² that over the rows of I put in their place.
    """
    p, b = np.shape(form.c_pb)
    first = np.block([[form.c_pp, -form.c_pb], [np.zeros((b, p)), form.gamma]])
    second = np.zeros((len(square), p + b, p + b), dtype=square.dtype)
    second[:, p:, :p] = -form.c_bp
    second[:, p:, p:] = form.c_bb
    second -= square[:, None, None] * np.eye(p + b)
    values = np.zeros((len(square), p + b + 1), dtype=square.dtype)
    rates = np.zeros_like(values)
    for rows in itertools.product((False, True), repeat=p + b):
        taken = np.where(np.array(rows)[:, None], first, second)
        values[:, sum(rows)] += np.linalg.det(taken)
        for i in np.flatnonzero(~np.array(rows)):
            replaced = taken.copy()
            replaced[:, i] = -np.eye(p + b)[i]
            rates[:, sum(rows)] += np.linalg.det(replaced)
    return values, rates


def _degree(form: BlockCoefficients) -> int:
    macro = np.shape(form.c_pp)[-1]
    size = np.abs(form.gamma).max()
    return macro + (int(np.linalg.matrix_rank(form.gamma / size, tol=1e-12)) if size else 0)


def _evaluate(coefficients: Any, at: Any) -> Any:
    """Polynomials with coefficients (n, m + 1), ascending, at points (n, r): shape (n, r)."""
    return polyval(at.T, coefficients.T, tensor=False).T


def _polynomial_roots(coefficients: Any) -> Any:
    """Roots in s, shape (n, degree): companion eigenvalues, then Newton in each.

    Roots differ by 1e12 in size; Newton's steps make each exact relative to itself.
    """
    degree = coefficients.shape[1] - 1
    if degree == 0:
        return np.zeros((len(coefficients), 0), dtype=coefficients.dtype)
    companion = np.zeros((len(coefficients), degree, degree), dtype=coefficients.dtype)
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1
    companion[:, 0] = -coefficients[:, -2::-1] / coefficients[:, -1:]
    roots = np.linalg.eigvals(companion)
    for _ in range(4):
        rate = _evaluate(polyder(coefficients, axis=1), roots)
        step = _evaluate(coefficients, roots) / np.where(rate == 0, 1, rate)
        roots = roots - np.where(np.abs(step) < 0.5 * np.abs(roots), step, 0)
    return roots


def complex_waves(medium: Medium, block: Block, omega: ArrayLike) -> ComplexWaves:
    """Every k(ω) of one block from the full quadratic problem, the gradient term kept.

    Args:
        medium: the medium.
        block: one of its family's blocks.
        omega: angular frequencies, real or complex, shape (n,), not 0, rad/s.

    Returns:
        One root of each pair ±k: the one with Im k > 0 or, where k is real, the one that carries
        energy towards +x. Each rank of Γ adds a pair; without Γ a block with a macro-field
        has the one of :func:`wavenumber` and an in-plane block has none.

    Raises:
        ValueError: an ω is 0, where k is not defined by ω.
    """
    given = np.atleast_1d(np.asarray(omega))
    if (given == 0).any():
        raise ValueError("omega = 0: must not be 0; take a small ω for the static limit")
    form = spectral_form(medium, block)
    felt = _lossless(medium, given)
    scaled = felt.astype(complex if np.iscomplexobj(felt) else float) * medium.time_scale
    values, rates = (x[:, : _degree(form) + 1] for x in _polynomial(form, scaled**2))
    roots = _polynomial_roots(values)
    rises = -_evaluate(rates, roots) / _evaluate(polyder(values, axis=1), roots)
    k = _outward(roots, rises, scaled[:, None])
    order = np.argsort(np.abs(k), axis=1)
    if block.macro:
        nearest = np.abs(k**2 - _closed_form(form, scaled)[:, None] ** 2)
        first = np.argmin(np.where(np.isfinite(nearest), nearest, np.inf), axis=1)
        others = np.array([row[row != one] for row, one in zip(order, first, strict=True)])
        order = np.concatenate(
            [first[:, None], others.reshape(len(first), order.shape[1] - 1)], axis=1
        )
    k = np.take_along_axis(k, order.astype(int), axis=1)
    return ComplexWaves(block.sector, block.name, given.astype(complex), k / medium.length_scale)
