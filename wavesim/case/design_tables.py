"""Bands of a case file, and [design]: what must pass and what must not, what may vary, in what."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field, model_validator

from wavesim.case.table import Finite, NotNegative, Positive, Table, Text


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


def distinct(bands: Sequence[BandTable]) -> list[BandTable]:
    """Bands without weights, each once."""
    plain = [
        BandTable.model_validate(b.model_dump(by_alias=True, exclude={"weight"})) for b in bands
    ]
    return [band for n, band in enumerate(plain) if band not in plain[:n]]


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
    tolerance: NotNegative = 0.01
