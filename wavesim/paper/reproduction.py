"""The paper reproduced: its figures, its claims judged, and findings, as a page and as JSON."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from wavesim.figures import gap_map as surveyfigures
from wavesim.material.medium import Medium
from wavesim.paper import figures as paperfigures
from wavesim.paper.branches_and_gaps import Study
from wavesim.paper.findings import appendix_c_findings, equation_findings
from wavesim.paper.page import CLOSURES, GAPS, SOURCE, judge, page
from wavesim.planewave.gap_map import family_gaps, gap_map
from wavesim.planewave.hyperbolicity import NotHyperbolicError, check_hyperbolic

# Media that are tried for waves that grow: the default closure outside the range that the paper
# studies, and the printed dispersion coefficients inside it.
_TRIED: tuple[tuple[str, float, float], ...] = (
    ("printed", 1.0, 0.5),
    ("printed", 1.0, 1.0),
    ("printed", 2.0, 1.3),
    ("appendix_c", 1.0, 0.5),
    ("appendix_c", 1.0, 0.6),
    ("appendix_c", 1.0, 0.8),
    ("appendix_c", 0.7, 0.8),
)


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


def stability_rows() -> list[dict[str, Any]]:
    """Media of Table 1 with other a and η: whether all ω(k) are real, and if not the growth."""
    rows = []
    for closure, a, eta in _TRIED:
        row: dict[str, Any] = {"closure": closure, "a": a, "eta": eta, "stable": True}
        medium = Medium(anisotropy=a, stiffness_ratio=eta, closure=closure)
        try:
            check_hyperbolic(medium)
        except NotHyperbolicError as error:
            row.update(
                stable=False,
                sector=error.sector,
                k_bar=error.k * medium.length_scale / (2 * np.pi),
                growth_per_second=error.growth_rate,
            )
        rows.append(row)
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
    plane = gap_map(
        Medium(closure="consistent"),
        ("anisotropy", np.linspace(0.0, 1.0, 201)),
        ("stiffness_ratio", np.linspace(0.0, 1.0, 201)),
    )
    drawn["gap_map.png"] = (
        "Beyond the paper: width of each gap over a and η, closure consistent.",
        surveyfigures.gap_map_figure(plane),
    )
    drawn["directions.png"] = (
        "Beyond the paper: slowness and group velocity over the direction of travel, a = 1, "
        "closure consistent.",
        surveyfigures.direction_figure(Medium(anisotropy=1.0, closure="consistent")),
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
        {closure: [{"text", "values", "holds"}]}}], "findings": {"coefficients", "equations"},
        "stability": [...]}.

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
    claims, gaps, stability = judge(), gap_rows(), stability_rows()
    (out / "paper.md").write_text(page(captions, claims, gaps, stability), encoding="utf-8")
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
        "findings": {
            "coefficients": [dataclasses.asdict(finding) for finding in appendix_c_findings()],
            "equations": [dataclasses.asdict(finding) for finding in equation_findings()],
        },
        "stability": stability,
    }
    text = json.dumps(result, indent=1, ensure_ascii=False)
    (out / "paper.json").write_text(text + "\n", encoding="utf-8")
    return result
