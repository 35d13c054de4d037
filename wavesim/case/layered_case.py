"""What a case file says of the bar's material: its medium, its layers, its ends. No grid yet.

What needs no simulation, such as transmission or a design, reads a case by this alone.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from wavesim.case.medium_tables import MOST_REPEATS, LayerTable
from wavesim.case.messages import place
from wavesim.case.schema import (
    HALF_SPACE,
    BandTable,
    BarTable,
    CaseError,
    CaseFile,
    distinct,
    read,
)
from wavesim.material.layers import End, Layer, Layers, check_follow
from wavesim.material.medium import Medium
from wavesim.planewave.hyperbolicity import check_hyperbolic, check_reckoned
from wavesim.planewave.many_media import doubtful

# A half-space is, in a run, a buffer of so many branch lengths: an absorber, and room for a source
# and a receiver.
BUFFER = 24


@dataclass(frozen=True)
class Placed:
    """A layer of the bar, groups written out.

    Attributes:
        where: the path to its table, such as ("layers", "1", "layers", "0").
        table: its table.
        start, end: m.
    """

    where: tuple[str, ...]
    table: LayerTable
    start: float
    end: float


@dataclass(frozen=True)
class BarLayers:
    """The material of a case.

    Attributes:
        title: of the case.
        medium: of [medium], which layers inherit from; of the layer where one is all.
        places: where the table of each layer stands; of a half-space's buffer, [bar].
        stretches: the layers; none where the case gives none.
        ends: of the bar; a half-space's buffer ends in an absorbing one.
        bands: those of [analysis] and [design], each once.
    """

    title: str
    medium: Medium
    places: tuple[Placed, ...]
    stretches: tuple[Layer, ...]
    ends: tuple[End, End]
    bands: tuple[BandTable, ...] = ()

    @property
    def layers(self) -> Layers | None:
        """The layers as one bar; None where it is uniform."""
        some = self.stretches
        if not some or (len(some) == 1 and some[0].last is None):
            return None
        return Layers(some)


def builder(name: str) -> Callable[..., Any]:
    """A function that makes something of a table, and tells what is wrong with it.

    Returns:
        build(where, make, *arguments): make(*arguments), whose ValueError becomes a CaseError that
        names the table at that path.
    """

    def build(where: tuple[str, ...], make: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return make(*arguments)
        except ValueError as error:
            raise CaseError(f"{name}: {place(where)} {error}") from None
        except ArithmeticError:
            raise CaseError(
                f"{name}: {place(where)} its numbers are too large, or too small, to reckon with; "
                "see that they are in SI units"
            ) from None

    return build


def bar_layers(file: CaseFile, name: str) -> BarLayers:
    """The material of a case.

    Raises:
        CaseError: anything that can't be used; the message names file, key, value and remedy.
    """
    make = builder(name)
    medium = make(("medium",), file.medium.build)
    make(("medium",), check_hyperbolic, medium)
    bar = file.bar
    make(("bar",), _check_half_spaces, bar, file.layers)
    places = make(("layers",), _with_buffers, bar, file.layers, float(medium.length_scale))
    stretches: list[Layer] = []
    media: dict[Medium, tuple[str, ...]] = {}  # each medium is looked at once
    for one in places:
        layer = make(one.where, one.table.build, file.medium, one.start, one.end)
        for end in layer.ends:
            media.setdefault(end, one.where)
        stretches.append(layer)
        make(one.where, check_follow, stretches[-2:], max(one.end, stretches[-1].end))
    for (end, where), doubted in zip(media.items(), doubtful(tuple(media)), strict=True):
        make(where, check_hyperbolic if doubted else check_reckoned, end)
    if len(stretches) == 1 and stretches[0].last is None:
        medium = stretches[0].medium
    ends = tuple("absorbing" if end == HALF_SPACE else end for end in (bar.left, bar.right))
    bands = distinct([*file.analysis.bands, *file.design.bands])
    return BarLayers(file.title, medium, tuple(places), tuple(stretches), ends, bands)  # type: ignore[arg-type]


def load_layers(path: str | Path, overrides: Sequence[str] = ()) -> BarLayers:
    """The material of a case file; arguments and errors as of :func:`wavesim.case.load.load`."""
    return bar_layers(read(path, overrides), str(path))


def _check_half_spaces(bar: BarTable, tables: Sequence[LayerTable]) -> None:
    for side, end in (("left", bar.left), ("right", bar.right)):
        if end == HALF_SPACE and not tables:
            raise ValueError(
                f'{side} = "{HALF_SPACE}": stands beside layers, and there are none; add '
                '[[layers]], or take "absorbing"'
            )


def _placed(tables: Sequence[LayerTable], begin: float) -> list[Placed]:
    """The layers of a case in order, each where it stands, from a position (m) on.

    Raises:
        ValueError: there are more than can be meant.
    """
    found: list[Placed] = []

    def put(inside: Sequence[LayerTable], path: tuple[str, ...]) -> None:
        for number, table in enumerate(inside):
            where = (*path, str(number))
            if table.group:
                for _ in range(table.repeat or 1):
                    put(table.layers, (*where, "layers"))
                continue
            if len(found) >= MOST_REPEATS:
                raise ValueError(f"more than {MOST_REPEATS} layers; lower a repeat")
            start = table.start
            if start is None:
                start = found[-1].end if found else begin
            end = start + table.thickness if table.end is None else table.end  # type: ignore[operator]
            found.append(Placed(where, table, start, end))

    put(tables, ("layers",))
    return found


def _with_buffers(bar: BarTable, tables: Sequence[LayerTable], unit: float) -> list[Placed]:
    """The layers where they stand, with a buffer of [medium] for each half-space."""
    length = BUFFER * unit
    own = LayerTable(thickness=length)
    first = [Placed(("bar",), own, 0.0, length)] if bar.left == HALF_SPACE else []
    found = _placed(tables, length if first else 0.0)
    given = next((p for p in found if p.table.start is not None), None)
    if first and given is not None:
        raise ValueError(
            f"number {int(given.where[1]) + 1}: from = {given.start:g}: [bar] left = "
            f'"{HALF_SPACE}" puts a buffer before the first layer; give thickness in place of from '
            "and to"
        )
    if bar.right != HALF_SPACE:
        return first + found
    last = found[-1].end
    return [*first, *found, Placed(("bar",), own, last, last + length)]


@dataclass(frozen=True)
class VariedKey:
    """A key and what it reaches.

    Attributes:
        key: as it is written, such as "layers.1.layers.0.thickness".
        name: "thickness" or a parameter of Medium.
        layers: indices of the layers of the bar, counted from 0, buffers of half-spaces too.
        end: of graded layers "first" or "last" where one number of a pair is meant, else "both".
    """

    key: str
    name: str
    layers: tuple[int, ...]
    end: Literal["first", "last", "both"] = "both"


def varied_key(known: BarLayers, key: str) -> VariedKey:
    """What a key reaches.

    Args:
        known: of :func:`wavesim.case.layered_case.load_layers`.
        key: "medium.NAME", "layers.N.NAME", "layers.N.layers.M.NAME", numbers from 0; of a graded
            parameter "….NAME.0" and "….NAME.1" are its two ends.

    Raises:
        ValueError: it reaches nothing; the message says what there is.
    """
    parts = key.split(".")
    end: Literal["first", "last", "both"] = "both"
    if len(parts) > 2 and parts[-1] in ("0", "1") and not parts[-2].isdigit():
        end = "first" if parts[-1] == "0" else "last"
        parts = parts[:-1]
    *table, name = parts
    names = ("thickness", *known.medium.known())
    if name not in names:
        near = difflib.get_close_matches(name, names, 1)
        hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(names)}"
        raise ValueError(f'key = "{key}": {name!r} can\'t be varied; {hint}')
    if table == ["medium"] and name != "thickness":
        found = [n for n, p in enumerate(known.places) if getattr(p.table, name) is None]
        if not found:
            raise ValueError(
                f'key = "{key}": reaches nothing, as every layer has {name} of its own; name a '
                "layer's, such as layers.0." + name
            )
    else:
        found = [n for n, p in enumerate(known.places) if list(p.where) == table]
        if not found:
            tables = dict.fromkeys(".".join(p.where) for p in known.places if p.where[0] != "bar")
            some = [*tables, *([] if name == "thickness" else ["medium"])]
            shown = ", ".join([*some[:6], *(["…", some[-1]] if len(some) > 6 else [])])
            raise ValueError(
                f'key = "{key}": no layer stands at {".".join(table) or "the top"}; name one of '
                f"{shown}"
                if some
                else "the case has no [[layers]]: add some"
            )
    own = [known.places[n].table for n in found]
    if name == "thickness" and any(t.thickness is None for t in own):
        raise ValueError(
            f'key = "{key}": the layer has from and to; give it thickness in place of them'
        )
    if end != "both" and not all(isinstance(getattr(t, name), list) for t in own):
        raise ValueError(f'key = "{key}": {name} is no pair there; leave .{key[-1]} out')
    return VariedKey(key, name, tuple(found), end)
