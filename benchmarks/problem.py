"""The one problem that every contestant solves: a bar, its sources, a duration.

Twelve fields, all six blocks driven, 4,096 cells of l/8, order 8, 200 units of time. The sources
stand round the middle of the bar and nothing reaches its ends, so a contestant without periodic
ends solves the same problem.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wavesim.grid.bar import Bar
from wavesim.grid.stencils import difference_weights
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, block_coefficients, scales
from wavesim.material.sectors import BLOCKS
from wavesim.material.wave_equations import CURVATURES, FIELDS, ROTATIONS
from wavesim.sources import Ricker

Float = NDArray[np.float64]

ORDER = 8
COMPONENTS = 12


@dataclass(frozen=True)
class Drive:
    """A point force on one component: q̈[component, cell] += strength · signal(t).

    Attributes:
        component: 0 to 11.
        cell: index on that component's grid.
        strength: scaled.
        pulse: gives signal(t), of a scaled time.
    """

    component: int
    cell: int
    strength: float
    pulse: Ricker
    time_scale: float

    def signal(self, t: Float) -> Float:
        """At scaled times t."""
        return np.asarray(self.pulse.signal(np.asarray(t) * self.time_scale))


@dataclass(frozen=True)
class Problem:
    """Bar, medium and sources; in scaled units where a name says nothing else.

    A scaled state has shape (12, cells): the components of wavesim's blocks, in their order.

    Attributes:
        medium, bar, sources: as for wavesim.
        duration: in units of time.
    """

    medium: Medium
    bar: Bar
    sources: tuple[Ricker, ...]
    duration: float

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return self.duration * float(self.medium.time_scale)

    @property
    def spacing(self) -> float:
        """Cell size."""
        return self.bar.spacing / float(self.medium.length_scale)

    @property
    def weights(self) -> Float:
        """Difference weights over the cell size, c_j/h."""
        return np.array(difference_weights(self.bar.order)) / self.spacing

    @cached_property
    def without_gradient(self) -> Medium:
        """The medium with Γ = 0: 1e-13 in scaled units, a quarter of a peer's work saved."""
        return replace(self.medium, G_n_g=0.0)

    @cached_property
    def forms(self) -> tuple[BlockCoefficients, ...]:
        """Coefficients of the six blocks, as the peers use them: without Γ."""
        units = scales(self.without_gradient)
        return tuple(block_coefficients(self.without_gradient, block, units) for block in BLOCKS)

    @cached_property
    def drives(self) -> tuple[Drive, ...]:
        """The sources as forces at single points of components."""
        units = scales(self.medium)
        found = []
        for pulse in self.sources:
            density, indices = self.bar.spread(pulse.position, pulse.width, pulse.staggered)
            strengths = density / units.force(pulse.field)
            for component, parts in enumerate(_components()):
                for cell, strength in zip(indices, strengths, strict=True):
                    if pulse.field in parts:
                        amount = float(parts[pulse.field] * strength)
                        found.append(Drive(component, int(cell), amount, pulse, float(units.time)))
        return tuple(found)

    @property
    def quiet_from(self) -> float:
        """Time from which on no source acts."""
        return max(pulse.end for pulse in self.sources) / float(self.medium.time_scale)

    def fields(self, state: Float) -> dict[str, Float]:
        """The twelve fields in SI of a scaled state."""
        units = scales(self.medium)
        made = {name: np.zeros(self.bar.cells) for name in FIELDS}
        for values, parts in zip(state, _components(), strict=True):
            for name, weight in parts.items():
                made[name] += weight * float(units.unit(name)) * values
        return made


def _components() -> list[dict[str, float]]:
    return [part for block in BLOCKS for part in block.rotations + block.curvatures]


def problem(cells: int = 4096, duration: float = 200.0) -> Problem:
    """The benchmark's problem, or a smaller or larger one of the same kind."""
    medium = Medium(anisotropy=0.25, closure="consistent")
    length, units = float(medium.length_scale), scales(medium)
    bar = Bar(cells, length / 8, ORDER)
    # Each on a grid point of its own field, a few branch lengths apart; the peak frequency is
    # 1 in units of the paper's axes; the amplitudes give all components a like size.
    named = (("phi1", 0.0), ("phi2", -3.0), ("phi3", 4.0), ("B22", 2.0), ("B23", -5.0))
    sources = []
    for field, offset in named:
        cell = cells // 2 + 8 * offset
        staggered = field in CURVATURES
        sources.append(
            Ricker(
                field,
                (cell + 0.5 * staggered) * bar.spacing,
                peak_frequency=1 / (2 * np.pi * float(medium.time_scale)),
                amplitude=float(units.force(field)) * length,
            )
        )
    return Problem(medium, bar, tuple(sources), duration)


def error(fields: dict[str, Float], exact: dict[str, Float]) -> float:
    """Largest over the fields of max |difference| / max |exact|."""
    return max(
        float(np.abs(fields[name] - exact[name]).max() / np.abs(exact[name]).max())
        for name in (*ROTATIONS, *CURVATURES)
    )


def exact_fields(made: Problem) -> dict[str, Float]:
    """The exact modal solution at the final time, by the route that the tests use.

    It solves the 12 × 12 system in SI for each wavenumber and shares no blocks, no scaling and no
    stepper with any contestant.
    """
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
    from exact import modal_field

    found = modal_field(made.medium, made.bar, made.sources, np.array([made.seconds]))
    return {name: values[0] for name, values in found.items()}
