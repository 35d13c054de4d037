"""Times that do not ascend, are rounded, or are uneven; clocks of single channels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.evenness import even, last_digit
from wavesim.records.faults.finding import CURED, Finding

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# Times even to this part of their interval count as even.
_EVEN_TIMES = 1e-5
# Off by more than this part of it they are told of.
_WORTH_TELLING = 1e-4
# Clocks whose times differ by less than this part of an interval are one; of intervals that differ
# by less than this part a cubic spline leads from one to the other.
_SAME, _ONE_RATE = 1e-3, 0.05
# Samples of a slower clock on either side that a filter reaches, and Kaiser's β: 80 dB down from
# 5 % above its Nyquist frequency on, and even to 1e-4 up to 5 % below.
_SUPPORT, _KAISER = 48, 7.86


def one_clock(values: Float, t: Float, found: list[Finding]) -> tuple[Float, Float]:
    """Channels with times of their own, shape (nt, nx), put on one clock."""
    if t.ndim == 1:
        return values, t
    values, own, late, said = on_one_clock(values, t)
    if said:
        found.append(
            Finding("clocks differ", f"{int((late > _SAME).sum())} channels",
                    f"by up to {late.max():.3g} intervals", CURED,
                    f"channels with clocks of their own put on one: {said}")
        )  # fmt: skip
    return values, own


def on_one_clock(values: Float, t: Float) -> tuple[Float, Float, Float, str]:
    """Channels of clocks of their own on one: the first's or, of several rates, the slowest's,
    which has no frequency that another could not hold, over the time that all have.

    Args:
        values: shape (C, nt, nx), NaN where missing, and behind a channel's end.
        t: times of each channel, shape (nt, nx), s.

    Returns:
        Values, times (n,), by how many intervals each channel's times were off, and what was done,
        "" where nothing was.

    Raises:
        RecordError: times do not ascend, or of several rates are uneven, or hardly overlap.
    """
    apart = np.array([np.nanmax(np.abs(one - t[:, 0])) for one in t.T])
    late = apart / float(np.nanmedian(np.diff(t[:, 0])))
    moved: Mask = np.asarray(~(late <= _SAME))
    if not moved.any():
        return values, t[:, 0], late, ""
    seen: Mask = np.asarray(np.isfinite(values).any(axis=0))
    seen[:, ~seen.any(axis=0)] = True
    there: Mask = np.isfinite(t) & (np.cumsum(seen[::-1], axis=0)[::-1] > 0)
    for j in map(int, np.flatnonzero(moved | (np.arange(len(moved)) == 0))):
        if there[:, j].sum() < 4 or not (np.diff(t[there[:, j], j]) > 0).all():
            raise RecordError(f"times of channel {j + 1} do not ascend: sort its samples by time")
    steps = np.array([np.median(np.diff(t[own, j])) for j, own in enumerate(there.T)])
    rates = bool(steps.max() > (1 + _ONE_RATE) * steps.min())
    first = int(np.argmax(steps if rates else moved * 0))
    clock = t[there[:, first], first] if rates else t[:, 0]
    late, fast = apart / steps[first], steps * (1 + _ONE_RATE) < steps[first]
    if rates:
        spans = np.array([t[own, j][[0, -1]] for j, own in enumerate(there.T)])
        begin, end = spans[:, 0].max(), spans[:, 1].min()
        clock = clock[(clock >= begin) & (clock <= end)]
        if len(clock) < 2 * _SUPPORT:
            raise RecordError(
                f"clocks of channels differ in rate, and the slowest has {len(clock)} frames in "
                f"the time that all have; at least {2 * _SUPPORT} are needed: record all for as "
                "long, or give those of one rate"
            )
    put = np.full((len(values), len(clock), t.shape[1]), np.nan)
    for j, own in enumerate(there.T):
        if fast[j] and even(t[own, j], 0.0, _EVEN_TIMES) is None:
            raise RecordError(
                f"times of channel {j + 1} are uneven, and of another rate than those of channel "
                f"{first + 1}: put both on one even clock"
            )
        for c in range(len(values)):
            if rates or moved[j]:
                onto = on_slower_clock if fast[j] else on_clock
                put[c, :, j] = onto(values[c, own, j], t[own, j], clock)
            else:
                put[c, :, j] = values[c, :, j]
    if not rates:
        return put, clock, late, f"{moved.sum()} on the first one's by a cubic spline"
    said = (
        f"{fast.sum()} with up to {steps.max() / steps.min():.3g} times its rate on the slowest, "
        "without what is beyond its Nyquist frequency, and over the time that all have, "
        f"{len(clock)} frames"
    )
    return put, clock, late, said


def on_clock(values: Float, own: Float, t: Float) -> Float:
    """Samples at other times by a cubic spline; NaN where they are missing beside, or beyond.

    Args:
        values: shape (n,), NaN where missing.
        own, t: times of the samples, ascending, shape (n,), and those wanted, any shape, s.
    """
    from scipy.interpolate import CubicSpline  # slow to import, and only a fault needs it

    there = np.isfinite(values)
    found = np.full(np.shape(t), np.nan)
    if there.sum() > 3:
        after = np.clip(np.searchsorted(own, t), 1, len(own) - 1)
        exact = np.abs(own[after - 1] - t), np.abs(own[after] - t)
        grain = 1e-9 * np.diff(own)[after - 1]
        known = (there[after - 1] | (exact[1] <= grain)) & (there[after] | (exact[0] <= grain))
        spline = CubicSpline(own[there], values[there], extrapolate=False)
        found[known] = spline(np.asarray(t)[known])
    return found


def on_slower_clock(values: Float, own: Float, t: Float) -> Float:
    """Samples of an even clock at the times of a slower one, without what is above its Nyquist
    frequency: Σ_i u_i c sinc c(τ − i) w(τ − i), c the ratio of intervals, w Kaiser's window.

    Args:
        values: shape (n,), NaN where missing.
        own, t: times of the samples, even, shape (n,), and those wanted, of longer intervals, s.
    """
    there = np.isfinite(values)
    filled = values if there.all() else on_clock(values[there], own[there], own)
    step = (own[-1] - own[0]) / (len(own) - 1)
    ratio = step * (len(t) - 1) / (t[-1] - t[0])
    reach = int(np.ceil(_SUPPORT / ratio))
    # Beyond its ends a signal goes on as its mirror image in the last sample.
    padded = np.pad(np.nan_to_num(filled), reach, mode="reflect", reflect_type="odd")
    at = (t - own[0]) / step
    found = np.empty(len(t))
    for part in np.array_split(np.arange(len(t)), max(1, len(t) * 2 * reach // 2**22)):
        near = np.floor(at[part]).astype(int)[:, None] + np.arange(-reach + 1, reach + 1)
        off = at[part][:, None] - near
        inside = np.sqrt(np.maximum(1 - (off / reach) ** 2, 0))
        weight = np.sinc(ratio * off) * np.i0(_KAISER * inside)
        index = np.clip(near + reach, 0, len(padded) - 1)
        found[part] = np.sum(weight * padded[index], axis=1) / np.sum(weight, axis=1)
    if not there.all():
        gone = np.interp(at, np.arange(len(own)), (~there).astype(float)) > 0
        found[gone] = np.nan
    return found


def check_ascending(t: Float, storage: float) -> None:
    """Refuse times that do not ascend, saying whether rounding is why."""
    steps = np.diff(t)
    if (steps > 0).all():
        return
    at = int(np.argmax(steps <= 0))
    digit = float(last_digit(t, storage).max())
    # Written with too few digits, times repeat but never fall.
    if (steps >= 0).all() and t[-1] > t[0]:
        mean = (t[-1] - t[0]) / (len(t) - 1)
        if digit > 0.5 * mean:
            raise RecordError(
                f"t[{at + 1}] = t[{at}] = {t[at]:g} s: times are rounded to {digit:.2g} s, while "
                f"samples are about {mean:.4g} s apart: give --interval (s), or write the times "
                "with more digits"
            )
        raise RecordError(
            f"t[{at + 1}] = t[{at}] = {t[at]:g} s: two frames at one time; drop one, or give "
            "--interval where samples are even"
        )
    falls = np.flatnonzero(steps < 0)
    if np.abs(t[falls + 1] - t[0]).max() <= 2 * float(np.median(steps)):
        raise RecordError(
            f"t[{at + 1}] = {t[at + 1]:g} s: times begin anew {len(falls)} times, as of segments "
            "one after the other: save each as a file of its own"
        )
    raise RecordError(
        f"t[{at + 1}] = {t[at + 1]:g} s after t[{at}] = {t[at]:g} s: times must ascend; sort the "
        "frames, or give --interval where samples are even"
    )


def even_times(
    values: Float, t: Float, missing: Mask, storage: float, found: list[Finding]
) -> tuple[Float, Float, Mask, float]:
    """Even times: those of a rounded sequence, or the values resampled.

    Returns:
        Values, times, missing frames, and the standard error of the interval over the interval.
    """
    sequence = even(t, storage, _EVEN_TIMES)
    count = len(t)
    if sequence is not None:
        if sequence.off > _WORTH_TELLING:
            found.append(
                Finding("times rounded", "all frames", f"to {sequence.digit:.2g} s", CURED,
                        f"times are rounded to {sequence.digit:.2g} s, {sequence.off:.2g} of their "
                        f"interval: taken as even, {sequence.step:.9g} s apart")
            )  # fmt: skip
        return values, sequence.values(count), missing, sequence.error
    grid = np.linspace(t[0], t[-1], count)
    step = grid[1] - grid[0]
    off = float(np.abs(t - grid).max() / step)
    own = ~missing
    longest = float(np.diff(t).max())
    if longest > 8 * step:
        raise RecordError(
            f"t: the longest interval, {longest:.4g} s, is {longest / step:.3g} times the mean; "
            "sample evenly, or use the part before or after it"
        )
    from scipy.interpolate import (  # slow to import, and only a fault needs it
        CubicSpline,
        PchipInterpolator,
    )

    values = CubicSpline(t[own], values[:, own], axis=1)(grid)
    gone = np.asarray(PchipInterpolator(t, missing.astype(float))(grid) > 1e-9)
    values[:, gone] = 0.0
    found.append(
        Finding("times uneven", "all frames", f"by {off:.2g} intervals", CURED,
                f"times uneven by up to {off:.2g} of their interval: resampled by a cubic spline, "
                "which is good to 1 % only up to about a fifth of the sampling frequency")
    )  # fmt: skip
    return values, grid, gone, 0.0
