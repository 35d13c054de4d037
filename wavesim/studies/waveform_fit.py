"""A case's parameters fitted to recorded waveforms.

    r_ij = [u_ij − s φ(x_j, t_i − t₀; θ) − c_j]/rms(u)

with a gain s and a lag t₀ that are fitted unless they are stated, and an offset c_j of each
receiver that is projected out. φ is the exact solution in the frequency domain, which knows no
grid, and ∂φ/∂θ its exact derivative, by dual numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.case.load import Case
from wavesim.layered.signals import contour_of, field_spectra
from wavesim.material.dual import Dual, parameters, value_of
from wavesim.planewave.band_edges import keeps_gradient
from wavesim.readings.matched_record import Measured, field_and_rates, resampling
from wavesim.simulation.bandlimited import cross_correlation
from wavesim.studies.fit_terms import QUALITY, Target, with_values
from wavesim.studies.least_squares import Parameter, Solution, solve

Float = NDArray[Any]

GAIN, LAG = "gain", "lag"
# A lag is looked for up to this part of the run, and beyond 1.5 periods where it explains so much
# more.
REACH, _FAR_BETTER = 0.5, 1.5
# A first guess that leaves this part of the power is followed by way of low frequencies.
_FAR = 0.3
# Low frequencies, over the centre of the record's spectrum.
_LOW_PASS = 0.6
# After so many evaluations a fit that leaves more than this of the rms over is of another record.
_FIRST, _UNLIKE = 12, 0.97


@dataclass
class Waveforms:
    """Recorded waveforms as data of a least-squares fit.

    Args:
        case: the case, which holds the first guess.
        varied: what is fitted.
        measured: the record laid beside the case.
        lag, gain: stated, s and –; fitted where None.
        known: what :func:`signals_of` gives, where nothing of it is varied.
        low_pass: frequency up to which both are compared, Hz; 0 for all.
    """

    case: Case
    varied: list[Target]
    measured: Measured
    lag: float | None = None
    gain: float | None = None
    known: Any = None
    low_pass: float = 0.0

    @property
    def parameters(self) -> list[Parameter]:
        """Parameters of media, then the gain and the lag that are fitted."""
        found = [self._parameter(one) for one in self.varied]
        if self.gain is None:
            found.append(Parameter(GAIN, self.unit, -np.inf, np.inf, self.unit, False))
        if self.lag is None:
            reach = REACH * self.case.simulation.duration
            found.append(Parameter(LAG, 0.0, -reach, reach, self.time_scale, False))
        return found

    @property
    def time_scale(self) -> float:
        """A tenth of a period of the centre of the record's spectrum, s."""
        return 0.1 / self.centre

    @property
    def centre(self) -> float:
        """Centre of the record's spectrum, Hz."""
        u = self.measured.values - self.measured.values.mean(axis=0)
        power = np.sum(np.abs(np.fft.rfft(u, axis=0)) ** 2, axis=1)
        f = np.fft.rfftfreq(len(u), self.measured.interval)
        # Noise has no centre: only what stands out counts.
        power = np.where(power > 0.02 * power.max(), power, 0.0)
        return float(np.sum(f * power) / np.sum(power))

    def _parameter(self, one: Target) -> Parameter:
        layers = self.case.simulation.layers
        start = one.value_in(layers)
        if one.name == QUALITY:
            return Parameter(one.key, start, 2.0, 1e5, start)
        known = layers.layers[one.layers[0]].medium.known()[one.name]
        tiny = 1e-6 * abs(start) if start else 0.0
        low = known.low + tiny if known.open else known.low
        size = abs(start) or min(known.high, 1.0)
        return Parameter(one.key, start, low, known.high, size)

    def simulated(self, values: Mapping[str, float]) -> Float:
        """The field at the receivers at given parameters, shape (frames, m)."""
        return value_of(self._at(values))

    def residuals(self, values: Mapping[str, float]) -> tuple[Float, Float, NDArray[np.int_]]:
        """Residuals over the record's rms, derivatives, and the frame of each."""
        found = self._at(values)
        frames, (*slopes, by_lag) = found.value, found.slopes
        gain, t, sim = self.scale_of(values), self._run_times(values), self.case.simulation
        # Before its start the bar is at rest; after its end nothing is known. Frames count less and
        # less up to it: one that came in or went at once would hold a lag where it does.
        counts = np.clip((sim.duration - t) / self.time_scale, 0.0, 1.0)
        W = resampling(sim.frames, sim.interval, t)
        columns = [gain * (W @ one) for one in slopes]
        there = W @ frames
        if self.gain is None:
            columns.append(there)
        if self.lag is None:
            columns.append(gain * (W @ by_lag))
        left = gain * there - self.measured.values
        parts = [self._projected(part, counts) for part in (left, *columns)]
        size = float(np.sqrt(np.mean(self._projected(self.measured.values, counts) ** 2)))
        r, *J = ((counts[:, None] * part).ravel() / size for part in parts)
        columns_of = np.stack(J, axis=1) if J else np.zeros((len(r), 0))
        return r, columns_of, np.repeat(np.arange(len(t)), left.shape[1])

    def laid_over(self, values: Mapping[str, float]) -> tuple[Float, Float]:
        """The simulated signals on the record's times, in its unit, offsets in them, and residuals.

        Args:
            values: of all parameters, gain and lag.

        Returns:
            (signals, record less signals), each of shape (nt, m); NaN after the simulation's end.
        """
        frames = self.simulated(values)
        t, sim = self._run_times(values), self.case.simulation
        there = self.scale_of(values) * (resampling(sim.frames, sim.interval, t) @ frames)
        there[t > sim.duration] = np.nan
        there += np.nanmean(self.measured.values - there, axis=0)
        return there, self.measured.values - there

    def scale_of(self, values: Mapping[str, float]) -> float:
        """The record's unit over the field's."""
        return values[GAIN] if self.gain is None else self.gain

    def _run_times(self, values: Mapping[str, float]) -> Float:
        """The record's times on the clock of the run, s."""
        return self.measured.t - (values[LAG] if self.lag is None else self.lag)

    @cached_property
    def _own(self) -> tuple[dict[str, float], Float]:
        """The case's own values, and its field at the receivers."""
        first = {one.key: one.value_in(self.case.simulation.layers) for one in self.varied}
        return first, self.simulated(first)

    def beginning(self) -> dict[str, float]:
        """First values: the case's, and the lag and gain that lay its field on the record best."""
        first, frames = dict(self._own[0]), self._own[1]
        recorded = self.measured.values - self.measured.values.mean(axis=0)
        if self.lag is not None:
            found = self._laid_best(frames, recorded, np.array([self.lag]))
        else:
            # The nearest lag, but where one further off explains much more.
            near = np.arange(-1.5 / self.centre, 1.5 / self.centre + 1e-30, self.time_scale / 2)
            found = self._laid_best(frames, recorded, near)
            far = self._alike_at(frames, recorded)
            if abs(far) > near[-1]:
                other = self._laid_best(frames, recorded, far + near)
                found = other if other[2] > _FAR_BETTER * found[2] else found
        if self.lag is None:
            first[LAG] = found[0]
        if self.gain is None:
            first[GAIN] = found[1]
        return first

    def _laid_best(self, frames: Float, recorded: Float, lags: Float) -> tuple[float, float, float]:
        """The best of some lags, its gain, and the power that it explains."""
        sim, found = self.case.simulation, (0.0, 1.0, -1.0)
        for lag in lags.tolist():
            t = self.measured.t - lag
            there = resampling(sim.frames, sim.interval, t) @ frames
            there = np.where((t <= sim.duration)[:, None], there, 0.0)
            there -= there.mean(axis=0)
            power = float(np.sum(there**2)) or 1.0
            gain = float(np.sum(there * recorded)) / power
            if gain**2 * power > found[2]:
                found = lag, gain, gain**2 * power
        return found

    def _alike_at(self, frames: Float, recorded: Float) -> float:
        """The lag at which all receivers together correlate most, of either sign, s."""
        sim, step = self.case.simulation, self.measured.interval
        own = np.arange(0.0, sim.duration + step / 2, step)
        there = resampling(sim.frames, sim.interval, own) @ frames
        pairs = zip(recorded.T, (there - there.mean(axis=0)).T, strict=True)
        c = np.sum([cross_correlation(u, one) for u, one in pairs], axis=0)
        lags = self.measured.t[0] + step * (np.arange(len(c)) - (len(own) - 1))
        inside = np.abs(lags) <= REACH * sim.duration
        return float(lags[int(np.argmax(np.where(inside, np.abs(c), -1.0)))])

    @cached_property
    def unit(self) -> float:
        """The record's rms over that of the case's own field: the gain's own size."""
        recorded = self.measured.values - self.measured.values.mean(axis=0)
        frames = self._own[1]
        return float(np.sqrt(np.mean(recorded**2)) / (np.sqrt(np.mean(frames**2)) or 1.0))

    def _projected(self, values: Float, counts: Float) -> Float:
        """Without each receiver's offset, and without high frequencies where that is asked for."""
        values = values - counts @ values / (counts.sum() or 1.0)
        if not self.low_pass:
            return values
        f = np.fft.rfftfreq(2 * len(values), self.measured.interval)
        keep = np.exp(-((f / self.low_pass) ** 2))[:, None]
        spectrum = np.fft.rfft(values, 2 * len(values), axis=0) * keep
        return np.fft.irfft(spectrum, 2 * len(values), axis=0)[: len(values)]

    def _at(self, values: Mapping[str, float]) -> Dual:
        """The exact solution, with its derivatives by what is varied and by a lag."""
        if self.known is not None:
            return self.known
        theta = [values[one.key] for one in self.varied]
        return signals_of(self.case, self.measured, self.varied, theta)


def signals_of(
    case: Case, measured: Measured, varied: Sequence[Target] = (), theta: Sequence[float] = ()
) -> Dual:
    """The case's field at the receivers, shape (frames, m), exactly.

    Args:
        case: the case.
        measured: at which receivers.
        varied, theta: what is varied, and its values.

    Returns:
        The field with its derivatives by theta, and by a lag t₀ at t₀ = 0.
    """
    sim, names = case.simulation, measured.names
    *values, lag = parameters([*theta, 0.0])
    layers = with_values(sim.layers, varied, values)
    grid = contour_of(sim.layers, sim.sources, sim.duration)
    found = field_spectra(
        layers, sim.bar.left, sim.bar.right, sim.sources,
        dict(zip(names, measured.positions, strict=True)), grid.omega, keeps_gradient(sim.layers),
    )  # fmt: skip
    field, rates = field_and_rates(measured.field)
    of_names = np.stack([found[name][field] for name in names])
    spectra = of_names * np.exp(1j * lag * grid.omega) * (-1j * grid.omega) ** rates
    return Dual(*(grid.signal(part, sim.times) for part in (spectra.value, spectra.slopes))
                ).transpose(1, 0)  # fmt: skip


def fit_waveforms(data: Waveforms) -> Solution:
    """Fit, by way of low frequencies where the first guess is far off.

    Raises:
        FitError: it can't be done.
    """
    start = data.beginning()
    r, _, _ = data.residuals(start)
    if np.mean(r**2) > _FAR:
        data.low_pass = _LOW_PASS * data.centre
        try:
            start = solve(data, start).values
        finally:
            data.low_pass = 0.0
    found = solve(data, start, _FIRST)
    # Frames outside the run count as 0 in the misfit.
    r, _, _ = data.residuals(found.values)
    if found.converged or found.misfit > _UNLIKE * np.sqrt(np.mean(r != 0)):
        return found
    last = solve(data, found.values)
    return replace(last, evaluations=found.evaluations + last.evaluations)
