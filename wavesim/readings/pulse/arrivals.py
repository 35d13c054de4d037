"""Arrival times at a receiver, by four conventions, each with its standard error.

Errors are those of white noise with the standard deviation seen before the arrival. They leave out
what a convention does to a pulse that changes its shape: conventions then differ, and that is no
error of any of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.first_break import AT_THE_END, DETECTED, WEAK, envelope, onset
from wavesim.readings.pulse.signals import CLIPPED, NO_QUIET, PulseError, PulseRecord
from wavesim.simulation.bandlimited import between, cross_correlation, slope

Float = NDArray[Any]

CONVENTIONS = ("first break", "threshold", "envelope", "correlation")
# A threshold must be this many deviations high, or noise crosses it first.
_ABOVE_NOISE = 4.0
# The parabola goes through the samples above this part of the envelope's peak.
_CAP = 0.9
# A reference of which this part of the energy lies beyond the record's end is seen cut.
_LOST = 0.1
# How exactly places between samples are found, in samples.
_EXACT = 1e-9


@dataclass(frozen=True)
class Arrivals:
    """Arrival times by one convention.

    Attributes:
        convention: its name.
        time: shape (m,), s; NaN where there is none.
        error: standard error for the noise of the record, shape (m,), s; NaN where unknown.
        reason: why there is none, or no error; "" where there are both.
    """

    convention: str
    time: Float
    error: Float
    reason: tuple[str, ...]


Pick = tuple[float, float, str]


def threshold(values: Float, fraction: float, noise: float) -> Pick:
    """First time at which |u| reaches a part of its peak, between samples, in samples.

    Args:
        values: u, shape (nt,).
        fraction: of the largest |u|, –, between 0 and 1.
        noise: standard deviation, unit of u; NaN where unknown.

    Returns:
        (position, error s √(1 + fraction²)/|u′|, reason). Where the record ends while the signal
        still grows, what it grew by in the last period is an error of its peak.
    """
    at = int(np.argmax(np.abs(values)))
    if values[at] == 0:
        return np.nan, np.nan, "the signal is 0"
    if not 0 < at < len(values) - 1:
        return np.nan, np.nan, AT_THE_END
    sign = np.sign(values[at])
    peak = float(between(sign * values, top(sign * values, at)))
    level = fraction * peak
    if level < _ABOVE_NOISE * noise:
        return np.nan, np.nan, "the threshold lies in the noise: raise the fraction"
    after = int(np.argmax(np.abs(values) >= level))
    if after == 0:
        return np.nan, np.nan, "the threshold is passed when the record begins: begin it earlier"
    sign = np.sign(values[after])
    place = _zero(lambda at: float(sign * between(values, at)) - level, after - 1, after)
    steep = abs(float(slope(values, place)))
    of_peak = fraction * np.hypot(noise, _grown(values, at, level))
    return place, np.hypot(noise, of_peak) / steep, _unless_known(noise)


def _grown(values: Float, at: int, level: float) -> float:
    """By how much |u| at its largest, ``at``, is larger than before the last period above a level,
    where the record ends within that; else 0."""
    loud = np.flatnonzero(np.abs(values) >= level)
    swings = loud[np.flatnonzero(np.diff(np.sign(values[loud]), prepend=0))]
    begin = int(swings[-2:][0])
    if at < begin or len(values) - loud[-1] > loud[-1] - begin + 1:
        return 0.0
    return float(np.abs(values[at]) - np.abs(values[:begin]).max(initial=0.0))


def envelope_peak(values: Float, noise: float) -> Pick:
    """Peak of the envelope: parabola by least squares through its logarithm near the top.

    It goes through the samples about the largest that lie above 0.9 of it, three at least. In the
    logarithm each has the error noise/envelope.

    Args:
        values: u, shape (nt,).
        noise: standard deviation, unit of u; NaN where unknown.

    Returns:
        (position, error, reason), in samples.
    """
    size = envelope(values)
    at = int(np.argmax(size))
    if not size[at] > 0:
        return np.nan, np.nan, "the signal is 0"
    if not 0 < at < len(values) - 1:
        return np.nan, np.nan, AT_THE_END
    if size[at] < DETECTED * noise:
        return np.nan, np.nan, WEAK
    low_side = np.flatnonzero(size[:at] < _CAP * size[at])
    high_side = np.flatnonzero(size[at:] < _CAP * size[at])
    low = min(at - 1, int(low_side[-1]) + 1 if len(low_side) else 0)
    high = max(at + 1, at + int(high_side[0]) - 1 if len(high_side) else len(size) - 1)
    s = np.arange(low, high + 1) - at
    design = np.stack([np.ones_like(s), s, s**2], axis=1).astype(float)
    inverse = np.linalg.pinv(design)
    c = inverse @ np.log(size[low : high + 1])
    if not c[2] < 0:
        return np.nan, np.nan, "the envelope has no peak: it is flat"
    place = -c[1] / (2 * c[2])
    # place = −c₁/2c₂: its derivatives by c₁ and c₂, through the parabola's own covariance.
    gradient = np.array([0, -1 / (2 * c[2]), c[1] / (2 * c[2] ** 2)])
    error = float(np.linalg.norm(gradient @ inverse)) * noise / float(size[at])
    return at + float(place), error, _unless_known(noise)


def correlation(values: Float, reference: Float, noise: float, reference_noise: float) -> Pick:
    """Lag of the largest cross-correlation c(τ) = Σ u(t + τ) r(t), between samples, in samples.

    With u = a r(t − τ) + n, E = Σ ṙ² = −c″(τ)/a, which noise doesn't bias, and
    var τ = [s_u² E + N s_u² s_r² π²/3]/(aE)²: the noise of u, and that of both together. The
    noise of r alone shifts all receivers alike, and is left out.

    Args:
        values: u, shape (nt,).
        reference: r, shape (nt,), on the same times.
        noise, reference_noise: standard deviations; NaN where unknown.

    Returns:
        (lag, error, reason).
    """
    c = cross_correlation(values, reference)
    at = int(np.argmax(c))
    own = float(np.nan_to_num(reference_noise))
    energy = float(np.sum(reference**2)) - len(reference) * own**2
    if not (energy > 0 and c[at] > 0):
        return np.nan, np.nan, "nothing in common with the reference"
    # White noise in both: c has the deviation s √(Σ r²) where nothing is in common.
    if c[at] < DETECTED * noise * np.sqrt(np.sum(reference**2)):
        return np.nan, np.nan, WEAK
    lag = top(c, at)
    # What of the reference lies beyond an end of the record at that lag is not there to be alike.
    late = round(lag) - (len(reference) - 1)
    lost = reference[len(reference) - late :] if late > 0 else reference[: max(-late, 0)]
    if float(np.sum(lost**2)) - len(lost) * own**2 > _LOST * energy:
        return np.nan, np.nan, AT_THE_END
    bend = -float(between(c, lag - 0.1) - 2 * between(c, lag) + between(c, lag + 0.1)) / 0.01
    a = float(between(c, lag)) / energy
    if not bend > 0:
        return np.nan, np.nan, AT_THE_END
    variance = noise**2 * bend / a + len(values) * (noise * own * np.pi) ** 2 / 3
    return lag - (len(reference) - 1), float(np.sqrt(variance)) / bend, _unless_known(noise)


def _unless_known(noise: float) -> str:
    return "" if np.isfinite(noise) else NO_QUIET


def arrivals(
    record: PulseRecord, convention: str, fraction: float = 0.5, reference: Float | None = None
) -> Arrivals:
    """Arrival at every receiver by one convention.

    Args:
        record: the signals.
        convention: "first break", "threshold", "envelope" or "correlation".
        fraction: of the peak, for the threshold, –.
        reference: signal to correlate with, shape (nt,), on the record's times (the source's, say);
            that of the first receiver that is whole where None. Times are the lag plus the time at
            which the reference's envelope peaks.

    Returns:
        The arrivals.

    Raises:
        PulseError: the convention is unknown, or fraction or reference are not admissible.
    """
    if convention not in CONVENTIONS:
        raise PulseError(f"convention = {convention!r}: take one of {', '.join(CONVENTIONS)}")
    if not 0 < fraction < 1:
        raise PulseError(f"fraction = {fraction:g}: must lie between 0 and 1")
    if reference is not None and np.shape(reference) != record.t.shape:
        raise PulseError(
            f"reference: shape {np.shape(reference)}; must be sampled as the signals, "
            f"{len(record.t)}"
        )
    zero = 0.0
    usable = next((j for j, why in enumerate(record.unusable) if not why), 0)
    own = record.values[:, usable] if reference is None else np.asarray(reference, float)
    own_noise = float(record.noise[usable]) if reference is None else 0.0
    if convention == "correlation":
        zero = envelope_peak(own, own_noise)[0]
    picks: list[Pick] = []
    each = zip(record.values.T, record.noise.tolist(), record.unusable, strict=True)
    for j, (u, noise, unusable) in enumerate(each):
        if unusable and not (unusable == CLIPPED and convention == "first break"):
            picks.append((np.nan, np.nan, unusable))
        elif convention == "first break":
            first = int(record.filled[j])
            place, spread, why = onset(u[first:])
            picks.append((first + place, spread, why))
        elif convention == "threshold":
            picks.append(threshold(u, fraction, noise))
        elif convention == "envelope":
            picks.append(envelope_peak(u, noise))
        else:
            picks.append(correlation(u, own, noise, own_noise))
    places, errors, reasons = zip(*picks, strict=True)
    step = record.interval
    return Arrivals(
        convention, record.t[0] + step * (np.array(places) + zero), step * np.array(errors), reasons
    )


def top(values: Float, start: int) -> float:
    """Position of the local maximum within a sample of the one at ``start``, in samples.

    The zero of the slope; ``start`` itself where it stands at an end of the record.
    """
    if not 0 < start < len(values) - 1:
        return float(start)
    low, high = start - 1.0, start + 1.0
    if not slope(values, low) > 0 > slope(values, high):
        return float(start)
    return _zero(lambda s: float(slope(values, s)), low, high)


def _zero(function: Callable[[float], float], low: float, high: float) -> float:
    """Where a function of other signs at two places is 0 between them; at one, but for rounding."""
    from scipy.optimize import brentq  # slow to import, and only a reading needs it

    ends = function(low), function(high)
    if not ends[0] * ends[1] < 0:
        return low if abs(ends[0]) < abs(ends[1]) else high
    return float(brentq(function, low, high, xtol=_EXACT))
