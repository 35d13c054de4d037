"""How much noise a receiver's transform holds, at each frequency.

White noise shows where there is no signal: at the highest frequencies. Noise in the signal's own
band, of wind or of a filtered amplifier, shows before the signal comes. Samples on a ladder of
steps q have q/√12 in any case.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[Any]

# What is before a receiver's first sample above so many deviations of its first part is quiet.
_FIRST_PART = 0.04
_ABOVE_FIRST = 6.0
_QUIET_PART = 0.8
_FEWEST_QUIET = 48
_LEAST_NOISE = 1e-5
_FEWEST_LIVE = 16
# Rounding, over the largest value.
ROUNDING = 1e-15


def white_level(values: Float, quantum: Float | float = 0.0) -> Float:
    """Deviation of a white noise as high as the highest tenth in frequency, shape (nx,).

    Args:
        values: shape (nt, nx); what is exactly constant at either end does not count as signal.
        quantum: q, the least step between samples, shape (nx,) or (), unit of the values.
    """
    live = np.flatnonzero((np.diff(values, axis=0) != 0).any(axis=1))
    inner = values[live[0] : live[-1] + 2] if len(live) > _FEWEST_LIVE else values
    window = np.hanning(len(inner))
    spectrum = np.abs(np.fft.rfft(inner * window[:, None], axis=0)) ** 2
    top = spectrum[-max(4, len(spectrum) // 10) : -1]
    white = np.sqrt(np.median(top, axis=0) / np.log(2) / np.sum(window**2))
    return np.asarray(np.maximum(white, np.asarray(quantum) / np.sqrt(12)))


def noise_variance(
    values: Float, interval: float, omega: Float, quantum: Float | float = 0.0
) -> Float:
    """Variance of a white noise as dense as the record's at each frequency, shape (nω, nx).

    Of m samples the transform Σ n e^{iωt} has m times that.

    Args:
        values: u, shape (nt, nx).
        interval: Δt, s.
        omega: ω, shape (nω,), rad/s.
        quantum: q, the least step between samples, shape (nx,) or (), unit of the values.
    """
    from scipy.signal import welch  # slow to import, and only a reading needs it

    count, receivers = values.shape
    variance = np.tile(white_level(values, quantum) ** 2, (len(omega), 1))
    head = values[: max(16, int(_FIRST_PART * count))]
    middle, spread = head.mean(axis=0), head.std(axis=0)
    peak = np.abs(values).max(axis=0)
    loud = np.abs(values - middle) > _ABOVE_FIRST * spread + 1e-12 * peak
    first = np.where(loud.any(axis=0), loud.argmax(axis=0), count)
    for at in range(receivers):
        quiet = int(_QUIET_PART * first[at])
        # What is less is the foot of a pulse, which no instrument's noise leaves to be seen.
        if quiet < _FEWEST_QUIET or not spread[at] > _LEAST_NOISE * peak[at]:
            continue
        f, power = welch(values[:quiet, at], 1 / interval, nperseg=max(16, quiet // 4))
        own = np.interp(omega / (2 * np.pi), f[1:-1], power[1:-1]) / (2 * interval)
        variance[:, at] = np.maximum(variance[:, at], own)
    return np.maximum(variance, (ROUNDING * peak.max(initial=0.0)) ** 2)


def noise_of_transform(
    values: Float, interval: float, omega: Float, quantum: Float | float = 0.0
) -> Float:
    """Standard deviation of ∫ n e^{iωt} dt over the record for the noise n, shape (nω, nx).

    Args:
        values, interval, omega, quantum: as of :func:`noise_variance`.
    """
    variance = noise_variance(values, interval, omega, quantum)
    return np.asarray(np.sqrt(variance * len(values)) * interval)
