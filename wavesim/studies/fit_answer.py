"""A fit of a case to waveforms: what it says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.case.load import Case
from wavesim.readings.matched_record import Measured
from wavesim.readings.misfit import LARGEST_RESIDUAL, SPOILS, Comparison
from wavesim.studies.comparison import LOOKED_INTO, NO_NOISE, beside_case, compare
from wavesim.studies.fit_terms import (
    ALLOWED,
    FitAnswer,
    Held,
    Target,
    answered,
    check_held,
    held_beside,
    targets,
    with_values,
)
from wavesim.studies.least_squares import Solution
from wavesim.studies.waveform_fit import GAIN, LAG, Waveforms, fit_waveforms, signals_of

Float = NDArray[Any]


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
    beside = beside_case(fitted, measured, lain, scale, signals_of(fitted, measured))
    r, J, _ = data.residuals(solution.values)
    columns = _held_columns(fitted, beside_them, measured, lain, scale, gain)
    held = Held.of(J, columns)
    # What was fitted to columns of other receivers is no case to lay them on.
    far = beside.residual > LARGEST_RESIDUAL
    otherwise = ""
    if beside.residual > LOOKED_INTO:
        otherwise = compare(case if far else fitted, measured, lag, gain).otherwise
    notes = measured.notes
    allowed = ALLOWED * np.linalg.norm(held.left * held.parts(known_to)) if known_to else 0.0
    if known_to:  # where it is not stated, errors hold that what is held is off
        part, most = held.seen(J, columns, r)
        of_held = beside.residual * float(np.sqrt(part)) if part > NO_NOISE else 0.0
        if of_held > max(SPOILS, allowed) and not (far or otherwise):
            beside = replace(beside, systematic=max(beside.systematic, of_held))
            notes = (*notes, f"what is left over is as errors of what is held: most so {most}")
    if otherwise and not max(beside.systematic, beside.residual * far) > max(SPOILS, allowed):
        notes = (*notes, otherwise)
    stated = [f"--{name}" for name, one in (("lag", lag), ("scale", gain)) if one is not None]
    reasons = {
        one.key: _reason(solution, one.key, beside, otherwise, float(allowed), stated)
        for one in varied
    }
    return answered(
        "waveforms", solution.values, solution.errors, solution.covariance, held, known_to or {},
        reasons, bend=solution.bend, degenerate=solution.degenerate, residual=beside.residual,
        evaluations=solution.evaluations, notes=notes, comparison=beside,
    )  # fmt: skip


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
            "is no noise: "
        ) + (
            otherwise
            or "something that is held is off, and the errors do not hold that; vary more keys, "
            f"{''.join(f'leave {one} out, ' for one in stated)}hold them at other values with "
            "--set, or say by --held how well they are known"
        )
    if key in solution.at_limits:
        return (
            "it ended at the limit of what is admissible: hold it there with --set, and vary others"
        )
    fewer = "leave out of --vary what the data do not tell"
    then = fewer if solution.degenerate else "begin closer, with --set"
    return "" if solution.converged else f"the fit did not settle: {then}"
