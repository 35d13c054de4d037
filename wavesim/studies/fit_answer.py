"""A case beside a record, and its fit to waveforms: what each of them says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.case.load import Case
from wavesim.readings.matched_record import Measured, resampling
from wavesim.readings.misfit import Comparison, goes_with, laid_otherwise, misfit
from wavesim.studies.fitted_keys import held_beside, targets, with_values
from wavesim.studies.least_squares import Solution, Tied, solve, tied
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
            samples=simulated.frames, receivers=simulated.receivers,
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
    if other.residual < _FAR_LESS * found.residual:
        said = _laid(
            replace(found, lag=at + other.lag, scale=other.scale),
            order,
            sign,
            lag is not None and abs(at + other.lag - lag) > step,
            scale is not None,
        )
        said += f": so {other.residual:.2%} would be left over, in place of {found.residual:.1%}"
    elif other.residual > _LARGEST_RESIDUAL:
        said = "the case is another than what was measured, whoever's the columns are"
    else:
        return found
    return replace(found, measured=replace(measured, notes=(*measured.notes, said)))


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
# What is held is changed by this part, to see what that does; those are told of whose 1 % moves a
# value by so many of its errors.
_CHANGED, _MOVES = 1e-3, 0.5
# More than this of the record left over says that the case is another than what was measured.
_LARGEST_RESIDUAL = 0.5


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
    comparison: Comparison | None = None

    def summary(self) -> dict[str, Any]:
        """As plain data, SI."""
        parameters = {
            key: {
                "value": value,
                "error": self.errors[key],
                "valid": not self.reasons[key],
                "reason": self.reasons[key],
            }
            for key, value in self.values.items()
        }
        return {
            "kind": self.kind,
            "parameters": parameters,
            "along": self.along,
            "nuisances": {k: {"value": v, "error": e} for k, (v, e) in self.nuisances.items()},
            "degenerate": [dict(one) for one in self.degenerate],
            "correlations": [asdict(one) for one in self.tied],
            "residual": self.residual,
            "evaluations": self.evaluations,
            "valid": not any(self.reasons.values()),
            "notes": list(self.notes),
        }


def of_waveforms(
    case: Case, measured: Measured, keys: Sequence[str], lag: float | None, gain: float | None
) -> FitAnswer:
    """Fit a case's parameters to waveforms.

    Args:
        case: the case; its values begin the fit.
        measured: the record laid beside it.
        keys: what to fit, such as "medium.anisotropy".
        lag, gain: stated, s and –; fitted where None.

    Raises:
        FitError: it can't be done.
    """
    varied = targets(case, keys)
    data = Waveforms(case, varied, measured, lag, gain)
    solution = fit_waveforms(data)
    values = {one.key: solution.values[one.key] for one in varied}
    layers = with_values(case.simulation.layers, varied, values.values())
    fitted = replace(case, simulation=replace(case.simulation, layers=layers))
    scale = data.scale_of(solution.values)
    lain = lag if lag is not None else solution.values[LAG]
    beside = compare(fitted, measured, lain, scale)
    # Of a ring each would be a run of its own.
    ring = case.simulation.endless
    columns = {} if ring else _held_columns(fitted, varied, measured, lain, scale, gain)
    # What was fitted to columns of other receivers is no case to lay them on.
    far = beside.residual > _LARGEST_RESIDUAL
    notes = (compare(case, measured, lag, gain) if far else beside).measured.notes
    nuisances = {
        key: (solution.values[key], solution.errors[key]) for key in (GAIN, LAG)
        if key in solution.values
    }  # fmt: skip
    if GAIN in nuisances:
        share = scale / solution.values[GAIN]
        nuisances[GAIN] = (scale, solution.errors[GAIN] * abs(share))
    return FitAnswer(
        "waveforms",
        values,
        {key: solution.errors[key] for key in values},
        {key: _reason(solution, key, beside) for key in values},
        nuisances,
        solution.degenerate,
        tied(solution.values, solution.errors, solution.covariance),
        beside.residual,
        solution.evaluations,
        (*notes, *_sensitive(data, solution, columns)),
        comparison=beside,
    )


def _held_columns(
    case: Case, varied: Any, measured: Measured, lag: float, scale: float, gain: float | None
) -> dict[str, Float]:
    """{what is held: how the residuals change as it grows by all of what it is, (n,)}."""

    def left(layers: Any, places: Measured, by: float = 1.0) -> Float:
        one = replace(case, simulation=replace(case.simulation, layers=layers))
        return Waveforms(
            case, [], measured, lag, by * scale, known=signals_of(one, places)
        ).residuals({})[0]

    own, found = case.simulation.layers, {}
    now = left(own, measured)
    for one in held_beside(case, varied):
        changed = with_values(own, [one], [one.value_in(own) * (1 + _CHANGED)])
        found[one.key] = (left(changed, measured) - now) / _CHANGED
    for j, (name, x) in enumerate(zip(measured.names, measured.positions, strict=True)):
        places = [*measured.positions[:j], x * (1 + _CHANGED), *measured.positions[j + 1 :]]
        moved = left(own, replace(measured, positions=tuple(places)))
        found[f"position of {name}"] = (moved - now) / _CHANGED
    if gain is not None:
        found["--scale"] = (left(own, measured, 1 + _CHANGED) - now) / _CHANGED
    return found


def _sensitive(data: Waveforms, solution: Solution, columns: dict[str, Float]) -> list[str]:
    """What is held and moves fitted values by more than half of their errors, being off by 1 %."""
    if not columns:
        return []
    _, J, _ = data.residuals(solution.values)
    keys = [one.key for one in data.varied]
    errors = np.array([solution.errors[key] for key in keys])
    parts = 0.01 * np.linalg.lstsq(J, np.stack(list(columns.values()), axis=1), None)[0]
    told = []
    for key, moved in zip(keys, np.abs(parts[: len(keys)]) / errors[:, None], strict=True):
        most = sorted(zip(moved.tolist(), columns, strict=True), reverse=True)
        each = [f"{size:.2g} ({name})" for size, name in most if size > _MOVES]
        told += [f"{key} by {', '.join(each)}"] if each else []
    said = "the errors take what is held as exact; off by 1 %, it moves, in errors, "
    return [said + "; ".join(told)] if told else []


def _reason(solution: Solution, key: str, beside: Comparison) -> str:
    """Why a value does not count, or ""."""
    if beside.residual > _LARGEST_RESIDUAL:
        return (
            f"{beside.residual:.0%} of the record is left over: the case is another than what "
            "was measured, or the first guess too far off: begin elsewhere with --set"
        )
    if not np.isfinite(solution.errors[key]):
        with_it = sorted({k for one in solution.degenerate if key in one for k in one} - {key})
        with_what = f" apart from {', '.join(with_it)}" if with_it else ""
        stated = {GAIN: "--scale", LAG: "--lag"}
        known = "".join(f", or state {stated[k]}" for k in with_it if k in stated)
        return f"the data do not tell it{with_what}: fit fewer{known}"
    if key in solution.at_limits:
        return "it ended at the limit of what is admissible: hold it, or begin elsewhere with --set"
    if beside.systematic > _SPOILS:
        return (
            f"what is left over, {beside.systematic:.1%} of the record, goes with the signals and "
            "is no noise: something that is held is off, and the errors do not hold that; vary "
            "more keys, or hold them at other values with --set"
        )
    return "" if solution.converged else "the fit did not settle: begin closer, with --set"
