"""The ends of a bar: what they send back, and what is driven at them.

(a at 0, b at L) = R (b at 0, a at L) + p. Fixed: φ = g; free: σ·n = g with n outward; at both the
double stress V is 0, the natural condition on a micro-field. Absorbing: the end's medium goes
on for ever. Periodic: what leaves at one end comes in at the other.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wavesim.layered.stack import Stack
from wavesim.layered.star_product import Piece, times
from wavesim.layered.uniform_layer import reflection
from wavesim.material.layers import ENDS


def check_ends(left: str, right: str, allowed: tuple[str, ...] = ENDS) -> None:
    """Hold the names of two ends to what is known.

    Raises:
        ValueError: an end is unknown, or one is periodic and the other not.
    """
    for name, end in (("left", left), ("right", right)):
        if end not in allowed:
            raise ValueError(f"{name} = {end!r}: must be one of {', '.join(allowed)}")
    if (left == "periodic") != (right == "periodic"):
        raise ValueError(f"left = {left!r}, right = {right!r}: both ends must be periodic, or none")


def returned(stack: Stack, left: str, right: str) -> Any:
    """R, shape (N, 2n, 2n)."""
    n, count = len(stack.impedance), len(stack.scaled)
    R = np.zeros((count, 2 * n, 2 * n), dtype=complex)
    if left == "periodic":
        R[:, range(n), range(n, 2 * n)] = R[:, range(n, 2 * n), range(n)] = 1
        return R
    for place, end in ((0, left), (n, right)):
        inside = slice(place, place + n)
        if end == "absorbing":
            R[:, inside, inside] = reflection(stack.end_waves(place > 0), place > 0)
            continue
        R[:, range(place, place + n), range(place, place + n)] = 1
        if end == "fixed" and stack.block.macro:
            R[:, place, place] = -1
    return R


def waves_at_ends(whole: Piece, R: Any, p: Any) -> Any:
    """(a at 0, b at L) of a bar with sources in it and p at its ends, shape (N, 2n)."""
    unit = np.eye(R.shape[-1])
    out = np.linalg.solve(unit - whole.whole @ R, (times(whole.whole, p) + whole.sent)[..., None])
    return times(R, out[..., 0]) + p
