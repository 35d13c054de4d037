"""What all figures share: style, colours, axes in two units, shaded gaps, tiling, writing.

Colour maps are perceptually uniform and run from light to dark, and lines differ by style as well
as by colour, so that a figure can be read in grey.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wavesim.material.family import Block, known_field, sector_words
from wavesim.material.medium import Medium
from wavesim.material.shown import KHZ
from wavesim.planewave.dispersion_relation import open_gaps

Drawings = dict[str, Callable[[], Figure]]

STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "figure.dpi": 160,
    "savefig.dpi": 160,
    "figure.constrained_layout.use": True,
}
MAP = matplotlib.colormaps["magma_r"].with_extremes(under=(1.0, 1.0, 1.0, 0.0))
FOUND = "#c8102e"
HALO = [patheffects.withStroke(linewidth=2.2, foreground="white")]
THEORY = "#111111"
# A line that is seen on all of MAP, and on white.
ON_MAP = "#2a8fd6"
# What a record that ends tells at ω + iσ stands behind what a steady wave does.
RECORD, RECORD_MARK = "#8a97a3", "#5d6b78"
GAP: dict[str, Any] = {"facecolor": "#dfe3e7", "linewidth": 0, "zorder": -1}
LABEL: dict[str, Any] = {"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 0.8}
# A measured point, of any mark and colour of its edge.
POINT: dict[str, Any] = {"ms": 3.4, "mfc": "white", "mew": 0.9}
# Of branches and modes, told apart by both.
SHADES = ("#0b3954", "#c8102e", "#2f7f4f", "#7a3e9d", "#e08e1b", "#555555")
MARKS = ("o", "s", "^", "D", "v", "P")
# Characters of a name that a figure has room for.
_LONGEST = 46
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# What a file says of when it was made: left out, so that one figure is one file.
_DATED = {"pdf": "CreationDate", "svg": "Date"}


def symbol(name: str) -> str:
    """A field's symbol, such as φ₁."""
    return known_field(name).symbol


def as_written(name: str) -> str:
    """A name as it is: $ begins no formula, and _ does not keep it from the legend."""
    plain = name.replace("$", r"\$")
    return f"\N{THIN SPACE}{plain}" if plain.startswith("_") else plain


def name_in_title(name: str) -> str:
    """A record's name, or its ends where a figure has no room for all of it."""
    half = _LONGEST // 2
    return as_written(name if len(name) <= _LONGEST else f"{name[:half]} … {name[-half:]}")


def title(blocks: Sequence[Block]) -> str:
    """The sector of some blocks in words, with the fields that are coupled in it."""
    sector = blocks[0].sector
    parts = [part for block in blocks for part in block.macro + block.micro]
    held: dict[str, None] = {}
    for part in parts:
        if sum(part.keys() == other.keys() for other in parts) > 1:  # as good as each alone
            held |= dict.fromkeys(map(symbol, part))
            continue
        terms = [("+ " if w > 0 else "− ") + symbol(name) for name, w in part.items()]
        held[" ".join(terms).removeprefix("+ ")] = None
    return f"{sector_words(sector)}: {', '.join(held)}"


def second_axes(axes: Axes, x: tuple[float, str] | None, y: tuple[float, str] | None) -> None:
    """Put scaled axes opposite to the SI ones: (scaled units in one shown unit, label)."""
    if x is not None:
        top = axes.secondary_xaxis("top", functions=_scaling(x[0]))
        top.set_xlabel(x[1])
    if y is not None:
        right = axes.secondary_yaxis("right", functions=_scaling(y[0]))
        right.set_ylabel(y[1])


def _scaling(factor: float) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    return (lambda v: v * factor), (lambda v: v / factor)


def gap_edges(medium: Medium, sector: str, unit: float = KHZ) -> list[tuple[str, float, float]]:
    """Name, lower and upper edge of each open gap of a sector; a frequency is ω times unit."""
    return [(gap.name, gap.lower * unit, gap.upper * unit) for gap in open_gaps(medium, sector)]


def plot_branch(axes: Axes, number: int, x: Any, y: Any, error: Any, label: str) -> None:
    """Points of one branch among several, with their bars."""
    colour = SHADES[number % len(SHADES)]
    axes.errorbar(
        x, y, error, fmt=MARKS[number % len(MARKS)], **POINT, mec=colour, ecolor=colour,
        elinewidth=0.9, label=label,
    )  # fmt: skip


def legend_entries(*axes: Axes) -> tuple[list[Any], list[str]]:
    """Handles and labels of what is drawn on some axes, each label once."""
    found: dict[str, Any] = {}
    for one in axes:
        for handle, label in zip(*one.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    return list(found.values()), list(found)


def shade(
    axes: Axes,
    edges: Iterable[tuple[str, float, float]],
    upright: bool = True,
    named: bool = True,
    at: float = 0.985,
) -> None:
    """Shade gaps, each with its name.

    Args:
        axes: on which frequency runs along x, or along y if not upright.
        edges: of :func:`gap_edges`, in the axes' unit.
        upright: whether frequency runs along x.
        named: whether names are written.
        at: where along the other axis, as part of it, if frequency does not run along x.
    """
    for name, low, high in edges:
        (axes.axvspan if upright else axes.axhspan)(low, high, **GAP)
        if not named:
            continue
        middle = (low + high) / 2
        if upright:
            own, place = axes.get_xaxis_transform(), (middle, 0.97)
            turned: dict[str, Any] = {"rotation": 90, "ha": "center", "va": "top"}
        else:
            own, place = axes.get_yaxis_transform(), (at, middle)
            turned = {"ha": "right" if at > 0.5 else "left", "va": "center"}
        # Text is drawn however far off; an annotation, only where its place is seen.
        axes.annotate(
            name, place, xycoords=own, fontsize=7, bbox=LABEL, clip_on=True, annotation_clip=True,
            **turned,
        )  # fmt: skip


def bare_figure(width: float, height: float) -> Figure:
    """A figure of a size in inches whose layout nobody looks for: :func:`set_out` tells it."""
    with matplotlib.rc_context({"figure.constrained_layout.use": False}):
        return Figure(figsize=(width, height))


def set_out(figure: Figure, left: float = 0.72, right: float = 0.15, columns: int = 3) -> None:
    """Give a figure margins as they are told, and a legend of all its axes below them.

    To have a layout found takes twice as long as all the rest of a figure.

    Args:
        figure: of :func:`bare_figure`, all drawn; with a heading over all its axes, or without.
        left, right: margins for numbers and labels, inch.
        columns: of the legend.
    """
    handles, labels = legend_entries(*figure.axes)
    figure.legend(handles, labels, loc="lower center", ncols=columns)
    width, height = figure.get_size_inches()
    below = 0.5 + 0.175 * -(-len(labels) // columns)
    above = 0.55 if figure.get_suptitle() else 0.32
    figure.subplots_adjust(
        left=left / width, right=1 - right / width, bottom=below / height, top=1 - above / height,
        wspace=0.06, hspace=0.06,
    )  # fmt: skip


def decades(axes: Axes) -> None:
    """Make y logarithmic with its decades alone as ticks, in plain text, once all is drawn.

    Ticks between them, and formulas for 10ⁿ, take longer to draw than all else on the axes.
    """
    axes.set_yscale("log", subs=())
    axes.yaxis.set_major_formatter(lambda y, _: _power_of_ten(float(y)))
    low, high = np.log10(axes.get_ylim())
    if high - low < 2:  # so that there are two of them at least
        axes.set_ylim(10.0 ** np.floor(low), 10.0 ** np.ceil(high))


def _power_of_ten(y: float) -> str:
    exponent = round(np.log10(y)) if y > 0 else 0
    if not np.isclose(y, 10.0**exponent, atol=0):  # of a span that holds no two decades
        return f"{y:.3g}"
    return f"10{str(exponent).translate(_RAISED)}"


def thin(values: np.ndarray, pixels: tuple[int, int]) -> np.ndarray:
    """Largest value in each of so many tiles, for a picture of a large array."""
    for axis, most in enumerate(pixels):
        values = tiles(values, axis, -(-values.shape[axis] // most))
    return values


def cell_ends(at: np.ndarray, most: int) -> tuple[float, float]:
    """Where the outer cells of a picture of even values end, thinned to so many: half a step out.

    Args:
        at: what the values are at, even, shape (n,), n ≥ 2.
        most: of :func:`thin`.
    """
    step, each = float(at[-1] - at[0]) / (len(at) - 1), -(-len(at) // most)
    first = float(at[0]) - step / 2
    return first, first + step * each * -(-len(at) // each)


def tiles(values: np.ndarray, axis: int, step: int) -> np.ndarray:
    """Largest value in each tile of so many along an axis."""
    if step <= 1:
        return values
    return np.asarray(
        np.maximum.reduceat(values, np.arange(0, values.shape[axis], step), axis=axis)
    )


def warm_up() -> None:
    """Draw something small, so that fonts and the like are there for all forks that follow."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(2, 2))
        axes = figure.subplots()
        axes.plot([1.0, 2.0], [1.0, 100.0], "o-", label="φ₁ (µs)")
        axes.set(xlabel="ω/2π (kHz)")
        decades(axes)
        second_axes(axes, (2.0, "ω̄"), None)
        axes.legend()
        FigureCanvasAgg(figure).print_png(BytesIO())


def write(drawings: Drawings, folder: Path, kind: str = "png") -> list[Path]:
    """Draw figures and write them.

    Args:
        drawings: by name, of ``figures.field``, ``figures.endless`` or ``figures.bar``.
        folder: where to; made if need be.
        kind: of the files: png, pdf or svg.

    Returns:
        The files written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    with matplotlib.rc_context(STYLE):
        for name, draw in drawings.items():
            path = folder / f"{name}.{kind}"
            if kind == "png":
                # What savefig does, without its drawing every figure once more for the layout.
                FigureCanvasAgg(draw()).print_png(path, pil_kwargs={"compress_level": 1})
            else:
                draw().savefig(path, format=kind, metadata={_DATED[kind]: None})
            written.append(path)
    return written
