"""A line through arrivals at several distances: t = t₀ + x/c, by weighted least squares."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.signals import NO_QUIET

Float = NDArray[Any]

# A convention tells of what others leave open where it is known this well.
_KNOWN = 0.2
# An answer whose standard error is more than this part of it is none.
LARGEST_ERROR = 0.25
_FURTHEST = 0.7
ALONE = "read by the first break alone, which noise may make: average more, or listen nearer"
BACKWARDS = (
    "the wave runs towards smaller positions: are they counted from the source, or lengths "
    "of specimens that take the place of a slower liquid?"
)


@dataclass(frozen=True)
class Velocity:
    """Velocity of arrivals.

    Attributes:
        velocity: c, m/s; NaN where it can't be given.
        error: its standard error, m/s; NaN where neither the arrivals' errors nor a third
            receiver tell one.
        intercept: t₀, arrival at x = 0, s.
        scatter: √ of the mean square of the arrivals' distances from the line, over the degrees
            of freedom, s; NaN for two.
        used: receivers that count.
        reason: why there is none, or "".
    """

    velocity: float
    error: float
    intercept: float
    scatter: float
    used: int
    reason: str = ""


def weighted_line(x: Float, y: Float, weight: Float) -> tuple[Any, Any, Any]:
    """Slope and intercept of y = a + bx by least squares along the last axis, and b's variance.

    Args:
        x, y, weight: shape (…, m); weights are 1/variance, 0 where a point doesn't count.

    Returns:
        (b, a, variance of b for these variances), each of shape (…). NaN where fewer than two
        distinct points count.
    """
    x, y, weight = np.broadcast_arrays(x, y, weight)
    total = weight.sum(axis=-1)
    # About the point that weighs most there is nothing to cancel, however far weights are apart.
    heaviest = np.argmax(weight, axis=-1, keepdims=True)
    x_0, y_0 = (np.take_along_axis(v, heaviest, -1) for v in (x, y))
    with np.errstate(divide="ignore", invalid="ignore"):
        mean_x = (weight * (x - x_0)).sum(axis=-1) / total
        mean_y = (weight * (y - y_0)).sum(axis=-1) / total
        dx, dy = x - x_0 - mean_x[..., None], y - y_0 - mean_y[..., None]
        spread = (weight * dx**2).sum(axis=-1)
        spread = np.where((weight > 0).sum(axis=-1) >= 2, spread, np.nan)
        b = (weight * dx * dy).sum(axis=-1) / spread
        a = mean_y + y_0[..., 0] - b * (mean_x + x_0[..., 0])
        return b, a, 1 / spread


def arrival_velocity(x: Float, time: Float, error: Float) -> Velocity:
    """Velocity from arrival times.

    The standard error of the slope follows from the arrivals' errors, enlarged by √(χ²/ν) where
    that exceeds 1: the line then fits worse than they allow. Where an arrival has no error, or 0,
    all weigh the same and the scatter alone tells the error.

    Args:
        x: positions, shape (m,), m.
        time: arrivals, shape (m,), s; NaN where there is none.
        error: their standard errors, shape (m,), s.

    Returns:
        The velocity.
    """
    own = np.isfinite(time)
    count = int(own.sum())
    if count < 2:
        return Velocity(np.nan, np.nan, np.nan, np.nan, count, "fewer than two arrivals")
    x, time, error = x[own], time[own], error[own]
    known = bool((np.isfinite(error) & (error > 0)).all())
    weight = 1 / error**2 if known else np.ones(count)
    b, a, variance = (float(part) for part in weighted_line(x, time, weight))
    left = time - a - b * x
    spare = count - 2
    scatter = float(np.sqrt(np.sum(left**2) / spare)) if spare else np.nan
    excess = float(np.sum(weight * left**2) / spare) if spare else np.nan
    if known:
        variance *= max(1.0, excess) if spare else 1.0
    else:
        variance *= excess
    if b == 0:
        return Velocity(np.nan, np.nan, a, scatter, count, "all arrive at once")
    return Velocity(1 / b, float(np.sqrt(variance)) / b**2, a, scatter, count)


def well_known(one: Velocity) -> bool:
    """Whether a velocity's own error is a fifth of it at most."""
    return math.isfinite(one.velocity) and one.error < _KNOWN * abs(one.velocity)


def not_by_noise(speeds: Mapping[str, Velocity]) -> dict[str, Velocity]:
    """Speeds without one of the first break alone: what breaks out of noise has a top as well."""
    first = speeds["first break"]
    others = [one for one in speeds.values() if one is not first]
    if not math.isfinite(first.velocity) or np.isfinite([one.velocity for one in others]).any():
        return dict(speeds)
    return {
        **speeds,
        "first break": replace(first, velocity=math.nan, error=math.nan, reason=ALONE),
    }


def telling(speeds: Iterable[Velocity]) -> list[Velocity]:
    """Velocities that tell of what is open: well known, or known without an error."""
    known = [v for v in speeds if math.isfinite(v.velocity)]
    return [v for v in known if math.isnan(v.error) or well_known(v)]


def with_what_is_open(one: Velocity, others: Iterable[Velocity]) -> float:
    """Standard error of a convention's velocity with what other conventions leave open, m/s.

    One that is known badly tells nothing of what is open.
    """
    apart = [
        (v.velocity - one.velocity) ** 2 - (0.0 if math.isnan(v.error) else v.error**2)
        for v in telling(others)
    ]
    return math.hypot(one.error, _FURTHEST * math.sqrt(max([0.0, *apart])))


def told(speeds: Mapping[str, Velocity]) -> dict[str, Velocity]:
    """Velocities as answers: a number with an error that holds what conventions leave open, or NaN
    with a reason.

    There is none without an error of its own, or with one of more than a quarter of it, of a wave
    that runs backwards, nor where conventions are so far apart that each is the speed of something
    else, as in a gap or where several waves pass.
    """
    every = list(speeds.values())
    sure = [one for one in every if well_known(one)]
    bars = [with_what_is_open(one, every) / abs(one.velocity) for one in sure]
    apart = min(bars, default=0.0) > LARGEST_ERROR
    found = {}
    for name, one in speeds.items():
        why = one.reason
        if not why and not math.isfinite(one.error):
            why = f"{NO_QUIET}: begin it earlier, or add a receiver"
        if not why and apart:
            each = sorted(abs(v.velocity) for v in sure)
            why = (
                f"conventions read {each[0]:.4g} to {each[-1]:.4g} m/s, which is the speed of no "
                "one wave: drive a narrower band, away from gaps, or place receivers elsewhere"
            )
        bar = with_what_is_open(one, every)
        if not why and not one.velocity > 0:
            why = BACKWARDS
        if not why and bar > LARGEST_ERROR * one.velocity:
            why = f"{one.velocity:.3g} m/s with an error of {bar:.2g} m/s is none"
        found[name] = (
            replace(one, velocity=math.nan, error=math.nan, reason=why) if why
            else replace(one, error=bar)
        )  # fmt: skip
    return found
