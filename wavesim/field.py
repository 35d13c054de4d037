"""The space-time field: what a run leaves behind, with its axes, units and provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.bar import Bar
from wavesim.equations import ROTATIONS, UNITS
from wavesim.layers import Layers
from wavesim.medium import Medium
from wavesim.sectors import BLOCKS, Block, scales
from wavesim.source import Source

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Energy:
    """Energy per area of the section at each frame, J/m²; arrays of shape (nt,).

    Attributes:
        kinetic: ½∫ ρβφ̇² + ργḂ² dx.
        potential: deformation energy, where the closure is symmetric.
        work: done by the sources since the start.
        dissipated: what losses and absorbing ends have taken since the start; None where there
            are none, or where the closure conserves no energy.
    """

    kinetic: Float
    potential: Float
    work: Float
    dissipated: Float | None = None

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the series that are there."""
        names = ("kinetic", "potential", "work", "dissipated")
        return tuple(name for name in names if getattr(self, name) is not None)

    @property
    def total(self) -> Float:
        """Kinetic and potential together."""
        return self.kinetic + self.potential


@dataclass(frozen=True)
class Field:
    """A space-time field on a bar.

    Attributes:
        t: times, even, shape (nt,), s.
        values: {field name: array-like (nt, nx)}, rad for rotations and 1/m for curvatures;
            arrays, or data sets of an open file that are read when indexed.
        medium, bar, sources: what made it; of a bar of layers, the medium at its left end.
        receivers: {name: position in m}.
        energy: energy at each frame.
        stepper, step: name and time step (s) of the stepper that made it.
        layers: what the bar is made of, where it is not one medium.
    """

    t: Float
    values: Mapping[str, ArrayLike]
    medium: Medium
    bar: Bar
    sources: tuple[Source, ...]
    receivers: Mapping[str, float] = field(default_factory=dict)
    energy: Energy | None = None
    stepper: str = ""
    step: float = 0.0
    layers: Layers | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the stored fields."""
        return tuple(self.values)

    @property
    def interval(self) -> float:
        """Time between frames, s."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    @property
    def quiet_from(self) -> float:
        """Time from which on no source acts, s."""
        return max((source.end for source in self.sources), default=0.0)

    @property
    def band(self) -> float:
        """End of the sources' band, rad/s; that of the frames where a source has none."""
        band = max(source.band for source in self.sources)
        return band if math.isfinite(band) else math.pi / self.interval

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Blocks that were set in motion."""
        driven = {source.field for source in self.sources}
        return tuple(block for block in BLOCKS if driven & set(block.fields))

    def __getitem__(self, name: str) -> Float:
        """One field, shape (nt, nx)."""
        return np.asarray(self.values[name])

    def positions(self, name: str) -> Float:
        """Grid positions of one field, shape (nx,), m."""
        return self.bar.nodes if name in ROTATIONS else self.bar.half_nodes

    def components(self, block: Block) -> list[tuple[Float, bool]]:
        """A block's components, scaled so that ½Σ q̇² is the kinetic energy.

        Args:
            block: one of ``field.blocks``.

        Returns:
            For each component its values (nt, nx) and whether it lives on the half-nodes.
        """
        units = scales(self.medium)
        found = []
        for component in block.rotations + block.curvatures:
            parts = [weight / units.unit(f) * self[f] for f, weight in component.items()]
            staggered = next(iter(component)) not in ROTATIONS
            found.append((np.sum(parts, axis=0), staggered))
        return found

    def at(self, position: float, name: str) -> Float:
        """Signal of one field at a position, interpolated to the bar's order.

        Args:
            position: m.
            name: of the field.

        Returns:
            Shape (nt,), in the field's unit.

        Raises:
            ValueError: the position is outside the bar.
        """
        weights, indices = self.bar.sampling(position, staggered=name not in ROTATIONS)
        return self[name][:, indices] @ weights

    @staticmethod
    def unit(name: str) -> str:
        """Unit of a field, rad or 1/m."""
        return UNITS[name]
