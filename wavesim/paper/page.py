"""The paper's eight claims, judged for each closure; the Markdown page: figures, gaps, findings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from wavesim.material.rotation_equations import ROTATION, SPECTRAL_CLOSURES
from wavesim.paper import statements
from wavesim.paper.branches_and_gaps import Study
from wavesim.paper.findings import Finding, appendix_c_findings, equation_findings
from wavesim.paper.statements import Statement
from wavesim.planewave.appendix_c import PRINTED

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


def _coefficient_table(found: list[Finding]) -> str:
    return _table(
        ("coefficient", "printed", "by Eqs. (26)–(37)", "by the tensors of Appendix B"),
        [
            (f.name, f.text(f.printed), f.text(f.equations), f.text(f.tensors))
            for f in found
            if not f.agrees
        ],
    )


def _equation_table(found: list[Finding]) -> str:
    return _table(
        ("equation and term", "printed", "by the tensors of Appendix B"),
        [(f.name, f.text(f.printed), f.text(f.tensors)) for f in found if not f.agrees],
    )


def _growth(row: dict[str, Any]) -> str:
    if row["stable"]:
        return ""
    rate, k_bar = row["growth_per_second"], row["k_bar"]
    return f"{rate:.3g} 1/s at k̄ = {k_bar:.3g}, {row['sector']}"


def _stability_table(rows: list[dict[str, Any]]) -> str:
    return _table(
        ("closure", "a", "η", "all ω real", "fastest growth"),
        [
            (
                row["closure"],
                f"{row['a']:g}",
                f"{row['eta']:g}",
                "yes" if row["stable"] else "**no**",
                _growth(row),
            )
            for row in rows
        ],
    )


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

## Findings on the paper

### 1. The relative stiffness in Eqs. (29)–(37) is not the tensor of Appendix B

{equations}

How one sees it. A contact has the stiffness G = (G_n − G_s) n⊗n + G_s I, so that M_ijij = l²N_p
⟨G_ii n_j²⟩: its tangential part G_s weighs a contact by n_j² alone, and under the fabric ⟨n_j²⟩ =
(5 + 2F_jj)/15. The printed diagonal terms carry 5 + 2F_ii + 2F_jj, as if n_i² weighed it too. For
G_s = G_n = G, where p₂ = 0 and p₁ = G/15, M_ijij must be l²N_p G ⟨n_j²⟩ = l²N_p p₁ (5 + 2F_jj): 5
+ 2a for B₁₁, B₂₁, B₃₁ and 5 − a for the other six. Eq. (29) gives 5 + 4a. Eqs. (26)–(28), the
coupling of different components, and every gradient term agree with the tensors.

Consequence: for a ≠ 0 the force of B on φ in (26)–(28) and that of φ on B in (29), (33), (35)
differ. The printed system then has no energy of the form of Eq. (17), and does not follow from
Hamilton's principle.

### 2. Coefficients of Appendix C

Those that differ from the equations, from the tensors, or from both; the other {agreeing} of {all}
agree with both:

{coefficients}

How one sees it. The second row of the longitudinal determinant is the sum of Eqs. (29), (30) and
(31), the third is (29) less half of (30) and of (31), both with B₁₁ = B̄ + B_D and
B₂₂ = B₃₃ = B̄ − B_D/2. For the a-term of L21 the sum is (4p₁ + 8p₂) + 2p₂ = 4p₁ + 10p₂, where
6p₁ + 8p₂ is printed. S11 is the sum of the two gradient terms of (36), which hold −w₂a and no other
w₂a, where −3w₂a is printed. With symmetric equations L21 = L12, L31 = L13, T21 = T12, T31 = T13.

Besides, T33 is printed without the factor l²/4 that T22 and T23 have and that its unit requires.

### 3. Waves that grow

Without symmetry ω² need not be real. A search over 0 ≤ kl ≤ 10⁴ finds

{stability}

so that the printed dispersion coefficients have complex frequencies inside the range 0 ≤ a ≤ 1,
0 ≤ η ≤ 1 that the paper studies, and the printed equations outside it. The tensors of Appendix B
have none anywhere: their energy is a sum of squares.

### 4. Smaller points

- Eq. (1) prints κ as the symmetric part of ∇ϖ. The wave equations follow only with κ_ij = ϖ_i,j:
  the stiffness of φ₂″ in (27), (5 + 2a)(b₁ + p₁) + (2 − a)(b₂ + p₂), is J₂₁₂₁ + M₂₁₂₁ alone.
- Eq. (15) prints K_s^ζ for G_s^ζ.
- β = 2R²/5 and γ = 12R⁴/35 are not the averages that the text defines: over a sphere ⟨y·y⟩ =
  3R²/5 and ⟨(y·y)²⟩ = 3R⁴/7. With these all frequencies would change.
- G_n^g = 1.25e-11 N·m makes the gradient term about 1e-12 of the relative one: no figure shows
  any effect of it.
"""


def page(
    captions: dict[str, str], claims: list[Claim], gaps: list[Any], stability: list[Any]
) -> str:
    """The Markdown page; captions by file name of the figure."""
    coefficients = appendix_c_findings()
    return _PAGE.format(
        source=SOURCE,
        figures="\n\n".join(
            f"![{caption}]({name})\n\n{caption}" for name, caption in captions.items()
        ),
        gaps=_gap_table(gaps),
        claims=_claim_section(claims),
        equations=_equation_table(equation_findings()),
        coefficients=_coefficient_table(coefficients),
        agreeing=sum(finding.agrees for finding in coefficients),
        all=len(PRINTED),
        stability=_stability_table(stability),
    )
