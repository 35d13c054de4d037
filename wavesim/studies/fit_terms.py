"""The terms of a fit: what its keys name in a case, what is held beside, and what it answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.case.layered_case import varied_key
from wavesim.case.load import Case
from wavesim.material.damping import constant_quality
from wavesim.material.layers import Layer, Layers
from wavesim.readings.misfit import Comparison
from wavesim.studies.least_squares import CONDITION, TIED, FitError, Tied, tied

Float = NDArray[Any]

QUALITY = "quality_factor"
# What is held is supposed to be known to this part of its size where it is not said.
SUPPOSED = 0.01
# What is left over spoils what is fitted where it is more than SPOILS, and more than so many times
# what the errors of what is held do.
ALLOWED = 2.0


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
            return float(medium.parameters[self.name])
        assert medium.damping.made is not None
        return medium.damping.made[0]

    def size_in(self, layers: Layers) -> float:
        """The size of what it is, SI; 1 of a 0 that has no unit, 0 of what follows from others."""
        medium = layers.layers[self.layers[0]].medium
        if getattr(medium, self.name, 0.0) is None:
            return 0.0
        bare = self.name in medium.known() and not medium.known()[self.name].unit
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


def check_held(known_to: Mapping[str, float], names: Sequence[str]) -> None:
    """Refuse a name that is of nothing held.

    Raises:
        FitError: it is; the message says what is held.
    """
    for name in known_to:
        if name and name not in names:
            raise FitError(f"--held {name}: is not held; must be of {', '.join(names)}")


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
            changed = {"damping": constant_quality(value, law[1])}
        for number in one.layers:
            made[number] = made[number].mapped(partial(replace, **changed))
    return Layers(tuple(made))


@dataclass(frozen=True)
class Held:
    """What is held in a fit, and what an error of it does.

    Attributes:
        names: of what is held, m.
        moved: by how much each value changes where each of them is larger by all of its size, SI,
            shape (p, m).
        left: how the residuals change beside, root of the mean square, shape (m,).
    """

    names: tuple[str, ...]
    moved: Float
    left: Float

    @classmethod
    def of(cls, J: Float, columns: Mapping[str, Float]) -> Held:
        """From derivatives of residuals: J by what is fitted, (n, p), and by what is held."""
        H = np.stack([*columns.values()], axis=1) if columns else np.zeros((len(J), 0))
        size = np.linalg.norm(J, axis=0)
        size = np.where(size > 0, size, 1.0)
        moved = -np.linalg.lstsq(J / size, H, CONDITION)[0]
        left = np.sqrt(np.mean((H + J / size @ moved) ** 2, axis=0))
        return cls(tuple(columns), moved / size[:, None], left)

    def parts(self, known_to: Mapping[str, float]) -> Float:
        """To which part of its size each is known, one standard error, as it is stated, (m,).

        Args:
            known_to: parts by name, that of all others under "", SUPPOSED of all where empty.

        Raises:
            FitError: what is named is not held.
        """
        check_held(known_to, self.names)
        known_to = known_to or {"": SUPPOSED}
        return np.array([known_to.get(name, known_to.get("", 0.0)) for name in self.names])

    def seen(self, J: Float, columns: Mapping[str, Float], residuals: Float) -> tuple[float, str]:
        """What is left over as errors of what is held would leave it, by least squares.

        Args:
            J, columns: as of :meth:`of`.
            residuals: shape (n,).

        Returns:
            The part of the residuals' power that they explain, –, and the one that explains most
            alone, with by how much it would be larger, in words; "" where nothing is held.
        """
        power = float(residuals @ residuals)
        own = {name: one for name, one in columns.items() if np.any(one)}
        if not own or not power:
            return 0.0, ""
        left = []
        for some in (*([one] for one in own.values()), [*own.values()]):
            A = np.stack([*J.T, *some], axis=1)
            size = np.linalg.norm(A, axis=0)
            size = np.where(size > 0, size, 1.0)
            found = np.linalg.lstsq(A / size, residuals, CONDITION)[0]
            left.append((float(np.sum((residuals - A / size @ found) ** 2)), -found[-1] / size[-1]))
        *alone, (together, _) = left
        most = min(range(len(alone)), key=lambda i: alone[i][0])
        return 1 - together / power, f"{[*own][most]} {100 * alone[most][1]:+.2g} %"

    def covariance(self, parts: Float) -> Float:
        """Of the values, as what is held is known to parts of it, each unlike the others."""
        moved = self.moved * parts
        return moved @ moved.T


@dataclass(frozen=True)
class FitAnswer:
    """A fit.

    Attributes:
        kind: "waveforms", "points" or "speeds".
        values, errors: {key: value and standard error}, SI; NaN where the data don't tell. Errors
            hold that what is held is known to 1 % alone, or as it is stated to be.
        reasons: {key: why a value does not count, or ""}.
        nuisances: {gain, lag: (value, standard error)}.
        degenerate: directions that the data don't tell, {key: part} each.
        tied: pairs of parameters whose errors hang together.
        residual: what is left over the record's rms, –; or χ² over degrees of freedom of points.
        evaluations, notes: how it went.
        along: {key: value} of what goes along with them, SI.
        known_to: to which part of its size each thing that is held was stated to be known, as
            :meth:`Held.parts` has it; {}, not stated.
        alone: {key: standard error where what is held is exact}, SI.
        held: {key: {what is held: by how much the value changes where that is 1 % larger}}, SI.
        comparison: the record beside the fitted case; None but for waveforms.
    """

    kind: str
    values: dict[str, float]
    errors: dict[str, float]
    reasons: dict[str, str]
    nuisances: dict[str, tuple[float, float]] = field(default_factory=dict)
    degenerate: tuple[dict[str, float], ...] = ()
    tied: tuple[Tied, ...] = ()
    residual: float = 0.0
    evaluations: int = 0
    notes: tuple[str, ...] = ()
    along: dict[str, float] = field(default_factory=dict)
    known_to: Mapping[str, float] = field(default_factory=dict)
    alone: dict[str, float] = field(default_factory=dict)
    held: dict[str, dict[str, float]] = field(default_factory=dict)
    comparison: Comparison | None = None

    def summary(self) -> dict[str, Any]:
        """As plain data, SI."""
        parameters = {
            key: {
                "value": value,
                "error": self.errors[key],
                "error_if_held_exact": self.alone.get(key, self.errors[key]),
                "valid": not self.reasons[key],
                "reason": self.reasons[key],
            }
            for key, value in self.values.items()
        }
        return {
            "kind": self.kind,
            "parameters": parameters,
            "along": self.along,
            "held": {"known_to": dict(self.known_to), "moves_by_1_percent": self.held},
            "nuisances": {k: {"value": v, "error": e} for k, (v, e) in self.nuisances.items()},
            "degenerate": [dict(one) for one in self.degenerate],
            "correlations": [asdict(one) for one in self.tied],
            "residual": self.residual,
            "evaluations": self.evaluations,
            "valid": not any(self.reasons.values()),
            "notes": list(self.notes),
        }


def answered(
    kind: str,
    values: Mapping[str, float],
    errors: Mapping[str, float],
    covariance: Float,
    held: Held,
    known_to: Mapping[str, float],
    reasons: dict[str, str],
    least: float = TIED,
    bend: Any = 0.0,
    **more: Any,
) -> FitAnswer:
    """An answer whose errors hold how well what is held is known.

    Args:
        kind, more: of :class:`FitAnswer`.
        values, errors, covariance: of all that was fitted, SI, by the data alone; errors NaN where
            not told.
        held: what was not.
        known_to: as :meth:`Held.parts` takes it; {}, not stated: all to 1 %.
        reasons: why a value does not count, or "", of those that are wanted.
        least: correlation beyond which errors are said to hang together.
        bend: of :class:`Solution`.
    """
    beside = held.covariance(held.parts(known_to))
    total = np.hypot([*errors.values()], np.sqrt(np.diag(beside)))
    wider = dict(zip(values, total.tolist(), strict=True))
    moves = {
        key: dict(zip(held.names, (0.01 * row).tolist(), strict=True))
        for key, row in zip(values, held.moved, strict=True) if key in reasons
    }  # fmt: skip
    return FitAnswer(
        kind,
        {key: values[key] for key in reasons},
        {key: wider[key] for key in reasons},
        reasons,
        {key: (values[key], wider[key]) for key in values if key not in reasons},
        tied=tied(values, wider, covariance + beside, least, bend),
        known_to=known_to,
        alone={key: errors[key] for key in reasons},
        held=moves,
        **more,
    )
