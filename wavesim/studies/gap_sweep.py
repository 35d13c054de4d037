"""Gaps of all media of a sweep at once, in closed form (``planewave.gap_map``)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.case.layered_case import bar_layers
from wavesim.case.schema import CaseFile
from wavesim.material.medium import Medium, check_parameter
from wavesim.planewave.gap_map import family_gaps, widest_full_gap
from wavesim.planewave.many_media import growing
from wavesim.studies.sweep_case import SweptCase, check_matters
from wavesim.studies.sweep_store import Layout, Variable

_BLOCK = 5000
_LOOKED_AT = "the parameters of the case's media"


@dataclass(frozen=True)
class GapMeasure:
    """Edges of the gaps of a case's media.

    Attributes:
        media: each once: of [medium], or of the layers, both of a graded one.
        names: of them.
        taken: {(medium, parameter): number of the key it is the value of}.
    """

    media: tuple[Medium, ...]
    names: tuple[str, ...]
    taken: dict[tuple[int, str], int]

    @property
    def layout(self) -> Layout:
        """What is stored."""
        own = ("medium", "gap") if len(self.names) > 1 else ("gap",)
        about = "edge of a gap; lower = upper where it is closed"
        variables = {name: Variable(own, "rad/s", f"{name} {about}") for name in ("lower", "upper")}
        coordinates: dict[str, Any] = {"gap": ([*self.media[0].family.all_gaps, "full"], "1")}
        if len(self.names) > 1:
            coordinates["medium"] = (list(self.names), "1")
        return Layout(variables, coordinates, _BLOCK)

    def prepare(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is sent to where the work is done."""
        return values

    def work(self, values: NDArray[np.float64]) -> tuple[dict[str, Any], list[str]]:
        """Edges, and why members have none.

        Args:
            values: shape (members, keys).
        """
        messages = [""] * len(values)
        lower, upper = [], []
        for number, (medium, name) in enumerate(zip(self.media, self.names, strict=True)):
            own = {p: values[:, key] for (m, p), key in self.taken.items() if m == number}
            where = f"{name}: " if len(self.names) > 1 else ""
            edges = _edges(medium, own, len(values), messages, where)
            lower.append(edges[0])
            upper.append(edges[1])
        failed = np.array([message != "" for message in messages])
        found = {}
        for name, parts in (("lower", lower), ("upper", upper)):
            whole = np.stack(parts, axis=1) if len(parts) > 1 else parts[0]
            whole[failed] = np.nan
            found[name] = whole
        return found, messages


def _edges(
    medium: Medium, own: dict[str, Any], count: int, messages: list[str], where: str
) -> tuple[Any, Any]:
    """Lower and upper edges of a family, (members, gaps) each; messages are filled in."""
    own = dict(own)
    for parameter, values in own.items():
        known = medium.known()[parameter]
        bad = ~((values > known.low) & (values <= known.high))
        if not known.open:
            bad &= values != known.low
        for member in np.flatnonzero(bad):
            try:
                check_parameter(parameter, float(values[member]))
            except ValueError as error:
                messages[member] = messages[member] or f"{where}{error}"
        stand_in = float(values[~bad][0]) if not bad.all() else getattr(type(medium)(), parameter)
        own[parameter] = np.where(bad, stand_in, values)
    if not own:
        own = {"density": np.full(count, float(medium.density))}
    family = dataclasses.replace(medium, **own)
    lower, upper = family_gaps(family)
    full = widest_full_gap(family)
    edges = [
        np.stack([np.broadcast_to(part, (count,)) for part in (*side.values(), whole)], axis=1)
        for side, whole in ((lower, full[0]), (upper, full[1]))
    ]
    unstable = np.isnan(edges[0] + edges[1]).any(axis=1) | growing(family, count)
    for member in np.flatnonzero(unstable):
        one: dict[str, Any] = {
            name: float(values[member]) for name, values in own.items() if np.ndim(values)
        }
        told = dataclasses.replace(medium, **one).settings
        messages[member] = messages[member] or (
            f"{where}{told}: waves of closure "
            f"{medium.closure!r} are unstable, they grow without bound; bring anisotropy nearer to "
            "0, where no closure is, or take closure 'consistent'"
        )
    return edges[0], edges[1]


def gap_measure(swept: SweptCase) -> GapMeasure:
    """How the gaps of a sweep are measured.

    Raises:
        SweepError: no member can be made, or a key does not matter to any medium.
    """
    anchor, first = swept.anchor(_media)
    taken: dict[tuple[int, str], int] = {}
    made = []
    for number, axis in enumerate(swept.varied.axes):
        other = swept.other(_media, anchor, number)
        if other is None:
            continue
        value, media = other
        made.append(media)
        own = {
            (m, p): number
            for m, (one, two) in enumerate(zip(first, media, strict=True))
            for p in one[1].known()
            if getattr(two[1], p) != getattr(one[1], p) and getattr(two[1], p) == value
        }
        check_matters(axis.key, bool(own), "gaps", _LOOKED_AT)
        taken |= own
    # Layers of one medium, whatever the keys, are one.
    kept: dict[Any, int] = {}
    for m, (_, medium) in enumerate(first):
        kept.setdefault((medium, *(media[m][1] for media in made)), m)
    place = {m: n for n, m in enumerate(kept.values())}
    return GapMeasure(
        tuple(first[m][1] for m in place),
        tuple(first[m][0] for m in place),
        {(place[m], p): key for (m, p), key in taken.items() if m in place},
    )


def _media(file: CaseFile, name: str) -> Sequence[tuple[str, Medium]]:
    """The media of a case by the tables they stand in."""
    bar = bar_layers(file, name)
    if not bar.stretches:
        return [("medium", bar.medium)]
    found = []
    for place, layer in zip(bar.places, bar.stretches, strict=True):
        table = ".".join(place.where)
        found.append((table, layer.medium))
        if layer.last is not None:
            found.append((f"{table}, to", layer.last))
    return found
