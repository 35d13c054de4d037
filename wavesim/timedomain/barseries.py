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
from wavesim.timedomain.generator import State
from wavesim.timedomain.response import interpolation
from wavesim.timedomain.timestep import Schedule

# Gauss nodes beyond half the phase of what they integrate or interpolate.
EXTRA_NODES = 14


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

    def advance(carry: Any, scale: jax.Array) -> Any:
        before, now = carry
        after = jax.tree.map(
            lambda rate, one, two: scale * (rate + made.shift * one) + two, A(now), now, before
        )
        return (now, after), seen(now)

    scales = jnp.full(made.degree + 1, 2 / made.radius).at[0].divide(2)
    return jax.lax.scan(advance, (jax.tree.map(jnp.zeros_like, y), y), scales)[1]
