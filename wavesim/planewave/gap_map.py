"""Gap edges over a plane of any two parameters, all media at once."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wavesim.material.medium import PARAMETERS, Medium
from wavesim.material.sectors import blocks_of
from wavesim.planewave.band_edges import GAP_NAMES, form_asymptotes, form_cutoffs
from wavesim.planewave.eigenproblem import Float
from wavesim.planewave.many_media import block_forms

GAPS = ("RLB1", "RLB2", "RTB1", "RTB2", "RSB")


@dataclass(frozen=True)
class GapMap:
    """Gap edges over a family of media of shape S, rad/s.

    Attributes:
        medium: the family; parameters that were varied are arrays that broadcast to S.
        lower, upper: edges by name of the gap, RLB1, RLB2, RTB1, RTB2, RSB, each of shape S;
            upper = lower where closed, NaN where an edge is not real (an unstable medium).
        full_lower, full_upper: the widest interval in which no wave of any kind propagates,
            shape S; equal where there is none.
        x, y: names of the parameters along the last and the last but one axis.
    """

    medium: Medium
    lower: dict[str, Float]
    upper: dict[str, Float]
    full_lower: Float
    full_upper: Float
    x: str
    y: str

    def width(self, name: str) -> Float:
        """Width of a gap, or of the widest "full" gap, shape S, rad/s."""
        if name == "full":
            return self.full_upper - self.full_lower
        return self.upper[name] - self.lower[name]


def family_gaps(medium: Medium) -> tuple[dict[str, Float], dict[str, Float]]:
    """Lower and upper edges, rad/s, of every gap of a family of media; see :class:`GapMap`."""
    to_si = 1 / np.asarray(medium.time_scale)
    lower: dict[str, Float] = {}
    upper: dict[str, Float] = {}
    for sector in ("longitudinal", "transverse2"):
        (block,) = blocks_of(sector)
        forms = block_forms(medium, block)
        starts, ends = form_asymptotes(forms), form_cutoffs(forms)
        for i, name in enumerate(GAP_NAMES[sector]):
            lower[name] = starts[..., i] * to_si
            upper[name] = np.maximum(lower[name], ends[..., i] * to_si)
    lines = inplane_lines(medium)
    lower["RSB"], upper["RSB"] = lines[..., 0], lines[..., -1]
    return lower, upper


def inplane_lines(medium: Medium) -> Float:
    """The frequencies of the three in-plane waves of a family, ascending, S + (3,), rad/s."""
    found = [form_cutoffs(block_forms(medium, block)) for block in blocks_of("inplane")]
    return np.sort(np.concatenate(found, axis=-1)) / np.asarray(medium.time_scale)[..., None]


def widest_full_gap(medium: Medium) -> tuple[Float, Float]:
    """The widest interval in which no wave of any kind propagates: its edges, rad/s, shape S."""
    lower, upper = family_gaps(medium)
    lines = inplane_lines(medium)
    starts, ends = [], []
    for along in GAP_NAMES["longitudinal"]:
        for across in GAP_NAMES["transverse2"]:
            low = np.maximum(lower[along], lower[across])[..., None]
            high = np.maximum(low, np.minimum(upper[along], upper[across])[..., None])
            marks = np.concatenate([low, np.clip(lines, low, high), high], axis=-1)
            starts.append(marks[..., :-1])
            ends.append(marks[..., 1:])
    start, end = np.concatenate(starts, axis=-1), np.concatenate(ends, axis=-1)
    width = np.where(np.isnan(end - start), -1.0, end - start)
    widest = np.argmax(width, axis=-1)[..., None]
    return (
        np.take_along_axis(start, widest, axis=-1)[..., 0],
        np.take_along_axis(end, widest, axis=-1)[..., 0],
    )


def gap_map(medium: Medium, x: tuple[str, ArrayLike], y: tuple[str, ArrayLike]) -> GapMap:
    """Edges of every gap over a plane of two parameters.

    Args:
        medium: gives the other parameters and the closure.
        x, y: name of a parameter of :class:`wavesim.material.medium.Medium` and its values, shapes
            (nx,) and (ny,), in that parameter's unit.

    Returns:
        The map, arrays of shape (ny, nx).

    Raises:
        ValueError: a name is unknown or used twice, or a value is not admissible.
    """
    for name, _ in (x, y):
        if name not in PARAMETERS:
            raise ValueError(f"parameter {name!r}: must be one of {', '.join(PARAMETERS)}")
    if x[0] == y[0]:
        raise ValueError(f"parameter {x[0]!r} is given for both axes: take two different ones")
    varied: dict[str, Any] = {
        x[0]: np.asarray(x[1], dtype=float)[None, :],
        y[0]: np.asarray(y[1], dtype=float)[:, None],
    }
    family = dataclasses.replace(medium, **varied)
    shape = (varied[y[0]].shape[0], varied[x[0]].shape[1])
    lower, upper = family_gaps(family)
    full_lower, full_upper = widest_full_gap(family)

    def spread(edges: dict[str, Float]) -> dict[str, Float]:
        return {name: np.broadcast_to(edge, shape) for name, edge in edges.items()}

    return GapMap(family, spread(lower), spread(upper), full_lower, full_upper, x[0], y[0])


def table(gaps: GapMap) -> tuple[list[str], Float]:
    """The map as one row for each medium, for a file.

    Returns:
        Names of the columns: the two parameters, then lower and upper edge of each gap and of
        the widest full gap, rad/s; and the rows, shape (ny·nx, columns).
    """
    shape = gaps.full_lower.shape
    columns = {
        gaps.x: np.broadcast_to(getattr(gaps.medium, gaps.x), shape),
        gaps.y: np.broadcast_to(getattr(gaps.medium, gaps.y), shape),
    }
    for name in gaps.lower:
        columns[f"{name}_lower"], columns[f"{name}_upper"] = gaps.lower[name], gaps.upper[name]
    columns["full_lower"], columns["full_upper"] = gaps.full_lower, gaps.full_upper
    return list(columns), np.column_stack([np.ravel(column) for column in columns.values()])
