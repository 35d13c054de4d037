"""Complex wavenumber, phase and group velocity, attenuation and Q from the spectra of receivers.

Between receivers one wave runs towards larger x, U ∝ e^{ikx}, with k = k(ω + iσ); σ = 0 through a
gate. What holds at real ω follows by the first two terms of the series

    k(ω) ≈ k − iσ k′ − σ² k″/2,      k′ = dk/dω, a local polynomial in ω

(which fails close to a band edge, where k(ω) branches). From it c = ω/Re k, v_g = 1/Re k′,
α = Im k, and two quality factors, which must not be mixed up:

    Q_M = −Re M/Im M = Re k²/Im k²,     M ∝ ω²/k²: exact for a wave with one modulus M
    Q_E = ω/(2 α v_g)                    energy held over energy lost in a radian

Q_M is (ω/2αc)(1 − (αc/ω)²) with the phase velocity c. The energy lost in a length is 2α times the
flow v_g E, hence Q_E; for a medium in which structure disperses waves and one loss law holds for
all stiffnesses and inertias, k = k₀(ω√(ι/m)), so α = ω k₀′/2Q to first order in 1/Q and Q_E is the
law's Q, while Q_M is not. Without structural dispersion both agree to the order 1/Q. In a gap
decay is not loss, and neither means anything: Q is left out where |Im k| > |Re k|.

Sachse & Pao, J. Appl. Phys. 49, 4320 (1978); Carcione, Wave Fields in Real Media, 2.3 (2015).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.dispersion.line_fit import NOISE_SPREAD, deviation, fit_line, unknowns
from wavesim.readings.pulse.phase_unwrapping import FINE, HIDDEN, Guess, resolve
from wavesim.readings.pulse.signals import PulseRecord
from wavesim.readings.pulse.spectral_windows import Spectra, Window, spectra
from wavesim.readings.pulse.velocity import weighted_line

Float = NDArray[Any]
Complex = NDArray[np.complex128]

DECIBELS_PER_NEPER = 20 / np.log(10)
# Frequencies in the polynomial along ω.
_SPAN = 7
# Of a difference's square this many variances of its noise are explained.
_EXPLAINED = 2.0
# Standard error of Re k, over it, at which ω/Re k may be anything and is not given.
_LARGEST_ERROR = 0.5
UNKNOWN = (
    "the error of k is not known: two receivers have none to spare, and the record shows no noise "
    "before the wave; add a receiver, or begin earlier"
)
# kΔx of two receivers is smooth to so many rad, told by so many frequencies at least.
_SMOOTH, _FEWEST_OF_CURVE = 0.03, 8
# What is left over is no noise where it is so many times that of the noise, of few frequencies too.
_CLEARLY = 5.0
# A loss is seen where α is this many times its standard error.
SEEN = 3.0


@dataclass(frozen=True)
class Dispersion:
    """What one wave between the receivers does, at n frequencies.

    Attributes:
        omega: shape (n,), rad/s.
        sigma: σ of the window, rad/s.
        damped: k at ω + iσ, as fitted, shape (n,), rad/m; NaN where not measurable.
        damped_error: its standard error, of real and imaginary part alike, shape (n,), rad/m.
        k: k at real ω, shape (n,), rad/m; the same without σ.
        k_error: of real and imaginary part alike, shape (n,), rad/m: noise, and with σ the size
            of the series' last term.
        phase_velocity, phase_error: c and its standard error, shape (n,), m/s; NaN where two errors
            are as large as Re k, as may be in a gap.
        group_velocity, group_error: v_g and its standard error, shape (n,), m/s.
        attenuation, attenuation_error: α and its standard error, shape (n,), Np/m.
        quality, quality_error: Q_E = ω/(2αv_g) and its standard error, shape (n,), –; NaN where α
            is not three times its error.
        quality_at_least: Q_E by α and three errors more, shape (n,), –.
        modulus_quality: Q_M = Re k²/Im k², shape (n,), –.
        intercept: of the phase at ω = 0, turns; see ``phase_unwrapping.py``.
        reason: why there is no k, n of them; "" where there is one.
        no_loss: why amplitudes tell no loss, so that k is its real part alone; "" where they do.
        alike: what gains leave open of α at all frequencies alike, Np/m; the errors hold it.
    """

    omega: Float
    sigma: float
    damped: Complex
    damped_error: Float
    k: Complex
    k_error: Float
    phase_velocity: Float
    phase_error: Float
    group_velocity: Float
    group_error: Float
    attenuation: Float
    attenuation_error: Float
    quality: Float
    quality_error: Float
    quality_at_least: Float
    modulus_quality: Float
    intercept: float
    reason: tuple[str, ...]
    no_loss: str = ""
    alike: float = 0.0

    def refused(self, reason: str, where: Any = True) -> Dispersion:
        """The same frequencies with nothing at those of a mask, or at any, for one reason."""
        own = np.broadcast_to(where, len(self.omega))
        of_frequency: dict[str, Any] = {
            name: np.where(own, np.nan, value)
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray) and name != "omega"
        }
        said = zip(own, self.reason, strict=True)
        return replace(self, **of_frequency, reason=tuple(reason if o else r for o, r in said))

    def without_loss(self, why: str) -> Dispersion:
        """The same velocities with neither α nor Q, for a reason."""
        names = "attenuation", "attenuation_error", "quality", "quality_error", "quality_at_least"
        none: dict[str, Any] = dict.fromkeys((*names, "modulus_quality"), 0 * self.omega + np.nan)
        none |= {"k": self.k.real + 1j * np.nan, "damped": self.damped.real + 1j * np.nan}
        return replace(self, **none, no_loss=why)

    def with_alike(self, alike: float) -> Dispersion:
        """The same with errors of α and Q that hold a part of α that all frequencies have, Np/m."""
        error = np.hypot(self.attenuation_error, alike)
        with np.errstate(divide="ignore", invalid="ignore"):
            of_quality = np.hypot(self.quality_error, self.quality * alike / self.attenuation)
            most = np.maximum(self.attenuation, 0.0) + SEEN * self.attenuation_error
            at_least = (
                self.quality_at_least * most / (most + SEEN * (error - self.attenuation_error))
            )
        return replace(
            self, attenuation_error=error, quality_error=of_quality, quality_at_least=at_least,
            alike=alike,
        )  # fmt: skip

    @property
    def with_errors(self) -> Dispersion:
        """The same with nothing where no error is known."""
        found = self.refused(UNKNOWN, np.isfinite(self.k) & ~np.isfinite(self.k_error))
        group = np.where(np.isfinite(self.group_error), found.group_velocity, np.nan)
        return replace(found, group_velocity=group)

    @property
    def decibels(self) -> Float:
        """α, dB/m."""
        return DECIBELS_PER_NEPER * self.attenuation

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where there is a k, shape (n,)."""
        return np.array([not reason for reason in self.reason])


def dispersion(
    record: PulseRecord,
    window: Window,
    omega: Float,
    k_max: float | None = None,
    expected: tuple[float, float] | None = None,
    source: Float | None = None,
) -> Dispersion:
    """Measure k(ω) and what follows from it.

    Args:
        record: the signals, of one wave that runs towards larger x: no echo within a gate.
        window: a gate, or an exponential.
        omega: ω, ascending, shape (n,), rad/s.
        k_max: largest |Re k| that can be, rad/m; see ``phase_unwrapping.py``.
        expected: (f, c), a phase velocity foreseen at one frequency, Hz and m/s.
        source: the source's signal, shape (nt,); see ``spectral_windows.spectra``.

    Returns:
        The dispersion.

    Raises:
        PulseError: the frequencies or the gate are not admissible.
    """
    seen = spectra(record, window, omega, source)
    step = FINE * 2 * np.pi / (len(record.t) * record.interval)
    highest = min(omega[-1] + 2 * step, 0.999 * np.pi / record.interval)
    fine = spectra(record, window, np.arange(step, highest, step), source)
    guess = resolve(seen, fine, k_max, expected)
    return derived(seen, guess, *wavenumber(seen, guess))


def wavenumber(seen: Spectra, guess: Guess) -> tuple[Complex, Float]:
    """k at ω + iσ by least squares of U against e^{ikx}, and the standard error of its parts."""
    rows = np.flatnonzero(np.isfinite(guess.k))
    k = np.full(len(seen.omega), complex(np.nan, np.nan))
    error = np.full(len(k), np.nan)
    if not len(rows):
        return k, error
    used, U = guess.used[rows], seen.values[rows]
    size = np.log(np.maximum(np.abs(U), 1e-290))
    decay = -weighted_line(np.broadcast_to(seen.x, U.shape), size, used * np.abs(U) ** 2)[0]
    fit = fit_line(U, seen.x, used, 1, False, (guess.k[rows] + 1j * decay)[:, None])
    k[rows] = fit.k[:, 0]
    noise = np.where(used, np.hypot(seen.noise[rows], seen.cut[rows]), 0)
    count = used.sum(axis=1)
    # With no receiver to spare nothing is left over, and the noise must be known.
    spare = count - unknowns(1, False)
    own = np.where((spare > 0)[:, None] & np.isnan(noise), seen.cut[rows] * used, noise)
    power = np.sum(own**2, axis=1) / count
    # What is left over is more than noise where some is known, at all frequencies together.
    known = noise[used & np.isfinite(noise)]
    if not (len(known) and np.mean(fit.residual) > NOISE_SPREAD * np.mean(known**2)):
        power = np.maximum(power, fit.residual)
    elif (spare > 0).any() and np.mean(fit.residual) > _CLEARLY * np.mean(known**2):
        # Gains leave the same part of all, there too where noise or few receivers hide it.
        whole = np.sum(used * np.abs(U) ** 2, axis=1) / count
        part = float(np.median((fit.residual / whole)[spare > 0]))
        fit = replace(fit, residual=np.maximum(fit.residual, part * whole))
    error[rows] = deviation(fit, spare, power, everywhere=False) / np.sqrt(2) * fit.unit[:, 0]
    two = spare <= 0
    x = np.where(used[two], seen.x, np.nan)
    apart = np.nanmax(x, axis=1) - np.nanmin(x, axis=1) if two.any() else np.zeros(0)
    own = rows[two]
    ripple = _ripple(seen.omega[own], k[own] * apart, error[own] * apart)
    error[own] = np.hypot(error[own], ripple / apart)
    return k, error


def _ripple(omega: Float, phase: Complex, error: Float) -> float:
    """How far kΔx of two receivers, which leave nothing over, is off a smooth curve, rad; 0 where
    that is little: an echo that comes before the direct wave has passed makes both parts ripple.

    Args:
        omega: shape (n,), rad/s.
        phase: kΔx, complex, shape (n,).
        error: of each part, shape (n,); NaN where unknown.
    """
    if len(omega) < _FEWEST_OF_CURVE:
        return 0.0
    s = (omega - omega.mean()) / np.ptp(omega)
    weight = 1 / np.hypot(np.nan_to_num(error), _SMOOTH / 2)
    left = []
    for part, degree in ((phase.real, 3), (phase.imag, 2)):
        curve = np.polynomial.polynomial.polyfit(s, part, degree, w=weight)
        off = weight * (part - np.polynomial.polynomial.polyval(s, curve))
        left.append(np.sum(off**2) / np.sum(weight**2) * len(s) / (len(s) - degree - 1))
    ripple = float(np.sqrt(max(left)))
    return ripple if ripple > _SMOOTH else 0.0


def derived(seen: Spectra, guess: Guess, damped: Complex, error: Float) -> Dispersion:
    """All that follows from k(ω + iσ)."""
    omega, sigma = seen.omega, seen.sigma
    k1, e1, k2, e2, k3 = _slopes(omega, damped, error, seen.duration)
    if sigma:
        k = damped - 1j * sigma * k1 - sigma**2 * k2 / 2
        k_error = np.sqrt(
            error**2 + (sigma * e1) ** 2 + (sigma**2 * e2 / 2) ** 2
            + np.abs(sigma**2 * k2 / 2) ** 2
        )  # fmt: skip
        k1 = k1 - 1j * sigma * k2
        # The first term that is left out counts as an error.
        e1 = np.sqrt(e1**2 + (sigma * e2) ** 2 + np.abs(sigma**2 * k3 / 2) ** 2)
    else:
        k, k_error = damped, error
    with np.errstate(divide="ignore", invalid="ignore"):
        phase = np.where(k_error >= _LARGEST_ERROR * np.abs(k.real), np.nan, omega / k.real)
        group = 1 / k1.real
        lossy = (k.imag > 0) & (k.imag < np.abs(k.real))
        # Where no loss is seen there is no Q, but a bound of it.
        seen_loss = lossy & (k.imag >= SEEN * k_error)
        quality = np.where(seen_loss, omega * k1.real / (2 * k.imag), np.nan)
        modulus = np.where(seen_loss, (k**2).real / (k**2).imag, np.nan)
        most = np.maximum(k.imag, 0.0) + SEEN * k_error
        at_least = np.where((k1.real > 0) & (most > 0), omega * k1.real / (2 * most), np.nan)
        part = np.hypot(k_error / k.imag, e1 / k1.real)
        # Half of how far it is to where 1/Q is two errors less, and 1/π: what Q means to 1/πQ.
        quality_error = np.hypot(np.abs(quality) * part / np.maximum(1 - 2 * part, 0.1), 1 / np.pi)
        phase_error = phase**2 / omega * k_error
        group_error = group**2 * e1
    reason = [
        why or ("" if np.isfinite(value) else HIDDEN)
        for why, value in zip(guess.reason, damped, strict=True)
    ]
    return Dispersion(
        omega, sigma, damped, error, k, k_error, phase, phase_error, group, group_error,
        k.imag.copy(), k_error, quality, quality_error, at_least, modulus, guess.intercept,
        tuple(reason),
    )  # fmt: skip


def _slopes(
    omega: Float, k: Complex, error: Float, duration: float
) -> tuple[Complex, Float, Complex, Float, Complex]:
    """k′ and k″ by a polynomial through the frequencies about each, with their errors, and k‴.

    A parabola or a cubic, whichever tells k′ better: to its noise comes by how much the two next
    degrees give another slope, as far as noise doesn't explain it. Neighbours closer than the
    window resolves, 2π/T, share their noise: errors grow by the √ of how many share it. NaN where a
    neighbour is missing; at the ends it leans inwards.
    """
    n = len(omega)
    first, second, third = np.full((3, n), complex(np.nan, np.nan))
    e1, e2 = np.full((2, n), np.nan)
    span = min(_SPAN, n)
    if span < 4:
        return first, e1, second, e2, third
    for i in range(n):
        low = min(max(i - span // 2, 0), n - span)
        own = slice(low, low + span)
        if not np.isfinite(k[own]).all():
            continue
        s = omega[own] - omega[i]
        powers = (s / np.abs(s).max())[:, None] ** np.arange(span)
        # Rows that give k′, k″/2, k‴/6 by a polynomial of each degree.
        fits = [np.linalg.pinv(powers[:, :d])[1:4] for d in range(3, min(span, 6) + 1)]
        shared = max(1.0, 2 * np.pi / duration / float(np.mean(np.diff(omega[own]))))
        noise = error[own] * np.sqrt(shared)
        tried = []
        for d in range(min(len(fits) - 1, 2)):
            apart = [more[0] - fits[d][0] for more in fits[d + 1 : d + 3]]
            off = [abs(a @ k[own]) ** 2 - _EXPLAINED * np.sum((a * noise) ** 2) for a in apart]
            tried.append(np.sqrt(np.sum((fits[d][0] * noise) ** 2) + max(0.0, *off)))
        best, unit = int(np.argmin(tried)), float(np.abs(s).max())
        first[i], e1[i] = fits[best][0] @ k[own] / unit, tried[best] / unit
        second[i] = 2 * (fits[best][1] @ k[own]) / unit**2
        e2[i] = 2 * np.linalg.norm(fits[best][1] * noise) / unit**2
        third[i] = 6 * (fits[1][2] @ k[own]) / unit**3
    return first, e1, second, e2, third
