"""Complex wavenumbers fitted to amplitudes along a line, at many frequencies at once.

    U(x) = Σ_p A_p e^{ik_p x} + B_p e^{−ik_p x},    p = 1 … P pairs

k is fitted by variable projection (Golub & Pereyra, SIAM J. Numer. Anal. 10, 413 (1973)), from
first guesses that evenly spaced receivers give in closed form: Prony's relation in its symmetric
form, where w = 2 cos(kd) solves w = c₀ of U₊₁ + U₋₁ = c₀ U₀ for one pair and
w² − 2 = c₁ w + c₀ of U₊₂ + U₋₂ = c₁(U₊₁ + U₋₁) + c₀ U₀ for two. Uneven ones
begin at the highest beams of their phases.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from wavesim.readings.dispersion.phase_beam import beams_by_height, highest_wavenumber

Float = NDArray[Any]
Complex = NDArray[np.complex128]

_STEPS = 80
# So many beams of uneven receivers are first guesses of Re k; of two pairs, of each of so many.
_BEAMS, _OF_TWO = 8, 4
# Receivers closer than this part of their spacing to even count as even.
_EVEN = 1e-6
# Left over up to so many times the noise's power is noise; of more, so much of what one wave hears
# of it is added; and what a 95 % bar leaves out.
NOISE_SPREAD, _HEARD, _OUTSIDE = 1.5, 2.0, 0.05
# A later guess must leave less than this part of what an earlier one leaves.
_BETTER = 0.98


@dataclass(frozen=True)
class LineFit:
    """Wavenumbers fitted at n frequencies, P pairs ±k at each.

    Attributes:
        k: shape (n, P), rad/m, Im k ≥ 0; NaN where too few receivers count.
        unit: standard error of |k| for a noise of variance 1 in U, shape (n, P), rad/m.
        forward, backward: √ of the mean square over the receivers of each wave, shape (n, P).
        residual: mean square left over, of those receivers, per free parameter, shape (n,).
        unexplained: part of the power left over, shape (n,).
        rival: square, of all receivers, that waves at least π/X off these leave over besides, shape
            (n,); NaN where there are none such.
        alike: how much more of what is left over is heard by the wave that hears most than of noise
            of each receiver's own, –: about 1 of such, more of another wave, shape (n,).
    """

    k: Complex
    unit: Float
    forward: Float
    backward: Float
    residual: Float
    unexplained: Float
    rival: Float
    alike: Float


def unknowns(pairs: int, both: bool) -> int:
    """Complex unknowns of a fit: as many receivers are the least."""
    return pairs * (3 if both else 2)


def deviation(
    fit: LineFit, spare: Any, noise: Float, rows: Any = slice(None), everywhere: bool = True
) -> Float:
    """Deviation of U by which a 95 % bar of k is √(−ln 0.05) ``fit.unit`` times it.

    What noise does not explain may be another wave, which receivers hear together, and is known
    from no more receivers than there are to spare, by Student's t. Gains alone are off along one
    direction of the complex plane. They are so at all frequencies alike: of a quiet wave noise
    covers what a loud one shows, by chance so does the wave itself, and its k is as far off.

    Args:
        fit: of n frequencies.
        spare: receivers beyond the unknowns, shape (m,), –.
        noise: its power in U, shape (m,).
        rows: which m of the frequencies.
        everywhere: whether what is off at half of the power is taken to be off at all frequencies.

    Returns:
        √ of the power, shape (m,); NaN where receivers are too few.
    """
    left = fit.residual[rows]
    power = np.sum(fit.forward[rows] ** 2 + fit.backward[rows] ** 2, axis=1)
    excess = np.maximum(left - NOISE_SPREAD * noise, 0.0)
    if everywhere:
        excess = np.maximum(excess, _usual(excess, power) * power)
        left = np.maximum(left, excess)
    size = np.sqrt(np.maximum(left, noise) + _HEARD * fit.alike[rows] * excess)
    wide = -stdtrit(np.maximum(spare, 1), _OUTSIDE / 2) / np.sqrt(-np.log(_OUTSIDE))
    return np.where(spare < 0, np.nan, np.where(excess > 0, wide, 1.0) * size)


def _usual(excess: Float, power: Float) -> float:
    """Part of the power that is left over of half of all power, or more: of any size, –."""
    told = np.isfinite(excess) & (power > 0)
    if not told.any():
        return 0.0
    part, weight = excess[told] / power[told], power[told]
    order = np.argsort(part)
    so_far = np.cumsum(weight[order])
    return float(part[order][np.searchsorted(so_far, so_far[-1] / 2)])


@dataclass(frozen=True)
class _State:
    basis: Complex
    coefficients: Complex
    residual: Complex
    normal: Complex
    step: Complex


def _evaluate(U: Complex, x: Float, used: Any, k: Complex, both: bool) -> _State:
    """Best amplitudes at given k, and the Gauss–Newton step.

    Each wave is counted from the end at which it is largest, so that none overflows.
    """
    away = np.where(k[:, None, :].imag < 0, (x - x[-1])[:, None], (x - x[0])[:, None])
    ahead = np.exp(1j * k[:, None, :] * away) * used[..., None]
    slope_a = 1j * away * ahead
    basis = ahead
    if both:
        back = np.exp(-1j * k[:, None, :] * (x - x[-1])[:, None]) * used[..., None]
        basis = np.concatenate([ahead, back], axis=-1)
    q, r = np.linalg.qr(basis)
    qh = np.conj(np.swapaxes(q, -1, -2))
    size = np.abs(np.diagonal(r, axis1=-2, axis2=-1)).max(axis=-1)
    # Where no receiver counts there is nothing to solve, and nothing is found.
    r = r + np.where(size > 0, 1e-14 * size, 1.0)[:, None, None] * np.eye(r.shape[-1])
    coefficients = np.linalg.solve(r, qh @ U[..., None])[..., 0]
    residual = U - (basis @ coefficients[..., None])[..., 0]
    p = k.shape[1]
    slope = coefficients[:, None, :p] * slope_a
    if both:
        slope = slope - coefficients[:, None, p:] * (1j * (x - x[-1])[:, None] * back)
    slope = slope - q @ (qh @ slope)
    sh = np.conj(np.swapaxes(slope, -1, -2))
    normal = sh @ slope
    diagonal = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2).real, 1e-280))
    scaled = normal / (diagonal[:, :, None] * diagonal[:, None, :]) + 1e-14 * np.eye(p)
    step = np.linalg.solve(scaled, (sh @ residual[..., None]) / diagonal[..., None])[..., 0]
    return _State(basis, coefficients, residual, normal, step / diagonal)


def fit_line(
    U: Complex,
    x: Float,
    used: NDArray[np.bool_],
    pairs: int,
    both: bool,
    start: Complex | None = None,
) -> LineFit:
    """Fit wavenumbers to amplitudes along a line without sources.

    Args:
        U: complex amplitudes, shape (n, nx).
        x: positions, ascending, shape (nx,), m.
        used: receivers that count, shape (n, nx).
        pairs: P, 1 or 2, –.
        both: whether waves run both ways.
        start: k that the fit begins at, shape (n, P), rad/m, where it is known so well that
            e^{ikx} is right to less than half a turn; k is then neither sought nor folded, and
            keeps its sign.

    Returns:
        The fit.
    """
    enough = used.sum(axis=1) >= unknowns(pairs, both)
    scale = np.sqrt(np.sum(np.abs(U) ** 2 * used, axis=1))
    data = np.where(used, U, 0) / np.maximum(scale, 1e-290)[:, None]
    best = np.full(len(U), np.inf)
    k = np.ones((len(U), pairs), complex)
    tried = []
    for guess in _guesses(data, x, used, pairs) if start is None else [start]:
        trial = _refined(data, x, used, guess, both)
        trial = _folded(trial, x) if start is None else trial
        left = np.sum(np.abs(_evaluate(data, x, used, trial, both).residual) ** 2, axis=1)
        tried.append((trial, left))
        # As good a fit at a shorter wave is an alias: the guesses ascend in |Re k|.
        better = np.isfinite(left) & (left < _BETTER * best)
        best[better], k[better] = left[better], trial[better]
    state = _evaluate(data, x, used, k, both)
    inverse = np.linalg.pinv(state.normal, hermitian=True)
    unit = np.sqrt(np.maximum(np.diagonal(inverse, axis1=1, axis2=2).real, 0))
    count = used.sum(axis=1)
    waves = state.coefficients[:, None, :] * state.basis
    size = np.sqrt(np.sum(np.abs(waves) ** 2, axis=1) / np.maximum(count, 1)[:, None])
    size *= scale[:, None]
    ahead = size[:, :pairs]
    back = size[:, pairs:] if both else np.zeros_like(ahead)
    flip = (k.imag < 0) & (start is None)
    spare = np.maximum(count - unknowns(pairs, both), 1)
    reach = _span(x, used)
    rival = np.full(len(U), np.nan)
    edge = highest_wavenumber(x) + np.pi / float(np.ptp(x))
    for trial, left in tried:
        other = _apart(trial, k, both) * reach > np.pi
        other &= (np.abs(trial.real) < edge).all(axis=1)  # an alias is no rival
        rival[other] = np.fmin(rival[other], left[other])
    return LineFit(
        np.where(enough[:, None], np.where(flip, -k, k), np.nan),
        unit / np.maximum(scale, 1e-290)[:, None],
        np.where(flip, back, ahead),
        np.where(flip, ahead, back),
        best * scale**2 / spare,
        best,
        (rival - best) * scale**2,
        _alike(state.residual, x, used),
    )


def _alike(left: Complex, x: Float, used: Any) -> Float:
    """How much more of what is left over the wave hears that hears most than one of noise alone.

    Of noise the highest beam hears ln m times the mean of m wavenumbers told apart.
    """
    edge = np.pi / float(np.diff(x).mean())
    cells = max(2, len(x))
    steer = np.exp(-1j * np.multiply.outer(x, np.linspace(-edge, edge, 4 * cells)))
    heard = (np.abs((left * used) @ steer) ** 2).max(axis=1)
    own = np.sum(np.abs(left) ** 2 * used, axis=1)
    return np.asarray(heard / np.maximum(own, 1e-290) / max(np.log(cells), 1.0))


def _span(x: Float, used: Any) -> Float:
    """From the first to the last receiver that counts, shape (n,), m."""
    last = used.shape[1] - 1 - used[:, ::-1].argmax(axis=1)
    return np.asarray(x[last] - x[used.argmax(axis=1)])


def _apart(k: Complex, other: Complex, both: bool) -> Float:
    """How far that Re k of one fit is that is farthest off any of another's, shape (n,), rad/m."""
    a, b = (np.abs(v.real) if both else v.real for v in (k, other))
    return np.asarray(np.abs(a[:, :, None] - b[:, None, :]).min(axis=2).max(axis=1))


def _refined(data: Complex, x: Float, used: Any, k: Complex, both: bool) -> Complex:
    length = float(x[-1] - x[0])
    found = np.where(np.isfinite(k), k, 1 / length).astype(complex)
    going = np.arange(len(found))
    for _ in range(_STEPS):
        k = found[going]
        step = _evaluate(data[going], x, used[going], k, both).step
        size = np.abs(step)
        most = np.maximum(0.3 / length, 0.1 * np.abs(k))
        k = k + step * np.minimum(1, most / np.maximum(size, 1e-290))
        k = k.real + 1j * np.clip(k.imag, 0 if both else -600 / length, 600 / length)
        found[going] = k
        going = going[~(size <= 1e-14 * np.abs(k)).all(axis=1)]
        if not len(going):
            break
    return found


def _folded(k: Complex, x: Float) -> Complex:
    """k with Re k between ±π/d where all receivers stand on one grid of pitch d."""
    gaps = np.diff(x)
    d = float(gaps.min())
    if np.abs(gaps / d - np.round(gaps / d)).max() > _EVEN * len(x):
        return k
    turn = 2 * np.pi / d
    return np.asarray(k - turn * np.round(k.real / turn))


def _guesses(U: Complex, x: Float, used: Any, pairs: int) -> list[Complex]:
    gaps = np.diff(x)
    d = float(gaps.mean())
    even = np.ptp(gaps) <= _EVEN * d
    found = []
    if even and len(x) >= 2 * pairs + 1:
        found.append(_prony(U, used, pairs) / d)
    inner = used[:, 1:] & used[:, :-1]
    size = np.sum(np.abs(U[:, :-1]) ** 2 * inner, axis=1)
    cross = np.sum(np.conj(U[:, :-1]) * U[:, 1:] * inner, axis=1)
    ratio = np.where(size > 0, cross, 1) / np.where(size > 0, size, 1)
    ratio = np.where(ratio == 0, 1, ratio)
    one = -1j * np.log(ratio) / d
    loss = np.maximum(one.imag, 0)
    singles = [one]
    if not even:
        edge = highest_wavenumber(x)
        reals = beams_by_height(U, x, used.astype(float), edge, _BEAMS)
        highest = reals[:, :_OF_TWO].T + 1j * loss
        reals = np.take_along_axis(reals, np.abs(reals).argsort(axis=1), axis=1)
        singles += list(reals.T + 1j * loss)
    if pairs == 1:
        return [*found, *(s[:, None] for s in singles)]
    others = (lambda s: 1j * np.abs(s), lambda s: 0.5 * s, lambda s: 2 * s)
    first = [one] if even else [one, *highest]
    return [*found, *(np.stack([s, other(s)], axis=1) for s in first for other in others)]


def _prony(U: Complex, used: Any, pairs: int) -> Complex:
    """k d from the symmetric recurrence, shape (n, P)."""
    last = U.shape[1] - pairs
    middle = slice(pairs, last)

    def around(j: int) -> Any:
        return U[:, pairs + j : last + j] + U[:, pairs - j : last - j]

    counts = used[:, middle].copy()
    for j in range(1, pairs + 1):
        counts &= used[:, pairs + j : last + j] & used[:, pairs - j : last - j]
    columns = [U[:, middle] * counts] + [around(j) * counts for j in range(1, pairs)]
    right = (around(pairs) * counts)[..., None]
    c = (np.linalg.pinv(np.stack(columns, axis=-1)) @ right)[..., 0]
    if pairs == 1:
        w = c
    else:
        root = np.sqrt(c[:, 1] ** 2 / 4 + 2 + c[:, 0])
        w = np.stack([c[:, 1] / 2 + root, c[:, 1] / 2 - root], axis=1)
    return np.asarray(np.arccos(w / 2))
