"""A time gate that keeps the direct wave at several receivers and leaves out the first echo.

After the direct wave each receiver is quiet for a while, until an echo comes: the gate closes in
the quiet of all of them, at one time, or where there is none such, as late after the direct wave.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.first_break import envelope
from wavesim.readings.pulse.signals import PulseRecord
from wavesim.readings.pulse.spectral_windows import Gate, whole_record
from wavesim.readings.pulse.velocity import weighted_line
from wavesim.records.windows import moving_mean

Float = NDArray[Any]

# The direct wave is over below this part of its peak, and an echo is one from that part on; or
# these many deviations of the noise, whose envelope has a mean of 1.25.
_QUIET, _ECHO = 0.02, 0.04
_OVER_NOISE, _ABOVE_NOISE = 2.2, 3.0
# The direct wave's top is the first that has this part of the largest.
_FIRST = 0.5
# The longest flank, over the gate.
_TAPER = 0.15

OVERLAP = (
    "an echo, or a wave of another speed, comes before the direct wave has passed, and errors of "
    "what spectra tell hold it: place receivers further from the far end, or take a longer specimen"
)


def echo_gate(record: PulseRecord) -> tuple[Gate | None, str]:
    """A gate that ends before the first echo.

    Args:
        record: the signals.

    Returns:
        (gate, ""); (None, "") where no echo is seen; (a gate with echoes in it, why) where none
        ends before them.
    """
    t = record.t
    places, tops, ends, echoes, within = [], [], [], [], np.full(len(record.x), math.inf)
    each = zip(record.x, record.values.T, record.noise, record.unusable, strict=True)
    for j, (x, u, noise, unusable) in enumerate(each):
        if unusable or not np.abs(u).max() > 0:
            continue
        size = moving_mean(envelope(u), max(3, _period(u) // 2))
        # Where nothing before the arrival tells the noise, the quietest tenth of the record does.
        least = noise if np.isfinite(noise) else float(np.percentile(size, 10)) / 1.25
        peak, s = float(size.max()), float(least)
        top = int(np.argmax(size >= _FIRST * peak))
        top += int(np.argmax(size[top : top + _period(u)]))
        peak = float(size[top])
        places.append(float(x - record.x[0]))
        tops.append(float(t[top]))
        echoes.append(math.inf)
        over = np.flatnonzero(size[top:] < max(_QUIET * peak, _OVER_NOISE * s))
        if not len(over):
            ends.append(float(t[-1]))
            continue
        end = top + int(over[0])
        ends.append(float(t[end]))
        again = np.flatnonzero(size[end:] > max(_ECHO * peak, _ABOVE_NOISE * s))
        if len(again):
            # An echo grows from below what tells it.
            rise = end + int(again[0])
            low = np.flatnonzero(size[end:rise] < max(_QUIET * peak, _OVER_NOISE * s))
            within[j] = echoes[-1] = float(t[end + int(low[-1]) if len(low) else rise])
    if not np.isfinite(echoes).any():
        return None, ""
    along, one = np.array(places), np.ones(len(places))
    slowness = float(weighted_line(along, np.array(tops), one)[0]) if len(places) > 1 else 0.0
    for delay in (0.0, slowness):
        over_all, first = np.max(ends - delay * along), float(np.min(echoes - delay * along))
        if over_all < first and delay >= 0:
            # It opens before the record at the last receiver too: the noise before the wave stays.
            start = float(t[0] - delay * along.max())
            flank = min(first - over_all, _TAPER * (first - start))
            velocity = 1 / delay if delay else math.inf
            return Gate(start - flank, first, flank / (first - start + flank), velocity), ""
    return whole_record(t, tuple(within.tolist())), OVERLAP


def _period(u: Float) -> int:
    """Samples in a period of the strongest frequency."""
    power = np.abs(np.fft.rfft(u))
    return int(np.clip(len(u) / max(int(np.argmax(power[1:])) + 1, 1), 4, len(u) // 4))


def common_period(record: PulseRecord) -> float:
    """Period of the strongest frequency that the receivers have in common, s."""
    return float(np.median([_period(u) for u in record.values.T])) * record.interval
