"""A step of a real bar with losses: the states within it, and what is lost there.

The power lost is a quadratic form of the state, taken at Gauss nodes τ_o of the step:

    y(t+τ_o) = Σ_k φ_k(X) [e^{−sτ_o} c_k(τ_o) y + Σ_j G_j ∫₀^τ_o e^{−s(τ_o−τ)} c_k(τ_o−τ) ŝ_j dτ],

all nodes and the end of the step from the same φ_k(X) y, and from φ_k(X) G_j prepared in windows.
"""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.barequation import BarEquation
from wavesim.timedomain.barseries import EXTRA_NODES, Series, chebyshev_sums
from wavesim.timedomain.barstep import expansion_coefficients
from wavesim.timedomain.group import State
from wavesim.timedomain.pushes import Pushes, pushes
from wavesim.timedomain.response import gauss, legendre_transform

# Gauss nodes of a step at which the power lost is taken.
_NODES = 12


class Within(eqx.Module):
    """Coefficients for the states at the nodes within a step and, last, at its end.

    Attributes:
        state: e^{−sτ_o} c_k(τ_o), shape (nodes + 1, degree + 1).
        pulses: of the signals at their nodes, shape (nodes + 1, degree + 1, signal nodes).
        weights: of the power lost, shape (nodes,).
        pushes: φ_k(X) G_j, of each group.
    """

    state: jax.Array
    pulses: jax.Array
    weights: jax.Array
    pushes: tuple[Pushes | None, ...]

    def step(
        self, equation: BarEquation, made: Series, y: State, signals: jax.Array
    ) -> tuple[State, jax.Array]:
        """State after a step, and what is lost in it.

        Args:
            equation: of the bar.
            made: coefficients of the step.
            y: state before.
            signals: at the nodes of the step, shape (sources, nodes).
        """
        states = chebyshev_sums(equation.generator, made, y, self.state)
        if len(signals):
            amounts = jnp.einsum("okn,jn->ojk", self.pulses, signals)
            states = tuple(
                part if push is None else push.add(part, amounts)
                for part, push in zip(states, self.pushes, strict=True)
            )
        inner, last = (
            jax.tree.map(lambda part, at=at: part[at], states) for at in (np.s_[:-1], -1)
        )
        return last, self.weights @ jax.vmap(equation.lost)(inner)


def within(equation: BarEquation, made: Series, reach: int, periodic: bool) -> Within:
    """Coefficients of a step.

    Args:
        equation: of the bar.
        made: coefficients of the step.
        reach: cells beyond which nothing is felt within it.
        periodic: whether the bar is.
    """
    nodes, weights = gauss(_NODES)
    count, degree, h = len(made.nodes), made.degree, made.step
    outputs = np.append(nodes, 1.0)
    state = expansion_coefficients(h * outputs, made.radius, made.shift, degree)
    fine, fine_weights = gauss((degree + count) // 2 + EXTRA_NODES)
    rest = np.multiply.outer(outputs, 1 - fine)
    lags = expansion_coefficients(h * rest.ravel(), made.radius, made.shift, degree)
    legendre = np.polynomial.legendre.legvander
    signals = legendre(2 * np.multiply.outer(outputs, fine) - 1, count - 1)
    measure = h * outputs[:, None] * fine_weights
    pulses = np.einsum(
        "ofk,ofp,of->okp", lags.reshape(*rest.shape, -1), signals, measure, optimize=True
    ) @ legendre_transform(count)
    return Within(
        jnp.asarray(state),
        jnp.asarray(pulses),
        jnp.asarray(h * weights),
        pushes(equation, made, jnp.eye(degree + 1), reach, periodic),
    )
