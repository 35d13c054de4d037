"""How loud a field is about a place: what a difference is held against, and whether at all.

At a node of a standing wave, at a free end (micro-fields) or a fixed one (macro-fields), ahead of
the first wave: there a signal is next to nothing, and so is any difference, but not their ratio.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.simulation.field import Field
from wavesim.simulation.simulation import Simulation

Float = NDArray[Any]

# A signal is judged above this part of the largest within half a wavelength of its receiver, …
NODE = 0.02
# … and of the largest about the sources and receivers: below, the exact signals end too.
ARRIVED = 1e-4
# On an end is what is nearer than this part of a cell.
_ON_END = 1e-3
# At most so many points about a place are looked at.
_MOST_POINTS = 128
# Of a record its last part, at whose size what comes after it would go on; and rounding, as a part
# of the largest value anywhere.
TAIL = 0.1
ROUNDING = 1e-11


class Loudness:
    """Largest values of a field's parts about its receivers and sources.

    Args:
        field: the field.
    """

    def __init__(self, field: Field) -> None:
        self.field = field
        self._known: dict[tuple[float, str], float] = {}

    def about(self, position: float, name: str) -> float:
        """Largest |u| of one field within half a wavelength of a place, at any time."""
        key = float(position), name
        if key not in self._known:
            self._known[key] = self._about(*key)
        return self._known[key]

    def _about(self, position: float, name: str) -> float:
        field, near = self.field, reach(self.field.simulation, position)
        first, last = np.searchsorted(field.positions(name), [position - near, position + near])
        step = max(1, (last - first) // _MOST_POINTS)
        return float(np.abs(field.part(name, points=slice(int(first), int(last), step))).max())

    def overall(self, name: str) -> float:
        """Largest |u| of one field about any source or receiver."""
        places = {s.position for s in self.field.sources} | set(self.field.receivers.values())
        return max(self.about(place, name) for place in sorted(places))

    @property
    def moved(self) -> bool:
        """Whether anything moved about sources and receivers."""
        return any(self.overall(name) > 0 for name in self.field.names)

    def scale(self, position: float, name: str, signal: Float) -> float | None:
        """What a difference from a signal is held against; None where it can't be judged.

        Args:
            position: of the receiver, m.
            name: of the field.
            signal: exact, shape (nt,).
        """
        near, own = self.about(position, name), float(np.abs(signal).max())
        if own == 0 or own < NODE * near or own < ARRIVED * self.overall(name):
            return None
        return max(near, own)

    def compared(
        self, exact: Mapping[str, Mapping[str, Float]]
    ) -> tuple[dict[str, dict[str, float]], dict[str, set[str]]]:
        """Signals at receivers beside exact ones.

        Args:
            exact: {receiver: {field: signal (nt,)}}.

        Returns:
            {receiver: {field: largest difference over the field's largest value within half a
            wavelength}} of those that can be judged where the grid has them to its order; and
            {receiver: names of the fields that arrived there}.
        """
        error: dict[str, dict[str, float]] = {}
        heard: dict[str, set[str]] = {}
        for receiver, own in exact.items():
            position = self.field.receivers[receiver]
            clear = not blurred(self.field, position)
            for name, value in own.items():
                scale = self.scale(position, name, value)
                if scale is None:
                    continue
                heard.setdefault(receiver, set()).add(name)
                if clear:
                    off = float(np.abs(self.field.at(position, name) - value).max()) / scale
                    error.setdefault(receiver, {})[name] = off
        return error, heard

    def hidden(self, record: Float, sigma: float, name: str) -> float:
        """Most that a record's end and rounding may add to its transform at ω + iσ.

        Args:
            record: shape (nt, …), of one field.
            sigma: σ, rad/s.
            name: of the field.

        Returns:
            Unit of the field times s.
        """
        t = self.field.t
        tail = float(np.abs(record[t > t[-1] * (1 - TAIL)]).max(initial=0.0))
        late = tail * float(np.exp(-sigma * t[-1]))
        return (late + ROUNDING * self.overall(name)) / sigma


def reach(simulated: Simulation, position: float) -> float:
    """Half the longest wavelength at a source's peak about a place, m; the bar without one."""
    bar = simulated.bar
    # A recorded signal with a mean peaks at 0 Hz.
    peaked = [s.peak_frequency for s in simulated.sources if 0 < s.peak_frequency < np.inf]
    speed = simulated.layers.at(position).fastest
    return max(speed / 2 / min(peaked) if peaked else bar.length, 2 * bar.order * bar.spacing)


def blurred(field: Field | Simulation, position: float) -> str:
    """Why the grid does not have a signal at a place to the order of its differences; "" if it has.

    On an end differences are one-sided, and next to a point source the field has a kink
    (macro-fields) or a jump (micro-fields), across which nothing can be interpolated.
    """
    bar = field.bar
    if not bar.periodic and min(position, bar.length - position) <= _ON_END * bar.spacing:
        return "on an end"
    if beside_a_source(field, position):
        return f"within {bar.order} cells of a point source"
    return ""


def beside_a_source(field: Field | Simulation, position: float) -> bool:
    """Whether differences and interpolation at a place reach over a point source."""
    reach = field.bar.order * field.bar.spacing * (1 - 1e-9)
    points = [s.position for s in field.sources if s.acts == "body" and s.width == 0]
    return any(abs(position - x) < reach for x in points)
