"""Values and slopes between samples, by a sinc under a Kaiser window, and correlations of signals.

    u(s) = Σ_n u_n sinc(s − n) w(s − n),    w(y) = I₀(b √(1 − (y/H)²)) / I₀(b)

With H = 24 and b = 14 the error is below 1e-6 of the peak for signals below 0.8 of the Nyquist
frequency. Outside the record u is taken for 0: see :func:`taps_at_end` for what moves to its end.
Kaiser & Schafer, IEEE Trans. ASSP 28, 105 (1980).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[Any]

_HALF = 24
_SHAPE = 14.0
# Of a signal that moves to its end: samples that are taken, the band, and what keeps K regular.
_LATE, _BELOW, _NUGGET = 96, 0.85, 1e-13


def between(values: Float, position: ArrayLike, moving: bool = False) -> Float:
    """u at positions between samples.

    Args:
        values: samples u_n, shape (nt,).
        position: s, in samples from the first, any shape.
        moving: whether u, free of noise, may still move at the last sample.

    Returns:
        u(s), shape of position.
    """
    n, weights = taps(position)
    inside = (n >= 0) & (n < len(values))
    samples = np.where(inside, values[np.clip(n, 0, len(values) - 1)], 0)
    found = np.array(np.sum(samples * weights, axis=-1))
    if moving:
        late, places, made = taps_at_end(len(values), position)
        found[late] = made @ values[places]
    return found


def taps_at_end(count: int, position: ArrayLike) -> tuple[NDArray[np.bool_], Any, Float]:
    """What values within H of the last sample are made of, where a signal still moves there.

    It is the best for all signals below 0.85 of the Nyquist frequency: u(s) = k(s)ᵀ K⁻¹ u of the
    last samples, K_mn = sinc 0.85(m − n), k_n = sinc 0.85(s − n). Just before the last sample it
    errs by up to 3e-3 of the peak, then by 6e-4 and 2e-4, by 3e-5 from four samples on, where
    u = 0 beyond the record makes 0.3 of it, and 4e-3 even half as far as H away. It takes
    u without noise, which it makes ten thousand times as large.

    Args:
        count: nt, of samples.
        position: s, in samples from the first, any shape.

    Returns:
        Which positions those are, shape of s, the samples, and the weights, (positions, samples).
    """
    s = np.asarray(position, float)
    late = (s > count - 1 - _HALF) & (s < count - 1) & (np.abs(s - np.rint(s)) > 1e-9)
    places = np.arange(max(0, count - _LATE), count)
    K = np.sinc(_BELOW * np.subtract.outer(places, places)) + _NUGGET * np.eye(len(places))
    near = np.sinc(_BELOW * np.subtract.outer(s[late], places))
    return late, places, np.linalg.solve(K, near.T).T


def cross_correlation(values: Float, reference: Float) -> Float:
    """c_m = Σ_n u_{n+m} r_n at all lags m, from −(N − 1) on, by FFT.

    Args:
        values: u, shape (nt,).
        reference: r, shape (N,).

    Returns:
        Shape (nt + N − 1,).
    """
    count = len(values) + len(reference) - 1
    size = 1 << (count - 1).bit_length()
    c = np.fft.irfft(np.fft.rfft(values, size) * np.conj(np.fft.rfft(reference, size)), size)
    return np.roll(c, len(reference) - 1)[:count]


def taps(position: ArrayLike) -> tuple[NDArray[np.int_], Float]:
    """Samples that a value between them is made of, and their weights.

    Args:
        position: s, in samples from the first, any shape.

    Returns:
        Numbers of samples, which may lie outside the record, and weights, shape of s and (2H,).
    """
    from scipy.special import i0  # numpy's takes ten times as long

    s = np.asarray(position, float)
    first = np.floor(s).astype(int)
    n = first[..., None] + np.arange(1 - _HALF, _HALF + 1)
    y = s[..., None] - n
    window = i0(_SHAPE * np.sqrt(np.maximum(1 - (y / _HALF) ** 2, 0))) / i0(_SHAPE)
    return n, np.asarray(np.sinc(y) * window)


def slope(values: Float, position: ArrayLike, step: float = 0.02) -> Float:
    """du/ds by a central difference of the interpolant, per sample, shape of position."""
    s = np.asarray(position, float)
    return np.asarray((between(values, s + step) - between(values, s - step)) / (2 * step))
