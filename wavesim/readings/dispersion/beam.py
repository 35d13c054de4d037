"""k at each frequency of a line of many receivers, by the phases along it: a beam.

    B(k, ω) = |Σ_n w_n e^{−ikx_n} U_n(ω)/|U_n(ω)|| / Σ_n w_n

with each receiver's amplitude divided out (``phase_beam.py``). The highest B at a frequency is a
wave where phases at random would hardly ever be as much in line. Where amplitudes are tame as well,
further waves are fitted along with it, amplitude and phase, as long as they explain by far the most
of what is left.

What no wave explains, 1 − B² and the scatter of amplitudes, may be a wave not told apart, so that
the error of k is a part of the aperture's resolution: about √(unexplained)/X.

A receiver counts at frequencies that are surer than 2π/T (``receiver_spectra.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.dispersion.halves_of_line import of_a_late_side
from wavesim.readings.dispersion.hidden_mode import Bends, along, of_receivers
from wavesim.readings.dispersion.line_fit import fit_line
from wavesim.readings.dispersion.phase_beam import highest_beam, phase_beam
from wavesim.readings.dispersion.receiver_spectra import FEWEST, spectra

Float = NDArray[Any]
Complex = NDArray[np.complex128]

# Chance that phases at random pass for a wave at one frequency.
_BY_CHANCE = 1e-3
# Error of k times X over √(unexplained), where that is no noise of its own at each receiver.
_OF_RESOLUTION = 2.0
# Noise is looked at where there is no more than so many times what is at the highest frequencies.
_AT_FLOOR = 4.0
# Noise is common to receivers where it is by so many deviations.
_SURELY = 3.0
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
        bends: of each, beside the others at its frequency.
        unsure: standard error of the frequency, rad/s.
        cut: whether it is nothing but what the record's ends leave of others.
        noise: its standard deviation at half the frequencies or more, unit of the amplitude.
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
    noise: float


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
    quiet = float(np.median(np.sqrt(np.mean(seen.noise**2, axis=1))))
    seen = seen.take(seen.omega <= omega_max)
    omega = seen.omega
    rows = np.flatnonzero(seen.weight.any(axis=1))
    seen = seen.take(rows)
    U, noise, weight = seen.U, seen.noise, np.where(seen.unsure < cell, seen.weight, 0.0)
    cut = (weight > 0).sum(axis=1) < FEWEST
    weight[cut] = seen.weight[cut]
    unsure = np.sum(weight * seen.unsure, axis=1) / np.sum(weight, axis=1)
    k, length = highest_beam(U, x, weight)
    bends = _bends(U, x, weight, k)
    alone = _by_phase(U, omega[rows], x, noise, weight, k, length, together(k))
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
        hidden = _bends_beside(U[[i]], x, weight[[i]] > 0, ks, noise[i])
        parts.append([np.full(m, row), ks, error, sizes, np.full(m, left), np.ones(m), *hidden])
    columns = [np.concatenate(c) for c in zip(*parts, strict=True)]
    step, k, error, size, left, clear = columns[:6]
    at = np.searchsorted(rows, step)
    found = Beams(step.astype(int), k, error, size, left, clear > 0, Bends(*columns[6:]),
                  unsure[at], cut[at], quiet)  # fmt: skip
    return omega, found


def _by_phase(
    U: Complex,
    omega: Float,
    x: Float,
    noise: Float,
    weight: Float,
    k: Float,
    length: Float,
    together: Float,
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
    noisy = noisy * np.sqrt(np.clip(more, 1, _NOISE_SPREAD) * together)
    error = np.hypot(noisy, _OF_RESOLUTION * np.sqrt(excess) / np.maximum(length, 1e-290))
    error = np.hypot(error, of_a_late_side(U, omega, k, weight, away, own))
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


def _bends_beside(U: Complex, x: Float, used: Any, k: Float, noise: Float) -> Float:
    """Bends of each of several waves at one frequency beside the others, of any k, shape (3, m)."""
    level, t = np.sqrt(np.mean(noise[used[0]] ** 2, keepdims=True)), (x - x.mean()) / np.ptp(x)
    found = []
    for j in range(len(k)):
        others = np.concatenate([o := along(np.delete(k, j)[None], x), o * t[:, None]], axis=-1)
        one, _ = of_receivers(U, x, used, k[[j]], others, level)
        found.append([one.size[0], one.noise[0], one.over[0]])
    return np.array(found).T


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
    chosen, start = before.residual, before.k
    power = np.abs(U) ** 2 * used
    tame = np.sum(power, axis=1) ** 2 / np.maximum(np.sum(power**2, axis=1), 1e-290)
    settled = (chosen <= 4 * level**2) | (before.unexplained > 0.9)
    for waves in range(2, MOST_WAVES + 1):
        tried = np.flatnonzero(~settled & (tame >= _TAME * waves) & np.isfinite(start).all(axis=1))
        if not len(tried):
            break
        left = _left_over(U[tried], x, used[tried], start[tried])
        weight = np.abs(left) * used[tried]
        extra, _ = highest_beam(left, x, weight)
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
