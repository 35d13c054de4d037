"""The bar: its grid and its ends. Geometry only, in metres."""

from __future__ import annotations

import functools
import math
import numbers
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.grid.stencils import difference_weights, interpolation_weights
from wavesim.grid.summation_by_parts import chain, check_stretches
from wavesim.material.arguments import checked
from wavesim.material.layers import ENDS, End, Layers
from wavesim.material.shown import Shown, quantity

MINIMUM_CELLS = 16
# More would not fit into any memory, and are taken for a slip of the pen.
MOST_CELLS = 10**8
# A Gaussian is cut at so many widths, where it is 1e-16 of its top. Sampled at a width of so many
# cells its sum is its integral to 3e-15; where that is off by more, a closure is near, which is not
# felt from so many cells on.
_CUT = 8.5
_SAMPLED = 1.3
_INTEGRATED = 1e-9
_WIDE = 32

Float = NDArray[Any]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Differences:
    """The difference D from nodes to half-nodes, by diagonals, and the norms of the points.

    Row j of D takes node j + first + w, modulo their number, with factor diagonals[w, j]. With the
    norms N (nodes) and H (half-nodes) −N⁻¹ Dᵀ H is the difference from half-nodes to nodes.

    Attributes:
        first: column of the first diagonal in row 0.
        diagonals: shape (width, half-nodes), 1/m.
        node_norm, half_norm: length that each point stands for, m.
    """

    first: int
    diagonals: Float
    node_norm: Float
    half_norm: Float


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
        norm = made.node_norm.copy()
        if self.periodic:
            norm[0] += norm[-1]
            norm = norm[:-1]
        return Differences(made.first, made.diagonals, norm, made.half_norm)

    def sampling(self, position: float, staggered: bool) -> tuple[Float, Index]:
        """Weights and grid indices that interpolate a field at a position, to the bar's order.

        Points are taken from one stretch only, as a field has kinks or jumps at interfaces; at an
        interface from the one to its right, as :meth:`Layers.layer_at` does.

        Args:
            position: m, in [0, L].
            staggered: True for a field on the half-nodes.

        Raises:
            ValueError: the position is outside the bar.
        """
        if not 0 <= position <= self.length * (1 + 1e-12):
            raise ValueError(
                f"position = {position:g} m: must be within the bar, 0 to {self.length:g} m"
            )
        first_cell, start = 0, 0.0
        for cells, spacing in self.all_stretches:
            end = start + cells * spacing
            if position < end - 1e-9 * spacing or end >= self.length * (1 - 1e-12):
                break
            first_cell, start = first_cell + cells, end
        first = start + 0.5 * spacing if staggered else start
        weights, indices = interpolation_weights(position, first, spacing, self.order)
        if not (self.uniform and self.periodic):
            last = cells - 1 if staggered else cells
            shift = max(0, -int(indices[0])) - max(0, int(indices[-1]) - last)
            if shift:
                weights, indices = interpolation_weights(
                    position, first, spacing, self.order, shift
                )
            indices = indices + first_cell
        return weights, indices % (self.cells if self.periodic or staggered else self.cells + 1)

    def spread(self, position: float, width: float, staggered: bool) -> tuple[Float, Index]:
        """Density that stands for δ(x − position), or for a Gaussian of that standard deviation.

        A point is the transpose of the interpolation above in the norm of the grid, so that source
        and receiver can be exchanged. A Gaussian exp(−(x−x_s)²/2w²)/(√(2π) w) is cut at 8.5 w
        (1e-16), on a periodic bar laid round it if need be. Where the grid's sum does not integrate
        it, being narrower than 1.3 cells or at a closure, it is a mean of points instead, which has
        its moments up to the bar's order: the moment of a point above all.

        Args:
            position: m, in [0, L].
            width: w, m; 0 for a point.
            staggered: True for a field on the half-nodes.

        Returns:
            Density (1/m) and the grid indices it stands at.

        Raises:
            ValueError: the position is outside the bar, or the Gaussian is too wide for it.
        """
        if width == 0:
            return self._point(position, staggered)
        if not 0 <= position <= self.length * (1 + 1e-12):
            self.sampling(position, staggered)  # says what is wrong
        if 17 * width > self.length:
            raise ValueError(
                f"width = {width:g} m: a Gaussian of 17 widths must fit into the bar of "
                f"{self.length:g} m; take at most {0.99 * self.length / 17:.3g} m"
            )
        x = self.half_nodes if staggered else self.nodes
        if self.periodic:
            distance = (x - position + self.length / 2) % self.length - self.length / 2
        else:
            distance = x - position
            if not _CUT * width <= position <= self.length - _CUT * width:
                raise ValueError(
                    f"width = {width:g} m: the Gaussian at {position:g} m stands out over an end "
                    f"of the bar; take at most "
                    f"{min(position, self.length - position) / _CUT:.3g} m, or move it inward"
                )
        indices = np.flatnonzero(np.abs(distance) <= _CUT * width)
        density = np.exp(-((distance[indices] / width) ** 2) / 2) / (np.sqrt(2 * np.pi) * width)
        if width >= _SAMPLED * self.spacing:
            norms = self.differences
            norm = norms.half_norm if staggered else norms.node_norm
            if width >= _WIDE * self.spacing or abs(density @ norm[indices] - 1) < _INTEGRATED:
                return density, indices
        return self._mean_of_points(position, width, staggered)

    def _point(self, position: float, staggered: bool) -> tuple[Float, Index]:
        weights, indices = self.sampling(position, staggered)
        if self.uniform and self.periodic:
            return weights / self.spacing, indices
        norms = self.differences
        return weights / (norms.half_norm if staggered else norms.node_norm)[indices], indices

    def _mean_of_points(
        self, position: float, width: float, staggered: bool
    ) -> tuple[Float, Index]:
        """The same Gaussian as point sources side by side, four to a cell and to a width."""
        finest = min(size for _, size in self.all_stretches)
        count = 2 * math.ceil(_CUT * max(4.0, min(4 * width / finest, 1000.0))) + 1
        u = np.linspace(-_CUT, _CUT, count)
        weights = np.exp(-(u**2) / 2)
        densities, points = [], []
        for place, weight in zip(position + width * u, weights / weights.sum(), strict=True):
            at = place % self.length if self.periodic else min(max(place, 0.0), self.length)
            density, indices = self._point(float(at), staggered)
            densities.append(weight * density)
            points.append(indices)
        indices, entry = np.unique(np.concatenate(points), return_inverse=True)
        return np.bincount(entry, np.concatenate(densities)), indices


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
    sizes = np.broadcast_to(np.asarray(spacing, dtype=float), len(layers.layers))
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
