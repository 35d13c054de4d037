"""What the sources do and feel within one exact step, as dense tables in windows about them.

    P_jn = w_n exp((h − τ_n)A) G_j      what a signal of 1 at node τ_n leaves at the step's end,
    O_e exp(τ_n A)                      what a state at its start makes be felt at τ_n,
    O_e exp(τ_n A) G_j                  what a signal makes be felt,

O_e being linear functionals of the state. All are sums of the series of exp(τA), made by sparse
products; nothing is felt further away than the reach of a step, so windows of that width hold all.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
import scipy.sparse as sp

from wavesim.timedomain.energy import Equation
from wavesim.timedomain.operator import Difference, Group
from wavesim.timedomain.source_terms import Points
from wavesim.timedomain.sparse_matrix import sparse_matrix
from wavesim.timedomain.time_step import TimeStep, nodes_of, series_coefficients

# Terms of a series that are held at a time.
_AT_ONCE = 64


def window(group: Group, points: np.ndarray) -> Group:
    """A group on some consecutive points alone: its matrix is that part of the group's.

    Args:
        group: of plain numbers.
        points: round the bar where it is a ring; the whole ring stays one.
    """
    whole = len(points) == group.free.shape[-1]

    def cut(array: Any) -> Any:
        array = np.asarray(array)
        return array if array.ndim == 0 or array.shape[-1] == 1 else array[..., points]

    made = jax.tree.map(cut, group)
    ring = group.D.ring and whole

    def closed(difference: Difference) -> Difference:
        return dataclasses.replace(difference, ring=ring)

    return dataclasses.replace(made, D=closed(made.D), QT=closed(made.QT))


class Driven(NamedTuple):
    """A group about one source: where it is, and what the source does and feels there.

    Attributes:
        group: its number.
        points: of the window, shape (points,).
        matrix: A of the window.
        pushed: G_i of every source in it, flat, shape (sources, unknowns).
        felt: O_e in it for e = j and, where j turns an end, for the moment that holds it; flat.
    """

    group: int
    points: np.ndarray
    matrix: Any
    pushed: np.ndarray
    felt: np.ndarray


def driven(equation: Equation, source: int, reach: int, ring: bool) -> list[Driven]:
    """The groups that a source drives, each in a window about it."""
    found = []
    turning = source in equation.turning
    pairs = zip(equation.operator.groups, equation.sources.points, strict=True)
    for number, (group, on) in enumerate(pairs):
        where = np.concatenate([one.point[one.source == source] for one in on])
        if not len(where):
            continue
        points = _window(where, group.free.shape[-1], reach, ring)
        cut = window(group, points)
        rest = cut.rest
        sizes = [np.shape(array) for array in rest]
        starts = np.cumsum([0, *(int(np.prod(size)) for size in sizes)])
        pushed = np.zeros((len(equation.sources.sources), starts[-1]))
        felt = np.zeros((1 + turning, starts[-1]))
        place = np.full(group.free.shape[-1], -1)
        place[points] = np.arange(len(points))
        for kind, (own, mass) in enumerate(zip(on, cut.mass, strict=True)):
            for other in range(len(pushed)):
                at, weight = _entries(own, other, place, sizes[2 + kind], starts[2 + kind])
                pushed[other, at] += weight
            part = slice(starts[2 + kind], starts[3 + kind])
            felt[0, part] = pushed[source, part] * np.broadcast_to(mass, sizes[2 + kind]).ravel()
        matrix = sparse_matrix(cut)
        if turning:
            free = dataclasses.replace(cut, free=1 / np.asarray(cut.c.node_mass))
            at, weight = _entries(on[0], source, place, sizes[2], starts[2])
            mass = np.ravel(np.broadcast_to(cut.c.node_mass, sizes[2]))[at - starts[2]]
            felt[1] = -(weight * mass) @ sparse_matrix(free)[at].toarray()
        found.append(Driven(number, points, matrix, pushed, felt))
    return found


def _entries(
    on: Points, source: int, place: np.ndarray, size: tuple[int, ...], start: int
) -> tuple[np.ndarray, np.ndarray]:
    """Flat places in a window of where a source acts, and its weights there."""
    own = (on.source == source) & (place[on.point] >= 0)
    at = (on.component[own], on.block[own], place[on.point[own]])
    return start + np.ravel_multi_index(at, size), np.asarray(on.weight)[own]


def _window(where: np.ndarray, size: int, reach: int, ring: bool) -> np.ndarray:
    """Consecutive points within reach of some."""
    where = np.unique(where)
    first, count = int(where[0]), int(where[-1] - where[0]) + 1
    if ring:  # the widest stretch that is not driven is left out
        idle = np.diff(np.append(where, where[0] + size))
        widest = int(np.argmax(idle))
        first, count = int(where[(widest + 1) % len(where)]), size - int(idle[widest]) + 1
    count = min(size, count + 2 * reach)
    first = (first - reach) % size if ring else int(np.clip(first - reach, 0, size - count))
    if count == size:
        first = 0
    return (first + np.arange(count)) % size


def series_terms(matrix: Any, start: np.ndarray, step: TimeStep, factors: np.ndarray) -> np.ndarray:
    """Σ_k f_ok φ_k(X) u for several o, X of :mod:`chebyshev_series`.

    Args:
        matrix: A or Aᵀ, sparse.
        start: u, shape (unknowns,) or (unknowns, columns).
        step: for R and s.
        factors: f, shape (outputs, degree + 1).

    Returns:
        Shape (outputs, *shape of u).
    """
    X = matrix / step.radius
    if step.shift:
        X = X + sp.eye_array(X.shape[0]) * (step.shift / step.radius)
    X = sp.csr_array(X)
    total = np.zeros((len(factors), start.size))
    before, now, held, first = start, start, [], 0
    for k in range(factors.shape[1]):
        if k:
            before, now = now, X @ now if k == 1 else 2 * (X @ now) + before
        held.append(now.ravel())
        if len(held) == _AT_ONCE or k == factors.shape[1] - 1:
            total += factors[:, first : k + 1] @ np.stack(held)
            first, held = k + 1, []
    return total.reshape(-1, *start.shape)


def pushes(parts: Sequence[Driven], source: int, step: TimeStep) -> list[np.ndarray]:
    """P_jn of a source, for each group that it drives, shape (nodes, unknowns of the window)."""
    nodes, weights = nodes_of(step)
    factors = series_coefficients(step.step - nodes, step.radius, step.shift, step.degree)
    factors = factors * weights[:, None]
    return [series_terms(part.matrix, part.pushed[source], step, factors) for part in parts]


def readings(parts: Sequence[Driven], step: TimeStep) -> list[np.ndarray]:
    """O_e exp(τ_n A) of a source's functionals, shape (nodes, e, unknowns) for each group."""
    nodes, _ = nodes_of(step)
    factors = series_coefficients(nodes, step.radius, step.shift, step.degree)
    return [
        series_terms(part.matrix.T, part.felt.T, step, factors).swapaxes(1, 2) for part in parts
    ]
