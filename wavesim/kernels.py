"""The propagators C and S of a uniform bar over one step, as kernels and as dense matrices.

Within a step h nothing travels further than about c_∞h, so C = cos(h√−L) couples a cell only to
the r cells on either side, to rounding; on a uniform bar it is the same for every cell. Cut into
runs of b cells, C is one dense matrix that takes b + 2r cells to b, and C q a product of that
matrix with all runs at once. The kernels are inverse Fourier transforms of Chebyshev sums of the
operator's symbol; no eigenvectors are needed, so every closure will do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.fft import next_fast_len

from wavesim.sectors import BlockForm
from wavesim.stencils import modified_wavenumber
from wavesim.timestep import SHORTEST_RUN, chebyshev_series, cosine, series_degree, sine

# A kernel ends where all that follows is below this part of its largest entry, for each radian of
# the fastest mode in a step: cos(h√λ) is known no better than its argument.
_NEGLIGIBLE = 1e-16
_LONGEST_RING = 8192


def symbol(form: BlockForm, phase: np.ndarray, spacing: float, order: int) -> np.ndarray:
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


def kernels(form: BlockForm, spacing: float, order: int, step: float, bound: float) -> np.ndarray:
    """C and S over one step as convolution kernels on an endless grid.

    Args:
        form: scaled coefficients of a block.
        spacing, order: of the grid, scaled.
        step: h, scaled.
        bound: spectral bound Λ of this block.

    Returns:
        Shape (2, fields, fields, 2r + 1): entry n of the last axis is the effect of a cell on the
        one n − r after it.
    """
    degree = series_degree(step, bound)
    series = [
        chebyshev_series(lambda e: cosine(step, e), bound, degree),
        chebyshev_series(lambda e: sine(step, e), bound, degree),
    ]
    least = _NEGLIGIBLE * max(4.0, step * math.sqrt(bound))
    ring = 64
    while True:
        kernel = _ring_kernel(form, spacing, order, bound, np.array(series), ring)
        size = np.abs(kernel).max(axis=(1, 2)) / np.abs(kernel).max(axis=(1, 2, 3))[:, None]
        distance = np.abs(np.fft.fftfreq(ring, 1 / ring))
        reach = int(distance[(size > least).any(axis=0)].max())
        if reach < 0.4 * ring or ring > _LONGEST_RING:
            return np.asarray(np.take(kernel, np.arange(-reach, reach + 1), axis=-1))
        ring = next_fast_len(2 * ring)


def _ring_kernel(
    form: BlockForm, spacing: float, order: int, bound: float, series: np.ndarray, ring: int
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
    """A kernel on some blocks of a group, as a dense matrix from b + 2r cells to b.

    Attributes:
        cosine, sine: of C and S, shape (fields (b + 2r), fields b).
        blocks: which blocks of the group it acts on.
        cells: N.
        run: b.
        reach: r.
    """

    cosine: jax.Array
    sine: jax.Array
    blocks: tuple[int, ...] = eqx.field(static=True)
    cells: int = eqx.field(static=True)
    run: int = eqx.field(static=True)
    reach: int = eqx.field(static=True)

    def apply(self, matrix: jax.Array, components: Sequence[jax.Array]) -> list[jax.Array]:
        """The matrix on a group's components of shape (tracks, blocks, N), these blocks alone."""
        fields = jnp.stack([c[:, self.blocks, :] for c in components], axis=2)
        tracks, blocks, count, cells = fields.shape
        runs = -(-cells // self.run)
        padded = jnp.concatenate(
            [fields[..., cells - self.reach :], fields, fields[..., : self.reach + self.run]],
            axis=-1,
        )
        width = self.run + 2 * self.reach
        at = np.arange(runs)[:, None] * self.run + np.arange(width)
        windows = padded[..., np.minimum(at, padded.shape[-1] - 1)]
        rows = jnp.moveaxis(windows, 2, 3).reshape(-1, count * width)
        result = (rows @ matrix).reshape(tracks, blocks, runs, count, self.run)
        result = jnp.moveaxis(result, 2, 3).reshape(tracks, blocks, count, -1)[..., :cells]
        return [result[:, :, i] for i in range(count)]


Convolutions = tuple[tuple[Convolution, ...], ...]


def convolution(kernel: np.ndarray, blocks: tuple[int, ...], cells: int) -> Convolution:
    """Lay kernels out as dense matrices.

    Args:
        kernel: of :func:`kernels`.
        blocks: of the group, that they act on.
        cells: N.

    Raises:
        ValueError: they reach round the bar.
    """
    _, fields, _, length = kernel.shape
    reach = (length - 1) // 2
    run = max(SHORTEST_RUN, math.ceil(0.75 * reach / 16) * 16)
    if 2 * reach + run > cells:
        raise ValueError(
            f"a step reaches {reach} cells either way, too far for a bar of {cells}: take a "
            "shorter step or solver 'chebyshev'"
        )
    width = run + 2 * reach
    # Cell p of a window stands p − r from the start of its run; cell m of the run takes it with
    # the kernel's entry at distance m + r − p.
    entry = np.arange(run)[None, :] + reach - np.arange(width)[:, None]
    inside = np.abs(entry) <= reach
    matrices = []
    for part in kernel:
        dense = np.where(inside, part[..., np.clip(entry + reach, 0, 2 * reach)], 0.0)
        # (row field i, column field j, p, m) → rows (j, p), columns (i, m).
        matrices.append(dense.transpose(1, 2, 0, 3).reshape(fields * width, fields * run))
    return Convolution(
        jnp.asarray(matrices[0]), jnp.asarray(matrices[1]), blocks, cells, run, reach
    )


def convolve(parts: Convolutions, which: Literal["cosine", "sine"], state: Any) -> Any:
    """C or S on a whole state.

    Args:
        parts: for each group, the convolutions of its blocks.
        which: "cosine" for C, "sine" for S.
        state: groups of components of shape (tracks, blocks, N).

    Returns:
        A state of the same shapes.
    """
    result = []
    for group, components in zip(parts, state, strict=True):
        made = [part.apply(getattr(part, which), components) for part in group]
        order = np.argsort([block for part in group for block in part.blocks])
        result.append(
            tuple(
                jnp.concatenate([piece[i] for piece in made], axis=1)[:, order]
                for i in range(len(components))
            )
        )
    return tuple(result)
