"""The paper's eight claims, each judged for every closure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from wavesim.material.granular_equations import SPECTRAL_CLOSURES
from wavesim.paper import statements
from wavesim.paper.statements import Found, Statement, Study

CLOSURES = SPECTRAL_CLOSURES

_CLAIMS: tuple[tuple[str, Callable[[Study], Iterator[Found]]], ...] = (
    (
        "Twelve waves with eight relations: LA, two LO; TA and two TO, twice; three TSO, two of "
        "them equal",
        statements.twelve_waves,
    ),
    (
        "LA rises fast, then to an asymptote; a matters little for k̄ < 0.1, then raises it",
        statements.acoustic_longitudinal,
    ),
    (
        "LO(B̄) rises slightly, then about linearly, and rises with a; LO(B_D) tends to an "
        "asymptote and falls with a except at long waves",
        statements.optical_longitudinal,
    ),
    (
        "TA and TO(B(12)) behave like LA and LO(B̄) at lower frequencies, less sensitive to a; "
        "TO(B[12]) is nearly flat and rises with a",
        statements.transverse,
    ),
    (
        "The TSO branches do not depend on k̄; all three fall as a grows",
        statements.shear,
    ),
    (
        "RLB1 is wider than RLB2, RTB1 than RTB2; in some range no wave of any kind propagates",
        statements.gaps,
    ),
    (
        "η from 0 to 1: RLB1 and RTB1 widen and move up, RTB1 from width 0 at η = 0, where the "
        "lower TO vanishes; RLB2, RTB2 and RSB shrink to 0",
        statements.stiffness_ratio,
    ),
    (
        "a from 0 to 1: RLB1's lower edge rises, its upper edge rises slightly, then falls; it "
        "closes at a = 1; RLB2 widens; the transverse gaps move up with little change of width; "
        "RSB moves down",
        statements.anisotropy,
    ),
)


@dataclass(frozen=True)
class Claim:
    """One claim, judged for each closure.

    Attributes:
        number: 1 to 8.
        text: the claim.
        statements: by closure.
    """

    number: int
    text: str
    statements: dict[str, list[Statement]]

    def verdict(self, closure: str) -> str:
        """ "holds", "fails", or "in part"."""
        found = [statement.holds for statement in self.statements[closure]]
        return "holds" if all(found) else "in part" if any(found) else "fails"


def judge() -> list[Claim]:
    """The eight claims, judged with measured numbers for every closure."""
    studies = {closure: Study(closure) for closure in CLOSURES}

    def judged(found: Iterator[Found]) -> list[Statement]:
        return [Statement(text, values, bool(holds)) for text, values, holds in found]

    return [
        Claim(number, text, {closure: judged(check(study)) for closure, study in studies.items()})
        for number, (text, check) in enumerate(_CLAIMS, start=1)
    ]
