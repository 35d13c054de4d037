"""Figures of a run by name, as a process beside it draws them: a fork for each; and one picture,
for those who open no page: where waves went, and what was read of them."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wavesim.figures import bar, endless
from wavesim.figures import field as of_fields
from wavesim.figures.style import (
    FOUND,
    POINT,
    STYLE,
    THEORY,
    Drawings,
    as_written,
    shade,
    symbol,
    title,
    write,
)
from wavesim.material.family import is_macro
from wavesim.material.shown import KHZ
from wavesim.readings.bar.pulse_test import PulseTest
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


Panel = Callable[[Axes], str]
_WIDTH, _HEIGHT, _HEAD = 11.0, 3.7, 1.0
# Layout and titles stand where they are told to: to have them found takes as long as all the rest.
_PLAIN = {"figure.constrained_layout.use": False, "axes.titley": 1.02, "figure.dpi": 130}
# Where a title stands that has a legend of two rows under it.
_ABOVE = 1.14
# Letters of a name of which three have no room side by side.
_LONG = 26


def write_overview(path: Path, field: Field, found: Any, title: str, verdict: str) -> None:
    """Draw and write it.

    Args:
        path: of the PNG.
        field: the field.
        found: every block of an endless bar beside the theory, or the reading of any other.
        title: of the case.
        verdict: in a sentence.
    """
    with matplotlib.rc_context(STYLE | _PLAIN):
        panels = _panels(field, found)
        rows = -(-len(panels) // 2)
        height = _HEAD + _HEIGHT * rows
        figure = Figure(figsize=(_WIDTH, height))
        figure.subplots_adjust(
            left=0.065, right=0.955, bottom=0.55 / height, top=1 - (_HEAD + 0.3) / height,
            wspace=0.24, hspace=0.5,
        )  # fmt: skip
        figure.text(
            0.012, 1 - 0.16 / height, as_written(title), va="top", fontsize=12, fontweight="bold"
        )
        told = as_written(textwrap.shorten(verdict, 165, placeholder=" …"))
        figure.text(0.012, 1 - 0.46 / height, told, va="top", fontsize=9.5)
        for number, panel in enumerate(panels, start=1):
            wide = number == len(panels) and number % 2 == 1
            axes = figure.add_subplot(rows, 2, (number, number + 1) if wide else number)
            text = panel(axes)
            axes.set_title(text, fontsize=9, y=axes.title.get_position()[1])
        FigureCanvasAgg(figure).print_png(path, pil_kwargs={"compress_level": 1})


def _panels(field: Field, found: Any) -> list[Panel]:
    sectors = list(dict.fromkeys(b.sector for b in field.blocks))
    travelling = [b.sector for b in field.blocks if b.macro] or sectors
    panels: list[Panel] = [partial(_spacetime, field=field, sector=travelling[0])]
    if isinstance(found, list):
        panels += [partial(_spectrum, field=field, held=found, sector=travelling[0])][: len(found)]
        held = [h for h in found if h.k_exact is not None]
        panels += [partial(_attenuation, field=field, held=h) for h in held[:1]]
    else:
        panels += [partial(_transmission, field=field, found=one) for one in found.scattered[:1]]
        panels += [partial(_ringing, found=one) for one in found.ringing[:1]]
        tests = [test for test in found.pulses if test.medium is not None]
        panels += [partial(_velocity, test=test) for test in tests[:1]]
    if field.receivers:
        panels.append(partial(_signals, field=field))
    return panels[:4]


def _legend(axes: Axes) -> None:
    """Above the axes, where it covers nothing; the title makes room."""
    rows = -(-len(axes.get_legend_handles_labels()[1]) // _columns(axes))
    axes.title.set_y(_ABOVE + 0.055 * max(0, rows - 2))
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 0.99), ncols=_columns(axes), fontsize=7.5,
        borderpad=0.2, labelspacing=0.25, columnspacing=1.6,
    )  # fmt: skip


def _columns(axes: Axes) -> int:
    """Of a legend: three, or two where names are long."""
    longest = max(len(label) for label in axes.get_legend_handles_labels()[1])
    return 3 if longest < _LONG else 2


def _spacetime(axes: Axes, field: Field, sector: str) -> str:
    image = of_fields.spacetime_panel(axes, field, sector)
    axes.set(xlabel="x (mm)", ylabel="t (µs)")
    axes.figure.colorbar(image, ax=axes, label="amplitude (dB)", pad=0.02)
    return f"Amplitude in the bar, {title(field.medium.family.blocks_of(sector))}"


def _spectrum(axes: Axes, field: Field, held: Any, sector: str) -> str:
    image = endless.spectrum_panel(axes, field, held, sector)
    axes.figure.colorbar(image, ax=axes, label="power (dB)", pad=0.02)
    return f"Dispersion and gaps, {title(field.medium.family.blocks_of(sector))}"


def _attenuation(axes: Axes, field: Field, held: Any) -> str:
    endless.attenuation_panel(axes, field, held)
    axes.set_xlabel("ω/2π (kHz)")
    _legend(axes)
    return f"Attenuation, {title([held.measured.block])}"


def _transmission(axes: Axes, field: Field, found: Any) -> str:
    bar.level_panel(axes, field, found)
    axes.set_xlabel("ω/2π (kHz)")
    _legend(axes)
    return f"Transmission and reflection, {found.sector}"


def _ringing(axes: Axes, found: Any) -> str:
    bar.ringing_panel(axes, found)
    axes.set_xlabel("ω/2π (kHz)")
    _legend(axes)
    return f"Eigenfrequencies, {found.sector}"


def _velocity(axes: Axes, test: PulseTest) -> str:
    found, exact = test.result.dispersion, test.exact.dispersion
    f = found.omega * KHZ
    shade(axes, [(g.name, g.lower * KHZ, g.upper * KHZ) for g in test.gaps if g.upper > g.lower])
    for name, style, mark in (("phase", "-", "o"), ("group", "--", "^")):
        value = getattr(found, f"{name}_velocity")
        axes.plot(f, getattr(exact, f"{name}_velocity"), style, color=THEORY, lw=0.9,
                  label=f"{name} velocity, exact")  # fmt: skip
        axes.plot(f, value, mark, **POINT, mec=FOUND, label=f"{name} velocity, simulated")
    speeds = found.phase_velocity[np.isfinite(found.phase_velocity)]
    top = 1.6 * float(np.median(speeds)) if len(speeds) else 1.0
    axes.set(xlabel="ω/2π (kHz)", ylabel="velocity (m/s)", xlim=(f[0], f[-1]), ylim=(0, top))
    _legend(axes)
    return f"Velocities between receivers, {symbol(test.name)}"


def _signals(axes: Axes, field: Field) -> str:
    names = [n for n in field.names if is_macro(n)] or list(field.names)
    of_fields.section_panel(axes, field, names[0])
    return f"Receivers: {axes.get_title()}"
