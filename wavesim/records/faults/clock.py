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


def one_clock(values: Float, t: Float, found: list[Finding]) -> tuple[Float, Float]:
    """Channels with times of their own, shape (nt, nx), put on the first one's."""
    if t.ndim == 1:
        return values, t
    first = t[:, 0]
    step = float(np.median(np.diff(first)))
    late = np.abs(t - first[:, None]).max(axis=0)
    for j in np.flatnonzero(~(late <= 1e-3 * step)):
        if not (np.diff(t[:, j]) > 0).all():
            raise RecordError(f"times of channel {j + 1} do not ascend: sort its samples by time")
        for c in range(len(values)):
            values[c, :, j] = on_clock(values[c, :, j], t[:, j], first)
    if (late > 1e-3 * step).any():
        most = float(late.max()) / step
        found.append(
            Finding("clocks differ", f"{int((late > 1e-3 * step).sum())} channels",
                    f"by up to {most:.3g} intervals", CURED,
                    "channels with clocks of their own put on the first one's by a cubic spline")
        )  # fmt: skip
    return values, first


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
