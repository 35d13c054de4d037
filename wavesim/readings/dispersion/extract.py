"""What is measured from a field: spectrum, branches and attenuation of every block set in motion.

Measured only: no dispersion relation enters here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wavesim.material.family import Block
from wavesim.material.shown import Shown
from wavesim.readings.damped_transform import check_asked
from wavesim.readings.dispersion.decay_along_ring import FEWEST_POINTS, Attenuation, attenuation
from wavesim.readings.dispersion.spectrum import Ridge, Spectrum, ridges, spectrum
from wavesim.simulation.field import Field
from wavesim.sources import excited_band

# The attenuation is measured up to this many times the highest peak frequency.
_ABOVE_PEAK = 2.0
# Room in k beyond the judged range, so that branches are followed past its end.
_MARGIN = 1.25


@dataclass(frozen=True, repr=False)
class Measured(Shown):
    """What was measured of one block.

    Attributes:
        block: the block.
        spectrum: its power over k and ω.
        ridges: the branches found in it.
        attenuation: complex wavenumber; None where nothing travels, or too short a way.
    """

    block: Block
    spectrum: Spectrum
    ridges: list[Ridge]
    attenuation: Attenuation | None

    def told(self) -> dict[str, str]:
        """Block, branches, what was measured of the attenuation."""
        curve = self.attenuation
        return {
            "block": self.block.name,
            "branches": str(len(self.ridges)),
            "spectrum": "{} wavenumbers × {} frequencies".format(*self.spectrum.power.shape),
            "attenuation": "none" if curve is None else f"{len(curve.omega)} frequencies",
        }


def extract(
    field: Field, k_max: float | None = None, frequencies: int = 120, damping: float = 18.0
) -> list[Measured]:
    """Measure every block of a field.

    Args:
        field: the field.
        k_max: highest wavenumber of interest, rad/m; k̄ = 0.5 where None.
        frequencies: number of frequencies of the attenuation, spread over the sources' band.
        damping: σT of the exponential window, –.

    Returns:
        One entry for each block that the sources set in motion.

    Raises:
        ValueError: the bar has layers or ends, where waves have no k of one medium; or a number
            is out of its range.
    """
    check_asked(frequencies, damping)
    if not field.simulation.endless:
        raise ValueError(
            f"field: of a bar of {len(field.layers.layers)} layers with ends "
            f"{field.bar.left!r} and {field.bar.right!r}; extract is for a ring of one medium: "
            "take read_bar, or record its receivers"
        )
    if k_max is None:
        k_max = np.pi / field.medium.length_scale
    nyquist = np.pi / field.interval
    found = []
    for block in field.blocks:
        low, high = excited_band([s for s in field.sources if s.field in block.fields])
        high = min(high, 0.95 * nyquist)
        shown = spectrum(field, block, _MARGIN * k_max, high)
        travelling = None
        if block.macro:
            peak = 2 * np.pi * max(s.peak_frequency for s in field.sources)
            # From the first bin on, where a signal has a mean value.
            lowest = low or 2 * np.pi / (field.t[-1] - field.t[0])
            highest = min(high, _ABOVE_PEAK * peak)
            omega = np.linspace(lowest, highest if highest > lowest else high, frequencies)
            curve = attenuation(field, block, omega, damping)
            travelling = curve if len(curve.distance) >= FEWEST_POINTS else None
        found.append(Measured(block, shown, ridges(shown), travelling))
    return found
