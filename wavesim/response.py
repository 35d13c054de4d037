"""What the pulses do to the field within one Chebyshev step, prepared as small dense tables.

A pulse at a point reaches only the cells near it within a step. With Gauss nodes τ_m and weights
w_m on [0, h] the pulse adds to the field after the step

    Δq = Σ_m w_m s(t+τ_m) S(h−τ_m) g,     Δv = Σ_m w_m s(t+τ_m) C(h−τ_m) g,

and its work is Σ_m w_m s(t+τ_m) ⟨g, v(t+τ_m)⟩, where

    ⟨g, v(t+τ)⟩ = ⟨LS(τ)ᵀg, q⟩ + ⟨C(τ)ᵀg, v⟩ + Σ_j ∫₀^τ ⟨g, C(τ−τ′) g_j⟩ s_j(t+τ′) dτ′.

The vectors S(h−τ_m) g, C(τ_m)ᵀg, … are Chebyshev sums of T_k(X) g, kept in a window round the
source; the work so found uses no energy, so that the energy balance is a true check.
"""

from __future__ import annotations

import functools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.forcing import Forcing
from wavesim.operator import Operator, State
from wavesim.timestep import Schedule, chebyshev_series, cosine, sine

# Gauss nodes beyond the degree of the series, for the spectrum of the pulse itself.
_EXTRA_NODES = 6


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
        nodes, weights: Gauss nodes and weights on [0, h].
        inner: nodes of [0, τ_m] for each m, shape (nodes, inner nodes).
        end: scaled time from which on no pulse acts.
    """

    reaches: tuple[_Reach, ...]
    own: jax.Array
    nodes: jax.Array
    weights: jax.Array
    inner: jax.Array
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
    unit_nodes, unit_weights = np.polynomial.legendre.leggauss(degree + _EXTRA_NODES)
    unit_nodes, unit_weights = (unit_nodes + 1) / 2, unit_weights / 2
    nodes, weights = h * unit_nodes, h * unit_weights
    # (node, degree) coefficients of the functions of L named at the head of this file.
    on_q = weights[:, None] * chebyshev_series(lambda e: sine(h - nodes, e), bound, degree)
    on_v = weights[:, None] * chebyshev_series(lambda e: cosine(h - nodes, e), bound, degree)
    from_q = chebyshev_series(lambda e: -e * sine(nodes, e), bound, degree)
    from_v = chebyshev_series(lambda e: cosine(nodes, e), bound, degree)
    lag = np.multiply.outer(nodes, 1 - unit_nodes)
    kernel = chebyshev_series(lambda e: cosine(lag, e), bound, degree)
    kernel *= np.multiply.outer(nodes, unit_weights)[..., None]

    windows = {
        number: window
        for number in range(len(operator.groups))
        if (window := _window(operator, number, forcing.profiles, degree)) is not None
    }
    forward, backward = np.stack([on_q, on_v]), np.stack([from_q, from_v]) * operator.spacing
    ahead, moments = _sums(operator, forcing.profiles, bound, windows, forward)
    back, _ = _sums(operator.adjoint, forcing.profiles, bound, windows, backward)
    reaches = tuple(
        _Reach(
            on_q=ahead[number][0],
            on_v=ahead[number][1],
            from_q=back[number][0],
            from_v=back[number][1],
            at=window,
            group=number,
        )
        for number, window in windows.items()
    )
    own = jnp.einsum("mnk,kij->imjn", kernel, moments)
    end = max(pulse.end for pulse in forcing.pulses) / forcing.time_scale
    return PulseTables(
        reaches,
        own,
        jnp.asarray(nodes),
        jnp.asarray(weights),
        jnp.asarray(np.multiply.outer(nodes, unit_nodes)),
        end,
    )


def _window(
    operator: Operator, number: int, profiles: tuple[State, ...], degree: int
) -> _Window | None:
    """Entries of one group, None where no pulse drives it; the profiles must be concrete."""
    entries, spans = [], []
    for pulse, profile in enumerate(profiles):
        driven = np.any([np.asarray(c) != 0 for c in profile[number]], axis=0)
        for block in np.nonzero(driven.any(axis=1))[0]:
            cells = np.nonzero(driven[block])[0]
            # The widest stretch of cells on the ring that is not driven is left out.
            idle = np.diff(np.append(cells, cells[0] + operator.cells))
            first = int(cells[(int(np.argmax(idle)) + 1) % len(cells)])
            entries.append((pulse, int(block), first))
            spans.append(operator.cells - int(idle.max()) + 1)
    if not entries:
        return None
    # A product with L reaches one cell less than the two stencils together are wide.
    reach = degree * 2 * len(operator.groups[number].weights)
    count = min(operator.cells, max(spans) + 2 * reach)
    pulse, block, first = np.array(entries).T
    return _Window(pulse, block, (first[:, None] - reach + np.arange(count)) % operator.cells)


@functools.partial(jax.jit, static_argnums=2)
def _sums(
    operator: Operator,
    profiles: tuple[State, ...],
    bound: float,
    windows: dict[int, _Window],
    coefficients: np.ndarray,
) -> tuple[dict[int, jax.Array], jax.Array]:
    """Σ_k c_fmk T_k(X) g_j in the windows, and ⟨g_i, T_k(X) g_j⟩ h, X = 1 + 2L/Λ.

    With coefficients of shape (functions, nodes, degree + 1) the first has, for each group,
    shape (functions, entries, nodes, components, cells); the second (degree + 1, i, j).
    """
    stacked = jax.tree.map(lambda *g: jnp.stack(g), *profiles)

    def shifted(y: State) -> State:
        return jax.tree.map(lambda a, b: a + 2 / bound * b, y, operator(y))

    def seen(y: State) -> Any:
        parts = {
            n: jnp.stack([c[w.pulse[:, None], w.block[:, None], w.cells] for c in y[n]], axis=1)
            for n, w in windows.items()
        }
        overlaps = jax.tree.map(lambda g, c: jnp.einsum("isn,jsn->ij", g, c), stacked, y)
        return parts, jax.tree.reduce(jnp.add, overlaps) * operator.spacing

    def advance(carry: tuple[State, State], _: None) -> Any:
        before, now = carry
        after = jax.tree.map(lambda a, b: 2 * a - b, shifted(now), before)
        return (now, after), seen(now)

    count = coefficients.shape[-1]
    _, (vectors, overlaps) = jax.lax.scan(advance, (shifted(stacked), stacked), length=count)
    sums = {n: jnp.einsum("fmk,kecn->femcn", coefficients, v) for n, v in vectors.items()}
    return sums, overlaps


def pulse_step(
    tables: PulseTables,
    forcing: Forcing,
    t: jax.Array,
    q0: State,
    v0: State,
    q1: State,
    v1: State,
) -> tuple[State, State, jax.Array]:
    """Add the pulses' part to a step of the field.

    Args:
        tables: of :func:`pulse_tables`.
        forcing: the pulses.
        t: scaled time at the step's start.
        q0, v0: the field and its rate at the step's start.
        q1, v1: both after the step without sources.

    Returns:
        Both after the step with sources, and the work done in it.
    """

    def act(fields: tuple[State, State]) -> tuple[State, State, jax.Array]:
        q, v = (list(field) for field in fields)
        signal = forcing.signals(t + tables.nodes)
        velocity = jnp.einsum("imjn,jmn->im", tables.own, forcing.signals(t + tables.inner))
        for reach in tables.reaches:
            g, at = reach.group, reach.at
            before = jnp.einsum("emcn,ecn->em", reach.from_q, at.seen(q0[g]))
            before += jnp.einsum("emcn,ecn->em", reach.from_v, at.seen(v0[g]))
            velocity = velocity.at[at.pulse].add(before)
            of_entry = signal[at.pulse]
            q[g] = at.add(q[g], jnp.einsum("em,emcn->ecn", of_entry, reach.on_q))
            v[g] = at.add(v[g], jnp.einsum("em,emcn->ecn", of_entry, reach.on_v))
        return tuple(q), tuple(v), jnp.sum(tables.weights * signal * velocity)

    return jax.lax.cond(t < tables.end, act, lambda fields: (*fields, jnp.zeros(())), (q1, v1))
