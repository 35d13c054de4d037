"""Offset, drift and hum: what a channel shows where nothing moves, taken out of all of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.finding import CURED, Finding, beside_peak, places
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
_MAINS = (50.0, 60.0)
# Saturated cores make odd multiples, rectifiers twice the frequency.
_HARMONICS = (1, 2, 3, 5, 7)
# Fewer periods than this of the mains are a drift.
_PERIODS = 1.5
_HUM = 5.0
# Part of the power of each quarter of what is at rest that hum leaves at most.
_LEFT = 0.95
# Parts of the record that may lie before its signal, and what of their power may be no hum.
_BEGINNINGS, _ALONE = (0.5, 0.25, 0.12, 0.06), 0.2
# An end from this part of the record on that leaves so many times the power is as quiet.
_END, _AS_QUIET = 0.75, 1.5
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
            hum = _hum(v, t, rest.mask[:, j], rest.peak[j])
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


def without_early_hum(
    values: Float, t: Float, x: Float, labels: tuple[str, ...], found: list[Finding]
) -> Float:
    """One component without the mains' hum that its beginning shows, in place.

    With a hum no start is at rest, so it goes before anything is looked for; what is left of it is
    fitted again over all that is at rest.

    Args:
        values: shape (nt, nx), NaN where missing.
        t, x, labels: times, positions and names of the receivers.
        found: findings, added to.
    """
    which, most = [], 0.0
    for j in range(values.shape[1]):
        v = values[:, j]
        for part in _BEGINNINGS:
            stop = int(part * len(v))
            if not _humming(v[:stop], float(t[1] - t[0]), 1 - 2 * _ALONE):
                continue
            own = np.isfinite(v) & (np.arange(len(v)) < stop)
            fit = _mains(v, t, own)
            if fit is None:
                continue
            power, amplitude, wave = fit
            left = v[own] - wave[own]
            alone = np.abs(left - left.mean()).max() <= 7 * np.std(left)
            if alone and power < _ALONE * np.var(v[own]):
                # An end that is as quiet tells the frequency finer.
                both = own | (np.isfinite(v) & (np.arange(len(v)) >= _END * len(v)))
                longer = _mains(v, t, both)
                if longer is not None and longer[0] < _AS_QUIET * power:
                    _, amplitude, wave = longer
                v -= wave
                which.append(j)
                most = max(most, amplitude)
                break
    if which:
        where = places(x, which, labels)
        found.append(Finding("hum", where, f"{most:.3g}", CURED,
                             f"hum of up to {most:.3g} taken out ({where})"))  # fmt: skip
    return values


def _hum(v: Float, t: Float, mask: Mask, peak: float) -> Float | None:
    """A sinusoid of the mains' frequency at rest, carried on through the signal."""
    own = mask & np.isfinite(v)
    stop = int(np.argmin(mask)) or len(v)
    if own.sum() < 4 * FEWEST or not _humming(v[:stop], float(t[1] - t[0]), 0.2):
        return None
    fit = _mains(v, t, own)
    if fit is None:
        return None
    power, amplitude, wave = fit
    error = np.sqrt(2 * power / own.sum())
    above = amplitude > max(_HUM * error, 1e-4 * peak)
    if not above or power > 0.7 * np.var(v[own]):
        return None
    # Hum is there all the time, and a wave that is too weak to be seen is not.
    quarters = np.array_split(np.flatnonzero(own), 4)
    there = all(np.var(v[part] - wave[part]) < _LEFT * np.var(v[part]) for part in quarters)
    return wave if there else None


def _humming(v: Float, interval: float, share: float) -> bool:
    """Whether so much of a stretch's power lies about a mains' frequency and its multiples."""
    span = len(v) * interval
    if span * _MAINS[0] < _PERIODS or len(v) < 4 * FEWEST:
        return False
    filled = np.nan_to_num(v - np.nanmean(v))
    power = np.abs(np.fft.rfft(filled)) ** 2
    f = np.arange(len(power)) / span
    near = np.zeros(len(power), bool)
    for mains in _MAINS:
        for line in (n * mains for n in _HARMONICS):
            near |= np.abs(f - line) <= 0.01 * line + 2 / span
    whole = float(power[1:].sum())
    return whole > 0 and float(power[near].sum()) > share * whole


def _mains(v: Float, t: Float, own: Mask) -> tuple[float, float, Float] | None:
    """Power left, amplitude and course of the best sinusoid near a mains' frequency."""
    covered = float(np.ptp(t[own])) if own.any() else 0.0
    # A frequency so low is found by some samples a period; what it is there by all.
    most = 0.5 / float(t[1] - t[0])
    every = max(1, int(5e-4 / float(t[1] - t[0])), int(own.sum()) // 20_000)
    at = np.flatnonzero(own)[::every]
    part, times = v[at], t[at] - t[0]
    best: tuple[float, float, Float] | None = None
    for mains in _MAINS:
        if covered * mains < _PERIODS or len(at) < 4 * FEWEST:
            continue
        # Fine enough that the residual is a parabola between three of them.
        count = 2 * int(np.ceil(0.01 * mains * covered * 8)) + 3
        tried = mains * (1 + np.linspace(-0.01, 0.01, count))
        left = np.array([_fitted(part, times, f, most)[0] for f in tried])
        grain = tried[1] - tried[0]
        f = _vertex(tried, left)
        tried = f + grain / 4 * np.arange(-1, 2)
        all_of_it = v[own], t[own] - t[0]
        f = _vertex(tried, np.array([_fitted(*all_of_it, g, most)[0] for g in tried]))
        power, found = _fitted(*all_of_it, f, most)
        if best is None or power < best[0]:
            wave = _tones(t - t[0], f, most)[:, 1:] @ found[1:]
            best = power, float(np.hypot(found[1], found[2])), wave
    return best


def _vertex(f: Float, left: Float) -> float:
    """Where the parabola through the least of evenly spaced values and its neighbours is lowest."""
    i = int(np.clip(np.argmin(left), 1, len(f) - 2))
    bend = left[i - 1] - 2 * left[i] + left[i + 1]
    shift = 0.5 * (left[i - 1] - left[i + 1]) / bend if bend > 0 else 0.0
    return float(f[i] + np.clip(shift, -1, 1) * (f[1] - f[0]))


def _fitted(part: Float, times: Float, f: float, most: float) -> tuple[float, Float]:
    """Power left by a level and sinusoids of multiples of f below most, and their amplitudes."""
    basis = _tones(times, f, most)
    found = np.linalg.lstsq(basis.T @ basis, basis.T @ part)[0]
    return float(np.mean((part - basis @ found) ** 2)), found


def _tones(times: Float, f: float, most: float) -> Float:
    angle = 2 * np.pi * f * times
    tones = (wave(n * angle) for n in _HARMONICS if n * f < most
             for wave in (np.cos, np.sin))  # fmt: skip
    return np.stack([np.ones(len(times)), *tones], axis=1)
