"""The mains' hum: 50 or 60 Hz and their multiples, seen where a record is at rest."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.finding import CURED, Finding, places
from wavesim.records.faults.quiet import FEWEST

Float = NDArray[Any]
Mask = NDArray[np.bool_]

_MAINS = (50.0, 60.0)
# Saturated cores make odd multiples, rectifiers twice the frequency.
_HARMONICS = (1, 2, 3, 5, 7)
# Fewer periods than this of the mains are a drift.
_PERIODS = 1.5
_HUM = 5.0
# Part of the power of each quarter of what is at rest that hum leaves at most.
_LEFT = 0.95
# Multiples are hum's where the mains' own frequency has this part of their power.
_OWN = 0.1
# So many receivers tell hum from a wave that passes them: of hum one course has this part of the
# power, and of a wave one direction this part of all amplitudes.
_FEWEST_PASSED, _IN_STEP, _PASSES = 5, 0.8, 0.9
# Parts of the record that may lie before its signal, and what of their power may be no hum.
_BEGINNINGS, _ALONE = (0.5, 0.25, 0.12, 0.06), 0.2
# An end from this part of the record on that leaves so many times the power is as quiet.
_END, _AS_QUIET = 0.75, 1.5


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
    hum: dict[int, tuple[float, Float]] = {}
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
                hum[j] = amplitude, wave
                break
    which = list(hum)
    waves = np.array([wave for _, wave in hum.values()])
    if which and not passes(waves, x[which]):
        values[:, which] -= waves.T
        most = max(amplitude for amplitude, _ in hum.values())
        where = places(x, which, labels)
        found.append(Finding("hum", where, f"{most:.3g}", CURED,
                             f"hum of up to {most:.3g} taken out ({where})"))  # fmt: skip
    return values


def passes(waves: Float, x: Float) -> bool:
    """Whether sinusoids of one frequency, (n, nt), pass along a line, as a shaker's do: hum is in
    step everywhere, or turned round, so that one course stands for all, or has any phase."""
    if len(x) < _FEWEST_PASSED or not np.isfinite(x).all() or not np.ptp(x) > 0:
        return False
    power = np.linalg.svd(waves, compute_uv=False) ** 2
    if power[0] > _IN_STEP * power.sum():
        return False
    spectra = np.fft.rfft(waves, axis=1)
    z = spectra[:, np.argmax(np.sum(np.abs(spectra) ** 2, axis=0))]
    apart = np.diff(np.sort(x))
    k = np.arange(0, np.pi / apart[apart > 0].min(), 0.3 / np.ptp(x))
    beam = np.abs(np.exp(1j * np.outer(np.r_[-k, k], x)) @ z)
    return bool(beam.max() > _PASSES * np.abs(z).sum())


def hum_at_rest(v: Float, t: Float, mask: Mask, peak: float) -> Float | None:
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
    near, own = np.zeros((2, len(power)), bool)
    for mains in _MAINS:
        for line in (n * mains for n in _HARMONICS):
            near |= np.abs(f - line) <= 0.01 * line + 2 / span
        own |= np.abs(f - mains) <= 0.01 * mains + 2 / span
    whole, all_lines = float(power[1:].sum()), float(power[near].sum())
    return all_lines > share * whole and float(power[own].sum()) > _OWN * all_lines


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
        # Of one that is above the Nyquist frequency nothing is left to fit.
        if len(found) > 1 and (best is None or power < best[0]):
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
