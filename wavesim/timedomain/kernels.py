"""The propagators C, S and LS of a uniform bar over one step, as kernels and as dense matrices.

Within a step h nothing travels further than about c_∞h, so C = cos(h√−L) couples a cell only to
the r cells on either side, to rounding; on a uniform bar it is the same for every cell. Cut into
runs of b cells, C is one dense matrix that takes b + 2r cells to b, and C q a product of that
matrix with all runs at once. The kernels are inverse Fourier transforms of Chebyshev sums of the
operator's symbol; no eigenvectors are needed, so every closure will do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.fft import next_fast_len

from wavesim.grid.stencils import modified_wavenumber
from wavesim.material.scaling import BlockCoefficients
from wavesim.timedomain.timestep import (
    SHORTEST_RUN,
    chebyshev_series,
    cosine,
    reach_within,
    series_degree,
    sine,
)

# A kernel ends where it falls below this part of its largest entry, for each radian of the fastest
# mode in a step (cos(h√λ) is known no better than its argument), and stays there for some cells.
_NEGLIGIBLE = 1e-16
_STAYS = 4


def symbol(form: BlockCoefficients, phase: np.ndarray, spacing: float, order: int) -> np.ndarray:
    """L acting on exp(i j phase) over grid indices j, nodes and half-nodes counted alike.

    Args:
        form: scaled coefficients of a block.
        phase: k h, shape (n,), rad.
        spacing: h, scaled.
        order: of the staggered differences.

    Returns:
        Shape (n, fields, fields), complex.
    """
    k = modified_wavenumber(phase / spacing, spacing, order)
    ahead = 1j * k * np.exp(0.5j * phase)
    back = 1j * k * np.exp(-0.5j * phase)
    p, size = len(form.c_pp), len(form.c_pp) + len(form.c_bb)
    matrix = np.zeros((len(k), size, size), dtype=complex)
    matrix[:, :p, :p] = -(k**2)[:, None, None] * form.c_pp
    matrix[:, :p, p:] = -back[:, None, None] * form.c_pb
    matrix[:, p:, :p] = ahead[:, None, None] * form.c_bp
    matrix[:, p:, p:] = -form.c_bb - (k**2)[:, None, None] * form.gamma
    return matrix


def kernels(
    form: BlockCoefficients, spacing: float, order: int, step: float, bound: float
) -> np.ndarray:
    """C, S and LS over one step as convolution kernels on an endless grid.

    Args:
        form: scaled coefficients of a block.
        spacing, order: of the grid, scaled.
        step: h, scaled.
        bound: spectral bound Λ of this block.

    Returns:
        Shape (3, fields, fields, 2r + 1): entry n of the last axis is the effect of a cell on the
        one n − r after it.
    """
    degree = series_degree(step, bound)
    series = [
        chebyshev_series(lambda e: cosine(step, e), bound, degree),
        chebyshev_series(lambda e: sine(step, e), bound, degree),
        chebyshev_series(lambda e: -e * sine(step, e), bound, degree),
    ]
    least = negligible(step, bound)
    speed = math.sqrt(np.max(form.c_pp, initial=0.0)) / spacing
    front = math.ceil(speed * step)
    ring = next_fast_len(4 * reach_within(step, speed))
    kernel = _ring_kernel(form, spacing, order, bound, np.array(series), ring)
    size = np.abs(kernel).max(axis=(1, 2)) / np.abs(kernel).max(axis=(1, 2, 3))[:, None]
    size = np.maximum(size, size[:, -np.arange(ring)]).max(axis=0)
    # Ahead of the front the kernel falls faster than any power: it ends where it first stays
    # negligible. What stands further out is rounding.
    stays = np.lib.stride_tricks.sliding_window_view(size[front + 1 : ring // 2], _STAYS).max(
        axis=1
    )
    reach = front + int(np.argmax(stays <= least))
    made = np.take(kernel, np.arange(-reach, reach + 1), axis=-1)
    # Nothing holds back a mean rotation: n steps would make n² of what rounding does to it.
    p = len(form.c_pp)
    mean = np.multiply.outer([1.0, step, 0.0], np.eye(p, made.shape[2]))
    made[:, :p, :, reach] += mean - made[:, :p].sum(axis=-1)
    return np.asarray(made)


def negligible(step: float, bound: float) -> float:
    """The part of a kernel's largest entry that is rounding, for a step h and bound Λ."""
    return _NEGLIGIBLE * max(4.0, step * math.sqrt(bound))


def _ring_kernel(
    form: BlockCoefficients, spacing: float, order: int, bound: float, series: np.ndarray, ring: int
) -> np.ndarray:
    """Kernels on a ring of so many cells, by Chebyshev sums of the symbol."""
    phase = 2 * np.pi * np.fft.fftfreq(ring)
    L = symbol(form, phase, spacing, order)
    X = np.eye(L.shape[-1]) + 2 / bound * L
    before, now = np.broadcast_to(np.eye(L.shape[-1]), L.shape).astype(complex), X
    total = series[:, 0, None, None, None] * before + series[:, 1, None, None, None] * now
    for k in range(2, series.shape[1]):
        before, now = now, 2 * X @ now - before
        total = total + series[:, k, None, None, None] * now
    return np.asarray(np.fft.ifft(total, axis=1).real.transpose(0, 2, 3, 1))


class Convolution(eqx.Module):
    """Kernels of a group's blocks, as dense matrices from b + 2r cells to b.

    Attributes:
        cosine: of C, shape (blocks, fields (b + 2r), fields b).
        start: of C, S and LS side by side, shape (blocks, fields (b + 2r), 3 fields b).
        cells: N.
        run: b.
        reach: r.
        fluxes: None in double precision; in single the number of rotations (``single.py``).
    """

    cosine: jax.Array
    start: jax.Array
    cells: int = eqx.field(static=True)
    run: int = eqx.field(static=True)
    reach: int = eqx.field(static=True)
    fluxes: int | None = eqx.field(static=True, default=None)

    def apply(self, matrix: jax.Array, components: Sequence[jax.Array]) -> list[jax.Array]:
        """One of the matrices, in its precision, on components of shape (tracks, blocks, N).

        Returns:
            As many components as the matrix has columns for, of the same shape.
        """
        fields = jnp.stack(components, axis=2).astype(matrix.dtype)
        tracks, blocks, count, cells = fields.shape
        runs = -(-cells // self.run)
        padded = jnp.concatenate(
            [fields[..., cells - self.reach :], fields, fields[..., : self.reach + self.run]],
            axis=-1,
        )
        width = self.run + 2 * self.reach
        at = np.arange(runs)[:, None] * self.run + np.arange(width)
        windows = padded[..., np.minimum(at, padded.shape[-1] - 1)]
        rows = windows.transpose(1, 0, 3, 2, 4).reshape(blocks, tracks * runs, count * width)
        result = (rows @ matrix).reshape(blocks, tracks, runs, -1, self.run)
        result = result.transpose(3, 1, 0, 2, 4).reshape(-1, tracks, blocks, runs * self.run)
        return list(result[..., :cells])


def convolution(of_blocks: Sequence[np.ndarray], cells: int) -> Convolution:
    """Lay kernels out as dense matrices.

    Args:
        of_blocks: for each block of a group, its :func:`kernels`.
        cells: N.

    Raises:
        ValueError: they reach round the bar.
    """
    reach = max((kernel.shape[-1] - 1) // 2 for kernel in of_blocks)
    run = run_length(reach)
    check_reach(reach, 2 * reach + run, cells)
    start = [dense(kernel, run, reach) for kernel in of_blocks]
    matrices = np.stack(start)
    columns = matrices.shape[-1] // 3
    return Convolution(
        jnp.asarray(matrices[..., :columns]), jnp.asarray(matrices), cells, run, reach
    )


def check_reach(reach: int, width: int, cells: int) -> None:
    """Raise a ValueError where what is to be laid out on a ring is wider than it."""
    if width > cells:
        raise ValueError(
            f"a step reaches {reach} cells either way, too far for a bar of {cells}: take a "
            "shorter step or solver 'chebyshev'"
        )


def dense(kernel: np.ndarray, run: int, reach: int) -> np.ndarray:
    """A kernel as the matrix from b + 2r cells to b.

    Args:
        kernel: of a block, shape (functions, fields, fields, 2r′ + 1), r′ ≤ r.
        run: b.
        reach: r.

    Returns:
        Shape (fields (b + 2r), functions fields b).
    """
    functions, fields, _, length = kernel.shape
    width, own = run + 2 * reach, (length - 1) // 2
    # Cell p of a window stands p − r from the start of its run; cell m of the run takes it with
    # the kernel's entry at distance m + r − p.
    entry = np.arange(run)[None, :] + reach - np.arange(width)[:, None]
    made = np.where(np.abs(entry) <= own, kernel[..., np.clip(entry + own, 0, 2 * own)], 0.0)
    # (function, row field i, column field j, p, m) → rows (j, p), columns (function, i, m).
    made = made.transpose(2, 3, 0, 1, 4)
    return made.reshape(fields * width, functions * fields * run)


def run_length(reach: int, shortest: int = SHORTEST_RUN) -> int:
    """b for a reach r, and not less than so many."""
    return max(shortest, math.ceil(0.75 * reach / 16) * 16)


def convolve(parts: Sequence[Convolution], state: Any) -> Any:
    """C on a whole state.

    Args:
        parts: the convolution of each group.
        state: groups of components of shape (tracks, blocks, N).

    Returns:
        A state of the same shapes.
    """
    pairs = zip(parts, state, strict=True)
    return tuple(tuple(part.apply(part.cosine, group)) for part, group in pairs)


def convolve_all(parts: Sequence[Convolution], state: Any) -> tuple[Any, Any, Any]:
    """C, S and LS on a whole state; arguments as for :func:`convolve`."""
    made: tuple[list[Any], list[Any], list[Any]] = ([], [], [])
    for part, group in zip(parts, state, strict=True):
        components = part.apply(part.start, group)
        for number, whole in enumerate(made):
            whole.append(tuple(components[number * len(group) : (number + 1) * len(group)]))
    return tuple(made[0]), tuple(made[1]), tuple(made[2])
