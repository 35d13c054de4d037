"""What a real bar loses in a step, from the ends of the step alone: for signals without kinks.

Hermite's rule with the power lost and its first five derivatives at both ends, of order 12; the
derivatives come from those of the state, y⁽ⁱ⁺¹⁾ = A y⁽ⁱ⁾ + Σ_j G_j s_j⁽ⁱ⁾. It costs five products
more than the step, where ``within.py``, which asks nothing of the signals, doubles the time.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.barequation import BarEquation
from wavesim.timedomain.drives import derivative
from wavesim.timedomain.group import State

# Derivatives of the power at either end, the power itself among them.
_ORDERS = 6
# The o-th derivative of a product is Σ_i binom(o, i) of derivatives i and o − i.
_LEIBNIZ = np.array(
    [
        [[math.comb(o, i) if i + j == o else 0.0 for j in range(_ORDERS)] for i in range(_ORDERS)]
        for o in range(_ORDERS)
    ]
)


class Ends(eqx.Module):
    """The rule for a step.

    Attributes:
        step: h, scaled.
    """

    step: float = eqx.field(static=True)

    def powers(self, equation: BarEquation, t: jax.Array, y: State) -> jax.Array:
        """Power lost by a state at a time, and its derivatives, shape (orders,)."""
        drives = equation.drives
        function: Callable[[jax.Array], jax.Array] = drives.signals
        amounts = [function(t)]
        for _ in range(_ORDERS - 1):
            function = derivative(function)
            amounts.append(function(t))
        acting = jnp.where(t < drives.end, jnp.stack(amounts), 0.0)

        def further(state: State, force: jax.Array) -> tuple[State, State]:
            return drives.add(equation.generator(state), force), state

        _, states = jax.lax.scan(further, y, acting)
        return jnp.einsum("ij,oij->o", equation.lost_between(states), _LEIBNIZ)

    def lost(self, before: jax.Array, after: jax.Array) -> jax.Array:
        """∫₀^h p from the derivatives of p at both ends: exact to degree 2·orders − 1."""
        n, h = _ORDERS, self.step
        weights = np.array(
            [
                math.factorial(n)
                / (math.factorial(j + 1) * math.factorial(n - j - 1))
                * (math.factorial(2 * n - j - 1) / math.factorial(2 * n))
                * h ** (j + 1)
                for j in range(n)
            ]
        )
        return before @ weights + after @ ((-1.0) ** np.arange(n) * weights)
