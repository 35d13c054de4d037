"""Transforms at complex frequency, of records that do not end.

Inside a gap the ringing of the band edges never ends, and a plain Fourier ratio is wrong by 10 %
and more. Weighted by exp(−σt) the record ends, and its transform is that of the unending one at
the complex frequency ω + iσ, where it decays as exp(ikx) with the plane-wave root k(ω + iσ).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[Any]
Complex = NDArray[np.complex128]


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
    weight = np.full(len(t), t[1] - t[0])
    weight[[0, -1]] /= 2
    kernel = np.exp(1j * np.multiply.outer(omega + 1j * sigma, t)) * weight
    flat = np.asarray(values).reshape(len(t), -1)
    found = np.empty((len(omega), flat.shape[1]), complex)
    found.real, found.imag = kernel.real @ flat, kernel.imag @ flat
    return found.reshape(len(omega), *np.shape(values)[1:])
