"""A case beside a record, and its fit to waveforms: what each of them says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.case.load import Case
from wavesim.material.dual import Dual
from wavesim.readings.matched_record import Measured, resampling
from wavesim.readings.misfit import LARGEST_RESIDUAL, Comparison, goes_with, laid_otherwise, misfit
from wavesim.studies.fit_terms import (
    ALLOWED,
    SPOILS,
    FitAnswer,
    Held,
    Target,
    answered,
    check_held,
    held_beside,
    targets,
    with_values,
)
from wavesim.studies.least_squares import Solution, solve
from wavesim.studies.waveform_fit import GAIN, LAG, REACH, Waveforms, fit_waveforms, signals_of

Float = NDArray[Any]


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
    found = _beside(case, measured, lag, scale, frames)
    if not found.residual > _LOOKED_INTO:
        return found
    sim, step = case.simulation, measured.interval
    last = float(measured.t[-1]) - (lag or 0.0)
    power = np.sum((frames.value - frames.value.mean(axis=0)) ** 2, axis=1)
    come = float(power[sim.times <= last].sum() / (power.sum() or 1.0))
    if found.residual > LARGEST_RESIDUAL and come < _LOOKED_INTO:
        return replace(
            found,
            otherwise=f"the record ends at {measured.t[-1]:.4g} s, by when {come:.2g} of the "
            "power of the case's signals has come: record longer, or say by --lag how late its "
            "clock is",
        )
    own = resampling(sim.frames, sim.interval, np.arange(0.0, sim.duration + step / 2, step))
    both = own @ frames.value, measured.values
    there, recorded = (part - part.mean(axis=0) for part in both)
    reach = max(REACH * sim.duration, abs(lag or 0.0) + sim.duration / 2)
    order, sign, at = laid_otherwise(recorded, there, step, float(measured.t[0]), reach)
    sign = sign * (1 if sign.sum() > 0 else -1)
    laid = replace(measured, values=measured.values[:, order] * sign, t=measured.t - at)
    other = _beside(case, laid, None, None, frames)
    own = np.array([one.residual <= LARGEST_RESIDUAL for one in other.receivers])
    if len(own) > 2 * (~own).sum() > 0:  # what is none of these is left out
        names, positions = (np.array(part)[own] for part in (laid.names, laid.positions))
        laid = replace(laid, names=names, positions=positions, values=laid.values[:, own])
        other = _beside(case, laid, None, None, frames[:, own])
    if not other.residual < _FAR_LESS * found.residual:
        return found
    late = lag is not None and abs(at + other.lag - lag) > step
    columns = zip(measured.names, np.array(measured.names)[order], sign, own, strict=True)
    parts = _laid_so([*columns])
    parts += [f"--scale {other.scale:.4g}"] if scale is not None else []
    parts += [f"--lag {at + other.lag:.4g}"] if late or not parts else []
    said = f"laid otherwise, {'; '.join(parts)}: so {other.residual:.2%} would be left over, in "
    return replace(found, otherwise=said + f"place of {found.residual:.1%}")


def _laid_so(columns: list[tuple[str, str, float, bool]]) -> list[str]:
    """How columns lie, in words, from (receiver, whose column it is, its sign, whether it is)."""
    moved = [f"{of} is {name}" for name, of, _, own in columns if own and of != name]
    moved += [f"{of} is none of them, and to leave out" for _, of, _, own in columns if not own]
    turned = [of for _, of, sign, own in columns if own and sign < 0]
    said = [f"what is matched to {', '.join(moved)}"] if moved else []
    if turned:
        said.append(f"{', '.join(turned)} of reversed polarity: turn round or leave out")
    return said


def _beside(
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
        found, errors.get(GAIN, np.nan) * abs(found / values.get(GAIN, 1.0)),
        residual, residual * float(np.sqrt(explained)) if explained > _NO_NOISE else 0.0,
    )  # fmt: skip


# From so much left over on, another way to lay the record on the case is looked for, and told where
# it leaves less than this part of that.
_LOOKED_INTO, _FAR_LESS = 0.1, 0.5
# What is left over goes with the signals where they explain this part of its power (of noise and of
# jitter 0.04 at most was seen).
_NO_NOISE = 0.3
# Places are changed by this part, to see what that does.
_CHANGED = 1e-6


def of_waveforms(
    case: Case,
    measured: Measured,
    keys: Sequence[str],
    lag: float | None = None,
    gain: float | None = None,
    known_to: Mapping[str, float] | None = None,
) -> FitAnswer:
    """Fit a case's parameters to waveforms.

    Args:
        case: the case; its values begin the fit.
        measured: the record laid beside it.
        keys: what to fit, such as "medium.anisotropy".
        lag, gain: stated, s and –; fitted where None.
        known_to: to which part of its size what is held is known, one standard error, by name, that
            of all others under ""; errors hold it. Positions are distances from the first source.

    Raises:
        FitError: it can't be done.
    """
    varied = targets(case, keys)
    beside_them = held_beside(case, varied)
    places = [f"position of {name}" for name in measured.names]
    stated_gain = ["--scale"] if gain is not None else []
    check_held(known_to or {}, [*(one.key for one in beside_them), *places, *stated_gain])
    data = Waveforms(case, varied, measured, lag, gain)
    solution = fit_waveforms(data)
    values = [solution.values[one.key] for one in varied]
    layers = with_values(case.simulation.layers, varied, values)
    fitted = replace(case, simulation=replace(case.simulation, layers=layers))
    scale = data.scale_of(solution.values)
    lain = lag if lag is not None else solution.values[LAG]
    beside = compare(fitted, measured, lain, scale)
    r, J, _ = data.residuals(solution.values)
    columns = _held_columns(fitted, beside_them, measured, lain, scale, gain)
    held = Held.of(J, columns)
    # What was fitted to columns of other receivers is no case to lay them on.
    far = beside.residual > LARGEST_RESIDUAL
    otherwise = compare(case, measured, lag, gain).otherwise if far else ""
    notes = measured.notes if far else beside.notes
    allowed = ALLOWED * np.linalg.norm(held.left * held.parts(known_to)) if known_to else 0.0
    if known_to:  # where it is not stated, errors hold that what is held is off
        part, most = held.seen(J, columns, r)
        of_held = beside.residual * float(np.sqrt(part)) if part > _NO_NOISE else 0.0
        if of_held > max(SPOILS, allowed):
            beside = replace(beside, systematic=max(beside.systematic, of_held))
            notes = (*notes, f"what is left over is as errors of what is held: most so {most}")
    stated = [f"--{name}" for name, one in (("lag", lag), ("scale", gain)) if one is not None]
    reasons = {
        one.key: _reason(solution, one.key, beside, otherwise, float(allowed), stated)
        for one in varied
    }
    found = answered(
        "waveforms", solution.values, solution.errors, solution.covariance, held, known_to or {},
        reasons, bend=solution.bend, degenerate=solution.degenerate, residual=beside.residual,
        evaluations=solution.evaluations, notes=notes, comparison=beside,
    )  # fmt: skip
    if GAIN in found.nuisances:
        value, error = found.nuisances[GAIN]
        found.nuisances[GAIN] = scale, error * abs(scale / value)
    return found


def _held_columns(
    case: Case,
    varied: Sequence[Target],
    measured: Measured,
    lag: float,
    scale: float,
    gain: float | None,
) -> dict[str, Float]:
    """{What is held: how the residuals, (n,), change as it grows by all of its size}."""
    own, data = case.simulation.layers, Waveforms(case, [*varied], measured, lag, scale)
    now, slopes, _ = data.residuals({one.key: one.value_in(own) for one in varied})
    found = {one.key: slope * one.size_in(own) for one, slope in zip(varied, slopes.T, strict=True)}
    for j, (name, x) in enumerate(zip(measured.names, measured.positions, strict=True)):
        away = x + _CHANGED * (x - case.simulation.sources[0].position)
        places = [*measured.positions[:j], away, *measured.positions[j + 1 :]]
        known = signals_of(case, replace(measured, positions=tuple(places)))
        moved, _, _ = Waveforms(case, [], measured, lag, scale, known=known).residuals({})
        found[f"position of {name}"] = (moved - now) / _CHANGED
    if gain is not None:
        found["--scale"] = Waveforms(case, [], measured, lag, 2 * scale).residuals({})[0] - now
    return found


def _reason(
    solution: Solution,
    key: str,
    beside: Comparison,
    otherwise: str,
    allowed: float,
    stated: Sequence[str],
) -> str:
    """Why a value does not count, or ""."""
    if beside.residual > LARGEST_RESIDUAL:
        return f"{beside.residual:.0%} of the record is left over: " + (
            otherwise
            or "the case is another than what was measured, the record holds as much noise, drift "
            "or crosstalk beside, or the first guess is too far off: begin elsewhere with --set"
        )
    if not np.isfinite(solution.errors[key]):
        with_it = sorted({k for one in solution.degenerate if key in one for k in one} - {key})
        with_what = f" apart from {', '.join(with_it)}" if with_it else ""
        options = {GAIN: "--scale", LAG: "--lag"}
        known = "".join(f", or state {options[k]}" for k in with_it if k in options)
        leave = "one of them" if with_it else "it"
        return f"the data do not tell it{with_what}: leave {leave} out of --vary{known}"
    if beside.systematic > max(SPOILS, allowed):
        return (
            f"what is left over, {beside.systematic:.1%} of the record, goes with the signals and "
            "is no noise: something that is held is off, and the errors do not hold that; vary "
            f"more keys, {''.join(f'leave {one} out, ' for one in stated)}hold them at other "
            "values with --set, or say by --held how well they are known"
        )
    if key in solution.at_limits:
        return (
            "it ended at the limit of what is admissible: hold it there with --set, and vary others"
        )
    fewer = "leave out of --vary what the data do not tell"
    then = fewer if solution.degenerate else "begin closer, with --set"
    return "" if solution.converged else f"the fit did not settle: {then}"
