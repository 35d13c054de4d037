"""The case file: schema, validation and defaults. SI units; no jax.

A case is TOML. Unknown keys are errors, every key has a default except where the schema says
otherwise, and whatever is wrong is said in one message that names file, key, value and remedy.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from wavesim.bar import Bar
from wavesim.equations import FIELDS
from wavesim.medium import PARAMETERS, Closure, Medium, check_parameter
from wavesim.source import Ricker
from wavesim.stencils import ORDERS

End = Literal["periodic"]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class CaseError(ValueError):
    """A case can't be used; the message names file, key, value and remedy."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class MediumTable(_Table):
    """[medium]: the parameters of Table 1; see :class:`wavesim.medium.Medium`."""

    closure: Closure = "printed"
    anisotropy: float = 0.0
    stiffness_ratio: float = 0.5
    branch_length: float = 1e-3
    particle_radius: float = 5e-4
    contact_density: float = 1e9
    density: float = 1570.0
    G_n_a: float = 5.0
    G_n_r: float = 5.0
    G_n_g: float = 1.25e-11
    rotation_inertia: float | None = None
    curvature_inertia: float | None = None

    @field_validator(*PARAMETERS)
    @classmethod
    def _admissible(cls, value: float | None, info: Any) -> float | None:
        if value is not None:
            try:
                check_parameter(info.field_name, value)
            except ValueError as error:
                raise ValueError(str(error).split(": ", 1)[1]) from None
        return value

    def build(self) -> Medium:
        """The medium."""
        return Medium(**self.model_dump())


class BarTable(_Table):
    """[bar]: length (m) or cells is required; spacing (m) is an eighth of the branch length."""

    length: Positive | None = None
    cells: Annotated[int, Field(gt=0)] | None = None
    spacing: Positive | None = None
    order: int = 8
    left: End = "periodic"
    right: End = "periodic"

    @field_validator("order")
    @classmethod
    def _offered(cls, value: int) -> int:
        if value not in ORDERS:
            raise ValueError(f"must be one of {', '.join(map(str, ORDERS))}")
        return value

    @model_validator(mode="after")
    def _one_size(self) -> BarTable:
        if (self.length is None) == (self.cells is None):
            raise ValueError("give either length (m) or cells, one of the two")
        return self

    def build(self, medium: Medium) -> Bar:
        """The bar, for a medium that gives the default spacing."""
        spacing = self.spacing or medium.branch_length / 8
        if self.cells is not None:
            return Bar(self.cells, spacing, self.order)
        assert self.length is not None
        cells = round(self.length / spacing)
        if abs(self.length / spacing - cells) > 1e-6:
            raise ValueError(
                f"length = {self.length:g}: must be a whole number of cells of spacing = "
                f"{spacing:g} m; the nearest is {cells * spacing:g}"
            )
        return Bar(cells, spacing, self.order)


class SourceTable(_Table):
    """[[sources]]: see :class:`wavesim.source.Ricker`."""

    kind: Literal["ricker"] = "ricker"
    field: str
    position: NotNegative
    peak_frequency: Positive
    amplitude: Annotated[float, Field(allow_inf_nan=False)] = 1.0
    width: NotNegative = 0.0
    delay: Annotated[float, Field(allow_inf_nan=False)] | None = None

    @field_validator("field")
    @classmethod
    def _known(cls, value: str) -> str:
        if value not in FIELDS:
            raise ValueError(f"must be one of {', '.join(FIELDS)}")
        return value

    def build(self) -> Ricker:
        """The source."""
        return Ricker(**self.model_dump(exclude={"kind"}))


class ReceiverTable(_Table):
    """[[receivers]]: a name and a position (m)."""

    name: Annotated[str, Field(min_length=1, pattern=r"^[^/.]+$")]
    position: NotNegative


class TimeTable(_Table):
    """[time]: duration (s) is required."""

    duration: Positive
    solver: Literal["auto", "chebyshev", "verlet"] = "auto"
    step: Positive | Literal["auto"] = "auto"
    samples: Annotated[int, Field(ge=2)] | Literal["auto"] = "auto"


class AnalysisTable(_Table):
    """[analysis]: what is read from the field.

    k_min, k_max (rad/m) bound the branches that are judged, k̄ = 0.02 and 0.5 by default;
    frequencies is the number of frequencies of the attenuation curve; damping is σT of its
    exponential window.
    """

    k_min: Positive | None = None
    k_max: Positive | None = None
    frequencies: Annotated[int, Field(ge=8, le=4096)] = 120
    damping: Annotated[float, Field(ge=4, le=30)] = 18.0

    @model_validator(mode="after")
    def _ordered(self) -> AnalysisTable:
        if self.k_min is not None and self.k_max is not None and self.k_min >= self.k_max:
            raise ValueError(f"k_min = {self.k_min:g}: must be below k_max = {self.k_max:g}")
        return self


class Case(_Table):
    """A whole case file."""

    title: str = ""
    medium: MediumTable = MediumTable()
    bar: BarTable
    sources: Annotated[list[SourceTable], Field(min_length=1)]
    receivers: list[ReceiverTable] = []
    time: TimeTable
    analysis: AnalysisTable = AnalysisTable()

    @field_validator("receivers")
    @classmethod
    def _distinct(cls, value: list[ReceiverTable]) -> list[ReceiverTable]:
        names = [receiver.name for receiver in value]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"name = {twice[0]!r} is given twice; each receiver needs its own")
        return value


def read(path: str | Path, overrides: Sequence[str] = ()) -> Case:
    """Read a case file and lay overrides over it.

    Args:
        path: of the TOML file.
        overrides: "table.key=value", value in TOML; "sources.0.position=0.1" for a table of
            an array.

    Returns:
        The case, validated table by table.

    Raises:
        CaseError: anything that can't be used.
    """
    name = str(path)
    try:
        text = Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise CaseError(f"{name}: no such file; name a case file, such as one in cases/") from None
    except (OSError, UnicodeDecodeError) as error:
        raise CaseError(f"{name}: can't be read: {error}") from None
    return parse(text, name, overrides)


def parse(text: str, name: str, overrides: Sequence[str] = ()) -> Case:
    """As :func:`read`, from the text of a case file."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise CaseError(f"{name}: not valid TOML: {error}") from None
    for override in overrides:
        _override(tables, override)
    try:
        return Case.model_validate(tables)
    except ValidationError as error:
        raise CaseError(f"{name}: {_sentence(_first(error))}") from None


def _override(tables: dict[str, Any], override: str) -> None:
    key, equals, value = override.partition("=")
    parts = key.strip().split(".")
    if not equals or not all(parts):
        raise CaseError(f"--set {override}: must be table.key=value, such as bar.order=10")
    try:
        parsed = tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        parsed = value.strip()
    table: Any = tables
    for depth, part in enumerate(parts):
        last = depth == len(parts) - 1
        if isinstance(table, list):
            if not part.isdigit() or int(part) >= len(table):
                raise CaseError(
                    f"--set {override}: {'.'.join(parts[:depth])} has entries 0 to "
                    f"{len(table) - 1}, not {part!r}"
                )
            if last:
                table[int(part)] = parsed
            else:
                table = table[int(part)]
        elif isinstance(table, dict):
            if last:
                table[part] = parsed
            else:
                table = table.setdefault(part, {})
        else:
            raise CaseError(f"--set {override}: {'.'.join(parts[:depth])} has no keys")


def _first(error: ValidationError) -> Any:
    """The error to tell: an unknown key first, as it is often why another one is missing."""
    errors = error.errors()
    return next((e for e in errors if e["type"] == "extra_forbidden"), errors[0])


def place(parts: Sequence[Any]) -> str:
    """[medium] or [[sources]] number 1, from a path through the tables."""
    table, *rest = (str(part) for part in parts)
    if table in ("sources", "receivers") and rest and rest[0].isdigit():
        return f"[[{table}]] number {int(rest[0]) + 1}:"
    return f"[{table}]"


_PLAIN = {
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "string_type": "must be text in quotes",
    "list_type": "must be an array of tables, [[…]]",
    "finite_number": "must be finite",
    "too_short": "needs at least one entry",
}


def _sentence(error: Any) -> str:
    """One validation error in words: key, value, and what is allowed."""
    parts = [part for part in error["loc"] if not _is_member(part)]
    kind, value = error["type"], error["input"]
    top = len(parts) == 1 and parts[0] not in Case.model_fields
    key = str(parts[-1])
    where = "" if top or len(parts) < 2 else place(parts[:-1]) + " "
    if kind == "extra_forbidden":
        allowed = _allowed(parts[:-1])
        near = difflib.get_close_matches(key, allowed, 1)
        hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(allowed)}"
        return f"{where}{key} = {_short(value)}: unknown key; {hint}"
    if kind == "missing":
        return f"{where}{key}: required, but not given"
    if kind == "value_error" and isinstance(value, dict):
        return f"{place(parts)} {error['ctx']['error']}"
    if kind == "value_error":
        text = str(error["ctx"]["error"])
    elif kind == "literal_error":
        text = f"must be {error['ctx']['expected']}"
        if parts[-1] in ("step", "samples"):
            text = "must be a number greater than 0, or 'auto'"
    elif kind == "model_type":
        return f"{key} = {_short(value)}: must be a table, [{key}]"
    elif kind in ("greater_than", "greater_than_equal", "less_than_equal"):
        text = error["msg"].replace("Input should be", "must be")
    else:
        text = _PLAIN.get(kind, error["msg"])
    return f"{where}{key} = {_short(value)}: {text}"


def _is_member(part: Any) -> bool:
    """Whether a part of a location names a member of a union rather than a key."""
    return isinstance(part, str) and ("[" in part or part.startswith("constrained-"))


def _allowed(parts: Sequence[Any]) -> list[str]:
    model: Any = Case
    tables = {
        "medium": MediumTable,
        "bar": BarTable,
        "sources": SourceTable,
        "receivers": ReceiverTable,
        "time": TimeTable,
        "analysis": AnalysisTable,
    }
    if parts:
        model = tables[str(parts[0])]
    return list(model.model_fields)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…"
