"""Transforms at complex frequency, of records that do not end.

Inside a gap the ringing of the band edges never ends, and a plain Fourier ratio is wrong by 10 %
and more. Weighted by exp(−σt) the record ends, and its transform is that of the unending one at
the complex frequency ω + iσ, where it decays as exp(ikx) with the plane-wave root k(ω + iσ).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.material.arguments import FREQUENCIES, WINDOW
from wavesim.records.windows import fast_length

# Columns of sums that are held at a time, and numbers.
_AT_ONCE, _HELD = 256, 2**19
# Samples times frequencies beyond which even frequencies are summed by chirps.
_MANY = 2**26
Float = NDArray[Any]
Complex = NDArray[np.complex128]


def check_asked(frequencies: int, damping: float) -> None:
    """Hold what is asked of spectra to what [analysis] of a case admits.

    Args:
        frequencies: how many.
        damping: σT.

    Raises:
        ValueError: one of them is out of its range.
    """
    for name, value, (low, high) in (
        ("frequencies", frequencies, FREQUENCIES),
        ("damping", damping, WINDOW),
    ):
        if not low <= value <= high:
            raise ValueError(f"{name} = {value:g}: must be between {low:g} and {high:g}")


def damped_transform(values: ArrayLike, t: Float, omega: Float, sigma: float) -> Complex:
    """∫ u e^{i(ω+iσ)t} dt by the trapezoidal rule, exact to exp(−σT) for a band-limited record.

    Args:
        values: u, shape (nt, …).
        t: times, even, shape (nt,), s.
        omega: real frequencies, shape (n,), rad/s.
        sigma: σ, rad/s.

    Returns:
        Shape (n, …), unit of u times s.
    """
    step = (t[-1] - t[0]) / (len(t) - 1)
    flat = np.asarray(values, float).reshape(len(t), -1)
    heard = np.flatnonzero(flat.any(axis=1))
    if not len(heard):
        return np.zeros((len(omega), *np.shape(values)[1:]), complex)
    some = slice(max(heard[0] - 1, 0), heard[-1] + 2)  # what a window closes is nothing
    flat, t, complex_omega = flat[some], t[some], omega + 1j * sigma
    apart = (omega[-1] - omega[0]) / max(len(omega) - 1, 1)
    even = np.allclose(omega, omega[0] + apart * np.arange(len(omega)), rtol=1e-13)
    if even and len(omega) * flat.size > _MANY:
        total = _at_even_frequencies(flat, t, step, complex_omega[0], apart, len(omega))
    else:
        total = _at_each(flat, t, step, complex_omega)
    for end in (0, -1):
        total -= np.multiply.outer(np.exp(1j * complex_omega * t[end]) / 2, flat[end])
    return np.asarray(step * total).reshape(len(omega), *np.shape(values)[1:])


def _at_each(flat: Float, t: Float, step: float, omega: Complex) -> Complex:
    """Σ_n u_n e^{iωt_n} at each ω, shape (n, columns)."""
    frames, columns = flat.shape
    # Few columns are summed over runs of samples and then over these, which needs the exponentials
    # of some times only; of many columns the sums are what takes the time.
    runs = max(1, min(math.isqrt(frames), _AT_ONCE // max(columns, 1)))
    each = -(-frames // runs)
    runs = -(-frames // each)
    padded = np.pad(flat, [(0, runs * each - frames), (0, 0)]) if runs > 1 else flat
    by_run = padded.reshape(runs, each, columns).swapaxes(0, 1).reshape(each, -1)
    total = np.empty((len(omega), columns), complex)
    rows = max(1, _HELD // (each + runs * columns))
    for first in range(0, len(omega), rows):  # a long record is seen at many frequencies
        own = omega[first : first + rows]
        within = np.exp(1j * np.multiply.outer(own, step * np.arange(each)))
        begins = np.exp(1j * np.multiply.outer(own, t[::each]))
        found = np.empty((len(own), runs * columns), complex)
        found.real, found.imag = within.real @ by_run, within.imag @ by_run
        total[first : first + rows] = (begins[:, None, :] @ found.reshape(len(own), runs, columns))[
            :, 0
        ]
    return total


def _at_even_frequencies(
    flat: Float, t: Float, step: float, omega: complex, apart: float, count: int
) -> Complex:
    """The same at ω + mδ, m ≥ 0, by chirps: by nm = ½(n² + m² − (m − n)²) it is a convolution.

    Rabiner, Schafer & Rader, IEEE Trans. Audio Electroacoust. 17, 86 (1969).
    """
    frames, turns = len(flat), apart * step / (2 * np.pi)

    def chirp(n: Float) -> Complex:
        return np.asarray(np.exp(1j * np.pi * np.fmod(turns * n * n, 2.0)))

    n, m = np.arange(frames, dtype=float), np.arange(count, dtype=float)
    size = fast_length(frames + count - 1)
    kernel = np.zeros(size, complex)
    kernel[:count], kernel[size - frames + 1 :] = chirp(m), chirp(n[:0:-1])
    known, total = np.fft.fft(kernel.conj()), np.empty((count, flat.shape[1]), complex)
    weight = np.exp(1j * omega * step * n) * chirp(n)
    after = chirp(m) * np.exp(1j * (omega + apart * m) * t[0])
    for column, u in enumerate(flat.T):
        total[:, column] = np.fft.ifft(np.fft.fft(u * weight, size) * known)[:count] * after
    return total


def truncation(largest: Float, omega: Float, sigma: float, damping: float) -> Float:
    """What a record's end leaves out of its transform, of all that still rings there.

    A wave that rings at ω′ with the transform U′ there leaves U′ e^{−σT} σ/|σ + i(ω − ω′)| at ω.

    Args:
        largest: |U| where it is largest, shape (n,).
        omega: real frequencies, shape (n,), rad/s.
        sigma, damping: σ (rad/s), and σT.

    Returns:
        Shape (n,), unit of U.
    """
    nearness = sigma / np.hypot(sigma, omega[:, None] - omega)
    return np.asarray((largest * nearness).max(axis=1) * np.exp(-damping))
