"""The packets that one receiver hears one after the other, and which of them went straight.

A packet is a top of the envelope. The direct wave is the first that is not small beside the
largest: what comes before it is a faster wave or the transmitter's near field, both small; what
comes after it was guided by the specimen's sides, or reflected. After three times its time the
direct wave is back, having gone to the transmitter and returned.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.first_break import division, envelope
from wavesim.readings.pulse.transmission_record import TransmissionRecord

Float = NDArray[Any]

# A packet counts from this part of the largest on.
_COUNTS = 0.08
# It is the direct one from the lower part on; from the higher where it and the largest may be a P
# and an S wave by their times.
_NOT_SMALL, DIRECT = 0.3, 0.45
_PAIR = (1.45, 2.4)
# Packets stand at least this far apart, and a break is sought this far before a top, and
# no more than so much before the lull since the packet before, in periods.
_APART = 0.6
_BEFORE = 2.5
# An echo comes within this part of three times the direct wave's time.
_ECHO = 0.08
LULL = 0.3
# V_P/V_S of dry grains: above √(4/3), the least that an elastic solid has.
P_OVER_S = (1.155, 2.6)
# A packet's time may be off by this part of that of the wave which it is.
_OFF = 0.15
_FASTER = "faster wave or near field"
_ABOVE_NOISE = 5.0


@dataclass(frozen=True)
class Packet:
    """One packet.

    Attributes:
        top: time of the envelope's top after the start, s.
        begins, error: first break after the start, and its standard error, s.
        size: of the top, over that of the largest, –.
        name: "direct", "P precursor", "faster wave or near field", "guided or reflected", …
        wave: which wave it is, such as "S"; "" where that is not known.
    """

    top: float
    begins: float
    error: float
    size: float
    name: str = ""
    wave: str = ""


def packets(record: TransmissionRecord) -> list[Packet]:
    """All packets of a record that stand above its noise, in order of time; none is named."""
    from scipy.signal import find_peaks  # slow to import, and only a reading needs it

    dt, period = record.interval, record.period
    size = envelope(record.got)
    largest = float(size.max())
    least = max(_COUNTS, hidden_by_noise(record)) * largest
    apart = max(1, int(_APART * period / dt))
    tops, _ = find_peaks(size, height=least, distance=apart, prominence=0.25 * least)
    found = []
    first = int(np.searchsorted(record.t, record.blank))
    tops = tops[tops > first]
    for at, before in zip(tops.tolist(), [first, *tops.tolist()], strict=False):
        # It breaks after the envelope's least since the packet before, or little earlier.
        least_at = before + int(np.argmin(size[before : at + 1]))
        low = max(first, at - int(_BEFORE * period / dt), least_at - int(LULL * period / dt))
        begins = break_between(record, low, at + 1)
        if begins is not None:
            place = float(record.t[0] + at * dt - record.start)
            found.append(Packet(place, *begins, float(size[at]) / largest))
    return found


def hidden_by_noise(record: TransmissionRecord) -> float:
    """Size below which noise hides a packet, over that of the largest, –."""
    largest = float(envelope(record.got).max())
    return _ABOVE_NOISE * float(np.nan_to_num(record.noise_in_band)) / max(largest, 1e-300)


def break_between(record: TransmissionRecord, low: int, high: int) -> tuple[float, float] | None:
    """First break among some samples: time after the start and its standard error, s, or None."""
    piece = record.got[low:high]
    if len(piece) < 16 or not np.abs(piece).max() > 0:
        return None
    found = division(piece, float(np.abs(piece).max()))
    if found is None:
        return None
    dt = record.interval
    return float(record.t[0] + (low + found.place) * dt - record.start), found.error * dt


def named(
    found: list[Packet],
    direct: float,
    period: float,
    delay: float,
    distance: float = math.nan,
    speeds: Mapping[str, float] | None = None,
) -> list[Packet]:
    """Packets with their names.

    What comes ahead of the direct wave is the precursor of a wave that is known to be as fast; a P
    precursor where no speeds are known and it takes 1/1.15 to 1/2.6 of the direct wave's time, as a
    P wave does of an S wave's. (The near field of a transmitter has the speed of P waves too.)
    Times are compared by tops, as a break ahead of a larger packet is uncertain.

    Args:
        found: of :func:`packets`.
        direct: first break of the direct wave after the start, s.
        period: of the central frequency, s.
        delay: of the system, s.
        distance: from tip to tip, m.
        speeds: {wave: speed} of waves that there may be, m/s; None where they are not known.
    """
    straight = [
        one
        for one in found
        if abs(one.begins - direct) < _APART * period or one.begins <= direct <= one.top
    ]
    top = straight[0].top if straight else math.nan
    echo = 3 * (direct - delay) + delay
    times = {name: distance / speed for name, speed in (speeds or {}).items()}

    def nearest(travel: float) -> str:
        near = min(times, key=lambda name: abs(times[name] - travel), default="")
        room = max(_APART * period, _OFF * times[near]) if near else 0.0
        return near if near and abs(times[near] - travel) <= room else ""

    main = nearest(direct - delay) if straight else ""
    base = times.get(main, direct - delay)

    def wave(one: Packet) -> str:
        travel = base + one.top - top
        if speeds is not None:
            return nearest(travel)
        ratio = base / travel if travel > 0 else 0.0
        return "P" if P_OVER_S[0] <= ratio <= P_OVER_S[1] else ""

    result = []
    for one in found:
        its = wave(one) if straight else ""
        if one in straight:
            name, its = "direct", main
        elif one.begins < direct:
            name = f"{its} precursor" if its and its != main else _FASTER
        elif speeds and its and its != main:
            name = f"{its} wave"
        elif abs(one.begins - echo) < max(_ECHO * echo, _APART * period):
            name, its = "reflected", main
        else:
            name, its = "guided or reflected", ""
        result.append(replace(one, name=name, wave=its if name != _FASTER else ""))
    return result


def direct(found: list[Packet]) -> int | None:
    """Which packet went straight: the first that is not small beside the largest.

    A packet that the largest follows at 1.45 to 2.4 times its time, as an S wave does a P wave,
    must be nearly half as large; else three tenths will do.
    """
    if not found:
        return None
    largest = max(found, key=lambda one: one.size)
    for i, one in enumerate(found):
        ratio = largest.top / one.top if one.top > 0 else 0.0
        least = DIRECT if _PAIR[0] <= ratio <= _PAIR[1] else _NOT_SMALL
        if one.size >= least:
            return i
    return None
