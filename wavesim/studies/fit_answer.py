"""A case beside a record, and its fit to waveforms: what each of them says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.case.load import Case
from wavesim.readings.matched_record import Measured, resampling
from wavesim.readings.misfit import LARGEST_RESIDUAL, Comparison, goes_with, laid_otherwise, misfit
from wavesim.studies.fitted_keys import held_beside, targets, with_values
from wavesim.studies.least_squares import TIED, Held, Solution, Tied, solve, tied
from wavesim.studies.waveform_fit import GAIN, LAG, REACH, Waveforms, fit_waveforms

Float = NDArray[Any]


def signals_of(case: Case, measured: Measured) -> Float:
    """The case's field at the receivers, (frames, m): exact for a bar, simulated for a ring."""
    simulated = case.simulation
    names, places = measured.names, measured.positions
    if simulated.endless:
        from wavesim.timedomain.integrate import simulate

        field = simulate(
            simulated.layers, simulated.bar, simulated.sources, simulated.duration,
            samples=simulated.frames, receivers=dict(zip(names, places, strict=True)),
        )  # fmt: skip
        return np.stack([field.at(x, measured.field) for x in places], axis=1)
    from wavesim.layered.signals import signals

    found = signals(
        simulated.layers, simulated.bar.left, simulated.bar.right, simulated.sources,
        dict(zip(names, places, strict=True)), simulated.times,
    )  # fmt: skip
    return np.stack([found[name][measured.field] for name in names], axis=1)


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
    own = resampling(sim.frames, sim.interval, np.arange(0.0, sim.duration + step / 2, step))
    there, recorded = (part - part.mean(axis=0) for part in (own @ frames, measured.values))
    reach = max(REACH * sim.duration, abs(lag or 0.0) + sim.duration / 2)
    order, sign, at = laid_otherwise(recorded, there, step, float(measured.t[0]), reach)
    sign = sign * (1 if sign.sum() > 0 else -1)
    laid = replace(measured, values=measured.values[:, order] * sign, t=measured.t - at)
    other = _beside(case, laid, None, None, frames)
    if not other.residual < _FAR_LESS * found.residual:
        return found
    late = lag is not None and abs(at + other.lag - lag) > step
    better = replace(found, lag=at + other.lag, scale=other.scale)
    said = _laid(better, order, sign, late, scale is not None)
    said += f": so {other.residual:.2%} would be left over, in place of {found.residual:.1%}"
    return replace(found, otherwise=said)


def _laid(better: Comparison, order: Any, sign: Float, late: bool, sized: bool) -> str:
    """How a record lies on a case better than as it is matched; its lag and scale, where other."""
    names = better.measured.names
    moved = [f"{names[i]} is {name}" for name, i in zip(names, order, strict=True)
             if names[i] != name]  # fmt: skip
    turned = [names[i] for i, one in zip(order, sign, strict=True) if one < 0]
    parts = [f"what is matched to {', '.join(moved)}"] if moved else []
    parts += (
        [f"{', '.join(turned)} of reversed polarity: turn round or leave out"] if turned else []
    )
    parts += [f"--scale {better.scale:.4g}"] if sized else []
    parts += [f"--lag {better.lag:.4g}"] if late or not parts else []
    return "laid otherwise, " + "; ".join(parts)


def _beside(
    case: Case, measured: Measured, lag: float | None, scale: float | None, frames: Float
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
# jitter 0.04 at most was seen); so much of the record's rms spoils what is fitted.
_NO_NOISE, _SPOILS = 0.3, 0.01
# What is held is changed by this part, to see what that does; and may leave over so many times what
# it does where it is off by its error.
_CHANGED, _ALLOWED = 1e-3, 2.0


@dataclass(frozen=True)
class FitAnswer:
    """A fit.

    Attributes:
        kind: "waveforms", "points" or "speeds".
        values, errors: {key: value and standard error}, SI; NaN where the data don't tell.
        reasons: {key: why a value does not count, or ""}.
        nuisances: {gain, lag: (value, standard error)}.
        degenerate: directions that the data don't tell, {key: part} each.
        tied: pairs of parameters whose errors hang together.
        residual: what is left over the record's rms, –; or χ² over degrees of freedom of points.
        evaluations, notes: how it went.
        along: {key: value} of what goes along with them, SI.
        known_to: to which part of its size each thing that is held was stated to be known, as
            :meth:`Held.parts` has it; errors hold that.
        if_known: {key: standard error where what is held is known to that, or to 1 % if not
            stated}, SI.
        held: {key: {what is held: by how much the value changes where that is 1 % larger}}, SI.
        comparison: the record beside the fitted case; None but for waveforms.
    """

    kind: str
    values: dict[str, float]
    errors: dict[str, float]
    reasons: dict[str, str]
    nuisances: dict[str, tuple[float, float]] = field(default_factory=dict)
    degenerate: tuple[dict[str, float], ...] = ()
    tied: tuple[Tied, ...] = ()
    residual: float = 0.0
    evaluations: int = 0
    notes: tuple[str, ...] = ()
    along: dict[str, float] = field(default_factory=dict)
    known_to: Mapping[str, float] = field(default_factory=dict)
    if_known: dict[str, float] = field(default_factory=dict)
    held: dict[str, dict[str, float]] = field(default_factory=dict)
    comparison: Comparison | None = None

    def summary(self) -> dict[str, Any]:
        """As plain data, SI."""
        parameters = {
            key: {
                "value": value,
                "error": self.errors[key],
                "error_if_held_known": self.if_known.get(key, self.errors[key]),
                "valid": not self.reasons[key],
                "reason": self.reasons[key],
            }
            for key, value in self.values.items()
        }
        return {
            "kind": self.kind,
            "parameters": parameters,
            "along": self.along,
            "held": {"known_to": dict(self.known_to), "moves_by_1_percent": self.held},
            "nuisances": {k: {"value": v, "error": e} for k, (v, e) in self.nuisances.items()},
            "degenerate": [dict(one) for one in self.degenerate],
            "correlations": [asdict(one) for one in self.tied],
            "residual": self.residual,
            "evaluations": self.evaluations,
            "valid": not any(self.reasons.values()),
            "notes": list(self.notes),
        }


def answered(
    kind: str,
    values: Mapping[str, float],
    errors: Mapping[str, float],
    covariance: Float,
    held: Held,
    known_to: Mapping[str, float],
    reasons: dict[str, str],
    least: float = TIED,
    **more: Any,
) -> FitAnswer:
    """An answer whose errors hold how well what is held is known.

    Args:
        kind, more: of :class:`FitAnswer`.
        values, errors, covariance: of all that was fitted, SI; errors NaN where not told.
        held: what was not.
        known_to: as :meth:`Held.parts` takes it; {}, not stated.
        reasons: why a value does not count, or "", of those that are wanted.
        least: correlation beyond which errors are said to hang together.
    """
    beside = held.covariance(held.parts(known_to))
    total = np.hypot([*errors.values()], np.sqrt(np.diag(beside)))
    wider = dict(zip(values, total.tolist(), strict=True))
    if known_to:
        errors, covariance = wider, covariance + beside
    moves = {
        key: dict(zip(held.names, (0.01 * row).tolist(), strict=True))
        for key, row in zip(values, held.moved, strict=True) if key in reasons
    }  # fmt: skip
    return FitAnswer(
        kind,
        {key: values[key] for key in reasons},
        {key: errors[key] for key in reasons},
        reasons,
        {key: (values[key], errors[key]) for key in values if key not in reasons},
        tied=tied(values, errors, covariance, least),
        known_to=known_to,
        if_known={key: wider[key] for key in reasons},
        held=moves,
        **more,
    )


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
    data = Waveforms(case, varied, measured, lag, gain)
    solution = fit_waveforms(data)
    values = [solution.values[one.key] for one in varied]
    layers = with_values(case.simulation.layers, varied, values)
    fitted = replace(case, simulation=replace(case.simulation, layers=layers))
    scale = data.scale_of(solution.values)
    lain = lag if lag is not None else solution.values[LAG]
    beside = compare(fitted, measured, lain, scale)
    columns = _held_columns(fitted, varied, measured, lain, scale, gain)
    held = Held.of(data.residuals(solution.values)[1], columns)
    # What was fitted to columns of other receivers is no case to lay them on.
    far = beside.residual > LARGEST_RESIDUAL
    otherwise = compare(case, measured, lag, gain).otherwise if far else ""
    notes = measured.notes if far else beside.notes
    allowed = _ALLOWED * np.linalg.norm(held.left * held.parts(known_to)) if known_to else 0.0
    stated = [f"--{name}" for name, one in (("lag", lag), ("scale", gain)) if one is not None]
    reasons = {
        one.key: _reason(solution, one.key, beside, otherwise, float(allowed), stated)
        for one in varied
    }
    found = answered(
        "waveforms", solution.values, solution.errors, solution.covariance, held, known_to or {},
        reasons, degenerate=solution.degenerate, residual=beside.residual,
        evaluations=solution.evaluations, notes=notes, comparison=beside,
    )  # fmt: skip
    if GAIN in found.nuisances:
        value, error = found.nuisances[GAIN]
        found.nuisances[GAIN] = scale, error * abs(scale / value)
    return found


def _held_columns(
    case: Case, varied: Any, measured: Measured, lag: float, scale: float, gain: float | None
) -> dict[str, Float]:
    """{what is held: how the residuals change as it grows by all of its size, (n,)}."""

    def left(layers: Any, places: Measured, by: float = 1.0) -> Float:
        one = replace(case, simulation=replace(case.simulation, layers=layers))
        return Waveforms(
            case, [], measured, lag, by * scale, known=signals_of(one, places)
        ).residuals({})[0]

    own, found = case.simulation.layers, {}
    now = left(own, measured)
    for one in held_beside(case, varied):
        changed = with_values(own, [one], [one.value_in(own) + _CHANGED * one.size_in(own)])
        found[one.key] = (left(changed, measured) - now) / _CHANGED
    for j, (name, x) in enumerate(zip(measured.names, measured.positions, strict=True)):
        away = x + _CHANGED * (x - case.simulation.sources[0].position)
        places = [*measured.positions[:j], away, *measured.positions[j + 1 :]]
        moved = left(own, replace(measured, positions=tuple(places)))
        found[f"position of {name}"] = (moved - now) / _CHANGED
    if gain is not None:
        found["--scale"] = (left(own, measured, 1 + _CHANGED) - now) / _CHANGED
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
            or "the case is another than what was measured, or the first guess too far "
            "off: begin elsewhere with --set"
        )
    if not np.isfinite(solution.errors[key]):
        with_it = sorted({k for one in solution.degenerate if key in one for k in one} - {key})
        with_what = f" apart from {', '.join(with_it)}" if with_it else ""
        options = {GAIN: "--scale", LAG: "--lag"}
        known = "".join(f", or state {options[k]}" for k in with_it if k in options)
        leave = "one of them" if with_it else "it"
        return f"the data do not tell it{with_what}: leave {leave} out of --vary{known}"
    if beside.systematic > max(_SPOILS, allowed):
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
    return "" if solution.converged else "the fit did not settle: begin closer, with --set"
