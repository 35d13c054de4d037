"""The packets that one receiver hears one after the other, and which of them went straight.

A packet is a top of the envelope. What comes before the direct wave is a faster wave or the
transmitter's near field, mostly small beside it; what comes after it was guided by the specimen's
sides, or reflected, or is the S wave of a P wave, mostly not much larger. How likely each packet is
to be the direct one follows from the sizes and times of the others (:func:`likelihoods`); where two
are about as likely, both are told. After three times its time the direct wave is back, having gone
to the transmitter and returned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.central_band import band_about
from wavesim.readings.pulse.first_break import division, envelope
from wavesim.readings.pulse.sent_signal import is_step
from wavesim.readings.pulse.transmission_record import TransmissionRecord

Float = NDArray[Any]

# A packet counts from this part of the largest on.
_COUNTS = 0.08
# … and no more of them than so many of the largest.
_MOST = 64
# Noise that may hide packets from this part of the largest on may hide the direct one.
DIRECT = 0.45
# By its ratio of times a pair of packets is a P and an S wave of an elastic solid: surely between
# the middle two, as Poisson's ratio is not below 0 nor near 1/2.
# As near as the first, a packet is a part of the next one.
_PAIR = (1.1, 1.25, 1.41, 1.47, 2.2, 2.6)
_PAIR_SURE = (1.0, 0.0, 0.05, 1.0, 1.0, 0.0)
LEAST_P_OVER_S = _PAIR[1]
# How likely a packet of so many times the direct one's size is ahead of it, as its P wave or not;
# and after it, as its S wave or not, as a guided wave. Also where the sender's wave is known.
_SIZE = (0.2, 0.3, 0.5, 0.8, 1.5, 2.5, 4.0)
_AHEAD_PAIR = (1.0, 0.95, 0.6, 0.4, 0.32, 0.28, 0.1)
_AHEAD_PAIR_S = (1.0, 1.0, 1.0, 0.8, 0.3, 0.1, 0.03)
_AHEAD_ELSE = (1.0, 0.5, 0.16, 0.1, 0.06, 0.03, 0.01)
_AFTER = (1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 15.0)
_AFTER_PAIR = (1.0, 0.7, 0.24, 0.08, 0.02, 0.01, 0.01)
_AFTER_ELSE = (1.0, 0.7, 0.4, 0.33, 0.27, 0.15, 0.05)
# A P wave that went a longer way is smaller than the first by this part at least.
_NO_LARGER = 0.9
# What is not faint ahead of a wave known as P.
_FAINT, _BEFORE_P = 0.15, 0.1
# A packet breaks no longer before it rises, in periods, and no longer after.
_RISES, _BEGUN = 0.42, 0.2
# Another packet may be the direct one as well from this part of its likelihood on.
RIVAL = 0.2
# What is sent is a burst from this many periods on; tops of one burst are this near, in periods,
# and this much alike.
_BURST, _OF_A_BURST, _ALIKE = 1.2, 1.2, 1.6
# Edges of a long pulse are packets of this part of its largest, and lie as they were sent to so
# many periods.
_EDGE, _NEAR_EDGE = 0.5, 0.3
# So many packets ahead of one, or after it, tell as much as any number: those of a train of echoes
# run into each other.
TELLING = 3
# Waves go on to the record's end where so many are of this part of the largest, and the last tenth
# of the record reaches that one.
_MANY, _LARGE, _AT_END = 7, 0.3, 0.5
# Packets stand at least this far apart, and a break is sought this far before a top, or a period
# before the envelope has this part of it, and no more than so much before the lull since the
# packet before, in periods.
_APART = 0.6
_BEFORE, _FOOT = 2.5, 0.1
# A top so near the record's end, in periods, is none: the signal grows on.
_CUT = 0.3
# An echo comes within this part of three times the direct wave's time.
_ECHO = 0.08
LULL = 0.3
# V_P/V_S of dry grains: above √(4/3), the least that an elastic solid has.
P_OVER_S = (1.155, 2.6)
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
        whole: whether the record goes on to its top.
    """

    top: float
    begins: float
    error: float
    size: float
    name: str = ""
    wave: str = ""
    whole: bool = True


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
    # Where the record ends sooner than the top of what is largest in it, that is one all the same.
    cut = int(np.argmax(size))
    cut = cut if len(size) - cut <= max(1, int(_CUT * period / dt)) and largest > least else -1
    if cut > 0:
        tops = np.append(tops[tops < cut - apart / 2], cut)
    # A burst's envelope may be highest at its end.
    before_top = _BEFORE * period + max(0.0, record.length - period)
    first = int(np.searchsorted(record.t, record.blank))
    tops = tops[tops > first]
    tops = np.sort(tops[np.argsort(size[tops])[-_MOST:]])
    for at, before in zip(tops.tolist(), [first, *tops.tolist()], strict=False):
        # It breaks after the envelope's least since the packet before, or little earlier.
        own = size[before : at + 1]
        least_at = before + int(np.argmin(own))
        # Transducers that ring rise for longer.
        foot = before + int(np.flatnonzero(np.append(True, own[:-1] < _FOOT * own[-1]))[-1])
        since = min(at - int(before_top / dt), foot - int(period / dt))
        low = max(first, since, least_at - int(LULL * period / dt))
        begins = break_between(record, low, at + 1)
        if begins is not None:
            place = float(record.t[0] + at * dt - record.start)
            found.append(Packet(place, *begins, float(size[at]) / largest, whole=at != cut))
    return _without_later_edges(_bursts_whole(found, record), record)


def _without_later_edges(found: list[Packet], record: TransmissionRecord) -> list[Packet]:
    """What was sent may have several packets, as the edges of a long pulse: the first of them
    stands for those that follow it as they were sent."""
    from scipy.signal import find_peaks  # slow to import, and only a reading needs it

    if record.length < _APART * record.period or record.sent is None or is_step(record.sent):
        return found
    size = envelope(band_about(record.sent, record.interval, record.period))
    apart = int(_APART * record.period / record.interval)
    tops, _ = find_peaks(size, height=_EDGE * size.max(), distance=apart, prominence=size.max() / 8)
    edges = [((at - tops[0]) * record.interval, size[at] / size[tops[0]]) for at in tops[1:]]

    def sent_with(one: Packet, other: Packet) -> bool:
        return any(
            abs(other.top - one.top - later) < _NEAR_EDGE * record.period
            and other.size < _ALIKE * part * one.size
            for later, part in edges
        )

    return [one for one in found if not any(sent_with(other, one) for other in found)]


def _bursts_whole(found: list[Packet], record: TransmissionRecord) -> list[Packet]:
    """A burst of several cycles has several tops: the first stands for them, with their size."""
    near = min(record.length, _OF_A_BURST * record.period)
    if record.length < _BURST * record.period:
        return found
    whole: list[Packet] = []
    last = -math.inf
    for one in found:
        alike = whole and 1 / _ALIKE < one.size / whole[-1].size < _ALIKE
        # Or the envelope has not fallen between them, as long as what was sent lasts.
        held = alike and rises(one, record) + record.rise < last
        if alike and one.top - last <= (record.length if held else near):
            whole[-1] = replace(whole[-1], size=max(whole[-1].size, one.size))
        else:
            whole.append(one)
        last = one.top
    return whole


def breaks_about(one: Packet, begins: float, period: float) -> bool:
    """Whether a packet breaks about a time and rises after it, s."""
    return one.begins - _BEGUN * period <= begins <= one.top


def breaking(found: Sequence[Packet], begins: float, period: float) -> Packet | None:
    """The packet that breaks about a time and rises after it, s."""
    return next((one for one in found if breaks_about(one, begins, period)), None)


def hidden_by_noise(record: TransmissionRecord) -> float:
    """Size below which noise hides a packet, over that of the largest, –."""
    largest = float(envelope(record.got).max())
    return _ABOVE_NOISE * float(np.nan_to_num(record.noise_in_band)) / max(largest, 1e-300)


def endless(found: Sequence[Packet], record: TransmissionRecord) -> str:
    """Why none of the packets can be told to have gone straight, where as large ones come until the
    record ends, as in a specimen that rings; or ""."""
    size = envelope(record.got)
    large = sum(one.size >= _LARGE for one in found)
    if large < _MANY or size[-(len(size) // 10) :].max() < _AT_END * size.max():
        return ""
    return (
        f"{large} waves about as large come one after the other until the record ends, and their "
        "sizes do not tell which went straight: --expected F C says about how fast it is; a "
        "specimen with lossy sides, or transducers that ring less, would show it"
    )


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


def named(found: list[Packet], direct: float, period: float, delay: float) -> list[Packet]:
    """Packets with their names.

    What comes ahead of the direct wave is a P precursor where it takes 1/1.15 to 1/2.6 of the
    direct wave's time, as a P wave does of an S wave's. (The near field of a transmitter has the
    speed of P waves too.) Times are compared by tops, as a break ahead of a larger packet is
    uncertain.

    Args:
        found: of :func:`packets`.
        direct: first break of the direct wave after the start, s.
        period: of the central frequency, s.
        delay: of the system, s.
    """
    straight = [
        one
        for one in found
        if abs(one.begins - direct) < _APART * period or one.begins <= direct <= one.top
    ]
    top = straight[0].top if straight else math.nan
    echo = 3 * (direct - delay) + delay
    result = []
    for one in found:
        travel, wave = direct - delay + one.top - top, ""
        if one in straight:
            name = "direct"
        elif one.begins < direct:
            ahead = travel > 0 and P_OVER_S[0] <= (direct - delay) / travel <= P_OVER_S[1]
            name, wave = ("P precursor", "P") if ahead else (_FASTER, "")
        elif abs(one.begins - echo) < max(_ECHO * echo, _APART * period):
            name = "reflected"
        else:
            name = "guided or reflected"
        result.append(replace(one, name=name, wave=wave))
    return result


def likelihoods(found: Sequence[Packet], delay: float = 0.0, wave: str = "") -> Float:
    """How likely each packet is the direct wave, over the likeliest; shape (n,).

    Args:
        found: of :func:`packets`.
        delay: of the system, s.
        wave: "P" or "S" where it is known which wave is sent, else "".
    """
    own = np.array([one.size for one in found])
    top = np.array([one.top for one in found])
    result = np.zeros(len(found))
    ahead_pair = _AHEAD_PAIR_S if wave == "S" else _AHEAD_PAIR
    for i, one in enumerate(found):
        time = max(one.begins - delay, 1e-12)
        travel = np.maximum(time + top - one.top, 0.05 * time)
        # Times of the slower over the faster of each two, and whether they are a P and an S wave.
        ratio = np.maximum(time / travel, travel / time)
        pair = np.interp(ratio, _PAIR, _PAIR_SURE)
        if wave == "S":
            # P waves that went longer ways follow the first one, and are no larger.
            of_first = np.triu(own[:i, None] > _NO_LARGER * own[:i])
            of_first &= own[:i, None] < one.size
            np.fill_diagonal(of_first, True)
            pair[:i] = np.max(of_first * pair[:i, None], axis=0, initial=0.0)
        size = own / one.size

        def mixed(at: Float, grid: tuple[float, ...], *rows: tuple[float, ...],
                  sure: Float) -> Float:  # fmt: skip
            as_pair, otherwise = (np.interp(np.log(at), np.log(grid), row) for row in rows)
            return np.asarray(sure * as_pair + (1 - sure) * otherwise)

        ahead = mixed(size[:i], _SIZE, ahead_pair, _AHEAD_ELSE, sure=pair[:i])
        after = mixed(size[i + 1 :], _AFTER, _AFTER_PAIR, _AFTER_ELSE, sure=pair[i + 1 :])
        weight = _together(ahead) * _together(after)
        result[i] = weight * (_BEFORE_P if wave == "P" and (size[:i] > _FAINT).any() else 1.0)
    return result / max(float(result.max(initial=0.0)), 1e-300)


def _together(each: Float) -> float:
    """Product of factors, the geometric mean of them to the power of those that tell."""
    return float(np.prod(each) ** min(1.0, TELLING / max(len(each), 1)))


def rises(one: Packet, record: TransmissionRecord) -> float:
    """When a packet's envelope last was below half of its top, less how long what was sent takes to
    half of its own: about its break, s after the start; -∞ where it stood above since the blank."""
    first = int(np.searchsorted(record.t, record.blank))
    at = round((one.top + record.start - record.t[0]) / record.interval)
    size = envelope(record.got)[first : at + 1]
    below = np.flatnonzero(size < size[-1] / 2)
    if not len(below):
        return -math.inf
    return float(record.t[first + below[-1]] - record.start) - record.rise


def foot(one: Packet, record: TransmissionRecord) -> float:
    """How far a packet's envelope stands above that of what was sent before both have half of their
    tops, over its top, –: the size of what comes ahead of a wave and runs into it; 1 of a step, or
    of what was not recorded."""
    if record.sent is None or is_step(record.sent):
        return 1.0
    begins, top = (
        int((when + record.start - record.t[0]) / record.interval) for when in (one.begins, one.top)
    )
    size = envelope(record.got)[max(begins, 0) : top + 1]
    own = envelope(band_about(record.sent, record.interval, record.period))
    sent = own[: int(np.argmax(own)) + 1] / own.max()
    size = size / size[-1]
    half = int(np.flatnonzero(np.append(True, size < 0.5))[-1])
    there = int(np.flatnonzero(np.append(True, sent < 0.5))[-1])
    along = np.arange(half) - half + there
    laid = np.where(along >= 0, sent[np.clip(along, 0, len(sent) - 1)], 0.0)
    return float(np.max(size[:half] - laid, initial=0.0))


def hides_two(one: Packet, record: TransmissionRecord) -> bool:
    """Whether a packet breaks so long before it rises that another wave runs into it."""
    return rises(one, record) - one.begins > _RISES * record.period


def begun_before(one: Packet, record: TransmissionRecord) -> bool:
    """Whether a packet had risen before the break that is seen, as where a wave runs into it."""
    return rises(one, record) + record.rise - one.begins < -_BEGUN * record.period


def direct(found: Sequence[Packet], delay: float = 0.0, wave: str = "") -> int | None:
    """Which packet most likely went straight; None where there is none."""
    return int(np.argmax(likelihoods(found, delay, wave))) if found else None
