"""What a peak of a spectrum has to stand out of: noise, leakage between wavenumbers, broad lines.

Noise that is not white, the waves of other wavenumbers that receivers of unequal gain let through,
and lines that are broad and random (thermal motion) all leave a continuum about a frequency. A wave
is a line that stands out of the continuum close to it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.special import gammaincinv

Float = NDArray[Any]

# The continuum close to a frequency is looked for within so many bins 2π/T.
_BLOCK_BINS = 32
# Side lobes in time, over their wave's own power, that are no leakage: of Blackman–Harris.
_SIDE_LOBES = 1e-8
# Leakage is looked for at frequencies where a wave is above this part of the strongest.
_STRONG = 1e-4
_FEWEST_WAVENUMBERS = 8
# Below this part of a line close by, a wavenumber's power is that line's flank.
_FLANK = 0.03
# Leakage above this part is none that can be told from waves that hardly depend on k.
_MOST_LEAKAGE = 3e-3
# Leakage is above this many times its own median at one of hundreds of wavenumbers.
_ABOVE_MEDIAN = 20.0
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


def leakage(power: Float, per_bin: float) -> Float:
    """Power at each frequency that the waves of one wavenumber leave at all others, shape (nω,).

    Receivers of unequal gain, or a dead one among them, multiply the field by g(x), so that a wave
    at k′ shows at every k with |ĝ(k − k′)|² of its power. How much that is at a frequency, is told
    where one wavenumber is far above the others: the median over k of what those have there.

    Args:
        power: of all wavenumbers of a ring, windowed in time, shape (n, nω).
        per_bin: points of it per bin 2π/T, –.

    Returns:
        The power below which a peak may be another wavenumber's; 0 where nothing leaks.
    """
    n, count = power.shape
    top = power.max(axis=0)
    if n < _FEWEST_WAVENUMBERS or not top.max() > 0:
        return np.zeros(count)
    near = 2 * round(_LOBE_BINS * per_bin) + 1
    # What stands on the flank of a wavenumber's own line is that line's.
    own = power < _FLANK * maximum_filter1d(power, near, axis=1)
    noise = np.median(power, axis=1) + _SIDE_LOBES * power.max(axis=1)
    above = np.where(own, np.nan, np.maximum(power - 2 * noise[:, None], 0.0))
    enough = np.isfinite(above).sum(axis=0) >= _FEWEST_WAVENUMBERS
    usual = np.zeros(count)
    usual[enough] = np.nanmedian(above[:, enough], axis=0)
    usual[usual > _MOST_LEAKAGE * top] = 0.0
    usual[top < _STRONG * top.max()] = 0.0
    return np.asarray(_ABOVE_MEDIAN * maximum_filter1d(usual, near))
