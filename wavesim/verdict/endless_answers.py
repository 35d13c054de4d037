"""What a run on a ring found, in the few rows that a reader asks for first: gaps, velocities.

Each measured number stands beside the exact one. The rows go into summary.json as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.family import sector_words
from wavesim.material.shown import DECIBELS, HERTZ, KHZ
from wavesim.planewave.dispersion_relation import Gap, full_gaps, open_gaps, wavenumber
from wavesim.simulation.field import Field
from wavesim.verdict.branches import Held
from wavesim.verdict.endless import told
from wavesim.verdict.gap_advice import Answers, Row, to_see_more


def of_endless(field: Field, held: Sequence[Held]) -> Answers:
    """Gaps with the attenuation in their middle, and velocities of long waves, of an endless bar.

    Returns:
        "gaps": name, sector, edges (Hz, of the plane-wave solver), attenuation (dB/m) in the
        middle, measured and exact at ω + iσ, exact at real ω, and what to set to look closer;
        "full_gaps": where no wave at all travels, edges in Hz, if there are any; "velocities":
        phase velocity (m/s) of each acoustic branch at the smallest wavenumber judged.
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
        "full_gaps": none_travels,
        "velocities": [row for h in held for row in _velocity(h)],
    }
    return {name: rows for name, rows in found.items() if rows or name != "full_gaps"}


def _gap(field: Field, gap: Gap, own: Sequence[Held], sector: str) -> Row:
    row: Row = {
        "gap": gap.name,
        "sector": sector,
        "lower": gap.lower * HERTZ,
        "upper": gap.upper * HERTZ,
        "frequency": None,
        "attenuation": None,
        "attenuation_exact": None,
        "attenuation_at_real_frequency": None,
        "frequencies": 0,
        "closer": "",
        "untold": "",
    }
    middle = (gap.lower + gap.upper) / 2
    if sector in field.medium.family.travelling:
        row |= {"frequency": middle * HERTZ, **_steady_loss(field, sector, middle)}
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
            **_steady_loss(field, sector, at),
            "frequencies": len(known),
        }
    if row["attenuation"] is None:
        row["untold"] = _untold(field, gap, sector, [curve.omega for curve in curves])
    return row


def _steady_loss(field: Field, sector: str, omega: float) -> Row:
    real = wavenumber(field.medium, sector, np.array([omega]))[0]
    return {"attenuation_at_real_frequency": float(real.imag) * DECIBELS}


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
