"""Places in two or three coordinates as places along a line."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError

Float = NDArray[Any]

# Spots further off a straight line than this part of it are on none.
_CROOKED = 0.1


def along_line(spots: Float, name: str = "") -> tuple[Float, str]:
    """Two or three coordinates as one along the straight line that fits them best.

    Args:
        spots: shape (n, 2) or (n, 3), any unit.
        name: of what they are, before a message.

    Returns:
        Shape (n,), in their unit: the coordinate itself where one alone varies, else distances
        along the line from the first spot on; and what is worth saying.

    Raises:
        RecordError: they are on no line.
    """
    moves = np.ptp(spots, axis=0)
    if (moves > 1e-9 * max(moves.max(), 1e-300)).sum() <= 1:
        return spots[:, int(np.argmax(moves))], ""
    at = spots - spots.mean(axis=0)
    x = at @ line_of(at)
    off = float(np.linalg.norm(at - np.outer(x, line_of(at)), axis=1).max())
    length = float(np.ptp(x))
    if off > _CROOKED * length:
        raise RecordError(
            f"{name}positions are on no straight line: up to {off:.3g} off one of {length:.3g}; "
            "give them along their line with --positions"
        )
    said = f"{name}distances along a line from the first receiver"
    if off > 1e-3 * length:
        said += f", which they are up to {off:.3g} off"
    return x - x[0], said


def line_of(at: Float) -> Float:
    """The direction in which spots about 0 lie, most of them ahead of the first, a unit vector."""
    direction = np.asarray(np.linalg.svd(at, full_matrices=False)[2][0])
    return direction if at[0] @ direction <= 0 else -direction
