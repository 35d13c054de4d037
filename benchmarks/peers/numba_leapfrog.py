"""Leapfrog as stencil loops compiled by numba: all steps in one compiled function.

The blocks of the equations do not feel each other, so the threads take blocks and never wait for
one another. A block's loops run over padded contiguous rows with the stencil written out, which
LLVM vectorises; the whole state stays in the cache next to the core.
"""

from __future__ import annotations

from typing import ClassVar

import numba
import numpy as np
from contestant import Solution
from leapfrog import forces, least_steps
from numpy.typing import NDArray
from problem import COMPONENTS, Problem

Float = NDArray[np.float64]

_PAD = 8


@numba.njit(fastmath=True)
def _add(total: Float, factor: float, row: Float) -> None:
    for i in range(total.size):
        total[i] += factor * row[i]


@numba.njit(fastmath=True)
def _combine(total: Float, keep: float, c: Float, a: Float, b: Float, d: Float) -> None:
    """total ← keep · total + c₀ a + c₁ b + c₂ d."""
    c0, c1, c2 = c[0], c[1], c[2]
    for i in range(total.size):
        total[i] = keep * total[i] + c0 * a[i] + c1 * b[i] + c2 * d[i]


@numba.njit(fastmath=True)
def _difference(out: Float, keep: float, u: Float, w: Float, ahead: int) -> None:
    """out ← keep · out + difference of u, whose ends it first lays round the ring.

    Each shift is a slice: an index like i − 3 costs numba a test for negative values at every
    point, and with it the vectors, ten times the time.
    """
    n = u.size - 2 * _PAD
    for i in range(_PAD):
        u[i] = u[n + i]
        u[_PAD + n + i] = u[_PAD + i]
    start = _PAD + ahead
    a1, b1 = u[start : start + n], u[start - 1 : start - 1 + n]
    a2, b2 = u[start + 1 : start + 1 + n], u[start - 2 : start - 2 + n]
    a3, b3 = u[start + 2 : start + 2 + n], u[start - 3 : start - 3 + n]
    a4, b4 = u[start + 3 : start + 3 + n], u[start - 4 : start - 4 + n]
    o = out[_PAD : _PAD + n]
    w1, w2, w3, w4 = w[0], w[1], w[2], w[3]
    for i in range(n):
        o[i] = (
            keep * o[i]
            + w1 * (a1[i] - b1[i])
            + w2 * (a2[i] - b2[i])
            + w3 * (a3[i] - b3[i])
            + w4 * (a4[i] - b4[i])
        )


@numba.njit(fastmath=True, parallel=True)
def _march(
    q: Float, w: Float, c: Float, at: Float, cells: Float, signal: Float, driven: int, steps: int
) -> None:
    """All steps of the three coupled blocks and the three oscillators.

    Task 0 to 2 is a coupled block, task 3 the oscillators together. ``c`` holds h² times the
    coefficients, so that dq is the change of q in a step.
    """
    for task in numba.prange(4):
        first = 3 * task
        mine = q[first : first + 3]
        change = np.zeros_like(mine)
        kappa, sigma = np.zeros(q.shape[1]), np.zeros(q.shape[1])
        for step in range(steps):
            if task < 3:
                _difference(kappa, 0.0, mine[0], w, 1)
                _combine(sigma, 0.0, c[task, 0], kappa, mine[1], mine[2])
                _combine(change[1], 1.0, c[task, 1], kappa, mine[1], mine[2])
                _combine(change[2], 1.0, c[task, 2], kappa, mine[1], mine[2])
                _difference(change[0], 1.0, sigma, w, 0)
            else:
                for j in range(3):
                    _add(change[j], c[3, 0, j], mine[j])
            if step < driven:
                for s in range(at.size):
                    if first <= at[s] < first + 3:
                        change[at[s] - first, cells[s] + _PAD] += signal[step, s]
            for j in range(3):
                _add(mine[j], 1.0, change[j])


class Peer:
    kind: ClassVar[str] = "steps"

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.least_steps = least_steps(problem)
        # Rows of a coupled block: σ, B̈₁ and B̈₂ of κ, B₁ and B₂.
        self.coefficients = np.zeros((4, 3, 3))
        for number, form in enumerate(problem.forms):
            if number < 3:
                rows = [[form.c_pp, -form.c_pb], [form.c_bp, -form.c_bb]]
                self.coefficients[number] = np.block(rows)
            else:
                self.coefficients[3, 0, number - 3] = -form.c_bb[0, 0]
        self.at = np.array([d.component for d in problem.drives])
        self.cells = np.array([d.cell for d in problem.drives])

    def warm_up(self, setting: float) -> None:
        self.part(setting, 2)

    def run(self, setting: float) -> Solution:
        return Solution(self.problem.fields(self.part(setting, int(setting))), int(setting))

    def part(self, setting: float, steps: int) -> Float:
        h = self.problem.duration / int(setting)
        signal, driven = forces(self.problem, int(setting))
        q = np.zeros((COMPONENTS, self.problem.bar.cells + 2 * _PAD))
        _march(
            q,
            self.problem.weights,
            h**2 * self.coefficients,
            self.at,
            self.cells,
            signal,
            driven,
            steps,
        )
        return q[:, _PAD:-_PAD].copy()
