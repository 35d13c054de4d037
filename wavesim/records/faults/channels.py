"""Channels that do not fit the others: dead, reversed, swapped, delayed, mis-scaled, one or a side.

At each frequency the field along a line is a few waves e^{ikx} that fall off alike, as round a ring
(`unfit_receivers.py`), so that several modes are no fault of any channel. What a channel shows is
held against what the others tell of it: a factor, a polarity, another's place, a delay ωτ. Where
the others do not agree on few waves, nothing is said of any.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from wavesim.records.faults.finding import CURED, TAKEN_OUT, Finding, places
from wavesim.records.faults.moveout import arrivals, delay_of, jump, speed
from wavesim.records.faults.quiet import Rest
from wavesim.records.faults.unfit_receivers import Waves, along_line, unfit

Float = NDArray[Any]
Mask = NDArray[np.bool_]

FEWEST = 5
TOGETHER = 24
_FREQUENCIES = 24
_DAMPING = 8.0
# Frequencies count above this part of the greatest power, and so many times above what is there at
# the highest.
_STRONG, _ABOVE = 0.05, 10.0
# Phases run no slower than signals do by this factor.
_SLOWER = 1.5
# Waves spread as r^c, c from this to 0, from so many spacings before the line or behind it.
_SPREADS, _BEFORE = -1.6, (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
_FEWEST_SPREAD = 8
# The others agree where no more than this part of the power is left.
_AGREED = 0.2
# A factor, a delay or an exchange explains all but these parts of what a channel shows, and a delay
# of what the others do not tell of it.
_ALONE, _LATE, _EXCHANGED = 0.1, 0.3, 0.15
# Factors nearer to 1 are none, at the ends, where waves may fall off otherwise, and elsewhere; and
# nearer to −1 they are a polarity.
_FACTOR, _AT_END, _TURNED = 1.04, 1.5, 0.1
# … and those that gains at random show in this part of records, as far as the others' tell.
_CHANCE = 0.01
# A factor between these is divided out; beyond, too little is left of the channel.
_SCALED = (0.2, 5.0)
# Of fewer an exchange is sought among all pairs: it must leave this part of what any other does.
_FEW, _CLEAR, _TIE = 8, 0.25, 1.1
_DEAD = 0.05
# A channel is heard where it is so many times its noise at half the frequencies, and off where what
# the others do not tell of it is so many times that (powers).
_HEARD, _NOISE = 10.0, 6.0


@dataclass
class Mended:
    """What is done to channels: values[:, order] * factor, without those out.

    Attributes:
        order: which channel's samples stand at each place, shape (nx,).
        factor: what each is multiplied by, shape (nx,).
        out: which are left out, shape (nx,).
    """

    order: NDArray[np.int64]
    factor: Float
    out: Mask

    @property
    def any(self) -> bool:
        """Whether anything is done."""
        moved = bool((self.order != np.arange(len(self.order))).any())
        return moved or bool((self.factor != 1).any()) or bool(self.out.any())


def misfits(
    component: Float,
    t: Float,
    x: Float,
    labels: tuple[str, ...],
    rest: Rest,
    unsure: Mask,
    found: list[Finding],
) -> Mended:
    """Channels to turn, exchange or rescale, and those to leave out.

    Args:
        component: shape (nt, nx), finite, without offset.
        t, x, labels: times, positions and names of the receivers.
        rest: of the channels.
        unsure: which have a size that says nothing: flat tops, gaps.
        found: findings, added to.
    """
    nx = component.shape[1]
    mended = Mended(np.arange(nx), np.ones(nx), np.zeros(nx, bool))
    if nx < FEWEST or not np.isfinite(x).all() or (rest.onset > 0).sum() < 0.6 * nx:
        return mended
    if (broken := _broken(component, t, x, rest)) is not None:
        kind, those = broken
        apart = Mended(mended.order, mended.factor, mended.out)
        found.append(mend(apart, kind, those, x, labels))
        keep = np.flatnonzero(~apart.out)
        right = component[:, keep] * apart.factor[keep]
        own = replace(rest, **{k: v[..., keep] for k, v in vars(rest).items()})
        more = misfits(right, t, x[keep], tuple(labels[j] for j in keep) if labels else labels,
                       own, unsure[keep], found)  # fmt: skip
        apart.order[keep], apart.out[keep] = keep[more.order], more.out
        apart.factor[keep] *= more.factor
        return apart
    starts = list(range(0, max(nx - TOGETHER, 0) + 1, TOGETHER // 2))
    if starts[-1] + TOGETHER < nx:
        starts.append(nx - TOGETHER)
    verdicts: dict[int, list[tuple[str, float]]] = {}
    judged = np.zeros(nx, int)
    for start in starts:
        part = np.arange(start, min(start + TOGETHER, nx))
        for number, verdict in _judge(component[:, part], t, x[part], rest, part).items():
            verdicts.setdefault(int(part[number]), []).append(verdict)
        judged[part] += 1
    agreed = {
        j: v[0]
        for j, v in verdicts.items()
        if len(v) == judged[j]
        and len({kind for kind, _ in v}) == 1
        and not (unsure[j] and v[0][0] in ("mis-scaled", "delayed", "misfit", "dead"))
    }
    for kind in ("reversed", "swapped", "mis-scaled", "delayed", "misfit", "dead"):
        those = {j: size for j, (k, size) in sorted(agreed.items()) if k == kind}
        if those:
            found.append(mend(mended, kind, those, x, labels))
    return mended


def mend(
    mended: Mended, kind: str, those: dict[int, float], x: Float, labels: tuple[str, ...]
) -> Finding:
    """What is done to channels of one kind, with the size that each is off by."""
    which = list(those)
    where = places(x, which, labels)
    listed = ", ".join(f"{size:.3g}" for size in list(those.values())[:6])
    if kind == "reversed":
        mended.factor[which] = -1
        said = f"of reversed polarity, as neighbours say: turned round ({where})"
        return Finding(kind, where, "polarity", CURED, said)
    if kind == "swapped":
        mended.order[which] = [int(other) for other in those.values()]
        said = f"exchanged with each other, as neighbours say: put back ({where})"
        return Finding(kind, where, f"{len(which)} channels", CURED, said)
    if kind == "mis-scaled":
        far = [j for j in which if not _SCALED[0] <= abs(those[j]) <= _SCALED[1]]
        for j in which:
            mended.factor[j] = 1 / those[j]
        mended.out[far] = True
        said = (f"larger by a factor {listed} than neighbours say: "
                f"{'left out' if far else 'divided by it'} ({where})")  # fmt: skip
        return Finding(kind, where, f"by a factor {listed}", TAKEN_OUT if far else CURED, said)
    mended.out[which] = True
    if kind == "delayed":
        word = "earlier" if max(those.values()) < 0 else "later"
        sign = -1 if word == "earlier" else 1
        listed = ", ".join(f"{sign * size:.3g}" for size in list(those.values())[:6])
        said = f"{word} by {listed} s than neighbours say: left out ({where})"
        return Finding(kind, where, f"{word} by {listed} s", TAKEN_OUT, said)
    if kind == "misfit":
        said = f"not what the neighbours on both sides say: left out ({where})"
        return Finding(kind, where, f"{len(which)} of {len(x)}", TAKEN_OUT, said)
    said = f"{len(which)} dead receivers left out ({where})"
    return Finding(kind, where, f"{len(which)} of {len(x)}", TAKEN_OUT, said)


def _judge(
    values: Float, t: Float, x: Float, rest: Rest, part: NDArray[np.int64]
) -> dict[int, tuple[str, float]]:
    """Verdicts on the channels of one group: {number: (kind, size)}."""
    transform = strong_spectrum(values, t, rest, part)
    if transform is None:
        return {}
    U, omega, floor = transform
    fall = fall_off(np.abs(U), x)
    heard = np.median(np.abs(U), axis=0) > np.sqrt(_HEARD) * floor
    dead = np.median(np.abs(U) / fall, axis=0) < _DEAD
    found: dict[int, tuple[str, float]] = {int(j): ("dead", 0.0) for j in np.flatnonzero(dead)}
    known = dead | ~heard
    if (~known).sum() < FEWEST - 1:
        return found
    own = replace(rest, **{k: v[..., part] for k, v in vars(rest).items()})
    v = speed(x, arrivals(values, t, own)[0])
    U, waves = U / fall, along_line(x, _SLOWER * omega[-1] / v if np.isfinite(v) else 0.0)
    if len(x) < _FEW and not known.any() and (pair := _exchanged(U, waves)):
        a, b = pair
        return {a: ("swapped", float(part[b])), b: ("swapped", float(part[a]))}
    seen = unfit(U, known, waves)
    off = seen.off & ~known
    if seen.told is None or not off.any():
        return found
    U, omega, V = U[seen.rows], omega[seen.rows], seen.told
    left = np.abs(U - V) ** 2
    agreed = np.median(left[:, ~seen.off].mean(axis=1) / np.mean(np.abs(V) ** 2, axis=1))
    off &= left.mean(axis=0) > _NOISE * floor**2 * np.mean(fall[seen.rows] ** -2.0, axis=0)
    if not seen.all or agreed > _AGREED:
        return found
    power = np.sum(np.abs(V) ** 2, axis=0)
    factors = np.sum(np.real(np.conj(V) * U), axis=0) / power
    spare = max(int((~seen.off).sum()) - 2, 1)  # but for a level and a slope
    scatter = np.sum(np.log(np.abs(factors[~seen.off])) ** 2) / spare
    by_chance = float(np.sqrt(scatter) * stdtrit(spare, 1 - _CHANCE / len(x) / 2))
    numbers = [int(j) for j in np.flatnonzero(off)]
    for j, i in ((j, i) for j in numbers for i in numbers if i < j):
        other = np.sum(np.abs(U[:, [i, j]] - V[:, [j, i]]) ** 2)
        apart = 2 * np.sum(np.abs(V[:, i] - V[:, j]) ** 2)
        if other < _EXCHANGED * min(power[i] + power[j], apart):
            found |= {i: ("swapped", float(part[j])), j: ("swapped", float(part[i]))}
    for j in (j for j in numbers if j not in found):
        size = float(np.sum(np.abs(U[:, j]) ** 2))
        factor = float(factors[j])
        phase = np.angle(U[:, j] * np.conj(V[:, j]))
        delay = delay_of(phase, omega)
        late = float(np.sum(np.abs(U[:, j] - V[:, j] * np.exp(1j * omega * delay)) ** 2))
        if np.sum(np.abs(U[:, j] - factor * V[:, j]) ** 2) < _ALONE * size:
            least = max(np.log(_AT_END if j in (0, len(x) - 1) else _FACTOR), by_chance)
            if abs(factor + 1) < _TURNED:
                found[j] = "reversed", np.pi
            elif factor < 0 or abs(np.log(factor)) > least:
                found[j] = "mis-scaled", factor
        else:
            plain = float(np.sum(np.abs(U[:, j] - V[:, j]) ** 2))
            alone = late < min(_LATE * size, _ALONE * plain)
            found[j] = ("delayed", delay) if alone else ("misfit", 0.0)
    return found


def _broken(
    component: Float, t: Float, x: Float, rest: Rest
) -> tuple[str, dict[int, float]] | None:
    """The fewer of receivers on both sides of a place that phases jump at, as between two cards or
    cables: reversed, or delayed; each with its size."""
    nx = len(x)
    for start in range(0, max(nx - TOGETHER // 2, 1), TOGETHER // 2):
        part = np.arange(start, min(start + TOGETHER, nx))
        transform = strong_spectrum(component[:, part], t, rest, part)
        if transform is None:
            continue
        U, omega, floor = transform
        heard = np.median(np.abs(U), axis=0) > np.sqrt(_HEARD) * floor
        seen = np.flatnonzero(heard)
        if len(seen) < FEWEST:
            continue
        U, at = U[:, seen], x[part[seen]]
        fall = fall_off(np.abs(U), at)
        U, hiss = U / fall, np.mean((floor[seen] / fall) ** 2, axis=1)
        hiss = hiss / np.mean(np.abs(U) ** 2, axis=1) + 1e-300
        if (found := jump(U, omega, at, hiss)) is None:
            continue
        j, turned, delay = found
        last = int(part[seen[j]]) + 1
        # Which side is late or reversed nothing tells: the fewer are.
        fewer = range(last, nx) if 2 * last >= nx else range(last)
        size = np.pi if turned else delay if 2 * last >= nx else -delay
        return "reversed" if turned else "delayed", dict.fromkeys(fewer, float(size))
    return None


def _exchanged(U: Any, waves: Waves) -> tuple[int, int] | None:
    """Which two of few channels, put in each other's place, leave far less than any other two."""
    good = np.ones(U.shape[1], bool)
    pairs = list(zip(*map(np.ndarray.tolist, np.triu_indices(len(good), 1)), strict=True))
    power = np.mean(np.abs(U) ** 2, axis=1)

    def left(order: list[int]) -> float:
        return float(np.median(waves(U[:, order], good)[1] / power))

    whole = list(range(len(good)))
    tried = []
    for a, b in pairs:
        order = whole.copy()
        order[a], order[b] = b, a
        tried.append(left(order))
    best = min(tried)
    # Two that tie leave one wave, run either way: 1 and 5 exchanged of five, or 2 and 4.
    second = min((one for one in tried if one > _TIE * best), default=best)
    sure = best < _CLEAR * min(second, left(whole)) and best < _CLEAR * _AGREED
    return (
        next(p for p, one in zip(pairs, tried, strict=True) if one < _TIE * best) if sure else None
    )


def strong_spectrum(
    values: Float, t: Float, rest: Rest, part: NDArray[np.int64]
) -> tuple[Any, Float, Float] | None:
    """U at the frequencies that are strong, and the noise's standard deviation in it."""
    n = len(t)
    step = (t[-1] - t[0]) / (n - 1)
    # What goes on at the record's end is faded out.
    damping = 0.0 if rest.mask[-1, part].mean() > 0.5 else _DAMPING
    window = np.exp(-damping * np.arange(n) / n)
    hat = np.conj(np.fft.rfft(values * window[:, None], axis=0))
    power = np.median(np.abs(hat) ** 2, axis=1)
    power[0] = 0
    floor = np.median(power[-max(4, len(power) // 8) :])
    strong = np.flatnonzero(power > max(_STRONG * power.max(initial=0), _ABOVE * floor))
    if len(strong) < 3:
        return None
    chosen = strong[np.unique(np.linspace(0, len(strong) - 1, _FREQUENCIES).astype(int))]
    omega = 2 * np.pi * chosen / (n * step)
    noise = np.nan_to_num(rest.noise[part]) * np.sqrt(np.sum(window**2))
    return hat[chosen], omega, noise


def fall_off(size: Float, x: Float) -> Float:
    """How amplitudes fall off along the line, by least absolute differences, shape (n, nx).

    ln A = a + b x + c ln r of all frequencies together, r from before the line or from behind it,
    and a slope of each frequency's own, the median of those between two receivers.
    """
    y = 0.5 * np.log(np.mean(size**2, axis=0) + 1e-300)
    at = x - x.mean()
    plain = np.stack([np.ones(len(x)), at / np.ptp(x)], axis=1)
    fit, least, _ = _absolute(plain, y)
    for r in (x - x[0], x[-1] - x) if len(x) >= _FEWEST_SPREAD else ():
        for before in _BEFORE:
            spread = np.log(r + before * np.median(np.diff(x)))
            tried, left, c = _absolute(np.c_[plain, spread], y)
            if _SPREADS < c < 0 and left < least:
                fit, least = tried, left
    i, j = np.triu_indices(len(x), 1)
    own = np.log(size + 1e-300) - fit
    slope = np.median((own[:, j] - own[:, i]) / (x[j] - x[i]), axis=1)
    return np.asarray(np.exp(fit + slope[:, None] * at))


def _absolute(columns: Float, y: Float) -> tuple[Float, float, float]:
    """Least Σ|y − columns·c|: the fit, that sum, and the last of c."""
    weight = np.ones(len(y))
    for _ in range(12):
        c = np.linalg.lstsq(columns * weight[:, None], y * weight, rcond=None)[0]
        left = np.abs(y - columns @ c)
        weight = 1 / np.sqrt(np.maximum(left, 1e-3))
    return columns @ c, float(left.sum()), float(c[-1])
