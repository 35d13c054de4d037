"""Receivers that say nothing: dead, mostly missing, or at rest where waves run."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.faults.finding import TAKEN_OUT, Finding, places
from wavesim.records.faults.unfit_receivers import PART

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# A receiver that varies less than this part of the strongest is dead.
_DEAD = 1e-12
# A receiver with more than this part of its samples missing is left out.
_MOST_MISSING = 0.2
# … but for what is before its first and after its last, of which there is this part and more.
_RECORDED = 0.1
# A field is odd about a receiver where this part of its power is left of it and its mirror image.
_ODD = 0.1


def living(
    values: Float,
    x: Float,
    labels: tuple[str, ...],
    ring: bool,
    still: bool = True,
) -> Mask:
    """Which receivers say something, shape (nx,); those that stand still are dead if so wished."""
    finite = np.isfinite(values)
    if finite.all():
        gone, some = np.zeros(len(x), bool), values
    else:
        seen = finite.any(axis=(0, 2))
        if not seen.any():
            raise RecordError("no sample is finite: every receiver is dead or mostly missing")
        gone = (~finite[:, seen]).mean(axis=(0, 1)) > _MOST_MISSING
        if not ring:
            gone &= ~_cut_short(np.asarray(finite[:, seen].all(axis=0)))
        some = np.where(finite, values, np.nan)
    dead: Mask = np.asarray(gone)
    if still:
        high, low = np.fmax.reduce(some, axis=1), np.fmin.reduce(some, axis=1)
        size = np.nan_to_num(np.fmax(np.abs(high), np.abs(low))).max()
        at_rest = np.nan_to_num(high - low).max(axis=0) <= _DEAD * max(size, 1e-300)
        if ring and at_rest.any():
            # Where no wave has come, or none travels, many rest rightly.
            at_rest &= ~_nodes(values) & (at_rest.sum() <= max(1, PART * len(x)))
        dead = gone | at_rest
    if not dead.any():
        return ~dead
    where = places(x, dead, labels)
    least_living = min(2, len(x))
    if len(x) - dead.sum() < least_living:
        raise RecordError(
            f"{dead.sum()} of {len(x)} receivers are dead or mostly missing ({where}); at "
            f"least {least_living} must live"
        )
    return ~dead


def _cut_short(there: Mask) -> Mask:
    """Which receivers begin late or end early and are whole between, shape (nx,)."""
    span = len(there) - np.argmax(there, axis=0) - np.argmax(there[::-1], axis=0)
    return np.asarray(
        (there.mean(axis=0) > _RECORDED) & (there.sum(axis=0) >= (1 - _MOST_MISSING) * span)
    )


def _nodes(values: Float) -> Mask:
    """Receivers round a ring that a standing field, odd about them, leaves at rest, shape (nx,).

    Σ_d (u_{j+d} + u_{j−d})² / 2 = Σ_d u_d² + Σ_d u_{j+d} u_{j−d}, of which the last is the circular
    convolution of u with itself at 2j.
    """
    nx = values.shape[2]
    own, hat = np.zeros(nx), np.zeros(nx // 2 + 1, complex)
    for rows in (np.nan_to_num(row) for part in values for row in np.array_split(part, 16)):
        own += np.sum(rows**2, axis=0)
        hat += np.sum(np.fft.rfft(rows, axis=1) ** 2, axis=0)
    at = np.arange(nx)
    # What is its own mirror image tells nothing.
    itself = own + (np.roll(own, -(nx // 2)) if nx % 2 == 0 else 0.0)
    power = own.sum() - itself
    mirrored = np.fft.irfft(hat, nx)[2 * at % nx] - itself
    return np.asarray(power + mirrored < _ODD * power)


def check_whole(x: Float, lost: Mask, labels: tuple[str, ...]) -> None:
    """Refuse a ring of which too many receivers are lost for the others to tell what they lack."""
    if lost.sum() > max(1, PART * len(x)):
        raise RecordError(
            f"{lost.sum()} of the ring's {len(x)} receivers can't be used "
            f"({places(x, lost, labels)}): no more than a quarter may be read from the others; "
            "record them again, or read what is there along a line, without --ring"
        )


def tell_dead(
    x: Float, alive: Mask, labels: tuple[str, ...], found: list[Finding], what: str = "dead"
) -> None:
    """A finding for all that are dead, or mostly missing."""
    if not alive.all():
        where, count = places(x, ~alive, labels), int((~alive).sum())
        found.append(Finding(what, where, f"{count} of {len(x)}", TAKEN_OUT,
                             f"{count} {what} receivers left out ({where})"))  # fmt: skip
