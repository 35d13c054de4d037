"""A uniform stretch of the bar: its waves, and its scattering matrix in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.layered.cross_section import Section, halves, to_vf
from wavesim.layered.star_product import Piece, times
from wavesim.material.dual import value_of


@dataclass(frozen=True)
class Waves:
    """Waves of a medium at each ω; those to the left are their mirror images.

    Attributes:
        k: outward wavenumbers, scaled, shape (N, n).
        v, f: columns √z v and f/√z of each wave to the right, shape (N, n, n).
        mirror_v, mirror_f: of the waves to the left.
    """

    k: Any
    v: Any
    f: Any
    mirror_v: Any
    mirror_f: Any


def outward(k: Any, flux: Any) -> Any:
    """The sign (N, n) with which ±k decays to the right or, if k is real, sends energy there."""
    flat = np.abs(k.imag) <= 1e-13 * np.abs(k)
    return np.where(flat, np.where(flux < 0, -1.0, 1.0), np.where(k.imag < 0, -1.0, 1.0))


def _eigen(matrix: Any, macro: int) -> tuple[Any, Any]:
    """Eigenvalues and vectors of P Q, to their own precision however small Γ is."""
    # With f_B counted in units of i it is real for real ω without loss: k² is then real exactly,
    # or one of a pair. The largest entries come first, as QR keeps small values if they do.
    turn = np.ones(matrix.shape[-1], dtype=complex)
    turn[macro:] = 1j
    turned = (matrix * turn / turn[:, None])[:, ::-1, ::-1]
    values, vectors = np.linalg.eig(turned if value_of(turned).imag.any() else turned.real)
    return values + 0j, vectors[:, ::-1] * turn[:, None]


def waves(one: Section, omega: Any) -> Waves:
    """Waves of a medium, from −k² e = P Q e."""
    P, Q = halves(one, omega)
    if one.size == 1:
        even = np.ones_like(P)
        k = np.sqrt(-(P * Q)[:, :, 0])
    else:
        values, even = _eigen(P @ Q, one.macro)
        even = even / np.abs(value_of(even)).max(axis=1, keepdims=True)
        k = np.sqrt(-values)
    k = np.where(k == 0, 1e-150, k)
    odd = Q @ even / (1j * k[:, None, :])
    v, f = to_vf(one, even, odd)
    v, f = value_of(v), value_of(f)
    sign = outward(value_of(k), np.sum((np.conj(f) * v).real, axis=1))
    odd = odd * sign[:, None, :]
    v, f = to_vf(one, even, odd)
    mirror_v, mirror_f = to_vf(one, even, -odd)
    return Waves(k * sign, v, f, mirror_v, mirror_f)


def reflection(of: Waves, to_right: bool) -> Any:
    """What a half-space sends back: b = R a at the right end or a = R b at the left, (N, n, n)."""
    v, f = (of.v, of.f) if to_right else (of.mirror_v, -of.mirror_f)
    return (v - f) @ np.linalg.inv(v + f)


def assemble(
    right: tuple[Any, Any], left: tuple[Any, Any], decay: tuple[Any, Any], made: tuple[Any, Any]
) -> Piece:
    """A piece from its waves: what goes right starts at its left end, and the other way round.

    Args:
        right, left: (√z v, f/√z) of the waves to the right and to the left, (N, n, n) each.
        decay: by what each of them is multiplied on its way through, (N, n) each.
        made: amplitudes that sources add at the far end of each, (N, n) each.
    """
    n = decay[0].shape[1]
    # At the left end a comes in and b goes out, at the right end b comes in and a goes out.
    a, b = ([(v + sign * f) / 2 for v, f in (right, left)] for sign in (1, -1))
    thin_right, thin_left = (d[:, None, :] for d in decay)
    M, N = (
        np.block([[one[0], one[1] * thin_left], [two[0] * thin_right, two[1]]])
        for one, two in ((a, b), (b, a))
    )
    S = np.swapaxes(np.linalg.solve(np.swapaxes(M, 1, 2), np.swapaxes(N, 1, 2)), 1, 2)
    arriving, leaving = (
        np.concatenate([times(one[1], made[1]), times(two[0], made[0])], axis=1)
        for one, two in ((a, b), (b, a))
    )
    sent = leaving - times(S, arriving)
    return Piece(S[:, :n, :n], S[:, :n, n:], S[:, n:, :n], S[:, n:, n:], sent[:, :n], sent[:, n:])


def uniform(of: Waves, thickness: float, made: tuple[Any, Any] | None = None) -> Piece:
    """A uniform piece; thickness scaled; made as in :func:`assemble`.

    With one wave and no source, Z its impedance over z and E = e^{ikh},

        S11 = (1 − Z²)(1 − E²)/N,   S21 = 4 Z E/N,   N = 4Z + (1 − Z)²(1 − E²).
    """
    through = np.exp(1j * of.k * thickness)
    if of.k.shape[1] == 1 and made is None:
        Z = of.f / of.v
        gone = -np.expm1(2j * of.k * thickness)[..., None]
        below = 4 * Z + (1 - Z) ** 2 * gone
        s11, s21 = (1 - Z**2) * gone / below, 4 * Z * through[..., None] / below
        none = np.zeros_like(through)
        return Piece(s11, s21, s21.copy(), s11.copy(), none, none.copy())
    if made is None:
        made = (np.zeros_like(through), np.zeros_like(through))
    return assemble((of.v, of.f), (of.mirror_v, of.mirror_f), (through, through), made)
