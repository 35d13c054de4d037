"""What a bar is made of, from its left end to its right: layers, uniform or graded, and its ends.

Both routes share this: it holds no grid. Positions in m, from the left end.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from wavesim.material.arguments import checked
from wavesim.material.case_tables import grouped, medium_table, rounded
from wavesim.material.medium import Medium
from wavesim.material.shown import Shown, quantity

End = Literal["periodic", "fixed", "free", "absorbing"]
Grading = Literal["smooth", "linear"]

ENDS: tuple[str, ...] = ("periodic", "fixed", "free", "absorbing")
GRADINGS: tuple[str, ...] = ("smooth", "linear")
# Places at which a graded layer is looked at where the medium at every point is meant.
GRADES = 9


@checked
@dataclass(frozen=True)
class Layer:
    """A stretch of the bar, of one medium or graded from one to another.

    Where it is graded every parameter p goes from that of ``medium`` at the start to that of
    ``last`` at the end, p(s) = p₀ + (p₁ − p₀) w(s), s = (x − start)/(end − start), with

        w = s³(10 − 15 s + 6 s²)  ("smooth", level to second order at both ends)  or  w = s.

    Args:
        start, end: where it begins and ends, m.
        medium: its medium, or that at its start. Its closure and loss law hold throughout.
        last: the medium at its end; None where it is uniform.
        grading: "smooth" or "linear".

    Raises:
        ValueError: it has no thickness, or the two media differ in family, closure or loss law.
    """

    start: float
    end: float
    medium: Medium
    last: Medium | None = None
    grading: Grading = "smooth"

    def __post_init__(self) -> None:
        if not (math.isfinite(self.start) and math.isfinite(self.end) and self.end > self.start):
            raise ValueError(
                f"from = {self.start:g}, to = {self.end:g}: must have a thickness greater than 0"
            )
        if self.start < 0:
            raise ValueError(f"from = {self.start:g}: must be 0 or greater; the bar begins at 0")
        if self.grading not in GRADINGS:
            raise ValueError(f"grading = {self.grading!r}: must be one of {', '.join(GRADINGS)}")
        if self.last is not None and self.last.family is not self.medium.family:
            raise ValueError("family: must be the same at both ends of a graded layer")
        if self.last is not None and (
            self.last.closure != self.medium.closure or self.last.damping != self.medium.damping
        ):
            raise ValueError("closure, damping: must be the same at both ends of a graded layer")

    @property
    def thickness(self) -> float:
        """end − start, m."""
        return self.end - self.start

    @property
    def ends(self) -> tuple[Medium, ...]:
        """Its medium, or both of a graded one."""
        return (self.medium,) if self.last is None else (self.medium, self.last)

    def mapped(self, change: Callable[[Medium], Medium]) -> Layer:
        """The same layer with its medium, or both, changed."""
        last = None if self.last is None else change(self.last)
        return dataclasses.replace(self, medium=change(self.medium), last=last)

    def sampled(self, places: int = GRADES) -> tuple[Medium, ...]:
        """Its medium, or those at so many places from its start to its end where it is graded."""
        if self.last is None:
            return (self.medium,)
        if (GRADES - 1) % (places - 1) == 0:
            return self._grades[:: (GRADES - 1) // (places - 1)]
        return tuple(self.at(float(x)) for x in np.linspace(self.start, self.end, places))

    @functools.cached_property
    def _grades(self) -> tuple[Medium, ...]:
        return tuple(self.at(float(x)) for x in np.linspace(self.start, self.end, GRADES))

    def weight(self, position: Any) -> Any:
        """w at positions within the layer, of any shape, m."""
        s = np.clip((position - self.start) / self.thickness, 0.0, 1.0)
        return graded_weight(s, self.grading)

    def at(self, position: float) -> Medium:
        """The medium at a position within the layer, m."""
        if self.last is None:
            return self.medium
        return self.medium.towards(self.last, float(self.weight(position)))


def graded_weight(s: Any, grading: Grading) -> Any:
    """w of s, the part of a graded layer that lies behind, 0 to 1, any shape: see Layer."""
    return s**3 * (10 - 15 * s + 6 * s**2) if grading == "smooth" else s


@checked
@dataclass(frozen=True, repr=False)
class Layers(Shown):
    """The layers of a bar, in order, without gaps or overlaps.

    Args:
        layers: at least one; the first starts at 0.

    Raises:
        ValueError: they do not follow each other; the message says where.
    """

    layers: tuple[Layer, ...]

    def __post_init__(self) -> None:
        if not self.layers:
            raise ValueError("layers = []: at least one layer is needed")
        for number in range(1, len(self.layers) + 1):
            try:
                check_follow(self.layers[max(number - 2, 0) : number], self.layers[-1].end)
            except ValueError as error:
                raise ValueError(f"layer {number}: {error}") from None

    def told(self) -> dict[str, str]:
        """Where each layer lies and what it is of."""
        return {
            f"{quantity(layer.start, 'm')} – {quantity(layer.end, 'm')}": repr(layer.medium)
            + ("" if layer.last is None else f" → {layer.last!r}, {layer.grading}")
            for layer in self.layers
        }

    def mapped(self, change: Callable[[Medium], Medium]) -> Layers:
        """The same layers with every medium changed."""
        return Layers(tuple(layer.mapped(change) for layer in self.layers))

    @property
    def length(self) -> float:
        """Of the bar, m."""
        return self.layers[-1].end

    @property
    def interfaces(self) -> tuple[float, ...]:
        """Where one layer meets the next, m."""
        return tuple(layer.end for layer in self.layers[:-1])

    @property
    def uniform(self) -> bool:
        """Whether it is one layer that is not graded."""
        return len(self.layers) == 1 and not self.graded

    @property
    def graded(self) -> bool:
        """Whether any of them is."""
        return any(layer.last is not None for layer in self.layers)

    @functools.cached_property
    def media(self) -> tuple[Medium, ...]:
        """Its media from left to right, each once; of a graded layer those at nine places."""
        found = [medium for layer in self.layers for medium in layer.sampled()]
        try:
            return tuple(dict.fromkeys(found))
        except TypeError:  # numbers that jax holds have no hash
            return tuple(found)

    @property
    def inner_media(self) -> tuple[Medium, ...]:
        """Media between the first and the last layer, each once, both of a graded layer; all of
        a bar of no more than two layers."""
        inner = self.layers[1:-1] or self.layers
        return tuple(dict.fromkeys(medium for layer in inner for medium in layer.ends))

    @property
    def lossy(self) -> bool:
        """Whether anything is lost in a layer."""
        return any(layer.medium.damping for layer in self.layers)

    @property
    def conserves_energy(self) -> bool:
        """Whether the equations of every layer conserve energy, losses apart."""
        return all(medium.conserves_energy for medium in self.media)

    @functools.cached_property
    def first(self) -> Medium:
        """The medium at the left end, whose units the program scales by."""
        return self.layers[0].at(0.0)

    def tables(self) -> dict[str, Any]:
        """{"medium": …, "layers": […]}: itself as tables of a case file, layers by thickness.

        [medium] is that of the first layer, and a layer gives what it has otherwise; a sequence
        that repeats is written once. Numbers have fourteen digits.

        Raises:
            ValueError: a loss law has no keys in a case file.
        """
        ends = [_end_tables(layer) for layer in self.layers]
        every = [table for pair in ends for table in pair]
        # What some medium goes without can't be inherited.
        common = {k: v for k, v in every[0].items() if all(k in table for table in every)}
        own = []
        for layer, (first, *others) in zip(self.layers, ends, strict=True):
            table: dict[str, Any] = {"thickness": rounded(layer.thickness)}
            last = others[0] if others else first
            for key, value in first.items():
                if last[key] != value:
                    table[key] = [value, last[key]]
                elif key not in common or common[key] != value:
                    table[key] = value
            if others:
                table["grading"] = layer.grading
            own.append(table)
        return {"medium": common, "layers": grouped(own)}

    def case_text(self, left: str = "absorbing", right: str = "absorbing", **tables: Any) -> str:
        """Itself as the text of a case file.

        Args:
            left, right: ends of the bar, as in [bar].
            tables: others of the file, such as title="…", bar={"spacing": 6.25e-5},
                sources=[{…}], receivers=[{…}], time={"duration": 1e-4}.

        Raises:
            ValueError: as :meth:`tables`.
        """
        from tomli_w import dumps

        bar = {"left": left, "right": right} | tables.pop("bar", {})
        head = {"title": tables.pop("title", "")}
        whole = self.tables()
        return dumps(
            head | {"medium": whole["medium"], "bar": bar, "layers": whole["layers"]} | tables
        )

    def layer_at(self, position: float) -> Layer:
        """The layer that holds a position; at an interface the one to its right."""
        for layer in self.layers:
            if position < layer.end:
                return layer
        return self.layers[-1]

    def at(self, position: float) -> Medium:
        """The medium at a position, m."""
        return self.layer_at(position).at(position)


def _end_tables(layer: Layer) -> list[dict[str, Any]]:
    """What a case file says of a layer's medium, or of both of a graded one, by the same keys."""
    tables = [medium_table(medium) for medium in layer.ends]
    keys = dict.fromkeys(key for table in tables for key in table)
    return [
        {key: table[key] if key in table else rounded(medium.parameters[key]) for key in keys}
        for table, medium in zip(tables, layer.ends, strict=True)
    ]


def as_layers(medium: Medium | Layers | Sequence[Layer], length: float) -> Layers:
    """Layers of a bar from what a caller gives: a medium, layers, or a list of them.

    Raises:
        ValueError: layers do not follow each other, or do not end where the bar does.
    """
    if isinstance(medium, Medium):
        return Layers((Layer(0.0, length, medium),))
    if not isinstance(medium, Layers) and not (
        isinstance(medium, Sequence) and all(isinstance(layer, Layer) for layer in medium)
    ):
        raise ValueError(f"medium = {medium!r}: must be a Medium, Layers, or a list of Layer")
    layers = medium if isinstance(medium, Layers) else Layers(tuple(medium))
    check_follow(layers.layers, length, whole=True)
    return layers


def check_follow(layers: Sequence[Layer], length: float, whole: bool = False) -> None:
    """Hold the last of some layers to the one before it, and to the bar's end.

    Raises:
        ValueError: it leaves a stretch without a medium, overlaps the one before, or passes the
            end of the bar; or the bar goes on past all of them.
    """
    layer, slack = layers[-1], 1e-9 * length
    reached = layers[-2].end if len(layers) > 1 else 0.0
    if layer.start > reached + slack:
        raise ValueError(
            f"from = {layer.start:g}: no layer covers x = {reached:g} to {layer.start:g} m; begin "
            f"this one at {reached:g}"
        )
    if layer.start < reached - slack:
        raise ValueError(
            f"from = {layer.start:g}: overlaps the layer before it, which ends at {reached:g} m; "
            f"begin it at {reached:g}, and give layers from left to right"
        )
    if layer.end > length + slack:
        raise ValueError(
            f"to = {layer.end:g}: the bar ends at {length:g} m; end it there, or lengthen the bar"
        )
    if whole and layer.end < length - slack:
        raise ValueError(
            f"to = {layer.end:g}: no layer covers x = {layer.end:g} to {length:g} m; end it with "
            "the bar, or add a layer"
        )
