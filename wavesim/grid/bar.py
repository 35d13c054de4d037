"""The bar: its grid and its ends. Geometry only, in metres."""

from __future__ import annotations

import functools
import math
import numbers
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavesim.grid.stencils import difference_weights
from wavesim.grid.summation_by_parts import Differences, chain, check_stretches
from wavesim.material.arguments import checked
from wavesim.material.layers import ENDS, End, Layers
from wavesim.material.shown import Shown, quantity

if TYPE_CHECKING:
    from scipy.sparse import csr_array

MINIMUM_CELLS = 16
# More are taken for a slip of the pen: their differences alone take a GB, and seconds.
MOST_CELLS = 5 * 10**6

Float = NDArray[Any]
Index = NDArray[np.int64]


@checked
@dataclass(frozen=True, repr=False)
class Bar(Shown):
    """A bar on a staggered grid, with its ends.

    Macro-fields φ live on the nodes x_i, φ′, B and σ on the half-nodes x_i + h/2. A periodic bar of
    N cells has N nodes, any other N + 1, one at each end. A bar of layers has a stretch of cells of
    its own size for each, so that every interface falls on a node (:func:`layered_bar`).

    Args:
        cells: N, number of cells, –, at least 16 and more than the stencil is wide.
        spacing: h, m; the largest, where stretches differ.
        order: order of the staggered differences, –, even, 2 to 12.
        left, right: "periodic" (both), "fixed" (φ = 0), "free" (σ = 0) or "absorbing" (a matched
            layer inside the bar). B is natural at fixed and free ends: Γ ∂ₓB = 0.
        absorber: length of the layer at an absorbing end, m.
        stretches: (cells, spacing) of each layer; empty where the grid is uniform.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    cells: int
    spacing: float
    order: int = 8
    left: End = "periodic"
    right: End = "periodic"
    absorber: float = 0.0
    stretches: tuple[tuple[int, float], ...] = ()

    def __post_init__(self) -> None:
        difference_weights(self.order)
        if not isinstance(self.cells, numbers.Integral):
            raise ValueError(f"cells = {self.cells!r}: must be a whole number")
        if not isinstance(self.spacing, numbers.Real):
            raise ValueError(f"spacing = {self.spacing!r}: must be a number in m")
        if not (self.spacing > 0 and math.isfinite(self.spacing)):
            raise ValueError(f"spacing = {self.spacing:g} m: must be greater than 0, and finite")
        least = max(MINIMUM_CELLS, 2 * self.order)
        if self.cells < least:
            raise ValueError(
                f"cells = {self.cells}: order {self.order} needs at least {least}; "
                "lengthen the bar or refine the spacing"
            )
        if self.cells > MOST_CELLS:
            raise ValueError(
                f"cells = {self.cells}: must be at most {MOST_CELLS:.0e}; shorten the bar or "
                "coarsen the spacing"
            )
        for name in ("left", "right"):
            if getattr(self, name) not in ENDS:
                raise ValueError(
                    f"{name} = {getattr(self, name)!r}: must be one of {', '.join(ENDS)}"
                )
        if (self.left == "periodic") != (self.right == "periodic"):
            raise ValueError(
                f'left = "{self.left}", right = "{self.right}": a bar is periodic at both ends or '
                "at none"
            )
        if self.stretches and self.cells != sum(cells for cells, _ in self.stretches):
            raise ValueError(
                f"cells = {self.cells}: the stretches have "
                f"{sum(cells for cells, _ in self.stretches)}; make the bar with layered_bar"
            )
        if self.absorber < 0:
            raise ValueError(f"absorber = {self.absorber:g} m: must be 0 or greater")
        absorbing = (self.left, self.right).count("absorbing")
        if absorbing and not self.absorber > 0:
            raise ValueError(
                f"absorber = {self.absorber:g} m: an absorbing end needs a length greater than 0, "
                "such as 8 branch lengths"
            )
        if absorbing * self.absorber > 0.8 * self.length:
            raise ValueError(
                f"absorber = {self.absorber:g} m: {absorbing} of them leave less than a fifth of "
                f"the bar of {self.length:g} m; shorten them or lengthen the bar"
            )
        if not self.uniform or not self.periodic:
            check_stretches(self.order, self.all_stretches)

    def told(self) -> dict[str, str]:
        """Length, grid, ends."""
        ends = "periodic" if self.periodic else f"{self.left} – {self.right}"
        told = {
            "length": quantity(self.length, "m"),
            "cells": f"{self.cells} of {quantity(self.spacing, 'm')}, order {self.order}",
            "ends": ends,
        }
        if not self.uniform:
            told["stretches"] = str(len(self.stretches))
        if self.absorber:
            told["absorber"] = quantity(self.absorber, "m")
        return told

    @property
    def periodic(self) -> bool:
        """Whether its ends are joined."""
        return self.left == "periodic"

    @property
    def uniform(self) -> bool:
        """Whether all cells are of one stretch."""
        return len(self.stretches) <= 1

    @functools.cached_property
    def length(self) -> float:
        """L, m: of a periodic bar x = L is x = 0 again."""
        if self.stretches:
            return sum(cells * spacing for cells, spacing in self.stretches)
        return self.cells * self.spacing

    @property
    def all_stretches(self) -> tuple[tuple[int, float], ...]:
        """(cells, spacing in m) of each stretch, one at least."""
        return self.stretches or ((self.cells, self.spacing),)

    @functools.cached_property
    def _all_nodes(self) -> Float:
        """N + 1 nodes, ends included."""
        parts: list[Float] = [np.zeros(1)]
        start = 0.0
        for cells, spacing in self.all_stretches:
            parts.append(start + np.arange(1, cells + 1) * spacing)
            start += cells * spacing
        return np.concatenate(parts)

    @property
    def nodes(self) -> Float:
        """Positions of the macro-fields, shape (N,) or (N + 1,), m."""
        return self._all_nodes[: self.cells] if self.periodic else self._all_nodes

    @property
    def half_nodes(self) -> Float:
        """Positions of the micro-fields, shape (N,), m."""
        if not self.stretches:
            return (np.arange(self.cells) + 0.5) * self.spacing
        return (self._all_nodes[1:] + self._all_nodes[:-1]) / 2

    @property
    def cell_sizes(self) -> Float:
        """Length of each cell, shape (N,), m."""
        return np.concatenate([np.full(cells, size) for cells, size in self.all_stretches])

    @property
    def wavenumbers(self) -> Float:
        """Wavenumbers that the uniform periodic bar holds exactly, 0 to Nyquist, rad/m."""
        return 2 * np.pi * np.arange(self.cells // 2 + 1) / self.length

    @property
    def clear(self) -> tuple[float, float]:
        """The part of the bar that is no absorber, m."""
        low = self.absorber if self.left == "absorbing" else 0.0
        return low, self.length - (self.absorber if self.right == "absorbing" else 0.0)

    @functools.cached_property
    def differences(self) -> Differences:
        """D and the norms, closures at ends and interfaces included."""
        if self.uniform and self.periodic:
            weights = np.array(difference_weights(self.order)) / self.spacing
            stencil = np.concatenate([-weights[::-1], weights])
            unit = np.full(self.cells, self.spacing)
            diagonals = np.repeat(stencil[:, None], self.cells, axis=1)
            return Differences(1 - self.order // 2, diagonals, unit, unit)
        cells, spacings = zip(*self.all_stretches, strict=True)
        made = chain(self.order, cells, spacings)
        if not self.periodic:
            return made
        norm = made.node_norm[:-1].copy()
        norm[0] += made.node_norm[-1]
        return replace(made, node_norm=norm)

    @functools.cached_property
    def stretch_norms(self) -> tuple[Float, ...]:
        """Length that each node of a stretch stands for in it, shape (cells + 1,) of each, m."""
        if self.uniform and self.periodic:
            norm = np.full(self.cells + 1, self.spacing)
            norm[[0, -1]] /= 2
            return (norm,)
        return tuple(chain(self.order, (n,), (h,)).node_norm for n, h in self.all_stretches)

    @property
    def difference_matrix(self) -> csr_array:
        """D as a sparse matrix, shape (half-nodes, nodes), 1/m."""
        from scipy.sparse import csr_array

        known, nodes = self.differences, len(self.nodes)
        rows = np.broadcast_to(np.arange(self.cells), known.diagonals.shape)
        columns = rows + known.first + np.arange(len(known.diagonals))[:, None]
        there = known.diagonals != 0
        entries = known.diagonals[there], (rows[there], columns[there] % nodes)
        return csr_array(entries, shape=(self.cells, nodes))


def layered_bar(
    layers: Layers,
    spacing: float | Sequence[float],
    order: int = 8,
    left: End = "free",
    right: End = "free",
    absorber: float = 0.0,
) -> Bar:
    """A bar whose grid fits its layers: each has a whole number of cells of its own size.

    Args:
        layers: what it is made of.
        spacing: the cell size to come nearest to, of all layers or of each, m.
        order, left, right, absorber: as of :class:`Bar`.

    Raises:
        ValueError: a layer is too thin for the order, or a value is not admissible.
    """
    stretches = []
    sizes, count = np.asarray(spacing, dtype=float), len(layers.layers)
    if sizes.shape not in ((), (count,)):
        raise ValueError(f"spacing: {sizes.size} given for {count} layers; give one, or one each")
    sizes = np.broadcast_to(sizes, count)
    for layer, size in zip(layers.layers, sizes.tolist(), strict=True):
        if not (size > 0 and math.isfinite(size)):
            raise ValueError(f"spacing = {size:g} m: must be greater than 0, and finite")
        cells = max(1, round(layer.thickness / size))
        stretches.append((cells, layer.thickness / cells))
    return Bar(
        sum(cells for cells, _ in stretches),
        max(size for _, size in stretches),
        order,
        left,
        right,
        absorber,
        tuple(stretches),
    )
