"""A case beside a record: lag, scale and misfit, and how a record that does not lie on it would.

Where more than a tenth is left over, other ways to lay it are tried until one leaves less than
half of that: columns exchanged, of other polarity, or late; each receiver with a gain of its own;
another field of the case, the rate in time of its own, or the rate of that, as sensors of velocity
and of acceleration record.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.case.load import Case
from wavesim.material.dual import Dual
from wavesim.material.shown import in_time
from wavesim.readings.matched_record import Measured, resampling
from wavesim.readings.misfit import LARGEST_RESIDUAL, Comparison, goes_with, laid_otherwise, misfit
from wavesim.studies.least_squares import Solution, solve
from wavesim.studies.waveform_fit import GAIN, LAG, REACH, Waveforms, signals_of

Float = NDArray[Any]

# From so much left over on, another way to lay the record on the case is looked for, and told where
# it leaves less than this part of that.
LOOKED_INTO, _FAR_LESS = 0.1, 0.5
# What is left over goes with the signals where they explain this part of its power (of noise and of
# jitter 0.04 at most was seen).
NO_NOISE = 0.3
# A gain is told where it differs from the others' by this part.
_OTHER_GAIN = 0.05


def compare(
    case: Case, measured: Measured, lag: float | None = None, scale: float | None = None
) -> Comparison:
    """Lay a case beside a record.

    Args:
        case: the case.
        measured: the record.
        lag, scale: stated, s and –; fitted where None.
    """
    frames = signals_of(case, measured)
    found = beside_case(case, measured, lag, scale, frames)
    if not found.residual > LOOKED_INTO:
        return found
    last = float(measured.t[-1]) - (lag or 0.0)
    power = np.sum((frames.value - frames.value.mean(axis=0)) ** 2, axis=1)
    come = float(power[case.simulation.times <= last].sum() / (power.sum() or 1.0))
    if found.residual > LARGEST_RESIDUAL and come < LOOKED_INTO:
        return replace(
            found,
            otherwise=f"the record ends at {measured.t[-1]:.4g} s, by when {come:.2g} of the "
            "power of the case's signals has come: record longer, or say by --lag how late its "
            "clock is",
        )
    for other, late, words in _other_ways(case, measured, frames, lag or 0.0):
        if other.residual < _FAR_LESS * found.residual:
            moved = lag is not None and abs(late - lag) > measured.interval
            words += [f"--scale {other.scale:.4g}"] if scale is not None else []
            words += [f"--lag {late:.4g}"] if moved or not words else []
            said = f"laid otherwise, {'; '.join(words)}: so {other.residual:.2%} would be left "
            return replace(found, otherwise=said + f"over, in place of {found.residual:.1%}")
    return found


def _other_ways(
    case: Case, measured: Measured, frames: Dual, lag: float
) -> Iterator[tuple[Comparison, float, list[str]]]:
    """Ways to lay a record on a case, each with its lag, s, and how it differs, in words."""
    yield _arranged(case, measured, frames, lag)
    own = np.std(measured.values, axis=0) / (np.std(frames.value, axis=0) + 1e-300)
    gains = own / np.median(own)
    told = [f"{name} × {g:.3g}" for name, g in zip(measured.names, gains, strict=True)
            if abs(g - 1) > _OTHER_GAIN]  # fmt: skip
    if told:
        alike = replace(measured, values=measured.values / gains)
        other, late, words = _arranged(case, alike, frames, lag)
        said = f"as of unlike gains, or another loss: {', '.join(told)} of their median"
        yield other, late, [said, *words]
    name, fields = measured.field, []
    for field in {f"{name}_t", f"{name}_tt", *case.simulation.fields} - {name}:
        other_field = replace(measured, field=field)
        signals = signals_of(case, other_field)
        if np.any(signals.value):
            other, late, words = _arranged(case, other_field, signals, lag)
            fields.append((other, late, [f"--field {field}", *words]))
    if fields:  # a micro-field is alike the rate of its macro-field
        yield min(fields, key=lambda one: one[0].residual)


def _arranged(
    case: Case, measured: Measured, frames: Dual, lag: float
) -> tuple[Comparison, float, list[str]]:
    """The record with its columns where they lie best, without those of no receiver."""
    sim, step = case.simulation, measured.interval
    own = resampling(sim.frames, sim.interval, np.arange(0.0, sim.duration + step / 2, step))
    both = own @ frames.value, measured.values
    there, recorded = (part - part.mean(axis=0) for part in both)
    reach = max(REACH * sim.duration, abs(lag) + sim.duration / 2)
    order, sign, at = laid_otherwise(recorded, there, step, float(measured.t[0]), reach)
    sign = sign * (1 if sign.sum() > 0 else -1)
    laid = replace(measured, values=measured.values[:, order] * sign, t=measured.t - at)
    other = beside_case(case, laid, None, None, frames)
    fits = np.array([one.residual <= LARGEST_RESIDUAL for one in other.receivers])
    names = [measured.names[j] for j in order]
    words = [f"{name} is {of}" for name, of, ok in zip(names, measured.names, fits, strict=True)
             if ok and of != name]  # fmt: skip
    late = []
    if len(fits) > 2 * (~fits).sum() > 0:  # what is none of these is left out
        other = beside_case(case, _of(laid, fits), None, None, frames[:, fits])
        for j in np.flatnonzero(~fits):
            alone = np.arange(len(fits)) == j
            one = beside_case(case, _of(laid, alone), None, None, frames[:, alone])
            if one.residual <= LARGEST_RESIDUAL:
                scale, unit = in_time(one.lag - other.lag)
                late.append(f"{names[j]} {(one.lag - other.lag) * scale:.3g} {unit}")
            else:
                words.append(f"{names[j]} is none of them, and to leave out")
    words = [f"what is matched to {', '.join(words)}"] if words else []
    if late:
        words.append(f"{', '.join(late)} later than the others: its clock or its place is another")
    turned = [names[j] for j in np.flatnonzero(fits & (sign < 0))]
    if turned:
        words.append(f"{', '.join(turned)} of reversed polarity: turn round or leave out")
    return other, at + other.lag, words


def _of(measured: Measured, some: NDArray[np.bool_]) -> Measured:
    """Some receivers of a record."""
    at = np.flatnonzero(some)
    return replace(
        measured,
        names=tuple(measured.names[j] for j in at),
        positions=tuple(measured.positions[j] for j in at),
        values=measured.values[:, at],
    )


def beside_case(
    case: Case, measured: Measured, lag: float | None, scale: float | None, frames: Dual
) -> Comparison:
    """The record beside the case as it is matched, where its field at the receivers is known."""
    data = Waveforms(case, [], measured, lag, scale, known=frames)
    values = data.beginning()
    solution: Solution | None = solve(data, values) if data.parameters else None
    if solution is not None:
        values = solution.values
    there, left = data.laid_over(values)
    inside = np.isfinite(there).all(axis=1)
    found = data.scale_of(values)
    errors = solution.errors if solution is not None else {}
    recorded = measured.values[inside] - measured.values[inside].mean(axis=0)
    per = tuple(
        misfit(name, x, recorded[:, j], there[inside, j], left[inside, j], measured.interval)
        for j, (name, x) in enumerate(zip(measured.names, measured.positions, strict=True))
    )
    residual = float(np.sqrt(np.mean(left[inside] ** 2) / np.mean(recorded**2)))
    quarter = 0.25 / (data.centre * measured.interval)
    explained = goes_with(there[inside], left[inside], measured.positions, quarter)
    return Comparison(
        measured, there, per,
        lag if lag is not None else values[LAG], errors.get(LAG, np.nan),
        found, errors.get(GAIN, np.nan),
        residual, residual * float(np.sqrt(explained)) if explained > NO_NOISE else 0.0,
    )  # fmt: skip
