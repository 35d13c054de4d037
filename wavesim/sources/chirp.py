"""A linear sweep, as a signal generator makes it."""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wavesim.material.arguments import checked
from wavesim.sources.source import (
    Extent,
    Source,
    check_place,
    check_positive,
    check_start,
    extent_on,
    extent_to,
    namespace,
)

# Bins from its last frequency on in which its spectrum falls, without those that its taper adds.
_BINS = 16
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
