"""What a peak of a spectrum has to stand out of: noise, leakage between wavenumbers, broad lines.

Noise that is not white, the waves of other wavenumbers that receivers of unequal gain let through,
and lines that are broad and random (thermal motion) all leave a continuum about a frequency. A wave
is a line that stands out of the continuum close to it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft, ifft
from scipy.ndimage import maximum_filter1d
from scipy.special import gammaincinv

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


def leakage_of_gains(power: Float, left: Float, per_bin: float) -> Float:
    """Power below which a peak may be what unequal gains leave of other wavenumbers' waves.

    Args:
        power: at the wavenumbers 2πm/X of a ring, m = 1 … n, shape (n, nω).
        left: D(q), variance of what gains are off by (``wavesim/records/faults/gains.py``), shape
            (nx,), –.
        per_bin: points of the power per bin 2π/T, –.

    Returns:
        Shape (n, nω); 0 where nothing leaks.
    """
    if not left.any():
        return np.zeros_like(power)
    nx, n = len(left), len(power)
    whole = np.zeros((nx, power.shape[1]))
    whole[1 : n + 1] += power
    whole[-1 : -n - 1 : -1] += power
    if 2 * n == nx:
        whole[n] /= 2
    spread = ifft(fft(whole, axis=0) * fft(left)[:, None], axis=0).real[1 : n + 1]
    near = 2 * round(_LOBE_BINS * per_bin) + 1
    return np.asarray(FLOOR_OVER_MEAN * maximum_filter1d(np.maximum(spread, 0), near, axis=1))
