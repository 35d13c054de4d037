"""Harmonic inversion: the frequencies in many series, their number found from the data.

The strongest peak of the residual's periodogram is taken as one more sinusoid, all sinusoids are
fitted anew, and so on until no peak stands above the noise (RELAX: Li & Stoica, IEEE Trans. Signal
Process. 44, 281 (1996)). The fit is not limited to bins of the transform: without noise it is
exact to rounding, and in white noise it attains the Cramér–Rao bound.

A peak counts where noise of the residual's level, per channel, over all frequencies and close to
this one, would show one as high in one series of a million, and where its amplitude is above a
given part of the strongest. Errors take the noise from the residual close to each frequency, so
that noise need not be white.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.fft import next_fast_len, rfft
from scipy.special import gammainccinv

from wavesim.readings.dispersion.hidden_mode import Bends, of_sinusoids
from wavesim.readings.dispersion.noise_level import continuum
from wavesim.readings.dispersion.sinusoids import (
    Fit,
    Float,
    exponentials,
    fit,
    transposed,
)
from wavesim.records.windows import blackman_harris, hann

FALSE_ALARM = 1e-6
# Part of the strongest amplitude below which no sinusoid is sought: weaker ones are at the level
# of the numerical errors that a long product of additions leaves.
DYNAMIC_RANGE = 5e-7
# What is weaker than this part of the strongest series is the rounding of its transform.
_OF_STRONGEST = 1e-14
_PADDING = 2
_BATCH = 2_000_000
_WORKERS = 2
# Noise close to a frequency is the residual's between these many bins from it.
_NEAR = (2.0, 12.0)
# Sinusoids closer than this part of a bin, or less sure than this, are not told apart.
_CLOSEST_BINS = 0.05
_FEWEST_SAMPLES = 16
# So many sinusoids within so many bins of the strongest, above this part of it, are no waves: no
# number of them ends a line that is broad and random.
_CROWD, _CROWD_BINS, _CROWD_PART = 5, 10.0, 0.01
_FIRST_STEPS = 6
# Noise goes with the signal where it is heard more by so many deviations of that ratio.
_BY_SCATTER = 4.0
# Phase error over the record, rad, that the sums of a simulated field leave on its strongest wave.
_ROUNDING = 1e-11


@dataclass(frozen=True)
class Sinusoids:
    """Sinusoids found in n series; flat arrays over all of them, (m,) each.

    Attributes:
        series: which series it is in, ascending.
        omega, decay: ω and γ, rad/s and 1/s.
        amplitude: √Σ_c |a_c|² at the start of the record, unit of the series.
        shape: a_c over its norm at the middle of the record, shape (m, C), complex.
        omega_error, decay_error: standard errors, rad/s and 1/s.
        amplitude_error: standard error, unit of the series.
        resolved: whether the fit holds it apart from its neighbours.
        residual: part of each series' power that no sinusoid explains, shape (n,).
        bends: how far from straight ln y is beside one sinusoid's, 1/s².
        settled: whether no further peak was left in the series, shape (n,).
        broad: whether many sinusoids crowd about its strongest, as under a line that is broad and
            random, shape (n,).
    """

    series: np.ndarray
    omega: Float
    decay: Float
    amplitude: Float
    shape: np.ndarray
    omega_error: Float
    decay_error: Float
    amplitude_error: Float
    bends: Bends
    resolved: np.ndarray
    residual: Float
    settled: np.ndarray
    broad: np.ndarray


@dataclass(frozen=True)
class _Search:
    """What is common to all series of one call."""

    window: Float
    weight: Float | None
    padded: int
    most: int
    dynamic_range: float
    damped: bool
    scale: Float
    least: float
    leakage: Float | None


def padded_length(count: int) -> int:
    """Length of the transform, padded twice, that peaks are looked for in."""
    return int(next_fast_len(_PADDING * count, real=True))


def invert(
    series: Float,
    interval: float,
    most: int = 8,
    dynamic_range: float = DYNAMIC_RANGE,
    damped: bool = True,
    missing: np.ndarray | None = None,
    leakage: Float | None = None,
) -> Sinusoids:
    """Find the sinusoids in each of n series.

    Args:
        series: y, shape (n, C, N): C channels that share frequencies, real.
        interval: Δt between samples, s.
        most: most sinusoids in one series, –.
        dynamic_range: weakest amplitude sought, over the strongest of its series, –.
        damped: False holds every decay to 0.
        missing: which of the N samples are missing, shape (N,), bool.
        leakage: square of the amplitude below which a peak may be another series', shape (n, nω)
            at the frequencies of a transform padded twice (:func:`padded_length`).

    Returns:
        What was found.

    Raises:
        ValueError: fewer than 16 samples, or one that is not finite.
    """
    n, channels, count = series.shape
    present = np.ones(count, bool) if missing is None else ~np.asarray(missing, bool)
    if present.sum() < _FEWEST_SAMPLES:
        raise ValueError(
            f"series of {present.sum()} samples: harmonic inversion needs at least "
            f"{_FEWEST_SAMPLES}; lengthen the record or sample it more often"
        )
    if not np.isfinite(series[..., present]).all():
        raise ValueError("series: holds values that are not finite; name them as missing")
    window = hann(count) * present
    weight = None if present.all() else present.astype(float)
    padded = padded_length(count)
    scale = _levels(series, present)
    size_of = np.sqrt(np.sum(np.mean(series[..., present] ** 2, axis=-1), axis=-1))
    least = _OF_STRONGEST * float(size_of.max(initial=0.0))
    leaks = None if leakage is None or not leakage.any() else leakage
    search = _Search(window, weight, padded, most, dynamic_range, damped, scale, least, leaks)
    size = max(1, _BATCH // (count * max(channels, 4)))
    parts = [slice(start, min(start + size, n)) for start in range(0, n, size)]

    def one(part: slice) -> list[tuple[np.ndarray, _Found]]:
        clean = np.where(present, series[part] / scale[:, None], 0.0)
        own = replace(search, leakage=None if leaks is None else leaks[part])
        return [(part.start + rows, found) for rows, found in _search(clean, own)]

    with ThreadPoolExecutor(_WORKERS) as pool:
        groups = [group for done in pool.map(one, parts) for group in done]
    return _gather(groups, n, channels, interval)


def _levels(series: Float, present: np.ndarray) -> Float:
    """Noise of each channel, shape (C,): divided by these, channels count by what they tell.

    The median of the periodogram is the noise where there is some, and else the leakage of the
    window, which goes with the signal; a channel without signal counts no more than by a hundred.
    """
    count = series.shape[-1]
    window = blackman_harris(count) * present
    some = np.where(present, series[:: max(1, len(series) // 64)], 0.0)
    power = np.abs(rfft(some * window, axis=-1)) ** 2
    floor = np.median(np.median(power, axis=-1), axis=0)
    peak = np.median(power.max(axis=-1), axis=0).max()
    floor = np.maximum(floor, max(1e-14 * peak, 1e-4 * floor.max()))
    return np.sqrt(floor / floor.max()) if floor.max() > 0 else np.ones(len(floor))


@dataclass(frozen=True)
class _Found:
    """Result of one group of series with p sinusoids each."""

    omega: Float
    decay: Float
    amplitude: Float
    shape: np.ndarray
    errors: Float
    amplitude_error: Float
    bends: Bends
    resolved: np.ndarray
    residual: Float
    settled: np.ndarray
    broad: np.ndarray


def _search(series: Float, search: _Search) -> Iterator[tuple[np.ndarray, _Found]]:
    """Add one sinusoid at a time to all series that still show a peak."""
    rows = np.arange(len(series))
    power = np.mean(series**2, axis=(1, 2))
    rows = rows[power > 0]
    residual = series[rows]
    omega, decay = np.zeros((len(rows), 0)), np.zeros((len(rows), 0))
    strongest = np.zeros(len(rows))
    last: Fit | None = None
    for p in range(search.most + 1):
        if not len(rows):
            return
        peak, size, height = _highest_peak(residual, search, rows)
        weakest = np.maximum(search.dynamic_range * strongest, search.least)
        goes_on = (size > height) & (size > weakest)
        broad = goes_on & _crowded(last, search) if last is not None else np.zeros_like(goes_on)
        stops = ~goes_on | broad | (p == search.most)
        if stops.any():
            if last is not None:
                ended = _report(_take(last, stops), series[rows[stops]], search)
                ended = replace(ended, settled=~goes_on[stops], broad=broad[stops])
                yield rows[stops], ended
            rows, peak, size = rows[~stops], peak[~stops], size[~stops]
            omega, decay, strongest = omega[~stops], decay[~stops], strongest[~stops]
        if not len(rows):
            return
        omega = np.concatenate([omega, peak[:, None]], axis=1)
        decay = np.concatenate([decay, np.zeros((len(rows), 1))], axis=1)
        # Without decay first, so that a fit from afar is not drawn to a broad, damped peak.
        near = fit(series[rows], omega, decay, search.weight, False, _FIRST_STEPS)
        last = fit(series[rows], near.omega, decay, search.weight, search.damped)
        omega, decay, residual = last.omega, last.decay, last.residual
        strongest = _norm(last.amplitude, search).max(axis=1)


def _crowded(found: Fit, search: _Search) -> np.ndarray:
    """Whether several sinusoids of like strength stand within a few bins of the strongest."""
    norm = _norm(found.amplitude, search)
    row, first = np.arange(len(norm)), norm.argmax(axis=1)
    bins = np.abs(found.omega - found.omega[row, first][:, None]) * len(search.window) / (2 * np.pi)
    near = (bins < _CROWD_BINS) & (norm > _CROWD_PART * norm[row, first][:, None])
    return np.asarray(near.sum(axis=1) >= _CROWD)


def _norm(amplitude: np.ndarray, search: _Search) -> Float:
    """√Σ_c |a_c|² in the series' own unit, (n, p)."""
    return np.sqrt(np.sum(np.abs(amplitude * search.scale[:, None]) ** 2, axis=1))


def _highest_peak(residual: Float, search: _Search, rows: np.ndarray) -> tuple[Float, Float, Float]:
    """ω of the highest peak between the bins, its amplitude, and the amplitude that noise reaches.

    Channels are weighted by their own noise: that of the median of the periodogram.
    """
    count, channels = residual.shape[-1], residual.shape[1]
    spectrum = rfft(residual * search.window, search.padded, axis=-1)
    power = spectrum.real**2 + spectrum.imag**2
    floor = np.median(power, axis=-1) / np.log(2)
    floor = np.maximum(floor, 1e-30 * power.max(axis=(1, 2))[:, None] + 1e-290)
    white = np.sum(power / floor[..., None], axis=1)
    white[:, : max(1, search.padded // count // 2)] = 0
    total = search.window.sum()
    threshold = gammainccinv(channels, FALSE_ALARM / count)
    about = continuum(white, search.padded / count, channels)
    usual = np.maximum(np.median(white, axis=1, keepdims=True), 1e-290)
    stands = white * usual > threshold * about
    if search.leakage is not None:
        square = np.einsum("ncf,c->nf", power, search.scale**2) * (2 / total) ** 2
        stands &= square > search.leakage[rows]
    white = np.where(stands, white, 0.0)
    at = np.argmax(white, axis=1)
    row = np.arange(len(white))
    inner = np.clip(at, 1, white.shape[1] - 2)
    left, middle, right = (
        np.log(np.sum(power[row, :, inner + d] / floor, axis=1) + 1e-290) for d in (-1, 0, 1)
    )
    bend = left - 2 * middle + right
    shift = np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, 1), 0.0)
    omega = 2 * np.pi * (inner + np.clip(shift, -0.5, 0.5)) / search.padded
    size = 2 / total * np.sqrt(np.sum(power[row, :, at] * search.scale**2, axis=1))
    height = size * np.sqrt(threshold / np.maximum(white[row, at], 1e-290))
    return omega, size, height


def _take(found: Fit, which: np.ndarray) -> Fit:
    return Fit(*(getattr(found, name)[which] for name in Fit.__dataclass_fields__))


def _report(found: Fit, series: Float, search: _Search) -> _Found:
    """Sinusoids with their errors, from the residual's level close to each."""
    n, channels, count = series.shape
    p = found.omega.shape[1]
    spectrum = rfft(found.residual * search.window, search.padded, axis=-1)
    power = (spectrum.real**2 + spectrum.imag**2) / np.sum(search.window**2)
    bins = np.arange(power.shape[-1]) * count / search.padded
    distance = np.abs(bins - (found.omega * count / (2 * np.pi))[..., None])
    near = ((distance >= _NEAR[0]) & (distance <= _NEAR[1])).astype(float)
    # An error of ω is Σ t n(t) e^{iωt}, which hears noise Δ bins from ω by ((sin x/x)′)², x = πΔ,
    # of area 1/3: nearly all from close by, and 1/2x² of what is far.
    far = np.where(distance > _NEAR[1], 3 / (2 * (np.pi * np.maximum(distance, 1)) ** 2), 0.0)
    far *= count / search.padded
    heard = near * ((1 - far.sum(axis=-1)) / np.maximum(near.sum(axis=-1), 1))[..., None] + far
    level = np.einsum("ncf,npf->ncp", power, heard)
    # What the fit's own parameters took out of the residual.
    samples = count if search.weight is None else search.weight.sum()
    level = level * samples / max(samples - 2 * p - (2 * p if search.damped else p) / channels, 1)
    norm = _norm(found.amplitude, search)
    noise = np.concatenate([level, level], axis=-1)
    scale = np.sqrt(noise)
    middle = np.sum(scale[..., :, None] * found.parts * scale[..., None, :], axis=1)
    covariance = found.unit @ middle @ transposed(found.unit)
    variance = np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0)
    more = _in_step(found, count)
    variance = variance * np.concatenate([more, more], axis=1)
    weakness = norm.max(axis=1, keepdims=True) / np.maximum(norm, 1e-290)
    rounding = _ROUNDING * weakness / count
    errors = np.sqrt(variance + np.concatenate([rounding, rounding], axis=1) ** 2)
    start = np.exp(np.clip(found.decay * (count - 1) / 2, -50, 50))
    square = search.scale[:, None] ** 2
    shares = np.abs(found.amplitude) ** 2 * square / np.maximum(norm**2, 1e-290)[:, None]
    amplitude_error = found.unit_amplitude * np.sqrt(np.sum(shares * level * square, axis=1))
    apart = np.abs(found.omega[:, :, None] - found.omega[:, None, :])
    apart = apart + np.where(np.eye(p, dtype=bool), np.inf, 0)
    closest = apart.min(axis=-1) * count / (2 * np.pi)
    resolved = (closest > _CLOSEST_BINS) & (errors[:, :p] * count < np.pi)
    # Of two that are hardly told apart the error is no small one, which it is taken for.
    errors[:, :p] *= 1 + 2 * errors[:, :p] / apart.min(axis=-1)
    return _Found(
        found.omega,
        found.decay,
        norm * start,
        transposed(found.amplitude * search.scale[:, None] / np.maximum(norm, 1e-290)[:, None]),
        errors,
        amplitude_error * start,
        of_sinusoids(found, level, search.scale, search.weight),
        resolved & (norm > 4 * amplitude_error),
        np.mean(found.residual**2, axis=(1, 2)) / np.mean(series**2, axis=(1, 2)),
        np.ones(n, bool),
        np.zeros(n, bool),
    )


def _in_step(found: Fit, count: int) -> Float:
    """How much more noise a frequency hears than one that goes on by itself, shape (n, p).

    A clock that shivers shifts all channels together, and most where the signal is steepest: of
    slopes s_c = ∂y_c/∂ω and noise r_c it is Σ_t (Σ_c s_c r_c)² over Σ_c Σ_t s_c² ⟨r_c²⟩.
    """
    n, p = found.omega.shape
    t = np.arange(count) - (count - 1) / 2
    level = np.mean(found.residual**2, axis=-1)
    more = np.ones((n, p))
    for j in range(p):
        z = exponentials(found.omega[:, j : j + 1], found.decay[:, j : j + 1], count)
        slope = t * (found.amplitude[:, :, j, None] * z).imag
        heard = np.sum(np.sum(slope * found.residual, axis=1) ** 2, axis=-1)
        alone = np.einsum("nct,nc->n", slope**2, level)
        more[:, j] = heard / np.maximum(alone, 1e-290)
    return np.where(more > 1 + _BY_SCATTER * np.sqrt(2 / count), more, 1.0)


def _gather(
    groups: list[tuple[np.ndarray, _Found]], n: int, channels: int, interval: float
) -> Sinusoids:
    residual, settled, broad = np.ones(n), np.ones(n, bool), np.zeros(n, bool)
    columns: dict[str, list[Any]] = {
        "series": [np.zeros(0, int)],
        "shape": [np.zeros((0, channels), complex)],
        "resolved": [np.zeros(0, bool)],
    }
    for rows, found in groups:
        residual[rows], settled[rows] = found.residual, found.settled
        broad[rows] = found.broad
        p = found.omega.shape[1]
        flat = {
            "series": np.repeat(rows, p),
            "omega": found.omega / interval,
            "decay": found.decay / interval,
            "amplitude": found.amplitude,
            "shape": found.shape.reshape(-1, channels),
            "omega_error": found.errors[:, :p] / interval,
            "decay_error": found.errors[:, p:] / interval,
            "amplitude_error": found.amplitude_error,
            "bend": found.bends.size / interval**2,
            "noise": found.bends.noise / interval**2,
            "over": found.bends.over,
            "resolved": found.resolved,
        }
        for name, values in flat.items():
            kept = values if name == "shape" else values.ravel()
            columns.setdefault(name, [np.zeros(0)]).append(kept)
    for name in (
        "omega", "decay", "amplitude", "omega_error", "decay_error", "amplitude_error", "bend",
        "noise", "over",
    ):  # fmt: skip
        columns.setdefault(name, [np.zeros(0)])
    whole = {name: np.concatenate(parts) for name, parts in columns.items()}
    order = np.lexsort((whole["omega"], whole["series"]))
    ordered = {name: values[order] for name, values in whole.items()}
    bends = Bends(*(ordered.pop(name) for name in ("bend", "noise", "over")))
    return Sinusoids(**ordered, bends=bends, residual=residual, settled=settled, broad=broad)
