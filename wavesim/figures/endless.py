"""Figures of what was measured of an endless bar, beside the theory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wavesim.figures.style import (
    FOUND,
    HALO,
    MAP,
    ON_MAP,
    POINT,
    RECORD,
    RECORD_MARK,
    Drawings,
    cell_ends,
    gap_edges,
    second_axes,
    shade,
    thin,
    title,
)
from wavesim.material.medium import Medium
from wavesim.material.shown import DECIBELS, KHZ
from wavesim.planewave.dispersion_relation import block_oscillations, wavenumber
from wavesim.simulation.field import Field
from wavesim.verdict.branches import Held

_LEVEL = 120.0
# Branches whose ends are nearer than this part of the axis have their names in one place.
_APART = 0.03


def dispersion(field: Field, held: Sequence[Held], sector: str) -> Figure:
    """2D spectrum of a sector with the theory over it and the recovered points on the theory."""
    figure = Figure(figsize=(5.6, 4.6))
    axes = figure.subplots()
    image = spectrum_panel(axes, field, held, sector)
    medium = field.medium
    second_axes(
        axes,
        (1e3 * medium.length_scale / 2 / np.pi, "k̄ = k l/2π"),
        (medium.time_scale / KHZ, "ω̄"),
    )
    axes.set_title(title(medium.family.blocks_of(sector)))
    figure.colorbar(image, ax=axes, label="power (dB)")
    return figure


def spectrum_panel(axes: Axes, field: Field, held: Sequence[Held], sector: str) -> Any:
    """What :func:`dispersion` shows, on given axes; returns the image."""
    own = [h for h in held if h.measured.block.sector == sector]
    found = own[0].measured.spectrum
    size = min(len(h.measured.spectrum.omega) for h in own)
    power = np.sum([h.measured.spectrum.power[:, :size] for h in own], axis=0)
    medium = field.medium
    top = found.omega[size - 1] * KHZ
    image = axes.imshow(
        10 * np.log10(np.maximum(thin(power.T, (1200, 4096)) / (power.max() or 1.0), 1e-12)),
        origin="lower",
        aspect="auto",
        extent=(*cell_ends(found.k / 1e3, 4096), *cell_ends(found.omega[:size] * KHZ, 1200)),
        cmap=MAP,
        vmin=-80,
        vmax=0,
        interpolation="nearest",
    )
    shade(axes, gap_edges(medium, sector), upright=False, at=0.015)
    k = np.linspace(0, found.k[-1], 400)
    for h in own:
        exact = block_oscillations(medium, h.measured.block, k)
        lines = axes.plot(k / 1e3, exact * KHZ, color=ON_MAP, lw=1.0, ls=(0, (4, 4)))
        lines[0].set_label("plane-wave solver" if h is own[0] else None)
        for branch in h.branches:
            shown = branch.k > 0
            every = max(1, int(shown.sum()) // 26)
            axes.plot(
                branch.k[shown][::every] / 1e3, branch.omega[shown][::every] * KHZ, "o", **POINT,
                mec=FOUND, label="recovered" if branch is own[0].branches[0] else None,
            )  # fmt: skip
    axes.set(
        xlim=(0, found.k[-1] / 1e3),
        ylim=_extent(own, found.k[-1], medium, top),
        xlabel="k (rad/mm)",
        ylabel="ω/2π (kHz)",
    )
    _name_branches(axes, own, medium, float(found.k[-1]))
    axes.legend(loc="lower right")
    return image


def _name_branches(axes: Axes, own: Sequence[Held], medium: Medium, k: float) -> None:
    """The name of each branch at its end; those that end as one share a place."""
    low, high = axes.get_ylim()
    ends: list[tuple[float, list[str]]] = []
    fine = np.linspace(0.0, k, 200)
    named = []
    for h in own:
        branches = block_oscillations(medium, h.measured.block, fine).T * KHZ
        for omega, name in zip(branches, h.measured.block.branches, strict=True):
            if omega[-1] <= high:
                named.append((float(omega[-1]), name))
            elif omega[0] < high:  # where it leaves the picture
                axes.annotate(
                    name, (fine[int(np.argmax(omega > high))] / 1e3, high), (-7, -4),
                    textcoords="offset points", ha="right", va="top", fontsize=8,
                    path_effects=HALO,
                )  # fmt: skip
    for frequency, name in sorted(named):
        if ends and frequency - ends[-1][0] < _APART * (high - low):
            ends[-1][1].append(name)
        else:
            ends.append((frequency, [name]))
    for frequency, names in ends:
        axes.annotate(
            ", ".join(names), (0.985 * k / 1e3, frequency), (0, 4),
            textcoords="offset points", ha="right", va="bottom", fontsize=8,
            path_effects=HALO, annotation_clip=False,
        )  # fmt: skip


def _extent(own: Sequence[Held], k: float, medium: Medium, top: float) -> tuple[float, float]:
    """Frequencies (kHz) between which a dispersion figure is drawn: all branches, with room."""
    ends = [block_oscillations(medium, h.measured.block, [0.0, k]) for h in own]
    low, high = (edge(np.concatenate(ends, axis=1)) * KHZ for edge in (np.min, np.max))
    return (0.75 * low if low < top else 0.0), min(top, 1.08 * high)


def attenuation(field: Field, held: Held) -> Figure:
    """Level over distance and frequency, and complex wavenumber, measured and exact."""
    curve, block = held.measured.attenuation, held.measured.block
    assert curve is not None
    assert held.k_exact is not None
    medium = field.medium
    figure = Figure(figsize=(6.2, 7.2))
    level, loss, real = figure.subplots(3, 1, sharex=True, height_ratios=(1.2, 1, 1))
    frequency = curve.omega * KHZ
    shown = thin(curve.level.T, (600, 4096))
    image = level.imshow(
        np.maximum(shown, -_LEVEL),
        origin="lower",
        aspect="auto",
        cmap=MAP,
        vmin=-_LEVEL,
        vmax=0,
        extent=(*cell_ends(frequency, 4096), *cell_ends(curve.distance * 1e3, 600)),
    )
    level.set(xlim=(frequency[0], frequency[-1]))
    level.set_ylabel("distance from source (mm)")
    figure.colorbar(image, ax=level, label="level (dB)")
    attenuation_panel(loss, field, held)
    _wavenumber_panel(real, field, held, np.real, 1e-3, "Re k (rad/mm)")
    real.set_xlabel("ω/2π (kHz)")
    figure.legend(*loss.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    second_axes(level, (medium.time_scale / KHZ, "ω̄"), None)
    second_axes(loss, None, (1e3 / DECIBELS * medium.length_scale, "Im k l"))
    second_axes(real, None, (1e3 * medium.length_scale / 2 / np.pi, "Re k l/2π"))
    level.set_title(
        title(medium.family.blocks_of(block.sector)) + f",  σ = {curve.sigma:.3g} rad/s"
    )
    return figure


def attenuation_panel(axes: Axes, field: Field, held: Held) -> None:
    """Attenuation against frequency, measured and exact, on given axes."""
    per_decibel = 1e-3 * DECIBELS
    _wavenumber_panel(axes, field, held, np.imag, per_decibel, "attenuation (dB/mm)")


def _wavenumber_panel(
    axes: Axes, field: Field, held: Held, part: Callable[[Any], Any], unit: float, label: str
) -> None:
    """A part of k(ω), measured and exact."""
    curve, block = held.measured.attenuation, held.measured.block
    assert curve is not None
    assert held.k_exact is not None
    medium = field.medium
    w = np.linspace(curve.omega[0], curve.omega[-1], 2000)
    damped = wavenumber(medium, block.sector, w + 1j * curve.sigma)
    plain = wavenumber(medium, block.sector, w)
    shade(axes, gap_edges(medium, block.sector))
    axes.plot(w * KHZ, part(plain) * unit, "-", color=FOUND, lw=1.4,
              label="steady wave (real ω): exact")  # fmt: skip
    axes.plot(w * KHZ, part(damped) * unit, "-", color=RECORD, lw=1.0,
              label="record (ω + iσ): exact")  # fmt: skip
    label_of_marks = "record (ω + iσ): simulated"
    measured = part(curve.k) * unit
    axes.plot(curve.omega * KHZ, measured, "o", **POINT, mec=RECORD_MARK, label=label_of_marks)
    axes.set_ylabel(label)
    top = np.nanmax(part(held.k_exact)) * unit
    axes.set_ylim(-0.04 * top, 1.25 * top)


def of_measurement(field: Field, held: Sequence[Held]) -> Drawings:
    """Figures that show what was measured of a field, beside the theory, not drawn yet."""
    drawings: Drawings = {}
    for sector in dict.fromkeys(h.measured.block.sector for h in held):
        drawings[f"dispersion_{sector}"] = partial(dispersion, field, held, sector)
    for h in held:
        if h.k_exact is not None:
            drawings[f"attenuation_{h.measured.block.sector}"] = partial(attenuation, field, h)
    return drawings
