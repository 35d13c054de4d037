"""A graded stretch of the bar: Magnus steps of order six, halved until they agree.

y′ = A(x) y + s(x) is solved over one step h by y₁ = exp(Ω)(y₀) + …, with Ω from A at three
Gauss points; the source joins A as one more column. A step counts when it agrees with its two
halves; each frequency is refined by itself, as only those near an asymptote of some cross-section
need many. Steps become scattering matrices before they are joined, so thick gaps do no harm.

Blanes, Casas, Oteo & Ros, Phys. Rep. 470, 151 (2009), Eq. (257).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from wavesim.layered.slab import assemble
from wavesim.layered.star import Piece, star

# A half step of order 6 errs by 1/64 of what it differs by from the whole one.
TOLERANCE = 1e-11
DEEPEST = 24

System = Callable[[float, Any], tuple[Any, Any]]
"""(A, s) at a scaled position for frequencies by index: shapes (N, 2n, 2n), (N, 2n)."""


def _commutator(a: Any, b: Any) -> Any:
    return a @ b - b @ a


def exponent(system: System, start: float, h: float, chosen: Any) -> tuple[Any, Any]:
    """Ω of one step and the constant source d that stands for s: y(1) of y′ = Ω y + d."""
    sampled = []
    for node in (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15)):
        A, s = system(start + node * h, chosen)
        whole = np.zeros((len(chosen), A.shape[1] + 1, A.shape[1] + 1), dtype=complex)
        whole[:, :-1, :-1], whole[:, :-1, -1] = h * A, h * s
        sampled.append(whole)
    first, middle, last = sampled
    one = middle
    two = math.sqrt(15) / 3 * (last - first)
    three = 10 / 3 * (last - 2 * middle + first)
    c1 = _commutator(one, two)
    c2 = -_commutator(one, 2 * three + c1) / 60
    total = one + three / 12 + _commutator(-20 * one - three + c1, two + c2) / 240
    return total[:, :-1, :-1], total[:, :-1, -1]


def _one_wave(total: Any) -> Piece:
    """S of exp(Ω), 2 × 2 without trace, where it may be nearly defective: with E = e^{−λ},

    exp(Ω) = e^λ [(1 + E²)/2 + (1 − E²)/(2λ) Ω],   λ² = −det Ω.
    """
    root = np.sqrt(total[:, 0, 0] ** 2 + total[:, 0, 1] * total[:, 1, 0])
    root = np.where(root.real < 0, -root, root)
    root = np.where(np.abs(root) < 1e-150, 1e-150, root)
    through = np.exp(-root)
    slope = -np.expm1(-2 * root) / (2 * root)
    T = slope[:, None, None] * total
    T[:, [0, 1], [0, 1]] += ((1 + through**2) / 2)[:, None]
    turn = np.array([[0.5, 0.5], [0.5, -0.5]])  # (y) → (a, b)
    T = turn @ T @ (2 * turn)
    below = T[:, 1, 1]
    none = np.zeros((len(total), 1), dtype=complex)

    def entry(values: Any) -> Any:
        return values[:, None, None]

    cross = entry(through / below)
    return Piece(
        entry(-T[:, 1, 0] / below), cross, cross.copy(), entry(T[:, 0, 1] / below), none,
        none.copy(),
    )  # fmt: skip


def step(total: Any, d: Any) -> Piece:
    """The piece of y′ = Ω y + d over a unit length."""
    n = total.shape[1] // 2
    if n == 1 and not d.any():
        return _one_wave(total)
    values, vectors = np.linalg.eig(total)
    order = np.argsort(values.real, axis=1)
    values = np.take_along_axis(values, order, axis=1)
    vectors = np.take_along_axis(vectors, order[:, None, :], axis=2)
    amplitude = np.linalg.solve(vectors, d[..., None])[..., 0]
    exponents = np.concatenate([values[:, :n], -values[:, n:]], axis=1)
    small = np.where(exponents == 0, 1e-150, exponents)
    made = np.expm1(small) / small * amplitude
    decay = np.exp(exponents)
    v, f = vectors[:, :n], vectors[:, n:]
    return assemble(
        (v[:, :, :n], f[:, :, :n]),
        (v[:, :, n:], f[:, :, n:]),
        (decay[:, :n], decay[:, n:]),
        (made[:, :n], -made[:, n:]),
    )


def graded(
    system: System,
    start: float,
    end: float,
    count: int,
    strength: Any = None,
    tolerance: float = TOLERANCE,
) -> Piece:
    """A stretch over which the medium varies.

    Args:
        system: A and s by position.
        start, end: scaled.
        count: N, of frequencies.
        strength: by what changes of what sources send are measured, shape (N,), > 0.
        tolerance: by how much S may change when a step is halved; the halves are kept, whose
            error is 1/64 of that.

    Raises:
        ValueError: steps as short as 2⁻²⁴ of the stretch still change S: a real ω is then in
            the continuum of its asymptotes.
    """
    strength = np.ones(count) if strength is None else strength
    chosen = np.arange(count)
    whole = step(*exponent(system, start, end - start, chosen))
    return _refined(system, start, end, chosen, whole, strength, tolerance, 0)


def _change(one: Piece, two: Piece, strength: Any) -> Any:
    share = np.abs(one.sent - two.sent).max(axis=1) / strength
    return np.maximum(np.abs(one.whole - two.whole).max(axis=(1, 2)), share)


def _refined(
    system: System,
    start: float,
    end: float,
    chosen: Any,
    coarse: Piece,
    strength: Any,
    tolerance: float,
    depth: int,
) -> Piece:
    middle = (start + end) / 2
    left = step(*exponent(system, start, middle - start, chosen))
    right = step(*exponent(system, middle, end - middle, chosen))
    fine = star(left, right)
    open_ = ~(_change(coarse, fine, strength) <= tolerance)
    if not open_.any():
        return fine
    if depth == DEEPEST:
        raise ValueError(
            f"frequency {chosen[open_][0]}: a graded layer has an asymptote at it, where waves "
            "pile up; take a complex ω, with Im ω > 0"
        )
    rest = (strength[open_], tolerance, depth + 1)
    finer = star(
        _refined(system, start, middle, chosen[open_], left.at(open_), *rest),
        _refined(system, middle, end, chosen[open_], right.at(open_), *rest),
    )
    fine.put(open_, finer)
    return fine
