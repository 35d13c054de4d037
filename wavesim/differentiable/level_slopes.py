"""The level of T and its derivative by every value at every frequency, by one pass backward.

A reverse pass gives the derivatives of one number. Each frequency is given its own copy of k and
Z's coefficients and of the thicknesses, so that the pass of Σ L gives ∂L(ω)/∂c of each ω apart; by
the chain rule with ∂c/∂p, which knows no frequency, that is the whole Jacobian ∂L(ω)/∂p for about
what a gradient costs. Frequencies of several sectors, whose coefficients differ, share the pass.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from wavesim.differentiable.coefficients import Wave, half_space, is_real, loss_law, units_of, waves
from wavesim.differentiable.graded_slices import uniform_slices
from wavesim.differentiable.stack_transmission import (
    before,
    behind,
    level_of,
    through_layer,
)
from wavesim.differentiable.traced_layers import TracedLayers
from wavesim.material.family import travelling_block


def level(stack: TracedLayers, sector: str, omega: Any, slices: int) -> Any:
    """20 log₁₀|T| of a stack, dB, (N,).

    Args:
        stack: its layers; may be traced.
        sector: with a macro-field.
        omega: real or complex ω, (N,), not 0, rad/s.
        slices: uniform ones, that stand for each graded layer.

    Raises:
        ValueError: as :func:`~wavesim.differentiable.stack_transmission.transmission`.
    """
    own, units = uniform_slices(stack, slices), units_of(stack)
    with jax.numpy_dtype_promotion("standard"):
        scaled = jnp.asarray(omega) * units.time
        block = travelling_block(own.kinds[0].family, sector, own.kept)
        wave = waves(own.kinds, own.first, block, units)
        return _level(wave, own.thickness / units.length, own.losses, scaled, units.time)


def _level(wave: Wave, thickness: Any, losses: Any, omega: Any, time: Any) -> Any:
    """The same of scaled waves, thicknesses (L, …) and ω."""
    first, last = (half_space(wave.of(n), loss_law(losses, n), omega, time) for n in (0, -1))
    step, real = partial(through_layer, omega, time), is_real(losses, omega)
    pieces = wave, thickness, losses
    state, _ = jax.lax.scan(step, behind(last, real), pieces, reverse=True)
    a, _, lost = before(state, first, real)
    return level_of(a, lost)


def level_and_slopes(
    make: Callable[[Any], TracedLayers],
    values: Any,
    parts: Sequence[tuple[str, Any]],
    slices: int,
) -> tuple[Any, Any]:
    """20 log₁₀|T| of a stack and its derivatives.

    Args:
        make: the stack as a function of the values, (n,); pure, of one build.
        values: where, (n,).
        parts: (sector with a macro-field, real or complex ω (N,), not 0, rad/s), in turn.
        slices: uniform ones, that stand for each graded layer.

    Returns:
        L, (ΣN,), dB, and ∂L/∂values, (ΣN, n), of all parts.

    Raises:
        ValueError: as :func:`~wavesim.differentiable.stack_transmission.transmission`.
    """
    stack = uniform_slices(make(jax.lax.stop_gradient(values)), slices)
    family = stack.kinds[0].family
    blocks = [travelling_block(family, sector, stack.kept) for sector, _ in parts]
    units, losses = units_of(stack), stack.losses
    counts = [len(omega) for _, omega in parts]
    ends = list(itertools.accumulate(counts))[:-1]
    with jax.numpy_dtype_promotion("standard"):
        scaled = jnp.concatenate([jnp.asarray(omega) for _, omega in parts]) * units.time
    degree = max(len(block.micro) for block in blocks)

    def pieces(values: Any) -> Any:
        own = uniform_slices(make(values), slices)
        found = [waves(own.kinds, own.first, block, units) for block in blocks]
        return [_padded(wave, degree) for wave in found], own.thickness / units.length

    def level_at(pieces: Any) -> Any:
        wave, thickness = pieces
        return _level(wave, thickness, losses, scaled, units.time)

    def spread(*given: Any) -> Any:
        copies = [jnp.repeat(c[:, None], n, axis=1) for c, n in zip(given, counts, strict=True)]
        return jnp.concatenate(copies, axis=1)

    with jax.numpy_dtype_promotion("standard"):
        (known, h), (slopes, h_slopes) = pieces(values), jax.jacfwd(pieces)(values)
        own = jax.tree.map(spread, *known), spread(*[h] * len(parts))
        found, back = jax.vjp(level_at, own)
        ((by_wave, by_h),) = back(jnp.ones_like(found))
        total = jnp.einsum("lf,ln->fn", by_h, h_slopes)
        rows: list[Any] = [0.0] * len(parts)
        for leaf, *of_parts in zip(*map(jax.tree.leaves, (by_wave, *slopes)), strict=True):
            for n, (some, slope) in enumerate(
                zip(jnp.split(leaf, ends, axis=1), of_parts, strict=True)
            ):
                rows[n] = rows[n] + jnp.einsum("lf,ln->fn", some, slope)
        return found, total + jnp.concatenate(rows)


def _padded(wave: Wave, degree: int) -> Wave:
    """The same 𝒟 with polynomials of a degree, as those of blocks of more micro-fields."""
    none = jnp.zeros_like(wave.i_phi)
    above, below = ((none,) * (degree + 1 - len(p)) + tuple(p) for p in (wave.above, wave.below))
    return Wave(above, below, wave.i_phi, wave.i_B)
