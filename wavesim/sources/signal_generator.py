"""Some cycles of a sine under a window, and a linear sweep, as a signal generator makes them."""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from wavesim.material.arguments import checked
from wavesim.sources.admissible import check_place, check_positive, check_start
from wavesim.sources.source import (
    Extent,
    Source,
    extent_on,
    extent_to,
    namespace,
)

Window = Literal["hann", "cos4", "cos6"]

# sin^p(πτ/T), a cosine sum that has p − 1 continuous derivatives at its ends.
_POWERS: dict[str, int] = {"hann": 2, "cos4": 4, "cos6": 6}
# The side lobes of the windows are below 1e-3 of the peak this many bins from it; so far from its
# last frequency a sweep's spectrum falls, without what its taper adds.
_BINS = 16
# More are taken for a slip of the pen.
_MOST_CYCLES = 1e7


@checked
@dataclass(frozen=True)
class ToneBurst(Source):
    """Some cycles of a sine under a window, s(t) = w(τ) sin(2πfτ), 0 ≤ τ = t − start ≤ T = n/f.

    The window is w = sin^p(πτ/T): "hann" (p = 2) begins with a continuous first derivative,
    "cos4" with three, "cos6" with five; an exact stepper is off by 1e-10 of the field for the
    first, by rounding for the others (measured). Windows of the Blackman–Harris family jump at
    their ends.

    Args:
        field: the field it drives, such as phi1 or u1.
        position: x_s, m.
        frequency: f, Hz.
        cycles: n, –, at least 1, not necessarily whole.
        window: "hann", "cos4" or "cos6".
        amplitude: of the drive, in its unit; see :class:`Source`.
        width: standard deviation of a Gaussian in x, m; 0 is a point.
        start: when it begins, s, ≥ 0.
        drive: "body", or a word of the field's family; see :class:`Source`.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    kind: ClassVar[str] = "tone-burst"

    field: str
    position: float
    frequency: float
    cycles: float = 5.0
    window: Window = "hann"
    amplitude: float = 1.0
    width: float = 0.0
    start: float = 0.0
    drive: str = "body"

    def __post_init__(self) -> None:
        check_place(self)
        check_start(self.start)
        check_positive(self, ("frequency", "Hz"))
        if not 1 <= self.cycles <= _MOST_CYCLES:
            raise ValueError(
                f"cycles = {self.cycles:g}: must be 1 or greater, and at most {_MOST_CYCLES:.0e}"
            )
        if self.window not in _POWERS:
            raise ValueError(f"window = {self.window!r}: must be one of {', '.join(_POWERS)}")

    @property
    def duration(self) -> float:
        """T = n/f, s."""
        return self.cycles / self.frequency

    @property
    def span(self) -> tuple[float, float, float]:
        """When it begins, its middle, and when it is over, s."""
        return self.start, self.start + self.duration / 2, self.start + self.duration

    @functools.cached_property
    def extent(self) -> Extent:
        """Read off its spectrum; a derivative jumps at its ends."""
        return extent_to(self, self.cycles + _BINS, max(self.cycles - 4 * _BINS, 0.0))

    @property
    def peak_frequency(self) -> float:
        """Where its spectrum peaks, Hz: f, or near it for few cycles."""
        return self.extent.peak / (2 * math.pi)

    def signal(self, t: Any) -> Any:
        """amplitude · s(t); see :meth:`Source.signal`."""
        xp = namespace(t)
        tau = t - self.start
        inside = (tau >= 0) & (tau <= self.duration)
        window = xp.sin(math.pi / self.duration * tau) ** _POWERS[self.window]
        tone = xp.sin(2 * math.pi * self.frequency * tau)
        return xp.where(inside, self.amplitude * window * tone, 0.0)

    def spectrum(self, omega: Any) -> Any:
        """Transform in closed form; see :meth:`Source.spectrum`.

        w(τ) = Σ_m c_m e^{2πimτ/T}, c_m = (−1)^m (p over p/2 + m)/2^p, |m| ≤ p/2, so that s is a sum
        of exponentials e^{iντ} on [0, T], and each gives T e^{iz} sin(z)/z, z = (ω + ν)T/2.
        """
        omega = np.asarray(omega)
        power, T = _POWERS[self.window], self.duration
        total = np.zeros(omega.shape, complex)
        for m in range(-power // 2, power // 2 + 1):
            weight = (-1) ** m * math.comb(power, power // 2 + m) / 2**power
            for sign in (1, -1):
                nu = 2 * math.pi * (m / T + sign * self.frequency)
                z = (omega + nu) * T / 2
                total += sign * weight / 2j * T * np.exp(1j * z) * np.sinc(z / np.pi)
        return self.amplitude * total * np.exp(1j * omega * self.start)


# Bins beyond which its extent is read off a fast transform, of so many samples to a bin.
_FEW_BINS, _IMAGES = 400, 8
# Periods of its last frequency that are taken for a slip of the pen.
_MOST_PERIODS = 1e5
# Gauss nodes to a panel, and the phase that a panel may hold, rad.
_NODES, _PHASE = 32, 25.0
# e^{−_GONE} is nothing beside what begins; numbers held at a time.
_GONE, _AT_ONCE = 90.0, 2**18


@checked
@dataclass(frozen=True)
class Chirp(Source):
    """A linear sweep, s(t) = w(τ) sin(2π(f₁τ + (f₂ − f₁)τ²/2T)), 0 ≤ τ = t − start ≤ T.

    w rises from 0 to 1 over the first part of it as x⁴(35 − 84x + 70x² − 20x³), which has three
    continuous derivatives, and falls so over the last.

    Args:
        field: the field it drives, such as phi1 or u1.
        position: x_s, m.
        low, high: f₁ and f₂, first and last frequency, Hz, 0 < f₁ < f₂.
        duration: T, s, at least one period of the lowest frequency.
        taper: part of the duration over which it rises, and falls, –, 0.01 to 0.5.
        amplitude: of the drive, in its unit; see :class:`Source`.
        width: standard deviation of a Gaussian in x, m; 0 is a point.
        start: when it begins, s, ≥ 0.
        drive: "body", or a word of the field's family; see :class:`Source`.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    kind: ClassVar[str] = "chirp"

    field: str
    position: float
    low: float
    high: float
    duration: float
    taper: float = 0.1
    amplitude: float = 1.0
    width: float = 0.0
    start: float = 0.0
    drive: str = "body"

    def __post_init__(self) -> None:
        check_place(self)
        check_start(self.start)
        check_positive(self, ("low", "Hz"), ("high", "Hz"), ("duration", "s"))
        if self.low >= self.high:
            raise ValueError(f"low = {self.low:g} Hz: must be below high = {self.high:g} Hz")
        if self.duration * self.low < 1:
            raise ValueError(
                f"duration = {self.duration:g} s: must be at least a period of low = "
                f"{self.low:g} Hz; take {1 / self.low:.4g} s or more"
            )
        if self.duration * self.high > _MOST_PERIODS:
            raise ValueError(
                f"duration = {self.duration:g} s: must hold at most {_MOST_PERIODS:.0e} periods of "
                f"high = {self.high:g} Hz; take {_MOST_PERIODS / self.high:.3g} s or less"
            )
        if not 0.01 <= self.taper <= 0.5:
            raise ValueError(f"taper = {self.taper:g}: must be between 0.01 and 0.5")

    @property
    def span(self) -> tuple[float, float, float]:
        """When it begins, its middle, and when it is over, s."""
        return self.start, self.start + self.duration / 2, self.start + self.duration

    @functools.cached_property
    def extent(self) -> Extent:
        """Read off its spectrum; its fourth derivative jumps at both ends of each taper."""
        bins = self.high * self.duration + _BINS + 6 / self.taper
        if bins <= _FEW_BINS:
            return extent_to(self, bins)
        # Of a long one by a fast transform: the grid is as fine, and its images are far off.
        count = int(2 ** math.ceil(math.log2(_IMAGES * bins)))
        t = self.start + self.duration / count * np.arange(count)
        size = np.abs(np.fft.rfft(self.signal(t), 4 * count)) * self.duration / count
        kept = math.ceil(4 * bins)
        return extent_on(np.arange(kept) * math.pi / 2 / self.duration, size[:kept])

    @property
    def peak_frequency(self) -> float:
        """The middle of the sweep, Hz."""
        return (self.low + self.high) / 2

    def signal(self, t: Any) -> Any:
        """amplitude · s(t); see :meth:`Source.signal`."""
        xp = namespace(t)
        tau = t - self.start
        # Distance to the nearer end, in lengths of the taper.
        nearer = self.duration / 2 - abs(tau - self.duration / 2)
        x = xp.clip(nearer / (self.taper * self.duration), 0.0, 1.0)
        window = x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3)
        rate = (self.high - self.low) / (2 * self.duration)
        return self.amplitude * window * xp.sin(2 * math.pi * tau * (self.low + rate * tau))

    def spectrum(self, omega: Any) -> Any:
        """Transform by Gauss quadrature on panels, to 1e-12 of its peak; see Source.spectrum.

        Panels of one length share Σ_j v_pj e^{iωhξ_j} but for v, and each has its own e^{iωt_p}.
        """
        flat = np.asarray(omega).reshape(-1)
        highest = np.abs(flat.real).max(initial=0.0) + 2 * math.pi * self.high
        # Beyond this e^{−Im(ω)t} leaves nothing of it.
        damping = float(flat.imag.min(initial=math.inf))
        over = self.start + _GONE / damping if damping > 0 else math.inf
        ramp = self.taper * self.duration
        marks = (0.0, ramp, self.duration - ramp, self.duration)
        nodes, weights = np.polynomial.legendre.leggauss(_NODES)
        total = np.zeros(flat.shape, complex)
        for first, last in itertools.pairwise(marks):
            count = math.ceil((last - first) * highest / _PHASE)
            half = (last - first) / (2 * max(count, 1))
            middles = self.start + first + half * (2 * np.arange(count) + 1)
            middles = middles[middles < over]
            within = np.exp(1j * half * np.multiply.outer(nodes, flat))
            rows = max(1, _AT_ONCE // max(len(flat), _NODES))
            for n in range(0, len(middles), rows):
                t = middles[n : n + rows, None]
                values = self.signal(t + half * nodes) * (half * weights)
                total += (np.exp(1j * t * flat) * (values @ within)).sum(axis=0)
        return total.reshape(np.shape(omega))[()]
