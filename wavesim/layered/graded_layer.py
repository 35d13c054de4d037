"""A graded stretch of the bar: Gauss collocation of order 16, steps halved until they agree.

y′ = A(x) y + s(x) is met at the eight Gauss points c_i of a step h: with y_i = y(c_i h),

    y_i = y₀ + h Σ_j a_ij (A_j y_j + s_j),    y₁ = y₀ + h Σ_j b_j (A_j y_j + s_j),

one linear system, which gives y₁ = T y₀ + q with an error of h¹⁷. A step counts when its scattering
matrix agrees with that of its two halves. Each frequency is refined by itself, as only those
near an asymptote of some cross-section need many steps. Steps become scattering matrices before
they are joined, so thick gaps do no harm.

Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, section II.7.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from typing import Any

import numpy as np

from wavesim.layered.star_product import Piece, star, times
from wavesim.material.dual import value_of

POINTS = 8
# By how much S may change when a step is halved. The halves are kept; where steps are resolved
# they are 2⁻¹⁶ of that wrong.
TOLERANCE = 1e-11
DEEPEST = 24

System = Callable[[float, Any], tuple[Any, Any]]
"""(A, s) at scaled positions for frequencies by index: shapes (points, N, 2n, 2n), (…, 2n)."""


class Unresolved(ValueError):
    """Steps as short as 2⁻²⁴ of the stretch still change S: a real ω is then in the continuum of
    its asymptotes. It holds the frequency's number."""


class TooMuch(ValueError):
    """More steps than are allowed within :func:`at_most`."""


_LEFT: ContextVar[list[float] | None] = ContextVar("steps left", default=None)


@contextmanager
def at_most(steps: float) -> Iterator[None]:
    """Hold all that is solved within to so many steps of one wave at one frequency, each of about
    8 μs; a step of n waves takes as long as n² of one.

    Raises:
        TooMuch: of ``graded``, which would take more.
    """
    before = _LEFT.set([steps])
    try:
        yield
    finally:
        _LEFT.reset(before)


@cache
def butcher() -> tuple[Any, Any, Any]:
    """c (8,), a (8, 8), b (8,) of Gauss collocation on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    series = np.linalg.inv(np.polynomial.legendre.legvander(nodes, POINTS - 1))
    integrals = np.array(
        [np.polynomial.legendre.legint(one, lbnd=-1) for one in np.eye(POINTS)]
    )  # of P_j from −1
    a = np.polynomial.legendre.legvander(nodes, POINTS) @ integrals.T @ series / 2
    return (nodes + 1) / 2, a, weights / 2


def transfer(system: System, start: float, h: float, chosen: Any) -> tuple[Any, Any]:
    """T and q of one step, y₁ = T y₀ + q, shapes (N, 2n, 2n), (N, 2n)."""
    nodes, a, b = butcher()
    A, s = (h * np.swapaxes(one, 0, 1) for one in system(start + nodes * h, chosen))
    N, m = len(chosen), A.shape[-1]
    if m == 2:
        return _of_one_wave(A[..., 0, 1], A[..., 1, 0], s)
    # Unknown y_i for each column of y₀ = 1, and for y₀ = 0 with the source.
    matrix = -np.einsum("ij,njkl->nikjl", a, A).reshape(N, POINTS * m, POINTS * m)
    matrix[:, range(POINTS * m), range(POINTS * m)] += 1
    given = np.zeros_like(A, shape=(N, POINTS, m, m + 1))
    given[..., :m] = np.eye(m)
    given[..., m] = np.einsum("ij,njk->nik", a, s)
    y = np.linalg.solve(matrix, given.reshape(N, POINTS * m, m + 1)).reshape(N, POINTS, m, m + 1)
    total = np.einsum("j,njkl,njlc->nkc", b, A, y)
    return total[..., :m] + np.eye(m), total[..., m] + np.einsum("j,njk->nk", b, s)


def _of_one_wave(P: Any, Q: Any, s: Any) -> tuple[Any, Any]:
    """The same of one pair of waves, e′ = P o + s₀, o′ = Q e + s₁: with e put into the equations of
    o half as many are left. P, Q (N, 8), s (N, 8, 2), all times h."""
    _, a, b = butcher()
    aP, aQ, as_ = a * P[:, None, :], a * Q[:, None, :], np.einsum("ij,njk->nik", a, s)
    e, o = (np.zeros_like(P + Q, shape=(*P.shape, 3)) for _ in range(2))
    e[..., 0], e[..., 2], o[..., 1], o[..., 2] = 1, as_[..., 0], 1, as_[..., 1]
    o = np.linalg.solve(np.eye(POINTS) - aQ @ aP, o + aQ @ e)
    e = e + aP @ o
    total = np.stack([(b * P)[:, None] @ o, (b * Q)[:, None] @ e], axis=1)[:, :, 0]
    return total[..., :2] + np.eye(2), total[..., 2] + np.einsum("j,njk->nk", b, s)


def scattered(T: Any, q: Any) -> Piece:
    """The piece that T and q of y = (√z v, f/√z) make."""
    n = T.shape[1] // 2
    unit = np.eye(n)
    turn = np.block([[unit, unit], [unit, -unit]])  # 2 (a, b) from y; y from (a, b)
    W = turn @ T @ turn / 2
    sent = times(turn / 2, q)
    below = 1 / W[:, n:, n:] if n == 1 else np.linalg.inv(W[:, n:, n:])
    left = -times(below, sent[:, n:])
    s11 = -below @ W[:, n:, :n]
    return Piece(
        s11,
        below,
        W[:, :n, :n] + W[:, :n, n:] @ s11,
        W[:, :n, n:] @ below,
        left,
        sent[:, :n] + times(W[:, :n, n:], left),
    )


def step(system: System, start: float, h: float, chosen: Any) -> Piece:
    """One step as a piece."""
    T, q = transfer(system, start, h, chosen)
    if left := _LEFT.get():
        left[0] -= len(chosen) * (T.shape[1] // 2) ** 2
        if left[0] < 0:
            raise TooMuch
    return scattered(T, q)


def graded(system: System, start: float, end: float, count: int, strength: Any = None) -> Piece:
    """A stretch over which the medium varies.

    Args:
        system: A and s by position.
        start, end: scaled.
        count: N, of frequencies.
        strength: by what changes of what sources send are measured, shape (N,), > 0.

    Raises:
        Unresolved: at some frequency no step is short enough.
        TooMuch: it takes more steps than :func:`at_most` allows.
    """
    strength = np.ones(count) if strength is None else strength
    chosen = np.arange(count)
    whole = step(system, start, end - start, chosen)
    return _refined(system, start, end, chosen, whole, strength, 0)


def _change(one: Piece, two: Piece, strength: Any) -> Any:
    share = np.abs(value_of(one.sent - two.sent)).max(axis=1) / strength
    return np.maximum(np.abs(value_of(one.whole - two.whole)).max(axis=(1, 2)), share)


def _refined(
    system: System, start: float, end: float, chosen: Any, coarse: Piece, strength: Any, depth: int
) -> Piece:
    middle = (start + end) / 2
    left = step(system, start, middle - start, chosen)
    right = step(system, middle, end - middle, chosen)
    fine = star(left, right)
    open_ = ~(_change(coarse, fine, strength) <= TOLERANCE)
    if not open_.any():
        return fine
    if depth == DEEPEST:
        raise Unresolved(int(chosen[open_][0]))
    rest = (strength[open_], depth + 1)
    finer = star(
        _refined(system, start, middle, chosen[open_], left.at(open_), *rest),
        _refined(system, middle, end, chosen[open_], right.at(open_), *rest),
    )
    fine.put(open_, finer)
    return fine
