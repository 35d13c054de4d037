"""The central frequency of what came through, and the band about it that counts as signal."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.signals import FEWEST_QUIET, PulseError
from wavesim.records.windows import noise_density

Float = NDArray[Any]

# The band about the central frequency, over and in multiples of it.
_LOW, _HIGH = 8.0, 8.0


def band_about(u: Float, dt: float, period: float) -> Float:
    """A fifth to eight times the central frequency; what is left begins no sooner than it did.

    The upper edge shifts no phase. The lower one is causal: a filter that looks ahead draws a slow
    wave out of a base that a packet lifts, for periods before that comes.
    """
    from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt  # slow to import

    top = min(_HIGH / period, 0.45 / dt)
    low = 1 / (_LOW * period)
    if not low < top:
        raise PulseError("its signal has no period that the times can show: look at both columns")
    upper = butter(2, top, "lowpass", fs=1 / dt, output="sos")
    lower = butter(1, low, "highpass", fs=1 / dt, output="sos")
    pad = min(len(u) - 1, int(3 / (top * dt)) + 8)
    smooth = sosfiltfilt(upper, u, padtype="odd", padlen=pad)
    return np.asarray(sosfilt(lower, smooth, zi=sosfilt_zi(lower) * smooth[0])[0])


def central_period(
    t: Float,
    raw: Float,
    sent: Float | None,
    otherwise: float,
    after: float,
    sampled: float,
    quiet: Float,
) -> float:
    """1/f of the mean of the power over frequency after a time, where that stands above noise.

    Power is weighted by f, so that a creeping base does not count. Noise is the level of the
    highest frequencies, as they were sampled at an interval (s) that t may divide, and that of what
    is quiet before the pulse is sent, where that is long enough: an amplifier's noise ends with its
    band, far below the highest frequencies.
    """
    dt = float(t[-1] - t[0]) / (len(t) - 1)
    u = raw[t >= after]
    u = u - np.linspace(u[0], u[-1], len(u))
    f = np.fft.rfftfreq(len(u), dt)
    window = np.hanning(len(u))
    power = np.abs(np.fft.rfft(u * window)) ** 2
    smooth = np.convolve(power, np.ones(5) / 5, "same")
    level = np.full(len(f), _highest(power, f, sampled))
    if len(quiet) >= FEWEST_QUIET:
        before = noise_density(quiet, dt, f) / dt * np.sum(window**2)
        # What lies below the first frequency that so short a part shows is not known by it.
        level = np.where(f * len(quiet) * dt > 4, np.maximum(level, before), level)
    own = (f > 4 / (len(u) * dt)) & (smooth > 10 * level) & (f < 0.4 / sampled)
    weight = np.where(own, power * f, 0.0)
    if sent is not None:
        fs = np.fft.rfftfreq(len(sent), dt)
        # A digitiser's steps, and its noise, were not sent.
        plain = np.abs(np.fft.rfft(sent)) ** 2
        power_sent = np.where(plain > 10 * _highest(plain, fs, sampled), plain * fs**2, 0.0)
        # Nothing comes through at frequencies far above those sent.
        weight *= f < 3 * float(np.sum(fs * power_sent) / max(np.sum(power_sent), 1e-300))
    if not weight.sum() > 0:
        return max(otherwise, 20 * dt)
    centre = float(np.sum(f * weight) / weight.sum())
    return float(np.clip(1 / centre, 4 * dt, 0.2 * len(t) * dt))


def _highest(power: Float, f: Float, sampled: float) -> float:
    """Mean power of white noise, by the median over the upper half of the frequencies."""
    return float(np.median(power[(f >= 0.25 / sampled) & (f <= 0.5 / sampled)])) / np.log(2)
