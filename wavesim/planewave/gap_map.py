"""Gap edges of many media at once, and over a plane of any two of their parameters."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wavesim.material.medium import Medium
from wavesim.material.shown import KHZ
from wavesim.planewave.band_edges import form_asymptotes, form_cutoffs
from wavesim.planewave.eigenproblem import Float
from wavesim.planewave.many_media import block_forms, time_scales


def family_gaps(medium: Medium) -> tuple[dict[str, Float], dict[str, Float]]:
    """Lower and upper edges, rad/s, of every gap of a family of media, by name, such as RLB1.

    Parameters may be arrays, and edges are of the shape to which they broadcast: upper = lower
    where a gap is closed, NaN where an edge is not real (an unstable medium).
    """
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


def gap_map(medium: Medium, x: tuple[str, ArrayLike], y: tuple[str, ArrayLike]) -> Any:
    """Edges of every gap over a plane of two parameters.

    Args:
        medium: gives the other parameters and the closure.
        x, y: name of a parameter of the medium and its values, shapes (nx,) and (ny,), in that
            parameter's unit; of several families it is varied in each that has it.

    Returns:
        A dataset (xarray) as that of a sweep of gaps: "lower" and "upper", rad/s, over x, y and
        "gap", of those of :func:`all_edges`.

    Raises:
        ValueError: a name is unknown or used twice, or a value is not admissible.
    """
    from xarray import Dataset  # slow to import

    known = medium.known()
    for name, _ in (x, y):
        if name not in known:
            raise ValueError(f"parameter {name!r}: must be one of {', '.join(known)}")
    if x[0] == y[0]:
        raise ValueError(f"parameter {x[0]!r} is given for both axes: take two different ones")
    axes = {name: np.asarray(values, dtype=float) for name, values in (x, y)}
    plane: dict[str, Any] = dict(zip(axes, np.ix_(*axes.values()), strict=True))
    whose, shape = edge_families(medium), tuple(map(len, axes.values()))
    stacked = (
        np.stack([np.broadcast_to(side[name], shape) for name in whose], axis=-1)
        for side in all_edges(dataclasses.replace(medium, **plane))
    )
    variables: dict[str, Any] = {"status": (tuple(axes), np.ones(shape, np.int8))}
    for side, edges in zip(_SIDES, stacked, strict=True):
        variables[side] = (*axes, "gap"), edges, {"units": "rad/s"}
    coordinates: dict[str, Any] = {
        name: (name, values, {"units": known[name].unit or "1"}) for name, values in axes.items()
    }
    coordinates |= {"gap": list(whose), "family": ("gap", list(whose.values()))}
    return Dataset(variables, coordinates)


_SIDES = ("lower", "upper")


def table(gaps: Any) -> tuple[list[str], Float]:
    """A map as one row for each medium, for a file.

    Returns:
        Names of the columns, each with its unit: the two parameters, then lower and upper edge of
        each gap and of the widest full gap (kHz); and the rows, shape (nx·ny, columns).
    """
    columns, keys = {}, gaps["status"].dims
    grids = np.meshgrid(*(gaps[name] for name in keys), indexing="ij")
    for name, values in zip(keys, grids, strict=True):
        unit = gaps[name].attrs["units"]
        columns[name if unit == "1" else f"{name} ({unit})"] = values
    for name in gaps["gap"].values:
        for side in _SIDES:
            columns[f"{name}_{side} (kHz)"] = KHZ * gaps[side].sel(gap=name).values
    return list(columns), np.column_stack([np.ravel(column) for column in columns.values()])


def room(gaps: Any, band: tuple[float, float]) -> Any:
    """How far inside each gap a band (Hz) is, rad/s, as ``gaps["lower"]``; held where ≥ 0."""
    low, high = (2 * math.pi * end for end in band)
    return np.minimum(low - gaps["lower"], gaps["upper"] - high)
