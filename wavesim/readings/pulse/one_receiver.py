"""A record of one receiver, read by itself against what was sent: which wave went straight, when it
broke, and what the record leaves open."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from wavesim.readings.pulse.left_open import (
    Arrived,
    as_sent,
    hidden,
    in_crosstalk,
    left_open,
    open_between,
    second_cycle,
)
from wavesim.readings.pulse.reading import (
    OF_ONE,
    UNKNOWN,
    Reading,
    ReceiverArrivals,
    Wanted,
    as_likely,
    judged,
    refused,
    spanned,
)
from wavesim.readings.pulse.signals import check_distance
from wavesim.readings.pulse.transmission_record import TransmissionRecord
from wavesim.readings.pulse.travel_time import OPEN, REACHED, TravelTime, likeness, travel_times
from wavesim.readings.pulse.wave_packets import (
    DIRECT,
    LEAST_P_OVER_S,
    RIVAL,
    Packet,
    breaking,
    endless,
    foot,
    hidden_by_noise,
    hides_two,
    likelihoods,
    named,
    packets,
    rises,
)

# A faster packet is told of from this part of the largest on.
_TOLD = 0.27
# A speed that is told is meant to be right within this part, as one standard deviation.
_ABOUT_AS_FAST = 0.12
# Packets nearer than this, in periods, are no two waves.
_APART = 0.6
# What comes first, is the largest but for rounding and a copy of what was sent went straight: no
# wave after it did that is smaller than this part of it.
_LARGEST, _COPY, _ECHO = 0.999, 0.9, 0.5
# A wave so near to that of transducers in touch, in periods, went no way between them.
_IN_TOUCH = 0.3
# A wave rises within so many periods after it breaks.
_OWN_CYCLE = 0.65
# Noise that hides a wave of this part of the largest is told of.
_MAY_HIDE = 0.1
UNSAID = (
    "nothing says when it was sent, as the record begins at t = 0: --input names the column of "
    "what was sent, or --delay says by how much it was later (--delay 0s: then it is {:.4g} m/s)"
)
AFTER_CROSSTALK = (
    "nothing stands out after the crosstalk, {:.3g} s long: the wave lies within it, is weaker "
    "than the noise, or comes after the record's end (of less than {:.4g} m/s): shield the "
    "transducers, average more, or record longer"
)
CUT = (
    "the record ends while its largest wave still grows, which may be the direct one: record longer"
)
LIKELIER = (
    "by sizes and times alone the wave at {:.3g} s, of {:.4g} m/s, is likelier the direct one: "
    "what --expected says has decided"
)
AS_IN_TOUCH = (
    "it arrives no later than what the transducers in touch heard may have: is --face-to-face a "
    "record of the specimen itself? a shorter pulse, or --delay, would tell"
)
NOTHING = "no arrival stands out of the noise: average more, or listen nearer"


def unheard(record: TransmissionRecord, distance: float) -> Reading:
    """A reading of a record in which nothing stands out."""
    reason = NOTHING
    if record.crosstalk:
        least = distance / (float(record.t[-1]) - record.start)
        reason = AFTER_CROSSTALK.format(record.blank - record.start, least)
    nothing = refused(record.name, "receiver", distance, reason)
    return replace(nothing, record=record, notes=record.notes)


def read_one(
    record: TransmissionRecord,
    distance: float,
    delays: Mapping[str, float],
    wanted: Wanted = UNKNOWN,
) -> Reading:
    """Read a record of one receiver by itself.

    Args:
        record: the record.
        distance: from tip to tip, m.
        delays: of the system, by convention, s.
        wanted: which wave is meant.

    Returns:
        The reading.

    Raises:
        PulseError: the distance is none.
    """
    check_distance(distance)
    heard = packets(record)
    if not heard:
        return unheard(record, distance)
    delay = delays.get(OF_ONE, 0.0)
    likely = by_size = likelihoods(heard, delay, wanted.wave)
    begun = np.array([one.begins for one in heard])
    if wanted.speed > 0:
        off = np.log(distance / np.maximum(begun - delay, 1e-12) / wanted.speed) / _ABOUT_AS_FAST
        likely = likely * np.exp(-(off**2) / 2)
        likely /= max(float(likely.max()), 1e-300)
    at = int(np.argmax(likely))
    as_well = (likely >= RIVAL) & (np.abs(begun - begun[at]) > _APART * record.period)
    whole = at == 0 and heard[0].size > _LARGEST and wanted.wave != "S"
    if whole and likeness(record, heard[0].begins) > _COPY:
        as_well &= np.array([one.size for one in heard]) > _ECHO
    rivals = begun[as_well].tolist()
    begins, other = run_into(heard[at], record, heard, distance, delay, wanted)
    rivals += [other] if math.isfinite(other) else []
    own = arrived(record, begins, delays)
    parts = left_open(record, heard, own, delays)
    cut = any(not one.whole for one in heard if one is heard[at] or one.begins in rivals)
    if cut and not endless(heard, record):
        own = replace(own, reason=CUT)
    found = settled(record, heard, own, parts, distance, delays, rivals, wanted)
    below = hidden_by_noise(record)
    if at == 0 and _MAY_HIDE < below <= DIRECT:
        weak = f"noise hides packets of up to {below:.0%} of the largest, a direct wave so weak too"
        found = replace(found, notes=(*found.notes, weak))
    if by_size[at] < RIVAL:
        before = max(float(begun[int(np.argmax(by_size))]) - delay, 1e-12)
        found = replace(found, notes=(*found.notes, LIKELIER.format(before, distance / before)))
    if below > DIRECT and found.best.valid:
        found = replace(found, best=replace(found.best, valid=False, reason=noisy(below)))
    return found


def run_into(
    one: Packet,
    record: TransmissionRecord,
    heard: Sequence[Packet],
    distance: float,
    delay: float,
    wanted: Wanted,
) -> tuple[float, float]:
    """When a packet breaks, one of those heard, and when it may as well, as where another wave runs
    into it: s after the start; NaN where it is known, or where nothing else may."""
    risen = rises(one, record)
    if not hides_two(one, record):
        return one.begins, math.nan
    if wanted.speed > 0:
        late = abs(distance / wanted.speed + delay - risen)
        return (
            risen if late < abs(distance / wanted.speed + delay - one.begins) else one.begins
        ), math.nan
    # A P wave comes ahead of the S wave that is meant, but no nearer than that's own first cycle;
    # what lies nearer than P waves do may be that wave itself.
    if wanted.wave and risen - one.begins > _OWN_CYCLE * record.period:
        near = risen - delay < LEAST_P_OVER_S * (one.begins - delay)
        as_well = one.begins if near else math.nan
        return (risen, as_well) if wanted.wave == "S" else (one.begins, math.nan)
    # Unless transducers ring, and so rise slowly, what stands above the rise of what was sent is a
    # wave of its own, as likely to be the direct one as one that comes by itself.
    if as_sent(record, one, heard):
        ahead = foot(one, record)
        both = [replace(one, top=one.top + one.begins - risen, size=ahead * one.size),
                replace(one, begins=risen)]  # fmt: skip
        if likelihoods(both, delay, wanted.wave)[0] < RIVAL:
            return risen, math.nan
    return one.begins, risen


def beside(
    record: TransmissionRecord,
    heard: Sequence[Packet],
    at: Arrived,
    distance: float,
    delay: float,
    wanted: Wanted,
) -> float:
    """How long after an arrival its wave may break as well, as another runs into it, in periods."""
    own = breaking(heard, at.begins, record.period)
    if own is None:
        return 0.0
    both = np.array(run_into(own, record, heard, distance, delay, wanted)) - at.begins
    return float(both[np.argmax(np.abs(both))]) / record.period if np.isfinite(both).all() else 0.0


def arrived(record: TransmissionRecord, begins: float, delays: Mapping[str, float]) -> Arrived:
    """The arrival of a direct wave that is known to break at about a time after the start, s."""
    found = travel_times(record, begins, delays)
    best, delay = found[OF_ONE], delays.get(OF_ONE, 0.0)
    return Arrived(
        OF_ONE, best.time + delay, best.error, open_between(found, best.time, record.period),
        second_cycle(record, begins), found, best.reason,
    )  # fmt: skip


def settled(
    record: TransmissionRecord,
    heard: list[Packet],
    at: Arrived,
    parts: Sequence[tuple[float, str]],
    distance: float,
    delays: Mapping[str, float],
    rivals: Sequence[float] = (),
    wanted: Wanted = UNKNOWN,
) -> Reading:
    """The reading for an arrival of the direct wave, with all that the record leaves open of it.

    Args:
        record, distance, delays: as for :func:`read_one`.
        heard: its packets.
        at: the arrival.
        parts: what is open of it, as :func:`left_open` tells.
        rivals: when others break that may be the direct one as well, after the start, s.
        wanted: what has been said of the wave.
    """
    delay = delays.get(OF_ONE, 0.0)
    time = at.begins - delay
    # None arrives before it was sent.
    rivals = [one for one in rivals if one > delay]
    others = [one - delay for one in rivals]
    told = named(heard, at.begins, record.period, delay)
    share = math.hypot(*(part for part, _ in parts))
    notes = [*record.notes, *_crosstalk(record)]
    notes += _other_readings(told, at.begins, delay, distance, rivals, wanted)
    notes += [note for part, note in parts if note and part > 0]
    reason = at.reason or (hidden(record) if in_crosstalk(record, at.begins) else "")
    about = _IN_TOUCH * record.period + delays.get(OPEN, 0.0) / REACHED
    if not reason and OPEN in delays and abs(time) < about:
        reason = AS_IN_TOUCH
    # No crosstalk, and nothing before t = 0, says that this is when it was sent.
    silent = record.sent is None and not delays and not record.crosstalk
    if not reason and silent and record.t[0] > record.start - record.interval:
        reason = UNSAID.format(distance / time)
    if not reason and not wanted.speed > 0:
        reason = endless(heard, record)
    best = judged(
        at.convention, time, math.hypot(at.noise, share), distance, reason, others, wanted,
        "average more" if at.noise > share else "send a shorter pulse",
    )  # fmt: skip
    arrivals = {
        name: replace(one, time=one.time + delays.get(name, 0.0)) for name, one in at.times.items()
    }
    if at.convention not in arrivals:
        arrivals[at.convention] = TravelTime(at.begins, at.noise, best.reason)
    return Reading(
        record.name,
        (ReceiverArrivals("receiver", distance, arrivals),),
        best,
        tuple(told),
        tuple(notes),
        record,
        common=share + spanned(time, others),
        delay=delay,
    )


def _crosstalk(record: TransmissionRecord) -> list[str]:
    """What was done to crosstalk."""
    if not record.crosstalk:
        return []
    known = bool(np.any(record.crosstalk_taken))
    return [
        f"crosstalk up to {record.blank - record.start:.3g} s after what was sent begins was left "
        "out" + (", and what is known of it taken out of the rest" if known else "")
    ]


def noisy(below: float) -> str:
    return (
        f"noise hides packets of up to {below:.0%} of the largest, and one of them may be the "
        "direct wave: average more, or read the record in a series (--against)"
    )


def _other_readings(
    told: Sequence[Packet],
    begins: float,
    delay: float,
    distance: float,
    rivals: Sequence[float],
    wanted: Wanted,
) -> list[str]:
    """What else the direct wave might be."""
    notes = [as_likely(distance, time - delay, wanted) for time in rivals]
    own = next((one for one in told if one.name == "direct"), None)
    for one in told:
        if one.begins in rivals or one.name == "direct" or not one.begins > delay:
            continue
        speed = distance / (one.begins - delay)
        were = f"the velocity would be {speed:.4g} m/s"
        if one.begins < begins and own and one.wave:
            notes.append(
                f"a {one.name} of {one.size:.0%} of the largest comes {begins - one.begins:.3g} s "
                f"ahead, at about {speed:.3g} m/s, "
                f"{(begins - delay) / (one.begins - delay):.2f} times as fast"
                + ("" if own.wave else "; so would the near field of a transmitter")
            )
        elif one.begins < begins and one.size >= _TOLD:
            notes.append(
                f"an earlier packet of {one.size:.0%} of the largest is taken for a faster wave or "
                f"the near field; were it the direct one, {were}"
            )
        elif own and one.begins > begins and one.size > 2 * own.size and not wanted.speed > 0:
            notes.append(
                f"a packet {one.size / own.size:.1f} times as large follows; were it the "
                f"direct one and this a near field, {were}: --expected F C about how fast it is"
            )
    return notes
