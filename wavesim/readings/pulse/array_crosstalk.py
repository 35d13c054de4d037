"""Several receivers without the crosstalk that all of them hear."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.readings.pulse import crosstalk
from wavesim.readings.pulse.signals import BEGUN, WANDERS, PulseError, PulseRecord
from wavesim.readings.pulse.transmission_record import TransmissionRecord, transmission_record
from wavesim.records.windows import moving_mean

Float = NDArray[Any]

# Crosstalk is known by its coming to so many receivers at once, this many deviations high.
_FEWEST_AT_ONCE, _HEARD = 2, 4.5
# Crosstalk of all receivers has this part of its power in common.
_ONE = 0.8
# Noise is taken to be at least this part of the peak.
_LEAST_NOISE = 2e-3
CROSSTALK = (
    "waves begin within crosstalk that is larger than they: what was sent tells enough of it to "
    "time them, but not for their spectra; shield and ground both sides"
)


def without_crosstalk(
    t: ArrayLike,
    signals: dict[str, Float],
    positions: Mapping[str, float],
    sent: ArrayLike,
    notes: list[str],
) -> tuple[dict[str, Float], str]:
    """Signals without their crosstalk: what is known of it taken out, or held at their base while
    it lasts; a receiver whose wave begins within what is not known is left out. With it why what
    is left tells no spectra, or ""."""
    try:
        each = {key: transmission_record(t, u, sent, key) for key, u in signals.items()}
    except PulseError:
        return signals, ""
    # A wave may be there at once at the nearest, crosstalk is at all.
    if not all(one.crosstalk for one in each.values()):
        return signals, ""
    if not _alike(np.stack([_early(each[key], u) for key, u in signals.items()])):
        return signals, ""
    known = [key for key, one in each.items() if one.crosstalk_taken.any()]
    hidden = [key for key in each if key not in known and not each[key].covered]
    begun = [key for key in each if each[key].covered and key not in known]
    # A wave that has begun at one has at those before it.
    furthest = max((positions[key] for key in begun), default=-math.inf)
    begun = [key for key in each if positions[key] <= furthest and key not in known]
    hidden = [key for key in hidden if key not in begun]
    if len(signals) - len(begun) < 2:
        raise PulseError(
            f"{', '.join(begun)}: the wave begins within crosstalk; shield and ground both sides, "
            "send a shorter pulse, or place receivers further away"
        )
    if known:
        notes.append(f"crosstalk, by what was sent, was taken out ({', '.join(known)})")
    if hidden:
        until = max(each[key].blank for key in hidden)
        notes.append(f"crosstalk, up to {until:.4g} s, was left out ({', '.join(hidden)})")
    if begun:
        notes.append(f"the wave begins within crosstalk: left out ({', '.join(begun)})")
    result = {}
    for key, u in signals.items():
        one = each[key]
        if key not in begun:
            every = _as_given(one, u)
            own = u - one.crosstalk_taken[every]
            result[key] = np.where(_within(one)[every], own - one.raw[every], own)
    rest = any(
        each[key].crosstalk > 1 and each[key].blank < each[key].start + each[key].length
        for key in known
    )
    return result, CROSSTALK if rest else ""


def _as_given(one: TransmissionRecord, u: Float) -> slice:
    """Samples of a record that its signal was given at: more are added where a period has few."""
    return slice(None, None, (len(one.t) - 1) // (len(u) - 1))


def _within(one: TransmissionRecord) -> NDArray[np.bool_]:
    """Samples at which a receiver may hear crosstalk."""
    return (one.t >= one.start) & (one.t < one.blank)


def _early(one: TransmissionRecord, u: Float) -> Float:
    """A signal, without its offset, while its receiver may hear crosstalk; 0 at other times."""
    return np.where(_within(one), one.raw + one.crosstalk_taken, 0.0)[_as_given(one, u)]


def _alike(rows: Float) -> bool:
    """Whether signals are one and the same but for their size, and no noise."""
    together = (rows != 0).all(axis=0)
    power = np.linalg.svd(rows[:, together], compute_uv=False) ** 2
    return bool(power.sum() > 0 and power[0] > _ONE * power.sum())


def without_what_all_hear_at_once(
    record: PulseRecord, signals: dict[str, Float], period: float, notes: list[str]
) -> dict[str, Float]:
    """Signals without crosstalk that is known by its coming at once.

    While it lasts the receivers' mean, at the size that each has of it, is taken out.

    Raises:
        PulseError: it lasts into the wave, or no wave comes after it.
    """
    own = [j for j, why in enumerate(record.unusable) if why in ("", BEGUN, WANDERS)]
    if len(own) < _FEWEST_AT_ONCE:
        return signals
    rows = [record.values[:, j] for j in own]
    # Crosstalk may stand in what is quiet before the wave: the quietest tenth tells the noise.
    width = max(3, int(period / record.interval))
    quietest = [np.percentile(np.sqrt(moving_mean(row**2, width)), 10) for row in rows]
    least = _LEAST_NOISE * np.median([np.abs(row).max() for row in rows])
    noise = float(max(np.median(quietest), least))
    found = crosstalk.at_once(rows, record.interval, period, noise, _HEARD)
    if found is None:
        return signals
    first, stop, over = found
    told = f"all receivers hear the same at {record.t[first]:.4g} s, as crosstalk"
    if not over:
        raise PulseError(
            f"{told}, and it lasts into the wave: name what was sent (--input), by which it is "
            "told apart, or shield and ground both sides"
        )
    stop = min(stop + int(period / 2 / record.interval), len(record.t))
    if np.median([np.abs(row[stop:]).max(initial=0.0) for row in rows]) < _HEARD * 1.5 * noise:
        raise PulseError(
            f"{told}, and no wave comes after it: name what was sent (--input), which tells a wave "
            "within it apart; else average more, or press transducers on"
        )
    notes.append(f"{told}, up to {record.t[stop - 1]:.4g} s: it was taken out of every receiver")
    hidden = slice(max(0, first - int(period / 4 / record.interval)), stop)
    centred = {key: u - np.median(u) for key, u in signals.items()}
    mean = np.mean([centred[record.names[j]][hidden] for j in own], axis=0)
    # What is left is noise, of which the mean has taken its part.
    kept = 1 / math.sqrt(1 - 1 / len(own))
    result = {}
    for key, u in signals.items():
        part = centred[key][hidden]
        result[key] = u.copy()
        result[key][hidden] += kept * (part - mean * (part @ mean) / (mean @ mean)) - part
    return result
