"""Work of the sources within one exact step, from small tables.

The step applies ŝ, the polynomial through the signals at its Gauss nodes τ_n, and the work is that
of ŝ too, by the same nodes, which integrate it exactly:

    W = Σ_j Σ_n w_n ŝ_jn r_jn,
    r_jn = O_j exp(τ_n A) y + Σ_i ∫₀^{τ_n} O_j exp((τ_n−τ)A) G_i ŝ_i dτ,

O_j y = ⟨G_j, v⟩ in the norm of kinetic energy; and for each macro-field that is prescribed its rate
times the force that holds it. No energy enters: the energy balance is a true check.
"""

from __future__ import annotations

import functools
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.energy import rates
from wavesim.timedomain.equation import Equation
from wavesim.timedomain.operator import States
from wavesim.timedomain.sources_within_step import Driven, picked, readings
from wavesim.timedomain.time_step import TimeStep, gauss_nodes, nodes_of


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
