"""Bloch waves of a stack repeated for ever, and its stop bands."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wavesim.layered.eigenfrequencies import eigenfrequencies, windows
from wavesim.layered.stack import Stack
from wavesim.material.family import travelling_block
from wavesim.material.layers import Layers
from wavesim.planewave.band_edges import keeps_gradient


def bloch(cell: Layers, sector: str, omega: ArrayLike, gradient: bool | None = None) -> Any:
    """Bloch wavenumber q(ω) of an infinite stack of a cell of length L: cos qL = ½ tr T.

    From the scattering matrix of the cell λ = e^{iqL} solves, for one wave,

        S12 λ² − (1 + S12 S21 − S11 S22) λ + S21 = 0,

    which holds in stop bands of any depth, where T overflows.

    Args:
        cell: the layers that are repeated.
        sector: longitudinal, transverse2 or transverse3.
        omega: ω, shape (N,), real or complex with Im ω ≥ 0, not 0, rad/s.
        gradient: whether Γ is kept; None lets planewave.gradient_share > 1e-9 of a layer decide.

    Returns:
        q, rad/m, −π < Re qL ≤ π: with Im q > 0 or, where q is real, energy going to +x. Shape (N,)
        in the limit Γ → 0; (N, n) where Γ is kept, ascending in Im q. Infinite where what comes
        through is too small for a number.

    Raises:
        ValueError: the sector has no macro-field, ω is 0, or Γ is singular where it is kept.
    """
    kept = keeps_gradient(cell, gradient)
    stack = Stack(
        cell, travelling_block(cell.first.family, sector), np.atleast_1d(np.asarray(omega)), kept
    )
    S = stack.whole()
    if len(stack.impedance) > 1:
        q = _many(S)
        return _placed(q.real, q.imag, cell)
    s11, s12, s21, s22 = (x[:, 0, 0] for x in (S.s11, S.s12, S.s21, S.s22))
    middle = 1 + s12 * s21 - s11 * s22
    root = np.sqrt(middle**2 - 4 * s12 * s21)
    larger = np.where((np.conj(middle) * root).real < 0, middle - root, middle + root)
    with np.errstate(divide="ignore", invalid="ignore"):  # S12 may be 0: nothing comes through
        small, large = 2 * s21 / larger, larger / (2 * s12)
        ahead = [1 - np.abs(s11 / (1 - s12 * x)) ** 2 for x in (small, large)]
        passes = np.abs(np.abs(small) - np.abs(large)) <= 1e-9 * np.abs(large)
        value = np.where(passes & (ahead[1] > ahead[0]), large, small)
        decay = -np.log(np.abs(value))
    return _placed(np.angle(value), np.where(passes & (np.abs(decay) < 1e-8), 0, decay), cell)


def _placed(phase: Any, decay: Any, cell: Layers) -> Any:
    """q of qL = phase + i decay; at the edge of the zone of two that are one the one of π."""
    q = np.empty(np.shape(phase), complex)
    phase = np.where(phase <= -np.pi * (1 - 1e-12), np.pi, phase)
    q.real, q.imag = phase / cell.length, decay / cell.length
    return q


def _many(S: Any) -> Any:
    """qL of each wave, shape (N, n): λ E x = F x for x = (a, b) at the left of the cell."""
    from scipy.linalg import eig

    n = S.s11.shape[-1]
    found = np.zeros((len(S.s11), n), dtype=complex)
    unit, zero = np.eye(n), np.zeros((n, n))
    for i in range(len(found)):
        E = np.block([[zero, S.s12[i]], [unit, -S.s22[i]]])
        F = np.block([[-S.s11[i], unit], [S.s21[i], zero]])
        (top, bottom), vectors = eig(F, E, homogeneous_eigvals=True)
        a, b = vectors[:n], vectors[n:]
        flux = np.sum(np.abs(a) ** 2 - np.abs(b) ** 2, axis=0)
        decay = np.log(np.maximum(np.abs(bottom), 1e-300)) - np.log(np.maximum(np.abs(top), 1e-300))
        # Outward is what decays or, at equal size, what carries energy there.
        order = np.lexsort((-flux, -np.where(np.abs(decay) < 1e-8, 0, decay)))
        ahead = order[:n]
        phase = np.angle(top[ahead] * np.conj(bottom[ahead]))
        found[i] = phase + 1j * np.where(np.abs(decay[ahead]) < 1e-8, 0, decay[ahead])
    return np.take_along_axis(found, np.argsort(found.imag, axis=1), axis=1)


def stop_bands(
    cell: Layers, sector: str, band: tuple[float, float], spacing: float | None = None
) -> list[tuple[float, float]]:
    """Where no Bloch wave propagates, in the limit Γ → 0, without loss.

    Edges are the eigenfrequencies of one cell closed on itself with qL = 0 and with qL = π, of
    which none is missed, and the frequencies at which a layer's own band begins or ends.

    Args:
        cell: the layers that are repeated, uniform each.
        sector: longitudinal, transverse2 or transverse3.
        band: lowest and highest ω, rad/s.
        spacing: see :func:`wavesim.layered.eigenfrequencies.resonances`.

    Returns:
        (lower, upper), rad/s, ascending; neighbours that touch are joined.
    """
    low, high = band
    edges = [
        eigenfrequencies(
            cell, travelling_block(cell.first.family, sector), sign, sign, band, False, spacing
        )
        for sign in ("periodic", "antiperiodic")
    ]
    marks = sorted({low, high, *np.concatenate(edges), *windows(cell, sector, band).ravel()})
    found: list[tuple[float, float]] = []
    for a, b in itertools.pairwise(marks):
        if b - a <= 1e-12 * b or abs(bloch(cell, sector, (a + b) / 2, False)[0].imag) == 0:
            continue
        if found and a - found[-1][1] <= 1e-12 * b:
            found[-1] = (found[-1][0], float(b))
        else:
            found.append((float(a), float(b)))
    return found
