"""Plane waves in an endless medium: ω(k), group velocity, gaps, complex k. It knows no grid."""

from wavesim.material.arguments import checked as _checked
from wavesim.planewave.dispersion_relation import *  # noqa: F403
from wavesim.planewave.dispersion_relation import __all__ as __all__

globals().update({name: _checked(globals()[name]) for name in __all__ if name[0].islower()})


def __dir__() -> list[str]:
    return sorted(__all__)
