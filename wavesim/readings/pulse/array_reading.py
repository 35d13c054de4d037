"""A pulse test with several receivers: one velocity of all conventions, Q, and what is doubtful."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.readings.pulse.echo_gate import echo_gate
from wavesim.readings.pulse.measurement import PulseResult, measure
from wavesim.readings.pulse.reading import Best, Reading, ReceiverArrivals, judged
from wavesim.readings.pulse.signals import PulseError, pulse_record
from wavesim.readings.pulse.transmission_record import transmission_record
from wavesim.readings.pulse.travel_time import TravelTime

Float = NDArray[Any]

# The first of them that there is: where the medium disperses all are right, each of another speed.
_PREFERRED = ("correlation", "envelope", "threshold", "first break")
# A convention tells of what others leave open where it is known this well.
_KNOWN = 0.2
_FURTHEST = 0.7
# Group and phase velocity that far apart are dispersion.
_DISPERSES = 0.03


def read_array(
    name: str,
    t: ArrayLike,
    signals: Mapping[str, ArrayLike],
    positions: Mapping[str, float],
    sent: ArrayLike | None = None,
    expected: tuple[float, float] | None = None,
) -> Reading:
    """Read a record of two receivers or more.

    Args:
        name: of the record.
        t: times, shape (nt,), s.
        signals: of each receiver, shape (nt,).
        positions: of each, m; the wave runs towards larger ones.
        sent: what was sent, shape (nt,); None where it was not recorded.
        expected: (f, c), a phase velocity foreseen at one frequency, Hz and m/s.

    Returns:
        The reading: times are those of the record's clock, ``best.time`` is that from the first to
        the last receiver.

    Raises:
        PulseError: something can't be used.
    """
    notes: list[str] = []
    given = {key: np.array(u, float) for key, u in signals.items()}
    if sent is not None:
        given = _without_crosstalk(t, given, sent, notes)
    looked_at = pulse_record(t, given, positions)
    window, overlap = echo_gate(looked_at)
    if window is not None:
        notes.append(f"the record is read up to {window.end:.4g} s, before the first echo")
        weights = window.weights(looked_at.t, looked_at.x)
        given = {key: _ended(given[key], weights[:, j]) for j, key in enumerate(looked_at.names)}
    result = measure(
        t, given, positions, window=window, expected=expected,
        source=None if sent is None else np.asarray(sent, float),
    )  # fmt: skip
    notes = [*result.record.notes, *notes]
    if overlap:
        notes.append(overlap)
    best = _best(result, ("first break",) if overlap else _PREFERRED)
    notes += _dispersion(result)
    receivers = tuple(
        ReceiverArrivals(key, float(result.record.x[j]), _arrivals(result, j))
        for j, key in enumerate(result.record.names)
    )
    return Reading(name, receivers, best, notes=tuple(notes), result=result)


def _without_crosstalk(
    t: ArrayLike, signals: dict[str, Float], sent: ArrayLike, notes: list[str]
) -> dict[str, Float]:
    """Signals held at their base while crosstalk lasts, where every receiver has it."""
    try:
        each = {key: transmission_record(t, u, sent, key) for key, u in signals.items()}
    except PulseError:
        return signals
    if not all(one.crosstalk for one in each.values()):
        return signals
    until = max(one.blank for one in each.values())
    notes.append(f"crosstalk up to {until:.4g} s was left out of every receiver")
    return {
        key: np.where((one.t >= one.start) & (one.t < until), u - one.raw, u)
        for (key, u), one in zip(signals.items(), each.values(), strict=True)
    }


def _ended(u: Float, weight: Float) -> Float:
    """A signal that ends with a gate, at the base it began with."""
    base = float(np.median(u[: max(4, len(u) // 50)]))
    return base + (u - base) * weight


def _arrivals(result: PulseResult, j: int) -> dict[str, TravelTime]:
    return {
        convention: TravelTime(float(one.time[j]), float(one.error[j]), one.reason[j])
        for convention, one in result.arrivals.items()
    }


def _best(result: PulseResult, preferred: tuple[str, ...]) -> Best:
    """The velocity that counts, with what the conventions leave open."""
    speeds = result.velocities
    span = float(result.record.x[-1] - result.record.x[0])
    told = [
        n for n in preferred
        if math.isfinite(speeds[n].velocity) and speeds[n].error < _KNOWN * abs(speeds[n].velocity)
    ]  # fmt: skip
    if not told:
        why = next((one.reason for one in speeds.values() if one.reason), "no velocity is known")
        reasons = [r for r in result.record.unusable if r]
        return Best("correlation", math.nan, math.nan, math.nan, math.nan, False,
                    reasons[0] if reasons else why)  # fmt: skip
    name = told[0]
    one = speeds[name]
    # One that is known badly tells less of what is open.
    others = [
        math.sqrt(max((speeds[n].velocity - one.velocity) ** 2 - speeds[n].error ** 2, 0.0))
        for n in told
    ]
    bar = math.hypot(one.error, _FURTHEST * max(others))
    time = span / one.velocity
    reason = ""
    if not one.velocity > 0:
        reason = "the wave runs towards smaller positions: are they counted from the source?"
    return judged(name, time, time * bar / abs(one.velocity), span, reason)


def _dispersion(result: PulseResult) -> list[str]:
    """Whether phase and group velocity are apart."""
    found = result.dispersion
    with np.errstate(invalid="ignore"):
        own = found.valid & np.isfinite(found.group_velocity)
    if own.sum() < 3:
        return []
    strongest = int(np.argmax(np.where(own, result.spectra.source, -1.0)))
    c, v = found.phase_velocity[strongest], found.group_velocity[strongest]
    error = math.hypot(found.phase_error[strongest], found.group_error[strongest])
    if abs(c - v) < max(_DISPERSES * c, 3 * error):
        return []
    f = found.omega[strongest] / (2 * math.pi)
    return [
        f"the medium disperses: at {f:.4g} Hz phases run at {c:.4g} m/s and groups at {v:.4g} m/s, "
        "so that each convention reads a speed of its own"
    ]
