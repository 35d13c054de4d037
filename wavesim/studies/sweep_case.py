"""The case of a sweep: its members as cases of their own, and how its media depend on the keys."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from wavesim.case.schema import CaseError, CaseFile, parse, read, source_of
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
