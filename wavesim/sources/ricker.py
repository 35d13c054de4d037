"""The Ricker pulse: the second derivative of a Gaussian."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wavesim.material.arguments import checked
from wavesim.sources.gaussian_derivative import DerivativeOfGaussian
from wavesim.sources.source import namespace


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
