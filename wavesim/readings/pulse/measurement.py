"""A pulse test read whole: arrivals, velocities, dispersion, attenuation, Q, transmission loss."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.material.shown import plain
from wavesim.readings.pulse.arrivals import CONVENTIONS, Arrivals, arrivals
from wavesim.readings.pulse.quality_over_band import (
    Quality,
    constant_quality_of_amplitudes,
    mean_quality,
    under_its_assumption,
)
from wavesim.readings.pulse.signals import CLIPPED, PulseError, PulseRecord, pulse_record
from wavesim.readings.pulse.spectral_windows import Spectra, Window, spectra, whole_record
from wavesim.readings.pulse.transmission_loss import Loss, transmission_loss
from wavesim.readings.pulse.velocity import Velocity, arrival_velocity, not_by_noise, told
from wavesim.readings.pulse.wavenumber_and_attenuation import Dispersion, dispersion

Float = NDArray[Any]

_MOST_FREQUENCIES = 400
# Whose velocity gives the travel times of the spectral ratio: the first that there is.
_FOR_TRAVEL_TIME = ("correlation", "envelope", "threshold", "first break")


@dataclass(frozen=True)
class PulseResult:
    """All that was read.

    Attributes:
        record: the signals.
        window: through which spectra were taken.
        arrivals, speeds: by convention; a speed's error is NaN where none is known.
        spectra: of the receivers, n frequencies.
        dispersion: complex k and what follows.
        constant_quality: Q by the spectral ratio over all n frequencies, which takes the velocity
            as constant; its reason says where it is not.
        loss: between the receivers named.
    """

    record: PulseRecord
    window: Window
    arrivals: dict[str, Arrivals]
    speeds: dict[str, Velocity]
    spectra: Spectra
    dispersion: Dispersion
    constant_quality: Quality
    loss: Loss

    @property
    def velocities(self) -> dict[str, Velocity]:
        """Speeds as answers: with an error, or NaN with a reason."""
        return told(self.speeds)

    def refused(self, why: str) -> PulseResult:
        """The same with no velocity and nothing at any frequency, for one reason."""
        none = Velocity(math.nan, math.nan, math.nan, math.nan, 0, why)
        speeds = dict.fromkeys(self.speeds, none)
        return replace(self, speeds=speeds, dispersion=self.dispersion.refused(why))

    @property
    def quality(self) -> Quality:
        """Q over the band, from α and v_g."""
        found = self.dispersion.with_errors
        of_band = mean_quality(
            found.omega, found.k, found.k_error, found.group_velocity, found.group_error,
            self.spectra.duration, found.alike,
        )  # fmt: skip
        if found.valid.any():
            return replace(of_band, reason=found.no_loss) if found.no_loss else of_band
        return replace(of_band, reason=Counter(found.reason).most_common(1)[0][0])

    def without_loss(self, why: str) -> PulseResult:
        """The same velocities with no loss at any frequency, for a reason."""
        ratio = replace(self.constant_quality, quality=math.nan, error=math.nan, reason=why)
        found = self.dispersion.without_loss(why)
        return replace(self, dispersion=found, constant_quality=ratio)

    def rows(self) -> dict[str, list[dict[str, Any]]]:
        """Plain tables, for JSON or print: units stand in the names, None where there is no number.

        Returns:
            "arrivals", "velocities", "quality" and "frequencies", a list of rows each.
        """
        record, found, loss = self.record, self.dispersion.with_errors, self.loss
        picks = [
            {"receiver": name, "position_m": record.x[j], "convention": convention,
             "time_s": one.time[j], "error_s": one.error[j], "reason": one.reason[j]}
            for convention, one in self.arrivals.items()
            for j, name in enumerate(record.names)
        ]  # fmt: skip
        speeds = [
            {"convention": convention, "velocity_m_s": one.velocity, "error_m_s": one.error,
             "intercept_s": one.intercept, "scatter_s": one.scatter, "receivers": one.used,
             "reason": one.reason}
            for convention, one in self.velocities.items()
        ]  # fmt: skip
        q = self.constant_quality
        ratio = {"quality": q.quality, "error": q.error, "inverse": q.inverse,
                 "inverse_error": q.inverse_error, "amplitudes": q.used,
                 "reason": q.reason}  # fmt: skip
        columns: dict[str, Any] = {
            "frequency_Hz": found.omega / (2 * np.pi),
            "sigma_rad_s": np.full(len(found.omega), found.sigma),
            "damped_re_k_rad_m": found.damped.real,
            "damped_im_k_rad_m": found.damped.imag,
            "damped_k_error_rad_m": found.damped_error,
            "phase_velocity_m_s": found.phase_velocity,
            "phase_velocity_error_m_s": found.phase_error,
            "group_velocity_m_s": found.group_velocity,
            "group_velocity_error_m_s": found.group_error,
            "attenuation_Np_m": found.attenuation,
            "attenuation_dB_m": found.decibels,
            "attenuation_error_Np_m": found.attenuation_error,
            "quality": found.quality,
            "quality_error": found.quality_error,
            "quality_at_least": found.quality_at_least,
            "modulus_quality": found.modulus_quality,
            "reason": found.reason,
            "loss_dB": loss.level,
            "loss_error_dB": loss.error,
            "loss_floor_dB": loss.floor,
            "loss_reason": loss.reason,
        }
        each = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
        tables = {"arrivals": picks, "velocities": speeds, "quality": [ratio], "frequencies": each}
        return dict(plain(tables))


def measure(
    t: ArrayLike,
    signals: Mapping[str, ArrayLike],
    positions: Mapping[str, float],
    window: Window | None = None,
    omega: ArrayLike | None = None,
    quiet_until: float | None = None,
    noise: float = math.nan,
    **how: Any,
) -> PulseResult:
    """Read a pulse test as :func:`measured` does, after its signals have been looked over.

    Args:
        t, signals, positions, quiet_until, noise: as for
            :func:`~wavesim.readings.pulse.signals.pulse_record`; 2 to about 20 receivers, all on
            one side of the source, ascending away from it.
        window, omega, how: as for :func:`measured`.
    """
    return measured(pulse_record(t, signals, positions, quiet_until, noise), window, omega, **how)


def measured(
    record: PulseRecord,
    window: Window | None = None,
    omega: ArrayLike | None = None,
    through: tuple[str, str] | None = None,
    fraction: float = 0.5,
    source: ArrayLike | None = None,
    k_max: float | None = None,
    expected: tuple[float, float] | None = None,
) -> PulseResult:
    """Read a pulse test.

    Args:
        record: the signals; what is wrong with them stands in ``notes``.
        window: for spectra; where None a gate over the whole record, of which the last 5 %
            fade.
        omega: ω of all spectral results, ascending, shape (n,), rad/s; where None, as dense as
            the window resolves, but 400 at most, over the band about the peak of the source's
            spectrum in which that is above 1 % of the peak, and the first receiver above noise.
        through: names of the input and output of the transmission loss; the first and the last
            receiver where None.
        fraction: of the peak, for arrival by threshold, –.
        source: the source's signal, shape (nt,), which receivers are correlated with and whose
            spectrum says what was driven; the first receiver's where None.
        k_max: largest |Re k| that can be, rad/m, and
        expected: (f, c), a phase velocity foreseen at one frequency, Hz and m/s: either resolves
            the phases' ambiguity, see :mod:`wavesim.readings.pulse.phase_unwrapping`.

    Raises:
        PulseError: something is not admissible; the message names it.
    """
    if omega is not None and np.iscomplexobj(omega):
        raise PulseError("omega: must be real, rad/s; a window says what its imaginary part is")
    if window is None:
        window = whole_record(record.t)
    known = None if source is None else np.asarray(source, float)
    picks = {name: arrivals(record, name, fraction, known) for name in CONVENTIONS}
    speeds = {name: arrival_velocity(record.x, one.time, one.error) for name, one in picks.items()}
    if CLIPPED not in record.unusable:
        speeds = not_by_noise(speeds)
    grid = _band(record, window, known) if omega is None else np.atleast_1d(omega).astype(float)
    seen = spectra(record, window, grid, known)
    speed = next(
        (speeds[n].velocity for n in _FOR_TRAVEL_TIME if math.isfinite(speeds[n].velocity)),
        math.nan,
    )
    found = dispersion(record, window, grid, k_max, expected, known)
    quality = under_its_assumption(
        constant_quality_of_amplitudes(seen, record.x / speed),
        grid, found.group_velocity, found.group_error,
    )  # fmt: skip
    ends = through or (record.names[0], record.names[-1])
    loss = transmission_loss(record, seen, *ends)
    return PulseResult(record, window, picks, speeds, seen, found, quality, loss)


def _band(record: PulseRecord, window: Window, source: Float | None) -> Float:
    """Frequencies that are driven about the peak of the source's spectrum, above noise there."""
    nyquist = np.pi / record.interval
    trial = np.linspace(0, 0.98 * nyquist, 513)[1:]
    coarse = spectra(record, window, trial, source)
    counts = coarse.driven if source is not None else coarse.driven & coarse.above[:, 0]
    counts = counts if counts.any() else coarse.driven
    lost = np.flatnonzero(~counts)
    peak = int(np.argmax(np.where(counts, coarse.source, -1)))
    place = int(np.searchsorted(lost, peak))
    first = int(lost[place - 1]) + 1 if place else 0
    last = int(lost[place]) - 1 if place < len(lost) else len(trial) - 1
    low, high = trial[first], trial[max(first, last)]
    step = max(2 * np.pi / coarse.duration, float(high - low) / (_MOST_FREQUENCIES - 1))
    low = max(float(low), step)
    return np.arange(low, max(float(high), low + step / 2), step)
