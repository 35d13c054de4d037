"""Figures of a run as jobs for a process beside it: one for each, which writes its file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wavesim.figures import bar, endless
from wavesim.figures import field as of_fields
from wavesim.figures.overview import write_overview
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
    return _jobs(folder, _measured(field, found))


def drawings(field: Field, found: Any) -> Drawings:
    """All figures of a run by name, not drawn yet; found as of :func:`of_measurement`, or None."""
    return of_fields.of_field(field) | ({} if found is None else _measured(field, found))


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


def _measured(field: Field, found: Any) -> Drawings:
    of_found = endless.of_measurement if isinstance(found, list) else bar.of_reading
    return of_found(field, found)


def overview(path: Path, field: Field, found: Any, title: str, verdict: str) -> None:
    """Write one picture of a run; arguments as of ``figures.overview.write_overview``."""
    write_overview(path, field, found, title, verdict)


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
