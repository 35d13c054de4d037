"""A bar whose cells have sizes that jax traces: where points are, and what stands at a position.

The grid keeps its numbers of cells; positions are held in m, so that a receiver stays where it is
while layers grow and shrink about it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.grid.points import CUT, gaussian_points, sampled


@dataclass(frozen=True)
class TracedGrid:
    """A bar with other sizes of cells.

    Attributes:
        bar: gives cells, ends and order.
        sizes: of the cells of each stretch, shape (stretches,), m.
    """

    bar: Bar
    sizes: Any

    @property
    def edges(self) -> Any:
        """Where stretches begin, and the last one ends, shape (stretches + 1,), m."""
        cells = np.array([float(cells) for cells, _ in self.bar.all_stretches])
        return jnp.concatenate([jnp.zeros(1), jnp.cumsum(cells * self.sizes)])

    def points(self, staggered: bool) -> Any:
        """Positions of nodes or half-nodes, m."""
        cells = np.array([cells for cells, _ in self.bar.all_stretches])
        own = jnp.repeat(self.sizes, cells, total_repeat_length=self.bar.cells)
        ends = jnp.concatenate([jnp.zeros(1), jnp.cumsum(own)])
        if staggered:
            return (ends[1:] + ends[:-1]) / 2
        return ends[:-1] if self.bar.periodic else ends

    def sampling(self, position: float, staggered: bool) -> tuple[Any, Any]:
        """Weights and indices that interpolate at a position, shape (order,).

        Beyond the end of the bar the weights are NaN.
        """
        bar, edges, width = self.bar, self.edges, self.bar.order
        counts = np.array([cells for cells, _ in bar.all_stretches])
        firsts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        at = jnp.clip(jnp.searchsorted(edges, position, side="right") - 1, 0, len(counts) - 1)
        size = self.sizes[at]
        place = (position - edges[at]) / size - (0.5 if staggered else 0.0)
        first = jnp.floor(jax.lax.stop_gradient(place)).astype(int) + 1 - width // 2
        if not (bar.uniform and bar.periodic):
            last = jnp.asarray(counts)[at] - (1 if staggered else 0)
            first = jnp.clip(first, 0, last + 1 - width)
        steps = np.arange(width)
        local = place - first.astype(float)
        weights = jnp.stack(
            [
                jnp.prod(jnp.stack([(local - float(j)) / float(i - j) for j in steps if j != i]))
                for i in steps
            ]
        )
        outside = position > edges[-1] * (1 + 1e-12)
        indices = first + steps + jnp.asarray(firsts)[at]
        count = bar.cells if bar.periodic or staggered else bar.cells + 1
        return jnp.where(outside, jnp.nan, weights), indices % count

    def spread(self, position: float, width: float, staggered: bool, norm: Any) -> tuple[Any, Any]:
        """Share of a unit source that each point takes, and their indices; as of ``grid.points``.

        Args:
            position: m.
            width: standard deviation of a Gaussian, m; 0 for a point.
            staggered: True for a field on the half-nodes.
            norm: length that each of these points stands for, m.
        """
        if width == 0:
            return self.sampling(position, staggered)
        x, length = self.points(staggered), self.edges[-1]
        if sampled(self.bar, position, width, staggered) is None:
            u, shares = gaussian_points(width / min(size for _, size in self.bar.all_stretches))
            places: Any = position + width * u
            places = places % length if self.bar.periodic else jnp.clip(places, 0.0, length)
            weights, indices = jax.vmap(lambda place: self.sampling(place, staggered))(places)
            laid = jnp.zeros(len(x)).at[indices].add(shares[:, None] * weights)
            return laid, jnp.arange(len(x))
        distance = x - position
        if self.bar.periodic:
            distance = (distance + length / 2) % length - length / 2
        density = jnp.exp(-((distance / width) ** 2) / 2) / (np.sqrt(2 * np.pi) * width)
        density = jnp.where(jnp.abs(distance) <= CUT * width, density, 0.0)
        return density * norm[: len(x)], jnp.arange(len(x))
