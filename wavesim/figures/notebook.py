"""Pictures of what a notebook shows: media, layers, bars, runs, fields, waves."""

from __future__ import annotations

from functools import partial, singledispatch
from io import BytesIO
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wavesim.figures.bands import LINE_STYLES, band_figure
from wavesim.figures.bar_section import bar_section
from wavesim.figures.field import spacetime
from wavesim.figures.style import GAP, MAP, STYLE, title
from wavesim.grid.bar import Bar
from wavesim.layered.transmission import Transmission
from wavesim.material.arguments import checked
from wavesim.material.layers import Layers
from wavesim.material.medium import Medium
from wavesim.material.shown import KHZ, decibels
from wavesim.readings.dispersion.extract import Measured
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.records.run_folder import Run
from wavesim.simulation.field import Field
from wavesim.simulation.simulation import Simulation


def picture(thing: Any, **options: Any) -> Figure:
    """The figure of a thing, which a notebook shows by itself.

    Args:
        thing: one of the classes below.
        options: of its kind, see :func:`draw`.

    Raises:
        ValueError: it has no picture, or no such option.
    """
    own = checked(draw.dispatch(type(thing)), f"plot of {type(thing).__name__}")
    with matplotlib.rc_context(STYLE):
        figure = own(thing, **options)
        FigureCanvasAgg(figure)
    figure._repr_png_ = partial(_png, figure)  # type: ignore[attr-defined]
    return figure


def _png(figure: Figure) -> bytes:
    with matplotlib.rc_context(STYLE), BytesIO() as image:
        figure.savefig(image, format="png", dpi=110)
        return image.getvalue()


@singledispatch
def draw(thing: Any, **options: Any) -> Figure:
    """What :func:`picture` shows, by kind: options are those of the functions registered here."""
    raise ValueError(f"{type(thing).__name__}: has no picture")


@draw.register
def _(medium: Medium, k_bar_max: float = 0.5, omega_bar_max: float | None = None) -> Figure:
    return band_figure(medium, k_bar_max, omega_bar_max)


@draw.register
def _(field: Field) -> Figure:
    return spacetime(field)


@draw.register
def _(run: Run) -> Figure:
    return spacetime(run.field)


@draw.register
def _(simulation: Simulation) -> Figure:
    there = Field(simulation, simulation.times, {})
    return bar_section(there, list(dict.fromkeys(b.sector for b in simulation.blocks)))


@draw.register
def _(measured: Measured, lowest: float = -80.0) -> Figure:
    """Power over k and ω in dB, and the tops of its ridges; lowest: dB at the map's foot."""
    found = measured.spectrum
    figure = Figure(figsize=(6.4, 4.4))
    axes = figure.subplots()
    level = decibels(np.sqrt(found.power), float(np.sqrt(found.power.max())))
    image = axes.pcolormesh(
        found.k, found.omega * KHZ, level.T, cmap=MAP, vmin=lowest, vmax=0.0, rasterized=True
    )
    figure.colorbar(image, ax=axes, label="power (dB)")
    for ridge in measured.ridges:
        some = slice(None, None, max(1, len(ridge.k) // 40))
        found_at = ridge.k[some], ridge.omega[some] * KHZ
        axes.plot(*found_at, "o", ms=5, mfc="none", mew=1.2, color="#00b7c7")
    axes.set(xlabel="k (rad/m)", ylabel="ω/2π (kHz)", title=title([measured.block]))
    return figure


@draw.register
def _(points: BranchPoints) -> Figure:
    """Valid points by branch with their 95 % bars; k in space has its decay beside it."""
    figure = Figure(figsize=(8.0 if points.in_space else 5.2, 4.0))
    panels = figure.subplots(1, 2 if points.in_space else 1, squeeze=False, sharey=True)[0]
    for branch in points.branches:
        own = points.take((points.branch == branch) & points.valid)
        frequency, label = own.omega.real * KHZ, f"branch {branch + 1}"
        across = {"yerr": own.bar * KHZ} if not points.in_space else {"xerr": own.bar}
        panels[0].errorbar(own.k.real, frequency, **across, fmt=".", ms=3, lw=0.8, label=label)
        if points.in_space:
            panels[1].errorbar(own.k.imag, frequency, **across, fmt=".", ms=3, lw=0.8)
    panels[0].set(xlabel="Re k (rad/m)" if points.in_space else "k (rad/m)", ylabel="ω/2π (kHz)")
    if points.in_space:
        panels[1].set(xlabel="Im k (1/m)")
    if points.branches:
        panels[0].legend()
    return figure


@draw.register
def _(found: Transmission) -> Figure:
    """Energy transmitted and reflected, in dB over frequency."""
    figure = Figure(figsize=(6.4, 3.6))
    axes = figure.subplots()
    for values, label, style in (
        (found.power_T, "transmitted", LINE_STYLES[0]),
        (found.power_R, "reflected", LINE_STYLES[1]),
    ):
        axes.plot(found.omega.real * KHZ, decibels(np.sqrt(values)), ls=style, label=label)
    axes.set(xlabel="ω/2π (kHz)", ylabel="energy (dB)")
    axes.legend()
    return figure


@draw.register
def _(bar: Bar) -> Figure:
    """Its stretches and ends, and the size of its cells."""
    figure = Figure(figsize=(6.4, 1.8))
    axes = figure.subplots()
    edges = np.cumsum([0.0, *(cells * size for cells, size in bar.all_stretches)])
    sizes = [size * 1e6 for _, size in bar.all_stretches]
    axes.stairs(sizes, edges * 1e3, color="black")
    for at, end in ((0.0, bar.left), (bar.length, bar.right)):
        if end == "absorbing":
            inner = bar.absorber if at == 0.0 else bar.length - bar.absorber
            axes.axvspan(at * 1e3, inner * 1e3, **GAP)
    axes.set(xlabel="x (mm)", ylabel="cell (µm)", ylim=(0.0, None))
    axes.set_title(f"{bar.left} – {bar.right}")
    return figure


def _varying(layers: Layers) -> str:
    """The last parameter that differs along a bar, or the last of all."""
    every = [medium.keys for medium in layers.media]
    names = list(layers.first.parameters)
    return next(
        (n for n in reversed(names) if len({repr(keys.get(n)) for keys in every}) > 1), names[-1]
    )


@draw.register
def _(layers: Layers, parameter: str | None = None) -> Figure:
    """One parameter of the medium along the bar, by its name in the case file; one that varies."""
    parameter = parameter or _varying(layers)
    x = np.concatenate([np.linspace(one.start, one.end, 41) for one in layers.layers])
    values = np.concatenate(
        [
            [float(one.at(at).parameters[parameter]) for at in np.linspace(one.start, one.end, 41)]
            for one in layers.layers
        ]
    )
    figure = Figure(figsize=(6.4, 2.2))
    axes = figure.subplots()
    axes.plot(x * 1e3, values, color="black")
    axes.set(xlabel="x (mm)", ylabel=parameter)
    return figure
