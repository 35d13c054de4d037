"""The law through a series of pulse tests, and which of their answers it excludes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.power_law import PowerLaw, off_the_law, power_law
from wavesim.readings.pulse.reading import Reading
from wavesim.readings.pulse.wave_packets import RIVAL

Float = NDArray[np.float64]

OFF = (
    "its velocity, {:.4g} m/s, is {:.0%} off the others' law, outside its error: was the distance, "
    "the wave, a sensor or its {} another? --distance takes one for each record; else read it alone"
)


TWO_WAVES = (
    "under the same {} {} shows a wave {:.1f} times as fast, and others too: are P and S waves, or "
    "two set-ups, in one series? read those of each by themselves"
)
# Waves under one state are two where one takes so many times the other's time, as waves P and S do,
# and records under so many states show it.
_AS_P_AND_S, _FEWEST_PAIRS = 1.25, 2


@dataclass(frozen=True)
class Series:
    """A series of readings.

    Attributes:
        parameter: its name.
        values: shape (n,).
        law: the power law; None where there is none.
    """

    parameter: str
    values: Float
    law: PowerLaw | None


def law_of(readings: Sequence[Reading], p: Float) -> PowerLaw | None:
    """The power law through the valid answers of readings at values p."""
    best = [one.best for one in readings]
    velocity = np.array([b.velocity if b.valid else np.nan for b in best])
    time = np.array([b.time for b in best])
    common = np.array([one.common for one in readings])
    total = np.array([b.error for b in best])
    with np.errstate(invalid="ignore", divide="ignore"):
        noise = np.sqrt(np.maximum(total**2 - common**2, 0)) / time
        return power_law(p, velocity, noise, common / time)


def of_one_law(
    readings: Sequence[Reading], parameter: str, p: Float
) -> tuple[list[Reading], NDArray[np.bool_]]:
    """The same, less the answers that a smooth law of the others excludes, and which these are."""
    best = [one.best for one in readings]
    velocity = np.array([b.velocity if b.valid else np.nan for b in best])
    off = off_the_law(p, velocity, np.array([b.velocity_error for b in best]))
    name = parameter.partition(" (")[0]
    kept = [
        replace(one, best=replace(b, valid=False, reason=OFF.format(b.velocity, away, name)))
        if away > 0 else one
        for one, b, away in zip(readings, best, off.tolist(), strict=True)
    ]  # fmt: skip
    return kept, off > 0


def without_two_waves(
    readings: Sequence[Reading],
    slowness: Sequence[Float],
    likely: Sequence[Float],
    parameter: str,
    p: Float,
) -> tuple[list[Reading], NDArray[np.bool_]]:
    """The same, less those of records that show waves of two speeds under the same states, and
    which these are.

    Two records do where what is likeliest the direct wave of each is unlikely to be that of the
    other, by the geometric mean of how likely.

    Args:
        readings, parameter, p: of the series.
        slowness: of each record's packets by their tops, s/m.
        likely: of each, how likely it is the direct one.
    """
    name, result, other = parameter.partition(" (")[0], list(readings), np.zeros(len(p), bool)
    shown = [i for i, own in enumerate(likely) if len(own)]
    log = [np.log(own) for own in slowness]
    first = {i: float(log[i][np.argmax(likely[i])]) for i in shown}

    def also(i: int, j: int) -> float:
        """How likely the direct wave of record i is that of record j."""
        near = np.abs(log[j] - first[i]) < np.log(_AS_P_AND_S)
        return float(np.max(likely[j], initial=0.0, where=near))

    pairs = {}
    for i in shown:
        apart = {
            j: abs(first[j] - first[i])
            for j in shown if p[j] == p[i] and also(i, j) * also(j, i) < RIVAL**2
        }  # fmt: skip
        if apart:
            pairs[i] = max(apart, key=lambda j: apart[j])
    if len({float(p[i]) for i in pairs}) < _FEWEST_PAIRS:
        return result, other
    for i, j in pairs.items():
        why = TWO_WAVES.format(name, readings[j].file, np.exp(first[i] - first[j]))
        result[i] = replace(result[i], best=replace(result[i].best, valid=False, reason=why))
        other[i] = True
    return result, other
