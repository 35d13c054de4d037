"""What the paper's claims are judged on: branches and gap edges of one closure, in ω̄ and k̄."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wavesim.material.medium import Medium
from wavesim.material.rotation_equations import ROTATION
from wavesim.planewave.dispersion_relation import block_frequencies
from wavesim.planewave.eigenproblem import Float
from wavesim.planewave.gap_map import family_gaps

A_VALUES = np.linspace(0.0, 1.0, 21)
ETA_VALUES = np.linspace(0.0, 1.0, 61) ** 2  # denser near 0, where edges go as √η
K_BAR = np.linspace(0.0, 1.0, 201)


@dataclass(frozen=True)
class Study:
    """What the claims are judged on: branches over k̄ and a, gap edges over a and over η."""

    closure: str

    def medium(self, a: float) -> Medium:
        """Table 1 with this a and closure."""
        return Medium(anisotropy=a, closure=self.closure)

    @cached_property
    def branch(self) -> dict[str, Float]:
        """ω̄ of each branch, shape (a, k̄), without the second of the transverse sectors."""
        found: dict[str, list[Float]] = {}
        for a in A_VALUES:
            medium = self.medium(float(a))
            k = K_BAR * 2 * math.pi / medium.length_scale
            for block in ROTATION.blocks:
                if block.sector != "transverse3":
                    omega = block_frequencies(medium, block, k) * medium.time_scale
                    for name, values in zip(block.branches, omega.T, strict=True):
                        found.setdefault(name, []).append(values)
        return {name: np.array(values) for name, values in found.items()}

    @cached_property
    def over_a(self) -> tuple[dict[str, Float], dict[str, Float]]:
        """Lower and upper gap edges, ω̄, over A_VALUES at η = 0.5."""
        return self._edges(Medium(anisotropy=A_VALUES, closure=self.closure))

    def over_eta(self, a: float) -> tuple[dict[str, Float], dict[str, Float]]:
        """Lower and upper gap edges, ω̄, over ETA_VALUES."""
        return self._edges(Medium(anisotropy=a, stiffness_ratio=ETA_VALUES, closure=self.closure))

    def _edges(self, family: Medium) -> tuple[dict[str, Float], dict[str, Float]]:
        lower, upper = family_gaps(family)
        scale = family.time_scale
        return (
            {name: edge * scale for name, edge in lower.items()},
            {name: edge * scale for name, edge in upper.items()},
        )
