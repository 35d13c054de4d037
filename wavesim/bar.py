"""The bar: its grid and its ends. Geometry only, in metres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.stencils import difference_weights, interpolation_weights

MINIMUM_CELLS = 16

Float = NDArray[Any]


@dataclass(frozen=True)
class Bar:
    """A uniform periodic bar on a staggered grid.

    Rotations φ live on the nodes x_i = i h; φ′, B and σ on the half-nodes x_i + h/2.

    Args:
        cells: N, number of cells, –, at least 16 and more than the stencil is wide.
        spacing: h, m.
        order: order of the staggered differences, –, even, 2 to 12.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    cells: int
    spacing: float
    order: int = 8

    def __post_init__(self) -> None:
        difference_weights(self.order)
        if not self.spacing > 0:
            raise ValueError(f"spacing = {self.spacing:g} m: must be greater than 0")
        least = max(MINIMUM_CELLS, 2 * self.order)
        if self.cells < least:
            raise ValueError(
                f"cells = {self.cells}: order {self.order} needs at least {least}; "
                "lengthen the bar or refine the spacing"
            )

    @property
    def length(self) -> float:
        """L = N h, m; x = L is x = 0 again."""
        return self.cells * self.spacing

    @property
    def nodes(self) -> Float:
        """Positions of the rotations, shape (N,), m."""
        return np.arange(self.cells) * self.spacing

    @property
    def half_nodes(self) -> Float:
        """Positions of the micro-curvatures, shape (N,), m."""
        return (np.arange(self.cells) + 0.5) * self.spacing

    @property
    def wavenumbers(self) -> Float:
        """Wavenumbers that the periodic bar holds exactly, 0 to Nyquist, rad/m."""
        return 2 * np.pi * np.arange(self.cells // 2 + 1) / self.length

    def sampling(self, position: float, staggered: bool) -> tuple[Float, NDArray[np.int64]]:
        """Weights and grid indices that interpolate a field at a position, to the bar's order.

        Args:
            position: m, in [0, L].
            staggered: True for a field on the half-nodes.

        Raises:
            ValueError: the position is outside the bar.
        """
        if not 0 <= position <= self.length:
            raise ValueError(
                f"position = {position:g} m: must be within the bar, 0 to {self.length:g} m"
            )
        first = 0.5 * self.spacing if staggered else 0.0
        weights, indices = interpolation_weights(position, first, self.spacing, self.order)
        return weights, indices % self.cells

    def spread(
        self, position: float, width: float, staggered: bool
    ) -> tuple[Float, NDArray[np.int64]]:
        """Density that stands for δ(x − position), or for a Gaussian of that standard deviation.

        A point is the transpose of the interpolation above, so that source and receiver can be
        exchanged. A Gaussian exp(−(x−x_s)²/2w²)/(√(2π) w) is cut at 8.5 w (1e-16), on a
        periodic bar laid round it if need be.

        Args:
            position: m, in [0, L].
            width: w, m; 0 for a point.
            staggered: True for a field on the half-nodes.

        Returns:
            Density (1/m) and the grid indices it stands at.

        Raises:
            ValueError: the position is outside the bar, or the Gaussian is too wide for it.
        """
        weights, indices = self.sampling(position, staggered)
        if width == 0:
            return weights / self.spacing, indices
        reach = int(np.ceil(8.5 * width / self.spacing))
        if 2 * reach + 1 > self.cells:
            widest = (self.cells - 1) // 2 * self.spacing / 8.5
            raise ValueError(
                f"width = {width:g} m: a Gaussian of 17 widths must fit into the bar of "
                f"{self.length:g} m; take at most {0.99 * widest:.3g} m"
            )
        first = 0.5 * self.spacing if staggered else 0.0
        centre = round((position - first) / self.spacing)
        indices = np.arange(centre - reach, centre + reach + 1)
        distance = (first + indices * self.spacing - position) / width
        density = np.exp(-(distance**2) / 2) / (np.sqrt(2 * np.pi) * width)
        return density, indices % self.cells
