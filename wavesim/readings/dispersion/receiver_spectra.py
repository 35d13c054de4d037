"""Transforms of a line's receivers: which count at which frequency, and how sure that is.

Of a record that begins or ends inside its signal the transform of u under a window h shows other
frequencies' waves at ω: where all is e^{ik(ω)x}, ∂ ln U/∂x = ik + (dk/dω) U′/U, with U′ that of u
under dh/dt. |U′/U| is by how much ω is unsure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # its parts are loaded where they are used: they take a while
from numpy.typing import NDArray

from wavesim.readings.dispersion.noise_level import noise_of_transform
from wavesim.records.faults.moveout import muted_until
from wavesim.records.faults.quiet import fine_noise
from wavesim.records.windows import hann

Float = NDArray[Any]
Complex = NDArray[np.complex128]

# Receivers count where they stand so many deviations above the noise, and so many at least.
_ABOVE_NOISE = 1.0
# … and the middle one of so many about each so many.
_NEIGHBOURS, _ABOUT = 5, 1.5
FEWEST = 5
# What a window's slope shows is no noise by so many deviations.
_SURELY = 3.0
# Both ends are let down where so much more of the power is then of sure frequency.
_CLEARLY = 0.1
# The record's last part is let down to 0.
_TAPER = 0.05
# Below this part of the strongest frequency's amplitude nothing is looked at.
_FAINT = 1e-4


@dataclass(frozen=True)
class Spectra:
    """Transforms of a line's receivers, arrays (n, nx) but for the frequencies.

    Attributes:
        omega: shape (n,), rad/s.
        U: ∫ u h e^{iωt} dt, unit of the record times s.
        noise: standard deviation of its noise, likewise.
        weight: what each receiver's phase tells, 1 far above the noise, 0 within it, –.
        unsure: by how much the frequency is, as the window says, rad/s.
    """

    omega: Float
    U: Complex
    noise: Float
    weight: Float
    unsure: Float

    def take(self, rows: Any) -> Spectra:
        """Those at some frequencies, by mask or number."""
        return Spectra(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def spectra(values: Float, interval: float, quantum: Float | float = 0.0) -> Spectra:
    """Transforms of a record whose end is let down, or both ends where it is inside a signal.

    Args:
        values: u, shape (nt, nx).
        interval: Δt, s.
        quantum: least step between samples, shape (nx,) or (), unit of the values.
    """
    count = len(values)
    fall = max(2, int(_TAPER * count))
    let_down = np.ones(count)
    let_down[-fall:] = 0.5 * (1 + np.cos(np.pi * np.arange(fall) / fall))
    omega = 2 * np.pi * np.fft.rfftfreq(count, interval)[1:]
    noise = noise_of_transform(values, interval, omega, quantum) / np.sqrt(count)
    muted = _after_mute(values, np.broadcast_to(quantum, values.shape[1]))
    best, most = None, 0.0
    for window in (let_down, hann(count)):
        change = np.diff(window, prepend=0.0)
        change[-1] -= window[-1]
        U, V = (_transform(values * h[:, None], interval) for h in (window, change))
        of_U, of_V = (noise * np.sqrt(np.sum(h**2)) for h in (window, change))
        excess = np.maximum(np.abs(V) ** 2 - (_SURELY * of_V) ** 2, 0)
        unsure = (
            np.hypot(np.sqrt(excess), muted * interval) / np.maximum(np.abs(U), 1e-290) / interval
        )
        weight = _weights(U, of_U)
        weight[np.abs(U).max(axis=1) < _FAINT * np.abs(U).max()] = 0.0
        power = np.abs(U) ** 2 * (weight > 0)
        share = float(np.sum(power * (unsure < omega[0])) / max(np.sum(power), 1e-290))
        if best is None or share > most + _CLEARLY:
            best, most = Spectra(omega, U, of_U, weight, unsure), share
    assert best is not None
    return best


def _after_mute(values: Float, quantum: Float) -> Float:
    """Largest |u| above the noise in the first quarter of a period behind a mute, shape (nx,); 0 at
    receivers without one."""
    size = np.zeros(values.shape[1])
    for j in np.flatnonzero(first := muted_until(values, quantum)):
        v = values[first[j] :, j]
        # A quarter of the period of the mean ω by power.
        quarter = int(
            np.pi / 2 * np.sqrt(np.sum(v**2) / max(float(np.sum(np.diff(v) ** 2)), 1e-290))
        )
        size[j] = np.abs(v[: quarter + 1]).max()
    noise = np.median([fine_noise(v) for v in values.T])
    return np.sqrt(np.maximum(size**2 - (_SURELY * noise) ** 2, 0))


def _transform(values: Float, interval: float) -> Complex:
    """∫ u e^{iωt} dt, shape (n, nx), but for ω = 0."""
    return np.asarray(np.conj(np.fft.rfft(values, axis=0))[1:] * interval, complex)


def _weights(U: Complex, noise: Float) -> Float:
    """What each receiver's phase tells, shape of U: 1 far above the noise, 0 within it."""
    strength = np.abs(U) / np.maximum(noise, 1e-290)
    # Noise alone is above its own deviation at one of three receivers, but not all about it.
    about = scipy.ndimage.median_filter(strength, size=(1, _NEIGHBOURS), mode="nearest")
    heard = (strength > _ABOVE_NOISE) & (about > _ABOUT)
    heard &= heard.sum(axis=1, keepdims=True) >= FEWEST
    return np.where(heard, strength**2 / (strength**2 + 1), 0.0)
