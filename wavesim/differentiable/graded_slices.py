"""A graded layer as slices, each by Gauss collocation of order 16, from the right to the left.

With u counted leftwards, v and g of ``stack_transmission`` obey

    dv/du = (ω/𝒟) g,    dg/du = −ω ι I v.

A slice meets that at eight Gauss points; the slopes of v alone are one system of eight equations.
``layered.graded_layer`` is the same method, with slices as small as each frequency asks.

For a search uniform slices, each of what stands in its middle, do as well: :func:`uniform_slices`.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.differentiable.coefficients import loss_law, moduli, waves
from wavesim.differentiable.traced_layers import TracedLayers, medium_of
from wavesim.material.family import Block
from wavesim.material.layers import graded_weight
from wavesim.material.scaling import Scales

POINTS = 8
# A decay that is set apart is no more than this, or an asymptote would empty the slice.
_MOST = 50.0


def _gauss() -> tuple[Any, Any, Any]:
    """c (8,), a (8, 8), b (8,) of Gauss collocation on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    series = np.linalg.inv(np.polynomial.legendre.legvander(nodes, POINTS - 1))
    rows = [np.polynomial.legendre.legint(one, lbnd=-1) for one in np.eye(POINTS)]
    a = np.polynomial.legendre.legvander(nodes, POINTS) @ np.array(rows).T @ series / 2
    return (nodes + 1) / 2, a, weights / 2


C, A, B = _gauss()


def graded_slices(
    stack: TracedLayers, n: int, block: Block, units: Scales, omega: Any, h: Any, steps: int
) -> tuple[Any, Any]:
    """(vv, vg, gv, gg) of each slice, times e^{−decay}, and decay, from the right: (steps, N) each.

    Args:
        stack: the stack.
        n: which of its layers.
        block: with a macro-field.
        units: to scale by.
        omega: scaled, (N,).
        h: thickness of a slice, scaled.
        steps: how many.
    """
    kind, grading = stack.kinds[n], stack.gradings[n]
    assert stack.last is not None
    assert grading is not None
    ends = [
        medium_of(kind, {name: value[n] for name, value in end.items()}).parameters
        for end in (stack.first, stack.last)
    ]
    places = 1 - (np.arange(steps)[:, None] + C).ravel() / steps
    w = jnp.asarray(graded_weight(places, grading))
    values = {name: (1 - w) * ends[0][name] + w * ends[1][name] for name in ends[0]}
    wave = waves((kind,), values, block, units)
    wave = jax.tree.map(lambda value: value.reshape(steps, POINTS, 1), wave)
    m, iota = moduli(loss_law(stack.losses, n), omega, units.time)
    D = wave.stiffness(omega, m, iota)
    p, q = h * omega / D, -h * omega * iota * wave.i_phi * jnp.ones_like(D)
    p, q = (jnp.moveaxis(x, 1, -1) for x in (p, q))  # (steps, N, 8)
    a, b = jnp.asarray(A), jnp.asarray(B)
    mixed = jnp.einsum("...i,ij,...j,jk->...ik", p, a.astype(p.dtype), q, a.astype(p.dtype))
    given = jnp.stack([p * jnp.einsum("ij,...j->...i", a.astype(p.dtype), q), p], axis=-1)
    V = _solved(jnp.eye(POINTS, dtype=p.dtype) - mixed, given)
    start = jnp.asarray([1.0, 0.0], dtype=p.dtype)
    G = q[..., None] * (start + jnp.einsum("ij,...jk->...ik", a.astype(p.dtype), V))
    to_v = start + jnp.einsum("i,...ik->...k", b.astype(p.dtype), V)
    to_g = jnp.flip(start) + jnp.einsum("i,...ik->...k", b.astype(p.dtype), G)
    decay = jax.lax.stop_gradient(jnp.sum(b * jnp.abs(jnp.sqrt(p * q + 0j).real), axis=-1))
    decay = jnp.minimum(decay, _MOST)
    kept = jnp.exp(-decay)
    return (
        to_v[..., 0] * kept, to_v[..., 1] * kept, to_g[..., 0] * kept, to_g[..., 1] * kept
    ), decay  # fmt: skip


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


def _solved(matrix: Any, given: Any) -> Any:
    """matrix⁻¹ given by elimination without a pivot, as the matrix is near 1 where slices do.

    jnp.linalg.solve hands each small matrix to LAPACK, and may wait for its threads for ever.
    """
    whole = jnp.concatenate([matrix, given], axis=-1)
    for k in range(POINTS):
        row = whole[..., k, :] / whole[..., k, k, None]
        rest = whole - whole[..., :, k, None] * row[..., None, :]
        whole = rest.at[..., k, :].set(row)
    return whole[..., POINTS:]
