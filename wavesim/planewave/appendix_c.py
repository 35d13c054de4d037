"""Closure "appendix_c": the dispersion coefficients of Appendix C as the paper prints them.

The determinants of Eqs. (51)–(54) hold the unknowns φ₁, B̄ = tr B/3, B_D = B₁₁ − B̄; φ₂, B₍₁₂₎,
B₍[21]₎ = (B₂₁ − B₁₂)/2, the sign of the skew part for which T₁₃, T₂₃, T₃₁ are positive as
printed; B₍₂₃₎ and B₂₂ − B₃₃; B₍[23]₎. With B = Z z, z those unknowns, a determinant is that of
Zᵀ K Z, so that K follows. The printed coefficients are no wave equations: this closure is
spectral only.

Its factors are kept as printed, but for T33, which prints without the l²/4 that its unit asks for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, scales


@dataclass(frozen=True)
class Coefficient:
    """One printed coefficient: factor · (c₁ q₁ + c₂ q₂ + c₃ q₁ a + c₄ q₂ a).

    Attributes:
        family: which stiffnesses q₁, q₂ are: "b+p", "p" or "w".
        factors: c₁, c₂, c₃, c₄.
        factor: the fraction before the bracket.
    """

    family: Literal["b+p", "p", "w"]
    factors: tuple[float, float, float, float]
    factor: float = 1.0

    def value(self, medium: Medium) -> Any:
        """The coefficient in a medium over l²N_p, N·m; a "w" one with its l², N·m³."""
        a = medium.anisotropy
        first, second = contact_stiffness(medium, self.family)
        c1, c2, c3, c4 = self.factors
        length = medium.branch_length**2 if self.family == "w" else 1.0
        bracket = c1 * first + c2 * second + (c3 * first + c4 * second) * a
        return length * self.factor * bracket


def contact_stiffness(medium: Medium, family: str) -> tuple[Any, Any]:
    """The shorthand of Appendix B: b₁ + p₁, b₂ + p₂; p₁, p₂; or w₁, w₂, in N·m."""
    eta = medium.stiffness_ratio
    if family == "w":
        return medium.G_n_g * (1 + 8 * eta) / 945, medium.G_n_g * (1 - eta) / 945
    normal = medium.G_n_r + (medium.G_n_a if family == "b+p" else 0.0)
    return normal * (1 + 6 * eta) / 105, normal * (1 - eta) / 105


# Names with a final "0" are the primed coefficients: the parts that do not go with k².
PRINTED: dict[str, Coefficient] = {
    "L11": Coefficient("b+p", (5, 16, 2, 10)),
    "L12": Coefficient("p", (5, 30, 2, 12)),
    "L13": Coefficient("p", (5, 9, 2, 9)),
    "L21": Coefficient("p", (5, 30, 6, 8)),
    "L22": Coefficient("w", (35, 280, 14, 112), 1 / 4),
    "L23": Coefficient("w", (14, 112, 11, 88), 1 / 4),
    "L31": Coefficient("p", (5, 9, 4, 7)),
    "L33": Coefficient("w", (49, 149, 25, 119), 1 / 8),
    "L220": Coefficient("p", (15, 90, 0, 0)),
    "L230": Coefficient("p", (0, 0, 6, 15)),
    "L330": Coefficient("p", (15, 27, 6, 6), 1 / 2),
    "T11": Coefficient("b+p", (5, 2, 2, -1)),
    "T12": Coefficient("p", (5, 9, 2, 0)),
    "T13": Coefficient("p", (5, -5, 2, -2)),
    "T21": Coefficient("p", (5, 9, 1, 1)),
    "T22": Coefficient("w", (28, 80, 13, 23), 1 / 4),
    "T23": Coefficient("w", (14, -14, 11, -11), 1 / 4),
    "T31": Coefficient("p", (5, -5, 1, -1)),
    "T33": Coefficient("w", (28, -28, 13, -13), 1 / 4),
    "T220": Coefficient("p", (10, 18, 2, 2)),
    "T330": Coefficient("p", (10, -10, 2, -2)),
    "S11": Coefficient("w", (7, 11, 1, -3), 1 / 4),
    "S110": Coefficient("p", (5, 9, -2, -2)),
    "S22": Coefficient("w", (7, -7, 1, -1), 1 / 4),
    "S220": Coefficient("p", (5, -5, -2, 2)),
}

# Columns: the block's orthonormal micro-curvatures for a unit of each unknown of the determinant.
_ROOT2 = math.sqrt(2)
UNKNOWNS: dict[str, np.ndarray] = {
    "longitudinal": np.array([[1.0, 1.0], [_ROOT2, -1 / _ROOT2]]),
    "transverse2": np.array([[1.0, 1.0], [1.0, -1.0]]),
    "transverse3": np.array([[1.0, 1.0], [1.0, -1.0]]),
    "inplane[23]": np.eye(1),
    "inplane(23)": np.eye(1),
    "inplane(22-33)": np.eye(1),
}


@dataclass(frozen=True)
class Determinant:
    """Names of the coefficients of one block's determinant, "" for a zero.

    Attributes:
        phi: of φ in the φ row, or "" where the block holds no rotation.
        row, column: coupling of the φ row to the unknowns, and back.
        square, constant: parts with k² and without, between the unknowns.
    """

    phi: str
    row: tuple[str, ...]
    column: tuple[str, ...]
    square: tuple[tuple[str, ...], ...]
    constant: tuple[tuple[str, ...], ...]


_TRANSVERSE = Determinant(
    "T11",
    ("T12", "T13"),
    ("T21", "T31"),
    (("T22", "T23"), ("T23", "T33")),
    (("T220", ""), ("", "T330")),
)
_SYMMETRIC = Determinant("", (), (), (("S11",),), (("S110",),))
DETERMINANTS: dict[str, Determinant] = {
    "longitudinal": Determinant(
        "L11",
        ("L12", "L13"),
        ("L21", "L31"),
        (("L22", "L23"), ("L23", "L33")),
        (("L220", "L230"), ("L230", "L330")),
    ),
    "transverse2": _TRANSVERSE,
    "transverse3": _TRANSVERSE,
    "inplane[23]": Determinant("", (), (), (("S22",),), (("S220",),)),
    "inplane(23)": _SYMMETRIC,
    "inplane(22-33)": _SYMMETRIC,
}


def printed_coefficients(medium: Medium, block: Block) -> BlockCoefficients:
    """Scaled coefficients of one block by Appendix C, in the medium's own units.

    Args:
        medium: the medium; its closure is not looked at.
        block: one of its family's blocks.

    Returns:
        The coefficients, as ``wavesim.material.scaling.block_coefficients`` gives those of others.
    """

    def matrix(names: Any) -> np.ndarray:
        flat = np.array(names, dtype=object)
        values = [PRINTED[name].value(medium) if name else 0.0 for name in flat.ravel()]
        return np.array(values, dtype=float).reshape(flat.shape)

    printed = DETERMINANTS[block.name]
    back = np.linalg.inv(UNKNOWNS[block.name])
    rotations = len(block.macro)
    per_contacts = medium.branch_length**2 * medium.contact_density
    row = matrix(printed.row).reshape(rotations, len(back))
    column = matrix(printed.column).reshape(len(back), rotations)
    phi = matrix([printed.phi] * rotations).reshape(rotations, rotations)
    return BlockCoefficients(
        c_pp=per_contacts * phi,
        c_pb=per_contacts * (row @ back),
        c_bp=per_contacts * (back.T @ column),
        c_bb=per_contacts * (back.T @ matrix(printed.constant) @ back),
        gamma=per_contacts * (back.T @ matrix(printed.square) @ back),
        i_phi=medium.density * medium.beta,
        i_B=medium.density * medium.gamma,
    ).scaled(scales(medium))
