"""Where the propagator of a bar is that of an endless uniform one, and where it is not. No jax.

cos(h√−L) couples a point to those within a reach of r cells. Rows further than that from anything
irregular (a closure at an end or interface, a graded layer) hold the kernel of their stretch's
medium. About the irregular parts what is left, the propagator less those kernels cut off where
their stretch ends, is nonzero within r of them only: pieces of rows and columns.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass

from wavesim.grid.bar import Bar
from wavesim.grid.summation_by_parts import closure
from wavesim.material.layers import Layers
from wavesim.timedomain.timestep import LONGEST_REACH, Schedule, reach_within, series_degree

Span = tuple[int, int]  # of points, the last one not included

# Irregular parts nearer than twice the reach and this are taken as one, so that a piece and the
# grid about it, on which it is made, hold one part whole and nothing of the next.
APART = 24

# Kernels take at least this many cells in one run: with many media their matrices must stay small.
SHORT_RUN = 32
# Costs in ns, timed on one core. A step's: of the series, for each cell, degree and coefficient of
# one field on another; of kernels, for each flop; of matrices read, for each entry. Of setting up:
# for each column, row, degree and coefficient of a piece, and for a piece as such.
_SERIES, _KERNEL, _ENTRY, _MAKING, _PIECE = 2.5, 0.026, 1.0, 10.0, 3e6
# Cells by which the reach itself is below reach_within, which bounds it.
_SLACK = 11


@dataclass(frozen=True)
class Piece:
    """A block of the propagator's correction; spans may leave a periodic bar on either side.

    Attributes:
        rows, columns: the points it takes a state to, and from.
    """

    rows: Span
    columns: Span


@dataclass(frozen=True)
class Zones:
    """A bar cut up for one reach.

    Attributes:
        stretches: uniform stretches that a kernel is held for, of cells.
        pieces: corrections; no two have a row in common.
        ring: whether the one stretch closes on itself.
        fits: False where a periodic bar is too short for its irregular parts.
    """

    stretches: tuple[Span, ...]
    pieces: tuple[Piece, ...]
    ring: bool = False
    fits: bool = True


def zones(layers: Layers, bar: Bar, reach: int) -> Zones:
    """Cut a bar up.

    Args:
        layers: what it is made of.
        bar: its grid and ends.
        reach: r, cells.
    """
    counts = [cells for cells, _ in bar.stretches] or [bar.cells]
    bounds = [sum(counts[:i]) for i in range(len(counts) + 1)]
    graded = [layer.last is not None for layer in layers.layers]
    if bar.uniform and bar.periodic and not any(graded):
        return Zones(((0, bar.cells),), (), ring=True)
    points = len(bar.nodes)
    near = closure(bar.order).weights.shape[0] + 1
    parts = [(bound - near, bound + near) for bound in bounds[: -1 if bar.periodic else None]]
    parts += [(bounds[i] - near, bounds[i + 1] + near) for i, yes in enumerate(graded) if yes]
    domains, fits = [], True
    for members in _clusters(sorted(parts), bar, 2 * reach + APART):
        first, last = members[0][0] - reach, max(high for _, high in members) + reach
        fits &= not bar.periodic or last - first + reach + APART <= bar.cells
        domains.append((first, last, members))
    pieces = []
    for first, last, members in domains:
        low, high = (first, last) if bar.periodic else (max(first, 0), min(last, points))
        cuts = [low, *_cuts(members), high]
        for a, b in itertools.pairwise(cuts):
            long = b - a > 2 * (reach + near) + APART
            number = math.ceil((b - a) / (reach + near)) if long else 1
            edges = [a + (b - a) * i // number for i in range(number + 1)]
            pieces += [
                # Closures are wider than the stencil: through them more is felt ahead of the front.
                Piece((p, q), (max(p - reach - near, low), min(q + reach + near, high)))
                for p, q in itertools.pairwise(edges)
            ]
    turns = (-bar.cells, 0, bar.cells) if bar.periodic else (0,)
    kept = tuple(
        (a, b)
        for a, b, gradual in zip(bounds, bounds[1:], graded, strict=False)
        if not gradual
        and not any(low + t <= a and b <= high + t for low, high, _ in domains for t in turns)
    )
    return Zones(kept, tuple(pieces), fits=fits)


def _clusters(parts: list[Span], bar: Bar, apart: int) -> list[list[Span]]:
    """Irregular parts that lie near each other, together."""
    clusters: list[list[Span]] = []
    reached = -math.inf
    for part in parts:
        if clusters and part[0] - reached <= apart:
            clusters[-1].append(part)
        else:
            clusters.append([part])
        reached = max(reached, part[1])
    if bar.periodic and len(clusters) > 1 and clusters[0][0][0] + bar.cells - reached <= apart:
        last = [(low - bar.cells, high - bar.cells) for low, high in clusters.pop()]
        clusters[0] = last + clusters[0]
    return clusters


def _cuts(members: list[Span]) -> list[int]:
    """Middles of the gaps between the parts of a cluster."""
    cuts, reached = [], members[0][1]
    for low, high in members[1:]:
        if low > reached:
            cuts.append((reached + low) // 2)
        reached = max(reached, high)
    return cuts


def banded(
    steps: Schedule,
    layers: Layers,
    bar: Bar,
    sizes: tuple[int, ...],
    speed: float,
    demanded: bool,
) -> Schedule:
    """The schedule of a lossless bar with the banded propagator, where that pays.

    Args:
        steps: its schedule with the series.
        layers, bar: the bar.
        sizes: number of fields of each block that is integrated.
        speed: of the fastest wave, cells per scaled time.
        demanded: take it in any case.

    Returns:
        One of the two.

    Raises:
        ValueError: it is demanded of a periodic bar that is too short.
    """
    reach = reach_within(steps.step, speed)
    cut = zones(layers, bar, reach)
    if demanded and not cut.fits:
        raise ValueError(
            f"solver = 'propagator': the bar of {bar.cells} cells is too short for what is within "
            f"{reach} cells of its interfaces; take 'chebyshev' or a longer bar"
        )
    made = dataclasses.replace(steps, solver="propagator", reach=reach)
    if demanded:
        return made
    expected = max(reach - _SLACK, 1)
    pays = (
        cut.fits
        and reach <= LONGEST_REACH
        and _cost(zones(layers, bar, expected), bar, expected, made, sizes)
        < sum(size**2 for size in sizes) * _SERIES * bar.cells * steps.degree * steps.steps
    )
    return made if pays else steps


def _cost(cut: Zones, bar: Bar, reach: int, steps: Schedule, sizes: tuple[int, ...]) -> float:
    """Of a run with the propagator, setup included, ns; no matrix is taken to be shared."""
    shapes = [
        (piece.rows[1] - piece.rows[0], piece.columns[1] - piece.columns[0]) for piece in cut.pieces
    ]
    width = SHORT_RUN + 2 * reach
    entries = sum(rows * columns for rows, columns in shapes)
    entries += len(cut.stretches) * width * SHORT_RUN
    each_step = _KERNEL * 4 * width * bar.cells + _ENTRY * entries
    degree = series_degree(steps.step, steps.bound)
    making = sum((columns + reach + APART) * rows for rows, columns in shapes)
    each_coefficient = each_step * steps.steps + _MAKING * degree * making
    return sum(size**2 * each_coefficient + _PIECE * len(shapes) for size in sizes)
