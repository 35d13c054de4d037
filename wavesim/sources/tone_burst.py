"""Some cycles of a sine under a window, as a signal generator makes them."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from wavesim.material.arguments import checked
from wavesim.sources.source import (
    Extent,
    Source,
    check_place,
    check_positive,
    check_start,
    extent_to,
    namespace,
)

Window = Literal["hann", "cos4", "cos6"]

# sin^p(πτ/T), a cosine sum that has p − 1 continuous derivatives at its ends.
_POWERS: dict[str, int] = {"hann": 2, "cos4": 4, "cos6": 6}
# The side lobes of the windows are below 1e-3 of the peak this many bins from it.
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
