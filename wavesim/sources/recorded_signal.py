"""A signal recorded in a laboratory, as the smooth curve through its samples."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from wavesim.material.arguments import checked
from wavesim.sources.admissible import check_place, check_size
from wavesim.sources.signal_file import check_samples
from wavesim.sources.source import (
    Extent,
    Source,
    extent_on,
    namespace,
    transform,
)


@checked
@dataclass(frozen=True)
class Recorded(Source):
    """A recorded signal, amplitude · Σ_j c_j M₄((t − t_j)/Δ), through its samples.

    M₄ is the cubic B-spline; the coefficients c_j solve (c_{j−1} + 4c_j + c_{j+1})/6 = v_j. The
    curve has two continuous derivatives everywhere, and is zero from two samples before the first
    and after the last. Between samples it is off a band-limited signal by (ωΔ)⁴/720. Its third
    derivative jumps at the samples: an exact stepper, which takes a signal for smooth within a
    step, is off by about 1e-9 of the field (measured, four samples to a step and more).

    Args:
        field: the field it drives, such as phi1 or u1.
        position: x_s, m.
        times: t_j, s: even (to 1e-6 of the record and a hundredth of a sample), at least 8.
        values: v_j, as many; the first and the last are at most 1e-2 of the largest.
        amplitude: by which the values are multiplied; with it in the drive's unit, see
            :class:`Source`.
        width: standard deviation of a Gaussian in x, m; 0 is a point.
        start: time of the first sample, s; None stands for that in times.
        drive: "body", or a word of the field's family; see :class:`Source`.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    kind: ClassVar[str] = "recorded"

    field: str
    position: float
    times: Sequence[float]
    values: Sequence[float]
    amplitude: float = 1.0
    width: float = 0.0
    start: float | None = None
    drive: str = "body"

    def __post_init__(self) -> None:
        check_place(self)
        for name in ("times", "values"):  # hashable, whatever they came as
            numbers = np.asarray(getattr(self, name), float).reshape(-1).tolist()
            object.__setattr__(self, name, tuple(numbers))
        check_samples(self.times, self.values)
        check_size("values", abs(self.amplitude) * max(map(abs, self.values)))

    @property
    def interval(self) -> float:
        """Δ, s."""
        return (self.times[-1] - self.times[0]) / (len(self.times) - 1)

    @property
    def first(self) -> float:
        """Time of the first sample, s."""
        return self.times[0] if self.start is None else self.start

    @functools.cached_property
    def _coefficients(self) -> NDArray[np.float64]:
        from scipy.linalg import solveh_banded  # slow to import, and only a record needs it

        values = np.array(self.values)
        bands = np.array([np.full(len(values), 1 / 6), np.full(len(values), 2 / 3)])
        return np.asarray(solveh_banded(bands, values))

    @property
    def span(self) -> tuple[float, float, float]:
        """Two samples before the first, the largest sample, two samples after the last, s."""
        places = np.array([-2, np.argmax(np.abs(self.values)), len(self.values) + 1])
        onset, peak, end = (self.first + self.interval * places).tolist()
        return onset, peak, end

    @functools.cached_property
    def extent(self) -> Extent:
        """Read off its spectrum; its third derivative jumps at the samples."""
        # Above twice Nyquist the images are below (2/3π)⁴ of what lies as far above it.
        size = 8 * len(self.values)
        turns = np.arange(2 * size + 1) / size  # ωΔ/2π
        period = np.abs(np.fft.fft(self._coefficients, size))
        values = self.interval * np.sinc(turns) ** 4 * np.resize(period, len(turns))
        return extent_on(2 * np.pi / self.interval * turns, abs(self.amplitude) * values)

    @property
    def peak_frequency(self) -> float:
        """Where its spectrum peaks, Hz."""
        return self.extent.peak / (2 * math.pi)

    def signal(self, t: Any) -> Any:
        """amplitude · s(t); see :meth:`Source.signal`."""
        xp = namespace(t)
        at = (t - self.first) / self.interval
        count = len(self.values)
        # Four zeros on either side: outside, the curve is made of them. Were x clipped instead, its
        # derivative would be 0 at the samples.
        padded = xp.asarray(np.pad(self._coefficients, 4))
        left = xp.clip(xp.floor(at), -3.0, count + 1)
        x = at - left
        index = xp.asarray(left, dtype=int) + 4
        weights = (
            (1 - x) ** 3,
            4 - 6 * x**2 + 3 * x**3,
            1 + 3 * x + 3 * x**2 - 3 * x**3,
            x**3,
        )
        total = sum(w * xp.take(padded, index + n) for n, w in enumerate(weights, start=-1))
        return self.amplitude / 6 * total

    def spectrum(self, omega: Any) -> Any:
        """Δ sinc⁴(ωΔ/2) Σ_j c_j e^{iωt_j}, exactly that of the curve; see Source.spectrum."""
        t = self.first + self.interval * np.arange(len(self.values))
        sinc = np.sinc(np.asarray(omega) * self.interval / (2 * np.pi))
        return self.amplitude * self.interval * sinc**4 * transform(omega, t, self._coefficients)
