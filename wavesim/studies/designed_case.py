"""The case that a design is: what a run takes as it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from wavesim.case.layered_case import BUFFER, BarLayers
from wavesim.case.schema import HALF_SPACE
from wavesim.case.toml_text import lay_over
from wavesim.studies.design_problem import Problem

# In branch lengths: where a source stands, and how far receivers are from the specimen.
_SOURCE, _AWAY = 12, 5
# Cells to a branch length: those tried first, and what is taken where they do not serve.
_TRIED, _CELLS = (10, 14), 20
# A source's width in branch lengths.
_WIDTH = 0.5
# A Ricker of this part of the highest frequency wished drives little of what is above that.
_PEAK = 0.45
# Periods of the middle of the bands that a run lasts.
_PERIODS = 80


def designed_tables(
    tables: dict[str, Any],
    own: Problem,
    values: Sequence[float],
    serves: Callable[[dict[str, Any]], bool] = lambda tables: False,
) -> dict[str, Any]:
    """Tables of a case that a run takes as it is.

    Args:
        tables: of the file, changed in place.
        own: what was asked in it.
        values: of the variables.
        serves: whether the grid of such tables does.

    Returns:
        The same without [design], whose bands become those of [analysis], with ends that absorb,
        and a source, receivers and a duration where it had none.
    """
    for varied, value in zip(own.keys, values, strict=True):
        lay_over(tables, f"{varied.key}={float(value)!r}")
    analysis = tables.setdefault("analysis", {})
    asked = [*analysis.get("bands", []), *tables.pop("design")["bands"]]
    asked = [{key: v for key, v in band.items() if key != "weight"} for band in asked]
    analysis["bands"] = [band for n, band in enumerate(asked) if band not in asked[:n]]
    title = tables.get("title")
    tables["title"] = f"{title} (designed)" if title else "A designed stack"
    unit = float(own.known.medium.length_scale)
    if any(varied.name == "thickness" for varied in own.keys):
        for key in ("length", "cells"):
            tables.get("bar", {}).pop(key, None)
    first, last = _ends(tables, unit, own.known)
    inner = own.length(values)
    low = min(wish.low for wish in own.wishes)
    high = max(wish.high for wish in own.wishes)
    if "sources" not in tables:
        family = own.known.medium.family
        sectors = dict.fromkeys(wish.sector for wish in own.wishes)
        macro = {block.sector: next(iter(block.macro[0])) for block in family.blocks if block.macro}
        tables["sources"] = [
            {
                "field": macro[s],
                "position": _SOURCE * unit,
                "peak_frequency": _short(_PEAK * high),
                "width": _WIDTH * unit,
            }
            for s in sectors
        ]
    if "receivers" not in tables:
        tables["receivers"] = [
            {"name": "before", "position": _short(first - _AWAY * unit)},
            {"name": "behind", "position": _short(first + inner + min(_AWAY * unit, last / 3))},
        ]
    tables.setdefault("time", {"duration": _short(2 * _PERIODS / (low + high), 2)})
    bar = tables["bar"]
    if not {"cells", "spacing"} & set(bar):  # as small as the verdict on signals asks
        for cells in (*_TRIED, _CELLS):
            bar["spacing"] = _short(unit / cells)
            if cells in _TRIED and serves(tables):
                break
    order = ("title", "medium", "bar", "layers", "sources", "receivers", "time")
    return {k: tables[k] for k in order if k in tables} | tables


def _short(value: float, digits: int = 6) -> float:
    return float(f"{value:.{digits}g}")


def _ends(tables: dict[str, Any], unit: float, known: BarLayers) -> tuple[float, float]:
    """Ends that absorb behind buffers long enough, and the lengths of these, m."""
    bar = tables.setdefault("bar", {})
    lengths = []
    for side, index in (("left", 0), ("right", -1)):
        if bar.get(side) == HALF_SPACE:
            lengths.append(BUFFER * unit)
            continue
        bar[side] = "absorbing"
        table, length = tables["layers"][index], known.stretches[index].thickness
        if length < BUFFER * unit and "thickness" in table:
            length = table["thickness"] = BUFFER * unit
            for key in ("length", "cells"):
                bar.pop(key, None)
        lengths.append(length)
    return lengths[0], lengths[1]
