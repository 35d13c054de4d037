"""Flat tops, stuck stretches, samples that are there twice, and what was done to all of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.faults.finding import CURED, TOLD, Finding, places
from wavesim.records.faults.quiet import fine_noise

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# So many samples at one extreme in a row, entered by a step that no crest has, are a top cut flat.
_FLAT, _SURE = 3, 5
_ROUNDED, _STEPS, _ABOVE_NOISE = 1.0, 8, 4.0
# The extreme is this part of the range off the middle of the samples.
_OFF = 0.2
# Beside noise that is so many times the least step two samples or more at the array's extreme, or
# three, are cut off there.
_FINE = ((2, 1e3), (3, 10.0))
_MOST_HELD = 16
_STUCK = 8
# Peaks that are equal to this part are so by division. A rectified signal never falls below rest by
# this part of its peak, and dips so many times, shortly, between lobes of that part.
_EQUAL = 1e-6
_BELOW, _LOBE, _DIPS = 0.02, 0.1, 2
NORMALISED = "normalised"


def clipped(values: Float, quantum: Float, noisy: bool = False) -> tuple[Mask, Float]:
    """Which receivers have flat tops, and the part of their samples that is flat.

    Args:
        values: shape (C, nt, nx), NaN where missing.
        quantum: least step of each, shape (nx,).
        noisy: whether the channels hold noise, so that no two samples are alike by right.
    """
    flat, part = np.zeros(values.shape[2], bool), np.zeros(values.shape[2])
    for component in values:
        if noisy:
            at = _at_one_rail(component)
            flat |= at.any(axis=0)
            part = np.maximum(part, at.mean(axis=0))
        for j in range(component.shape[1]):
            v = component[:, j]
            v = v[np.isfinite(v)]
            if len(v) < 16 or np.ptp(v) == 0:
                continue
            middle = np.median(v)
            for rail in (v.max(), v.min()):
                if abs(rail - middle) < _OFF * np.ptp(v):
                    continue
                share = _flat(v, rail, quantum[j])
                if share:
                    flat[j] = True
                    part[j] += share
    return flat, part


def _at_one_rail(component: Float) -> Mask:
    """Samples at the extreme of all channels, where more are than noise lets be, (nt, nx)."""
    found = np.zeros(component.shape, bool)
    strongest = component[:, int(np.argmax(np.ptp(np.nan_to_num(component), axis=0)))]
    steps = np.diff(np.unique(strongest[np.isfinite(strongest)]))
    noise = np.median([fine_noise(v[np.isfinite(v)]) for v in component.T])
    for rail in (np.nanmax(component), np.nanmin(component)):
        at = component == rail
        fine = any(at.sum() >= n and noise > above * steps.min(initial=np.inf)
                   for n, above in _FINE)  # fmt: skip
        # All divided by their peaks hold it once each.
        if fine and not (component.shape[1] > 2 and (at.sum(axis=0) == 1).all()):
            found |= at
    return found


def _flat(v: Float, rail: float, quantum: float) -> float:
    """Part of the samples in runs at a rail, 0 where it is none."""
    at = v == rail
    # A few steps high nothing has a top, and a level that the record begins at is rest.
    low = np.ptp(v) < _STEPS * quantum or np.abs(v[:_FLAT] - rail).max() <= 2 * quantum
    if at.sum() < _FLAT or (quantum and low):
        return 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(int), [0]]))).reshape(-1, 2)
    long = edges[np.diff(edges, axis=1).ravel() >= _FLAT]
    long = long[(long[:, 0] > 0) & (long[:, 1] < len(v))]
    # One crest of three or four equal samples is chance among the many of many receivers.
    if not len(long) or (quantum and len(long) == 1 and np.diff(long).max() < _SURE):
        return 0.0
    noise = _ABOVE_NOISE * fine_noise(v)
    # A crest that is round is entered slowly: the step before it is of the size of the last digit.
    # A top cut flat is entered as steeply as the wave climbs.
    climb = 0
    counted = 0
    for start, stop in long:
        before, behind = abs(v[start] - v[start - 1]), abs(v[stop] - v[stop - 1])
        # A parabola whose crest is within one step over n samples falls by so many beside it.
        n = int(stop - start)
        bound = (((n + 1) / (n - 1)) ** 2 + _ROUNDED) * quantum + noise
        climb += max(before, behind) > bound
        counted += int(stop - start)
    return counted / len(v) if climb * 2 > len(long) else 0.0


def once_each(
    values: Float, t: Float, quantum: Float, found: list[Finding]
) -> tuple[Float, Float, int]:
    """Every sample once, where each is held for several frames.

    Returns:
        Values, times, and how many frames each was held.
    """
    if values.shape[1] < 64:
        return values, t, 1
    same = (values[:, 1:] == values[:, :-1]).all(axis=(0, 2))
    lively = ~same
    if same.mean() < 0.45 or lively.sum() < 16:
        return values, t, 1
    first = int(np.argmax(lively)) + 1
    changes = np.flatnonzero(lively) + 1
    gaps = np.diff(changes)
    for held in range(2, _MOST_HELD + 1):
        # Where all is quiet to the last digit frames are equal by right, too.
        if np.mean(gaps % held == 0) > 0.98 and np.mean(gaps == held) > 0.5:
            start = first % held
            found.append(
                Finding("samples repeated", "all receivers", f"{held} times each", CURED,
                        f"each sample is there {held} times: one of each taken, so that frames are "
                        f"{held} times as far apart")
            )  # fmt: skip
            return values[:, start::held], t[start::held], held
    return values, t, 1


def without_stuck(
    values: Float, t: Float, x: Float, labels: tuple[str, ...], quantum: Float, found: list[Finding]
) -> Float:
    """Values with stretches that stand still while the signal goes on as NaN."""
    which, total, first = np.zeros(len(x), bool), 0, len(t)
    for component in values:
        size = np.nanmax(np.abs(component - np.nanmedian(component, axis=0)), axis=0)
        same = np.diff(component, axis=0) == 0
        for j in np.flatnonzero(same.sum(axis=0) >= _STUCK):
            v = component[:, j]
            if size[j] == 0 or quantum[j] > 2e-3 * size[j]:
                continue
            edges = np.diff(np.concatenate([[0], same[:, j].astype(int), [0]]))
            for start, stop in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1),
                                   strict=True):  # fmt: skip
                # It stands at a value that is neither the level at rest nor an extreme, and jumps
                # to go on.
                held = v[start]
                jump = abs(v[stop + 1] - held) if stop + 1 < len(v) else 0.0
                before = abs(held - v[start - 1]) if start else 0.0
                apart = abs(held - np.nanmedian(v)) > 0.02 * size[j]
                extreme = held in (np.nanmax(v), np.nanmin(v))
                if (stop - start >= _STUCK and apart and not extreme and start > 0
                        and jump > 3 * max(before, quantum[j])):  # fmt: skip
                    which[j] = True
                    total += int(stop - start)
                    first = min(first, int(start))
                    v[start + 1 : stop + 1] = np.nan
    if total:
        where = places(x, which, labels)
        found.append(
            Finding("stuck", f"{where}, from t = {t[first]:.6g} s", f"{total} samples", CURED,
                    f"{total} samples that stand still while the signal goes on taken as missing "
                    f"({where})")
        )  # fmt: skip
    return values


def tell_processed(values: Float, flat: Mask, quantum: Float, found: list[Finding]) -> None:
    """Refuse signals that are rectified, and tell of channels divided by their peaks.

    Args:
        values: shape (C, nt, nx), NaN where a sample is missing, with noise.
        flat, quantum: which receivers have flat tops, and their least step, shape (nx,).
        found: findings, added to.
    """
    for v in values:
        size = np.nanmax(np.abs(v), axis=0)
        dips = []
        for lobes in (np.abs(v) > _LOBE * size).T:
            gaps = np.diff(np.flatnonzero(lobes)) - 1
            dips.append(np.sum((gaps > 0) & (gaps < lobes.sum() / (1 + np.sum(gaps > 0)))))
        if np.nanmin(v + _BELOW * size) > 0 and np.median(dips) >= _DIPS:
            raise RecordError(
                "values never fall below rest, but dip to it between lobes: they are rectified, "
                "and every frequency in them is another; give the signal as it was"
            )
        equal = np.ptp(size) <= _EQUAL * size.max() and not flat.any()
        if len(size) > 2 and equal and not (quantum > _EQUAL * size).any():
            found.append(
                Finding(NORMALISED, "all receivers", f"peaks of {size.max():.6g}", TOLD,
                        "all receivers have one peak to the last digit: each was divided by its "
                        "own, so that amplitudes along them tell nothing")
            )  # fmt: skip
