"""What all kinds of sources have in common, held to what is admissible."""

from __future__ import annotations

import math
import numbers
from typing import TYPE_CHECKING, Any

from wavesim.material.family import known_field

if TYPE_CHECKING:
    from wavesim.sources.source import Source

# What acts by a signal, and what of that acts at an end.
SIGNAL_ACTS: tuple[str, ...] = ("body", "surface", "prescribed")
END_ACTS: tuple[str, ...] = ("surface", "prescribed")

# Of what drives, in size.
LARGEST = 1e100


def check_place(source: Source, acts: tuple[str, ...] = SIGNAL_ACTS) -> None:
    """Hold what all kinds have in common to what is admissible.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """
    family = known_field(source.field).family
    for name, unit in (("position", "m"), ("width", "m"), ("amplitude", "")):
        value: Any = getattr(source, name)
        if not isinstance(value, numbers.Real) or not math.isfinite(value):
            raise ValueError(f"{name} = {value!r}{f' {unit}' if unit else ''}: must be a number")
    if source.position < 0:
        raise ValueError(f"position = {source.position:g} m: must be 0 or greater; x begins at 0")
    if source.amplitude == 0:
        raise ValueError("amplitude = 0: must not be 0, or nothing moves")
    check_size("amplitude", abs(source.amplitude))
    if float(source.width) < 0:
        raise ValueError(f"width = {source.width:g} m: must be 0 (a point) or greater")
    if source.drive not in (allowed := family.words_for(acts)):
        raise ValueError(
            f"drive = {source.drive!r}: must be one of {', '.join(allowed)} on {source.field}"
        )
    if source.acts in END_ACTS:
        if source.staggered:
            raise ValueError(
                f'field = "{source.field}": a drive {source.drive!r} acts on a {family.words[0]} '
                f"at an end; take one of {', '.join(family.macro)}"
            )
        if source.width != 0:
            raise ValueError(
                f"width = {source.width:g} m: must be 0 for drive {source.drive!r}, which acts at "
                "an end; leave it out"
            )


def check_size(name: str, size: float) -> None:
    """Hold what drives to numbers whose squares, the energy, are numbers too.

    Raises:
        ValueError: they are not.
    """
    if not 1 / LARGEST <= size <= LARGEST:
        raise ValueError(
            f"{name} = {size:g} in size: must be {1 / LARGEST:g} to {LARGEST:g}, as energy goes by "
            "its square; give 1 and scale the fields, which go by it"
        )


def check_positive(source: Source, *units: tuple[str, str]) -> None:
    """Hold parameters to what is finite and greater than 0.

    Args:
        source: of any kind.
        units: the parameters' names, each with its unit.

    Raises:
        ValueError: one is not; the message names it.
    """
    for name, unit in units:
        value: Any = getattr(source, name)
        if not isinstance(value, numbers.Real):
            raise ValueError(f"{name} = {value!r}: must be a number in {unit}")
        if not (float(value) > 0 and math.isfinite(value)):
            raise ValueError(f"{name} = {value:g} {unit}: must be > 0")


def check_start(start: float) -> None:
    """Hold the time at which a source begins to 0 or later.

    Raises:
        ValueError: it is earlier, or not finite.
    """
    if not (start >= 0 and math.isfinite(start)):
        raise ValueError(f"start = {start:g} s: must be 0 or greater")
