"""Windows over a record, sums of cosines, the density of noise under one, means, lengths of FFTs.

They are as scipy.signal, scipy.ndimage and scipy.fft have them; of those this is all that a run
needs, and loading them takes longer than loading jax.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.float64]

_HANN = (0.5, -0.5)
# Harris, Proc. IEEE 66, 51 (1978): four terms, side lobes 92 dB down.
_BLACKMAN_HARRIS = (0.35875, -0.48829, 0.14128, -0.01168)


def hann(count: int) -> Float:
    """w_n = ½ − ½ cos 2πn/(N − 1), shape (N,)."""
    return _cosines(_HANN, count)


def blackman_harris(count: int) -> Float:
    """w_n = Σ_j a_j cos 2πjn/(N − 1) of four terms, shape (N,)."""
    return _cosines(_BLACKMAN_HARRIS, count)


def noise_density(noise: ArrayLike, interval: float, frequency: ArrayLike) -> Float:
    """Two-sided power density of noise, by Welch's method: quarters of it, half overlapping.

    The mean is taken out of each, so that the lowest frequency is empty and the next serves there.
    Welch, IEEE Trans. Audio Electroacoust. 15, 70 (1967).

    Args:
        noise: u, shape (n,), n ≥ 16.
        interval: Δt, s.
        frequency: f, any shape, Hz.

    Returns:
        S, shape of f, unit of u squared, times s.
    """
    u = np.asarray(noise, float)
    size = min(max(16, len(u) // 4), len(u))
    parts = sliding_window_view(u, size)[:: size - size // 2]
    window = hann(size + 1)[:-1]
    hat = np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * window)
    power = np.mean(np.abs(hat) ** 2, axis=0) * interval / np.sum(window**2)
    known = np.fft.rfftfreq(size, interval)
    return np.asarray(np.interp(np.abs(frequency), known[1:-1], power[1:-1]))


def moving_mean(values: ArrayLike, size: int) -> Float:
    """Means over that many samples about each, the record mirrored at its ends, shape (n,)."""
    padded = np.pad(np.asarray(values, float), (size // 2, size - 1 - size // 2), "symmetric")
    total = np.cumsum(np.concatenate([[0.0], padded]))
    return np.asarray((total[size:] - total[:-size]) / size)


def fast_length(least: int) -> int:
    """The next number of samples whose FFT is quick: a product of 2, 3, 5, 7 and 11 alone."""
    length = least - 1
    rest = 0
    while rest != 1:
        length = rest = length + 1
        for factor in (2, 3, 5, 7, 11):
            while rest % factor == 0:
                rest //= factor
    return length


def _cosines(terms: Sequence[float], count: int) -> Float:
    phase = np.linspace(-np.pi, np.pi, count) if count > 1 else np.zeros(count)
    signs = (-1.0) ** np.arange(len(terms))  # counted from the middle, so that it is symmetric
    return np.asarray(
        np.sum(
            [a * s * np.cos(j * phase) for j, (a, s) in enumerate(zip(terms, signs, strict=True))],
            axis=0,
        )
    )
