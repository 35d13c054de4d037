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
from wavesim.material.layers import Layer, Layers
from wavesim.material.sectors import Block
from wavesim.readings.bar.excited_band import JUDGED, contour, pulses
from wavesim.readings.damped_transform import damped_transform
from wavesim.simulation.field import Field

Complex = NDArray[np.complex128]

_FEWEST_CELLS = 4
# Weighted against amplitudes this far below the strongest of the record's end, exp(−σT).
_ABOVE_FLOOR = 30.0


@dataclass(frozen=True)
class Cells:
    """Bloch wavenumber of a stack against frequency.

    Attributes:
        sector: of the wave.
        period: L, m.
        omega, sigma: ω and σ of the frequencies ω + iσ, shape (n,), rad/s.
        q: measured, of ±q that with Im q ≥ 0, and |Re q| for Re q, shape (n,), rad/m.
        q_exact: of the exact solver.
        cosine, cosine_exact: cos(qL), which decides; q itself is ill-conditioned at a band edge.
        judged: where the source has 1 % of its peak and the field stands above the record's end.
    """

    sector: str
    period: float
    omega: NDArray[Any]
    sigma: float
    q: Complex
    q_exact: Complex
    cosine: Complex
    cosine_exact: Complex
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


def cells(field: Field, block: Block, frequencies: int, damping: float) -> Cells | None:
    """Measure the Bloch waves of a bar's repeated stretch.

    Args:
        field: its sources outside that stretch.
        block: one with a rotation.
        frequencies: number of frequencies.
        damping: σT of the exponential window.

    Returns:
        What was measured; None where fewer than four cells repeat.
    """
    found = repeated(field.layers) if field.layers is not None else None
    own = pulses(field, block)
    if found is None or not own:
        return None
    start, end, cell = found
    if any(start <= source.position <= end for source in own):
        return None
    period = cell.length
    omega, sigma, size = contour(field, own, frequencies, damping)
    nodes = field.bar.nodes
    near = 1e-9 * period
    first, second, last = np.searchsorted(nodes, [start - near, start + period - near, end + near])
    step = int(second - first)  # a ring has no node at its right end
    (name,) = block.rotations[0]
    record = field.part(name, points=slice(int(first), int(last)))
    U = damped_transform(record, field.t, omega, sigma)
    middle, sides = U[:, step:-step], U[:, 2 * step :] + U[:, : -2 * step]
    floor = _ABOVE_FLOOR * np.exp(-damping) * np.abs(U).max()
    weight = (np.abs(middle) > floor).astype(float)
    square = np.sum(weight * np.abs(middle) ** 2, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.sum(weight * np.conj(middle) * sides, axis=1) / square / 2
    exact = bloch(cell, block.sector, omega + 1j * sigma)
    judged = (size >= JUDGED) & (weight.sum(axis=1) >= 2 * step)
    return Cells(
        block.sector,
        period,
        omega,
        sigma,
        _folded(cosine) / period,
        _folded(np.cos(exact * period)) / period,
        cosine,
        np.cos(exact * period),
        judged,
    )


def _folded(cosine: Complex) -> Complex:
    """Of ±qL that which decays, Im qL ≥ 0, with |Re qL| for Re qL, at most π."""
    angle = np.arccos(np.where(np.isfinite(cosine), cosine, np.nan + 0j))
    return np.where(angle.imag < 0, np.conj(angle), angle)


def exact_folded(layers: Layers, sector: str, omega: Complex) -> Complex:
    """qL of a bar's repeated stretch by the exact solver, folded as the measured one is.

    Args:
        layers: of the bar; four cells repeat in it.
        sector: of the wave.
        omega: ω + iσ, shape (n,), rad/s.
    """
    found = repeated(layers)
    assert found is not None
    return _folded(np.cos(bloch(found[2], sector, omega) * found[2].length))
