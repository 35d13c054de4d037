"""Complex k at each frequency of a record, from few receivers, by an exponential window.

Weighted by exp(−σt) a record ends, whatever still rings, and its transform is the field at the
complex frequency ω + iσ, which between the receivers, where no source is, is made of waves
exp(±ikx) with the medium's roots k(ω + iσ), in bands and gaps alike. Receivers may stand anywhere,
and the waves that an end sends back are part of the model.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from wavesim.readings.damped_transform import damped_transform
from wavesim.readings.dispersion.branch_joining import join
from wavesim.readings.dispersion.line_fit import LineFit, fit_line, unknowns
from wavesim.readings.dispersion.line_geometry import folded, with_axes
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.records.record import Record, RecordError

Float = NDArray[Any]

# σT where there is no noise, and the least. With noise of a part n of the peak ln(1/n) + 4 serves:
# the truncation is then below the noise, and no more of the record is given away.
DAMPING = 18.0
_LEAST_DAMPING = 8.0
_BELOW_NOISE = 4.0
# Receivers count where their amplitude is this many times the truncation error exp(−σT), and the
# noise.
_ABOVE_TRUNCATION = 30.0
_ABOVE_NOISE = 3.0
# More waves are sought where they lower the power left over, per free parameter, by this factor.
_BETTER = 6.0
# Largest part of the power that may be left unexplained, and largest relative error.
_UNEXPLAINED = 0.05
_LARGEST_ERROR = 0.5
# Chance that noise passes for a wave at one of the wavenumbers told apart; with no receiver to
# spare, the power that a wave must have over the noise's.
_BY_CHANCE = 1e-6
_WITHOUT_SPARE = 25.0
# Left over above this many times the noise's and truncation's power, it is not theirs.
_EXCESS = 9.0
_NYQUIST = 0.97
# Part of the Nyquist frequency up to which what lies beyond is not folded in.
_BAND = 0.8
# Part of a ring, from its source on, in which receivers are used.
_PART_OF_RING = 0.125


def in_space(
    record: Record,
    omega: Float,
    damping: float | None = None,
    pairs: int = 1,
    component: int | None = None,
    clear: float = 0.0,
    k_max: float | None = None,
) -> BranchPoints:
    """Complex k at given frequencies; branches joined by continuity of |k|.

    Args:
        record: from before the source began on (u = 0 at its start).
        omega: real frequencies, ascending, shape (n,), rad/s.
        damping: σT of the exponential window, –; more cuts how far decay is seen, less leaves
            more of the record's end; by the record's noise where None.
        pairs: most pairs ±k sought at one frequency, 1 or 2, –.
        component: which of the record's; the strongest where None.
        clear: distance to keep from sources, m.
        k_max: largest |k| believed, rad/m; larger ones are refused.

    Returns:
        The points, n for each pair; those that can't be measured are there with the reason.

    Raises:
        RecordError: frames are missing, or fewer than two receivers stand clear of the sources.
    """
    if len(record.missing) and record.missing.any():
        raise RecordError(
            f"{record.missing.sum()} frames are missing: the exponential window needs them all; "
            "fill them, or use the part before the first one"
        )
    omega = np.asarray(omega, float)
    if component is None:
        component = int(np.argmax(np.abs(record.values).max(axis=(1, 2))))
    receivers, x = line_of(record, clear)
    values = record.values[component][:, receivers]
    t = record.t - record.t[0]
    deviation = replace(record, values=values[None], x=x).noise
    if len(record.quantum):
        # Samples rounded to q are off by q/√12, whatever the highest frequencies show.
        rounding = np.sqrt(np.mean(record.quantum[receivers] ** 2) / 12)
        deviation = float(max(deviation, rounding))
    if damping is None:
        part = deviation / max(np.abs(values).max(), 1e-290)
        damping = float(np.clip(_BELOW_NOISE - np.log(part + 1e-290), _LEAST_DAMPING, DAMPING))
    sigma = damping / float(t[-1])
    U = damped_transform(values, t, omega, sigma)
    everywhere = np.abs(damped_transform(record.values[component], t, omega, sigma)).max(axis=1)
    truncation = everywhere * np.exp(-damping)
    noise = _noise(deviation, record.interval, sigma, len(t))
    used = np.abs(U) > np.maximum(_ABOVE_TRUNCATION * truncation, _ABOVE_NOISE * noise)[:, None]
    if not record.ring:
        used |= (used.sum(axis=1) < len(x))[:, None] & (
            np.abs(U) > _ABOVE_TRUNCATION * truncation[:, None]
        )
    level = np.hypot(truncation, noise)
    fits = _fits(U, x, used, pairs)
    points = _chosen(fits, used, omega + 1j * sigma, level)
    points = _judged(points, np.zeros(0) if record.lattice else x, k_max)
    points = points.refused(
        points.omega.real > _BAND * np.pi / record.interval,
        "near the Nyquist frequency: sample more often",
    )
    points = with_axes(points, record.interval_error, record.spacing_error)
    if not (record.ring or record.lattice):
        points = folded(points, x, record.speed)
    return _with_branches(points, omega)


def line_of(record: Record, clear: float = 0.0) -> tuple[NDArray[np.int64], Float]:
    """Receivers of the longest stretch without a source, and their positions along it."""
    x, sources = record.x, np.sort(np.array(record.sources, float))
    if record.ring and len(sources):
        length = record.aperture
        gaps = np.diff(np.concatenate([sources, [sources[0] + length]]))
        start = sources[int(np.argmax(gaps))]
        along = np.mod(x - start, length)
        reach = clear + _PART_OF_RING * gaps.max()
        keep = np.flatnonzero((along > clear) & (along <= reach))
        keep = keep[np.argsort(along[keep])]
        chosen, at = keep, along[keep]
    else:
        edges = np.concatenate([[-np.inf], sources, [np.inf]])
        groups = [
            np.flatnonzero((x > low + clear) & (x < high - clear))
            for low, high in itertools.pairwise(edges)
        ]
        chosen = max(groups, key=len)
        at = x[chosen]
    if len(chosen) < 2:
        raise RecordError(
            f"{len(chosen)} receivers stand on one side of the sources and {clear:g} m clear of "
            "them: at least 2 are needed, 3 where waves run both ways; add receivers there"
        )
    return chosen, at


def _noise(deviation: float, interval: float, sigma: float, count: int) -> float:
    """Standard deviation in U of white noise: √(Σ e^{−2σt}) Δt times its own."""
    weights = (1 - np.exp(-2 * sigma * interval * count)) / (1 - np.exp(-2 * sigma * interval))
    return float(deviation * np.sqrt(weights)) * interval


def _fits(U: Any, x: Float, used: Any, pairs: int) -> list[tuple[int, bool, LineFit]]:
    found = []
    for p in range(1, pairs + 1):
        for both in (False, True):
            if len(x) >= unknowns(p, both):
                found.append((p, both, fit_line(U, x, used, p, both)))
    return found


def _chosen(
    fits: list[tuple[int, bool, LineFit]], used: Any, omega: Any, level: Float
) -> BranchPoints:
    """At each frequency the simplest model that a richer one does not better by far."""
    n = len(omega)
    count = used.sum(axis=1)
    chosen = np.zeros(n, int)
    best = fits[0][2].residual.copy()
    for number, (pairs, both, one) in enumerate(fits[1:], start=1):
        spare = count > unknowns(pairs, both)
        # Not below the noise: what is left there is no wave.
        better = spare & (one.residual * _BETTER < best) & (best > level**2)
        better |= spare & (one.residual * 1e4 < best)
        chosen[better] = number
        best = np.where(better, one.residual, best)
    columns: dict[str, list[Any]] = {
        name: []
        for name in ("omega", "k", "amplitude", "error", "residual", "reason", "excess", "weak")
    }
    for i in range(n):
        pairs, both, one = fits[chosen[i]]
        noise = np.sqrt(max(one.residual[i], level[i] ** 2))
        few = count[i] < unknowns(pairs, both)
        for p in range(pairs):
            columns["omega"].append(omega[i])
            columns["k"].append(one.k[i, p])
            columns["amplitude"].append(np.hypot(one.forward[i, p], one.backward[i, p]))
            columns["error"].append(np.nan if few else noise * one.unit[i, p])
            columns["residual"].append(one.unexplained[i])
            columns["weak"].append(_weak(one, i, count[i], unknowns(pairs, both), level[i]))
            columns["excess"].append(one.residual[i] > _EXCESS * level[i] ** 2)
            columns["reason"].append(
                "too few receivers above the record's truncation and noise: place some nearer to "
                "the source, or lengthen the record" if few else ""
            )  # fmt: skip
    reason = np.array(columns["reason"], object)
    unexplained = np.array(columns["residual"]) > _UNEXPLAINED
    more = unexplained & np.array(columns["excess"], bool) & (reason == "")
    weak = np.array(columns["weak"], bool) & (reason == "")
    reason[weak] = "no wave stands above the noise: drive more of it, or listen nearer"
    more &= ~weak
    reason[more] = "unexplained power: more waves than sought, or uneven noise"
    return BranchPoints(
        "space",
        np.array(columns["k"]),
        np.array(columns["omega"]),
        np.zeros(len(reason)),
        np.array(columns["amplitude"]),
        np.array(columns["error"]),
        np.array(columns["residual"]),
        reason == "",
        reason,
        np.full(len(reason), -1),
    )


def _weak(one: LineFit, i: int, count: int, free: int, level: float) -> bool:
    """Whether noise alone might be explained as well, by an F test."""
    spare = count - free
    if spare < 1:
        power = np.sum(one.forward[i] ** 2 + one.backward[i] ** 2)
        return bool(power < _WITHOUT_SPARE * level**2)
    left = max(float(one.unexplained[i]), 1e-290)
    ratio = (1 - left) / free / (left / spare)
    return bool(ratio < f_distribution.isf(_BY_CHANCE / count, 2 * free, 2 * spare))


def _judged(points: BranchPoints, x: Float, k_max: float | None) -> BranchPoints:
    points = points.refused(
        ~(points.error < _LARGEST_ERROR * np.abs(points.k)), "the error bar is as large as k"
    )
    if len(x):
        points = points.refused(
            np.abs(points.k.real) > _NYQUIST * np.pi / np.diff(x).min(),
            "at the receivers' Nyquist wavenumber: space them closer",
        )
    if k_max is not None:
        points = points.refused(np.abs(points.k) > k_max, "above k_max")
    return points


def _with_branches(points: BranchPoints, omega: Float) -> BranchPoints:
    branch = np.full(len(points), -1)
    own = np.flatnonzero(points.valid)
    if len(own):
        size = np.abs(points.k[own])
        step = np.searchsorted(omega, points.omega[own].real * (1 - 1e-12))
        cell = float(np.median(size)) / 4
        branch[own] = join(step, size, points.amplitude[own], cell, shortest=1)
    return replace(points, branch=branch)
