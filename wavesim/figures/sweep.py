"""Maps of a sweep: what was measured over the keys that were varied."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wavesim.figures.style import FOUND, Drawings, symbol
from wavesim.material.family import known_field
from wavesim.material.shown import KHZ, decibels
from wavesim.planewave.gap_map import room

_MAP = matplotlib.colormaps["viridis"]
# Levels below this are one colour, dB.
_LOW = -60.0
# What differs by less, relatively, is the same.
_ROUNDING = 1e-9
# Panels of one figure.
_MOST_PANELS = 12
# Units of axes: what one of SI is in that shown.
_SHOWN = {"m": (1e3, "mm"), "Hz": (1e-3, "kHz"), "s": (1e6, "µs")}


def sweep_figures(data: Any) -> Drawings:
    """Maps of all that a sweep measured, by name of the file.

    A quantity is drawn over the one or two keys of a grid; of three or more over the first two, at
    the middle of the others; of a sample as points over its first two keys. Members that failed
    are left white, or are grey crosses. Gaps that hold the band asked for are hatched on a grid.

    Args:
        data: the dataset (xarray) of ``wavesim.studies.sweep``.
    """
    drawings: Drawings = {
        name: partial(_figure, data, panels) for name, panels in _quantities(data).items() if panels
    }
    if "T" in data and "member" not in data["status"].dims:
        for sector in data["sector"].values:
            drawings[f"levels_{sector}"] = partial(_levels, data, str(sector))
    return drawings


def _quantities(data: Any) -> dict[str, dict[str, tuple[Any, str]]]:
    """{figure: {panel: (values over the members, unit)}}."""
    found: dict[str, dict[str, tuple[Any, str]]] = {}
    if "lower" in data:
        width = (data["upper"] - data["lower"]) * KHZ
        media = [str(name) for name in width["medium"].values] if "medium" in width.dims else [""]
        for number, medium in enumerate(media):
            own = width.sel(medium=medium) if medium else width
            panels = {
                _width_of(own.sel(gap=gap)): (own.sel(gap=gap), "kHz") for gap in own["gap"].values
            }
            found[f"gaps_{number}" if medium else "gaps"] = {
                f"{medium}: {name}" if medium else name: panel for name, panel in panels.items()
            }
    if "T" in data:
        energy = data["transmitted"].mean("frequency")
        unit = f"part of the incident, mean of {data.sizes['frequency']} frequencies"
        found["transmission"] = {
            f"{sector}: transmitted energy": (energy.sel(sector=sector), unit)
            for sector in energy["sector"].values
        }
    if "peak" in data:
        peak = data["peak"]
        for name in peak["field"].values:
            unit = known_field(str(name)).unit
            found[f"peak_{name}"] = {
                f"largest {symbol(str(name))} at {receiver}": (
                    peak.sel(field=name, receiver=receiver),
                    unit,
                )
                for receiver in peak["receiver"].values[:_MOST_PANELS]
            }
    return found


def _width_of(own: Any) -> str:
    """A gap's width in words."""
    gap = str(own["gap"].values)
    if gap == "full":
        return "widest full gap"
    family, dash, rest = gap.rpartition("-")
    return f"widest full gap, {family}" if dash and rest == "full" else f"width of {gap}"


def _levels(data: Any, sector: str) -> Figure:
    """20 log₁₀|T| over frequency and each key, the other keys at the middle of their ranges."""
    keys = [str(name) for name in data["status"].dims if data.sizes[name] > 1]
    keys = keys[:3] or [str(data["status"].dims[0])]
    figure = Figure(figsize=(0.6 + 3.9 * len(keys), 3.6), layout="constrained")
    places = figure.subplots(1, len(keys), squeeze=False, sharey=True)[0]
    for axes, key in zip(places, keys, strict=True):
        middle = {name: data.sizes[name] // 2 for name in data["status"].dims if name != key}
        own = data["T"].sel(sector=sector).isel(middle).transpose("frequency", key)
        level = decibels(own.values)
        shown: Any = {"cmap": _MAP, "vmin": _LOW, "vmax": 0.0, "shading": "nearest"}
        image = axes.pcolormesh(_along(data, key), data["frequency"] / 1e3, level, **shown)
        told = _held(data, middle)
        axes.set_title(f"at {told}" if told else sector)
        axes.set_xlabel(_label(data, key))
    places[0].set_ylabel("frequency (kHz)")
    figure.colorbar(image, ax=list(places), label=f"|T|, {sector} (dB)", extend="min")
    return figure


def _figure(data: Any, panels: Mapping[str, tuple[Any, str]]) -> Figure:
    across = min(3, len(panels))
    down = -(-len(panels) // across)
    figure = Figure(figsize=(0.6 + 3.6 * across, 0.6 + 2.8 * down), layout="constrained")
    places = figure.subplots(down, across, squeeze=False)
    for axes, (title, (values, unit)) in zip(places.flat, panels.items(), strict=False):
        axes.set_title(title)
        _panel(axes, data, values, unit)
    for axes in places.flat[len(panels) :]:
        axes.set_visible(False)
    return figure


def _panel(axes: Axes, data: Any, values: Any, unit: str) -> None:
    members = data["status"].dims
    keys = [str(name) for name in data.coords if data[name].dims and data[name].dims[0] in members]
    values = _even(values)
    if "member" in data["status"].dims:
        _points(axes, data, keys, values, unit)
        return
    x, *others = (str(name) for name in data["status"].dims)
    held = {name: data.sizes[name] // 2 for name in others[1:]}
    values = values.isel(held)
    if held:
        axes.set_title(f"{axes.get_title()}\nat {_held(data, held)}")
    axes.set_xlabel(_label(data, x))
    if not others:
        # A mean hangs on which narrow peaks its frequencies meet: no line from one to the next.
        line = "o" if "mean" in unit else "o-"
        axes.plot(_along(data, x), values, line, ms=3, lw=1.2, color=FOUND)
        axes.set_ylabel(unit)
        return
    y = others[0]
    axes.set_ylabel(_label(data, y))
    shown = values.transpose(y, x).values
    image = axes.pcolormesh(_along(data, x), _along(data, y), shown, cmap=_MAP, shading="nearest")
    there = shown[np.isfinite(shown)]
    if len(there) and np.ptp(there) == 0:  # a bar of colours would make up a range
        image.set_visible(False)
        axes.text(
            0.5, 0.5, f"{there[0]:g} {unit} throughout", transform=axes.transAxes, ha="center"
        )
        return
    axes.figure.colorbar(image, ax=axes, label=unit)
    if data.attrs.get("band") and "gap" in values.coords:
        there = room(data, data.attrs["band"])
        own = {name: values[name] for name in there.dims if name in values.coords}
        inside = (there.sel(own) >= 0).transpose(y, x).values.astype(float)
        if inside.any():
            over = _along(data, x), _along(data, y), inside
            axes.contourf(*over, [0.5, 1.5], colors="none", hatches=["xx"])
            axes.contour(*over, [0.5], colors=FOUND, linewidths=1.8)


def _even(values: Any) -> Any:
    """The values; their mean throughout where they differ by rounding alone, which an axis or a bar
    of colours would spread over all its length."""
    if not np.isfinite(values).any():
        return values
    low, high = float(values.min()), float(values.max())
    if high - low > _ROUNDING * max(abs(low), abs(high)):
        return values
    return values.where(~np.isfinite(values), float(values.mean()))


def _points(axes: Axes, data: Any, keys: list[str], values: Any, unit: str) -> None:
    there = np.isfinite(values.values)
    axes.set_xlabel(_label(data, keys[0]))
    if len(keys) == 1:
        axes.plot(_along(data, keys[0])[there], values[there], "o", ms=3, color=FOUND)
        axes.set_ylabel(unit)
        return
    axes.set_ylabel(_label(data, keys[1]))
    x, y = (_along(data, key) for key in keys[:2])
    axes.plot(x[~there], y[~there], "x", ms=4, color="0.6")
    image = axes.scatter(x[there], y[there], c=values.values[there], s=14, cmap=_MAP)
    axes.figure.colorbar(image, ax=axes, label=unit)


def _along(data: Any, key: str) -> Any:
    """Values of a key in the unit of its axis."""
    return data[key].values * _SHOWN.get(data[key].attrs.get("units"), (1.0, ""))[0]


def _label(data: Any, key: str) -> str:
    unit = data[key].attrs.get("units", "1")
    return key if unit == "1" else f"{key} ({_SHOWN.get(unit, (1.0, unit))[1]})"


def _held(data: Any, places: Mapping[str, int]) -> str:
    """The keys that are held, each at one of its values."""
    return ", ".join(
        f"{_label(data, name)} = {_along(data, name)[at]:.4g}" for name, at in places.items()
    )
