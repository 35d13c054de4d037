"""The spectral solver: plane waves exp(i(kx − ωt)) in an unbounded medium.

With φ = Φ e^{i(kx−ωt)} and B = i b e^{i(kx−ωt)} a block of the wave equations becomes the real
eigenvalue problem ω² v = K(k) v,

    K(k) = |  k² c_pp      −k c_pb    |,      v = (Φ, b).
           | −k c_bp     c_bb + k² γ  |

It knows no grid: it shares the medium with the time domain and nothing else. Everything is in SI
at the boundary of this module: k in rad/m, ω in rad/s.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.medium import Medium
from wavesim.sectors import BLOCKS, SECTORS, Block, BlockForm, block_form, blocks_of

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

_GAP_NAMES = {"longitudinal": "RLB", "transverse2": "RTB", "transverse3": "RTB"}


class NotHyperbolicError(ValueError):
    """Some ω(k) of the medium is not real: its waves grow without bound.

    Attributes:
        k: wavenumber of the fastest growth found, rad/m.
        growth_rate: Im ω there, 1/s.
        sector: the sector it was found in.
    """

    def __init__(self, sector: str, k: float, growth_rate: float, medium: Medium) -> None:
        self.sector, self.k, self.growth_rate = sector, k, growth_rate
        super().__init__(
            f"anisotropy = {medium.anisotropy:g} with stiffness_ratio = "
            f"{medium.stiffness_ratio:g}: the {sector} waves of closure {medium.closure!r} are "
            f"unstable: at k = {k:.4g} rad/m they grow as exp({growth_rate:.3g}/s · t); bring "
            "the two nearer to 0 ≤ a ≤ 1, 0 ≤ η ≤ 1, or take closure 'consistent'"
        )


@dataclass(frozen=True)
class Gap:
    """A band gap.

    Attributes:
        name: RLB1, RLB2, RTB1, RTB2 or RSB.
        sector: longitudinal, transverse2, transverse3 or inplane.
        lower, upper: edges, rad/s; equal where the gap is closed.
    """

    name: str
    sector: str
    lower: float
    upper: float


def _stiffness(form: BlockForm, k: Float) -> Float:
    """K(k) of one block, scaled; k of shape (n,), result (n, fields, fields)."""
    rotations = np.asarray(form.c_pp).shape[0]
    size = rotations + np.asarray(form.c_bb).shape[0]
    stiffness = np.zeros((*k.shape, size, size))
    square = (k**2)[..., None, None]
    stiffness[..., :rotations, :rotations] = square * form.c_pp
    stiffness[..., :rotations, rotations:] = -k[..., None, None] * form.c_pb
    stiffness[..., rotations:, :rotations] = -k[..., None, None] * form.c_bp
    stiffness[..., rotations:, rotations:] = form.c_bb + square * form.gamma
    return stiffness


def _eigenvalues(matrix: Float) -> Complex:
    """Eigenvalues, ascending by real part; exactly real where the matrix is symmetric."""
    if np.allclose(matrix, matrix.swapaxes(-1, -2), rtol=1e-13, atol=0):
        return np.linalg.eigvalsh(matrix).astype(complex)
    values = np.linalg.eigvals(matrix).astype(complex)
    return np.take_along_axis(values, np.argsort(values.real, axis=-1), axis=-1)


def _frequencies(form: BlockForm, k: Float, block: Block, medium: Medium) -> Float:
    """Scaled ω(k), ascending; raises where one is not real."""
    squares = _eigenvalues(_stiffness(form, k))
    size = np.abs(squares).max(axis=-1, keepdims=True)
    growth = np.abs(np.sqrt(squares).imag)
    growth[np.abs(squares.imag) + np.maximum(-squares.real, 0) < 1e-11 * size] = 0
    if growth.any():
        worst = np.unravel_index(np.argmax(growth), growth.shape)
        raise NotHyperbolicError(
            block.sector,
            float(k[worst[0]] / medium.length_scale),
            float(growth[worst] / medium.time_scale),
            medium,
        )
    return np.sqrt(np.maximum(squares.real, 0.0))


def block_frequencies(medium: Medium, block: Block, k: ArrayLike) -> Float:
    """ω(k) of one block, branches ascending.

    Args:
        medium: the medium.
        block: one of ``wavesim.sectors.BLOCKS``.
        k: wavenumbers, shape (n,), rad/m.

    Returns:
        Angular frequencies, shape (n, branches of the block), rad/s.

    Raises:
        NotHyperbolicError: an ω(k) is not real.
    """
    scaled = np.atleast_1d(np.asarray(k, dtype=float)) * medium.length_scale
    return _frequencies(block_form(medium, block), scaled, block, medium) / medium.time_scale


def frequencies(medium: Medium, sector: str, k: ArrayLike) -> Float:
    """ω(k) of one sector, branches ascending at each k.

    Args:
        medium: the medium.
        sector: longitudinal, transverse2, transverse3 or inplane.
        k: wavenumbers, shape (n,), rad/m.

    Returns:
        Angular frequencies, shape (n, 3), rad/s.

    Raises:
        NotHyperbolicError: an ω(k) is not real.
        ValueError: no sector has that name.
    """
    parts = [block_frequencies(medium, block, k) for block in blocks_of(sector)]
    return np.sort(np.concatenate(parts, axis=1), axis=1)


def cutoffs(medium: Medium, sector: str) -> Float:
    """Optical cutoffs ω(k = 0): √ of the eigenvalues of c_bb. Ascending, rad/s."""
    squares = [_eigenvalues(block_form(medium, block).c_bb).real for block in blocks_of(sector)]
    return np.sort(np.sqrt(np.maximum(np.concatenate(squares), 0))) / medium.time_scale


def asymptotes(medium: Medium, sector: str) -> Float:
    """Frequencies that branches tend to as k → ∞ with Γ → 0: D(ω²) = 0 (docs/physics.md).

    They are √ of the eigenvalues of c_bb − c_bp c_pp⁻¹ c_pb. Ascending, rad/s.
    """
    squares = []
    for block in blocks_of(sector):
        form = block_form(medium, block)
        rest = form.c_bb
        if block.rotations:
            rest = rest - form.c_bp @ np.linalg.solve(form.c_pp, form.c_pb)
        squares.append(_eigenvalues(rest).real)
    return np.sort(np.sqrt(np.maximum(np.concatenate(squares), 0))) / medium.time_scale


def gaps(medium: Medium, sector: str) -> list[Gap]:
    """Band gaps of one sector, in the limit Γ → 0.

    A gap of the longitudinal and transverse sectors runs from the asymptote of the branch below
    to the cutoff of the branch above; RSB lies between the two frequencies of the in-plane
    waves. The gradient term Γ, 1e-12 of the rest with Table 1, would let the branch below rise
    on at wavelengths far under the particle size; the gap is meant, as in the paper, without it.

    Returns:
        One gap for each pair of neighbours; a closed gap has upper = lower.
    """
    upper = cutoffs(medium, sector)
    if sector == "inplane":
        return [Gap("RSB", sector, float(upper[0]), float(upper[-1]))]
    lower = asymptotes(medium, sector)
    return [
        Gap(f"{_GAP_NAMES[sector]}{i + 1}", sector, float(low), float(max(low, high)))
        for i, (low, high) in enumerate(zip(lower, upper, strict=True))
    ]


def full_gaps(medium: Medium) -> list[tuple[float, float]]:
    """Frequency intervals in which no wave of any sector propagates, rad/s, ascending.

    The in-plane waves have (nearly) one frequency each; where one falls into such an interval
    it divides it.
    """
    stops = [[(gap.lower, gap.upper) for gap in gaps(medium, s)] for s in SECTORS if s != "inplane"]
    common = stops[0]
    for other in stops[1:]:
        common = [(max(a, c), min(b, d)) for a, b in common for c, d in other]
    lines = cutoffs(medium, "inplane")
    free = []
    for low, high in common:
        marks = [low, *(w for w in lines if low < w < high), high]
        free += [(float(a), float(b)) for a, b in itertools.pairwise(marks)]
    tiny = 1e-12 * float(lines[-1])
    return sorted((a, b) for a, b in free if b - a > tiny)


def wavenumber(medium: Medium, sector: str, omega: ArrayLike) -> Complex:
    """k(ω) of the one pair ±k of a sector with rotation, in the limit Γ → 0.

        k² = ω² / D(ω²),    D = c_pp − c_pb (c_bb − ω²)⁻¹ c_bp

    Args:
        medium: the medium.
        sector: longitudinal, transverse2 or transverse3.
        omega: angular frequencies, real or complex, shape (n,), rad/s.

    Returns:
        The root that decays towards +x (Im k > 0) or, where it does not decay, carries energy
        towards +x (k > 0: no branch runs backward), shape (n,), complex, rad/m. ω + i0 is
        meant where ω is real; in a gap k is imaginary.

    Raises:
        ValueError: the sector has no rotation, so nothing propagates in it.
    """
    (block, *others) = blocks_of(sector)
    if others or not block.rotations:
        raise ValueError(f"sector {sector!r} has no propagating wave: k(ω) is not defined")
    form = block_form(medium, block)
    scaled = np.atleast_1d(np.asarray(omega, dtype=complex)) * medium.time_scale
    square = scaled**2
    inner = form.c_bb - square[:, None, None] * np.eye(len(form.c_bb))
    stiffness = form.c_pp - form.c_pb @ np.linalg.solve(
        inner, np.broadcast_to(form.c_bp, (len(square), *form.c_bp.shape)).astype(complex)
    )
    k = scaled / np.sqrt(stiffness[:, 0, 0])
    k = np.where(np.abs(k.imag) > 1e-14 * np.abs(k), k * np.sign(k.imag), k)
    return k / medium.length_scale


def check_hyperbolic(medium: Medium) -> None:
    """Look for a real k with an ω that is not real, over k from 0 far into the asymptotes.

    Raises:
        NotHyperbolicError: one was found; it says where, and how fast the wave grows.
    """
    k = np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 1401)]) / medium.length_scale
    for block in BLOCKS:
        block_frequencies(medium, block, k)
