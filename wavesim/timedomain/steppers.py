"""Diffrax solvers for q̈ = L q + Σ_j g_j s_j(t), with the work of the sources as one more state.

All take the term TERM and, as diffrax's args, a :class:`WaveEquation`; diffrax's own solvers can
take the same.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from wavesim.timedomain.forcing import Forcing
from wavesim.timedomain.operator import Operator, State, inner
from wavesim.timedomain.response import PulseTables, add_pulses, pulse_work
from wavesim.timedomain.timestep import Schedule, chebyshev_series, cosine, sine


class Motion(NamedTuple):
    """State of a run, scaled.

    Attributes:
        q: fields.
        v: their time derivatives.
        work: done by the sources since the start, energy per area of the section.
    """

    q: State
    v: State
    work: jax.Array


class WaveEquation(eqx.Module):
    """The vector field d(q, v, work)/dt = (v, L q + f, ⟨f, v⟩)."""

    operator: Operator
    forcing: Forcing

    def __call__(self, t: jax.Array, y: Motion) -> Motion:
        force = self.forcing(t)
        acceleration = jax.tree.map(jnp.add, self.operator(y.q), force)
        return Motion(y.v, acceleration, inner(force, y.v) * self.operator.spacing)

    def observe(self, y: Motion) -> tuple[State, jax.Array, jax.Array, jax.Array]:
        """Fields, kinetic and deformation energy, and work, of a state."""
        return y.q, self.operator.kinetic(y.v), self.operator.potential(y.q), y.work


TERM = diffrax.ODETerm(lambda t, y, equation: equation(t, y))  # of any equation here


class WaveSolver(diffrax.AbstractSolver):
    """What the solvers share: term, interpolation and no error estimate."""

    term_structure: ClassVar[Any] = diffrax.ODETerm
    interpolation_cls: ClassVar[Any] = diffrax.LocalLinearInterpolation

    def func(self, terms: Any, t0: Any, y0: Any, args: Any) -> Any:
        return terms.vf(t0, y0, args)


class Verlet(WaveSolver):
    """Störmer–Verlet, order 2, stable for h < 2/√Λ.

        v½ = v + h/2 (Lq + f(t)),  q⁺ = q + h v½,  v⁺ = v½ + h/2 (Lq⁺ + f(t + h))

    The force at t + h is kept for the next step; the work is the sum of ⟨f, v½⟩ h by halves.
    Hairer, Lubich & Wanner, Acta Numerica 12, 399 (2003).
    """

    def order(self, terms: Any) -> int:
        return 2

    def init(self, terms: Any, t0: Any, t1: Any, y0: Motion, args: Any) -> tuple[State, State]:
        return _force(args, t0, y0.q)

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Motion, args: Any, solver_state: Any, made_jump: Any
    ) -> Any:
        equation, h = args, t1 - t0
        acceleration, force = solver_state
        half = jax.tree.map(lambda v, a: v + h / 2 * a, y0.v, acceleration)
        q = jax.tree.map(lambda q, v: q + h * v, y0.q, half)
        acceleration1, force1 = _force(equation, t1, q)
        v = jax.tree.map(lambda v, a: v + h / 2 * a, half, acceleration1)
        power = (inner(force, half) + inner(force1, half)) * equation.operator.spacing
        y1 = Motion(q, v, y0.work + h / 2 * power)
        return (
            y1,
            None,
            {"y0": y0, "y1": y1},
            (acceleration1, force1),
            diffrax.RESULTS.successful,
        )


def _force(equation: WaveEquation, t: Any, q: State) -> tuple[State, State]:
    force = equation.forcing(t)
    return jax.tree.map(jnp.add, equation.operator(q), force), force


class Chebyshev(WaveSolver):
    """The exact propagator over a fixed step, as a Chebyshev series in L cut at rounding level.

        q⁺ = C q + S v + ∫₀^h S(h−τ) g s dτ,   v⁺ = L S q + C v + ∫₀^h C(h−τ) g s dτ

    with C = cos(h√−L), S = sin(h√−L)/√−L. The integrals over the pulses are Gauss sums whose
    vectors are computed beforehand (``response.py``). Tal-Ezer, Kosloff & Koren, Geophys.
    Prospect. 35, 479 (1987).

    The step that diffrax takes must be the one the series was made for.
    """

    series: jax.Array
    bound: float = eqx.field(static=True)
    pulses: PulseTables

    def order(self, terms: Any) -> None:
        return None

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any) -> None:
        return None

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Motion, args: Any, solver_state: Any, made_jump: Any
    ) -> Any:
        q, v = propagate(self.series, self.bound, args.operator, y0.q, y0.v)

        def driven() -> Motion:
            signal = args.forcing.signals(t0 + self.pulses.nodes)
            work = pulse_work(self.pulses, args.forcing, t0, y0.q, y0.v)
            return Motion(*add_pulses(self.pulses, signal, signal, q, v), y0.work + work)

        y1 = jax.lax.cond(t0 < self.pulses.end, driven, lambda: Motion(q, v, y0.work))
        return y1, None, {"y0": y0, "y1": y1}, None, diffrax.RESULTS.successful


def propagator_series(schedule: Schedule) -> jax.Array:
    """Chebyshev coefficients of C, S and LS = −λS over one step; shape (degree + 1, 3)."""
    h, bound, degree = schedule.step, schedule.bound, schedule.degree
    series = [
        chebyshev_series(lambda e: cosine(h, e), bound, degree),
        chebyshev_series(lambda e: sine(h, e), bound, degree),
        chebyshev_series(lambda e: -e * sine(h, e), bound, degree),
    ]
    return jnp.stack([jnp.asarray(part) for part in series], axis=-1)


def propagate(
    series: jax.Array, bound: float, operator: Operator, q: State, v: State
) -> tuple[State, State]:
    """(C q + S v, LS q + C v) by the recurrence T_{k+1} = 2X T_k − T_{k−1}, X = 1 + 2L/Λ.

    Args:
        series: of :func:`propagator_series`.
        bound: Λ.
        operator: L.
        q, v: fields and their rates.

    Returns:
        Both after one step without sources.
    """
    both = jax.tree.map(lambda a, b: jnp.stack([a, b]), q, v)

    def shifted(y: State) -> State:
        return jax.tree.map(lambda a, b: a + 2 / bound * b, y, operator(y))

    def add(total: Any, factors: jax.Array, term: State) -> Any:
        c, s, d = factors

        def accumulate(sums: jax.Array, t: jax.Array) -> jax.Array:
            return sums + jnp.stack([c * t[0] + s * t[1], d * t[0] + c * t[1]])

        return jax.tree.map(accumulate, total, term)

    def advance(carry: Any, factors: jax.Array) -> tuple[Any, None]:
        before, now, total = carry
        after = jax.tree.map(lambda a, b: 2 * a - b, shifted(now), before)
        return (now, after, add(total, factors, after)), None

    now = shifted(both)
    total = add(add(jax.tree.map(jnp.zeros_like, both), series[0], both), series[1], now)
    (_, _, total), _ = jax.lax.scan(advance, (both, now, total), series[2:])
    return jax.tree.map(lambda t: t[0], total), jax.tree.map(lambda t: t[1], total)
