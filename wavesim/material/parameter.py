"""A parameter of a medium: its symbol, unit and admissible range, said once."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Parameter:
    """What is said once of a parameter of a medium.

    Attributes:
        symbol: the paper's, such as "G_n^a".
        unit: SI, "" for none.
        low, high: the admissible range.
        open: whether low itself is outside it.
        why: what is wrong outside it.
    """

    symbol: str
    unit: str
    low: float = 0.0
    high: float = math.inf
    open: bool = True
    why: str = ""

    @property
    def allowed(self) -> str:
        """The range in words."""
        if math.isfinite(self.high):
            text = f"between {self.low:g} and {self.high:g}"
        else:
            text = f"greater than {self.low:g}" if self.open else f"{self.low:g} or greater"
        return f"{text} ({self.why})" if self.why else text

    def admits(self, value: float) -> bool:
        """Whether a value is in the range."""
        return self.low < value <= self.high or (value == self.low and not self.open)

    def check(self, name: str, value: float) -> None:
        """Hold a value to the range.

        Args:
            name: of the parameter, for the message.
            value: its value, in its unit.

        Raises:
            ValueError: the value is not finite or not admissible.
        """
        if not math.isfinite(value):
            raise ValueError(f"{name} = {value}: must be finite")
        if not self.admits(value):
            raise ValueError(f"{name} = {value:g}: must be {self.allowed}")


PARAMETERS: dict[str, Parameter] = {}
"""What is known of the parameters of the media of all families, by name."""
