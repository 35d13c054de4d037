"""Leapfrog as stencil loops compiled by numba, all steps in one function.

The blocks of the equations do not feel each other: threads take blocks, and never wait for one
another. Loops run over padded contiguous rows with the stencil written out, which LLVM vectorises;
a shift is a slice, as an index like i − 3 costs numba a test for negative values at every point.
What differs from the stencil of a layer near interfaces and ends is added entry by entry.
"""

from __future__ import annotations

import numba
import numpy as np

_PAD = 8


@numba.njit(fastmath=True)
def _add(total, factor, part, first, last):
    """total ← total + factor · part, on a stretch of points."""
    t, x = total[first + _PAD : last + _PAD], part[first + _PAD : last + _PAD]
    for i in range(t.size):
        t[i] += factor * x[i]


@numba.njit(fastmath=True)
def _combine(total, keep, c, a, b, d, first, last):
    """total ← keep · total + c₀ a + c₁ b + c₂ d, on a stretch of points."""
    c0, c1, c2 = c[0], c[1], c[2]
    t, x = total[first + _PAD : last + _PAD], a[first + _PAD : last + _PAD]
    y, z = b[first + _PAD : last + _PAD], d[first + _PAD : last + _PAD]
    for i in range(t.size):
        t[i] = keep * t[i] + c0 * x[i] + c1 * y[i] + c2 * z[i]


@numba.njit(fastmath=True)
def _difference(out, keep, u, w, ahead, ring):
    """out ← keep · out + difference of u, whose ends it first lays round the ring."""
    n = u.size - 2 * _PAD
    if ring:
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
def _march(made, w, c, edges, ring, near, places, near_from, force, at, force_from, signal, every):
    """All steps. Task 0 to 2 is a block of φ, B₁ and B₂, task 3 the three oscillators.

    ``c`` and ``near`` hold h² times the coefficients, so that ``change`` is that of q in a step;
    ``near_from`` and ``force_from`` say where the entries of each task begin.
    """
    n = made.shape[2]
    for task in numba.prange(4):
        mine = np.zeros((3, n + 2 * _PAD))
        change = np.zeros_like(mine)
        kappa, sigma = np.zeros(n + 2 * _PAD), np.zeros(n + 2 * _PAD)
        rows = np.array([9, 10, 11]) if task == 3 else np.array([task, task + 3, task + 6])
        for step in range(every * (made.shape[0] - 1)):
            if task < 3:
                _difference(kappa, 0.0, mine[0], w, 1, ring)
                for k in range(edges.size - 1):
                    a, b = edges[k], edges[k + 1]
                    _combine(sigma, 0.0, c[k, task, 0], kappa, mine[1], mine[2], a, b)
                    _combine(change[1], 1.0, c[k, task, 1], kappa, mine[1], mine[2], a, b)
                    _combine(change[2], 1.0, c[k, task, 2], kappa, mine[1], mine[2], a, b)
                _difference(change[0], 1.0, sigma, w, 0, ring)
            else:
                for k in range(edges.size - 1):
                    for j in range(3):
                        _add(change[j], c[k, 3, 0, j], mine[j], edges[k], edges[k + 1])
            for e in range(near_from[task], near_from[task + 1]):
                i, j, k, m = places[e, 0], places[e, 1], places[e, 2], places[e, 3]
                change[i, j] += near[e] * mine[k, m]
            if step < signal.size:
                for e in range(force_from[task], force_from[task + 1]):
                    change[at[e, 0], at[e, 1]] += force[e] * signal[step]
            for j in range(3):
                _add(mine[j], 1.0, change[j], 0, n)
            if (step + 1) % every == 0:
                for j in range(3):
                    made[(step + 1) // every, rows[j]] = mine[j, _PAD : _PAD + n]


class Peer:
    """Setting: steps from one frame to the next."""

    def __init__(self, given, setting: float) -> None:
        self.given, self.per_frame = given, int(setting)
        force = given.g[given.rates]
        at = np.flatnonzero(force)
        task, where = self._places(at)
        order = np.argsort(task, kind="stable")
        self.force, self.at = force[at][order], where[order]
        self.force_from = np.searchsorted(task[order], np.arange(5))
        task, to = self._places(given.near_rows)
        _, of = self._places(given.near_columns)
        order = np.argsort(task, kind="stable")
        self.near, self.places = given.near_values[order], np.hstack([to, of])[order]
        self.near_from = np.searchsorted(task[order], np.arange(5))

    def _places(self, flat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Task of each unknown, and its row and padded point there."""
        component, point = np.divmod(flat, self.given.points)
        coupled = component < 9
        task = np.where(coupled, component % 3, 3)
        row = np.where(coupled, component // 3, component - 9)
        return task, np.stack([row, point + _PAD], axis=1)

    def compile(self, frames: int) -> None:
        if not _march.signatures:
            Peer(self.given, 1).run(2)

    def run(self, frames: int) -> np.ndarray:
        given = self.given
        square = (given.interval / self.per_frame) ** 2
        made = np.zeros((frames, 12, given.points))
        forces = self.force, self.at, self.force_from, given.driven(self.per_frame, frames)
        near = square * self.near, self.places, self.near_from
        layers = given.w, square * given.c, given.edges, given.ring
        _march(made, *layers, *near, *forces, self.per_frame)
        return made.reshape(frames, -1)
