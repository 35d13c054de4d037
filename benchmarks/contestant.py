"""What a contestant must offer, and what it gives back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

Fields = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Solution:
    """A run's end.

    Attributes:
        fields: the twelve fields at the final time, SI.
        products: products with L that it took; None where the word has no meaning.
    """

    fields: Fields
    products: int | None


class Contestant(Protocol):
    """One way to solve the problem. Making it is its set-up, which is timed apart.

    Attributes:
        kind: what its setting is: "steps" over the duration (error ∝ 1/steps²), "tolerance"
            (absolute and relative), or "none" where it is exact.
        least_steps: where the setting is "steps", the fewest that are stable.
    """

    kind: ClassVar[str]
    least_steps: int

    def warm_up(self, setting: float) -> None:
        """Compile all that a run with this setting needs."""

    def run(self, setting: float) -> Solution:
        """Solve the problem."""

    def part(self, setting: float, steps: int) -> None:
        """The first steps of a run that takes ``setting`` steps; only where the kind is "steps"."""
