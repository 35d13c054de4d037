"""Waves at each wavenumber as peaks of a windowed transform in time, and what leaks into them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft

from wavesim.readings.dispersion.hidden_mode import Bends, of_lines
from wavesim.readings.dispersion.noise_level import FLOOR_OVER_MEAN, continuum, leakage
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.records.record import Record
from wavesim.records.windows import blackman_harris

Float = NDArray[Any]

WORKERS = 2
# Peaks of the FFT count above this part of the highest at their wavenumber (power), this many
# times the median of all frequencies, and of those close by.
_PEAK_FLOOR = 1e-8
_ABOVE_MEDIAN = 40.0
_ABOVE_CONTINUUM = 20.0
_PADDING = 2
# Noise above this part of a digitiser's step makes what rounding leaves random.
_HIDES = 0.6
# What leaks in beside a line shifts it by up to this part of a bin 2π/T, over their amplitudes.
_SHIFT = 0.5
# Half-width of the Blackman–Harris main lobe.
LOBE_BINS = 4
BROAD = (
    "no line stands out of what surrounds it: waves that are broad or random, or that other "
    "wavenumbers leak into"
)
# The middle of what is about a peak is taken so many cells 2π/T to each side; where it is off by
# this part of one, in the median of all peaks, lines are broad and random.
_ABOUT, _RANDOM = 6, 0.3
# Error of the parabola through the logarithm of a Blackman–Harris peak padded twice, in its bins.
_SHAPE = 2e-3
# Power of the window's side lobes, over the line's.
_SIDE_LOBE = 1e-9


def beside_leakage(points: BranchPoints, at: Any, leaks: Float, cell: float) -> Float:
    """Errors with what leaks into a line from others close by, which shifts it by a part of a bin.

    Args:
        points: as found.
        at: where in leaks each is, shape (m,).
        leaks: power below which a peak may be another wavenumber's, shape (nω,).
        cell: 2π/T, rad/s.
    """
    size = np.sqrt(leaks[np.clip(at, 0, len(leaks) - 1)] / FLOOR_OVER_MEAN)
    part = size / np.maximum(points.amplitude, 1e-290)
    return np.hypot(points.error, _SHIFT * cell * np.minimum(part, 1))


def power(channels: Float, shape: Callable[[int], Float] = blackman_harris) -> tuple[Float, float]:
    """Power Σ_c |∫ y_c w e^{iωt} dt|² over both directions, shape (n, nω), and ω per bin·Δt.

    Args:
        channels: of :func:`series`, shape (n, 2C, nt).
        shape: of the window w.
    """
    count = channels.shape[-1]
    padded = next_fast_len(_PADDING * count, real=True)
    window = shape(count)
    window = window * (2 / window.sum())
    total = np.zeros((len(channels), padded // 2 + 1))
    for c in range(channels.shape[1]):
        hat = rfft(channels[:, c] * window, padded, axis=-1, workers=WORKERS)
        total += hat.real**2 + hat.imag**2
    return total, 2 * np.pi / padded


def leaks_of(
    record: Record,
    heights: Float,
    per_bin: float,
    first: int = 1,
    shape: Callable[[int], Float] = blackman_harris,
) -> tuple[Float, Float]:
    """Power below which peaks are none of their wavenumber's waves, shape (nω,) each.

    Those of a floor, which is another wavenumber's, where receivers differ, or a digitiser's: of a
    signal that repeats itself, and noise that does not hide the steps, what rounding leaves repeats
    itself too, and is lines at all wavenumbers, of the power q²/12 together. And lines that show.
    """
    density = 2 * np.pi / per_bin / len(record.t)
    whole = heights
    if first == 1:
        # A hum that all hear alike is at k = 0.
        alike, _ = power(record.values.mean(axis=2)[None], shape)
        whole = np.concatenate([alike, heights])
    leaks, lines = leakage(whole, density, 2 * len(record.values), record.leak or 0.0)
    steps = record.quantum
    if steps.any() and record.noise < _HIDES * float(np.median(steps[steps > 0])):
        leaks = np.maximum(leaks, 2 * float(np.sum(steps**2)) / 12 / len(record.x) ** 2)
    return leaks, lines


def peaks(channels: Float, k: Float, record: Record) -> tuple[BranchPoints, Bends]:
    """Peaks of the windowed FFT, placed by a parabola through their logarithm.

    The error is half the difference between that and the middle of the peak by a parabola through
    the points two bins off: 0 for a lone sinusoid but for the window's shape, and more where
    another is near.
    """
    interval = record.interval
    heights, per_bin = power(channels)
    logarithm = np.log(np.maximum(heights, 1e-300))
    middle = logarithm[:, 2:-2]
    peak = (middle > logarithm[:, 1:-3]) & (middle >= logarithm[:, 3:-1])
    floor = np.log(_PEAK_FLOOR) + logarithm.max(axis=1, keepdims=True)
    noise = np.log(_ABOVE_MEDIAN) + np.median(logarithm, axis=1, keepdims=True)
    density = 2 * np.pi / per_bin / channels.shape[-1]
    local = continuum(heights, density, channels.shape[1])
    leaks = np.maximum(*leaks_of(record, heights, per_bin))
    stands = heights > np.maximum(_ABOVE_CONTINUUM * local, leaks)
    loud = peak & (middle > np.maximum(floor, noise))
    line = loud & stands[:, 2:-2]
    # Where no line stands out, the loudest of what there is, to say so of.
    hump = np.where(loud & ~line.any(axis=1, keepdims=True), middle, -np.inf)
    only = np.zeros_like(line)
    only[np.arange(len(hump)), hump.argmax(axis=1)] = np.isfinite(hump.max(axis=1))
    row, at = np.nonzero(line | only)
    broad = only[row, at]
    at = at + 2
    near, top = _vertex(*(logarithm[row, at + d] for d in (-1, 0, 1)))
    far, _ = _vertex(*(logarithm[row, at + d] for d in (-2, 0, 2)))
    snr = local[row, at] / np.exp(top)
    error = np.sqrt((near - 2 * far) ** 2 / 4 + _SHAPE**2 + 4 * snr) * per_bin / interval
    total = heights.sum(axis=1)[row]
    lobe = sum(heights[row, np.clip(at + d, 0, heights.shape[1] - 1)] for d in range(-8, 9))
    explained = np.bincount(row, lobe / total, len(k))
    found = BranchPoints(
        "fft",
        k[row],
        (at + near) * per_bin / interval,
        np.zeros(len(row)),
        np.exp(top / 2),
        error,
        np.clip(1 - explained, 0, 1)[row],
        ~broad,
        np.where(broad, BROAD, "").astype(object),
        np.full(len(row), -1),
    )
    cell = 2 * np.pi / (len(record.t) * interval)
    found = replace(found, error=beside_leakage(found, at, leaks, cell))
    off = _off_middle(heights, row, at + near, density) * cell
    if len(off[~broad]) and np.median(np.abs(off[~broad])) > _RANDOM * cell:
        # Which crest of such a line is the highest is chance.
        spread = float(np.sqrt(np.mean(off[~broad] ** 2)))
        found = replace(found, error=np.sqrt(found.error**2 + off**2 + spread**2))
    beside = np.sqrt(local[row, at] + _SIDE_LOBE * heights.max(axis=1)[row])
    return found, of_lines(channels, row, found.omega, interval, beside)


def _off_middle(heights: Float, row: Any, at: Float, density: float) -> Float:
    """Distance of the middle of the power about each peak from it, in cells 2π/T, shape (m,).

    A lone sinusoid's is 0, decaying or not. A broad and random line has a few crests.

    Args:
        heights: power, shape (n, nω).
        row, at: series and place of each peak, in bins, shape (m,).
        density: bins a cell.
    """
    reach = round(_ABOUT * density)
    away = np.arange(-reach, reach + 1)
    first = np.clip(np.round(at).astype(int), reach, heights.shape[1] - reach - 1)
    about = heights[row[:, None], first[:, None] + away]
    about = np.maximum(about - np.median(heights, axis=1)[row, None], 0.0)
    middle = first + about @ away / np.maximum(about.sum(axis=1), 1e-290)
    return np.asarray((middle - at) / density)


def _vertex(left: Float, middle: Float, right: Float) -> tuple[Float, Float]:
    bend = left - 2 * middle + right
    bend = np.where(bend < 0, bend, -1e-300)
    shift = np.clip(0.5 * (left - right) / bend, -1, 1)
    return shift, middle - 0.25 * (left - right) * shift
