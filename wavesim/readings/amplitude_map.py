"""Amplitude over time and position, in tiles that a picture can show: √2 times the rms in each,
and where waves overlap in it that have gone round a ring.

The mean is over a tile, and in time over a period of what the sources drive at least: the phase of
a wave, which no picture of a whole record can resolve, leaves no pattern.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.planewave.dispersion_relation import block_group_velocity
from wavesim.simulation.field import Field

Float = NDArray[Any]

# Frames are read so many at a time that they fit into these bytes.
_AT_ONCE = 64e6


def amplitude_map(field: Field, sector: str, most: tuple[int, int]) -> Float:
    """√2 times the root of the mean of Σq² over tiles, q the sector's components.

    Args:
        field: the field.
        sector: one that was set in motion.
        most: tiles in time and along the bar, at most.

    Returns:
        Shape (times, positions), even in both, in the scaled units of ``field.components``.
    """
    blocks = [block for block in field.blocks if block.sector == sector]
    high, wide = (-(-n // m) for n, m in zip((len(field.t), field.bar.cells), most, strict=True))
    rows = high * max(1, int(_AT_ONCE / (32 * field.bar.cells * high)))
    found = []
    for low in range(0, len(field.t), rows):
        square: Any = 0.0
        for block in blocks:
            for values, _ in field.components(block, slice(low, low + rows)):
                values *= values
                square = square + values[:, : field.bar.cells]
        found.append(_means(_means(square, 0, high), 1, wide))
    mean = _over_a_period(np.concatenate(found), field, high)
    if not field.bar.uniform:
        # A picture has even columns: each shows the tile that its place lies in.
        x = field.bar.half_nodes[::wide]
        even = (np.arange(len(x)) + 0.5) * field.bar.length / len(x)
        mean = mean[:, np.clip(np.searchsorted(x, even) - 1, 0, len(x) - 1)]
    return np.asarray(np.sqrt(2 * mean))


def tile_ends(field: Field, most: tuple[int, int]) -> tuple[float, float, float]:
    """Where the tiles of :func:`amplitude_map` end at the right, m, and begin and end in time, s.

    A frame stands in the middle of its interval, so that they begin half a one before t = 0; the
    last tile may reach beyond the bar and the record.
    """
    high, wide = (-(-n // m) for n, m in zip((len(field.t), field.bar.cells), most, strict=True))
    rows, columns = -(-len(field.t) // high), -(-field.bar.cells // wide)
    length = columns * wide * field.bar.spacing if field.bar.uniform else field.bar.length
    return length, -0.5 * field.interval, (rows * high - 0.5) * field.interval


def _means(values: Float, axis: int, step: int) -> Float:
    """Mean of each tile of so many along an axis; the last may be smaller."""
    if step <= 1:
        return values
    first = np.arange(0, values.shape[axis], step)
    size = np.diff([*first, values.shape[axis]])
    total = np.add.reduceat(values, first, axis=axis)
    return np.asarray(total / (size[:, None] if axis == 0 else size))


def _over_a_period(mean: Float, field: Field, high: int) -> Float:
    """Running mean in time over a period of the slowest source, where tiles are shorter."""
    peaked = [s.peak_frequency for s in field.sources if math.isfinite(s.peak_frequency)]
    if not peaked or min(peaked) <= 0:
        return mean
    reach = round(0.5 / min(peaked) / (high * field.interval))
    reach = min(reach, (len(mean) - 1) // 2)
    if reach < 1:
        return mean
    total = np.cumsum(np.concatenate([np.zeros((1, mean.shape[1])), mean]), axis=0)
    at = np.arange(len(mean))
    first, last = np.maximum(at - reach, 0), np.minimum(at + reach + 1, len(mean))
    return np.asarray((total[last] - total[first]) / (last - first)[:, None])


def gone_round(field: Field, sector: str) -> list[tuple[list[float], list[float]]]:
    """Where the fastest wave is once it has gone round the bar: beyond it waves overlap.

    Args:
        field: the field.
        sector: of the waves.

    Returns:
        Positions (m) and times (s) of the two ends of each line; none where no wave goes round.
    """
    blocks = [block for block in field.blocks if block.sector == sector and block.macro]
    sources = [s for s in field.sources if any(s.field in block.fields for block in blocks)]
    if not field.bar.periodic or not sources:
        return []
    length, end = field.bar.length, float(field.t[-1])
    k = [np.pi / field.bar.spacing]
    speed = max(float(block_group_velocity(field.medium, b, k).max()) for b in blocks)
    lines = []
    for begin, x in dict.fromkeys((max(s.onset, 0.0), s.position) for s in sources):
        for there, start, way in ((length - x, 0.0, 1.0), (x, length, -1.0)):
            back = begin + there / speed
            if back >= end:
                continue
            last = start + way * min(speed * (end - back), length)
            lines.append(([start, last], [back, back + abs(last - start) / speed]))
    return lines
