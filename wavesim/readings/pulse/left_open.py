"""What a record of one receiver leaves open of a time, beside its noise, as standard errors.

A wave may have begun in crosstalk, or in the tail of one ahead of it; what was sent may rise
slowly; transducers ring and delay; conventions are apart; two cycles may be as likely.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.central_band import band_about
from wavesim.readings.pulse.first_break import envelope
from wavesim.readings.pulse.sent_signal import is_step
from wavesim.readings.pulse.transmission_record import STRONG, TransmissionRecord
from wavesim.readings.pulse.travel_time import OPEN, REACHED, TravelTime, correlations
from wavesim.readings.pulse.wave_packets import Packet, begun_before, breaking, rises

Float = NDArray[Any]

# Of the distance to the convention that lies furthest this part is a standard error.
_FURTHEST = 0.7
# Another lag with this part of the largest correlation is a second cycle.
_SECOND = 0.9
# Of what takes longer than this to rise, in periods, the first cycle may not stand out.
_SLOW = 0.2
# A step's near field begins this far ahead of its wave, in periods, as one standard error.
_OF_A_STEP = 0.25
# Transducers that ring delay what they pass on, in periods.
_DELAY = 0.14
# They ring where the envelope of what is heard takes so many periods more from half of its top to
# this part of it than that of what was sent, by the first of them if it takes that many more to
# fall to half, too. Their first cycles are unheard for such a part of that; and, where what comes
# ahead in a period has so much of the top and covers more of them, for about a constant besides;
# so too where what was sent is not known and may have been a burst, which rises as slowly itself
# (Hann's window of three cycles by 0.44 of one).
_RINGS, _RINGS_ON, _NEAR_TOP = (0.15, 0.3), 0.45, 0.9
_UNHEARD, _LOUD, _NOT_HEARD, _AS_A_BURST = 0.4, 0.1, (0.35, 0.6), 0.43
# A wave that breaks within this part of a period after the crosstalk is hidden by it, and within
# that where it had not ended, or was strong and longer than so many periods: a wave that began in
# it is still there; of a sweep this part of its length has its first cycle, the longest.
_HIDDEN, _NEAR_UNENDED, _BURST, _FIRST = 0.1, 0.75, 1.6, 0.15
# A wave has the form of crosstalk where they correlate so well, over so many samples at least.
_SAME_FORM, _FEWEST = 0.95, 8
# A wave of this part of the next one's size, over for no more than so many periods as that breaks,
# may cover its break by such a part of one; and where transducers ring on.
_COVERS, _LEAVES, _COVERED = 0.15, 1.5, (0.35, 0.9)

SECOND = (
    "two cycles are as likely, {:.3g} s apart; the error holds both: a shorter pulse would tell "
    "them apart"
)
SLOW = (
    "what was sent rises slowly, so that its first cycle may not stand out; the error holds the "
    "time in which it rises: a pulse that begins at once would tell it"
)
STEP = (
    "what was sent is a step, whose near field runs into the wave; the error holds that: a single "
    "sine would tell them apart"
)
EARLIER = (
    "it may have begun within the crosstalk or a wave ahead of it; the error holds that: a shorter "
    "pulse would part them"
)
RINGING = (
    "the transducers ring, so that the first cycles may not be seen; the error holds that: "
    "--face-to-face tells their delay, and a pulse further from their resonance has less of it"
)

DELAYED = (
    "most of the error is the system's own delay, which is not said: --face-to-face FILE of the "
    "transducers in touch reads it, or --delay says it"
)
IN_TOUCH = (
    "most of the error is the delay: crosstalk or ringing may hide when the transducers in touch "
    "first moved; a pulse further from their resonance tells it, or --delay says it"
)


@dataclass(frozen=True)
class Arrived:
    """An arrival of the direct wave, as it was read.

    Attributes:
        convention: by which.
        begins, noise: when, after the start, the system's delay in it, and its noise, s.
        open: what conventions leave open of it, as a standard error, s.
        second: how far another cycle lies that is as likely, s; NaN where none is.
        times: travel times by convention.
        reason: why it does not count, or "".
    """

    convention: str
    begins: float
    noise: float
    open: float
    second: float
    times: dict[str, TravelTime]
    reason: str = ""


def left_open(
    record: TransmissionRecord, heard: Sequence[Packet], at: Arrived, delays: Mapping[str, float]
) -> list[tuple[float, str]]:
    """What a record leaves open of an arrival, as standard errors, s, each with a note or "".

    They are the same parts in the same order for every record.
    """
    slow = STEP if record.sent is not None and is_step(record.sent) else SLOW
    own = breaking(heard, at.begins, record.period)
    delay = delays.get(OPEN, 0.0) if delays else _DELAY * record.period
    others = [
        (float(np.nan_to_num(at.second)), SECOND.format(at.second)),
        (0.0 if delays or own is None else ringing(record, own, heard, at.begins), RINGING),
        (begun_earlier(record, own, heard, at.begins), EARLIER),
        (slow_rise(record), slow),
    ]
    most = max(at.noise, at.open, *(part for part, _ in others))
    why = IN_TOUCH if delays else DELAYED
    return [(at.open, ""), (delay, why if delay > most else ""), *others]


def begun_earlier(
    record: TransmissionRecord, own: Packet | None, heard: Sequence[Packet], begins: float
) -> float:
    """What a direct wave leaves open that may have begun within a wave ahead of it, or in
    crosstalk, as one standard error, s."""
    early = 0.0
    if own is not None and begun_before(own, record):
        early = begins - max(rises(own, record), record.blank - record.start)
    # What such a wave leaves behind covers the break.
    covers = (
        own is not None and one.top < begins < one.top + _LEAVES * record.period
        and one.size >= _COVERS * own.size
        for one in heard
    )  # fmt: skip
    if any(covers):
        rings = own is not None and slower(record, own, heard)[1] > _RINGS_ON
        early = max(early, _COVERED[rings] * record.period)
    return REACHED * early


def in_crosstalk(record: TransmissionRecord, begins: float) -> bool:
    """Whether a direct wave that seems to break at a time after the start began in crosstalk."""
    beyond = (begins + record.start - record.blank) / record.period
    long = record.crosstalk > STRONG and record.length > _BURST * record.period
    within = max(_NEAR_UNENDED, _FIRST * record.length / record.period)
    near = beyond < (within if record.unended or long else _HIDDEN)
    return record.covered or near or comes_again(record, begins)


def comes_again(record: TransmissionRecord, begins: float) -> bool:
    """Whether what breaks at a time after the start has the form of strong crosstalk, as what each
    edge of a square sends has; known to be none where what was sent is."""
    known = record.sent is not None or bool(np.any(record.crosstalk_taken))
    if known or record.crosstalk < STRONG:
        return False
    dt = record.interval
    whole = band_about(record.raw, dt, record.period)
    first = int(np.searchsorted(record.t, record.start - _HIDDEN * record.period))
    length = max(record.blank - record.start + 2 * _HIDDEN * record.period, record.period)
    n = max(int(length / dt), _FEWEST)
    at = first + int(begins / dt)
    near = whole[max(first + n // 2, at - n // 2) : at + 2 * n]
    if len(near) < n:
        return False
    rows = np.lib.stride_tricks.sliding_window_view(near, n)
    rows = rows - rows.mean(axis=1, keepdims=True)
    form = whole[first : first + n] - whole[first : first + n].mean()
    like = np.abs(rows @ form) / np.maximum(np.linalg.norm(rows, axis=1), 1e-290)
    return bool(like.max() > _SAME_FORM * np.linalg.norm(form))


def hidden(record: TransmissionRecord) -> str:
    until = record.blank - record.start
    if record.crosstalk:
        column = "or is --input another column?"
        if record.sent is None:
            column = "or name what was sent with --input, which tells how long crosstalk may last"
        return (
            f"it would arrive within the crosstalk, {until:.3g} s long: send a shorter pulse, "
            f"shield the transducers, or take a longer specimen; {column}"
        )
    return "it would arrive as what was sent begins: is --input the right column?"


def open_between(found: Mapping[str, TravelTime], time: float, period: float) -> float:
    """What the conventions leave open about a time, as one standard error, s.

    Seven tenths of the distance to the one that lies furthest, as of an even distribution up to
    1.2 times that; an eighth of a period more where only one or two tell.
    """
    known = [one.time for one in found.values() if np.isfinite(one.time)]
    apart = _FURTHEST * max((abs(one - time) for one in known), default=0.0)
    return apart if len(known) > 2 else math.hypot(apart, period / 8)


def ringing(
    record: TransmissionRecord, own: Packet, heard: Sequence[Packet], begins: float
) -> float:
    """What transducers leave open that ring on after one of the packets heard, which breaks at a
    time after the start, as one standard error, s: they take as long to be heard as they rise more
    slowly than what was sent, and longer where something ahead is as loud."""
    rise, fall = slower(record, own, heard)
    if not rise > _RINGS[0 if fall > _RINGS_ON else 1]:
        return 0.0
    after, size = record.t - record.start, envelope(record.got)
    since = max(begins - record.period, record.blank - record.start)
    ahead = size[(after >= since) & (after < begins)]
    top = float(size[int(np.searchsorted(after, own.top).clip(max=len(size) - 1))])
    quiet = len(ahead) and float(np.sqrt(np.mean(ahead**2))) < _LOUD * top
    quiet = quiet and (record.sent is not None or rise < _AS_A_BURST)
    part = _UNHEARD * rise if quiet else _NOT_HEARD[0] + _NOT_HEARD[1] * rise
    return part * record.period


def slower(record: TransmissionRecord, own: Packet, heard: Sequence[Packet]) -> tuple[float, float]:
    """How much more slowly one of the packets heard rises, and falls, than what was sent, in
    periods; 0 of a step, and of what another follows before it falls. What was not recorded may
    have risen and fallen at once."""
    if record.sent is not None and is_step(record.sent):
        return 0.0, 0.0
    dt, period = record.interval, record.period
    rise, fall = _about_top(
        envelope(record.got), round((own.top + record.start - record.t[0]) / dt)
    )
    sent = (0, 0)
    if record.sent is not None:
        sent = _about_top(envelope(band_about(record.sent, dt, period)))
    alone = not any(own.top < one.top <= own.top + fall * dt for one in heard)
    return (rise - sent[0]) * dt / period, (fall - sent[1]) * dt / period * alone


def as_sent(record: TransmissionRecord, own: Packet, heard: Sequence[Packet]) -> bool:
    """Whether one of the packets heard rises and falls as fast as what was sent: none does of
    transducers that ring, whose first cycles are smaller than those that follow."""
    return max(slower(record, own, heard)) < _RINGS[0]


def _about_top(size: Float, at: int | None = None) -> tuple[int, int]:
    """Samples in which an envelope rises from half of a top of it to near that, and falls to half
    from there."""
    at = int(np.argmax(size)) if at is None else at
    before = np.flatnonzero(size[:at] < size[at] / 2)
    first = int(before[-1]) if len(before) else 0
    after = np.flatnonzero(size[at:] < size[at] / 2)
    near = int(np.argmax(size[first : at + 1] >= _NEAR_TOP * size[at]))
    return near, int(after[0]) if len(after) else len(size) - at


def slow_rise(record: TransmissionRecord) -> float:
    """What a burst that rises slowly leaves open of its first cycle, s, as long as that takes, and
    a step, whose near field runs into its wave; 0 of what does neither."""
    if record.sent is not None and is_step(record.sent):
        return _OF_A_STEP * record.period
    return record.rise if record.rise > _SLOW * record.period else 0.0


def second_cycle(record: TransmissionRecord, begins: float) -> float:
    """How far from the best lag another lies that correlates as well, s; NaN where none does."""
    if record.sent is None or is_step(record.sent):
        return float("nan")
    lags, c = correlations(record, record.sent, begins)
    size = np.abs(c)
    best = int(np.argmax(size))
    tops = np.flatnonzero((size[1:-1] >= size[:-2]) & (size[1:-1] > size[2:])) + 1
    other = [i for i in tops if i != best and c[i] * c[best] > 0 and size[i] > _SECOND * size[best]]
    if not other:
        return float("nan")
    return float(min(abs(lags[i] - lags[best]) for i in other))
