"""Sources: pulses in time and in frequency. Jax goes through, but is not needed.

A source adds a body moment (on a rotation φ_i) or a body double moment (on a micro-curvature
B_ij) to the balance equations: amplitude · s(t) · δ(x − position), or a Gaussian in place of δ.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.equations import FIELDS, ROTATIONS

# Past 2/f_p from its peak a Ricker pulse is below 1e-15 of it.
_HALF_DURATION = 2.0
# Up to 2.5 f_p the spectrum of a Ricker pulse is above 3 % of its peak.
_BAND = 2.5


@dataclass(frozen=True)
class Ricker:
    """A Ricker pulse s(t) = (1 − 2u²) exp(−u²), u = π f_p (t − t₀).

    Args:
        field: the field it drives, phi1 … B33.
        position: x_s, m.
        peak_frequency: f_p, at which its spectrum peaks, Hz.
        amplitude: moment per area of the section, N·m/m² on a rotation, N on a micro-curvature.
        width: standard deviation of a Gaussian in x, m; 0 is a point.
        delay: t₀, time of the peak, s; None stands for 2/f_p, by when the pulse has risen from
            below 1e-15.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    field: str
    position: float
    peak_frequency: float
    amplitude: float = 1.0
    width: float = 0.0
    delay: float | None = None

    def __post_init__(self) -> None:
        if self.field not in FIELDS:
            raise ValueError(f"field = {self.field!r}: must be one of {', '.join(FIELDS)}")
        if not self.peak_frequency > 0:
            raise ValueError(f"peak_frequency = {self.peak_frequency:g} Hz: must be > 0")
        if self.width < 0:
            raise ValueError(f"width = {self.width:g} m: must be 0 (a point) or greater")

    @property
    def staggered(self) -> bool:
        """Whether the field it drives lives on the half-nodes."""
        return self.field not in ROTATIONS

    @property
    def peak_time(self) -> float:
        """t₀, s."""
        return _HALF_DURATION / self.peak_frequency if self.delay is None else self.delay

    @property
    def end(self) -> float:
        """Time from which on the pulse is below 1e-15 of its peak, s."""
        return self.peak_time + _HALF_DURATION / self.peak_frequency

    @property
    def band(self) -> float:
        """Angular frequency above which its spectrum is below 3 % of its peak, rad/s."""
        return 2 * math.pi * _BAND * self.peak_frequency

    def signal(self, t: Any) -> Any:
        """amplitude · s(t).

        Args:
            t: times, numpy or jax array of any shape, s.

        Returns:
            Shape of t, unit of the amplitude.
        """
        xp = t.__array_namespace__() if hasattr(t, "__array_namespace__") else np
        u = (math.pi * self.peak_frequency * (t - self.peak_time)) ** 2
        return self.amplitude * (1 - 2 * u) * xp.exp(-u)

    def spectrum(self, omega: Any) -> Any:
        """Fourier transform ∫ amplitude · s(t) e^{iωt} dt, entire in ω.

            4√π (ω²/ω_p³) exp(−ω²/ω_p²) e^{iωt₀},   ω_p = 2π f_p

        Args:
            omega: angular frequencies, real or complex, any shape, rad/s.

        Returns:
            Shape of omega, complex, unit of the amplitude times s.
        """
        peak = 2 * math.pi * self.peak_frequency
        ratio = np.asarray(omega) / peak
        shape = 4 * math.sqrt(math.pi) * ratio**2 * np.exp(-(ratio**2)) / peak
        return self.amplitude * shape * np.exp(1j * np.asarray(omega) * self.peak_time)


# A frequency counts as excited where the spectrum is above this part of its peak.
EXCITED = 1e-3


def excitation(sources: Sequence[Ricker], omega: Any) -> Any:
    """Spectrum |s(ω)| of the strongest source at each frequency, relative to its own peak.

    Args:
        sources: at least one.
        omega: angular frequencies, any shape, rad/s.

    Returns:
        Shape of omega, 0 to 1.
    """
    parts = []
    for source in sources:
        ratio = (np.asarray(omega) / (2 * math.pi * source.peak_frequency)) ** 2
        parts.append(ratio * np.exp(1 - ratio))
    return np.max(parts, axis=0)


def excited_band(sources: Sequence[Ricker]) -> tuple[float, float]:
    """Lowest and highest angular frequency that count as excited, rad/s.

    (ω/ω_p)² exp(1 − (ω/ω_p)²) = EXCITED at ω/ω_p = 0.01918 and 3.123.
    """
    from scipy.special import lambertw  # slow to import, and only an analysis needs it

    peaks = [2 * math.pi * source.peak_frequency for source in sources]
    low, high = (math.sqrt(-lambertw(-EXCITED / math.e, branch).real) for branch in (0, -1))
    return low * min(peaks), high * max(peaks)
