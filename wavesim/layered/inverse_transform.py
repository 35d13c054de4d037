"""The frequencies ω + iσ_w of an inverse transform, and the transform.

A record of length T is had from a period T_p = 2T of the signal times exp(−σ_w t), with
exp(−σ_w T_p) = 1e-11: what comes round from later is below that, and what rounding leaves grows by
exp(σ_w T) = 3e5 at most. The sum runs over ω_j = jΔω, Δω = 2π/T_p, up to where every source's
spectrum has fallen for good below 1e-10 of its peak.

An initial value makes a signal begin with a step, whose spectrum falls as 1/ω alone. As it starts
at rest the signal is even about t = 0, and smooth, if it goes on to t < 0: with c(t) what is had
from t > 0 alone, low-passed, u(t) = c(t) + c(−t), exact for what the low-pass
leaves alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

_WRAP = 1e-11
_SMALL = 1e-10
# A source whose spectrum has not fallen by this many times its band is cut there.
_FURTHEST = 30.0


class BeyondNumbersError(ValueError):
    """A spectrum at ω + iσ over- or underflows."""


@dataclass(frozen=True)
class Contour:
    """Where a signal is evaluated in the frequency domain.

    Attributes:
        omega: ω_j + iσ_w, shape (N,), rad/s.
        step: Δω, rad/s.
        lowpass: top and width of the low-pass of initial values, rad/s; None without.
    """

    omega: Any
    step: float
    lowpass: tuple[float, float] | None

    def signal(self, spectrum: Any, t: Any) -> Any:
        """u(t) from U(ω_j + iσ_w), shape (..., N): shape (..., nt)."""
        weighted = spectrum * (self.step / math.pi)
        weighted[..., 0] *= 0.5
        if self.lowpass is None:
            return self._sum(weighted, t)
        from scipy.special import erfc

        top, width = self.lowpass
        z = self.omega
        weighted = weighted * (erfc((z - top) / width) * erfc((-z - top) / width) / 4)
        return self._sum(weighted, t) + self._sum(weighted, -np.asarray(t))

    def _sum(self, weighted: Any, t: Any) -> Any:
        """Re Σ_j w_j exp(−i(ω_j + iσ_w)t); by FFT for times that divide the period evenly."""
        period = max(2 * (len(t) - 1), 1)
        place = t * (period * self.step / (2 * math.pi))
        if np.abs(place - np.rint(place)).max() <= 1e-9:
            blocks = -(-len(self.omega) // period)
            padded = np.zeros((*weighted.shape[:-1], blocks * period), dtype=complex)
            padded[..., : len(self.omega)] = weighted
            # To these times alike are frequencies that lie a whole number of turns apart.
            folded = padded.reshape(*weighted.shape[:-1], blocks, period).sum(axis=-2)
            sums = np.fft.fft(folded)[..., np.rint(place).astype(int) % period]
            return (sums * np.exp(self.omega[0].imag * t)).real
        parts = []
        chunk = max(1, 2_000_000 // len(self.omega))
        for start in range(0, len(t), chunk):
            phase = np.exp(-1j * np.multiply.outer(self.omega, t[start : start + chunk]))
            parts.append((weighted @ phase).real)
        return np.concatenate(parts, axis=-1)


def _top(spectrum: Callable[[Any], Any], band: float, sigma: float) -> float:
    omega = band * np.linspace(0, _FURTHEST, 3001) + 1j * sigma
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.abs(spectrum(omega))
    if not 0 < size.max() < np.inf:
        raise BeyondNumbersError(
            "duration: is so short beside what a source sends that its spectrum at ω + iσ is "
            "beyond numbers; lengthen the run"
        )
    return float(omega[min(np.flatnonzero(size > _SMALL * size.max()).max() + 1, 3000)].real)


def contour(duration: float, sources: Sequence[Any], initial: Sequence[float]) -> Contour:
    """Frequencies for a record.

    Args:
        duration: last time asked for, s, > 0.
        sources: those with a pulse, with ``spectrum`` and ``band``.
        initial: for each initial value, the highest angular frequency it sets in motion, rad/s.

    Raises:
        BeyondNumbersError: a spectrum is no number there.
    """
    period = 2 * duration
    sigma = -math.log(_WRAP) / period
    step = 2 * math.pi / period
    tops = [_top(source.spectrum, source.band, sigma) for source in sources]
    lowpass = None
    if initial:
        # erfc rises from 1e-16 of its step to 1 − 1e-16 within 6 widths on either side; it is
        # blind to the period if a width is some steps.
        top = max([*initial, *tops])
        width = max(0.05 * top, 20 * step)
        lowpass = (top + 6 * width, width)
        tops = [top + 12 * width]
    count = max(64, math.ceil(max(tops) / step) + 1)
    return Contour(step * np.arange(count) + 1j * sigma, step, lowpass)
