"""A pulse test with several receivers, whichever end the wave comes from, and what would make one
velocity of a line where conventions agree on none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from wavesim.readings.pulse import faults
from wavesim.readings.pulse.array_reading import read_array
from wavesim.readings.pulse.reading import Reading
from wavesim.readings.pulse.signals import PulseError
from wavesim.readings.pulse.velocity import BACKWARDS

OPPOSED = (
    "{} correlates better with {} when turned over: is its polarity reversed, or does the wave "
    "disperse so far?"
)
WITHOUT = (
    "with {0} the receivers hear no one wave, without it one of {1:.4g} ± {2:.2g} m/s: leave it "
    "out; does the source stand between it and the others, or is it misplaced?"
)
TURNED = "the wave runs towards smaller positions: distances are counted from the largest"
# Of so many receivers phases tell which is turned over.
_TOLD_BY_PHASES = 4


def read_either_way(
    name: str,
    t: ArrayLike,
    signals: Mapping[str, ArrayLike],
    positions: Mapping[str, float],
    *more: Any,
) -> Reading:
    """:func:`read_array`, whichever end of the receivers' line the wave comes from."""
    reading = read_array(name, t, signals, positions, *more)
    if reading.best.reason != BACKWARDS:
        return _told_why(reading, t, signals, positions, more)
    ends = min(positions.values()) + max(positions.values())
    turned = {key: ends - x for key, x in positions.items()}
    other = read_array(name, t, signals, turned, *more)
    if not other.best.valid:
        return _told_why(reading, t, signals, positions, more)
    receivers = tuple(replace(one, position=ends - one.position) for one in other.receivers)
    return replace(other, receivers=receivers, notes=(TURNED, *other.notes))


def _told_why(
    reading: Reading,
    t: ArrayLike,
    signals: Mapping[str, ArrayLike],
    positions: Mapping[str, float],
    more: Sequence[Any],
) -> Reading:
    """A reading with what its receivers show beside one wave: some turned over, or, where no
    velocity is known, one at an end that is of no wave with the others."""
    best, result = reading.best, reading.result
    if result is None:
        return reading
    names, m = result.record.names, len(result.record.names)
    turned = faults.opposed(result.record.values) if m < _TOLD_BY_PHASES else []
    told = OPPOSED.format(", ".join(names[j] for j in turned), names[0])
    if turned and best.valid:
        return replace(reading, notes=(told, *reading.notes))
    if turned:
        return replace(reading, best=replace(best, reason=told))
    ends = ((names[0], names[1:]), (names[-1], names[:-1])) if m > 3 else ()
    for odd, rest in () if best.valid or "several waves" in best.reason else ends:
        own, x = {key: signals[key] for key in rest}, {key: positions[key] for key in rest}
        with suppress(PulseError):
            alone = read_array(reading.file, t, own, x, *more).best
            if alone.valid:
                said = WITHOUT.format(odd, alone.velocity, alone.velocity_error)
                return replace(reading, best=replace(best, reason=said))
    return reading
