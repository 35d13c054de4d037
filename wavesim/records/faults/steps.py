"""Levels that jump at a time, as where an amplifier switches or a trigger couples in: put back.

A channel is at another level at its end than at its beginning, and somewhere between it jumps by as
much from one sample to the next. No wave does that to several channels at once, to one alone, or in
no order along the line.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wavesim.records.faults.finding import CURED, Finding, beside_peak, places
from wavesim.records.faults.quiet import FEWEST, fine_noise

Float = NDArray[Any]

# A level is that of this part of the record at either end, at rest there but for this part of the
# step; the two differ by so many standard errors, and this part of the peak.
ENDS, _REST, _ERRORS, _PART = 32, 0.2, 8.0, 1e-3
# Parabolas through so many samples on either side of a jump tell it, up to this part of a period:
# to this part of what the level moved by, and so many deviations of what they leave; it stands out
# of these by so many, and elsewhere none does by half as many.
_FEWEST_FITTED, _OF_PERIOD, _AGREES, _DEVIATIONS, _STANDS_OUT = 6, 6, 0.3, 3.0, 6.0
# Jumps within so many samples come at once.
_AT_ONCE = 2
# So many channels tell that jumps come in no order.
_FEWEST_IN_ORDER = 3


def without_steps(
    values: Float, t: Float, x: Float, labels: tuple[str, ...], found: list[Finding]
) -> bool:
    """Put jumps of channels' levels back, and say whether there were any.

    Args:
        values: one component, shape (nt, nx), NaN where missing; changed in place.
        t, x, labels: times, positions and names of the receivers.
        found: findings, added to.
    """
    nt, nx = values.shape
    if nx < 2 or nt < 4 * max(FEWEST, nt // ENDS):
        return False
    whole = np.isfinite(values).mean(axis=0) > 0.5
    moved = np.array([level_moves(_filled(v)) if one else 0.0
                      for v, one in zip(values.T, whole, strict=True)])  # fmt: skip
    those = np.flatnonzero(moved)
    if not len(those):
        return False
    u = np.stack([_filled(values[:, j]) for j in those], axis=1)
    at = _together(u, moved[those])
    if (at < 0).all():
        at = np.array([_together(u[:, [i]], moved[[j]])[0] for i, j in enumerate(those)])
        own = at[at >= 0]
        steps = np.diff(own)
        in_order = len(own) < _FEWEST_IN_ORDER or (steps >= 0).all() or (steps <= 0).all()
        if in_order and len(those) > 1:
            return False
    which, at = those[at >= 0], at[at >= 0]
    if not len(which):
        return False
    peak = np.nanmax(np.abs(values - np.nanmedian(values, axis=0)), axis=0)
    for j, i in zip(which, at, strict=True):
        values[i + 1 :, j] -= moved[j]
        # It may take a sample.
        values[i : i + 2, j] = np.interp([1, 2], [0, 3], values[[i - 1, i + 2], j])
    part = float(np.max(np.abs(moved[which]) / np.maximum(peak[which], 1e-300)))
    size = f"{np.abs(moved[which]).max():.3g}, {beside_peak(part)}"
    when = f"at t = {t[at.min() + 1]:.4g} s"
    if np.ptp(at) > _AT_ONCE:
        when = f"from t = {t[at.min() + 1]:.4g} s on, each at a time of its own"
    where = places(x, which, labels)
    found.append(
        Finding("level jumps", where, size, CURED,
                f"levels that jump {when}, by up to {size}, put back ({where})")
    )  # fmt: skip
    return True


def _filled(v: Float) -> Float:
    """A channel with straight lines where samples are missing."""
    own = np.isfinite(v)
    return v if own.all() else np.interp(np.arange(len(v)), np.flatnonzero(own), v[own])


def level_moves(u: Float) -> float:
    """By how much the level at the end is off that at the beginning; 0 where it is not, or where
    either is not at rest."""
    ends = max(FEWEST, len(u) // ENDS)
    first, last = u[:ends], u[-ends:]
    moved = float(last.mean() - first.mean())
    error = float(np.hypot(_error(first), _error(last)))
    if abs(moved) <= max(_ERRORS * error, _PART * float(np.ptp(u))):
        return 0.0
    rough = max(float(first.std()), float(last.std()))
    return 0.0 if rough > max(_REST * abs(moved), 2 * fine_noise(u)) else moved


def _error(part: Float) -> float:
    """Standard error of a mean, neighbours that hang together allowed for."""
    blocks = part[: 4 * (len(part) // 4)].reshape(4, -1).mean(axis=1)
    return float(np.hypot(blocks.std(ddof=1) / 2, part.std() / np.sqrt(len(part))))


def _together(u: Float, moved: Float) -> NDArray[np.int64]:
    """After which sample channels, shape (nt, m), jump by what their levels moved by, all at once;
    −1 of those that do not."""
    # Of a jump all frequencies are as loud in the rate of change.
    rate = np.abs(np.fft.rfft(np.diff(u, axis=0), axis=0)).sum(axis=1)
    period = len(u) / max(int(np.argmax(rate[1:])) + 1, 1)
    width = _FEWEST_FITTED
    none = np.full(len(moved), -1)
    while width <= max(_FEWEST_FITTED, min(period / _OF_PERIOD, len(u) // 16)):
        jumps, left = _jumps(u, width)
        size = jumps @ moved / (moved @ moved)
        deviation = np.sqrt(left**2 @ moved**2) / (moved @ moved)
        clear = size / deviation
        at = int(np.argmax(clear))
        elsewhere = np.abs(clear)
        elsewhere[max(0, at - 2 * width) : at + 2 * width + 1] = 0.0
        agrees = abs(size[at] - 1) < _AGREES + _DEVIATIONS * deviation[at]
        if agrees and clear[at] > max(_STANDS_OUT, 2 * float(elsewhere.max())):
            own = np.abs(jumps[at] - moved) < _AGREES * np.abs(moved) + _DEVIATIONS * left[at]
            # Within what the parabolas leave out, between the samples that differ most.
            near = np.diff(u[at - 1 : at + 3], axis=0) @ moved
            return np.where(own, at - 1 + int(np.argmax(near)), none)
        width *= 2
    return none


def _jumps(u: Float, width: int) -> tuple[Float, Float]:
    """By how much channels jump after each sample, as parabolas through so many samples before and
    after it tell, but for the two next to it, and what these leave open of it; shape (nt, m)."""
    s = np.arange(width) + 1.5
    powers = np.stack([np.ones(width), s, s**2], axis=1)
    inverse = np.linalg.pinv(powers)
    windows = sliding_window_view(u, width, axis=0)
    after = windows @ inverse[0]
    before = windows @ inverse[0][::-1]
    # Residuals are as many less three; a parabola has the same from either side.
    left = windows - windows @ (powers @ inverse).T
    variance = np.sum(left**2, axis=2) / (width - 3)
    count = len(after) - width - 2
    jumps, deviation = np.zeros(u.shape), np.full(u.shape, np.inf)
    own = slice(width, width + count)
    jumps[own] = after[width + 2 :] - before[:count]
    # Of few samples the residuals may be small by chance.
    least = np.array([fine_noise(v) for v in u.T]) ** 2 + (1e-9 * np.ptp(u, axis=0)) ** 2
    both = np.maximum(variance[width + 2 :], least) + np.maximum(variance[:count], least)
    deviation[own] = np.linalg.norm(inverse[0]) * np.sqrt(both)
    return jumps, deviation
