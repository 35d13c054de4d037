"""A series of pulse tests in different states, read as one: an arrival followed, and its law."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.common_crosstalk import without_common, without_still
from wavesim.readings.pulse.left_open import Arrived, in_crosstalk, left_open, open_between
from wavesim.readings.pulse.one_receiver import NOTHING, arrived, beside, run_into, settled, unheard
from wavesim.readings.pulse.power_law import FEWEST, Line, lines
from wavesim.readings.pulse.reading import OF_ONE, UNKNOWN, Reading, Wanted
from wavesim.readings.pulse.series import (
    LEAST_CORRELATION,
    MOVES,
    STRESS_POWER,
    Followed,
    clearest,
    follow_clearest,
    in_noise,
    in_order,
    of_another_set_up,
)
from wavesim.readings.pulse.series_law import Series, law_of, of_one_law, without_two_waves
from wavesim.readings.pulse.signals import PulseError, check_distance
from wavesim.readings.pulse.transmission_record import TransmissionRecord
from wavesim.readings.pulse.travel_time import REACHED, TravelTime
from wavesim.readings.pulse.wave_packets import (
    RIVAL,
    TELLING,
    Packet,
    begun_before,
    hidden_by_noise,
    hides_two,
    likelihoods,
    packets,
)

Float = NDArray[np.float64]

FOLLOWED = "followed"
# A wave that breaks within this part of a period of the record's end is not seen.
_SEEN = 0.5
# Arrivals within this part of a period are the same.
_SAME = 0.6
# What was followed to may be a cycle off where a record's own packet is so many periods from it.
_A_CYCLE = (0.3, 1.2)
# A packet is on a series' line within this part of its time, and no more than twice; and the power
# of a wave's speed beside what is foreseen, mean and deviation: of a stress, and of anything else.
_OFF_LINE = 0.06
_POWER_LEFT, _ANY_POWER = (0.0, 0.1), (0.0, 0.4)
# Words of a parameter that makes waves faster as Hertz's contacts do, and the speed, m/s, up to
# which these are: waves in rock, or in water between grains, grow by no known power.
_LOOSE = 1000.0
_STRESSES = ("stress", "pressure", "sigma", "confin", "kpa", "load", "force")
UNLIKE = "it does not look like its neighbours in the series: look at the record"
ANOTHER = (
    "by itself it shows another direct wave than the series': was the distance, the wave, a sensor "
    "or its state another? --distance takes one for each record; else read it alone"
)
BEYOND = "its wave would arrive at the record's end, {:.3g} s, or after it: record longer"
UNLIKE_MOST = (
    "most records of the series show no wave of this one's, or it lies within their crosstalk: "
    "shield and ground both sides, or look whether they are of one set-up"
)
# A wave that this part of a series or more does not show is none, unless the others are in order;
# what does not stand out of noise is a wave where it correlates so well with its neighbours.
_MOST_LOST, _SURELY_ALIKE = 0.6, 0.8


def read_series(
    records: Sequence[TransmissionRecord],
    distance: float | Sequence[float],
    delays: Mapping[str, float],
    parameter: str,
    values: Sequence[float],
    wanted: Wanted = UNKNOWN,
) -> tuple[list[Reading], Series]:
    """Read records of one receiver in different states, following one arrival through all.

    Args:
        records: in any order.
        distance: from tip to tip, m; of each, where they differ.
        delays: of the system, by convention, s.
        parameter: name of what makes the states differ.
        values: of it, one for each record.
        wanted: which wave is meant; its speed is that of the record which shows it best.

    Returns:
        (readings in the order given, the series).

    Raises:
        PulseError: there are no records, or not a value and a distance for each.
    """
    p, count = np.asarray(values, float), len(records)
    if not count or len(p) != count or np.size(distance) not in (1, count):
        raise PulseError(
            f"records: {count}, with {len(p)} values and {np.size(distance)} distances; give at "
            "least one record, a value for each, and one distance or one each"
        )
    check_distance(distance)
    L = np.broadcast_to(np.asarray(distance, float), p.shape)
    cleared = without_common(records)
    if cleared is not None:
        answer = _read_own(cleared, L, delays, parameter, p, wanted)
        times = np.array([one.best.time for one in answer[0] if one.best.valid])
        if len(times) > 1 and np.ptp(times) > MOVES * np.median([one.period for one in cleared]):
            return answer
    return _read_own(records, L, delays, parameter, p, wanted)


def _read_own(
    records: Sequence[TransmissionRecord],
    L: Float,
    delays: Mapping[str, float],
    parameter: str,
    p: Float,
    wanted: Wanted,
) -> tuple[list[Reading], Series]:
    """The same of records whose crosstalk is known as well as it can be; those that turn out to be
    of another set-up are refused, and the others read again without them, which they had led."""
    readings, series, another = _read(records, L, delays, parameter, p, wanted)
    own = np.flatnonzero(~another)
    if another.any() and len(own) >= FEWEST:
        rest = [records[i] for i in own.tolist()]
        again, found = _read_own(rest, L[own], delays, parameter, p[own], wanted)
        for i, one in zip(own.tolist(), again, strict=True):
            readings[i] = one
        series = replace(series, law=found.law)
    return readings, series


def _read(
    records: Sequence[TransmissionRecord],
    L: Float,
    delays: Mapping[str, float],
    parameter: str,
    p: Float,
    wanted: Wanted,
) -> tuple[list[Reading], Series, NDArray[np.bool_]]:
    """What the records say together, and which of them are of another set-up."""
    count = len(records)
    order = np.argsort(p, kind="stable").tolist()
    heard = [[] if one.covered else packets(one) for one in records]
    heard = without_still(heard, records, order)
    delay = delays.get(OF_ONE, 0.0)
    largest = [max(own, key=lambda q: q.size).top for own in heard if own]
    loose = bool(largest) and float(L.mean() / np.median(largest)) < _LOOSE
    stress = bool((p > 0).all()) and any(w in parameter.lower() for w in _STRESSES)
    grows = loose and stress
    foreseen = np.log(L) - (STRESS_POWER * np.log(p) if grows else 0.0)
    own, waves = _direct_of_each(records, heard, p, foreseen, grows, delay, L, wanted)
    leaders = clearest(records, heard, own)
    if not leaders:
        none = [unheard(one, float(d)) for one, d in zip(records, L, strict=True)]
        return none, Series(parameter, p, None), np.zeros(count, bool)
    begun = np.full(count, np.nan)
    for i, k in enumerate(own):
        if k is not None:
            breaks = run_into(heard[i][k], records[i], heard[i], float(L[i]), delay, wanted)
            begun[i] = breaks[0] - delay
    on_line = waves[0].y if waves else foreseen
    found = follow_clearest(records, order, leaders, delay, on_line, begun, bool(waves))
    rivals = _rivals(records, heard, waves, found, delay, wanted)
    each = _followed(records, found, begun, delays, order)
    period = np.array([one.period for one in records])
    likely = [likelihoods(one, delay, wanted.wave) for one in heard]
    other = of_another_set_up(found, heard, likely, delay, period)
    ended = waves[0].ended if waves else np.zeros(count, bool)
    each = [
        replace(one, reason=_at_end(r, math.inf, 0.0) if over
                else (_at_end(r, one.begins, 1.0) or ANOTHER) if no else one.reason)
        for r, one, no, over in zip(records, each, other, ended, strict=True)
    ]  # fmt: skip
    other |= ended
    parts = [left_open(*own, delays) for own in zip(records, heard, each, strict=True)]
    # What a set-up leaves open it leaves open in most of its records, as many periods of each.
    open_ = np.array([[part for part, _ in own] for own in parts]) / period[:, None]
    usual = np.median(open_, axis=0) * period[:, None]
    as_well = float(np.median([
        beside(one, packet, at, float(d), delay, wanted)
        for one, packet, at, d in zip(records, heard, each, L, strict=True)
    ]))  # fmt: skip
    readings = [
        settled(
            one,
            packet,
            at,
            [(o, note) for o, (_, note) in zip(own, part, strict=True)],
            float(d),
            delays,
            [t + delay for t in others] + ([at.begins + as_well * one.period] if as_well else []),
            wanted,
        )
        for one, packet, at, own, part, d, others in zip(
            records, heard, each, np.nan_to_num(usual).tolist(), parts, L, rivals, strict=True
        )
    ]
    if stress:
        readings, off = of_one_law(readings, parameter, p)
        other = other | off
    slowness = [t / d for t, d in zip(_times(records, heard, delay), L, strict=True)]
    readings, two = without_two_waves(readings, slowness, likely, parameter, p)
    return readings, Series(parameter, p, law_of(readings, p)), other | two


def _direct_of_each(
    records: Sequence[TransmissionRecord],
    heard: Sequence[list[Packet]],
    p: Float,
    foreseen: Float,
    grows: bool,
    delay: float,
    distance: Float,
    wanted: Wanted,
) -> tuple[list[int | None], list[Line]]:
    """Which packet of each record is the direct one, and the waves that are seen in the series."""
    likely = [likelihoods(own, delay, wanted.wave) for own in heard]
    times = _times(records, heard, delay)
    away = np.array([
        max(_OFF_LINE, _SAME * r.period / float(np.median(t))) if len(t) else _OFF_LINE
        for r, t in zip(records, times, strict=True)
    ])  # fmt: skip
    waves = lines(times, likely, p, foreseen, np.minimum(away, 2 * _OFF_LINE),
                  _POWER_LEFT if grows else _ANY_POWER,
                  [np.array([q.size for q in own]) for own in heard],
                  np.array([hidden_by_noise(one) for one in records]),
                  np.array([one.t[-1] - one.start - one.period - delay for one in records])
                  )  # fmt: skip
    if not waves:
        alone = [int(np.argmax(one)) if len(one) else None for one in likely]
        return alone, []
    if wanted.speed > 0:

        def off(one: Line) -> float:
            return float(np.min(np.abs(np.log(distance / wanted.speed) - one.y)))

        waves = [min(waves, key=off)]
    seen: list[int | None] = [k if k >= 0 else None for k in waves[0].packet.tolist()]
    # Where another wave runs into it, its break is another's; unless it does so in all.
    alone = [
        None if k is None or hides_two(packet[k], one) or begun_before(packet[k], one) else k
        for one, packet, k in zip(records, heard, seen, strict=True)
    ]
    return (seen if all(k is None for k in alone) else alone), waves


def _times(
    records: Sequence[TransmissionRecord], heard: Sequence[list[Packet]], delay: float
) -> list[Float]:
    """When packets of each record arrive by their tops, which are surer than breaks, as a smaller
    wave ahead may draw those to itself; by the break where the record does not reach the top; s."""
    return [
        np.array([
            max((q.top - one.period / 2 if q.whole else q.begins) - delay, 1e-12) for q in packet
        ])
        for one, packet in zip(records, heard, strict=True)
    ]  # fmt: skip


def _rivals(
    records: Sequence[TransmissionRecord],
    heard: Sequence[list[Packet]],
    waves: Sequence[Line],
    found: Followed,
    delay: float,
    wanted: Wanted,
) -> list[list[float]]:
    """When other waves arrive at each record that may be the direct one as well, s."""
    as_well = [one for one in waves[1:] if one.likely**TELLING >= RIVAL]
    result: list[list[float]] = []
    for i, (record, own, time) in enumerate(zip(records, heard, found.time, strict=True)):
        times = []
        for one in as_well:
            first, other = int(waves[0].packet[i]), int(one.packet[i])
            if first >= 0 and other >= 0:
                times.append(time + own[other].top - own[first].top)
            else:
                times.append(time * float(np.exp(one.y[i] - waves[0].y[i])))
        if not waves:
            likely = likelihoods(own, delay, wanted.wave)
            times = [q.begins - delay for q, w in zip(own, likely, strict=True) if w >= RIVAL]
        result.append([t for t in times if abs(t - time) > _SAME * record.period and t > 0])
    return result


def _followed(
    records: Sequence[TransmissionRecord],
    found: Followed,
    begun: Float,
    delays: Mapping[str, float],
    order: Sequence[int],
) -> list[Arrived]:
    """Followed arrivals, which jump no cycle, with what the records' own first breaks are off, and
    their own packets (begun, less the delay, s), where these are about a cycle from them."""
    delay, time = delays.get(OF_ONE, 0.0), found.time
    alone = [arrived(one, t + delay, delays) for one, t in zip(records, time, strict=True)]
    period = np.array([one.period for one in records])
    off = np.abs(np.array([one.begins - delay for one in alone]) - time)
    near = off < _SAME * period
    scatter = 1.4826 * float(np.median(off[near])) if near.any() else 0.0
    own = np.abs(begun - time) / period
    cycle = np.where((own > _A_CYCLE[0]) & (own < _A_CYCLE[1]), own * period, 0.0)
    noise = np.hypot(np.hypot(np.nan_to_num(found.error), scatter), REACHED * cycle)
    share = _open_in_periods(alone, time, period)
    unlike = ~(found.correlation >= LEAST_CORRELATION) & (len(alone) > 1)
    hidden = [in_crosstalk(one, t + delay) for one, t in zip(records, time, strict=True)]
    alike = found.correlation >= _SURELY_ALIKE
    noise_alone = ~alike & [in_noise(one, t + delay) for one, t in zip(records, time, strict=True)]
    lost = (unlike | hidden) & ~noise_alone
    moves = in_order(time[order][~(lost | noise_alone)[order]], float(np.median(period)))
    share_lost = float(np.sum(lost)) / max(1, int(np.sum(~noise_alone)))
    none = UNLIKE_MOST * (share_lost > _MOST_LOST and not moves)
    ends = [_at_end(one, t + delay, _SEEN) for one, t in zip(records, time, strict=True)]
    return [
        Arrived(
            FOLLOWED, time[i] + delay, noise[i], share * period[i], one.second, one.times,
            ends[i] or (NOTHING if noise_alone[i] else UNLIKE if unlike[i] else none),
        )
        for i, one in enumerate(alone)
    ]  # fmt: skip


def _at_end(record: TransmissionRecord, begins: float, seen: float) -> str:
    """Why a wave that breaks at a time after the start is not seen, less than so many periods
    before the record's end; "" of others."""
    last = float(record.t[-1]) - record.start
    return BEYOND.format(last) if begins > last - seen * record.period else ""


def _open_in_periods(alone: Sequence[Arrived], time: Float, period: Float) -> float:
    """What conventions leave open in the whole series, as one standard error, in periods.

    A single record's convention may have read something else; in the median over all it has not.
    """
    apart = {}
    for name in alone[0].times:
        own = [one.times[name] for one in alone]
        off = (np.array([one.time for one in own]) - time) / period
        if np.isfinite(off).sum() >= max(1, len(alone) // 2):
            apart[name] = TravelTime(float(np.nanmedian(off)), 0.0)
        else:
            apart[name] = TravelTime(np.nan, np.nan, next(a.reason for a in own if a.reason))
    return open_between(apart, 0.0, 1.0)
