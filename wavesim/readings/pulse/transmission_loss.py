"""Transmission loss between two receivers, 20 log₁₀ |U_out/U_in|(ω) in dB."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.signals import PulseRecord
from wavesim.readings.pulse.spectral_windows import ABOVE_NOISE, ABOVE_TRUNCATION, Spectra

Float = NDArray[Any]

NOISY = "the output is below the noise"
UNDRIVEN = "the source's spectrum is under 1 % of its peak"
UNHEARD = "the input is below the noise"


@dataclass(frozen=True)
class Loss:
    """Transmission from one receiver to another.

    Attributes:
        first, last: names of input and output.
        omega: shape (n,), rad/s.
        level: 20 log₁₀ |U_out/U_in|, shape (n,), dB: negative where the output is smaller.
        error: its standard error, shape (n,), dB; NaN where the noise is unknown.
        floor: level at which the output would stand at the limit of being told from noise and
            truncation, shape (n,), dB; −inf where nothing hides it, NaN where that is unknown.
        reason: why a level doesn't count, n of them; "" where it does.
    """

    first: str
    last: str
    omega: Float
    level: Float
    error: Float
    floor: Float
    reason: tuple[str, ...]

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where the level counts, shape (n,)."""
        return np.array([not reason for reason in self.reason])


def transmission_loss(record: PulseRecord, seen: Spectra, first: str, last: str) -> Loss:
    """Loss between two receivers.

    Args:
        record: the signals.
        seen: their spectra.
        first, last: names of input and output.

    Returns:
        The loss; at the complex frequencies ω + iσ where the window is exponential.

    Raises:
        PulseError: no receiver has that name.
    """
    i, o = record.index(first), record.index(last)
    entered, left = np.abs(seen.values[:, i]), np.abs(seen.values[:, o])
    noise = seen.noise
    to_decibels = 20 / np.log(10)
    with np.errstate(divide="ignore", invalid="ignore"):
        level = 20 * np.log10(left / entered)
        # Of the noise only the part along U changes |U|: half of its variance.
        error = to_decibels * np.sqrt(
            ((noise[:, i] / entered) ** 2 + (noise[:, o] / left) ** 2) / 2
        )
        hidden = np.maximum(ABOVE_NOISE * noise[:, o], ABOVE_TRUNCATION * seen.truncation[o])
        floor = 20 * np.log10(hidden / entered)
    reason = np.where(seen.above[:, o], "", NOISY)
    reason = np.where(seen.above[:, i], reason, UNHEARD)
    reason = np.where(seen.driven, reason, UNDRIVEN)
    unusable = next((why for why in (record.unusable[i], record.unusable[o]) if why), "")
    reason = np.full(len(reason), unusable) if unusable else reason
    return Loss(first, last, seen.omega, level, error, floor, tuple(reason.tolist()))
