"""What receivers see of a bar without losses, as moments: one product with L each, and no more.

With L of q̈ = L q + G s(t), R ≥ every frequency and Z = 1 + 2L/R², ω = R sin ψ, z = cos 2ψ:

    sin(tω)/ω = (2/R) Σ_n J_{2n+1}(Rt) W_n(z),   W_n(cos 2ψ) = sin((2n+1)ψ)/sin ψ,
    cos(tω)   = J_0(Rt) + 2 Σ_n J_{2n}(Rt) T_n(z),

so that the moments O W_n(Z) G, and O T_n(Z) q_0 of an initial field, tell what receivers O see at
all times (``moments_in_time.py``): half as many products as a series of exp(tA) takes, on a third
of its state. Both polynomials obey p_{n+1} = 2Z p_n − p_{n−1}, which is done as a leapfrog,

    d_{n+1} = d_n + (4/R²) L q_n,   q_{n+1} = q_n + d_{n+1},

as rounding then does not grow where z is near 1. (Jacobi–Anger; Mason & Handscomb, Chebyshev
Polynomials, 2003, 1.2.) A leapfrog can be run backward: reverse mode makes each q_n anew from the
last one, and needs no memory.

Arrays have the members of a batch as their last axis: a product serves all, and ``jax.vmap`` leads
here.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import custom_vmap

from wavesim.grid.bar import Bar


class Force(NamedTuple):
    """−(4/R²) L of blocks of one shape, p macro- and b micro-fields.

    Arrays are of shape (blocks, points, M).

    Attributes:
        stress: C of (σ, τ) of (Q φ, B): rows of σ as they are, of τ over inertia and times 4/R².
        free: (4/R²)/m_φ at nodes, 0 where held.
        bending: Γ over the norm of the nodes, shape (b, b) of such arrays; () where left out.
        back: (4/R²)/(H i_B) at half-nodes; () where Γ is left out.
    """

    stress: tuple[tuple[Any, ...], ...]
    free: Any
    bending: tuple[tuple[Any, ...], ...]
    back: Any


class Given(NamedTuple):
    """What moments are made of.

    Attributes:
        forces: of each group of blocks.
        start: q_0 and d_0 of each group: each a pair of tuples, of φ and of B, of arrays (blocks,
            points, M).
        weights, indices: that interpolate at receivers, of nodes and of half-nodes, shape
            (receivers, points, M) each.
    """

    forces: tuple[Force, ...]
    start: Any
    weights: tuple[Any, Any]
    indices: Any


class Differences(NamedTuple):
    """Q, the difference of the grid times its norm, of cells of size 1, and Qᵀ.

    Attributes:
        to_half, to_node: their products with (blocks, points, M), each the other's transpose.
    """

    to_half: Callable[[Any], Any]
    to_node: Callable[[Any], Any]


def unit_differences(bar: Bar) -> Differences:
    """Q = H D of a bar: it does not depend on the sizes of its cells."""
    made, n = bar.differences, len(bar.nodes)
    width, count = made.diagonals.shape
    half = np.zeros((width, n))
    half[:, :count] = made.diagonals * made.half_norm
    node = np.zeros((width, n))
    for w in range(width):  # row j of Q takes column j + first + w
        columns = np.arange(count) + made.first + w
        if bar.periodic:
            node[w, columns % n] = half[w, :count]
        else:
            inside = (columns >= 0) & (columns < n)
            node[w, columns[inside]] = half[w, :count][inside]

    def taps(diagonals: np.ndarray, first: int, u: Any) -> Any:
        left, right = -first, width - 1 + first
        u = jax.lax.optimization_barrier(u)  # see Difference of operator.py
        if bar.periodic:
            padded = jnp.concatenate([u[:, n - left :], u, u[:, :right]], axis=1)
        else:
            padded = jnp.pad(u, [(0, 0), (left, right), (0, 0)])
        padded = jax.lax.optimization_barrier(padded)
        total = diagonals[0][:, None] * padded[:, :n]
        for w in range(1, width):
            total = total + diagonals[w][:, None] * padded[:, w : w + n]
        return total

    def plain_half(u: Any) -> Any:
        return taps(half, made.first, u)

    def plain_node(u: Any) -> Any:
        return taps(node[::-1], 1 - width - made.first, u)

    to_half, to_node = jax.custom_vjp(plain_half), jax.custom_vjp(plain_node)
    to_half.defvjp(lambda u: (plain_half(u), None), lambda _, back: (plain_node(back),))
    to_node.defvjp(lambda u: (plain_node(u), None), lambda _, back: (plain_half(back),))
    return Differences(to_half, to_node)


def pull(of: Differences, forces: tuple[Force, ...], q: Any) -> Any:
    """−(4/R²) L q of all groups."""
    return tuple(_pulled(of, *pair) for pair in zip(forces, q, strict=True))


def _pulled(of: Differences, force: Force, q: Any) -> Any:
    """−(4/R²) L q of one group."""
    phi, B = q
    p = len(phi)
    strains = [*(of.to_half(one) for one in phi), *B]
    made = [_dot(row, strains) for row in force.stress]
    on_phi, on_B = [force.free * of.to_node(one) for one in made[:p]], made[p:]
    if force.bending:
        slopes = [of.to_node(one) for one in B]
        for j, row in enumerate(force.bending):
            on_B[j] = on_B[j] + force.back * of.to_half(_dot(row, slopes))
    return tuple(on_phi), tuple(on_B)


def _dot(row: Sequence[Any], values: Sequence[Any]) -> Any:
    first, *others = (c * v for c, v in zip(row, values, strict=True))
    return sum(others, start=first)


def _seen(indices: Any, weights: Any, q: Any) -> Any:
    """Values at receivers, (components, blocks, receivers, M) for φ and for B of each group."""

    def at(indices: Any, weights: Any, parts: tuple[Any, ...]) -> Any:
        receivers, width, members = weights.shape
        if not parts:
            return jnp.zeros((0, 0, receivers, members))
        flat = indices.reshape(1, receivers * width, members)
        found = []
        for part in parts:
            own = jnp.take_along_axis(part, flat, axis=1).reshape(-1, receivers, width, members)
            found.append(jnp.sum(weights * own, axis=2))
        return jnp.stack(found)

    return tuple(
        tuple(at(*own) for own in zip(indices, weights, group, strict=True)) for group in q
    )


def _minus(one: Any, other: Any) -> Any:
    return jax.tree.map(jnp.subtract, one, other)


def _plus(one: Any, other: Any) -> Any:
    return jax.tree.map(jnp.add, one, other)


def moments_of(bar: Bar, count: int) -> Callable[[Given], Any]:
    """A function that gives the first moments of a bar.

    Returns:
        moments(given): (φ, B) of each group at the receivers, shapes (count, components, blocks,
        receivers, M). Of reverse mode; under ``jax.vmap`` the batch joins the members.
    """
    of = unit_differences(bar)
    pulled = functools.partial(pull, of)

    @custom_vmap
    def forward(given: Given) -> Any:
        def step(carry: Any, _: None) -> Any:
            q, d = carry
            d = _minus(d, pulled(given.forces, q))
            return (_plus(q, d), d), _seen(given.indices, given.weights, q)

        last, seen = jax.lax.scan(step, given.start, None, length=count)
        return seen, last

    @custom_vmap
    def backward(given: Given, last: Any, back: Any) -> Any:
        """Gradient by forces, start and weights, from that by the moments."""

        def seen(weights: Any, q: Any) -> Any:
            return _seen(given.indices, weights, q)

        def step(carry: Any, back: Any) -> Any:
            (q, d), (of_q, of_d), found = carry
            q = _minus(q, d)
            force, pullback = jax.vjp(pulled, given.forces, q)
            d = _plus(d, force)
            of_d = _plus(of_d, of_q)
            forces, by_force = pullback(jax.tree.map(jnp.negative, of_d))
            weights, by_receivers = jax.vjp(seen, given.weights, q)[1](back)
            of_q = _plus(of_q, _plus(by_force, by_receivers))
            return ((q, d), (of_q, of_d), _plus(found, (forces, weights))), None

        def zeros(tree: Any) -> Any:
            return jax.tree.map(jnp.zeros_like, tree)

        start = last, zeros(last), (zeros(given.forces), zeros(given.weights))
        (_, of_start, (forces, weights)), _ = jax.lax.scan(step, start, back, reverse=True)
        return forces, of_start, weights

    for function in (forward, backward):
        _let_members_join(function)

    @jax.custom_vjp
    def moments(given: Given) -> Any:
        return forward(given)[0]

    def kept(given: Given) -> Any:
        seen, last = forward(given)
        return seen, (given, last)

    def gradient(kept: Any, back: Any) -> Any:
        given, last = kept
        forces, start, weights = backward(given, last, back)
        return (Given(forces, start, weights, None),)

    moments.defvjp(kept, gradient)
    return moments


def _let_members_join(function: Any) -> None:
    """A batch of a function of arrays whose last axis are members is one call with more members."""

    def rule(size: int, batched: Any, *arguments: Any) -> Any:
        def joined(array: Any, is_batched: bool) -> Any:
            whole = array if is_batched else jnp.broadcast_to(array, (size, *jnp.shape(array)))
            moved = jnp.moveaxis(whole, 0, -2)
            return moved.reshape(*moved.shape[:-2], moved.shape[-2] * moved.shape[-1])

        def parted(array: Any) -> Any:
            members = array.shape[-1] // size
            return jnp.moveaxis(array.reshape(*array.shape[:-1], size, members), -2, 0)

        made = function(*jax.tree.map(joined, arguments, tuple(batched)))
        return jax.tree.map(parted, made), jax.tree.map(lambda _: True, made)

    function.def_vmap(rule)
