"""A run's field measured, held against theory, and told: the verdict of a run, with its answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what measures is loaded while a run compiles
    from wavesim.case.load import Case
    from wavesim.simulation.simulation import Simulation

# Stands in a note for the folder of the run, which is not known here.
FOLDER = "FOLDER"


@dataclass(frozen=True)
class Found:
    """What was measured of a field.

    Attributes:
        checks: the verdict.
        shown: what its figures are drawn from.
        tables: what is stored of it, with units.
        summary: what summary.json gets besides.
        answers: the few rows that a reader asks for first.
        notes: what the record was too short, or the grid too coarse, to tell.
    """

    checks: list[Any]
    answers: dict[str, Any]
    shown: Any
    tables: dict[str, Any]
    summary: dict[str, Any]
    notes: list[str]


# The modules that read the pulse tests of a run.
FOR_PULSE_TESTS = "wavesim.records.of_pulse_test", "wavesim.readings.pulse.answers", "scipy.signal"


def needed(simulated: Simulation) -> tuple[str, ...]:
    """The modules that measure a run of this case, its pulse tests apart."""
    if simulated.endless:
        return "wavesim.verdict.endless", "wavesim.readings.bar.reading"
    return "wavesim.verdict.bar_answers", "scipy.signal"


def measure(
    case: Case,
    field: Any,
    known: Any = None,
    passing: Callable[[], tuple[dict[str, Any], list[str]]] | None = None,
) -> Found:
    """Measure a field and hold it against theory.

    Every bar is measured by what its receivers record; an endless one by its waves, ω(k) and k(ω),
    besides.

    Args:
        case: the case.
        field: the field of its run.
        known: what the exact solvers say of its receivers; worked out where None.
        passing: gives what :func:`pulse_tests` reads of it; read here where None.
    """
    table, passing = case.analysis, passing or partial(pulse_tests, field)
    if case.simulation.endless:
        from wavesim.readings.bar.loudness import Loudness
        from wavesim.readings.bar.reading import expected
        from wavesim.readings.dispersion.extract import extract
        from wavesim.verdict.branches import hold, tables
        from wavesim.verdict.endless import endless_notes, judge, of_endless
        from wavesim.verdict.receivers_and_energy import receiver_notes, signal_checks

        measured = extract(field, case.k_range[1], table.frequencies, table.damping)
        held = [hold(field, m, case.k_range) for m in measured]
        checks = judge(field, held)
        found = tables(held)
        summary, said = passing()
        if field.receivers:
            known = known or expected(field)
            exact = known.signals or known.finer
            error, heard = Loudness(field).compared(exact)
            checks += signal_checks(field, error, finer=bool(known.finer))
            said = receiver_notes(field, exact, heard, known.refused) + said
        said = endless_notes(field, held) + said
        return Found(checks, of_endless(field, held), held, found, summary, said)
    from wavesim.readings.bar.pulse_test import rows
    from wavesim.readings.bar.reading import read_bar
    from wavesim.verdict.bar import judge_bar
    from wavesim.verdict.bar_answers import bar_notes, of_bar
    from wavesim.verdict.gap_rows import of_media

    reading = read_bar(field, table.frequencies, table.damping, known, table.bands)
    summary = {"pulse_tests": [rows(test) for test in reading.pulses]} | passing()[0]
    checks = judge_bar(field, reading)
    answers = ({} if reading.scattered else of_media(field)) | of_bar(field, reading)
    told = bar_notes(reading, field)
    return Found(checks, answers, reading, reading.tables(), summary, told)


# What of a pulse each convention follows, so that its speed is not taken for another.
_TIMED = {
    "first break": "the speed of its earliest motion, which the fastest of its waves bring: no "
    "phase velocity at any one frequency",
    "threshold": "the speed of its first rise, which the faster of its waves bring: no phase "
    "velocity at any one frequency",
    "envelope": "the speed of its energy, a group velocity",
    "correlation": "the speed at which its shape is carried on, near the phase velocity at its "
    "peak frequency",
}


def pulse_tests(field: Any) -> tuple[dict[str, Any], list[str]]:
    """What ``wavesim pulse`` reads of a run with two receivers or more beside its sources.

    Returns:
        ({"pulse": as ``wavesim pulse --json`` has it, but for the frequencies}, a note of the
        velocities); nothing where there are no such receivers.
    """
    from wavesim.material.shown import with_error
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
                readings.append(
                    read_array(test.name, test.t, *given, unlike=test.unlike, noise=0.0)
                )
    except (RecordError, PulseError):
        # Receivers on both sides, or where nothing came: nothing that could be read.
        pass
    if not readings:
        return {}, []
    told = answer(readings, None)
    for one in told["records"]:
        one.pop("frequencies", None)
    read: dict[str, list[str]] = {}
    refused: dict[str, list[str]] = {}
    for one in readings:
        name = one.file.rpartition(" ")[2]
        if one.best.valid:
            speed = with_error(one.best.velocity, one.best.velocity_error, "m/s")
            read.setdefault(one.best.convention, []).append(f"{name} {speed}")
        else:
            refused.setdefault(one.best.reason, []).append(name)
    said = [
        f"pulse velocity between receivers by {by}, {_TIMED[by]}: {', '.join(speeds)}"
        for by, speeds in read.items()
    ]
    said += [
        f"no pulse velocity between receivers of {', '.join(names)}: {why}"
        for why, names in refused.items()
    ]
    return {"pulse": told}, [f"{one}; wavesim pulse {FOLDER} tells more" for one in said]
