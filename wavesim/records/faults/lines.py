"""Steady lines beside the signal's band, as a switched supply or a transmitter makes them.

    u(t) = a cos 2πft + b sin 2πft

from the first sample to the last, where the signal has no power, so that the signal does not tell
on f, a and b: they are fitted to the whole record by least squares, weighed by the window of
Blackman and Harris, which lets nothing of other frequencies in.
With such a line no start is at rest.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.finding import CURED, Finding, places
from wavesim.records.faults.hum import passes
from wavesim.records.windows import blackman_harris

Float = NDArray[Any]

# A line stands so many times above the median of so many bins about it, to so many bins of the
# window's; so many of a channel are looked for, of so many samples and more.
_ABOVE, _ABOUT, _WIDTH, _MOST, _FEWEST = 300.0, 64, 4, 4, 512
# The signal has less than this part of its greatest power there, and is at rest, to this part of
# its peak, in one of so many blocks; in each of fewer a line is as large, to this part.
_BESIDE, _REST, _RESTS, _STEADY, _BLOCKS = 1e-3, 0.1, 16, 0.3, 6
_ROUNDS, _AT_ONCE = 6, 2_000_000


def without_lines(
    values: Float, t: Float, x: Float, labels: tuple[str, ...], found: list[Finding]
) -> None:
    """Take steady lines that the signal's band does not hold out of one component, in place.

    Args:
        values: shape (nt, nx), NaN where missing.
        t, x, labels: times, positions and names of the receivers.
        found: findings, added to.
    """
    nt, nx = values.shape
    if nt < _FEWEST:
        return
    lines = {}
    for few in np.array_split(np.arange(nx), 1 + values.size // _AT_ONCE):
        part = np.nan_to_num(values[:, few] - np.nanmean(values[:, few], axis=0))
        for j, bins in zip(few, _standing_out(part), strict=True):
            own = len(bins) and np.isfinite(values[:, j]).all()
            if own and (one := _lines(values[:, j], bins / nt)) is not None:
                lines[int(j)] = one
    which = list(lines)
    if not which or passes(np.array([wave for wave, _ in lines.values()]), x[which]):
        return
    for j, (wave, _) in lines.items():
        values[:, j] -= wave
    most = max(float(np.abs(wave).max()) for wave, _ in lines.values())
    step = float(t[-1] - t[0]) / (nt - 1)
    every = np.sort(np.concatenate([f for _, f in lines.values()])) / step
    told, where = ", ".join(dict.fromkeys(f"{f:.3g}" for f in every)), places(x, which, labels)
    found.append(
        Finding("line", where, f"{most:.3g} at {told} Hz", CURED,
                f"a steady line of up to {most:.3g} at {told} Hz, beside the signal's band, taken "
                f"out ({where})")
    )  # fmt: skip


def _standing_out(part: Float) -> list[NDArray[np.int64]]:
    """Bins of each channel at which a line stands, the strongest."""
    power = np.abs(np.fft.rfft(part * blackman_harris(len(part))[:, None], axis=0)) ** 2
    blocks = len(power) // _ABOUT
    usual = np.median(power[: blocks * _ABOUT].reshape(blocks, _ABOUT, -1), axis=1)
    edged = np.pad(usual, ((1, 1), (0, 0)), "edge")
    usual = np.max([edged[:-2], edged[1:-1], edged[2:]], axis=0)
    usual = usual[np.minimum(np.arange(len(power)) // _ABOUT, blocks - 1)]
    top = (power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:])
    out = top & (power[1:-1] > _ABOVE * usual[1:-1]) & (power[1:-1] > 1e-12 * power.max(axis=0))
    out[: 2 * _WIDTH] = False  # that is a drift
    at = [np.flatnonzero(one) + 1 for one in out.T]
    return [bins[np.argsort(-power[bins, j])[:_MOST]] for j, bins in enumerate(at)]


def _lines(v: Float, f: Float) -> tuple[Float, Float] | None:
    """The course of a channel's steady lines and their frequencies, per frame, from a first guess;
    None where none is steady, or beside what else there is."""
    frames, weight = np.arange(len(v)), np.sqrt(blackman_harris(len(v)))
    for _ in range(_ROUNDS):
        angle = 2 * np.pi * np.outer(frames, f)
        cos, sin = np.cos(angle), np.sin(angle)
        columns = np.c_[cos, sin, np.ones(len(v))] * weight[:, None]
        size = np.linalg.lstsq(columns, weight * v)[0]
        a, b = size[: len(f)], size[len(f) : -1]
        slope = 2 * np.pi * (frames - len(v) / 2)[:, None] * (b * cos - a * sin)
        both = np.c_[columns, slope * weight[:, None]]
        change = np.linalg.lstsq(both, weight * v)[0][columns.shape[1] :]
        f = f + np.clip(change, -0.5 / len(v), 0.5 / len(v))
    waves = a * cos + b * sin
    rest = v - waves.sum(axis=1)
    good = np.array([_is_steady(rest, wave) for wave in waves.T])
    rest = v - waves[:, good].sum(axis=1)
    rest = rest - np.median(rest)
    quiet = min(np.std(one) for one in np.array_split(rest, _RESTS))
    if not good.any() or quiet > _REST * np.abs(rest).max():
        return None
    power = np.abs(np.fft.rfft(rest)) ** 2
    power = np.convolve(power, np.ones(2 * _WIDTH + 1), "same")
    at = np.clip(np.rint(f * len(v)).astype(int), 0, len(power) - 1)
    good &= power[at] < _BESIDE * power.max()
    return (waves[:, good].sum(axis=1), f[good]) if good.any() else None


def _is_steady(rest: Float, wave: Float) -> bool:
    """Whether a line is as large in each part of a channel as in all of it."""
    for a, b in zip(np.array_split(rest, _BLOCKS), np.array_split(wave, _BLOCKS), strict=True):
        window = blackman_harris(len(a))
        if abs(np.sum(window * a * b)) > _STEADY * np.sum(window * b * b):
            return False
    return True
