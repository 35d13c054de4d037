"""Whether one wave alone passes several receivers, or more, and how fast each of them goes.

A wave alone leaves U_j = g_j A e^{ikx_j} at each frequency, with gains g_j of the receivers that no
frequency changes. Waves that have parted are packets, tops of the envelope, each on a line
t = t₀ + x/c of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.first_break import envelope
from wavesim.readings.pulse.phase_unwrapping import OPEN
from wavesim.readings.pulse.signals import PulseRecord
from wavesim.readings.pulse.spectral_windows import Spectra
from wavesim.readings.pulse.wavenumber_and_attenuation import Dispersion
from wavesim.records.windows import moving_mean

Float = NDArray[Any]

# A packet counts from this part of its receiver's largest on, and as much above the noise; tops of
# two packets stand this far apart, and on a line within that much, in periods.
_COUNTS, _ABOVE_NOISE, _APART, _ON_LINE = 0.2, 6.0, 0.6, 0.3
# Logarithms of two waves' speeds differ by so much at least, and at most.
_DIFFER, _FURTHEST = 0.1, 1.1
# Waves are mixed where one leaves this part, and so many times the noise's; and by so many
# frequencies on end it is lost.
_MIXED, _OVER_NOISE, _ON_END = 0.1, 4.0, 3
MIXED = "one wave alone leaves a tenth of the receivers' power or more: several pass"
# A line has packets at this part of the receivers, and so many waves are told of.
_HEARD, _MOST = 0.6, 3


@dataclass(frozen=True)
class Passing:
    """A wave that passes the receivers.

    Attributes:
        velocity: m/s.
        size: mean of its packets, over the largest of their receiver.
        time: tops of its packets, shape (m,), s; NaN where it has none.
        alone: the same, NaN too where another wave's is the same packet.
    """

    velocity: float
    size: float
    time: Float
    alone: Float

    @property
    def count(self) -> int:
        """Receivers that it has a packet at."""
        return int(np.isfinite(self.time).sum())


def waves_passing(record: PulseRecord, period: float) -> list[Passing]:
    """Waves of different speeds that run towards larger x, three at most, the largest first.

    Args:
        record: the signals.
        period: of the central frequency, s.
    """
    from scipy.signal import find_peaks  # slow to import, and only a reading needs it

    own = [j for j, why in enumerate(record.unusable) if not why]
    if len(own) < 2:
        return []
    reach = max(1, int(_APART * period / record.interval))
    tops: list[tuple[Float, Float]] = []
    for j in own:
        size = moving_mean(envelope(record.values[:, j]), max(3, reach // 2))
        least = max(_COUNTS * size.max(), _ABOVE_NOISE * float(np.nan_to_num(record.noise[j])))
        at, _ = find_peaks(size, height=least, distance=reach, prominence=least / 2)
        if not len(at):
            return []
        tops.append((record.t[at], size[at] / size.max()))
    x, last = record.x[own], tops[-1][0]
    found: list[Passing] = []
    # From the last receiver, where they have parted furthest, to each of the earlier half.
    for a, b in product(range(max(1, len(own) // 2)), range(len(last))):
        for start in (
            tops[a][0][len(tops[a][0]) - len(last) + b :][:1] if len(own) < 3 else tops[a][0]
        ):
            slowness = (last[b] - start) / (x[-1] - x[a])
            if slowness > 0:
                found.append(_on_line(tops, x, last[b] + slowness * (x - x[-1]), slowness, period))
    enough = [one for one in found if one.count >= max(2, _HEARD * len(own))]
    enough.sort(key=lambda one: (-one.count, -one.size))
    kept: list[Passing] = []
    for one in enough:
        if all(_another(one, other, period) for other in kept):
            kept.append(one)
    kept = sorted(kept, key=lambda one: -one.size)[:_MOST]
    if not kept:
        return []
    whole = np.full((len(kept), len(record.x)), np.nan)
    whole[:, own] = [one.time for one in kept]
    return [
        replace(
            one, time=time, alone=np.where((time == np.delete(whole, i, 0)).any(0), np.nan, time)
        )
        for i, (one, time) in enumerate(zip(kept, whole, strict=True))
    ]


def _on_line(
    tops: list[tuple[Float, Float]], x: Float, line: Float, slowness: float, period: float
) -> Passing:
    """A wave along a line of times, with the packets that lie on it."""
    time, size = np.full(len(x), np.nan), []
    for j, (at, (place, sizes)) in enumerate(zip(line, tops, strict=True)):
        near = int(np.argmin(np.abs(place - at)))
        if abs(place[near] - at) <= _ON_LINE * period:
            time[j] = place[near]
            size.append(float(sizes[near]))
    return Passing(float(1 / slowness), float(np.mean(size)), time, time)


def _another(one: Passing, other: Passing, period: float) -> bool:
    """Whether one is a wave beside another: of another speed, apart from it at the last receiver,
    and the faster one ahead at the first, as of one source."""
    if not _DIFFER < abs(math.log(one.velocity / other.velocity)) < _FURTHEST:
        return False
    fast, slow = sorted((one, other), key=lambda each: -each.velocity)
    both = np.isfinite(fast.time) & np.isfinite(slow.time)
    ahead = (slow.time - fast.time)[both]
    return bool(len(ahead) and ahead[-1] > _APART * period and ahead[0] > -_ON_LINE * period)


def unexplained(seen: Spectra, found: Dispersion) -> tuple[Float, Float]:
    """Parts of the power of receivers above the noise that one wave leaves, and that is noise (0
    where unknown), shape (n,) each; NaN where these are fewer than three, or there is no k."""
    heard = seen.above
    own = np.isfinite(found.damped) & (heard.sum(axis=1) > 2)
    U, k = np.where(heard, seen.values, 0), np.where(own, found.damped, 1.0)
    away = np.where(k[:, None].imag < 0, seen.x - seen.x[-1], seen.x - seen.x[0])
    wave = np.exp(1j * k[:, None] * away) * heard
    weight = np.maximum((np.abs(wave) ** 2).sum(axis=1), 1e-290)
    wave = wave * ((np.conj(wave) * U).sum(axis=1) / weight)[:, None]
    each = np.maximum((np.abs(wave[own]) ** 2).sum(axis=0), 1e-290)
    gain = (np.conj(wave) * U)[own].real.sum(axis=0) / each
    power = np.maximum((np.abs(U) ** 2).sum(axis=1), 1e-290)
    left = (np.abs(U - gain * wave) ** 2).sum(axis=1) / power
    noise = (np.nan_to_num(seen.noise * heard) ** 2).sum(axis=1) / power
    return np.where(own, left, np.nan), np.where(own, noise, np.nan)


def of_one_wave(
    seen: Spectra, found: Dispersion, expected: tuple[float, float] | None = None
) -> Dispersion:
    """A dispersion with nothing where two waves are as loud, nor past where they are so at several
    frequencies on end: which multiple of 2π their phases are at is not known there.

    Args:
        seen, found: spectra, and what one wave of them is.
        expected: as for :func:`~wavesim.readings.pulse.wavenumber_and_attenuation.dispersion`; the
            wave is followed from there, or from the lowest frequency.
    """
    left, noise = unexplained(seen, found)
    with np.errstate(invalid="ignore"):
        mixed = left > np.maximum(_MIXED, _OVER_NOISE * noise)
    own = np.flatnonzero(np.isfinite(left) & ~mixed)
    if not mixed.any() or not len(own):
        return found
    among = np.convolve(mixed, np.ones(_ON_END), "same") > _ON_END - 0.5
    start = own[0]
    if expected is not None:
        start = own[np.argmin(np.abs(found.omega[own] - 2 * np.pi * expected[0]))]
    passed = np.cumsum(among)
    return found.refused(OPEN, passed != passed[start]).refused(MIXED, mixed)
