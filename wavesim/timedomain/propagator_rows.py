"""Rows of the exact propagator C = cos(h√−L) of a bar without losses, as dense matrices.

Each is a Chebyshev series in the sparse L about it, C = Σ_k a_k T_k(1 + 2L/R²). Points are taken in
runs of 32, begun anew at each layer. The rows of a run are one dense matrix on the window about it,
and equal windows hold one.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp
from scipy.special import jv

from wavesim.grid.bar import Bar
from wavesim.timedomain.operator import Group
from wavesim.timedomain.sources_within_step import picked
from wavesim.timedomain.sparse_matrix import second_order
from wavesim.timedomain.time_step import RUN, TimeStep

# Runs fewer than these are held each by itself, though they be equal.
_FEW = 4
# Entries below this part of the largest are nothing.
_NOTHING = 1e-18


class Runs(NamedTuple):
    """How the points of a bar are taken in runs.

    Attributes:
        start: first point of each, shape (runs,).
        order: run of each point, times RUN, and its place in the run, shape (points,).
        windows: points of the window about each run, shape (runs, window).
        inside: place of the run's first point in its window, shape (runs,).
        kind: number of what stands in the window, shape (runs,).
        first: the first run of each kind.
    """

    start: np.ndarray
    order: np.ndarray
    windows: np.ndarray
    inside: np.ndarray
    kind: np.ndarray
    first: np.ndarray


def cosine_rows(
    group: Group, step: TimeStep, reach: int, ring: bool, alike: np.ndarray, runs: Runs
) -> list[np.ndarray]:
    """Rows of 2(C − 1) of each kind of run, shape (fields · RUN, fields · window) each.

    Nothing is felt beyond a reach, in points, within a step; ``alike`` numbers what stands about
    each point.
    """
    n, width, macro = len(alike), runs.windows.shape[1], group.c.macro
    fields = len(group.c.stiffness)
    far, deep = _distant(group, alike, reach, ring) if width < n else (np.zeros(n, bool), {})
    # Of a bar shorter than a run some points stand there twice.
    points = (runs.start[:, None] + np.arange(RUN)) % n  # runs, RUN
    used = runs.order[points] // RUN == np.arange(len(points))[:, None]
    points = points[runs.first]  # kinds, RUN
    wanted = [np.any(used[runs.kind == kind], axis=0) for kind in range(len(points))]
    wanted = [one & ~far[own] for one, own in zip(wanted, points, strict=True)]
    factors, symmetric = second_order(group), _symmetric(group)

    def series(window: np.ndarray, chosen: np.ndarray, columns: bool) -> np.ndarray:
        if not len(chosen):
            return np.zeros((fields, 0, fields, len(window)))
        return _series(_cut(factors, window, n), fields, chosen, step, columns)

    def about(point: int) -> tuple[np.ndarray, np.ndarray]:
        first = point - reach if ring else int(np.clip(point - reach, 0, n - 2 * reach - 1))
        return (first + np.arange(2 * reach + 1)) % n, np.array([point - first])

    fixed = np.flatnonzero(np.any(np.asarray(group.free) == 0, axis=0)).tolist()
    held: list[int] = fixed if macro and deep else []
    jobs = [
        (runs.windows[run], (runs.inside[run] + np.flatnonzero(own)) % width, False)
        for run, own in zip(runs.first, wanted, strict=True)
    ]
    jobs += [(*about(point), False) for point in deep.values()]
    jobs += [(*about(point), True) for point in held]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        made = list(pool.map(series, *zip(*jobs, strict=True)))
    near = np.zeros((len(points), fields, RUN, fields, width))
    for rows, own, found in zip(near, wanted, made, strict=False):
        rows[:, own] = found
    bulk = dict(zip(deep, made[len(points) :], strict=False))
    mass = np.stack([np.broadcast_to(one, (1, n))[0] for one in group.mass], axis=-1)
    mass = mass[:, [0] * macro + [1] * (fields - macro)]
    kinds = near.copy() if bulk else near
    for rows, run, own in zip(kinds, runs.first, points, strict=True):
        window, inside = runs.windows[run], int(runs.inside[run])
        i, j = np.flatnonzero(far[own]), np.flatnonzero(~far[window] & symmetric)
        for place in i.tolist():
            first = inside + place - reach
            start, end = max(0, first), min(width, first + 2 * reach + 1)
            of_medium = bulk[int(alike[own[place]])][:, 0]
            rows[:, place, :, start:end] = of_medium[..., start - first : end - first]
        other, place = np.divmod(runs.order[window[j]][:, None], RUN)
        at = (own[i] - runs.windows[other, 0]) % n
        turned = near[runs.kind[other], :, place, :, np.minimum(at, width - 1)]  # j, i, f′, f
        turned = turned * mass[window[j]][:, None, :, None] / mass[own[i]][:, None]
        turned = np.where((at < width)[..., None, None], turned, 0.0)
        rows[:, i, :, j[:, None]] = turned.swapaxes(2, 3)
        for point, found in zip(held, made[len(points) + len(deep) :], strict=True):
            at = own[i] - about(point)[0][0]
            seen = (at >= 0) & (at <= 2 * reach)
            for column in np.flatnonzero(window == point):
                taken = found[:macro, 0][..., at[seen]]  # f′, f, i
                rows[:, i[seen], :macro, column] = taken.transpose(2, 1, 0)
        _let_uniform_fields_be(rows, (inside + np.arange(RUN)) % width, macro)
    return [rows.reshape(fields * RUN, fields * width) for rows in kinds]


def _distant(
    group: Group, alike: np.ndarray, reach: int, ring: bool
) -> tuple[np.ndarray, dict[int, int]]:
    """Points whose rows are those of their medium, but for some columns; one point of each medium.

    A wave that comes back from where the medium changes has been there: what it adds to C_ij counts
    only where i or j is within half the reach of it. Rows of such points are made one by one; those
    of the others are those of an endless medium but for columns of such points, which are known by
    symmetry, C being symmetric in the norm of kinetic energy, or, of held nodes, which move others
    but are not moved, made one by one. Where the closure is not symmetric half the reach is all.
    """
    changes = alike != np.roll(alike, -1)
    if not ring:
        changes[[0, -1]] = True

    def clear(where: np.ndarray, distance: int) -> np.ndarray:
        """Whether none of these is within a distance of each point."""
        about = np.pad(where, distance, "wrap" if ring else "edge")
        total = np.concatenate([[0], np.cumsum(about)])
        return np.asarray(total[2 * distance + 1 :] == total[: len(where)])

    deep = np.flatnonzero(clear(changes, reach))
    one_of = {int(alike[point]): int(point) for point in deep}
    far = clear(changes, reach // 2 if _symmetric(group) else reach)
    return far & np.isin(alike, list(one_of)), one_of


def _symmetric(group: Group) -> bool:
    both = (one for one in (group.c.stiffness, group.c.gradient) if one is not None)
    return all(np.allclose(one, np.swapaxes(one, 0, 1), 1e-14, 0.0) for one in both)


def _cut(factors: Sequence[Any], points: np.ndarray, n: int) -> list[Any]:
    """The part of F, K and G at some of n points."""

    def at(size: int) -> np.ndarray:
        return (np.arange(size // n)[:, None] * n + points).ravel()

    return [one[at(one.shape[0])][:, at(one.shape[1])] for one in factors]


def _series(
    factors: Sequence[Any], fields: int, points: np.ndarray, step: TimeStep, columns: bool
) -> np.ndarray:
    """Rows of 2(C − 1) of some points of a window, shape (fields, points, fields, window).

    By the factors F, K and G of L on the window; or its columns.
    """
    unknowns = factors[0].shape[0]
    width = unknowns // fields
    chosen = (np.arange(fields)[:, None] * width + points).ravel()
    start = np.zeros((unknowns, len(chosen)))
    start[chosen, np.arange(len(chosen))] = 1.0
    # cos(hR √((1 − x)/2)) = Σ a_k T_k(x): J_0 and 2 J_2k of hR by the angle θ, x = cos 2θ.
    phase = step.step * step.radius
    count = int(phase / 2 + 6 * (1 + phase) ** (1 / 3)) + 12
    a = _cosine_series(phase, count)
    # T_k+1 = 2 X T_k − T_k−1 of X = 1 + 2L/R², L = F K G; rows of C are columns of Cᵀ.
    F, K, G = factors if columns else [sp.csr_array(factor.T) for factor in reversed(factors)]
    K = K * (4 / step.radius**2)
    before, now = start, start + 0.5 * (F @ (K @ (G @ start)))
    total = a[0] * before + a[1] * now
    for factor in a[2:]:
        after = F @ (K @ (G @ now))
        after += 2 * now
        after -= before
        before, now = now, after
        total += factor * now
    return (2 * (total - start).T).reshape(fields, len(points), fields, width)


def _cosine_series(phase: float, count: int) -> np.ndarray:
    """a_k of cos(z √((1 − x)/2)) = Σ a_k T_k(x), without the terms below rounding.

    With x = cos θ it is cos(z sin(θ/2)) = J_0(z) + 2 Σ_k J_2k(z) cos kθ.
    """
    a = 2 * jv(2 * np.arange(count), phase)
    a[0] /= 2
    kept = np.nonzero(np.abs(a) > _NOTHING)[0]
    return np.asarray(a[: max(2, int(kept[-1]) + 1)])


def _let_uniform_fields_be(rows: np.ndarray, points: np.ndarray, macro: int) -> None:
    """Set the sum of each row over a uniform macro-field to 0, where it is 0 but for rounding.

    Rounding of it would grow with the number of steps squared.
    """
    run = np.arange(RUN)
    for component in range(macro):
        sums = rows[:, :, component].sum(axis=-1)
        rounding = np.abs(sums) < 1e-11
        for field in range(len(rows)):
            rows[field, run, component, points] -= np.where(rounding[field], sums[field], 0.0)


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
            ones = np.ones((1, count))
            special[:, own] = np.vstack([ones, np.transpose(away), difference.factors.T])
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
