"""Signals of the receivers of a pulse test, checked, with the noise that each shows beforehand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.readings.pulse.first_break import WEAK, onset

Float = NDArray[Any]

# The part of the time before the first break that counts as quiet: an emergent onset has a foot.
QUIET_PART = 0.75
# Fewer quiet samples tell nothing of a noise.
FEWEST_QUIET = 32
FEWEST_SAMPLES = 32
# Rounding is a noise too, of this part of the peak: a simulated signal has no other.
_ROUNDING = 2.0**-53


class PulseError(ValueError):
    """Signals that can't be used; one line that names what, and the remedy."""


@dataclass(frozen=True)
class PulseRecord:
    """Signals of receivers along a line, ordered by position.

    Attributes:
        t: times, even, shape (nt,), s; may start anywhere.
        names: of the receivers, m of them.
        x: their positions, ascending, shape (m,), m.
        values: signals u, shape (nt, m), any one unit.
        quiet: time up to which each is nothing but noise, shape (m,), s; t₀ where none is known,
            infinite where no arrival stands out at all.
    """

    t: Float
    names: tuple[str, ...]
    x: Float
    values: Float
    quiet: Float

    @property
    def interval(self) -> float:
        """Δt, s."""
        return float((self.t[-1] - self.t[0]) / (len(self.t) - 1))

    def index(self, name: str) -> int:
        """Which receiver has this name.

        Raises:
            PulseError: none has.
        """
        if name not in self.names:
            raise PulseError(f"receiver {name!r}: unknown; take one of {', '.join(self.names)}")
        return self.names.index(name)

    @cached_property
    def noise(self) -> Float:
        """Standard deviation before the arrival, shape (m,), unit of u; NaN where it is unknown."""
        result = np.full(len(self.names), np.nan)
        for j, part in enumerate(self._quiet_parts()):
            if len(part) >= FEWEST_QUIET:
                result[j] = np.std(part, ddof=1)
        return np.maximum(result, self._rounding)

    def density(self, frequency: Float) -> Float:
        """Two-sided power density of the noise before the arrival, by Welch's method.

        Args:
            frequency: f, shape (n,), Hz.

        Returns:
            S, shape (n, m), unit of u squared, times s; NaN where the quiet part is too short.
        """
        from scipy.signal import welch  # slow to import, and only a reading needs it

        result = np.full((len(frequency), len(self.names)), np.nan)
        for j, part in enumerate(self._quiet_parts()):
            if len(part) >= FEWEST_QUIET:
                f, power = welch(
                    part, 1 / self.interval, nperseg=max(16, len(part) // 4), scaling="density"
                )
                # Welch takes the mean out, so the lowest bin is empty; the one-sided ends are not
                # doubled.
                result[:, j] = np.interp(np.abs(frequency), f[1:-1], power[1:-1]) / 2
        return np.maximum(result, self._rounding**2 * self.interval)

    @property
    def _rounding(self) -> Float:
        return _ROUNDING * np.abs(self.values).max(axis=0)

    def _quiet_parts(self) -> list[Float]:
        return [self.values[self.t < end, j] for j, end in enumerate(self.quiet)]


def pulse_record(
    t: ArrayLike,
    signals: Mapping[str, ArrayLike],
    positions: Mapping[str, float],
    quiet_until: float | None = None,
) -> PulseRecord:
    """Check signals and order them by position.

    Args:
        t: times, even, shape (nt,), s; may start anywhere.
        signals: u of each receiver, shape (nt,) each.
        positions: x of each receiver, m.
        quiet_until: time before which no receiver has a signal yet, s; where None, three quarters
            of the time to each receiver's own first break.

    Returns:
        The record. A constant offset stays: take it out beforehand.

    Raises:
        PulseError: fewer than two receivers, or what is given doesn't fit together.
    """
    time = np.asarray(t, float)
    if time.ndim != 1 or len(time) < FEWEST_SAMPLES:
        raise PulseError(
            f"t: {time.size} samples; must be one row of at least {FEWEST_SAMPLES}: record longer"
        )
    steps = np.diff(time)
    step = float(np.mean(steps))
    if not (step > 0 and np.abs(steps - step).max() <= 1e-3 * step):
        raise PulseError("t: must ascend in even steps; resample the signals")
    if len(signals) < 2:
        raise PulseError(f"signals: {len(signals)} receivers; at least 2 are needed")
    if set(signals) != set(positions):
        odd = sorted(set(signals) ^ set(positions))
        raise PulseError(f"receiver {odd[0]!r}: must have both a signal and a position; give both")
    names = tuple(sorted(signals, key=lambda name: positions[name]))
    x = np.array([positions[name] for name in names], float)
    if not (np.isfinite(x).all() and (np.diff(x) > 0).all()):
        raise PulseError(f"positions = {x.tolist()} m: must be finite and all different")
    for name in names:
        one = np.asarray(signals[name])
        if one.shape != time.shape or np.iscomplexobj(one) or not np.isfinite(one).all():
            raise PulseError(
                f"signal {name!r}: must be {len(time)} real, finite values, as many as t; it has "
                f"shape {one.shape}"
            )
    values = np.stack([np.asarray(signals[name], float) for name in names], axis=1)
    if quiet_until is None:
        picks = [onset(values[:, j]) for j in range(len(names))]
        breaks = np.array([0.0 if np.isnan(place) else place for place, _, _ in picks])
        quiet = time[0] + QUIET_PART * step * breaks
        # What nothing stands out of is noise from end to end.
        quiet[[reason == WEAK for _, _, reason in picks]] = np.inf
    else:
        quiet = np.full(len(names), float(quiet_until))
    return PulseRecord(time, names, x, values, quiet)
