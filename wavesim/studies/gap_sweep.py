"""Gaps of all media of a sweep at once, in closed form (``planewave.gap_map``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.planewave.gap_map import all_edges, edge_families
from wavesim.studies.sweep_case import SweptCase, check_matters
from wavesim.studies.sweep_store import Layout, Variable
from wavesim.studies.swept_media import SweptMedia, swept_media

_BLOCK = 5000
_LOOKED_AT = "the parameters of the case's media"


@dataclass(frozen=True)
class GapMeasure:
    """Edges of the gaps of a case's media.

    Attributes:
        swept: the media.
    """

    swept: SweptMedia

    @property
    def layout(self) -> Layout:
        """What is stored."""
        names = self.swept.names
        own = ("medium", "gap") if len(names) > 1 else ("gap",)
        about = "edge of a gap; lower = upper where it is closed"
        variables = {name: Variable(own, "rad/s", f"{name} {about}") for name in ("lower", "upper")}
        whose = edge_families(self.swept.media[0])
        coordinates: dict[str, Any] = {"gap": (list(whose), "1")}
        if len(names) > 1:
            coordinates["medium"] = (list(names), "1")
        return Layout(variables, coordinates, _BLOCK, {"family": (list(whose.values()), "gap")})

    def prepare(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is sent to where the work is done."""
        return values

    def work(self, values: NDArray[np.float64]) -> tuple[dict[str, Any], list[str]]:
        """Edges, and why members have none.

        Args:
            values: shape (members, keys).
        """
        count = len(values)
        families, messages = self.swept.families(values)
        sides: tuple[list[Any], list[Any]] = ([], [])
        for number, family in enumerate(families):
            for side, edges in zip(sides, all_edges(family), strict=True):
                parts = [np.broadcast_to(part, (count,)) for part in edges.values()]
                side.append(np.stack(parts, axis=1))
            # An edge that is not real is of a wave that grows.
            unreal = np.isnan(sides[0][-1] + sides[1][-1]).any(axis=1)
            for member in np.flatnonzero(unreal):
                self.swept.tell_growing(messages, number, family, int(member))
        failed = np.array([message != "" for message in messages])
        found = {}
        for name, parts in zip(("lower", "upper"), sides, strict=True):
            whole = np.stack(parts, axis=1) if len(parts) > 1 else parts[0]
            whole[failed] = np.nan
            found[name] = whole
        return found, messages


def gap_measure(swept: SweptCase) -> GapMeasure:
    """How the gaps of a sweep are measured.

    Raises:
        SweepError: no member can be made, or a key does not matter to any medium.
    """
    media, matters = swept_media(swept)
    for axis, does in zip(swept.varied.axes, matters, strict=True):
        check_matters(axis.key, does, "gaps", _LOOKED_AT)
    return GapMeasure(media)
