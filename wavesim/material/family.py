"""A family of waves as data: what its fields are called and measured in, and how they are coupled.

A family has macro-fields φ, which live on nodes, and micro-fields B, which follow them with an
inertia of their own and live on half-nodes:

    m_φ φ̈ = ∂ₓσ + k,             σ = C_φφ φ′ − C_φB B
    m_B B̈ = C_Bφ φ′ − C_BB B + Γ ∂ₓ²B + Π

Everything past this room knows φ, B and their blocks alone; names, units and symbols come from
here, and the coefficients from the family's medium (``medium``).
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from wavesim.material.arguments import checked

_LOWERED = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
Part = dict[str, float]
"""A component: {field: weight}, an orthonormal combination of fields."""
Acts = Literal["body", "surface", "prescribed", "initial"]
"""What a source does: it acts inside, loads a free end, moves a fixed one, or is there at t = 0."""


@checked
@dataclass(frozen=True)
class Block:
    """Fields that are coupled with each other and with no others.

    Attributes:
        name: unique in its family.
        sector: of the waves, such as longitudinal.
        macro: components of macro-fields.
        micro: likewise of micro-fields.
        branches: names of its branches, ascending in frequency; one for each component.
    """

    name: str
    sector: str
    macro: tuple[Part, ...]
    micro: tuple[Part, ...]
    branches: tuple[str, ...]

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields that this block's components combine."""
        return tuple(dict.fromkeys(name for part in self.macro + self.micro for name in part))

    def projections(self, family: Family) -> tuple[np.ndarray, np.ndarray]:
        """Matrices from a family's macro- and micro-fields to components: :func:`weights`."""
        names = family.macro, family.micro
        if names not in self._projections:
            self._projections[names] = weights(self.macro, names[0]), weights(self.micro, names[1])
        return self._projections[names]

    @functools.cached_property
    def _projections(self) -> dict[Any, tuple[np.ndarray, np.ndarray]]:
        return {}


def weights(parts: Sequence[Part], names: Sequence[str]) -> np.ndarray:
    """Matrix from the named fields to components, shape (components, names)."""
    rows = [[part.get(name, 0.0) for name in names] for part in parts]
    return np.array(rows).reshape(len(parts), len(names))


@dataclass(frozen=True)
class Quantity:
    """One field, or what acts on it.

    Attributes:
        name: such as phi1.
        macro: whether it is a macro-field, on nodes.
        symbol: such as φ₁.
        unit: SI.
        force_unit: of what acts on it, per area of the section.
        family: that it belongs to.
    """

    name: str
    macro: bool
    symbol: str
    unit: str
    force_unit: str
    family: Family


@checked
@dataclass(frozen=True, eq=False)
class Family:
    """A family of waves.

    Attributes:
        name: as a case file has it.
        macro, micro: names of its fields; each is a letter or word and its indices.
        blocks: how they are coupled, those of one shape side by side.
        gaps: names of each sector's band gaps, ascending; a sector with a macro-field has one for
            each micro-field, another has one, between its lowest and highest frequency.
        units: of a macro-field and of a micro-field, SI.
        symbols: their letters.
        words: what they are called.
        force_units: of what acts on the one and on the other, per area of the section.
        drives: its words for what drives an end, {word: "surface" or "prescribed"}: what loads a
            free end, and what moves a fixed one.
        waves: what those who measure call the waves of a sector, {sector: such as "P"}.
        time: the unit of time as a formula.
    """

    name: str
    macro: tuple[str, ...]
    micro: tuple[str, ...]
    blocks: tuple[Block, ...]
    gaps: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    units: tuple[str, str] = ("", "")
    symbols: tuple[str, str] = ("φ", "B")
    words: tuple[str, str] = ("macro-field", "micro-field")
    force_units: tuple[str, str] = ("", "")
    drives: Mapping[str, Acts] = field(
        default_factory=lambda: {"surface": "surface", "prescribed": "prescribed"}
    )
    waves: Mapping[str, str] = field(default_factory=dict)
    time: str = "τ"

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of all its fields."""
        return self.macro + self.micro

    @property
    def sectors(self) -> tuple[str, ...]:
        """Names of its sectors, each once."""
        return tuple(dict.fromkeys(block.sector for block in self.blocks))

    @property
    def travelling(self) -> tuple[str, ...]:
        """Sectors with a macro-field, in which waves travel."""
        return tuple(dict.fromkeys(block.sector for block in self.blocks if block.macro))

    @property
    def quantities(self) -> dict[str, Quantity]:
        """Its fields by name."""
        return {
            name: Quantity(
                name,
                number == 0,
                self.symbols[number] + name.lstrip(_WORD).translate(_LOWERED),
                self.units[number],
                self.force_units[number],
                self,
            )
            for number, names in enumerate((self.macro, self.micro))
            for name in names
        }

    def blocks_of(self, sector: str) -> tuple[Block, ...]:
        """Blocks of a sector.

        Raises:
            ValueError: no sector has that name.
        """
        found = tuple(block for block in self.blocks if block.sector == sector)
        if not found:
            raise ValueError(f"sector {sector!r}: must be one of {', '.join(self.sectors)}")
        return found

    def excited(self, fields: Sequence[str]) -> tuple[Block, ...]:
        """Blocks that sources on these fields set in motion.

        Raises:
            ValueError: a field is of another family.
        """
        for name in fields:
            if name not in self.fields:
                raise ValueError(
                    f"field = {name!r}: must be one of {', '.join(self.fields)}, as the medium's "
                    f"family is {self.name}"
                )
        return tuple(block for block in self.blocks if set(block.fields) & set(fields))

    def gap_names(self, sector: str) -> tuple[str, ...]:
        """Names of a sector's gaps; numbered where the family gives them none."""
        blocks = self.blocks_of(sector)
        count = sum(len(block.micro) for block in blocks) if blocks[0].macro else 1
        return self.gaps.get(sector) or tuple(f"{sector} {n + 1}" for n in range(count))

    @property
    def all_gaps(self) -> tuple[str, ...]:
        """Names of all its gaps, each once."""
        return tuple(dict.fromkeys(name for s in self.sectors for name in self.gap_names(s)))

    def first_alike(self, sector: str) -> str:
        """The first of the sectors whose waves are alike, as those are whose gaps share names."""
        names = self.gap_names(sector)
        return next(s for s in self.sectors if self.gap_names(s) == names)

    @property
    def unlike(self) -> tuple[str, ...]:
        """Sectors whose waves differ: the first of those alike."""
        return tuple(dict.fromkeys(map(self.first_alike, self.sectors)))

    def acts(self, drive: str) -> Acts:
        """What a drive does, in whatever words: the family's, or "body", "surface", ….

        Raises:
            ValueError: it is no drive of this family.
        """
        known = self._drives
        if drive not in known:
            raise ValueError(
                f"drive = {drive!r}: must be one of {', '.join(known)} (family {self.name})"
            )
        return known[drive]

    def words_for(self, acts: Sequence[str]) -> tuple[str, ...]:
        """Its words for drives that do one of these."""
        return tuple(word for word, done in self._drives.items() if done in acts)

    @property
    def _drives(self) -> dict[str, Acts]:
        return {"body": "body", **self.drives, "initial": "initial"}


def travelling_block(family: Family, sector: str, kept: bool = False) -> Block:
    """The block in which a sector's waves travel.

    Args:
        family: whose.
        sector: or the name of one of its blocks.
        kept: whether Γ is, which alone carries micro-fields from place to place.

    Raises:
        ValueError: nothing travels in it, several blocks are meant, or it is unknown.
    """
    blocks = [block for block in family.blocks if block.name == sector] or list(
        family.blocks_of(sector)
    )
    if not blocks[0].macro and not kept:
        raise ValueError(
            f"sector {sector!r}: nothing travels in it as Γ → 0; take one of "
            f"{', '.join(family.travelling)}"
        )
    if not blocks[0].macro and len(blocks) > 1:
        raise ValueError(
            f"sector {sector!r}: has {len(blocks)} waves that know nothing of each other; take one "
            f"of {', '.join(block.name for block in blocks)}"
        )
    return blocks[0]


_WORD = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_"
_HALF = 0.5**0.5


def granular_blocks(macro: str, micro: str) -> tuple[Block, ...]:
    """Blocks of three macro- and nine micro-fields about the axis of symmetry x₁.

    Three hold one macro-field and two micro-fields and have three branches each; three hold one
    micro-field alone and have one branch each: twelve waves.

    Args:
        macro, micro: the names of fields without their indices.
    """

    def coupled(sector: str, i: str, micro_parts: tuple[Part, ...], letter: str) -> Block:
        branches = (f"{letter}A", f"{letter}O1", f"{letter}O2")
        return Block(sector, sector, ({f"{macro}{i}": 1.0},), micro_parts, branches)

    def alone(which: str, one: str, other: str, sign: float) -> Block:
        part = {f"{micro}{one}": _HALF, f"{micro}{other}": sign * _HALF}
        return Block(f"inplane{which}", "inplane", (), (part,), (f"TSO{which}",))

    along = ({f"{micro}11": 1.0}, {f"{micro}22": _HALF, f"{micro}33": _HALF})
    return (
        coupled("longitudinal", "1", along, "L"),
        coupled("transverse2", "2", ({f"{micro}21": 1.0}, {f"{micro}12": 1.0}), "T"),
        coupled("transverse3", "3", ({f"{micro}31": 1.0}, {f"{micro}13": 1.0}), "T"),
        alone("[23]", "23", "32", -1),
        alone("(23)", "23", "32", 1),
        alone("(22-33)", "22", "33", -1),
    )


# Sectors about an axis of symmetry, in words.
_SECTORS = {
    "transverse2": "transverse x₂",
    "transverse3": "transverse x₃",
    "inplane": "in-plane",
}


def sector_words(sector: str, *alike: str) -> str:
    """A sector in words, its family first where that is named; of several, what they share."""
    family, dash, own = sector.rpartition("-")
    words = _SECTORS.get(own, own)
    return family + (" " if dash else "") + (words.partition(" x")[0] if alike else words)


_QUANTITIES: dict[str, Quantity] = {}


def register(family: Family) -> None:
    """Make a family's fields known by name.

    Raises:
        ValueError: another family has a field of that name.
    """
    for name, one in family.quantities.items():
        known = _QUANTITIES.get(name)
        if known is not None and known.family.name != family.name:
            raise ValueError(f"field {name!r}: is one of family {known.family.name!r} already")
        _QUANTITIES[name] = one


def known_field(name: str) -> Quantity:
    """What is known of a field by its name.

    Raises:
        ValueError: no family has such a field.
    """
    if name not in _QUANTITIES:
        raise ValueError(f"field = {name!r}: must be one of {', '.join(_QUANTITIES)}")
    return _QUANTITIES[name]


def is_macro(name: str) -> bool:
    """Whether a field is a macro-field, and lives on the nodes."""
    return known_field(name).macro


def known_fields() -> tuple[str, ...]:
    """Names of the fields of all families."""
    return tuple(_QUANTITIES)


def grouped(blocks: Sequence[Block]) -> list[tuple[Block, ...]]:
    """Blocks of one family that lie side by side and have as many fields of each kind, together."""

    def kind(block: Block) -> tuple[str, int, int]:
        family = known_field(block.fields[0]).family
        return family.name, len(block.macro), len(block.micro)

    groups = itertools.groupby(blocks, key=kind)
    return [tuple(members) for _, members in groups]
