"""The eigenproblem of plane waves, in the scaled form of ``wavesim.material.scaling``.

With φ = Φ e^{i(kx−ωt)} and B = i b e^{i(kx−ωt)} a block of the wave equations becomes the real
eigenvalue problem ω² v = K(k) v,

    K(k) = |  k² c_pp      −k c_pb    |,      v = (Φ, b).
           | −k c_bp     c_bb + k² γ  |

Every function takes coefficients and wavenumbers with any leading axes that broadcast.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, block_coefficients, scales
from wavesim.planewave import appendix_c

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]


def spectral_form(medium: Medium, block: Block) -> BlockCoefficients:
    """Coefficients of a block in the medium's own units, for any closure, "appendix_c" included."""
    if medium.closure == "appendix_c":
        return appendix_c.printed_coefficients(medium, block)
    return block_coefficients(medium, block, scales(medium))


@dataclass(frozen=True)
class Eigenmodes:
    """Solutions of the eigenproblem, ascending in Re ω²; real wherever the system allows it.

    Attributes:
        squares: ω², shape (..., m).
        right: columns v of K v = ω² v, shape (..., m, m).
        left: columns u of uᵀ K = ω² uᵀ, scaled so that uᵀ v = 1; the same as right, each of norm
            one, where K is symmetric.
    """

    squares: Any
    right: Any
    left: Any


def _assemble(pp: Any, pb: Any, bp: Any, bb: Any) -> Float:
    """One matrix from four blocks that broadcast against each other."""
    shape = np.broadcast_shapes(*(block.shape[:-2] for block in (pp, pb, bp, bb)))
    p, size = pp.shape[-1], pp.shape[-1] + bb.shape[-1]
    matrix = np.empty((*shape, size, size), dtype=np.result_type(pp, pb, bp, bb))
    matrix[..., :p, :p], matrix[..., :p, p:] = pp, pb
    matrix[..., p:, :p], matrix[..., p:, p:] = bp, bb
    return matrix


def stiffness(form: BlockCoefficients, k: Any) -> Float:
    """K(k), shape (..., m, m); k of shape (...), scaled."""
    k = np.asarray(k)[..., None, None]
    return _assemble(
        k**2 * form.c_pp, -k * form.c_pb, -k * form.c_bp, form.c_bb + k**2 * form.gamma
    )


def stiffness_slope(form: BlockCoefficients, k: Any) -> Float:
    """dK/dk, shape (..., m, m); k of shape (...), scaled."""
    k = np.asarray(k)[..., None, None]
    one = np.ones_like(k)
    return _assemble(2 * k * form.c_pp, -one * form.c_pb, -one * form.c_bp, 2 * k * form.gamma)


def _equal(one: Float, other: Float) -> bool:
    size = np.abs(one)
    return bool((np.abs(one - other) <= 1e-13 * size + 1e-15 * size.max()).all())


def is_symmetric(form: BlockCoefficients) -> bool:
    """Whether the coefficients are symmetric to rounding, so that an energy is conserved."""
    return all(
        _equal(one, np.swapaxes(other, -1, -2))
        for one, other in (
            (form.c_pp, form.c_pp),
            (form.c_pb, form.c_bp),
            (form.c_bb, form.c_bb),
            (form.gamma, form.gamma),
        )
        if np.size(one)
    )


def _general(matrix: Float) -> Eigenmodes:
    values, right = np.linalg.eig(matrix)
    order = np.argsort(values.real, axis=-1)
    values = np.take_along_axis(values, order, axis=-1)
    right = np.take_along_axis(right, order[..., None, :], axis=-1)
    return Eigenmodes(values, right, np.swapaxes(np.linalg.inv(right), -1, -2))


def _by_symmetrising(form: BlockCoefficients, k: Float) -> Eigenmodes:
    """A block with one macro-field whose couplings there and back differ.

    Once c_bb + k² γ is diagonal, K is an arrow: −k u_i in the row of φ, −k v_i in its column.
    Where every u_i v_i > 0 scaling by √(v_i/u_i) makes it symmetric, so that its ω² are real; the
    other wavenumbers are left to the general eigenproblem.
    """
    square = (k**2)[..., None, None]
    values, turn = np.linalg.eigh(form.c_bb + square * form.gamma)
    to_phi = (form.c_pb @ turn)[..., 0, :]
    from_phi = (np.swapaxes(turn, -1, -2) @ form.c_bp)[..., :, 0]
    product = to_phi * from_phi
    fits = (product > 1e-14 * np.abs(to_phi).max() * np.abs(from_phi).max()).all(axis=-1)
    ratio = np.sqrt(np.where(fits[..., None], from_phi / np.where(to_phi == 0, 1, to_phi), 1.0))
    arrow = _assemble(
        square * form.c_pp,
        -(k[..., None] * to_phi * ratio)[..., None, :],
        -(k[..., None] * to_phi * ratio)[..., :, None],
        values[..., None] * np.eye(values.shape[-1]),
    )
    squares, vectors = np.linalg.eigh(arrow)
    micro = vectors[..., 1:, :]
    right = np.concatenate([vectors[..., :1, :], turn @ (ratio[..., None] * micro)], axis=-2)
    left = np.concatenate([vectors[..., :1, :], turn @ (micro / ratio[..., None])], axis=-2)
    if not fits.all():
        rest = _general(stiffness(form, k[~fits]))
        if np.iscomplexobj(rest.squares):
            squares, right, left = (x.astype(complex) for x in (squares, right, left))
        squares[~fits], right[~fits], left[~fits] = rest.squares, rest.right, rest.left
    return Eigenmodes(squares, right, left)


def solve(form: BlockCoefficients, k: Float) -> Eigenmodes:
    """All plane waves of a block at given wavenumbers.

    ω² is the Rayleigh quotient uᵀ K v of the modes found: for the acoustic branch at long waves
    that is exact relative to ω² itself, where an eigenvalue alone is so only relative to ‖K‖.
    """
    matrix = stiffness(form, k)
    if is_symmetric(form):
        _, vectors = np.linalg.eigh(matrix)
        modes = Eigenmodes(None, vectors, vectors)
    elif np.shape(form.c_pp)[-1] == 1:
        modes = _by_symmetrising(form, k)
    else:
        modes = _general(matrix)
    squares = np.sum(modes.left * (matrix @ modes.right), axis=-2)
    return Eigenmodes(squares, modes.right, modes.left)


def slope(form: BlockCoefficients, k: Float, modes: Eigenmodes) -> Any:
    """d(ω²)/dk = uᵀ (dK/dk) v of each mode, shape (n, m), scaled."""
    return np.sum(modes.left * (stiffness_slope(form, k) @ modes.right), axis=-2)
