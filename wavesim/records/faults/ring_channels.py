"""Channels round a ring that do not fit the waves that all others show.

At each frequency that is strong the field round a ring is a few waves e^{ikx} of exact wavenumbers.
A faulty channel adds a little to all of them and a lot to itself: what is left where it stands,
with the strong waves taken out, is its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.channels import Mended
from wavesim.records.faults.finding import CURED, TOLD, Finding, places

Float = NDArray[Any]
Mask = NDArray[np.bool_]

_FEWEST = 16
# Frequencies count above this part of the greatest power, waves above this part of the amplitude
# of the largest at their frequency.
_STRONG, _WAVE = 0.01, 0.15
# A channel is off where what is left there is this many times the others' power, and this part of
# the whole.
_ABOVE, _PART, _BESIDE = 10.0, 1e-4, 0.6
# It is off by a factor alone where that explains so much of it.
_ALONE = 0.9
_ALIKE = 0.15
_MOST = 0.1


def ring_misfits(
    component: Float, x: Float, labels: tuple[str, ...], found: list[Finding]
) -> tuple[Mended, Mask]:
    """Channels to turn, and those that do not fit in another way, shape (nx,).

    Args:
        component: shape (nt, nx), finite.
        x, labels: positions and names of the receivers.
        found: findings, added to.
    """
    nx = component.shape[1]
    mended = Mended(np.arange(nx), np.ones(nx), np.zeros(nx, bool))
    odd = np.zeros(nx, bool)
    if nx < _FEWEST:
        return mended, odd
    window = np.hanning(len(component))[:, None]
    U = np.fft.rfft((component - component.mean(axis=0)) * window, axis=0)
    strength = np.median(np.abs(U) ** 2, axis=1)
    U = U[strength > _STRONG * strength.max(initial=0.0)]
    if len(U) < 2:
        return mended, odd
    hat = np.fft.fft(U, axis=1)
    size = np.abs(hat)
    kept = size >= _WAVE * size.max(axis=1, keepdims=True)
    waves = np.fft.ifft(np.where(kept, hat, 0), axis=1)
    # What the others say of each: its own part in the waves, m of n, taken out.
    own = kept.mean(axis=1, keepdims=True)
    waves = (waves - own * U) / (1 - np.minimum(own, 0.9))
    left = np.sum(np.abs(U - waves) ** 2, axis=0)
    whole = float(np.median(np.sum(np.abs(waves) ** 2, axis=0)))
    off = (left > _ABOVE * np.median(left)) & (left > _PART * whole)
    # A faulty channel leaks into the others; beside it they are not off.
    off &= left > _BESIDE * left.max()
    if not off.any() or off.mean() > _MOST:
        return mended, odd
    for j in np.flatnonzero(off):
        expected = waves[:, j]
        factor = float(np.real(np.vdot(expected, U[:, j])) / np.real(np.vdot(expected, expected)))
        rest = float(np.sum(np.abs(U[:, j] - factor * expected) ** 2))
        alone = rest < (1 - _ALONE) * float(np.sum(np.abs(U[:, j]) ** 2))
        if alone and abs(factor + 1) < _ALIKE:
            mended.factor[j] = -1
        elif not (alone and abs(factor - 1) < _ALIKE):
            odd[j] = True
    turned = mended.factor < 0
    if turned.any():
        where = places(x, turned, labels)
        said = f"of reversed polarity, as the ring's waves say: turned round ({where})"
        found.append(Finding("reversed", where, "polarity", CURED, said))
    if odd.any():
        where = places(x, odd, labels)
        said = (
            "dead, mis-scaled, exchanged or delayed: they do not fit the waves that all others "
            f"show ({where})"
        )
        found.append(Finding("misfit", where, f"{int(odd.sum())} of {nx}", TOLD, said))
    return mended, odd
