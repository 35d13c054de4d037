"""What the sources do and feel within one exact step, as dense tables in windows about them.

    P_jn = w_n exp((h − τ_n)A) G_j      what a signal of 1 at node τ_n leaves at the step's end,
    O_e exp(τ_n A)                      what a state at its start makes be felt at τ_n,
    O_e exp(τ_n A) G_j                  what a signal makes be felt,

O_e being linear functionals of the state. All are sums of the series of exp(τA), made by sparse
products; nothing is felt further away than the reach of a step, so windows of that width hold all.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp

from wavesim.timedomain.equation import Equation, rates
from wavesim.timedomain.operator import Difference, Group, States
from wavesim.timedomain.source_terms import Points
from wavesim.timedomain.sparse_matrix import sparse_matrix
from wavesim.timedomain.time_step import TimeStep, gauss_nodes, nodes_of, series_coefficients

# Terms of a series that are held at a time.
_AT_ONCE = 64


def picked(values: Any, points: Any, axis: int = -1) -> Any:
    """Values at some points of an axis.

    Args:
        values: an array.
        points: numbers of points, of 32 bits: others jax converts, each by a loop of its own.
        axis: which.
    """
    where = (slice(None),) * (axis % values.ndim) + (points,)
    return values.at[where].get(mode="promise_in_bounds", wrap_negative_indices=False)


def window(group: Group, points: np.ndarray) -> Group:
    """A group on some consecutive points alone: its matrix is that part of the group's.

    Args:
        group: of plain numbers.
        points: round the bar where it is a ring; the whole ring stays one.
    """
    n = group.free.shape[-1]
    ring = group.D.ring and len(points) == n
    place = np.full(n, -1)
    place[points] = np.arange(len(points))

    def cut(array: Any) -> Any:
        array = np.asarray(array)
        return array[..., points] if array.ndim and array.shape[-1] == n else array

    def part(difference: Difference) -> Difference:
        own = place[difference.rows] >= 0
        columns = place[difference.columns[own]]
        factors = np.where(columns >= 0, difference.factors[own], 0.0)
        return dataclasses.replace(
            difference,
            weights=None if difference.stencil else cut(difference.weights),
            scale=cut(difference.scale),
            rows=place[difference.rows[own]],
            columns=np.maximum(columns, 0),
            factors=factors,
            ring=ring,
        )

    c, law = jax.tree.map(cut, (group.c, group.losses))
    D, QT = part(group.D), part(group.QT)
    norms = cut(group.half_norm), cut(group.node_norm)
    return type(group)(D, QT, *norms, c, cut(group.free), law)


class Driven(NamedTuple):
    """A group about sources that lie near each other: where they are, what they do and feel there.

    Attributes:
        group: its number.
        points: of the window, shape (points,).
        matrix: A of the window.
        sources: their numbers.
        pushed: G_j of each of them, flat, shape (sources, unknowns).
        felt: O_e: of each of them, and then of each that moves an end for the force that holds
            it; flat, shape (e, unknowns).
    """

    group: int
    points: np.ndarray
    matrix: Any
    sources: list[int]
    pushed: np.ndarray
    felt: np.ndarray


def driven(equation: Equation, reach: int, ring: bool) -> list[Driven]:
    """The groups that sources drive, in windows about them.

    Args:
        equation: of the bar, of plain numbers.
        reach: cells beyond which nothing is felt within a step.
        ring: whether the bar is periodic.
    """
    found = []
    pairs = zip(equation.operator.groups, equation.sources.points, strict=True)
    for number, (group, on) in enumerate(pairs):
        size = group.free.shape[-1]
        for sources, where in _near(on, equation.sources.count, 2 * reach):
            points = _window(where, size, reach, ring)
            found.append(_driven(equation, number, sources, points))
    return found


def _near(
    on: tuple[Points, Points], count: int, distance: int
) -> list[tuple[list[int], np.ndarray]]:
    """Sources on a group with the points they act on, those within a distance together."""
    places = [
        np.unique(np.concatenate([one.point[one.source == source] for one in on]))
        for source in range(count)
    ]
    order = sorted((s for s in range(count) if len(places[s])), key=lambda s: int(places[s][0]))
    found: list[tuple[list[int], np.ndarray]] = []
    for source in order:
        own = places[source]
        if found and own[0] - found[-1][1][-1] <= distance:
            sources, before = found[-1]
            found[-1] = ([*sources, source], np.union1d(before, own))
        else:
            found.append(([source], own))
    return found


def _driven(equation: Equation, number: int, sources: list[int], points: np.ndarray) -> Driven:
    group, on = equation.operator.groups[number], equation.sources.points[number]
    cut = window(group, points)
    sizes = [np.shape(array) for array in cut.rest]
    starts = np.cumsum([0, *(int(np.prod(size)) for size in sizes)])
    place = np.full(group.free.shape[-1], -1)
    place[points] = np.arange(len(points))
    pushed = np.zeros((len(sources), starts[-1]))
    weights = np.ones(starts[-1])
    for kind, (own, mass) in enumerate(zip(on, cut.mass, strict=True)):
        size, start = sizes[2 + kind], starts[2 + kind]
        weights[start : starts[3 + kind]] = np.broadcast_to(mass, size).ravel()
        for row, source in zip(pushed, sources, strict=True):
            at, weight = _entries(own, source, place, size, start)
            row[at] += weight
    felt = [*(pushed * weights)]
    stand = [ends[0] for ends in equation.sources.turning]
    turned = [source for source in sources if source in stand]
    if turned:
        free = dataclasses.replace(cut, free=1 / np.asarray(cut.c.node_mass))
        held = sparse_matrix(free)
        for source in turned:
            at, weight = _entries(on[0], source, place, sizes[2], starts[2])
            felt.append(-(weight * weights[at]) @ held[at].toarray())
    return Driven(number, points, sparse_matrix(cut), sources, pushed, np.array(felt))


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
    """Σ_k f_ok φ_k(X) u for several o, X of ``chebyshev_stepper.py``.

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
    total, held = np.zeros((len(factors), start.size)), np.empty((_AT_ONCE, start.size))
    before, now, doubled = start, start, 2 * X
    for k in range(factors.shape[1]):
        if k == 1:
            now = X @ now
        elif k:
            after = doubled @ now
            after += before
            before, now = now, after
        at = k % _AT_ONCE
        held[at] = now.ravel()
        if at == _AT_ONCE - 1 or k == factors.shape[1] - 1:
            total += factors[:, k - at : k + 1] @ held[: at + 1]
    return total.reshape(-1, *start.shape)


def pushes(part: Driven, step: TimeStep) -> np.ndarray:
    """P_jn of sources, shape (sources, nodes, unknowns of the window)."""
    nodes, weights = nodes_of(step)
    factors = series_coefficients(step.step - nodes, step.radius, step.shift, step.degree)
    made = series_terms(part.matrix, part.pushed.T, step, factors * weights[:, None])
    return np.moveaxis(made, 2, 0)


def readings(part: Driven, step: TimeStep) -> np.ndarray:
    """O_e exp(τ_n A) of functionals, shape (e, nodes, unknowns of the window)."""
    nodes, _ = nodes_of(step)
    factors = series_coefficients(nodes, step.radius, step.shift, step.degree)
    return np.moveaxis(series_terms(part.matrix.T, part.felt.T, step, factors), 2, 0)


class Felt(eqx.Module):
    """What sources near each other feel of one group.

    Attributes:
        group: its number.
        points: of the window about them, shape (points,).
        sources: their numbers; factors: by which what is felt is multiplied, among ``Work.done``'s.
        rows: O_e exp(τ_n A), shape (e, nodes, unknowns of the window).
        own: what their signals make be felt, shape (e, nodes, sources, nodes).
    """

    group: int = eqx.field(static=True)
    points: Any
    sources: Any
    factors: Any
    rows: Any
    own: Any


class Work(eqx.Module):
    """Tables for the work in a step.

    The step applies ŝ, the polynomial through the signals at its Gauss nodes τ_n, and the work is
    that of ŝ too, by the same nodes, which integrate it exactly:

        W = Σ_j Σ_n w_n ŝ_jn r_jn,
        r_jn = O_j exp(τ_n A) y + Σ_i ∫₀^{τ_n} O_j exp((τ_n−τ)A) G_i ŝ_i dτ,

    O_j y = ⟨G_j, v⟩ in the norm of kinetic energy; and for each macro-field that is prescribed its
    rate times the force that holds it. No energy enters: the energy balance is a true check.

    Attributes:
        felt: of all sources.
        risen: ∫₀^{τ_n} of the polynomial through values at the nodes, shape (nodes, nodes).
        weights: w_n.
        turning: sources that prescribe a macro-field, those of one end together.
    """

    felt: tuple[Felt, ...]
    risen: Any
    weights: Any
    turning: tuple[tuple[int, ...], ...] = eqx.field(static=True)

    def done(self, equation: Equation, y: States, signals: Any) -> Any:
        """Work in the step from a state y, by signals ŝ at the nodes, shape (sources, nodes)."""
        factors = signals
        if self.turning:
            first = np.array([ends[0] for ends in self.turning])
            driving = jnp.stack([signals[np.array(ends)].sum(axis=0) for ends in self.turning])
            turned = rates(equation.sources, y)[first, None] + driving @ self.risen.T
            factors = jnp.concatenate([signals, turned])
        total = jnp.zeros(())
        for part in self.felt:
            near = [jnp.ravel(picked(array, part.points)) for array in y[part.group] if array.size]
            felt = part.rows @ jnp.concatenate(near)
            felt = felt + jnp.tensordot(part.own, picked(signals, part.sources, 0), 2)
            total = total + jnp.sum(self.weights * picked(factors, part.factors, 0) * felt)
        return total


def work(equation: Equation, near: list[Driven], step: TimeStep) -> Work | None:
    """Prepare the tables; None where there is no signal.

    Args:
        equation: of the bar, of plain numbers.
        near: the groups that sources drive, in windows about them.
        step: how the bar is stepped.
    """
    if not near:
        return None
    _, weights = nodes_of(step)
    convolved, risen = _convolutions(step.nodes)
    turning = equation.sources.turning
    stand = [ends[0] for ends in turning]
    felt = []
    for part in near:
        rows = readings(part, step)
        of_signals = np.einsum("enu,iu->eni", rows, part.pushed)
        own = step.step * np.einsum("nmk,emi->enik", convolved, of_signals, optimize=True)
        count = equation.sources.count
        held = [count + stand.index(j) for j in part.sources if j in stand]
        factors = np.array(part.sources + held, np.int32)
        sources, points = np.array(part.sources, np.int32), part.points.astype(np.int32)
        felt.append(Felt(part.group, points, sources, factors, rows, own))
    return Work(tuple(felt), step.step * risen, weights, turning)


@functools.cache
def _convolutions(count: int) -> tuple[np.ndarray, np.ndarray]:
    """∫₀^{x_n} ℓ_m(x_n − x) ℓ_k(x) dx and ∫₀^{x_n} ℓ_k dx over the Gauss nodes of [0, 1].

    ℓ_m is the polynomial that is 1 at node m and 0 at the others. Not to be changed.
    """
    points, weights = gauss_nodes(count)
    legendre = np.polynomial.legendre.legvander
    orders = np.arange(count)
    to_series = (2 * orders[:, None] + 1) / 2 * legendre(points, count - 1).T * weights
    x = (1 + points) / 2
    convolved, risen = np.empty((count, count, count)), np.empty((count, count))
    for n, end in enumerate(x):
        # ℓ at end·x_i and, as the nodes are symmetric, in reverse order at end − end·x_i.
        basis = legendre(2 * end * x - 1, count - 1) @ to_series
        measured = basis * (end * weights / 2)[:, None]
        convolved[n] = basis[::-1].T @ measured
        risen[n] = measured.sum(axis=0)
    return convolved, risen
