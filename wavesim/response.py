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
from dataclasses import dataclass
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


@dataclass(frozen=True)
class _Window:
    """Where a pulse is felt within a step: cells first … first + count − 1 round the ring."""

    group: int
    blocks: tuple[int, ...]
    first: int
    count: int
    ring: int

    @property
    def cells(self) -> np.ndarray:
        return (self.first + np.arange(self.count)) % self.ring


class _Reach(eqx.Module):
    """One pulse on one group of blocks, within a window of the grid.

    Attributes:
        on_q, on_v: w_m S(h−τ_m) g and w_m C(h−τ_m) g, shape (nodes, components, blocks, cells).
        from_q, from_v: (LS(τ_m))ᵀ g and C(τ_m)ᵀ g, likewise.
        window: which cells of which blocks.
    """

    on_q: jax.Array
    on_v: jax.Array
    from_q: jax.Array
    from_v: jax.Array
    window: _Window = eqx.field(static=True)


class PulseTables(eqx.Module):
    """Tables of all pulses for one step length.

    Attributes:
        reaches: for each pulse, for each group it drives.
        own: ∫ kernel for the pulses' velocity at each other's points within the step, shape
            (pulses, nodes, pulses, inner nodes).
        nodes, weights: Gauss nodes and weights on [0, h].
        inner: nodes of [0, τ_m] for each m, shape (nodes, inner nodes).
        spacing: cell size, scaled.
        end: scaled time from which on no pulse acts.
    """

    reaches: tuple[tuple[_Reach, ...], ...]
    own: jax.Array
    nodes: jax.Array
    weights: jax.Array
    inner: jax.Array
    spacing: float = eqx.field(static=True)
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

    windows = tuple(_windows(operator, profile, degree) for profile in forcing.profiles)
    ahead, back, moments = _series_vectors(operator, forcing.profiles, bound, degree, windows)
    reaches = tuple(
        tuple(
            _Reach(
                on_q=jnp.tensordot(on_q, a, 1),
                on_v=jnp.tensordot(on_v, a, 1),
                from_q=jnp.tensordot(from_q, b, 1),
                from_v=jnp.tensordot(from_v, b, 1),
                window=window,
            )
            for window, a, b in zip(*of_pulse, strict=True)
        )
        for of_pulse in zip(windows, ahead, back, strict=True)
    )
    own = jnp.einsum("mnk,kij->imjn", kernel, moments) * operator.spacing
    end = max(pulse.end for pulse in forcing.pulses) / forcing.time_scale
    return PulseTables(
        reaches,
        own,
        jnp.asarray(nodes),
        jnp.asarray(weights),
        jnp.asarray(np.multiply.outer(nodes, unit_nodes)),
        operator.spacing,
        end,
    )


def _windows(operator: Operator, profile: State, degree: int) -> tuple[_Window, ...]:
    """A window for each group that a profile drives; the profile must be concrete."""
    windows = []
    for number, (group, components) in enumerate(zip(operator.groups, profile, strict=True)):
        driven = np.any([np.asarray(c) != 0 for c in components], axis=0)
        if not driven.any():
            continue
        at = np.nonzero(driven.any(axis=0))[0]
        # The widest stretch of cells on the ring that is not driven is left out.
        idle = np.diff(np.append(at, at[0] + operator.cells))
        first = int(at[(int(np.argmax(idle)) + 1) % len(at)])
        span = operator.cells - int(idle.max()) + 1
        reach = degree * 2 * len(group.weights)
        count = min(operator.cells, span + 2 * reach)
        blocks = tuple(int(s) for s in np.nonzero(driven.any(axis=1))[0])
        windows.append(_Window(number, blocks, first - reach, count, operator.cells))
    return tuple(windows)


@functools.partial(jax.jit, static_argnums=(2, 3, 4))
def _series_vectors(
    operator: Operator,
    profiles: tuple[State, ...],
    bound: float,
    degree: int,
    windows: tuple[tuple[_Window, ...], ...],
) -> tuple[Any, Any, jax.Array]:
    """T_k(X) g_j and T_k(Xᵀ) g_j in the windows, and ⟨g_i, T_k(X) g_j⟩.

    The first two, for each pulse and window, have shape (degree + 1, components, blocks, cells);
    the last has shape (degree + 1, pulses i, pulses j).
    """
    adjoint = jax.linear_transpose(operator, operator.zero())
    pulses = range(len(profiles))
    stacked = jax.tree.map(lambda *g: jnp.stack(g), *profiles)

    def sequence(product: Any) -> Any:
        """T_k(X) of all profiles, one after the other."""

        def shifted(y: State) -> State:
            return jax.tree.map(lambda a, b: a + 2 / bound * b, y, jax.vmap(product)(y))

        def seen(y: State) -> Any:
            each = [jax.tree.map(lambda c, j=j: c[j], y) for j in pulses]
            parts = tuple(tuple(_seen(each[j], w) for w in windows[j]) for j in pulses)
            overlaps = jax.tree.map(lambda g, c: jnp.einsum("isn,jsn->ij", g, c), stacked, y)
            return parts, jax.tree.reduce(jnp.add, overlaps)

        def advance(carry: tuple[State, State], _: None) -> Any:
            before, now = carry
            after = jax.tree.map(lambda a, b: 2 * a - b, shifted(now), before)
            return (now, after), seen(now)

        return jax.lax.scan(advance, (shifted(stacked), stacked), length=degree + 1)[1]

    ahead, moments = sequence(operator)
    back, _ = sequence(lambda y: adjoint(y)[0])
    return ahead, back, moments


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
        q, v = fields
        signal = forcing.signals(t + tables.nodes)
        within = jnp.einsum("imjn,jmn->im", tables.own, forcing.signals(t + tables.inner))
        work = jnp.zeros(())
        for number, reaches in enumerate(tables.reaches):
            velocity = within[number]
            for reach in reaches:
                velocity += tables.spacing * jnp.tensordot(reach.from_q, _seen(q0, reach.window), 3)
                velocity += tables.spacing * jnp.tensordot(reach.from_v, _seen(v0, reach.window), 3)
                q = _add(q, reach.window, jnp.tensordot(signal[number], reach.on_q, 1))
                v = _add(v, reach.window, jnp.tensordot(signal[number], reach.on_v, 1))
            work += jnp.sum(tables.weights * signal[number] * velocity)
        return q, v, work

    return jax.lax.cond(t < tables.end, act, lambda fields: (*fields, jnp.zeros(())), (q1, v1))


def _seen(y: State, window: _Window) -> jax.Array:
    rows = jnp.asarray(window.blocks)
    return jnp.stack([c[rows][:, window.cells] for c in y[window.group]])


def _add(y: State, window: _Window, change: jax.Array) -> State:
    rows = jnp.asarray(window.blocks)[:, None]
    group = tuple(c.at[rows, window.cells].add(change[i]) for i, c in enumerate(y[window.group]))
    return (*y[: window.group], group, *y[window.group + 1 :])
