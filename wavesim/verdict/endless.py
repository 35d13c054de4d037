"""The verdict on an endless bar, beside the plane-wave solver; and what a reader asks first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.family import sector_words
from wavesim.material.shown import DECIBELS, HERTZ, KHZ
from wavesim.planewave.dispersion_relation import Gap, full_gaps, gaps, open_gaps
from wavesim.simulation.field import Field
from wavesim.verdict import remedies
from wavesim.verdict.branches import Held, faint
from wavesim.verdict.check import Check, judged
from wavesim.verdict.foreseen_errors import (
    MAXIMUM_TOLERANCE,
    MEDIAN_TOLERANCE,
    WAVENUMBER_TOLERANCE,
)
from wavesim.verdict.gap_rows import at_receivers, gap_row, steady_loss
from wavesim.verdict.receivers_and_energy import energy_checks, energy_note
from wavesim.verdict.remedies import Answers, Row, to_see_more

# A branch of fewer wavenumbers is lost by their distance.
_FEW_WAVENUMBERS = 12
_UNCERTAIN = 0.3 * WAVENUMBER_TOLERANCE


def judge(field: Field, held: Sequence[Held]) -> list[Check]:
    """All checks of a run.

    Args:
        field: the field.
        held: every block, beside the theory.

    Returns:
        The checks; none about what the record is too short to tell.
    """
    checks = []
    expected = [b for h in held for b in h.branches if b.expected]
    if expected:
        present = sum(b.present for b in expected)
        bins = f"frequency bins of {1e-3 / field.t[-1]:.3g} kHz do not tell all waves apart"
        lacking = _of_missing, field, held, bins
        whole = len(expected)
        checks.append(
            judged("waves present", present, 0.0, *lacking, reference=whole, unit="waves")
        )
        strays = sum(len(h.strays) for h in held)
        remedy = remedies.longer_run, field, bins
        checks.append(judged("ridges of no wave", strays, 0.0, *remedy, unit="ridges"))
    for h in held:
        checks += _branch_checks(field, h)
    checks += _gap_edge_checks(field, held)
    for h in held:
        checks += _wavenumber_checks(field, h)
    return checks + energy_checks(field)


def _of_missing(field: Field, held: Sequence[Held], bins: str) -> str:
    """What finds branches that are not found where they stand clear of their neighbours: of few
    wavenumbers it is their distance that keeps them from being followed."""
    lost = [(h, b) for h in held for b in h.branches if b.expected and not b.present]
    missing = ", ".join(f"{h.measured.block.sector} {b.name}" for h, b in lost)
    if min(b.expected for _, b in lost) >= _FEW_WAVENUMBERS:
        return remedies.longer_run(field, f"{bins} (missing: {missing})")
    bar = field.bar
    return (
        f"lengthen [bar] length to {2 * bar.length:.6g} ({2 * bar.cells} cells) or more (now "
        f"{bar.length:.6g} m): its wavenumbers, {2 * math.pi / bar.length:.4g} rad/m apart, are "
        f"too few to follow a branch by (missing: {missing})"
    )


def _branch_checks(field: Field, h: Held) -> list[Check]:
    checks = []
    for number, branch in enumerate(h.branches):
        if not branch.expected:
            continue
        found = branch.error if branch.judged.any() else np.array([np.nan])
        label = f"{h.measured.block.sector} {branch.name}: |Δω|/ω"
        remedy = remedies.of_frequencies, field, h.measured.block, branch.k[branch.judged], number
        for name, value, allowed in (
            ("median", float(np.median(found)), MEDIAN_TOLERANCE),
            ("maximum", float(np.max(found)), MAXIMUM_TOLERANCE),
        ):
            checks.append(judged(f"{label}, {name}", value, allowed, *remedy, value))
    return checks


def _gap_edge_checks(field: Field, held: Sequence[Held]) -> list[Check]:
    """Branches' ends on either side of each gap, as recovered over the judged k, to one bin.

    Over a finite range a branch does not reach its asymptote, so these are not the gap's own edges.
    """
    checks = []
    for sector in dict.fromkeys(h.measured.block.sector for h in held):
        blocks = [h for h in held if h.measured.block.sector == sector]
        branches = [
            (b, (h.measured.block, b.k[b.judged], number))
            for h in blocks
            for number, b in enumerate(h.branches)
            if b.judged.any()
        ]
        if sector not in field.medium.family.travelling:
            # The two relations of the in-plane sector, the lower first.
            branches.sort(key=lambda one: float(one[0].omega_exact[0]))
            branches = list(
                {round(float(b.omega_exact[0])): (b, of) for b, of in branches}.values()
            )
        elif len(branches) < len(blocks[0].branches):
            continue
        step = blocks[0].measured.spectrum.bin * HERTZ
        for gap, lower, upper in zip(
            gaps(field.medium, sector), branches, branches[1:], strict=False
        ):
            for (branch, of), edge, side in (
                (lower, np.max, f"top of {lower[0].name} below"),
                (upper, np.min, f"bottom of {upper[0].name} above"),
            ):
                j = branch.judged
                found, exact = edge(branch.omega[j]), edge(branch.omega_exact[j])
                name = f"{sector} {side} {gap.name}, at judged k"
                remedy = remedies.of_frequencies, field, *of, float(abs(found / exact - 1))
                edges = float(found * HERTZ), float(exact * HERTZ)
                checks.append(judged(name, edges[0], step, *remedy, reference=edges[1], unit="Hz"))
    return checks


def told(h: Held) -> NDArray[np.bool_]:
    """Where complex k can be told: what the record's end may hide of it would not count against it.

    Where that hides more, the simulation is not to blame. Shape (n,), of a block whose attenuation
    was measured.
    """
    curve = h.measured.attenuation
    assert curve is not None
    return np.asarray(curve.error <= _UNCERTAIN * np.abs(curve.k))


def endless_notes(field: Field, held: Sequence[Held]) -> list[str]:
    """What a reader should know beside the checks; arguments as of :func:`judge`."""
    found = []
    if not any(branch.expected for h in held for branch in h.branches):
        duration, frames = field.simulation.duration, field.simulation.frames
        nyquist = (frames - 1) / (2 * duration)
        found.append(
            f"no branch was judged: frequency bins of {1e-3 / duration:.3g} kHz up to "
            f"{nyquist / 1e3:.4g} kHz do not tell the excited branches apart; lengthen [time] "
            "duration for finer bins, raise [time] samples for a higher end"
        )
    curves = [h.measured.attenuation for h in held if h.measured.block.macro]
    if curves and all(curve is None or not len(curve.distance) for curve in curves):
        found.append(
            "no wavenumber could be measured along the bar: lengthen the bar, or leave more room "
            "between the sources"
        )
    weak = faint(held)
    found += _not_judged(field, held) + ([weak] if weak else [])
    return found + energy_note(field)


def _not_judged(field: Field, held: Sequence[Held]) -> list[str]:
    """Notes of the gaps whose attenuation was looked for and can't be told, and what to change."""
    by_remedy: dict[str, list[str]] = {}
    for h in held:
        curve, sector = h.measured.attenuation, h.measured.block.sector
        if curve is None or h.k_exact is None:
            continue
        for gap in gaps(field.medium, sector):
            inside = (curve.omega > gap.lower) & (curve.omega < gap.upper)
            if not inside.any() or told(h)[inside].any():
                continue
            middle = (gap.lower + gap.upper) / 2
            own = [s for s in field.sources if s.field in h.measured.block.fields]
            if any(low <= middle <= high for low, high in (s.excited for s in own)):
                remedy = remedies.to_tell(field, curve, inside, _UNCERTAIN)
            else:
                remedy = f"drive it with a source of {middle * KHZ:.4g} kHz or so"
            names = by_remedy.setdefault(remedy, [])
            name = f"{sector_words(sector)} {gap.name}"
            if name not in names:
                names.append(name)
    return [
        f"not judged, as it can't be told from this record: the attenuation in {', '.join(names)}; "
        f"{remedy}"
        for remedy, names in by_remedy.items()
    ]


def _wavenumber_checks(field: Field, h: Held) -> list[Check]:
    """Complex wavenumber, in each gap and in the bands."""
    curve, exact = h.measured.attenuation, h.k_exact
    if curve is None or exact is None:
        return []
    error = np.where(told(h), np.abs(curve.k / exact - 1), np.nan)
    sector = h.measured.block.sector
    in_bands = np.ones(len(error), bool)
    parts = []
    for gap in gaps(field.medium, sector):
        inside = (curve.omega > gap.lower) & (curve.omega < gap.upper)
        in_bands &= ~inside
        parts.append((f"in {gap.name}", inside))
    parts.append(("in the bands", in_bands))
    checks = []
    for label, where in parts:
        known = error[where & np.isfinite(error)]
        if len(known):
            name = f"{sector} k {label}: |Δk|/|k|, {len(known)} of {where.sum()} frequencies"
            there, omega = np.where(where, error, np.nan), curve.omega + 1j * curve.sigma
            remedy = remedies.of_wavenumbers, field, h.measured.block, omega, there
            checks.append(judged(name, float(known.max()), WAVENUMBER_TOLERANCE, *remedy))
    return checks


def of_endless(field: Field, held: Sequence[Held]) -> Answers:
    """Gaps with the attenuation in their middle, and velocities of long waves, of an endless bar.

    Returns:
        "gaps": name, sector, edges (Hz, of the plane-wave solver), attenuation (dB/m) in the
        middle, measured and exact at ω + iσ, exact at real ω with the distance (m) of 20 dB, and
        what to set to look closer; "receivers" of ``gap_rows.at_receivers``; "full_gaps": where
        none of its waves travels, edges in Hz, if there are any; "velocities": phase velocity
        (m/s) of each acoustic branch at the smallest wavenumber judged.
    """
    rows: list[Row] = []
    family = field.medium.family
    for sector in family.sectors:
        own = [h for h in held if h.measured.block.sector == sector]
        if own or sector in family.unlike:
            rows += [_gap(field, gap, own, sector) for gap in open_gaps(field.medium, sector)]
    none_travels: list[Row] = [
        {"stopped": "all", "lower": low * HERTZ, "upper": high * HERTZ}
        for low, high in full_gaps(field.medium, divided=False)
    ]
    found = {
        "gaps": rows,
        **at_receivers(field, rows),
        "full_gaps": none_travels,
        "velocities": [row for h in held for row in _velocity(h)],
    }
    return {name: rows for name, rows in found.items() if rows or name != "full_gaps"}


def _gap(field: Field, gap: Gap, own: Sequence[Held], sector: str) -> Row:
    row: Row = {
        **gap_row(gap),
        "frequency": None,
        "attenuation": None,
        "attenuation_exact": None,
        "attenuation_at_real_frequency": None,
        "twenty_decibels_within": None,
        "frequencies": 0,
        "closer": "",
        "untold": "",
    }
    middle = (gap.lower + gap.upper) / 2
    if sector in field.medium.family.travelling:
        row |= {"frequency": middle * HERTZ, **steady_loss(field.medium, sector, middle)}
    curves = [h.measured.attenuation for h in own if h.measured.attenuation is not None]
    if sector in field.medium.family.travelling:  # else nothing more is to be seen
        row["closer"] = to_see_more(
            field, sector, gap, max((len(c.omega) for c in curves), default=0)
        )
    for h in own:
        curve, exact = h.measured.attenuation, h.k_exact
        if curve is None or exact is None:
            continue
        known = np.flatnonzero((curve.omega > gap.lower) & (curve.omega < gap.upper) & told(h))
        if not len(known):
            continue
        at = float(np.clip(middle, *curve.omega[known[[0, -1]]]))
        row |= {
            "frequency": at * HERTZ,
            "attenuation": _between(curve.omega[known], curve.k[known].imag, at) * DECIBELS,
            "attenuation_exact": _between(curve.omega[known], exact[known].imag, at) * DECIBELS,
            **steady_loss(field.medium, sector, at),
            "frequencies": len(known),
        }
    if row["attenuation"] is None:
        row["untold"] = _untold(field, gap, sector, [curve.omega for curve in curves])
    return row


def _untold(field: Field, gap: Gap, sector: str, measured: Sequence[NDArray[Any]]) -> str:
    """Why nothing was measured of a gap, with the frequencies (rad/s) at which waves were."""
    family = field.medium.family
    if not any(s.field in b.fields for b in family.blocks_of(sector) for s in field.sources):
        return f"no source drives {sector_words(sector, sector)} waves"
    if sector not in family.travelling:
        return "these waves do not travel"
    if not measured:
        return "the ring is too short to measure a decay along it"
    low, high = (end * KHZ for end in (measured[0][0], measured[0][-1]))
    if not gap.lower * KHZ < high:
        return f"what the sources drive, and frames show, ends at {high:.4g} kHz"
    if not gap.upper * KHZ > low:
        return f"what the sources drive begins at {low:.4g} kHz"
    inside = (measured[0] > gap.lower) & (measured[0] < gap.upper)
    if not inside.any():
        return "it lies between two frequencies: raise [analysis] frequencies"
    return "this record does not tell it: a note below says what to change"


def _between(omega: NDArray[Any], values: NDArray[Any], at: float) -> float:
    """Values at some frequencies at one among them, by a parabola through the three nearest.

    Where there are but two, or one, by the line through them, or that one.
    """
    near = np.argsort(np.abs(omega - at))[:3]
    return float(np.polyfit((omega[near] - at) / at, values[near], len(near) - 1)[-1])


def _velocity(h: Held) -> list[Row]:
    if not h.measured.block.macro:
        return []
    branch = h.branches[0]
    judged = np.flatnonzero(branch.judged)
    if not len(judged):
        return []
    k = branch.k[judged[0]]
    return [
        {
            "wave": branch.name,
            "sector": h.measured.block.sector,
            "wavenumber": float(k),
            "velocity": float(branch.omega[judged[0]] / k),
            "velocity_exact": float(branch.omega_exact[judged[0]] / k),
        }
    ]
