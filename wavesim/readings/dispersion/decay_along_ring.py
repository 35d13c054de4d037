"""Attenuation and complex wavenumber of an endless bar, from the decay along its longest free part.

At ω + iσ (``readings.damped_transform``) amplitudes go as exp(ikx) with the plane-wave root
k(ω + iσ), in gaps as in bands, and as exp(−ikx) where a wave has gone round the ring the other way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.family import Block
from wavesim.readings.damped_transform import damped_transform, truncation
from wavesim.readings.dispersion.line_fit import fit_line
from wavesim.simulation.field import Field

Float = NDArray[Any]
Complex = NDArray[np.complex128]

# The fit begins this many branch lengths from the source, past what its stencil spreads over,
# goes no further than this part of the way round, and stops at this multiple of the truncation
# error exp(−σT).
_FROM = 2.0
_PART = 0.125
_ABOVE_FLOOR = 30.0
# So many columns of the record are read at a time that they and their transform fit into these
# bytes.
_AT_ONCE = 64e6
# A fit needs about so many bytes for an amplitude.
_FIT_BYTES = 400
FEWEST_POINTS = 6
# A k that may be off by more of itself is not given.
_LARGEST_ERROR = 0.1
# Frames fold back what lies beyond their Nyquist frequency: of the tail of a spectrum, which goes
# on falling there, this part of what is seen from the first of these parts of that frequency on.
_FOLDED, _TOP = 0.25, (0.97, 1.0)


@dataclass(frozen=True)
class Attenuation:
    """Complex wavenumber of one block against frequency.

    Attributes:
        omega: real part of the frequencies, shape (n,), rad/s.
        sigma: their imaginary part σ, rad/s.
        k: measured complex wavenumber at ω + iσ, shape (n,), rad/m; NaN where not measurable.
        error: of |k|, by what the record's end leaves out and its frames fold back, shape (n,),
            rad/m.
        distance: of the grid points used, from the source, shape (nx,), m.
        level: amplitude over these against that at the first of them, shape (n, nx), dB.
    """

    omega: Float
    sigma: float
    k: Complex
    error: Float
    distance: Float
    level: Float


def wavenumbers(
    U: Complex, x: Float, left_out: Float, folded: float = 0.0
) -> tuple[Complex, Float]:
    """k of A exp(ikx) + B exp(−ikx) through complex amplitudes, by least squares.

    Args:
        U: amplitudes at n frequencies, shape (n, nx).
        x: ascending, even, shape (nx,), m.
        left_out: what the record's end leaves out of U, alike at all x, shape (n,); the fit stops
            where U first is not 30 times as large.
        folded: what the frames fold into it.

    Returns:
        k, shape (n,), rad/m; NaN where fewer than six points are left; and how far off |k|
        may be by both, shape (n,), rad/m.
    """
    k, error = np.full(len(U), complex(np.nan, np.nan)), np.full(len(U), np.nan)
    used = np.logical_and.accumulate(np.abs(U) > _ABOVE_FLOOR * left_out[:, None], axis=1)
    count = used.sum(axis=1)
    rows = np.flatnonzero(count >= FEWEST_POINTS)
    at_once = max(1, int(_AT_ONCE / (_FIT_BYTES * max(len(x), 1))))
    for first in range(0, len(rows), at_once):
        some = rows[first : first + at_once]
        fit = fit_line(U[some], x, used[some], 1, both=True)
        k[some] = fit.k[:, 0]
        wrong = np.hypot(left_out[some], folded)
        error[some] = wrong * np.sqrt(count[some]) * fit.unit[:, 0]
    return k, error


def attenuation(field: Field, block: Block, omega: Float, damping: float) -> Attenuation:
    """Complex wavenumber of a block along the longest stretch free of sources.

    Args:
        field: the field.
        block: one of its blocks, with a macro-field.
        omega: real frequencies, shape (n,), rad/s.
        damping: σT, –: 12 to 24 serve; more cuts the distance that can be seen, less leaves
            more of the record's end.

    Returns:
        The attenuation.

    Raises:
        ValueError: the block has no macro-field, so nothing travels in it.
    """
    if not block.macro:
        raise ValueError(f"block {block.name!r} has no macro-field: no wave travels in it")
    (name,) = block.macro[0]
    start, stretch = free_stretch(field, block)
    first, last = _FROM * field.medium.length_scale, _PART * stretch
    spacing = field.bar.spacing
    steps = np.arange(int(np.ceil(first / spacing)), int(last / spacing) + 1)
    origin = int(np.ceil(start / spacing - 1e-9))
    sigma = damping / float(field.t[-1])
    columns = (origin + steps) % field.bar.cells
    wanted = np.concatenate([omega, np.multiply(_TOP, np.pi / field.interval)])
    seen, largest = np.empty((len(omega), len(columns)), complex), np.zeros(len(wanted))
    width = max(1024, int(_AT_ONCE / (8 * len(field.t) + 40 * len(omega))) // 1024 * 1024)
    for low in range(0, field.bar.cells, width):
        values = field.part(name, points=slice(low, low + width))
        transform = damped_transform(values, field.t, wanted, sigma)
        largest = np.maximum(largest, np.abs(transform).max(axis=1))
        here = (low <= columns) & (columns < low + width)
        seen[:, here] = transform[: len(omega), columns[here] - low]
    distance = (origin + steps) * spacing - start
    left_out = truncation(largest[: len(omega)], omega, sigma, damping)
    k, error = wavenumbers(seen, distance, left_out, _FOLDED * largest[len(omega) :].max())
    k[error > _LARGEST_ERROR * np.abs(k)] = np.nan
    level = np.abs(seen)
    del seen  # of a long bar it is large
    if len(steps):
        np.maximum(level, 1e-300, out=level)
        level /= level[:, :1].copy()
        np.log10(level, out=level)
        level *= 20
    return Attenuation(omega, sigma, k, error, distance, level)


def free_stretch(field: Field, block: Block) -> tuple[float, float]:
    """Where the longest stretch of the ring without a source of a block begins, and its length, m.

    A Gaussian source is taken to end six widths from its middle.
    """
    own = [s for s in field.sources if s.field in block.fields]
    ends = sorted((s.position - 6 * s.width, s.position + 6 * s.width) for s in own)
    best, stretch = ends[-1][1], 0.0
    # One that stands out over the ring's end reaches in from its other side.
    reach = max(ends[0][1], max(high for _, high in ends) - field.bar.length)
    following = [*ends[1:], (ends[0][0] + field.bar.length, 0.0)]
    for low, high in following:
        if low - reach > stretch:
            best, stretch = reach, low - reach
        reach = max(reach, high)
    return best, stretch
