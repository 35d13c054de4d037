"""Errors of fitted sinusoids, from the residual close to each, so that noise need not be white."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import rfft

from wavesim.readings.dispersion.hidden_mode import Bends, of_sinusoids
from wavesim.readings.dispersion.sinusoids import Fit, Float, exponentials, transposed

# Noise close to a frequency is the residual's between these many bins from it.
_NEAR = (2.0, 12.0)
# A line is random where this part of its power within so many bins is no sinusoid's, and so many
# times the noise's.
_RANDOM, _LINE_BINS, _OVER_NOISE = 0.2, 6.0, 10.0
# Sinusoids closer than this part of a bin, or less sure than this, are not told apart.
_CLOSEST_BINS = 0.05
# Noise goes with the signal where it is heard more by so many deviations of that ratio.
_BY_SCATTER = 4.0
# A wave grows where its decay is below nought by so many standard errors.
_SURELY_GROWS = 3.0
# Phase error over the record, rad, that the sums of a simulated field leave on its strongest wave.
_ROUNDING = 1e-11


@dataclass(frozen=True)
class Settings:
    """What is common to all series that are inverted together.

    Attributes:
        window: of the samples, shape (N,); weight: 0 where one is missing, None where none is.
        padded: length of the transform.
        most, dynamic_range, damped: as of ``harmonic_inversion.invert``.
        scale: by which channels were divided, shape (C,).
        least: amplitude below which there is rounding alone.
        leakage: as of ``harmonic_inversion.invert``, of these series.
    """

    window: Float
    weight: Float | None
    padded: int
    most: int
    dynamic_range: float
    damped: bool
    scale: Float
    least: float
    leakage: Float | None


@dataclass(frozen=True)
class Sinusoids:
    """Sinusoids found in n series; flat arrays over all of them, (m,) each.

    Attributes:
        series: which series it is in, ascending.
        omega, decay: ω and γ, rad/s and 1/s; of a group of series, for a sample.
        amplitude: √Σ_c |a_c|² at the start of the record, unit of the series.
        shape: a_c over its norm at the middle of the record, shape (m, C), complex.
        omega_error, decay_error: standard errors, rad/s and 1/s.
        amplitude_error: standard error, unit of the series.
        resolved: whether the fit holds it apart from its neighbours.
        residual: part of each series' power that no sinusoid explains, shape (n,).
        bends: how far from straight ln y is beside one sinusoid's, 1/s².
        settled: whether no further peak was left in the series, shape (n,).
        broad: whether many sinusoids crowd about its strongest, or leave much of its line, as of
            one that is broad and random, shape (n,).
    """

    series: np.ndarray
    omega: Float
    decay: Float
    amplitude: Float
    shape: np.ndarray
    omega_error: Float
    decay_error: Float
    amplitude_error: Float
    bends: Bends
    resolved: np.ndarray
    residual: Float
    settled: np.ndarray
    broad: np.ndarray


def of_moving_lines(found: Sinusoids, cell: float) -> np.ndarray:
    """Which sinusoids, (m,), are two for one line whose frequency moves while it is recorded.

    e^{−iωt − iβt²/2} is, to first order in β, a sum of two within a bin of each other, of which
    one grows as the other falls. Where no source acts no wave grows; what a gain in time does, it
    does to all alike.

    Args:
        found: with frequencies and decays in rad/s and 1/s.
        cell: a bin, 2π/T, rad/s.
    """
    beside = np.zeros(len(found.omega), bool)
    sure = found.decay / np.maximum(found.decay_error, 1e-290)
    for j in np.flatnonzero(sure < -_SURELY_GROWS):
        pair = (found.series == found.series[j]) & (sure > _SURELY_GROWS)
        pair &= np.abs(found.omega - found.omega[j]) < cell
        beside |= pair
        beside[j] |= pair.any()
    return beside


def norm_of(amplitude: np.ndarray, settings: Settings) -> Float:
    """√Σ_c |a_c|² in the series' own unit, (n, p)."""
    return np.sqrt(np.sum(np.abs(amplitude * settings.scale[:, None]) ** 2, axis=1))


def report(found: Fit, series: Float, rows: np.ndarray, settings: Settings) -> Sinusoids:
    """Sinusoids with their errors, from the residual's level close to each."""
    n, channels, count = series.shape
    p = found.omega.shape[1]
    spectrum = rfft(found.residual * settings.window, settings.padded, axis=-1)
    power = (spectrum.real**2 + spectrum.imag**2) / np.sum(settings.window**2)
    bins = np.arange(power.shape[-1]) * count / settings.padded
    distance = np.abs(bins - (found.omega * count / (2 * np.pi))[..., None])
    near = ((distance >= _NEAR[0]) & (distance <= _NEAR[1])).astype(float)
    # An error of ω is Σ t n(t) e^{iωt}, which hears noise Δ bins from ω by ((sin x/x)′)², x = πΔ,
    # of area 1/3: nearly all from close by, and 1/2x² of what is far.
    far = np.where(distance > _NEAR[1], 3 / (2 * (np.pi * np.maximum(distance, 1)) ** 2), 0.0)
    far *= count / settings.padded
    heard = near * ((1 - far.sum(axis=-1)) / np.maximum(near.sum(axis=-1), 1))[..., None] + far
    level = np.einsum("ncf,npf->ncp", power, heard)
    # What the fit's own parameters took out of the residual.
    samples = count if settings.weight is None else settings.weight.sum()
    level = level * samples / max(samples - 2 * p - (2 * p if settings.damped else p) / channels, 1)
    norm = norm_of(found.amplitude, settings)
    noise = np.concatenate([level, level], axis=-1)
    scale = np.sqrt(noise)
    middle = np.sum(scale[..., :, None] * found.parts * scale[..., None, :], axis=1)
    covariance = found.unit @ middle @ transposed(found.unit)
    variance = np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0)
    more = _in_step(found, count)
    variance = variance * np.concatenate([more, more], axis=1)
    weakness = norm.max(axis=1, keepdims=True) / np.maximum(norm, 1e-290)
    rounding = _ROUNDING * weakness / count
    errors = np.sqrt(variance + np.concatenate([rounding, rounding], axis=1) ** 2)
    start = np.exp(np.clip(found.decay * (count - 1) / 2, -50, 50))
    square = settings.scale[:, None] ** 2
    shares = np.abs(found.amplitude) ** 2 * square / np.maximum(norm**2, 1e-290)[:, None]
    amplitude_error = found.unit_amplitude * np.sqrt(np.sum(shares * level * square, axis=1))
    apart = np.abs(found.omega[:, :, None] - found.omega[:, None, :])
    apart = apart + np.where(np.eye(p, dtype=bool), np.inf, 0)
    closest = apart.min(axis=-1) * count / (2 * np.pi)
    resolved = (closest > _CLOSEST_BINS) & (errors[:, :p] * count < np.pi)
    # Of two that are hardly told apart the error is no small one, which it is taken for.
    errors[:, :p] *= 1 + 2 * errors[:, :p] / apart.min(axis=-1)
    shape = transposed(
        found.amplitude * settings.scale[:, None] / np.maximum(norm, 1e-290)[:, None]
    )
    bends = of_sinusoids(found, level, settings.scale, settings.weight)
    return Sinusoids(
        np.repeat(rows, p),
        found.omega.ravel(),
        found.decay.ravel(),
        (norm * start).ravel(),
        shape.reshape(-1, channels),
        errors[:, :p].ravel(),
        errors[:, p:].ravel(),
        (amplitude_error * start).ravel(),
        Bends(bends.size.ravel(), bends.noise.ravel(), bends.over.ravel()),
        (resolved & (norm > 4 * amplitude_error)).ravel(),
        np.mean(found.residual**2, axis=(1, 2)) / np.mean(series**2, axis=(1, 2)),
        np.ones(n, bool),
        _leaves_much(series * settings.window, power, distance, norm, settings),
    )


def _leaves_much(
    series: Float, left: Float, distance: Float, norm: Float, settings: Settings
) -> np.ndarray:
    """Whether much of the line of each series' strongest sinusoid is no sinusoid, shape (n,).

    Args:
        series: windowed, shape (n, C, N).
        left: power of what is left of it, over Σ w², shape (n, C, nω).
        distance: of all frequencies from the sinusoids, in bins, shape (n, p, nω).
    """
    strongest = distance[np.arange(len(norm)), norm.argmax(axis=1)]
    near = (strongest < _LINE_BINS)[:, None]
    noise = np.median(left, axis=-1) / np.log(2)
    part = np.sum(left * near, axis=(1, 2))
    loud = part > _OVER_NOISE * np.sum(noise * near.sum(axis=-1), axis=1)
    much = np.zeros(len(norm), bool)
    if loud.any():
        hat = rfft(series[loud], settings.padded, axis=-1)
        power = (hat.real**2 + hat.imag**2) / np.sum(settings.window**2)
        much[loud] = part[loud] > _RANDOM * np.sum(power * near[loud], axis=(1, 2))
    return much


def _in_step(found: Fit, count: int) -> Float:
    """How much more noise a frequency hears than one that goes on by itself, shape (n, p).

    A clock that shivers shifts all channels together, and most where the signal is steepest: of
    slopes s_c = ∂y_c/∂ω and noise r_c it is Σ_t (Σ_c s_c r_c)² over Σ_c Σ_t s_c² ⟨r_c²⟩.
    """
    n, p = found.omega.shape
    t = np.arange(count) - (count - 1) / 2
    level = np.mean(found.residual**2, axis=-1)
    more = np.ones((n, p))
    for j in range(p):
        z = exponentials(found.omega[:, j : j + 1], found.decay[:, j : j + 1], count)
        slope = t * (found.amplitude[:, :, j, None] * z).imag
        heard = np.sum(np.sum(slope * found.residual, axis=1) ** 2, axis=-1)
        alone = np.einsum("nct,nc->n", slope**2, level)
        more[:, j] = heard / np.maximum(alone, 1e-290)
    return np.where(more > 1 + _BY_SCATTER * np.sqrt(2 / count), more, 1.0)
