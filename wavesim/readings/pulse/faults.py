"""What only a pulse test shows of its signals: padding, muting, a reversed receiver, a second gain.

What is wrong with any record is looked for by :mod:`wavesim.records.faults`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.quantisation import quanta
from wavesim.simulation.bandlimited import cross_correlation

Float = NDArray[Any]

# Equal samples in a row before the signal are a padding; after it, by so many more at one receiver
# than at another, a muting.
_PADDING, _MUTED = 16, 4
# A receiver turned over must leave this part of what was left before, and little at all; looked at
# where every receiver has this part of its peak spectrum.
_TURNED = 0.15
# A signal is another's turned over where it correlates so much better that way, and so well.
_OPPOSED, _COPY = 1.15, 0.7
# Two gains leave this part of what a line leaves of ln|U| along the receivers, of so many at least
# two have the other one, and it is this many times as large.
_STEP_LEAVES, _FEWEST_OF_STEP, _STEP = 0.02, 6, 1.05
_FITS = 0.03
_IN_BAND = 0.3


def padding(values: Float) -> int:
    """Samples at the beginning that were filled in: all equal, and noise sets in at once.

    A simulated signal is 0 before its front and grows from nothing: no padding.
    """
    other = np.flatnonzero(values != values[0])
    if not len(other) or other[0] < _PADDING or quanta(values[None, :, None])[0] > 0:
        return 0
    lead = int(other[0])
    early, later = values[lead : lead + 8], values[lead + 8 : lead + 16]
    if len(later) < 8:
        return 0
    level, then = np.std(early), np.std(later)
    peak = np.abs(values - values[0]).max()
    return lead if level > 1e-5 * peak and level > 0.2 * then else 0


def muted(values: Float) -> str:
    """Why spectra tell nothing of signals that were muted after the wave, at each receiver by a
    time of its own; "" of others.

    Args:
        values: u, shape (nt, m).
    """
    equal = np.array([int(np.argmax((u != u[-1])[::-1])) for u in values.T])
    if np.ptp(np.where(quanta(values[None]) > 0, 0, equal)) < _MUTED:
        return ""
    return (
        "signals are muted after the wave, and c, α and Q would be those of the part that is left: "
        "give them as they were recorded"
    )


def reversed_receivers(values: Float, x: Float) -> list[int]:
    """Receivers whose sign is the other one's, among four or more that one wave passes.

    At each frequency of the band the phases are those of e^{ikx} for some k: how well they are,
    Σ_j |U_j|⁻¹ U_j e^{−ikx_j}/m at the best k, is looked at with all as they stand, and with one
    turned over.

    Args:
        values: u, shape (nt, m).
        x: positions, ascending, shape (m,), m.

    Returns:
        Their indices: one at most, as of two it could be the others.
    """
    m = values.shape[1]
    if m < 4:
        return []
    U = np.fft.rfft(values, axis=0)
    size = np.abs(U)
    strength = np.min(size / np.maximum(size.max(axis=0), 1e-300), axis=1)
    band = np.flatnonzero(strength[1:] >= _IN_BAND) + 1
    if len(band) < 3:
        return []
    band = band[:: -(-len(band) // 60)]
    phases = U[band] / size[band]
    most = np.pi / np.min(np.diff(x))
    k = np.arange(-most, most, 0.4 / (x[-1] - x[0]))
    carried = np.exp(-1j * np.outer(x, k))

    def apart(signs: Float) -> float:
        return float(np.mean(1 - np.abs((phases * signs) @ carried).max(axis=1) / m))

    signs = np.ones((m, m)) - 2 * np.eye(m)
    turned = [apart(row) for row in signs]
    best = int(np.argmin(turned))
    clear = turned[best] < _FITS and turned[best] < _TURNED * apart(np.ones(m))
    return [best] if clear else []


def opposed(values: Float) -> list[int]:
    """Receivers whose signals are more like the first's when turned over, by their correlation.

    Args:
        values: u, shape (nt, m).
    """
    size = np.maximum(np.linalg.norm(values, axis=0), 1e-300)
    each = [cross_correlation(u, values[:, 0]) / size[0] / s
            for u, s in zip(values.T, size, strict=True)]  # fmt: skip
    return [j for j, c in enumerate(each) if -c.min() > max(_OPPOSED * c.max(), _COPY)]


def second_gain(values: Any, x: Float, above: NDArray[np.bool_]) -> str:
    """Why amplitudes tell nothing, where the receivers beyond one have another gain; "" elsewhere.

    The mean over frequency of ln|U| then steps from one line in x to another.

    Args:
        values: spectra U, shape (n, nx).
        x: positions, shape (nx,), m.
        above: where |U| stands above the noise, shape (n, nx).
    """
    count = len(x)
    own = above.all(axis=1)
    if count < _FEWEST_OF_STEP or not own.any():
        return ""
    mean = np.log(np.abs(values[own])).mean(axis=0)
    line = np.stack([np.ones(count), (x - x.mean()) / np.ptp(x)], axis=1)

    def left(*columns: Float) -> tuple[float, float]:
        design = np.column_stack([line, *columns])
        found = np.linalg.lstsq(design, mean, rcond=None)[0]
        return float(np.sum((mean - design @ found) ** 2)), float(found[-1])

    alone = left()[0]
    steps = [(*left(1.0 * (np.arange(count) >= at)), at) for at in range(2, count - 1)]
    least, step, at = min(steps)
    if least > _STEP_LEAVES * alone or abs(step) < np.log(_STEP):
        return ""
    return (
        f"receivers from x = {x[at]:.4g} m on are {np.exp(step):.3g} times as strong as the loss "
        "before them foretells, at all frequencies: a second gain; divide them by it"
    )
