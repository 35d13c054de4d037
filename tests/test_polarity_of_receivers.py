"""Receivers of a line of reversed polarity in turn, or at random; fields are exact."""

import numpy as np
import pytest
from test_order_of_receivers import GOOD, UNEVEN, T, X, noisy, passing

from wavesim.readings.dispersion.wavenumber_at_frequency import in_space
from wavesim.records.record import record

LINES = {"three": X[:3], "six": X[:6], "twelve": X, "uneven": UNEVEN}


@pytest.mark.parametrize("line", LINES)
def test_receivers_of_reversed_polarity_are_turned_round_whichever_they_are(line):
    """In turn an even line shows k − π/d alone: k = ω/c comes out, and samples as they were."""
    x, omega = LINES[line], 2 * np.pi * np.linspace(5e4, 1.5e5, 10)
    u = noisy(passing(x))
    at_random = np.random.default_rng(8).choice([-1.0, 1.0], len(x))
    for sign in ((-1.0) ** np.arange(len(x)), at_random):
        found = record(u * sign, T, x)
        assert [one.what for one in found.findings] == ["reversed"]
        right = found.values[0] * np.sign(found.values[0, :, 0] @ u[:, 0])
        assert right == pytest.approx(u, abs=1e-2)
        points = in_space(found, omega)
        own = points.take(points.valid)
        assert len(own) == 10
        assert np.mean(np.abs(own.k - own.omega / 3000) <= own.bar) >= 0.9


@pytest.mark.parametrize("field", GOOD)
def test_no_other_waves_make_receivers_of_reversed_polarity(field):
    """Standing waves turn at their nodes, and of two modes one may be louder farther on."""
    for n in (3, 5, 12):
        found = record(noisy(GOOD[field](X[:n])), T, X[:n])
        assert not any(one.what == "reversed" for one in found.findings)
