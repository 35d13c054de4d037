"""What a wave has to stand out of: noise, leakage between wavenumbers, broad lines.

Noise that is not white, the waves of other wavenumbers that receivers of unequal gain let through,
and lines that are broad and random (thermal motion) all leave a continuum about a frequency. A wave
is a line that stands out of the continuum close to it.

Of a receiver's transform: white noise shows where there is no signal, at the highest frequencies.
Noise in the signal's own band, of wind or of a filtered amplifier, shows where the record is
quietest: before the signal comes, or when it has gone.
Samples on a ladder of steps q have q/√12 in any case.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy  # its parts are loaded where they are used: they take a while
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.special import gammaincinv

from wavesim.records.windows import noise_density

Float = NDArray[Any]

# The continuum close to a frequency is looked for within so many bins 2π/T.
_BLOCK_BINS = 32
# Leakage is above this many times its mean at one of hundreds of wavenumbers.
FLOOR_OVER_MEAN = 20.0
# Leakage of lines that stand close peaks between them too: half a main lobe.
_LOBE_BINS = 3.0
# One wavenumber leaks into others where its power is so many times that of the middle one and of
# so many on either side, and this part of them have a line there, so many times the continuum.
_SPIKE, _BESIDE, _AT_MOST, _STANDS = 100.0, 2, 0.75, 4.0
# So many do, of so many at least.
_SEVERAL, _FEWEST_WAVENUMBERS = 3, 5
# Points are of one frequency within this part of 2π/T and so many errors, no more than that; what
# is leaked is so much weaker than where it is from, which has no like one beside it …
_SAME, _ERRORS, _WIDEST, _WEAKER, _LIKE = 0.02, 3.0, 0.5, 0.3, 0.1
# (where receivers are known to differ, also what is fainter than this part, within 2π/T) …
_FAINT_PART = 0.01
# … and so many times what chance leaves, as within so many times the width. A flat branch is met
# by so much of another by chance; no medium has so many.
_BY_CHANCE, _ABOUT, _SELDOM, _MOST_FLAT = 4.0, 5.0, 0.02, 4


def continuum(power: Float, per_bin: float, channels: int = 1) -> Float:
    """Median of the noise about each frequency, as the lower quartile within 32 bins tells it.

    Lines may take up to three quarters of those bins; the highest of three such stretches counts.

    Args:
        power: periodograms, shape (n, nω).
        per_bin: points of them per bin 2π/T, –.
        channels: of how many series each is the sum, –.

    Returns:
        Shape (n, nω), unit of the power; no lower than the median of all frequencies.
    """
    n, count = power.shape
    size = max(8, round(_BLOCK_BINS * per_bin))
    blocks = max(1, count // size)
    size = count // blocks
    inner = power[:, : blocks * size].reshape(n, blocks, size)
    # |noise|² of each channel is distributed exponentially, and so their sum as Γ(channels).
    to_median = float(gammaincinv(channels, 0.5) / gammaincinv(channels, 0.25))
    quartile = np.partition(inner, size // 4, axis=2)[:, :, size // 4] * to_median
    # Where noise ends within a block, its neighbour tells how high it is.
    higher = scipy.ndimage.maximum_filter1d(quartile, 3, axis=1, mode="nearest")
    local = higher[:, np.minimum(np.arange(count) // size, blocks - 1)]
    return np.maximum(local, np.median(power, axis=1, keepdims=True))


def leakage(power: Float, per_bin: float, channels: int, off: float) -> tuple[Float, Float]:
    """Power below which a peak may be another wavenumber's wave, in receivers that differ.

    What receivers are off by in gain, place or clock puts a wave of one wavenumber into all others,
    at its frequency: lines at one frequency at nearly all wavenumbers, of which one stands far
    above those beside it, are that one's. So are they where this shows at several frequencies, or
    of what all receivers hear alike, k = 0; else they may be a flat branch that another crosses.

    Args:
        power: at wavenumbers 2πm/X, m from 0 on, shape (n, nω).
        per_bin, channels: as of :func:`continuum`.
        off: variance of what receivers are known to be off by, over that of the waves, over their
            number, –.

    Returns:
        By what receivers are known to be off by; and by the lines that show. Shape (nω,) each.
    """
    n, count = power.shape
    near = 2 * round(_LOBE_BINS * per_bin) + 1
    known = scipy.ndimage.maximum_filter1d(2 * off * power.sum(axis=0), near)
    one, highest, middle = power.argmax(axis=0), power.max(axis=0), np.median(power, axis=0)
    away = np.abs(np.arange(n)[:, None] - one)
    beside = np.where((away > 0) & (away <= _BESIDE), power, 0).max(axis=0)
    alike = power[0] > _SPIKE * middle
    own = np.flatnonzero(alike | (highest > _SPIKE * np.maximum(beside, middle)))
    stands = np.median(power[:, own] / continuum(power, per_bin, channels)[:, own], axis=0)
    own = own[(stands > _STANDS) & (own > 0) & (own < count - 1) & (n >= _FEWEST_WAVENUMBERS)]
    peak = np.zeros(power.shape)
    peak[:, 1:-1] = (power[:, 1:-1] >= power[:, :-2]) & (power[:, 1:-1] > power[:, 2:])
    own = own[scipy.ndimage.maximum_filter1d(peak, 3, axis=1)[:, own].mean(axis=0) > _AT_MOST]
    if len(np.unique(one[own])) < _SEVERAL:
        own = own[alike[own]]
    lines = np.zeros(count)
    lines[own] = middle[own] / np.log(2)
    # Of a fitted line the frequency is known to less than a bin.
    return FLOOR_OVER_MEAN * known, FLOOR_OVER_MEAN * scipy.ndimage.maximum_filter1d(
        lines, round(per_bin) + 1
    )


def leaked(
    step: NDArray[np.int64],
    omega: Float,
    amplitude: Float,
    error: Float,
    cell: float,
    differ: bool = False,
) -> NDArray[np.bool_]:
    """Points at the frequency of a far stronger one of another wavenumber, where many are so.

    By chance some points are, as where a branch crosses a flat one, whose points have like ones
    beside them. Where lines stand at one frequency at most wavenumbers, at more frequencies than
    there are flat branches, none of them is a wave of its wavenumber.

    Args:
        step: index of the wavenumber, shape (m,).
        omega, amplitude, error: frequency, amplitude and standard error of ω, shape (m,).
        cell: 2π/T, unit of ω.
        differ: whether receivers are known to, so that what is faint beside a strong one is leaked.
    """
    order = np.argsort(omega)
    ascending = omega[order]
    result, flat, faint = np.zeros((3, len(omega)), bool)
    groups, crowds, by_chance = 0, 0, 0.0
    away = _ABOUT * _WIDEST * cell
    starts, ends = (np.searchsorted(ascending, omega + side) for side in (-away, away))
    half = len(np.unique(step)) / 2
    for j in np.argsort(-amplitude):
        around = order[starts[j] : ends[j]]
        off = np.abs(omega[around] - omega[j])
        unsure = _SAME * cell + _ERRORS * (error[around] + error[j])
        width = np.minimum(unsure, _WIDEST * cell)
        near = around[off < width]
        # … of which none is the others' own.
        if (
            len(near) > half
            and not (result[j] or flat[j])
            and len(np.unique(step[near])) > half
            and (amplitude[near] > _LIKE * amplitude[j]).sum() > 1
        ):
            flat[near] = True
            crowds += 1
        beside = near[np.abs(step[near] - step[j]) == 1]
        if result[j] or (amplitude[beside] > _LIKE * amplitude[j]).any():
            continue
        part = np.where(step[around] == step[j], np.inf, amplitude[around] / amplitude[j])
        faint[around[(part < _FAINT_PART) & (off < cell + unsure)]] = differ
        weak = part < _WEAKER
        own = weak & (off < width)
        by_chance += float(np.sum(width[weak & ~own])) / away
        result[around[own]] = True
        groups += int(own.any())
    # A flat branch meets another by chance, once.
    strong = amplitude * _WEAKER > np.median(amplitude[result]) if result.any() else result
    likely = 2 * np.sum(_SAME * cell + _ERRORS * error[strong]) / max(float(np.ptp(omega)), cell)
    if result.sum() < 2 + _BY_CHANCE * by_chance or groups < likely / _SELDOM:
        result[:] = False
    return result | faint | (flat & (crowds >= _MOST_FLAT))


# What is before a receiver's first sample above so many deviations of its first part is quiet.
# Noise is what is in the quietest stretch as long as that, or as a tenth of the record: in the
# first may be a pulse's foot, which is all there is where that is below this part of the peak.
_FIRST_PART, _ABOVE_FIRST, _QUIET_PART, _FEWEST_QUIET, _LEAST_NOISE = 0.04, 6.0, 0.8, 48, 1e-5
_FEWEST_LIVE = 16
# Rounding, over the largest value.
ROUNDING = 1e-15


def white_level(values: Float, quantum: Float | float = 0.0) -> Float:
    """Deviation of a white noise as high as the highest tenth in frequency, shape (nx,).

    Args:
        values: shape (nt, nx); what is exactly constant at either end does not count as signal.
        quantum: q, the least step between samples, shape (nx,) or (), unit of the values.
    """
    inner = _live(values)
    window = np.hanning(len(inner))
    spectrum = np.abs(np.fft.rfft(inner * window[:, None], axis=0)) ** 2
    top = spectrum[-max(4, len(spectrum) // 10) : -1]
    white = np.sqrt(np.median(top, axis=0) / np.log(2) / np.sum(window**2))
    return np.asarray(np.maximum(white, np.asarray(quantum) / np.sqrt(12)))


def _live(values: Float) -> Float:
    """Without what is exactly constant at either end, unless that is nearly all."""
    live = np.flatnonzero((np.diff(values, axis=0) != 0).any(axis=1))
    return values[live[0] : live[-1] + 2] if len(live) > _FEWEST_LIVE else values


def noise_variance(
    values: Float, interval: float, omega: Float, quantum: Float | float = 0.0
) -> Float:
    """Variance of a white noise as dense as the record's at each frequency, shape (nω, nx).

    Of m samples the transform Σ n e^{iωt} has m times that.

    Args:
        values: u, shape (nt, nx).
        interval: Δt, s.
        omega: ω, shape (nω,), rad/s.
        quantum: q, the least step between samples, shape (nx,) or (), unit of the values.
    """
    variance = np.tile(white_level(values, quantum) ** 2, (len(omega), 1))
    head, peak = values[: max(16, int(_FIRST_PART * len(values)))], np.abs(values).max(axis=0)
    middle, spread = head.mean(axis=0), head.std(axis=0)
    loud = np.abs(values - middle) > _ABOVE_FIRST * spread + 1e-12 * peak
    first = np.where(loud.any(axis=0), loud.argmax(axis=0), len(values))
    quiet, inner = (_QUIET_PART * first).astype(int), _live(values)
    for at in np.flatnonzero((quiet >= _FEWEST_QUIET) & (spread > _LEAST_NOISE * peak)):
        size = min(quiet[at], max(_FEWEST_QUIET, len(inner) // 10), len(inner))
        parts = sliding_window_view(inner[:, at], size)[:: size // 4]
        quietest = parts[parts.std(axis=1).argmin()]
        own = noise_density(quietest, interval, omega / (2 * np.pi)) / interval
        variance[:, at] = np.maximum(variance[:, at], own)
    return np.maximum(variance, (ROUNDING * peak.max(initial=0.0)) ** 2)


# A band is where power smoothed over so many bins is above this part of the highest, and so many
# times the noise's.
_SMOOTHED, _FAINT, _ABOVE_NOISE = 5, 1e-4, 4.0


def excited_frequencies(
    values: Float, interval: float, quantum: Float | float = 0.0, part: float = _FAINT
) -> tuple[float, float]:
    """The lowest and the highest frequency at which something is above the noise, rad/s.

    Args:
        values, interval, quantum: as of :func:`noise_variance`.
        part: of the greatest power that counts, –.
    """
    omega = 2 * np.pi * np.fft.rfftfreq(len(values), interval)[1:]
    power = np.mean(np.abs(np.fft.rfft(values, axis=0)[1:] * interval) ** 2, axis=1)
    noise = np.mean(noise_of_transform(values, interval, omega, quantum) ** 2, axis=1)
    power = scipy.ndimage.uniform_filter1d(power, _SMOOTHED, mode="nearest")
    loud = np.flatnonzero((power > part * power.max()) & (power > _ABOVE_NOISE * noise))
    if not len(loud):
        return float(omega[0]), float(omega[-1])
    return float(omega[loud[0]]), float(omega[loud[-1]])


def noise_of_transform(
    values: Float, interval: float, omega: Float, quantum: Float | float = 0.0
) -> Float:
    """Standard deviation of ∫ n e^{iωt} dt over the record for the noise n, shape (nω, nx).

    Args:
        values, interval, omega, quantum: as of :func:`noise_variance`.
    """
    variance = noise_variance(values, interval, omega, quantum)
    return np.asarray(np.sqrt(variance * len(values)) * interval)
