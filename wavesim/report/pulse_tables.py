"""Tables of pulse tests: what was read, in an order that answers."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console

from wavesim.material.shown import DECIBELS, in_frequency, in_time, in_wavenumber, with_error
from wavesim.readings.pulse.reading import Reading, ReceiverArrivals
from wavesim.readings.pulse.series_law import Series
from wavesim.report.terminal import new_table

_CONVENTIONS = ("first break", "threshold", "envelope", "correlation", "followed")
_WIDE = 110
# More notes than this are told by their number alone.
_MOST_NOTES = 12
# Receivers whose arrivals are shown.
_MOST_RECEIVERS = 8
_LONGEST_NAME = 16
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")
# No Q above this is told from none.
_HIGHEST_Q = 1e6


def show(console: Console, readings: Sequence[Reading], series: Series | None) -> None:
    """Print readings, and the law of their series."""
    alone = [one for one in readings if one.result is None]
    if alone:
        _single(console, alone, readings, series)
    for one in readings:
        if one.result is not None:
            _several(console, one)
    if series is not None:
        _law(console, readings, series)
    _notes(console, readings)


def _single(
    console: Console, alone: Sequence[Reading], readings: Sequence[Reading], series: Series | None
) -> None:
    times = [one.best.time for one in alone if math.isfinite(one.best.time)]
    scale, unit = in_time(min(times) if times else math.nan)
    # A narrow terminal has room for the answer alone.
    shown = _CONVENTIONS[:4] if console.width >= _WIDE else ()
    varied = [series.parameter.replace(" (", "\n(")] if series is not None else []
    table = new_table("record", *varied, f"travel time ({unit})", "velocity (m/s)", *shown)
    for place, one in enumerate(readings):
        if one.result is not None:
            continue
        row = [one.file]
        if series is not None:
            row.append(f"{series.values[place]:g}")
        best = one.best
        if best.valid:
            row += [with_error(best.time * scale, best.error * scale),
                    with_error(best.velocity, best.velocity_error)]  # fmt: skip
        else:
            row += ["–", "refused"]
        found = one.receivers[0].arrivals
        for name in shown:
            time = found[name].time if name in found else math.nan
            row.append(f"{time * scale:.4g}" if math.isfinite(time) else "–")
        table.add_row(*row)
    console.print(table)
    if len(alone) == 1 and not shown and alone[0].best.valid:
        console.print(_by_convention(alone[0], scale, unit))
    said = "± is one standard error: noise, and what conventions and other waves leave open."
    console.print(said + (" Conventions' times include the system's delay." if shown else ""))
    for said, count in _alike([one.best.reason for one in alone if not one.best.valid]):
        console.print(f"{count} refused: {said}.", markup=False)


def _alike(reasons: Sequence[str]) -> list[tuple[str, int]]:
    """Reasons and how many have each; those that differ by their first number have its range."""
    groups: dict[str, list[str]] = {}
    for reason in reasons:
        groups.setdefault(_NUMBER.sub("#", reason, count=1), []).append(reason)
    told = []
    for key, those in groups.items():
        numbers = sorted({_NUMBER.findall(one)[0] for one in those if "#" in key}, key=float)
        said = key.replace("#", " to ".join(dict.fromkeys([*numbers[:1], *numbers[-1:]])), 1)
        told.append((said, len(those)))
    return told


def _several(console: Console, one: Reading) -> None:
    assert one.result is not None
    result, best = one.result, one.best
    console.print(f"{one.file}: {len(one.receivers)} receivers", markup=False)
    if best.valid:
        speed = with_error(best.velocity, best.velocity_error, "m/s")
        console.print(f"  velocity {speed} (by {best.convention}; ± is one standard error)")
    else:
        console.print(f"  velocity refused: {best.reason}.", markup=False)
    quality, ratio = result.quality, result.constant_quality
    per, hertz = in_frequency(2 * math.pi * quality.band[1])
    low, high = (2 * math.pi * per * f for f in quality.band)
    if not quality.reason:
        told = f"  Q {with_error(quality.quality, quality.error)} from α and v_g over {low:.4g} to "
        told += f"{high:.4g} {hertz}"
        if quality.excess > 3:
            told += f"; it changes with frequency (χ²/ν = {quality.excess:.2g})"
        console.print(told)
    elif quality.reason != best.reason:
        console.print(f"  Q refused: {quality.reason}.", markup=False)
    if not ratio.reason:
        told = f"  Q {with_error(ratio.quality, ratio.error)} by the spectral ratio"
        if not quality.reason:
            apart = abs(ratio.inverse - quality.inverse)
            apart /= math.hypot(ratio.inverse_error, quality.inverse_error)
            told += (
                ", which takes the velocity as constant: a check alone, "
                f"{apart:.1f} standard errors off; report Q from α and v_g"
            )
        console.print(told)
    elif ratio.reason != quality.reason:
        console.print(f"  Q by the spectral ratio refused: {ratio.reason}.", markup=False)
    times = [abs(float(t)) for own in result.arrivals.values() for t in own.time]
    scale, unit = in_time(max((t for t in times if math.isfinite(t)), default=math.nan))
    heads = [f"{name}\n({unit})" for name in result.arrivals]
    table = new_table("receiver", *heads, words=0)
    table.columns[0].justify = "left"
    for receiver in one.receivers[:_MOST_RECEIVERS]:
        own = [receiver.arrivals[name].time * scale for name in result.arrivals]
        each = [f"{t:.5g}" if math.isfinite(t) else "–" for t in own]
        table.add_row(_place(receiver, one.receivers[-1].position >= 10), *each)
    table.add_section()
    speeds = [result.velocities[name] for name in result.arrivals]
    table.add_row("velocity (m/s)", *(_known(v.velocity, v.error) for v in speeds))
    console.print(table)
    mixed = [v.reason for v in speeds] if "several waves" in best.reason else [best.reason]
    for why in dict.fromkeys(v.reason for v in speeds if v.reason not in ("", *mixed)):
        names = [n for n, v in zip(result.arrivals, speeds, strict=True) if v.reason == why]
        console.print(f"– {', '.join(names)}: {why}.", markup=False)
    if len(one.receivers) > _MOST_RECEIVERS:
        console.print(f"The first {_MOST_RECEIVERS} of {len(one.receivers)} receivers.")
    _spectra(console, one)


def _place(receiver: ReceiverArrivals, far: bool) -> str:
    """A receiver's name and position, in m of far ones, which some headings say already."""
    x = receiver.position
    name, place = receiver.name[:_LONGEST_NAME], f"{x:.5g} m" if far else f"{x * 1e3:.5g} mm"
    return name if place in name else f"{name}, {place}"


def _known(value: float, error: float) -> str:
    """A value with its error; "–" where no error is known."""
    return with_error(value, error) if math.isfinite(error) else "–"


def _spectra(console: Console, one: Reading) -> None:
    """A few frequencies of c, v_g, α and Q."""
    assert one.result is not None
    found = one.result.dispersion
    known = found.valid & (np.isfinite(found.phase_error) | np.isfinite(found.group_error))
    own = np.flatnonzero(known).tolist()
    if not own:
        return
    rows = own[:: max(1, len(own) // 8)]
    per, hertz = in_frequency(float(found.omega[own].max()))
    share, length = in_wavenumber(float(found.k.real[own].max()))
    heads = f"f ({hertz})", "c (m/s)", "v_g (m/s)", f"α (dB/{length})", "Q"
    table = new_table(*heads, words=0)
    loss, error = (DECIBELS * share * a for a in (found.attenuation, found.attenuation_error))
    for i in rows:
        table.add_row(
            f"{found.omega[i] * per:.5g}",
            _known(found.phase_velocity[i], found.phase_error[i]),
            _known(found.group_velocity[i], found.group_error[i]),
            _known(loss[i], error[i]),
            _quality(found, i),
        )
    console.print(table)


def _quality(found: Any, i: int) -> str:
    """Q, or what it is above where no loss is seen."""
    if math.isfinite(found.quality[i]):
        return with_error(found.quality[i], found.quality_error[i])
    least = found.quality_at_least[i]
    return f"> {min(least, _HIGHEST_Q):.3g}" if math.isfinite(least) else "–"


def _by_convention(one: Reading, scale: float, unit: str) -> str:
    """The travel time by each convention, beside the one that was taken."""
    own = one.receivers[0].arrivals
    told = [
        f"{name} {own[name].time * scale:.4g}"
        for name in _CONVENTIONS
        if name in own and math.isfinite(own[name].time)
    ]
    delay = ""
    if one.delay:
        own_delay = f"{one.delay * scale:.4g} for the {one.best.convention}"
        delay = f", the system's delay in them ({own_delay})"
    return f"Taken is the {one.best.convention}. By convention, {unit}{delay}: {', '.join(told)}."


def _law(console: Console, readings: Sequence[Reading], series: Series) -> None:
    law, name = series.law, series.parameter.partition(" (")[0]
    if law is None:
        console.print(
            f"No law V = a {name}^b: it needs three velocities at two values above 0 or more."
        )
        return
    a, b = with_error(law.a, law.a_error), with_error(law.b, law.b_error)
    console.print(f"V = a {name}^b: a = {a} m/s, b = {b}; scatter {law.scatter:.1%}", markup=False)
    for i in law.outliers:
        console.print(f"  set aside: {readings[i].file}, {readings[i].best.velocity:.5g} m/s")


def _notes(console: Console, readings: Sequence[Reading]) -> None:
    """Each note once, with how many records it is of."""
    said: dict[str, list[Any]] = {}
    for one in readings:
        for note in dict.fromkeys(one.notes):
            said.setdefault(note, []).append(one.file)
    # Of those that differ in a number alone, one speaks for all.
    alike: dict[str, list[str]] = {}
    for note in said:
        alike.setdefault(
            "".join(c for c in note if not c.isdigit() and c not in ".-+e"), []
        ).append(note)
    for number_of, notes in enumerate(alike.values()):
        if number_of == _MOST_NOTES:
            console.print(f"… and {len(alike) - _MOST_NOTES} more notes: see --json")
            break
        files = [file for note in notes for file in said[note]]
        where = (
            ""
            if len(readings) == 1
            else (f"{files[0]}: " if len(files) == 1 else f"{len(files)} records, as {files[0]}: ")
        )
        console.print(f"Note: {where}{notes[0]}.", markup=False)
