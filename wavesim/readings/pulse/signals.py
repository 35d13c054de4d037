"""Signals of the receivers of a pulse test, checked, with the noise that each shows beforehand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.readings.pulse import faults
from wavesim.readings.pulse.first_break import AT_THE_END, WEAK, onset
from wavesim.records.evenness import even
from wavesim.records.faults.baseline import without_baseline
from wavesim.records.faults.clipping import clipped
from wavesim.records.faults.fill_values import within_range, without_fill
from wavesim.records.faults.finding import Finding
from wavesim.records.faults.moveout import begun
from wavesim.records.faults.quantisation import quanta
from wavesim.records.faults.quiet import FEWEST, rest
from wavesim.records.faults.steps import ENDS, level_moves, without_steps
from wavesim.records.windows import noise_density

Float = NDArray[Any]

# The part of the time before the first break that counts as quiet: an emergent onset has a foot.
QUIET_PART = 0.75
# Fewer quiet samples tell nothing of a noise.
FEWEST_QUIET = 32
NO_QUIET = "no error: the record begins too shortly before the signal"
FEWEST_SAMPLES = 32
# Times even to this part of their interval count as even, and to that part they stay as written.
_EVEN, _AS_WRITTEN = 1e-3, 1e-6
# Rounding is a noise too, of this part of the peak: a simulated signal has no other.
_ROUNDING = 2.0**-53
# Samples a period: from which on they stay, up to which they are too few, as made of them, and from
# which on that needs no word.
_FEWEST_PER_PERIOD, _TOO_FEW, _PER_PERIOD, _ENOUGH = 24, 3.5, 32, 10
_STRONG = 0.05
# A quiet part that bends by this many deviations of its roughness wanders.
_BENDS = 1.5
# A level that has moved by this part of the peak at the end is no wave's, nor a base.
_MOVED = 0.2
CLIPPED = "flat tops: the signal is clipped; lower the gain"
MARKED = "it holds a mark of overload: record it again with less gain"
WANDERS = "its base wanders before the arrival: take drift or hum out, or record longer before it"
MOVED = (
    "it ends at another level than it begins at, and arrivals are told from one: take the base's "
    "movement out, or, if the wave leaves it there, give its rate of change"
)
REVERSED = "reversed beside the others, turned over; check its polarity"
BEGUN = "the record begins within the signal: trigger earlier"


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
        filled: samples at each one's beginning that were filled in, shape (m,).
        unusable: why the shape of each one's signal tells nothing, m of them; "" where it does.
        notes: what was put right, and what keeps a receiver from being read.
        known: standard deviation of the noise where the signals don't show it, unit of u; NaN where
            nothing tells it, 0 in a simulation.
    """

    t: Float
    names: tuple[str, ...]
    x: Float
    values: Float
    quiet: Float
    filled: NDArray[np.int_]
    unusable: tuple[str, ...]
    notes: tuple[str, ...] = ()
    known: float = np.nan

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
        result = np.full(len(self.names), self.known)
        for j, part in enumerate(self._quiet_parts()):
            if len(part) >= FEWEST_QUIET:
                result[j] = np.std(part, ddof=1)
        return np.maximum(result, self._least)

    def density(self, frequency: Float) -> Float:
        """Two-sided power density of the noise before the arrival, by Welch's method.

        Args:
            frequency: f, shape (n,), Hz.

        Returns:
            S, shape (n, m), unit of u squared, times s; NaN where the quiet part is too short.
        """
        result = np.full((len(frequency), len(self.names)), np.nan)
        for j, part in enumerate(self._quiet_parts()):
            if len(part) >= FEWEST_QUIET:
                result[:, j] = noise_density(part, self.interval, frequency)
        return np.maximum(result, self._least**2 * self.interval)

    @cached_property
    def _least(self) -> Float:
        """Noise of rounding, shape (m,): of the digitiser, LSB/√12, or of the arithmetic."""
        steps = quanta(self.values[None])
        return np.maximum(_ROUNDING * np.abs(self.values).max(axis=0), steps / np.sqrt(12))

    def _quiet_parts(self) -> list[Float]:
        return [
            self.values[first : int(np.searchsorted(self.t, end)), j]
            for j, (first, end) in enumerate(zip(self.filled, self.quiet, strict=True))
        ]


def pulse_record(
    t: ArrayLike,
    signals: Mapping[str, ArrayLike],
    positions: Mapping[str, float],
    quiet_until: float | None = None,
    noise: float = np.nan,
) -> PulseRecord:
    """Check signals and order them by position.

    Args:
        t: times, even, shape (nt,), s; may start anywhere.
        signals: u of each receiver, shape (nt,) each.
        positions: x of each receiver, m.
        quiet_until: time before which no receiver has a signal yet, s; where None, three quarters
            of the time to each receiver's own first break.
        noise: its standard deviation where no signal shows it, unit of u; 0 in a simulation.

    Returns:
        The record, without offsets, on even times.

    Raises:
        PulseError: fewer than two receivers, or what is given doesn't fit together.
    """
    time, notes = even_time_axis(t)
    step = float(time[1] - time[0])
    if len(signals) < 2:
        raise PulseError(f"signals: {len(signals)} receivers; at least 2 are needed")
    if set(signals) != set(positions):
        odd = sorted(set(signals) ^ set(positions))
        raise PulseError(f"receiver {odd[0]!r}: must have both a signal and a position; give both")
    names = tuple(sorted(signals, key=lambda name: positions[name]))
    x = np.array([positions[name] for name in names], float)
    if not (np.isfinite(x).all() and (np.diff(x) > 0).all()):
        raise PulseError(f"positions = {x.tolist()} m: must be finite and all different")
    values = np.stack([checked(name, signals[name], time) for name in names], axis=1)
    found: list[Finding] = []
    why = np.array([""] * len(names), object)
    why[marked(values, time, x, names, found)] = MARKED
    if (why == "").sum() < 2:
        raise PulseError(f"{found[-1].said}; at least 2 receivers without any are needed")
    values[:, why == MARKED] = 0.0
    filled = np.array([faults.padding(u) for u in values.T])
    quantum = quanta(values[None])
    flat = clipped(values[None], quantum)[0]
    for j, first in enumerate(filled):
        values[:first, j] = values[first, j] if first else 0.0
    without_steps(values, time, x, names, found)
    at_rest = rest(values, quantum)
    values = without_baseline(values, time, x, names, quantum, at_rest, found)
    quiet = np.full(len(names), np.nan if quiet_until is None else float(quiet_until))
    for j, first in enumerate(filled.tolist()):
        own = values[first:, j]
        if quiet_until is None:
            quiet[j] = time[0] + step * (first + _quiet_samples(own))
        count = int(np.searchsorted(time, quiet[j])) - first
        if count >= FEWEST_QUIET and not why[j] and _wanders(own, count):
            why[j] = WANDERS
        elif not why[j]:
            why[j] = _moved(own)
    why[flat & (why != MARKED)] = CLIPPED
    why[np.isin(why, ("", WANDERS)) & begun(values, at_rest) & np.isfinite(quiet)] = BEGUN
    there = np.flatnonzero(why != MARKED)
    turned = there[faults.reversed_receivers(values[:, there], x[there])]
    values[:, turned] *= -1
    told = (
        (filled > 0, "padded: equal samples at its beginning count as none"),
        (np.isin(np.arange(len(names)), turned), REVERSED),
        *((why == one, one) for one in dict.fromkeys(why) if one),
    )
    notes += [one.said for one in found]
    notes += [f"{', '.join(np.array(names)[own])}: {one}" for own, one in told if own.any()]
    return PulseRecord(time, names, x, values, quiet, filled, tuple(why), tuple(notes), noise)


def marked(
    values: Float, t: Float, x: Float, names: tuple[str, ...], found: list[Finding]
) -> NDArray[np.bool_]:
    """Signals with marks of overload or of missing values among their samples, shape (m,)."""
    whole = without_fill(within_range(values[None].copy(), found), t, x, names, found)
    return np.asarray(~np.isfinite(whole[0]).all(axis=0))


def _wanders(u: Float, quiet: int) -> bool:
    """Whether the quiet beginning bends by more than its roughness."""
    curve = np.polynomial.Polynomial.fit(np.arange(quiet), u[:quiet], 2)(np.arange(quiet))
    rough = float(np.std(np.diff(u[:quiet]))) / np.sqrt(2)
    return bool(np.std(curve) > max(_BENDS * rough, 1e-3 * float(np.ptp(u))))


def even_time_axis(t: ArrayLike) -> tuple[Float, list[str]]:
    """Even times, and what was done to them.

    Raises:
        PulseError: they are too few, or neither even nor rounded from even ones.
    """
    time = np.asarray(t, float)
    if time.ndim != 1 or len(time) < FEWEST_SAMPLES:
        raise PulseError(
            f"t: {time.size} samples; must be one row of at least {FEWEST_SAMPLES}: record longer"
        )
    if not np.isfinite(time).all():
        raise PulseError("t: holds values that are not finite; give every time")
    found = even(time, tolerance=_EVEN) if (np.diff(time) >= 0).all() else None
    if found is None:
        raise PulseError(
            "t: must ascend in even steps, or be rounded from such; resample the signals, or give "
            "times with more digits"
        )
    if found.off <= _AS_WRITTEN:
        return time, []
    said = f"times written to {found.digit:.0e} s are taken as even, {found.step:.6g} s apart"
    return found.values(len(time)), [said]


def finely(t: Float, u: Float, v: Float | None) -> tuple[Float, Float, Float | None, list[str]]:
    """Signals with some thirty samples a period, by cubic splines, and what was done.

    Raises:
        PulseError: a period has too few samples for that.
    """
    power = np.abs(np.fft.rfft(u - np.linspace(u[0], u[-1], len(u)))) ** 2
    f = np.fft.rfftfreq(len(u))
    power = np.where(power > _STRONG * power.max(), power, 0.0)
    period = float(power.sum() / max(np.sum(f * power), 1e-300))
    if not power.any() or period >= _FEWEST_PER_PERIOD:
        return t, u, v, []
    if period < _TOO_FEW:
        raise PulseError(
            f"a period has {period:.2g} samples, too few to tell when it arrives: sample at least "
            f"{_ENOUGH / period:.2g} times as fast"
        )
    from scipy.interpolate import CubicSpline  # slow to import, and only few records need it

    times = int(np.ceil(_PER_PERIOD / period))
    place = np.arange((len(t) - 1) * times + 1) / times
    own = np.arange(len(t))
    fine = [None if row is None else CubicSpline(own, row)(place) for row in (u, v)]
    said = []
    if period < _ENOUGH:
        said = [f"a period has {period:.2g} samples: {times} times as many by cubic splines"]
    return t[0] + (t[-1] - t[0]) * place / own[-1], np.asarray(fine[0]), fine[1], said


def check_distance(distance: ArrayLike) -> None:
    """Hold distances from tip to tip (m) to what they can be.

    Raises:
        PulseError: one is 0 or less.
    """
    if not (np.asarray(distance) > 0).all():
        raise PulseError(f"distance = {np.asarray(distance)} m: must be greater than 0")


def checked(name: str, signal: ArrayLike, time: Float) -> Float:
    """A signal as an array of its own.

    Raises:
        PulseError: it is not real and finite, or not as long as the times.
    """
    one = np.asarray(signal)
    if one.shape != time.shape or np.iscomplexobj(one) or not np.isfinite(one).all():
        raise PulseError(
            f"signal {name!r}: must be {len(time)} real, finite values, as many as t; it has "
            f"shape {one.shape}"
        )
    return np.array(one, float)


def _moved(u: Float) -> str:
    """Why arrivals of a signal can't be told, whose level at the end is another than at the
    beginning; "" elsewhere. One that is reached at an end alone is of a wave that is cut there."""
    moved = abs(level_moves(u))
    if not moved > _MOVED * float(np.abs(u).max()):
        return ""
    ends = max(FEWEST, len(u) // ENDS)
    if abs(float(u[-ends:].mean() - u[-2 * ends : -ends].mean())) > moved / 2:
        return AT_THE_END
    return BEGUN if abs(float(u[:ends].mean() - u[ends : 2 * ends].mean())) > moved / 2 else MOVED


def _quiet_samples(u: Float) -> float:
    """Samples up to three quarters of the way to the first break; infinite where none stands out.

    An offset would hide the break, and the median is about it.
    """
    place, _, reason = onset(u - np.median(u))
    if reason == WEAK:
        return np.inf
    return 0.0 if np.isnan(place) else QUIET_PART * place
