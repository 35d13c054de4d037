"""Receivers that the few waves of all others do not explain: of any fault.

At each strong frequency the field is a few waves e^{ikx}; round a ring k = 2πm/X. They are sought
one by one (orthogonal matching pursuit: Pati, Rezaiifar & Krishnaprasad, Asilomar 27, 40 (1993)) at
the receivers that are believed, by least squares. A receiver is off where what is left falls by far
without it, at most frequencies. What it shows is then held against what the others tell of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.fft import fft, ifft
from numpy.typing import NDArray

Float = NDArray[Any]
Mask = NDArray[np.bool_]
# The field of a few waves laid through good receivers, (n, nx), and the variance of what is left.
Waves = Callable[[Any, Mask], tuple[Any, Float]]

FEWEST = 6
# No more than this part of the receivers may be off, and waves are no more than this of the rest,
# and than so many.
PART, _WAVES, _MOST_WAVES = 0.25, 0.25, 32
# A wave stands so many times above the median of all wavenumbers, or this part of the field.
_ABOVE, _ROUNDING = 3.5, 1e-8
# What is left must fall by this factor without one, of few and of many; so many of the worst are
# tried, and so many are taken away in search of a fall, as where two are off alike.
_FALLS, _TRIED, _AHEAD = (4.0, 2.0), 4, 3
# Of many it need not fall as far where one has so many times the others' median left.
_SOME, _STANDS = 1.3, 25.0
# A factor that explains all but this part of a receiver is one.
_ALONE, _SAME = 0.01, 1e-3
_FEWEST_FREQUENCIES, _FREQUENCIES = 4, 64
# … fewer of more receivers than these, which tell as much, …
_FULL = 256
# … the loudest, of this part of the greatest power. One is off by this part of the field's.
_LOUD, _LEAST = 0.01, 1e-6
# Where, of many, none has so many times the median left, none is off.
_MANY, _EVEN = 16, 3.0
# Along a line waves are no more than so many, and each must lower what is left to this part.
# Wavenumbers tried, per receiver, over ±π/d; what they miss by leaves this part of the power.
_MOST_ALONG, _LOWERS, _FINE, _SQUARE = 4, 0.6, 16, 1e-16


@dataclass(frozen=True)
class Unfit:
    """What was found.

    Attributes:
        off: receivers that do not fit, shape (nx,).
        factor: of those what they show over what is there, where that is all, (nx,); NaN else.
        all: whether the others fit each other then.
        left, power: variance of what is left of them, and of the field, in the mean.
        rows: frequencies that were looked at, shape (m,).
        told: the field there as the others tell it, shape (m, nx).
    """

    off: Mask
    factor: Float
    all: bool
    left: float = 0.0
    power: float = 1.0
    rows: NDArray[np.int64] | None = None
    told: Any = None


def unfit(U: Any, known: Mask, waves: Waves | None = None) -> Unfit:
    """Receivers that do not fit.

    Args:
        U: field at strong frequencies, shape (n, nx).
        known: receivers that are known to be off, shape (nx,).
        waves: lays few waves through some receivers; where not given, they go evenly round a ring.
    """
    nx = U.shape[1]
    off, factor = known.copy(), np.full(nx, np.nan)
    if (nx < FEWEST and waves is None) or len(U) < _FEWEST_FREQUENCIES:
        return Unfit(off, factor, True)
    waves = waves or round_ring
    size = np.sum(np.abs(U) ** 2, axis=1)
    several = max(4 * _FEWEST_FREQUENCIES, min(_FREQUENCIES, _FREQUENCIES * _FULL // nx))
    loud = np.argsort(-size, kind="stable")[:several]
    fewest = loud[: 4 * _FEWEST_FREQUENCIES]
    rows = np.union1d(fewest, loud[size[loud] > _LOUD * size.max()])
    U = U[rows]
    most = max(1, int(PART * nx))
    start = before = waves(U, ~off)
    size = np.where(off, 0, _left_at(U, before))
    gone, since, last = off.copy(), 0, before
    falls = _FALLS[int(nx >= _MANY)]
    if nx >= _MANY and size.max() < _EVEN * np.median(size[~off]):
        since = _AHEAD
    while gone.sum() <= most and since < _AHEAD:
        j, after = _worst(U, gone, before, waves)
        left_at = _left_at(U, before)
        out = left_at[j] / np.median(left_at[~gone])
        gone[j] = True
        since += 1
        seen = np.mean(np.abs(U[:, j] - after[0][:, j]) ** 2)
        less = seen < _LEAST * np.mean(np.abs(after[0]) ** 2)
        fall = _fall(before, after)
        if not less and (fall >= falls or (nx >= _MANY and fall >= _SOME and out > _STANDS)):
            off, since, last = gone.copy(), 0, after
        before = after
    power = float(np.mean(np.abs(start[0][:, ~known]) ** 2))
    if off.sum() > most:
        return Unfit(known, factor, False, float(start[1].mean()), power)
    V, left = last
    for j in map(int, np.flatnonzero(off & ~known)) if off.sum() > 1 else ():
        # One that was taken for the worst while another was.
        again = off.copy()
        again[j] = False
        with_it = waves(U, ~again)
        if _fall(with_it, (V, left)) < min(np.sqrt(falls), _SOME):
            off, (V, left) = again, with_it
    for j in map(int, np.flatnonzero(off & ~known)):
        told, seen = V[:, j] / np.sqrt(left), U[:, j] / np.sqrt(left)
        size = float(np.sum(np.abs(told) ** 2))
        part = float(np.sum(np.real(np.conj(told) * seen))) / max(size, 1e-300)
        rest = float(np.sum(np.abs(seen - part * told) ** 2))
        if rest < _ALONE * float(np.sum(np.abs(seen) ** 2)):
            # What stands by itself at one place, as under a source, looks so, but for its factor.
            fits = abs(part - 1) < _SAME
            factor[j], off[j] = np.nan if fits else part, not fits
    return Unfit(off, factor, True, float(left.mean()), power, rows, V)


def _worst(
    U: Any, gone: Mask, now: tuple[Any, Float], waves: Waves
) -> tuple[int, tuple[Any, Float]]:
    """The receiver without which least is left, and the waves of the others."""
    size = _left_at(U, now)
    tried = []
    for j in np.argsort(-np.where(gone, -1, size), kind="stable")[:_TRIED]:
        good = ~gone
        good[j] = False
        after = waves(U, good)
        tried.append((_fall(now, after), int(j), after))
    _, j, after = max(tried, key=lambda one: one[0])
    return j, after


def _left_at(U: Any, now: tuple[Any, Float]) -> Float:
    """What is left at each receiver, over what is at all, at each frequency and in all."""
    V, left = now
    rest = np.abs(U - V) ** 2
    return np.asarray(np.mean(rest / left[:, None], axis=0) + rest.mean(axis=0) / left.mean())


def _fall(before: tuple[Any, Float], after: tuple[Any, Float]) -> float:
    """By what factor less is left, at half the frequencies or more."""
    return float(np.median(before[1] / after[1]))


def round_ring(U: Any, good: Mask) -> tuple[Any, Float]:
    """The field of a few waves laid through good receivers, and the variance of what is left."""
    n, nx = U.shape
    seen = np.where(good, U, 0)
    V, left = np.zeros_like(U), seen
    floor = _ROUNDING * np.sqrt(nx * np.sum(np.abs(seen) ** 2, axis=1))
    rows, taken = np.arange(n)[:, None], np.zeros((n, nx), bool)
    # Scalar products over good receivers, of two waves by m − m′, and of a wave and what is seen.
    product, heard = fft(good), fft(seen, axis=1)
    waves, goes = np.zeros((n, 0), int), np.ones((n, 1), bool)
    own = goes[:, :0]
    for _ in range(min(max(2, int(_WAVES * good.sum())), _MOST_WAVES)):
        size = np.abs(fft(left, axis=1))
        above = np.maximum(_ABOVE * np.median(size, axis=1), floor)
        size[taken] = 0
        goes &= (size.max(axis=1) > above)[:, None] | (waves.shape[1] == 0)
        if not goes.any():
            break
        waves = np.append(waves, size.argmax(axis=1)[:, None], axis=1)
        own = np.append(own, goes, axis=1)
        taken[rows[goes], waves[:, -1:][goes]] = True
        gram = product[waves[:, :, None] - waves[:, None]] * own[:, :, None] * own[:, None]
        gram += 1e-13 * nx * np.eye(waves.shape[1])
        told = np.linalg.solve(gram, (heard[rows, waves] * own)[..., None])[..., 0]
        spectrum = np.zeros_like(V)
        np.add.at(spectrum, (rows, waves), told)
        V = nx * ifft(spectrum, axis=1)
        left = np.where(good, U - V, 0)
    spare = np.maximum(good.sum() - taken.sum(axis=1), 1)
    rest = np.sum(np.abs(left) ** 2, axis=1) / spare
    return V, np.maximum(rest, _ROUNDING**2 * np.mean(np.abs(seen) ** 2, axis=1))


def along_line(x: Float, most: float = 0.0) -> Waves:
    """Few waves of any wavenumber that receivers at x tell apart, ±π/d, one by one; where they
    stand unevenly up to the most that any has, rad/m, which is no alias of another there."""
    gaps = np.diff(x)
    further = most if np.ptp(gaps) > 1e-3 * gaps.mean() else 0.0
    parts = max(1, int(np.ceil(further * float(np.median(gaps)) / np.pi)))
    k = np.linspace(-1, 1, _FINE * len(x) * parts + 1)[:-1] * parts * np.pi / np.median(gaps)
    steer = np.exp(1j * np.outer(k, x - x.mean()))

    def waves(U: Any, good: Mask) -> tuple[Any, Float]:
        n, count = len(U), int(good.sum())
        seen = np.where(good, U, 0)
        power = np.sum(np.abs(seen) ** 2, axis=1)
        V, rest, left = np.zeros_like(U), seen, power / count
        taken, goes = np.zeros((n, 0), int), np.ones(n, bool)
        for number in range(1, max(1, min(_MOST_ALONG, int(_WAVES * count))) + 1):
            taken = np.append(taken, np.abs(rest @ steer.conj().T).argmax(axis=1)[:, None], axis=1)
            own = steer[taken]
            heard = np.conj(own * good)
            gram = heard @ own.transpose(0, 2, 1) + 1e-9 * count * np.eye(number)
            size = np.linalg.solve(gram, heard @ seen[:, :, None])
            told = (size * own).sum(axis=1)
            after = np.where(good, U - told, 0)
            # A wave has a size, a phase and a wavenumber.
            lower = np.sum(np.abs(after) ** 2, axis=1) / max(count - 1.5 * number, 0.5)
            goes &= (lower < _LOWERS * left) | (number == 1)
            V, rest = (np.where(goes[:, None], a, b) for a, b in ((told, V), (after, rest)))
            left = np.where(goes, lower, left)
        return V, np.maximum(left, _SQUARE * power / count)

    return waves
