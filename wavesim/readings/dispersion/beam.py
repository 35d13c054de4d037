"""k at each frequency of a line of many receivers, by the phases along it: a beam.

    B(k, ω) = |Σ_n w_n e^{−ikx_n} U_n(ω)/|U_n(ω)|| / Σ_n w_n

The phase-shift method of surface-wave surveys (Park, Miller & Xia, SEG Expanded Abstracts 17, 1377
(1998)): each receiver's amplitude is divided out, so that neither losses, spreading nor how a
receiver is coupled counts. The highest B at a frequency is a wave where phases at random would
hardly ever be as much in line. Where amplitudes are tame as well, further waves are fitted along
with it, amplitude and phase, as long as they explain by far the most of what is left.

What no wave explains, 1 − B² and the scatter of amplitudes, may be a wave not told apart, so that
the error of k is a part of the aperture's resolution: about √(unexplained)/X.

Of a record that begins or ends inside its signal the transform of u under a window h shows other
frequencies' waves at ω: where all is e^{ik(ω)x}, ∂ ln U/∂x = ik + (dk/dω) U′/U, with U′ that of u
under dh/dt. A receiver counts at frequencies where |U′/U|, by which ω is unsure, is below 2π/T.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from wavesim.readings.dispersion.hidden_mode import Bends
from wavesim.readings.dispersion.line_fit import fit_line
from wavesim.readings.dispersion.noise_level import noise_of_transform
from wavesim.records.windows import hann

Float = NDArray[Any]
Complex = NDArray[np.complex128]

# Receivers count where they stand so many deviations above the noise, and so many at least.
_ABOVE_NOISE = 1.0
# … and the middle one of so many about each so many.
_NEIGHBOURS, _ABOUT = 5, 1.5
FEWEST = 5
# Points of the search over k in each 2π/X.
_PER_CELL = 8
_STEPS = 12
# Chance that phases at random pass for a wave at one frequency.
_BY_CHANCE = 1e-3
# Error of k times X over √(unexplained), where that is no noise of its own at each receiver.
_OF_RESOLUTION = 2.0
# Noise is looked at where there is no more than so many times what is at the highest frequencies.
_AT_FLOOR = 4.0
# Noise is common to receivers where it is by so many deviations.
_SURELY = 3.0
# Both ends are let down where so much more of the power is then of sure frequency.
_CLEARLY = 0.1
# Unexplained up to so many times the noise's own is noise.
_NOISE_SPREAD = 1.5
# Amplitudes are tame where so many receivers for each wave hold the power …
_TAME = 4.0
# Further waves are fitted there where they lower what is left over, per free parameter, so much …
_BETTER = 6.0
# … and leave nothing but noise, or this part of the power; each this strong, over the strongest.
_LEFT = 1e-6
# Waves closer than half of 2π/X are believed only where nothing at all is left.
_EXACT = 1e-13
# What the record's end leaves of the waves, over their amplitude.
_ENDED = 6e-8
_WEAKEST = 0.02
# … and than so many times what the frequency is unsure by, over 2π/T: the record's ends are none.
_OF_ENDS = 3.0
MOST_WAVES = 3
# A line's beam that comes back to this height is an alias.
_ALIAS = 0.7
# The record's last part is let down to 0.
_TAPER = 0.05
# Below this part of the strongest frequency's amplitude nothing is looked at.
_FAINT = 1e-4


@dataclass(frozen=True)
class Beams:
    """Waves found along a line; flat arrays (m,).

    Attributes:
        step: index of the frequency.
        k: along x, signed, rad/m.
        error: standard error of k, rad/m.
        amplitude: root mean square over the line, unit of the record times s.
        unexplained: part of the power, or of the phases, that no wave explains.
        clear: whether chance explains it no better.
        bends: of those that are alone at their frequency; 0 of others.
        unsure: standard error of the frequency, rad/s.
        cut: whether it is nothing but what the record's ends leave of others.
    """

    step: NDArray[np.int64]
    k: Float
    error: Float
    amplitude: Float
    unexplained: Float
    clear: NDArray[np.bool_]
    bends: Bends
    unsure: Float
    cut: NDArray[np.bool_]


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
    best, most = None, 0.0
    for window in (let_down, hann(count)):
        change = np.diff(window, prepend=0.0)
        change[-1] -= window[-1]
        U, V = (_transform(values * h[:, None], interval) for h in (window, change))
        of_U, of_V = (noise * np.sqrt(np.sum(h**2)) for h in (window, change))
        excess = np.maximum(np.abs(V) ** 2 - (_SURELY * of_V) ** 2, 0)
        unsure = np.sqrt(excess) / np.maximum(np.abs(U), 1e-290) / interval
        weight = _weights(U, of_U)
        weight[np.abs(U).max(axis=1) < _FAINT * np.abs(U).max()] = 0.0
        power = np.abs(U) ** 2 * (weight > 0)
        share = float(np.sum(power * (unsure < omega[0])) / max(np.sum(power), 1e-290))
        if best is None or share > most + _CLEARLY:
            best, most = Spectra(omega, U, of_U, weight, unsure), share
    assert best is not None
    return best


def _transform(values: Float, interval: float) -> Complex:
    """∫ u e^{iωt} dt, shape (n, nx), but for ω = 0."""
    return np.asarray(np.conj(np.fft.rfft(values, axis=0))[1:] * interval, complex)


def highest_wavenumber(x: Float) -> float:
    """Largest |k| that a line tells from its aliases, rad/m: π/d where receivers are d apart.

    Half the least k at which the line's own beam, |Σ e^{ikx}|/N, comes back to 0.7.

    Args:
        x: positions, ascending, shape (nx,), m.
    """
    least = float(np.diff(x).min())
    k = np.arange(0, 2.02 * np.pi / least, np.pi / (4 * float(np.ptp(x))))
    own = np.concatenate(
        [np.abs(np.exp(1j * np.multiply.outer(part, x)).mean(axis=1))
         for part in np.array_split(k, max(1, len(k) * len(x) // 2_000_000))]
    )  # fmt: skip
    lobe = int(np.argmax(own < 0.5))
    again = np.flatnonzero(own[lobe:] > _ALIAS)
    if not len(again):
        return float(np.pi / least)
    low = lobe + int(again[0])
    top = low + int(np.argmax(own[low : low + 16]))
    return min(float(k[top]) / 2, float(np.pi / least))


def phase_beam(U: Complex, x: Float, weight: Float, k: Float) -> Float:
    """B(k, ω), shape (nω, nk).

    Args:
        U: shape (nω, nx).
        x: positions, shape (nx,), m.
        weight: w, shape (nω, nx), –.
        k: wavenumbers, shape (nk,), or (nω, nk) for those of each frequency, rad/m.
    """
    unit = weight * U / np.maximum(np.abs(U), 1e-290)
    unit[(weight > 0).sum(axis=1) < FEWEST] = 0.0
    total = np.maximum(weight.sum(axis=1), 1e-290)[:, None]
    if k.ndim == 1:
        return np.asarray(np.abs(unit @ np.exp(-1j * np.multiply.outer(x, k))) / total)
    steer = np.exp(-1j * k[:, None, :] * x[:, None])
    return np.asarray(np.abs(np.einsum("fx,fxk->fk", unit, steer)) / total)


def _in_step(U: Complex, x: Float) -> Callable[[Float], Float]:
    """How much more of the noise's power a wave of given k hears than if receivers shared none.

    A clock that shivers shifts all receivers at once: its noise, seen at high frequencies where the
    signal is not, is as long in x as the signal is, and has the signal's wavenumbers. It is in
    phases alone, which makes it twice as much.
    """
    high = U[len(U) // 2 : -1]
    size = np.mean(np.abs(high) ** 2, axis=1)
    high = high[size <= _AT_FLOOR * float(np.median(size[-max(4, len(U) // 10) :]))]
    high = high / np.maximum(np.sqrt(np.mean(np.abs(high) ** 2, axis=0)), 1e-290)
    lever = (x - x.mean()) / np.sqrt(np.sum((x - x.mean()) ** 2))

    def heard(k: Float) -> Float:
        power = np.abs(high @ (lever[:, None] * np.exp(-1j * np.outer(x, k)))) ** 2
        more = power.mean(axis=0)
        return np.where(more > 1 + _SURELY / np.sqrt(len(high)), 2 * more, 1.0)

    return heard


def _weights(U: Complex, noise: Float) -> Float:
    """What each receiver's phase tells, shape of U: 1 far above the noise, 0 within it."""
    strength = np.abs(U) / np.maximum(noise, 1e-290)
    # Noise alone is above its own deviation at one of three receivers, but not all about it.
    about = median_filter(strength, size=(1, _NEIGHBOURS), mode="nearest")
    heard = (strength > _ABOVE_NOISE) & (about > _ABOUT)
    return np.where(heard, strength**2 / (strength**2 + 1), 0.0)


def beams(
    values: Float, x: Float, interval: float, omega_max: float, quantum: Float | float = 0.0
) -> tuple[Float, Beams]:
    """The waves along a line, at each frequency of its transform.

    Args:
        values: u, shape (nt, nx).
        x: positions, ascending, shape (nx,), m.
        interval: Δt, s.
        omega_max: highest frequency wanted, rad/s.
        quantum: least step between samples, shape (nx,) or (), unit of the values.

    Returns:
        Frequencies (n,), rad/s, and what was found at them.
    """
    seen = spectra(values, interval, quantum)
    together, cell = _in_step(seen.U, x), seen.omega[0]
    seen = seen.take(seen.omega <= omega_max)
    omega, fewest = seen.omega, min(FEWEST, len(x))
    rows = np.flatnonzero((seen.weight > 0).sum(axis=1) >= fewest)
    seen = seen.take(rows)
    U, noise, weight = seen.U, seen.noise, np.where(seen.unsure < cell, seen.weight, 0.0)
    cut = (weight > 0).sum(axis=1) < fewest
    weight[cut] = seen.weight[cut]
    unsure = np.sum(weight * seen.unsure, axis=1) / np.sum(weight, axis=1)
    k, length = _highest(U, x, weight)
    bends = _bends(U, x, weight, k)
    alone = _by_phase(U, x, noise, weight, k, length, together(k))
    one = (*alone, bends.size, bends.noise, bends.over)
    fits = _fitted(U, x, weight > 0, k, noise, np.maximum(_WEAKEST, _OF_ENDS * unsure / cell))
    parts = [[np.zeros(0)] * 9]
    for i, row in enumerate(rows):
        if i not in fits:
            parts.append([np.array([v]) for v in (row, *(column[i] for column in one))])
            continue
        ks, errors, sizes, left, excess = fits[i]
        errors, m = errors * np.sqrt(together(ks)), len(ks)
        error = np.hypot(errors, _OF_RESOLUTION * np.sqrt(excess) / length[i])
        parts.append(
            [np.full(m, row), ks, error, sizes, np.full(m, left), np.ones(m), *np.zeros((3, m))]
        )
    columns = [np.concatenate(c) for c in zip(*parts, strict=True)]
    step, k, error, size, left, clear = columns[:6]
    at = np.searchsorted(rows, step)
    found = Beams(step.astype(int), k, error, size, left, clear > 0, Bends(*columns[6:]),
                  unsure[at], cut[at])  # fmt: skip
    return omega, found


def _highest(U: Complex, x: Float, weight: Float) -> tuple[Float, Float]:
    """k of the highest beam at each frequency, and √12 times the spread of its receivers, m."""
    gap = np.pi / highest_wavenumber(x)
    cells = max(4, int(np.ceil(float(np.ptp(x)) / gap)) + 1)
    grid = np.linspace(-np.pi, np.pi, 2 * (cells * _PER_CELL // 2) + 1) / gap
    k = np.zeros(len(U))
    for some in np.array_split(np.arange(len(U)), max(1, len(U) * len(grid) // 2_000_000)):
        k[some] = grid[phase_beam(U[some], x, weight[some], grid).argmax(axis=1)]
    total = np.maximum(weight.sum(axis=1), 1e-290)
    middle = (weight @ x) / total
    away = x - middle[:, None]
    spread = np.sqrt(np.sum(weight * away**2, axis=1) / total)
    # Newton's steps up |S|², S = Σ w e^{−ikx} U/|U|, no further than an eighth of a cell.
    unit = weight * U / np.maximum(np.abs(U), 1e-290)
    limit = np.pi / (2 * _PER_CELL * np.maximum(spread, 1e-290))
    for _ in range(_STEPS):
        turned = unit * np.exp(-1j * k[:, None] * away)
        S, first = turned.sum(axis=1), np.sum(-1j * away * turned, axis=1)
        second = np.sum(-(away**2) * turned, axis=1)
        slope = np.real(np.conj(S) * first)
        bend = np.abs(first) ** 2 + np.real(np.conj(S) * second)
        step = np.where(bend < 0, -slope / np.where(bend < 0, bend, 1), 0.0)
        k = k + np.clip(step, -limit, limit)
    return k, np.sqrt(12) * spread


def _by_phase(
    U: Complex, x: Float, noise: Float, weight: Float, k: Float, length: Float, together: Float
) -> tuple[Float, Float, Float, Float, Float]:
    """k, its error, amplitude, unexplained and whether clear, of one wave at each frequency."""
    B = phase_beam(U, x, weight, k[:, None])[:, 0]
    total = np.maximum(weight.sum(axis=1), 1e-290)
    telling = total**2 / np.maximum(np.sum(weight**2, axis=1), 1e-290)
    ratio = noise / np.maximum(np.abs(U), 1e-290)
    variance = ratio**2 / 2 + ratio**4  # of a phase in noise, and within it
    own = np.sum(weight * variance, axis=1) / total
    left = np.clip(1 - B**2, 0, 1)
    excess = np.maximum(left - _NOISE_SPREAD * own, 0) + _uneven(U, x, weight, ratio)
    away = x - (weight @ x / total)[:, None]
    lever = np.maximum(np.sum(weight * away**2, axis=1), 1e-290)
    noisy = np.sqrt(np.sum((weight * away) ** 2 * variance, axis=1)) / lever
    # Noise that is known too low shows in what is left over.
    more = left * telling / np.maximum(telling - 2, 1) / np.maximum(own, 1e-290)
    noisy = noisy * np.sqrt(np.clip(more, 1, _NOISE_SPREAD))
    noisy = noisy * np.sqrt(together)
    error = np.hypot(noisy, _OF_RESOLUTION * np.sqrt(excess) / np.maximum(length, 1e-290))
    telling = telling / np.maximum(together / 2, 1)  # of receivers that share theirs, fewer count
    chance = np.exp(np.maximum(telling - 1, 1) * np.log(np.maximum(left, 1e-300))) * len(x)
    size = np.sqrt(np.sum(np.abs(U) ** 2 * (weight > 0), axis=1) / (weight > 0).sum(axis=1))
    return k, error, size, left, (chance < _BY_CHANCE).astype(float)


def _bends(U: Complex, x: Float, weight: Float, k: Float) -> Bends:
    """How the logarithm of one wave bends along the line, at each frequency.

    Amplitudes that only spread or fade are convex: no such bend is counted.
    """
    total = np.maximum(weight.sum(axis=1), 1e-290)[:, None]
    away = x - weight @ x[:, None] / total
    length = np.sqrt(np.sum(weight * away**2, axis=1, keepdims=True) / total)
    turned = U * np.exp(-1j * k[:, None] * away)
    mean = np.sum(weight * turned / np.maximum(np.abs(turned), 1e-290), axis=1)
    turned = turned * np.exp(-1j * np.angle(mean))[:, None]
    away = away / np.maximum(length, 1e-290)
    root = np.sqrt(weight)
    basis = np.stack([np.ones_like(away), away, away**2 / 2], axis=-1) * root[..., None]
    inverse = np.linalg.inv(np.swapaxes(basis, 1, 2) @ basis + 1e-9 * total[..., None] * np.eye(3))
    spare = np.maximum((weight > 0).sum(axis=1) - 3, 1)
    found = []
    for seen in (np.angle(turned), np.log(np.maximum(np.abs(turned), 1e-290))):
        right = np.swapaxes(basis, 1, 2) @ (root * seen)[..., None]
        fit = inverse @ right
        left = root * seen - (basis @ fit)[..., 0]
        found += [fit[:, 2, 0], np.sum(left**2, axis=1) / spare * inverse[:, 2, 2]]
    phase, unsure, level, rough = found
    size, noise = phase**2 + np.minimum(level, 0) ** 2, unsure + rough / 2
    # Of bends of amplitude half are concave by chance.
    over = phase**2 / np.maximum(unsure, 1e-290)
    over = (over + 2 * np.minimum(level, 0) ** 2 / np.maximum(rough, 1e-290)) / 2
    square = np.maximum(length[:, 0], 1e-290) ** 2
    return Bends(np.sqrt(size) / square, np.sqrt(noise) / square, over)


def _uneven(U: Complex, x: Float, weight: Float, ratio: Float) -> Float:
    """Variance of ln|U| about a straight line, beyond the noise's: what losses do not explain."""
    level = np.log(np.maximum(np.abs(U), 1e-290))
    total = np.maximum(weight.sum(axis=1), 1e-290)[:, None]
    away = x - np.sum(weight * x, axis=1, keepdims=True) / total
    level = level - np.sum(weight * level, axis=1, keepdims=True) / total
    slope = np.sum(weight * away * level, axis=1) / np.sum(weight * away**2, axis=1)
    left = level - slope[:, None] * away
    own = _NOISE_SPREAD * np.sum(weight * ratio**2 / 2, axis=1)
    return np.asarray(np.maximum(np.sum(weight * left**2, axis=1) - own, 0) / total[:, 0])


def _fitted(
    U: Complex, x: Float, used: Any, k: Float, noise: Float, weakest: Float
) -> dict[int, Any]:
    """Further waves, amplitude and phase together, where they explain nearly all of the power."""
    level = np.sqrt(np.sum(noise**2 * used, axis=1) / np.maximum(used.sum(axis=1), 1))
    before = fit_line(U, x, used, 1, False, k[:, None].astype(complex))
    best: dict[int, Any] = {}
    chosen = before.residual
    start = before.k
    power = np.abs(U) ** 2 * used
    tame = np.sum(power, axis=1) ** 2 / np.maximum(np.sum(power**2, axis=1), 1e-290)
    settled = (chosen <= 4 * level**2) | (before.unexplained > 0.9)
    for waves in range(2, MOST_WAVES + 1):
        tried = np.flatnonzero(~settled & (tame >= _TAME * waves) & np.isfinite(start).all(axis=1))
        if not len(tried):
            break
        left = _left_over(U[tried], x, used[tried], start[tried])
        weight = np.abs(left) * used[tried]
        extra, _ = _highest(left, x, weight)
        guess = np.concatenate([start[tried], extra[:, None]], axis=1)
        now = fit_line(U[tried], x, used[tried], waves, False, guess)
        start = np.full((len(U), waves), np.nan, complex)
        start[tried] = now.k
        for j, i in enumerate(tried):
            size = now.forward[j]
            apart = np.abs(np.subtract.outer(now.k[j].real, now.k[j].real)) + np.diag(
                [np.inf] * waves
            )
            good = (
                now.residual[j] * _BETTER < chosen[i]
                and (now.unexplained[j] < _LEFT or now.residual[j] < _NOISE_SPREAD * level[i] ** 2)
                and size.min() > weakest[i] * size.max()
                and size.max() < 4 * np.sqrt(np.mean(np.abs(U[i][used[i]]) ** 2))
                and (apart.min() * float(np.ptp(x)) > np.pi or now.unexplained[j] < _EXACT)
            )
            if good:
                chosen[i] = now.residual[j]
                ended = (_ENDED * np.abs(U[i][used[i]]).max()) ** 2
                deviation = np.sqrt(max(now.residual[j], level[i] ** 2) + ended)
                errors = deviation * now.unit[j] / np.sqrt(2)  # of the real part
                # What is left over of noise is in these errors.
                over = 1 - _NOISE_SPREAD * level[i] ** 2 / max(now.residual[j], 1e-290)
                rest = float(now.unexplained[j])
                best[int(i)] = (now.k[j].real, errors, size, rest, rest * max(over, 0.0))
        settled |= chosen <= 4 * level**2
    return best


def _left_over(U: Complex, x: Float, used: Any, k: Complex) -> Complex:
    """U less its best sum of waves."""
    away = x - x.mean()
    basis = np.exp(1j * k[:, None, :] * away[:, None]) * used[..., None]
    basis = basis / np.maximum(np.linalg.norm(basis, axis=1, keepdims=True), 1e-290)
    seen = np.where(used, U, 0)[..., None]
    return np.asarray((seen - basis @ (np.linalg.pinv(basis) @ seen))[..., 0])
