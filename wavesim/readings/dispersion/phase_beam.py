"""The beam of the phases along a line: how much in step receivers are with a wave of given k.

    B(k, ω) = |Σ_n w_n e^{−ikx_n} U_n(ω)/|U_n(ω)|| / Σ_n w_n

The phase-shift method of surface-wave surveys (Park, Miller & Xia, SEG Expanded Abstracts 17, 1377
(1998)): each receiver's amplitude is divided out, so that neither losses, spreading nor how a
receiver is coupled counts.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[Any]
Complex = NDArray[np.complex128]

# Points of the search over k in each 2π/X.
_PER_CELL = 8
_STEPS = 12
# A line's beam that comes back to this height is an alias.
_ALIAS = 0.7
# Receivers nearer to each other than this part of the line count as so far apart.
_FINEST = 10_000
# Numbers that are held at a time.
_HELD = 2_000_000


def highest_wavenumber(x: Float) -> float:
    """Largest |k| that a line tells from its aliases, rad/m: π/d where receivers are d apart.

    Half the least k at which the line's own beam, |Σ e^{ikx}|/N, comes back to 0.7.

    Args:
        x: positions, ascending, shape (nx,), m.
    """
    least = max(float(np.diff(x).min()), float(np.ptp(x)) / _FINEST)
    k = np.arange(0, 2.02 * np.pi / least, np.pi / (4 * float(np.ptp(x))))
    own = np.concatenate(
        [np.abs(np.exp(1j * np.multiply.outer(part, x)).mean(axis=1))
         for part in np.array_split(k, max(1, len(k) * len(x) // _HELD))]
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
    total = np.maximum(weight.sum(axis=1), 1e-290)[:, None]
    if k.ndim == 1:
        return np.asarray(np.abs(unit @ np.exp(-1j * np.multiply.outer(x, k))) / total)
    steer = np.exp(-1j * k[:, None, :] * x[:, None])
    return np.asarray(np.abs(np.einsum("fx,fxk->fk", unit, steer)) / total)


def highest_beam(U: Complex, x: Float, weight: Float) -> tuple[Float, Float]:
    """k of the highest beam at each frequency, and √12 times the spread of its receivers, m.

    Args:
        U, x, weight: as of :func:`phase_beam`.
    """
    k = beams_by_height(U, x, weight, highest_wavenumber(x), 1)[:, 0]
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


def beams_by_height(U: Complex, x: Float, weight: Float, edge: float, count: int) -> Float:
    """k of the highest beams at each frequency, the highest first, to 1/16 of 2π/X, rad/m.

    Args:
        U, x, weight: as of :func:`phase_beam`.
        edge: they are looked for up to this |k|, rad/m.
        count: how many, –.

    Returns:
        Shape (nω, count); any others where there are fewer peaks.
    """
    cells = max(4, int(np.ceil(float(np.ptp(x)) * edge / np.pi)) + 1)
    grid = np.linspace(-edge, edge, 2 * (cells * _PER_CELL // 2) + 1)
    k = np.empty((len(U), count))
    for some in np.array_split(np.arange(len(U)), max(1, len(U) * len(grid) // _HELD)):
        height = phase_beam(U[some], x, weight[some], grid)
        about = np.pad(height, ((0, 0), (1, 1)), constant_values=-1)
        peak = (height > about[:, :-2]) & (height >= about[:, 2:])
        k[some] = grid[np.argsort(np.where(peak, -height, 1), axis=1, kind="stable")[:, :count]]
    return k
