"""Receivers round a ring that do not fit the waves that all others show, and in what way.

At each frequency the field round a ring is a few waves e^{ikx} of the wavenumbers 2πm/X. Receivers
of gain 1 + ε_j, misplaced by δ_j and late by τ_j change it, and each wave shows at all others: what
is left without the few strong ones,

    (1 − P) U = (1 − P) (V ε + V′ δ + iωV τ) + noise,    V = P U,

P the projector on those, tells ε, δ and τ by least squares over all frequencies: one for all, which
noise has not. What stands out of its errors is put right; what is left shows each wave at all other
wavenumbers. A receiver that none of them brings into line is odd, and the others are read without
it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np
from numpy.fft import fft, ifft
from numpy.typing import NDArray

from wavesim.records.content import RecordError
from wavesim.records.faults.channels import Mended, mend
from wavesim.records.faults.finding import CURED, TAKEN_OUT, Finding, places
from wavesim.records.faults.moveout import jump
from wavesim.records.faults.ring_waves import (
    FEWEST_FREQUENCIES,
    RingWaves,
    ring_waves,
    strong_frequencies,
)
from wavesim.records.faults.unfit_receivers import PART, round_ring, unfit

Float = NDArray[Any]
Mask = NDArray[np.bool_]

FEWEST = 16
_FRAMES = 64
# Windowed, neighbouring frequencies hang together: so many count as one.
_TOGETHER = 2.0
# Gains are unequal where their χ² is above its mean by so many of its deviations.
_SURE = 6.0
# They are believed where no more than this part is left then of what is no wave.
_LESS = 0.8
_ROUNDS, _STEPS = 12, 60
# Before anything is known receivers may be off by so much, and no receiver by so many spacings.
_WIDEST, _FARTHEST = 0.3, 0.3
# What is put right is off by this part of what was taken from it still, or of what was added.
_OF_MENDED = 1e-3
# What is left above so many times the noise is the receivers' own.
_NOISY = 2.0
# Sides are told by so many frequencies, of so many receivers.
_OF_SIDES, _MOST_OF_SIDES = 15, 256
# A gain that is −1 to within this is a polarity.
_TURNED = 0.01


@dataclass(frozen=True)
class Gains:
    """How receivers differ from each other.

    Attributes:
        gain: what each shows of the field, shape (nx,), –; 1 where nothing stands out.
        place: how far each stands off its place, over the spacing, shape (nx,), –; 0 likewise.
        late: how late its clock is, in frames, shape (nx,); 0 likewise.
        odd: receivers that none of these brings into line, shape (nx,).
        alone: receivers that stand out by their gain alone, shape (nx,).
        left: variance of what is still off, over the field's, over nx, –; 0 where none
            stands out.
    """

    gain: Float
    place: Float
    late: Float
    odd: Mask
    alone: Mask
    left: float = 0.0

    @property
    def any(self) -> bool:
        """Whether anything is to be put right."""
        return bool((self.gain != 1).any() or self.place.any() or self.late.any())

    def put_right(self, component: Float) -> Float:
        """The field as equal receivers would have it, shape (nt, nx); odd ones as they are."""
        u = component / np.where(self.odd | (self.gain <= 0), 1.0, self.gain)
        if self.late.any():
            from scipy.interpolate import CubicSpline  # slow to import, and only a fault needs it

            frames = np.arange(len(u), dtype=float)
            u = np.stack([CubicSpline(frames, v)(frames + tau) for v, tau in
                          zip(u.T, self.late, strict=True)], axis=1)  # fmt: skip
        return np.asarray(_at_places(u, self.place).real)


def gains(component: Float, known: Mask | None = None) -> Gains:
    """What the receivers of one component are off by.

    Args:
        component: u, shape (nt, nx), finite, while no source acts; receivers evenly round a ring.
        known: receivers that are known to be odd, shape (nx,).
    """
    nx = component.shape[1]
    nil, none = np.zeros(nx), np.zeros(nx, bool)
    known = none if known is None else known
    equal = Gains(nil + 1, nil, nil, known, none)
    if len(component) < _FRAMES:
        return equal
    U, omega, noise = strong_frequencies(component)
    if len(U) < FEWEST_FREQUENCIES:
        return equal
    unlike = unfit(U, known)
    alone = np.isfinite(unlike.factor)
    off, odd = np.zeros((3, nx)), unlike.off & ~alone
    off[0, alone] = unlike.factor[alone] - 1
    if nx < FEWEST or not unlike.all:
        # They are too few to say in what way they differ.
        uneven = unlike.left > _NOISY * noise
        left = (unlike.left - noise) / unlike.power / nx if uneven else 0.0
        return Gains(1 + off[0], off[1], off[2], odd, alone, left)
    spread = np.full(3, _WIDEST)
    now = ring_waves(_righted(U, omega, off), odd)
    if now is None:
        return Gains(1 + off[0], off[1], off[2], odd, alone)
    kinds: list[int] = []
    for _ in range(_ROUNDS):
        sure = _sure(now, omega, odd)
        # Of what has not been looked at, the surest.
        more = [int(n) for n in np.argsort(-sure) if sure[n] > 0 and n not in kinds][:1]
        for tried_kinds in ([kinds] if kinds else []) + ([kinds + more] if more else []):
            step = _solved(now, omega, off, odd, spread, tried_kinds)
            tried = off + step
            tried[0] = (1 + off[0]) * (1 + step[0]) - 1
            tried[:, ~odd] -= tried[:, ~odd].mean(axis=1, keepdims=True)
            after = ring_waves(_righted(U, omega, tried), odd)
            if after is not None and _less_left(now, after):
                break
        else:
            break
        kinds, off, now = tried_kinds, tried, after
        spread[kinds] = np.maximum(np.sqrt(np.mean(off[kinds][:, ~odd] ** 2, axis=1)), 1e-6)
    good, right = ~odd, _righted(U, omega, off)
    mended = np.mean(np.abs(right - U)[:, good] ** 2) / np.mean(np.abs(U[:, good]) ** 2)
    left = _OF_MENDED**2 * float(mended) / nx
    return Gains(1 + off[0], off[1], off[2], odd, alone, left)


def _righted(U: Any, omega: Float, off: Float) -> Any:
    """U at some frequencies, of receivers that are off by so much, as equal ones would have it."""
    return _at_places(U / (1 + off[0]) * np.exp(1j * omega[:, None] * off[2]), off[1])


def _at_places(U: Any, place: Float) -> Any:
    """The field at even places where it was seen at others, by its Taylor series about them."""
    if not place.any():
        return U
    k = 2j * np.pi * np.fft.fftfreq(U.shape[1])
    k[U.shape[1] // 2] *= U.shape[1] % 2
    V = U
    for _ in range(3):
        hat = fft(V, axis=1)
        V = U - sum(place**n / factorial(n) * ifft(k**n * hat, axis=1) for n in (1, 2, 3))
    return V


def _bases(now: RingWaves, omega: Float) -> tuple[Any, Any, Any]:
    """V, V′ per spacing, and −iωV per frame: what a unit of gain, place and lateness adds."""
    n = now.V.shape[1]
    k = 2j * np.pi * np.fft.fftfreq(n)
    slope = ifft(k * np.where(now.kept, fft(now.V, axis=1), 0), axis=1)
    return now.V, slope, -1j * omega[now.rows, None] * now.V


def _less_left(before: RingWaves, after: RingWaves) -> bool:
    """Whether clearly less is left beside the waves, at the frequencies that both tell of."""
    both = np.isin(before.rows, after.rows), np.isin(after.rows, before.rows)
    fall = before.weight[both[0], 0] / after.weight[both[1], 0]
    return len(fall) >= FEWEST_FREQUENCIES and float(np.median(fall)) < _LESS


def ring_misfits(
    values: Float, known: Mask, x: Float, labels: tuple[str, ...], found: list[Finding]
) -> tuple[Mended, Mask]:
    """Channels to turn or rescale, and those that no factor puts right, shape (nx,).

    Args:
        values: shape (C, nt, nx), finite, while no source acts.
        known: receivers that are known to be bad, shape (nx,).
        x, labels: positions and names of the receivers.
        found: findings, added to.
    """
    nx = values.shape[2]
    mended = Mended(np.arange(nx), np.ones(nx), np.zeros(nx, bool))
    if not known.any() and (side := _reversed_side(values, x, labels)) is not None:
        found.append(mend(mended, "reversed", dict.fromkeys(side, np.pi), x, labels))
        values = values * mended.factor
    seen = [gains(component, known) for component in values]
    odd = np.logical_or.reduce([known, *(one.odd for one in seen)])
    turned = np.logical_or.reduce([one.gain < 0 for one in seen]) & ~odd
    scaled = np.logical_or.reduce([one.alone for one in seen]) & ~turned & ~odd
    gain = seen[0].gain
    if len(values) > 1:
        odd, turned, scaled = odd | turned | scaled, turned & False, scaled & False
    before = mended.factor.copy()
    mended.factor[turned] *= -1
    scaled |= turned & (np.abs(gain + 1) > _TURNED)
    # Of many the others say more exactly what it shows than its factor does.
    if nx >= FEWEST and (odd | scaled).mean() <= PART:
        odd = odd | scaled
    else:
        mended.factor[scaled] = before[scaled] / gain[scaled]
    if turned.any():
        where = places(x, turned, labels)
        said = f"of reversed polarity, as the ring's waves say: turned round ({where})"
        found.append(Finding("reversed", where, "polarity", CURED, said))
    if scaled.any():
        where = places(x, scaled, labels)
        listed = ", ".join(f"{size:.3g}" for size in gain[scaled][:6])
        done = "read from the others" if (odd & scaled).any() else "divided by it"
        said = f"larger by a factor {listed} than the ring's waves say: {done} ({where})"
        found.append(Finding("mis-scaled", where, f"by a factor {listed}", CURED, said))
    new = odd & ~known & ~scaled
    if new.any():
        where = places(x, new, labels)
        said = (
            "dead, exchanged, delayed or of another field: they do not fit the waves that all "
            f"others show, and are read from these ({where})"
        )
        found.append(Finding("misfit", where, f"{int(new.sum())} of {nx}", TAKEN_OUT, said))
    return mended, odd


def _reversed_side(values: Float, x: Float, labels: tuple[str, ...]) -> range | None:
    """The fewer of receivers on two sides of a ring that are of opposite polarity, as two cards.

    Raises:
        RecordError: one side is late: too many receivers to read them from the others.
    """
    strongest = int(np.argmax(np.abs(values).max(axis=(1, 2))))
    U, omega, noise = strong_frequencies(values[strongest])
    if len(U) < FEWEST_FREQUENCIES or len(x) > _MOST_OF_SIDES:
        return None
    some = np.unique(np.linspace(0, len(U) - 1, _OF_SIDES).astype(int))
    U, omega = U[some], omega[some]
    part = noise / np.maximum(np.mean(np.abs(U) ** 2, axis=1), 1e-300) + 1e-300
    seen = jump(U, omega, x, part, round_ring)
    if seen is None:
        return None
    first, reversed_, late = seen[0] + 1, *seen[1:]
    if not reversed_:
        where = places(x, [first], labels)
        raise RecordError(
            f"the ring's receivers from {where} on are {abs(late):.3g} frames "
            f"{'later' if late < 0 else 'earlier'} than those before, as of another card or cable: "
            "put their times right"
        )
    return range(first, len(x)) if 2 * first >= len(x) else range(first)


def _sure(now: RingWaves, omega: Float, odd: Mask) -> Float:
    """How far χ² of gains, places and clocks is above what chance makes of it, shape (3,)."""
    bases = np.where(odd, 0, np.stack(_bases(now, omega)))
    weight = now.weight / _TOGETHER
    pull = np.sum(weight * np.real(np.conj(bases) * now.R), axis=1)
    size = np.sum(weight * (1 - now.own)[:, None] * np.abs(bases) ** 2, axis=1)
    known = ~odd & (size > 1e-12 * size.max(axis=1, keepdims=True))
    # Var of the pull is half of it: only the real part counts.
    ratio = np.where(known, 2 * pull**2 / np.maximum(size, 1e-300), 0)
    chi = ratio.sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    return np.asarray(chi - 1 - _SURE * np.sqrt(2 / (~odd).sum()))


def _solved(
    now: RingWaves, omega: Float, off: Float, odd: Mask, spread: Float, kinds: list[int]
) -> Float:
    """ε, δ, τ by conjugate gradients, those of the kinds asked for, shape (3, nx)."""
    bases = np.where(odd, 0, np.stack(_bases(now, omega)))
    asked = np.isin(np.arange(3), kinds)[:, None]
    weight = now.weight / _TOGETHER
    prior = (1 / spread**2)[:, None]

    def pulled(left: Any) -> Float:
        return np.asarray(np.sum(weight * np.real(np.conj(bases) * left), axis=1) * asked)

    def times(e: Float) -> Float:
        moved = np.sum(bases * e[:, None], axis=0)
        moved = moved - ifft(np.where(now.kept, fft(moved, axis=1), 0), axis=1)
        return pulled(moved) + prior * e

    diagonal = np.sum(weight * (1 - now.own)[:, None] * np.abs(bases) ** 2, axis=1)
    scale = 1 / (diagonal + prior)
    r = pulled(now.R) - prior * off * ~odd * asked
    e = np.zeros_like(r)
    z = scale * r
    p, rz = z, float(np.sum(r * z))
    for _ in range(_STEPS):
        if not rz > 1e-20:
            break
        q = times(p)
        a = rz / float(np.sum(p * q))
        e, r = e + a * p, r - a * q
        z = scale * r
        new = float(np.sum(r * z))
        p, rz = z + new / rz * p, new
    bound = np.array([9.0, _FARTHEST, np.pi / 4 / omega.max()])[:, None]
    lowest = np.maximum(-bound, [[-0.9], [-9.0], [-99.0]])
    return np.clip(e, lowest, bound)
