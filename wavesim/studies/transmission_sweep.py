"""T and R of all stacks of a sweep, as batches in jax; without a simulation.

What a key does to the stack is found by making two members that differ in it alone, and taken for
linear in its value, as parameters and thicknesses are; some members are made to make sure. Stacks
of which that is not so, and those that the batch does not serve (a graded layer without losses,
whose asymptotes are looked for, or one whose slices do not suffice), are solved one by one by
``layered``.
"""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from wavesim.case.layered_case import BarLayers, bar_layers
from wavesim.case.schema import CaseError
from wavesim.differentiable.stack_transmission import transmission
from wavesim.differentiable.traced_layers import TracedLayers, traced_layers
from wavesim.layered.transmission import specimen
from wavesim.studies.sweep_case import SweptCase, SweptMedia, check_matters, swept_media
from wavesim.studies.sweep_store import Layout, Variable
from wavesim.studies.transmission_study import transmission_study
from wavesim.studies.variation import SweepError
from wavesim.timedomain.compiled import keep_compiled

# What follows a line does so to rounding, and a bit more.
_LINEAR = 1e-9
_MADE = 8  # members that are made to make sure
_BLOCK = 512
_ONE_BY_ONE = 8
_LOOKED_AT = "the layers and their media"
_OVER = ("sector", "frequency")
_VARIABLES = {
    "T": Variable(_OVER, "1", "transmitted over incident amplitude, at the faces", "c16"),
    "R": Variable(_OVER, "1", "reflected over incident amplitude, at the faces", "c16"),
    "transmitted": Variable(_OVER, "1", "transmitted over incident energy"),
    "reflected": Variable(_OVER, "1", "reflected over incident energy"),
}
_READ = {"transmitted": "power_T", "reflected": "power_R"}


@dataclass(frozen=True)
class _Rule:
    """How the arrays of a stack depend on the keys: base + Σ slope (value − anchor).

    Attributes:
        base: the anchor's stack.
        slopes: of each key, by array.
        anchor: values of the keys there.
    """

    base: TracedLayers
    slopes: list[TracedLayers]
    anchor: NDArray[np.float64]

    def stacks(self, values: NDArray[np.float64]) -> TracedLayers:
        """Those of members as one, whose arrays have the shape (members, …)."""
        away = values - self.anchor
        found: TracedLayers = jax.tree.map(
            lambda base, *slopes: base + np.tensordot(away, np.stack(slopes), 1),
            self.base,
            *self.slopes,
        )
        return found


@dataclass(frozen=True)
class TransmissionMeasure:
    """T and R of a case's specimen over frequencies.

    Attributes:
        swept: the sweep.
        media: its media.
        rule: how stacks depend on the keys; None where they are solved one by one.
        sectors: in which waves are looked at.
        frequency: Hz, shape (n,).
        notes: what a reader should know beside the numbers.
    """

    swept: SweptCase
    media: SweptMedia
    rule: _Rule | None
    sectors: tuple[str, ...]
    frequency: NDArray[np.float64]
    notes: tuple[str, ...] = ()

    @property
    def layout(self) -> Layout:
        """What is stored."""
        coordinates = {"sector": (list(self.sectors), "1"), "frequency": (self.frequency, "Hz")}
        together = self.rule is not None and not any(self.rule.base.gradings)
        return Layout(_VARIABLES, coordinates, _BLOCK if together else _ONE_BY_ONE)

    def prepare(self, values: NDArray[np.float64]) -> Any:
        """Values of the keys; where each is solved alone, what :meth:`_made` makes of them."""
        return values if self.rule is not None else self._made(values)

    def _made(self, values: NDArray[np.float64]) -> list[Any]:
        """The stacks of members, or why there is none."""
        made: list[Any] = []
        for member in values:
            try:
                made.append(bar_layers(self.swept.file(member), self.swept.name))
            except CaseError as error:
                made.append(str(error))
        return made

    def work(self, prepared: Any) -> tuple[dict[str, Any], list[str]]:
        """T and R, and why members have none."""
        if self.rule is None:
            return self._one_by_one(prepared)
        keep_compiled()
        _, messages = self.media.families(prepared)
        stack = self.rule.stacks(prepared)
        for member in np.flatnonzero((stack.thickness[:, 1:-1] <= 0).any(axis=1)):
            least = float(stack.thickness[member, 1:-1].min())
            messages[member] = messages[member] or (
                f"thickness = {least:g}: must be greater than 0 m in every layer"
            )
        failed = np.array([message != "" for message in messages])
        if failed.all():
            return {}, messages
        # Another stands in for a member that can't be, and for those up to a power of two, so that
        # blocks of many sizes compile a few times.
        chosen = np.full(1 << (len(failed) - 1).bit_length(), np.argmin(failed))
        there = np.flatnonzero(~failed)
        chosen[there] = there
        batch = jax.tree.map(lambda a: np.asarray(a)[chosen], stack)
        first = list(map(self.media.media[0].family.first_alike, self.sectors))
        omega = 2 * np.pi * self.frequency
        made = {sector: _batch(batch, omega, sector) for sector in set(first)}
        whole = {
            name: np.stack([getattr(made[s], _READ.get(name, name)) for s in first], axis=1)
            for name in _VARIABLES
        }
        whole = {name: values[: len(failed)] for name, values in whole.items()}
        unknown = np.flatnonzero(np.isnan(whole["T"]).any(axis=(1, 2)) & ~failed)
        for values in whole.values():
            values[failed] = np.nan
        if len(unknown):  # slices of a graded layer did not suffice
            alone, told = self._one_by_one(self._made(prepared[unknown]))
            for name, values in whole.items():
                values[unknown] = alone[name]
            for member, message in zip(unknown, told, strict=True):
                messages[member] = message
        return whole, messages

    def _one_by_one(self, stacks: list[Any]) -> tuple[dict[str, Any], list[str]]:
        low, high = float(self.frequency[0]), float(self.frequency[-1])
        shape = len(stacks), len(self.sectors), len(self.frequency)
        found = {name: np.full(shape, np.nan, dtype=one.kind) for name, one in _VARIABLES.items()}
        messages = []
        for member, stack in enumerate(stacks):
            message = stack if isinstance(stack, str) else ""
            if not message:
                try:
                    study = transmission_study(stack, (low, high), len(self.frequency))
                except ValueError as error:
                    message = f"{self.swept.name}: {error}"
                else:
                    for place, sector in enumerate(self.sectors):
                        for name, values in found.items():
                            values[member, place] = getattr(
                                study.curves[sector], _READ.get(name, name)
                            )
            messages.append(message)
        return found, messages


@functools.partial(jax.jit, static_argnames=("sector",))
def _batch(stack: TracedLayers, omega: Any, sector: str) -> Any:
    # Through a graded layer each member takes the slices that it needs where they go one by one.
    together = None if any(stack.gradings) else _BLOCK
    return jax.lax.map(lambda one: transmission(one, sector, omega), stack, batch_size=together)


def _stack(bar: BarLayers) -> TracedLayers | None:
    """A specimen between half-spaces of no length, as arrays; None where a batch does not serve."""
    own = specimen(bar.layers).layers  # type: ignore[arg-type]
    if any(layer.last is not None and not layer.medium.damping for layer in own.layers):
        return None
    try:
        made = traced_layers(own)
    except ValueError:
        return None
    made = jax.tree.map(np.asarray, made)
    thickness = np.array(made.thickness)
    thickness[[0, -1]] = 0.0
    return dataclasses.replace(made, thickness=thickness)


def _like(made: TracedLayers | None, base: TracedLayers) -> bool:
    structure: Any = jax.tree.structure
    return bool(structure(made) == structure(base))


def _rule(swept: SweptCase) -> tuple[_Rule | None, list[bool]]:
    """How stacks depend on the keys, None where not linearly; and which keys matter to them."""
    anchor, first = swept.anchor(bar_layers)
    others = [swept.other(bar_layers, anchor, number) for number in range(len(anchor))]
    matters = [
        other is None or (other[1].stretches != first.stretches or other[1].medium != first.medium)
        for other in others
    ]
    base = _stack(first)
    # What graded layers take to compile is what the exact solver takes for so many.
    few = swept.varied.count <= _ONE_BY_ONE
    if base is None or (few and any(base.gradings)):
        return None, matters
    slopes = []
    for number, other in enumerate(others):
        value, bar = other or (np.inf, first)
        made = _stack(bar)
        if not _like(made, base):
            return None, matters
        step = value - anchor[number]
        slopes.append(jax.tree.map(lambda a, b, h=step: np.nan_to_num((a - b) / h), made, base))
    rule = _Rule(base, slopes, np.array(anchor))
    return (rule if _holds(rule, swept) else None), matters


def _holds(rule: _Rule, swept: SweptCase) -> bool:
    """Whether some members are what the rule says."""
    chosen = np.linspace(0, swept.varied.count - 1, _MADE).astype(int)
    for values in swept.varied.values[chosen]:
        try:
            made = _stack(bar_layers(swept.file(values), swept.name))
        except CaseError:
            continue
        if not _like(made, rule.base):
            return False
        told = rule.stacks(values[None])
        for one, two in zip(jax.tree.leaves(made), jax.tree.leaves(told), strict=True):
            size = np.nanmax(np.abs(one), initial=0.0)
            if (np.abs(np.nan_to_num(one - two[0])) > _LINEAR * size).any():
                return False
    return True


def transmission_measure(
    swept: SweptCase, band: tuple[float, float] | None = None, points: int = 200
) -> TransmissionMeasure:
    """How the transmission of a sweep is measured.

    Args:
        swept: the sweep.
        band: lowest and highest frequency, Hz; by default what the half-spaces' first band holds.
        points: number of frequencies, evenly spaced.

    Raises:
        SweepError: no member can be made, nothing stands between half-spaces, a key does not matter
            to the stack, or there is no such band.
    """
    _, first = swept.anchor(bar_layers)
    if points < 2:
        raise SweepError(f"--points {points}: must be 2 or greater")
    try:
        study = transmission_study(first, band, 2)
    except ValueError as error:
        where = f"--{error}" if str(error).startswith("band") else f"{swept.name}: {error}"
        raise SweepError(where) from None
    rule, matters = _rule(swept)
    for axis, does in zip(swept.varied.axes, matters, strict=True):
        check_matters(axis.key, does, "transmission", _LOOKED_AT)
    ends = study.frequency
    frequency = np.linspace(float(ends[0]), float(ends[-1]), points)
    sectors = tuple(study.curves)
    low = study.too_low
    notes = () if low is None else (low,)
    return TransmissionMeasure(swept, swept_media(swept)[0], rule, sectors, frequency, notes)
