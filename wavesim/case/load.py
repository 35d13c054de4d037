"""A case file as what it describes: one simulation, and what is to be read off it. No jax."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import tomli_w

from wavesim.case.layered_case import BarLayers, bar_layers, builder
from wavesim.case.messages import place
from wavesim.case.schema import AnalysisTable, BandTable, CaseError, CaseFile, read
from wavesim.grid.bar import Bar, layered_bar
from wavesim.grid.points import sampling, spread
from wavesim.grid.summation_by_parts import closure
from wavesim.material.layers import End, Layers, as_layers, check_follow
from wavesim.material.medium import Medium
from wavesim.material.scaling import JUDGED, judged_range
from wavesim.simulation.simulation import Simulation, check_carried
from wavesim.sources import Source

# Length of the absorbing layer at an end, in branch lengths of the medium there.
_ABSORBER = 8
# What an end must be for a source to drive it.
_DRIVEN_END: dict[str, End] = {"surface": "free", "prescribed": "fixed"}


@dataclass(frozen=True)
class Case:
    """What a case file says.

    Attributes:
        title: of the case.
        simulation: what is simulated.
        analysis: what is read from the field.
        k_range: wavenumbers between which branches of an endless bar are judged, rad/m.
        material: its medium and layers as the file has them.
        tables: the file's tables, every default filled in but those of [time] and [analysis].
        notes: what was taken otherwise than it was written, as the grid has it.
    """

    title: str
    simulation: Simulation
    analysis: AnalysisTable
    k_range: tuple[float, float]
    material: BarLayers
    tables: dict[str, Any]
    notes: tuple[str, ...] = ()

    @property
    def medium(self) -> Medium:
        """That of [medium], which layers inherit from."""
        return self.material.medium

    def resolved(self, solver: str, step: float) -> str:
        """The case as TOML, every default filled in; a run of it repeats this one."""
        tables = dict(self.tables)
        settled = {"solver": solver, "step": step, "samples": self.simulation.frames}
        tables["time"] = tables["time"] | settled
        if self.simulation.endless:
            low, high = self.k_range
            tables["analysis"] = tables["analysis"] | {"k_min": low, "k_max": high}
        bands = [{k: v for k, v in b.items() if v is not None} for b in tables["analysis"]["bands"]]
        own = tables["analysis"] | {"bands": bands}
        tables["analysis"] = {k: v for k, v in own.items() if v is not None}
        return tomli_w.dumps(tables)


def load(path: str | Path, overrides: Sequence[str] = ()) -> Case:
    """Read a case file, lay overrides over it, and build what it describes.

    Args:
        path: of the TOML file.
        overrides: "table.key=value", value in TOML.

    Raises:
        CaseError: anything that can't be used; the message names file, key, value and remedy.
    """
    return build(read(path, overrides), str(path))


def build(file: CaseFile, name: str) -> Case:
    """Build what the tables of a case file describe; name and errors as of :func:`load`."""
    for heading in file.missing:
        raise CaseError(
            f"{name}: {heading}: required, but not given; add it (what needs no simulation, as "
            "bands, gaps or design, does without)"
        )
    make, known = builder(name), bar_layers(file, name)
    medium, stretches, ends = known.medium, known.stretches, known.ends
    media = [m for layer in stretches for m in layer.ends] or [medium]
    finest = min(media, key=lambda m: float(m.length_scale))
    sized = not stretches or file.bar.length is not None or file.bar.cells is not None
    plain = make(("bar",), file.bar.build, finest) if sized else None
    notes: list[str] = []
    if stretches:  # each gets cells of its own size, so that all their lengths are kept
        length = stretches[-1].end
        if plain:
            length = file.bar.length or plain.length
    elif plain:
        length, rounded = plain.length, file.bar.rounded(plain)
        notes += [rounded] if rounded else []
    for number, one in enumerate(known.places):
        last = number + 1 == len(stretches)
        make(one.where, check_follow, stretches[: number + 1], length, last)
    layers = known.layers
    order = file.bar.order
    widest = file.bar.spacing or (plain.spacing if plain else float(finest.length_scale) / 8)
    # Less where a layer is too thin for the closures.
    spacings = [min(widest, layer.thickness / closure(order).cells) for layer in stretches]
    absorber = make(("bar",), _absorber, file, ends, (media[0], media[-1]), length)
    bar = make(("bar",), _whole, plain, layers, length, spacings, order, ends, absorber)
    of_bar = layers or as_layers(medium, bar.length)
    sources = []
    for number, entry in enumerate(file.sources):
        where = ("sources", str(number))
        source = make(where, entry.build, bar.length)
        make(where, medium.family.excited, [source.field])
        source, taken = _on_grid(source, number, file, bar)
        notes += taken
        if source.acts in _DRIVEN_END:
            make(where, _check_end, source, entry, ends)
        else:
            make(where, spread, bar, source.position, source.width, source.staggered)
        make(where, check_carried, source, of_bar, bar)
        sources.append(source)
    receivers = {}
    for number, receiver in enumerate(file.receivers):
        position = _within(receiver.position, file, bar)
        make(("receivers", str(number)), sampling, bar, position, False)
        receivers[receiver.name] = position
    duration, solver = file.time.duration, file.time.solver
    samples, step = (None if v == "auto" else v for v in (file.time.samples, file.time.step))
    timed = duration, samples, receivers, solver, step
    simulation = make(("time",), Simulation, of_bar, bar, tuple(sources), *timed)
    for number, band in enumerate(file.analysis.bands):
        make(("analysis", "bands", str(number)), _check_band, band, simulation)
    judged = (0.0, 0.0)
    if simulation.endless:
        judged = make(("analysis",), _judged, file.analysis, medium, bar)
    tables = _resolved(file, known, bar, absorber, sources)
    return Case(file.title, simulation, file.analysis, judged, known, tables, tuple(notes))


def _within(position: float, file: CaseFile, bar: Bar) -> float:
    """A position, at the end of the bar where that was rounded down past it."""
    given = file.bar.length or 0.0
    return min(position, bar.length) if position <= given <= bar.length + bar.spacing else position


def _on_grid(source: Source, number: int, file: CaseFile, bar: Bar) -> tuple[Source, list[str]]:
    """A source as the grid of a bar has it, and what is to be said of that."""
    changed: dict[str, float] = {"position": _within(source.position, file, bar)}
    said = []
    cell = min(size for _, size in bar.all_stretches)
    if source.acts == "body" and 0 < source.width < cell:
        changed["width"] = 0.0
        said.append(
            f"{place(('sources', str(number)))} width = {source.width:g}: less than a cell of the "
            f"grid, {cell:g} m; taken for a point, width = 0"
        )
    same = all(getattr(source, key) == value for key, value in changed.items())
    return source if same else dataclasses.replace(cast(Any, source), **changed), said


def _judged(analysis: AnalysisTable, medium: Medium, bar: Bar) -> tuple[float, float]:
    """Wavenumbers between which branches are judged, held to what the bar resolves."""
    lowest, highest = judged_range(medium)
    low, high = analysis.k_min or lowest, analysis.k_max or highest
    if low >= high:
        raise ValueError(
            f"k_min = {low:g}: must be below k_max = {high:g} rad/m (k̄ = {JUDGED[0]:g} and "
            f"{JUDGED[1]:g} are the defaults); give the other too"
        )
    if high > math.pi / bar.spacing:
        raise ValueError(
            f"k_max = {high:g}: the grid holds wavenumbers up to {math.pi / bar.spacing:.5g} "
            "rad/m; take that or less, or a finer [bar] spacing"
        )
    if high * bar.length < 4 * math.pi:
        raise ValueError(
            f"k_max = {high:g}: the bar of {bar.length:.4g} m holds only multiples of "
            f"{2 * math.pi / bar.length:.4g} rad/m, and at least two are needed; raise k_max, or "
            f"lengthen the bar to {4 * math.pi / high:.3g} m"
        )
    return low, high


def _check_band(band: BandTable, simulated: Simulation) -> None:
    """Hold a band to a run that tells of T in it."""
    bar, layers, family = simulated.bar, simulated.layers, simulated.medium.family
    if band.sector not in family.travelling:
        raise ValueError(
            f'sector = "{band.sector}": must be one of {", ".join(family.travelling)}; in others '
            "nothing travels"
        )
    driven = {b.sector for b in simulated.blocks if b.macro}
    if band.sector not in driven:
        raise ValueError(
            f'sector = "{band.sector}": no source drives it; add [[sources]] of one of its fields'
        )
    if (bar.left, bar.right) != ("absorbing", "absorbing") or len(layers.layers) < 2:
        raise ValueError(
            f"from = {band.low:g}: nothing stands between half-spaces to let a band through; take "
            'layers, and [bar] left = "half-space", right = "half-space"'
        )


def _resolved(
    file: CaseFile, known: BarLayers, bar: Bar, absorber: float, sources: Sequence[Source]
) -> dict[str, Any]:
    """The file's tables with every default of them filled in, but for [time] and [analysis]."""
    tables = file.model_dump(by_alias=True, exclude={"design"})
    own = known.medium
    tables["medium"] |= own.keys | own.parameters
    tables["bar"] |= {"left": known.ends[0], "right": known.ends[1]}
    tables["bar"].pop("length", None)
    if known.layers:  # which have the length, and each cells of its own
        tables["bar"].pop("cells", None)
    else:
        tables["bar"] |= {"cells": bar.cells, "spacing": bar.spacing}
    if absorber:
        tables["bar"]["absorber"] = absorber
    tables["layers"] = [
        one.table.resolved(layer, file.medium)
        for one, layer in zip(known.places, known.stretches, strict=True)
    ]
    tables["sources"] = [
        table.resolved(source) for table, source in zip(file.sources, sources, strict=True)
    ]
    for name in ("medium", "bar"):
        tables[name] = {key: value for key, value in tables[name].items() if value is not None}
    return tables


def _absorber(
    file: CaseFile, ends: tuple[End, End], media: tuple[Medium, Medium], whole: float
) -> float:
    """Length of the absorbing layers; they must leave something of the bar."""
    absorbing = [m for end, m in zip(ends, media, strict=True) if end == "absorbing"]
    if not absorbing:
        return 0.0
    length = file.bar.absorber or _ABSORBER * max(float(m.length_scale) for m in absorbing)
    if len(absorbing) * length >= whole:
        raise ValueError(
            f"absorber = {length:g}: the absorbing layers leave nothing of the bar of "
            f"{whole:g} m; take less than {whole / len(absorbing):g}, or lengthen the bar"
        )
    return length


def _whole(
    plain: Bar | None,
    layers: Layers | None,
    length: float,
    spacings: Sequence[float],
    order: int,
    ends: tuple[End, End],
    absorber: float,
) -> Bar:
    """The bar with its ends, and with a stretch of the grid for each layer."""
    if layers is not None:
        return layered_bar(layers, spacings, order, *ends, absorber)
    if plain is None:
        cells = max(1, round(length / spacings[0]))
        plain = Bar(cells, length / cells, order)
    return dataclasses.replace(plain, left=ends[0], right=ends[1], absorber=absorber)


def _check_end(source: Source, table: Any, ends: tuple[End, End]) -> None:
    """Hold a source that drives an end to what that end is."""
    end = ends[0] if table.end == "left" else ends[1]
    needed = _DRIVEN_END[source.acts]
    if end != needed:
        raise ValueError(
            f'drive = "{source.drive}": acts at a {needed} end, and [bar] {table.end} = "{end}"; '
            f'set that to "{needed}", or take another drive'
        )
