"""One arrival followed through a series of records of the same set-up in different states.

Picks that are made record by record jump: to another cycle, to a later wave, to crosstalk. Waves
of neighbouring states differ by a stretch of time, t → r t, all packets alike. So the record that
shows its direct wave best is picked, and every other follows from those next to it by the r at
which the stretch from 0.9 to 1.7 of the arrival correlates best,

    C(r) = Σ u_i(τ) u_j(rτ) / √(Σ u_i²(τ) Σ u_j²(rτ)),

less a mild prior, (ln r − ln r₀)²/2s², and a little more where the record by itself shows its
direct wave. Pairs of records one, two and three apart then vote on all
times at once, by the shift that lays the packet of one on that of the other best, in least squares:
VanDecar & Crosson, Bull. Seismol. Soc. Am. 80, 150 (1990).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.first_break import envelope
from wavesim.readings.pulse.power_law import FEWEST
from wavesim.readings.pulse.sent_signal import sent_period
from wavesim.readings.pulse.transmission_record import HEARD, TransmissionRecord
from wavesim.readings.pulse.travel_time import top_of
from wavesim.readings.pulse.wave_packets import LEAST_P_OVER_S, RIVAL, Packet, breaks_about

Float = NDArray[Any]

# The stretch of time that is compared, in multiples of the arrival.
_FROM, _TO = 0.9, 1.7
# Stretches that are tried between neighbours, and the prior's width, in ln r.
_MOST = 0.5
_PRIOR = (0.25, 0.06)
# Its weight beside a correlation.
_TRUST = 0.15
# What is sent is a burst from this many periods on.
_BURST = 1.6
# Frequencies sent are two where their logarithms are so far apart.
_OTHER_FREQUENCY = 0.05
# The weight of the direct wave that a record shows by itself, and how near it counts, in periods;
# farther apart than the last two waves are no longer the same.
_ALONE, _NEAR, _APART = 0.2, 0.25, 0.6
# Arrivals that differ by so many periods are of two waves.
_ANOTHER = 0.4
# The packet about its break, in periods.
_PACKET = (-0.5, 1.5)
# Neighbours up to so far apart vote.
_REACH = 3
# A packet that correlates better by so much the other way round, within so many periods of where
# it was followed to, was connected so.
_TURNED, _ABOUT = 0.05, 0.9
# Correlations from here on count.
LEAST_CORRELATION = 0.4
# A record is of another set-up where what was followed is no likely direct wave of its own, as in
# most records of the series it is; it then correlates less with its neighbours, by so much.
_LIKELY, _LESS = 0.5, 0.05
# … or not at all, where no more than this part of the records show the wave as less than likely,
# and a wave so many times as loud, which is no part of it, is the likely one.
_FEW_OFF, _LOUDER = 0.2, 2.0
# A wave moves through a series by so many periods at least, where crosstalk does not.
MOVES = 1.5
# Speed grows as this power of a stress in grains: Hertz's contact gives 1/6 to 1/4 and more.
STRESS_POWER = 0.27


@dataclass(frozen=True)
class Followed:
    """Arrival of one wave through a series.

    Attributes:
        time: of the arrival after the start, less the delay, shape (n,), s.
        error: how far the pairs' votes are apart, shape (n,), s.
        correlation: of each record with its neighbours at the stretch found, shape (n,).
    """

    time: Float
    error: Float
    correlation: Float


def clearest(
    records: Sequence[TransmissionRecord], heard: Sequence[list[Packet]], own: Sequence[int | None]
) -> list[int]:
    """Records that show a direct wave, that first whose stands out most from its noise.

    Args:
        records, heard: and their packets.
        own: which of them is the direct wave.
    """
    clear = {}
    for i, (one, found) in enumerate(zip(records, heard, strict=True)):
        if own[i] is None:
            continue
        level = max(float(np.nan_to_num(one.noise_in_band)), 1e-3 * float(np.abs(one.got).max()))
        # The earlier it comes after its start, in periods, the less of it is lost on its way, and
        # the smaller are the near field and faster waves beside it.
        largest = max(found, key=lambda packet: packet.size)
        clear[i] = float(np.abs(one.got).max()) / level
        clear[i] *= (one.period / max(largest.begins, one.period)) ** 2
    return sorted(clear, key=lambda i: -clear[i])


def follow_clearest(
    records: Sequence[TransmissionRecord],
    order: Sequence[int],
    leaders: Sequence[int],
    delay: float,
    foreseen: Float,
    alone: Float,
    sure: bool,
) -> Followed:
    """Follow the arrival of the clearest record, or of the next where that follows another and the
    one after it bears it out: the clearest may be of another set-up.

    Args:
        leaders: indices of records, the clearest first; others as of :func:`follow`.
    """

    def led_by(i: int) -> Followed:
        return follow(records, order, i, float(alone[i]), delay, foreseen, alone, sure)

    def apart(one: Followed, other: Followed) -> float:
        return float(np.median(np.abs(one.time - other.time) / period))

    period = np.array([one.period for one in records])
    first, *others = [led_by(i) for i in leaders[:2]]
    if not others or len(leaders) < 3 or apart(first, others[0]) < _ANOTHER:
        return first
    third = led_by(leaders[2])
    borne_out = apart(others[0], third) < _ANOTHER
    return others[0] if borne_out else first


def follow(
    records: Sequence[TransmissionRecord],
    order: Sequence[int],
    reference: int,
    arrival: float,
    delay: float,
    foreseen: Float,
    alone: Float,
    sure: bool = False,
) -> Followed:
    """Follow an arrival.

    Args:
        records: the series.
        order: their indices, neighbours in state next to each other.
        reference: index of the record that was picked.
        arrival: there, after the start and less the delay, s.
        delay: of the system, s.
        foreseen: ln of the times that are foreseen, up to a constant, shape (n,); 0 for none.
        alone: when the direct wave of each record begins by itself, shape (n,), after the start and
            less the delay, s; NaN where none is seen.
        sure: whether the times foreseen are those of packets on one line.

    Returns:
        The arrivals.
    """
    n = len(records)
    place = {index: k for k, index in enumerate(order)}
    log_time = np.full(n, np.nan)
    log_time[reference] = np.log(arrival)
    signals = [_Signal(one, delay) for one in records]
    start = place[reference]
    away = sorted(range(n), key=lambda k: (abs(k - start), k))
    for k in away[1:]:
        index = order[k]
        side = 1 if k > start else -1
        near = [order[k - side * d] for d in range(1, _REACH + 1) if 0 <= k - side * d < n]
        near = [i for i in near if np.isfinite(log_time[i])][:2]
        lags = np.arange(-_MOST, _MOST + 1e-9, 0.004)
        total = np.zeros(len(lags))
        for i in near:
            # Stretches are counted from the nearest neighbour's time.
            shift = log_time[near[0]] - log_time[i]
            C = signals[i].correlations(signals[index], np.exp(log_time[i]), lags + shift)
            total += C / len(near)
        expected = foreseen[index] - foreseen[near[0]]
        other = -_TRUST * (lags - expected) ** 2 / (2 * _PRIOR[sure] ** 2)
        off = np.exp(log_time[near[0]] + lags) - alone[index]
        other += _ALONE * np.nan_to_num(np.exp(-((off / _NEAR / records[index].period) ** 2) / 2))
        log_time[index] = log_time[near[0]] + lags[int(np.argmax(total + other))]
    return _voted(signals, order, reference, np.exp(log_time))


def in_noise(record: TransmissionRecord, begins: float) -> bool:
    """Whether the packet that breaks at a time after the start is no louder than noise may be."""
    after = record.t - record.start - begins
    packet = (after > _PACKET[0] * record.period) & (after < _PACKET[1] * record.period)
    loudest = float(envelope(record.got)[packet].max(initial=0.0))
    return loudest < HEARD * record.noise_in_band


def in_order(time: Float, period: float) -> bool:
    """Whether times of records in their order are those of a wave that moves, as crosstalk and
    chance do not."""
    steps = np.diff(time)
    return len(time) >= FEWEST and bool(
        (np.all(steps < 0) or np.all(steps > 0)) and np.ptp(time) > MOVES * period
    )


def of_another_set_up(
    found: Followed,
    heard: Sequence[list[Packet]],
    likely: Sequence[Float],
    delay: float,
    period: Float,
) -> NDArray[np.bool_]:
    """Records of another distance, wave or sensor, which have no part in a series, shape (n,).

    Each shows a direct wave by itself, and what was followed through the series is none such there.

    Args:
        found: the arrivals.
        heard, likely: packets of each record, and how likely each is the direct wave.
        delay: of the system, s.
        period: of each record's central frequency, shape (n,), s.
    """
    own, louder = np.full(len(heard), np.nan), np.zeros(len(heard), bool)
    for i, (packets, weights) in enumerate(zip(heard, likely, strict=True)):
        begins, T = float(found.time[i]) + delay, float(period[i])
        there = [abs(one.begins - begins) < _APART * T or breaks_about(one, begins, T)
                 for one in packets]  # fmt: skip
        if packets:
            own[i] = np.max(weights, initial=0.0, where=np.array(there))
            first = packets[int(np.argmax(weights))]
            size = max(
                (one.size for one, yes in zip(packets, there, strict=True) if yes), default=1
            )
            away = abs(np.log(max(first.begins - delay, 1e-12) / found.time[i]))
            louder[i] = first.size > _LOUDER * size and away > np.log(LEAST_P_OVER_S)
    shown = own[np.isfinite(own)]
    if not len(shown) or np.median(shown) <= _LIKELY:
        return np.zeros(len(heard), bool)
    odd = (own < RIVAL) & (found.correlation < np.median(found.correlation) - _LESS)
    if np.sum(shown < _LIKELY) <= _FEW_OFF * len(shown):
        # What was followed may be a copy of the wave that went another way, and correlate as well:
        # where the others show it as the direct one, that a louder wave is that here says enough.
        odd |= (own < RIVAL) & louder
    return odd


class _Signal:
    """A record against the time after its start, less the delay."""

    def __init__(self, one: TransmissionRecord, delay: float) -> None:
        self.tau = one.t - one.start - delay
        self.u = one.got / (float(np.abs(one.got).max()) or 1.0)
        self.period = one.period
        self.sent_period = sent_period(one.sent, one.interval) or 1.0
        self.burst = one.length > _BURST * one.period
        self.envelope = envelope(self.u)

    def at(self, tau: Float) -> Float:
        return np.interp(tau, self.tau, self.u, left=0.0, right=0.0)

    def outline_at(self, tau: Float, whole: bool) -> Float:
        """What a stretch is judged by: the signal, or its envelope about its mean."""
        if not whole:
            return self.at(tau)
        outline = np.interp(tau, self.tau, self.envelope, left=0.0, right=0.0)
        return np.asarray(outline - outline.mean(axis=-1, keepdims=True))

    def correlations(self, other: _Signal, time: float, log_ratios: Float) -> Float:
        """C(r) with another one, for an arrival at ``time`` here; shape of log_ratios."""
        step = min(self.period, other.period) / 16
        tau = np.arange(_FROM * time, max(_TO * time, _FROM * time + 2 * self.period), step)
        # Cycles of a burst keep their length, and those of what was sent at another frequency have
        # their own: only the envelope moves as a stretch does.
        apart = abs(np.log(other.sent_period / self.sent_period)) > _OTHER_FREQUENCY
        whole = self.burst or other.burst or apart
        own = self.outline_at(tau, whole)
        there = other.outline_at(np.exp(log_ratios)[:, None] * tau, whole)
        size = np.sqrt(np.sum(own**2) * np.sum(there**2, axis=1))
        # A stretch that reaches into silence correlates with noise alone.
        least = 0.1 * np.sqrt(np.sum(own**2) * len(tau)) * float(np.sqrt(np.mean(other.u**2)))
        C = np.asarray(there @ own / np.maximum(size, max(least, 1e-30)))
        # Of either polarity; outlines have none.
        return C if whole else np.abs(C)

    def shifted(self, other: _Signal, time: float, times: Float, period: float) -> Float:
        """Correlation of the packet at ``time`` here with those at some times there, each as long
        as what was sent."""
        s = np.arange(_PACKET[0] * period, _PACKET[1] * period, period / 24)
        as_long = other.period / self.period
        own, there = self.at(time + s), other.at(times[:, None] + as_long * s)
        size = np.sqrt(np.sum(own**2) * np.sum(there**2, axis=1))
        least = 0.1 * np.sqrt(np.sum(own**2) * len(s) * float(np.mean(other.u**2)))
        return np.asarray(there @ own / np.maximum(size, max(float(least), 1e-30)))


def _voted(
    signals: Sequence[_Signal], order: Sequence[int], reference: int, rough: Float
) -> Followed:
    """Times at which the packets of all pairs lie on each other best, and what is left over.

    A packet is as long as what was sent, so here it is shifted, and stretched about itself alone.
    """
    n = len(signals)
    rows, values, weights, pairs = [], [], [], []
    best = np.zeros(n)
    for a in range(n):
        for b in range(a + 1, min(a + _REACH + 1, n)):
            i, j = order[a], order[b]
            period = max(signals[i].period, signals[j].period)
            lags = np.linspace(-1.3, 1.3, 209) * period
            C = signals[i].shifted(signals[j], rough[i], rough[j] + lags, period)
            near = np.abs(lags) <= 0.5 * period
            about = C[np.abs(lags) <= _ABOUT * period]
            if -about.min() > about.max() + _TURNED:
                C = -C
            top = int(np.argmax(np.where(near, C, -2.0)))
            if not C[top] >= LEAST_CORRELATION:
                continue
            row = np.zeros(n)
            as_long = signals[j].period / signals[i].period
            row[j], row[i] = 1.0, -as_long
            rows.append(row)
            at = lags[0] + top_of(C, top) * (lags[1] - lags[0])
            values.append(rough[j] - as_long * rough[i] + at)
            weights.append(float(C[top]) ** 2 / (b - a))
            pairs.append((i, j, as_long))
            if b == a + 1:
                best[i], best[j] = max(best[i], C[top]), max(best[j], C[top])
    hold = np.zeros(n)
    hold[reference] = 1.0
    # What no pair tells stays where it was followed to.
    A = np.array([hold, *rows, *(1e-3 * np.eye(n))])
    y = np.array([rough[reference], *values, *(1e-3 * rough)])
    w = np.sqrt(np.array([1e3, *weights, *np.ones(n)]))
    time = np.linalg.lstsq(A * w[:, None], y * w, rcond=None)[0]
    off: list[list[float]] = [[] for _ in range(n)]
    for (i, j, as_long), value in zip(pairs, values, strict=True):
        left = time[j] - as_long * time[i] - value
        off[i].append(left)
        off[j].append(left)
    spread = np.array([np.sqrt(np.mean(np.square(one))) if one else np.nan for one in off])
    return Followed(time, spread, best)
