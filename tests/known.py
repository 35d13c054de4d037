"""Media, blocks and units that tests of readings share."""

from __future__ import annotations

import numpy as np

from wavesim.material.medium import Medium
from wavesim.material.sectors import BLOCKS

LONGITUDINAL = BLOCKS[0]
MEDIUM = Medium(anisotropy=0.25)


def unit(medium):
    """Wavenumber of k̄ = 1."""
    return 2 * np.pi / float(medium.length_scale)
