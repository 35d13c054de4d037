"""The four sectors of the twelve equations and their blocks.

About the axis of symmetry x₁ the twelve fields fall apart into blocks that never exchange
energy. Three hold one rotation and two micro-curvatures and have three branches each; three hold
one micro-curvature alone and have one branch each: twelve waves.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wavesim.material.wave_equations import FIELDS, ROTATIONS

_HALF = math.sqrt(0.5)


@dataclass(frozen=True)
class Block:
    """Fields that are coupled with each other and with no others.

    Attributes:
        name: unique among BLOCKS.
        sector: longitudinal, transverse2, transverse3 or inplane.
        rotations: components, each {field: weight}, an orthonormal combination of rotations.
        curvatures: likewise of micro-curvatures.
        branches: names of its branches, ascending in frequency.
    """

    name: str
    sector: str
    rotations: tuple[dict[str, float], ...]
    curvatures: tuple[dict[str, float], ...]
    branches: tuple[str, ...]

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields that this block's components combine."""
        used = {name for component in self.rotations + self.curvatures for name in component}
        return tuple(name for name in FIELDS if name in used)

    def weights(self, names: tuple[str, ...]) -> np.ndarray:
        """Matrix from the named fields to this block's components, shape (components, names)."""
        components = self.rotations if names == ROTATIONS else self.curvatures
        rows = [[component.get(name, 0.0) for name in names] for component in components]
        return np.array(rows).reshape(len(components), len(names))


BLOCKS: tuple[Block, ...] = (
    Block(
        "longitudinal",
        "longitudinal",
        ({"phi1": 1.0},),
        ({"B11": 1.0}, {"B22": _HALF, "B33": _HALF}),
        ("LA", "LO1", "LO2"),
    ),
    Block(
        "transverse2",
        "transverse2",
        ({"phi2": 1.0},),
        ({"B21": 1.0}, {"B12": 1.0}),
        ("TA", "TO1", "TO2"),
    ),
    Block(
        "transverse3",
        "transverse3",
        ({"phi3": 1.0},),
        ({"B31": 1.0}, {"B13": 1.0}),
        ("TA", "TO1", "TO2"),
    ),
    Block("inplane[23]", "inplane", (), ({"B23": _HALF, "B32": -_HALF},), ("TSO[23]",)),
    Block("inplane(23)", "inplane", (), ({"B23": _HALF, "B32": _HALF},), ("TSO(23)",)),
    Block("inplane(22-33)", "inplane", (), ({"B22": _HALF, "B33": -_HALF},), ("TSO(22-33)",)),
)
SECTORS: tuple[str, ...] = ("longitudinal", "transverse2", "transverse3", "inplane")


def blocks_of(sector: str) -> tuple[Block, ...]:
    """Blocks of a sector.

    Raises:
        ValueError: no sector has that name.
    """
    found = tuple(block for block in BLOCKS if block.sector == sector)
    if not found:
        raise ValueError(f"sector {sector!r}: must be one of {', '.join(SECTORS)}")
    return found


def excited_blocks(fields: Sequence[str]) -> tuple[Block, ...]:
    """Blocks that sources on these fields set in motion."""
    return tuple(block for block in BLOCKS if set(block.fields) & set(fields))


def grouped(blocks: Sequence[Block]) -> list[tuple[Block, ...]]:
    """Blocks that lie side by side and have as many rotations, together."""
    groups = itertools.groupby(blocks, key=lambda block: len(block.rotations))
    return [tuple(members) for _, members in groups]
