"""A case's tables as objects: medium, layers, bar, ends, sources. Nothing is settled of time."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.case import medium_tables as casemedia
from wavesim.case import source_tables as casesources
from wavesim.case.messages import place
from wavesim.case.schema import Case, CaseError
from wavesim.grid.bar import Bar, layered_bar
from wavesim.grid.stencils import modified_wavenumber
from wavesim.grid.summation_by_parts import closure
from wavesim.material.layers import End, Layer, Layers
from wavesim.material.medium import Medium
from wavesim.material.wave_equations import fastest_speed
from wavesim.planewave.dispersion_relation import check_hyperbolic
from wavesim.sources import Chirp, InitialField, Recorded, Source, ToneBurst

# A grid carries what it slows down by no more than this.
_PHASE_ERROR = 0.01
# Length of the absorbing layer at an end, in branch lengths of the medium there.
_ABSORBER = 8
# What an end must be for a source to drive it.
_DRIVEN_END: dict[str, End] = {"moment": "free", "rotation": "fixed"}


@dataclass(frozen=True)
class Parts:
    """What a case describes, before a run of it is planned.

    Attributes:
        medium: of the whole bar where it is uniform, else that of [medium], which gives the layers'
            defaults.
        layers: of the bar; None where it is uniform.
        bar: the grid.
        ends: left and right.
        absorber: length of the absorbing layer at each absorbing end, m; 0 where neither is.
        sources: at least one.
        receivers: {name: position in m}.
    """

    medium: Medium
    layers: Layers | None
    bar: Bar
    ends: tuple[End, End]
    absorber: float
    sources: tuple[Source, ...]
    receivers: dict[str, float]

    @property
    def media(self) -> tuple[Medium, ...]:
        """Every medium in the bar: one, or those at both ends of each layer."""
        if self.layers is None:
            return (self.medium,)
        return tuple(m for layer in self.layers.layers for m in _ends(layer))


def builder(name: str) -> Callable[..., Any]:
    """A function that makes something of a table, and tells what is wrong with it.

    Args:
        name: of the file, for messages.

    Returns:
        build(where, make, *arguments): make(*arguments), whose ValueError becomes a CaseError that
        names the table at that path.
    """

    def build(where: tuple[str, ...], make: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return make(*arguments)
        except ValueError as error:
            raise CaseError(f"{name}: {place(where)} {error}") from None

    return build


def assemble(case: Case, name: str) -> Parts:
    """Build what a case describes.

    Args:
        case: the tables.
        name: of the file, for messages.

    Raises:
        CaseError: anything that can't be used; the message names file, key, value and remedy.
    """
    build = builder(name)
    medium = build(("medium",), case.medium.build)
    build(("medium",), check_hyperbolic, medium)
    stretches: list[Layer] = []
    for number, table in enumerate(case.layers):
        where = ("layers", str(number))
        layer = build(where, table.build, case.medium)
        for end in _ends(layer):
            build(where, check_hyperbolic, end)
        stretches.append(layer)
    media = [m for layer in stretches for m in _ends(layer)] or [medium]
    finest = min(media, key=lambda m: float(m.branch_length))
    bar = build(("bar",), case.bar.build, finest)
    for number in range(len(stretches)):
        where = ("layers", str(number))
        build(where, casemedia.check_follow, stretches[: number + 1], bar.length)
    if stretches:
        build(where, casemedia.check_whole, stretches, bar.length)
    layers = casemedia.as_bar(stretches)
    if stretches and layers is None:
        medium = stretches[0].medium
    ends = (case.bar.left, case.bar.right)
    for number, layer in enumerate(layers.layers if layers else ()):
        build(("layers", str(number)), _check_thick, layer, bar)
    absorber = build(("bar",), _absorber, case, ends, (media[0], media[-1]), bar)
    bar = build(("bar",), _whole, bar, layers, ends, absorber)
    sources = []
    for number, entry in enumerate(case.sources):
        where = ("sources", str(number))
        source = build(where, entry.build, bar.length)
        if source.drive in _DRIVEN_END:
            build(where, _check_end, source, entry, ends)
        else:
            build(where, bar.spread, source.position, source.width, source.staggered)
        build(where, check_carried, source, media, bar)
        sources.append(source)
    for number, receiver in enumerate(case.receivers):
        where = ("receivers", str(number))
        build(where, bar.sampling, receiver.position, False)
    return Parts(
        medium,
        layers,
        bar,
        ends,
        absorber,
        tuple(sources),
        {receiver.name: receiver.position for receiver in case.receivers},
    )


def resolved(case: Case, parts: Parts) -> dict[str, Any]:
    """The case's tables with every default of them filled in, but for [time] and [analysis].

    Args:
        case: the tables, as given.
        parts: what they were built into.
    """
    tables = case.model_dump(by_alias=True)
    own = case.medium.build()
    tables["medium"] |= {"rotation_inertia": own.beta, "curvature_inertia": own.gamma}
    tables["bar"].pop("length", None)
    tables["bar"] |= {"cells": parts.bar.cells, "spacing": parts.bar.spacing}
    if parts.absorber:
        tables["bar"]["absorber"] = parts.absorber
    tables["layers"] = [
        casemedia.resolved(table.build(case.medium), table, case.medium) for table in case.layers
    ]
    tables["sources"] = [
        casesources.resolved(table, source)
        for table, source in zip(case.sources, parts.sources, strict=True)
    ]
    for name in ("medium", "bar"):
        tables[name] = {key: value for key, value in tables[name].items() if value is not None}
    return tables


def _ends(layer: Layer) -> tuple[Medium, ...]:
    return (layer.medium,) if layer.last is None else (layer.medium, layer.last)


def _absorber(case: Case, ends: tuple[End, End], media: tuple[Medium, Medium], bar: Bar) -> float:
    """Length of the absorbing layers; they must leave something of the bar."""
    absorbing = [m for end, m in zip(ends, media, strict=True) if end == "absorbing"]
    if not absorbing:
        return 0.0
    length = case.bar.absorber or _ABSORBER * max(float(m.branch_length) for m in absorbing)
    if len(absorbing) * length >= bar.length:
        raise ValueError(
            f"absorber = {length:g}: the absorbing layers leave nothing of the bar of "
            f"{bar.length:g} m; take less than {bar.length / len(absorbing):g}, or lengthen the bar"
        )
    return length


def _check_thick(layer: Layer, grid: Bar) -> None:
    """Hold a layer to the fewest cells that its closures take."""
    cells, least = max(1, round(layer.thickness / grid.spacing)), closure(grid.order).cells
    if cells >= least:
        return
    # A whole part of the spacing, as a bar's length is a whole number of cells.
    parts = math.ceil(least * grid.spacing / layer.thickness * (1 - 1e-9))
    raise ValueError(
        f"from = {layer.start:g}, to = {layer.end:g}: {layer.thickness:.4g} m is {cells} "
        f"cell{'s' if cells > 1 else ''} of [bar] spacing = {grid.spacing:.6g}, and order "
        f"{grid.order} needs {least} in a layer; take [bar] spacing = {grid.spacing / parts:.6g}, "
        "a lower [bar] order, or a thicker layer"
    )


def _whole(grid: Bar, layers: Layers | None, ends: tuple[End, End], absorber: float) -> Bar:
    """The bar with its ends, and with a stretch of the grid for each layer."""
    if layers is None:
        return dataclasses.replace(grid, left=ends[0], right=ends[1], absorber=absorber)
    return layered_bar(layers, grid.spacing, grid.order, *ends, absorber)


def _check_end(source: Source, table: Any, ends: tuple[End, End]) -> None:
    """Hold a source that drives an end to what that end is."""
    end = ends[0] if table.end == "left" else ends[1]
    needed = _DRIVEN_END[source.drive]
    if end != needed:
        raise ValueError(
            f'drive = "{source.drive}": acts at a {needed} end, and [bar] {table.end} = "{end}"; '
            f'set that to "{needed}", or take another drive'
        )


def check_carried(source: Source, media: Sequence[Medium], bar: Bar) -> None:
    """Hold a source's frequency to what the grid can carry in every medium of the bar.

    Raises:
        ValueError: the frequency is above :func:`highest_frequency`; of an initial field, it is
            too narrow.
    """
    if isinstance(source, InitialField):
        limit = _largest_phase(bar) / bar.spacing
        if source.highest_wavenumber > limit:
            least = source.width * source.highest_wavenumber / limit
            raise ValueError(
                f"width = {source.width:g}: the grid carries wavenumbers up to {limit:.4g} rad/m "
                f"(order {bar.order}; there a wave's phase is off by 1 %); take at least "
                f"{least:.3g}, or a finer [bar] spacing"
            )
        return
    key, frequency = _pitch(source)
    highest = min(highest_frequency(medium, bar) for medium in media)
    if frequency > highest:
        spacing = bar.spacing * highest / frequency
        raise ValueError(
            f"{key} = {frequency:g}: the grid carries at most "
            f"{highest:.4g} Hz (order {bar.order}; there the fastest wave's phase is off by 1 %); "
            f"lower it, or take [bar] spacing ≤ {spacing:.3g}"
        )


def _pitch(source: Source) -> tuple[str, float]:
    """The key that says how high a source goes, and that frequency, Hz."""
    if isinstance(source, ToneBurst):
        return "frequency", source.frequency
    if isinstance(source, Chirp):
        return "high", source.high
    if isinstance(source, Recorded):
        return "peak of the recorded spectrum", source.peak_frequency
    return "peak_frequency", source.peak_frequency


def highest_frequency(medium: Medium, bar: Bar) -> float:
    """Frequency at which the grid's phase error on the fastest wave reaches 1 %, Hz.

    The fastest wave has c_∞ = √(C_φφ/m_φ); at a given frequency it is the longest.
    """
    return fastest_speed(medium) * _largest_phase(bar) / bar.spacing / (2 * math.pi)


def _largest_phase(bar: Bar) -> float:
    """kh at which the differences slow a wave down by 1 %."""
    phase = np.linspace(1e-3, math.pi, 20001)
    slowing = 1 - modified_wavenumber(phase, 1.0, bar.order) / phase
    return float(np.interp(_PHASE_ERROR, slowing, phase))
