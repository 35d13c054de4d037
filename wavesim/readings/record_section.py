"""What receivers recorded of one field, as a record section shows it: order, scale, how much."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.simulation.field import Field

Float = NDArray[Any]

# Traces have one scale where the smallest peak is this part of the largest.
_ALIKE = 0.25
# A trace has arrived at this part of its peak, and is silent below that one.
ARRIVED, _SILENT = 0.05, 0.02
# So far below what moved anywhere else a trace is rounding, or nothing.
_STILL = 1e-12
_MOST_PERIODS = 30


@dataclass(frozen=True)
class Section:
    """Signals of one field at all receivers, in the order of their positions.

    Attributes:
        order: name and position (m) of each receiver, n of them.
        signals: shape (n, times), in the field's unit.
        peaks: largest |signal| of each, shape (n,); 0 where nothing moved.
        scale: what each trace is drawn over, shape (n,): the largest peak of all where they are
            alike, else its own; 1 where nothing moved.
        alike: whether they have one scale.
        first: frame of the first value of 5 % of the peak, shape (n,).
        end: until when there is something to be read, s.
    """

    order: list[tuple[str, float]]
    signals: Float
    peaks: Float
    scale: Float
    alike: bool
    first: NDArray[np.int_]
    end: float

    @property
    def arrived(self) -> NDArray[np.bool_]:
        """Where something arrives within the record."""
        return (self.peaks > 0) & (self.first > 0)


def record_section(field: Field, name: str) -> Section:
    """The record section of a field.

    Args:
        field: read where it is looked at.
        name: of one of its fields.
    """
    order = sorted(field.receivers.items(), key=lambda item: item[1])
    signals = np.array([field.at(position, name) for _, position in order])
    peaks = np.abs(signals).max(axis=1)
    peaks = np.where(peaks > _STILL * _largest(field, name), peaks, 0.0)
    alike = float(peaks.min()) >= _ALIKE * float(peaks.max())
    scale = np.where(peaks > 0, peaks.max() if alike else peaks, 1.0)
    first = np.argmax(np.abs(signals) >= ARRIVED * np.maximum(peaks, 1e-300)[:, None], axis=1)
    end = _last_shown(field, signals, peaks, first)
    return Section(order, signals, peaks, scale, alike, first, end)


def _largest(field: Field, name: str) -> float:
    """Largest |value| in a few frames of a field."""
    every = max(1, len(field.t) // 16)
    return float(np.abs(field.part(name, slice(0, None, every), slice(None))).max(initial=0.0))


def spectra(field: Field, signals: Float) -> tuple[Float, Float]:
    """Frequencies, Hz, and |∫ signal e^{iωt} dt| of each, of the record faded out at its end."""
    f = np.fft.rfftfreq(4 * signals.shape[1], field.interval)
    tapered = signals * _end_taper(signals.shape[1])
    return f, np.abs(np.fft.rfft(tapered, 4 * signals.shape[1])) * field.interval


def _end_taper(count: int) -> Float:
    """1 over the record but for its last fifth, where it falls to 0 as a cosine.

    It leaves early arrivals as they are, so that spectra at different distances compare. To load
    scipy.signal for it would take longer than to draw with it.
    """
    whole = 2 * count - 1
    left = np.arange(count)[::-1] / whole
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.minimum(left / 0.1, 1.0)))


def _last_shown(field: Field, signals: Float, peaks: Float, first: Any) -> float:
    """Until when a record section shows something that can be read, s."""
    least = np.where(peaks > 0, _SILENT * peaks, np.inf)
    loud = (np.abs(signals) > least[:, None]).any(axis=0)
    if not loud.any():
        return float(field.t[-1])
    end = 1.05 * float(field.t[np.flatnonzero(loud)[-1]])
    f, power = spectra(field, signals)
    peak = float(f[np.argmax(np.sum(power**2, axis=0))])
    if peak > 0:
        end = min(end, float(field.t[first.max()]) + _MOST_PERIODS / peak)
    return min(end, float(field.t[-1]))
