"""Where a signal leaves the noise: the first break, by Maeda's criterion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[Any]

# Noise is taken to be at least this part of the peak: below it a smooth onset has no beginning.
_LEAST_NOISE = 1e-3
# The envelope of white noise of N samples peaks at about √(2 ln N) deviations: 4.5 for 20000.
DETECTED = 6.0
# Noise alone gains up to 20 or so at the best of a thousand divisions.
_LEAST_GAIN = 30.0
# Samples on either side of a division.
_FEWEST = 8
AT_THE_END = "the largest amplitude stands at an end of the record: record longer"
WEAK = "no arrival stands out of the noise: average more, or listen nearer"


def envelope(values: Float) -> Float:
    """|u + iHu|, H the Hilbert transform, padded against wrapping round; shape of u, (nt,)."""
    count = len(values)
    hat = np.fft.fft(values, 2 * count)
    hat[1:count] *= 2
    hat[count + 1 :] = 0
    return np.abs(np.fft.ifft(hat))[:count]


def onset(values: Float) -> tuple[float, float, str]:
    """First break by Maeda's criterion, in samples.

        A(n) = n ln var(u₁…u_n) + (N − n − 1) ln var(u_{n+1}…u_N)

    up to where the envelope has fallen to half of its peak: where n divides noise from signal best,
    A is least. As A is −2 ln of a likelihood, exp(−A/2) weighs the n; the error is √ of the
    variance under it. There is an arrival where A is less by 30 than for a signal without any.
    A smooth onset is picked where it leaves the noise, so later for more noise; variances count
    as at least (1e-3 of the peak)². Maeda, Zisin 38, 365 (1985).

    Args:
        values: u, shape (nt,).

    Returns:
        (first sample of the signal, its error, reason); NaN with the reason where none stands out.
    """
    size = envelope(values)
    at = int(np.argmax(size))
    peak = float(size[at])
    if not peak > 0:
        return np.nan, np.nan, "the signal is 0"
    below = np.flatnonzero(size[at:] < peak / 2)
    last = max(at + (int(below[0]) if len(below) else len(size)), at + _FEWEST)
    last = min(last, len(values))
    if at < _FEWEST or last < 3 * _FEWEST:
        return np.nan, np.nan, AT_THE_END
    found = division(values[:last], peak)
    if found is None:
        return np.nan, np.nan, AT_THE_END
    if DETECTED * found.before > peak or found.gain < _LEAST_GAIN:
        return np.nan, np.nan, WEAK
    return found.place, found.error, ""


@dataclass(frozen=True)
class Division:
    """Where noise ends and signal begins.

    Attributes:
        place, error: first sample of the signal and its error, in samples.
        gain: by how much −2 ln of the likelihood falls by dividing there.
        before: standard deviation before it, unit of u.
    """

    place: float
    error: float
    gain: float
    before: float


def division(values: Float, peak: float) -> Division | None:
    """The best division of a stretch by Maeda's criterion; None where it is too short.

    Args:
        values: u, shape (n,), which ends with the signal.
        peak: of the signal, unit of u.
    """
    last = len(values)
    if last < 2 * _FEWEST:
        return None
    u = values / peak
    n = np.arange(_FEWEST, last - _FEWEST // 2)

    def variances(row: Float) -> Float:
        count = np.arange(1, len(row) + 1)
        return np.cumsum(row**2) / count - (np.cumsum(row) / count) ** 2

    before = np.maximum(variances(u)[n - 1], 0) + _LEAST_NOISE**2
    after = np.maximum(variances(u[::-1])[::-1][n], 0) + _LEAST_NOISE**2
    criterion = n * np.log(before) + (last - n - 1) * np.log(after)
    best = int(np.argmin(criterion))
    undivided = last * np.log(np.var(u) + _LEAST_NOISE**2)
    weight = np.exp(-(criterion - criterion[best]) / 2)
    weight /= weight.sum()
    spread = float(np.sqrt(np.sum(weight * (n - n[best]) ** 2)))
    # A sample is a width too: the break lies between two.
    return Division(
        float(n[best]),
        float(np.hypot(spread, 12**-0.5)),
        float(undivided - criterion[best]),
        float(np.sqrt(before[best]) * peak),
    )
