"""Every other receiver of a line late: told with how late, and never read as waves."""

from __future__ import annotations

import re

import numpy as np
import pytest
from test_waves_along_line import passing

from wavesim.readings.dispersion.wavenumber_at_frequency import in_space
from wavesim.records.fitness import for_k_at_frequency
from wavesim.records.record import RecordError, record

SPEED, F0 = 2000.0, 5e4
T = np.arange(200) * 0.0734 / F0


def late_in_turn(x, samples, late=1):
    """Pulses of c = 2000 m/s without dispersion, every other receiver so many samples late."""
    u = passing(x, [(lambda w: w / SPEED, lambda r: 1.0)], F0, T)
    u[:, late::2] = np.roll(u[:, late::2], samples, axis=0)
    return u + 3e-3 * np.random.default_rng(0).normal(size=u.shape)


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("uneven", [0.0, 0.3])
def test_every_other_receiver_late_is_told_with_how_late(samples, uneven, rng):
    """By the time that it is late, to 5 % of a sample; receivers evenly spaced, or not."""
    x = 0.04 + 0.0136 * (np.arange(10) + uneven * rng.uniform(-1, 1, 10))
    with pytest.raises(RecordError, match="every other receiver") as told:
        record(late_in_turn(x, samples), T, x)
    late = float(re.search(r"is (\S+) s late", str(told.value))[1])
    assert late == pytest.approx(samples * T[1], abs=0.05 * T[1])
    where = [
        float(p) for p in re.search(r"x = ([\d., ]+)", str(told.value))[1].split(",") if p.strip()
    ]
    assert where == pytest.approx(x[1::2], rel=1e-4)
    assert not record(late_in_turn(x, 0), T, x).findings


def test_few_faint_waves_beside_what_no_few_waves_explain_are_none():
    """Late by nearly half a period, and taken as recorded, the loud frequencies are no few waves;
    faint ones, where the two halves happen to look like one wave, are none either."""
    x = 0.0544 + 0.0136 * np.arange(10)
    one = record(late_in_turn(x, 3), T, x, as_recorded=True)
    points = in_space(for_k_at_frequency(one), np.linspace(6.45e4, 8.56e5, 60))
    assert not points.valid.any()
