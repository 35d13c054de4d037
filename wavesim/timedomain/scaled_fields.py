"""Fields in SI, and the components of blocks that the operator acts on, scaled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wavesim.material.family import Block, grouped
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales


def to_scaled(fields: Mapping[str, Any], blocks: Sequence[Block], medium: Medium) -> list[Any]:
    """Fields in SI as components (φ, B) of each group; fields not named are 0.

    Args:
        fields: {field: shape (…, points)}.
        blocks: those of the operator.
        medium: whose units it is scaled by.

    Returns:
        (φ, B) of each group, shapes (components, blocks, …, points).
    """
    units = scales(medium)
    shape = np.shape(next(iter(fields.values())))
    found: list[Any] = []
    for stacked in grouped(blocks):
        pair = []
        for kinds in zip(*((block.macro, block.micro) for block in stacked), strict=True):
            values = np.zeros((len(kinds[0]), len(stacked), *shape))
            for s, parts in enumerate(kinds):
                for i, part in enumerate(parts):
                    for name in set(part) & set(fields):
                        values[i, s] += part[name] / units.unit(name) * fields[name]
            pair.append(values)
        found.append(tuple(pair))
    return found


def to_fields(pairs: Sequence[Any], blocks: Sequence[Block], medium: Medium) -> dict[str, Any]:
    """The fields in SI of (φ, B) of each group; inverse of :func:`to_scaled`.

    Args:
        pairs: shapes (…, components, blocks, points) each, numpy or jax.
        blocks: those of the operator.
        medium: whose units it is scaled by.

    Returns:
        {field: shape (…, points)}, of every field that the blocks combine.
    """
    units = scales(medium)
    fields: dict[str, Any] = {}
    for (phi, B), stacked in zip(pairs, grouped(blocks), strict=True):
        for s, block in enumerate(stacked):
            for values, parts in ((phi, block.macro), (B, block.micro)):
                for i, part in enumerate(parts):
                    for name, weight in part.items():
                        term = weight * units.unit(name) * values[..., i, s, :]
                        fields[name] = fields[name] + term if name in fields else term
    ordered = [name for block in blocks for name in block.fields]
    return {name: fields[name] for name in dict.fromkeys(ordered)}
