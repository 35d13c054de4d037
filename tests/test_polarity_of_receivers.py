"""Receivers of a line of reversed polarity in turn, or at random; fields are exact."""

import numpy as np
import pytest
from test_order_of_receivers import GOOD, UNEVEN, T, X, noisy, passing

from wavesim.readings.dispersion.folding import TURNED
from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
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


RING = {
    "a medium": [lambda k: 2000 * k],
    "with a cut-off": [lambda k: 2000 * k, lambda k: np.sqrt(7.5e6**2 + (800 * k) ** 2)],
    "a chain": [lambda k: 4e6 * np.sin(k * 5e-4)],
    "on springs": [lambda k: np.sqrt(1e6**2 + (4e6 * np.sin(k * 5e-4)) ** 2)],
    "softer at π/d": [lambda k: np.sqrt(4e6**2 - (3e6 * np.sin(k * 5e-4)) ** 2)],
}


@pytest.mark.parametrize("field", RING)
@pytest.mark.parametrize("count", [12, 32])
def test_waves_round_a_ring_come_to_rest_at_k_0_or_every_other_receiver_is_reversed(field, count):
    """No law moves at ω = 0 at π/d alone; of a cut-off at 0 nothing tells."""
    rng, x, t = np.random.default_rng(6), 1e-3 * np.arange(count), np.arange(900) * 2.5e-7
    k = 2 * np.pi * np.arange(1, count // 2) / (count * 1e-3)
    u = np.zeros((900, count))
    for omega in RING[field]:
        for sign in (1, -1):
            waves = np.exp(1j * (sign * np.outer(k, x) + rng.uniform(0, 6.28, (len(k), 1))))
            u += (np.exp(-1j * np.outer(t, omega(k))) @ waves).real
    u = noisy(u)
    chain = field not in ("a medium", "with a cut-off")
    found = in_time(record(u, t, x, ring=True, lattice=chain))
    own = found.take(found.valid)
    off = np.abs([law(own.k) - own.omega for law in RING[field]]).min(axis=0)
    assert len(own) >= len(k) - 1
    assert (off <= 2 * own.bar).all()
    turned = in_time(record(u * (-1.0) ** np.arange(count), t, x, ring=True, lattice=chain))
    if field in ("a medium", "with a cut-off", "a chain"):
        assert not turned.valid.any()
        assert TURNED in turned.reason
