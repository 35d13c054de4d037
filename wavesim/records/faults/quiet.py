"""Where a channel is at rest: before its first break, and after its signal has died away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# Fewer samples at rest tell nothing.
FEWEST = 8
# A sample this many times the noise off its level is a signal's.
_ABOVE = 5.0
# A start counts as quiet where its deviation is at most this part of the peak, and, but for a
# slope, at most so many times the noise between neighbours or that part of the peak: the crest of a
# wave is flat too, but not so flat.
_LOUD = 0.1
_FLAT, _FLAT_PART = 4.0, 1e-3
# Part of the time before the first break that counts as quiet: an emergent onset has a foot.
_PART = 0.8
_CROWD, _FEW = 4, 0.25
# A hiss is as loud, to this factor, in each of so many blocks.
_EVEN, _BLOCKS = 2.5, 8
# Over a block the end may deviate this many times more than the start.
_TAIL = 1.6
# Rounding is a noise too, of this part of the peak.
_ROUNDING = 1e-9

# Part of the frames at rest that is worth leaving out.
_WORTH_CUTTING = 0.1
# A signal is seen from these parts of its peak on, and began so many times as long before as it
# takes to the second ones; noise is within so many of its deviations.
_FEET, _RISES, _WITHIN = ((0.1, 0.5), (0.5, 0.9), (1e-12, 1e-12)), 2, 5.5
# Parts of so many frames that are louder by so many deviations than what is before are a foot.
_PART_AT_REST, _LOUDER = 16, 2.0


@dataclass(frozen=True)
class Rest:
    """Rest of each channel of one component.

    Attributes:
        onset: number of samples at rest before the signal, shape (nx,); 0 where it begins within.
        mask: samples at rest before and after it, shape (nt, nx).
        level, noise: mean and standard deviation of those before, shape (nx,); NaN where none are.
        peak: largest distance from the level (or from the median), shape (nx,).
    """

    onset: NDArray[np.int64]
    mask: Mask
    level: Float
    noise: Float
    peak: Float


def rest(values: Float, quantum: Float) -> Rest:
    """Find the rest of each channel.

    Args:
        values: one component, shape (nt, nx), NaN where a sample is missing.
        quantum: least step of each channel, shape (nx,).
    """
    nt, nx = values.shape
    onset = np.zeros(nx, int)
    mask = np.zeros((nt, nx), bool)
    level, noise = np.full(nx, np.nan), np.full(nx, np.nan)
    peak = np.zeros(nx)
    width = min(max(FEWEST, nt // 64), nt // 2)
    for j in range(nx):
        v = values[:, j]
        finite = np.isfinite(v)
        if finite.sum() < 2 * FEWEST:
            continue
        if not finite.all():
            v = np.interp(np.arange(nt), np.flatnonzero(finite), v[finite])
        least = max(1.01 * quantum[j], _ROUNDING * np.ptp(v), 1e-300)
        head = v[:width]
        centre, spread = float(np.mean(head)), max(float(np.std(head)), least / _ABOVE)
        peak[j] = np.abs(v - centre).max()
        if spread > _LOUD * peak[j] or not _still(head, v, peak[j], least):
            peak[j] = np.abs(v - np.median(v)).max()
            continue
        first = _first(v, centre, max(_ABOVE * spread, least))
        # Once more, with the level of all that is known to be quiet.
        kept = max(int(_PART * first), 1)
        if kept >= FEWEST:
            own = v[:kept]
            centre, spread = float(np.mean(own)), max(float(np.std(own)), least / _ABOVE)
            first = _first(v, centre, max(_ABOVE * spread, least))
            kept = max(int(_PART * first), 1)
        if kept < FEWEST:
            continue
        own = v[:kept]
        onset[j], level[j], noise[j] = kept, float(np.mean(own)), float(np.std(own))
        peak[j] = np.abs(v - level[j]).max()
        mask[:kept, j] = True
        last = _last(v, max(spread, least / _ABOVE), 2 * width, least)
        mask[last:, j] = True
    if nx >= _CROWD and (onset > 0).mean() < _FEW:
        # Where hardly any channel is at rest, those that seem to be are on a crest.
        onset[:], mask[:] = 0, False
        level[:] = noise[:] = np.nan
    return Rest(onset, mask, level, noise, peak)


def fine_noise(v: Float) -> float:
    """Standard deviation of white noise by third differences, which a smooth signal hardly has."""
    changes = np.flatnonzero(np.diff(v) != 0)
    if len(changes):
        v = v[changes[0] : changes[-1] + 1]  # padding is no signal
    if len(v) < 8:
        return 0.0
    return 1.4826 * float(np.median(np.abs(np.diff(v, 3)))) / np.sqrt(20.0)


def _still(head: Float, v: Float, peak: float, least: float) -> bool:
    """Whether a start is straight to within the noise."""
    s = np.arange(len(head))
    line = np.polynomial.Polynomial.fit(s, head, 1)
    left = float(np.std(head - line(s)))
    slope = abs(float(line(s[-1]) - line(s[0])))
    noise = max(fine_noise(v), least)
    smooth = left <= max(_FLAT * noise, _FLAT_PART * peak) and slope <= 8 * noise + 0.02 * peak
    return smooth or _hisses(v, len(head), peak)


def _hisses(v: Float, width: int, peak: float) -> bool:
    """Whether a start is a noise of its own, that of a filtered amplifier: alike for long."""
    blocks = v[: _BLOCKS * width].reshape(-1, width) if len(v) >= 2 * _BLOCKS * width else v[None]
    if len(blocks) < _BLOCKS or width < FEWEST:
        return False
    size = np.sqrt(np.mean((blocks - blocks.mean()) ** 2, axis=1))
    return bool(size.max() < min(_EVEN * size.min(), _LOUD * peak))


def _first(v: Float, centre: float, bound: float) -> int:
    beyond = np.abs(v - centre) > bound
    # Two of three in a row: noise alone passes five deviations seldom, and not twice.
    two = beyond[:-2].astype(int) + beyond[1:-1] + beyond[2:] >= 2
    return int(np.argmax(two)) if two.any() else len(v)


def _last(v: Float, spread: float, width: int, least: float) -> int:
    """From which sample on the end is as quiet as the start, about a line of its own."""
    s = np.arange(width) - (width - 1) / 2
    stop = len(v)
    while stop >= width:
        block = v[stop - width : stop]
        slope = float(np.sum(s * block) / np.sum(s * s))
        if np.std(block - slope * s) > _TAIL * spread + least:
            break
        stop -= width
    # A signal fades: leave out as much again as a quarter of what is quiet.
    return stop + (len(v) - stop) // 4


def frames_at_rest(values: Float) -> int:
    """How many frames of u (nt, nx) are before anything stands out of its noise, less a margin."""
    count = len(values)
    peaks = np.abs(values).max(axis=0)

    def reached(part: float) -> int:
        return int((np.abs(values) > part * peaks).any(axis=1).argmax())

    for part, later in _FEET:
        first = reached(part)
        # A signal that rises slowly begins long before it is seen.
        cut = first - max(8, first // 8, _RISES * (reached(later) - first))
        if not _WORTH_CUTTING * count < cut < count // 2:
            continue
        before, head = values[:cut], values[: cut // 2]
        size = np.abs(before - head.mean(axis=0)).max(axis=0)
        # A signal's foot is no noise: it is all at the end.
        if (size <= _WITHIN * head.std(axis=0) + 1e-12 * peaks).all():
            return _before_foot(values, cut) if cut > 2 * _PART_AT_REST else cut
    return 0


def _before_foot(values: Float, cut: int) -> int:
    """Frames before a signal that rises out of the noise: parts at the end louder than the rest."""
    part, low = max(_PART_AT_REST, cut // 8), cut
    size = (values[:cut] - values[: cut // 2].mean(axis=0)) ** 2
    size = size.mean(axis=1) / max(float(size[: cut // 2].mean()), 1e-290)
    chance = _LOUDER * np.sqrt(2 / (part * values.shape[1]))
    while low >= max(cut // 4, part) and size[low - part : low].mean() > 1 + chance:
        low -= part
    return low if low == cut else max(0, low - part)
