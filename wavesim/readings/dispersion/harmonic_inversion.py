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

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np
from scipy.fft import next_fast_len, rfft
from scipy.special import gammainccinv

from wavesim.readings.dispersion.hidden_mode import Bends
from wavesim.readings.dispersion.noise_level import continuum
from wavesim.readings.dispersion.sinusoid_errors import Settings, Sinusoids, norm_of, report
from wavesim.readings.dispersion.sinusoids import Fit, Float, fit
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
_FEWEST_SAMPLES = 16
# So many sinusoids within so many bins of the strongest, above this part of it, are no waves: no
# number of them ends a line that is broad and random.
_CROWD, _CROWD_BINS, _CROWD_PART = 5, 10.0, 0.01
_FIRST_STEPS = 6


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
        leakage: square of the amplitude below which a peak may be another series', shape (nω,) at
            the frequencies of a transform padded twice (:func:`padded_length`).

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
    settings = Settings(window, weight, padded, most, dynamic_range, damped, scale, least, leaks)
    size = max(1, min(-(-n // _WORKERS), _BATCH // (count * max(channels, 4))))
    parts = [slice(start, min(start + size, n)) for start in range(0, n, size)]

    def one(part: slice) -> list[tuple[np.ndarray, Sinusoids]]:
        clean = np.where(present, series[part] / scale[:, None], 0.0)
        return [
            (part.start + rows, replace(found, series=part.start + found.series))
            for rows, found in _search(clean, settings)
        ]

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


def _search(series: Float, settings: Settings) -> Iterator[tuple[np.ndarray, Sinusoids]]:
    """Add one sinusoid at a time to all series that still show a peak."""
    rows = np.arange(len(series))
    power = np.mean(series**2, axis=(1, 2))
    rows = rows[power > 0]
    residual = series[rows]
    omega, decay = np.zeros((len(rows), 0)), np.zeros((len(rows), 0))
    strongest = np.zeros(len(rows))
    last: Fit | None = None
    for p in range(settings.most + 1):
        if not len(rows):
            return
        peak, size, height = _highest_peak(residual, settings)
        weakest = np.maximum(settings.dynamic_range * strongest, settings.least)
        goes_on = (size > height) & (size > weakest)
        broad = goes_on & _crowded(last, settings) if last is not None else np.zeros_like(goes_on)
        stops = ~goes_on | broad | (p == settings.most)
        if stops.any():
            if last is not None:
                ended = report(_take(last, stops), series[rows[stops]], rows[stops], settings)
                broad = broad[stops] | ended.broad
                yield rows[stops], replace(ended, settled=~goes_on[stops], broad=broad)
            rows, peak, size = rows[~stops], peak[~stops], size[~stops]
            omega, decay, strongest = omega[~stops], decay[~stops], strongest[~stops]
        if not len(rows):
            return
        omega = np.concatenate([omega, peak[:, None]], axis=1)
        decay = np.concatenate([decay, np.zeros((len(rows), 1))], axis=1)
        # Without decay first, so that a fit from afar is not drawn to a broad, damped peak.
        near = fit(series[rows], omega, decay, settings.weight, False, _FIRST_STEPS)
        last = fit(series[rows], near.omega, decay, settings.weight, settings.damped)
        omega, decay, residual = last.omega, last.decay, last.residual
        strongest = norm_of(last.amplitude, settings).max(axis=1)


def _crowded(found: Fit, settings: Settings) -> np.ndarray:
    """Whether several sinusoids of like strength stand within a few bins of the strongest."""
    norm = norm_of(found.amplitude, settings)
    row, first = np.arange(len(norm)), norm.argmax(axis=1)
    bins = (
        np.abs(found.omega - found.omega[row, first][:, None]) * len(settings.window) / (2 * np.pi)
    )
    near = (bins < _CROWD_BINS) & (norm > _CROWD_PART * norm[row, first][:, None])
    return np.asarray(near.sum(axis=1) >= _CROWD)


def _highest_peak(residual: Float, settings: Settings) -> tuple[Float, Float, Float]:
    """ω of the highest peak between the bins, its amplitude, and the amplitude that noise reaches.

    Channels are weighted by their own noise: that of the median of the periodogram.
    """
    count, channels = residual.shape[-1], residual.shape[1]
    spectrum = rfft(residual * settings.window, settings.padded, axis=-1)
    power = spectrum.real**2 + spectrum.imag**2
    floor = np.median(power, axis=-1) / np.log(2)
    floor = np.maximum(floor, 1e-30 * power.max(axis=(1, 2))[:, None] + 1e-290)
    white = np.sum(power / floor[..., None], axis=1)
    white[:, : max(1, settings.padded // count // 2)] = 0
    total = settings.window.sum()
    threshold = gammainccinv(channels, FALSE_ALARM / count)
    about = continuum(white, settings.padded / count, channels)
    usual = np.maximum(np.median(white, axis=1, keepdims=True), 1e-290)
    stands = white * usual > threshold * about
    if settings.leakage is not None:
        square = np.einsum("ncf,c->nf", power, settings.scale**2) * (2 / total) ** 2
        stands &= square > settings.leakage
    white = np.where(stands, white, 0.0)
    at = np.argmax(white, axis=1)
    row = np.arange(len(white))
    inner = np.clip(at, 1, white.shape[1] - 2)
    left, middle, right = (
        np.log(np.sum(power[row, :, inner + d] / floor, axis=1) + 1e-290) for d in (-1, 0, 1)
    )
    bend = left - 2 * middle + right
    shift = np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, 1), 0.0)
    omega = 2 * np.pi * (inner + np.clip(shift, -0.5, 0.5)) / settings.padded
    size = 2 / total * np.sqrt(np.sum(power[row, :, at] * settings.scale**2, axis=1))
    height = size * np.sqrt(threshold / np.maximum(white[row, at], 1e-290))
    return omega, size, height


def _take(found: Fit, which: np.ndarray) -> Fit:
    return Fit(*(getattr(found, name)[which] for name in Fit.__dataclass_fields__))


def _gather(
    groups: list[tuple[np.ndarray, Sinusoids]], n: int, channels: int, interval: float
) -> Sinusoids:
    """Those of all n series, ascending in series and ω, in time rather than in samples."""
    residual, settled, broad = np.ones(n), np.ones(n, bool), np.zeros(n, bool)
    for rows, found in groups:
        residual[rows], settled[rows], broad[rows] = found.residual, found.settled, found.broad

    def every(of: Callable[[Sinusoids], Any], none: Any) -> Any:
        return np.concatenate([none, *(of(found) for _, found in groups)])

    nil = np.zeros(0)
    bends = (every(attrgetter(f"bends.{name}"), nil) for name in ("size", "noise", "over"))
    size, noise, over = bends
    columns = {
        "series": np.zeros(0, int), "shape": np.zeros((0, channels), complex),
        "resolved": np.zeros(0, bool), "omega": nil, "decay": nil, "amplitude": nil,
        "omega_error": nil, "decay_error": nil, "amplitude_error": nil,
    }  # fmt: skip
    whole = {name: every(attrgetter(name), none) for name, none in columns.items()}
    for name in ("omega", "decay", "omega_error", "decay_error"):
        whole[name] = whole[name] / interval
    order = np.lexsort((whole["omega"], whole["series"]))
    return Sinusoids(
        **{name: values[order] for name, values in whole.items()},
        bends=Bends(size / interval**2, noise / interval**2, over).take(order),
        residual=residual,
        settled=settled,
        broad=broad,
    )
