"""Frames that are not of the times they are given: held, lost, there twice, or off their times."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy  # its parts are loaded where they are used: they take a while
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.evenness import even
from wavesim.records.faults.finding import CURED, TAKEN_OUT, Finding, places

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# The most frames that a sample is held for by right of its being there several times; so many that
# are there again at least, where they are by a slower clock.
_MOST_HELD, _AGAIN = 16, 8
# A frame is told by so many on either side; it moves where both of so many deviate by so many times
# the noise, at this part of so many receivers and more.
_SIDE, _ABOUT, _MOVES, _RECEIVERS, _MOVING, _HALF = 3, 16, 6.0, 64, 3, 0.5
# What hears no wave deviates by so much more power than the median receiver.
_DEAF = 10.0
# Of more samples fewer receivers are looked at.
_SAMPLES = 2**22
# What is off there is so many times noise and, of one, of all, what is within so many frames; at
# receivers at rest no more than by chance; and, unlike a pick-up, no one sign at all.
_OFF, _ONE, _ALL, _WITHIN, _AT_REST, _ALIKE = 15.0, 8.0, 40.0, 21, 0.25, 0.5
# Two blocks of frames that change places break at so many times.
_BREAKS = 3
# It is midway between frames, to this part, and of receivers by so many frames at one time.
_BETWEEN, _COPIED, _ONE_TIME = 0.25, 0.04, 0.6
# Deviations that receivers share along their slopes are this part of what they would be if nothing
# else were there, by the median of so many parts of the record, as what is picked up is in one, and
# between these parts of an interval: less is noise, and more is no frame’s in its place, but
# edges sharper than an interval. Waves and noise make up to 0.3 of the first.
_ALONG, _STRETCHES, _OF_INTERVAL, _OUT_OF_PLACE = 0.7, 5, 0.06, 0.6
# Of fewer receivers the two shapes that are taken out of all leave too little.
_FEWEST = 6


def once_each(values: Float, t: Float, found: list[Finding]) -> tuple[Float, Float, float]:
    """Every sample once, where each is held for several frames, or some are.

    A record put on a finer clock by its nearest samples holds each for the time of its own clock:
    first frames k_j = k₀ + j b + e_j, |e_j| ≤ ½, are those of an even sequence.

    Returns:
        Values, times, and how many frames each was held, b.
    """
    if values.shape[1] < 64:
        return values, t, 1
    same = (values[:, 1:] == values[:, :-1]).all(axis=(0, 2))
    lively = ~same
    if same.sum() < _AGAIN or lively.sum() < 16:
        return values, t, 1
    changes = np.flatnonzero(lively) + 1
    gaps = np.diff(changes)
    if held := _held(gaps):
        start = int(changes[0]) % held
        found.append(
            Finding("samples repeated", "all receivers", f"{held} times each", CURED,
                    f"each sample is there {held} times: one of each taken, so that frames are "
                    f"{held} times as far apart")
        )  # fmt: skip
        return values[:, start::held], t[start::held], held
    # Frames at rest before and after are equal by right, and so are a few at a quantised crest.
    if np.sum(gaps - 1) < _AGAIN:
        return values, t, 1
    slower = even(changes.astype(float), 1.0)
    if slower is None or slower.step < 1 + 0.5 / len(changes):
        return values, t, 1
    found.append(
        Finding("samples repeated", "all receivers", f"{slower.step:.4g} times each", CURED,
                f"{same.sum()} of {len(t)} frames hold the samples of the one before, as put there "
                f"from a clock {slower.step:.6g} times slower by the nearest: one of each taken")
    )  # fmt: skip
    return values[:, changes], t[changes], slower.step


def _held(gaps: NDArray[np.int64]) -> int:
    """For how many frames samples are held that change after so many each; 0 where they are not."""
    for held in range(2, _MOST_HELD + 1):
        # Where all is quiet to the last digit frames are equal by right, too.
        if len(gaps) and np.mean(gaps % held == 0) > 0.98 and np.mean(gaps == held) > 0.5:
            return held
    return 0


def held_alone(values: Float, x: Float, labels: tuple[str, ...], found: list[Finding]) -> Mask:
    """Receivers whose samples are held for several frames each, where others' are not, shape (nx,):
    those of a slower clock, filled in on a faster one, by the last sample or by another.

    Args:
        values: shape (C, nt, nx), NaN where a sample is missing.
        x, labels: positions and names of the receivers.
        found: findings, added to.
    """
    lively = (values[:, 1:] != values[:, :-1]).any(axis=0)
    held = np.array([_held(np.diff(np.flatnonzero(one))) if one.sum() >= 16 else 0
                     for one in lively.T])  # fmt: skip
    out = np.asarray(held > 0)
    if not out.any() or out.all():
        return np.zeros(len(x), bool)
    where, size = places(x, out, labels), f"{held.max()} times"
    found.append(
        Finding("samples held", where, size, TAKEN_OUT,
                f"each sample is there up to {size}, as of a slower clock than the others': left "
                f"out ({where})")
    )  # fmt: skip
    return out


def check_goes_on(u: Float, t: Float) -> None:
    """Refuse a record in which all receivers that move break off at once, as no wave does.

    Frames beside one another tell each other (``_deviations``), but not where frames are lost, or
    there twice, while times go on.

    Args:
        u: one component, shape (nt, nx), finite.
        t: times, shape (nt,), s.
    """
    u, off, c = _deviations(u)
    if not len(off):
        return
    count, side = len(u), _SIDE
    noise = (1.4826 * np.median(np.abs(off), axis=0)) ** 2 + 1e-20
    # Between frames i and i + 1: of the equations that hold both, and of frames before and behind.
    i = np.arange(side + _ABOUT, count - side - _ABOUT)
    wrong = _sums(off**2, i - 2 * side + 1, 2 * side)
    near = scipy.ndimage.maximum_filter1d(
        _without_breaks(wrong, 2 * side), _WITHIN, axis=0, mode="constant"
    )
    away = 2 * side + _WITHIN // 2
    near = np.maximum(np.roll(near, away, axis=0), np.roll(near, -away, axis=0))
    power = [_sums(u**2, a, _ABOUT) / _ABOUT - (_sums(u, a, _ABOUT) / _ABOUT) ** 2
             for a in (i - _ABOUT + 1, i + 1)]  # fmt: skip
    moves = np.minimum(*power) > _MOVES**2 * noise / (1 + 2 * np.sum(c**2))
    hit = (wrong > _OFF * 2 * side * noise) & (wrong > _ONE * near)
    hits, moving = np.sum(hit & moves, axis=1), np.sum(moves, axis=1)
    jump = np.where(moves, off[i - side] - off[i - side + 1], 0)
    found = (hits >= np.maximum(_MOVING, _HALF * moving)) & (
        np.sum(hit & ~moves, axis=1) <= _AT_REST * hits + 1
    )
    found &= np.sum(wrong * moves, axis=1) > _ALL * np.sum(near * moves, axis=1)
    found &= np.sum(jump, axis=1) ** 2 < _ALIKE * moving * np.sum(jump**2, axis=1)
    size = np.where(found, np.sum(wrong * moves, axis=1), 0)
    best = int(np.argmax(size))
    if size[best] and _at_once(off[:, hit[best] & moves[best]] ** 2, int(i[best]) - side):
        raise RecordError(
            f"t = {t[i[best]]:.6g} to {t[i[best] + 1]:.6g} s: all receivers that move break off at "
            "once: frames are lost there, or there twice, or of other receivers, while times go "
            "on; put them right, or use the part before or after"
        )


def check_clock(u: Float) -> None:
    """Refuse a record whose frames are off their times, by a part of an interval each.

    A frame that is δ late deviates from what those beside it tell by δ ∂u/∂t at all receivers: of n
    that move alike the power along that is n times what it is by chance. Waves deviate by their
    even derivatives, across it. What δ leaves of a wave stands at other frequencies, with the
    wave's k, and would be read there for a wave.

    Args:
        u: one component, shape (nt, nx), finite.
    """
    u, off, _ = _deviations(u)
    nx = u.shape[1]
    if not len(off) or nx < _FEWEST:
        return
    slope = (u[_SIDE + 1 : len(u) - _SIDE + 1] - u[_SIDE - 1 : len(u) - _SIDE - 1]) / 2
    weight = 1 / np.sqrt(np.maximum(np.mean(off**2, axis=0), 1e-20))
    off, slope = off * weight, slope * weight
    # What all hear at once deviates along its own slope, in one shape, and moves so.
    loudest = [np.linalg.eigh(one.T @ one)[1][:, -1] for one in (off, slope)]
    shapes = np.linalg.qr(np.stack(loudest, axis=1))[0]
    off, slope = (one - one @ shapes @ shapes.T for one in (off, slope))
    steep = np.maximum(np.sum(slope**2, axis=1), 1e-300)
    along = np.sum(off * slope, axis=1) ** 2 / steep
    chance = (
        np.sum(slope**2 * scipy.ndimage.uniform_filter1d(off**2, _ABOUT, axis=0), axis=1) / steep
    )
    receivers = steep**2 / np.maximum(np.sum(slope**4, axis=1), 1e-300)
    # What one receiver shows alone, as a burst of its own noise, is no clock's.
    moves = (steep > np.median(steep)) & (receivers >= _MOVING)
    if not moves.any():
        return
    so_far = np.cumsum(steep * moves)
    part = np.minimum(_STRETCHES * so_far / so_far[-1], _STRETCHES - 1).astype(int)
    excess, all_of_it = (
        np.bincount(part, moves * power, _STRETCHES)
        for power in (along - chance, chance * (np.maximum(receivers, _MOVING) - 1))
    )
    late = float(np.sqrt(np.sum(along[moves]) / np.sum(steep[moves])))
    if not _OF_INTERVAL < late < _OUT_OF_PLACE:
        return
    if np.median(excess / np.maximum(all_of_it, 1e-300)) > _ALONG:
        raise RecordError(
            f"frames are off their times by {late:.2g} of an interval (rms), all receivers alike, "
            "as of a record put on another clock by its nearest samples, or of a clock that "
            "jitters: give the samples as they were taken, or put them there by interpolation"
        )


def _deviations(u: Float) -> tuple[Float, Float, Float]:
    """What frames differ by from what those beside them tell.

    u_i ≈ Σ_m c_m (u_{i−m} + u_{i+m}), with one c by least squares for the record. Receivers of
    noise alone, which is ten times and more as far from that, are left out: it would take c along.

    Returns:
        Some receivers that hear waves, each over its rms; deviations of all frames but so many at
        the ends, none of a record of few; c.
    """
    some = min(_RECEIVERS, max(2 * _MOVING, _SAMPLES // len(u)))
    u = u[:, :: -(-u.shape[1] // some)]
    u = u / np.maximum(np.sqrt(np.mean(u**2, axis=0)), 1e-300)
    count, side = len(u), _SIDE
    if count < 4 * _ABOUT:
        return u, u[:0], np.zeros(side)
    beside = np.stack([u[side - m : count - side - m] + u[side + m : count - side + m]
                       for m in range(1, side + 1)], axis=-1)  # fmt: skip
    own, kept = u[side:-side], np.ones(count - 2 * side, bool)
    hears = np.ones(u.shape[1], bool)
    for _ in range(3):
        u, own, beside = u[:, hears], own[:, hears], beside[:, hears]
        a = beside[kept].reshape(-1, side)
        normal = a.T @ a + 1e-12 * np.sum(a**2) * np.eye(side) + 1e-290 * np.eye(side)
        c = np.linalg.solve(normal, a.T @ own[kept].ravel())
        off = own - beside @ c
        size = np.sum(off**2, axis=1)
        kept = size <= np.quantile(size, 0.97)
        each = np.sum(off**2, axis=0)
        hears = each <= _DEAF * np.median(each)
    return u, off, c


def _without_breaks(wrong: Float, wide: int) -> Float:
    """Deviations, shape (n, nx), without those of the greatest few in time: of blocks of frames
    that are exchanged one break is near another."""
    left, total = wrong.copy(), np.sum(wrong / np.maximum(wrong.max(axis=0), 1e-300), axis=1)
    for _ in range(_BREAKS):
        at = int(np.argmax(total))
        own = slice(max(at - wide, 0), at + wide + 1)
        left[own], total[own] = 0.0, 0.0
    return left


def _at_once(off: Float, at: int) -> bool:
    """Whether squares (n, nx) about an equation are off as by a break between two frames: at one
    time, where waves come one after the other, but not by one shape, as what all pick up is."""
    about = np.arange(-_ABOUT // 2, _ABOUT // 2 + 2)
    rows = off[np.clip(at + about, 0, len(off) - 1)]
    middle = about @ (rows / np.sum(rows, axis=0))
    between = abs(float(np.mean(middle)) % 1 - 0.5) < _BETWEEN
    return bool(between and _COPIED < np.std(middle) < _ONE_TIME)


def _sums(rows: Float, first: NDArray[np.int64], many: int) -> Float:
    """Of so many rows from each of some on."""
    total = np.cumsum(np.concatenate([np.zeros((1, rows.shape[1])), rows]), axis=0)
    return np.asarray(total[first + many] - total[first])
