"""Spectra of a record through a window, with what hides a signal at each frequency.

A time gate keeps what passes while it is open: it leaves out echoes, and is right where the signal
ends within it. Where ringing never ends, as at the edges of a gap, an exponential window exp(−σt)
ends it: the spectrum is then that of the unending signal at the complex frequency ω + iσ.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.readings.damped_transform import damped_transform
from wavesim.readings.pulse.signals import PulseError, PulseRecord
from wavesim.records.faults.steps import level_moves

Float = NDArray[Any]
Complex = NDArray[np.complex128]

# What a moved level adds to U counts so many times, beside what noise does.
_ALL_ALIKE = 2.0
# Receivers count where they stand this far above the noise, and above the truncation exp(−σT).
ABOVE_NOISE = 3.0
ABOVE_TRUNCATION = 10.0
_TAIL = 0.1
_ENDING = 0.15
# Of a whole record this part fades.
_FADES = 0.05
# A source whose spectrum is below this part of its peak drives nothing.
SOURCE_PART = 0.01


@dataclass(frozen=True)
class Gate:
    """A time gate: 1 inside, cosine flanks within its ends, 0 outside.

    Args:
        start, end: when it opens and closes at the first receiver, s.
        taper: length of each flank over that of the gate, –, from 0 to 0.5.
        velocity: at which it moves along with the wave, m/s; it stays where infinite.
        echoes: when another wave than the direct one comes within it at each receiver, s; infinite
            where none does.

    Raises:
        PulseError: a value is not admissible.
    """

    start: float
    end: float
    taper: float = 0.1
    velocity: float = math.inf
    echoes: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not self.end > self.start:
            raise PulseError(f"gate = [{self.start:g}, {self.end:g}] s: must end after its start")
        if not 0 <= self.taper <= 0.5:
            raise PulseError(f"taper = {self.taper:g}: must lie between 0 and 0.5")
        if not self.velocity > 0:
            raise PulseError(f"velocity = {self.velocity:g} m/s: must be greater than 0")

    def weights(self, t: Float, x: Float) -> Float:
        """Shape (nt, m)."""
        s = (t[:, None] - (x - x[0]) / self.velocity - self.start) / (self.end - self.start)
        inner = np.minimum(s, 1 - s)
        flank = np.clip(inner / self.taper, 0, 1) if self.taper else np.ones_like(s)
        return np.where(inner >= 0, np.sin(np.pi / 2 * flank) ** 2, 0.0)

    def ending(self, t: Float, x: Float) -> Float:
        """The gate's last part, opened slowly and closed as the gate closes, by which is seen what
        it cuts off, at the frequencies that a closing so fast throws it to, and all from echoes on;
        shape (nt, m)."""
        s = (t[:, None] - (x - x[0]) / self.velocity - self.start) / (self.end - self.start)
        opened = np.clip((s - 1 + _ENDING) / (_ENDING / 2), 0, 1)
        of_another = t[:, None] >= np.asarray(self.echoes or math.inf)
        part = np.where(of_another, 1.0, np.sin(np.pi / 2 * opened) ** 2)
        return np.asarray(part * self.weights(t, x))

    def sigma(self, t: Float) -> float:
        """0: the frequency is real."""
        return 0.0


def whole_record(t: Float, echoes: tuple[float, ...] = ()) -> Gate:
    """A gate over a whole record, of which the last 5 % fade.

    Args:
        t: its times, shape (nt,), s.
        echoes: see :class:`Gate`.
    """
    # The opening flank lies before the record: a pulse may come early in it.
    start = float(t[0]) - float(t[-1] - t[0]) * _FADES / (1 - _FADES)
    return Gate(start, float(t[-1]), _FADES, echoes=echoes)


@dataclass(frozen=True)
class Exponential:
    """The window exp(−σ(t − t₀)) over the whole record, which begins at t₀.

    Args:
        damping: σT over the record's length T, –: more leaves less of the record's end, less lets
            decay be seen further.

    Raises:
        PulseError: it is not positive.
    """

    damping: float = 18.0

    def __post_init__(self) -> None:
        if not 0 < self.damping < math.inf:
            raise PulseError(f"damping = {self.damping:g}: must be greater than 0; 18 serves")

    def weights(self, t: Float, x: Float) -> Float:
        """1, as :func:`damped_transform` puts the weight on; shape (nt, m)."""
        return np.ones((len(t), len(x)))

    def sigma(self, t: Float) -> float:
        """σ, rad/s."""
        return self.damping / float(t[-1] - t[0])


Window = Gate | Exponential


@dataclass(frozen=True)
class Spectra:
    """Spectra U = ∫ w u e^{iω(t−t₀)} dt of the receivers.

    Attributes:
        omega: real part of the frequencies, shape (n,), rad/s.
        sigma: their imaginary part σ, rad/s; 0 through a gate.
        x: positions, shape (m,), m.
        values: U, shape (n, m), unit of u times s.
        noise: standard deviation of U by the noise before the arrival, shape (n, m); NaN where
            that is unknown.
        cut: about what waves that still pass as a gate closes would add to U, and what echoes
            within it do, and levels that move by L beneath the wave, L/|ω|, shape (n, m).
        truncation: most that what follows the record may add to U, shape (m,): with the largest
            |u| of the record's last tenth, |u| exp(−σT)/σ. Through a gate 0.
        source: |spectrum| of the source's signal, or where that is not known of the first
            receiver's, shape (n,).
        duration: of a window of even weight that resolves as much, (Σw)²/Σw² Δt, s.
        unusable: why a receiver's spectrum is not that of its wave, m of them; "" where it is.
    """

    omega: Float
    sigma: float
    x: Float
    values: Complex
    noise: Float
    truncation: Float
    source: Float
    duration: float
    cut: Float
    unusable: tuple[str, ...] = ()

    @property
    def whole(self) -> NDArray[np.bool_]:
        """Receivers whose spectrum is that of their wave, shape (m,)."""
        return np.array([not why for why in self.unusable or [""] * len(self.x)])

    @property
    def noise_known(self) -> bool:
        """Whether the noise of every whole receiver is."""
        own = self.noise[:, self.whole]
        return bool(np.isfinite(own).all() and (own > 0).all())

    @property
    def above(self) -> NDArray[np.bool_]:
        """Where a receiver is whole, and above noise and truncation, shape (n, m)."""
        floor = np.maximum(
            ABOVE_NOISE * np.hypot(np.nan_to_num(self.noise), self.cut),
            ABOVE_TRUNCATION * self.truncation,
        )
        return (np.abs(self.values) > floor) & self.whole

    @property
    def driven(self) -> NDArray[np.bool_]:
        """Where the source's spectrum is above 1 % of its peak among these, shape (n,)."""
        return np.asarray(self.source >= SOURCE_PART * self.source.max())


def spectra(
    record: PulseRecord, window: Window, omega: ArrayLike, source: Float | None = None
) -> Spectra:
    """Transform a record through a window.

    Args:
        record: the signals.
        window: a gate, or an exponential.
        omega: real frequencies, shape (n,), > 0, ascending, below the Nyquist frequency, rad/s.
        source: the source's signal, shape (nt,); it is not gated. Without it the first receiver
            stands for the source, and what a gap takes away before it counts as not driven.

    Returns:
        The spectra.

    Raises:
        PulseError: frequencies are not admissible, or the gate holds fewer than two samples.
    """
    omega = np.asarray(omega, float)
    highest = np.pi / record.interval
    if not (len(omega) and omega[0] > 0 and (np.diff(omega) > 0).all() and omega[-1] < highest):
        raise PulseError(
            f"omega: must ascend from above 0 to below the Nyquist frequency {highest:g} rad/s"
        )
    t = record.interval * np.arange(len(record.t))
    sigma = window.sigma(record.t)
    weights = window.weights(record.t, record.x)
    if ((weights > 0).sum(axis=0) < 2).any():
        raise PulseError(
            f"gate: leaves nothing of a record from {record.t[0]:g} to {record.t[-1]:g} s; move it"
        )
    U = damped_transform(record.values * weights, t, omega, sigma)
    total = weights * np.exp(-sigma * t)[:, None]
    power = (total**2).sum(axis=0) * record.interval
    noise = np.sqrt(record.density(omega / (2 * np.pi)) * power)
    cut = np.zeros_like(noise)
    if isinstance(window, Gate):
        # Waves that still pass as the gate closes are cut off: they go on about as they were.
        # An echo within it is no part of the direct wave.
        last = record.values * window.ending(record.t, record.x)
        cut = np.abs(damped_transform(last, t, omega, 0.0))
    # A level that is another behind the wave than before it moved somewhere beneath it; all of it
    # may turn phases, of which noise takes half of its power, and those of all frequencies alike.
    moved = np.abs([level_moves(u) for u in record.values.T])
    beneath = moved * np.exp(-sigma * t[np.abs(record.values).argmax(axis=0)])
    cut = np.hypot(cut, _ALL_ALIKE * beneath / np.abs(omega + 1j * sigma)[:, None])
    tail = np.abs(record.values[t > (1 - _TAIL) * t[-1]]).max(axis=0)
    truncation = tail * np.exp(-sigma * t[-1]) / sigma if sigma else 0 * tail
    duration = float((total[:, 0].sum() * record.interval) ** 2 / power[0])
    driving = np.abs(U[:, 0] if source is None else damped_transform(source, t, omega, sigma))
    return Spectra(omega, sigma, record.x, U, noise, truncation, driving, duration, cut,
                   record.unusable)  # fmt: skip
