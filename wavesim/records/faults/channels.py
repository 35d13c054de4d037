"""Channels that do not fit the others: dead, reversed, swapped, delayed, mis-scaled.

At each frequency one travelling wave U_j = A e^{ikx_j} is laid through some neighbours: k by the
phases alone (the beam |Σ e^{−ikx_j} U_j/|U_j||, which one bad channel does not turn), the decay by
the median of slopes of ln|U_j|. What a channel is off by at all frequencies alike is its own: a
phase π, a phase ωτ, a factor. Where the others do not agree on a wave, nothing is said of any.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.finding import CURED, TAKEN_OUT, Finding, places
from wavesim.records.faults.quiet import Rest

Float = NDArray[Any]
Mask = NDArray[np.bool_]

FEWEST = 5
_TOGETHER = 24
_FREQUENCIES = 24
_DAMPING = 8.0
# Beam of the phases from which on there is one wave to hold channels against.
_COHERENT = 0.62
# Off by this many deviations of the others, and by so much: ln of a factor, rad.
_DEVIATIONS = 8.0
_FACTOR, _PHASE = 0.04, 0.06
# A gain is one at all frequencies: it stands out of its own changes by this factor. What two waves
# make of a channel changes from one to the next.
_STEADY = 3.0
_STANDS_OUT = 5.0
_MOST = 0.3
# A factor between these is divided out; beyond, too little is left of the channel.
_SCALED = (0.2, 5.0)
_DEAD = 0.05


@dataclass
class _Off:
    """How far each of some channels is off.

    Attributes:
        turned, odd: of opposite phase throughout; of phases that do not fit.
        unfit: mean of |phase|, rad.
        delay, factor: τ, s, and ln of a factor, with the deviations that the others have.
        unsteady: deviation of ln of the factor over the frequencies.
        coherent: beam of the phases.
        omega: median frequency, rad/s.
    """

    turned: Mask
    odd: Mask
    unfit: Float
    delay: Float
    factor: Float
    unsteady: Float
    coherent: float
    spread_delay: float
    spread_factor: float
    omega: float


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
    starts = list(range(0, max(nx - _TOGETHER, 0) + 1, _TOGETHER // 2))
    if starts[-1] + _TOGETHER < nx:
        starts.append(nx - _TOGETHER)
    verdicts: dict[int, list[tuple[str, float]]] = {}
    judged = np.zeros(nx, int)
    for start in starts:
        part = np.arange(start, min(start + _TOGETHER, nx))
        for number, verdict in _judge(component[:, part], t, x[part], rest, part).items():
            verdicts.setdefault(int(part[number]), []).append(verdict)
        judged[part] += 1
    agreed = {
        j: v[0]
        for j, v in verdicts.items()
        if len(v) == judged[j]
        and len({kind for kind, _ in v}) == 1
        and not (unsure[j] and v[0][0] in ("mis-scaled", "delayed", "dead"))
    }
    for kind in ("reversed", "swapped", "mis-scaled", "delayed", "dead"):
        those = {j: size for j, (k, size) in sorted(agreed.items()) if k == kind}
        if those:
            found.append(_mend(mended, kind, those, x, labels))
    return mended


def _mend(
    mended: Mended, kind: str, those: dict[int, float], x: Float, labels: tuple[str, ...]
) -> Finding:
    which = list(those)
    where = places(x, which, labels)
    listed = ", ".join(f"{size:.3g}" for size in list(those.values())[:6])
    if kind == "reversed":
        mended.factor[which] = -1
        said = f"of reversed polarity, as neighbours say: turned round ({where})"
        return Finding(kind, where, "polarity", CURED, said)
    if kind == "swapped":
        mended.order[which] = which[::-1]
        said = f"exchanged with each other, as neighbours say: put back ({where})"
        return Finding(kind, where, f"{len(which)} channels", CURED, said)
    if kind == "mis-scaled":
        far = [j for j in which if not _SCALED[0] <= those[j] <= _SCALED[1]]
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
    said = f"{len(which)} dead receivers left out ({where})"
    return Finding(kind, where, f"{len(which)} of {len(x)}", TAKEN_OUT, said)


def _judge(
    values: Float, t: Float, x: Float, rest: Rest, part: NDArray[np.int64]
) -> dict[int, tuple[str, float]]:
    """Verdicts on the channels of one group: {number: (kind, size)}."""
    transform = _transform(values, t, rest.noise[part])
    if transform is None:
        return {}
    U, omega, floor = transform
    off = _off(U, omega, x, floor)
    if off is None:
        return {}
    nx = values.shape[1]
    most = max(1, int(_MOST * nx))
    found: dict[int, tuple[str, float]] = {}
    if 0 < off.turned.sum() <= most:
        found |= {int(j): ("reversed", np.pi) for j in np.flatnonzero(off.turned)}
    late = ~off.turned & (
        np.abs(off.delay) > np.maximum(_DEVIATIONS * off.spread_delay, _PHASE / off.omega)
    )
    late &= _alone(np.abs(off.delay), late)
    late |= off.odd & _alone(off.unfit, off.odd)
    wrong = ~off.turned & (
        np.abs(off.factor) > np.maximum(_DEVIATIONS * off.spread_factor, _FACTOR)
    )
    wrong &= np.abs(off.factor) > _STEADY * off.unsteady
    wrong &= _alone(np.abs(off.factor), wrong)
    dead = wrong & (off.factor < np.log(_DEAD))
    if late.any() and not dead.any() and (pair := _exchanged(U, omega, x, floor, off)):
        return found | dict.fromkeys(pair, ("swapped", 0.0))
    if 0 < dead.sum() <= most:
        found |= {int(j): ("dead", 0.0) for j in np.flatnonzero(dead)}
    late &= ~dead
    if 0 < late.sum() <= most:
        found |= {int(j): ("delayed", float(off.delay[j])) for j in np.flatnonzero(late)}
    wrong &= ~dead & ~late
    if 0 < wrong.sum() <= most:
        found |= {
            int(j): ("mis-scaled", float(np.exp(off.factor[j]))) for j in np.flatnonzero(wrong)
        }
    return found


def _exchanged(U: Any, omega: Float, x: Float, floor: Float, off: _Off) -> tuple[int, int] | None:
    """Which two channels, put in each other's place, leave none that does not fit."""
    unit = (U / np.maximum(np.abs(U), 1e-300)) ** 2
    steer = np.exp(-2j * np.outer(_wavenumbers(x), x - x.mean())).T
    beam = unit @ steer
    best = 0.0, (0, 0)
    for a, b in zip(*np.triu_indices(len(x), 1), strict=True):
        other = beam + np.outer(unit[:, b] - unit[:, a], steer[a] - steer[b])
        coherent = float(np.median(np.abs(other).max(axis=1)))
        best = max(best, (coherent, (int(a), int(b))))
    exchanged = U.copy()
    exchanged[:, best[1]] = U[:, best[1][::-1]]
    again = _off(exchanged, omega, x, floor)
    if again is None or again.coherent <= off.coherent or (again.odd | again.turned).any():
        return None
    near = np.maximum(_DEVIATIONS * again.spread_delay, _PHASE / again.omega)
    return best[1] if (np.abs(again.delay) < near).all() else None


def _alone(size: Float, candidate: Mask) -> Mask:
    """Which candidates stand out from their neighbours: what waves do goes on from one to the next.

    Args:
        size: how far each is off, shape (n,).
        candidate: which are meant.
    """
    others = np.flatnonzero(~candidate)
    result = np.zeros(len(size), bool)
    for j in np.flatnonzero(candidate):
        near = others[np.argsort(np.abs(others - j), kind="stable")[:3]]
        result[j] = len(near) > 0 and size[j] > _STANDS_OUT * size[near].max()
    return result


def _transform(values: Float, t: Float, noise: Float) -> tuple[Any, Float, Float] | None:
    """U at the frequencies that are strong, and the noise's standard deviation in it."""
    n = len(t)
    step = (t[-1] - t[0]) / (n - 1)
    window = np.exp(-_DAMPING * np.arange(n) / n)
    hat = np.conj(np.fft.rfft(values * window[:, None], axis=0))
    power = np.median(np.abs(hat) ** 2, axis=1)
    power[0] = 0
    strong = np.flatnonzero(power > 0.05 * power.max(initial=0))
    if len(strong) < 3 or not power.max(initial=0) > 0:
        return None
    chosen = strong[np.unique(np.linspace(0, len(strong) - 1, _FREQUENCIES).astype(int))]
    omega = 2 * np.pi * chosen / (n * step)
    floor = np.nan_to_num(noise) * np.sqrt(np.sum(window**2))
    return hat[chosen], omega, floor


def _off(U: Any, omega: Float, x: Float, floor: Float) -> _Off | None:
    count, nx = U.shape
    size = np.maximum(np.abs(U), 1e-300)
    unit = U / size
    k = _wavenumbers(x)
    steer = np.exp(-1j * np.outer(k, x - x.mean()))
    # Of squared phasors, which polarity does not turn; by it alone k is open to π/spacing, and
    # taken so that most phasors agree, and small.
    beam = np.abs(unit**2 @ (steer**2).T) / nx
    best = np.argmax(beam + 0.2 * np.abs(unit @ steer.T) / nx - 0.01 * np.abs(k) / k[-1], axis=1)
    coherent = float(np.median(beam[np.arange(count), best]))
    if coherent < _COHERENT * (1 - 2 / nx):
        return None
    phase = np.empty((count, nx))
    factor = np.empty((count, nx))
    for i in range(count):
        phase[i] = _phases(unit[i], x, k[best[i]])
        factor[i] = _line_left(x, np.log(size[i]))
    heard = size > 10 * floor
    # Where half the frequencies of a channel are noise its phase says nothing, its size still does.
    clear = heard.mean(axis=0) > 0.5
    turned = clear & (np.mean(np.cos(phase) < -0.6, axis=0) > 0.8)
    fitting = np.mean(np.cos(phase) > 0.7, axis=0) > 0.6
    if (fitting | turned).sum() < 0.6 * nx:
        return None
    good = fitting & ~turned
    delay = np.where(clear, _delays(phase, omega), 0.0)
    middle = np.median(factor, axis=0)
    unsteady = 1.4826 * np.median(np.abs(factor - middle), axis=0)

    def spread(values: Float) -> float:
        return float(1.4826 * np.median(np.abs(values[good] - np.median(values[good]))))

    return _Off(
        turned,
        clear & ~fitting & ~turned,
        np.abs(phase).mean(axis=0),
        delay - np.median(delay[good]),
        middle - np.median(middle[good]),
        unsteady,
        coherent,
        spread(delay),
        spread(middle),
        float(np.median(omega)),
    )


def _wavenumbers(x: Float) -> Float:
    """Wavenumbers that receivers tell apart, ±π/d, rad/m."""
    return np.linspace(-1, 1, 16 * len(x) + 1) * np.pi / float(np.median(np.diff(x)))


def _delays(phase: Float, omega: Float) -> Float:
    """τ of each channel whose ωτ fits its phases best, whole turns left open; shape (nx,), s."""
    step = 0.25 / omega.max()
    reach = np.pi / max(float(np.median(np.diff(omega))), 1e-300)
    tau = np.arange(-min(200.0, np.floor(reach / step)), min(200.0, np.floor(reach / step)) + 1)
    tau = tau * step
    match = np.exp(1j * phase).T @ np.exp(-1j * np.outer(omega, tau))
    worth = match.real + 1e-3 * np.abs(match) - 1e-3 * len(omega) * np.abs(tau) / tau[-1]
    found = tau[np.argmax(worth, axis=1)]
    left = np.angle(np.exp(1j * (phase - omega[:, None] * found)))
    return np.asarray(found + (omega[:, None] * left).sum(axis=0) / np.sum(omega**2))


def _phases(unit: Any, x: Float, k: float) -> Float:
    """Phases left by the wave that most channels agree on, k refined by those within a radian."""
    at = x - x.mean()
    mean = 0.0
    for _ in range(4):
        left = np.angle(unit * np.exp(-1j * (k * at + mean)))
        if mean == 0.0:
            mean = float(np.angle(np.sum(np.exp(1j * left))))
            left = np.angle(unit * np.exp(-1j * (k * at + mean)))
        near = np.abs(left) < 1.0
        if near.sum() < 3:
            break
        slope, level = np.polyfit(at[near], left[near], 1)
        k, mean = k + float(slope), mean + float(level)
    return np.asarray(np.angle(unit * np.exp(-1j * (k * at + mean))))


def _line_left(x: Float, y: Float) -> Float:
    """What the line through the median of slopes leaves over."""
    i, j = np.triu_indices(len(x), 1)
    slope = float(np.median((y[j] - y[i]) / (x[j] - x[i])))
    left = y - slope * x
    return np.asarray(left - np.median(left))
