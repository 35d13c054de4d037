"""Every other receiver of a line late, as of two cards or multiplexers whose channels take turns.

A wave passes from one receiver to the next in s_j Δx_j + (−1)^j τ, with a slowness s that changes
little along the line. Three lags in turn tell τ,

    (−1)^j [s_j − (s_{j−1} + s_{j+1})/2] = τ [1/Δx_j + (1/Δx_{j−1} + 1/Δx_{j+1})/2],

and all such threes tell the same one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.faults.finding import places
from wavesim.records.faults.polarity import packets
from wavesim.records.faults.quiet import Rest

Float = NDArray[Any]

# All of so many threes tell τ to this part of it, and it is so many times what noise makes of a
# lag, and more than this part of an interval, which the tops of packets are known to.
_THREES, _ALIKE, _ERRORS, _OF_INTERVAL = 3, 0.25, 6.0, 0.1


def check_none_late_in_turn(
    component: Float, t: Float, x: Float, labels: tuple[str, ...], rest: Rest
) -> None:
    """Refuse a line of which every other receiver is late.

    Args:
        component: u, shape (nt, nx), finite, without offset.
        t, x: times, s, and places, ascending, m.
        labels: names of the receivers.
        rest: of the channels.

    Raises:
        RecordError: every other one is, with how late.
    """
    gaps = np.diff(x)
    if len(gaps) < _THREES + 2 or not gaps.all() or (tops := packets(component)) is None:
        return
    interval = float(t[1] - t[0])
    turn = (-1.0) ** np.arange(len(gaps))
    slowness = tops[0] * interval / gaps
    told = turn * (slowness - np.convolve(np.pad(slowness, 1), [0.5, 0, 0.5], "valid"))
    told /= 1 / gaps + np.convolve(np.pad(1 / gaps, 1), [0.5, 0, 0.5], "valid")
    told = told[1:-1]
    late = float(np.median(told))
    # Cramér's and Rao's bound for the lag of two receivers.
    rate = np.sqrt(np.sum(np.gradient(component, interval, axis=0) ** 2, axis=0))
    error = float(np.median(np.nan_to_num(rest.noise) / np.maximum(rate, 1e-290))) * np.sqrt(2)
    alike = np.abs(told - late) < _ALIKE * abs(late)
    if not alike.all() or abs(late) < max(_ERRORS * error, _OF_INTERVAL * interval):
        return
    which = places(x, np.arange(len(x)) % 2 == int(late > 0), labels)
    raise RecordError(
        f"every other receiver ({which}) is {abs(late):.3g} s late by those beside it, as of two "
        "cards or a multiplexer: give each channel its own clock, right by that much, or every "
        "other receiver alone"
    )
