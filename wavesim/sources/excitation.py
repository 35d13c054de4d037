"""What several sources excite together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wavesim.sources.initial_field import InitialField
from wavesim.sources.source import Source


def excitation(sources: Sequence[Source], omega: Any, k: Any = 0.0) -> Any:
    """Spectrum |s(ω)| of the strongest source at each frequency, relative to its own peak.

    An initial field excites all frequencies and, in wavenumber, exp(−k²w²/2).

    Args:
        sources: at least one.
        omega: angular frequencies, any shape, rad/s.
        k: wavenumbers, of a shape that goes with omega, rad/m; felt by initial fields alone.

    Returns:
        Shape of omega, 0 to 1.
    """
    omega = np.asarray(omega)
    parts = [
        np.exp(-((np.asarray(k) * source.width) ** 2) / 2) * np.ones(omega.shape)
        if isinstance(source, InitialField)
        else np.abs(source.spectrum(omega)) / source.strongest
        for source in sources
    ]
    return np.max(parts, axis=0)


def excited_band(sources: Sequence[Source]) -> tuple[float, float]:
    """Lowest and highest angular frequency that count as excited, rad/s; see base.EXCITED."""
    bands = [source.excited for source in sources]
    return min(low for low, _ in bands), max(high for _, high in bands)
