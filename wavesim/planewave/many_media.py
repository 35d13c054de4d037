"""Many media at once: the block coefficients of a family whose parameters are arrays.

Over l²N_p every coefficient of the wave equations, and of Appendix C, is linear in one contact
stiffness and, that factored out, linear in a and in η each:

    G_n (1 − η)(X₀ + a X₁) + G_n η (Y₀ + a Y₁)

The four media a, η ∈ {0, 1} therefore determine those of all, and no equation is written twice.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from wavesim.material.medium import PARAMETERS, Medium, check_parameter
from wavesim.material.scaling import BlockCoefficients, scales
from wavesim.material.sectors import Block
from wavesim.planewave.eigenproblem import spectral_form


def _check(medium: Medium) -> None:
    for name in PARAMETERS:
        value = getattr(medium, name)
        if value is not None:
            check_parameter(name, float(np.min(value)))
            check_parameter(name, float(np.max(value)))


def _factors(medium: Medium) -> BlockCoefficients:
    """What each scaled coefficient goes with, apart from a and η."""
    per_contacts = medium.branch_length**2 * medium.contact_density
    relative = per_contacts * medium.G_n_r
    return BlockCoefficients(
        c_pp=per_contacts * (medium.G_n_a + medium.G_n_r),
        c_pb=relative,
        c_bp=relative,
        c_bb=relative,
        gamma=per_contacts * medium.branch_length**2 * medium.G_n_g,
    ).scaled(scales(medium))


def block_forms(medium: Medium, block: Block) -> BlockCoefficients:
    """Scaled coefficients of one block in every medium of a family, each in its own units.

    Args:
        medium: parameters that are numbers or arrays which broadcast to one shape S.
        block: one of ``wavesim.material.sectors.BLOCKS``.

    Returns:
        Coefficients of shape S + (·, ·).

    Raises:
        ValueError: a parameter is outside its admissible range.
    """
    _check(medium)
    a, eta = np.asarray(medium.anisotropy, float), np.asarray(medium.stiffness_ratio, float)
    wanted, at_corner = _factors(medium), _factors(Medium())
    corners = {
        (i, j): spectral_form(
            dataclasses.replace(
                Medium(), anisotropy=float(i), stiffness_ratio=float(j), closure=medium.closure
            ),
            block,
        )
        for i in (0, 1)
        for j in (0, 1)
    }
    weights = {(i, j): (a if i else 1 - a) * (eta if j else 1 - eta) for i, j in corners}
    shape = np.broadcast_shapes(*(np.shape(getattr(medium, n)) for n in PARAMETERS))
    made = {}
    for name in ("c_pp", "c_pb", "c_bp", "c_bb", "gamma"):
        ratio = getattr(wanted, name) / getattr(at_corner, name)
        ratio = np.broadcast_to(np.asarray(ratio, float), shape)
        made[name] = sum(
            (weight * ratio)[..., None, None] * getattr(corners[corner], name)
            for corner, weight in weights.items()
        )
    return BlockCoefficients(**made)
