"""The paper's Figures 3 to 6 drawn anew, the closures side by side."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wavesim.figures.bands import (
    LINE_STYLES,
    add_hertz_axis,
    add_wavenumber_axis,
    colour_of,
    hatch_full_gaps,
    heading,
    shade_gaps,
)
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.paper.claims import CLOSURES
from wavesim.paper.statements import A_VALUES, ETA_VALUES, K_BAR, Study
from wavesim.planewave.dispersion_relation import block_frequencies
from wavesim.planewave.eigenproblem import Float

SECTORS = ROTATION.unlike
# Rows of the three parts of Figure 3, from the highest branch down.
BRANCHES = {
    "longitudinal": ("LO2", "LO1", "LA"),
    "transverse2": ("TO2", "TO1", "TA"),
    "inplane": ("TSO(23)", "TSO[23]"),
}
_NAMES_IN_MATHS = {
    "LA": "LA",
    "LO1": "LO ($B_D$)",
    "LO2": "LO ($\\bar B$)",
    "TA": "TA",
    "TO1": "TO ($B_{[12]}$)",
    "TO2": "TO ($B_{(12)}$)",
    "TSO[23]": "TSO ($B_{[23]}$)",
    "TSO(23)": "TSO ($B_{(23)}$ and $B_{22}-B_{33}$)",
}
_DASHES: tuple[Any, ...] = ("-", (0, (6, 1.5)), "--", "-.", ":")


def _outer_axes(panels: Any, wavenumbers: bool, labels: list[str] | None = None) -> None:
    """SI beside the last column and, where the abscissa is k̄, above the first row; row labels."""
    medium = Medium()
    for axes in panels[:, -1]:
        add_hertz_axis(axes, medium)
    for i, axes in enumerate(panels[:, 0]):
        axes.set_ylabel(f"{labels[i]}\n$\\bar\\omega$" if labels else "$\\bar\\omega$")
    if wavenumbers:
        for axes in panels[0]:
            add_wavenumber_axis(axes, medium)


def dispersion_figure(studies: dict[str, Study], sector: str) -> Figure:
    """Figure 3, one sector: each branch for a = 0 … 1, rows by branch, columns by closure."""
    rows = BRANCHES[sector]
    figure = Figure(figsize=(10.0, 1.2 + 2.5 * len(rows)), layout="constrained")
    panels = figure.subplots(len(rows), len(studies), sharex=True, sharey="row", squeeze=False)
    colours = colormaps["viridis"](np.linspace(0.0, 0.78, 5))
    chosen = [int(np.argmin(np.abs(A_VALUES - a))) for a in (0.0, 0.25, 0.5, 0.75, 1.0)]
    handles = []
    for column, (closure, study) in zip(panels.T, studies.items(), strict=True):
        for axes, name in zip(column, rows, strict=True):
            handles = [
                axes.plot(
                    K_BAR,
                    study.branch[name][i],
                    color=colour,
                    ls=dash,
                    lw=1.5,
                    label=f"a = {A_VALUES[i]:g}",
                )[0]
                for i, colour, dash in zip(chosen, colours, _DASHES, strict=True)
            ]
            axes.set_xlim(0.0, 1.0)
            axes.margins(y=0.25 if sector == "inplane" else 0.08)
            if name in ("LA", "TA"):
                axes.set_ylim(bottom=0.0)
            axes.text(
                0.97,
                0.06,
                _NAMES_IN_MATHS[name],
                transform=axes.transAxes,
                ha="right",
                va="bottom",
                fontsize=9,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5},
            )
        column[0].set_title(closure, fontsize=10)
        column[-1].set_xlabel("$\\bar k = kl/2\\pi$")
    _outer_axes(panels, wavenumbers=True)
    figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False)
    return figure


# Rows of the figures that compare a = 0, where closures coincide, with each at a = 0.5.
_CASES = [
    ("all closures, a = 0", "printed", 0.0),
    *((f"{closure}, a = 0.5", closure, 0.5) for closure in CLOSURES),
]


def gap_figure() -> Figure:
    """Figure 4: the bands and their gaps, for a = 0 and for each closure at a = 0.5."""
    figure = Figure(figsize=(10.0, 12.0), layout="constrained")
    panels = figure.subplots(len(_CASES), 3, sharex=True, sharey=True)
    for row, (_, closure, a) in zip(panels, _CASES, strict=True):
        medium = Medium(anisotropy=a, closure=closure)
        k = K_BAR * 2 * math.pi / medium.length_scale
        for axes, sector in zip(row, SECTORS, strict=True):
            dashes = iter(LINE_STYLES)
            for block in ROTATION.blocks_of(sector):
                for omega in block_frequencies(medium, block, k).T:
                    axes.plot(
                        K_BAR,
                        omega * medium.time_scale,
                        color=colour_of(ROTATION, sector),
                        ls=next(dashes),
                        lw=1.6,
                    )
            shade_gaps(axes, medium, sector)
            hatch_full_gaps(axes, medium)
            axes.set_xlim(0.0, 0.5)
            axes.set_ylim(0.0, 2.0)
    labels = [label for label, _, _ in _CASES]
    return _by_sector(
        figure, panels, "$\\bar k = kl/2\\pi$", labels,
        "grey: gap of the sector; hatched: no wave of any kind", wavenumbers=True,
    )  # fmt: skip


def _by_sector(
    figure: Figure, panels: Any, x_label: str, labels: list[str], note: str, wavenumbers: bool
) -> Figure:
    """The figure with titles of its columns, axes and a note below."""
    for axes, sector in zip(panels[0], SECTORS, strict=True):
        axes.set_title(heading(ROTATION, sector), fontsize=10)
    for axes in panels[-1]:
        axes.set_xlabel(x_label)
    _outer_axes(panels, wavenumbers, labels)
    figure.supxlabel(note, fontsize=9)
    return figure


def _edges_panel(
    axes: Axes, x: Float, lower: dict[str, Float], upper: dict[str, Float], sector: str
) -> None:
    """Gap edges of one sector over a parameter: lower dashed, upper solid, between them shaded."""
    colour = colour_of(ROTATION, sector)
    inside = slice(len(x) // 8, -(len(x) // 8))
    for name, alpha in zip(ROTATION.gap_names(sector), (0.45, 0.2), strict=False):
        low, high = lower[name], upper[name]
        axes.fill_between(x, low, high, color=colour, alpha=alpha, lw=0)
        axes.plot(x, low, color=colour, ls="--", lw=1.4)
        axes.plot(x, high, color=colour, ls="-", lw=1.4)
        i = len(x) // 8 + int(np.argmax((high - low)[inside]))
        axes.annotate(
            name,
            (x[i], 0.5 * (low[i] + high[i])),
            ha="center",
            va="center",
            fontsize=8,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.0},
        )
    axes.set_xlim(x[0], x[-1])


def _edges_figure(rows: list[tuple[str, Float, Any]], x_label: str, limits: Any) -> Figure:
    figure = Figure(figsize=(10.0, 0.8 + 2.6 * len(rows)), layout="constrained")
    panels = figure.subplots(len(rows), 3, sharex=True, sharey=True)
    for row, (_, x, (lower, upper)) in zip(panels, rows, strict=True):
        for axes, sector in zip(row, SECTORS, strict=True):
            _edges_panel(axes, x, lower, upper, sector)
            axes.set_ylim(*limits)
    labels = [label for label, _, _ in rows]
    note = "solid: upper edge (cutoff); dashed: lower edge (asymptote)"
    return _by_sector(figure, panels, x_label, labels, note, wavenumbers=False)


def stiffness_ratio_figure(studies: dict[str, Study]) -> Figure:
    """Figure 5: gap edges against η, for a = 0 and for each closure at a = 0.5."""
    rows = [(label, ETA_VALUES, studies[closure].over_eta(a)) for label, closure, a in _CASES]
    return _edges_figure(rows, "stiffness ratio η", (0.0, 1.8))


def anisotropy_figure(studies: dict[str, Study]) -> Figure:
    """Figure 6: gap edges against a for each closure, η = 0.5."""
    rows = [(closure, A_VALUES, study.over_a) for closure, study in studies.items()]
    return _edges_figure(rows, "anisotropy a", (0.7, 1.8))
