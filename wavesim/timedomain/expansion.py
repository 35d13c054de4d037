"""The stepper of real bars: exp(hA) and the sources' part of a step as one Chebyshev series in A.

With A′ = A + s, s half the fastest loss rate, and R ≥ every |Im λ| of A, X = A′/R,

    exp(τA) = e^{−sτ} Σ_k c_k(τ) φ_k(X),  c_0 = J_0(τR), c_k = 2 J_k(τR),
    φ_0 = 1, φ_1 = X, φ_{k+1} = 2X φ_k + φ_{k−1}   (φ_k(X) = i^k T_k(−iX)),
    y(t+h) = Σ_k φ_k(X) [e^{−sh} c_k(h) y + Σ_j G_j ∫₀^h e^{−s(h−τ)} c_k(h−τ) s_j(t+τ) dτ],

by Clenshaw's recurrence: the sources cost scalars. Tal-Ezer, SIAM J. Numer. Anal. 23, 11 (1986);
Tal-Ezer, Kosloff & Koren, Geophys. Prospect. 35, 479 (1987). Exact to rounding at any step.

Work and losses are integrals of powers p(t) over the step: Hermite's rule with p and its first five
derivatives at both ends, of order 12; they come from those of the state,
y⁽ⁱ⁺¹⁾ = A y⁽ⁱ⁾ + Σ_j G_j s_j⁽ⁱ⁾.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.source import Source
from wavesim.timedomain.barstep import expansion_coefficients
from wavesim.timedomain.generator import Generator, State, Strain
from wavesim.timedomain.response import interpolation
from wavesim.timedomain.steppers import WaveSolver
from wavesim.timedomain.timestep import Schedule

# Derivatives of a power that Hermite's rule takes at either end, the power itself among them.
_ORDERS = 6
# Gauss nodes beyond half the phase of what they integrate or interpolate.
_EXTRA_NODES = 14


class BarMotion(NamedTuple):
    """State of a run of a real bar, scaled.

    Attributes:
        y: fields, rates and memory.
        work: done by the sources since the start, energy per area of the section.
        lost: what damping and absorbing ends have taken since, likewise.
        powers: derivatives of the sources' power and of the power lost, shape (2, orders).
    """

    y: State
    work: jax.Array
    lost: jax.Array
    powers: jax.Array


class Points(eqx.Module):
    """Where sources act on one rate of one group: accelerations at points, one entry each.

    Attributes:
        source: which signal, shape (entries,).
        block, node: which point, shape (entries,).
        weight: acceleration there for a signal of 1, shape (entries,).
    """

    source: Any
    block: Any
    node: Any
    weight: Any


class Drives(eqx.Module):
    """The sources: Σ_j G_j s_j(t), as forces on the state.

    Attributes:
        points: G_j, for each group and each of its rates φ̇, Ḃ.
        sources: whose signals are s_j; none of an initial field.
        time: s in one scaled unit of time.
    """

    points: tuple[tuple[Points, ...], ...]
    sources: tuple[Source, ...] = eqx.field(static=True)
    time: float = eqx.field(static=True)

    @property
    def end(self) -> float:
        """Scaled time from which on none acts."""
        return max((source.end for source in self.sources), default=0.0) / self.time

    @property
    def prescribed(self) -> bool:
        """Whether an end's rotation is among them."""
        return any(source.drive == "rotation" for source in self.sources)

    def signals(self, t: jax.Array) -> jax.Array:
        """s_j at scaled times t of any shape, (sources, *shape of t); g̈ for a rotation g."""
        if not self.sources:
            return jnp.zeros((0, *jnp.shape(t)))
        made = []
        for source in self.sources:

            def signal(t: jax.Array, source: Source = source) -> jax.Array:
                return jnp.asarray(source.signal(t * self.time))

            held = source.drive == "rotation"
            made.append((_derivative(_derivative(signal)) if held else signal)(t))
        return jnp.stack(made)

    def derivatives(self, t: jax.Array) -> jax.Array:
        """s_j and its first derivatives at a time, shape (orders, sources)."""
        function: Callable[[jax.Array], jax.Array] = self.signals
        made = [function(t)]
        for _ in range(_ORDERS - 1):
            function = _derivative(function)
            made.append(function(t))
        return jnp.stack(made)

    def add(self, y: State, amounts: jax.Array) -> State:
        """y + Σ_j G_j amounts_j."""
        made = []
        for points, parts in zip(self.points, y, strict=True):
            new = list(parts)
            for track, p in enumerate(points, start=len(points)):
                if len(p.source):
                    push = p.weight * amounts[p.source]
                    new[track] = new[track].at[p.block, p.node].add(push)
            made.append(tuple(new))
        return tuple(made)


def _derivative(function: Callable[[jax.Array], jax.Array]) -> Callable[[jax.Array], jax.Array]:
    return lambda t: jax.jvp(function, (t,), (jnp.ones_like(t),))[1]


class BarEquation(eqx.Module):
    """ẏ = A y + Σ_j G_j s_j(t), with work and losses."""

    generator: Generator
    drives: Drives
    balanced: bool = eqx.field(static=True)

    def __call__(self, t: jax.Array, motion: BarMotion) -> BarMotion:
        amounts = self.drives.signals(t)
        rate = self.drives.add(self.generator(motion.y), amounts)
        alone = jax.tree.map(lambda part: part[None], motion.y)
        seen = jax.vmap(self.generator.observe)(alone)
        work, lost = self._work(seen, amounts[None])[0, 0], self._lost(seen)[0, 0]
        return BarMotion(rate, work, lost, jnp.zeros_like(motion.powers))

    def observe(self, motion: BarMotion) -> tuple[Any, ...]:
        """Fields, kinetic and stored energy, work and, where it is known, what is lost."""
        kinetic, stored = self.generator.energy(motion.y)
        seen = (self.generator.fields(motion.y), kinetic, stored, motion.work)
        return (*seen, motion.lost) if self.accounted else seen

    @property
    def accounted(self) -> bool:
        """Whether losses are accounted for."""
        return self.balanced and self.generator.lossy

    def rest(self, y: State) -> BarMotion:
        """The motion of a bar at rest in this state."""
        still = jnp.zeros(())
        return BarMotion(y, still, still, jnp.zeros((2, _ORDERS)))

    def start(self, y: State) -> BarMotion:
        """The motion that begins with a state, before any signal."""
        powers = self.powers(jnp.zeros(()), y, jnp.asarray(False))
        return self.rest(y)._replace(powers=powers)

    def powers(self, t: jax.Array, y: State, acting: jax.Array) -> jax.Array:
        """Derivatives of the sources' power and of the power lost, shape (2, orders)."""

        def known() -> jax.Array:
            amounts = jnp.where(acting, self.drives.derivatives(t), 0.0)

            def further(state: State, force: jax.Array) -> tuple[State, State]:
                return self.drives.add(self.generator(state), force), state

            _, states = jax.lax.scan(further, y, amounts)
            seen = jax.vmap(self.generator.observe)(states)
            pairs = jnp.stack([self._work(seen, amounts), self._lost(seen)])
            return jnp.einsum("pij,oij->po", pairs, _LEIBNIZ)

        if self.accounted:
            return known()
        return jax.lax.cond(acting, known, lambda: jnp.zeros((2, _ORDERS)))

    def _work(self, seen: tuple[Strain, ...], amounts: jax.Array) -> jax.Array:
        """Power [i, j] of the forces' j-th derivative on the i-th derivative of the rates."""
        total = jnp.zeros((len(amounts), len(amounts)))
        for group, points, strain in zip(
            self.generator.groups, self.drives.points, seen, strict=True
        ):
            for v, m, p in zip(strain.v, group.mass, points, strict=True):
                if len(p.source):
                    pushes = p.weight * m[p.block, p.node] * amounts[:, p.source]
                    total = total + v[:, p.block, p.node] @ pushes.T
            if self.drives.prescribed:
                for v, sigma in zip(strain.v, strain.sigma, strict=False):
                    held = jnp.where(group.free == 0, group.QT(sigma), 0.0)
                    total = total + jnp.einsum("ibn,jbn->ij", v, held)
        return total

    def _lost(self, seen: tuple[Strain, ...]) -> jax.Array:
        """Power lost as a bilinear form, of derivatives i and j of the state."""
        total = jnp.zeros(2 * seen[0].v[0].shape[:1])
        if self.accounted:
            for group, strain in zip(self.generator.groups, seen, strict=True):
                total = total + group.lost(strain)
        return total


# The o-th derivative of a product is Σ_i binom(o, i) of derivatives i and o − i.
_LEIBNIZ = np.array(
    [
        [[math.comb(o, i) if i + j == o else 0.0 for j in range(_ORDERS)] for i in range(_ORDERS)]
        for o in range(_ORDERS)
    ]
)


class Series(eqx.Module):
    """Coefficients of one step.

    Attributes:
        state: e^{−sh} c_k(h), shape (degree + 1,).
        pulses: of the signals at the nodes, shape (degree + 1, nodes).
        nodes: times within the step at which signals are taken, scaled.
        radius, shift: R and s.
        step: h.
    """

    state: jax.Array
    pulses: jax.Array
    nodes: jax.Array
    radius: float = eqx.field(static=True)
    shift: float = eqx.field(static=True)
    step: float = eqx.field(static=True)


def series(schedule: Schedule, band: float) -> Series:
    """Coefficients for the steps of a schedule.

    Args:
        schedule: of a real bar.
        band: angular frequency above which no signal has anything, scaled; may be infinite.
    """
    assert schedule.shift is not None
    step, radius, shift = schedule.step, math.sqrt(schedule.bound), schedule.shift
    state = expansion_coefficients(np.array([step]), radius, shift)[0]
    degree = len(state) - 1
    fine = degree + _EXTRA_NODES
    count = math.ceil(min(fine, step * band / 2 + _EXTRA_NODES))
    (nodes, _), (fine_nodes, fine_weights), between = interpolation(count, fine)
    at_nodes = expansion_coefficients(step * (1 - fine_nodes), radius, shift, degree)
    pulses = (between.T @ (step * fine_weights[:, None] * at_nodes)).T
    return Series(
        jnp.asarray(state),
        jnp.asarray(pulses),
        jnp.asarray(step * nodes),
        float(radius),
        float(shift),
        float(step),
    )


class Expansion(WaveSolver):
    """Steps by the series; see the head of this file.

    The step that diffrax takes must be the one that the series was made for.
    """

    series: Series

    def order(self, terms: Any) -> None:
        return None

    def init(self, terms: Any, t0: Any, t1: Any, y0: BarMotion, args: BarEquation) -> None:
        return None

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
        signals = jnp.where(acting, drives.signals(t0 + made.nodes), 0.0)
        y = self.propagate(args, y0.y, made.pulses @ signals.T)
        powers = args.powers(t1, y, acting)
        work, lost = hermite(made.step, y0.powers, powers)
        y1 = BarMotion(y, y0.work + work, y0.lost + lost, powers)
        return y1, None, {"y0": y0, "y1": y1}, None, diffrax.RESULTS.successful

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


def hermite(step: float, before: jax.Array, after: jax.Array) -> jax.Array:
    """∫₀^h p from derivatives (…, orders) of p at both ends: exact to degree 2·orders − 1."""
    n = _ORDERS
    weights = np.array(
        [
            math.factorial(n)
            / (math.factorial(j + 1) * math.factorial(n - j - 1))
            * (math.factorial(2 * n - j - 1) / math.factorial(2 * n))
            * step ** (j + 1)
            for j in range(n)
        ]
    )
    signs = (-1.0) ** np.arange(n)
    return before @ weights + after @ (signs * weights)
