"""The bands of a medium as plain data: the JSON object and the table of ``wavesim bands``."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wavesim.material.medium import Medium
from wavesim.planewave.dispersion_relation import (
    Gap,
    asymptotes,
    block_frequencies,
    cutoffs,
    frequencies,
    full_gaps,
    gaps,
)

# Wavenumbers at which branches are told, evenly from 0 to k̄ = 1.
_POINTS = 401


def summary(medium: Medium) -> dict[str, Any]:
    """Everything the plane-wave solver says about a medium, as an object that JSON can hold.

    Returns:
        {"medium": parameters and closure, SI; "units": how ω̄ and k̄ are made of ω and k;
        "sectors": {sector: {"k": (401,) rad/m, "omega": (401, 3) rad/s, ascending at
        each k, "branches", "cutoffs", "asymptotes" (rad/s, ascending), "gaps": [{"name",
        "lower", "upper"}] rad/s, upper = lower where closed}}; "full_gaps": [[lower, upper]];
        of several families "full_gaps_of": {family: those of its waves alone}}.

    Raises:
        NotHyperbolicError: an ω(k) of the medium is not real.
    """
    k = np.linspace(0.0, 2 * math.pi / float(medium.length_scale), _POINTS)
    sectors = {
        sector: {
            "k": k.tolist(),
            "omega": frequencies(medium, sector, k).tolist(),
            "branches": [
                name for block in medium.family.blocks_of(sector) for name in block.branches
            ],
            "cutoffs": cutoffs(medium, sector).tolist(),
            "asymptotes": asymptotes(medium, sector).tolist(),
            "gaps": [
                {"name": gap.name, "lower": gap.lower, "upper": gap.upper}
                for gap in gaps(medium, sector)
            ],
        }
        for sector in medium.family.sectors
    }
    several = {
        part.family.name: [[low, high] for low, high in full_gaps(part)] for part in medium.parts
    }
    return {
        "medium": medium.described,
        "units": {
            "omega_bar_per_omega": float(medium.time_scale),
            "k_bar_per_k": float(medium.length_scale) / (2 * math.pi),
        },
        "sectors": sectors,
        "full_gaps": [[low, high] for low, high in full_gaps(medium)],
    } | ({"full_gaps_of": several} if len(several) > 1 else {})


def _row(
    medium: Medium,
    sector: str,
    branch: str,
    cutoff: float,
    asymptote: float | None,
    gap: Gap | None,
) -> dict[str, Any]:
    values = {
        "cutoff": cutoff,
        "asymptote": asymptote,
        "gap_lower": gap.lower if gap else None,
        "gap_upper": gap.upper if gap else None,
    }
    row: dict[str, Any] = {"sector": sector, "branch": branch, "gap": gap.name if gap else None}
    for name, omega in values.items():
        row[f"{name}_hz"] = None if omega is None else omega / (2 * math.pi)
        row[f"{name}_bar"] = None if omega is None else omega * float(medium.time_scale)
    return row


def table(medium: Medium) -> list[dict[str, Any]]:
    """One row for each distinct branch: where it starts, where it tends to, the gap above it.

    Returns:
        Rows, by sector and ascending in frequency, each with "sector" (the two transverse
        sectors share theirs), "branch", "cutoff_hz", "cutoff_bar" (at k = 0, in Hz and as ω̄),
        "asymptote_hz", "asymptote_bar" (k → ∞ with Γ → 0; None for a branch that rises without
        end), "gap" (name of the gap above the branch), "gap_lower_hz", "gap_upper_hz",
        "gap_lower_bar", "gap_upper_bar"; None where no gap is above.
    """
    rows, family = [], medium.family
    for sector in (s for s in family.unlike if s in family.travelling):
        (block,) = family.blocks_of(sector)
        alike = [s for s in family.sectors if family.gap_names(s) == family.gap_names(sector)]
        label = ", ".join(alike)
        starts = (0.0, *cutoffs(medium, sector).tolist())
        ends = (*asymptotes(medium, sector).tolist(), None)
        above = (*gaps(medium, sector), None)
        for branch, start, end, gap in zip(block.branches, starts, ends, above, strict=True):
            rows.append(_row(medium, label, branch, start, end, gap))
    for sector in (s for s in family.sectors if s not in family.travelling):
        (shear,) = gaps(medium, sector)
        lines = [
            (omega, branch)
            for block in family.blocks_of(sector)
            for omega, branch in zip(
                block_frequencies(medium, block, 0.0)[0].tolist(), block.branches, strict=True
            )
        ]
        lines.sort(key=lambda line: float(f"{line[0]:.10g}"))  # two are equal but for rounding
        for i, (line, branch) in enumerate(lines):
            rows.append(_row(medium, sector, branch, line, line, None if i else shear))
    return rows
