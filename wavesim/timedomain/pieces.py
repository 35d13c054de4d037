"""The propagator of a bar that is not uniform, as kernels of its stretches and dense corrections.

Kernels are those of ``kernels.py``. A correction is made on the grid about it alone: rows of
cos(h√−L) by the Chebyshev series of the cosine in Lᵀ, applied to unit vectors, less the kernels.
Nothing that is done at the edges of that grid is felt in the correction within a step. Equal ones,
as in a stack that repeats, are made once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import block_array, csr_array, diags_array

from wavesim.grid.bar import Bar
from wavesim.material.layers import Layers
from wavesim.material.scaling import BlockCoefficients
from wavesim.timedomain.group import Group
from wavesim.timedomain.kernels import kernels, negligible
from wavesim.timedomain.timestep import Schedule, chebyshev_series, cosine, series_degree
from wavesim.timedomain.zones import APART, Piece, Span, zones

# Numbers of media and grids that agree to so many digits are equal when matrices are shared.
_DIGITS = 11
# Places within a graded layer at which its reach is looked up.
_PLACES = 5


@dataclass(frozen=True)
class Cut:
    """The propagator C of one group of blocks.

    Attributes:
        points: number of points of the bar.
        reach: r.
        stretches: (span, number of its kernel) of each.
        kernels: for each number, for each block, shape (1, fields, fields, 2r′ + 1).
        pieces: (piece, number of its matrix) of each.
        corrections: for each number, shape (blocks, fields, rows, fields, columns).
        ring: whether the one stretch closes on itself.
    """

    points: int
    reach: int
    stretches: tuple[tuple[Span, int], ...]
    kernels: tuple[tuple[np.ndarray, ...], ...]
    pieces: tuple[tuple[Piece, int], ...]
    corrections: tuple[np.ndarray, ...]
    ring: bool


def cut(layers: Layers, bar: Bar, group: Group, schedule: Schedule, length: float) -> Cut:
    """Kernels and corrections of a group.

    Args:
        layers: what the bar is made of, of plain numbers and without losses.
        bar: its grid and ends, none of them absorbing.
        group: its generator.
        schedule: of the run; its step and bound count.
        length: unit of length, m.

    Raises:
        ValueError: the bar is periodic and too short.
    """
    spacing = bar.cell_sizes / length

    def at(j: int) -> tuple[np.ndarray, ...]:
        """Kernels of the blocks in an endless medium as that of cell j."""
        return tuple(
            kernels(form, spacing[j], bar.order, schedule.step, schedule.bound)[:1]
            for form in (_form(group, block, j) for block in range(group.free.shape[0]))
        )

    counts = [cells for cells, _ in bar.stretches] or [bar.cells]
    bounds = np.cumsum([0, *counts])
    known: dict[bytes, int] = {}
    held: list[tuple[np.ndarray, ...]] = []
    numbers: dict[Span, int] = {}
    reach = 0
    for a, b, layer in zip(bounds, bounds[1:], layers.layers, strict=False):
        if layer.last is not None:
            graded = [at(int(j)) for j in np.linspace(a, b - 1, _PLACES)]
            reach = max(reach, *(_reach(kernel) for made in graded for kernel in made))
            continue
        middle = int(a + b) // 2
        forms = [_form(group, block, middle) for block in range(group.free.shape[0])]
        flat = [np.ravel(part) for form in forms for part in vars(form).values()]
        key = _rounded(np.concatenate([[spacing[middle]], *flat]))
        if key not in known:
            known[key] = len(held)
            held.append(at(middle))
        numbers[int(a), int(b)] = known[key]
        reach = max(reach, *(_reach(kernel) for kernel in held[known[key]]))
    found = zones(layers, bar, reach)
    if not found.fits:
        raise ValueError(
            f"a step reaches {reach} cells either way, too far for a periodic bar of {bar.cells} "
            "with interfaces: take a shorter step or solver 'chebyshev'"
        )
    stretches = tuple((span, numbers[span]) for span in found.stretches)
    matrices: dict[bytes, int] = {}
    corrections: list[np.ndarray] = []
    pieces = []
    for piece in found.pieces:
        local = _Local(bar, group, piece, reach, length, stretches)
        key = local.key
        if key not in matrices:
            matrices[key] = len(corrections)
            corrections.append(local.correction(schedule, held))
        pieces.append((piece, matrices[key]))
    least = negligible(schedule.step, schedule.bound)
    pieces = [one for one in pieces if np.abs(corrections[one[1]]).max() > least]
    return Cut(
        len(bar.nodes), reach, stretches, tuple(held), tuple(pieces), tuple(corrections), found.ring
    )


def _reach(kernel: np.ndarray) -> int:
    return (kernel.shape[-1] - 1) // 2


def _form(group: Group, block: int, j: int) -> BlockCoefficients:
    """Coefficients of a block over its inertias at cell j, away from closures."""
    c = group.c
    i_phi, i_B = c.m_phi[block, j] / group.node_norm[j], c.i_B[block, j]
    return BlockCoefficients(
        c.c_pp[..., block, j] / i_phi,
        c.c_pb[..., block, j] / i_phi,
        c.c_bp[..., block, j] / i_B,
        c.c_bb[..., block, j] / i_B,
        c.gamma[..., block, j] / i_B,
    )


def _rounded(values: np.ndarray) -> bytes:
    """A key that arrays share which agree to some digits."""
    scale = 10.0 ** np.floor(np.log10(np.abs(values) + 1e-300))
    return bytes((np.round(values / scale, _DIGITS) * scale + 0.0).tobytes())


class _Local:
    """The grid about a piece.

    Attributes:
        points: of the bar that it takes in.
        rows, columns: of the piece, within it.
        stretches: (first, last, number of the kernel) within it.
    """

    def __init__(
        self,
        bar: Bar,
        group: Group,
        piece: Piece,
        reach: int,
        length: float,
        stretches: Sequence[tuple[Span, int]],
    ) -> None:
        about = reach // 2 + APART // 2
        low = min(piece.rows[0], piece.columns[0]) - about
        high = max(piece.rows[1], piece.columns[1]) + about
        count = len(bar.nodes)
        if not bar.periodic:
            low, high = max(low, 0), min(high, count)
        self.group = group
        self.points = np.arange(low, high) % count
        self.rows = slice(piece.rows[0] - low, piece.rows[1] - low)
        self.columns = slice(piece.columns[0] - low, piece.columns[1] - low)
        self.stretches = [
            (max(a + turn - low, 0), min(b + turn - low, high - low), number)
            for (a, b), number in stretches
            for turn in ((-bar.cells, 0, bar.cells) if bar.periodic else (0,))
            if a + turn < high and b + turn > low
        ]
        made = bar.differences
        size = high - low
        D = np.zeros((size, size))
        half = np.flatnonzero(self.points < bar.cells)
        for offset, diagonal in enumerate(made.diagonals, start=made.first):
            inside = half[(half + offset >= 0) & (half + offset < size)]
            D[inside, inside + offset] = diagonal[self.points[inside]] * length
        self.D = D

    @property
    def _coefficients(self) -> list[np.ndarray]:
        c, at = self.group.c, self.points
        parts = [c.c_pp, c.c_pb, c.c_bp, c.c_bb, c.gamma, c.m_phi, c.i_B, self.group.free]
        return [part[..., at] for part in parts]

    @property
    def key(self) -> bytes:
        """Shared by pieces whose matrices are the same."""
        g, at = self.group, self.points
        arrays = [self.D, g.norm[at], g.node_norm[at], *self._coefficients]
        where = repr((self.rows, self.columns, self.stretches)).encode()
        return where + _rounded(np.concatenate([np.ravel(array) for array in arrays]))

    def operator(self, block: int) -> Any:
        """L of a block on this grid, sparse, fields outermost."""
        c_pp, c_pb, c_bp, c_bb, gamma, _, i_B, free = (
            part[..., block, :] for part in self._coefficients
        )
        D, p, b = csr_array(self.D), len(c_pp), len(c_bb)
        QT = (diags_array(self.group.norm[self.points]) @ D).T
        slope = diags_array(-1 / self.group.node_norm[self.points]) @ QT
        pull = diags_array(-free) @ QT
        parts: list[list[Any]] = [[None] * (p + b) for _ in range(p + b)]
        for i in range(p):
            for j in range(p):
                parts[i][j] = pull @ diags_array(c_pp[i, j]) @ D
            for j in range(b):
                parts[i][p + j] = -pull @ diags_array(c_pb[i, j])
        for i in range(b):
            for j in range(p):
                parts[p + i][j] = diags_array(c_bp[i, j] / i_B) @ D
            for j in range(b):
                parts[p + i][p + j] = diags_array(-c_bb[i, j] / i_B)
                if self.group.with_gradient:
                    bent = diags_array(1 / i_B) @ D @ diags_array(gamma[i, j]) @ slope
                    parts[p + i][p + j] = parts[p + i][p + j] + bent
        return csr_array(block_array(parts))

    def correction(self, schedule: Schedule, held: Sequence[tuple[np.ndarray, ...]]) -> np.ndarray:
        """C less the kernels, for each block, shape (blocks, fields, rows, fields, columns)."""
        made: dict[bytes, np.ndarray] = {}
        whole = []
        for block in range(self.group.free.shape[0]):
            L = self.operator(block)
            key = L.indices.tobytes() + L.data.tobytes()
            if key not in made:
                made[key] = self._rows(L, schedule)
                for a, b, number in self.stretches:
                    self._less(made[key], a, b, held[number][block])
            whole.append(made[key])
        return np.stack(whole)

    def _rows(self, L: Any, schedule: Schedule) -> np.ndarray:
        """Rows and columns of cos(h√−L) that the piece holds."""
        bound, size = schedule.bound, len(self.points)
        fields = L.shape[0] // size
        degree = series_degree(schedule.step, bound)
        series = chebyshev_series(lambda e: cosine(schedule.step, e), bound, degree)
        # Sparse products are faster here than BLAS, whose threads wait for each other.
        X = csr_array(diags_array(np.ones(L.shape[0])) + 2 / bound * L.T)
        first = np.eye(L.shape[0]).reshape(fields, size, -1)
        before = np.ascontiguousarray(first[:, self.rows].reshape(-1, L.shape[0]).T)
        now = X @ before
        total = series[0] * before + series[1] * now
        X = 2 * X
        for factor in series[2:]:
            before, now = now, X @ now - before
            total += factor * now
        rows = total.T.reshape(fields, -1, fields, size)
        return np.array(rows[..., self.columns])

    def _less(self, rows: np.ndarray, a: int, b: int, kernel: np.ndarray) -> None:
        """Take a kernel off within a stretch of this grid."""
        reach = _reach(kernel)
        m = np.arange(len(self.points))
        row, column = m[self.rows], m[self.columns]
        distance = row[:, None] - column
        inside = (row >= a) & (row < b)
        here = inside[:, None] & (column >= a) & (column < b) & (np.abs(distance) <= reach)
        entries = kernel[0][..., np.clip(distance + reach, 0, 2 * reach)]
        rows -= np.where(here, entries, 0.0).transpose(0, 2, 1, 3)
