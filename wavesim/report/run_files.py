"""What a run writes beside its fields: summary.json, the page, and pictures, which a process beside
it draws; and what an earlier run left."""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavesim.verdict.judgement import FOR_PULSE_TESTS
from wavesim.worker import Answer, Here, Worker

if TYPE_CHECKING:  # the process is begun before they are loaded
    from wavesim.case.load import Case
    from wavesim.simulation.field import Field
    from wavesim.simulation.simulation import Simulation
    from wavesim.timedomain.time_step import TimeStep
    from wavesim.verdict.judgement import Found

# What a picture's name begins with, and what it ends with.
_FIGURES = {"spacetime", "receivers", "energy", "bar", "signals", "dispersion", "attenuation"}
_FIGURES |= {"transmission", "bloch", "eigenfrequencies", "arrivals", "loss", "velocities"}
_PICTURES = (".png", ".pdf", ".svg")


def summary(case: Case, steps: TimeStep, found: Found, timing: dict[str, float]) -> dict[str, Any]:
    """What summary.json tells of a run."""
    from wavesim.io.result_layout import versions
    from wavesim.material.scaling import scales
    from wavesim.material.shown import plain

    told = {
        "title": case.title,
        "checks": [check.row() for check in found.checks],
        "passed": all(check.passed for check in found.checks),
        "timing": timing,
        "stepper": steps.solver,
        "step": steps.step * float(scales(case.simulation.medium).time),
        "steps": steps.steps,
        "operator_products": steps.operator_products,
        "cells": case.simulation.bar.cells,
        "fields": list(case.simulation.fields),
        "peak_memory_bytes": peak_memory(),
        "versions": versions(),
        "answers": found.answers,
    }
    made: dict[str, Any] = plain(told | found.summary)
    return made


def write(
    summary: dict[str, Any],
    notes: Sequence[str],
    data: dict[str, Any] | None,
    resolved: str,
    folder: Path,
    rerun: str,
) -> None:
    """Write summary.json, and report.html where there is what it is drawn from.

    Raises:
        OSError: a file can't be written.
    """
    from wavesim.io.whole_files import write_whole
    from wavesim.report.page import page

    text = json.dumps(summary, indent=1, ensure_ascii=False) + "\n"
    write_whole(folder / "summary.json", text.encode())
    if data is not None:
        made = page(summary, data, resolved, folder, rerun, notes)
        write_whole(folder / "report.html", made.encode())


def take_away_old(folder: Path) -> None:
    """An earlier run's verdict must not be taken for this one's."""
    for name in ("summary.json", "report.html", "overview.png"):
        (folder / name).unlink(missing_ok=True)
    for picture in (folder / "figures").glob("*.*"):
        if picture.stem.partition("_")[0] in _FIGURES and picture.suffix in _PICTURES:
            picture.unlink(missing_ok=True)


def peak_memory() -> int:
    """Largest memory of this process so far and of the largest it has waited for, bytes."""
    whom = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
    size = sum(resource.getrusage(who).ru_maxrss for who in whom)
    return size if sys.platform == "darwin" else size * 1024


_DRAWING, _PAGE_DATA = "wavesim.figures.drawing", "wavesim.report.page_data"


def begun_beside() -> Worker:
    """A process beside a run, which loads what it will draw with; the sooner the better."""
    beside = Worker()
    beside.prepare("importlib.import_module", _DRAWING)
    beside.prepare("importlib.import_module", _PAGE_DATA)
    beside.prepare("wavesim.figures.style.warm_up")
    for name in FOR_PULSE_TESTS:
        beside.prepare("importlib.import_module", name)
    return beside


def reached(simulation: Simulation, beside: Worker) -> Worker | Here:
    """The process beside a run; this one in its place for a family of a program's own, whose class
    no other process finds."""
    media = [part for medium in simulation.layers.media for part in medium.parts]
    ours = all(type(medium).__module__.startswith("wavesim.") for medium in media)
    return beside if ours else Here()


class Pictures:
    """What the process beside a run draws of it, and what its page is drawn from.

    Args:
        beside: the process.
        folder: of the run.
        figures: whether all figures are wanted.
        field: what was simulated.
    """

    def __init__(self, beside: Worker | Here, folder: Path, figures: bool, field: Field) -> None:
        self._beside, self._folder, self._figures, self._field = beside, folder, figures, field
        self._data = [beside.ask(f"{_PAGE_DATA}.of_field", field)]
        self._drawn: list[Answer] = []

    def of_found(self, found: Found, title: str) -> None:
        """Draw what was measured, and held against what is exact, under a title."""
        from wavesim.report.answers import verdict

        ask, folder, known = self._beside.ask, self._folder, (self._field, found.shown)
        said = verdict({"checks": [check.row() for check in found.checks]})
        overview = folder / "overview.png"
        self._drawn.append(ask(f"{_DRAWING}.write_overview", overview, *known, title, said))
        self._data.append(ask(f"{_PAGE_DATA}.of_found", *known))
        if self._figures:
            named = ask(f"{_DRAWING}.names", *known)
            self._drawn.append(named)
            with suppress(Exception):  # told of with the others
                self._drawn += [
                    ask(f"{_DRAWING}.draw", folder / "figures", *known, name, "png")
                    for name in named.result()
                ]

    def wait(self) -> None:
        """Wait until all is drawn, well or not."""
        for one in (*self._drawn, *self._data):
            one.wait()

    def result(self) -> tuple[dict[str, Any] | None, list[Exception]]:
        """What the page is drawn from, and what went wrong: it takes nothing else with it."""
        wrong: list[Exception] = []
        data: dict[str, Any] | None = {}
        for one in (*self._drawn, *self._data):
            try:
                made = one.result()
                if data is not None and one in self._data:
                    data |= made
            except Exception as error:
                wrong.append(error)
                data = None if one in self._data else data
        return data, wrong
