"""The verdict on a record from anywhere: its points beside theory, and how well they hold.

What the commands ``dispersion`` and ``attenuation`` do, apart from reading and showing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wavesim.readings.dispersion.decaying_waves import ABOVE_WEAKEST, weakest, while_waves_last
from wavesim.readings.dispersion.frequency_at_wavenumber import chosen_method, in_time
from wavesim.readings.dispersion.noise_level import excited_frequencies
from wavesim.readings.dispersion.nyquist_crossing import because_undersampled
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.readings.dispersion.spreading import KINDS
from wavesim.readings.dispersion.unequal_gains import CALIBRATED, OF_TWO
from wavesim.readings.dispersion.wavenumber_at_frequency import in_space, line_without_source
from wavesim.records.faults.moveout import of_no_wave
from wavesim.records.fitness import for_frequency_at_k, for_k_at_frequency, unclipped
from wavesim.records.of_medium import RecordOfMedium
from wavesim.records.record import Record, RecordError
from wavesim.verdict.check import Check
from wavesim.verdict.recovered_points import (
    PRESENT,
    Matched,
    MatchedInSpace,
    match,
    match_along_line,
    match_in_space,
)
from wavesim.verdict.score import Score, score

# A simulated field must be recovered this well against its grid and against the continuum.
GRID_TOLERANCE = 1e-8
CONTINUUM_TOLERANCE = 1e-5
WAVENUMBER_TOLERANCE = 1e-4
# The continuum is asked for up to this k̄ only.
CONTINUUM_TO = 0.5
# Judged between these k̄ where theory is known.
JUDGED = (0.02, 1.0)
# Part of a laboratory record's points whose 95 % bars must hold the theory.
COVERAGE = 0.9
# In space errors hang together over frequencies a few σ apart: of one record fewer need hold.
SPACE_COVERAGE = 0.7
_FREQUENCIES = 40


@dataclass(frozen=True)
class Recovered:
    """Points of one record beside the theory.

    Attributes:
        origin: the record that they were recovered from.
        points: the points.
        matched: beside the theory, where there is one.
        score: beside the truth, where the record carries it.
    """

    origin: RecordOfMedium
    points: BranchPoints
    matched: Matched | MatchedInSpace | None
    score: Score | None = None

    def without_values(self) -> Recovered:
        """The same, its record without values: as small as it goes from process to process."""
        record = self.origin.record
        bare = replace(record, values=record.values[:, :0])
        return replace(self, origin=replace(self.origin, record=bare))


def dispersion(
    found: Sequence[RecordOfMedium],
    method: str = "auto",
    k_max: float | None = None,
    **options: Any,
) -> list[Recovered]:
    """ω at each wavenumber of each record, beside the theory.

    Args:
        found: the records.
        method: "auto", "harmonic" or "fft".
        k_max: highest wavenumber, rad/m; k̄ = 1 where a medium is known, else Nyquist.
        options: of ``wavesim.readings.dispersion.frequency_at_wavenumber.in_time``.
    """
    results = []
    for origin in found:
        unit = None
        if origin.medium is not None:
            unit = 2 * np.pi / float(origin.medium.length_scale)
        highest = k_max if k_max is not None or unit is None else JUDGED[1] * unit
        own, least = options, PRESENT
        if origin.law and origin.theory is not None:
            k_end = highest or np.pi / origin.record.spacing
            record = while_waves_last(origin.record, origin.law, origin.theory[0], k_end)
            origin, least = replace(origin, record=record), ABOVE_WEAKEST * weakest(origin.law)
            if method != "fft":
                own = {"dynamic_range": weakest(origin.law)} | options
        quiet = unclipped(origin.record.since(origin.record.quiet_from))
        sure = method == "harmonic" or (method == "auto" and chosen_method(quiet) == "harmonic")
        origin = replace(origin, record=for_frequency_at_k(origin.record, sure))
        points = in_time(origin.record, highest, method, **own)
        if origin.medium is None:
            _check_speeds(points)
        matched = None
        if origin.theory is not None and unit is not None and origin.block is not None:
            exact, grid = origin.theory
            low, high = JUDGED[0] * unit, min(highest or np.inf, JUDGED[1] * unit)
            names, judged = origin.block.branches, (low, high)
            if points.method == "beam":
                matched = match_along_line(points, origin.record, names, exact)
            else:
                matched = match(points, origin.record, names, exact, grid, judged, least)
        results.append(Recovered(origin, points, matched, _scored(origin.record, points, highest)))
    return results


def _scored(record: Record, points: BranchPoints, k_max: float | None = None) -> Score | None:
    if not record.answer or "k" not in record.answer or "omega" not in record.answer:
        return None
    return score(record, points, k_max)


def attenuation(
    found: Sequence[RecordOfMedium],
    band: tuple[float, float] | None = None,
    frequencies: int = _FREQUENCIES,
    damping: float | None = None,
    pairs: int = 1,
    clear: float | None = None,
    spreading: str = "plane",
    gain_error: float | None = None,
) -> list[Recovered]:
    """Complex k at given frequencies of each record in which a wave travels, beside the theory.

    Args:
        found: the records.
        band: lowest and highest frequency, Hz; ω̄ from 0.2 to 2 where a medium is known, else those
            at which the record is above its noise, with three periods in it at least.
        frequencies: how many, –.
        damping: σT of the exponential window, –; by the record's noise where None.
        pairs: most pairs ±k at one frequency, –.
        clear: distance to keep from sources, m; one particle distance where a medium is known.
        spreading: of the waves, one of ``wavesim.readings.dispersion.spreading.KINDS``.
        gain_error: standard deviation of the receivers' gains, relative, –; where None, 0 of a
            simulated field, 0.1 of any other.

    Raises:
        RecordError: no wave travels in any record, or one can't be used.
    """
    results = []
    for origin in found:
        if origin.block is not None and not origin.block.macro:
            continue
        origin = replace(origin, record=for_k_at_frequency(origin.record))
        record, medium = origin.record, origin.medium
        if band is not None:
            low, high = (2 * np.pi * f for f in band)
            _check_band(low, record)
        elif medium is not None:
            low, high = 0.2 / float(medium.time_scale), 2.0 / float(medium.time_scale)
            high = min(high, 0.8 * np.pi / record.interval)
        else:
            low, high = _excited(record)
        keep = clear
        if keep is None:
            keep = float(medium.length_scale) if medium is not None and origin.bar else 0.0
        component = 0 if origin.bar is not None else None
        omega = np.linspace(low, high, frequencies)
        gains = (CALIBRATED if origin.bar is None else 0.0) if gain_error is None else gain_error
        if origin.bar is None and len(line_without_source(record, keep)[0]) == 2:
            notes = (*record.notes, OF_TWO.format(100 * gains))
            origin = replace(origin, record=replace(record, notes=notes))
        points = in_space(
            record, omega, damping, pairs, component, keep,
            spreading=KINDS[spreading], gain_error=gains,
        )  # fmt: skip
        points = because_undersampled(points, record)
        if medium is None:
            _check_speeds(points)
        matched = None
        if origin.theory is not None:
            matched = match_in_space(points, *origin.theory)
        results.append(Recovered(origin, points, matched, _scored(origin.record, points)))
    if not results:
        raise RecordError("no wave travels in any of its sectors: there is no k to measure")
    return results


def _excited(record: Record) -> tuple[float, float]:
    """Frequencies worth asking for, rad/s."""
    strongest = record.values[int(np.argmax(np.abs(record.values).max(axis=(1, 2))))]
    quantum = record.quantum if len(record.quantum) else 0.0
    low, high = excited_frequencies(strongest, record.interval, quantum)
    low = max(low, 6 * np.pi / float(np.ptp(record.t)))
    return low, max(min(high, 0.8 * np.pi / record.interval), low)


def _check_speeds(points: BranchPoints) -> None:
    """Refuse points that are all faster, or all slower, than waves are."""
    speed = points.phase_velocity[points.valid]
    if len(speed) and (why := of_no_wave(float(speed.min()), float(speed.max()))):
        raise RecordError(why)


def _check_band(low: float, record: Record) -> None:
    """Refuse a band that the frames do not reach, most often for a unit of time."""
    nyquist = 0.5 / record.interval
    if low >= 2 * np.pi * nyquist:
        raise RecordError(
            f"--band {low / (2 * np.pi):g} Hz: above the Nyquist frequency, {nyquist:.4g} Hz with "
            f"frames {record.interval:.4g} s apart: name a lower band, or the unit of the times "
            "with --time-unit"
        )


def checks(results: Sequence[Recovered]) -> list[Check]:
    """The verdict: waves missed and false, and errors against both references."""
    found: list[Check] = []
    for one in results:
        if isinstance(one.matched, Matched):
            found += _checks_in_time(one, one.matched)
        elif one.matched is not None:
            found += _checks_in_space(one, one.matched)
    return found


def _checks_in_time(one: Recovered, matched: Matched) -> list[Check]:
    name = one.origin.name
    missed, false = int(matched.missed.sum()), len(matched.false_k)
    found = [
        Check(f"{name}: waves missed, of {matched.present.sum()} (k, ω)", missed, 0, 0, "points"),
        Check(f"{name}: points of no wave", false, 0, 0, "points"),
    ]
    if not matched.found.any():
        return found
    harmonic = one.points.method == "harmonic"
    medium = one.origin.medium
    if one.origin.bar is None or medium is None:
        inside = float(np.mean(np.abs(matched.omega - matched.grid)[matched.found]
                               <= matched.bar[matched.found]))  # fmt: skip
        if one.points.method != "fft":
            label = f"{name}: points whose 95 % bar holds the theory, at least"
            found.append(Check(label, inside, 1, 1 - COVERAGE, "–"))
        return found
    short = matched.k * float(medium.length_scale) / (2 * np.pi) <= CONTINUUM_TO + 1e-9
    if harmonic and one.origin.law:
        for continuum, where in ((False, "grid"), (True, f"continuum, k̄ ≤ {CONTINUUM_TO:g}")):
            shift = matched.shift(continuum)[short if continuum else slice(None)]
            if np.isfinite(shift).any():
                label = f"{name}: |ΔRe ω| over the width γ + 2π/T against the {where}"
                found.append(Check(label, float(np.nanmax(shift)), 0, weakest(medium.damping)))
        return found
    grid = float(np.nanmax(matched.error(False)))
    label = f"{name}: |Δω|/ω against the grid, {matched.found.sum()} points"
    found.append(Check(label, grid, 0, GRID_TOLERANCE if harmonic else 1e-2))
    whole = matched.error(True)[short]
    if np.isfinite(whole).any():
        label = f"{name}: |Δω|/ω against the continuum, k̄ ≤ {CONTINUUM_TO:g}"
        tolerance = CONTINUUM_TOLERANCE if harmonic else 1e-2
        found.append(Check(label, float(np.nanmax(whole)), 0, tolerance))
    return found


def _checks_in_space(one: Recovered, matched: MatchedInSpace) -> list[Check]:
    name, points = one.origin.name, one.points
    valid = points.valid
    label = f"{name}: {valid.sum()} of {len(points)} frequencies measured"
    if one.origin.bar is None:
        within = np.abs(points.k - matched.grid)[valid] <= points.bar[valid]
        inside = float(np.mean(within)) if valid.any() else 0.0
        return [
            Check(f"{label}; 95 % bar holds the theory, at least", inside, 1, 1 - SPACE_COVERAGE)
        ]
    found = []
    for continuum, reference in ((False, "grid"), (True, "continuum")):
        error = matched.error(continuum)
        worst = float(np.nanmax(error)) if valid.any() else float("nan")
        found.append(
            Check(f"{label}; |Δk|/|k| against the {reference}", worst, 0, WAVENUMBER_TOLERANCE)
        )
    return found
