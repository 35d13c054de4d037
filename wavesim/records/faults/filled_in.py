"""Stretches exactly straight, or exactly still, between samples that hold noise: filled in.

Programs put straight lines, the last value or zeros where samples were lost. Second differences of
white noise of standard deviation s are √6 s wide, and their own second differences √70 s; in such
a stretch they are no more than rounding. Noise keeps within that by chance, n times in a row, with
the n-th power of the probability of once.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.finding import CURED, Finding, places
from wavesim.records.faults.quantisation import quanta

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# The shortest stretch, of second differences; as rare as this in a record by chance, of noise that
# keeps within rounding in no more than this part of its differences.
_SHORTEST, _CHANCE, _OFTEN = 8, 1e-6, 0.3
# Noise is looked at where it is alone, in this part of blocks of so many frames; it is white where
# fourth differences over second ones are more than this (3.4 of white noise, of a wave of n samples
# to its period (2π/n)²).
_QUIETEST, _BLOCK, _WHITE = 0.25, 16, 2.0
# … and where second differences are a digitiser's steps and no more, samples stand still by right.
_STEPS = 1.5
# Numbers of so many digits or decimals, and of single precision, are told by so many samples.
_DIGITS, _LOOKED_AT = 12, 256
_LISTED = 3


def without_filled_in(
    values: Float, t: Float, x: Float, labels: tuple[str, ...], found: list[Finding]
) -> Float:
    """Values with stretches that were filled in as NaN.

    Args:
        values: shape (C, nt, nx), NaN where a sample is missing; changed in place.
        t, x, labels: times, positions and names of the receivers.
        found: findings, added to.
    """
    which, stretches, total = np.zeros(len(x), bool), {}, 0
    for component in values:
        second = np.abs(np.diff(component, 2, axis=0))
        rough = np.nanmedian(second, axis=0)
        for j in np.flatnonzero(rough > 0):
            v = component[:, j]
            for start, stop in _straight(v, second[:, j], values.size):
                still = v[start] == v[start + 1]
                if still and v[start] in (np.nanmax(v), np.nanmin(v)):
                    continue  # a flat top
                # The ends of a line are samples, and the first of a value that is held.
                first, last = start + (not still or v[start] != 0), stop - (not still)
                how = "on a straight line" if not still else "at 0" if v[start] == 0 else "at rest"
                stretches[t[first], t[last - 1]] = how
                v[first:last] = np.nan
                which[j], total = True, total + last - first
    if total:
        where = places(x, which, labels)
        at = ", ".join(f"{how} from t = {a:.6g} to {b:.6g} s"
                       for (a, b), how in sorted(stretches.items())[:_LISTED])  # fmt: skip
        at += ", …" if len(stretches) > _LISTED else ""
        found.append(
            Finding("filled in", f"{where}, from t = {min(stretches)[0]:.6g} s",
                    f"{total} samples", CURED,
                    f"{total} samples without the noise that all others hold ({where}; exactly "
                    f"{at}), as filled in where samples were lost: taken as missing")
        )  # fmt: skip
    return values


def _straight(v: Float, second: Float, count: int) -> list[tuple[int, int]]:
    """First frame of each stretch, and the first behind it, of a record of so many samples."""
    close = 4 * _grain(v)[1:-1]
    small = second <= close
    edges = np.diff(np.concatenate([[0], small.astype(np.int8), [0]]))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    long = ends - begins >= _SHORTEST
    if not long.any():
        return []
    begins, ends = begins[long], ends[long]
    # Noise where it is alone, but for these stretches.
    own = np.isfinite(second)
    for a, b in zip(begins, ends, strict=True):
        own[max(0, a - 2) : b + 2] = False
    n = len(second) // _BLOCK * _BLOCK
    whole = own[:n].reshape(-1, _BLOCK).all(axis=1)
    if whole.sum() < 4:
        return []
    blocks = second[:n].reshape(-1, _BLOCK)[whole]
    fourth = np.abs(np.diff(v, 4))
    finer = np.pad(fourth, (1, 1), "edge")[:n].reshape(-1, _BLOCK)[whole]
    size = np.median(blocks, axis=1)
    quiet = size <= np.quantile(size, _QUIETEST)
    rough = float(np.median(blocks[quiet]))
    # Where samples stand still beneath a digitiser's step, one that stands still tells nothing.
    if not rough or float(np.median(finer[quiet])) < _WHITE * rough:
        return []
    if rough < _STEPS * float(quanta(v[None, :, None])[0]):
        return []
    within = small[:n].reshape(-1, _BLOCK)[whole][quiet].mean()
    found = []
    for a, b in zip(begins, ends, strict=True):
        # Of a normal variable of median magnitude m the density is 0.54/m at 0, on both sides.
        chance = max(float(within), 0.54 * float(close[a:b].max()) / rough, 1e-3)
        fewest = np.log(_CHANCE / count) / np.log(chance) if chance < _OFTEN else np.inf
        # What touches an end is padding.
        if b - a >= fewest and a > 0 and b < len(second):
            found.append((int(a), int(b) + 2))
    return found


def _grain(v: Float) -> Float:
    """How far apart the numbers are that samples are stored as, at each."""
    finite = np.flatnonzero(np.isfinite(v) & (v != 0))
    some = v[finite[:: max(1, len(finite) // _LOOKED_AT)]]
    size = np.nanmax(np.abs(v))
    grain = np.spacing(np.abs(np.nan_to_num(v))) + 2.0**-52 * size
    if not len(some):
        return grain
    if (some.astype(np.float32) == some).all():
        grain = grain + 2.0**-23 * np.abs(np.nan_to_num(v))
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        for decimals in range(-3, _DIGITS):
            if np.abs(np.round(some, decimals) - some).max() <= 1e-9 * 10.0**-decimals:
                return grain + 10.0**-decimals
        for digits in range(2, _DIGITS):
            step = 10.0 ** (np.floor(np.log10(np.abs(some))) + 1 - digits)
            if (np.abs(np.round(some / step) - some / step) <= 1e-6).all():
                exponent = np.floor(np.log10(np.maximum(np.abs(np.nan_to_num(v)), 1e-300)))
                return grain + 10.0 ** (exponent + 1 - digits)
    return grain


__all__ = ["without_filled_in"]
