"""Bursts of bad samples, as a laser gives where its speckle fades: made missing.

Such a burst goes up and down from one sample to the next, where the signal itself does not, and
comes at each receiver at times of its own: a wave comes to all of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, label

from wavesim.records.faults.fill_values import off_cubic
from wavesim.records.faults.finding import CURED, Finding, places

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# Samples of a burst are off the cubic through their neighbours by this many times the receiver's
# noise, and by this part of the rms of the samples about; a wave at a quarter of the sampling
# frequency is so by two thirds, white noise by 1.4.
_OVER_NOISE, _ROUGH, _ABOUT = 20.0, 0.5, 7
# No more than so many samples lie between those of one burst, which has so many of them or more,
# and takes no more than this part of the record; it is as large as this part of the receiver's
# peak.
_APART, _FEWEST, _LONGEST, _PART = 4, 3, 0.1, 0.05
_ROUGH_ALL = 0.7
# Of two, each may be sampled at other places of a sharp pulse.
_RECEIVERS = 3
# A wave comes to the receivers beside too: to one of this many on either side so much alike, and
# of this part of its amplitude at least. So many bursts tell.
_BESIDE, _ALIKE, _AMPLITUDE, _LOOKED_AT = 2, 0.7, 0.1, 100


def without_bursts(
    values: Float, t: Float, x: Float, labels: tuple[str, ...], found: list[Finding]
) -> Float:
    """Values with bursts of bad samples as NaN.

    Args:
        values: shape (C, nt, nx); changed in place.
        t, x, labels: times, positions and names of the receivers.
        found: findings, added to.
    """
    which, total, first = np.zeros(len(x), bool), 0, len(t)
    for component in values:
        bursts = _bursts(component)
        if not bursts:
            continue
        some = bursts[:: -(-len(bursts) // _LOOKED_AT)]
        if np.mean([_heard_beside(component, j, part) for j, part in some]) > 0.5:
            continue
        for j, part in bursts:
            component[part, j] = np.nan
            which[j] = True
            first = min(first, part.start)
        total += len(bursts)
    if total:
        where = places(x, which, labels)
        found.append(
            Finding("dropouts", f"{where}, from t = {t[first]:.6g} s", f"{total} bursts", CURED,
                    f"{total} bursts of samples that go up and down from one to the next, at each "
                    f"receiver at times of its own, taken as missing ({where}, first at "
                    f"t = {t[first]:.6g} s)")
        )  # fmt: skip
    return values


def _bursts(component: Float) -> list[tuple[int, slice]]:
    """Receiver and frames of each burst."""
    nt, nx = component.shape
    if nt < 16 * _ABOUT or nx < _RECEIVERS:
        return []
    off = np.abs(off_cubic(component))
    with np.errstate(invalid="ignore"):
        noise = 1.4826 * np.nanmedian(off, axis=0)
        hot = off > np.maximum(_OVER_NOISE * noise, _PART * np.nanmax(np.abs(component), axis=0))
    found = []
    for j in map(int, np.flatnonzero(hot.any(axis=0) & (noise > 0))):
        column = np.nan_to_num(component[:, j])
        about = np.pad(column, _ABOUT // 2, mode="edge")
        rough = hot[:, j] & (off[:, j] > _ROUGH * sliding_window_view(about, _ABOUT).std(axis=-1))
        runs, count = label(binary_closing(np.pad(rough, _APART), np.ones(_APART + 1)))
        runs = runs[_APART:-_APART]
        for run in range(1, count + 1):
            at = np.flatnonzero(runs == run)
            if rough[at].sum() < _FEWEST or len(at) > _LONGEST * nt:
                continue
            swing = float(np.std(column[at]))
            if np.sqrt(np.mean(off[at, j] ** 2)) > _ROUGH_ALL * swing:
                found.append((j, slice(max(int(at[0]) - 1, 0), int(at[-1]) + 2)))
    # At many receivers at once it came from without, or is the wave.
    taken = np.zeros((nt, nx), bool)
    for j, part in found:
        taken[part, j] = True
    together = taken.sum(axis=1) > max(1, nx // 3)
    return [(j, part) for j, part in found if not together[part].any()]


def _heard_beside(component: Float, j: int, part: slice) -> bool:
    """Whether one of the receivers beside has the like at some time."""
    own = np.nan_to_num(component[part, j])
    own = own - own.mean()
    size = np.sqrt(np.sum(own**2))
    for i in range(max(j - _BESIDE, 0), min(j + _BESIDE + 1, component.shape[1])):
        if i == j:
            continue
        there = sliding_window_view(np.nan_to_num(component[:, i]), len(own))
        energy = np.sqrt(len(own)) * there.std(axis=-1)
        loud = energy > _AMPLITUDE * size
        if loud.any() and (np.abs(there[loud] @ own) > _ALIKE * size * energy[loud]).any():
            return True
    return False
