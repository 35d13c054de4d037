"""The strong waves round a ring told from what is left beside them, frequency by frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.fft import fft, ifft, rfft
from numpy.typing import NDArray

from wavesim.records.windows import blackman_harris

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# Frequencies count above this part of the greatest power, and so many of them.
_STRONG, _MOST_FREQUENCIES = 1e-4, 192
# Waves are told from what leaks and from noise where they are so many times its median, and fill
# no more than this part of the wavenumbers.
_ABOVE, _FEW = 4.0, 0.5
# A receiver's amplitude counts no further than this times its neighbours'.
_NEIGHBOURS, _CLIP = 3, 3.0
# So many receivers at most are missing between the ends of a ring; put in, they leave less than
# this part of the rest (0.26 or less where one is, and 2.5 or more where none is, were seen of
# twelve or more).
_MOST_MISSING, _FAR_LESS, _FEWEST_ROUND = 3, 0.3, 12
# Of a record's quarters, each of so many frames at least, peaks of the last, this many times above
# their spectrum's median, are so many times as high as the same bins of the first, and so many on
# either side, and hold this part of its power: beats and random lines alone do not.
_FEWEST_FRAMES, _PEAK, _GROWN, _BESIDE, _MOSTLY = 32, 30.0, 8.0, 2, 0.5
# So many frequencies must tell something.
FEWEST_FREQUENCIES = 4


@dataclass(frozen=True)
class RingWaves:
    """Strong waves and the rest at each of the frequencies that tell something.

    rows tells which frequencies; U, V, R are of shape (n, nx), kept of the wavenumbers too; weight
    is 1 over the variance of a receiver's R, shape (n, 1); own the part of them that are kept.
    """

    rows: NDArray[np.int64]
    U: Any
    V: Any
    R: Any
    kept: Mask
    weight: Float
    own: Float


def strong_frequencies(component: Float) -> tuple[Any, Float, float]:
    """U at the frequencies that tell something, these in rad per frame, and the noise's power."""
    window = blackman_harris(len(component))[:, None]
    U = rfft((component - component.mean(axis=0)) * window, axis=0)
    # A field that covers a quarter of the receivers is seen; one bad receiver is not.
    size = np.sort(np.abs(U) ** 2, axis=1)[:, -min(U.shape[1], max(3, U.shape[1] // 4))]
    strong = np.flatnonzero(size > _STRONG * size.max(initial=0.0))
    if len(strong) > _MOST_FREQUENCIES:
        strong = strong[np.linspace(0, len(strong) - 1, _MOST_FREQUENCIES).astype(int)]
    noise = float(np.median(np.abs(U[-max(4, len(U) // 10) : -1]) ** 2) / np.log(2))
    return U[strong], 2 * np.pi * strong / len(component), noise


def ring_waves(U: Any, odd: Mask) -> RingWaves | None:
    """Waves told from the rest, odd receivers as the waves have them."""
    nx = U.shape[1]
    U = _clipped(U)
    use = np.ones(len(U), bool)
    hat = fft(U, axis=1)
    for _ in range(4 if odd.any() else 1):
        size = np.abs(hat)
        median = np.median(size, axis=1, keepdims=True)
        kept = size > np.maximum(_ABOVE * median, 1e-7 * size.max(axis=1, keepdims=True))
        own = kept.mean(axis=1)
        use = (own > 0) & (own < _FEW)
        if not odd.any():
            break
        U = np.where(use[:, None], _filled(U, kept, odd), U)
        hat = fft(U, axis=1)
    if use.sum() < FEWEST_FREQUENCIES:
        return None
    U, hat, kept, own = U[use], hat[use], kept[use], own[use]
    V = ifft(np.where(kept, hat, 0), axis=1)
    R = U - V
    rest = np.where(kept, np.nan, np.abs(hat) ** 2)
    variance = np.nanmedian(rest, axis=1, keepdims=True) / np.log(2) / nx
    floor = 1e-14 * np.mean(np.abs(V) ** 2, axis=1, keepdims=True)
    return RingWaves(np.flatnonzero(use), U, V, R, kept, 1 / np.maximum(variance, floor), own)


def missing_between_ends(component: Float, odd: Mask) -> int:
    """How many receivers are missing between the last one and the first round a ring.

    With as many put in as are missing, read from the others, the rest is less by far, for no wave
    of the true ring closes round one without them.

    Args:
        component: u, shape (nt, nx), finite, while no source acts.
        odd: receivers that are known to be bad, shape (nx,).
    """
    U, _, _ = strong_frequencies(component)
    now = ring_waves(U, odd)
    if len(odd) < _FEWEST_ROUND or now is None:
        return 0
    parts = [1.0]
    for more in range(1, _MOST_MISSING + 1):
        put_in = np.pad(U, ((0, 0), (0, more)))
        other = ring_waves(put_in, np.r_[odd, np.ones(more, bool)])
        both = np.intersect1d(now.rows, [] if other is None else other.rows)
        if other is None or len(both) < FEWEST_FREQUENCIES:
            parts.append(1.0)
            continue
        before, after = (one.weight[np.isin(one.rows, both), 0] for one in (now, other))
        parts.append(float(np.median(before / after)))
    found = int(np.argmin(parts))
    return found if parts[found] < _FAR_LESS else 0


def waves_appear(component: Float) -> bool:
    """Whether most waves of the last quarter were not there in the first, where no source acts.

    A wave round a ring goes on as e^{−iωt}, or decays, at each wavenumber.

    Args:
        component: u, shape (nt, nx), finite, while no source acts.
    """
    nt, nx = component.shape
    quarter = nt // 4
    if quarter < _FEWEST_FRAMES or nx < 3:
        return False
    hat = rfft(component, axis=1)[:, 1 : (nx + 1) // 2]
    window = blackman_harris(quarter)[:, None]
    first, last = (
        np.abs(fft(part * window, axis=0)) ** 2 for part in (hat[:quarter], hat[-quarter:])
    )
    beside = np.sum([np.roll(first, m, axis=0) for m in range(-_BESIDE, _BESIDE + 1)], axis=0)
    top = last.argmax(axis=0), np.arange(last.shape[1])
    power = last[top] * (last[top] > _PEAK * np.median(last, axis=0))
    return bool(power[last[top] > _GROWN * beside[top]].sum() > _MOSTLY * last.max(axis=0).sum())


def _clipped(U: Any) -> Any:
    """Amplitudes no larger than three times the largest close by, so that one hides no wave."""
    size = np.abs(U)
    near = np.max(
        [np.roll(size, d, axis=1) for d in range(-_NEIGHBOURS, _NEIGHBOURS + 1) if d], axis=0
    )
    return np.where(size > _CLIP * near, U * (_CLIP * near / np.maximum(size, 1e-300)), U)


def _filled(U: Any, kept: Mask, odd: Mask) -> Any:
    """Odd receivers' values such that least is left of the field without its waves."""
    where = np.flatnonzero(odd)
    filled = U.copy()
    filled[:, where] = 0
    hat = fft(filled, axis=1)
    left = filled - ifft(np.where(kept, hat, 0), axis=1)
    # (1 − P) of a unit at one place, as seen at another, depends on how far they are apart.
    kernel = ifft(np.where(kept, 0.0, 1.0), axis=1)
    matrix = kernel[:, (where[:, None] - where) % U.shape[1]]
    matrix = matrix + 1e-9 * np.eye(len(where))
    filled[:, where] = np.linalg.solve(matrix, -left[:, where, None])[..., 0]
    return filled
