"""The space-time field: what a run leaves behind, with its axes, units and provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.grid.bar import Bar
from wavesim.material.layers import Layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.material.sectors import BLOCKS, Block
from wavesim.material.wave_equations import ROTATIONS, UNITS
from wavesim.simulation.bandlimited import between
from wavesim.sources import Source
from wavesim.timedomain.timestep import Precision

Float = NDArray[np.float64]

WHOLE = slice(None)
# A long bar holds more wavenumbers than anyone looks at: spectra are taken at no more than these.
MOST_WAVENUMBERS = 2048


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
            arrays, or data sets that are read when indexed.
        medium, bar, sources: what made it; of a bar of layers, the medium at its left end.
        receivers: {name: position in m}.
        energy: energy at each frame.
        stepper, step: name and time step (s) of the stepper that made it.
        layers: what the bar is made of, where it is not one medium.
        precision: of the stepper's products and of the values that are kept.
    """

    t: Float
    values: Mapping[str, Any]
    medium: Medium
    bar: Bar
    sources: tuple[Source, ...]
    receivers: Mapping[str, float] = field(default_factory=dict)
    energy: Energy | None = None
    stepper: str = ""
    step: float = 0.0
    layers: Layers | None = None
    precision: Precision = "double"

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
        return self.part(name)

    def part(self, name: str, frames: slice = WHOLE, points: slice = WHOLE) -> Float:
        """Some frames of one field at some points, shape (frames, points); no more is read."""
        return np.asarray(self.values[name][frames, points], np.float64)

    def positions(self, name: str) -> Float:
        """Grid positions of one field, shape (nx,), m."""
        return self.bar.nodes if name in ROTATIONS else self.bar.half_nodes

    def components(
        self, block: Block, frames: slice = WHOLE, points: slice = WHOLE
    ) -> list[tuple[Float, bool]]:
        """A block's components, scaled so that ½Σ q̇² is the kinetic energy.

        Args:
            block: one of ``field.blocks``.
            frames, points: which are wanted; no others are read.

        Returns:
            For each component its values (frames, points) and whether it lives on the half-nodes.
        """
        units = scales(self.medium)
        found = []
        for component in block.rotations + block.curvatures:
            (first, weight), *others = component.items()
            total = weight / units.unit(first) * self.part(first, frames, points)
            for name, weight in others:
                total += weight / units.unit(name) * self.part(name, frames, points)
            found.append((total, first not in ROTATIONS))
        return found

    def at(self, position: float, name: str, t: ArrayLike | None = None) -> Float:
        """Signal of one field at a position, interpolated to the bar's order.

        Args:
            position: m.
            name: of the field.
            t: times of any sampling, any shape, s; those of the frames where None. Between frames
                the signal is band-limited, to 1e-6 of its peak below 0.8 of their Nyquist
                frequency; near the record's ends less, as nothing is known beyond.

        Returns:
            Shape (nt,) or of t, in the field's unit.

        Raises:
            ValueError: the position is outside the bar.
        """
        weights, indices = self.bar.sampling(position, staggered=name not in ROTATIONS)
        # On a ring the points may be at both its ends.
        runs = np.split(indices, np.flatnonzero(np.diff(indices) != 1) + 1)
        near = [self.part(name, points=slice(int(r[0]), int(r[-1]) + 1)) for r in runs]
        signal = np.concatenate(near, axis=1) @ weights
        if t is None:
            return signal
        return between(signal, (np.asarray(t) - self.t[0]) / self.interval)

    @staticmethod
    def unit(name: str) -> str:
        """Unit of a field, rad or 1/m."""
        return UNITS[name]
