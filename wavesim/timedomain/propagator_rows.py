"""Rows of the exact propagator C = cos(h√−L) of a bar without losses, as dense matrices.

Points are taken in runs of 32, begun anew at each layer. The rows of a run are one dense matrix on
the window about it, a Chebyshev series in the sparse L of that window,

    C = Σ_k a_k T_k(1 + 2L/R²),

and equal windows hold one. Rows whose sum over a uniform macro-field is 1 but for rounding, as
nothing holds it back, are set so: rounding of it would grow with the number of steps squared.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp
from scipy.special import jv

from wavesim.grid.bar import Bar
from wavesim.timedomain.operator import Group
from wavesim.timedomain.sparse_matrix import second_order
from wavesim.timedomain.time_step import RUN, TimeStep
from wavesim.timedomain.within_step import picked, window

# Rows of fewer runs than these are held for each run by itself, though they be equal.
_FEW = 4
# Entries below this part of the largest are nothing.
_NOTHING = 1e-18


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
    n, ring = group.free.shape[-1], bar.periodic
    reach = step.reach if group.c.macro or group.c.gradient is not None else 0
    width, macro = min(n, RUN + 2 * reach), group.c.macro
    fields = macro + group.rest.B.shape[0]
    starts, order = _runs(bar, n)
    kinds: dict[bytes, int] = {}
    members: list[list[int]] = []
    windows, jobs = [], []
    uniform = ring and width < n and all(_even(a, n) for a in jax.tree.leaves(group))
    alike = np.zeros(n, int) if uniform else _alike(group)
    whole = None if uniform else second_order(group)
    for number, start in enumerate(starts):
        first = start - reach if width < n else 0
        first = first % n if ring else int(np.clip(first, 0, n - width))
        points = (first + np.arange(width)) % n
        windows.append(points)
        inside = (start - first) % n
        key = alike[points].tobytes() + bytes(str(inside), "ascii")
        kind = kinds.setdefault(key, len(kinds))
        if kind == len(members):
            members.append([])
            cut = second_order(window(group, points)) if whole is None else _cut(whole, points, n)
            jobs.append((cut, (fields, macro, inside), step, uniform))
        members[kind].append(number)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        made = list(pool.map(_run_rows, *zip(*jobs, strict=True)))
    many = [kind for kind, own in enumerate(members) if len(own) >= _FEW]
    few = [(number, kind) for kind, own in enumerate(members) for number in own if len(own) < _FEW]
    matrices = [made[kind] for kind in many]
    taken = [members[kind] for kind in many]
    if few:
        matrices.append(np.stack([made[kind] for _, kind in few]))
        taken.append([number for number, _ in few])
    place = np.empty(len(starts), int)
    place[np.concatenate(taken)] = np.arange(len(starts))
    order = place[order // RUN] * RUN + order % RUN
    of_runs = tuple(
        np.stack([windows[number] for number in own], axis=1).astype(np.int32) for own in taken
    )
    return Rows(tuple(blocks), tuple(matrices), of_runs, order.astype(np.int32))


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
    known: dict[bytes, int] = {}
    columns = np.ascontiguousarray(np.concatenate(rows).T)
    return np.array([known.setdefault(one.tobytes(), len(known)) for one in columns])


def _cut(factors: Sequence[Any], points: np.ndarray, n: int) -> list[Any]:
    """The part of F, K and G at some of n points."""

    def at(size: int) -> np.ndarray:
        return (np.arange(size // n)[:, None] * n + points).ravel()

    return [one[at(one.shape[0])][:, at(one.shape[1])] for one in factors]


def _even(values: Any, points: int) -> bool:
    """Whether numbers are the same at all points, but for rounding where a ring is joined."""
    if np.shape(values)[-1:] != (points,):
        return True
    size = np.abs(values).max(axis=-1, initial=0.0)
    return bool((np.ptp(values, axis=-1) <= 1e-13 * size).all())


def _runs(bar: Bar, n: int) -> tuple[list[int], np.ndarray]:
    """First point of each run, and for each point its run · RUN + its place in the run.

    Runs begin anew at each layer; the last one of a layer may reach into the next, where its rows
    are not used, and begins earlier where the bar ends.
    """
    starts: list[int] = []
    order = np.empty(n, int)
    first = 0
    for number, (cells, _) in enumerate(bar.all_stretches, start=1):
        end = n if number == len(bar.all_stretches) else first + cells
        for begin in range(first, end, RUN):
            start = begin if bar.periodic else min(begin, max(0, n - RUN))
            points = np.arange(begin, min(begin + RUN, end))
            order[points] = len(starts) * RUN + points - start
            starts.append(start)
        first = end
    return starts, order


def _run_rows(
    factors: Sequence[Any], shape: tuple[int, int, int], step: TimeStep, uniform: bool
) -> np.ndarray:
    """Rows of 2(C − 1) of a run on its window, shape (fields · RUN, fields · window).

    Args:
        factors: F, K and G of L on the window, of :func:`second_order`.
        shape: numbers of fields, of macro-fields, and the place of the run's first point in it.
        step: for h and R.
        uniform: whether all points are alike: those of the first then serve for all.
    """
    fields, macro, inside = shape
    unknowns = factors[0].shape[0]
    width = unknowns // fields
    points = (inside + np.arange(1 if uniform else RUN)) % width
    chosen = (np.arange(fields)[:, None] * width + points).ravel()
    start = np.zeros((unknowns, len(chosen)))
    start[chosen, np.arange(len(chosen))] = 1.0
    # cos(hR √((1 − x)/2)) = Σ a_k T_k(x): J_0 and 2 J_2k of hR by the angle θ, x = cos 2θ.
    phase = step.step * step.radius
    count = int(phase / 2 + 6 * (1 + phase) ** (1 / 3)) + 12
    a = _cosine_series(phase, count)
    # Rows of C are columns of Cᵀ: T_k+1 = 2 X T_k − T_k−1 of X = 1 + 2Lᵀ/R², Lᵀ = Gᵀ Kᵀ Fᵀ.
    F, K, G = (sp.csr_array(factor.T) for factor in factors)
    K = K * (4 / step.radius**2)
    before, now = start, start + 0.5 * (G @ (K @ (F @ start)))
    total = a[0] * before + a[1] * now
    for factor in a[2:]:
        after = G @ (K @ (F @ now))
        after += 2 * now
        after -= before
        before, now = now, after
        total += factor * now
    rows = 2 * (total - start).T
    rows = rows.reshape(fields, -1, fields, width)
    if uniform:
        rows = np.concatenate([np.roll(rows, j, axis=-1) for j in range(RUN)], axis=1)
        points = inside + np.arange(RUN)
    _let_uniform_fields_be(rows, points, macro)
    return rows.reshape(fields * RUN, unknowns)


def _cosine_series(phase: float, count: int) -> np.ndarray:
    """a_k of cos(z √((1 − x)/2)) = Σ a_k T_k(x), without the terms below rounding.

    With x = cos θ it is cos(z sin(θ/2)) = J_0(z) + 2 Σ_k J_2k(z) cos kθ.
    """
    a = 2 * jv(2 * np.arange(count), phase)
    a[0] /= 2
    kept = np.nonzero(np.abs(a) > _NOTHING)[0]
    return np.asarray(a[: max(2, int(kept[-1]) + 1)])


def _let_uniform_fields_be(rows: np.ndarray, points: np.ndarray, macro: int) -> None:
    """Set the sum of each row over a uniform macro-field to 0, where it is 0 but for rounding."""
    run = np.arange(RUN)
    for component in range(macro):
        sums = rows[:, :, component].sum(axis=-1)
        rounding = np.abs(sums) < 1e-11
        for field in range(len(rows)):
            rows[field, run, component, points] -= np.where(rounding[field], sums[field], 0.0)
