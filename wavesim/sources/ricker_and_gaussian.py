"""The first derivative of a Gaussian and the second, the Ricker pulse."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wavesim.material.arguments import checked
from wavesim.sources.admissible import check_place, check_positive
from wavesim.sources.source import (
    EXCITED,
    Extent,
    Source,
    namespace,
)


@functools.cache
def _crossings(level: float) -> tuple[float, float]:
    """Both x > 0 at which x² exp(1 − x²) has a level far below 1, by Newton in ln x²."""
    found = []
    for log in (math.log(level) - 1, math.log(1 - math.log(level))):
        for _ in range(20):
            square = math.exp(log)
            log -= (log + 1 - square - math.log(level)) / (1 - square)
        found.append(math.exp(log / 2))
    return found[0], found[1]


@dataclass(frozen=True)
class DerivativeOfGaussian(Source):
    """The n-th derivative of a Gaussian: |s(ω)| ∝ (x² exp(1 − x²))^(n/2), x = ω/2πf_p.

    Arguments are those of :class:`Ricker`.
    """

    field: str
    position: float
    peak_frequency: float
    amplitude: float = 1.0
    width: float = 0.0
    delay: float | None = None
    drive: str = "body"

    order: ClassVar[int]
    """n."""
    half_duration: ClassVar[float]
    """Past this many 1/f_p from t₀ it is below 1e-15 of its peak."""
    band_ratio: ClassVar[float]
    """Up to so many f_p its spectrum is above 3 % of its peak."""
    end_ratio: ClassVar[float]
    """At so many f_p its spectrum is 2e-14 of its peak."""

    def __post_init__(self) -> None:
        check_place(self)
        check_positive(self, ("peak_frequency", "Hz"))

    @property
    def span(self) -> tuple[float, float, float]:
        """t₀ less half its duration, t₀, and t₀ and half its duration, s."""
        half = self.half_duration / self.peak_frequency
        middle = half if self.delay is None else self.delay
        return middle - half, middle, middle + half

    @property
    def extent(self) -> Extent:
        """In closed form, but for the two x at which |s| is EXCITED of its peak."""
        low, high = _crossings(EXCITED ** (2 / self.order))
        peak = 2 * math.pi * self.peak_frequency
        return Extent(
            peak,
            float(abs(self.spectrum(peak))),
            self.band_ratio * peak,
            (low * peak, high * peak),
            self.end_ratio * peak,
        )


@checked
@dataclass(frozen=True)
class GaussianDerivative(DerivativeOfGaussian):
    """First derivative of a Gaussian, s(t) = −u exp(½ − u²/2), u = 2π f_p (t − t₀).

    It peaks with 1 at u = −1 and with −1 at u = 1. Arguments are those of
    :class:`Ricker`; t₀, about which it is odd, is 1.4/f_p unless given.
    """

    kind: ClassVar[str] = "gaussian-derivative"
    order: ClassVar[int] = 1
    half_duration: ClassVar[float] = 1.4
    band_ratio: ClassVar[float] = 3.22
    end_ratio: ClassVar[float] = 8.3

    def signal(self, t: Any) -> Any:
        """amplitude · s(t); see :meth:`Source.signal`."""
        u = 2 * math.pi * self.peak_frequency * (t - self.peak_time)
        return -self.amplitude * u * namespace(t).exp(0.5 - u**2 / 2)

    def spectrum(self, omega: Any) -> Any:
        """−i √(2πe) (ω/ω_p²) exp(−ω²/2ω_p²) e^{iωt₀}; see :meth:`Source.spectrum`."""
        peak = 2 * math.pi * self.peak_frequency
        ratio = np.asarray(omega) / peak
        shape = math.sqrt(2 * math.pi * math.e) / peak * ratio * np.exp(-(ratio**2) / 2)
        return -1j * self.amplitude * shape * np.exp(1j * np.asarray(omega) * self.peak_time)


@checked
@dataclass(frozen=True)
class Ricker(DerivativeOfGaussian):
    """A Ricker pulse s(t) = (1 − 2u²) exp(−u²), u = π f_p (t − t₀).

    Args:
        field: the field it drives, such as phi1 or u1.
        position: x_s, m.
        peak_frequency: f_p, at which its spectrum peaks, Hz.
        amplitude: of the drive, in its unit; see :class:`Source`.
        width: standard deviation of a Gaussian in x, m; 0 is a point.
        delay: t₀, time of the peak, s; None stands for 2/f_p, by when the pulse has risen from
            below 1e-15.
        drive: "body", or a word of the field's family; see :class:`Source`.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    kind: ClassVar[str] = "ricker"
    order: ClassVar[int] = 2
    half_duration: ClassVar[float] = 2.0
    band_ratio: ClassVar[float] = 2.5
    end_ratio: ClassVar[float] = 6.0

    def signal(self, t: Any) -> Any:
        """amplitude · s(t); see :meth:`Source.signal`."""
        u = (math.pi * self.peak_frequency * (t - self.peak_time)) ** 2
        return self.amplitude * (1 - 2 * u) * namespace(t).exp(-u)

    def spectrum(self, omega: Any) -> Any:
        """4√π (ω²/ω_p³) exp(−ω²/ω_p²) e^{iωt₀}, ω_p = 2π f_p; see :meth:`Source.spectrum`."""
        peak = 2 * math.pi * self.peak_frequency
        ratio = np.asarray(omega) / peak
        shape = 4 * math.sqrt(math.pi) * ratio**2 * np.exp(-(ratio**2)) / peak
        return self.amplitude * shape * np.exp(1j * np.asarray(omega) * self.peak_time)
