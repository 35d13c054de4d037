"""A field given at t = 0, at rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wavesim.material.arguments import checked
from wavesim.sources.admissible import check_place, check_positive
from wavesim.sources.source import (
    IN_BAND,
    Extent,
    Source,
    namespace,
)


@checked
@dataclass(frozen=True)
class InitialField(Source):
    """A field at rest at t = 0: amplitude · exp(−(x − x_s)²/2w²).

    It is what a body force of the inertia times amplitude · δ′(t) leaves behind, so that its
    spectrum is amplitude · (−iω). All frequencies are excited alike; what it excites is limited in
    wavenumber, by exp(−k²w²/2), and its band is therefore infinite.

    Args:
        field: the field, such as phi1 or u1.
        position: x_s, m.
        width: w, standard deviation, m, > 0.
        amplitude: in the field's unit.

    Raises:
        ValueError: a value is not admissible; the message names it.
    """

    kind: ClassVar[str] = "initial"

    field: str
    position: float
    width: float
    amplitude: float = 1.0
    drive: str = "initial"

    def __post_init__(self) -> None:
        check_place(self, ("initial",))
        check_positive(self, ("width", "m"))

    @property
    def span(self) -> tuple[float, float, float]:
        """0 s throughout: it acts no more."""
        return 0.0, 0.0, 0.0

    @property
    def extent(self) -> Extent:
        """All frequencies."""
        return Extent(math.inf, math.inf, math.inf, (0.0, math.inf))

    @property
    def peak_frequency(self) -> float:
        """Infinite: its spectrum rises with ω."""
        return math.inf

    @property
    def highest_wavenumber(self) -> float:
        """Wavenumber above which exp(−k²w²/2) is below 3 %, rad/m."""
        return math.sqrt(2 * math.log(1 / IN_BAND)) / self.width

    def signal(self, t: Any) -> Any:
        """0: there is no signal."""
        return namespace(t).zeros_like(t)

    def spectrum(self, omega: Any) -> Any:
        """amplitude · (−iω), unit of the amplitude over s; see :meth:`Source.spectrum`."""
        return -1j * self.amplitude * np.asarray(omega)
