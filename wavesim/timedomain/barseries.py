"""Coefficients of one exact step of a real bar; see ``expansion.py``."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.barstep import expansion_coefficients
from wavesim.timedomain.group import State
from wavesim.timedomain.response import interpolation
from wavesim.timedomain.timestep import Schedule

# Gauss nodes beyond half the phase of what they integrate or interpolate.
EXTRA_NODES = 14
# Terms of a series that are held at a time: enough for a matrix product, few beside long bars.
_AT_ONCE = 32


class Series(eqx.Module):
    """Coefficients of one step.

    Attributes:
        state: e^{−sh} c_k(h), shape (degree + 1,).
        pulses: of the signals at the nodes, shape (degree + 1, nodes).
        nodes, weights: Gauss nodes of the step, at which signals are taken, and weights; scaled.
        radius, shift: R and s.
        step: h.
    """

    state: jax.Array
    pulses: jax.Array
    nodes: jax.Array
    weights: jax.Array
    radius: float = eqx.field(static=True)
    shift: float = eqx.field(static=True)
    step: float = eqx.field(static=True)

    @property
    def degree(self) -> int:
        """Highest k."""
        return len(self.state) - 1


def series(schedule: Schedule, band: float) -> Series:
    """Coefficients for the steps of a schedule.

    Args:
        schedule: of a real bar.
        band: angular frequency above which no signal has anything, scaled; may be infinite.
    """
    assert schedule.shift is not None
    step, radius, shift = schedule.step, math.sqrt(schedule.bound), schedule.shift
    state = expansion_coefficients(np.array([step]), radius, shift)[0]
    degree = len(state) - 1
    fine = degree + EXTRA_NODES
    count = math.ceil(min(fine, step * band / 2 + EXTRA_NODES))
    (nodes, weights), (fine_nodes, fine_weights), between = interpolation(count, fine)
    at_nodes = expansion_coefficients(step * (1 - fine_nodes), radius, shift, degree)
    pulses = (between.T @ (step * fine_weights[:, None] * at_nodes)).T
    return Series(
        jnp.asarray(state),
        jnp.asarray(pulses),
        jnp.asarray(step * nodes),
        jnp.asarray(step * weights),
        float(radius),
        float(shift),
        float(step),
    )


def chebyshev_terms(
    A: Callable[[State], State], made: Series, y: State, seen: Callable[[State], Any]
) -> Any:
    """What is seen of φ_k(X) y, stacked over k from 0 to the degree.

    Args:
        A: the generator, or its transpose.
        made: for radius, shift and degree.
        y: a state.
        seen: of a state, arrays.
    """
    _, found = _terms(A, made, (jax.tree.map(jnp.zeros_like, y), y), _scales(made), seen)
    return found


def chebyshev_sums(
    A: Callable[[State], State], made: Series, y: State, factors: jax.Array
) -> State:
    """Σ_k factors_ok φ_k(X) y for several o, some terms at a time.

    Args:
        A: the generator.
        made: for radius, shift and degree.
        y: a state.
        factors: shape (outputs, degree + 1).

    Returns:
        States with a first axis of outputs.
    """
    groups = -(-factors.shape[1] // _AT_ONCE)
    missing = groups * _AT_ONCE - factors.shape[1]
    some = jnp.pad(factors, ((0, 0), (0, missing))).reshape(-1, groups, _AT_ONCE)
    scales = jnp.pad(_scales(made), (0, missing)).reshape(groups, _AT_ONCE)

    def add(carry: Any, group: tuple[jax.Array, jax.Array]) -> Any:
        pair, total = carry
        part, scale = group
        pair, terms = _terms(A, made, pair, scale, lambda term: term)
        return (pair, jax.tree.map(lambda s, t: s + jnp.tensordot(part, t, 1), total, terms)), None

    nothing = jax.tree.map(lambda part: jnp.zeros((len(factors), *part.shape)), y)
    begun = (jax.tree.map(jnp.zeros_like, y), y), nothing
    (_, total), _ = jax.lax.scan(add, begun, (some.swapaxes(0, 1), scales))
    return total


def _scales(made: Series) -> jax.Array:
    """By which each X φ_k enters φ_{k+1}."""
    return jnp.full(made.degree + 1, 2 / made.radius).at[0].divide(2)


def _terms(
    A: Callable[[State], State],
    made: Series,
    pair: tuple[State, State],
    scales: jax.Array,
    seen: Callable[[State], Any],
) -> tuple[tuple[State, State], Any]:
    """The recurrence from (φ_{k−1}, φ_k) on; what is seen of φ_k and those after it."""

    def advance(carry: Any, scale: jax.Array) -> Any:
        before, now = carry
        after = jax.tree.map(
            lambda rate, one, two: scale * (rate + made.shift * one) + two, A(now), now, before
        )
        return (now, after), seen(now)

    return jax.lax.scan(advance, pair, scales)
