"""What receivers round a ring that are dead, or show something else, would have shown.

Waves at the wavenumbers of a ring go on at every receiver, so that those told by the others say
what a bad one lacks. Its signal is 0 at first, which leaks e^{−ikx_j}/N of every wave into all
others; harmonic inversion of what stands above that leakage gives a better one, which leaks less,
and so on: of p waves near one frequency a part p/N of the error remains each time (alternating
projections: Papoulis, IEEE Trans. Circuits Syst. 22, 735 (1975)).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from wavesim.readings.dispersion.sinusoid_errors import Sinusoids
from wavesim.readings.dispersion.sinusoids import exponentials
from wavesim.records.record import Record

Float = NDArray[Any]

_ROUNDS = 16
# No better than this part of the field, nor than this part of its noise, round the ring.
_ROUNDING, _OF_NOISE = 1e-10, 0.03

# Changes fall by no less than this part each time.
_SLOW = 0.05
# Leakage is looked for up to 20 times its mean; of a few receivers it is no more than this part of
# that, times their number.
_COHERENT = 0.2


def put_in(record: Record, inverted: Callable[[Float, Record], Sinusoids]) -> Record:
    """The record with what bad receivers would have shown; what that leaves open is in its leak.

    Args:
        record: of a ring, while no source acts; ``misfit`` says which receivers are bad.
        inverted: sinusoids of series (n, 2C, nt) of all wavenumbers 2πm/X, m = 0 …, of a record
            with a leak.
    """
    out = np.flatnonzero(record.misfit)
    if not record.ring or not len(out):
        return record
    nx = len(record.x)
    before = record.leak or 0.0
    values = record.values.copy()
    values[..., out] = 0.0
    size = float(np.sqrt(np.mean(values[..., ~record.misfit] ** 2)))
    noise = record.noise / size
    enough = max(_ROUNDING, _OF_NOISE * noise * np.sqrt(nx))
    left, changed, share = np.inf, np.inf, _COHERENT * len(out)
    for _ in range(_ROUNDS):
        leak = before + share * len(out) * (min(left, 1.0) / nx) ** 2
        now = replace(record, values=values, leak=leak)
        hat = rfft(values, axis=2) / nx
        channels = np.stack([p.transpose(2, 0, 1) for p in (hat.real, hat.imag)], axis=2)
        found = inverted(channels.reshape(len(channels), -1, values.shape[1]), now)
        told = _told(found, now, out)
        change = float(np.sqrt(np.mean((told - values[..., out]) ** 2))) / size
        power = np.mean(np.abs(hat) ** 2, axis=(0, 1))
        unseen = float(np.sum(found.residual * power) / max(np.sum(power), 1e-290)) - 2 * noise**2
        values[..., out] = told
        # Of changes that fall by a factor each time all that are still to come.
        ahead = change / max(1 - change / changed if changed else 0.0, _SLOW)
        now_left = max(ahead, np.sqrt(max(unseen, 0.0)))
        if now_left >= left:
            break
        left, changed = now_left, change
        if left < enough:
            break
    leak = before + len(out) * (min(left, 1.0) / nx) ** 2
    return replace(record, values=values, leak=leak)


def _told(found: Sinusoids, record: Record, out: NDArray[np.int64]) -> Float:
    """What sinusoids show at some receivers, shape (C, nt, n)."""
    components, count, nx = record.values.shape
    told = np.zeros((components, count, len(out)))
    decay = found.decay * record.interval
    start = np.exp(np.clip(decay * (count - 1) / 2, -50, 50))
    middle = (found.amplitude / start)[:, None] * found.shape
    twice = np.where((found.series == 0) | (2 * found.series == nx), 1.0, 2.0)
    for j, at in enumerate(out):
        turn = 2 * np.pi * found.series * at / nx
        # Re û e^{iφ} of û = y₀ + i y₁.
        own = middle.reshape(len(turn), components, 2)
        cosine, sine = (twice * np.cos(turn))[:, None], (twice * np.sin(turn))[:, None]
        shown = own[..., 0] * cosine - own[..., 1] * sine
        for some in np.array_split(np.arange(len(turn)), max(1, len(turn) * count // 4_000_000)):
            z = exponentials(found.omega[some] * record.interval, decay[some], count)
            told[..., j] += (shown[some].T @ z).real
    return told
