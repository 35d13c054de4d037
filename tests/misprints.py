"""Where the paper's equations and coefficients part from its own tensors, derived, not listed.

Every coefficient is linear in a and in two contact stiffnesses q₁, q₂: p₁, p₂; w₁, w₂; or b₁ + p₁,
b₂ + p₂. Evaluated in a few media, the factor of each of q₁, q₂, q₁ a, q₂ a comes out as a whole
number or a simple fraction, and can be held against what is printed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.material.family import weights
from wavesim.material.granular_equations import ROTATION, Closure
from wavesim.material.medium import Medium
from wavesim.planewave.appendix_c import DETERMINANTS, PRINTED, UNKNOWNS

Factors = tuple[float, float, float, float]


@dataclass(frozen=True)
class Finding:
    """One coefficient, as printed and as the paper's own equations and tensors give it.

    Attributes:
        name: of the coefficient, as in the paper; a final prime marks the constant parts.
        stiffness: names of q₁ and q₂.
        fraction: the factor before the bracket, as text: "", "l²/4", "l²/8" or "1/2".
        printed, equations, tensors: factors of q₁, q₂, q₁ a, q₂ a in the bracket, as printed; by
            Eqs. (26)–(37); by the tensors of Appendix B.
    """

    name: str
    stiffness: tuple[str, str]
    fraction: str
    printed: Factors
    equations: Factors
    tensors: Factors

    @property
    def agrees(self) -> bool:
        """Whether all three are the same."""
        return self.printed == self.equations == self.tensors

    def text(self, factors: Factors) -> str:
        """The coefficient written out with given factors."""
        first, second = self.stiffness
        terms = zip(factors, (first, second, f"{first}a", f"{second}a"), strict=True)
        signed = [
            f"{'+' if factor > 0 else '−'} {'' if abs(factor) == 1 else f'{abs(factor):g}'}{symbol}"
            for factor, symbol in terms
            if factor
        ]
        written = " ".join(signed).removeprefix("+ ") or "0"
        return f"({self.fraction})({written})" if self.fraction else written


def _unit_media(closure: Closure, a: float) -> tuple[Medium, Medium]:
    """Media with q₁ = 1, q₂ = 0 and with q₁ = q₂ = 1, for b, p and w alike."""
    one = Medium(
        anisotropy=a, stiffness_ratio=1.0, G_n_a=15.0, G_n_r=15.0, G_n_g=105.0, closure=closure
    )
    both = Medium(
        anisotropy=a, stiffness_ratio=0.0, G_n_a=105.0, G_n_r=105.0, G_n_g=945.0, closure=closure
    )
    return one, both


def _factors(read: Any, closure: Closure) -> Factors:
    """Factors of q₁, q₂, q₁ a, q₂ a of a coefficient that ``read`` takes from a flux form."""
    values = {}
    for a in (0.0, 1.0):
        one, both = _unit_media(closure, a)
        first, sum_of_both = read(one.flux_form()), read(both.flux_form())
        values[a] = (first, sum_of_both - first)
    constant, change = values[0.0], np.subtract(values[1.0], values[0.0])
    return _rounded((*constant, *change))


def _rounded(values: Any) -> Factors:
    exact = np.round(np.asarray(values, dtype=float), 9) + 0.0
    return tuple(float(value) for value in exact)  # type: ignore[return-value]


_FRACTIONS = {("w", 0.25): "l²/4", ("w", 0.125): "l²/8", ("p", 0.5): "1/2"}
_SYMBOLS = {"p": ("p₁", "p₂"), "w": ("w₁", "w₂"), "b+p": ("(b₁+p₁)", "(b₂+p₂)")}


def _readers(block_name: str) -> dict[str, Any]:
    """How each coefficient of a determinant is read from a flux form, Zᵀ K Z of its blocks."""
    block = next(block for block in ROTATION.blocks if block.name == block_name)
    names, turn = DETERMINANTS[block_name], UNKNOWNS[block_name]
    rotation = weights(block.macro, ROTATION.macro)
    curvature = turn.T @ weights(block.micro, ROTATION.micro)
    length = Medium().branch_length
    readers: dict[str, Any] = {}
    for i, name in enumerate(names.row):
        readers[name] = lambda f, i=i: (rotation @ f.C_phi_B @ curvature.T)[0, i]
        readers[names.column[i]] = lambda f, i=i: (curvature @ f.C_B_phi @ rotation.T)[i, 0]
    if names.phi:
        # C_φφ = J + M with both stiffnesses alike, so that b + p is twice p
        readers[names.phi] = lambda f: (rotation @ f.C_phi_phi @ rotation.T)[0, 0] / 2
    for i in range(len(turn)):
        for j in range(i, len(turn)):
            if names.square[i][j]:
                readers[names.square[i][j]] = lambda f, i=i, j=j: (
                    (curvature @ f.Gamma @ curvature.T)[i, j] / length**2
                )
            if names.constant[i][j]:
                readers[names.constant[i][j]] = lambda f, i=i, j=j: (
                    curvature @ f.C_B_B @ curvature.T
                )[i, j]
    return readers


def appendix_c_findings() -> list[Finding]:
    """Every coefficient of Appendix C held against Eqs. (26)–(37) and against the tensors."""
    found = []
    for block in ("longitudinal", "transverse2", "inplane(23)", "inplane[23]"):
        for name, read in _readers(block).items():
            printed = PRINTED[name]
            scale = 1 / printed.factor
            found.append(
                Finding(
                    name[:3] + "′" if name.endswith("0") else name,
                    _SYMBOLS[printed.family],
                    _FRACTIONS.get((printed.family, printed.factor), ""),
                    _rounded(printed.factors),
                    _rounded(scale * np.array(_factors(read, "printed"))),
                    _rounded(scale * np.array(_factors(read, "consistent"))),
                )
            )
    order = list(PRINTED)
    return sorted(found, key=lambda finding: order.index(finding.name.replace("′", "0")))


def equation_findings() -> list[Finding]:
    """Relative stiffness in Eqs. (29)–(37), as printed against the tensor M_ijkl."""
    found = []
    for number, row in zip(range(29, 38), _EQUATIONS, strict=True):
        for column in ROTATION.micro:
            i, j = ROTATION.micro.index(row), ROTATION.micro.index(column)

            def read(form: Any, i: int = i, j: int = j) -> float:
                return float(form.C_B_B[i, j])

            printed, tensors = _factors(read, "printed"), _factors(read, "consistent")
            if any(printed) or any(tensors):
                name = f"({number}) {column} in the equation of {row}"
                found.append(Finding(name, _SYMBOLS["p"], "", printed, printed, tensors))
    return found


_EQUATIONS = ("B11", "B22", "B33", "B12", "B21", "B13", "B31", "B23", "B32")
