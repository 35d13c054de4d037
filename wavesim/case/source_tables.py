"""[[sources]] of a case file: a table for each kind, of its data class, and the sources made."""

from __future__ import annotations

import dataclasses
import functools
import operator
from pathlib import Path
from typing import Annotated, Any, Literal, cast, get_type_hints

from pydantic import (
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from wavesim.case.table import Finite, NotNegative, Positive, Table
from wavesim.material.family import known_field, known_fields
from wavesim.sources import (
    Chirp,
    GaussianDerivative,
    InitialField,
    Recorded,
    Ricker,
    Source,
    ToneBurst,
    parameters,
    read_csv,
)
from wavesim.sources.admissible import END_ACTS, SIGNAL_ACTS

Side = Literal["left", "right"]
# Keys of kinds whose numbers are above 0.
_POSITIVE = dict.fromkeys(("peak_frequency", "frequency", "low", "high", "duration"), Positive)
_KINDS: dict[str, type[Source]] = {
    made.kind: made
    for made in (Ricker, GaussianDerivative, ToneBurst, Chirp, Recorded, InitialField)
}


class _SourceTable(Table):
    """What every source has."""

    field: str

    def build(self, length: float) -> Source:
        """The source, on a bar of a length, m."""
        given = self.model_dump(exclude={"file"})
        end = given.pop("end", None)
        if end is not None:
            given["position"] = 0.0 if end == "left" else length
        return _KINDS[given.pop("kind")](**given)

    def resolved(self, source: Source) -> dict[str, Any]:
        """This table with every default filled in and a file's samples inlined."""
        settled, given = parameters(source), self.model_dump()
        placed = [key for key in ("position", "width") if given.get(key) is not None]
        given |= {key: settled[key] for key in ("delay", "start", *placed) if key in settled}
        return {key: value for key, value in given.items() if value is not None}

    @field_validator("field")
    @classmethod
    def _known(cls, value: str) -> str:
        if value not in known_fields():
            raise ValueError(f"must be one of {', '.join(known_fields())}")
        return value


class _SignalTable(_SourceTable):
    """What every source with a signal has."""

    position: NotNegative | None = None
    end: Side | None = None
    drive: str = "body"
    amplitude: Finite = 1.0
    width: NotNegative = 0.0

    @model_validator(mode="after")
    def _placed(self) -> _SignalTable:
        family = known_field(self.field).family
        words = family.words_for(SIGNAL_ACTS)
        if self.drive not in words:
            *first, last = (f'"{word}"' for word in words)
            allowed = f"{', '.join(first)} or {last}"
            raise ValueError(f'drive = "{self.drive}": must be {allowed} on {self.field}')
        if family.acts(self.drive) == "body":
            if self.end is not None:
                ends = " or ".join(f'"{word}"' for word in family.words_for(END_ACTS))
                raise ValueError(
                    f'end = "{self.end}": is for drive = {ends}; give position (m), or a drive'
                )
            if self.position is None:
                raise ValueError("position: required, but not given; add it")
            return self
        if self.position is not None:
            raise ValueError(
                f'position = {self.position:g}: drive = "{self.drive}" acts at an end; give end = '
                '"left" or "right" in its place'
            )
        if self.end is None:
            raise ValueError(
                f'end: required with drive = "{self.drive}", but not given; add "left" or "right"'
            )
        return self


class RecordedTable(_SignalTable):
    """See :class:`wavesim.sources.Recorded`; a file's samples stand in its place."""

    kind: Literal["recorded"]
    file: str | None = None
    times: list[float] = Field(default_factory=list)
    values: list[float] = Field(default_factory=list)
    start: Finite | None = None

    @model_validator(mode="before")
    @classmethod
    def _read(cls, given: Any, info: ValidationInfo) -> Any:
        if not isinstance(given, dict):
            return given
        if "file" not in given:
            return given
        inline = [name for name in ("times", "values") if name in given]
        rest = {key: value for key, value in given.items() if key != "file"}
        file = given["file"]
        if inline:
            raise ValueError(
                f'file = "{file}": {inline[0]} is given too; give file, or times and values'
            )
        if not isinstance(file, str):
            raise ValueError(f"file = {file}: must be text in quotes, the path of a CSV file")
        folder = (info.context or {}).get("folder", Path())
        try:
            times, values = read_csv(folder / file)
        except ValueError as error:
            raise ValueError(f'file = "{file}": {error}') from None
        return rest | {"times": times, "values": values}

    @model_validator(mode="after")
    def _sampled(self) -> RecordedTable:
        if not (self.times or self.values):
            raise ValueError(
                "file: required, but not given; add the path of a CSV file of two columns, t in s "
                "and value"
            )
        return self


def _table_of(made: type[Source], base: type[_SourceTable]) -> Any:
    """The table of a kind: what its base has, and what else the data class takes, by name."""
    hints, keys = get_type_hints(made), dict[str, Any]()
    for one in dataclasses.fields(cast(Any, made)):
        if one.name in base.model_fields or one.name == "drive":
            continue
        kind = _POSITIVE.get(one.name) or {float: Finite}.get(hints[one.name], hints[one.name])
        keys[one.name] = kind, ... if one.default is dataclasses.MISSING else one.default
    default = made.kind if made is Ricker else ...
    keys["kind"] = Literal[made.kind], default
    return create_model(f"{made.__name__}Table", __base__=base, **keys)


_TABLES: dict[str, Any] = {
    kind: RecordedTable
    if made is Recorded
    else _table_of(made, _SourceTable if made is InitialField else _SignalTable)
    for kind, made in _KINDS.items()
}


def _kind(given: Any) -> str:
    """Which table a source is held to; what is no kind is told as such."""
    if isinstance(given, Table):  # as when it is written
        return str(getattr(given, "kind", ""))
    kind = given.get("kind", "ricker") if isinstance(given, dict) else "ricker"
    return kind if isinstance(kind, str) else ""


SourceTable: Any = Annotated[
    functools.reduce(operator.or_, (Annotated[one, Tag(kind)] for kind, one in _TABLES.items())),
    Discriminator(_kind),
]
