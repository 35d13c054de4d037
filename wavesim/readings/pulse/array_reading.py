"""A pulse test with several receivers: one velocity of all conventions, Q, and what is doubtful."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.material.shown import in_frequency
from wavesim.readings.dispersion.spreading import spreads
from wavesim.readings.pulse import faults
from wavesim.readings.pulse.array_crosstalk import without_crosstalk, without_what_all_hear_at_once
from wavesim.readings.pulse.echo_gate import common_period, echo_gate
from wavesim.readings.pulse.first_break import onset
from wavesim.readings.pulse.measurement import PulseResult, measured
from wavesim.readings.pulse.quality_over_band import all_alike, left_to_gains
from wavesim.readings.pulse.reading import Best, Reading, ReceiverArrivals, judged
from wavesim.readings.pulse.several_waves import Passing, of_one_wave, unexplained, waves_passing
from wavesim.readings.pulse.signals import PulseError, PulseRecord, pulse_record
from wavesim.readings.pulse.travel_time import TravelTime
from wavesim.readings.pulse.velocity import (
    BACKWARDS,
    Velocity,
    arrival_velocity,
    telling,
    well_known,
    with_what_is_open,
)

Float = NDArray[Any]

VAGUE = (
    "no convention reads a velocity to 20 %: add a receiver, place them further apart, or begin "
    "the record earlier, so that its noise is seen"
)
SPREADS = (
    "amplitudes fall as those of waves that spread, not of plane ones, so that there is no α or Q: "
    "wavesim attenuation takes --source and --spreading"
)
_Speed = tuple[str, Velocity]
# Noise of this part of the others' size is that of a receiver without a signal.
_DEAD = 1e-2


# The first of them that there is: where the medium disperses all are right, each of another speed.
_PREFERRED = ("correlation", "envelope", "threshold", "first break")
# An error this many times the convention's own is told of.
_OPEN = 3.0
# One wave that leaves this part of the power, and this many times the noise's, is not alone.
_UNEXPLAINED, _OVER_SHARE = 0.03, 30.0
# Speeds whose logarithms differ by less may be of one wave.
_ONE_WAVE = 0.15
# A packet's top tells its arrival to this part of a period.
_TOP = 0.1
# Group and phase velocity that far apart are dispersion.
_DISPERSES = 0.03
# A phase that is off by so much of a turn may be off by a whole one.
_A_TURN = 0.5


def read_array(
    name: str,
    t: ArrayLike,
    signals: Mapping[str, ArrayLike],
    positions: Mapping[str, float],
    sent: ArrayLike | None = None,
    expected: tuple[float, float] | None = None,
    unlike: str = "",
    noise: float = math.nan,
    levelled: str = "",
) -> Reading:
    """Read a record of two receivers or more.

    Args:
        name: of the record.
        t: times, shape (nt,), s.
        signals: of each receiver, shape (nt,).
        positions: of each, m; the wave runs towards larger ones.
        sent: what was sent, shape (nt,); None where it was not recorded.
        expected: (f, c), a phase velocity foreseen at one frequency, Hz and m/s.
        unlike: why what lies between the receivers is not one medium, so that there is no k of it;
            "" where it is one.
        noise: of arrivals where the record shows none before them, unit of the signals; 0 in a
            simulation.
        levelled: why amplitudes of the receivers tell nothing; "" where they do.

    Returns:
        The reading: times are those of the record's clock, ``best.time`` is that from the first to
        the last receiver.

    Raises:
        PulseError: something can't be used.
    """
    notes: list[str] = []
    given = {key: np.array(u, float) for key, u in signals.items()}
    usual = float(np.median([np.ptp(u) for u in given.values()]))
    dead = [key for key, u in given.items()
            if not np.ptp(u) > _DEAD * usual and onset(u - np.median(u))[2]]  # fmt: skip
    if len(given) - len(dead) > 1:
        given = {key: u for key, u in given.items() if key not in dead}
        positions = {key: x for key, x in positions.items() if key not in dead}
        notes += [f"{', '.join(dead)}: dead, no signal beside the others': left out"] * bool(dead)
    looked_at = pulse_record(t, given, positions)
    try:
        cleared = without_what_all_hear_at_once(looked_at, given, common_period(looked_at), notes)
    except PulseError:
        if sent is None:
            raise
        cleared = given
    if cleared is given and sent is not None:
        cleared, rest = without_crosstalk(t, given, positions, sent, notes)
        unlike = unlike or rest
    if cleared is not given:
        given, positions = cleared, {key: positions[key] for key in cleared}
        looked_at = pulse_record(t, given, positions)
    unlike = unlike or faults.muted(looked_at.values)
    own, (window, overlap) = looked_at, echo_gate(looked_at)
    if window is not None and not overlap:
        at = "" if math.isinf(window.velocity) else ", later at each that the wave reaches later"
        notes.append(f"the record is read up to {window.end:.4g} s, before the first echo{at}")
        weights = window.weights(looked_at.t, looked_at.x)
        # Where no arrival stands out all of a signal is noise, up to where the gate closes.
        closes = np.where(weights < 1, looked_at.t[:, None], np.inf).min(axis=0)
        own = replace(own, values=own.values * weights, quiet=np.minimum(own.quiet, closes))
    own = replace(own, known=noise)
    result = measured(own, window, source=sent, expected=expected)
    if unlike:
        result = _without_spectra(result, unlike)
        notes.append(unlike)
    notes = [*result.record.notes, *notes]
    waves, why = _several(result, looked_at)
    if why and not unlike:
        result = _without_spectra(result, why)
    if why:
        notes.insert(0, why)
    else:
        one = of_one_wave(result.spectra, result.dispersion, expected)
        result = replace(result, dispersion=one)
        notes += [overlap] if overlap else []
    spectra = result.spectra
    if not levelled and noise != 0 and not why:
        levelled = faults.second_gain(spectra.values, result.record.x, spectra.above)
        notes = [*([levelled] if levelled else []), *notes]
    if levelled:
        gone = (levelled,) * len(result.loss.reason)
        result = replace(result, loss=replace(result.loss, reason=gone)).without_loss(levelled)
    elif noise != 0 and spreads(spectra.values, result.record.x, spectra.above, None):
        result = result.without_loss(SPREADS)
        notes.insert(0, SPREADS)
    elif noise != 0 and (levelled := _alike(result)):
        result = replace(result, dispersion=result.dispersion.without_loss(levelled))
        notes.insert(0, levelled)
    elif noise != 0:
        found = result.dispersion
        ratio, c = result.constant_quality, found.with_errors.phase_velocity
        open_ = left_to_gains(result.quality, ratio, found.omega, c)
        result = replace(result, dispersion=found.with_alike(open_))
    best = _best(result, bool(overlap), [] if len(waves) > 1 else notes)
    if waves:
        best = _of_several(best, result, waves, expected)
    notes += _dispersion(result, expected)
    receivers = tuple(
        ReceiverArrivals(key, float(result.record.x[j]), _arrivals(result, j))
        for j, key in enumerate(result.record.names)
    )
    return Reading(name, receivers, best, notes=tuple(notes), result=result)


def _alike(result: PulseResult) -> str:
    """Why there is no α where amplitudes fall at all frequencies alike; "" elsewhere."""
    found = result.dispersion.with_errors
    return all_alike(
        found.omega, found.phase_velocity, found.attenuation, found.attenuation_error,
        float(np.ptp(result.record.x)), result.spectra.duration,
    )  # fmt: skip


def _without_spectra(result: PulseResult, why: str) -> PulseResult:
    """A result whose spectra tell nothing, neither c, α nor Q, for a reason."""
    ratio = replace(result.constant_quality, quality=math.nan, error=math.nan, reason=why)
    return replace(result, dispersion=result.dispersion.refused(why), constant_quality=ratio)


def _several(result: PulseResult, record: PulseRecord) -> tuple[list[list[_Speed]], str]:
    """Speeds of the waves that pass, and why what spectra tell is of none of them; ([], "") where
    one wave alone explains the receivers."""
    parts = unexplained(result.spectra, result.dispersion)
    left, share = (
        float(np.median(part[np.isfinite(part)])) if np.isfinite(part).any() else math.nan
        for part in parts
    )
    if left <= max(_UNEXPLAINED, _OVER_SHARE * share):
        return [], ""
    period = common_period(record)
    lines = waves_passing(record, period)
    if len(lines) > 1:
        waves = _groups([*result.speeds.items(), *(_line(one, record, period) for one in lines)])
        speeds = " and ".join(f"{one[0][1].velocity:.4g}" for one in waves)
        more = f"of {speeds} m/s " if len(waves) > 1 else ""
        return waves, f"several waves {more}pass the receivers, and spectra mix them"
    if not math.isfinite(left):
        return [], ""
    return [], (
        f"one wave alone leaves {left:.0%} of the receivers' power: several waves that overlap, "
        "or echoes; wavesim attenuation tells them apart where receivers are many"
    )


def _line(one: Passing, record: PulseRecord, period: float) -> _Speed:
    """The speed of packets that are of one wave alone."""
    return "envelope", arrival_velocity(record.x, one.alone, np.full(len(record.x), _TOP * period))


def _groups(speeds: Sequence[_Speed]) -> list[list[_Speed]]:
    """Speeds that are known, those of one wave together, the surest of each first."""
    sure = [each for each in speeds if each[1].velocity > 0 and well_known(each[1])]
    sure.sort(key=lambda each: each[1].error / each[1].velocity)
    groups: list[list[_Speed]] = []
    for each in sure:
        for group in groups:
            if abs(math.log(each[1].velocity / group[0][1].velocity)) < _ONE_WAVE:
                group.append(each)
                break
        else:
            groups.append([each])
    return groups


def _of_several(
    best: Best,
    result: PulseResult,
    waves: Sequence[list[_Speed]],
    expected: tuple[float, float] | None,
) -> Best:
    """The wave that is meant of several, or why none is."""
    speeds = " or ".join(f"{one[0][1].velocity:.4g}" for one in waves)
    if expected is None:
        if best.valid or len(waves) < 2:
            return best
        reason = f"it is one of several waves, of {speeds} m/s: --expected F C says about how fast"
        return replace(best, reason=reason)
    wave = min(waves, key=lambda one: abs(math.log(one[0][1].velocity / expected[1])))
    name, one = wave[0]
    span = float(result.record.x[-1] - result.record.x[0])
    bar = with_what_is_open(one, (v for _, v in wave))
    reason = ""
    if abs(math.log(one.velocity / expected[1])) > _ONE_WAVE:
        reason = f"no wave is about as fast as --expected says, but {speeds} m/s"
    time = span / one.velocity
    # The other wave may lie beneath what is read.
    beneath = _TOP * common_period(result.record)
    error = math.hypot(time * bar / one.velocity, beneath)
    return judged(name, time, error, span, reason)


def _arrivals(result: PulseResult, j: int) -> dict[str, TravelTime]:
    return {
        convention: TravelTime(float(one.time[j]), float(one.error[j]), one.reason[j])
        for convention, one in result.arrivals.items()
    }


def _best(result: PulseResult, overlap: bool, notes: list[str]) -> Best:
    """The velocity that counts, with what the conventions leave open; a note where that is most."""
    speeds = result.speeds
    span = float(result.record.x[-1] - result.record.x[0])
    told = [name for name in _PREFERRED if well_known(speeds[name])]
    if not told:
        why = next((one.reason for one in speeds.values() if one.reason), VAGUE)
        reasons = [r for r in result.record.unusable if r]
        return Best("correlation", math.nan, math.nan, math.nan, math.nan, False,
                    reasons[0] if reasons else why)  # fmt: skip
    # Beside an echo any of them may have read it, and the one that is nearest to all counts.
    bars = {n: with_what_is_open(speeds[n], speeds.values()) for n in told}
    name = min(told, key=lambda n: bars[n] / abs(speeds[n].velocity)) if overlap else told[0]
    one, bar = speeds[name], bars[name]
    remedy = "average more"
    if bar > _OPEN * one.error:
        each = sorted(v.velocity for v in telling(speeds.values()))
        read = f"{each[0]:.4g} to {each[-1]:.4g} m/s"
        remedy = f"conventions read {read}; drive a narrower band, away from gaps"
        notes.append(
            f"the velocity's error is what the conventions leave open, which read {read}, and not "
            "the noise of one of them"
        )
    time = span / one.velocity
    reason = "" if one.velocity > 0 else BACKWARDS
    error = time * bar / abs(one.velocity)
    return judged(name, time, error, span, reason, remedy=remedy)


def _dispersion(result: PulseResult, expected: tuple[float, float] | None) -> list[str]:
    """Whether phase and group velocity are apart, and whether --expected may have put them so."""
    found = result.dispersion
    with np.errstate(invalid="ignore"):
        own = found.valid & np.isfinite(found.group_velocity + found.phase_velocity)
    if own.sum() < 3:
        return []
    strongest = int(np.argmax(np.where(own, result.spectra.source, -1.0)))
    c, v = found.phase_velocity[strongest], found.group_velocity[strongest]
    error = math.hypot(found.phase_error[strongest], found.group_error[strongest])
    if abs(c - v) < max(_DISPERSES * abs(c), 3 * error):
        return []
    omega = float(found.omega[strongest])
    per, unit = in_frequency(omega)
    # As much lies between neighbours.
    turns = omega * float(np.diff(result.record.x).min()) * abs(1 / c - 1 / v) / (2 * math.pi)
    if expected is not None and turns > _A_TURN:
        return [
            f"at {omega * per:.4g} {unit} phases run at {c:.4g} m/s, as --expected says, and "
            f"groups at {v:.4g} m/s: the medium disperses, or --expected is off by {turns:.1f} "
            "turns of the phase between neighbours, and so is c: receivers closer to each other "
            "tell"
        ]
    return [
        f"the medium disperses: at {omega * per:.4g} {unit} phases run at {c:.4g} m/s and groups "
        f"at {v:.4g} m/s, so that each convention reads a speed of its own"
    ]
