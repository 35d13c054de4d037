"""Receivers of a line of which many are of reversed polarity: in turn, or at random.

A wave that passes two receivers makes their correlation one packet about the time that it takes.
Where it hardly disperses the phase at the top of the packet's envelope is 0, and π where one of the
two is reversed; of waves that do, or several, it is another. Every other one reversed, an even line
shows each wave at k − π/d.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import ifft, next_fast_len, rfft

from wavesim.records.faults.channels import Mended, mend
from wavesim.records.faults.finding import Finding
from wavesim.records.faults.order import few_waves_alone
from wavesim.records.faults.quiet import Rest

Float = NDArray[Any]

_FEWEST = 3
# The packet is one wave's where its top is this part of that of two receivers that are alike, and
# its phase is so near to 0 or π, rad; it must be so short that the top is one: its band this part
# of its frequency (rms).
_ALIKE, _NEAR, _BROAD = 0.8, 0.25, 0.1


def turned_round(
    component: Float,
    t: Float,
    x: Float,
    labels: tuple[str, ...],
    rest: Rest,
    found: list[Finding],
) -> Mended:
    """Receivers of reversed polarity turned round, where one wave alone passes the line.

    Args:
        component: u, shape (nt, nx), finite, without offset.
        t, x, labels: times, positions and names of the receivers.
        rest: of the channels.
        found: findings, added to.
    """
    nx = len(x)
    mended = Mended(np.arange(nx), np.ones(nx), np.zeros(nx, bool))
    if nx < _FEWEST or not np.isfinite(x).all() or (sign := _polarity(component)) is None:
        return mended
    in_turn = bool((np.diff(sign) != 0).all())
    if in_turn or few_waves_alone(component * sign, component, t, x, rest, np.arange(nx)):
        found.append(
            mend(
                mended,
                "reversed",
                dict.fromkeys(np.flatnonzero(sign < 0).tolist(), np.pi),
                x,
                labels,
            )
        )
    return mended


def _polarity(component: Float) -> Float | None:
    """Polarity of each receiver, ±1, most of them +1, shape (nx,); None where all are alike, or it
    is unsure."""
    if (tops := packets(component)) is None:
        return None
    lags, phase = tops
    if (np.abs(np.sin(phase)) > np.sin(_NEAR)).any() or (lags * lags[0] <= 0).any():  # one way
        return None
    sign = np.cumprod(np.append(1.0, np.sign(np.cos(phase))))
    sign = sign if sign.sum() >= 0 else -sign
    return sign if (sign < 0).any() else None


def packets(component: Float) -> tuple[Float, Float] | None:
    """By how many frames the packet of each receiver and the one before is late, and its phase at
    the top, shape (nx − 1,); None where packets are long, or of unlike receivers."""
    frames = next_fast_len(2 * len(component), real=True)
    power = np.sum(component**2, axis=0)
    U = rfft(component, frames, axis=0)
    if not power.all() or not _broad(np.abs(U[:, 1:] * U[:, :-1]) ** 2):
        return None
    lags, phases = [], []
    for before, after, size in zip(U.T[:-1], U.T[1:], power[1:] * power[:-1], strict=True):
        packet = 2 * ifft(np.conj(before) * after, frames)
        at = int(np.abs(packet).argmax())
        low, top, high = packet[[at - 1, at, (at + 1) % frames]]
        if abs(top) < _ALIKE * np.sqrt(size):
            return None
        bend = abs(low) - 2 * abs(top) + abs(high)
        late = (abs(low) - abs(high)) / 2 / bend if bend else 0.0
        phases.append(float(np.angle(top) + late * np.angle(high / top)))
        lags.append(at + late - frames * (2 * at > frames))
    return np.array(lags), np.array(phases)


def _broad(power: Float) -> bool:
    """Whether the bands of most packets, rms about their mean frequency, are a part of that."""
    at, whole = np.arange(len(power))[:, None], np.maximum(power.sum(axis=0), 1e-290)
    middle = np.sum(at * power, axis=0) / whole
    width = np.sqrt(np.sum((at - middle) ** 2 * power, axis=0) / whole)
    return bool(np.median(width / np.maximum(middle, 1e-290)) > _BROAD)
