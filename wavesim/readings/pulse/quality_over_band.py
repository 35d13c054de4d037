"""Constant Q from amplitudes at several distances; Q over a band from α and v_g.

At each frequency ln A(x) = const − αx. For Q that doesn't depend on frequency, α = πf/(Qc) and

    ln A_j(f) = s(f) + g_j − π f τ_j/Q

with the source's spectrum s, a gain g_j of each receiver, and the travel time τ_j: with two
receivers, the slope of ln(A₂/A₁) against f is −π(τ₂ − τ₁)/Q, the classic spectral ratio. All
receivers are fitted at once; s(f) is projected out frequency by frequency. That holds while the
velocity is constant. Where it is not, by δ over a band of width Δf about f, Q is off by the part
δ f/Δf or so; a Q that is the same at all frequencies is then the mean of ω/(2αv_g), each with its
error.

Tonn, Geophys. Prospect. 39, 1 (1991).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.readings.pulse.spectral_windows import Spectra

Float = NDArray[Any]

_FEWEST_FREQUENCIES = 3
UNSEEN = "no loss is seen: Q above {:.3g}"
NOT_KNOWN = "whether the velocity is constant over the band is not known"
CHANGES = "Q changes with frequency, from {:.3g} to {:.3g} over the band, and no mean: take α(ω)"
BENDS = (
    "ln A bends with frequency, as 1/Q from {:.2g} to {:.2g} over the band would have it, and the "
    "spectral ratio takes Q as constant: take α(ω)"
)
ALIKE = (
    "the last receiver has {:.2g} of the first one's amplitude at all frequencies alike, beside "
    "what falls with frequency: as of waves that spread, unlike gains, what lies between, or a "
    "loss that does not grow with frequency; wavesim attenuation reads the decay as it is"
)
# A part of α that all frequencies have is told by so many standard errors beyond this part of α,
# which velocities that change by 1/πQ, as losses make them, leave open.
_SURELY, _PART = 3.0, 0.1
# 1/Q that changes by this part of its mean over the band is not constant.
_CHANGED = 0.5
# The spectral ratio is refused where a velocity that changes puts it off by more than this part.
_CONSTANT = 0.1


@dataclass(frozen=True)
class Quality:
    """Q over a band.

    Attributes:
        quality: Q, –; infinite or negative where amplitudes don't fall with frequency.
        error: its standard error to first order, –; NaN where nothing tells it.
        inverse, inverse_error: 1/Q, which the error is normal in, and its standard error, –.
        used: amplitudes, or frequencies, that count.
        reason: why there is none, or "".
        at_least: Q by two standard errors of 1/Q more, –; NaN where nothing is known.
        band: the lowest and highest frequency, Hz; NaN by the spectral ratio, as is
        excess: χ²/ν of 1/Q about its mean, what Q means to 1/πQ counted as an error of each; the
            error is stretched by its root where above 1.
        bends: whether ln A bends with frequency by more than a constant Q lets it.
        varies: whether the velocity changes by so much that the spectral ratio tells nothing.
    """

    quality: float
    error: float
    inverse: float
    inverse_error: float
    used: int
    reason: str = ""
    at_least: float = math.nan
    band: tuple[float, float] = (math.nan, math.nan)
    excess: float = math.nan
    bends: bool = False
    varies: bool = False


def constant_quality_of_amplitudes(seen: Spectra, travel_time: ArrayLike) -> Quality:
    """Q from the slope of ln A against f, over all receivers and all frequencies of the spectra.

    The velocity's own change with frequency, which a constant Q entails, is neglected: it makes
    Q wrong by a part of the order 1/πQ.

    Args:
        seen: the spectra, over a band without gaps, through a gate (σ = 0).
        travel_time: τ_j, shape (m,), s; a time common to all is of no account.

    Returns:
        Q; none through an exponential window, nor where ln A bends with f by so much that 1/Q would
        change by more than half over the band. Frequencies closer than the window resolves share
        their noise, and count accordingly.
    """
    if seen.sigma:
        nothing = "the spectral ratio over frequency needs a gate"
        return Quality(np.nan, np.nan, np.nan, np.nan, 0, nothing)
    size, known = np.abs(seen.values), seen.noise_known
    logarithm = np.log(np.maximum(size, 1e-290))
    noise = np.where(seen.whole, seen.noise, np.inf)
    # Of the noise only the part along U changes ln|U|: half of its variance.
    weight = 2 * (size / noise) ** 2 if known else np.ones_like(size)
    weight = np.where(seen.above & seen.driven[:, None], weight, 0)
    weight = np.where((weight > 0).sum(axis=1)[:, None] >= 2, weight, 0)
    tau = np.asarray(travel_time, float) - np.asarray(travel_time, float)[0]
    frequency = seen.omega / (2 * np.pi)
    falls = -np.pi * frequency[:, None] * tau
    columns = [falls] + [np.eye(len(tau))[j] * np.ones_like(weight) for j in range(1, len(tau))]
    total = np.maximum(weight.sum(axis=1, keepdims=True), 1e-290)

    def projected(part: Float) -> Float:
        away = part - (weight * part).sum(axis=1, keepdims=True) / total
        return np.asarray((np.sqrt(weight) * away).ravel())

    data, counts = projected(logarithm), (weight > 0).any(axis=1)
    count = int((weight > 0).sum())
    spare = count - int(counts.sum()) - len(tau)
    if spare < 1 or not np.isfinite(tau).all():
        nothing = "too few amplitudes above the noise, or no travel times"
        return Quality(np.nan, np.nan, np.nan, np.nan, count, nothing)
    shared = max(1.0, 2 * np.pi / seen.duration / float(np.mean(np.diff(seen.omega))))

    def fitted(parts: list[Float], spare: int) -> tuple[Float, Float]:
        """The first two of the parts' sizes, and their standard errors."""
        design = np.stack([projected(part) for part in parts], axis=1)
        scale = np.maximum(np.linalg.norm(design, axis=0), 1e-290)
        inverse = np.linalg.pinv(design / scale)
        solution = inverse @ data
        excess = float(np.sum((data - design / scale @ solution) ** 2)) / spare
        variance = np.sum(inverse**2, axis=1) * shared * (max(1.0, excess) if known else excess)
        return (solution / scale)[:2], (np.sqrt(variance) / scale)[:2]

    (one, *_), (error, *_) = (part.tolist() for part in fitted(columns, spare))
    found = Quality(
        1 / one if one else np.inf, error / one**2 if one else np.nan, one, error, count
    )
    # 1/Q at either end of the band, if it changes in proportion to f.
    away = frequency / float(np.mean(frequency[counts])) - 1
    if spare > 1:
        (mean, bend), (_, unsure) = fitted([falls, away[:, None] * falls, *columns[1:]], spare - 1)
        ends = mean + bend * np.array([away[counts].min(), away[counts].max()])
        if abs(bend) > _SURELY * unsure and np.ptp(ends) > _CHANGED * abs(mean):
            return replace(found, reason=BENDS.format(*ends), bends=True)
    return found


def mean_quality(
    omega: Float,
    k: Any,
    k_error: Float,
    group: Float,
    group_error: Float,
    duration: float,
    alike: float = 0.0,
) -> Quality:
    """Q over a band from the wavenumber and the group velocity.

    Args:
        omega: ω, shape (n,), rad/s.
        k, k_error: complex, and the error of each part, shape (n,), rad/m; NaN where unknown.
        group, group_error: v_g, shape (n,), m/s.
        duration: of the window, s: frequencies closer than it resolves share their noise.
        alike: what is open of α at all frequencies alike, Np/m.

    Returns:
        The quality.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        inverse = 2 * k.imag * group / omega
        error = np.hypot(2 * group / omega * k_error, inverse * group_error / group)
        own = np.isfinite(inverse) & (error > 0) & (group > 0) & (group_error < 0.5 * group)
    count = int(own.sum())
    nan = np.nan
    if count < _FEWEST_FREQUENCIES:
        why = f"{count} frequencies with α and v_g; at least {_FEWEST_FREQUENCIES} are needed"
        if int((np.isfinite(inverse) & ~np.isfinite(error)).sum()) >= _FEWEST_FREQUENCIES:
            why = (
                "the error of α is not known: two receivers have none to spare, and the record "
                "shows no noise before the wave; add a receiver, or begin earlier"
            )
        return Quality(nan, nan, nan, nan, count, why)
    inverse, error, f = inverse[own], error[own], omega[own] / (2 * np.pi)
    weight = 1 / error**2
    mean = float(np.sum(weight * inverse) / weight.sum())
    # Losses change v_g themselves, by the part 1/πQ of it, which the definition leaves open.
    unsaid = mean**2 / math.pi
    excess = float(np.sum((inverse - mean) ** 2 / (error**2 + unsaid**2)) / (count - 1))
    shared = max(1.0, 1 / duration / float(np.median(np.diff(f))))
    # So do those that are off the mean alike, as by echoes.
    left = (inverse - mean) / error
    along = max(0.0, float(np.sum(left[1:] * left[:-1]) / np.sum(left**2)))
    shared = max(shared, min((1 + along) / max(1 - along, 1e-9), count))
    spread = float(np.sum(1 / (error**2 + unsaid**2)))
    # What bars hold and values do not scatter by is off at all alike, and no mean lessens it.
    few = 2 * math.sqrt(2 * shared / count)
    common = max(0.0, 1 - excess - few) * count / float(weight.sum())
    bar = float(np.sqrt(max(shared / weight.sum(), (excess > 1) * excess * shared / spread)))
    gains = 2 * alike * float(np.median(group[own] / omega[own]))
    bar = math.sqrt(bar**2 + unsaid**2 + common + gains**2)
    least = 1 / max(max(mean, 0.0) + 2 * bar, 1e-300)
    seen, at_each = mean > 2 * bar, inverse[inverse > 2 * error]
    why = "" if seen else UNSEEN.format(least)
    if not seen and len(at_each) > count / 2:
        why, least = CHANGES.format(1 / at_each.max(), 1 / at_each.min()), nan
    return Quality(
        1 / mean if seen else nan, bar / mean**2 if seen else nan, mean, bar, count,
        why, least, (float(f[0]), float(f[-1])), excess,
    )  # fmt: skip


def all_alike(
    omega: Float,
    c: Float,
    loss: Float,
    error: Float,
    span: float,
    duration: float,
) -> str:
    """Why amplitudes unlike at all frequencies alike tell no α, nor Q from it; "" elsewhere.

    A Q that does not depend on frequency has α ∝ ω where the velocity is constant. Waves that
    spread, gains, and what lies between receivers add a part α₀ that is the same at all: the line
    α = α₀ + βω then begins above 0, or, where it curves up as viscous losses do, ∝ ω², the parabola
    below it; and amplitudes are e^{−α₀ Δx} times as large besides.

    Args:
        omega, c, loss, error: ω, phase velocity, α and its standard error, shape (n,); NaN where
            unknown.
        span: Δx of first and last receiver, m.
        duration: of the window, s, as for :func:`mean_quality`.
    """
    own = np.isfinite(loss) & (error > 0)
    if own.sum() <= _FEWEST_FREQUENCIES:
        return ""
    if not _constant(c[own]):
        return ""
    w, alpha, weight = omega[own], loss[own], 1 / error[own]
    shared = max(1.0, 2 * np.pi / duration / float(np.median(np.diff(w))))

    def beyond(degree: int) -> tuple[float, float]:
        """α₀ of a polynomial, and how far it is from 0, in standard errors."""
        design = weight[:, None] * (w[:, None] / w[-1]) ** np.arange(degree + 1)
        inverse = np.linalg.pinv(design)
        found = inverse @ (weight * alpha)
        left = float(np.sum((weight * alpha - design @ found) ** 2)) / (len(w) - degree - 1)
        deviation = float(np.linalg.norm(inverse[0])) * math.sqrt(shared * max(1.0, left))
        open_ = _PART * abs(float(np.median(alpha)))
        return float(found[0]), max(abs(float(found[0])) - open_, 0.0) / deviation

    constant, sure = beyond(1)
    if constant < 0:
        constant, sure = beyond(2)
    if not sure > _SURELY:
        return ""
    return ALIKE.format(math.exp(-constant * span))


def left_to_gains(quality: Quality, ratio: Quality, omega: Float, c: Float) -> float:
    """What the spectral ratio, which no gain or spreading touches, leaves open of α, Np/m.

    Gains put α off at all frequencies alike, and of few receivers nothing else is left over that
    would tell it: 1/Q of α and that of the ratio, less by 1/πQ² as losses change velocities, are
    then apart, by 2α₀c/ω. 0 where velocities change more, and the ratio tells nothing.

    Args:
        quality, ratio: of :func:`mean_quality` and :func:`under_its_assumption`.
        omega, c: as for :func:`all_alike`.
    """
    known = np.isfinite(c)
    if ratio.varies or not known.any() or not _constant(c[known]):
        return 0.0
    by_ratio = ratio.inverse + ratio.inverse**2 / math.pi
    apart = abs(quality.inverse - by_ratio)
    seen = apart > ratio.inverse_error
    return apart * float(np.median(omega[known] / c[known])) / 2 if seen else 0.0


def _constant(c: Float) -> bool:
    """Whether a velocity is constant, as the spectral ratio takes it; at the band's ends noise
    makes it what it is not."""
    low, middle, high = np.percentile(c, (10, 50, 90))
    return bool(high - low <= _CONSTANT * middle)


def under_its_assumption(ratio: Quality, omega: Float, group: Float, group_error: Float) -> Quality:
    """The spectral ratio's Q with what a velocity that is not constant does to it.

    Args:
        ratio: of :func:`constant_quality_of_amplitudes`.
        omega, group, group_error: v_g(ω) and its standard error, shape (n,); NaN where unknown.

    Returns:
        The same with an error that holds it, and with a reason where it is more than a tenth of Q.
    """
    if ratio.reason and not ratio.bends:
        return ratio
    with np.errstate(invalid="ignore"):
        own = np.isfinite(group) & (group > 0) & (group_error < 0.1 * group)
    if own.sum() < _FEWEST_FREQUENCIES:
        return ratio if ratio.bends else replace(ratio, reason=NOT_KNOWN)
    v, f = group[own], omega[own] / (2 * np.pi)
    slope = float(np.polyfit(f, 1 / v, 1, w=v**2 / group_error[own])[0])
    apart = abs(slope) * float(f.mean()) * float(np.mean(v))
    widened = replace(
        ratio,
        error=float(np.hypot(ratio.error, apart * ratio.quality)),
        inverse_error=float(np.hypot(ratio.inverse_error, apart * ratio.inverse)),
    )
    if apart <= _CONSTANT:
        if ratio.bends or widened.inverse > 2 * widened.inverse_error:
            return widened
        least = 1 / max(max(ratio.inverse, 0.0) + 2 * widened.inverse_error, 1e-300)
        return replace(widened, quality=np.nan, error=np.nan, reason=UNSEEN.format(least))
    change = float(np.ptp(v) / np.mean(v))
    return replace(
        widened,
        varies=True,
        reason=f"the velocity changes by {change:.0%} over the band, and the spectral ratio takes "
        "it as constant: Q from α and v_g holds",
    )
