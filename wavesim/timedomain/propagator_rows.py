"""Rows of the exact propagator C = cos(h√−L) of a bar without losses, as dense matrices.

Points are taken in runs of 32, begun anew at each layer. The rows of a run (``cosine_rows.py``) are
one dense matrix on the window about it, and equal windows hold one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.timedomain.cosine_rows import Runs, cosine_rows
from wavesim.timedomain.operator import Group
from wavesim.timedomain.sources_within_step import picked
from wavesim.timedomain.time_step import RUN, TimeStep

# Rows of fewer runs than these are held for each run by itself, though they be equal.
_FEW = 4


class Rows(eqx.Module):
    """Rows of 2(C − 1) of blocks that are alike in everything.

    Attributes:
        blocks: which of the group.
        matrices: of each kind of run, shape (RUN · f, f · window), or, of runs all different,
            (runs, RUN · f, f · window), for f fields.
        windows: points of the windows, shape (window, runs) for each of these.
        order: place among the rows of all runs of each point's, shape (points,).
    """

    blocks: tuple[int, ...] = eqx.field(static=True)
    matrices: tuple[Any, ...]
    windows: tuple[Any, ...]
    order: Any

    def __call__(self, q: Any) -> Any:
        """The product with states q, shape (fields, points, columns)."""
        fields, columns = q.shape[0], q.shape[2]
        made = []
        for matrix, points in zip(self.matrices, self.windows, strict=True):
            near = picked(q, points, 1)  # fields, window, runs, columns
            if matrix.ndim == 2:
                rows = matrix @ near.reshape(matrix.shape[1], -1)
                rows = rows.reshape(fields, RUN, -1, columns).swapaxes(1, 2)
            else:
                near = near.transpose(2, 0, 1, 3).reshape(len(matrix), matrix.shape[2], columns)
                rows = (matrix @ near).reshape(-1, fields, RUN, columns).swapaxes(0, 1)
            made.append(rows.reshape(fields, -1, columns))
        return picked(jnp.concatenate(made, axis=1), self.order, 1)


def rows_of(group: Group, bar: Bar, step: TimeStep) -> tuple[Rows, ...]:
    """Rows of all blocks of a group, blocks that are alike together."""
    alike: dict[bytes, list[int]] = {}
    c = group.c
    for block in range(group.free.shape[0]):
        arrays = [c.stiffness, c.inertia, c.node_mass, group.free]
        arrays += [] if c.gradient is None else [c.gradient]
        key = b"".join(np.ascontiguousarray(np.asarray(a)[..., block, :]).tobytes() for a in arrays)
        alike.setdefault(key, []).append(block)
    return tuple(_of_block(_one(group, blocks[0]), blocks, bar, step) for blocks in alike.values())


def _one(group: Group, block: int) -> Group:
    """A group of one of its blocks alone."""

    def of(array: Any) -> Any:
        return None if array is None else np.asarray(array)[..., block : block + 1, :]

    c = group.c
    alone = type(c)(of(c.stiffness), of(c.gradient), of(c.node_mass), of(c.inertia), macro=c.macro)
    return eqx.tree_at(lambda g: (g.c, g.free), group, (alone, of(group.free)))


def _of_block(group: Group, blocks: Sequence[int], bar: Bar, step: TimeStep) -> Rows:
    n = group.free.shape[-1]
    reach = step.reach if group.c.macro or group.c.gradient is not None else 0
    width = min(n, RUN + 2 * reach)
    uniform = bar.periodic and width < n and all(_even(a, n) for a in jax.tree.leaves(group))
    alike = np.zeros(n, int) if uniform else _alike(group)
    runs = _runs(bar, alike, width, reach)
    made = cosine_rows(group, step, reach, bar.periodic, alike, runs)
    members = [np.flatnonzero(runs.kind == kind) for kind in range(len(made))]
    taken = [own for own in members if len(own) >= _FEW]
    matrices = [made[runs.kind[own[0]]] for own in taken]
    few = [own for own in members if len(own) < _FEW]
    if few:
        taken.append(np.concatenate(few))
        matrices.append(np.stack([made[kind] for kind in runs.kind[taken[-1]]]))
    place = np.empty(len(runs.start), int)
    place[np.concatenate(taken)] = np.arange(len(place))
    order = place[runs.order // RUN] * RUN + runs.order % RUN
    windows = tuple(runs.windows[own].T.astype(np.int32) for own in taken)
    return Rows(tuple(blocks), tuple(matrices), windows, order.astype(np.int32))


def _alike(group: Group) -> np.ndarray:
    """A number for each point, the same where everything about the point is the same."""
    n = group.free.shape[-1]
    at_points = [group.c, group.losses, group.half_norm, group.node_norm, group.free]
    rows = []
    for difference in (group.D, group.QT):
        at_points += [difference.weights, difference.scale]
        own, (count, width) = difference.rows, np.shape(difference.factors)
        special = np.zeros((1 + 2 * width, n))
        if count:
            away = (difference.columns - np.asarray(own)[:, None]) % n
            special[:, own] = np.vstack(
                [np.ones((1, count)), np.transpose(away), difference.factors.T]
            )
        rows.append(special)
    for leaf in map(np.asarray, jax.tree.leaves(at_points)):
        if leaf.shape[-1:] == (n,):
            rows.append(leaf.reshape(-1, n))
    columns = np.ascontiguousarray(np.concatenate(rows).T)
    whole = columns.view(f"V{columns.itemsize * columns.shape[1]}")[:, 0]
    return np.asarray(np.unique(whole, return_inverse=True)[1])


def _even(values: Any, points: int) -> bool:
    """Whether numbers are the same at all points, but for rounding where a ring is joined."""
    if np.shape(values)[-1:] != (points,):
        return True
    size = np.abs(values).max(axis=-1, initial=0.0)
    return bool((np.ptp(values, axis=-1) <= 1e-13 * size).all())


def _runs(bar: Bar, alike: np.ndarray, width: int, reach: int) -> Runs:
    """Runs of a bar's points, begun anew at each layer.

    The last one of a layer may reach into the next, where its rows are not used, and begins earlier
    where the bar ends.
    """
    n = len(alike)
    starts: list[int] = []
    order = np.empty(n, int)
    first = 0
    for number, (cells, _) in enumerate(bar.all_stretches, start=1):
        end = n if number == len(bar.all_stretches) else first + cells
        for begin in range(first, end, RUN):
            starts.append(begin if bar.periodic else min(begin, max(0, n - RUN)))
            points = np.arange(begin, min(begin + RUN, end))
            order[points] = (len(starts) - 1) * RUN + points - starts[-1]
        first = end
    start = np.array(starts)
    left = start - reach if width < n else np.zeros_like(start)
    left = left % n if bar.periodic else np.clip(left, 0, n - width)
    windows = (left[:, None] + np.arange(width)) % n
    inside = (start - left) % n
    seen = np.column_stack([alike[windows], inside])
    _, first_of, kind = np.unique(seen, axis=0, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first_of))  # in order along the bar, whatever it is made of
    return Runs(start, order, windows, inside, rank[kind.ravel()], np.sort(first_of))
