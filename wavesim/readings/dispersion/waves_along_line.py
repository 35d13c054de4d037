"""Modes of a line that waves leave: ω against k by beams, joined over frequency.

At each frequency the waves along the line are found (``beam.py``), each with the error of its k.
Joined over frequencies they are modes; along one, the error of ω at given k is that of k times the
slope dω/dk, its group velocity.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.dispersion.beam import Beams, beams
from wavesim.readings.dispersion.branch_joining import join
from wavesim.readings.dispersion.folding import (
    FOLDED,
    folded_branches,
    points_to_zero,
    through_zero,
)
from wavesim.readings.dispersion.hidden_mode import worth
from wavesim.readings.dispersion.phase_beam import highest_wavenumber
from wavesim.readings.dispersion.points import ALONE, CUT, BranchPoints
from wavesim.readings.dispersion.receiver_spectra import FEWEST
from wavesim.records.fitness import for_waves_along_line
from wavesim.records.record import Record, RecordError

Float = NDArray[Any]

# Part of the Nyquist frequency or wavenumber up to which a point counts.
_NYQUIST = 0.97
# Modes closer than this part of 2π/X are taken for one where nothing shows.
_CLOSE = 0.1
# Points are joined within this part of the aperture's resolution 2π/X.
_CELL = 0.25
# Largest standard error of k, over k.
_LARGEST_ERROR = 0.25
# A tone is the highest of so many bins on either side, so many times higher than all within more,
# and than noise.
_WIDE, _NEAR_TONE, _TONE = 4, 12, 10.0
# … and no weaker than this part of the strongest.
_LOUD = 0.1
# Fewer points left are no mode.
_FEWEST = 3
# The slope of a mode is taken over so many points on either side, and more where it is not known
# to this part of it.
_SLOPE, _SURELY_SLOPE = 2, 0.3
# The slowest wave is looked for above this part of the receivers' Nyquist wavenumber.
_SHORT = 0.3
# One whose dω/dk is less than this part of ω/k is not. Above so many times its frequency at π/d all
# is folded.
_FLAT, _FOLDS = 0.3, 2.0
# No k is better than this part of 2π/X: rounding, and what of a wave is left at the record's end.
_FLOOR = 1e-7
CHANCE = "phases along the line are no more in line than by chance"


def along_line(
    record: Record, k_max: float | None = None, omega_max: float | None = None
) -> BranchPoints:
    """Points (k, ω) of the waves that pass a line of receivers.

    Args:
        record: from before the waves come, or from when they are all there.
        k_max: highest wavenumber wanted, rad/m.
        omega_max: highest frequency wanted, rad/s.

    Returns:
        The points, ascending in ω, at the frequencies of the record's transform; modes are their
        branches.

    Raises:
        RecordError: frames are missing, or fewer than five receivers stand on one side of sources.
    """
    record = one_side(for_waves_along_line(record))
    values, x = record.values[0], record.x
    top = _NYQUIST * np.pi / record.interval
    quantum = record.quantum if len(record.quantum) else 0.0
    omega, found = beams(values, x, record.interval, min(top, omega_max or top), quantum)
    return _as_points(omega, found, x, k_max, record)


def one_side(record: Record) -> Record:
    """The strongest component at the receivers on the side of the sources that has most."""
    component = int(np.argmax(np.abs(record.values).max(axis=(1, 2))))
    edges = np.concatenate([[-np.inf], np.sort(record.sources), [np.inf]])
    sides = [
        np.flatnonzero((record.x > low) & (record.x < high))
        for low, high in itertools.pairwise(edges)
    ]
    own = max(sides, key=len)
    if len(own) < FEWEST:
        raise RecordError(
            f"{len(own)} receivers stand on one side of the sources: at least {FEWEST} are needed "
            "to tell waves along a line apart; add receivers, or measure k at given ω (wavesim "
            "attenuation)"
        )
    return record.component(component).receivers(own)


def _as_points(
    omega: Float, found: Beams, x: Float, k_max: float | None, record: Record
) -> BranchPoints:
    cell = 2 * np.pi / float(np.ptp(x))
    n = len(found.step)
    branch = np.full(n, -1)
    clear = np.flatnonzero(found.clear & ~found.cut)
    if len(clear):
        branch[clear] = join(
            found.step[clear], found.k[clear], found.amplitude[clear], _CELL * cell
        )
    tones = _tones(found, branch)
    branch[tones] = branch.max(initial=-1) + 1 + np.arange(len(tones))
    at = omega[found.step]
    error = np.hypot(found.error, _FLOOR * cell)
    hides = worth(found.bends, np.abs(found.k), branch, found.step, cell, close=_CLOSE)
    error = np.hypot(error, hides.error)
    error = np.hypot(error, np.abs(found.k) * np.hypot(record.spacing_error, record.interval_error))
    speed = at / np.maximum(np.abs(found.k), 1e-290)
    gap = np.pi / highest_wavenumber(x)
    modes = [np.flatnonzero(branch == b) for b in np.unique(np.delete(branch, tones)) if b >= 0]
    beyond = np.zeros(n, bool)
    for own in modes:
        beyond[own] = through_zero(own[np.argsort(at[own])], found.k, at, cell)
    folded = folded_branches(branch, found.k, at, gap, beyond)
    for own in modes:
        speed[own] = np.abs(slopes(found.k[own], at[own], error[own]))
    # Where the slowest wave is folded, k is one that points to 0, or may be any.
    phase = at / np.maximum(np.abs(found.k), 1e-290)
    short = ~folded & (branch >= 0) & (np.abs(found.k) > _SHORT * np.pi / gap)
    short &= speed > _FLAT * phase  # a mode that tends to a ceiling is not there above it
    fold = float(phase[short].min(initial=np.inf)) * np.pi / gap
    for own in modes:
        if at[own].mean() > fold:
            folded[own] |= not points_to_zero(found.k[own], at[own], gap)
            folded[own] |= at[own].mean() > _FOLDS * fold
    of_omega = np.hypot(speed * error, found.unsure)
    error = np.hypot(error, found.unsure / np.maximum(np.minimum(speed, phase), 1e-290))
    points = BranchPoints(
        "beam",
        np.abs(found.k),
        at,
        np.zeros(n),
        found.amplitude,
        of_omega,
        found.unexplained,
        np.ones(n, bool),
        np.full(n, "", object),
        branch,
        error,
        np.where(found.bends.noise > 0, speed * hides.splitting, np.nan),
    )
    points = points.refused(found.cut, CUT)
    points = points.refused(~found.clear, CHANCE)
    points = points.refused(points.k < cell, "longer than the aperture")
    points = points.refused(error > _LARGEST_ERROR * points.k, "the error bar is as large as k")
    points = points.refused(of_omega > _LARGEST_ERROR * at, "the error bar is as large as ω")
    if not record.lattice:
        points = points.refused(folded, FOLDED)
        points = points.refused(
            points.k > _NYQUIST * np.pi / gap,
            "at the Nyquist wavenumber: space receivers closer",
        )
    points = points.refused(branch < 0, ALONE)
    left = np.bincount(branch[points.valid], minlength=branch.max(initial=0) + 1)
    few = (branch >= 0) & (left[branch] < _FEWEST)
    few[tones] = False
    points = points.refused(few, ALONE)
    if k_max is not None:
        points = points.take(points.k <= k_max)
    return numbered(points)


def _tones(found: Beams, branch: NDArray[Any]) -> NDArray[np.int64]:
    """Waves of no mode that are lines in frequency: far above those at other frequencies near by.

    Their frequency is known by how far it is off that of the transform (``Beams.unsure``).
    """
    tones = []
    loud = found.amplitude > _LOUD * found.amplitude.max(initial=0.0)
    for i in np.flatnonzero(loud & found.clear & ~found.cut & (branch < 0)):
        away = np.abs(found.step - found.step[i])
        beside = found.amplitude[(away > _WIDE) & (away < _NEAR_TONE)].max(initial=found.noise)
        near, size = found.amplitude[away <= _WIDE].max(), found.amplitude[i]
        if size == near > _TONE * beside and not (branch[away <= _WIDE] >= 0).any():
            tones.append(i)
    return np.array(tones, int)


def numbered(points: BranchPoints) -> BranchPoints:
    """Branches of valid points only, numbered from 0 on, ascending in their median frequency."""
    branch = np.where(points.valid, points.branch, -1)
    names = sorted(np.unique(branch[branch >= 0]),
                   key=lambda b: float(np.median(np.real(points.omega[branch == b]))))  # fmt: skip
    changed = np.full(len(branch), -1)
    for number, name in enumerate(names):
        changed[branch == name] = number
    return replace(points, branch=changed)


def slopes(k: Float, omega: Float, error: Float) -> Float:
    """dω/dk at each point of a mode, by straight lines through the points about it.

    Args:
        k, omega: along a mode, shape (m,), rad/m and rad/s.
        error: standard error of k, shape (m,), rad/m: the lines are as long as they must be.
    """
    result = np.empty(len(k))
    for i in range(len(k)):
        reach, change, unsure = _SLOPE, 0.0, 1.0
        while unsure > _SURELY_SLOPE * abs(change) and reach < 2 * len(k):
            near = slice(max(0, i - reach), i + reach + 1)
            away = omega[near] - omega[near].mean()
            size = float(np.sum(away**2))
            change = float(np.sum(away * (k[near] - k[near].mean())) / size)
            unsure, reach = float(np.median(error[near])) / np.sqrt(size), 2 * reach
        if unsure > _SURELY_SLOPE * abs(change):  # as fast as phases, for all that is known
            change = min(abs(change), abs(k[i]) / omega[i])
        result[i] = 1 / change if change else omega[i] / max(abs(k[i]), 1e-290)
    return result
