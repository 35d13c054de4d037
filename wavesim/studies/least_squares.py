"""Least squares for a case's parameters: uncertainties, and what the data can't tell apart.

    minimise Σ_i |r_i(θ, ν)|²

over the parameters θ that are wanted and nuisances ν (gain, lag) that are not, by scipy's trust
region with exact derivatives. Errors come from the residuals themselves: by the jackknife, what the
answer moves by where a block of data is left out,

    cov = Σ_b δ_b δ_bᵀ,    δ_b = (JᵀJ − J_bᵀJ_b)⁻¹ J_bᵀ r_b,

of blocks of one time (all receivers share its jitter), of 4, 16 … as long as none tells most of a
direction, as disturbances last; or of what noise of their spectrum, smoothed over some bins, makes
of J, as noise of a narrow band is alike for a while; or s²(JᵀJ)⁻¹, whichever is most; s² is what is
left over. A direction of (θ, ν), each in units of its own size, along which J hardly changes is one
that the data do not tell: it is named, and what lies along it has no error bar.
Bell & McCaffrey, Survey Methodol. 28, 169 (2002).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[Any]

# A direction is not told where J along it is this part of its largest; or where one standard error
# is more than this many times the parameters themselves.
CONDITION = 1e-7
_UNKNOWN = 3.0
# Parts of a direction below this are not named, but part of the error.
_NAMED = 0.15
# A block tells at most this part of a direction; blocks begin at so many places.
_TOLD_BY_ONE, _BEGINNINGS = 0.5, 4
# A flat valley may be followed for long: within this part of an error its end is reached.
_FAR_WITHIN = 0.1
# The spectrum of noise is a mean over so many bins 2π/T to either side.
_BINS = 2
_MOST_EVALUATIONS = 60
# A valley's bend is looked at within this part of an error.
_WITHIN = 0.5
# Correlation of errors beyond which they hang together.
TIED = 0.9


class FitError(ValueError):
    """A fit can't be made; the message says why and what to do."""


@dataclass(frozen=True)
class Parameter:
    """What is fitted.

    Attributes:
        key: such as "medium.anisotropy", or the name of a nuisance.
        start: first guess, SI.
        low, high: limits, SI.
        scale: a change of it that matters, SI, > 0.
        wanted: whether it is a parameter, not a nuisance.
    """

    key: str
    start: float
    low: float
    high: float
    scale: float
    wanted: bool = True


@dataclass(frozen=True)
class Solution:
    """A fit.

    Attributes:
        values: {key: value}, SI, of parameters and nuisances.
        errors: {key: standard error}, SI; NaN where the data don't tell.
        covariance: shape (p, p), in the order of values, of what is told.
        bend: by how much values are off where the longest direction that is told is gone along by
            one error, as valleys are curved, SI, shape (p,).
        misfit: root of the mean square of the residuals.
        evaluations: of them.
        degenerate: directions that the data don't tell, {key: part of the direction} each.
        at_limits: keys that ended at a limit.
        converged: whether the iteration came to its end.
    """

    values: dict[str, float]
    errors: dict[str, float]
    covariance: Float
    bend: Float
    misfit: float
    evaluations: int
    degenerate: tuple[dict[str, float], ...]
    at_limits: tuple[str, ...]
    converged: bool


def solve(
    data: Any, start: Mapping[str, float] | None = None, most: int = _MOST_EVALUATIONS
) -> Solution:
    """Fit.

    Args:
        data: has ``parameters``, and ``residuals(values)``: these, (n,), their derivatives by the
            parameters, (n, p), and the group of each, (n,).
        start: values to begin with, in place of the parameters' own.
        most: evaluations at most.

    Returns:
        The solution.

    Raises:
        FitError: there are fewer residuals than parameters, or the residuals are not finite.
    """
    from scipy.optimize import least_squares  # slow to import, and only a fit needs it

    known = data.parameters
    keys = [one.key for one in known]
    scale = np.array([one.scale for one in known])
    low, high = (np.array([getattr(p, n) for p in known]) / scale for n in ("low", "high"))
    first = np.array([(start or {}).get(p.key, p.start) for p in known]) / scale
    margin = 1e-9 * np.maximum(1, np.abs(first))
    first = np.clip(first, low + margin, high - margin)
    kept: dict[bytes, Any] = {}

    def at(x: Float) -> Any:
        if x.tobytes() not in kept:
            kept.clear()
            kept[x.tobytes()] = data.residuals(dict(zip(keys, (x * scale).tolist(), strict=True)))
        return kept[x.tobytes()]

    r, _, _ = at(first)
    if len(r) <= len(known):
        raise FitError(f"{len(r)} numbers for {len(known)} parameters: more data are needed")
    if not np.isfinite(r).all():
        raise FitError("the first guess gives values that are not finite: begin closer")
    answer = least_squares(
        lambda x: at(x)[0], first, jac=lambda x: at(x)[1] * scale, bounds=(low, high),
        x_scale="jac", xtol=1e-8, ftol=1e-8, gtol=1e-10, max_nfev=most,
    )  # fmt: skip
    x = answer.x
    r, J, groups = at(x)
    size = np.maximum(np.abs(x), 1.0)
    covariance, directions, open_by = _uncertainty(r, J * scale, groups, size)
    told = covariance * scale[:, None] * scale
    errors = np.sqrt(np.maximum(np.diag(told), 0.0))
    named = []
    for direction, far in zip(directions, open_by, strict=True):
        parts = {k: float(v) for k, v in zip(keys, direction, strict=True) if abs(v) > _NAMED}
        named.append(parts)
        errors = np.hypot(errors, far * np.abs(direction) * size * scale)
        errors[[key in parts for key in keys]] = np.nan
    ends = tuple(
        key for key, v, a, b, m in zip(keys, x, low, high, margin, strict=True)
        if v - a <= 10 * m or b - v <= 10 * m
    )  # fmt: skip
    return Solution(
        dict(zip(keys, (x * scale).tolist(), strict=True)),
        dict(zip(keys, errors.tolist(), strict=True)),
        told,
        _bend(lambda y: at(y)[0], x, r, J * scale, covariance, (low, high)) * scale,
        float(np.sqrt(np.mean(r**2))),
        int(answer.nfev),
        tuple(named),
        ends,
        bool(answer.success) or _within_errors(r, J * scale, errors / scale),
    )


def _within_errors(r: Float, J: Float, errors: Float) -> bool:
    """Whether the next step, by J alone, is far within the errors."""
    step = np.abs(np.linalg.lstsq(J, r, CONDITION)[0])
    return not (step > _FAR_WITHIN * errors).any()


def _bend(residuals: Any, x: Float, r: Float, J: Float, covariance: Float, limits: Any) -> Float:
    """−J⁺ r₂, r₂ = (r(x + v) + r(x − v))/2 − r, one error v along the longest direction."""
    size = np.maximum(np.abs(x), 1.0)
    length, axes = np.linalg.eigh(covariance / size[:, None] / size)
    v = np.sqrt(max(length[-1], 0.0)) * axes[:, -1] * size
    room = min(np.min(np.minimum(x - limits[0], limits[1] - x) / (np.abs(v) + 1e-300)), 1.0)
    part = _WITHIN * room
    if not part * np.abs(v).max() > 1e-9:
        return np.zeros(len(x))
    second = ((residuals(x + part * v) + residuals(x - part * v)) / 2 - r) / part**2
    return -np.linalg.lstsq(J, second, CONDITION)[0]


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


def tied(
    values: Mapping[str, float],
    errors: Mapping[str, float],
    cov: Any,
    least: float = TIED,
    bend: Any = 0.0,
) -> tuple[Tied, ...]:
    """Pairs of parameters whose errors hang together by more than the least; see Solution.bend."""
    bend = np.broadcast_to(bend, len(values))
    keys, found = list(values), []
    for i, j in zip(*np.tril_indices(len(keys), -1), strict=True):
        both = keys[i], keys[j]
        size = float(np.sqrt(max(cov[i, i] * cov[j, j], 0.0)))
        if not size > 0 or not abs(cov[i, j]) > least * size:
            continue
        if np.isfinite([errors[key] for key in both]).all():
            factor = -float(cov[i, j] / cov[j, j])
            told = values[both[0]] + factor * values[both[1]]
            left = float(np.sqrt(max(cov[i, i] + factor * cov[i, j], 0.0)))
            left = float(np.hypot(left, bend[i] + factor * bend[j]))
            found.append(Tied(both, float(cov[i, j]) / size, factor, told, left))
    return tuple(found)


def _uncertainty(
    r: Float, J: Float, groups: NDArray[np.int_], size: Float
) -> tuple[Float, list[Float], list[float]]:
    """Covariance of what is told; directions that are not, and how far along them the data leave it
    open, in units of the parameters' size."""
    p = J.shape[1]
    # Data that nothing moves, as outside a run, tell nothing of the noise.
    n = int(((r != 0) | (J != 0).any(axis=1)).sum())
    U, s, Vt = np.linalg.svd(J * size, full_matrices=False)
    variance = float(np.sum(r**2)) / max(n - p, 1)
    error = np.sqrt(variance) / np.maximum(s, CONDITION * s[0] or 1e-300)
    told = (s > CONDITION * s[0]) & (error < _UNKNOWN)
    inverse = np.where(told, 1 / np.where(told, s, 1.0), 0.0)
    plain = (Vt.T * inverse**2) @ Vt * variance
    # Each parameter's variance is the largest of those.
    found = np.diag(plain)
    for part in (*_left_out(r, U, groups), _coloured(r, U, groups)):
        found = np.maximum(found, np.diag((Vt.T * inverse) @ part @ (Vt.T * inverse).T))
    ratio = np.sqrt(found / np.maximum(np.diag(plain), 1e-300))
    covariance = plain * ratio[:, None] * ratio
    return (
        covariance * size[:, None] * size,
        [row for row, ok in zip(Vt, told, strict=True) if not ok],
        np.maximum(error, _UNKNOWN)[~told].tolist(),
    )


def _left_out(r: Float, U: Float, groups: NDArray[np.int_]) -> list[Float]:
    """Σ_b δ_b δ_bᵀ for each length of blocks, in the directions U that J = U s Vᵀ tells, (p, p)."""
    p, times = U.shape[1], int(groups.max()) + 1
    score, told = np.zeros((times + 1, p)), np.zeros((times + 1, p, p))
    np.add.at(score, groups + 1, U * r[:, None])
    for i in range(p):
        np.add.at(told[:, i], groups + 1, U * U[:, i : i + 1])
    score, told = np.cumsum(score, axis=0), np.cumsum(told, axis=0)
    found: list[Float] = []
    for length in (4**i for i in range(times.bit_length() // 2)):
        begin = np.unique(np.arange(_BEGINNINGS) * length // _BEGINNINGS)
        total = np.zeros((p, p))
        for first in begin:
            ends = np.unique(np.r_[0, np.arange(first, times, length), times])
            rest = np.eye(p) - np.diff(told[ends], axis=0)
            if length > 1 and np.linalg.eigvalsh(rest)[:, 0].min() < 1 - _TOLD_BY_ONE:
                return found
            moved = np.linalg.solve(
                rest + 1e-9 * np.eye(p), np.diff(score[ends], axis=0)[..., None]
            )
            total += moved[..., 0].T @ moved[..., 0] / len(begin)
        found.append(total)
    return found


def _coloured(r: Float, slopes: Float, groups: NDArray[np.int_]) -> Float:
    """What noise of the residuals' spectrum makes of the scores, shape (p, p).

    Groups are times, one after the other, of as many members each.
    """
    p, times = slopes.shape[1], int(groups.max()) + 1
    if len(r) % times or (groups != np.repeat(np.arange(times), len(r) // times)).any():
        return np.zeros((p, p))
    members = len(r) // times
    noise = np.fft.fft(r.reshape(times, members), 2 * times, axis=0)
    heard = np.conj(np.fft.fft(slopes.reshape(times, members, p), 2 * times, axis=0))
    alive = int((r.reshape(times, members) != 0).any(axis=1).sum())
    # What is fitted takes its part of the noise out of each frequency's residuals.
    taken = np.sum(np.abs(heard) ** 2, axis=(1, 2)) / (members * times)
    noise /= 1 - np.minimum(taken, _TOLD_BY_ONE)[:, None]
    shifts = range(-2 * _BINS, 2 * _BINS + 1)
    total = np.zeros((p, p))
    for shift in shifts:
        scores = np.einsum("fm,fmp->fp", np.roll(noise, shift, axis=0), heard)
        total += (np.conj(scores.T) @ scores).real
    return total / (2 * times * max(alive - p, 1) * len(shifts))
