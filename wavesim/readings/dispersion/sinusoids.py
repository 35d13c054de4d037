"""Least-squares fit of a few decaying sinusoids to many series at once.

    y_c(t) = Re Σ_j a_cj z_j(t) + noise,     z_j = exp(−(γ_j + iω_j) t)

Frequencies ω_j and decays γ_j are shared by the channels c of one series. Amplitudes are
eliminated (variable projection: Golub & Pereyra, SIAM J. Numer. Anal. 10, 413 (1973), in the form
of Kaufman, BIT 15, 49 (1975)) and ω, γ found by Gauss–Newton steps, which in white noise attain
the Cramér–Rao bound. All that a step needs of N samples are inner products of z and t z with each
other and with y, so that a batch of series is three matrix products.

Time is counted from the middle of the series, in samples; ω and γ are in radians and nepers per
sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

_FINE = 64
# Longest step of a frequency, in bins 2π/N; growth and decay over the series are held to these.
_LONGEST_STEP = 0.4
_DECAY = (-2.0, 40.0)
# Least phase over the series, rad: below it a cosine is a constant, and has no sine.
_SLOWEST = 0.01
# Steps shorter than this many radians (nepers) over the series, or this part of the standard
# error, change nothing.
_RADIANS = 1e-12
_OF_ERROR = 1e-3
# While steps are longer, radians over the series, inner products tell them well enough without the
# N samples left over, of which they know the power but for this part of the series' own.
_ROUGH = 1e-2
_ROUNDED = 1e-8


@dataclass(frozen=True)
class Fit:
    """Sinusoids fitted to n series of C channels, p to each.

    Attributes:
        omega, decay: ω and γ, shape (n, p), per sample.
        amplitude: a at the middle of the series, shape (n, C, p), complex.
        residual: y less the model, shape (n, C, N).
        parts: JᵀJ of each channel for all ω then all γ, shape (n, C, 2p, 2p).
        unit: inverse of their sum, the covariance of ω and γ in noise of variance 1.
        unit_amplitude: standard error of |a| of one channel in noise of variance 1, shape (n, p).
    """

    omega: Float
    decay: Float
    amplitude: Complex
    residual: Float
    parts: Float
    unit: Float
    unit_amplitude: Float


def exponentials(omega: Float, decay: Float, count: int, start: float | None = None) -> Complex:
    """z at N samples, shape (n, p, N), by products of coarse and fine powers.

    Args:
        omega, decay: ω and γ, shape (n, p), per sample.
        count: N.
        start: the first sample's time, in samples; None: −(N−1)/2.
    """
    s = -(decay + 1j * omega)
    blocks = -(-count // _FINE)
    begin = -(count - 1) / 2 if start is None else start
    coarse = np.exp(s[..., None] * (np.arange(blocks) * _FINE + begin))
    fine = np.exp(s[..., None] * np.arange(_FINE))
    product = coarse[..., :, None] * fine[..., None, :]
    return np.asarray(product.reshape(*s.shape, blocks * _FINE)[..., :count])


def transposed(matrix: Any) -> Any:
    """The matrix, or stack of matrices, with its last two axes exchanged."""
    return np.swapaxes(matrix, -1, -2)


def solve(matrix: Float, right: Float) -> Float:
    """x of A x = b for a stack of symmetric positive A, its diagonal scaled to one."""
    size = np.sqrt(np.maximum(np.diagonal(matrix, axis1=-2, axis2=-1), 1e-290))[..., :, None]
    scaled = matrix / (size * transposed(size)) + 1e-15 * np.eye(matrix.shape[-1])
    return np.asarray(np.linalg.solve(scaled, right / size) / size)


@dataclass(frozen=True)
class _Linear:
    """The problem at one ω, γ: best amplitudes and the slopes about them."""

    coefficients: Float
    residual: Float | None
    gram: Float
    parts: Float
    step: Float
    error: Float


def _linear(
    series: Float,
    omega: Float,
    decay: Float,
    weight: Float | None,
    damped: bool,
    power: Float | None = None,
) -> _Linear:
    """At one ω, γ; of a rough step the power Σ y², shape (n,), is enough, and no residual made."""
    n, channels, count = series.shape
    p = omega.shape[1]
    z = exponentials(omega, decay, count)
    both = np.empty((n, 4 * p, count))
    both[:, :p], both[:, p : 2 * p] = z.real, z.imag
    if weight is not None:
        both[:, : 2 * p] *= weight
    np.multiply(both[:, : 2 * p], np.arange(count) - (count - 1) / 2, out=both[:, 2 * p :])
    basis, timed = both[:, : 2 * p], both[:, 2 * p :]
    products = both @ transposed(both)
    gram, cross = products[:, : 2 * p, : 2 * p], products[:, : 2 * p, 2 * p :]
    residual = None
    if power is None:
        coefficients = transposed(solve(gram, transposed(series @ transposed(basis))))
        residual = series - coefficients @ basis
        # Once more for what rounding left.
        more = transposed(solve(gram, transposed(residual @ transposed(basis))))
        coefficients = coefficients + more
        residual -= more @ basis
        left = np.sum(residual**2, axis=(1, 2))
        along = residual @ transposed(timed)
    else:
        seen = series @ transposed(both)
        coefficients = transposed(solve(gram, transposed(seen[..., : 2 * p])))
        left = power - np.sum(coefficients * seen[..., : 2 * p], axis=(1, 2))
        left[left < _ROUNDED * power] = 0.0
        along = seen[..., 2 * p :] - coefficients @ cross
    projected = products[:, 2 * p :, 2 * p :] - transposed(cross) @ solve(gram, cross)
    # ∂y/∂ω = −δ t Re z + α t Im z and ∂y/∂γ = −α t Re z − δ t Im z for y = α Re z + δ Im z.
    alpha, delta = coefficients[..., :p], coefficients[..., p:]
    slope = np.zeros((n, channels, 2 * p, 2 * p))
    j = np.arange(p)
    slope[..., j, j], slope[..., p + j, j] = -delta, alpha
    slope[..., j, p + j], slope[..., p + j, p + j] = -alpha, -delta
    parts = transposed(slope) @ (projected[:, None] @ slope)
    pull = transposed(slope) @ along[..., None]
    normal, right = parts.sum(axis=1), pull.sum(axis=1)
    if not damped:
        normal, right = normal[:, :p, :p], right[:, :p]
    step = np.zeros((n, 2 * p))
    step[:, : right.shape[1]] = solve(normal, right)[..., 0]
    noise = np.sqrt(left / (channels * count))
    stiffness = np.maximum(np.diagonal(normal, axis1=1, axis2=2), 1e-290)
    error = np.full((n, 2 * p), np.inf)
    error[:, : right.shape[1]] = noise[:, None] / np.sqrt(stiffness)
    return _Linear(coefficients, residual, gram, parts, step, error)


def fit(
    series: Float,
    omega: Float,
    decay: Float,
    weight: Float | None = None,
    damped: bool = True,
    steps: int = 40,
) -> Fit:
    """Fit sinusoids from a first guess.

    Args:
        series: y, shape (n, C, N); 0 where a sample is missing.
        omega: first guess of ω, shape (n, p), rad per sample, in (0, π).
        decay: first guess of γ, shape (n, p), nepers per sample.
        weight: 1 where a sample counts, 0 where it is missing, shape (N,); None: all count.
        damped: False holds every γ at its first guess.
        steps: most Gauss–Newton steps.

    Returns:
        The fit.
    """
    count, p = series.shape[-1], omega.shape[1]
    omega, decay = np.maximum(omega, _SLOWEST / count), decay.copy()
    active = np.arange(len(series))
    power, rough = np.einsum("nct,nct->n", series, series), True
    for _ in range(steps):
        if not len(active):
            break
        every = len(active) == len(series)
        part = series if every else series[active]
        known = power[active] if rough else None
        now = _linear(part, omega[active], decay[active], weight, damped, known)
        longest = np.abs(now.step).max(axis=1)
        limit = _LONGEST_STEP * 2 * np.pi / count
        step = now.step * np.minimum(1, limit / np.maximum(longest, 1e-300))[:, None]
        moved = omega[active] + step[:, :p]
        # −ω is the same real sinusoid, and one of ω = 0 has no phase.
        omega[active] = np.maximum(np.abs(moved), _SLOWEST / count)
        decay[active] = np.clip(decay[active] + step[:, p:], _DECAY[0] / count, _DECAY[1] / count)
        small = np.abs(now.step) <= np.maximum(_RADIANS / count, _OF_ERROR * now.error)
        goes_on = ~small.all(axis=1) | (rough & (now.error == 0).any(axis=1))
        active = active[goes_on]
        rough = rough and bool((longest[goes_on] > _ROUGH / count).any())
    last = _linear(series, omega, decay, weight, damped)
    assert last.residual is not None
    size = 2 * p if damped else p
    unit = np.zeros((len(series), 2 * p, 2 * p))
    normal = last.parts.sum(axis=1)[:, :size, :size]
    unit[:, :size, :size] = solve(normal, np.broadcast_to(np.eye(size), normal.shape))
    spread = solve(last.gram, np.broadcast_to(np.eye(2 * p), last.gram.shape))
    spread = np.diagonal(spread, axis1=1, axis2=2)
    return Fit(
        omega,
        decay,
        last.coefficients[..., :p] - 1j * last.coefficients[..., p:],
        last.residual,
        last.parts,
        unit,
        np.sqrt(np.maximum(spread[:, :p] + spread[:, p:], 0) / 2),
    )
