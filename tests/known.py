"""Fields and records that several tests of extraction share, made once."""

from __future__ import annotations

from functools import cache

import numpy as np

from wavesim.case.problem import load
from wavesim.material.medium import Medium
from wavesim.material.sectors import BLOCKS

CASES = {"printed": "cases/bandgap_pulse.toml", "consistent": "cases/consistent.toml"}


@cache
def simulated(closure):
    """The shipped case of a closure: all twelve waves on the default grid."""
    from pathlib import Path

    from wavesim import simulate

    plan = load(Path(__file__).parent.parent / CASES[closure]).plan
    return simulate(plan.medium, plan.bar, plan.sources, plan.duration, plan.schedule.frames)


@cache
def recovered(closure, method="harmonic"):
    """[(block, record, points up to k̄ = 1)] of that field."""
    from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
    from wavesim.records.of_field import block_record

    field = simulated(closure)
    found = []
    for block in field.blocks:
        record = block_record(field, block)
        found.append((block, record, in_time(record, unit(field.medium), method)))
    return found


def unit(medium):
    """Wavenumber of k̄ = 1."""
    return 2 * np.pi / float(medium.length_scale)


LONGITUDINAL = BLOCKS[0]
MEDIUM = Medium(anisotropy=0.25)
