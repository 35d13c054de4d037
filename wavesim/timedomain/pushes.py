"""What the sources of a real bar do within one exact step, prepared in windows about them.

With y = (q, v) and the series of ``expansion.py``, they add to the state after a step

    Δy = Σ_k φ_k(X) G_j ∫₀^h c_k(h−τ) s_j(t+τ) dτ = Σ_m P_jm s_j(t+τ_m),

which is felt only within the reach of their points. Two steps of opposite sense make the two-term
recurrence: s(t+τ) + s(t−τ) acts on q, and their difference on v.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.expansion import BarEquation, Series
from wavesim.timedomain.generator import State


class Pushes(eqx.Module):
    """What the sources do to one group within a step, in windows about them.

    Attributes:
        made: for their signals at the nodes, shape (sources, nodes, 2 fields, blocks, points):
            q in the first fields, v in the others.
        points: where that is, shape (sources, points).
    """

    made: jax.Array
    points: np.ndarray

    def add(self, fields: jax.Array, on_q: jax.Array, on_v: jax.Array) -> jax.Array:
        """(q, v) of shape (2, blocks, fields, points) with their part added."""
        size = fields.shape[2]
        sums = [
            jnp.einsum("sm,smfbp->bfsp", signal, part)
            for signal, part in ((on_q, self.made[:, :, :size]), (on_v, self.made[:, :, size:]))
        ]
        return fields.at[..., self.points].add(jnp.stack(sums))


def pushes(
    equation: BarEquation, made: Series, reach: int, periodic: bool
) -> tuple[Pushes | None, ...]:
    """The sources' part of a step, for each group; None where none acts on it.

    Args:
        equation: of the bar.
        made: coefficients of the step.
        reach: cells beyond which nothing is felt within it.
        periodic: whether the bar is.
    """
    windows: list[np.ndarray | None] = []
    sources = range(len(equation.drives.sources))
    for group, parts in zip(equation.generator.groups, equation.drives.points, strict=True):
        size = group.free.shape[-1]
        spans = [
            _span(np.concatenate([p.node[p.source == source] for p in parts]), size, periodic)
            for source in sources
        ]
        if not any(count for _, count in spans):
            windows.append(None)
            continue
        count = min(size, max(count for _, count in spans) + 2 * reach)
        first = np.array([first for first, _ in spans]) - reach
        first = first % size if periodic else np.clip(first, 0, size - count)
        windows.append((first[:, None] + np.arange(count)) % size)
    driven = tuple(window is not None for window in windows)
    found = iter(_pushes(equation, made, tuple(w for w in windows if w is not None), driven))
    return tuple(None if window is None else Pushes(next(found), window) for window in windows)


def _span(driven: np.ndarray, size: int, periodic: bool) -> tuple[int, int]:
    """First and number of the points that hold all those driven."""
    if not len(driven):
        return 0, 0
    driven = np.unique(driven)
    if not periodic:
        return int(driven[0]), int(driven[-1] - driven[0]) + 1
    # The widest stretch of points on the ring that is not driven is left out.
    idle = np.diff(np.append(driven, driven[0] + size))
    widest = int(np.argmax(idle))
    return int(driven[(widest + 1) % len(driven)]), size - int(idle[widest]) + 1


@eqx.filter_jit
def _pushes(
    equation: BarEquation,
    made: Series,
    windows: tuple[np.ndarray, ...],
    driven: tuple[bool, ...],
) -> tuple[jax.Array, ...]:
    """Σ_k φ_k(X) G_j b_km of each source in its windows, of the groups driven."""
    drives, A = equation.drives, equation.generator

    def of_source(source: jax.Array, points: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        def seen(y: State) -> tuple[jax.Array, ...]:
            kept = [(g, part) for g, part, yes in zip(A.groups, y, driven, strict=True) if yes]
            return tuple(
                jnp.stack(part[: 2 * g.size])[..., at]
                for (g, part), at in zip(kept, points, strict=True)
            )

        def weighted(factors: jax.Array, y: State) -> tuple[jax.Array, ...]:
            return tuple(jnp.tensordot(factors, part, 0) for part in seen(y))

        def scaled(y: State) -> State:
            return jax.tree.map(lambda rate: rate / made.radius, A(y))

        def advance(carry: Any, factors: jax.Array) -> tuple[Any, None]:
            before, now, total = carry
            total = jax.tree.map(jnp.add, total, weighted(factors, now))
            after = jax.tree.map(lambda a, b: 2 * a + b, scaled(now), before)
            return (now, after, total), None

        alone = (jnp.arange(len(drives.sources)) == source).astype(float)
        first = drives.add(A.zero(), alone)
        start = (first, scaled(first), weighted(made.pulses[0], first))
        (_, _, total), _ = jax.lax.scan(advance, start, made.pulses[1:])
        return total

    counted = jnp.arange(len(drives.sources))
    return jax.lax.map(lambda one: of_source(*one), (counted, windows))
