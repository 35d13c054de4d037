"""What the commands ``dispersion`` and ``attenuation`` do: file in, points beside theory out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.damping import UNDAMPED, Damping
from wavesim.material.medium import Medium
from wavesim.material.sectors import Block, blocks_of
from wavesim.readings.dispersion.decaying_waves import ABOVE_WEAKEST, weakest, while_waves_last
from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
from wavesim.readings.dispersion.points import BranchPoints, plain
from wavesim.readings.dispersion.wavenumber_at_frequency import in_space
from wavesim.records.files import HDF5, Layout, read
from wavesim.records.record import Record, RecordError
from wavesim.records.relations import OfMedium
from wavesim.studies.medium_fit import Fitted, Observed, fit
from wavesim.verdict.endless import Check
from wavesim.verdict.points import PRESENT, Matched, MatchedInSpace, match, match_in_space

Float = NDArray[Any]

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
class Source:
    """Records of a file, with what is known of the medium.

    Attributes:
        name: of the block, or of the file.
        record: the record.
        medium, block: theory to lay over it; None without.
        bar: grid that the record obeys; None for a laboratory's.
        exact: False in single precision, whose rounding is waves too: ω(k) is then not judged.
    """

    name: str
    record: Record
    medium: Medium | None = None
    block: Block | None = None
    bar: Any = None
    exact: bool = True

    @property
    def label(self) -> str:
        """The name as part of a file's: no brackets."""
        return self.name.translate({ord("["): "_skew_", ord("("): "_even_", 93: "", 41: ""})

    @property
    def law(self) -> Damping:
        """Losses of a simulated field; none of any other."""
        return self.medium.damping if self.bar is not None and self.medium else UNDAMPED

    @property
    def theory(self) -> tuple[OfMedium, OfMedium | None] | None:
        """Relations of the continuum and of the grid."""
        if self.medium is None or self.block is None:
            return None
        exact = OfMedium(self.medium, self.block)
        return exact, None if self.bar is None else OfMedium(self.medium, self.block, self.bar)


@dataclass(frozen=True)
class Recovered:
    """Points of one record beside the theory.

    Attributes:
        source: where they came from.
        points: the points.
        matched: beside the theory, where there is one.
    """

    source: Source
    points: BranchPoints
    matched: Matched | MatchedInSpace | None


def sources(path: Path, layout: Layout, medium: Medium | None, sector: str) -> list[Source]:
    """Records of a file: the driven blocks of a result.h5, or one record of any other.

    Args:
        path: of the file.
        layout: what it does not say for itself.
        medium: theory to lay over it; a result.h5 brings its own.
        sector: which sector's, for a record that does not say.

    Raises:
        RecordError: the file can't be used.
    """
    if path.suffix.lower() in HDF5 and path.is_file():
        from wavesim.io import result_reader as resultfile

        if resultfile.is_result(path):
            return _of_result(path)
    record = read(path, layout)
    if medium is None:
        return [Source(path.stem, record)]
    (block, *others) = blocks_of(sector)
    if others:
        raise RecordError(
            f"--sector {sector}: its waves do not travel and can't be told apart in one record; "
            "take longitudinal or transverse2"
        )
    return [Source(path.stem, record, medium, block)]


def _of_result(path: Path) -> list[Source]:
    from wavesim.case.problem import settle
    from wavesim.case.schema import CaseError, parse
    from wavesim.io import result_reader as resultfile
    from wavesim.records.of_field import block_record

    try:
        stored = resultfile.describe(path)
        problem = settle(parse(stored.case, str(path)), str(path))
        if not problem.plan.endless:
            # Its waves are not ω(k) of one medium on a ring, which is what is looked for here.
            raise RecordError(
                "is of a bar with layers or ends; its run has read its receivers already: see "
                "summary.json and the groups exact, transmission, bloch, eigenfrequencies, pulse"
            )
        field = resultfile.read(path, problem)
        exact = field.precision == "double"
        return [
            Source(b.name, block_record(field, b), field.medium, b, field.bar, exact)
            for b in field.blocks
        ]
    except (resultfile.StorageError, CaseError) as error:
        raise RecordError(str(error)) from None
    except RecordError as error:
        raise RecordError(f"{path}: {error}") from None


def dispersion(
    found: Sequence[Source], method: str = "harmonic", k_max: float | None = None, **options: Any
) -> list[Recovered]:
    """ω at each wavenumber of each record, beside the theory.

    Args:
        found: the records.
        method: "harmonic" or "fft".
        k_max: highest wavenumber, rad/m; k̄ = 1 where a medium is known, else Nyquist.
        options: of ``wavesim.readings.dispersion.frequency_at_wavenumber.in_time``.
    """
    results = []
    for source in found:
        unit = None
        if source.medium is not None:
            unit = 2 * np.pi / float(source.medium.length_scale)
        highest = k_max if k_max is not None or unit is None else JUDGED[1] * unit
        own, least = options, PRESENT
        if source.law and source.theory is not None:
            k_end = highest or np.pi / source.record.spacing
            record = while_waves_last(source.record, source.law, source.theory[0], k_end)
            source, least = replace(source, record=record), ABOVE_WEAKEST * weakest(source.law)
            if method == "harmonic":
                own = {"dynamic_range": weakest(source.law)} | options
        points = in_time(source.record, highest, method, **own)
        matched = None
        if source.theory is not None and unit is not None and source.block is not None:
            exact, grid = source.theory
            low, high = JUDGED[0] * unit, min(highest or np.inf, JUDGED[1] * unit)
            names, judged = source.block.branches, (low, high)
            matched = match(points, source.record, names, exact, grid, judged, least)
        results.append(Recovered(source, points, matched))
    return results


def attenuation(
    found: Sequence[Source],
    band: tuple[float, float] | None = None,
    frequencies: int = _FREQUENCIES,
    damping: float | None = None,
    pairs: int = 1,
    clear: float | None = None,
) -> list[Recovered]:
    """Complex k at given frequencies of each record in which a wave travels, beside the theory.

    Args:
        found: the records.
        band: lowest and highest frequency, Hz; ω̄ from 0.2 to 2 where a medium is known, else from
            three periods in the record to half the Nyquist frequency.
        frequencies: how many, –.
        damping: σT of the exponential window, –; by the record's noise where None.
        pairs: most pairs ±k at one frequency, –.
        clear: distance to keep from sources, m; one particle distance where a medium is known.

    Raises:
        RecordError: no wave travels in any record, or one can't be used.
    """
    results = []
    for source in found:
        if source.block is not None and not source.block.rotations:
            continue
        record, medium = source.record, source.medium
        if band is not None:
            low, high = (2 * np.pi * f for f in band)
        elif medium is not None:
            low, high = 0.2 / float(medium.time_scale), 2.0 / float(medium.time_scale)
            high = min(high, 0.8 * np.pi / record.interval)
        else:
            low, high = 6 * np.pi / float(np.ptp(record.t)), 0.5 * np.pi / record.interval
        keep = clear
        if keep is None:
            keep = float(medium.length_scale) if medium is not None and source.bar else 0.0
        component = 0 if source.bar is not None else None
        omega = np.linspace(low, high, frequencies)
        points = in_space(record, omega, damping, pairs, component, keep)
        matched = None
        if source.theory is not None:
            matched = match_in_space(points, *source.theory)
        results.append(Recovered(source, points, matched))
    if not results:
        raise RecordError("no wave travels in any of its sectors: there is no k to measure")
    return results


def checks(results: Sequence[Recovered]) -> list[Check]:
    """The verdict: waves missed and false, and errors against both references."""
    found: list[Check] = []
    for one in results:
        if isinstance(one.matched, Matched):
            found += _checks_in_time(one, one.matched) if one.source.exact else []
        elif one.matched is not None:
            found += _checks_in_space(one, one.matched)
    return found


def _checks_in_time(one: Recovered, matched: Matched) -> list[Check]:
    name = one.source.name
    missed, false = int(matched.missed.sum()), len(matched.false_k)
    found = [
        Check(f"{name}: waves missed, of {matched.present.sum()} (k, ω)", missed, 0, 0, "points"),
        Check(f"{name}: points of no wave", false, 0, 0, "points"),
    ]
    if not matched.found.any():
        return found
    harmonic = one.points.method == "harmonic"
    medium = one.source.medium
    if one.source.bar is None or medium is None:
        inside = float(np.mean(np.abs(matched.omega - matched.grid)[matched.found]
                               <= matched.bar[matched.found]))  # fmt: skip
        if harmonic:
            label = f"{name}: points whose 95 % bar holds the theory, at least"
            found.append(Check(label, inside, 1, 1 - COVERAGE, "–"))
        return found
    short = matched.k * float(medium.length_scale) / (2 * np.pi) <= CONTINUUM_TO + 1e-9
    if harmonic and one.source.law:
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
    name, points = one.source.name, one.points
    valid = points.valid
    label = f"{name}: {valid.sum()} of {len(points)} frequencies measured"
    if one.source.bar is None:
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


def fitted(results: Sequence[Recovered], start: Medium, parameters: Sequence[str]) -> Fitted:
    """Parameters of the medium that the points tell of."""
    observed = [
        Observed(one.source.block, one.points, one.source.bar)
        for one in results
        if one.source.block is not None
    ]
    return fit(observed, start, parameters)


def summary(results: Sequence[Recovered], fit_of: Fitted | None = None) -> dict[str, Any]:
    """All that was found as one object for JSON, SI units, NaN as null."""
    entries = []
    for one in results:
        points, record = one.points, one.source.record
        entry: dict[str, Any] = {
            "name": one.source.name,
            "method": points.method,
            "frames": len(record.t),
            "receivers": len(record.x),
            "notes": list(record.notes),
            "branches": len(points.branches),
            "points": {n: plain(column) for n, column in points.columns().items()},
        }
        if isinstance(one.matched, Matched):
            entry["waves"] = one.matched.rows()
            entry["false_points"] = len(one.matched.false_k)
        elif one.matched is not None:
            entry["error_grid"] = plain(one.matched.error(False))
            entry["error_continuum"] = plain(one.matched.error(True))
        entries.append(entry)
    found = checks(results)
    answer: dict[str, Any] = {
        "records": entries,
        "checks": [check.row() for check in found],
        "passed": all(check.passed for check in found),
    }
    if fit_of is not None:
        answer["fit"] = {
            "values": fit_of.values,
            "standard_errors": fit_of.errors,
            "chi_square": fit_of.chi_square,
            "points": fit_of.points,
        }
    return answer
