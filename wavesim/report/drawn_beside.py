"""What the process beside a run draws of it, and what the page of the run is drawn from."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavesim.worker import Answer, Here, Worker

if TYPE_CHECKING:  # the process is begun before they are loaded
    from wavesim.simulation.field import Field
    from wavesim.simulation.simulation import Simulation
    from wavesim.verdict.judgement import Found

_DRAWING, _PAGE_DATA = "wavesim.figures.drawing", "wavesim.report.page_data"


def begun_beside() -> Worker:
    """A process beside a run, which loads what it will draw with; the sooner the better."""
    beside = Worker()
    beside.prepare("importlib.import_module", _DRAWING)
    beside.prepare("importlib.import_module", _PAGE_DATA)
    beside.prepare(f"{_DRAWING}.warm_up")
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
