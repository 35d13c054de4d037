"""Work of the sources within one exact step, from small tables.

The step applies ŝ, the polynomial through the signals at its Gauss nodes τ_n, and the work is that
of ŝ too, by the same nodes, which integrate it exactly:

    W = Σ_j Σ_n w_n ŝ_jn r_jn,
    r_jn = O_j exp(τ_n A) y + Σ_i ∫₀^{τ_n} O_j exp((τ_n−τ)A) G_i ŝ_i dτ,

O_j y = ⟨G_j, v⟩ in the norm of kinetic energy; and for each rotation that is prescribed its rate
times the moment that holds it. No energy enters: the energy balance is a true check.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.energy import Equation
from wavesim.timedomain.operator import States
from wavesim.timedomain.time_step import TimeStep, nodes_of
from wavesim.timedomain.within_step import Driven, readings


class Felt(eqx.Module):
    """What one source feels of one group: at ``points``, rows of shape (nodes, e, unknowns)."""

    group: int = eqx.field(static=True)
    points: Any
    rows: Any

    def of(self, y: States) -> Any:
        """O_e exp(τ_n A) y, shape (nodes, e)."""
        parts = [jnp.ravel(array[..., self.points]) for array in y[self.group]]
        return self.rows @ jnp.concatenate(parts)


class Work(eqx.Module):
    """Tables for the work in a step.

    Attributes:
        felt: of each source.
        own: what signals make be felt, for each source, shape (nodes, e, sources, nodes).
        risen: ∫₀^{τ_n} of the polynomial through values at the nodes, shape (nodes, nodes).
        weights: w_n.
        turning: sources whose prescribed rotation does work.
    """

    felt: tuple[tuple[Felt, ...], ...]
    own: tuple[Any, ...]
    risen: Any
    weights: Any
    turning: tuple[int, ...] = eqx.field(static=True)

    def done(self, y: States, signals: Any, rates: Any) -> Any:
        """Work in the step from a state.

        Args:
            y: the state at its start.
            signals: ŝ at the nodes, shape (sources, nodes).
            rates: G_jᵀ v at its start, shape (sources,); of a prescribed rotation its rate.
        """
        total = jnp.zeros(())
        for j, (parts, own) in enumerate(zip(self.felt, self.own, strict=True)):
            felt = jnp.tensordot(own, signals, 2)
            for part in parts:
                felt = felt + part.of(y)
            power = signals[j] * felt[:, 0]
            if j in self.turning:
                power = power + (rates[j] + self.risen @ signals[j]) * felt[:, 1]
            total = total + jnp.sum(self.weights * power)
        return total


def work(equation: Equation, driven: list[list[Driven]], step: TimeStep) -> Work | None:
    """Prepare the tables; None where there is no signal.

    Args:
        equation: of the bar, of plain numbers.
        driven: for each source the groups that it drives.
        step: how the bar is stepped.
    """
    if not driven:
        return None
    _, weights = nodes_of(step)
    convolved, risen = _convolutions(step.nodes)
    felt, own = [], []
    for parts in driven:
        rows = readings(parts, step)
        of_signals = sum(
            np.einsum("neu,iu->nei", row, part.pushed)
            for row, part in zip(rows, parts, strict=True)
        )
        own.append(step.step * np.einsum("nmk,mei->neik", convolved, of_signals))
        felt.append(
            tuple(Felt(part.group, part.points, row) for part, row in zip(parts, rows, strict=True))
        )
    turning = tuple(int(j) for j in equation.turning)
    return Work(tuple(felt), tuple(own), step.step * risen, weights, turning)


def _convolutions(count: int) -> tuple[np.ndarray, np.ndarray]:
    """∫₀^{x_n} ℓ_m(x_n − x) ℓ_k(x) dx and ∫₀^{x_n} ℓ_k dx over the Gauss nodes of [0, 1].

    ℓ_m is the polynomial that is 1 at node m and 0 at the others.
    """
    points, weights = np.polynomial.legendre.leggauss(count)
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
