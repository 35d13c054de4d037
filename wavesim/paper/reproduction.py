"""The paper reproduced: its figures, and its claims judged, as a page and as JSON."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.paper import figures as paperfigures
from wavesim.paper.claims import CLOSURES, Claim, judge
from wavesim.paper.statements import Study
from wavesim.planewave.gap_map import family_gaps

SOURCE = (
    "Yu, P.; Liu, Y.; Shi, M.; Chen, Z. *Propagation Characteristics of Rotation Waves in "
    "Transversely Isotropic Granular Media Considering Microstructure Effect.* Appl. Sci. 2022, "
    "12(12), 6129, [doi:10.3390/app12126129](https://doi.org/10.3390/app12126129)"
)
GAPS = ROTATION.all_gaps


def gap_rows() -> list[dict[str, Any]]:
    """Gap edges in ω̄ at η = 0.5 for a = 0, 0.5 and 1, by closure."""
    rows = []
    values = np.array([0.0, 0.5, 1.0])
    for closure in CLOSURES:
        family = Medium(anisotropy=values, closure=closure)
        lower, upper = family_gaps(family)
        for i, a in enumerate(values):
            scale = float(family.time_scale)
            edges = {
                name: [float(lower[name][i]) * scale, float(upper[name][i]) * scale]
                for name in GAPS
            }
            rows.append({"a": float(a), "closure": closure, "edges": edges})
    return rows


def figures() -> dict[str, tuple[str, Figure]]:
    """All figures of the page: file name → caption, figure."""
    studies: dict[str, Study] = {closure: Study(closure) for closure in CLOSURES}
    drawn: dict[str, tuple[str, Figure]] = {}
    for sector, part in (
        ("longitudinal", "a–c, longitudinal waves"),
        ("transverse2", "d–f, transverse waves"),
        ("inplane", "g–i, in-plane shear waves"),
    ):
        drawn[f"figure3_{sector.removesuffix('2')}.png"] = (
            f"Figure 3 {part}: dispersion for five values of a, η = 0.5, by closure.",
            paperfigures.dispersion_figure(studies, sector),
        )
    drawn["figure4_gaps.png"] = (
        "Figure 4: the gaps, η = 0.5, for a = 0, where the closures coincide, and for a = 0.5. "
        "Hatched: no wave of any kind.",
        paperfigures.gap_figure(),
    )
    drawn["figure5_stiffness_ratio.png"] = (
        "Figure 5: gap edges against η, for a = 0 and for a = 0.5.",
        paperfigures.stiffness_ratio_figure(studies),
    )
    drawn["figure6_anisotropy.png"] = (
        "Figure 6: gap edges against a, η = 0.5.",
        paperfigures.anisotropy_figure(studies),
    )
    return drawn


def reproduce(
    out: Path, dpi: int = 160, tell: Callable[[int, int], None] = lambda done, of: None
) -> dict[str, Any]:
    """Write the paper's figures, the page paper.md and the numbers paper.json to a folder.

    Args:
        out: the folder; made if it does not exist.
        dpi: resolution of the figures, dots per inch.
        tell: called with the parts done, and all there are.

    Returns:
        What paper.json holds: {"source", "figures": {file: caption}, "gaps": [...], "claims":
        [{"number", "claim", "verdicts": {closure: "holds" | "in part" | "fails"}, "statements":
        {closure: [{"text", "values", "holds"}]}}]}.

    Raises:
        OSError: the folder can't be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    captions = {}
    drawn = figures()
    for number, (name, (caption, figure)) in enumerate(drawn.items()):
        tell(number, len(drawn) + 1)
        figure.savefig(out / name, dpi=dpi)
        captions[name] = caption
    tell(len(drawn), len(drawn) + 1)
    claims, gaps = judge(), gap_rows()
    (out / "paper.md").write_text(page(captions, claims, gaps), encoding="utf-8")
    result = {
        "source": SOURCE,
        "figures": captions,
        "gaps": gaps,
        "claims": [
            {
                "number": claim.number,
                "claim": claim.text,
                "verdicts": {closure: claim.verdict(closure) for closure in CLOSURES},
                "statements": {
                    closure: [dataclasses.asdict(statement) for statement in found]
                    for closure, found in claim.statements.items()
                },
            }
            for claim in claims
        ],
    }
    text = json.dumps(result, indent=1, ensure_ascii=False)
    (out / "paper.json").write_text(text + "\n", encoding="utf-8")
    return result


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
