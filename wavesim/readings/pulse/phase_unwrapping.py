"""Re k(ω) up to what the phases of receivers leave open: the 2π ambiguity, and how it is resolved.

Two receivers d apart tell k only up to a multiple of 2π/d. Here the nearest neighbours decide it,
and receivers ever further apart then refine k, each phase taken at the multiple of 2π nearest to
what the nearer ones foretell. At the nearest neighbours the multiple is, in this order,

1. none, where the caller knows that |Re k| ≤ k_max ≤ π/d: the phase itself is the answer;
2. one for each stretch of frequencies without a break, along which the phase is unwrapped: that at
   which a velocity foreseen by the caller at one frequency is met best, for the stretch it lies in;
3. without either, for the lowest stretch alone: the multiple by which the phase, continued as a
   line through its lowest part, comes nearest to 0 at ω = 0, which an acoustic branch does. It
   must come within a quarter turn, and the phase may not bend so that another may be right.

Other stretches stay open, with the reason. Frequencies closer than 1/T are needed for 2 and 3, and
a refined spectrum is taken for them. A further receiver is left out at a frequency where five
errors of the phase foretold for it make half a turn. Sachse & Pao, J. Appl. Phys. 49, 4320 (1978).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.readings.pulse.spectral_windows import ABOVE_NOISE, Spectra
from wavesim.readings.pulse.velocity import weighted_line

Float = NDArray[Any]

# The fine frequencies, along which phase is unwrapped, are this part of 1/T apart, T the record's
# length; a break of up to so many of them is bridged.
FINE = 0.25
_BRIDGED = 8
# From one to the next the phase may leave its mean turn by so much, rad: more were a delay of 0.6 T
# between neighbours, and is no wave but what the window cut off.
_LARGEST_STEP = 1.0
# The line to ω = 0 goes through the stretch's part below this many times its lowest frequency.
_LOWEST_PART = 3.0
_QUARTER_TURN = 0.25
# Of √ω a parabola shows a third of what a line is off by at ω = 0, where half a turn is too much;
# below so many turns at the lowest frequency it can't be.
_BENT, _BELOW, _SMOOTH = 1 / 6, 0.4, 4
# A stretch shorter than this is chance.
_FEWEST = 8

# Phases along which to unwrap must stand out more clearly than others, by this factor.
_CLEARLY = 2.0
# The lowest stretch that counts holds this part of all the energy.
_ENERGY = 0.01
# A further receiver serves where so many errors of the phase foretold for it make no half turn.
_SURE = 5.0

NOISY = "the phase is too noisy here to be unwrapped: name k_max ≤ π/spacing, or average more"
OPEN = "2π ambiguity: --expected F C says about how fast the wave is; or place receivers closer"
HIDDEN = "one of the two nearest neighbours stands below the noise or truncation"
UNDRIVEN = "the source's spectrum is under 1 % of its peak"


@dataclass(frozen=True)
class Guess:
    """Re k at the frequencies of spectra.

    Attributes:
        k: shape (n,), rad/m; NaN where it is open.
        used: receivers whose phase is known for certain, shape (n, m).
        intercept: phase of the pair at ω = 0 by rule 3, in turns, multiples taken out; NaN where
            it was not used.
        reason: why k is open, n of them; "" where it is not.
    """

    k: Float
    used: NDArray[np.bool_]
    intercept: float
    reason: tuple[str, ...]


def nearest_pair(x: Float, heard: NDArray[np.bool_]) -> tuple[int, int]:
    """The neighbours closest to each other, of those heard at all; of several the first.

    Without two of them it is the first two.
    """
    own = np.flatnonzero(heard) if heard.sum() >= 2 else np.arange(2)
    gaps = np.diff(x[own])
    first = int(np.flatnonzero(gaps <= gaps.min() * (1 + 1e-9))[0])
    return int(own[first]), int(own[first + 1])


def resolve(
    seen: Spectra,
    fine: Spectra,
    k_max: float | None = None,
    expected: tuple[float, float] | None = None,
) -> Guess:
    """Re k of a wave that runs towards larger x.

    Args:
        seen: spectra where k is wanted.
        fine: the same at frequencies at most 1/4T apart, from the lowest on.
        k_max: largest |Re k| that can be, rad/m; of use where it is below π/spacing.
        expected: (f, c), a phase velocity foreseen at one frequency, Hz and m/s.

    Returns:
        The guess.
    """
    a, b = nearest_pair(seen.x, np.any(seen.above & seen.driven[:, None], axis=0))
    d = float(seen.x[b] - seen.x[a])
    both = seen.above[:, a] & seen.above[:, b] & seen.driven
    phase = np.angle(seen.values[:, b] * np.conj(seen.values[:, a]))
    intercept, unwrapped = np.nan, np.ones(len(both), bool)
    if k_max is not None and k_max * d <= np.pi * (1 + 1e-6):
        k = np.where(both, phase / d, np.nan)
    else:
        smooth, inside, intercept = _unwrapped(fine, (a, b), d, expected)
        unwrapped = np.interp(seen.omega, fine.omega, inside) == 1
        # Only the multiple comes from the fine frequencies.
        foretold = np.interp(seen.omega, fine.omega, smooth)
        k = np.where(both, _nearest(phase, foretold) / d, np.nan)
    refined, used = _refined(seen, k, (a, b))
    reason = np.where(np.isfinite(refined), "", np.where(unwrapped, OPEN, NOISY))
    reason = np.where(both, reason, HIDDEN)
    reason = np.where(seen.driven, reason, UNDRIVEN)
    if sum(not why for why in seen.unusable or [""] * len(seen.x)) < 2:
        reason = np.full(len(reason), next(why for why in seen.unusable if why))
        refined = np.full(len(reason), np.nan)
    return Guess(refined, used, intercept, tuple(reason.tolist()))


def _nearest(phase: Any, foretold: Any) -> Any:
    turn = 2 * np.pi
    return phase + turn * np.round((foretold - phase) / turn)


def _unwrapped(
    fine: Spectra, pair: tuple[int, int], d: float, expected: tuple[float, float] | None
) -> tuple[Float, NDArray[np.bool_], float]:
    """Phase of a pair over fine frequencies, NaN where open; where unwrapped; intercept, turns."""
    a, b = pair
    cross = fine.values[:, b] * np.conj(fine.values[:, a])
    noise = np.nan_to_num(fine.noise[:, [a, b]])
    size = np.abs(fine.values[:, [a, b]])
    clear = fine.above[:, [a, b]] & (size > _CLEARLY * ABOVE_NOISE * noise)
    used = fine.driven & clear.all(axis=1)
    variance = ((noise / np.maximum(size, 1e-290)) ** 2).sum(axis=1) / 2
    energy = np.abs(cross) * used
    # Where a pulse comes late the phase turns fast: its mean turn is taken out first.
    product = cross[1:] * np.conj(cross[:-1])
    turn = np.angle(np.sum(product * (used[1:] & used[:-1])))
    steps = turn + np.angle(product * np.exp(-1j * turn))
    rough = np.abs(steps - turn) > _LARGEST_STEP
    result, intercept = np.full(len(cross), np.nan), np.nan
    inside = np.zeros(len(cross), bool)
    runs = _stretches(used, rough)
    runs = [run for run in runs if energy[run].sum() >= _ENERGY * energy.sum()]
    for number, run in enumerate(runs):
        inside[run] = True
        own = steps[run.start : run.stop - 1]
        psi = np.angle(cross[run.start]) + np.concatenate([[0], np.cumsum(own)])
        omega = fine.omega[run]
        if expected is not None:
            at, want = 2 * np.pi * expected[0], 2 * np.pi * expected[0] * d / expected[1]
            if omega[0] <= at <= omega[-1]:
                off = np.round((want - np.interp(at, omega, psi)) / (2 * np.pi))
                result[run] = psi + 2 * np.pi * off
        elif number == 0:
            low = omega <= _LOWEST_PART * omega[0]
            low[: _FEWEST // 2] = True
            weight = 1 / np.maximum(variance[run], 1e-6)
            at_zero = float(weighted_line(omega[low], psi[low], weight[low])[1]) / (2 * np.pi)
            intercept = at_zero - round(at_zero)
            if abs(intercept) <= _QUARTER_TURN and not _bends(omega[low], psi[low], weight[low]):
                result[run] = psi - 2 * np.pi * round(at_zero)
    return result, inside, intercept


def _bends(omega: Float, psi: Float, weight: Float) -> bool:
    """Whether a phase bends so that its line to ω = 0 may be off by half a turn, surely: a
    parabola through it ends elsewhere. As of flexural waves, k ∝ √ω, whose line ends at kd/2."""
    s = omega / omega[-1]
    if (psi[-1] - psi[0]) / (s[-1] - s[0]) * s[0] < 2 * np.pi * _BELOW:
        return False  # √ω is off by as much at 0 as the line turns up to the lowest frequency
    basis = np.stack([np.ones(len(s)), s, s**2], axis=1)
    normal = basis.T @ (weight[:, None] * basis)
    through = np.linalg.lstsq(normal, basis.T @ (weight * psi))[0]
    # Noise is what a smoother curve leaves, and neighbours in frequency share it.
    left = psi - np.polynomial.Polynomial.fit(s, psi, _SMOOTH, w=np.sqrt(weight))(s)
    noise = max(1.0, float(np.mean(weight * left**2))) / FINE
    error = np.sqrt(np.linalg.pinv(normal)[2, 2] * noise)
    # What s² ≈ a + bs, by the same weights, leaves at 0.
    a = np.linalg.lstsq(normal[:2, :2], basis[:, :2].T @ (weight * s**2))[0][0]
    bend, unsure = (abs(float(a * one)) / (2 * np.pi) for one in (through[2], error))
    return bend > max(_BENT, _SURE * unsure)


def _stretches(used: NDArray[np.bool_], rough: NDArray[np.bool_]) -> list[slice]:
    """Runs of frequencies that count, short breaks bridged; no step within one is rough."""
    at = np.flatnonzero(used)
    if not len(at):
        return []
    roughness = np.concatenate([[0], np.cumsum(rough)])
    cut = (np.diff(at) > _BRIDGED + 1) | (np.diff(roughness[at]) > 0)
    cuts = np.flatnonzero(cut)
    starts = at[np.concatenate([[0], cuts + 1])]
    ends = at[np.concatenate([cuts, [len(at) - 1]])]
    return [
        slice(int(s), int(e) + 1) for s, e in zip(starts, ends, strict=True) if e - s + 1 >= _FEWEST
    ]


def _refined(seen: Spectra, k: Float, pair: tuple[int, int]) -> tuple[Float, NDArray[np.bool_]]:
    """k by the phases of ever more receivers, nearest to the pair first, and which served."""
    x, U = seen.x, seen.values
    size = np.abs(U)
    known = seen.noise_known
    noise = np.where(seen.whole, seen.noise, np.inf)
    weight = 2 * (size / noise) ** 2 if known else size**2
    turned = np.angle(U * np.conj(U[:, pair[:1]]))
    phase, used = np.zeros(U.shape), np.zeros(U.shape, bool)
    order = np.argsort(np.abs(x - (x[pair[0]] + x[pair[1]]) / 2), kind="stable")
    error = np.zeros(len(k))
    for number, j in enumerate([*pair, *(int(j) for j in order if j not in pair)]):
        away = x[j] - x[pair[0]]
        phase[:, j] = _nearest(turned[:, j], k * away)
        used[:, j] = seen.above[:, j] & (_SURE * error * abs(away) < np.pi)
        if number:
            served = np.where(used, weight, 0)
            k, _, variance = weighted_line(np.broadcast_to(x, U.shape), phase, served)
            error = np.sqrt(variance) if known else error
    return np.asarray(k), used & np.isfinite(k)[:, None]
