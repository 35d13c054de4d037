"""One run, from a settled case to a folder of results: integrate, measure, judge, tell."""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

from wavesim.report.run_files import Pictures, begun_beside, reached, summary, take_away_old, write
from wavesim.verdict.judgement import FOLDER, measure, needed
from wavesim.worker import Answer, Here, SharedArray, Worker

if TYPE_CHECKING:  # the process beside a run is begun before they are loaded
    from wavesim.case.load import Case
    from wavesim.io.result_writer import Results
    from wavesim.io.storing import Storing
    from wavesim.simulation.field import Energy, Field
    from wavesim.simulation.simulation import Simulation
    from wavesim.timedomain.time_step import TimeStep

Progress = Callable[[str, float], None]
_EXPECTED = "wavesim.readings.bar.reading.expected"
_PULSE_TESTS = "wavesim.verdict.judgement.pulse_tests"


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
        beside: of ``run_files.begun_beside``, where it was begun before; the caller ends it.
        figures: draw all figures too.
        rerun: the command that runs this case, for the page.

    Returns:
        What came of it.

    Raises:
        StorageError: result.h5 can't be written or resumed.
        RunError: another file can't be written, or the integration failed; the result file then
            holds what came before.
    """
    laps, tell = _Laps(), progress or (lambda stage, part: None)
    tell("import", 0.0)
    simulated = case.simulation
    with _told_as_run_errors(folder), ExitStack() as until_the_end:
        from wavesim.io.folder_lock import locked

        if not resume:
            _begin(folder)
        if folder.is_dir():
            until_the_end.enter_context(locked(folder))
        own = beside or until_the_end.enter_context(begun_beside())
        worker = reached(simulated, own)
        known = _expected(case, worker)
        from wavesim.timedomain.compiled import keep_compiled

        keep_compiled()
        from wavesim.io.storing import Storing
        from wavesim.timedomain.time_step import time_step

        laps.end("import")
        steps = time_step(simulated)
        results, start = _results(case, folder, steps, resume)
        kept = {} if start else _shared(simulated, worker)
        tell("compile", 0.0)
        # What the analysis needs is loaded while the compiler leaves Python's lock alone.
        loading = Thread(target=lambda: [import_module(name) for name in needed(simulated)])
        storing = until_the_end.enter_context(Storing(results, kept))
        energies = _integrated(simulated, results, start, storing, laps, tell, loading.start)
        loading.join()
        tell("analyse", 0.0)
        field = _field(results, steps, storing, kept, energies)
        pictures = Pictures(worker, folder, figures, field)
        until_the_end.enter_context(results.gathering(storing.wait))
        passing = worker.ask(_PULSE_TESTS, field)
        found = measure(case, field, known.result(), passing.result)
        laps.end("analyse")
        tell("figures", 0.0)
        pictures.of_found(found, case.title or folder.name)
        storing.wait()
        if not kept:
            # The file is read until all is drawn: only then may another take its place.
            pictures.wait()
            laps.end("figures")
        tell("store", 0.0)
        results.finish("complete", found.tables)
        laps.end("store")
        tell("figures", 0.0)
        data, undrawn = pictures.result()
        laps.end("figures")
        notes = [note.replace(FOLDER, shlex.quote(str(folder))) for note in found.notes]
        for failure in undrawn:
            why = str(failure).partition("\n")[0]
            notes.append(f"a picture could not be drawn ({type(failure).__name__}: {why})")
        outcome = Outcome(summary(case, steps, found, laps.timing), folder, notes)
        write(outcome.summary, notes, data, results.told["case"], folder, rerun)
        for failure in undrawn:
            if isinstance(failure, OSError):
                raise failure
        return outcome


class _Laps:
    """Seconds that the stages of a run took: ``timing``."""

    def __init__(self) -> None:
        self.timing: dict[str, float] = {}
        self._clock = time.perf_counter()

    def end(self, stage: str, **parts: float) -> None:
        """A stage ends, or a part of it, and the next begins; some of it was of other names."""
        now = time.perf_counter()
        parts = parts | {stage: now - self._clock - sum(parts.values())}
        for name, seconds in parts.items():
            self.timing[name] = self.timing.get(name, 0.0) + seconds
        self._clock = now


def _expected(case: Case, worker: Worker | Here) -> Answer:
    """What is exact at the receivers of a bar, asked for before it is needed."""
    from wavesim.simulation.field import Field

    to_come, table = Field(case.simulation, case.simulation.times, {}), case.analysis
    return worker.ask(_EXPECTED, to_come, table.frequencies, table.damping, table.bands)


def _results(
    case: Case, folder: Path, steps: TimeStep, resume: bool
) -> tuple[Results, tuple[int, Sequence[Any]] | None]:
    """The file of a run's results, and where to carry on from; None begins at t = 0."""
    from wavesim.io.result_writer import Results
    from wavesim.io.whole_files import write_whole
    from wavesim.material.scaling import scales

    seconds = steps.step * float(scales(case.simulation.medium).time)
    resolved = case.resolved(steps.solver, seconds)
    told = {"title": case.title, "case": resolved, "stepper": steps.solver, "step": seconds}
    results, start = Results(folder / "result.h5", case.simulation, told), None
    if resume:
        start = results.carry_on()
    else:
        results.create()
    take_away_old(folder)
    write_whole(folder / "resolved.toml", resolved.encode())
    return results, start


def _shared(simulated: Simulation, worker: Worker | Here) -> dict[str, SharedArray]:
    """Arrays for the field that the process beside sees too; none where memory has no room."""
    from wavesim.simulation.field import Field
    from wavesim.timedomain.cost import in_memory

    if in_memory(simulated):
        to_come = Field(simulated, simulated.times, {})
        sizes = {name: len(to_come.positions(name)) for name in simulated.fields}
        with suppress(OSError):
            return {name: worker.array((simulated.frames, size)) for name, size in sizes.items()}
    return {}


def _field(
    results: Results,
    steps: TimeStep,
    storing: Storing,
    kept: dict[str, SharedArray],
    energies: list[Energy],
) -> Field:
    """The field of a run: as it was kept, or out of its file."""
    from wavesim.io.result_reader import read
    from wavesim.simulation.field import Energy, Field

    simulated = results.simulation
    if not kept:
        storing.wait()
        return read(results.path, simulated)
    storing.filled()
    for values in kept.values():
        values.freeze()
    energy, step = Energy.joined(energies), results.told["step"]
    return Field(simulated, simulated.times, kept, energy, steps.solver, step)


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


def _integrated(
    simulated: Simulation,
    results: Results,
    start: tuple[int, Sequence[Any]] | None,
    storing: Storing,
    laps: _Laps,
    tell: Progress,
    meanwhile: Callable[[], object],
) -> list[Energy]:
    """Integrate, and store each chunk while the next one is integrated.

    Returns:
        The energy of each chunk.
    """
    from wavesim.io.result_reader import StorageError
    from wavesim.report.terminal import BAD_INPUT, FAILED
    from wavesim.timedomain.integrate import CarryOnError, NotFiniteError, Timing, stream

    energies, spent = [], Timing()
    try:
        for chunk in stream(simulated, start, spent, meanwhile):
            storing.add(chunk)
            energies.append(chunk.energy)
            tell("integrate", (chunk.first + chunk.count) / simulated.frames)
    except CarryOnError as error:
        said = f"{results.path}: damaged: {error}; run without --resume"
        raise RunError(said, BAD_INPUT) from None
    except NotFiniteError as error:
        storing.wait()
        results.finish("failed")
        raise RunError(str(error), FAILED) from None
    except BaseException:
        with suppress(StorageError):
            storing.stop()
        raise
    laps.end("store", compile=spent.compile, integrate=spent.integrate)
    return energies


def _begin(folder: Path) -> None:
    from wavesim.report.terminal import unwritable

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(*unwritable(error, f"--out {folder}")) from None
