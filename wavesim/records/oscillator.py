"""An oscillator driven from rest by a Ricker pulse, in closed form.

    q̈ + 2γq̇ + (ω² + γ²) q = s(t),    s = (1 − 2u²) e^{−u²},  u = c(t − t₀),  c = π f_p

    q(t) = Im I(t) / ω,    I = ∫_{−∞}^t e^{iΩ(t−τ)} s(τ) dτ,    Ω = ω + iγ

With s = −G″/2c², G = e^{−u²}, two integrations by parts leave the integral of a Gaussian, which
is the Faddeeva function w(z) = e^{−z²} erfc(−iz) (Abramowitz & Stegun 7.1.3): no quadrature, and
exact to rounding at every time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import wofz

Float = NDArray[Any]


def driven(omega: Float, t: Float, peak_frequency: float, delay: float) -> Float:
    """q of the driven oscillator.

    Args:
        omega: ω, shape (m,), ≥ 0, rad/s; complex ω − iγ for one that decays as e^{−γt}. A free
            mass, ω = 0, goes as −G/2c².
        t: times, shape (nt,), s.
        peak_frequency: f_p of the pulse, Hz.
        delay: t₀, time of the pulse's peak, s.

    Returns:
        Shape (nt, m), s².
    """
    turned = np.conj(np.asarray(omega, complex))
    c = np.pi * peak_frequency
    tau = (np.asarray(t, float) - delay)[:, None]
    after = tau > 0
    gauss = np.exp(-((c * tau) ** 2))
    # erfc(z) for z = −(cτ + iΩ/2c): where Re z < 0 as 2 − erfc(−z).
    z = np.where(after, 1, -1) * (c * tau + 0.5j * turned / c)
    tail = gauss * wofz(1j * z)
    whole = 2 * np.exp(np.where(after, 1j * turned * tau, 0) - turned**2 / (4 * c**2))
    integral = np.sqrt(np.pi) / (2 * c) * np.where(after, whole - tail, tail)
    slope = -2 * c**2 * tau * gauss
    response = -(slope + 1j * turned * gauss - turned**2 * integral) / (2 * c**2)
    free = turned == 0
    return np.where(free, -gauss / (2 * c**2), response.imag / np.where(free, 1, turned.real))
