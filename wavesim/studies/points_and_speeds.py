"""Fits of a medium to points, and from P and S speeds to contact stiffness and η.

Speeds are those of long waves of the translation family.

At long waves grains move with the mean, so that the average stiffness K_n^a and η alone are felt,

    ρ V_P² = l²N_p K_n^a (A + B η)/105,   A = 21 + 12a, B = 14 + 2a,
    ρ V_S² = l²N_p K_n^a (C + D η)/105,   C = 7 + a,    D = 28 + 13a,

of which the ratio of speeds gives η and V_S then K_n^a. At a = 0 V_P²/V_S² = (21 + 14η)/(7 + 28η).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wavesim.case.load import Case
from wavesim.material.dual import parameters
from wavesim.material.medium import Medium
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.readings.misfit import SPOILS
from wavesim.records.point_table import ERRORS, read_points
from wavesim.studies.fit_terms import ALLOWED, QUALITY, FitAnswer, Held, answered, targets
from wavesim.studies.least_squares import FitError

KEYS = ("medium.K_n_a", "medium.stiffness_ratio")
NO_BARS = "without errors of the speeds the values have none: give --speed-errors E_P E_S"
NOT_TOLD = (
    "two speeds of long waves tell K_n_a and stiffness_ratio alone, with anisotropy, "
    "branch_length, contact_density and density as given: more contacts, or longer branches, of "
    "softer contacts have the same speeds; K_n_r, K_n_g and strain_inertia are not felt by long "
    "waves but near the gaps; K_n_r is kept in its ratio to K_n_a"
)
_ROUNDING = 1e-9
HELD = ("anisotropy", "branch_length", "contact_density", "density")


def of_speeds(
    v_p: float,
    v_s: float,
    start: Medium,
    errors: tuple[float, float] = (math.nan, math.nan),
    known_to: Mapping[str, float] | None = None,
) -> FitAnswer:
    """K_n_a and η of a granular medium from its P and S speeds, anisotropy held.

    Args:
        v_p, v_s: speeds of long waves along the axis, m/s.
        start: a medium of the translation family; gives all that is held.
        errors: one standard error of each, m/s, unlike each other's; NaN where not known.
        known_to: as of :func:`wavesim.fit_waveforms`.

    Returns:
        Both with first-order errors.

    Raises:
        FitError: a speed is not positive, an error negative, or the medium is of another family.
    """
    start = next((part for part in start.parts if part.family.name == "translation"), start)
    if start.family.name != "translation":
        raise FitError(
            f"family = {start.family.name!r}: P and S waves are the translation family's; "
            'give a case with [medium] family = "translation"'
        )
    if not (v_p > 0 and v_s > 0 and math.isfinite(v_p + v_s)):
        raise FitError(f"speeds = {v_p:g}, {v_s:g} m/s: must be greater than 0")
    if any(error < 0 for error in errors):
        told = ", ".join(f"{error:g}" for error in errors)
        raise FitError(f"speed errors = {told} m/s: must be 0 or greater")
    a = float(start.anisotropy)
    A, B, C, D = _weights(a)
    eta = float(_contacts(v_p, v_s, start)[1])
    if not eta >= 0:
        below = math.isnan(eta)
        limit = math.sqrt(B / D if below else A / C)
        reason = (
            f"V_P/V_S = {v_p / v_s:.4g} is {'not ' if below else ''}above {limit:.4g}, which no "
            f"stiffness_ratio ≥ 0 has at anisotropy = {a:g}: another fabric, or a speed misread"
        )
        nothing = dict.fromkeys(KEYS, math.nan)
        reasons = dict.fromkeys(KEYS, reason)
        return FitAnswer("speeds", nothing, nothing, reasons, notes=(NOT_TOLD,))

    at = np.array([v_p, v_s, *(getattr(start, name) for name in HELD)], float)
    p, s, *rest = parameters(at)
    given: dict[str, Any] = dict(zip(HELD, rest, strict=True))
    by = _contacts(p, s, replace(start, **given)).slopes.T * np.where(at == 0, 1.0, np.abs(at))
    by_speed = by[:, :2] * (np.array(errors) / (v_p, v_s))
    held = Held(tuple(f"medium.{name}" for name in HELD), by[:, 2:], np.zeros(len(HELD)))
    covariance = by_speed @ by_speed.T
    values = dict(zip(KEYS, _contacts(v_p, v_s, start).tolist(), strict=True))
    bars = dict(zip(KEYS, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    barred = all(bar > 0 for bar in bars.values())
    return answered(
        "speeds", values, bars, covariance, held, known_to or {}, dict.fromkeys(KEYS, ""), -1.0,
        notes=(NOT_TOLD,) if barred else (NO_BARS, NOT_TOLD),
        along={"medium.K_n_r": float(start.K_n_r / start.K_n_a) * values[KEYS[0]]},
    )  # fmt: skip


def _weights(a: Any) -> tuple[Any, Any, Any, Any]:
    """A, B, C, D."""
    return 21 + 12 * a, 14 + 2 * a, 7 + a, 28 + 13 * a


def _contacts(v_p: Any, v_s: Any, medium: Medium) -> Any:
    """K_n_a and η, N/m and –."""
    A, B, C, D = _weights(medium.anisotropy)
    q = (v_p / v_s) ** 2
    # Near the least ratio, (B/D)½, rounding alone tells η.
    eta = (A - q * C) / (q * D - B) if q * D > B * (1 + _ROUNDING) else math.nan
    eta = eta - float(eta) if abs(float(eta)) <= 1e-12 else eta
    stiffness = 105 * medium.density / medium.per_contacts * v_s**2 / (C + D * eta)
    return np.stack([stiffness, eta])


def of_series(
    p: dict[str, Any], s: dict[str, Any], start: Medium, known_to: Mapping[str, float] | None = None
) -> dict[str, Any]:
    """Each state of two series, as ``wavesim pulse --json`` writes them, and how K_n_a follows.

    Args:
        p, s: of P and of S pulses, whose records are of the same states in the same order.
        start, known_to: as of :func:`of_speeds`; the law's own error is of the speeds alone, as all
            states have alike what is held.

    Returns:
        As :meth:`FitAnswer.summary`, that of the first state that both have, with "series", a row
        for each, the name of their "parameter", and "law": K_n_a = c · parameter^b, {"c", "b",
        "b_error"}; None with fewer than three states, or at one parameter alone.

    Raises:
        FitError: the series have no states in common.
    """
    known = [_speeds(one) for one in (p, s)]
    both = [key for key in known[0] if key in known[1]]
    if not both:
        raise FitError("the two series have no state in common: give them the same --against")
    fits, told = [], []
    for key in both:
        (v_p, e_p), (v_s, e_s) = known[0][key], known[1][key]
        fits.append((key[0], of_speeds(v_p, v_s, start, (e_p, e_s), known_to)))
        told.append(fits[-1][1].summary())
    answer, name = told[0], (p.get("series") or {}).get("parameter") or "state"
    rows = [{"parameter": at} | o["parameters"] for (at, _), o in zip(fits, told, strict=True)]
    first = f"parameters, and fitted.toml of --out, are those at {name} = {fits[0][0]:g}"
    good = [(at, one) for at, one in fits if at > 0 and not any(one.reasons.values())]
    lawful = len(good) > 2 and len({at for at, _ in good}) > 1
    return answer | {
        "series": rows,
        "parameter": name,
        "law": _power_law(good) if lawful else None,
        "valid": not any(row[KEYS[0]]["reason"] for row in rows),
        "notes": [first, *answer["notes"]],
    }


def _speeds(series: dict[str, Any]) -> dict[tuple[float, int], tuple[float, float]]:
    """{(parameter, how many records had it before): (velocity, its error)} of those that hold."""
    records = series["records"]
    told = series.get("series") or {}
    values: Sequence[float] = told.get("values") or range(1, len(records) + 1)
    found, before = {}, Counter[float]()
    for value, record in zip(values, records, strict=True):
        key = float(value), before[float(value)]
        before[float(value)] += 1
        best = record.get("best") or {}
        if best.get("valid") and best.get("velocity"):
            error = best.get("velocity_error")
            found[key] = (float(best["velocity"]), math.nan if error is None else error)
    return found


def _power_law(fits: Sequence[tuple[float, FitAnswer]]) -> dict[str, float]:
    """The law by least squares; its power is as unsure as scatter, or errors of K_n_a, have it."""
    K = np.array([one.values[KEYS[0]] for _, one in fits])
    x, y = np.log([at for at, _ in fits]), np.log(K)
    b, c = np.polyfit(x, y, 1)
    away = x - x.mean()
    lever = float(np.sum(away**2))
    scatter = float(np.sum((y - c - b * x) ** 2)) / (len(x) - 2) / lever
    own = np.nan_to_num(np.array([one.alone[KEYS[0]] for _, one in fits]) / K)
    error = math.sqrt(max(scatter, float(np.sum((away * own) ** 2)) / lever**2))
    return {"c": float(np.exp(c)), "b": float(b), "b_error": error}


def of_points(
    paths: Sequence[Path],
    case: Case,
    keys: Sequence[str],
    sector: str | None = None,
    known_to: Mapping[str, float] | None = None,
) -> FitAnswer:
    """Fit a case's medium to points that ``wavesim dispersion`` or ``attenuation`` wrote.

    Args:
        paths: of tables of points, each of a sector of its own.
        case: the case, of one uniform medium, which begins the fit.
        keys: what to fit: medium.NAME.
        sector: which sector's waves the points of the first are of; by its name where None.
        known_to: as of :func:`wavesim.fit_waveforms`; "spacing" is that of the receivers.

    Raises:
        FitError: it can't be done.
        RecordError: the table can't be read.
    """
    from wavesim.studies import medium_fit  # slow to import, and waveforms do without

    varied = targets(case, keys)
    odd = next((v for v in varied if v.name == QUALITY or not v.key.startswith("medium.")), None)
    if odd is not None:
        raise FitError(
            f"--vary {odd.key}: points tell of one lossless medium: name its parameters, such as "
            "medium.anisotropy, or give the waveforms"
        )
    if not case.simulation.layers.uniform:
        raise FitError("points tell of one medium: leave [[layers]] out, or give the waveforms")
    names = [one.name for one in varied]
    given = [sector, *[None] * (len(paths) - 1)]
    sectors = [_sector(path, case, names, one) for path, one in zip(paths, given, strict=True)]
    observed = [
        medium_fit.Observed(case.medium.family.blocks_of(one)[0], _points(path))
        for path, one in zip(paths, sectors, strict=True)
    ]
    try:
        found = medium_fit.fit(observed, case.medium, names)
    except FitError as wrong:
        raise FitError(f"{', '.join(map(str, paths))}: {wrong}") from None
    held, known_to = found.held, known_to or {}
    allowed = np.linalg.norm(held.left * held.parts(known_to)) if known_to else 0.0
    reason = ""
    if found.systematic and found.left > SPOILS and found.chi_square > (ALLOWED * allowed) ** 2:
        reason = (
            f"the points lie {found.left:.1%} off, {found.chi_square**0.5:.1f} of their errors: "
            "they are of other waves (--sector, branch), or something that is held is off: vary "
            "more keys, hold them at other values with --set, or say by --held how well they are "
            "known"
        )
    notes = [
        f"{found.points} numbers of {' and '.join(sectors)} points, χ² per degree of freedom "
        f"{found.chi_square:.3g}"
    ]
    if found.systematic and not reason:
        notes.append(
            "more is left over than the points' errors: they are held against the endless medium, "
            "and a simulated record's grid, or another medium, puts them off; the errors hold what "
            "that could move"
            + (", but errors of what is held only as far as --held says" if known_to else "")
        )
    return answered(
        "points",
        {one.key: found.values[one.name] for one in varied},
        {one.key: found.errors[one.name] for one in varied},
        found.covariance,
        held,
        known_to,
        {one.key: reason for one in varied},
        residual=found.chi_square,
        notes=tuple(notes),
    )


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
    """The valid points of a table, each of its branch."""
    columns = read_points(path, ERRORS)
    k, omega = columns["k"], columns["omega"]
    valid = columns.get("valid", np.ones(len(k), bool))
    if not valid.any():
        raise FitError(f"{path}: holds no valid point")
    # Who says no branches but gives a k twice has several, each point of its own.
    several = np.arange(len(k)) if len(np.unique(k)) < len(k) else np.zeros(len(k))
    branch = np.nan_to_num(columns.get("branch", several)).astype(int)
    zero, nothing = np.zeros(len(k)), np.full(len(k), "", object)
    method = "space" if np.iscomplexobj(k) else "harmonic"
    every = k, omega, zero, zero, columns["error"], zero, valid, nothing, branch
    return BranchPoints(method, *every).take(valid)
