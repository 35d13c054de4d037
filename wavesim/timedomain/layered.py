"""The stepper of real bars without losses: the exact propagator, one banded product a step.

    q⁺ = 2C q − q⁻ + ∫₀^h S(h−τ) G [s(t+τ) + s(t−τ)] dτ
    v⁺ = 2C v − v⁻ + ∫₀^h C(h−τ) G [s(t+τ) − s(t−τ)] dτ

as in ``propagator.py``; C is that of ``pieces.py``. The sources' part of a step is that of
``expansion.py``, Σ_k φ_k(X) G_j ∫ c_k s_j dτ, kept in a window about each source
(``pushes.py``): s(t+τ) + s(t−τ) acts on q, and their difference on v. Their work is that of
``barwork.py``.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.barequation import BarEquation, BarMotion
from wavesim.timedomain.barseries import Series
from wavesim.timedomain.barwork import Work
from wavesim.timedomain.expansion import Expansion
from wavesim.timedomain.group import Parts, State
from wavesim.timedomain.kernels import dense, run_length
from wavesim.timedomain.pieces import Cut
from wavesim.timedomain.pushes import Pushes
from wavesim.timedomain.steppers import WaveSolver
from wavesim.timedomain.zones import SHORT_RUN

Tracks = tuple[jax.Array, ...]  # of each group (q, v), shape (2, blocks, fields, points)


class Piecewise(eqx.Module):
    """C of one group of blocks.

    Attributes:
        kernels: from b + 2r cells to b, each shape (blocks, fields (b + 2r), fields b).
        corrections: of each kind, shape (blocks, kind, fields columns, fields rows).
        stretches: (first cell, end, number of the kernel) of each.
        places: of the corrections of each kind, first row and column of each, (kind, times).
        sizes: rows and columns of each kind.
        points, reach: number of points of the bar; r.
        ring: whether the one stretch closes on itself.
    """

    kernels: tuple[jax.Array, ...]
    corrections: tuple[jax.Array, ...]
    stretches: tuple[tuple[int, int, int], ...] = eqx.field(static=True)
    places: tuple[tuple[tuple[tuple[int, int], ...], ...], ...] = eqx.field(static=True)
    sizes: tuple[tuple[int, int], ...] = eqx.field(static=True)
    points: int = eqx.field(static=True)
    reach: int = eqx.field(static=True)
    ring: bool = eqx.field(static=True)

    def __call__(self, fields: jax.Array) -> jax.Array:
        """C on fields of shape (tracks, blocks, fields, points)."""
        made = self._plain(fields)
        for matrix, places, (rows, columns) in zip(
            self.corrections, self.places, self.sizes, strict=True
        ):
            tracks, blocks, count, points = fields.shape
            first = np.array(places)
            kinds, times, _ = first.shape
            at = (first[..., 1, None] + np.arange(columns)) % points
            seen = fields[..., at].transpose(1, 3, 4, 0, 2, 5)
            seen = seen.reshape(blocks, kinds, times * tracks, count * columns)
            change = (seen @ matrix).reshape(blocks, kinds, times, tracks, count, rows)
            onto = (first[..., 0, None] + np.arange(rows)) % points
            made = made.at[..., onto].add(change.transpose(3, 0, 4, 1, 2, 5))
        return made

    def _plain(self, fields: jax.Array) -> jax.Array:
        """The kernels' part."""
        tracks, blocks, count, points = fields.shape
        r, b = self.reach, run_length(self.reach, SHORT_RUN)
        none = jnp.zeros((tracks, blocks, count, 1))
        padded = jnp.concatenate([fields, none], axis=-1)
        results = []
        order = sorted(range(len(self.stretches)), key=lambda n: self.stretches[n][2])
        by_kernel = itertools.groupby(order, key=lambda n: self.stretches[n][2])
        found: dict[int, jax.Array] = {}
        for number, members in by_kernel:
            spans = [self.stretches[n] for n in members]
            windows, lengths = [], []
            for a, e, _ in spans:
                starts = np.arange(a, e, b)
                cells = starts[:, None] - r + np.arange(b + 2 * r)
                inside = (cells >= a) & (cells < e)
                windows.append(cells % points if self.ring else np.where(inside, cells, points))
                lengths.append(len(starts))
            at = np.concatenate(windows)
            rows = padded[..., at].transpose(1, 0, 3, 2, 4)
            rows = rows.reshape(blocks, tracks * len(at), count * (b + 2 * r))
            made = (rows @ self.kernels[number]).reshape(blocks, tracks, len(at), count, b)
            made = made.transpose(1, 0, 3, 2, 4).reshape(tracks, blocks, count, len(at) * b)
            position = 0
            for (a, e, _), length in zip(spans, lengths, strict=True):
                found[a] = made[..., position * b : position * b + e - a]
                position += length
        reached = 0
        for a, e, _ in sorted(self.stretches):
            results += [jnp.zeros((tracks, blocks, count, a - reached)), found[a]]
            reached = e
        results.append(jnp.zeros((tracks, blocks, count, points - reached)))
        return jnp.concatenate(results, axis=-1)


def piecewise(made: Cut) -> Piecewise:
    """Lay a cut out for products.

    Args:
        made: of :func:`pieces.cut`.
    """
    run = run_length(made.reach, SHORT_RUN)
    kernels = tuple(
        jnp.asarray(np.stack([dense(kernel, run, made.reach) for kernel in of_blocks]))
        for of_blocks in made.kernels
    )
    places: dict[int, list[tuple[int, int]]] = {}
    for piece, number in made.pieces:
        places.setdefault(number, []).append((piece.rows[0], piece.columns[0]))
    kinds: dict[tuple[int, int, int], list[int]] = {}
    for number, at in places.items():
        _, _, rows, _, columns = made.corrections[number].shape
        kinds.setdefault((rows, columns, len(at)), []).append(number)
    corrections = []
    for (rows, columns, _), numbers in kinds.items():
        stacked = np.stack([made.corrections[number] for number in numbers], axis=1)
        blocks, count, fields = stacked.shape[:3]
        # (block, kind, row field, row, column field, column) → (block, kind, column, row).
        turned = stacked.transpose(0, 1, 4, 5, 2, 3)
        corrections.append(
            jnp.asarray(turned.reshape(blocks, count, fields * columns, fields * rows))
        )
    return Piecewise(
        kernels,
        tuple(corrections),
        tuple((a, e, number) for (a, e), number in made.stretches),
        tuple(tuple(tuple(places[n]) for n in numbers) for numbers in kinds.values()),
        tuple((rows, columns) for rows, columns, _ in kinds),
        made.points,
        made.reach,
        made.ring,
    )


class LayeredPropagator(WaveSolver):
    """Two-term recurrence of the exact propagator of a real bar; see the head of this file.

    The step that diffrax takes must be the one that all was made for.
    """

    parts: tuple[Piecewise, ...]
    pushes: tuple[Pushes | None, ...]
    series: Series
    work: Work | None

    def order(self, terms: Any) -> None:
        return None

    def init(self, terms: Any, t0: Any, t1: Any, y0: BarMotion, args: BarEquation) -> Tracks:
        """(q⁻, v⁻) one step before: the series backward in time, and the signals with it."""
        groups = args.generator.groups
        turned = tuple(
            part[: g.size] + tuple(-v for v in part[g.size :])
            for g, part in zip(groups, y0.y, strict=True)
        )
        none = jnp.zeros((len(self.series.state), len(args.drives.sources)))
        back = Expansion(self.series).propagate(args, turned, none)
        made = tuple(_stacked(part).at[1].multiply(-1.0) for part in back)
        behind = self._signals(args, t0, -1.0)
        return self._pushed(made, behind, -behind)

    def step(
        self,
        terms: Any,
        t0: Any,
        t1: Any,
        y0: BarMotion,
        args: BarEquation,
        solver_state: Tracks,
        made_jump: Any,
    ) -> Any:
        now = tuple(_stacked(part) for part in y0.y)
        after = tuple(
            2 * part(one) - before
            for part, one, before in zip(self.parts, now, solver_state, strict=True)
        )
        step = self.series.step

        def driven() -> BarMotion:
            ahead, behind = self._signals(args, t0, 1.0), self._signals(args, t0, -1.0)
            y = _parts(self._pushed(after, ahead + behind, ahead - behind))
            work = 0.0 if self.work is None else self.work.done(args, y0.y, ahead)
            return BarMotion(y, y0.work + work, y0.lost)

        def free() -> BarMotion:
            return y0._replace(y=_parts(after))

        # An end that was turned is left with a rate of rounding.
        acting = (t0 < args.drives.end + 1.5 * step) | bool(len(args.held))
        y1 = jax.lax.cond(acting, driven, free)
        return y1, None, {"y0": y0, "y1": y1}, now, diffrax.RESULTS.successful

    def _signals(self, equation: BarEquation, t: Any, way: float) -> jax.Array:
        """Signals at the nodes of the step ahead of a time, or of that behind it, backward."""
        made = self.series
        first = t + (way - 1) / 2 * made.step
        signals = equation.drives.sampled(first, made.nodes, made.weights, made.step)
        return signals if way > 0 else signals[:, ::-1]

    def _pushed(self, made: Tracks, on_q: jax.Array, on_v: jax.Array) -> Tracks:
        """Both tracks with the sources' part added."""
        return tuple(
            one if push is None else _driven(push, one, on_q, on_v)
            for one, push in zip(made, self.pushes, strict=True)
        )


def _driven(push: Pushes, fields: jax.Array, on_q: jax.Array, on_v: jax.Array) -> jax.Array:
    """(q, v) of one group, shape (2, blocks, fields, points), with the sources' part added."""
    size = fields.shape[2]
    sums = [
        jnp.einsum("sm,smfbp->bfsp", signal, part)
        for signal, part in ((on_q, push.made[:, :, :size]), (on_v, push.made[:, :, size:]))
    ]
    return fields.at[..., push.points].add(jnp.stack(sums))


def _stacked(part: Parts) -> jax.Array:
    """(q, v) of a group, shape (2, blocks, fields, points)."""
    half = len(part) // 2
    return jnp.stack([jnp.stack(part[:half], axis=1), jnp.stack(part[half:], axis=1)])


def _parts(made: Sequence[jax.Array]) -> State:
    """Inverse of :func:`_stacked`, of all groups."""
    return tuple(tuple(one[t, :, i] for t in range(2) for i in range(one.shape[2])) for one in made)
