"""Many media at once: the block coefficients of a family whose parameters are arrays.

Over l²N_p every coefficient of the wave equations, and of Appendix C, is linear in one contact
stiffness and, that factored out, linear in a and in η each:

    g (1 − η)(X₀ + a X₁) + g η (Y₀ + a Y₁)

The four media a, η ∈ {0, 1} therefore determine those of all, and no equation is written twice.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator
from typing import Any

import numpy as np

from wavesim.material.family import Block
from wavesim.material.granular_equations import GranularMedium
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, scales
from wavesim.planewave.eigenproblem import spectral_form, stiffness
from wavesim.planewave.hyperbolicity import NotHyperbolicError, check_hyperbolic

# Wavenumbers at which media are looked at for waves that grow, scaled.
_LOOKED_AT = np.concatenate([[0.0], np.geomspace(1e-2, 1e3, 49)])
# Times that a local minimum between them is followed down, by a quarter each.
_ROUNDS = 8
# Media of one kind that are worth looking at together.
_MANY = 20
# What of a matrix of size 1 is rounding.
_ROUNDING = 1e-13
# Media looked at together, for the memory they take.
_TOGETHER = 2000

_NAMES = ("c_pp", "c_pb", "c_bp", "c_bb", "gamma")


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
    """
    shape = _shape(medium)
    medium = medium.part(block)
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


def time_scales(medium: Medium, block: Block) -> np.ndarray:
    """The unit of time of each medium, s, shape S; arguments of :func:`block_forms`."""
    shape, part = _shape(medium), medium.part(block)
    if isinstance(part, GranularMedium):
        return np.broadcast_to(np.asarray(part.time_scale, float), shape)
    return np.array([float(one.time_scale) for one in _each(part, shape)]).reshape(shape)


def _shape(medium: Medium) -> tuple[int, ...]:
    every = [getattr(part, name) for part in medium.parts for name in part.known()]
    return np.broadcast_shapes(*map(np.shape, every))


def _each(medium: Medium, shape: tuple[int, ...]) -> Iterator[Medium]:
    """Media of plain numbers, as those of a family may depend on its parameters in any way."""
    given = {n: v for n in medium.known() if (v := getattr(medium, n)) is not None}
    spread = {n: np.broadcast_to(np.asarray(v, float), shape) for n, v in given.items()}
    for i in np.ndindex(shape):
        one: dict[str, Any] = {name: float(values[i]) for name, values in spread.items()}
        yield dataclasses.replace(medium, **one)


def _one_by_one(medium: Medium, block: Block, shape: tuple[int, ...]) -> BlockCoefficients:
    """Coefficients of each by itself."""
    forms = [spectral_form(one, block) for one in _each(medium, shape)]
    made = {name: np.array([getattr(form, name) for form in forms]) for name in _NAMES}
    return BlockCoefficients(**{n: v.reshape(*shape, *v.shape[1:]) for n, v in made.items()})


def growing(medium: Medium, count: int) -> np.ndarray:
    """Which media of a family have waves that grow; ``check_hyperbolic`` tells of one how fast.

    ω² are complex where the discriminant of the characteristic polynomial is negative, often over
    a very short range of k: its local minima are followed down. They are looked for only where
    they are possible, with closure "printed" and a or η outside 0 to 1, or a gradient that is felt.

    Args:
        medium: parameters that are numbers, or arrays of shape (count,).
        count: of the media.

    Returns:
        Shape (count,).
    """
    found = np.zeros(count, bool)
    if len(medium.parts) > 1:
        return np.any([growing(part, count) for part in medium.parts], axis=0)
    if medium.stable:
        return found
    if not isinstance(medium, GranularMedium):
        return np.array([_unstable(one) for one in _each(medium, (count,))])
    outside = np.broadcast_to(~np.asarray(medium.settled), count)
    for first in range(0, int(outside.sum()), _TOGETHER):
        some = np.flatnonzero(outside)[first : first + _TOGETHER]
        own: dict[str, Any] = {
            name: np.asarray(value)[some]
            for name in medium.known()
            if np.ndim(value := getattr(medium, name))
        }
        part = dataclasses.replace(medium, **own)
        for block in medium.family.blocks:
            form = block_forms(part, block)
            found[some] |= _grows([np.asarray(getattr(form, n)) for n in _NAMES])
    return found


def doubtful(media: tuple[Medium, ...]) -> list[bool]:
    """Of each of some media, whether ``check_hyperbolic`` has to look at it.

    Many of one kind are looked at together, which takes a hundredth of the time.
    """
    try:
        return _doubtful(media)
    except TypeError:  # numbers that jax holds have no hash
        return [not medium.stable for medium in media]


@functools.lru_cache(maxsize=8)
def _doubtful(media: tuple[Medium, ...]) -> list[bool]:
    found = [not medium.stable for medium in media]
    groups: dict[tuple[type[Medium], str], list[int]] = {}
    for number in np.flatnonzero(found):
        medium = media[number]
        if isinstance(medium, GranularMedium):
            groups.setdefault((type(medium), medium.closure), []).append(int(number))
    for alike in groups.values():
        if len(alike) >= _MANY:
            given = [media[number].parameters for number in alike]
            own: dict[str, Any] = {
                name: np.array([float(each[name]) for each in given]) for name in given[0]
            }
            grown = growing(dataclasses.replace(media[alike[0]], **own), len(alike))
            for at, grows in zip(alike, grown, strict=True):
                found[at] = bool(grows)
    return found


def _unstable(medium: Medium) -> bool:
    try:
        check_hyperbolic(medium)
    except NotHyperbolicError:
        return True
    return False


def _grows(form: list[np.ndarray]) -> np.ndarray:
    """Whether a block has complex or negative ω², by media; coefficients (media, ·, ·) each."""

    def reality(which: np.ndarray, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        own = (part[which][:, None] for part in form)
        return _reality(stiffness(BlockCoefficients(*own), k))

    media = np.arange(len(form[0]))
    disc, least = reality(media, _LOOKED_AT)
    found: np.ndarray = np.any((disc < -_ROUNDING) | (least < -_ROUNDING), axis=1)
    inner = disc[:, 1:-1]
    member, place = np.nonzero((inner <= disc[:, :-2]) & (inner <= disc[:, 2:]) & ~found[:, None])
    low, high = _LOOKED_AT[place], _LOOKED_AT[place + 2]
    for _ in range(_ROUNDS):
        k = np.linspace(low, high, 9, axis=1)
        values, _ = reality(member, k)
        at, rows = np.argmin(values, axis=1), np.arange(len(member))
        found[member[values[rows, at] < -_ROUNDING]] = True
        low, high = k[rows, np.maximum(at - 1, 0)], k[rows, np.minimum(at + 1, 8)]
    return found


def _reality(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of matrices (..., m, m), m ≤ 3, of size 1: the discriminant of the characteristic polynomial,
    negative where an eigenvalue is complex, and its least coefficient up to its sign, negative
    where a real one is."""
    scale = np.abs(matrices).max(axis=(-2, -1))[..., None, None]
    m = matrices / np.where(scale > 0, scale, 1.0)
    trace, last = np.trace(m, axis1=-2, axis2=-1), np.linalg.det(m)
    if m.shape[-1] == 1:
        return np.ones_like(trace), trace
    if m.shape[-1] == 2:
        return trace**2 - 4 * last, np.minimum(trace, last)
    second = (trace**2 - np.einsum("...ij,...ji->...", m, m)) / 2
    b, c, d = -trace, second, -last
    disc = 18 * b * c * d - 4 * b**3 * d + b**2 * c**2 - 4 * c**3 - 27 * d**2
    return disc, np.minimum(np.minimum(trace, second), last)
