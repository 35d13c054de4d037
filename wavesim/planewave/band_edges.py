"""Where bands begin and end, in closed form: cutoffs, asymptotes, gaps, the full gap.

Edges are meant in the limit Γ → 0. With Γ ≠ 0 the branch below a gap rises on from its asymptote
as ω² + k²Γ/m_B, and reaches any frequency at some k; with Table 1 that is at wavelengths of 1e-6
of a particle, where no continuum is meant. ``gradient_share`` says whether that limit is fair.
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.material.layers import Layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients
from wavesim.planewave.eigenproblem import Float, spectral_form

# A gradient term with a share below this is left out.
NEGLIGIBLE = 1e-9


@dataclass(frozen=True)
class Gap:
    """A band gap.

    Attributes:
        name: that of its family, such as RLB1.
        sector: of the waves.
        lower, upper: edges, rad/s; equal where the gap is closed.
    """

    name: str
    sector: str
    lower: float
    upper: float


def _roots(matrix: Any) -> Float:
    """√ of the eigenvalues of (..., b, b), ascending; NaN where one is not real and ≥ 0."""
    values = np.linalg.eigvals(matrix)
    size = np.abs(values).max(axis=-1, keepdims=True)
    real = (np.abs(values.imag) <= 1e-7 * size) & (values.real >= -1e-11 * size)
    squares = np.where(real, np.maximum(values.real, 0.0), np.nan)
    return np.sqrt(np.sort(squares, axis=-1))


def form_cutoffs(form: BlockCoefficients) -> Float:
    """ω(k = 0) of the optical branches: √ of the eigenvalues of c_bb. Shape (..., b), scaled."""
    return _roots(form.c_bb)


def form_asymptotes(form: BlockCoefficients) -> Float:
    """ω(k → ∞): √ of the eigenvalues of c_bb − c_bp c_pp⁻¹ c_pb. Shape (..., b), scaled."""
    if not np.shape(form.c_pp)[-1]:
        return _roots(form.c_bb)
    return _roots(form.c_bb - form.c_bp @ np.linalg.solve(form.c_pp, form.c_pb))


def cutoffs(medium: Medium, sector: str) -> Float:
    """Optical cutoffs ω(k = 0): √ of the eigenvalues of C_BB/m_B. Ascending, rad/s."""
    found = [
        form_cutoffs(spectral_form(medium, block)) for block in medium.family.blocks_of(sector)
    ]
    return np.sort(np.concatenate(found)) / medium.time_scale


def asymptotes(medium: Medium, sector: str) -> Float:
    """Frequencies that branches tend to as k → ∞ with Γ → 0, D(ω²) = 0. Ascending, rad/s.

    They are √ of the eigenvalues of (C_BB − C_Bφ C_φφ⁻¹ C_φB)/m_B.
    """
    found = [
        form_asymptotes(spectral_form(medium, block)) for block in medium.family.blocks_of(sector)
    ]
    return np.sort(np.concatenate(found)) / medium.time_scale


def gaps(medium: Medium, sector: str) -> list[Gap]:
    """Band gaps of one sector, in the limit Γ → 0.

    Where waves travel a gap runs from the asymptote of the branch below to the cutoff of the branch
    above; in a sector of micro-fields alone it lies between the lowest and the highest frequency.

    Returns:
        One gap for each pair of neighbours; a closed gap has upper = lower.
    """
    upper = cutoffs(medium, sector)
    if sector in medium.family.travelling:
        edges = list(zip(asymptotes(medium, sector), upper, strict=True))
    else:
        edges = [(upper[0], upper[-1])]
    return [
        Gap(name, sector, float(low), float(max(low, high)))
        for name, (low, high) in zip(medium.family.gap_names(sector), edges, strict=True)
    ]


def open_gaps(medium: Medium, sector: str) -> list[Gap]:
    """Those of :func:`gaps` that are not closed."""
    return [gap for gap in gaps(medium, sector) if gap.upper > gap.lower]


def full_gaps(medium: Medium, divided: bool = True) -> list[tuple[float, float]]:
    """Frequency intervals in which no wave of any sector propagates, rad/s, ascending.

    Args:
        medium: of one family or several.
        divided: micro-fields alone have (nearly) one frequency each and do not travel; whether one
            that falls into such an interval divides it.
    """
    moving = medium.family.travelling
    stops = [[(gap.lower, gap.upper) for gap in gaps(medium, s)] for s in moving]
    common = stops[0]
    for other in stops[1:]:
        common = [(max(a, c), min(b, d)) for a, b in common for c, d in other]
    still = [cutoffs(medium, s) for s in medium.family.sectors if s not in moving]
    lines = np.concatenate([*still, np.zeros(0)]) if divided else np.zeros(0)
    free = []
    for low, high in common:
        marks = [low, *(w for w in lines if low < w < high), high]
        free += [(float(a), float(b)) for a, b in itertools.pairwise(marks)]
    tiny = 1e-12 * max((b for _, b in common), default=0.0)
    return sorted((a, b) for a, b in free if b - a > tiny)


def gradient_share(medium: Medium) -> float:
    """Largest part that the gradient term has in ω² of a standing micro-field at k̄ = 1.

    max (2π/l)² Γ / C_BB over the blocks, –. Gap edges, which neglect Γ, are good to about this.
    """
    try:
        return _share(medium)
    except TypeError:  # numbers that jax holds have no hash
        return _share.__wrapped__(medium)


@functools.lru_cache(maxsize=1000)
def _share(medium: Medium) -> float:
    share = 0.0
    for block in medium.family.blocks:
        form = spectral_form(medium, block)
        gradient = float(np.abs(np.linalg.eigvals(form.gamma)).max()) * (2 * math.pi) ** 2
        if gradient:
            least = float(np.abs(np.linalg.eigvals(form.c_bb)).min())
            share = max(share, gradient / least if least else math.inf)
    return share


def keeps_gradient(layers: Layers, asked: bool | None = None) -> bool:
    """Whether the gradient term is kept in a bar: what is asked, or whether it counts.

    It counts where its share is above 1e-9 in some medium of the bar.
    """
    return (
        asked
        if asked is not None
        else any(gradient_share(medium) > NEGLIGIBLE for medium in layers.media)
    )
