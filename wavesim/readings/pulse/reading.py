"""What a pulse test says: arrivals by convention, the best of them, velocity, Q.

What is common to records of one receiver (``one_receiver.py``), of several (``array_reading.py``)
and to a series of them: an answer, judged by its error, and what else may be meant.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wavesim.readings.pulse.measurement import PulseResult
from wavesim.readings.pulse.transmission_record import TransmissionRecord
from wavesim.readings.pulse.travel_time import REACHED, TravelTime
from wavesim.readings.pulse.velocity import LARGEST_ERROR
from wavesim.readings.pulse.wave_packets import Packet

# Of one receiver the first break is taken; it needs no assumption about the pulse's form.
OF_ONE = "first break"
# An answer with an error of up to this part counts, where other waves may be meant.
_LARGEST_OPEN = 0.36


@dataclass(frozen=True)
class Wanted:
    """What is known of the wave that a test is after.

    Attributes:
        wave: "P" or "S", as the transducers send it; "" where it is not said.
        speed: about how fast it is, m/s; NaN where it is not said.
    """

    wave: str = ""
    speed: float = math.nan


UNKNOWN = Wanted()


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


def as_likely(distance: float, time: float, wanted: Wanted) -> str:
    return (
        f"the wave at {time:.3g} s, of {distance / time:.4g} m/s, may be the direct one as well, "
        "as of a P wave and its S wave, or of the direct wave and a guided one; the error holds "
        f"both: {say_which(wanted)}"
    )


def say_which(wanted: Wanted) -> str:
    """What tells waves apart that has not been told."""
    if wanted.speed > 0:
        return "--expected with a speed nearer to one of them tells which"
    roughly = "--expected F C about how fast it is"
    return roughly if wanted.wave else f"--wave P or S says which is sent, {roughly}"


def judged(
    convention: str,
    time: float,
    error: float,
    distance: float,
    reason: str,
    rivals: Sequence[float] = (),
    wanted: Wanted = UNKNOWN,
    remedy: str = "average more",
) -> Best:
    """A travel time as an answer, if it is one.

    Args:
        convention: that it was read by.
        time, error: less the delay, s.
        distance: from tip to tip, m.
        reason: why it is none, or "".
        rivals: times that may be meant as well, which the bars are to reach, s.
        wanted: what has been said of the wave.
        remedy: what makes the error less.
    """
    if not reason and not time > 0:
        reason = "it arrives before it is sent: look at --delay"
    if not reason and not np.isfinite(error):
        reason = "its error is not known"
    velocity = distance / time if time > 0 else math.nan
    others = [other for other in rivals if other > 0]
    # Each of them is known no better than this one: its own bar is to lie within the other.
    apart = max((abs(velocity - distance / other) for other in others), default=0.0)
    bar = velocity * error / time + REACHED * apart if time > 0 else math.nan
    alone, error = error, error + spanned(time, others)
    if not reason and alone > LARGEST_ERROR * time:
        reason = f"its standard error is {alone / time:.0%} of it, above {LARGEST_ERROR:.0%}: "
        reason += f"{remedy}, or take a longer path"
    if not reason and min(error / time, bar / velocity) > _LARGEST_OPEN:
        speeds = " or ".join(f"{distance / one:.4g}" for one in sorted([time, *others]))
        reason = f"it is one of several waves, of {speeds} m/s: {say_which(wanted)}"
    return Best(convention, time, error, velocity, bar, not reason, reason)


def spanned(time: float, rivals: Sequence[float]) -> float:
    """Standard error, beside that of a time, for some others that may stand as well, s."""
    return REACHED * max((abs(time - other) for other in rivals), default=0.0)
