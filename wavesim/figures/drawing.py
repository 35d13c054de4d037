"""Figures of a run by name, as a process beside it draws them: a fork for each."""

from __future__ import annotations

from collections.abc import Sequence
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


def drawings(field: Field, found: Any) -> Drawings:
    """All figures of a run by name, not drawn yet.

    Args:
        field: the field.
        found: every block of an endless bar beside the theory, or the reading of any other; None
            where nothing was measured.
    """
    if found is None:
        return of_fields.of_field(field)
    of_found = endless.of_measurement if isinstance(found, list) else bar.of_reading
    return of_fields.of_field(field) | of_found(field, found)


def names(field: Field, found: Any, asked: Sequence[str] = ()) -> list[str]:
    """Names of figures; found as of :func:`drawings`.

    Args:
        field, found: as of :func:`drawings`.
        asked: those that are wanted; all where there are none.

    Raises:
        KeyError: one is none of a figure of this run; its arguments are the name and all names.
    """
    known = list(drawings(field, found))
    for name in asked:
        if name not in known:
            raise KeyError(name, known)
    return list(dict.fromkeys(asked)) or known


def draw(folder: Path, field: Field, found: Any, name: str, kind: str) -> Path:
    """Write one figure as png, pdf or svg; other arguments as of :func:`names`."""
    (path,) = write({name: drawings(field, found)[name]}, folder, kind)
    return path


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
