"""What a transmitter sent: when, for how long, at what frequency."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.signals import PulseError
from wavesim.records.faults.quantisation import quanta
from wavesim.records.faults.quiet import fine_noise

Float = NDArray[Any]

NOTHING_SENT = (
    "the transmitter's signal is constant, or noise alone: is --input its column? a step must be "
    "sent after the record begins"
)
# What is sent begins where it has this part of its peak.
_SENT = 0.03
# It is over where it has less than this part for as long as it lasted.
_BACK = 0.15
# White noise seldom reaches so many deviations in a record.
_LOUDEST = 5.0
# What varies by less than this many deviations of its noise, or of its least step, is constant.
_NOISE = 12.0


def what_was_sent(t: Float, v: Float) -> tuple[float, float, Float]:
    """Start and length of what is sent, s, and it without its base.

    Args:
        t: times, even, shape (nt,), s.
        v: the transmitter's signal, shape (nt,), any unit.

    Raises:
        PulseError: nothing is sent.
    """
    level, noise = abs(float(np.median(v))), max(fine_noise(v), float(quanta(v[None, :, None])[0]))
    v = v - _before_sent(t, v)
    peak = float(np.abs(v).max())
    if not peak > 0 or np.ptp(v) < min(_SENT * level, _NOISE * noise):
        raise PulseError(NOTHING_SENT)
    # Noise of the input's own channel is not sent; what is sent is mostly short, or smooth.
    usual = 1.4826 * float(np.median(np.abs(v - np.median(v))))
    least = max(_SENT * peak, _LOUDEST * min(fine_noise(v), usual))
    above = np.flatnonzero(np.abs(v) >= least)
    if not len(above):
        raise PulseError(NOTHING_SENT)
    first, last = int(above[0]), int(above[-1])
    loud = np.flatnonzero(np.abs(v) >= _BACK * peak)
    apart = np.flatnonzero(np.diff(loud) > loud[:-1] - loud[0] + 4)
    if last > 0.8 * len(v) and len(apart) and not is_step(v):
        # A gauge on a bar hears what was sent come back: that is not sent again.
        last = int(loud[apart[0]])
        v = np.where(np.arange(len(v)) <= last, v, 0.0)
    elif last > 0.8 * len(v):
        # A step stays: what it sends, it sends as it rises.
        level = float(np.median(v[-max(4, len(v) // 50) :]))
        moving = np.flatnonzero(np.abs(v - level) >= 0.1 * peak)
        last = min(int(moving[-1]) + 1, len(v) - 1)  # a run may end while it is sent
    # The start lies before the first sample above the part, by how fast it rises there.
    rise = abs(v[min(first + 1, len(v) - 1)] - v[first])
    back = min(abs(v[first]) / rise, 1.0) if rise > 0 else 0.0
    if least > _SENT * peak and first > 0:
        # … or, where noise hides so small a part, from there to twice as much.
        twice = max(int(np.argmax(np.abs(v) >= min(2 * least, 0.9 * peak))), first)
        once, other = (
            at - (abs(v[at]) - level) / max(abs(v[at]) - abs(v[at - 1]), 1e-300)
            for at, level in ((first, least), (twice, min(2 * least, 0.9 * peak)))
        )
        back = first - once + other - once
        v = np.where((np.arange(len(v)) >= first - back) & (np.arange(len(v)) <= last), v, 0.0)
    step = float(t[1] - t[0])
    return float(t[first]) - back * step, max(float(t[last] - t[first]), step), v


def _before_sent(t: Float, v: Float) -> float:
    """Level of the transmitter before it sends.

    A record that begins no sooner may show none: what a pulse returns to, and what a step leaves,
    is the one of its first and last levels that is nearer to 0.
    """
    part, early = max(4, len(v) // 50), t < -0.5 * (t[1] - t[0])
    if early.any():
        return float(np.median(v[early][:part]))
    first, last = v[:part], float(np.median(v[-part:]))
    level, much = float(np.median(first)), 0.1 * float(np.ptp(v))
    if np.ptp(first) >= _SENT * np.ptp(v):
        return float(v[0]) if abs(v[0]) < abs(last) - much else last
    return level if abs(level) <= abs(last) + much else last


def sent_period(sent: Float | None, interval: float) -> float:
    """1/f of the mean of the power sent; 0 where none was recorded, or it does not end."""
    if sent is None or is_step(sent):
        return 0.0
    power = np.abs(np.fft.rfft(sent)) ** 2
    f = np.fft.rfftfreq(len(sent), interval)
    return max(float(power.sum() / np.sum(f * power)), 4 * interval)


def is_step(sent: Float) -> bool:
    """Whether what is sent stays."""
    return abs(float(sent[-1])) > 0.5 * float(np.abs(sent).max())
