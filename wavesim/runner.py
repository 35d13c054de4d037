"""One run, from a settled case to a folder of results: integrate, measure, judge, tell."""

from __future__ import annotations

import errno
import json
import math
import resource
import sys
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

from wavesim.worker import Answer, Here, SharedArray, Worker

if TYPE_CHECKING:  # the process beside a run is begun before they are loaded
    from wavesim.case.load import Case
    from wavesim.simulation.simulation import Simulation

Progress = Callable[[str, float], None]
_EXPECTED = "wavesim.readings.bar.reading.expected"
# What a picture's name begins with, and what it ends with.
_FIGURES = {"spacetime", "receivers", "energy", "bar", "signals", "dispersion", "attenuation"}
_FIGURES |= {"transmission", "bloch", "eigenfrequencies", "arrivals", "loss", "velocities"}
_PICTURES = (".png", ".pdf", ".svg")
# result.h5 shows what is stored no sooner than so after the time before, s.
_SHOWN_EVERY = 0.5
_DRAWING, _PAGE_DATA = "wavesim.figures.drawing", "wavesim.report.page_data"


class RunError(RuntimeError):
    """A run can't begin or can't go on; the message says why and what to do.

    Attributes:
        unstable: the integration failed, rather than a file.
        code: to end with: 2 where what was asked for can't be, 3 where the integration, or the
            writing of its results, failed.
    """

    def __init__(self, message: str, unstable: bool, written: bool = True) -> None:
        self.unstable, self.code = unstable, 2 if written and not unstable else 3
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
        RunError: a file can't be written or resumed, or the integration failed; the result file
            then holds what came before.
    """
    begun = time.perf_counter()
    tell = progress or (lambda stage, part: None)
    tell("import", 0.0)
    from wavesim.io.folder_lock import locked
    from wavesim.io.result_reader import StorageError, WriteError

    try:
        with ExitStack() as until_the_end:
            if not resume:
                _begin(folder)
            if folder.is_dir():
                until_the_end.enter_context(locked(folder))
            own = beside or until_the_end.enter_context(begun_beside())
            at_work = reached(case.simulation, own)
            known = case, folder, resume, tell, begun, at_work, figures, rerun
            return _run(until_the_end, *known)
    except StorageError as error:
        raise RunError(str(error), False, not isinstance(error, WriteError)) from error
    except OSError as error:
        what = error.strerror or error
        raise RunError(
            f"{error.filename or folder}: can't be written: {what}; make room on the disk, and "
            "run again with --resume if result.h5 is there",
            False,
            False,
        ) from error
    except (MemoryError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and "RESOURCE_EXHAUSTED" not in str(error):
            raise
        why = str(error).splitlines()[0]
        raise RunError(
            f"the run does not fit into memory ({why}): lower [time] samples or duration, or take "
            "fewer cells",
            False,
        ) from error


def _run(
    until_the_end: ExitStack,
    case: Case,
    folder: Path,
    resume: bool,
    tell: Progress,
    clock: float,
    beside: Worker | Here,
    figures: bool,
    rerun: str,
) -> Outcome:
    timing: dict[str, float] = {}

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
        known = beside.one(_EXPECTED, to_come, *read)
    from wavesim.timedomain.compiled import keep_compiled

    keep_compiled()
    from wavesim.io import result_reader as resultfile
    from wavesim.io import result_writer as storage
    from wavesim.io.result_reader import StorageError
    from wavesim.timedomain.cost import in_memory
    from wavesim.timedomain.integrate import Chunk, NotFiniteError, Timing, stream
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
    # An earlier run's verdict must not be taken for this one's.
    for name in ("summary.json", "report.html", "overview.png"):
        (folder / name).unlink(missing_ok=True)
    for picture in (folder / "figures").glob("*.*"):
        if picture.stem.partition("_")[0] in _FIGURES and picture.suffix in _PICTURES:
            picture.unlink(missing_ok=True)
    storage.write_whole(folder / "resolved.toml", resolved.encode())
    kept: dict[str, SharedArray] = {}
    if start is None and in_memory(simulated):
        sizes = {name: len(to_come.positions(name)) for name in simulated.fields}
        with suppress(OSError):
            kept = {name: beside.array((frames, size)) for name, size in sizes.items()}
    tell("compile", 0.0)
    # What the analysis needs is loaded while the compiler leaves Python's lock alone.
    loading = Thread(target=lambda: [import_module(name) for name in _analysis(simulated)])
    energies = []
    shown_at = -math.inf

    def store(chunk: Chunk) -> None:
        nonlocal shown_at
        for name, values in kept.items():
            values[chunk.first : chunk.first + chunk.count] = chunk.values[name]
        due = time.monotonic() - shown_at > _SHOWN_EVERY or chunk.first + chunk.count == frames
        shown_at = time.monotonic() if due else shown_at
        results.append(chunk.first, chunk.values, chunk.energy, chunk.state, due)

    try:
        # A chunk is written while the next one is integrated.
        with ThreadPoolExecutor(1) as writer:
            writing: Future[None] | None = None
            for chunk in stream(simulated, start, spent, loading.start):
                if writing is not None:
                    writing.result()
                writing = writer.submit(store, chunk)
                energies.append(chunk.energy)
                tell("integrate", (chunk.first + chunk.count) / frames)
        if writing is not None:
            writing.result()
    except NotFiniteError as error:
        results.finish("failed")
        raise RunError(str(error), True) from None
    except BaseException:
        with suppress(StorageError):
            results.present()
        raise
    lap("integrate")
    timing["compile"] = spent.compile
    timing["store"] = timing["integrate"] - spent.compile - spent.integrate
    timing["integrate"] = spent.integrate

    loading.join()
    tell("analyse", 0.0)
    if kept:
        until_the_end.enter_context(results.gathering())
        stored = simulated.times, kept, Energy.joined(energies)
        field = Field(simulated, *stored, steps.solver, seconds)
    else:
        field = resultfile.read(results.path, simulated)
    shown = beside.one(f"{_PAGE_DATA}.of_field", field)
    drawn = [beside.each(f"{_DRAWING}.of_field", folder / "figures", field)] if figures else []
    found = measure(case, field, *(known.result() if known else ()))
    lap("analyse")
    tell("figures", 0.0)
    rows = [check.row() for check in found.checks]
    sentence, overview = verdict({"checks": rows}), folder / "overview.png"
    told_of = field, found.shown, case.title or folder.name, sentence
    drawn.append(beside.one(f"{_DRAWING}.overview", overview, *told_of))
    measured = beside.one(f"{_PAGE_DATA}.of_found", field, found.shown)
    if figures:
        asked = folder / "figures", field, found.shown
        drawn.append(beside.each(f"{_DRAWING}.of_measurement", *asked))
    if not kept:
        # The file is read until all is drawn: only then may another take its place.
        until_the_end.enter_context(results.gathering())
        for one in (*drawn, shown, measured):
            one.wait()
        lap("figures")
    tell("store", 0.0)
    results.finish("complete", found.tables)
    lap("store")
    tell("figures", 0.0)
    undrawn = []
    for one in drawn:
        try:
            one.result()
        except Exception as error:  # a picture that fails takes nothing else with it
            undrawn.append(error)
    data = None
    try:
        data = shown.result()[0] | measured.result()[0]
    except Exception as error:
        undrawn.append(error)
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
    summary = _plain(summary)
    text = json.dumps(summary, indent=1, ensure_ascii=False) + "\n"
    storage.write_whole(folder / "summary.json", text.encode())
    for failure in undrawn:
        why = str(failure).partition("\n")[0]
        found.notes.append(f"a picture could not be drawn ({type(failure).__name__}: {why})")
    if data is not None:
        made = page(summary, data, resolved, folder, rerun, found.notes)
        storage.write_whole(folder / "report.html", made.encode())
    for failure in undrawn:
        if isinstance(failure, OSError):
            raise failure
    return Outcome(summary, folder, found.notes)


@dataclass(frozen=True)
class Found:
    """What was measured of a field.

    Attributes:
        checks: the verdict.
        shown: what its figures are drawn from.
        tables: what is stored of it, with units.
        summary: what summary.json gets besides.
        answers: the few rows that a reader asks for first.
        notes: as of :class:`Outcome`.
    """

    checks: list[Any]
    answers: dict[str, Any]
    shown: Any
    tables: dict[str, Any]
    summary: dict[str, Any]
    notes: list[str]


def _analysis(simulated: Simulation) -> tuple[str, ...]:
    """The modules that measure a run of this case."""
    endless = simulated.endless
    return "wavesim.verdict.endless" if endless else "wavesim.verdict.bar", "scipy.signal"


def measure(case: Case, field: Any, known: Any = None) -> Found:
    """Measure a field and hold it against theory.

    An endless bar is measured by its waves, ω(k) and k(ω), one with layers or ends by what its
    receivers record.

    Args:
        case: the case.
        field: the field of its run.
        known: what the exact solvers say of a bar with layers or ends; worked out where None.
    """
    table = case.analysis
    if case.simulation.endless:
        from wavesim.readings.dispersion.extract import extract
        from wavesim.verdict.answers import of_endless
        from wavesim.verdict.endless import hold, judge, tables

        measured = extract(field, case.k_range[1], table.frequencies, table.damping)
        held = [hold(field, m, case.k_range) for m in measured]
        checks = judge(field, held)
        found = tables(held)
        passing, said = pulse_tests(field)
        told = notes(case.simulation, checks) + said
        return Found(checks, of_endless(field, held), held, found, passing, told)
    from wavesim.readings.bar.pulse_test import rows
    from wavesim.readings.bar.reading import read_bar
    from wavesim.verdict.answers import of_bar
    from wavesim.verdict.bar import bar_notes, judge_bar

    reading = read_bar(field, table.frequencies, table.damping, known, table.bands)
    summary = {"pulse_tests": [rows(test) for test in reading.pulses]} | pulse_tests(field)[0]
    checks = judge_bar(field, reading)
    answers = of_bar(field, reading)
    told = bar_notes(reading, field)
    return Found(checks, answers, reading, reading.tables(), summary, told)


def pulse_tests(field: Any) -> tuple[dict[str, Any], list[str]]:
    """What ``wavesim pulse`` reads of a run with two receivers or more beside its sources.

    Returns:
        ({"pulse": as ``wavesim pulse --json`` has it, but for the frequencies}, a line for each
        velocity); nothing where there are no such receivers.
    """
    from wavesim.readings.pulse.answers import answer
    from wavesim.readings.pulse.array_reading import read_array
    from wavesim.readings.pulse.signals import PulseError
    from wavesim.records.content import RecordError
    from wavesim.records.of_pulse_test import of_field

    if len(field.receivers) < 2:
        return {}, []
    readings = []
    try:
        for test in of_field(field, "run"):
            if test.placed:
                given = test.signals, test.positions, test.sent
                readings.append(read_array(test.name, test.t, *given))
    except (RecordError, PulseError):
        # Receivers on both sides, or where nothing came: nothing that could be read.
        pass
    if not readings:
        return {}, []
    told = answer(readings, None)
    for one in told["records"]:
        one.pop("frequencies", None)
    said = [
        f"pulse test on {one.file.rpartition(' ')[2]}, {len(one.receivers)} receivers: "
        f"{one.best.velocity:.4g} ± {one.best.velocity_error:.2g} m/s by {one.best.convention}; "
        "wavesim pulse reads more of the folder"
        for one in readings
        if one.best.valid
    ]
    return {"pulse": told}, said


def _begin(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
        raise RunError(
            f"--out {folder}: can't be written: {error.strerror}; name another folder",
            False,
            not full,
        ) from None


def notes(simulated: Simulation, checks: list[Any]) -> list[str]:
    """What a reader should know beside the checks."""
    found = []
    if not any("waves present" in check.name for check in checks):
        duration, frames = simulated.duration, simulated.frames
        nyquist = (frames - 1) / (2 * duration)
        found.append(
            f"no branch was judged: frequency bins of {1e-3 / duration:.3g} kHz up to "
            f"{nyquist / 1e3:.4g} kHz do not tell the excited branches apart; lengthen [time] "
            "duration for finer bins, raise [time] samples for a higher end"
        )
    if any(block.macro for block in simulated.blocks) and not any(
        "|Δk|/|k|" in check.name for check in checks
    ):
        found.append(
            "no wavenumber could be measured along the bar: lengthen the bar, or leave more room "
            "between the sources"
        )
    return found


def peak_memory() -> int:
    """Largest memory of this process so far and of the largest it has waited for, bytes."""
    whom = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
    size = sum(resource.getrusage(who).ru_maxrss for who in whom)
    return size if sys.platform == "darwin" else size * 1024


def _plain(value: Any) -> Any:
    """Numbers that JSON has: not a number becomes null."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list):
        return [_plain(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
