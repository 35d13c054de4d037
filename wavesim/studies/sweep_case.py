"""The case of a sweep: its members as cases of their own, and what keys do to its media."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from wavesim.case.layered_case import bar_layers
from wavesim.case.schema import CaseError, CaseFile, parse, read, source_of
from wavesim.material.medium import Medium
from wavesim.material.parameter import PARAMETERS
from wavesim.planewave.many_media import growing
from wavesim.studies.variation import SweepError, Variation

Made = TypeVar("Made")
Make = Callable[[CaseFile, str], Made]
# Members that are tried for one that can be made at all.
_TRIED = 64


@dataclass(frozen=True)
class SweptCase:
    """A case file and what varies in it.

    Attributes:
        name: of the file, for messages.
        text: of it.
        folder: that its recorded signals are taken from.
        overrides: laid over every member.
        varied: the members.
    """

    name: str
    text: str
    folder: str
    overrides: tuple[str, ...]
    varied: Variation

    def file(self, values: Sequence[float]) -> CaseFile:
        """Tables of one member.

        Raises:
            CaseError: they can't be used.
        """
        own = [*self.overrides, *self.varied.overrides(values)]
        return parse(self.text, self.name, own, self.folder)

    def anchor(self, make: Make[Made]) -> tuple[list[float], Made]:
        """Values of a member that can be made, and what it is made into.

        Args:
            make: what makes it, of its tables and the name of the file.

        Raises:
            SweepError: none of those tried can be; it says why the first can't.
        """
        count = self.varied.count
        tried = sorted({count * n // _TRIED for n in range(_TRIED)} | {count - 1})
        first: CaseError | None = None
        for values in self.varied.values[tried].tolist():
            try:
                return values, make(self.file(values), self.name)
            except CaseError as error:
                first = first or error
        raise SweepError(_varied(str(first), self.varied.keys))

    def other(
        self, make: Make[Made], anchor: list[float], number: int
    ) -> tuple[float, Made] | None:
        """What a member is made into that differs from another in one key alone, and its value.

        Args:
            make: what makes it.
            anchor: values of the other member.
            number: of the key.

        Returns:
            None of a key that has one value only.

        Raises:
            SweepError: none can be made.
        """
        axis, first = self.varied.axes[number], None
        if axis.low == axis.high:
            return None
        for share in (1.0, 0.0, *(n / 16 for n in range(1, 16))):
            value = axis.low + share * (axis.high - axis.low)
            if value == anchor[number]:
                continue
            try:
                made = make(self.file([*anchor[:number], value, *anchor[number + 1 :]]), self.name)
            except CaseError as error:
                first = first or error
                continue
            return value, made
        raise SweepError(_varied(str(first), [axis.key]))


def swept_case(path: str | Path, varied: Variation, overrides: Sequence[str] = ()) -> SweptCase:
    """The case of a sweep.

    Args:
        path: of the case file.
        varied: what varies.
        overrides: "table.key=value", laid over every member.

    Raises:
        CaseError: the file can't be used as it is.
    """
    read(path, overrides)
    file, text = source_of(path)
    return SweptCase(str(path), text, str(file.parent), tuple(overrides), varied)


def _varied(message: str, keys: Sequence[str]) -> str:
    """A message about --set or a key, as one about --vary."""
    if "--set " in message:
        return message.replace("--set ", "--vary ")
    return f"--vary {', '.join(keys)}: {message}"


def check_matters(key: str, matters: bool, measure: str, looked_at: str) -> None:
    """Refuse a key that changes nothing.

    Raises:
        SweepError: it does not matter.
    """
    if not matters:
        raise SweepError(
            f"--vary {key}: does not matter to --measure {measure}, which looks at {looked_at} "
            "alone; leave it out, or take another measure"
        )


@dataclass(frozen=True)
class SweptMedia:
    """Media of a case that vary by keys.

    Attributes:
        media: each once: of [medium], or of the layers, both of a graded one.
        names: of them, by the tables they stand in.
        taken: {(medium, parameter): number of the key it is the value of}.
    """

    media: tuple[Medium, ...]
    names: tuple[str, ...]
    taken: dict[tuple[int, str], int]

    def families(self, values: NDArray[np.float64]) -> tuple[list[Medium], list[str]]:
        """Each medium in all members, and why a member can't be.

        Args:
            values: shape (members, keys).

        Returns:
            Media whose parameters are numbers or arrays of shape (members,), one at least an
            array; of a member that can't be they are those of another. A message for each member,
            "" where it can be.
        """
        messages = [""] * len(values)
        found = []
        for number, medium in enumerate(self.media):
            own = {p: values[:, key] for (m, p), key in self.taken.items() if m == number}
            found.append(_family(medium, own, messages, self._where(number)))
            for member in np.flatnonzero(growing(found[-1], len(values))):
                self.tell_growing(messages, number, found[-1], int(member))
        return found, messages

    def tell_growing(self, messages: list[str], number: int, family: Medium, member: int) -> None:
        """Note of a member that waves of a medium grow, if nothing is noted yet."""
        one: dict[str, Any] = {
            name: float(value[member])
            for name in family.known()
            if np.ndim(value := getattr(family, name))
        }
        told = dataclasses.replace(family, **one).settings
        messages[member] = messages[member] or (
            f"{self._where(number)}{told}: waves of closure {family.closure!r} are unstable, they "
            "grow without bound; bring anisotropy nearer to 0, where no closure is, or take "
            "closure 'consistent'"
        )

    def _where(self, number: int) -> str:
        return f"{self.names[number]}: " if len(self.names) > 1 else ""


def _family(medium: Medium, own: dict[str, Any], messages: list[str], where: str) -> Medium:
    """A medium in all members; what is out of its range is noted, and another value taken."""
    own = dict(own)
    for parameter, values in own.items():
        known = medium.known()[parameter]
        bad = ~((values > known.low) & (values <= known.high))
        if not known.open:
            bad &= values != known.low
        for member in np.flatnonzero(bad):
            try:
                PARAMETERS[parameter].check(parameter, float(values[member]))
            except ValueError as error:
                messages[member] = messages[member] or f"{where}{error}"
        stand_in = float(values[~bad][0]) if not bad.all() else float(getattr(medium, parameter))
        own[parameter] = np.where(bad, stand_in, values)
    if not own:
        name = next(iter(medium.known()))
        own = {name: np.full(len(messages), float(getattr(medium, name)))}
    return dataclasses.replace(medium, **own)


def swept_media(swept: SweptCase) -> tuple[SweptMedia, list[bool]]:
    """The media of a sweep, and whether each key matters to any.

    Raises:
        SweepError: no member can be made.
    """
    anchor, first = swept.anchor(_media)
    taken: dict[tuple[int, str], int] = {}
    made, matters = [], []
    for number in range(len(swept.varied.axes)):
        other = swept.other(_media, anchor, number)
        if other is None:
            matters.append(True)
            continue
        value, media = other
        made.append(media)
        own = {
            (m, p): number
            for m, (one, two) in enumerate(zip(first, media, strict=True))
            for p in one[1].known()
            if getattr(two[1], p) != getattr(one[1], p) and getattr(two[1], p) == value
        }
        matters.append(bool(own))
        taken |= own
    # Layers of one medium, whatever the keys, are one.
    kept: dict[Any, int] = {}
    for m, (_, medium) in enumerate(first):
        kept.setdefault((medium, *(media[m][1] for media in made)), m)
    place = {m: n for n, m in enumerate(kept.values())}
    found = SweptMedia(
        tuple(first[m][1] for m in place),
        tuple(first[m][0] for m in place),
        {(place[m], p): key for (m, p), key in taken.items() if m in place},
    )
    return found, matters


def _media(file: CaseFile, name: str) -> Sequence[tuple[str, Medium]]:
    """The media of a case by the tables they stand in."""
    bar = bar_layers(file, name)
    if not bar.stretches:
        return [("medium", bar.medium)]
    found: list[tuple[str, Medium]] = []
    for place, layer in zip(bar.places, bar.stretches, strict=True):
        table = ".".join(place.where)
        found += zip((table, f"{table}, to"), layer.ends, strict=False)
    return found
