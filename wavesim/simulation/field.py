"""The space-time field: what a run leaves behind, with its axes, units and provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.grid.bar import Bar
from wavesim.grid.points import sampling
from wavesim.material.arguments import checked
from wavesim.material.family import Block, is_macro, known_field
from wavesim.material.layers import Layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.material.shown import Shown, quantity
from wavesim.simulation.bandlimited import between
from wavesim.simulation.simulation import Simulation
from wavesim.sources import Source

if TYPE_CHECKING:
    import xarray

Float = NDArray[np.float64]

WHOLE = slice(None)
# A long bar holds more wavenumbers than anyone looks at: spectra are taken at no more than these.
MOST_WAVENUMBERS = 2048


@dataclass(frozen=True)
class Energy:
    """Energy per area of the section at each frame, J/m²; arrays of shape (nt,).

    Attributes:
        kinetic: ½∫ m_φ φ̇² + m_B Ḃ² dx.
        potential: deformation energy, where the closure is symmetric.
        work: done by the sources since the start.
    """

    kinetic: Float
    potential: Float
    work: Float

    @classmethod
    def joined(cls, parts: Sequence[Energy]) -> Energy:
        """That of consecutive frames as one."""
        names = [part.name for part in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    @property
    def total(self) -> Float:
        """Kinetic and potential together."""
        return self.kinetic + self.potential

    @property
    def dissipated(self) -> Float:
        """What losses and absorbing ends have taken: work − energy, and what was there at first."""
        return self.work - (self.total - self.total[0])


@checked
@dataclass(frozen=True, repr=False)
class Field(Shown):
    """A space-time field on a bar.

    Attributes:
        simulation: what made it.
        t: times, even, shape (nt,), s.
        values: {field name: array-like (nt, nx)}, SI;
            arrays, or data sets that are read when indexed.
        energy: energy at each frame.
        stepper, step: name and time step (s) of the stepper that made it.
    """

    simulation: Simulation
    t: Float
    values: Mapping[str, Any]
    energy: Energy | None = None
    stepper: str = ""
    step: float = 0.0

    def told(self) -> dict[str, str]:
        """Fields, axes and what made them."""
        return {
            "fields": ", ".join(self.names),
            "t": f"{len(self.t)} frames to {quantity(float(self.t[-1]), 's')}",
            "x": f"{len(self.bar.nodes)} nodes over {quantity(self.bar.length, 'm')}",
            "sources": self.simulation.told()["sources"],
            "stepper": f"{self.stepper}, steps of {quantity(self.step, 's')}",
        }

    def to_xarray(self) -> xarray.Dataset:
        """The field as a labelled data set.

        Returns:
            Fields over (t, x) or (t, x_half), energies over t, with attributes ``units``.
        """
        import xarray

        axes = {
            "t": ("t", self.t, {"units": "s"}),
            "x": ("x", self.bar.nodes, {"units": "m"}),
            "x_half": ("x_half", self.bar.half_nodes, {"units": "m"}),
        }
        data: dict[str, Any] = {
            name: (
                ("t", "x" if is_macro(name) else "x_half"),
                self[name],
                {"units": self.unit(name)},
            )
            for name in self.names
        }
        if self.energy is not None:
            for name in ("kinetic", "potential", "work", "total"):
                data[f"energy_{name}"] = ("t", getattr(self.energy, name), {"units": "J/m²"})
        return xarray.Dataset(data, axes, {"stepper": self.stepper, "step": self.step})

    @property
    def medium(self) -> Medium:
        """The medium at the bar's left end."""
        return self.simulation.medium

    @property
    def layers(self) -> Layers:
        """What the bar is made of."""
        return self.simulation.layers

    @property
    def bar(self) -> Bar:
        """Its grid and its ends."""
        return self.simulation.bar

    @property
    def sources(self) -> tuple[Source, ...]:
        """What drove it."""
        return self.simulation.sources

    @property
    def receivers(self) -> Mapping[str, float]:
        """{name: position in m}."""
        return self.simulation.receivers

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Blocks that were set in motion."""
        return self.simulation.blocks

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

    def __getitem__(self, name: str) -> Float:
        """One field, shape (nt, nx)."""
        return self.part(name)

    @checked
    def part(self, name: str, frames: slice = WHOLE, points: slice = WHOLE) -> Float:
        """Some frames of one field at some points, shape (frames, points); no more is read.

        Raises:
            ValueError: there is no such field.
        """
        self._check(name)
        return np.asarray(self.values[name][frames, points], np.float64)

    def _check(self, name: str) -> None:
        if name not in self.values:
            raise ValueError(
                f"name = {name!r}: must be one of the fields that the sources set in motion, "
                f"{', '.join(self.names)}"
            )

    def positions(self, name: str) -> Float:
        """Grid positions of one field, shape (nx,), m."""
        return self.bar.nodes if is_macro(name) else self.bar.half_nodes

    def components(self, block: Block, frames: slice = WHOLE) -> list[tuple[Float, bool]]:
        """A block's components, scaled so that ½Σ q̇² is the kinetic energy.

        Args:
            block: one of ``field.blocks``.
            frames: which are wanted; no others are read.

        Returns:
            For each component its values (frames, nx) and whether it lives on the half-nodes.
        """
        units = scales(self.medium)
        found = []
        for component in block.macro + block.micro:
            (first, weight), *others = component.items()
            total = weight / units.unit(first) * self.part(first, frames)
            for name, weight in others:
                total += weight / units.unit(name) * self.part(name, frames)
            found.append((total, not is_macro(first)))
        return found

    @checked
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
            ValueError: the position is outside the bar, a time outside the record, or there is no
                such field.
        """
        self._check(name)
        weights, indices = sampling(self.bar, position, staggered=not is_macro(name))
        # On a ring the points may be at both its ends.
        runs = np.split(indices, np.flatnonzero(np.diff(indices) != 1) + 1)
        near = [self.part(name, points=slice(int(r[0]), int(r[-1]) + 1)) for r in runs]
        signal = np.concatenate(near, axis=1) @ weights
        if t is None:
            return signal
        first, last = float(self.t[0]), float(self.t[-1])
        asked = np.asarray(t, float)
        slack = 1e-9 * (last - first)
        if asked.size and not (asked.min() >= first - slack and asked.max() <= last + slack):
            raise ValueError(
                f"t = {asked.min():g} to {asked.max():g} s: must be within the record, {first:g} "
                f"to {last:g} s; simulate for longer, or ask for less"
            )
        return between(signal, (np.asarray(t) - self.t[0]) / self.interval, moving=True)

    @staticmethod
    def unit(name: str) -> str:
        """Unit of a field."""
        return known_field(name).unit
