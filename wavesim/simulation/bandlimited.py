"""Values and slopes between samples, by a sinc under a Kaiser window.

    u(s) = Σ_n u_n sinc(s − n) w(s − n),    w(y) = I₀(b √(1 − (y/H)²)) / I₀(b)

With H = 24 and b = 14 the error is below 1e-6 of the peak for signals below 0.8 of the Nyquist
frequency. Outside the record u is taken for 0. Kaiser & Schafer, IEEE Trans. ASSP 28, 105 (1980).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.special import i0

Float = NDArray[Any]

_HALF = 24
_SHAPE = 14.0


def between(values: Float, position: ArrayLike) -> Float:
    """u at positions between samples.

    Args:
        values: samples u_n, shape (nt,).
        position: s, in samples from the first, any shape.

    Returns:
        u(s), shape of position.
    """
    s = np.asarray(position, float)
    first = np.floor(s).astype(int)
    n = first[..., None] + np.arange(1 - _HALF, _HALF + 1)
    y = s[..., None] - n
    window = i0(_SHAPE * np.sqrt(np.maximum(1 - (y / _HALF) ** 2, 0))) / i0(_SHAPE)
    inside = (n >= 0) & (n < len(values))
    samples = np.where(inside, values[np.clip(n, 0, len(values) - 1)], 0)
    return np.asarray(np.sum(samples * np.sinc(y) * window, axis=-1))


def slope(values: Float, position: float, step: float = 0.02) -> float:
    """du/ds by a central difference of the interpolant, per sample."""
    low, high = between(values, [position - step, position + step])
    return float((high - low) / (2 * step))


def top(values: Float, start: int) -> float:
    """Position of the local maximum within a sample of the one at ``start``, in samples.

    The zero of the slope; ``start`` itself where it stands at an end of the record.
    """
    if not 0 < start < len(values) - 1:
        return float(start)
    low, high = start - 1.0, start + 1.0
    if not slope(values, low) > 0 > slope(values, high):
        return float(start)
    return float(brentq(lambda s: slope(values, s), low, high, xtol=1e-9))
