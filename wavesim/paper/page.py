"""The paper's eight claims, judged for each closure; the Markdown page: figures, gaps, claims."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from wavesim.material.rotation_equations import ROTATION, SPECTRAL_CLOSURES
from wavesim.paper import statements
from wavesim.paper.branches_and_gaps import Study
from wavesim.paper.statements import Statement

CLOSURES = SPECTRAL_CLOSURES

_CLAIMS: tuple[tuple[str, Callable[[Study], list[Statement]]], ...] = (
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
    return [
        Claim(number, text, {closure: check(study) for closure, study in studies.items()})
        for number, (text, check) in enumerate(_CLAIMS, start=1)
    ]


SOURCE = (
    "Yu, P.; Liu, Y.; Shi, M.; Chen, Z. *Propagation Characteristics of Rotation Waves in "
    "Transversely Isotropic Granular Media Considering Microstructure Effect.* Appl. Sci. 2022, "
    "12(12), 6129, [doi:10.3390/app12126129](https://doi.org/10.3390/app12126129)"
)
GAPS = ROTATION.all_gaps


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _gap_table(rows: list[dict[str, Any]]) -> str:
    return _table(
        ("a", "closure", *GAPS),
        [
            (
                f"{row['a']:g}",
                row["closure"],
                *("{:.4f}–{:.4f}".format(*row["edges"][name]) for name in GAPS),
            )
            for row in rows
        ],
    )


def _claim_section(claims: list[Claim]) -> str:
    parts = [
        _table(
            ("", "claim", *CLOSURES),
            [
                (str(claim.number), claim.text, *(claim.verdict(c) for c in CLOSURES))
                for claim in claims
            ],
        )
    ]
    for claim in claims:
        rows = []
        for found in zip(*(claim.statements[c] for c in CLOSURES), strict=True):
            cells = [
                ("yes" if s.holds else "**no**")
                + ": "
                + ", ".join(f"{name} {value:.4g}" for name, value in s.values.items())
                for s in found
            ]
            rows.append((found[0].text, *cells))
        parts.append(f"**Claim {claim.number}.** {claim.text}.\n")
        parts.append(_table(("statement", *CLOSURES), rows))
    return "\n\n".join(parts)


_PAGE = """# The paper reproduced

{source}

Three variants of the paper's system exist, because its equations, its tensors and its dispersion
coefficients differ where a ≠ 0; they coincide at a = 0:

- `printed`: the wave equations (26)–(37) as printed;
- `consistent`: the tensors of Appendix B in every equation; symmetric, conserves energy;
- `appendix_c`: the determinants (51)–(54) with the coefficients of Appendix C as printed.

All numbers are ω̄ = ω √(4πρR⁵/3G_n^a) with Table 1 and η = 0.5 unless said otherwise. Gap edges are
those of the limit Γ → 0: with Table 1 the gradient term is about 1e-12 of the others.

## Figures

{figures}

## Gap edges

{gaps}

## The eight claims

A claim holds where every statement of it does, by the criterion given with it; otherwise it holds
in part.

{claims}

What this shows: that TO(B[12]) rises with a (claim 4), and that the transverse gaps move up with
little change of width (claim 8), rests on the equations as printed. With the paper's own tensors
TO(B[12]) falls, RTB2 widens threefold, and RLB1 stays open at a = 1. That RLB1 closes at a = 1
rests on Appendix C, and there its lower edge turns down again from a = 0.85 on. Claim 7 holds at
a = 0; at a = 0.5 RLB2 does not shrink to 0 in any closure nor, with the paper's tensors, does
RTB2.

What is misprinted in the paper, coefficient by coefficient, stands in docs/physics.md, section 6.
"""


def page(captions: dict[str, str], claims: list[Claim], gaps: list[Any]) -> str:
    """The Markdown page; captions by file name of the figure."""
    return _PAGE.format(
        source=SOURCE,
        figures="\n\n".join(
            f"![{caption}]({name})\n\n{caption}" for name, caption in captions.items()
        ),
        gaps=_gap_table(gaps),
        claims=_claim_section(claims),
    )
