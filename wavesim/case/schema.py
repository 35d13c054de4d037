"""The case file: schema, validation and defaults. SI units; no jax.

A case is TOML. Unknown keys are errors, every key has a default except where the schema says
otherwise, and whatever is wrong is said in one message that names file, key, value and remedy.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from wavesim.case.medium_tables import LayerTable, MediumTable, learn
from wavesim.case.messages import sentence
from wavesim.case.shipped import found, like
from wavesim.case.source_tables import SourceTable
from wavesim.case.table import Finite, Name, NotNegative, Positive, Table, Text
from wavesim.case.toml_text import CaseError as CaseError
from wavesim.case.toml_text import toml_tables
from wavesim.grid.bar import MOST_CELLS, Bar
from wavesim.grid.stencils import ORDERS
from wavesim.material.arguments import FREQUENCIES, WINDOW
from wavesim.material.medium import Medium
from wavesim.sources.signal_file import text_of


class BandTable(Table):
    """[[analysis.bands]]: sector; from, to (Hz); at_most, at_least (dB of |T|), either or both."""

    sector: Text = "longitudinal"
    low: Annotated[Positive, Field(alias="from")]
    high: Annotated[Positive, Field(alias="to")]
    at_most: Finite | None = None
    at_least: Finite | None = None

    @model_validator(mode="after")
    def _holds(self) -> BandTable:
        if self.high <= self.low:
            raise ValueError(
                f"to = {self.high:g}: must be greater than from = {self.low:g}; a band has a width"
            )
        if self.at_most is not None and self.at_least is not None and self.at_most < self.at_least:
            raise ValueError(
                f"at_most = {self.at_most:g}: is below at_least = {self.at_least:g} of the same "
                "band; nothing can be both"
            )
        return self

    @property
    def told(self) -> str:
        """As "longitudinal T from 600 to 700 kHz"."""
        return f"{self.sector} T from {self.low / 1e3:.6g} to {self.high / 1e3:.6g} kHz"


def distinct(bands: Sequence[BandTable]) -> tuple[BandTable, ...]:
    """Bands without weights, each once."""
    plain = [
        BandTable.model_validate(b.model_dump(by_alias=True, exclude={"weight"})) for b in bands
    ]
    return tuple(band for n, band in enumerate(plain) if band not in plain[:n])


class WishTable(BandTable):
    """[[design.bands]]: a band with one limit at least, and its weight against others."""

    weight: Positive = 1.0

    @model_validator(mode="after")
    def _asks(self) -> WishTable:
        if self.at_most is None and self.at_least is None:
            raise ValueError(
                "at_most, at_least: neither is given; say how much is to pass, in dB, such as "
                "at_most = -40"
            )
        return self


class VariableTable(Table):
    """[[design.variables]]: key, as of --set, with * for any number; from, to in its unit."""

    key: Text
    low: Annotated[Finite, Field(alias="from")]
    high: Annotated[Finite, Field(alias="to")]

    @model_validator(mode="after")
    def _has_range(self) -> VariableTable:
        if self.high <= self.low:
            raise ValueError(
                f"to = {self.high:g}: must be greater than from = {self.low:g}, or nothing varies"
            )
        return self


class DesignTable(Table):
    """[design]: limits and tolerance of a design, with its bands and variables.

    length_at_most (m) is of all that stands between the half-spaces, thickness_at_least (m) of each
    layer there; tolerance is relative, of each variable as it is made.
    """

    bands: list[WishTable] = Field(default_factory=list)
    variables: list[VariableTable] = Field(default_factory=list)
    length_at_most: Positive | None = None
    thickness_at_least: Positive | None = None
    tolerance: Annotated[float, Field(ge=0, lt=1, allow_inf_nan=False)] = 0.01


HALF_SPACE = "half-space"
CaseEnd = Literal["half-space", "periodic", "fixed", "free", "absorbing"]


class BarTable(Table):
    """[bar]: length (m) or cells, which layers give where there are any; spacing (m).

    spacing is an eighth of the branch length, less in layers too thin for that. absorber is the
    length (m) of the absorbing layer at each absorbing end, inside the bar; None stands for 8
    branch lengths. An end that is a half-space stands for [medium] going on for ever.
    """

    length: Positive | None = None
    cells: Annotated[int, Field(gt=0)] | None = None
    spacing: Positive | None = None
    order: int = 8
    left: CaseEnd = "periodic"
    right: CaseEnd = "periodic"
    absorber: Positive | None = None

    @field_validator("order")
    @classmethod
    def _offered(cls, value: int) -> int:
        if value not in ORDERS:
            raise ValueError(f"must be one of {', '.join(map(str, ORDERS))}")
        return value

    @model_validator(mode="after")
    def _ends_match(self) -> BarTable:
        ends = {"left": self.left, "right": self.right}
        if (self.left == "periodic") != (self.right == "periodic"):
            side, other = ("right", "left") if self.left == "periodic" else ("left", "right")
            raise ValueError(
                f'{side} = "{ends[side]}": {other} is "periodic", and a bar is periodic at both '
                f"ends or at neither; give {other} too"
            )
        if self.absorber is not None and not {"absorbing", HALF_SPACE} & set(ends.values()):
            raise ValueError(
                f'absorber = {self.absorber:g}: neither end is "absorbing"; set left or right to '
                "it, or leave absorber out"
            )
        return self

    def build(self, medium: Medium) -> Bar:
        """The bar of no layers, for a medium that gives the default spacing."""
        if (self.length is None) == (self.cells is None):
            both = "both are given" if self.cells is not None else "neither is given"
            raise ValueError(f"length, cells: {both}; give length (m) or cells, one of the two")
        spacing = self.spacing or float(medium.length_scale) / 8
        if self.cells is not None:
            return Bar(self.cells, spacing, self.order)
        assert self.length is not None
        cells = self.length / spacing
        if cells > MOST_CELLS:
            raise ValueError(
                f"length = {self.length:g}: {cells:.3g} cells of spacing = {spacing:g} m, more "
                f"than {MOST_CELLS:.0e}; take at most {MOST_CELLS * spacing:.3g} m, or a coarser "
                "spacing"
            )
        return Bar(round(cells), spacing, self.order)

    def rounded(self, bar: Bar) -> str:
        """What is to be said where the length given is no whole number of cells; "" where it is."""
        if self.length is None or abs(self.length - bar.length) <= 1e-6 * bar.spacing:
            return ""
        return (
            f"[bar] length = {self.length:g}: no whole number of cells of spacing = "
            f"{bar.spacing:g} m; rounded to {bar.cells} cells, {bar.length:g} m"
        )


class ReceiverTable(Table):
    """[[receivers]]: a name and a position (m)."""

    name: Name
    position: NotNegative


class TimeTable(Table):
    """[time]: duration (s) is required."""

    duration: Positive
    solver: str = "auto"
    step: Positive | Literal["auto"] = "auto"
    samples: Annotated[int, Field(ge=2)] | Literal["auto"] = "auto"


class AnalysisTable(Table):
    """[analysis]: what is read from the field.

    k_min, k_max (rad/m) bound the branches that are judged, k̄ = 0.02 and 0.5 by default;
    frequencies is the number of frequencies of the attenuation curve; damping is σT of its
    exponential window. bands are those in which the transmission of layers is judged.
    """

    k_min: Positive | None = None
    k_max: Positive | None = None
    frequencies: Annotated[int, Field(ge=FREQUENCIES[0], le=FREQUENCIES[1])] = 120
    damping: Annotated[float, Field(ge=WINDOW[0], le=WINDOW[1], allow_inf_nan=False)] = 18.0
    bands: list[BandTable] = Field(default_factory=list)

    @model_validator(mode="after")
    def _ordered(self) -> AnalysisTable:
        if self.k_min is not None and self.k_max is not None and self.k_min >= self.k_max:
            raise ValueError(f"k_min = {self.k_min:g}: must be below k_max = {self.k_max:g}")
        return self


class CaseFile(Table):
    """A whole case file; what only a simulation needs of it may be missing."""

    title: Text = ""
    medium: MediumTable = Field(default_factory=MediumTable)
    bar: BarTable = BarTable()
    layers: list[LayerTable] = Field(default_factory=list)
    sources: Annotated[list[SourceTable], Field(min_length=1)] = []  # noqa: RUF012
    receivers: list[ReceiverTable] = Field(default_factory=list)
    time: TimeTable = TimeTable.model_construct()
    analysis: AnalysisTable = AnalysisTable()
    design: DesignTable = DesignTable()

    @field_validator("receivers")
    @classmethod
    def _distinct(cls, value: list[ReceiverTable]) -> list[ReceiverTable]:
        names = [receiver.name for receiver in value]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f'name = "{twice[0]}" is given twice; each receiver needs its own')
        return value

    @property
    def missing(self) -> tuple[str, ...]:
        """Headings of the tables that a simulation needs and this lacks."""
        needed = {"bar": "[bar]", "sources": "[[sources]]", "time": "[time]"}
        return tuple(needed[name] for name in needed if name not in self.model_fields_set)


def learned() -> type[CaseFile]:
    """The schema, with the keys of all families that there are by now."""
    if learn():
        CaseFile.model_rebuild(force=True)
    return CaseFile


def read(path: str | Path, overrides: Sequence[str] = ()) -> CaseFile:
    """Read a case file and lay overrides over it.

    Args:
        path: of the TOML file, or the name of a shipped case.
        overrides: "table.key=value", value in TOML; "sources.0.position=0.1" for a table of
            an array.

    Returns:
        Its tables, validated table by table.

    Raises:
        CaseError: anything that can't be used.
    """
    name = str(path)
    file, text = source_of(path)
    return parse(text, name, overrides, file.parent)


def tables_of(path: str | Path, overrides: Sequence[str] = ()) -> tuple[dict[str, Any], Path]:
    """The tables of a case file as they are written, overrides laid over them, and its folder.

    Arguments and errors as of :func:`read`; nothing is held to the schema.
    """
    file, text = source_of(path)
    return toml_tables(text, str(path), overrides), file.parent


def source_of(path: str | Path) -> tuple[Path, str]:
    """The file of a case, shipped or not, and its text."""
    try:
        file = found(path)
        return file, text_of(file, like(path))
    except ValueError as error:  # a NUL in the path among them
        raise CaseError(f"{path}: {error}") from None


def parse(
    text: str, name: str, overrides: Sequence[str] = (), folder: str | Path = "."
) -> CaseFile:
    """As :func:`read`, from the text of a case file.

    Args:
        text: of the file.
        name: of the file, for messages.
        overrides: as :func:`read`.
        folder: that the paths of recorded signals are taken from.
    """
    tables = toml_tables(text, name, overrides)
    learned()
    try:
        return CaseFile.model_validate(tables, context={"folder": Path(folder)})
    except ValidationError as error:
        raise CaseError(f"{name}: {sentence(CaseFile, error)}") from None
