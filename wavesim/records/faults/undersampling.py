"""Signals that go on beyond the Nyquist frequency, where samples show them at 2π/Δt − ω."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.faults.finding import TOLD, Finding

Float = NDArray[Any]

UNDERSAMPLED = "sampled too seldom"
# The spectrum is looked at in so many bands at most, of so many frequencies at least.
_BANDS, _FEWEST = 12, 3
# In the last of them a signal goes on that has this part of its highest there, and so many times
# the noise's power.
_PART, _OVER_NOISE = 0.3, 10.0


def tell_undersampled(values: Float, noise: Float, found: list[Finding]) -> None:
    """Say so where the spectrum of signals is high up to the Nyquist frequency.

    Args:
        values: one component, shape (nt, nx), without offset, at rest at its beginning or end.
        noise: standard deviation of each receiver at rest, shape (nx,); NaN where it never is.
        found: findings, added to.
    """
    known = np.isfinite(noise)
    if known.sum() < 2:
        return
    power = np.sum(np.abs(np.fft.rfft(values[:, known], axis=0)) ** 2, axis=1)[1:]
    bands = min(_BANDS, len(power) // _FEWEST)
    if bands < _FEWEST:
        return
    density = np.array([part.mean() for part in np.array_split(power, bands)])
    still = len(values) * float(np.sum(noise[known] ** 2))
    part = float(np.sqrt(density[-1] / density.max()))
    if part > _PART and density[-1] > _OVER_NOISE * still:
        found.append(
            Finding(UNDERSAMPLED, "all receivers", f"{100 * part:.0f} % of the spectrum's highest",
                    TOLD, "signals go on beyond the Nyquist frequency, at which their spectrum is "
                    f"still {100 * part:.0f} % of its highest: what is beyond is seen at 2π/Δt − "
                    "ω; sample more often, or behind a low-pass filter")
        )  # fmt: skip
