"""The digitiser's least step (LSB) of each channel, read off its samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.finding import WIDENED, Finding, places

Float = NDArray[Any]

# All differences are multiples of the step to this part of it.
_MULTIPLE = 0.02
# Samples of so few repeated values are no digitiser's.
_REPEATED = 0.5
# A step is told of where its noise q/√12 is this part of the peak and more.
_WORTH_TELLING = 1e-4


def quanta(values: Float) -> Float:
    """The least step between samples of each receiver, 0 where they are not quantised.

    Args:
        values: shape (C, nt, nx), as recorded.

    Returns:
        q, shape (nx,), unit of the values; the coarsest component's.
    """
    result = np.zeros(values.shape[2])
    for component in values:
        ordered = np.sort(component, axis=0)
        repeated = np.mean(np.diff(ordered, axis=0) == 0, axis=0)
        for j in np.flatnonzero(repeated > _REPEATED):
            result[j] = max(result[j], _step(ordered[:, j]))
    return result


def _step(ordered: Float) -> float:
    levels = np.unique(ordered[np.isfinite(ordered)])
    if len(levels) < 3:
        return 0.0
    gaps = np.diff(levels)
    # Levels that differ by rounding alone are one.
    q = float(gaps[gaps > 1e-9 * (levels[-1] - levels[0])].min())
    turns = (levels - levels[0]) / q
    # The step of one gap is known to rounding; over the whole range it is known better.
    for _ in range(3):
        whole = np.round(turns)
        q *= float(np.sum(turns * whole) / np.sum(whole**2))
        turns = (levels - levels[0]) / q
    off = np.abs(turns - np.round(turns)).max()
    return q if off < max(_MULTIPLE, 1e-6 * turns[-1]) and turns[-1] < 2**24 else 0.0


def tell(
    quantum: Float, values: Float, x: Float, labels: tuple[str, ...], found: list[Finding]
) -> None:
    """A finding for the channels whose step is a noise to be reckoned with."""
    peak = np.ptp(values, axis=1).max(axis=0) / 2
    coarse = (quantum / np.sqrt(12) > _WORTH_TELLING * peak) & (peak > 0)
    if not coarse.any():
        return
    levels = int(np.round(np.min(2 * peak[coarse] / quantum[coarse])))
    where = places(x, coarse, labels)
    low, high = quantum[coarse].min(), quantum[coarse].max()
    step = f"{high:.3g}" if high <= 1.01 * low else f"{low:.3g} to {high:.3g}"
    found.append(
        Finding("quantised", where, f"LSB {step}, {levels + 1} levels",
                WIDENED,
                f"samples are {step} apart ({where}): a noise of at least that over √12")
    )  # fmt: skip
