"""Gap edges of a family of media whose parameters are arrays, all at once."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from wavesim.material.medium import Medium
from wavesim.planewave.band_edges import form_asymptotes, form_cutoffs
from wavesim.planewave.eigenproblem import Float
from wavesim.planewave.many_media import block_forms, time_scales


def family_gaps(medium: Medium) -> tuple[dict[str, Float], dict[str, Float]]:
    """Lower and upper edges of every gap of a family of media, by name, such as RLB1.

    Args:
        medium: parameters that are numbers or arrays which broadcast to one shape S.

    Returns:
        Edges of shape S each, rad/s; upper = lower where closed, NaN where an edge is not real (an
        unstable medium).
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


def room(lower: Any, upper: Any, band: tuple[float, float]) -> Any:
    """How far inside gaps a band is: the nearer distance of its ends (Hz) from their edges (rad/s).

    Returns:
        Shape of the edges, rad/s; a gap holds all of the band where it is 0 or more.
    """
    low, high = (2 * math.pi * end for end in band)
    return np.minimum(low - lower, upper - high)
