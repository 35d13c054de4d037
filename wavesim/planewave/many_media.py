"""Many media at once: the block coefficients of a family whose parameters are arrays.

Over l²N_p every coefficient of the wave equations, and of Appendix C, is linear in one contact
stiffness and, that factored out, linear in a and in η each:

    g (1 − η)(X₀ + a X₁) + g η (Y₀ + a Y₁)

The four media a, η ∈ {0, 1} therefore determine those of all, and no equation is written twice.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from wavesim.material.family import Block
from wavesim.material.granular import GranularMedium
from wavesim.material.medium import Medium, check_parameter
from wavesim.material.scaling import BlockCoefficients, scales
from wavesim.planewave.eigenproblem import spectral_form

_NAMES = ("c_pp", "c_pb", "c_bp", "c_bb", "gamma")


def _check(medium: Medium) -> None:
    for name in medium.known():
        value = getattr(medium, name)
        if value is not None:
            check_parameter(name, float(np.min(value)))
            check_parameter(name, float(np.max(value)))


def _factors(medium: GranularMedium) -> BlockCoefficients:
    """What each scaled coefficient goes with, apart from a and η."""
    per_contacts = medium.per_contacts
    average, normal, gradient = medium.stiffnesses
    relative = per_contacts * normal
    return BlockCoefficients(
        c_pp=per_contacts * average + relative,
        c_pb=relative,
        c_bp=relative,
        c_bb=relative,
        gamma=per_contacts * medium.branch_length**2 * gradient,
    ).scaled(scales(medium))


def block_forms(medium: Medium, block: Block) -> BlockCoefficients:
    """Scaled coefficients of one block in every medium of a family, each in its own units.

    Args:
        medium: parameters that are numbers or arrays which broadcast to one shape S.
        block: one of its family's blocks.

    Returns:
        Coefficients of shape S + (·, ·).

    Raises:
        ValueError: a parameter is outside its admissible range.
    """
    _check(medium)
    shape = np.broadcast_shapes(*(np.shape(getattr(medium, n)) for n in medium.known()))
    if not isinstance(medium, GranularMedium):
        return _one_by_one(medium, block, shape)
    a, eta = np.asarray(medium.anisotropy, float), np.asarray(medium.stiffness_ratio, float)
    plain: GranularMedium = type(medium)(closure=medium.closure)
    wanted, at_corner = _factors(medium), _factors(plain)
    corners = {
        (i, j): spectral_form(
            dataclasses.replace(plain, anisotropy=float(i), stiffness_ratio=float(j)), block
        )
        for i in (0, 1)
        for j in (0, 1)
    }
    weights = {(i, j): (a if i else 1 - a) * (eta if j else 1 - eta) for i, j in corners}
    made = {}
    for name in _NAMES:
        ratio = getattr(wanted, name) / getattr(at_corner, name)
        ratio = np.broadcast_to(np.asarray(ratio, float), shape)
        made[name] = sum(
            (weight * ratio)[..., None, None] * getattr(corners[corner], name)
            for corner, weight in weights.items()
        )
    return BlockCoefficients(**made)


def _numbers(spread: dict[str, Any], i: tuple[int, ...]) -> dict[str, Any]:
    return {name: float(values[i]) for name, values in spread.items()}


def _one_by_one(medium: Medium, block: Block, shape: tuple[int, ...]) -> BlockCoefficients:
    """The same of a family whose coefficients may depend on its parameters in any way."""
    given = {n: v for n in medium.known() if (v := getattr(medium, n)) is not None}
    spread: dict[str, Any] = {
        n: np.broadcast_to(np.asarray(v, float), shape) for n, v in given.items()
    }
    forms = [
        spectral_form(dataclasses.replace(medium, **_numbers(spread, i)), block)
        for i in np.ndindex(shape)
    ]
    made = {name: np.array([getattr(form, name) for form in forms]) for name in _NAMES}
    return BlockCoefficients(**{n: v.reshape(*shape, *v.shape[1:]) for n, v in made.items()})
