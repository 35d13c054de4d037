"""Pulses in closed form: derivatives of a Gaussian."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.sources.source import EXCITED, Drive, Source, check_place, namespace

# Past 2/f_p from its peak a Ricker pulse is below 1e-15 of it.
_HALF_DURATION = 2.0
# Up to 2.5 f_p the spectrum of a Ricker pulse is above 3 % of its peak.
_BAND = 2.5
# Above this many times the end of its band the spectrum of a Ricker pulse is 2e-14 of its peak.
_BEYOND_BAND = 2.4

# The same three of the first derivative of a Gaussian; the last in units of f_p.
_FIRST_HALF_DURATION = 1.4
_FIRST_BAND = 3.22
_FIRST_SPECTRAL_END = 8.3


def _check(source: Ricker | GaussianDerivative) -> None:
    check_place(source)
    if not source.peak_frequency > 0:
        raise ValueError(f"peak_frequency = {source.peak_frequency:g} Hz: must be > 0")


def _excited(level: float) -> tuple[float, float]:
    """Both ω/ω_p at which (ω/ω_p)² exp(1 − (ω/ω_p)²) has that level."""
    from scipy.special import lambertw  # slow to import, and only an analysis needs it

    low, high = (math.sqrt(-lambertw(-level / math.e, branch).real) for branch in (0, -1))
    return low, high


@dataclass(frozen=True)
class Ricker(Source):
    """A Ricker pulse s(t) = (1 − 2u²) exp(−u²), u = π f_p (t − t₀).

    Args:
        field: the field it drives, phi1 … B33.
        position: x_s, m.
        peak_frequency: f_p, at which its spectrum peaks, Hz.
        amplitude: of the drive: N·m/m² on a rotation, N on a micro-curvature, rad for "rotation".
        width: standard deviation of a Gaussian in x, m; 0 is a point.
        delay: t₀, time of the peak, s; None stands for 2/f_p, by when the pulse has risen from
            below 1e-15.
        drive: "body", "moment" or "rotation"; see :class:`Source`.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    field: str
    position: float
    peak_frequency: float
    amplitude: float = 1.0
    width: float = 0.0
    delay: float | None = None
    drive: Drive = "body"

    def __post_init__(self) -> None:
        _check(self)

    @property
    def kind(self) -> str:
        """ricker."""
        return "ricker"

    @property
    def peak_time(self) -> float:
        """t₀, s."""
        return _HALF_DURATION / self.peak_frequency if self.delay is None else self.delay

    @property
    def onset(self) -> float:
        """Time until which the pulse is below 1e-15 of its peak, s."""
        return self.peak_time - _HALF_DURATION / self.peak_frequency

    @property
    def end(self) -> float:
        """Time from which on the pulse is below 1e-15 of its peak, s."""
        return self.peak_time + _HALF_DURATION / self.peak_frequency

    @property
    def band(self) -> float:
        """Angular frequency above which its spectrum is below 3 % of its peak, rad/s."""
        return 2 * math.pi * _BAND * self.peak_frequency

    @property
    def excited(self) -> tuple[float, float]:
        """(ω/ω_p)² exp(1 − (ω/ω_p)²) = EXCITED at ω/ω_p = 0.01918 and 3.123; rad/s."""
        low, high = _excited(EXCITED)
        peak = 2 * math.pi * self.peak_frequency
        return low * peak, high * peak

    @property
    def spectral_end(self) -> float:
        """2.4 times the end of its band, where its spectrum is 2e-14 of its peak, rad/s."""
        return _BEYOND_BAND * self.band

    @property
    def strongest(self) -> float:
        """4√π/(e ω_p) · |amplitude|."""
        return (
            abs(self.amplitude) * 4 * math.sqrt(math.pi) / math.e
            / (2 * math.pi * self.peak_frequency)
        )  # fmt: skip

    def signal(self, t: Any) -> Any:
        """amplitude · s(t).

        Args:
            t: times, numpy or jax array of any shape, s.

        Returns:
            Shape of t, unit of the amplitude.
        """
        u = (math.pi * self.peak_frequency * (t - self.peak_time)) ** 2
        return self.amplitude * (1 - 2 * u) * namespace(t).exp(-u)

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


@dataclass(frozen=True)
class GaussianDerivative(Source):
    """First derivative of a Gaussian, s(t) = −u exp(½ − u²/2), u = 2π f_p (t − t₀).

    It peaks with 1 at u = −1 and with −1 at u = 1.

    Args:
        field: the field it drives, phi1 … B33.
        position: x_s, m.
        peak_frequency: f_p, at which its spectrum peaks, Hz.
        amplitude: of the drive: N·m/m² on a rotation, N on a micro-curvature, rad for "rotation".
        width: standard deviation of a Gaussian in x, m; 0 is a point.
        delay: t₀, time of its zero, s; None stands for 1.4/f_p, by when the pulse has risen from
            below 1e-15.
        drive: "body", "moment" or "rotation"; see :class:`Source`.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    field: str
    position: float
    peak_frequency: float
    amplitude: float = 1.0
    width: float = 0.0
    delay: float | None = None
    drive: Drive = "body"

    def __post_init__(self) -> None:
        _check(self)

    @property
    def kind(self) -> str:
        """gaussian-derivative."""
        return "gaussian-derivative"

    @property
    def peak_time(self) -> float:
        """t₀, the zero between its two peaks, s."""
        return _FIRST_HALF_DURATION / self.peak_frequency if self.delay is None else self.delay

    @property
    def onset(self) -> float:
        """Time until which the pulse is below 1e-15 of its peak, s."""
        return self.peak_time - _FIRST_HALF_DURATION / self.peak_frequency

    @property
    def end(self) -> float:
        """Time from which on the pulse is below 1e-15 of its peak, s."""
        return self.peak_time + _FIRST_HALF_DURATION / self.peak_frequency

    @property
    def band(self) -> float:
        """Angular frequency above which its spectrum is below 3 % of its peak, rad/s."""
        return 2 * math.pi * _FIRST_BAND * self.peak_frequency

    @property
    def excited(self) -> tuple[float, float]:
        """(ω/ω_p) exp(½ − ½(ω/ω_p)²) = EXCITED; rad/s."""
        low, high = _excited(EXCITED**2)
        peak = 2 * math.pi * self.peak_frequency
        return low * peak, high * peak

    @property
    def spectral_end(self) -> float:
        """8.3 peak frequencies, where its spectrum is 2e-14 of its peak, rad/s."""
        return 2 * math.pi * _FIRST_SPECTRAL_END * self.peak_frequency

    @property
    def strongest(self) -> float:
        """√(2π)/ω_p · |amplitude|."""
        return abs(self.amplitude) * math.sqrt(2 * math.pi) / (2 * math.pi * self.peak_frequency)

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
