"""What a fit of a case's parameters says: values, errors, what is not told, how well it fits."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from wavesim.case.load import Case
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.readings.matched_record import Measured
from wavesim.studies import medium_fit
from wavesim.studies.comparison import Comparison, compare
from wavesim.studies.fitted_keys import QUALITY, targets, with_values
from wavesim.studies.least_squares import FitError, Solution
from wavesim.studies.waveform_fit import GAIN, LAG, Waveforms, fit_waveforms

# More than this of the record left over says that the case is another than what was measured.
_LARGEST_RESIDUAL = 0.5


@dataclass(frozen=True)
class Tied:
    """Two parameters whose errors hang together: the data tell a sum of them better than either.

    Attributes:
        keys: which, a and b.
        value: correlation of their errors, –.
        factor, told, told_error: a + factor · b = told ± told_error, SI.
    """

    keys: tuple[str, str]
    value: float
    factor: float
    told: float
    told_error: float


@dataclass(frozen=True)
class FitAnswer:
    """A fit.

    Attributes:
        values, errors: {key: value and standard error}, SI; NaN where the data don't tell.
        nuisances: {gain, lag: (value, standard error)}.
        degenerate: directions that the data don't tell, {key: part} each.
        residual: what is left over the record's rms, –; or χ² over degrees of freedom of points.
        kind: "waveforms" or "points".
        evaluations, converged, at_limits, notes: how it went.
        tied: pairs of parameters whose errors hang together.
        comparison: the record beside the fitted case; None for points.
    """

    values: dict[str, float]
    errors: dict[str, float]
    nuisances: dict[str, tuple[float, float]]
    degenerate: tuple[dict[str, float], ...]
    residual: float
    kind: str
    evaluations: int
    converged: bool
    at_limits: tuple[str, ...]
    tied: tuple[Tied, ...]
    notes: tuple[str, ...]
    comparison: Comparison | None = None

    def reason(self, key: str) -> str:
        """Why a value does not count, or ""."""
        if self.kind == "waveforms" and self.residual > _LARGEST_RESIDUAL:
            return (
                f"{self.residual:.0%} of the record is left over: the case is another than what "
                "was measured, or the first guess too far off"
            )
        if not np.isfinite(self.errors[key]):
            others = sorted({k for one in self.degenerate if key in one for k in one} - {key})
            with_what = f" apart from {', '.join(others)}" if others else ""
            return f"the data do not tell it{with_what}: fit fewer, or add what tells them apart"
        if key in self.at_limits:
            return "it ended at the limit of what is admissible"
        if not self.converged:
            return "the fit did not settle: begin closer, with --set"
        return ""

    def summary(self) -> dict[str, Any]:
        """As plain data, SI."""
        parameters = {
            key: {
                "value": value,
                "error": self.errors[key],
                "valid": not self.reason(key),
                "reason": self.reason(key),
            }
            for key, value in self.values.items()
        }
        return {
            "kind": self.kind,
            "parameters": parameters,
            "nuisances": {k: {"value": v, "error": e} for k, (v, e) in self.nuisances.items()},
            "degenerate": [dict(one) for one in self.degenerate],
            "correlations": [asdict(one) for one in self.tied],
            "residual": self.residual,
            "evaluations": self.evaluations,
            "valid": all(one["valid"] for one in parameters.values()),
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
    wanted = [one.key for one in varied]
    layers, law = with_values(
        case.simulation.layers, varied, [solution.values[key] for key in wanted]
    )
    if any(one.name == QUALITY for one in varied):
        layers = layers.mapped(lambda medium: replace(medium, damping=law))
    fitted = replace(case, simulation=replace(case.simulation, layers=layers))
    scale = data.scale_of(solution.values)
    beside = compare(fitted, measured, lag if lag is not None else solution.values[LAG], scale)
    nuisances = {
        key: (solution.values[key], solution.errors[key]) for key in (GAIN, LAG)
        if key in solution.values
    }  # fmt: skip
    if GAIN in nuisances:
        share = scale / solution.values[GAIN]
        nuisances[GAIN] = (scale, solution.errors[GAIN] * abs(share))
    return FitAnswer(
        {key: solution.values[key] for key in wanted},
        {key: solution.errors[key] for key in wanted},
        nuisances,
        solution.degenerate,
        beside.residual,
        "waveforms",
        solution.evaluations,
        solution.converged,
        solution.at_limits,
        _tied(solution),
        measured.notes,
        beside,
    )


def _tied(solution: Solution) -> tuple[Tied, ...]:
    """Pairs of parameters whose errors hang together by more than 0.9."""
    keys, cov, found = list(solution.values), solution.covariance, []
    for i, j in zip(*np.tril_indices(len(keys), -1), strict=True):
        both = keys[i], keys[j]
        size = float(np.sqrt(max(cov[i, i] * cov[j, j], 0.0)))
        if not size > 0 or not abs(cov[i, j]) > 0.9 * size:
            continue
        if np.isfinite([solution.errors[key] for key in both]).all():
            factor = -float(cov[i, j] / cov[j, j])
            told = solution.values[both[0]] + factor * solution.values[both[1]]
            left = float(np.sqrt(max(cov[i, i] + factor * cov[i, j], 0.0)))
            found.append(Tied(both, float(cov[i, j]) / size, factor, told, left))
    return tuple(found)


_IN_TIME = ("k_rad_per_m", "omega_rad_per_s", "omega_error_rad_per_s")
_IN_SPACE = ("omega_rad_per_s", "sigma_rad_per_s", "k_real_rad_per_m", "k_imag_rad_per_m",
             "k_error_rad_per_m")  # fmt: skip


def is_points(path: Path) -> bool:
    """Whether a file is a table of points, as wavesim dispersion or attenuation writes it."""
    if not path.is_file() or path.suffix.lower() not in (".csv", ".txt"):
        return False
    with path.open(encoding="utf-8", errors="replace") as file:
        heading = file.readline(4096)
    names = [name.strip() for name in heading.split(",")]
    return all(n in names for n in _IN_TIME) or all(n in names for n in _IN_SPACE)


def of_points(path: Path, case: Case, keys: Sequence[str], sector: str | None = None) -> FitAnswer:
    """Fit a case's medium to points that ``wavesim dispersion`` or ``attenuation`` wrote.

    Args:
        path: of the table of points.
        case: the case, of one uniform medium, which begins the fit.
        keys: what to fit: medium.NAME.
        sector: which sector's waves the points are of; by the file's name where None.

    Raises:
        FitError: it can't be done.
    """
    varied = targets(case, keys)
    odd = next((v for v in varied if v.name == QUALITY or not v.key.startswith("medium.")), None)
    if odd is not None or not case.simulation.layers.uniform:
        raise FitError(
            f"--vary {odd.key if odd else keys[0]}: points tell of one lossless medium: name its "
            "parameters, such as medium.anisotropy, or give the waveforms"
        )
    points = _points(path)
    sector = _sector(path, case, [one.name for one in varied], sector)
    (block, *_) = case.medium.family.blocks_of(sector)
    seen = [medium_fit.Observed(block, points)]
    try:
        found = medium_fit.fit(seen, case.medium, [one.name for one in varied])
    except FitError as wrong:
        raise FitError(f"{path}: {wrong}") from None
    keyed = {one.name: one.key for one in varied}
    notes = [
        f"{found.points} numbers of {sector} points, χ² per degree of freedom "
        f"{found.chi_square:.3g}"
    ]
    if found.systematic:
        notes.append(
            "what is left over is no noise: the points are held against the endless medium, and a "
            "simulated record's grid, or another medium, puts them off; the errors hold what that "
            "could move"
        )
    return FitAnswer(
        {keyed[n]: v for n, v in found.values.items()},
        {keyed[n]: v for n, v in found.errors.items()},
        {}, (), found.chi_square, "points", 0, True, (), (),
        tuple(notes),
    )  # fmt: skip


def _sector(path: Path, case: Case, names: Sequence[str], given: str | None) -> str:
    """The sector of a file of points: as it is named, on its own or in the file's name.

    Where several families run, its family is that which has all that is fitted.

    Raises:
        FitError: it is none in which waves travel, or may be of several families.
    """
    known = case.medium.family.travelling
    ending = path.stem.rpartition("_")[2]
    sector = given or (ending if ending in known else "longitudinal")
    if sector in known:
        return sector
    fitting = [part for part in case.medium.parts if all(name in part.known() for name in names)]
    found = [f"{part.family.name}-{sector}" for part in fitting]
    found = [name for name in found if name in known]
    if len(found) == 1:
        return found[0]
    raise FitError(f"--sector {sector}: must be one of {', '.join(known)}")


def _points(path: Path) -> BranchPoints:
    with path.open(encoding="utf-8-sig", newline="") as file:
        rows = list(csv.DictReader(file))
    in_space = all(name in (rows[0] if rows else {}) for name in _IN_SPACE)
    needed = _IN_SPACE if in_space else _IN_TIME
    try:
        table = {n: np.array([float(row[n] or "nan") for row in rows]) for n in needed}
        valid = np.array(
            [row.get("valid", "True").strip().lower() in ("true", "1") for row in rows]
        )
        branch = np.array([int(float(row.get("branch") or 0)) for row in rows])
    except (ValueError, TypeError, KeyError) as wrong:
        raise FitError(f"{path}: a row of points holds no number: {wrong}") from None
    if not valid.any():
        raise FitError(f"{path}: holds no valid point")
    n = len(rows)
    if in_space:
        k = table["k_real_rad_per_m"] + 1j * table["k_imag_rad_per_m"]
        omega: Any = table["omega_rad_per_s"] + 1j * table["sigma_rad_per_s"]
        error = table["k_error_rad_per_m"]
    else:
        k, omega = table["k_rad_per_m"], table["omega_rad_per_s"]
        error = table["omega_error_rad_per_s"]
    zero, nothing = np.zeros(n), np.full(n, "", object)
    return BranchPoints(
        method="space" if in_space else "harmonic", k=k, omega=omega, decay=zero, amplitude=zero,
        error=error, residual=zero, valid=valid, reason=nothing, branch=branch,
    ).take(valid)  # fmt: skip
