"""What the sources of a real bar do within one exact step, prepared in windows about them.

With the series of ``expansion.py`` they add to the state after a step

    Δy = Σ_k φ_k(X) G_j ∫₀^h c_k(h−τ) s_j(t+τ) dτ = Σ_m P_jm s_j(t+τ_m),

which is felt only within the reach of their points.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.barequation import BarEquation
from wavesim.timedomain.barseries import Series, chebyshev_terms
from wavesim.timedomain.group import Parts, State


class Pushes(eqx.Module):
    """What the sources do to one group within a step, in windows about them.

    Attributes:
        made: P_jm, shape (sources, m, tracks, blocks, points).
        points: where that is, shape (sources, points).
    """

    made: jax.Array
    points: np.ndarray

    def add(self, parts: Parts, amounts: jax.Array) -> Parts:
        """States with Σ_jm P_jm a_jm added.

        Args:
            parts: tracks of the group, shape (states, blocks, nodes) each.
            amounts: a_jm, shape (states, sources, m).
        """
        change = jnp.einsum("osm,smtbp->tobsp", amounts, self.made)
        return tuple(
            part.at[..., self.points].add(own) for part, own in zip(parts, change, strict=True)
        )


def pushes(
    equation: BarEquation, made: Series, factors: jax.Array, reach: int, periodic: bool
) -> tuple[Pushes | None, ...]:
    """P_jm = Σ_k φ_k(X) G_j f_km, for each group; None where no source acts on it.

    Args:
        equation: of the bar.
        made: coefficients of the step.
        factors: f, shape (degree + 1, m).
        reach: cells beyond which nothing is felt within it.
        periodic: whether the bar is.
    """
    windows = driven_windows(equation, reach, periodic)
    if not equation.drives.sources:
        return (None,) * len(windows)
    found = _pushes(equation, made, factors, windows)
    return tuple(
        None if one is None or window is None else Pushes(one, window)
        for one, window in zip(found, windows, strict=True)
    )


def driven_windows(
    equation: BarEquation, reach: int, periodic: bool
) -> tuple[np.ndarray | None, ...]:
    """Points within reach of each source, shape (sources, points), of each group that is driven."""
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
    return tuple(windows)


def windowed(y: State, points: Any) -> tuple[jax.Array | None, ...]:
    """A state at some points of each group, shape (tracks, blocks, points); None at None."""
    return tuple(
        None if at is None else jnp.stack(part)[..., at] for part, at in zip(y, points, strict=True)
    )


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
    factors: jax.Array,
    windows: tuple[np.ndarray | None, ...],
) -> tuple[jax.Array | None, ...]:
    """Σ_k φ_k(X) G_j f_km of each source in its windows, of the groups driven."""
    drives, A = equation.drives, equation.generator

    def of_source(alone: jax.Array, points: Any) -> Any:
        begun = drives.add(A.zero(), alone)
        terms = chebyshev_terms(A, made, begun, lambda y: windowed(y, points))
        return jax.tree.map(lambda term: jnp.tensordot(factors.T, term, 1), terms)

    return jax.lax.map(lambda one: of_source(*one), (jnp.eye(len(drives.sources)), windows))
