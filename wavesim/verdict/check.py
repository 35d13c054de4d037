"""A line of a verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any


@dataclass(frozen=True)
class Check:
    """One line of the verdict.

    Attributes:
        name: what was checked.
        measured, reference: in the unit named; an error has reference 0.
        tolerance: largest |measured − reference| that passes.
        unit: of the three numbers.
        remedy: what to change in the case if it falls short; "" where nothing is known.
    """

    name: str
    measured: float
    reference: float
    tolerance: float
    unit: str = "–"
    remedy: str = ""

    @property
    def passed(self) -> bool:
        """Whether the measured value is within the tolerance; never where it is not a number."""
        return bool(abs(self.measured - self.reference) <= self.tolerance)

    def row(self) -> dict[str, Any]:
        """As summary.json has it: with whether it passed, and the remedy only if it did not."""
        found = asdict(self) | {"passed": self.passed}
        if self.passed or not self.remedy:
            del found["remedy"]
        return found


def judged(
    name: str,
    measured: float,
    allowed: float,
    remedy: Callable[..., str],
    *arguments: Any,
    reference: float = 0.0,
    unit: str = "–",
) -> Check:
    """A check, its remedy looked for only where it falls short.

    Args:
        name, measured, allowed, reference, unit: as of :class:`Check`, allowed its tolerance.
        remedy, arguments: a function of ``remedies``, and what it takes.
    """
    check = Check(name, measured, reference, allowed, unit)
    return check if check.passed else replace(check, remedy=remedy(*arguments))
