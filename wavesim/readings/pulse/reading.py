"""What a pulse test says: arrivals by convention, the best of them, velocity, Q.

A record of one receiver is read against what was sent, one of several receivers by the line through
their arrivals. What is common to both stands in :class:`Reading`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.measurement import PulseResult
from wavesim.readings.pulse.transmission_record import (
    TransmissionRecord,
)
from wavesim.readings.pulse.travel_time import (
    TravelTime,
    open_between,
    second_cycle,
    slow_rise,
    travel_times,
)
from wavesim.readings.pulse.wave_packets import (
    DIRECT,
    P_OVER_S,
    Packet,
    direct,
    hidden_by_noise,
    named,
    packets,
)

Float = NDArray[Any]

# Of one receiver the first break is taken; it needs no assumption about the pulse's form.
OF_ONE = "first break"
# An answer whose standard error is more than this part of it is none.
_LARGEST_ERROR = 0.25
# A wave that breaks within this part of a period after the crosstalk is hidden by it.
HIDDEN = 0.1
# A later packet may be the one that is meant from this part of the direct one's size on.
_NO_SMALLER = 0.8

SLOW = (
    "what was sent rises over more than half a period, so that its first cycle does not stand out; "
    "the error holds one cycle either way: a pulse that begins at once would tell it"
)
NOTHING = "no arrival stands out of the noise: average more, or listen nearer"


@dataclass(frozen=True)
class Best:
    """The travel time that counts.

    Attributes:
        convention: which.
        time, error: less the delay, and its standard error with what the conventions leave open, s.
        velocity, velocity_error: m/s.
        valid: whether it counts.
        reason: why not, or "".
    """

    convention: str
    time: float
    error: float
    velocity: float
    velocity_error: float
    valid: bool
    reason: str


@dataclass(frozen=True)
class ReceiverArrivals:
    """Arrivals at one receiver: its name, its position (m), travel times by convention."""

    name: str
    position: float
    arrivals: dict[str, TravelTime]


@dataclass(frozen=True)
class Reading:
    """A record as it was read.

    Attributes:
        file: its name.
        receivers: in order of position.
        best: the answer.
        packets: what a single receiver heard, named; empty for several receivers.
        notes: what was put right, and what is doubtful.
        record: of a single receiver.
        result: of several.
        common: part of the error that other records of the same series share, s.
        delay: of the system, which the arrivals hold and the best time does not, s.
    """

    file: str
    receivers: tuple[ReceiverArrivals, ...]
    best: Best
    packets: tuple[Packet, ...] = ()
    notes: tuple[str, ...] = ()
    record: TransmissionRecord | None = None
    result: PulseResult | None = None
    common: float = 0.0
    delay: float = 0.0


def refused(file: str, name: str, position: float, reason: str) -> Reading:
    """A reading of a record that can't be read."""
    nan = math.nan
    best = Best(OF_ONE, nan, nan, nan, nan, False, reason)
    return Reading(file, (ReceiverArrivals(name, position, {}),), best)


def read_one(
    record: TransmissionRecord,
    distance: float,
    delays: Mapping[str, float],
    speeds: Mapping[str, float] | None = None,
) -> Reading:
    """Read a record of one receiver by itself.

    Args:
        record: the record.
        distance: from tip to tip, m.
        delays: of the system, by convention, s.
        speeds: {wave: speed} that packets are named by, m/s; None where they are not known.

    Returns:
        The reading.
    """
    heard = packets(record)
    at = direct(heard)
    if at is None:
        nothing = refused(record.name, "receiver", distance, NOTHING)
        return replace(nothing, record=record, notes=record.notes)
    found = settled(record, heard, heard[at].begins, distance, delays, speeds)
    below = hidden_by_noise(record)
    if speeds is None and below > DIRECT and found.best.valid:
        found = replace(found, best=replace(found.best, valid=False, reason=noisy(below)))
    # Of waves that are told apart by their speeds the largest is the one that the test is after.
    known = [
        one for one in found.packets if one.wave and one.name in ("direct", f"{one.wave} wave")
    ]
    main = max(known, key=lambda one: one.size, default=None)
    if main is None or main.name == "direct":
        return found
    return settled(record, heard, main.begins, distance, delays, speeds)


def settled(
    record: TransmissionRecord,
    heard: list[Packet],
    begins: float,
    distance: float,
    delays: Mapping[str, float],
    speeds: Mapping[str, float] | None = None,
) -> Reading:
    """The reading for a direct wave that is known to break at about a time after the start."""
    found = travel_times(record, begins, delays)
    delay = delays.get(OF_ONE, 0.0)
    best = found[OF_ONE]
    told = named(heard, begins, record.period, delay, distance, speeds)
    notes = list(record.notes)
    if record.crosstalk:
        until = record.blank - record.start
        notes.append(f"crosstalk up to {until:.3g} s after what was sent begins was left out")
    notes += _other_readings(told, begins, delay, distance)
    share = open_between(found, best.time, record.period)
    second = second_cycle(record, begins)
    if np.isfinite(second):
        share = float(np.hypot(share, second))
        notes.append(
            f"two cycles are as likely, {second:.3g} s apart; the error holds both: a shorter "
            "pulse would tell them apart"
        )
    slow = slow_rise(record)
    if slow:
        share = float(np.hypot(share, slow))
        notes.append(SLOW)
    error = float(np.hypot(best.error, share))
    answer = judged(OF_ONE, best.time, error, distance, best.reason)
    if answer.valid and begins + record.start - record.blank < HIDDEN * record.period:
        answer = replace(answer, valid=False, reason=hidden(record))
    return Reading(
        record.name,
        (ReceiverArrivals("receiver", distance, _with_delay(found, delays)),),
        answer,
        tuple(told),
        tuple(notes),
        record,
        common=share,
        delay=delay,
    )


def _with_delay(
    found: Mapping[str, TravelTime], delays: Mapping[str, float]
) -> dict[str, TravelTime]:
    """Times after what was sent, the delay of the system in them."""
    return {
        name: replace(one, time=one.time + delays.get(name, 0.0)) for name, one in found.items()
    }


def noisy(below: float) -> str:
    return (
        f"noise hides packets of up to {below:.0%} of the largest, and one of them may be the "
        "direct wave: average more, or read the record in a series (--against)"
    )


def hidden(record: TransmissionRecord) -> str:
    until = record.blank - record.start
    if record.crosstalk:
        return (
            f"it would arrive within the crosstalk, {until:.3g} s long: send a shorter pulse, "
            "shield the transducers, or take a longer specimen"
        )
    return "it would arrive as what was sent begins: is --input the right column?"


def _other_readings(
    told: Sequence[Packet], begins: float, delay: float, distance: float
) -> list[str]:
    """What else the direct wave might be."""
    notes = []
    own = next((one for one in told if one.name == "direct"), None)
    ahead_named = any(one.wave and one.begins < begins for one in told if one.name != "direct")
    for one in told:
        speed = distance / (one.begins - delay) if one.begins > delay else math.nan
        if own and one.wave and one.begins < begins and one.name != "direct":
            ahead = own.top - one.top
            its = begins - delay - ahead
            notes.append(
                f"a {one.name} of {one.size:.0%} of the largest comes {ahead:.3g} s ahead, at "
                f"about {distance / its:.3g} m/s, {(begins - delay) / its:.2f} times as fast"
                + ("" if own.wave else "; so would the near field of a transmitter")
            )
        elif one.begins < begins and one.name != "direct" and one.size >= 0.6 * DIRECT:
            notes.append(
                f"an earlier packet of {one.size:.0%} of the largest is taken for a faster wave or "
                f"the near field; were it the direct one, the velocity would be {speed:.4g} m/s"
            )
        follows = own is not None and one.begins > begins and one.name != "direct"
        ratio = 1 + (one.top - own.top) / (begins - delay) if own else 0.0
        pair = P_OVER_S[0] <= ratio <= P_OVER_S[1] and not ahead_named
        as_large = one.size >= max(DIRECT, _NO_SMALLER * own.size) if own else False
        if own and follows and pair and not own.wave and as_large:
            notes.append(
                f"a packet {one.size / own.size:.1f} times as large follows at {ratio:.2f} times "
                "the time, as an S wave does its P wave or a guided wave the direct one; were it "
                f"the direct one, the velocity would be {speed:.4g} m/s: --medium tells them apart"
            )
        elif own and follows and one.size > 2 * own.size:
            notes.append(
                f"a packet {one.size / own.size:.1f} times as large follows; were it the direct "
                f"one and this a near field, the velocity would be {speed:.4g} m/s"
            )
    return notes


def judged(convention: str, time: float, error: float, distance: float, reason: str) -> Best:
    """A travel time as an answer, if it is one."""
    if not reason and not time > 0:
        reason = "it arrives before it is sent: look at --delay"
    velocity = distance / time if time > 0 else math.nan
    bar = velocity * error / time if time > 0 else math.nan
    if not reason and not np.isfinite(error):
        reason = "its error is not known"
    if not reason and error > _LARGEST_ERROR * time:
        reason = f"its standard error is {error / time:.0%} of it"
    return Best(convention, time, error, velocity, bar, not reason, reason)
