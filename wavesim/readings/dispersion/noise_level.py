"""What a wave has to stand out of: noise, leakage between wavenumbers, broad lines.

Noise that is not white, the waves of other wavenumbers that receivers of unequal gain let through,
and lines that are broad and random (thermal motion) all leave a continuum about a frequency. A wave
is a line that stands out of the continuum close to it.

Of a receiver's transform: white noise shows where there is no signal, at the highest frequencies.
Noise in the signal's own band, of wind or of a filtered amplifier, shows before the signal comes.
Samples on a ladder of steps q have q/√12 in any case.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft, ifft
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.special import gammaincinv

from wavesim.records.windows import noise_density

Float = NDArray[Any]

# The continuum close to a frequency is looked for within so many bins 2π/T.
_BLOCK_BINS = 32
# Leakage is above this many times its mean at one of hundreds of wavenumbers.
FLOOR_OVER_MEAN = 20.0
# Leakage of lines that stand close peaks between them too: half a main lobe.
_LOBE_BINS = 3.0


def continuum(power: Float, per_bin: float, channels: int = 1) -> Float:
    """Median of the noise about each frequency, as the lower quartile within 32 bins tells it.

    Lines may take up to three quarters of those bins; the highest of three such stretches counts.

    Args:
        power: periodograms, shape (n, nω).
        per_bin: points of them per bin 2π/T, –.
        channels: of how many series each is the sum, –.

    Returns:
        Shape (n, nω), unit of the power; no lower than the median of all frequencies.
    """
    n, count = power.shape
    size = max(8, round(_BLOCK_BINS * per_bin))
    blocks = max(1, count // size)
    size = count // blocks
    inner = power[:, : blocks * size].reshape(n, blocks, size)
    # |noise|² of each channel is distributed exponentially, and so their sum as Γ(channels).
    to_median = float(gammaincinv(channels, 0.5) / gammaincinv(channels, 0.25))
    quartile = np.partition(inner, size // 4, axis=2)[:, :, size // 4] * to_median
    # Where noise ends within a block, its neighbour tells how high it is.
    higher = maximum_filter1d(quartile, 3, axis=1, mode="nearest")
    local = higher[:, np.minimum(np.arange(count) // size, blocks - 1)]
    return np.maximum(local, np.median(power, axis=1, keepdims=True))


def leakage_of_gains(power: Float, left: Float, per_bin: float, first: int = 1) -> Float:
    """Power below which a peak may be what unequal gains leave of other wavenumbers' waves.

    Args:
        power: at the wavenumbers 2πm/X of a ring, m from the first on, shape (n, nω).
        left: D(q), variance of what gains are off by (``records/faults/ring_misfits.py``), shape
            (nx,), –.
        per_bin: points of the power per bin 2π/T, –.
        first: m of the first, 0 or 1.

    Returns:
        Shape (n, nω); 0 where nothing leaks.
    """
    if not left.any():
        return np.zeros_like(power)
    nx, n = len(left), len(power)
    whole = np.zeros((nx, power.shape[1]))
    m = np.arange(first, first + n)
    whole[m] += power
    whole[-m] += power
    whole[m[2 * m % nx == 0]] /= 2
    spread = ifft(fft(whole, axis=0) * fft(left)[:, None], axis=0).real[m]
    near = 2 * round(_LOBE_BINS * per_bin) + 1
    return np.asarray(FLOOR_OVER_MEAN * maximum_filter1d(np.maximum(spread, 0), near, axis=1))


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
        own = noise_density(values[:quiet, at], interval, omega / (2 * np.pi)) / interval
        variance[:, at] = np.maximum(variance[:, at], own)
    return np.maximum(variance, (ROUNDING * peak.max(initial=0.0)) ** 2)


# A band is where power smoothed over so many bins is above this part of the highest, and so many
# times the noise's.
_SMOOTHED, _FAINT, _ABOVE_NOISE = 5, 1e-4, 4.0


def excited_frequencies(
    values: Float, interval: float, quantum: Float | float = 0.0
) -> tuple[float, float]:
    """The lowest and the highest frequency at which something is above the noise, rad/s.

    Args:
        values, interval, quantum: as of :func:`noise_variance`.
    """
    omega = 2 * np.pi * np.fft.rfftfreq(len(values), interval)[1:]
    power = np.mean(np.abs(np.fft.rfft(values, axis=0)[1:] * interval) ** 2, axis=1)
    noise = np.mean(noise_of_transform(values, interval, omega, quantum) ** 2, axis=1)
    power = uniform_filter1d(power, _SMOOTHED, mode="nearest")
    loud = np.flatnonzero((power > _FAINT * power.max()) & (power > _ABOVE_NOISE * noise))
    if not len(loud):
        return float(omega[0]), float(omega[-1])
    return float(omega[loud[0]]), float(omega[loud[-1]])


def noise_of_transform(
    values: Float, interval: float, omega: Float, quantum: Float | float = 0.0
) -> Float:
    """Standard deviation of ∫ n e^{iωt} dt over the record for the noise n, shape (nω, nx).

    Args:
        values, interval, omega, quantum: as of :func:`noise_variance`.
    """
    variance = noise_variance(values, interval, omega, quantum)
    return np.asarray(np.sqrt(variance * len(values)) * interval)
