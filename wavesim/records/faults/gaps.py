"""Samples and frames that are not there: bridged where short, marked missing where long."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy  # its parts are loaded where they are used: they take a while
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.faults.finding import CURED, TAKEN_OUT, Finding, places

Float = NDArray[Any]
Mask = NDArray[np.bool_]

FEWEST_FRAMES = 16
# A first frame of zeros is none where the next ones are off by this many times their own range.
_HEAD, _APART = 8, 4.0
# A break of up to this many frames at one receiver is bridged.
BRIDGED = 2
# A frame is told by so many on either side; it moves where both of so many deviate by so many times
# the noise, at this part of so many receivers and more.
_SIDE, _ABOUT, _MOVES, _RECEIVERS, _MOVING, _HALF = 3, 16, 6.0, 64, 3, 0.5
# Of more samples fewer receivers are looked at.
_SAMPLES = 2**22
# What is off there is so many times noise and, of one, of all, what is within so many frames; at
# receivers at rest no more than by chance; and, unlike a pick-up, no one sign at all.
_OFF, _ONE, _ALL, _WITHIN, _AT_REST, _ALIKE = 15.0, 8.0, 40.0, 21, 0.25, 0.5
# It is midway between frames, to this part, and of receivers by so many frames at one time.
_BETWEEN, _COPIED, _ONE_TIME = 0.25, 0.04, 0.6


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
    """Short breaks at single receivers filled by a spline, and long ones where all is quiet.

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
        edges = np.flatnonzero(np.diff(np.concatenate([[0], gone.astype(int), [0]])))
        for start, stop in edges.reshape(-1, 2):
            inside = start >= 2 and stop <= len(t) - 2
            if stop - start <= BRIDGED and inside:
                continue
            about = slice(max(0, 2 * start - stop - 2), min(len(t), 2 * stop - start + 2))
            if quiet[about, r].all():
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
    where = places(x, touched, labels) if touched.any() else ""
    if filled:
        found.append(Finding("samples missing", where, str(filled), CURED,
                             f"{filled} missing samples bridged by a cubic spline"))  # fmt: skip
    if still:
        found.append(
            Finding("samples missing", where, str(still), CURED,
                    f"{still} missing samples where all is quiet filled with the mean there")
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


def cut_apart(missing: Mask, quiet: Mask) -> bool:
    """Whether frames are missing for longer than a spline bridges while a signal goes on, so that
    receivers have lost different parts of it, and their sizes say nothing."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], missing.astype(int), [0]]))).reshape(-1, 2)
    last = len(missing) - 1
    return any(
        stop - start > BRIDGED and not quiet[[max(start - 1, 0), min(stop, last)]].all()
        for start, stop in edges
    )


def check_goes_on(u: Float, t: Float) -> None:
    """Refuse a record in which all receivers that move break off at once, as no wave does.

    u_i ≈ Σ_m c_m (u_{i−m} + u_{i+m}), with one c by least squares for the record, tells each frame
    by those beside it, but not where frames are lost, or there twice, while times go on.

    Args:
        u: one component, shape (nt, nx), finite.
        t: times, shape (nt,), s.
    """
    some = min(_RECEIVERS, max(2 * _MOVING, _SAMPLES // len(u)))
    u = u[:, :: -(-u.shape[1] // some)]
    u = u / np.maximum(np.sqrt(np.mean(u**2, axis=0)), 1e-300)
    count, side = len(u), _SIDE
    if count < 4 * _ABOUT:
        return
    beside = np.stack([u[side - m : count - side - m] + u[side + m : count - side + m]
                       for m in range(1, side + 1)], axis=-1)  # fmt: skip
    own, kept = u[side:-side], np.ones(count - 2 * side, bool)
    for _ in range(3):
        a = beside[kept].reshape(-1, side)
        normal = a.T @ a + 1e-12 * np.sum(a**2) * np.eye(side) + 1e-290 * np.eye(side)
        c = np.linalg.solve(normal, a.T @ own[kept].ravel())
        off = own - beside @ c
        size = np.sum(off**2, axis=1)
        kept = size <= np.quantile(size, 0.97)
    noise = (1.4826 * np.median(np.abs(off), axis=0)) ** 2 + 1e-20
    # Between frames i and i + 1: of the equations that hold both, and of frames before and behind.
    i = np.arange(side + _ABOUT, count - side - _ABOUT)
    wrong = _sums(off**2, i - 2 * side + 1, 2 * side)
    near = scipy.ndimage.maximum_filter1d(wrong, _WITHIN, axis=0, mode="constant")
    away = 2 * side + _WITHIN // 2
    near = np.maximum(np.roll(near, away, axis=0), np.roll(near, -away, axis=0))
    power = [_sums(u**2, a, _ABOUT) / _ABOUT - (_sums(u, a, _ABOUT) / _ABOUT) ** 2
             for a in (i - _ABOUT + 1, i + 1)]  # fmt: skip
    moves = np.minimum(*power) > _MOVES**2 * noise / (1 + 2 * np.sum(c**2))
    hit = (wrong > _OFF * 2 * side * noise) & (wrong > _ONE * near)
    hits, moving = np.sum(hit & moves, axis=1), np.sum(moves, axis=1)
    jump = np.where(moves, off[i - side] - off[i - side + 1], 0)
    found = (hits >= np.maximum(_MOVING, _HALF * moving)) & (
        np.sum(hit & ~moves, axis=1) <= _AT_REST * hits + 1
    )
    found &= np.sum(wrong * moves, axis=1) > _ALL * np.sum(near * moves, axis=1)
    found &= np.sum(jump, axis=1) ** 2 < _ALIKE * moving * np.sum(jump**2, axis=1)
    size = np.where(found, np.sum(wrong * moves, axis=1), 0)
    best = int(np.argmax(size))
    if size[best] and _at_once(off[:, hit[best] & moves[best]] ** 2, int(i[best]) - side):
        raise RecordError(
            f"t = {t[i[best]]:.6g} to {t[i[best] + 1]:.6g} s: all receivers that move break off at "
            "once: frames are lost there, or there twice, or of other receivers, while times go "
            "on; put them right, or use the part before or after"
        )


def _at_once(off: Float, at: int) -> bool:
    """Whether squares (n, nx) about an equation are off as by a break between two frames: at one
    time, where waves come one after the other, but not by one shape, as what all pick up is."""
    about = np.arange(-_ABOUT // 2, _ABOUT // 2 + 2)
    rows = off[np.clip(at + about, 0, len(off) - 1)]
    middle = about @ (rows / np.sum(rows, axis=0))
    between = abs(float(np.mean(middle)) % 1 - 0.5) < _BETWEEN
    return bool(between and _COPIED < np.std(middle) < _ONE_TIME)


def _sums(rows: Float, first: NDArray[np.int64], many: int) -> Float:
    """Of so many rows from each of some on."""
    total = np.cumsum(np.concatenate([np.zeros((1, rows.shape[1])), rows]), axis=0)
    return np.asarray(total[first + many] - total[first])
