"""Branches followed by the continuity of their mode shapes, never by sorting alone.

Two eigenvalues that cross belong to modes that pass through each other; two that only come near
exchange their shapes over a short way and turn back. Sorting takes every crossing for a near
miss; a coarse overlap takes every near miss for a crossing. Here an interval is divided until the
overlap of the modes over it is clear and, where by it two modes change places, until either they
are seen to turn back or the crossing is pinned down.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wavesim.material.assignment import assigned
from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.planewave.eigenproblem import Eigenmodes, Float, solve, spectral_form
from wavesim.planewave.hyperbolicity import real_frequencies

# An assignment is clear when every mode keeps at least this much of its (squared) shape.
_CLEAR = 0.7
# ω² nearer than this, relative to the largest, are one: their modes are known only together.
_EQUAL = 1e-10
_DIVISIONS = 40
# Not the middle, where a symmetric interval has its crossing and the modes are mixed at will.
_DIVIDE_AT = 0.4453

Solver = Callable[[Float], Eigenmodes]


def _overlaps(before: Eigenmodes, after: Eigenmodes) -> Float:
    """|u_i† v_j|² of left modes before and right modes after, rows of sum about one."""
    raw = np.abs(np.swapaxes(before.left, -1, -2) @ after.right)
    back = np.abs(np.swapaxes(after.left, -1, -2) @ before.right)
    return np.asarray(raw * np.swapaxes(back, -1, -2))


def _assign(before: Eigenmodes, after: Eigenmodes) -> tuple[Any, bool]:
    """Which mode after continues each mode before, and whether that is settled.

    It is settled if every mode keeps its shape and its place; modes of one frequency count as
    one, in shape and in place.
    """
    overlaps = _overlaps(before, after)
    target = assigned(-overlaps)[1]
    squares = np.real(after.squares)
    together = np.abs(squares[:, None] - squares) <= _EQUAL * np.abs(squares).max()
    kept = np.sum(overlaps * together[target], axis=1)
    in_place = together[target, np.arange(len(target))]
    return target, bool((kept >= _CLEAR).all() and in_place.all())


def _pick(modes: Eigenmodes, i: int | slice) -> Eigenmodes:
    return Eigenmodes(modes.squares[i], modes.right[i], modes.left[i])


def _link(
    solver: Solver, x: tuple[float, float], ends: tuple[Eigenmodes, Eigenmodes], divisions: int
) -> Any:
    target, settled = _assign(*ends)
    if settled or divisions == 0:
        return target
    middle = x[0] + _DIVIDE_AT * (x[1] - x[0])
    between = _pick(solver(np.array([middle])), 0)
    first = _link(solver, (x[0], middle), (ends[0], between), divisions - 1)
    second = _link(solver, (middle, x[1]), (between, ends[1]), divisions - 1)
    return second[first]


def track(solver: Solver, points: Float) -> Any:
    """Follow every mode of an eigenproblem along a line of points.

    Args:
        solver: gives the modes at points of shape (n,), ascending.
        points: where to follow them, shape (n,), monotonic.

    Returns:
        Indices, shape (n, m): column j holds the place, in ascending order, of the mode that
        starts as the j-th at the first point.
    """
    modes = solver(points)
    order = np.empty(modes.squares.shape, dtype=int)
    order[0] = np.arange(order.shape[1])
    before, after = _pick(modes, slice(None, -1)), _pick(modes, slice(1, None))
    kept = np.diagonal(_overlaps(before, after), axis1=-2, axis2=-1)
    plain = np.all(kept >= _CLEAR, axis=-1)
    for i, clear in enumerate(plain.tolist(), start=1):
        order[i] = order[i - 1]
        if not clear:
            x = float(points[i - 1]), float(points[i])
            step = _link(solver, x, (_pick(modes, i - 1), _pick(modes, i)), _DIVISIONS)
            order[i] = step[order[i - 1]]
    return order


def follow(medium: Medium, block: Block, k: ArrayLike) -> Float:
    """ω(k) of the branches of one block, followed through crossings and near misses.

    Args:
        medium: the medium.
        block: one of its family's blocks.
        k: wavenumbers to follow them over, shape (n,), monotonic, rad/m.

    Returns:
        Shape (n, branches), rad/s; a column is one branch, in the order of ``block.branches``, in
        which they start at the first k.

    Raises:
        NotHyperbolicError: an ω(k) is not real.
    """
    given = np.atleast_1d(np.asarray(k, dtype=float))
    scaled, form = given * medium.length_scale, spectral_form(medium, block)
    omega = real_frequencies(solve(form, scaled), scaled, block, medium) / medium.time_scale
    order = track(lambda points: solve(form, points), scaled)
    return np.take_along_axis(omega, order, axis=1)
