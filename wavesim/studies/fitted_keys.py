"""What the keys of a fit name: parameters of which media of a case, and values laid over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from wavesim.case.load import Case
from wavesim.material.damping import Damping, constant_quality
from wavesim.material.layers import Layer, Layers
from wavesim.studies.least_squares import FitError

QUALITY = "quality_factor"


@dataclass(frozen=True)
class Target:
    """A parameter that is varied: of which layers, which of their medium's."""

    key: str
    name: str
    layers: tuple[int, ...]


def targets(case: Case, keys: Sequence[str]) -> list[Target]:
    """What keys of a case name.

    Args:
        case: the case.
        keys: "medium.NAME", "layers.N.NAME" (from 0), or NAME for medium.NAME.

    Raises:
        FitError: a key names no parameter of a medium.
    """
    allowed = (*case.medium.known(), QUALITY)
    layers = case.simulation.layers.layers
    found: list[Target] = []
    for key in keys:
        parts = key.split(".")
        name, table = parts[-1], parts[:-1] or ["medium"]
        if name not in allowed:
            raise FitError(f"--vary {key}: must end in one of {', '.join(allowed)}")
        if table == ["medium"]:
            if name == QUALITY:
                _check_one_law(key, layers)
                own = tuple(range(len(layers)))
            else:
                base = getattr(case.medium, name)
                own = tuple(
                    i for i, one in enumerate(layers)
                    if base in [getattr(medium, name) for medium in one.ends]
                )  # fmt: skip
        elif len(table) == 2 and table[0] == "layers" and table[1].isdigit():
            number = int(table[1])
            if name == QUALITY:
                raise FitError(
                    f"--vary {key}: one quality factor is fitted for all layers: name "
                    f"medium.{QUALITY}"
                )
            if number >= len(layers):
                raise FitError(f"--vary {key}: the case has {len(layers)} layers, from 0 on")
            own = (number,)
        else:
            raise FitError(f"--vary {key}: must be medium.NAME or layers.N.NAME, N from 0")
        graded = [i for i in own if name != QUALITY and _graded(layers[i], name)]
        if graded:
            raise FitError(
                f"--vary {key}: layers.{graded[0]} is graded in {name}, and one value would make "
                "it uniform: fit parameters that its two ends share"
            )
        if not own:
            raise FitError(f"--vary {key}: layers have values of their own; name layers.N.{name}")
        full = ".".join([*table, name])
        if any(one.key == full for one in found):
            raise FitError(f"--vary {key}: is named twice")
        found.append(Target(full, name, own))
    if not found:
        raise FitError("--vary: name what to fit, such as medium.anisotropy")
    return found


def _check_one_law(key: str, layers: Sequence[Layer]) -> None:
    """Refuse a quality factor that is not all that is lost, or not that of all layers."""
    law = layers[0].medium.damping
    if any(medium.damping != law for layer in layers for medium in layer.ends):
        raise FitError(
            f"--vary {key}: layers have losses of their own, and one quality factor is fitted for "
            "all: give all the one of [medium]"
        )
    if law.mass or law.stiffness:
        raise FitError(
            f"--vary {key}: no quality factor is fitted beside mass_damping and stiffness_damping: "
            "leave them out"
        )


def _graded(layer: Layer, name: str) -> bool:
    return len({getattr(medium, name) for medium in layer.ends}) > 1


def with_values(layers: Layers, varied: Sequence[Target], theta: Any) -> tuple[Layers, Damping]:
    """Layers with parameters laid over, and the law of all of them where a quality factor is one.

    Without it each layer has its own, and the law is that of the first.
    """
    made: list[Layer] = list(layers.layers)
    law = made[0].medium.damping
    for one, value in zip(varied, theta, strict=True):
        if one.name == QUALITY:
            assert law.made is not None
            law = constant_quality(float(value), law.made[1])
            continue
        for number in one.layers:
            made[number] = made[number].mapped(partial(replace, **{one.name: value}))
    return Layers(tuple(made)), law
