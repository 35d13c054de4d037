"""Travel time from transmitter to one receiver, by each convention: heard less sent.

    first break     where each leaves its noise
    threshold       where each first reaches half of its peak
    envelope        tops of the envelopes
    correlation     lag at which what was heard is most like what was sent, of either sign

The system's own delay, of cables and transducers, comes off each: it is what the same convention
reads with the transducers face to face. The conventions are apart by what a pulse's form leaves
open, and the error of the one that is taken holds that, beside the noise.
Lee & Santamarina, J. Geotech. Geoenviron. Eng. 131, 1063 (2005).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.arrivals import CONVENTIONS, top
from wavesim.readings.pulse.central_band import band_about
from wavesim.readings.pulse.first_break import envelope
from wavesim.readings.pulse.sent_signal import is_step
from wavesim.readings.pulse.signals import PulseError
from wavesim.readings.pulse.transmission_record import HEARD, TransmissionRecord, blanked
from wavesim.readings.pulse.wave_packets import LULL, break_between, direct, endless, packets, rises
from wavesim.simulation.bandlimited import cross_correlation

Float = NDArray[Any]

# Of the distance to another time this part is a standard error whose 95 % bar reaches there.
REACHED = 1 / 1.96
# The key, among delays by convention, of what they leave open; in touch a wave is heard from this
# part of the largest on.
OPEN, _AUDIBLE = "open", 0.05
# What breaks within this part of a period comes at once.
_AT_ONCE = 0.1
# The first break and the packet are looked for about the arrival that is known, in periods.
_ABOUT = (0.8, 0.5)
_PACKET = (0.5, 2.0)
# A convention that lies further off than this, in periods, does not tell of the direct wave.
_ELSEWHERE = 0.6
NOTHING_ALIKE = "nothing in common with what was sent near the break"
NOT_SENT = "what was sent was not recorded: name its column with --input"
STEP = "what was sent is a step, not a pulse: it has no such time"
ELSEWHERE = (
    "it lies over 0.6 of a period from the first break: transducers that ring, or a later packet"
)


@dataclass(frozen=True)
class TravelTime:
    """A travel time by one convention.

    Attributes:
        time, error: less the delay, and the standard error by noise, s; NaN where there is none.
        reason: why there is none, or "".
    """

    time: float
    error: float
    reason: str = ""


def travel_times(
    record: TransmissionRecord, begins: float, delays: Mapping[str, float]
) -> dict[str, TravelTime]:
    """Travel times of the direct wave.

    Args:
        record: the record.
        begins: roughly when it breaks, after the start, s.
        delays: of the system, by convention, s; 0 where left out.

    Returns:
        {convention: travel time}.
    """
    found: dict[str, TravelTime] = {}
    sent = record.sent
    if sent is not None:
        sent = None if is_step(sent) else band_about(sent, record.interval, record.period)
    for name in CONVENTIONS:
        if name == "first break":
            one = _first_break(record, begins)
        elif record.sent is None:
            one = TravelTime(np.nan, np.nan, NOT_SENT)
        elif sent is None:
            one = TravelTime(np.nan, np.nan, STEP)
        elif record.unusable and name != "correlation":
            one = TravelTime(np.nan, np.nan, record.unusable)
        else:
            one = {"threshold": _threshold, "envelope": _envelope, "correlation": _correlation}[
                name
            ](record, sent, begins)
        if abs(one.time - begins) > _ELSEWHERE * record.period:
            one = TravelTime(np.nan, np.nan, ELSEWHERE)
        found[name] = TravelTime(one.time - delays.get(name, 0.0), one.error, one.reason)
    return found


def face_to_face(record: TransmissionRecord) -> dict[str, float]:
    """Delays of a system, by convention, from a record with the transducers in touch, s.

    What was received begins with what was sent, so that nothing can be taken for crosstalk. The
    wave may have broken as early as anything is heard, or as late as its packet rises: crosstalk,
    or cycles of transducers that ring, may hide that. The first break is taken in the middle
    between, and ``OPEN`` has a standard error whose 95 % bar reaches either.

    Raises:
        PulseError: no arrival stands out, or none of many.
    """
    before = max(record.start - record.period, float(record.t[0]))
    whole = record.raw + record.crosstalk_taken
    none = np.zeros(len(whole))
    plain = blanked(replace(record, raw=whole, crosstalk_taken=none, crosstalk=0.0), before)
    heard = packets(plain)
    at = direct(heard)
    if at is None:
        raise PulseError(f"{record.name}: no arrival stands out of the noise: average more")
    if endless(heard, plain):
        why = "waves about as large come until the record ends, so that none tells the delay"
        raise PulseError(f"{record.name}: {why}: give it with --delay")
    found = travel_times(plain, heard[at].begins, {})
    first, got = found["first break"].time, np.abs(plain.got)
    least = max(HEARD * float(np.nan_to_num(plain.noise_in_band)), _AUDIBLE * float(got.max()))
    heard_from = float(plain.t[int(np.argmax(got > least))]) - plain.start
    # A convention that tells nothing here is put right by what the first break tells.
    told = {name: one.time if np.isfinite(one.time) else first for name, one in found.items()}
    earliest = min(first, max(heard_from, 0.0))
    # What is heard at once may be crosstalk, into which the wave runs.
    at_once = first < _AT_ONCE * plain.period
    latest = max(first, rises(heard[at], plain)) if at_once else first
    middle, apart = (earliest + latest) / 2, (latest - earliest) / 2
    return {**told, "first break": middle, OPEN: REACHED * apart}


def _window(record: TransmissionRecord, begins: float, before: float, after: float) -> slice:
    """Samples about a time after the start, from the blanked part on."""
    first = int(np.searchsorted(record.t, record.blank))
    at = (begins + record.start - record.t[0]) / record.interval
    reach = record.period / record.interval
    low = min(max(first, int(at - before * reach)), len(record.t) - 1)
    return slice(low, max(low + 1, min(len(record.t), int(at + after * reach) + 1)))


def _packet(record: TransmissionRecord, begins: float) -> slice:
    """Samples of the packet that breaks at a time; a burst lasts as long as it was sent."""
    before, after = _PACKET
    return _window(record, begins, before, max(after, record.length / record.period + 1.0))


def _first_break(record: TransmissionRecord, begins: float) -> TravelTime:
    own = _window(record, begins, *_ABOUT)
    # What a wave ahead of it leaves is no noise to divide from: it breaks about the lull between.
    size = envelope(record.got)[own.start : own.stop]
    until = max(1, int((begins + record.start - record.t[own.start]) / record.interval))
    lull = own.start + int(np.argmin(size[: until + 1]))
    low = max(own.start, lull - int(LULL * record.period / record.interval))
    found = break_between(record, low, own.stop)
    if found is None:
        return TravelTime(np.nan, np.nan, "no break stands out near the direct wave")
    return TravelTime(*found)


def _threshold(record: TransmissionRecord, sent: Float, begins: float) -> TravelTime:
    own = _packet(record, begins)
    part = record.got[own]
    place, slope = _reaches_half(part)
    there, _ = _reaches_half(sent)
    if not np.isfinite(place):
        return TravelTime(np.nan, np.nan, "the packet has reached half of its peak before")
    time = (own.start + place - there) * record.interval
    # Against the first sent sample above half, as the start counts from the pulse's first rise.
    error = float(np.nan_to_num(record.noise_in_band)) / slope * record.interval if slope else 0.0
    return TravelTime(time, error)


def _reaches_half(u: Float) -> tuple[float, float]:
    """Where |u| first reaches half of its peak, in samples, and its slope a sample there."""
    size = np.abs(u)
    level = 0.5 * float(size.max())
    at = int(np.argmax(size >= level))
    if at == 0:
        return float("nan"), 0.0
    rise = float(size[at] - size[at - 1])
    return at - 1 + (level - float(size[at - 1])) / rise, rise


def _envelope(record: TransmissionRecord, sent: Float, begins: float) -> TravelTime:
    own = _packet(record, begins)
    size = envelope(record.got)[own]
    first = _first_top(size)
    if first is None:
        return TravelTime(np.nan, np.nan, "the packet's envelope has no top")
    place = own.start + top_of(size, first)
    its = envelope(sent)
    there = top_of(its, _first_top(its) or 1)
    peak = float(size[first])
    bend = max(2 * peak - float(size[first - 1] + size[first + 1]), 1e-12 * peak)
    error = float(np.nan_to_num(record.noise_in_band)) / np.sqrt(bend * peak) * record.interval
    return TravelTime((place - there) * record.interval, min(error, record.period / 4))


def _first_top(size: Float) -> int | None:
    """The first top that is not much lower than the largest."""
    inner = size[1:-1]
    tops = np.flatnonzero((inner >= size[:-2]) & (inner > size[2:])) + 1
    high = [int(i) for i in tops if size[i] >= 0.6 * size.max()]
    return high[0] if high else None


def top_of(size: Float, at: int) -> float:
    """Top of a parabola through three values, in samples; the largest itself at an end."""
    if not 0 < at < len(size) - 1:
        return float(at)
    a, b, c = size[at - 1 : at + 2]
    bend = a - 2 * b + c
    return at + (0.5 * float((a - c) / bend) if bend < 0 else 0.0)


def _correlation(record: TransmissionRecord, sent: Float, begins: float) -> TravelTime:
    lags, c = correlations(record, sent, begins)
    # A later packet may be larger: the first top of the correlation's envelope counts.
    first = _first_top(envelope(c))
    reach = 0.3 * record.period / record.interval
    near = np.abs(np.arange(len(c)) - (np.argmax(np.abs(c)) if first is None else first)) <= reach
    at = int(np.argmax(np.where(near, np.abs(c), -1.0)))
    if not 0 < at < len(c) - 1:
        return TravelTime(np.nan, np.nan, NOTHING_ALIKE)
    place = top(np.abs(c), at)
    bend = abs(float(c[at - 1] - 2 * c[at] + c[at + 1]))
    energy = float(np.sum(np.diff(sent) ** 2))
    error = float(np.nan_to_num(record.noise_in_band)) * np.sqrt(energy) / max(bend, 1e-300)
    time = lags[0] + place * record.interval
    return TravelTime(float(time), min(float(error), 0.5) * record.interval)


def likeness(record: TransmissionRecord, begins: float) -> float:
    """How far the packet that breaks at a time after the start is a copy of what was sent, 0 to 1;
    0 of a step, and of what was not recorded."""
    if record.sent is None or is_step(record.sent):
        return 0.0
    sent = band_about(record.sent, record.interval, record.period)
    packet = record.got[_packet(record, begins)]
    size = float(np.linalg.norm(packet) * np.linalg.norm(sent))
    return float(np.abs(cross_correlation(packet, sent)).max()) / max(size, 1e-300)


def correlations(record: TransmissionRecord, sent: Float, begins: float) -> tuple[Float, Float]:
    """Lags about the direct wave, s, and the correlation of its packet with what was sent."""
    own = _packet(record, begins)
    packet = np.zeros(len(record.t))
    packet[own] = record.got[own] * np.hanning(own.stop - own.start + 2)[1:-1] ** 0.25
    c = cross_correlation(packet, sent)
    lags = (np.arange(len(c)) - (len(sent) - 1)) * record.interval
    near = np.abs(lags - begins) <= 1.25 * record.period
    return lags[near], c[near]
