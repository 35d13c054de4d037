"""A time gate that keeps the direct wave at several receivers and leaves out the first echo.

After the direct wave each receiver is quiet for a while, until an echo comes: the gate closes in
the quiet of all of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.first_break import envelope
from wavesim.readings.pulse.signals import PulseRecord
from wavesim.readings.pulse.spectral_windows import Gate
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
    "an echo, or a wave of another speed, reaches a receiver before the direct wave has passed "
    "another: place receivers further from the far end, or take a longer specimen; until then "
    "spectra mix both"
)


def echo_gate(record: PulseRecord) -> tuple[Gate | None, str]:
    """A gate that ends before the first echo.

    Args:
        record: the signals.

    Returns:
        (gate, ""); (None, "") where no echo is seen; (None, why) where none can be told from the
        direct wave.
    """
    t, ends, echoes = record.t, [], []
    for u, noise, unusable in zip(record.values.T, record.noise, record.unusable, strict=True):
        if unusable or not np.abs(u).max() > 0:
            continue
        size = moving_mean(envelope(u), max(3, _period(u) // 2))
        # Where nothing before the arrival tells the noise, the quietest tenth of the record does.
        least = noise if np.isfinite(noise) else float(np.percentile(size, 10)) / 1.25
        peak, s = float(size.max()), float(least)
        top = int(np.argmax(size >= _FIRST * peak))
        top += int(np.argmax(size[top : top + _period(u)]))
        peak = float(size[top])
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
            echoes.append(float(t[end + int(low[-1])]) if len(low) else float(t[rise]))
    if not echoes:
        return None, ""
    over_all, first = max(ends), min(echoes)
    if not over_all < first:
        return None, OVERLAP
    start = float(t[0])
    flank = min(first - over_all, _TAPER * (first - start))
    return Gate(start - flank, first, flank / (first - start + flank)), ""


def _period(u: Float) -> int:
    """Samples in a period of the strongest frequency."""
    power = np.abs(np.fft.rfft(u))
    return int(np.clip(len(u) / max(int(np.argmax(power[1:])) + 1, 1), 4, len(u) // 4))


def common_period(record: PulseRecord) -> float:
    """Period of the strongest frequency that the receivers have in common, s."""
    return float(np.median([_period(u) for u in record.values.T])) * record.interval
