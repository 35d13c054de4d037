"""The command ``pulse``: arrivals, velocities, Q of pulse tests, one or a series of them.

Exit codes: 0 all well; 1 no record could be answered; 2 bad input.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

import click

from wavesim.cli.arguments import (
    FREQUENCY,
    INPUT,
    JSON,
    POSITIVE,
    TIME,
    WRITTEN,
    print_json,
    record_options,
    write_json,
    writing,
)
from wavesim.cli.series_values import States, numbers, states
from wavesim.report.terminal import BAD_INPUT, FELL_SHORT, console, stop

# Waves of a pulse test are no slower, m/s: loose dust; of times whose unit nobody says, loose soil.
_SLOWEST, _SLOWEST_UNSAID = 1.0, 20.0


@dataclass(frozen=True)
class _Set:
    """What the options say of the set-up: distances (m), delays by convention (s), the series."""

    distances: tuple[float, ...]
    delays: dict[str, float]
    states: States | None


@click.command(short_help="Arrivals, velocities, Q of pulse tests.")
@click.argument("files", nargs=-1, type=click.Path(), required=True)
@INPUT
@click.option(
    "--distance",
    metavar="L|L1,L2,…",
    help="From tip to tip in m or as 20mm; or one for each record.",
)
@click.option("--delay", type=TIME, help="Of cables and transducers, in s or as 20us.")
@click.option(
    "--face-to-face",
    metavar="FILE",
    help="Record of the transducers in touch, that tells the delay.",
)
@click.option(
    "--against",
    metavar="NAME=V1,V2,…",
    help="What differs from record to record, as stress=20,40,80kPa, or in a table, stress=FILE.",
)
@click.option(
    "--expected",
    type=(FREQUENCY, POSITIVE),
    metavar="F C",
    help="About how fast the wave is, C m/s at F Hz, where phases or packets are ambiguous.",
)
@click.option(
    "--wave",
    type=click.Choice(["P", "S"], case_sensitive=False),
    help="Which wave the transducers send; where it is not said, either may be the direct one.",
)
@WRITTEN
@JSON
@record_options
def pulse(
    files: tuple[str, ...],
    column: str | None,
    distance: str | None,
    delay: float | None,
    face_to_face: str | None,
    against: str | None,
    expected: tuple[float, float] | None,
    wave: str | None,
    out: str | None,
    as_json: bool,
    layout: Any,
) -> None:
    """Read pulse tests: FILES of a scope or a digitiser, or the folder of a run.

    One receiver beside its transmitter (--input, --distance), several receivers with positions,
    or a series of records of one set-up in different states (--against).
    """
    from wavesim.readings.pulse.answers import answer
    from wavesim.report.progress import working

    layout = replace(layout, input=column)
    tests, refused = _read(files, layout)
    series_of = None if against is None else states(against, files)
    setup = _setup(distance, delay, face_to_face, series_of, layout)
    with working(f"reading {len(tests)} pulse test{'s' * (len(tests) > 1)}"):
        readings, series = _readings(files, tests, refused, setup, expected, wave)
    found = answer(readings, series)
    if as_json:
        print_json(found)
    else:
        from wavesim.report.pulse_tables import show

        show(console(), readings, series)
    if out:
        _write(found, readings, series, Path(out), as_json)
    if not any(one.best.valid for one in readings):
        sys.exit(FELL_SHORT)


def _read(files: Sequence[str], layout: Any) -> tuple[list[Any], dict[int, str]]:
    """Tests of all files; of several, those that can't be read stand as None, with why."""
    from wavesim.records.content import RecordError
    from wavesim.records.of_pulse_test import of_pulse_file

    tests: list[Any] = []
    refused: dict[int, str] = {}
    for file in files:
        try:
            tests += of_pulse_file(file, layout)
        except RecordError as error:
            if len(files) == 1:
                stop(str(error), BAD_INPUT)
            refused[len(tests)] = str(error)
            tests.append(None)
    if len(refused) == len(tests):
        stop(next(iter(refused.values())), BAD_INPUT)
    return tests, refused


def _setup(
    distance: str | None,
    delay: float | None,
    face_to_face: str | None,
    against: States | None,
    layout: Any,
) -> _Set:
    from wavesim.readings.pulse.arrivals import CONVENTIONS

    distances: tuple[float, ...] = ()
    if distance is not None:
        distances = numbers("--distance", distance, "m")
        if not all(d > 0 for d in distances):
            stop(f"--distance {distance}: must be greater than 0, in m", BAD_INPUT)
    if delay is not None and face_to_face is not None:
        stop("give either --delay or --face-to-face, one of the two", BAD_INPUT)
    delays = {} if delay is None else dict.fromkeys(CONVENTIONS, delay)
    if face_to_face is not None:
        delays = _delays(face_to_face, layout)
    return _Set(distances, delays, against)


def _delays(file: str, layout: Any) -> dict[str, float]:
    """Delays by convention, of a record with the transducers face to face."""
    from wavesim.readings.pulse.signals import PulseError
    from wavesim.readings.pulse.transmission_record import transmission_record
    from wavesim.readings.pulse.travel_time import face_to_face
    from wavesim.records.content import RecordError
    from wavesim.records.of_pulse_test import of_pulse_file

    try:
        (test, *others) = of_pulse_file(file, layout)
        if others or len(test.signals) != 1 or test.sent is None:
            what = "must hold one receiver, and what was sent: --input names its column"
            stop(f"--face-to-face {file}: {what}", BAD_INPUT)
        (signal,) = test.signals.values()
        return face_to_face(transmission_record(test.t, signal, test.sent, file))
    except (RecordError, PulseError) as error:
        stop(f"--face-to-face: {error}", BAD_INPUT)


def _readings(
    files: Sequence[str],
    tests: list[Any],
    refused: dict[int, str],
    setup: _Set,
    expected: tuple[float, float] | None,
    wave: str | None,
) -> tuple[list[Any], Any]:
    import numpy as np

    from wavesim.readings.pulse.one_receiver import read_one
    from wavesim.readings.pulse.reading import Wanted
    from wavesim.readings.pulse.reading import refused as refusal
    from wavesim.readings.pulse.series_law import Series, law_of
    from wavesim.readings.pulse.series_reading import read_series
    from wavesim.readings.pulse.signals import PulseError
    from wavesim.records.of_pulse_test import of_lengths

    count = len(tests)
    if setup.states is not None:
        setup.states.check(
            [f if t is None else t.name for f, t in zip_longest(files, tests)], count
        )
    if len(setup.distances) not in (0, 1, count):
        stop(
            f"--distance: {len(setup.distances)} values for {count} records; give one, or one for "
            "each",
            BAD_INPUT,
        )
    each = (setup.distances * count if len(setup.distances) == 1 else setup.distances)[:count]
    found: list[Any] = [None] * count
    single: dict[int, Any] = {}
    for i, test in enumerate(tests):
        if test is None:
            # Files and tests are one for one up to what could not be read.
            name = files[i] if len(files) == count else f"record {i + 1}"
            found[i] = refusal(name, "receiver", math.nan, refused[i])
            continue
        distance = each[i] if each else math.nan
        try:
            if test.placed:
                found[i] = _line(test, expected, either_way=True)
            else:
                single[i] = _single(test, distance)
        except PulseError as error:
            if count == 1:
                stop(f"{test.name}: {error}", BAD_INPUT)
            found[i] = refusal(test.name, "receiver", distance, str(error))
    wanted = Wanted((wave or "").upper(), expected[1] if expected else math.nan)
    if setup.states is None:
        for i, (record, distance) in single.items():
            one = read_one(record, distance, setup.delays, wanted)
            found[i] = _noted(one, tests[i])
        if len(single) == count and (of_all := of_lengths(tests, single)):
            with suppress(PulseError):
                found.append(_line(of_all, expected))
        return found, None
    parameter, values = setup.states.parameter, np.array(setup.states.values)
    if single:
        own = list(single)
        records, distances = zip(*single.values(), strict=True)
        readings, _ = read_series(
            records, distances, setup.delays, parameter, values[own].tolist(), wanted
        )
        for i, one in zip(own, readings, strict=True):
            found[i] = _noted(one, tests[i])
    return found, Series(parameter, values, law_of(found, values))


def _noted(reading: Any, test: Any) -> Any:
    from wavesim.records.axes import UNSAID
    from wavesim.records.faults.moveout import of_no_wave

    best, result = reading.best, reading.result
    unsaid = any(UNSAID.format("time") in note for note in test.notes)
    slowest = _SLOWEST_UNSAID if unsaid else _SLOWEST
    if best.valid and (why := of_no_wave(best.velocity, best.velocity, slowest)):
        if unsaid and best.velocity < slowest:
            why = (
                f"{UNSAID.format('time')}, and in s the signal would go at {best.velocity:.3g} "
                "m/s, slower than waves in soils: give --time-unit, s if that is right"
            )
        why += ", or --distance in m" * (result is None)
        best = replace(best, valid=False, reason=why)
        result = result and result.refused(why)
    notes = (*test.notes, *reading.notes)
    return replace(reading, best=best, result=result, notes=notes)


def _line(test: Any, expected: tuple[float, float] | None, either_way: bool = False) -> Any:
    """A test of receivers along a line, from its first or from either end."""
    from wavesim.readings.pulse.array_reading import read_array
    from wavesim.readings.pulse.either_way import read_either_way

    placed = {name: x for name, x in test.positions.items() if math.isfinite(x)}
    signals = {name: test.signals[name] for name in placed}
    known = (test.sent, expected, test.unlike, test.noise, test.levelled)
    read = read_either_way if either_way else read_array
    return _noted(read(test.name, test.t, signals, placed, *known), test)


def _single(test: Any, distance: float) -> tuple[Any, float]:
    from wavesim.readings.pulse.transmission_record import transmission_record

    ((name, signal),) = test.signals.items()
    if not math.isfinite(distance):
        distance = abs(test.positions[name])
    if not (math.isfinite(distance) and distance > 0):
        stop(
            f"{test.name}: no position is known: give --distance, from tip to tip, in m; where "
            "several columns are receivers of one test, --spacing or --positions X1,X2,…; where "
            "several files are, --distance X1,X2,…",
            BAD_INPUT,
        )
    record = transmission_record(test.t, signal, test.sent, test.name)
    if test.sent is None:
        said = (
            "what was sent is taken to begin at t = 0; where a column of the file recorded it, "
            "--input names that"
        )
        record = replace(record, notes=(*record.notes, said))
    return record, distance


def _write(
    found: dict[str, Any], readings: Sequence[Any], series: Any, folder: Path, quiet: bool
) -> None:
    from wavesim.figures.pulse_test import drawings
    from wavesim.figures.style import write

    with writing(folder):
        write_json(folder / "pulse.json", found)
        written = [path.name for path in write(drawings(readings, series), folder)]
    if not quiet:
        click.echo(f"pulse.json, {', '.join(written)} in {folder}")
