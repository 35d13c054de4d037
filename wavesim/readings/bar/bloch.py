"""Bloch waves of a periodic stack, from the field at like points of its cells.

Where a stretch repeats with period L, the two waves that run to and fro in it differ by e^{±iqL}
from cell to cell, so that any three like points obey, whatever their amplitudes,

    u(x + L) + u(x − L) = 2 cos(qL) u(x):

cos(qL) by least squares over all such triples at each ω + iσ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.layered.bloch import bloch
from wavesim.material.family import Block
from wavesim.material.layers import Layer, Layers
from wavesim.readings.bar.excited_band import JUDGED, contour, line, pulses
from wavesim.readings.bar.loudness import Loudness
from wavesim.readings.damped_transform import damped_transform
from wavesim.simulation.field import Field

Complex = NDArray[np.complex128]

_FEWEST_CELLS = 4
# To this part of themselves amplitudes are told from what the record's end and rounding may add.
_TOLD = 1e-3


@dataclass(frozen=True)
class Repeated:
    """A stretch of a bar that repeats, and what is known of it before any field is.

    Attributes:
        sector: of the wave.
        period: L, m.
        nodes: those of the stretch, its end included; step: how many to a period.
        omega, sigma: ω and σ of the frequencies ω + iσ, shape (n,), rad/s.
        cosine_exact: cos(qL) of the exact solver, shape (n,).
        driven: where the source has 1 % of its peak, shape (n,).
        line: ω and q (folded, rad/m) on a line fine enough to be drawn.
    """

    sector: str
    period: float
    nodes: slice
    step: int
    omega: NDArray[Any]
    sigma: float
    cosine_exact: Complex
    driven: NDArray[np.bool_]
    line: tuple[NDArray[Any], Complex]


@dataclass(frozen=True, kw_only=True)
class Cells(Repeated):
    """Bloch wavenumber of a stack against frequency, beside what is known of it.

    Attributes:
        q: measured, of ±q that with Im q ≥ 0, and |Re q| for Re q, shape (n,), rad/m.
        q_exact: of the exact solver.
        cosine: cos(qL) measured, which decides; q itself is ill-conditioned at a band edge.
        judged: where the source has 1 % of its peak and the field stands above the record's end.
    """

    q: Complex
    q_exact: Complex
    cosine: Complex
    judged: NDArray[np.bool_]


def repeated(layers: Layers) -> tuple[float, float, Layers] | None:
    """The longest stretch of a bar that repeats: its start, its end, and one cell from 0."""
    all_ = layers.layers
    best: tuple[float, float, Layers] | None = None
    for size in range(2, len(all_) // _FEWEST_CELLS + 1):
        for first in range(len(all_) - _FEWEST_CELLS * size + 1):
            count = size
            while first + count < len(all_) and _alike(
                all_[first + count], all_[first + count - size]
            ):
                count += 1
            cells = count // size
            if cells >= _FEWEST_CELLS:
                start, end = all_[first].start, all_[first + cells * size - 1].end
                if best is None or end - start > (best[1] - best[0]) * (1 + 1e-9):
                    own = all_[first : first + size]
                    cell = [
                        Layer(o.start - start, o.end - start, o.medium, o.last, o.grading)
                        for o in own
                    ]
                    best = start, end, Layers(tuple(cell))
    return best


def _alike(one: Layer, other: Layer) -> bool:
    same = (one.medium, one.last, one.grading) == (other.medium, other.last, other.grading)
    return same and abs(one.thickness - other.thickness) <= 1e-9 * one.thickness


def repeated_stretch(
    field: Field, block: Block, frequencies: int, damping: float
) -> Repeated | None:
    """What is known of a bar's repeated stretch.

    Args:
        field: its sources outside that stretch; no value of it is looked at.
        block: one with a macro-field.
        frequencies: number of frequencies.
        damping: σT of the exponential window.

    Returns:
        What is known; None where fewer than four cells repeat.
    """
    found = repeated(field.layers)
    own = pulses(field, block)
    if found is None or not own:
        return None
    start, end, cell = found
    if any(start <= source.position <= end for source in own):
        return None
    period, nodes = cell.length, field.bar.nodes
    omega, sigma, size = contour(field, own, frequencies, damping)
    near = 1e-9 * period
    first, second, last = np.searchsorted(nodes, [start - near, start + period - near, end + near])
    fine, count = line(omega, sigma), len(omega)
    q = bloch(cell, block.sector, np.concatenate([omega, fine]) + 1j * sigma)
    cosine = np.cos(q * period)
    return Repeated(
        block.sector,
        period,
        slice(int(first), int(last)),
        int(second - first),  # a ring has no node at its right end
        omega,
        sigma,
        cosine[:count],
        size >= JUDGED,
        (fine, _folded(cosine[count:]) / period),
    )


def cells(field: Field, block: Block, known: Repeated, loud: Loudness | None = None) -> Cells:
    """Measure the Bloch waves of a bar's repeated stretch.

    Args:
        field: the field.
        block: one with a macro-field.
        known: of :func:`repeated_stretch`.
        loud: of the same field; made where None.
    """
    loud = loud or Loudness(field)
    period, step = known.period, known.step
    (name,) = block.macro[0]
    record = field.part(name, points=known.nodes)
    U = damped_transform(record, field.t, known.omega, known.sigma)
    middle, sides = U[:, step:-step], U[:, 2 * step :] + U[:, : -2 * step]
    weight = (np.abs(middle) * _TOLD > loud.hidden(record, known.sigma, name)).astype(float)
    square = np.sum(weight * np.abs(middle) ** 2, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.sum(weight * np.conj(middle) * sides, axis=1) / square / 2
    judged = known.driven & (weight.sum(axis=1) >= 2 * step)
    q, exact = _folded(cosine) / period, _folded(known.cosine_exact) / period
    return Cells(**vars(known), q=q, q_exact=exact, cosine=cosine, judged=judged)


def _folded(cosine: Complex) -> Complex:
    """Of ±qL that which decays, Im qL ≥ 0, with |Re qL| for Re qL, at most π."""
    angle = np.arccos(np.where(np.isfinite(cosine), cosine, np.nan + 0j))
    return np.where(angle.imag < 0, np.conj(angle), angle)
