"""Figures of a run as jobs for a process beside it: one for each, which writes its file."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wavesim.figures import bar, endless
from wavesim.figures import field as of_fields
from wavesim.figures.style import STYLE, Drawings, second_axes, write
from wavesim.simulation.field import Field

Jobs = list[Callable[[], list[Path]]]


def of_field(folder: Path, field: Field) -> Jobs:
    """What draws the figures that show a field alone; it is read from its file by each."""
    return _jobs(folder, of_fields.of_field(field))


def of_measurement(folder: Path, field: Field, found: Any) -> Jobs:
    """What draws the figures that show what was measured of a field.

    Args:
        folder: where to; made if need be.
        field: the field.
        found: every block of an endless bar beside the theory, or the reading of any other.
    """
    if isinstance(found, list):
        return _jobs(folder, endless.of_measurement(field, found))
    return _jobs(folder, bar.of_reading(field, found))


def warm_up() -> None:
    """Draw something small, so that fonts and the like are there for all forks that follow."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(2, 2))
        axes = figure.subplots()
        axes.plot([1.0, 2.0], [1.0, 100.0], "o-", label="φ₁ (µs)")
        axes.set(yscale="log", title="$\\bar\\omega$", xlabel="ω/2π (kHz)")
        second_axes(axes, (2.0, "ω̄"), None)
        figure.legend(loc="outside upper center")
        FigureCanvasAgg(figure).print_png(BytesIO())


def _jobs(folder: Path, drawings: Drawings) -> Jobs:
    return [partial(write, {name: draw}, folder) for name, draw in drawings.items()]
