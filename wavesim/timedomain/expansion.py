"""The stepper of real bars: exp(hA) and the sources' part of a step as one Chebyshev series in A.

With A′ = A + s, s half the fastest loss rate, and R ≥ every |Im λ| of A, X = A′/R,

    exp(τA) = e^{−sτ} Σ_k c_k(τ) φ_k(X),  c_0 = J_0(τR), c_k = 2 J_k(τR),
    φ_0 = 1, φ_1 = X, φ_{k+1} = 2X φ_k + φ_{k−1}   (φ_k(X) = i^k T_k(−iX)),
    y(t+h) = Σ_k φ_k(X) [e^{−sh} c_k(h) y + Σ_j G_j ∫₀^h e^{−s(h−τ)} c_k(h−τ) s_j(t+τ) dτ],

by Clenshaw's recurrence: the sources cost scalars. Tal-Ezer, SIAM J. Numer. Anal. 23, 11 (1986);
Tal-Ezer, Kosloff & Koren, Geophys. Prospect. 35, 479 (1987). Exact to rounding at any step.

The work of the sources is that of ``barwork.py``. Losses are accounted for by ``ends.py`` where no
signal has kinks; else the state within the step is needed too, and ``within.py`` makes the step.
"""

from __future__ import annotations

from typing import Any

import diffrax
import jax
import jax.numpy as jnp

from wavesim.timedomain.barequation import BarEquation, BarMotion
from wavesim.timedomain.barseries import Series
from wavesim.timedomain.barwork import Work
from wavesim.timedomain.ends import Ends
from wavesim.timedomain.group import State
from wavesim.timedomain.steppers import WaveSolver
from wavesim.timedomain.within import Within


class Expansion(WaveSolver):
    """Steps by the series; see the head of this file.

    The step that diffrax takes must be the one that the series was made for.
    """

    series: Series
    work: Work | None = None
    losses: Within | Ends | None = None

    def order(self, terms: Any) -> None:
        return None

    def init(self, terms: Any, t0: Any, t1: Any, y0: BarMotion, args: BarEquation) -> Any:
        """The power lost and its derivatives, where the step's ends tell what is lost in it."""
        return self.losses.powers(args, t0, y0.y) if isinstance(self.losses, Ends) else None

    def step(
        self,
        terms: Any,
        t0: Any,
        t1: Any,
        y0: BarMotion,
        args: BarEquation,
        solver_state: Any,
        made_jump: Any,
    ) -> Any:
        made, drives = self.series, args.drives
        acting = t0 < drives.end
        signals = drives.sampled(t0, made.nodes, made.weights, made.step)
        work, lost = y0.work, y0.lost
        if self.work is not None:
            table = self.work
            # An end that was turned is left with a rate of rounding.
            work = work + jax.lax.cond(
                acting | bool(len(args.held)),
                lambda: table.done(args, y0.y, signals),
                lambda: jnp.zeros(()),
            )
        powers = None
        if isinstance(self.losses, Within):
            y, gone = self.losses.step(args, made, y0.y, signals)
            lost = lost + gone
        else:
            y = self.propagate(args, y0.y, made.pulses @ signals.T)
        if isinstance(self.losses, Ends):
            powers = self.losses.powers(args, t1, y)
            lost = lost + self.losses.lost(solver_state, powers)
        y1 = BarMotion(y, work, lost)
        return y1, None, {"y0": y0, "y1": y1}, powers, diffrax.RESULTS.successful

    def propagate(self, equation: BarEquation, y: State, forces: jax.Array) -> State:
        """Σ_k φ_k(X) [c_k y + Σ_j G_j b_kj], downward from the highest degree."""
        made = self.series

        def plus(c: Any, factor: float, one: State, two: State) -> State:
            """c_k y + Σ_j G_j b_kj + factor X one + two."""
            rate = equation.generator(one)
            scale = factor / made.radius
            new = jax.tree.map(
                lambda own, r, a, b: c[0] * own + scale * (r + made.shift * a) + b,
                y,
                rate,
                one,
                two,
            )
            return equation.drives.add(new, c[1])

        def down(carry: tuple[State, State], c: Any) -> tuple[tuple[State, State], None]:
            one, two = carry
            return (plus(c, 2.0, one, two), one), None

        zero = jax.tree.map(jnp.zeros_like, y)
        terms = (made.state, forces)
        descending = jax.tree.map(lambda c: c[:0:-1], terms)
        (one, two), _ = jax.lax.scan(down, (zero, zero), descending)
        return plus(jax.tree.map(lambda c: c[0], terms), 1.0, one, two)
