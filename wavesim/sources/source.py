"""What every source has: a field, a place, a way to drive, a signal and its transform."""

from __future__ import annotations

import abc
import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from wavesim.material.family import Acts, is_macro, known_field

# A frequency counts as excited where the spectrum is above this part of its peak.
EXCITED = 1e-3
# The band of a source ends where its spectrum falls below this part of its peak for good.
IN_BAND = 0.03
# Frames fold nothing onto a frequency where what would come there is below this part of it.
_UNFOLDED = 1e-3

# Points of the grid on which an extent is read off, in 2π/T.
_TO_A_BIN = 16
# Products of frequencies and times held at a time.
_AT_ONCE = 2**20


@dataclass(frozen=True)
class Extent:
    """Where a spectrum is; a source says each of these of itself, by the same name or nearly so.

    Attributes:
        peak: ω of its largest value, rad/s.
        strongest: that value, unit of the amplitude times s.
        band: where it falls below 3 % of that for good, rad/s.
        excited: lowest and highest ω at which it is 1e-3 of that, rad/s.
        end: from where on it is rounding, rad/s; infinite where a derivative of the signal jumps,
            as the spectrum then falls as a power of ω.
    """

    peak: float
    strongest: float
    band: float
    excited: tuple[float, float]
    end: float = math.inf


class Source(abc.ABC):
    """A source: amplitude · s(t) on one field at one place.

    By its ``drive``, a word of its field's family, the signal is what ``acts`` says:

    - "body", in all families: a body force on a macro-field (a body moment on a rotation) or a
      body double force on a micro-field, amplitude · s(t) · δ(x − position), or a Gaussian of
      standard deviation width in place of δ; N/m² on a displacement and N/m on a micro-strain,
      N·m/m² on a rotation and N on a micro-curvature;
    - "surface", of rotation "moment", of translation "traction": what loads a free end, per area;
      position is that of the end;
    - "prescribed", of rotation "rotation", of translation "displacement": the macro-field of a
      fixed end; position is that of the end;
    - "initial": none; the field itself at t = 0, see ``InitialField``.

    Every kind is a frozen dataclass and hashable, so that jax takes it as static. It gives its
    signal, the transform of that, and where both are: :attr:`span` and :attr:`extent`.
    """

    kind: ClassVar[str]
    """Its name in a case file."""

    if TYPE_CHECKING:  # fields of the dataclasses, or properties of them

        @property
        def field(self) -> str:
            """The field it drives, such as phi1, B11, u1, A11."""

        @property
        def position(self) -> float:
            """x_s, m."""

        @property
        def amplitude(self) -> float:
            """By which s(t), of order 1, is multiplied."""

        @property
        def width(self) -> float:
            """Standard deviation of a Gaussian in x, m; 0 is a point."""

        @property
        def drive(self) -> str:
            """How it drives, in a word of its field's family."""

        @property
        def peak_frequency(self) -> float:
            """The dominant frequency, Hz."""

    @abc.abstractmethod
    def signal(self, t: Any) -> Any:
        """amplitude · s(t).

        Args:
            t: times, numpy or jax array of any shape, s.

        Returns:
            Shape of t, unit of the amplitude.
        """

    @abc.abstractmethod
    def spectrum(self, omega: Any) -> Any:
        """Fourier transform ∫ amplitude · s(t) e^{iωt} dt, entire in ω.

        Args:
            omega: angular frequencies, real or complex, any shape, rad/s.

        Returns:
            Shape of omega, complex, unit of the amplitude times s.
        """

    @property
    @abc.abstractmethod
    def span(self) -> tuple[float, float, float]:
        """Onset, peak (or middle) and end, s: before and after it is below 1e-15 of its peak."""

    @property
    @abc.abstractmethod
    def extent(self) -> Extent:
        """Where its spectrum is."""

    @property
    def onset(self) -> float:
        """Time until which it is below 1e-15 of its peak, s."""
        return self.span[0]

    @property
    def peak_time(self) -> float:
        """Time of its peak, or of its middle, s."""
        return self.span[1]

    @property
    def end(self) -> float:
        """Time from which on it is below 1e-15 of its peak, s."""
        return self.span[2]

    @property
    def band(self) -> float:
        """Angular frequency above which its spectrum is below 3 % of its peak, rad/s."""
        return self.extent.band

    @property
    def excited(self) -> tuple[float, float]:
        """Lowest and highest angular frequency that count as excited, rad/s."""
        return self.extent.excited

    @property
    def spectral_end(self) -> float:
        """Angular frequency from which on its spectrum is rounding, rad/s; see :class:`Extent`."""
        return self.extent.end

    @property
    def strongest(self) -> float:
        """Largest |spectrum| at real ω, unit of the amplitude times s."""
        return self.extent.strongest

    @property
    def acts(self) -> Acts:
        """What its drive does: "body", "surface", "prescribed" or "initial"."""
        return known_field(self.field).family.acts(self.drive)

    @property
    def staggered(self) -> bool:
        """Whether the field it drives lives on the half-nodes."""
        return not is_macro(self.field)


def parameters(source: Source) -> dict[str, Any]:
    """Every parameter of a source by name, with times in place of None."""
    values = {f.name: getattr(source, f.name) for f in dataclasses.fields(cast(Any, source))}
    settled = {"delay": source.peak_time, "start": getattr(source, "first", None)}
    return values | {name: settled[name] for name in settled if values.get(name, 0) is None}


def namespace(t: Any) -> Any:
    """numpy or jax.numpy, after the array; numpy for a plain number."""
    return t.__array_namespace__() if hasattr(t, "__array_namespace__") else np


def transform(omega: Any, t: NDArray[Any], values: NDArray[Any]) -> Any:
    """Σ_j v_j e^{iωt_j}, shape of omega.

    Args:
        omega: angular frequencies, real or complex, any shape, rad/s.
        t, values: t_j, s, and v_j, shape (n,).
    """
    flat = np.asarray(omega).reshape(-1)
    rows = max(1, _AT_ONCE // len(t))
    parts = [np.exp(1j * flat[n : n + rows, None] * t) @ values for n in range(0, len(flat), rows)]
    return np.concatenate([np.zeros(0, complex), *parts]).reshape(np.shape(omega))[()]


def extent_to(source: Source, bins: float, first: float = 0.0) -> Extent:
    """The extent of a source of finite duration T, read off its spectrum on a grid of π/8T.

    Args:
        source: of any kind.
        bins: where its spectrum stays below 1e-3 of its peak, in 2π/T.
        first: up to where it is below that too.
    """
    turns = np.arange(math.floor(first) * _TO_A_BIN, math.ceil(bins * _TO_A_BIN)) / _TO_A_BIN
    omega = np.asarray(2 * math.pi / (source.end - source.onset) * turns, float)
    return extent_on(omega, np.abs(source.spectrum(omega)))


def extent_on(omega: NDArray[np.float64], size: NDArray[np.float64]) -> Extent:
    """Read the extent off a grid; the largest value by a parabola through three points.

    Args:
        omega: even grid up to where size stays below 1e-3 of its peak, rad/s.
        size: |spectrum| there.
    """
    at = int(np.argmax(size))
    peak, strongest = omega[at], size[at]
    if 0 < at < len(size) - 1:
        before, after = size[at - 1], size[at + 1]
        bend = before - 2 * strongest + after
        if bend < 0:
            shift = (before - after) / (2 * bend)
            step = omega[1] - omega[0]
            peak, strongest = peak + shift * step, strongest - (before - after) * shift / 4
    last = len(omega) - 1
    in_band = np.nonzero(size >= IN_BAND * strongest)[0]
    heard = np.nonzero(size >= EXCITED * strongest)[0]
    return Extent(
        float(peak),
        float(strongest),
        float(omega[min(in_band[-1] + 1, last)]),
        (float(omega[max(heard[0] - 1, 0)]), float(omega[min(heard[-1] + 1, last)])),
    )


def excitation(sources: Sequence[Source], omega: Any, k: Any = 0.0) -> Any:
    """Spectrum |s(ω)| of the strongest source at each frequency, relative to its own peak.

    It is 0 beyond twice where that has fallen below EXCITED for good. An initial field excites all
    frequencies and, in wavenumber, exp(−k²w²/2).

    Args:
        sources: at least one.
        omega: angular frequencies, any shape, rad/s.
        k: wavenumbers, of a shape that goes with omega, rad/m; felt by initial fields alone.

    Returns:
        Shape of omega, 0 to 1.
    """
    omega = np.asarray(omega)
    parts = []
    for source in sources:
        if source.acts == "initial":
            parts.append(np.exp(-((np.asarray(k) * source.width) ** 2) / 2) * np.ones(omega.shape))
            continue
        near, part = omega.real <= 2 * source.excited[1], np.zeros(omega.shape)
        part[near] = np.abs(source.spectrum(omega[near])) / source.strongest
        parts.append(part)
    return np.max(parts, axis=0)


def unfolded(sources: Sequence[Source], omega: Any, interval: float) -> Any:
    """Where frames show what sources drive at ω, and not what they drive at 2π/Δt − ω as well.

    Args:
        sources: at least one; initial fields, which drive all frequencies, are not looked at.
        omega: angular frequencies below the frames' Nyquist frequency, shape (n,), rad/s.
        interval: Δt of the frames, s.

    Returns:
        Mask, shape (n,).
    """
    own = [source for source in sources if source.acts != "initial"]
    if not own:
        return np.ones(np.shape(omega), bool)
    mirrored = excitation(own, 2 * math.pi / interval - np.asarray(omega))
    return mirrored <= _UNFOLDED * excitation(own, omega)


def excited_band(sources: Sequence[Source]) -> tuple[float, float]:
    """Lowest and highest angular frequency that count as excited, rad/s; see EXCITED."""
    bands = [source.excited for source in sources]
    return min(low for low, _ in bands), max(high for _, high in bands)
