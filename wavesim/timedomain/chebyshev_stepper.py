"""The stepper of every bar, losses and absorbers included: exp(hA) as one Chebyshev series in A.

With A′ = A + s, s half the fastest loss rate, and R ≥ every |Im λ| of A, X = A′/R,

    exp(τA) = e^{−sτ} Σ_k c_k(τ) φ_k(X),  c_0 = J_0(τR), c_k = 2 J_k(τR),
    φ_0 = 1, φ_1 = X, φ_{k+1} = 2X φ_k + φ_{k−1}   (φ_k(X) = i^k T_k(−iX)),
    y(t+h) = Σ_k φ_k(X) [e^{−sh} c_k(h) y + Σ_j G_j Σ_n w_n e^{−s(h−τ_n)} c_k(h−τ_n) ŝ_j(t+τ_n)],

by Clenshaw's recurrence, so that the sources cost scalars; τ_n, w_n are the Gauss nodes of the step
and their weights, enough of them to integrate the fastest wave exactly. Tal-Ezer, SIAM J. Numer.
Anal. 23, 11 (1986); Tal-Ezer, Kosloff & Koren, Geophys. Prospect. 35, 479 (1987). Exact to rounding
at any step; media may be traced by jax.
"""

from __future__ import annotations

from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.equation import Equation, Motion, Run
from wavesim.timedomain.operator import States
from wavesim.timedomain.sources_within_step import Work
from wavesim.timedomain.time_step import TimeStep, nodes_of, series_coefficients


class Series(eqx.Module):
    """Coefficients of one step.

    Attributes:
        state: e^{−sh} c_k(h), shape (degree + 1,).
        pulses: of the signals at the nodes, shape (degree + 1, nodes).
        nodes, weights: τ_n and w_n, scaled.
        radius, shift, step: R, s and h.
    """

    state: Any
    pulses: Any
    nodes: Any
    weights: Any
    radius: Any
    shift: Any
    step: Any


def series(step: TimeStep) -> Series:
    """Coefficients of the steps of a run."""
    nodes, weights = nodes_of(step)
    known = step.radius, step.shift, step.degree
    state = series_coefficients(np.array([step.step]), *known)[0]
    pulses = series_coefficients(step.step - nodes, *known).T * weights
    made = (state, pulses, nodes, weights, step.radius, step.shift, step.step)
    return Series(*(np.asarray(part) for part in made))


class ExactStepper(diffrax.AbstractSolver):
    """What steppers share that are exact at any step: no order, no error estimate.

    The step that diffrax takes must be the one that their tables were made for.
    """

    term_structure = diffrax.AbstractTerm
    interpolation_cls = diffrax.LocalLinearInterpolation

    def order(self, terms: Any) -> None:
        return None

    def func(self, terms: Any, t0: Any, y0: Any, args: Any) -> Any:
        return terms.vf(t0, y0, args)


class ChebyshevSeries(ExactStepper):
    """Steps by the series; see the head of this file.

    Attributes:
        series: coefficients of a step.
        work: tables of the sources' work; None leaves the work at 0.
    """

    series: Series
    work: Work | None = None

    def init(self, terms: Any, t0: Any, t1: Any, y0: Motion, args: Run) -> None:
        return None

    def step(
        self,
        terms: Any,
        t0: Any,
        t1: Any,
        y0: Motion,
        args: Run,
        solver_state: None,
        made_jump: Any,
    ) -> Any:
        equation, t = args.equation, args.time(t0)
        made, sources = self.series, equation.sources
        signals = sources.sampled(t, made.nodes, made.weights, made.step)
        y = self._propagated(equation, y0.y, made.pulses @ signals.T)
        done = y0.work
        if self.work is not None:
            table = self.work
            done = done + jax.lax.cond(
                t < sources.end,
                lambda: table.done(equation, y0.y, signals),
                lambda: jnp.zeros(()),
            )
        y1 = Motion(y, done)
        return y1, None, {"y0": y0, "y1": y1}, None, diffrax.RESULTS.successful

    def _propagated(self, equation: Equation, y: States, forces: Any) -> States:
        """Σ_k φ_k(X) [c_k y + Σ_j G_j b_kj], downward from the highest degree."""
        made = self.series

        def down(carry: tuple[States, States], c: Any) -> tuple[tuple[States, States], None]:
            one, two = carry
            own, pulses, factor = c
            scale = factor / made.radius
            rate = equation.operator(one)
            new = jax.tree.map(
                lambda a, r, b, d: own * a + scale * (r + made.shift * b) + d, y, rate, one, two
            )
            return (equation.sources.add(new, pulses), one), None

        zero = jax.tree.map(jnp.zeros_like, y)
        factors = jnp.full(len(made.state), 2.0).at[0].set(1.0)
        terms = jax.tree.map(lambda c: c[::-1], (made.state, forces, factors))
        # Two at a time: no part of a state is copied to be the one before.
        (total, _), _ = jax.lax.scan(down, (zero, zero), terms, unroll=2)
        return total
