"""Samples taken in turn by two converters that differ in level, gain and delay."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy  # its parts are loaded where they are used: they take a while
from numpy.typing import NDArray

from wavesim.records.faults.finding import CURED, Finding, places

Float = NDArray[Any]

# Taps of the half-band filter that parts a signal from its image, and the fewest frames.
_TAPS, _FEWEST = 41, 256
# The image stands above what is by chance in so many numbers' worth of the upper half band by this
# factor, and is this part of all that is there, in each of so many parts that hold as much of it.
_ABOVE, _PART, _PARTS = 25.0, 0.5, 8
# Converters of one board are alike to this part in gain, and to this part of an interval in time;
# more is a signal about a quarter of the sampling frequency, or one of many harmonics.
_UNLIKE = 0.1


def one_converter(values: Float, x: Float, labels: tuple[str, ...], found: list[Finding]) -> Float:
    """Values without the image of one converter in the other's samples.

    Two that sample in turn, of gains 1 ± ε, levels ± b and delays ± τ, give of s(t)

        y_n = s_n + (−1)ⁿ (b + ε s_n − τ ṡ_n),

    so that each wave of frequency ω stands again at π/Δt − ω. Of a signal that lies below a
    quarter of the sampling frequency these three parts are found by least squares of what lies
    above. (Kurosawa et al., IEEE Trans. Circuits Syst. I 48 (2001) 261.)

    Args:
        values: shape (C, nt, nx), finite.
        x, labels: places and names of the receivers.
        found: findings, added to.
    """
    if values.shape[1] < _FEWEST or not np.isfinite(values).all():
        return values
    frames = values.shape[1]
    low, turn = _below(values), ((-1.0) ** np.arange(frames))[:, None]
    high, rises = values - low, np.gradient(low, axis=1)
    alike = np.max(
        [np.abs(_correlation(high, turn * part)) for part in (np.ones_like(low), low, rises)],
        axis=0,
    )
    image, which, most = None, np.zeros(values.shape[2], bool), 0.0
    inside = slice(_TAPS, -_TAPS)
    # Where an image is most of what is above, one of three parts is a third of that.
    for c, j in np.argwhere(alike > np.sqrt(_PART / 3) / 2):
        parts = turn * np.stack([np.ones(frames), low[c, :, j], rises[c, :, j]], axis=-1)
        # Of each part what the filter leaves of it above.
        a, h = (parts - _below(parts[None])[0])[inside], high[c, inside, j]
        size = np.sqrt(np.sum(a**2, axis=0)) + 1e-300
        amount = np.linalg.lstsq(a / size, h, rcond=1e-9)[0] / size
        fit = a @ amount
        left = float(np.sum((h - fit) ** 2))
        told = float(np.sum(h**2)) - left
        chance = left * len(amount) / (len(h) / 2)
        alike_enough = np.abs(amount[1:]).max() < _UNLIKE
        if told > _ABOVE * chance and alike_enough and _all_along(h, fit):
            image = np.zeros_like(values) if image is None else image
            image[c, :, j] = parts @ amount
            which[j] = True
            most = max(most, float(np.abs(image[c, :, j]).max() / np.abs(values[c, :, j]).max()))
    if image is None:
        return values
    where = places(x, which, labels)
    found.append(
        Finding("interleaved", where, f"up to {100 * most:.2g} % of the peak", CURED,
                f"every other sample differs by up to {100 * most:.2g} % of the peak, as of two "
                f"converters in turn: put right ({where})")
    )  # fmt: skip
    return values - image


def _below(values: Float) -> Float:
    """What of values, (C, nt, nx), lies below a quarter of the sampling frequency."""
    n = np.arange(_TAPS) - _TAPS // 2
    taps = np.sinc(n / 2) * np.hamming(_TAPS)
    return np.asarray(scipy.ndimage.convolve1d(values, taps / taps.sum(), axis=1, mode="nearest"))


def _correlation(u: Float, v: Float) -> Float:
    """Σ u v over what both have, over all times, shape (C, nx)."""
    size = np.sqrt(np.sum(u**2, axis=1) * np.sum(v**2, axis=1)) + 1e-300
    return np.asarray(np.sum(u * v, axis=1) / size)


def _all_along(high: Float, fit: Float) -> bool:
    """Whether an image is most of what is above all along the record, and not where it breaks."""
    so_far = np.cumsum(fit**2)
    part = np.minimum(_PARTS * so_far / max(so_far[-1], 1e-300), _PARTS - 1).astype(int)
    left, all_of_it = (np.bincount(part, one, _PARTS) for one in ((high - fit) ** 2, high**2))
    return bool((left < (1 - _PART) * all_of_it).all())
