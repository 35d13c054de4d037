"""Gap edges over a plane of any two parameters, all media at once."""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wavesim.material.medium import Medium
from wavesim.planewave.band_edges import form_asymptotes, form_cutoffs
from wavesim.planewave.eigenproblem import Float
from wavesim.planewave.many_media import block_forms, time_scales


@dataclass(frozen=True)
class GapMap:
    """Gap edges over a family of media of shape S, rad/s.

    Attributes:
        medium: the family; parameters that were varied are arrays that broadcast to S.
        lower, upper: edges by name of the gap, such as RLB1, each of shape S;
            upper = lower where closed, NaN where an edge is not real (an unstable medium). Where
            waves of several families run, "translation-full" is the widest interval in which none
            of one family propagates.
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

    def edges(self, name: str) -> tuple[Float, Float]:
        """Lower and upper edge of a gap, or of the widest "full" gap, shape S each, rad/s."""
        if name == "full":
            return self.full_lower, self.full_upper
        return self.lower[name], self.upper[name]

    def width(self, name: str) -> Float:
        """Width of a gap, or of the widest "full" gap, shape S, rad/s."""
        lower, upper = self.edges(name)
        return upper - lower

    def covers(self, name: str, band: tuple[float, float]) -> Any:
        """Where a gap, or the widest "full" one, holds all of a band (rad/s), mask of shape S."""
        lower, upper = self.edges(name)
        return (lower <= band[0]) & (band[1] <= upper)


def family_gaps(medium: Medium) -> tuple[dict[str, Float], dict[str, Float]]:
    """Lower and upper edges, rad/s, of every gap of a family of media; see :class:`GapMap`."""
    lower: dict[str, Float] = {}
    upper: dict[str, Float] = {}
    family = medium.family
    for sector in (s for s in family.unlike if s in family.travelling):
        (block,) = family.blocks_of(sector)
        forms = block_forms(medium, block)
        starts, ends = form_asymptotes(forms), form_cutoffs(forms)
        to_si = 1 / time_scales(medium, block)
        for i, name in enumerate(family.gap_names(sector)):
            lower[name] = starts[..., i] * to_si
            upper[name] = np.maximum(lower[name], ends[..., i] * to_si)
    for sector in (s for s in family.sectors if s not in family.travelling):
        ((name,), lines) = family.gap_names(sector), standing_lines(medium, sector)
        lower[name], upper[name] = lines[..., 0], lines[..., -1]
    names = family.all_gaps
    return {name: lower[name] for name in names}, {name: upper[name] for name in names}


def standing_lines(medium: Medium, sector: str) -> Float:
    """Frequencies of a sector of micro-fields alone, ascending, S + (waves,), rad/s."""
    blocks = medium.family.blocks_of(sector)
    found = [form_cutoffs(block_forms(medium, block)) for block in blocks]
    unit = time_scales(medium, blocks[0])[..., None]
    return np.sort(np.concatenate(found, axis=-1)) / unit


def widest_full_gap(medium: Medium) -> tuple[Float, Float]:
    """The widest interval in which no wave of any kind propagates: its edges, rad/s, shape S."""
    lower, upper = family_gaps(medium)
    family = medium.family
    standing = [s for s in family.sectors if s not in family.travelling]
    lines = [standing_lines(medium, sector) for sector in standing]
    moving = [family.gap_names(s) for s in family.unlike if s in family.travelling]
    starts, ends = [], []
    for names in itertools.product(*moving):
        low = np.max(np.broadcast_arrays(*(lower[name] for name in names)), axis=0)[..., None]
        high = np.min(np.broadcast_arrays(*(upper[name] for name in names)), axis=0)[..., None]
        high = np.maximum(low, high)
        inside = [np.clip(own, low, high) for own in lines]
        marks = np.concatenate([low, *inside, high], axis=-1)
        if len(standing) > 1:
            marks = np.sort(marks, axis=-1)
        starts.append(marks[..., :-1])
        ends.append(marks[..., 1:])
    start, end = np.concatenate(starts, axis=-1), np.concatenate(ends, axis=-1)
    width = np.where(np.isnan(end - start), -1.0, end - start)
    widest = np.argmax(width, axis=-1)[..., None]
    return (
        np.take_along_axis(start, widest, axis=-1)[..., 0],
        np.take_along_axis(end, widest, axis=-1)[..., 0],
    )


def all_edges(medium: Medium) -> tuple[dict[str, Float], dict[str, Float]]:
    """Those of every gap, of what is full of each of several families, and of what is "full"."""
    lower, upper = family_gaps(medium)
    several = medium.parts if len(medium.parts) > 1 else ()
    for name, one in [*((f"{part.family.name}-full", part) for part in several), ("full", medium)]:
        lower[name], upper[name] = widest_full_gap(one)
    return lower, upper


def edge_families(medium: Medium) -> dict[str, str]:
    """Whose waves each of :func:`all_edges` is of, in their order."""
    parts = medium.parts
    names = [part.family.name for part in parts]
    of_gaps = [part.family.name for part in parts for _ in part.family.all_gaps]
    found = dict(zip(medium.family.all_gaps, of_gaps, strict=True))
    own_full = {f"{name}-full": name for name in names if len(names) > 1}
    return found | own_full | {"full": " and ".join(names)}


def gap_map(medium: Medium, x: tuple[str, ArrayLike], y: tuple[str, ArrayLike]) -> GapMap:
    """Edges of every gap over a plane of two parameters.

    Args:
        medium: gives the other parameters and the closure.
        x, y: name of a parameter of the medium and its values, shapes (nx,) and (ny,), in that
            parameter's unit; of several families it is varied in each that has it.

    Returns:
        The map, arrays of shape (ny, nx).

    Raises:
        ValueError: a name is unknown or used twice, or a value is not admissible.
    """
    for name, _ in (x, y):
        if name not in medium.known():
            raise ValueError(f"parameter {name!r}: must be one of {', '.join(medium.known())}")
    if x[0] == y[0]:
        raise ValueError(f"parameter {x[0]!r} is given for both axes: take two different ones")
    varied: dict[str, Any] = {
        x[0]: np.asarray(x[1], dtype=float)[None, :],
        y[0]: np.asarray(y[1], dtype=float)[:, None],
    }
    family = dataclasses.replace(medium, **varied)
    shape = (varied[y[0]].shape[0], varied[x[0]].shape[1])
    lower, upper = (
        {name: np.broadcast_to(edge, shape) for name, edge in edges.items()}
        for edges in all_edges(family)
    )
    return GapMap(family, lower, upper, lower.pop("full"), upper.pop("full"), x[0], y[0])


def table(gaps: GapMap) -> tuple[list[str], Float]:
    """The map as one row for each medium, for a file.

    Returns:
        Names of the columns, each with its unit: the two parameters, then lower and upper edge of
        each gap and of the widest full gap (kHz); and the rows, shape (ny·nx, columns).
    """
    shape = gaps.full_lower.shape
    columns = {}
    for name in (gaps.x, gaps.y):
        unit = gaps.medium.known()[name].unit
        heading = f"{name} ({unit})" if unit else name
        columns[heading] = np.broadcast_to(getattr(gaps.medium, name), shape)
    edges = {name: (gaps.lower[name], gaps.upper[name]) for name in gaps.lower}
    edges["full"] = gaps.full_lower, gaps.full_upper
    for name, pair in edges.items():
        for side, edge in zip(("lower", "upper"), pair, strict=True):
            columns[f"{name}_{side} (kHz)"] = edge * 1e-3 / (2 * math.pi)
    return list(columns), np.column_stack([np.ravel(column) for column in columns.values()])
