"""Finite records of a signal generator: tone bursts and linear sweeps."""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from wavesim.sources.source import (
    Drive,
    Extent,
    Source,
    check_place,
    check_positive,
    extent,
    namespace,
)

Window = Literal["hann", "cos4", "cos6"]

# sin^p(πτ/T), a cosine sum that has p − 1 continuous derivatives at its ends.
_POWERS: dict[str, int] = {"hann": 2, "cos4": 4, "cos6": 6}
WINDOWS: tuple[str, ...] = tuple(_POWERS)

# Points of the grid on which a band is read off, in 2π/T.
_TO_A_BIN = 16
# The side lobes of the windows are below 1e-3 of the peak this many bins from it.
_BINS = 16
# Gauss nodes to a panel of a sweep, and the phase that a panel may hold, rad.
_NODES, _PHASE = 32, 25.0
# Products of frequencies and nodes held at a time.
_AT_ONCE = 2**20


def _check(source: ToneBurst | Chirp) -> None:
    check_place(source)
    if not (source.start >= 0 and math.isfinite(source.start)):
        raise ValueError(f"start = {source.start:g} s: must be 0 or greater")


@dataclass(frozen=True)
class ToneBurst(Source):
    """Some cycles of a sine under a window, s(t) = w(τ) sin(2πfτ), 0 ≤ τ = t − start ≤ T = n/f.

    The window is w = sin^p(πτ/T): "hann" (p = 2) begins with a continuous first derivative,
    "cos4" with three, "cos6" with five; an exact stepper is off by 1e-10 of the field for the
    first, by rounding for the others (measured). Windows of the Blackman–Harris family jump at
    their ends.

    Args:
        field: the field it drives, phi1 … B33.
        position: x_s, m.
        frequency: f, Hz.
        cycles: n, –, at least 1, not necessarily whole.
        window: "hann", "cos4" or "cos6".
        amplitude: of the drive: N·m/m² on a rotation, N on a micro-curvature, rad for "rotation".
        width: standard deviation of a Gaussian in x, m; 0 is a point.
        start: when it begins, s, ≥ 0.
        drive: "body", "moment" or "rotation"; see :class:`Source`.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    field: str
    position: float
    frequency: float
    cycles: float = 5.0
    window: Window = "hann"
    amplitude: float = 1.0
    width: float = 0.0
    start: float = 0.0
    drive: Drive = "body"

    def __post_init__(self) -> None:
        _check(self)
        check_positive(self, ("frequency", "Hz"))
        if not (self.cycles >= 1 and math.isfinite(self.cycles)):
            raise ValueError(f"cycles = {self.cycles:g}: must be 1 or greater")
        if self.window not in _POWERS:
            raise ValueError(f"window = {self.window!r}: must be one of {', '.join(_POWERS)}")

    @property
    def kind(self) -> str:
        """tone-burst."""
        return "tone-burst"

    @property
    def duration(self) -> float:
        """T = n/f, s."""
        return self.cycles / self.frequency

    @property
    def peak_time(self) -> float:
        """Its middle, s."""
        return self.start + self.duration / 2

    @property
    def onset(self) -> float:
        """When it begins, s."""
        return self.start

    @property
    def end(self) -> float:
        """When it is over, s."""
        return self.start + self.duration

    @functools.cached_property
    def _extent(self) -> Extent:
        bins = self.cycles + _BINS
        omega = 2 * math.pi / self.duration * np.arange(math.ceil(bins * _TO_A_BIN)) / _TO_A_BIN
        return extent(omega, np.abs(self.spectrum(omega)))

    @property
    def peak_frequency(self) -> float:
        """Where its spectrum peaks, Hz: f, or near it for few cycles."""
        return self._extent.peak / (2 * math.pi)

    @property
    def band(self) -> float:
        """Angular frequency above which its spectrum is below 3 % of its peak, rad/s."""
        return self._extent.band

    @property
    def excited(self) -> tuple[float, float]:
        """Lowest and highest angular frequency that count as excited, rad/s."""
        return self._extent.excited

    @property
    def spectral_end(self) -> float:
        """Infinite: a derivative jumps at the ends."""
        return math.inf

    @property
    def strongest(self) -> float:
        """Largest |spectrum|, to 1e-4 of itself."""
        return self._extent.strongest

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


@dataclass(frozen=True)
class Chirp(Source):
    """A linear sweep, s(t) = w(τ) sin(2π(f₁τ + (f₂ − f₁)τ²/2T)), 0 ≤ τ = t − start ≤ T.

    w rises from 0 to 1 over the first part of it as x⁴(35 − 84x + 70x² − 20x³), which has three
    continuous derivatives, and falls so over the last.

    Args:
        field: the field it drives, phi1 … B33.
        position: x_s, m.
        low, high: f₁ and f₂, first and last frequency, Hz, 0 < f₁ < f₂.
        duration: T, s, at least one period of the lowest frequency.
        taper: part of the duration over which it rises, and falls, –, 0.01 to 0.5.
        amplitude: of the drive: N·m/m² on a rotation, N on a micro-curvature, rad for "rotation".
        width: standard deviation of a Gaussian in x, m; 0 is a point.
        start: when it begins, s, ≥ 0.
        drive: "body", "moment" or "rotation"; see :class:`Source`.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    field: str
    position: float
    low: float
    high: float
    duration: float
    taper: float = 0.1
    amplitude: float = 1.0
    width: float = 0.0
    start: float = 0.0
    drive: Drive = "body"

    def __post_init__(self) -> None:
        _check(self)
        check_positive(self, ("low", "Hz"), ("high", "Hz"), ("duration", "s"))
        if self.low >= self.high:
            raise ValueError(f"low = {self.low:g} Hz: must be below high = {self.high:g} Hz")
        if self.duration * self.low < 1:
            raise ValueError(
                f"duration = {self.duration:g} s: must be at least a period of low = "
                f"{self.low:g} Hz; take {1 / self.low:.4g} s or more"
            )
        if not 0.01 <= self.taper <= 0.5:
            raise ValueError(f"taper = {self.taper:g}: must be between 0.01 and 0.5")

    @property
    def kind(self) -> str:
        """chirp."""
        return "chirp"

    @property
    def peak_time(self) -> float:
        """Its middle, s."""
        return self.start + self.duration / 2

    @property
    def peak_frequency(self) -> float:
        """The middle of the sweep, Hz."""
        return (self.low + self.high) / 2

    @property
    def onset(self) -> float:
        """When it begins, s."""
        return self.start

    @property
    def end(self) -> float:
        """When it is over, s."""
        return self.start + self.duration

    @functools.cached_property
    def _extent(self) -> Extent:
        bins = self.high * self.duration + _BINS + 6 / self.taper
        omega = 2 * math.pi / self.duration * np.arange(math.ceil(bins * _TO_A_BIN)) / _TO_A_BIN
        return extent(omega, np.abs(self.spectrum(omega)))

    @property
    def band(self) -> float:
        """Angular frequency above which its spectrum is below 3 % of its peak, rad/s."""
        return self._extent.band

    @property
    def excited(self) -> tuple[float, float]:
        """Lowest and highest angular frequency that count as excited, rad/s."""
        return self._extent.excited

    @property
    def spectral_end(self) -> float:
        """Infinite: the fourth derivative jumps at both ends of each taper."""
        return math.inf

    @property
    def strongest(self) -> float:
        """Largest |spectrum|, to 1e-4 of itself."""
        return self._extent.strongest

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
        """Transform by Gauss quadrature on panels, to 1e-12 of its peak; see Source.spectrum."""
        omega = np.asarray(omega)
        flat = omega.reshape(-1)
        highest = np.abs(flat.real).max(initial=0.0) + 2 * math.pi * self.high
        ramp = self.taper * self.duration
        marks = (0.0, ramp, self.duration - ramp, self.duration)
        edges = [
            np.linspace(a, b, math.ceil((b - a) * highest / _PHASE) + 1)
            for a, b in itertools.pairwise(marks)
            if b > a
        ]
        panels = np.unique(np.concatenate(edges))
        nodes, weights = np.polynomial.legendre.leggauss(_NODES)
        half = np.diff(panels)[:, None] / 2
        t = (self.start + panels[:-1, None] + half * (1 + nodes)).reshape(-1)
        values = self.signal(t) * (half * weights).reshape(-1)
        rows = max(1, _AT_ONCE // len(t))
        parts = [
            np.exp(1j * flat[n : n + rows, None] * t) @ values for n in range(0, len(flat), rows)
        ]
        return np.concatenate([np.zeros(0, complex), *parts]).reshape(omega.shape)[()]
