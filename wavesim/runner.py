"""One run, from a settled case to a folder of results: integrate, measure, judge, tell."""

from __future__ import annotations

import json
import resource
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

from wavesim.material.shown import plain
from wavesim.verdict.judgement import FOLDER, measure, needed
from wavesim.worker import Answer, Here, SharedArray, Worker

if TYPE_CHECKING:  # the process beside a run is begun before they are loaded
    from wavesim.case.load import Case
    from wavesim.io.result_writer import Results
    from wavesim.io.storing import Storing
    from wavesim.simulation.field import Energy, Field
    from wavesim.simulation.simulation import Simulation
    from wavesim.timedomain.integrate import Timing

Progress = Callable[[str, float], None]
_EXPECTED = "wavesim.readings.bar.reading.expected"
# What a picture's name begins with, and what it ends with.
_FIGURES = {"spacetime", "receivers", "energy", "bar", "signals", "dispersion", "attenuation"}
_FIGURES |= {"transmission", "bloch", "eigenfrequencies", "arrivals", "loss", "velocities"}
_PICTURES = (".png", ".pdf", ".svg")
_DRAWING, _PAGE_DATA = "wavesim.figures.drawing", "wavesim.report.page_data"
_OVERVIEW = "wavesim.figures.overview.write_overview"


class RunError(RuntimeError):
    """A run can't begin or can't go on; the message says why and what to do.

    Attributes:
        code: to end with: 2 where what was asked for can't be, 3 where the integration, or the
            writing of its results, failed.
    """

    def __init__(self, message: str, code: int) -> None:
        self.code = code
        super().__init__(message)


@dataclass(frozen=True)
class Outcome:
    """What a run has to say.

    Attributes:
        summary: contents of summary.json.
        folder: where its files are.
        notes: what the record was too short, or the grid too coarse, to tell.
    """

    summary: dict[str, Any]
    folder: Path
    notes: list[str]

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(check["passed"] for check in self.summary["checks"])


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


def run(
    case: Case,
    folder: Path,
    resume: bool = False,
    progress: Progress | None = None,
    beside: Worker | None = None,
    figures: bool = False,
    rerun: str = "",
) -> Outcome:
    """Run a case.

    Args:
        case: the case.
        folder: where to write; made if need be.
        resume: carry on from the result file that is there.
        progress: called with the name of the stage and the part of it done.
        beside: of :func:`begun_beside`, where it was begun before; the caller ends it.
        figures: draw all figures too.
        rerun: the command that runs this case, for the page.

    Returns:
        What came of it.

    Raises:
        StorageError: result.h5 can't be written or resumed.
        RunError: another file can't be written, or the integration failed; the result file then
            holds what came before.
    """
    clock, timing = time.perf_counter(), dict[str, float]()
    tell = progress or (lambda stage, part: None)
    tell("import", 0.0)
    with _told_as_run_errors(folder), ExitStack() as until_the_end:
        from wavesim.io.folder_lock import locked

        if not resume:
            _begin(folder)
        if folder.is_dir():
            until_the_end.enter_context(locked(folder))
        own = beside or until_the_end.enter_context(begun_beside())
        worker = reached(case.simulation, own)

        def lap(stage: str) -> None:
            nonlocal clock
            now = time.perf_counter()
            timing[stage], clock = timing.get(stage, 0.0) + now - clock, now

        from wavesim.material.scaling import scales
        from wavesim.report.answers import verdict
        from wavesim.report.page import page
        from wavesim.simulation.field import Energy, Field

        known: Answer | None = None
        to_come = Field(case.simulation, case.simulation.times, {})
        if not case.simulation.endless:
            table = case.analysis
            read = table.frequencies, table.damping, table.bands
            known = worker.ask(_EXPECTED, to_come, *read)
        from wavesim.timedomain.compiled import keep_compiled

        keep_compiled()
        from wavesim.io import result_reader as resultfile
        from wavesim.io import result_writer as storage
        from wavesim.io.storing import Storing
        from wavesim.io.whole_files import write_whole
        from wavesim.timedomain.cost import in_memory
        from wavesim.timedomain.integrate import Timing
        from wavesim.timedomain.time_step import time_step

        lap("import")
        simulated, spent = case.simulation, Timing()
        steps, frames = time_step(simulated), simulated.frames
        seconds = steps.step * float(scales(simulated.medium).time)
        resolved = case.resolved(steps.solver, seconds)
        told = {"title": case.title, "case": resolved, "stepper": steps.solver, "step": seconds}
        results = storage.Results(folder / "result.h5", simulated, told)
        start = None
        if resume:
            start = results.carry_on()
        else:
            results.create()
        _take_away_old(folder)
        write_whole(folder / "resolved.toml", resolved.encode())
        kept: dict[str, SharedArray] = {}
        if start is None and in_memory(simulated):
            sizes = {name: len(to_come.positions(name)) for name in simulated.fields}
            with suppress(OSError):
                kept = {name: worker.array((frames, size)) for name, size in sizes.items()}
        tell("compile", 0.0)
        # What the analysis needs is loaded while the compiler leaves Python's lock alone.
        loading = Thread(target=lambda: [import_module(name) for name in needed(simulated)])
        storing = until_the_end.enter_context(Storing(results, kept))
        energies = _integrated(simulated, results, start, storing, spent, tell, loading.start)
        lap("integrate")
        timing["compile"] = spent.compile
        timing["store"] = timing["integrate"] - spent.compile - spent.integrate
        timing["integrate"] = spent.integrate

        loading.join()
        tell("analyse", 0.0)
        if kept:
            storing.filled()
            for values in kept.values():
                values.freeze()
            stored = simulated.times, kept, Energy.joined(energies)
            field = Field(simulated, *stored, steps.solver, seconds)
        else:
            storing.wait()
            field = resultfile.read(results.path, simulated)
        pictures = _Pictures(worker, folder, figures, field)
        found = measure(case, field, known and known.result())
        lap("analyse")
        tell("figures", 0.0)
        rows = [check.row() for check in found.checks]
        pictures.of_found(found.shown, case.title or folder.name, verdict({"checks": rows}))
        storing.wait()
        until_the_end.enter_context(results.gathering())
        if not kept:
            # The file is read until all is drawn: only then may another take its place.
            pictures.wait()
            lap("figures")
        tell("store", 0.0)
        results.finish("complete", found.tables)
        lap("store")
        tell("figures", 0.0)
        data, undrawn = pictures.result()
        lap("figures")
        summary = {
            "title": case.title,
            "checks": rows,
            "passed": all(check.passed for check in found.checks),
            "timing": timing,
            "stepper": steps.solver,
            "step": seconds,
            "steps": steps.steps,
            "operator_products": steps.operator_products,
            "cells": simulated.bar.cells,
            "fields": list(simulated.fields),
            "peak_memory_bytes": peak_memory(),
            "versions": storage.versions(),
            "answers": found.answers,
        } | found.summary
        summary = plain(summary)
        text = json.dumps(summary, indent=1, ensure_ascii=False) + "\n"
        write_whole(folder / "summary.json", text.encode())
        notes = [note.replace(FOLDER, shlex.quote(str(folder))) for note in found.notes]
        for failure in undrawn:
            why = str(failure).partition("\n")[0]
            notes.append(f"a picture could not be drawn ({type(failure).__name__}: {why})")
        if data is not None:
            made = page(summary, data, resolved, folder, rerun, notes)
            write_whole(folder / "report.html", made.encode())
        for failure in undrawn:
            if isinstance(failure, OSError):
                raise failure
        return Outcome(summary, folder, notes)


@contextmanager
def _told_as_run_errors(folder: Path) -> Iterator[None]:
    """Files that can't be written, and memory that does not suffice, told with what to do."""
    from wavesim.report.terminal import BAD_INPUT, FAILED, unwritable

    try:
        yield
    except OSError as error:
        remedy = "run again, with --resume if result.h5 is there"
        said, _ = unwritable(error, error.filename or folder, remedy)
        raise RunError(said, FAILED) from error
    except (MemoryError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and "RESOURCE_EXHAUSTED" not in str(error):
            raise
        why = str(error).partition("\n")[0] or type(error).__name__
        raise RunError(
            f"the run does not fit into memory ({why}): lower [time] samples or duration, or take "
            "fewer cells",
            BAD_INPUT,
        ) from error


def _take_away_old(folder: Path) -> None:
    """An earlier run's verdict must not be taken for this one's."""
    for name in ("summary.json", "report.html", "overview.png"):
        (folder / name).unlink(missing_ok=True)
    for picture in (folder / "figures").glob("*.*"):
        if picture.stem.partition("_")[0] in _FIGURES and picture.suffix in _PICTURES:
            picture.unlink(missing_ok=True)


def _integrated(
    simulated: Simulation,
    results: Results,
    start: tuple[int, Sequence[Any]] | None,
    storing: Storing,
    spent: Timing,
    tell: Progress,
    meanwhile: Callable[[], object],
) -> list[Energy]:
    """Integrate, and store each chunk while the next one is integrated.

    Args:
        simulated: what is run.
        results: where to.
        start: to carry on from; None begins at t = 0.
        storing: what stores them.
        spent: where to note the seconds spent.
        tell: progress.
        meanwhile: called while Python has nothing to do.

    Returns:
        The energy of each chunk.
    """
    from wavesim.io.result_reader import StorageError
    from wavesim.report.terminal import FAILED
    from wavesim.timedomain.integrate import NotFiniteError, stream

    energies = []
    try:
        for chunk in stream(simulated, start, spent, meanwhile):
            storing.add(chunk)
            energies.append(chunk.energy)
            tell("integrate", (chunk.first + chunk.count) / simulated.frames)
    except NotFiniteError as error:
        storing.wait()
        results.finish("failed")
        raise RunError(str(error), FAILED) from None
    except BaseException:
        with suppress(StorageError):
            storing.stop()
        raise
    return energies


class _Pictures:
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

    def of_found(self, found: Any, title: str, verdict: str) -> None:
        """Draw what was measured; arguments as of ``figures.overview.write_overview``."""
        ask, folder, known = self._beside.ask, self._folder, (self._field, found)
        self._drawn.append(ask(_OVERVIEW, folder / "overview.png", *known, title, verdict))
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


def _begin(folder: Path) -> None:
    from wavesim.report.terminal import unwritable

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(*unwritable(error, f"--out {folder}")) from None


def peak_memory() -> int:
    """Largest memory of this process so far and of the largest it has waited for, bytes."""
    whom = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
    size = sum(resource.getrusage(who).ru_maxrss for who in whom)
    return size if sys.platform == "darwin" else size * 1024
