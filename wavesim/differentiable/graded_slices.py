"""A graded layer as slices, each by Gauss collocation of order 16, from the right to the left.

With y = (e, o) of ``layered/``, e = (v_φ, f_B) and o = (f_φ, v_B), and u counted leftwards,

    de/du = −P o,    do/du = −Q e,

met at eight Gauss points of a slice; the slopes of e alone are one system of equations. It is the
method of ``layered.graded_layer``. How long slices are, each frequency says by itself: no longer
than 1.5/|k|, and than half the way to where P has a pole, at an asymptote beside the layer or, with
losses, beside the real axis. With f₀ the function whose zeros these are no zero is nearer than

    2|f₀|/(|f₀′| + √(f₀′² + 2|f₀| max|f₀″|)).

For a search uniform slices, each of what stands in its middle, do as well: :func:`uniform_slices`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.differentiable.coefficients import loss_law
from wavesim.differentiable.traced_layers import TracedLayers, medium_of
from wavesim.layered.graded_layer import POINTS, butcher
from wavesim.material.family import Block
from wavesim.material.layers import Grading, graded_weight
from wavesim.material.medium import Medium
from wavesim.material.scaling import Scales, block_coefficients

_WAVES, _SHARE = 1.5, 0.5
# From one to the next of so many looks f₀′ shows f₀″, with room; no slice is longer in parts of u.
_LOOKS, _ROOM, _LONGEST = 48, 1.2, 0.25


C, A, B = butcher()
# Places in w at which coefficients are taken: polynomials of the eleventh degree at most.
_PLACES = 16


def _interpolation() -> tuple[Any, Any, Any]:
    """Chebyshev's places in w, barycentric weights there, and the derivative at each by values."""
    turn = np.pi * (np.arange(_PLACES) + 0.5) / _PLACES
    places, weights = (1 + np.cos(turn)) / 2, np.sin(turn) * (-1.0) ** np.arange(_PLACES)
    gaps = places[:, None] - places + np.eye(_PLACES)
    slopes = weights / weights[:, None] / gaps - np.eye(_PLACES)
    return places, weights, slopes - np.diag(slopes.sum(axis=1))


_AT, _WEIGHTS, _SLOPES = _interpolation()


class System(NamedTuple):
    """A graded layer, over its thickness and u from 0 at its right end to 1.

    Attributes:
        halves: P and Q times the thickness at places (N, 8): (N, 8, n, n) each.
        rate: |k| times the thickness at places (N,).
        zeros: f₀ and f₀′ at places (N,), (N, K): functions with zeros at the poles of P and Q.
    """

    halves: Callable[[Any], tuple[Any, Any]]
    rate: Callable[[Any], Any]
    zeros: Callable[[Any], tuple[Any, Any]]


Along = Callable[[Any], tuple[tuple[Any, ...], tuple[Any, ...]]]
"""Coefficients of a block at places, as ``BlockCoefficients`` has them in turn, and derivatives."""


def coefficients_along(
    stack: TracedLayers, n: Any, kind: Medium, grading: Grading, block: Block, units: Scales
) -> Along:
    """Scaled coefficients of a graded layer at places u of any shape, from its right end, in parts.

    They are polynomials in w, the part of the layer's end, so that values at some w have them all.

    Args:
        stack: its layers.
        n: which of them; may be traced.
        kind, grading: its own.
        block: whose coefficients.
        units: to scale by.
    """
    assert stack.last is not None
    first, last = (
        medium_of(kind, {name: value[n] for name, value in end.items()}).parameters
        for end in (stack.first, stack.last)
    )

    def at(w: Any) -> list[Any]:
        values = {name: (1 - w) * first[name] + w * last[name] for name in first}
        return list(vars(block_coefficients(medium_of(kind, values), block, units)).values())

    known = jax.vmap(at)(_AT)
    slopes = [jnp.tensordot(_SLOPES, one, 1) for one in known]

    def along(u: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        w, by_u = jax.jvp(lambda u: graded_weight(1 - u, grading), (u,), (jnp.ones_like(u),))
        gap = w[..., None] - _AT
        basis = _WEIGHTS / jnp.where(gap == 0, 1e-100, gap)
        basis = basis / basis.sum(axis=-1, keepdims=True)
        turn = basis * by_u[..., None]
        return tuple(jnp.tensordot(basis, one, 1) for one in known), tuple(
            jnp.tensordot(turn, one, 1) for one in slopes
        )

    return along


def through_graded(
    system: Callable[[Any], System],
    layers: Any,
    state: Any,
    through: Callable[[Any, tuple[Any, ...]], Any],
    count: int,
    steps: int,
) -> tuple[Any, Any]:
    """What is carried, at the left end of graded layers, and whether slices sufficed, (N,).

    Args:
        system: of a layer by its index.
        layers: indices, from the right to the left.
        state: at their right end.
        through: takes it through a slice of (ee, eo, oe, oo).
        count: N, of frequencies.
        steps: how many slices there may be in a layer.
    """

    def one(state: Any, n: Any) -> tuple[Any, Any]:
        return _through_slices(system(n), state, through, count, steps)

    state, clear = jax.lax.scan(jax.checkpoint(one), state, layers)
    return state, clear.all(axis=0)


def _through_slices(
    system: System, state: Any, through: Callable[..., Any], count: int, steps: int
) -> tuple[Any, Any]:

    looks = (np.arange(_LOOKS + 1) / _LOOKS)[:, None] + np.zeros(count)
    _, slopes = jax.lax.map(system.zeros, jnp.asarray(looks))
    bend = _ROOM * _LOOKS * jnp.abs(jnp.diff(slopes, axis=0)).max(axis=0)

    def longest(u: Any) -> Any:
        f, slope = (jnp.abs(one) for one in system.zeros(u))
        clear = 2 * f / jnp.maximum(slope + jnp.sqrt(slope**2 + 2 * f * bend), 1e-300)
        return jnp.minimum(_SHARE * clear.min(axis=1), _WAVES / system.rate(u))

    def slice_(carry: Any, _: Any) -> tuple[Any, None]:
        state, u = carry
        h = jax.lax.stop_gradient(jnp.clip(longest(u), 0.0, jnp.minimum(_LONGEST, 1 - u)))

        def go(state: Any) -> Any:
            p, q = system.halves(u[:, None] + h[:, None] * C)
            p, q = (-x * h[:, None, None, None] for x in (p, q))
            return through(state, _collocated(p, q))

        return (jax.lax.cond(jnp.any(h > 0), go, lambda state: state, state), u + h), None

    begun = state, jnp.zeros(count)
    (state, u), _ = jax.lax.scan(jax.checkpoint(slice_), begun, None, length=steps)
    return state, u > 1 - 1e-12


def _collocated(p: Any, q: Any) -> tuple[Any, Any, Any, Any]:
    """ee, eo, oe, oo of e → ee e + eo o, o → oe e + oo o over a slice, (N, n, n) each.

    Args:
        p, q: −hP and −hQ at its points, (N, 8, n, n).
    """
    n, unit = p.shape[-1], jnp.eye(p.shape[-1], dtype=p.dtype)
    a, b = (jnp.asarray(x, dtype=p.dtype) for x in (A, B))
    twice = jnp.asarray(A[:, :, None] * A[None], dtype=p.dtype)
    mixed = jnp.einsum("zirs,ijk,zjsc->zirkc", p, twice, q)
    size = POINTS * n
    from_e = p @ jnp.einsum("ij,zjrc->zirc", a, q)
    given = jnp.concatenate([from_e, p], axis=-1).reshape(-1, size, 2 * n)
    matrix = jnp.eye(size, dtype=p.dtype) - mixed.reshape(-1, size, size)
    E = _solved(matrix, given).reshape(-1, POINTS, n, 2 * n)  # slopes of e
    start = jnp.concatenate([unit, jnp.zeros_like(unit)], axis=-1)
    Z = q @ (start + jnp.einsum("ij,zjrc->zirc", a, E))
    e = start + jnp.einsum("i,zirc->zrc", b, E)
    o = jnp.roll(start, n, axis=-1) + jnp.einsum("i,zirc->zrc", b, Z)
    return e[..., :n], e[..., n:], o[..., :n], o[..., n:]


def _solved(matrix: Any, given: Any) -> Any:
    """matrix⁻¹ given by elimination without a pivot, as the matrix is near 1 where slices do.

    jnp.linalg.solve hands each small matrix to LAPACK, and may wait for its threads for ever.
    """
    size = matrix.shape[-1]

    def eliminated(whole: Any, k: Any) -> tuple[Any, None]:
        row = whole[:, k] / whole[:, k, k, None]
        rest = whole - whole[:, :, k, None] * row[:, None]
        return rest.at[:, k].set(row), None

    whole = jnp.concatenate([matrix, given], axis=-1)
    return jax.lax.scan(eliminated, whole, np.arange(size))[0][..., size:]


def uniform_slices(stack: TracedLayers, count: int) -> TracedLayers:
    """The stack with so many uniform slices for each graded layer, as it is in their middles.

    Args:
        stack: whose arrays may be traced.
        count: of slices, each of the second order in its thickness.
    """
    if stack.last is None:
        return stack
    parts = [count if grading else 1 for grading in stack.gradings]
    at = np.repeat(np.arange(len(parts)), parts)
    w = np.concatenate(
        [
            graded_weight((np.arange(n) + 0.5) / n, grading) if grading else np.zeros(1)
            for n, grading in zip(parts, stack.gradings, strict=True)
        ]
    )
    whole = [n > 1 for n in parts]
    first, last = dict(stack.first), dict(stack.last)
    for n in np.flatnonzero(whole):  # what follows from others, as an inertia from R, is graded too
        for end in (first, last):
            known = medium_of(stack.kinds[n], {name: v[n] for name, v in end.items()}).parameters
            for name in end:
                end[name] = end[name].at[n].set(known[name])
    values = {
        name: jnp.where(w == 0, first[name][at], (1 - w) * first[name][at] + w * last[name][at])
        for name in first
    }
    return TracedLayers(
        first=values,
        last=None,
        thickness=(stack.thickness / np.array(parts))[at],
        losses=loss_law(stack.losses, at),
        kinds=tuple(stack.kinds[n] for n in at),
        gradings=(None,) * len(at),
        kept=stack.kept,
    )
