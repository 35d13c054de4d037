"""What the keys of a fit name: parameters of which media of a case, and values laid over them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from wavesim.case.layered_case import varied_key
from wavesim.case.load import Case
from wavesim.material.damping import constant_quality
from wavesim.material.layers import Layer, Layers
from wavesim.studies.least_squares import FitError

QUALITY = "quality_factor"


@dataclass(frozen=True)
class Target:
    """A parameter that is varied: of which layers of the bar, which of their medium's."""

    key: str
    name: str
    layers: tuple[int, ...]

    def value_in(self, layers: Layers) -> float:
        """What it is in layers, SI."""
        medium = layers.layers[self.layers[0]].medium
        if self.name != QUALITY:
            return float(getattr(medium, self.name) or 0.0)
        assert medium.damping.made is not None
        return medium.damping.made[0]

    def size_in(self, layers: Layers) -> float:
        """The size of what it is, SI; 1 of a 0 that has no unit."""
        known = layers.layers[self.layers[0]].medium.known()
        bare = self.name in known and not known[self.name].unit
        return abs(self.value_in(layers)) or float(bare)


def targets(case: Case, keys: Sequence[str]) -> list[Target]:
    """What keys of a case name.

    Args:
        case: the case.
        keys: "medium.NAME", what of its layers is not their own, "layers.N.NAME" (from 0, as
            ``--set`` counts them), or NAME for medium.NAME.

    Raises:
        FitError: a key names no parameter of a medium.
    """
    allowed = (*case.medium.known(), QUALITY)
    layers = case.simulation.layers.layers
    found: list[Target] = []
    for key in keys:
        full = key if "." in key else f"medium.{key}"
        name = full.rpartition(".")[2]
        if name not in allowed:
            raise FitError(f"--vary {key}: must end in one of {', '.join(allowed)}")
        if name == QUALITY:
            _check_one_law(key, full, layers)
            own = tuple(range(len(layers)))
        elif full == f"medium.{name}" and not case.material.places:
            own = (0,)
        else:
            try:
                own = varied_key(case.material, full).layers
            except ValueError as error:
                said = str(error).removeprefix(f'key = "{full}": ')
                raise FitError(f"--vary {key}: {said}") from None
        graded = [i for i in own if name != QUALITY and _graded(layers[i], name)]
        if graded:
            raise FitError(
                f"--vary {key}: the layer from {layers[graded[0]].start:g} m on is graded in "
                f"{name}, and one value would make it uniform: fit parameters that its two ends "
                "share"
            )
        if any(one.key == full for one in found):
            raise FitError(f"--vary {key}: is named twice")
        found.append(Target(full, name, own))
    if not found:
        raise FitError("--vary: name what to fit, such as medium.anisotropy")
    return found


def held_beside(case: Case, varied: Sequence[Target]) -> list[Target]:
    """What else of a case's media, and of layers of their own, is a number that could be varied."""
    layers, found = case.simulation.layers, dict[str, Target]()
    for name in (*case.medium.known(), QUALITY):
        own = [
            f"{'.'.join(p.where)}.{name}" for p in case.material.places
            if p.where[0] != "bar" and getattr(p.table, name, None) is not None
        ]  # fmt: skip
        for key in (f"medium.{name}", *own):
            with suppress(FitError):
                (one,) = targets(case, [key])
                taken = any(v.name == name and set(v.layers) & set(one.layers) for v in varied)
                if one.layers and not taken and one.size_in(layers):
                    found[key] = one
    return list(found.values())


def _check_one_law(key: str, full: str, layers: Sequence[Layer]) -> None:
    """Refuse a quality factor that is not all that is lost, or not that of all layers."""
    law = layers[0].medium.damping
    why = ""
    if full != f"medium.{QUALITY}":
        why = f"one quality factor is fitted for all layers: name medium.{QUALITY}"
    elif any(medium.damping != law for layer in layers for medium in layer.ends):
        why = (
            "layers have losses of their own, and one quality factor is fitted for all: give all "
            "the one of [medium]"
        )
    elif law.mass or law.stiffness:
        why = (
            "no quality factor is fitted beside mass_damping and stiffness_damping: leave them out"
        )
    elif law.made is None:
        why = f"the case has none: give {QUALITY} and quality_band in [medium] to begin with"
    if why:
        raise FitError(f"--vary {key}: {why}")


def _graded(layer: Layer, name: str) -> bool:
    return len({getattr(medium, name) for medium in layer.ends}) > 1


def with_values(layers: Layers, varied: Sequence[Target], theta: Any) -> Layers:
    """Layers with parameters laid over; a quality factor by its law, over the band of theirs."""
    made: list[Layer] = list(layers.layers)
    for one, value in zip(varied, theta, strict=True):
        changed = {one.name: value}
        if one.name == QUALITY:
            law = made[0].medium.damping.made
            assert law is not None
            changed = {"damping": constant_quality(float(value), law[1])}
        for number in one.layers:
            made[number] = made[number].mapped(partial(replace, **changed))
    return Layers(tuple(made))
