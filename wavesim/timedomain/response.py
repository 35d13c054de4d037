"""What the pulses do to the field within one exact step, prepared as small dense tables.

A pulse at a point reaches only the cells near it within a step. With nodes τ_m on [0, h] it adds
to the field after the step

    Δq = ∫₀^h S(h−τ) g s(t+τ) dτ = Σ_m [S g]_m s(t+τ_m),     Δv = ∫₀^h C(h−τ) g s(t+τ) dτ,

and its work is ∫ s(t+τ) ⟨g, v(t+τ)⟩ dτ, where

    ⟨g, v(t+τ)⟩ = ⟨LS(τ)ᵀg, q⟩ + ⟨C(τ)ᵀg, v⟩ + Σ_j ∫₀^τ ⟨g, C(τ−τ′) g_j⟩ s_j(t+τ′) dτ′.

The integrals over the operator's functions are Gauss sums fine enough for its fastest mode; the
pulse, which is smoother, is sampled at fewer Gauss nodes and interpolated to those. The vectors
[S g]_m, … are Chebyshev sums of T_k(X) g, made on a ring of no more cells than the window round the
source in which it is felt: what goes round that ring in T_k(X) g alone is nothing in the sums. The
work so found uses no energy, so that the energy balance is a true check.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.forcing import Forcing
from wavesim.timedomain.operator import Operator, State
from wavesim.timedomain.timestep import Schedule, chebyshev_series, cosine, sine

# Gauss nodes beyond half the phase of what they integrate or interpolate.
_EXTRA_NODES = 14


class _Window(eqx.Module):
    """Where pulses are felt within a step.

    Attributes:
        pulse, block: of each entry, shape (entries,).
        cells: the cells within reach round the source, shape (entries, cells).
    """

    pulse: np.ndarray
    block: np.ndarray
    cells: np.ndarray

    def seen(self, components: tuple[jax.Array, ...]) -> jax.Array:
        """A group's components in the windows, shape (entries, components, cells)."""
        rows = self.block[:, None]
        return jnp.stack([c[rows, self.cells] for c in components], axis=1)

    def add(self, components: tuple[jax.Array, ...], change: jax.Array) -> tuple[jax.Array, ...]:
        """A group's components with a change of that shape added in the windows."""
        rows = self.block[:, None]
        return tuple(c.at[rows, self.cells].add(change[:, i]) for i, c in enumerate(components))


class _Reach(eqx.Module):
    """The pulses on one group of blocks, an entry for each pulse and block that it drives.

    Attributes:
        on_q, on_v: w_m S(h−τ_m) g and w_m C(h−τ_m) g, shape (entries, nodes, components, cells).
        from_q, from_v: (LS(τ_m))ᵀ g and C(τ_m)ᵀ g times the cell size, likewise.
        at: which pulse, block and cells an entry is.
        group: which group of the state.
    """

    on_q: jax.Array
    on_v: jax.Array
    from_q: jax.Array
    from_v: jax.Array
    at: _Window
    group: int = eqx.field(static=True)


class PulseTables(eqx.Module):
    """Tables of all pulses for one step length.

    Attributes:
        reaches: for each group that a pulse drives.
        own: ∫ kernel for the pulses' velocity at each other's points within the step, shape
            (pulses, nodes, pulses, inner nodes).
        nodes, weights: Gauss nodes and weights on [0, h], at which the pulses are sampled.
        inner: nodes of [0, τ_m] for each m, shape (nodes, inner nodes).
        step: h, scaled.
        end: scaled time from which on no pulse acts.
    """

    reaches: tuple[_Reach, ...]
    own: jax.Array
    nodes: jax.Array
    weights: jax.Array
    inner: jax.Array
    step: float = eqx.field(static=True)
    end: float = eqx.field(static=True)


def pulse_tables(operator: Operator, forcing: Forcing, schedule: Schedule) -> PulseTables:
    """Prepare the tables.

    Args:
        operator: L.
        forcing: the pulses.
        schedule: of the run; its step, bound and degree count.

    Returns:
        The tables, jax arrays where the operator's coefficients are.
    """
    h, bound, degree = schedule.step, schedule.bound, schedule.degree
    fine = degree + _EXTRA_NODES
    # Infinite where a signal has kinks: it is then sampled at all the fine nodes.
    band = max(pulse.spectral_end for pulse in forcing.pulses) * forcing.time_scale
    (unit_nodes, unit_weights), (fine_nodes, fine_weights), between = interpolation(
        math.ceil(min(fine, h * band / 2 + _EXTRA_NODES)), fine
    )
    nodes, weights = h * unit_nodes, h * unit_weights
    # (node, degree) coefficients of the functions of L named at the head of this file.
    rest, measure = h * (1 - fine_nodes), h * fine_weights[:, None]
    on_q = between.T @ (measure * chebyshev_series(lambda e: sine(rest, e), bound, degree))
    on_v = between.T @ (measure * chebyshev_series(lambda e: cosine(rest, e), bound, degree))
    from_q = chebyshev_series(lambda e: -e * sine(nodes, e), bound, degree)
    from_v = chebyshev_series(lambda e: cosine(nodes, e), bound, degree)
    kernel = np.empty((len(nodes), len(nodes), degree + 1))
    for row, node in zip(kernel, nodes, strict=True):
        lag = functools.partial(cosine, node * (1 - fine_nodes))
        part = node * fine_weights[:, None]
        row[:] = between.T @ (part * chebyshev_series(lag, bound, degree))

    cells = _felt(forcing.profiles, schedule.reach)
    windows = {
        number: _Window(pulse, block, cells[pulse])
        for number in range(len(operator.groups))
        for pulse, block in [_driven(number, forcing.profiles)]
        if len(pulse)
    }
    forward, backward = np.stack([on_q, on_v]), np.stack([from_q, from_v]) * operator.spacing
    given = forcing.profiles, cells, bound, windows
    ahead, moments = _sums(operator, *given, forward)
    back, _ = _sums(operator.adjoint, *given, backward)
    reaches = tuple(
        _Reach(
            on_q=jnp.asarray(ahead[number][0]),
            on_v=jnp.asarray(ahead[number][1]),
            from_q=jnp.asarray(back[number][0]),
            from_v=jnp.asarray(back[number][1]),
            at=window,
            group=number,
        )
        for number, window in windows.items()
    )
    own = (jnp if isinstance(moments, jax.Array) else np).einsum("mnk,kij->imjn", kernel, moments)
    end = max(pulse.end for pulse in forcing.pulses) / forcing.time_scale
    return PulseTables(
        reaches,
        jnp.asarray(own),
        jnp.asarray(nodes),
        jnp.asarray(weights),
        jnp.asarray(np.multiply.outer(nodes, unit_nodes)),
        h,
        end,
    )


def _driven(number: int, profiles: tuple[State, ...]) -> tuple[np.ndarray, np.ndarray]:
    """(pulse, block) of all entries of a group; the profiles must be concrete."""
    driven = [np.any([np.asarray(c) != 0 for c in g[number]], axis=(0, 2)) for g in profiles]
    pulse, block = np.nonzero(driven)
    return pulse, block


def _felt(profiles: tuple[State, ...], reach: int) -> np.ndarray:
    """The cells in which each pulse is felt within a step, shape (pulses, cells)."""
    firsts, spans = [], []
    for profile in profiles:
        parts = [np.asarray(c) != 0 for c in jax.tree.leaves(profile)]
        ring = parts[0].shape[-1]
        at = np.nonzero(np.any([part.any(axis=0) for part in parts], axis=0))[0]
        # The widest stretch of cells on the ring that is not driven is left out.
        idle = np.diff(np.append(at, at[0] + ring))
        firsts.append(int(at[(int(np.argmax(idle)) + 1) % len(at)]))
        spans.append(ring - int(idle.max()) + 1)
    count = min(ring, max(spans) + 2 * reach)
    return (np.array(firsts)[:, None] - reach + np.arange(count)) % ring


def gauss(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss–Legendre nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


def interpolation(
    count: int, fine: int
) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Two Gauss rules on [0, 1], coarse and fine, and the matrix from values at one to the other.

    Values become Legendre coefficients by the discrete transform, exact for degree < count.

    Args:
        count, fine: number of nodes of either.

    Returns:
        (nodes, weights) of each, and the matrix (fine, count).
    """
    finer = gauss(fine)
    legendre = np.polynomial.legendre.legvander
    between = legendre(2 * finer[0] - 1, count - 1) @ legendre_transform(count)
    return gauss(count), finer, between


def legendre_transform(count: int) -> np.ndarray:
    """From values at Gauss nodes of [0, 1] to coefficients of P_p(2x − 1), shape (count, count)."""
    nodes, weights = gauss(count)
    coarse = np.polynomial.legendre.legvander(2 * nodes - 1, count - 1)
    return np.asarray((2 * np.arange(count) + 1)[:, None] * coarse.T * weights)


def _sums(
    operator: Operator,
    profiles: tuple[State, ...],
    cells: np.ndarray,
    bound: float,
    windows: dict[int, _Window],
    coefficients: np.ndarray,
) -> tuple[dict[int, Any], Any]:
    """Σ_k c_fmk T_k(X) g_j in the windows, and ⟨g_i, T_k(X) g_j⟩ h, X = 1 + 2L/Λ.

    With coefficients of shape (functions, nodes, degree + 1) the first has, for each group,
    shape (functions, entries, nodes, components, cells); the second (degree + 1, i, j).
    Plain coefficients are summed by numpy, which has nothing to compile.
    """
    own = range(len(profiles))
    # All pulses in the windows of each one, and each in its own.
    stacked = jax.tree.map(lambda *g: np.stack([one[..., cells] for one in g]), *profiles)
    begun = jax.tree.map(lambda g: g[own, :, own].copy(), stacked)

    def shifted(y: State) -> State:
        return jax.tree.map(lambda a, b: a + 2 / bound * b, y, operator(y))

    traced = any(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(operator))
    xp = jnp if traced else np

    def seen(y: State) -> Any:
        parts = {
            n: xp.stack([c[w.pulse, w.block] for c in y[n]], axis=1) for n, w in windows.items()
        }
        overlaps = jax.tree.map(lambda g, c: xp.einsum("isjn,jsn->ij", g, c), stacked, y)
        return parts, sum(jax.tree.leaves(overlaps)) * operator.spacing

    def advance(carry: tuple[State, State], _: None) -> Any:
        before, now = carry
        after = jax.tree.map(lambda a, b: 2 * a - b, shifted(now), before)
        return (now, after), seen(now)

    count = coefficients.shape[-1]
    carry = (shifted(begun), begun)
    if traced:
        _, (vectors, overlaps) = jax.lax.scan(advance, carry, length=count)
    else:
        found = []
        for _ in range(count):
            carry, made = advance(carry, None)
            found.append(made)
        vectors, overlaps = jax.tree.map(lambda *parts: np.stack(parts), *found)
    sums = {
        n: xp.einsum("fmk,kecn->femcn", coefficients, v, optimize=True) for n, v in vectors.items()
    }
    return sums, overlaps


def add_pulses(
    tables: PulseTables, on_q: jax.Array, on_v: jax.Array, q: State, v: State
) -> tuple[State, State]:
    """Add the pulses' part to a field and its rate after a step.

    Args:
        tables: of :func:`pulse_tables`.
        on_q, on_v: signal of each pulse at the nodes, as it enters q and v, (pulses, nodes).
        q, v: the field and its rate, after the step without sources.
    """
    new_q, new_v = list(q), list(v)
    for reach in tables.reaches:
        g, at = reach.group, reach.at
        new_q[g] = at.add(q[g], jnp.einsum("em,emcn->ecn", on_q[at.pulse], reach.on_q))
        new_v[g] = at.add(v[g], jnp.einsum("em,emcn->ecn", on_v[at.pulse], reach.on_v))
    return tuple(new_q), tuple(new_v)


def pulse_work(
    tables: PulseTables, forcing: Forcing, t: jax.Array, q: State, v: State
) -> jax.Array:
    """Work of the pulses in a step from scaled time t, from the field and its rate at t."""
    velocity = jnp.einsum("imjn,jmn->im", tables.own, forcing.signals(t + tables.inner))
    for reach in tables.reaches:
        at, g = reach.at, reach.group
        felt = jnp.einsum("emcn,ecn->em", reach.from_q, at.seen(q[g]))
        felt += jnp.einsum("emcn,ecn->em", reach.from_v, at.seen(v[g]))
        velocity = velocity.at[at.pulse].add(felt)
    return jnp.sum(tables.weights * forcing.signals(t + tables.nodes) * velocity)
