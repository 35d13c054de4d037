"""Pieces of a bar as scattering matrices, joined by Redheffer's star product.

Everywhere on the bar a = (√z v + f/√z)/2 travels right and b = (√z v − f/√z)/2 left, with one
reference impedance z for the whole bar, so that nothing happens at an interface. A piece gives

    b_left  = S11 a_left + S12 b_right + g_left,
    a_right = S21 a_left + S22 b_right + g_right,

g from the sources in it. Only decaying exponentials occur: no gap is too thick. A lossless piece
has a unitary S at real ω, a passive one ‖S‖ ≤ 1 for Im ω ≥ 0.

Redheffer, J. Math. Phys. 41, 1 (1962).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Piece:
    """Scattering matrix of a stretch of the bar, and what its sources send out of it.

    Attributes:
        s11, s12, s21, s22: shape (N, n, n).
        left, right: g_left, g_right, shape (N, n).
    """

    s11: Any
    s12: Any
    s21: Any
    s22: Any
    left: Any
    right: Any

    @property
    def whole(self) -> Any:
        """S, shape (N, 2n, 2n)."""
        return np.block([[self.s11, self.s12], [self.s21, self.s22]])

    @property
    def sent(self) -> Any:
        """(g_left, g_right), shape (N, 2n)."""
        return np.concatenate([self.left, self.right], axis=1)

    def at(self, chosen: Any) -> Piece:
        """The piece at some of its frequencies."""
        return Piece(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    def put(self, chosen: Any, other: Piece) -> None:
        """Overwrite some frequencies by another's."""
        for name in self.__dataclass_fields__:
            getattr(self, name)[chosen] = getattr(other, name)


def times(matrix: Any, vector: Any) -> Any:
    """(N, n, n) times (N, n)."""
    return (matrix @ vector[..., None])[..., 0]


def _inverse(matrix: Any) -> Any:
    return 1 / matrix if matrix.shape[-1] == 1 else np.linalg.inv(matrix)


def nothing(count: int, n: int) -> Piece:
    """A piece of no thickness."""
    zero, one = np.zeros((count, n, n), dtype=complex), np.zeros((count, n, n), dtype=complex)
    one[:, range(n), range(n)] = 1
    none = np.zeros((count, n), dtype=complex)
    return Piece(zero, one, one.copy(), zero.copy(), none, none.copy())


def jump(velocity: Any, force: Any) -> Piece:
    """A point source: by how much √z v and f/√z jump, shape (N, n) each."""
    made = nothing(*velocity.shape)
    return replace(made, left=(force - velocity) / 2, right=(velocity + force) / 2)


def inner(one: Piece, two: Piece, entering: Any, returning: Any) -> tuple[Any, Any]:
    """(a, b) between two pieces, given a at the left of one and b at the right of two, (N, n)."""
    unit = np.eye(one.s11.shape[-1])
    a = times(
        _inverse(unit - one.s22 @ two.s11),
        times(one.s21, entering) + times(one.s22, times(two.s12, returning) + two.left) + one.right,
    )
    return a, times(two.s11, a) + times(two.s12, returning) + two.left


def star(one: Piece, two: Piece) -> Piece:
    """One piece followed on its right by another."""
    unit = np.eye(one.s11.shape[-1])
    inverse = _inverse(unit - one.s22 @ two.s11)
    through = inverse @ one.s21
    back = inverse @ one.s22 @ two.s12
    sent = times(inverse, times(one.s22, two.left) + one.right)
    return Piece(
        one.s11 + one.s12 @ two.s11 @ through,
        one.s12 @ (two.s12 + two.s11 @ back),
        two.s21 @ through,
        two.s22 + two.s21 @ back,
        one.left + times(one.s12, times(two.s11, sent) + two.left),
        two.right + times(two.s21, sent),
    )
