"""Records that a filter has gone over which bends waves: told by their noise, which each receiver
has of its own, and which never repeats itself.

A filter that keeps the m largest singular values of a record leaves the noise of n receivers in m
dimensions. A median takes its values from the samples, one for several.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError

Float = NDArray[Any]

# Noise by differences of this order, which of white noise are like the ones after them by −6/7, and
# of few waves without noise by their cos ωΔt; dimensions that hold less than this part of the one
# before them hold rounding; of so many receivers, two fewer and more.
_ORDER, _WHITE, _ROUNDING, _FEWEST, _FEWER = 6, (-0.92, -0.75), 1e-4, 4, 2
# Receivers put in between two others by a straight line are no filter's.
_BETWEEN, _OF_THEM = 1e-6, 0.3
# This part of the samples, but for those at rest to the last digit, repeat the one before, where
# levels are known to this part of the step from one to the next: half do after a median of three.
_REPEAT, _FINE, _FEWEST_STEPS, _LEAST = 0.2, 1e-3, 16, 1e-7


def check_unfiltered(v: Float) -> None:
    """Refuse what few singular values or medians have left.

    Args:
        v: one component with noise, shape (nt, nx), NaN where a sample is missing.

    Raises:
        RecordError: it is.
    """
    if not np.isfinite(v).all() or len(v) <= 4 * v.shape[1]:
        return
    if many := _dimensions(v):
        raise RecordError(
            f"the noise of {v.shape[1]} receivers is that of {many} signals: all but {many} "
            "singular values were filtered out, and waves with them; give the record as it was"
        )
    if _of_medians(v):
        raise RecordError(
            "samples with noise repeat the one before, as medians of several do, which bend crests "
            "and with them amplitudes and phases; give the record as it was"
        )


def _dimensions(v: Float) -> int:
    """Of how many signals the noise of all channels is, where these are fewer by far; else 0."""
    nx = v.shape[1]
    if nx < _FEWEST:
        return 0
    noise = np.diff(v, _ORDER, axis=0)
    like = float(np.sum(noise[1:] * noise[:-1]) / max(float(np.sum(noise**2)), 1e-290))
    size = np.sqrt(np.mean(noise**2, axis=0))
    between = np.abs(np.diff(v, 2, axis=1)).max(axis=0) < _BETWEEN * np.abs(v).max()
    if not _WHITE[0] < like < _WHITE[1] or not size.all() or np.mean(between) > _OF_THEM:
        return 0
    noise = noise / size
    # Channels that are others', but for a factor, have no noise of their own.
    same = np.abs(noise.T @ noise) > (1 - _ROUNDING) * len(noise)
    noise = noise[:, ~np.triu(same, 1).any(axis=0)]
    held = np.linalg.svd(noise, compute_uv=False)
    falls = np.flatnonzero(held[1:] < _ROUNDING * held[:-1])
    many = int(falls[0]) + 1 if len(falls) else len(held)
    return many if many <= len(held) - _FEWER else 0


def _of_medians(v: Float) -> bool:
    """Whether most channels' samples repeat themselves more than digits make them."""
    v = v - np.median(v, axis=0)
    told = []
    for u in v.T:
        steps = np.abs(np.diff(u))[u[1:] != 0]
        moving, levels = steps[steps > 0], np.diff(np.unique(u))
        if len(moving) < _FEWEST_STEPS:
            continue
        # What is rounding at rest is no noise.
        noise = float(np.median(moving))
        fine = levels.min() < _FINE * noise and noise > _LEAST * np.ptp(u)
        told.append(bool(fine and np.mean(steps == 0) > _REPEAT))
    return bool(told and np.mean(told) > 0.5)
