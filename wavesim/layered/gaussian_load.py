"""What a Gaussian source makes of one wave, in closed form.

With g the Gaussian of unit integral about x_s with standard deviation w, a wave e^{ikx}, Im k ≥ 0,
leaves x₀ … x₁ with

    ∫ e^{ik(x₁ − x)} g(x) dx = ½ e^{ik(x₁ − x_s) − κ²} [erf(u₁ + iκ) − erf(u₀ + iκ)],

u = (x − x_s)/√2w, κ = kw/√2; erf by Faddeeva's function, so that no part of it overflows.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

# Beyond this many standard deviations a Gaussian is below 1e-15 of its top, and taken as 0.
CUT = 8.5


def sent(k: Any, start: float, end: float, centre: float, width: float) -> Any:
    """The integral above, shape of k; positions and width in the unit of 1/k.

    For what travels left, mirror the positions: sent(k, −end, −start, −centre, width).
    """
    from scipy.special import wofz

    out = end
    start, end = max(start, centre - CUT * width), min(end, centre + CUT * width)
    if end <= start:
        return np.zeros_like(k)
    kappa = k * width / math.sqrt(2)
    terms, signs = [], []
    for x in (start, end):
        u = (x - centre) / (math.sqrt(2) * width)
        z = u + 1j * kappa
        sign = np.where(z.real >= 0, 1.0, -1.0)
        terms.append(sign * np.exp(1j * k * (out - x) - u**2) * wofz(1j * sign * z))
        signs.append(sign)
    # erfc(z) = 2 − erfc(−z): the 2s cancel unless Re z changes sign in between.
    crossed = signs[1] - signs[0]
    exponent = np.where(crossed != 0, 1j * k * (out - centre) - kappa**2, 0)
    return (terms[0] - terms[1] + crossed * np.exp(exponent)) / 2


def density(x: float, centre: float, width: float) -> float:
    """g(x), 0 beyond the cut."""
    u = (x - centre) / width
    return math.exp(-(u**2) / 2) / (math.sqrt(2 * math.pi) * width) if abs(u) <= CUT else 0.0
