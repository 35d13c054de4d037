"""Flat tops, stuck stretches, and what was done to all samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.faults.finding import CURED, TOLD, Finding, places
from wavesim.records.faults.gain_in_time import unsteady
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
_STUCK, _LOST = 8, 0.1
# Sizes of channels are one where they are apart by less than this part of what noise makes, so many
# of its deviations, as happens by chance once in so many records; at rest it is in the quietest of
# so many blocks.
_ONE_SIZE, _CHANCE_WIDTH, _BY_CHANCE, _BLOCKS = 0.1, 2.5, 1e-6, 8
# A rectified signal never falls below rest by this part of its peak, and dips so many times,
# or each of so many once, shortly, between lobes of that part; most of the time it is below this
# part. Rectified noise has its least value 1.7 median deviations below its median, and noise that
# is not 4 and more.
_BELOW, _LOBE, _DIPS, _ALL_OF, _AT_REST, _FOLDED = 0.02, 0.1, 2, 4, 0.25, 2.5
# Compressed samples hold less noise above this part of the peak than below that, by this factor, at
# so many receivers.
_CREST, _STILL, _LESS, _SEVERAL = 0.5, 0.1, 0.35, 3
# A magnitude's noise at rest, mean over standard deviation, to this part; blocks are at rest up to
# so many times the least mean, of records of so many samples, so many blocks of each.
_RAYLEIGH, _CLOSE, _LEVEL, _RESTING, _PARTS = 1.913, 0.06, 1.3, 256, 16
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
    # Noise leaves no run of equal samples but at a limit, the longer the less of it the last digit
    # shows.
    fine = fine_noise(v)
    shown = min(1.0, fine / quantum) ** 2 if quantum else float(fine > 0)
    if shown * np.diff(long).max() >= 2 * _SURE:
        return float(np.diff(long).sum()) / len(v)
    noise = _ABOVE_NOISE * fine
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
                # to go on; or at that level, and jumps to it and off it.
                held = v[start]
                jump = abs(v[stop + 1] - held) if stop + 1 < len(v) else 0.0
                before = abs(held - v[start - 1]) if start else 0.0
                # An average of coarse steps rests on a crest, and goes on by steps as large.
                beside = (*np.diff(v[max(0, start - 3) : start + 1]), *np.diff(v[stop + 1 :][:4]))
                apart = abs(held - np.nanmedian(v)) > 0.02 * size[j]
                extreme = held in (np.nanmax(v), np.nanmin(v))
                lost = not apart and min(before, jump) > max(_LOST * size[j], 3 * quantum[j])
                goes_on = (
                    apart and not extreme and jump > 3 * np.nanmax(np.abs([*beside, quantum[j]]))
                )
                if stop - start >= _STUCK and start > 0 and (goes_on or lost):
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
    """Refuse magnitudes and rectified signals, and tell of channels levelled, each by its own.

    Args:
        values: shape (C, nt, nx), NaN where a sample is missing, with noise.
        flat, quantum: which receivers have flat tops, and their least step, shape (nx,).
        found: findings, added to.
    """
    for v in values:
        if _of_magnitudes(v):
            raise RecordError(
                "values are magnitudes (envelopes, moduli of complex samples): at rest their noise "
                "is Rayleigh's, that of √(a² + b²), and frequencies in them are of packets, not of "
                "waves; give the signals as they were"
            )
        size = np.nanmax(np.abs(v), axis=0)
        dips = []
        for u, lobes in zip(v.T, (np.abs(v) > _LOBE * size).T, strict=True):
            at = np.flatnonzero(lobes)
            gaps = np.diff(at) - 1
            short = (gaps > 0) & (gaps < lobes.sum() / (1 + np.sum(gaps > 0)))
            dips.append(sum(_to_rest(u[i : i + n + 2]) for i, n in zip(at[:-1][short], gaps[short],
                                                                       strict=True)))  # fmt: skip
        low = np.median(np.nanmedian(v, axis=0) < _AT_REST * size) == 1
        many = np.median(dips) >= _DIPS or (len(dips) >= _ALL_OF and min(dips) > 0)
        rest = np.nanmedian(v, axis=0)
        still = np.nanmedian(np.abs(v - rest), axis=0)
        # Above an offset a signal may swing both ways: it falls below rest by more than noise.
        floor = (rest - np.nanmin(v, axis=0) < np.maximum(_BELOW * size, _FOLDED * still)).all()
        if low and np.nanmin(v + _BELOW * size) > 0 and floor and many:
            raise RecordError(
                "values never fall below rest, but dip to it between lobes: they are rectified, "
                "and every frequency in them is another; give the signal as it was"
            )
        grows, follows = unsteady(np.nan_to_num(v - np.nanmedian(v, axis=0)))
        if not grows and _compressed(v - np.nanmedian(v, axis=0)):
            raise RecordError(
                "noise is less on crests than at rest, as no instrument adds it: samples are "
                "compressed (µ-law, decibels, an amplifier that saturates); take that back first"
            )
        gain = grows or follows
        told = not gain and not flat.any() and (size > 0).all()
        alike = _of_one_size(v, quantum) if told else ""
        if alike:
            said = f"all receivers have one {alike} to more digits than noise lets be: each was "
            said += "divided by its own"
        elif gain:
            said = f"noise is {gain}, at all receivers alike, as under a gain that changes in time "
            said += "(an automatic one, e^at, t^n, a window)"
        if alike or gain:
            said += ", so that amplitudes along them tell nothing"
            found.append(Finding(NORMALISED, "all receivers", alike or gain, TOLD, said))


def _to_rest(dip: Float) -> bool:
    """Whether values between two lobes come down to 0 as |u| does: to within half a step of u."""
    low = int(np.argmin(dip))
    return bool(dip[low] <= np.abs(np.diff(dip))[max(low - 1, 0) : low + 1].max())


def _of_magnitudes(v: Float) -> bool:
    """Whether channels, (nt, nx), never fall below zero and are Rayleigh's at rest: of mean √(π/2)
    and standard deviation √(2 − π/2) times that of either part."""
    blocks = np.array_split(v, _PARTS)
    mean = np.array([block.mean(axis=0) for block in blocks])
    if len(v) < _RESTING or not np.nanmin(v) >= 0 or not (mean > 0).all():
        return False
    ratios = []
    for j, still in enumerate((mean <= _LEVEL * mean.min(axis=0)).T):
        rest = np.concatenate([b[:, j] for b, own in zip(blocks, still, strict=True) if own])
        ratios.append(float(rest.mean()) / max(float(rest.std()), 1e-300))
    return abs(float(np.median(ratios)) / _RAYLEIGH - 1) < _CLOSE


def _compressed(v: Float) -> bool:
    """Whether third differences, nearly all noise, are less where channels, (nt, nx), are loud than
    where they are at rest: a curve that rises less and less passes less of both."""
    runs, third = sliding_window_view(np.abs(v), 4, axis=0), np.abs(np.diff(v, 3, axis=0))
    peak, ratios = np.nanmax(np.abs(v), axis=0), []
    for run, noise, top in zip(np.moveaxis(runs, 1, 0), third.T, peak, strict=True):
        loud = noise[(run.min(axis=1) > _CREST * top) & (noise > 0)]
        still = noise[run.max(axis=1) < _STILL * top]
        if len(loud) >= _STUCK and len(still) >= 4 * _STUCK:
            ratios.append(np.median(loud) / max(float(np.median(still)), 1e-300))
    return len(ratios) >= _SEVERAL and float(np.median(ratios)) < _LESS


def _of_one_size(v: Float, quantum: Float) -> str:
    """Of which measure all channels, (nt, nx), have one size beyond noise and chance; or ""."""
    nx, parts = v.shape[1], np.array_split(v, _BLOCKS)
    # Where it is least: at rest.
    noise = min(np.median([fine_noise(u[np.isfinite(u)]) for u in part.T]) for part in parts)
    few = 1 / np.sqrt(len(v))  # of a mean over all samples noise leaves so much
    told = []
    for name, size, least, part in (
        ("peak", np.nanmax(np.abs(v), axis=0), quantum.max(), 1.0),
        ("range", np.nanmax(v, axis=0) - np.nanmin(v, axis=0), quantum.max(), 1.4),
        ("rms", np.sqrt(np.nanmean(v**2, axis=0)), 0.0, few),
        ("rms about the mean", np.nanstd(v, axis=0), 0.0, few),
    ):
        spread = max(float(np.ptp(size)), least, 1e-15 * float(size.max()))
        chance = min(1.0, spread / (_CHANCE_WIDTH * part * max(float(noise), 1e-300)))
        sure = chance < _ONE_SIZE and (nx - 1) * np.log(chance) < np.log(_BY_CHANCE)
        told.append((name, sure))
    # Copies of one signal have all of them alike.
    return "" if all(one for _, one in told) else next((name for name, one in told if one), "")
