"""What the tables of a case file have in common."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]

# A name is drawn, printed and a path in a file; longer ones fit nowhere.
_LONGEST_NAME = 100


def _no_control(value: str) -> str:
    bad = next((c for c in value if not c.isprintable()), None)
    if bad is not None:
        raise ValueError(
            f"holds the control character U+{ord(bad):04X}, which terminals obey and files can't "
            "hold; take it out"
        )
    return value


def _usable(value: str) -> str:
    if not value.strip() or "/" in value or value.strip(".") == "":
        raise ValueError("must be a name without '/', not blank and not only dots")
    if len(value) > _LONGEST_NAME:
        raise ValueError(f"has {len(value)} characters; must be at most {_LONGEST_NAME}")
    return value


Text = Annotated[str, AfterValidator(_no_control)]
Name = Annotated[Text, AfterValidator(_usable)]


class Table(BaseModel):
    """A table: unknown keys are errors, and a value has the type that it is written with."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
