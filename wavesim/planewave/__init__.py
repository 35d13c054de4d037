"""Plane waves in an endless medium: ω(k), group velocity, gaps, complex k. It knows no grid."""

from wavesim.planewave.dispersion_relation import *  # noqa: F403
from wavesim.planewave.dispersion_relation import __all__ as __all__
