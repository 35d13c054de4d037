"""Samples and frames that are not there: bridged where short, marked missing where long."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.faults.finding import CURED, TAKEN_OUT, Finding, places

Float = NDArray[Any]
Mask = NDArray[np.bool_]

FEWEST_FRAMES = 16
# A first frame of zeros is none where the next ones are off by this many times their own range.
_HEAD, _APART = 8, 4.0
# Samples beside a gap that goes on to an end are at rest to so many deviations.
_BESIDE, _REST = 32, 6.0
# A break of up to this many frames at one receiver is bridged.
BRIDGED = 2


def without_first_zeros(
    values: Float, t: Float, signal: Float | None, found: list[Finding]
) -> tuple[Float, Float, Float | None]:
    """The first frame left out where it holds zeros alone and no channel comes from there.

    Some scopes write such a row; beside an offset it is a spike.

    Args:
        values, t: shape (C, nt, nx) and (nt,).
        signal: the source's, shape (nt,), or None.
        found: findings, added to.
    """
    head = values[:, : _HEAD + 1]
    if len(t) <= 2 * _HEAD or head[:, 0].any() or not np.isfinite(head).all():
        return values, t, signal
    from_zero = np.abs(head[:, 1]) > _APART * np.ptp(head[:, 1:], axis=1)
    if not from_zero.any():
        return values, t, signal
    found.append(
        Finding("first row", f"t = {t[0]:.6g} s", "1 frame", CURED,
                "the first frame holds zeros alone, as some scopes write it: left out")
    )  # fmt: skip
    return values[:, 1:], t[1:], None if signal is None else signal[1:]


def whole_frames(values: Float, t: Float, found: list[Finding]) -> tuple[Float, Float]:
    """Frames left out of an even sequence of times, put in again as missing."""
    steps = np.diff(t)
    usual = float(np.median(steps))
    counts = np.maximum(1, np.round(steps / usual)).astype(int)
    regular = np.abs(steps - counts * usual) <= 1e-3 * usual
    if (counts == 1).all() or not regular.all():
        return values, t
    at = np.concatenate([[0], np.cumsum(counts)])
    if at[-1] + 1 > 4 * len(t):
        raise RecordError(
            f"t: {at[-1] + 1 - len(t)} of {at[-1] + 1} frames are missing; at most three quarters "
            "may be: use a part of the record"
        )
    filled = np.full((values.shape[0], at[-1] + 1, values.shape[2]), np.nan)
    filled[:, at] = values
    gone = int(at[-1] + 1 - len(t))
    first = int(np.argmax(counts > 1))
    found.append(
        Finding("frames missing", f"from t = {t[first]:.6g} s", f"{gone} of {at[-1] + 1}",
                TAKEN_OUT, f"{gone} frames are missing from the times")
    )  # fmt: skip
    return filled, np.interp(np.arange(at[-1] + 1), at, t)


def bridged(
    values: Float, t: Float, x: Float, labels: tuple[str, ...], quiet: Mask, found: list[Finding]
) -> tuple[Float, Mask, Mask]:
    """Short breaks at single receivers filled by a spline, and any where all is quiet.

    Args:
        values: shape (C, nt, nx), NaN where a sample is missing.
        t, x, labels: times, positions and names of the receivers.
        quiet: samples at which nothing but noise is about, shape (nt, nx).
        found: findings, added to.

    Returns:
        Values, which frames are missing, shape (nt,), and which receivers are why, shape (nx,).
    """
    absent = ~np.isfinite(values)
    missing: Mask = np.asarray(absent.all(axis=(0, 2)))
    single = absent & ~missing[:, None]
    broken = np.zeros(values.shape[2], bool)
    filled, still = 0, 0
    touched = np.zeros(values.shape[2], bool)
    for c, r in zip(*np.nonzero(single.any(axis=1)), strict=True):
        gone = single[c, :, r]
        long = np.zeros(len(t), bool)
        for start, stop in _stretches(gone):
            inside = start >= 2 and stop <= len(t) - 2
            if stop - start <= BRIDGED and inside:
                continue
            if quiet[_about(start, stop, len(t)), r].all() or _ended(
                values[c], quiet, int(r), int(start), int(stop)
            ):
                long[start:stop] = True
                still += int(stop - start)
            else:
                missing[start:stop] = True
                broken[r] = True
        own = ~absent[c, :, r]
        bridge = gone & ~missing & ~long
        if bridge.any():
            from scipy.interpolate import CubicSpline  # slow to import, and only a fault needs it

            values[c, bridge, r] = CubicSpline(t[own], values[c, own, r])(t[bridge])
            filled += int(bridge.sum())
        if long.any():
            near = own & quiet[:, r]
            values[c, long, r] = np.mean(values[c, near, r]) if near.any() else 0.0
        touched[r] |= bool(bridge.any() or long.any())
    for start, stop in _stretches(missing):
        if quiet[_about(start, stop, len(t))].all():
            missing[start:stop] = False
            values[:, start:stop] = np.nanmean(np.where(quiet, values, np.nan), 1, keepdims=True)
            found.append(
                Finding("frames missing", f"from t = {t[start]:.6g} s", f"{stop - start} frames",
                        CURED, f"{stop - start} missing frames, from t = {t[start]:.6g} s, where "
                        "all is quiet, filled with the mean there")
            )  # fmt: skip
    where = places(x, touched, labels) if touched.any() else ""
    if filled:
        found.append(Finding("samples missing", where, str(filled), CURED,
                             f"{filled} missing samples bridged by a cubic spline"))  # fmt: skip
    if still:
        found.append(
            Finding("samples missing", where, str(still), CURED,
                    f"{still} missing samples where all is quiet filled with the mean there "
                    f"({where})")
        )  # fmt: skip
    told = any(finding.what == "frames missing" for finding in found)
    if missing.any() and (broken.any() or not told):
        first = t[int(np.argmax(missing))]
        at = f" ({places(x, broken, labels)})" if broken.any() and not broken.all() else ""
        found.append(
            Finding("frames missing", f"from t = {first:.6g} s{at}",
                    f"{missing.sum()} of {len(t)}", TAKEN_OUT,
                    f"{missing.sum()} of {len(t)} frames count as missing{at}")
        )  # fmt: skip
    if missing.sum() > len(t) - FEWEST_FRAMES:
        raise RecordError(
            f"{missing.sum()} of {len(t)} frames hold values that are not finite; at least "
            f"{FEWEST_FRAMES} whole ones are needed"
        )
    return values, missing, broken


def _ended(v: Float, quiet: Mask, r: int, start: int, stop: int) -> bool:
    """Whether a receiver that ends early, or begins late, is at rest there, and its neighbours go
    on so: what it would show is no more than they do.

    Args:
        v: one component, shape (nt, nx), NaN where a sample is missing.
        quiet: samples at which nothing but noise is about, shape (nt, nx).
        r, start, stop: the receiver; first frame that is missing and the first behind.
    """
    if start > 0 and stop < len(v):
        return False
    beside = slice(max(0, start - _BESIDE), start) if start else slice(stop, stop + _BESIDE)
    there = np.flatnonzero(np.isfinite(v[start:stop]).all(axis=0))
    before, behind = there[there < r][-1:], there[there > r][:1]
    if not len(before) + len(behind):
        return False
    for n in (r, *before, *behind):
        head = v[quiet[:, n] & np.isfinite(v[:, n]), n]
        part = v[beside if n == r else slice(start, stop), n]
        part = part[np.isfinite(part)]
        if min(len(head), len(part)) < _HEAD:
            return False
        if np.abs(part - head.mean()).max() > _REST * max(float(head.std()), 1e-9 * np.ptp(head)):
            return False
    return True


def cut_apart(missing: Mask, quiet: Mask) -> bool:
    """Whether frames are missing for longer than a spline bridges while a signal goes on, so that
    receivers have lost different parts of it, and their sizes say nothing."""
    last = len(missing) - 1
    return any(
        stop - start > BRIDGED and not quiet[[max(start - 1, 0), min(stop, last)]].all()
        for start, stop in _stretches(missing)
    )


def _stretches(missing: Mask) -> NDArray[Any]:
    """First frame and frame after the last of each stretch that is missing, (n, 2)."""
    return np.flatnonzero(np.diff(np.concatenate([[0], missing.astype(int), [0]]))).reshape(-1, 2)


def _about(start: int, stop: int, count: int) -> slice:
    """A stretch with as much again on either side, and two frames."""
    return slice(max(0, 2 * start - stop - 2), min(count, 2 * stop - start + 2))
