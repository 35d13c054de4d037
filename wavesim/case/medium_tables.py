"""[medium] and [[layers]] of a case file: parameters, losses, and the layers made of them."""

from __future__ import annotations

import dataclasses
import math
import numbers
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)
from pydantic.fields import FieldInfo

from wavesim.case.table import Finite, NotNegative, Positive, Table
from wavesim.material.damping import Damping, constant_quality
from wavesim.material.granular_equations import Closure
from wavesim.material.layers import Grading, Layer
from wavesim.material.medium import Medium, families, medium_of
from wavesim.material.parameter import PARAMETERS
from wavesim.material.several_families import together


def _one_number(value: Any, info: ValidationInfo) -> Any:
    """A loss key in a layer: a pair is told as what it is."""
    if isinstance(value, list) and info.field_name != "quality_band":
        raise ValueError("can't be graded: a layer has one loss law; give one number")
    return value


def _number_or_pair(value: Any) -> Any:
    """A parameter in a layer: a number, or one for each end."""
    graded = isinstance(value, list)
    parts = value if graded else [value]
    real = all(isinstance(p, numbers.Real) and not isinstance(p, bool) for p in parts)
    if not real or (graded and len(parts) != 2):
        raise ValueError("must be a number, or a pair [at from, at to]")
    try:
        found = [float(part) for part in parts]
    except OverflowError:
        found = [math.inf]
    if not all(map(math.isfinite, found)):
        raise ValueError("must be finite")
    return found if graded else found[0]


def _check_band(value: list[float] | None) -> list[float] | None:
    if value is not None and not (len(value) == 2 and 0 < value[0] < value[1] < math.inf):
        raise ValueError("must be two frequencies in Hz, [f1, f2] with 0 < f1 < f2")
    return value


def damping(losses: dict[str, Any]) -> Damping:
    """The loss law of the loss keys of a table.

    Args:
        losses: {key: value or None} of :data:`LOSSES`.

    Raises:
        ValueError: a quality factor without its band, or a band without a quality factor.
    """
    quality, band = losses["quality_factor"], losses["quality_band"]
    if quality is not None and band is None:
        raise ValueError(
            f"quality_factor = {quality:g}: needs quality_band; add quality_band = [f1, f2] (Hz)"
        )
    if band is not None and quality is None:
        raise ValueError(
            f"quality_band = {band}: is for a quality_factor; add it, or leave the band out"
        )
    law = Damping() if quality is None else constant_quality(quality, tuple(band))
    return dataclasses.replace(
        law, mass=losses["mass_damping"], stiffness=losses["stiffness_damping"]
    )


MOST_REPEATS = 10_000

Band = Annotated[list[float] | None, AfterValidator(_check_band)]

# The type and the default of each loss key.
LOSSES: dict[str, tuple[Any, Any]] = {
    "mass_damping": (NotNegative, 0.0),
    "stiffness_damping": (NotNegative, 0.0),
    "quality_factor": (Annotated[float, Field(gt=1, allow_inf_nan=False)] | None, None),
    "quality_band": (Band, None),
}

# Parameters of all families, in [medium] and in a layer; what is left out is as the family has it.
_ONE: Any = Finite | None
_ONE_OR_PAIR: Any = Annotated[Any, BeforeValidator(_number_or_pair)]
_CLOSURE: dict[str, Any] = {"closure": (Closure | None, None)}
_KEYS: dict[str, Any] = _CLOSURE | dict.fromkeys(PARAMETERS, (_ONE, None)) | LOSSES
_MediumKeys: Any = create_model("_MediumKeys", __base__=Table, **_KEYS)
_KEYS = _CLOSURE | dict.fromkeys(PARAMETERS, (_ONE_OR_PAIR, None))
_KEYS |= {key: (kind | None, None) for key, (kind, _) in LOSSES.items()}
_LayerKeys: Any = create_model("_LayerKeys", __base__=Table, **_KEYS)


class MediumTable(_MediumKeys):
    """[medium]: its family, or several that run side by side, their parameters, and the losses.

    See :class:`Medium`. What several families share, such as anisotropy, is given once for all.
    """

    family: str | list[str] = "rotation"

    @field_validator("family", mode="before")
    @classmethod
    def _known(cls, value: Any) -> Any:
        names = value if isinstance(value, list) else [value]
        if not names or any(name not in families() for name in names):
            *first, last = (f'"{name}"' for name in families())
            raise ValueError(
                f"must be {', '.join(first)} or {last}, or a list of them; a family of your own is "
                "known in the Python program that makes its class"
            )
        if len(set(names)) < len(names):
            raise ValueError("must name each family once")
        return value

    def build(self) -> Medium:
        """The medium."""
        given = self.model_dump()
        losses = {key: given.pop(key) for key in LOSSES}
        return _made(given, damping(losses))


def _made(given: dict[str, Any], law: Damping) -> Medium:
    """The medium of what is given, None standing for what is not.

    Raises:
        ValueError: a key is another family's.
    """
    given = {key: value for key, value in given.items() if value is not None}
    family, closure = given.pop("family"), given.pop("closure", None)
    names = family if isinstance(family, list) else [family]
    known = {name: medium_of(name).declared() for name in names}
    for key in given:
        if not any(key in own for own in known.values()):
            apart = [name for own in known.values() for name in own if _only(name)]
            raise ValueError(
                f"{key} = {given[key]:g}: is no key of family {' and '.join(names)}, which has "
                f"{', '.join(apart)} of its own"
            )
    media = []
    for name in names:
        its = {key: value for key, value in given.items() if key in known[name]}
        # Of several families one that has no choice goes by its own.
        if closure is not None and (len(names) == 1 or len(medium_of(name).closures) > 1):
            its["closure"] = closure
        media.append(Medium(family=name, **its, damping=law))
    return together(*media)


def _at_end(key: str, value: Any, end: int) -> Any:
    """A key's value at one end of a layer."""
    return value[end] if key in PARAMETERS and isinstance(value, list) else value


def _only(name: str) -> bool:
    """Whether a parameter is one family's alone."""
    return sum(name in medium_of(family).declared() for family in families()) == 1


class LayerTable(_LayerKeys):
    """[[layers]]: a layer, or a group of layers that is repeated.

    A layer has from and to (m), or thickness (m) and begins where the one before it ends; grading;
    and any key of [medium], a pair where it is graded. A group has repeat, and its layers in
    [[layers.layers]], by thickness.
    """

    start: NotNegative | None = Field(default=None, alias="from")
    end: NotNegative | None = Field(default=None, alias="to")
    thickness: Positive | None = None
    grading: Grading = "smooth"
    repeat: Annotated[int, Field(gt=0, le=MOST_REPEATS)] | None = None
    layers: list[LayerTable] = Field(default_factory=list)

    _ungraded = field_validator(*LOSSES, mode="before")(_one_number)

    @property
    def group(self) -> bool:
        """Whether it is a group."""
        return self.repeat is not None or bool(self.layers)

    @model_validator(mode="after")
    def _one_or_several(self) -> LayerTable:
        if not self.group:
            return self
        if not self.layers:
            raise ValueError(
                f"repeat = {self.repeat}: has no layers to repeat; add [[layers.layers]] below it"
            )
        own = [
            type(self).model_fields[name].alias or name
            for name in sorted(self.model_fields_set - {"repeat", "layers"})
        ]
        if own:
            raise ValueError(
                f"{own[0]}: a group has repeat and [[layers.layers]] alone; give it in these, or "
                "in [medium]"
            )
        for number, inner in enumerate(self.layers, start=1):
            if not inner.group and inner.thickness is None:
                raise ValueError(
                    f"[[layers.layers]] number {number}: thickness: required in a group, but not "
                    "given; add it in place of from and to"
                )
        return self

    @model_validator(mode="after")
    def _one_extent(self) -> LayerTable:
        if self.group:
            return self
        if self.thickness is not None:
            if self.start is not None or self.end is not None:
                raise ValueError(
                    f"thickness = {self.thickness:g}: stands in place of from and to; give the one "
                    "or the others"
                )
            return self
        if self.start is None and self.end is None:
            raise ValueError("thickness, or from and to: neither is given; give one of the two (m)")
        for name, value in (("from", self.start), ("to", self.end)):
            if value is None:
                raise ValueError(f"{name}: required, but not given; add it")
        assert self.start is not None
        assert self.end is not None
        if self.end <= self.start:
            raise ValueError(
                f"to = {self.end:g}: must be greater than from = {self.start:g}; a layer has a "
                "thickness"
            )
        return self

    def build(self, medium: MediumTable, start: float, end: float) -> Layer:
        """The layer from start to end (m), with the defaults that [medium] gives.

        Raises:
            ValueError: the loss keys do not go together.
        """
        given = {
            key: value
            for key, value in self.model_dump(exclude=set(_EXTENT)).items()
            if value is not None
        }
        whole = medium.model_dump() | given
        law = damping({key: whole.pop(key) for key in LOSSES})
        graded = any(key in PARAMETERS and isinstance(value, list) for key, value in whole.items())
        ends = [
            _made({key: _at_end(key, value, n) for key, value in whole.items()}, law)
            for n in ((0, 1) if graded else (0,))
        ]
        last = None if ends[0] == ends[-1] else ends[-1]
        return Layer(start, end, ends[0], last, self.grading)

    def resolved(self, layer: Layer, medium: MediumTable) -> dict[str, Any]:
        """This table with every default filled in.

        Args:
            layer: what it was built into.
            medium: [medium], which gives the loss keys that this does not.
        """
        first, last = layer.medium.parameters, (layer.last or layer.medium).parameters
        losses = {
            key: getattr(self, key) if getattr(self, key) is not None else getattr(medium, key)
            for key in LOSSES
        }
        return (
            {"from": layer.start, "to": layer.end, "grading": layer.grading}
            | {"closure": layer.medium.keys["closure"]}
            | {n: first[n] if first[n] == last[n] else [first[n], last[n]] for n in first}
            | {key: value for key, value in losses.items() if value is not None}
        )


_EXTENT = ("start", "end", "thickness", "grading", "repeat", "layers")


def learn() -> bool:
    """Make parameters of families that came since keys of both tables; whether any did."""
    new = [name for name in PARAMETERS if name not in MediumTable.model_fields]
    for table, kind in ((MediumTable, _ONE), (LayerTable, _ONE_OR_PAIR)) if new else ():
        for name in new:
            table.model_fields[name] = FieldInfo.from_annotated_attribute(kind, None)
        table.model_rebuild(force=True)
    return bool(new)
