"""The paper reproduced: its figures, and its claims judged, as a page and as JSON."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from wavesim.material.medium import Medium
from wavesim.paper import figures as paperfigures
from wavesim.paper.branches_and_gaps import Study
from wavesim.paper.page import CLOSURES, GAPS, SOURCE, judge, page
from wavesim.planewave.gap_map import family_gaps


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
