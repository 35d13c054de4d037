"""Offset and drift, and hum: what a channel shows where nothing moves, taken out of all of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.finding import CURED, Finding, beside_peak, places
from wavesim.records.faults.hum import hum_at_rest
from wavesim.records.faults.quiet import FEWEST, Rest

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# A level is an offset where it is this many standard errors off 0, and this part of the peak.
_ERRORS = 5.0
_PART = 1e-7
# Where no start is quiet, a line at zero frequency stands this many times above its neighbours.
_LINE = 5.0
# So many channels tell what all have alike, and differ by at most this part of it.
_ENOUGH, _ALIKE = 0.4, 0.05
# A rest shorter than this many times the fewest samples, off by this part of the peak, is doubted.
_SHORT, _STEP = 4, 0.05


def without_baseline(
    values: Float,
    t: Float,
    x: Float,
    labels: tuple[str, ...],
    quantum: Float,
    rest: Rest,
    found: list[Finding],
) -> Float:
    """One component without what it shows at rest.

    Args:
        values: shape (nt, nx), NaN where missing; changed in place.
        t, x, labels: times, positions and names of the receivers.
        quantum: least step of each, shape (nx,).
        rest: where each is at rest.
        found: findings, added to.
    """
    taken: dict[str, list[tuple[int, float]]] = {"offset": [], "drift": [], "hum": []}
    shared = _shared(values, rest)
    # What all have alike is taken from all alike, and leaves differences between them as they are.
    values -= shared
    usual = _usual(rest)
    for j in range(values.shape[1]):
        v = values[:, j]
        base, kind = None, "offset"
        if rest.onset[j] >= FEWEST:
            hum = hum_at_rest(v, t, rest.mask[:, j], rest.peak[j])
            if hum is not None:
                v -= hum
                taken["hum"].append((j, float(np.abs(hum).max())))
            base, kind = _level(
                v, rest.mask[:, j], int(rest.onset[j]), quantum[j], rest.peak[j], usual
            )
        elif not shared:
            base = _line(v)
        if base is not None and kind == "drift" and not np.abs(base).max() > _PART * rest.peak[j]:
            base = None
        if base is not None:
            v -= base
        size = abs(shared) if base is None else float(np.abs(base + shared).max())
        if size:
            taken[kind].append((j, size))
    for kind, those in taken.items():
        if those:
            which = [j for j, _ in those]
            most = max(size for _, size in those)
            part = max(size / max(rest.peak[j], 1e-300) for j, size in those)
            where = places(x, which, labels)
            found.append(
                Finding(kind, where, f"{most:.3g}, {beside_peak(part)}", CURED,
                        f"{kind} of up to {most:.3g} ({beside_peak(part)}) taken out ({where})")
            )  # fmt: skip
    return values


def _shared(values: Float, rest: Rest) -> float:
    """The offset that all channels have alike; 0 where there is none."""
    own = rest.onset >= FEWEST
    if own.mean() >= _ENOUGH:
        levels, errors = rest.level[own], rest.noise[own] / np.sqrt(rest.onset[own])
    else:
        found = [_line(values[:, j]) for j in range(values.shape[1])]
        lines = [one for one in found if one is not None]
        if len(lines) < _ENOUGH * len(found) or len(found) < 2:
            return 0.0
        levels, errors = np.array([one[0] for one in lines]), np.zeros(len(lines))
    middle = float(np.median(levels))
    spread = 1.4826 * float(np.median(np.abs(levels - middle)))
    error = float(np.median(errors))
    alike = spread <= 3 * error + _ALIKE * abs(middle)
    size = float(np.median(rest.peak))
    if not alike or abs(middle) <= max(_ERRORS * error, _PART * size):
        return 0.0
    near = np.abs(levels - middle) <= 3 * max(spread, error)
    return float(levels[near].mean())


def _usual(rest: Rest) -> tuple[float, float]:
    """Level of the channels that are long at rest, and how far they differ."""
    sure = rest.level[rest.onset >= _SHORT * FEWEST]
    if not len(sure):
        return 0.0, 0.0
    middle = float(np.median(sure))
    return middle, 1.4826 * float(np.median(np.abs(sure - middle)))


def _level(
    v: Float, mask: Mask, onset: int, quantum: float, peak: float, usual: tuple[float, float]
) -> tuple[Float | None, str]:
    """The level at rest: constant, or a parabola where it moves."""
    start = v[:onset]
    start = start[np.isfinite(start)]
    if len(start) < FEWEST:
        return None, "offset"
    level, error = float(start.mean()), _error(start)
    off = abs(level) > max(_ERRORS * error, _PART * peak, 0.05 * quantum)
    at = np.flatnonzero(mask & np.isfinite(v))
    after = at[at >= onset]
    if len(after) >= 2 * FEWEST and _slopes(v[after]):
        drift = _drift(v, at, onset, max(float(start.std()), quantum / np.sqrt(12)), peak)
        if drift is not None and np.abs(drift).max() > _PART * peak:
            return drift, "drift"
    if not off:
        return None, "offset"
    half = len(start) // 2
    a, b = start[:half], start[half:]
    still = abs(a.mean() - b.mean()) <= _ERRORS * np.hypot(_error(a), _error(b)) + 0.5 * quantum
    if len(after) >= 2 * FEWEST:
        end = v[after]
        if abs(end.mean() - level) <= _ERRORS * np.hypot(error, _error(end)) + 0.5 * quantum:
            return np.full(len(v), v[at].mean()), "offset"
    as_others = abs(level - usual[0]) <= 5 * (usual[1] + error) + 0.02 * peak
    if onset < _SHORT * FEWEST and abs(level) > _STEP * peak and not as_others:
        # So short a rest, so far off, is a part of the signal.
        return None, "offset"
    if not still:
        # A foot of the signal, or a drift whose course is not known: nothing to go by.
        return None, "drift"
    return np.full(len(v), level), "offset"


def _drift(v: Float, at: NDArray[np.int64], onset: int, noise: float, peak: float) -> Float | None:
    """A line or parabola through what is at rest before and after, if it fits both; else None."""
    s = np.arange(len(v)) / len(v)
    # Both ends weigh alike, however long each is.
    before = at < onset
    weight = np.where(before, 1 / np.sqrt(before.sum()), 1 / np.sqrt((~before).sum()))
    for order in (1, 2):
        fit = np.polynomial.Polynomial.fit(s[at], v[at], order, w=weight)
        left = v[at] - fit(s[at])
        good = all(
            np.std(left[part]) <= 1.5 * noise + 1e-6 * peak
            and abs(left[part].mean()) <= _ERRORS * _error(left[part]) + 1e-6 * peak
            for part in (before, ~before)
        )
        if good:
            return np.asarray(fit(s))
    return None


def _error(part: Float) -> float:
    """Standard error of a mean, neighbours that hang together allowed for."""
    n = len(part)
    if n < 2:
        return float("inf")
    off = part - part.mean()
    power = float(np.mean(off**2))
    if power == 0:
        return 0.0
    along = max(0.0, float(np.mean(off[1:] * off[:-1])) / power)
    return float(np.sqrt(power / n * (1 + along) / max(1 - along, 0.05)))


def _slopes(part: Float) -> bool:
    """Whether values rise or fall from end to end more than their noise lets them."""
    s = np.linspace(-1, 1, len(part))
    slope, level = np.polyfit(s, part, 1)
    left = part - level - slope * s
    error = np.sqrt(3.0) * max(_error(left), 1e-300)
    return bool(abs(slope) > 5.0 * error)


def _line(v: Float) -> Float | None:
    """The mean of a signal that is never at rest, where it is a line at zero frequency."""
    finite = np.isfinite(v)
    if finite.mean() < 0.98 or len(v) < 64:
        return None
    frames = np.arange(len(v))
    filled = v if finite.all() else np.interp(frames, frames[finite], v[finite])
    window = np.blackman(len(v))
    window = window / window.sum()
    mean = float(np.sum(window * filled))
    beside = np.abs(np.fft.rfft((filled - mean) * window)[4:12]).max()
    if abs(mean) <= _LINE * beside or abs(mean) <= _PART * np.abs(filled).max():
        return None
    return np.full(len(v), mean)
