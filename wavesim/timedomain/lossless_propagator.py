"""The fast stepper of a bar without losses: rows of its exact propagator as dense matrices.

For q = (φ, B) and v = q̇ alike, q̈ = Lq gives exactly

    q(t+h) − q(t) = q(t) − q(t−h) + 2(C − 1) q(t) + pulses,    C = cos(h√−L).

Nothing travels further than about c_∞h within a step: C couples a point to some tens of others, to
rounding, and its rows are dense matrices on windows about their points (``propagator_rows.py``). In
this form rounding grows as the number of steps, not as its square.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.timedomain.chebyshev_stepper import ExactStepper
from wavesim.timedomain.equation import Equation, Motion, Run
from wavesim.timedomain.operator import Group, State, States
from wavesim.timedomain.propagator_rows import Rows, rows_of
from wavesim.timedomain.sources_within_step import Driven, Work, picked, pushes, series_terms, work
from wavesim.timedomain.sparse_matrix import flat, sparse_matrix, unflat
from wavesim.timedomain.time_step import TimeStep, nodes_of, series_coefficients


class Pulses(eqx.Module):
    """What sources near each other leave in q and v of a group within a step.

    Attributes:
        group: its number.
        sources: their numbers.
        made: by the signals of the step that begins, and by those of the step that has ended, at
            the points of the window about them and, as the last one, of 0, shape
            (2 · sources · nodes, 2 · fields · blocks · (points + 1)).
        place: of each point of the bar in the window, shape (points of the bar,).
    """

    group: int = eqx.field(static=True)
    sources: Any
    made: Any
    place: Any


class Memory(NamedTuple):
    """What the stepper keeps beside the state: q(t) − q(t−h) of each group, and the last signals.

    Attributes:
        change: shape (fields, blocks, points, 2), of q and v, for each group.
        signals: ŝ of the step that has ended, shape (sources, nodes).
    """

    change: tuple[Any, ...]
    signals: Any


class Propagator(ExactStepper):
    """Steps by dense rows; see the head of this file.

    Attributes:
        rows: for each group, blocks alike together.
        pulses: of all sources.
        nodes, weights, h: Gauss nodes of a step, their weights, and the step.
        work: tables of the sources' work.
        begun: the memory at t = 0.
    """

    rows: tuple[tuple[Rows, ...], ...]
    pulses: tuple[Pulses, ...]
    nodes: Any
    weights: Any
    h: Any
    work: Work | None
    begun: Memory

    def init(self, terms: Any, t0: Any, t1: Any, y0: Motion, args: Run) -> Memory:
        return self.begun

    def step(
        self,
        terms: Any,
        t0: Any,
        t1: Any,
        y0: Motion,
        args: Run,
        solver_state: Memory,
        made_jump: Any,
    ) -> Any:
        equation, t = args.equation, args.time(t0)
        sources = equation.sources
        signals = sources.sampled(t, self.nodes, self.weights, self.h)
        change = [
            self._change(rows, part, before)
            for rows, part, before in zip(self.rows, y0.y, solver_state.change, strict=True)
        ]
        work = y0.work
        if self.pulses:
            table = self.work
            assert table is not None
            acting = t - self.h < sources.end
            change, done = jax.lax.cond(
                acting,
                lambda: (
                    self._pushed(change, signals, solver_state.signals),
                    table.done(equation, y0.y, signals),
                ),
                lambda: (change, jnp.zeros(())),
            )
            work = work + done
        y = tuple(map(_added, equation.operator.groups, y0.y, change))
        kept = Memory(tuple(change), signals)
        y1 = Motion(y, work)
        return y1, None, {"y0": y0, "y1": y1}, kept, diffrax.RESULTS.successful

    def _change(self, rows: tuple[Rows, ...], y: State, before: Any) -> Any:
        """q(t+h) − q(t) but for the pulses, shape (fields, blocks, points, 2)."""
        q = jnp.concatenate([y.phi, y.B])
        v = jnp.concatenate([y.phi_rate, y.B_rate])
        both = jnp.stack([q, v], axis=-1)
        fields, _, points, _ = both.shape
        made: dict[int, Any] = {}
        for alike in rows:
            some = jnp.stack([both[:, block] for block in alike.blocks], axis=2)
            product = alike(some.reshape(fields, points, -1)).reshape(some.shape)
            made |= {block: product[:, :, n] for n, block in enumerate(alike.blocks)}
        return before + jnp.stack([made[block] for block in sorted(made)], axis=1)

    def _pushed(self, change: list[Any], ahead: Any, behind: Any) -> list[Any]:
        change, signals = list(change), jnp.stack([ahead, behind])
        for part in self.pulses:
            fields, blocks, _, _ = change[part.group].shape
            push = jnp.ravel(picked(signals, part.sources, 1)) @ part.made
            push = picked(push.reshape(2, fields, blocks, -1), part.place)
            change[part.group] = change[part.group] + jnp.moveaxis(push, 0, -1)
        return change


def _added(group: Group, y: State, change: Any) -> State:
    p = y.phi.shape[0]
    q, v = change[..., 0], change[..., 1]
    phi = y.phi + q[:p]
    return y._replace(
        phi=phi,
        B=y.B + q[p:],
        phi_rate=y.phi_rate + v[:p],
        B_rate=y.B_rate + v[p:],
        kappa=group.D(phi) if p else y.kappa,
    )


def propagator(
    equation: Equation,
    bar: Bar,
    step: TimeStep,
    start: States,
    near: list[Driven],
) -> Propagator:
    """Prepare the stepper.

    Args:
        equation: of a bar without losses, of plain numbers.
        bar: its grid.
        step: how it is stepped.
        start: the state at t = 0.
        near: the groups that sources drive, in windows about them.
    """
    groups = equation.operator.groups
    with ThreadPoolExecutor() as side:
        rows = [side.submit(rows_of, group, bar, step) for group in groups]
        pulses = [side.submit(_pulses, part, groups[part.group], step) for part in near]
        done = side.submit(work, equation, near, step)
    nodes, weights = nodes_of(step)
    silent = np.zeros((equation.sources.count, len(nodes)))
    change = tuple(_first_change(g, y, step) for g, y in zip(groups, start, strict=True))
    begun = Memory(change, silent)
    return Propagator(
        tuple(one.result() for one in rows),
        tuple(one.result() for one in pulses),
        nodes,
        weights,
        np.asarray(step.step),
        done.result(),
        begun,
    )


def _pulses(part: Driven, group: Group, step: TimeStep) -> Pulses:
    """P_jn, and exp(−hA) of it by time reversal: q changes sign, and nodes their order."""
    made = pushes(part, step)
    sources, nodes, _ = made.shape
    fields, (blocks, n) = len(group.rest.phi) + len(group.rest.B), group.free.shape
    count = len(part.points)
    made = made[..., : 2 * fields * blocks * count]  # φ, B, φ̇, Ḃ in this order, no memory
    ahead = made.reshape(sources, nodes, 2, fields * blocks, count)
    behind = ahead[:, ::-1] * np.array([1.0, -1.0])[:, None, None]
    both = np.pad(np.stack([ahead, behind]), [(0, 0)] * 5 + [(0, 1)])
    place = np.full(n, count)
    place[part.points] = np.arange(count)
    made = both.reshape(2 * sources * nodes, -1)
    return Pulses(part.group, np.array(part.sources, np.int32), made, place.astype(np.int32))


def _first_change(group: Group, y: State, step: TimeStep) -> np.ndarray:
    """y(0) − exp(−hA) y(0) of a state, shape (fields, blocks, points, 2)."""
    rest = group.rest
    made = np.zeros((len(rest.phi) + len(rest.B), *rest.B.shape[1:], 2))
    if not any(np.any(array) for array in y):
        return made
    factors = series_coefficients(np.array([step.step]), step.radius, step.shift, step.degree)
    # exp(−hA) is exp(hA) with φ_k(X) of odd k in reverse.
    factors = factors * (-1.0) ** np.arange(factors.shape[1])
    (before,) = unflat(series_terms(sparse_matrix(group), flat(y), step, factors)[0], (rest,))
    made[..., 0] = np.concatenate([y.phi - before.phi, y.B - before.B])
    made[..., 1] = np.concatenate([y.phi_rate - before.phi_rate, y.B_rate - before.B_rate])
    return made
