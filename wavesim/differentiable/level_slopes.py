"""The level of T and its derivative by every value at every frequency, by one pass backward.

A reverse pass gives the derivatives of one number. Each frequency is given its own copy of k and
Z's coefficients and of the thicknesses, so that the pass of Σ L gives ∂L(ω)/∂c of each ω apart; by
the chain rule with ∂c/∂p, which knows no frequency, that is the whole Jacobian ∂L(ω)/∂p for about
what a gradient costs.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from wavesim.differentiable.coefficients import half_space, loss_law, units_of, waves
from wavesim.differentiable.graded_slices import uniform_slices
from wavesim.differentiable.stack_transmission import (
    before,
    behind,
    block_of,
    level_of,
    through_layer,
)
from wavesim.differentiable.traced_layers import TracedLayers


def level_and_slopes(
    make: Callable[[Any], TracedLayers], values: Any, sector: str, omega: Any, slices: int
) -> tuple[Any, Any]:
    """20 log₁₀|T| of a stack and its derivatives.

    Args:
        make: the stack as a function of the values, (n,); pure, of one build.
        values: where, (n,).
        sector: one with a macro-field.
        omega: real ω, (N,), not 0, rad/s.
        slices: uniform ones, that stand for each graded layer.

    Returns:
        L, (N,), dB, and ∂L/∂values, (N, n).

    Raises:
        ValueError: as :func:`~wavesim.differentiable.stack_transmission.transmission`.
    """
    stack = uniform_slices(make(jax.lax.stop_gradient(values)), slices)
    block, units, losses = block_of(stack, sector), units_of(stack), stack.losses
    scaled = jnp.asarray(omega) * units.time

    def pieces(values: Any) -> Any:
        own = uniform_slices(make(values), slices)
        return waves(own.kinds, own.first, block, units), own.thickness / units.length

    def level(pieces: Any) -> Any:
        wave, thickness = pieces
        ends = [half_space(wave.of(n), loss_law(losses, n), scaled, units.time) for n in (0, -1)]
        step = partial(through_layer, scaled, units.time)
        all_ = wave, thickness, losses
        state, _ = jax.lax.scan(step, behind(ends[1], losses), all_, reverse=True)
        a, _, lost = before(state, ends[0], losses)
        return level_of(a, lost)

    with jax.numpy_dtype_promotion("standard"):
        known, slopes = pieces(values), jax.jacfwd(pieces)(values)
        own = jax.tree.map(lambda c: jnp.repeat(c[:, None], len(omega), axis=1), known)
        found, back = jax.vjp(level, own)
        (by_piece,) = back(jnp.ones_like(found))
        parts = zip(jax.tree.leaves(by_piece), jax.tree.leaves(slopes), strict=True)
        return found, sum(jnp.einsum("lf,ln->fn", of_level, of_c) for of_level, of_c in parts)
