"""Synthetic records with known truth, exact to rounding, and spoilt as a laboratory spoils them.

On a ring of length X, driven at x_s by a Ricker pulse s(t), a relation with branches ω_b(k) gives

    u(x, t) = (1/X) Σ_m Σ_b W_b(k_m) e^{−(k_m w)²/2} cos(k_m(x − x_s)) q(t; ω_b(k_m)),

    k_m = 2πm/X, all m,

where w is the source's width and q an oscillator driven from rest, in closed form. A ring so long
that no wave comes round it is an unbounded medium. The oscillator:

    q̈ + 2γq̇ + (ω² + γ²) q = s(t),    s = (1 − 2u²) e^{−u²},  u = c(t − t₀),  c = π f_p

    q(t) = Im I(t) / ω,    I = ∫_{−∞}^t e^{iΩ(t−τ)} s(τ) dτ,    Ω = ω + iγ

With s = −G″/2c², G = e^{−u²}, two integrations by parts leave the integral of a Gaussian, which
is the Faddeeva function w(z) = e^{−z²} erfc(−iz) (Abramowitz & Stegun 7.1.3): no quadrature, and
exact to rounding at every time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import wofz

from wavesim.records.record import Record, RecordError, record
from wavesim.records.relations import Given, Relation

Float = NDArray[Any]


def driven(omega: Float, t: Float, peak_frequency: float, delay: float) -> Float:
    """q of the driven oscillator.

    Args:
        omega: ω, shape (m,), ≥ 0, rad/s; complex ω − iγ for one that decays as e^{−γt}. A free
            mass, ω = 0, goes as −G/2c².
        t: times, shape (nt,), s.
        peak_frequency: f_p of the pulse, Hz.
        delay: t₀, time of the pulse's peak, s.

    Returns:
        Shape (nt, m), s².
    """
    turned = np.conj(np.asarray(omega, complex))
    c = np.pi * peak_frequency
    # Without a frequency but with decay q is the limit ω → 0.
    turned = np.where((turned.real == 0) & (turned != 0), turned + 1e-5 * c, turned)
    tau = (np.asarray(t, float) - delay)[:, None]
    after = tau > 0
    gauss = np.exp(-((c * tau) ** 2))
    # erfc(z) for z = −(cτ + iΩ/2c): where Re z < 0 as 2 − erfc(−z).
    tail = np.zeros((len(tau), len(turned)), complex)
    near = gauss[:, 0] > 0
    z = np.where(after, 1, -1)[near] * (c * tau[near] + 0.5j * turned / c)
    tail[near] = gauss[near] * wofz(1j * z)
    whole = 2 * np.exp(np.where(after, 1j * turned * tau, 0) - turned**2 / (4 * c**2))
    integral = np.sqrt(np.pi) / (2 * c) * np.where(after, whole - tail, tail)
    slope = -2 * c**2 * tau * gauss
    response = -(slope + 1j * turned * gauss - turned**2 * integral) / (2 * c**2)
    free = turned == 0
    return np.where(free, -gauss / (2 * c**2), response.imag / np.where(free, 1, turned.real))


# The pulse is below 1e-15 of its peak from this many 1/f_p after it.
_HALF_DURATION = 2.0
# exp(−(kw)²/2) is below 1e-16 from kw of this on.
_WIDTHS = 8.6
# Wavenumbers of a record at most.
_MOST = 1_000_000


@dataclass(frozen=True)
class Pulse:
    """A Ricker pulse at a point.

    Args:
        peak_frequency: f_p, Hz.
        position: x_s, m.
        delay: time of its peak, s; 2/f_p where None.
        amplitude: strength, a force per mass times a length, m²/s² where u is in m.
        width: standard deviation of a Gaussian in x, m; 0 is a point, cut at the highest k.
    """

    peak_frequency: float
    position: float = 0.0
    delay: float | None = None
    amplitude: float = 1.0
    width: float = 0.0

    @property
    def peak_time(self) -> float:
        """Time of the peak, s."""
        return _HALF_DURATION / self.peak_frequency if self.delay is None else self.delay

    @property
    def end(self) -> float:
        """Time from which on it is over, s."""
        return self.peak_time + _HALF_DURATION / self.peak_frequency


@dataclass(frozen=True)
class Spoil:
    """What a laboratory does to a record.

    Args:
        noise: standard deviation of white noise over the record's largest value, –.
        jitter: standard deviation of the times at which samples were really taken, s.
        misplacement: standard deviation of where receivers really stand, m.
        dead: number of receivers that give nothing.
        bits: resolution of the digitiser over ± the largest value; 0 is unlimited.
        seed: of the random numbers.
    """

    noise: float = 0.0
    jitter: float = 0.0
    misplacement: float = 0.0
    dead: int = 0
    bits: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("noise", "jitter", "misplacement", "dead", "bits"):
            if not getattr(self, name) >= 0:
                raise RecordError(f"{name} = {getattr(self, name)}: must be 0 or greater")


def synthesize(
    relation: Relation | Callable[[Float], Any],
    t: ArrayLike,
    x: ArrayLike,
    pulse: Pulse,
    length: float,
    k_max: float | None = None,
    spoil: Spoil | None = None,
    ring: bool = False,
    lattice: bool = False,
) -> Record:
    """A record with known truth.

    Args:
        relation: the waves; a function ω(k), rad/m to rad/s, arrays (n,) to (n,) or (n, branches),
            complex ω − iγ where they decay; or one of ``wavesim.records.relations``.
        t: times, shape (nt,), s.
        x: receivers, shape (nx,), m.
        pulse: what drives them.
        length: X, of the ring, m.
        k_max: highest wavenumber in it, rad/m; where None, that at which a wide source has fallen
            to 1e-16, and for a point the receivers' Nyquist wavenumber: right for a lattice, while
            in a continuum a point so cut off is no longer one.
        spoil: what is done to it; nothing where None.
        ring: whether the receivers go evenly round the whole ring.
        lattice: whether they are all the sites of a lattice.

    Returns:
        The record; its answer holds k (n,), omega (n, branches), weights (n, branches), the clean
        values and what was done to it.

    Raises:
        RecordError: a value can't be used.
    """
    waves: Relation = Given(relation) if callable(relation) else relation
    t, x = np.array(t, float), np.array(x, float)
    spoil = spoil or Spoil()
    rng = np.random.default_rng(spoil.seed)
    nyquist = np.pi / float(np.median(np.diff(np.sort(x))))
    if k_max is None:
        k_max = _WIDTHS / pulse.width if pulse.width > 0 else nyquist
    count = float(np.floor(k_max * length / (2 * np.pi) * (1 + 1e-12)))
    if not 1 <= count <= _MOST:
        raise RecordError(
            f"length = {length:g} m: holds {count:g} wavenumbers up to k_max = {k_max:g} rad/m; "
            f"must be 1 to {_MOST:g}: take another length or k_max"
        )
    k = 2 * np.pi * np.arange(int(count) + 1) / length
    omega, weights = waves.omega(k), waves.weights(k)
    # k and −k are the same wave at 0 and, on a lattice, at its Nyquist wavenumber.
    at_edge = np.isclose(k, nyquist, rtol=1e-9) & (lattice or ring)
    halved = np.where((k == 0) | at_edge, 0.5, 1.0)[:, None]
    clean = _sum(k, omega, halved * weights, t, x, pulse, length)
    true_t = t + spoil.jitter * rng.normal(size=len(t))
    true_x = x + spoil.misplacement * rng.normal(size=len(x))
    values = clean
    if spoil.jitter or spoil.misplacement:
        values = _sum(k, omega, halved * weights, true_t, true_x, pulse, length)
    values = _digitised(values, spoil, rng)
    dead = np.sort(rng.choice(len(x), min(spoil.dead, len(x)), replace=False))
    values[:, dead] = 0.0
    answer = {
        "k": k,
        "omega": omega,
        "weights": weights,
        "clean": clean,
        "dead": dead,
        "noise": spoil.noise * np.abs(clean).max(),
    }
    return record(
        values,
        t,
        x,
        ring=ring,
        quiet_from=pulse.end,
        sources=(pulse.position,),
        answer=answer,
        lattice=lattice,
        trusted=True,
    )


def _sum(
    k: Float, omega: Float, weights: Float, t: Float, x: Float, pulse: Pulse, length: float
) -> Float:
    shape = np.cos(np.multiply.outer(k, x - pulse.position)) * (2 * pulse.amplitude / length)
    shape *= np.exp(-((k * pulse.width) ** 2) / 2)[:, None]
    total = np.zeros((len(t), len(x)))
    # Waves far above the pulse's spectrum count too: they follow it, as s/ω².
    for branch in range(omega.shape[1]):
        for part in np.array_split(np.arange(len(k)), max(1, len(k) * len(t) // 2_000_000)):
            q = driven(omega[part, branch], t, pulse.peak_frequency, pulse.peak_time)
            total += (q * weights[part, branch]) @ shape[part]
    return total


def _digitised(values: Float, spoil: Spoil, rng: np.random.Generator) -> Float:
    peak = np.abs(values).max()
    values = values + spoil.noise * peak * rng.normal(size=values.shape)
    if spoil.bits:
        step = 2 * np.abs(values).max() / 2**spoil.bits
        values = step * np.round(values / step)
    return values


def positions(count: int, spacing: float, first: float = 0.0) -> Float:
    """Evenly spaced receivers: first, first + spacing, …; shape (count,), m."""
    return first + spacing * np.arange(count)
