"""How moments of a bar without losses add up to signals: tables that depend on no medium.

A source's signal s enters by j_k(t) = ∫ J_k(R(t − u)) s(u) du over 0 to t, an initial field by
J_k(Rt). By Jacobi and Anger, Σ_k J_k(x) e^{ikθ} = e^{ix sin θ}, so that all orders at a time are
the Fourier series of

    e^{iRt sin θ} S_t(R sin θ),   S_t(Ω) = ∫ e^{−iΩu} s(u) du over 0 to t.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from wavesim.grid.bar import Bar
from wavesim.timedomain.chebyshev_moments import (
    Force,
    Given,
    moments_of,
    pull,
    unit_differences,
)
from wavesim.timedomain.operator import Group, Operator
from wavesim.timedomain.source_terms import SourceTerms
from wavesim.timedomain.time_step import TimeStep, nodes_of

# Moments whose part in every frame is below this of the largest are not made.
_CUT = 1e-18

Float = NDArray[np.float64]


def signals(
    A: Operator, terms: SourceTerms, initial: Any, places: Any, bar: Bar, step: TimeStep
) -> Any:
    """What receivers record of a bar without losses.

    Args:
        A: its operator; coefficients may be traced.
        terms: the sources on it.
        initial: the state at t = 0; None where it is rest.
        places: weights and indices of the receivers, of nodes and of half-nodes, (receivers,
            points) each.
        bar: the grid.
        step: of the run.

    Returns:
        (φ, B) of each group, shapes (frames, components, blocks, receivers).
    """
    made = tables(step, terms, initial is not None)
    moments = moments_of(bar, made[0].shape[1])
    scale = 4 / step.radius**2
    forces = tuple(_force(group, scale) for group in A.groups)
    nodes, halves = (tuple(jnp.asarray(part)[..., None] for part in place) for place in places)
    total: Any = None
    starts = _starts(A, terms) + ([] if initial is None else [_at_rest(initial, forces, bar)])
    for table, start in zip(made, starts, strict=True):
        seen = moments(Given(forces, start, (nodes[0], halves[0]), (nodes[1], halves[1])))
        found = jax.tree.map(lambda m, t=table: jnp.tensordot(t, m[..., 0], 1), seen)
        total = found if total is None else jax.tree.map(jnp.add, total, found)
    return total


def _starts(A: Operator, terms: SourceTerms) -> list[Any]:
    """q_0 = G and d_0 = 2G of each signal."""
    made = []
    for number in range(len(terms.signals)):
        amounts = np.where(np.array(terms.which) == number, terms.amplitude, 0.0)
        pushed = terms.add(A.rest, amounts)
        q = tuple((_parts(part.phi_rate), _parts(part.B_rate)) for part in pushed)
        made.append((q, jax.tree.map(lambda a: 2 * a, q)))
    return made


def _at_rest(initial: Any, forces: Any, bar: Bar) -> Any:
    """q_0 and d_0 = −(2/R²) L q_0 of an initial field."""
    q = tuple((_parts(part.phi), _parts(part.B)) for part in initial)
    pulled = pull(unit_differences(bar), forces, q)
    return q, jax.tree.map(lambda a: a / 2, pulled)


def _parts(array: Any) -> tuple[Any, ...]:
    """(components, blocks, points) as one array for each component, of one member."""
    return tuple(jnp.asarray(part)[..., None] for part in array)


def _force(group: Group, scale: float) -> Force:
    """The coefficients of a group, folded."""
    c, p = group.c, group.c.macro
    C, half_norm = jnp.asarray(c.stiffness), jnp.asarray(group.half_norm)
    per_half = 1 / jnp.where(half_norm == 0, 1.0, half_norm)
    count = len(C)
    by = [per_half if j < p else 1.0 for j in range(count)]
    over = [1.0 if i < p else scale / c.inertia for i in range(count)]
    stress = tuple(
        tuple((C[i, j] * by[j] * over[i])[..., None] for j in range(count)) for i in range(count)
    )
    free = (scale * jnp.asarray(group.free))[..., None]
    if c.gradient is None:
        return Force(stress, free, (), ())
    bending = jnp.asarray(c.gradient) / group.node_norm
    rows = tuple(tuple(one[..., None] for one in row) for row in bending)
    return Force(stress, free, rows, (scale * per_half / c.inertia)[..., None])


def _orders(step: TimeStep) -> int:
    """Orders beyond which every J_k(Rt) of a run is below rounding."""
    phase = step.radius * step.step * step.steps
    return int(phase + 16 * (phase + 1) ** (1 / 3)) + 40


def tables(step: TimeStep, sources: SourceTerms, initial: bool) -> list[Float]:
    """Factors of the moments in the frames of a run.

    Returns:
        One table for each signal, of W_n, and one for initial fields, of T_n, shape (frames,
        moments) each, all of one shape.
    """
    count = 2 ** int(np.ceil(np.log2(2 * _orders(step) + 2)))
    omega = step.radius * np.sin(2 * np.pi * np.arange(count) / count)
    made = [_of_signal(step, omega, signal) for signal in _sampled(step, sources)]
    if initial:
        made.append(_of_initial(step, omega))
    largest = max(float(np.abs(table).max()) for table in made)
    needed = [np.abs(table).max(axis=0) > _CUT * largest for table in made]
    last = max(int(np.max(np.nonzero(some)[0])) for some in needed)
    return [table[:, : last + 1] for table in made]


def _sampled(step: TimeStep, sources: SourceTerms) -> list[Float]:
    """Each signal, of amplitude 1, at the nodes of the steps while it lasts, (steps, nodes)."""
    if not sources.signals:
        return []
    nodes, weights = nodes_of(step)
    number = min(step.steps, int(np.ceil(float(sources.end) / step.step)) + 1)
    alone = dataclasses.replace(
        sources,
        amplitude=np.ones(len(sources.signals)),
        which=tuple(range(len(sources.signals))),
    )
    with jax.ensure_compile_time_eval():
        starts = np.arange(number) * step.step
        found = jax.vmap(lambda t: alone.sampled(t, nodes, weights, step.step))(starts)
    return list(np.moveaxis(np.asarray(found), 1, 0))


def _of_signal(step: TimeStep, omega: Float, signal: Float) -> Float:
    nodes, weights = nodes_of(step)
    within = np.exp(-1j * omega[:, None] * nodes)
    spectrum = np.zeros(len(omega), complex)
    table = np.zeros((step.frames, _orders(step) // 2))
    for number in range(step.steps):
        t = number * step.step
        if number < len(signal):
            spectrum += np.exp(-1j * omega * t) * (within @ (weights * signal[number]))
        if (number + 1) % step.per_frame == 0:
            now = np.exp(1j * omega * (t + step.step)) * spectrum
            table[(number + 1) // step.per_frame] = _coefficients(now)[1::2][: table.shape[1]]
    return table * (2 / step.radius)


def _of_initial(step: TimeStep, omega: Float) -> Float:
    table = np.zeros((step.frames, _orders(step) // 2))
    for frame in range(step.frames):
        now = np.exp(1j * omega * frame * step.per_frame * step.step)
        table[frame] = 2 * _coefficients(now)[::2][: table.shape[1]]
    table[:, 0] /= 2
    return table


def _coefficients(values: Any) -> Float:
    """Fourier coefficients of orders 0 and up; they are real."""
    found: Float = np.fft.fft(values)[: len(values) // 2].real / len(values)
    return found
