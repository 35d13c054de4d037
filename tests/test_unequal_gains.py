"""Bars of a decay along a line hold what gains of the receivers make of it, noise or none."""

import numpy as np
import pytest
from pulses import ricker

from wavesim.readings.dispersion.wavenumber_at_frequency import in_space
from wavesim.records.of_medium import RecordOfMedium
from wavesim.records.record import record
from wavesim.verdict.record import attenuation

T = np.arange(1000) * 5e-7
X = 0.02 + 0.005 * np.arange(3)


def test_gains_of_three_receivers_that_noise_hides_are_held():
    """k = ω/c without loss, gains that scatter by 5 %, noise of 1 % of the peak: what one receiver
    to spare shows of them at one frequency is mostly noise, and by chance may be nothing."""
    omega, held = 2 * np.pi * np.linspace(5e4, 1.5e5, 8), []
    clean = ricker(T[:, None] - X / 3000 - 2e-5, 1e5, 3e-5)
    for seed in range(30):
        rng = np.random.default_rng(seed)
        u = clean * (1 + 0.05 * rng.standard_normal(3))
        points = in_space(record(u + 0.01 * rng.standard_normal(u.shape), T, X), omega)
        own = points.take(points.valid)
        held += [*(np.abs(own.k - own.omega / 3000) <= own.bar)]
    assert len(held) > 100
    assert np.mean(held) >= 0.95


@pytest.mark.parametrize("calibrated", [0.1, 0.02])
def test_gains_of_two_receivers_are_held_as_far_as_they_are_calibrated(calibrated):
    """k = ω/c , gains that scatter by what they are said to: nothing in the record shows
    them. Said to be alike, the bars hold noise alone, and lack most."""
    omega, held, alike = 2 * np.pi * np.linspace(5e4, 1.5e5, 8), [], []
    clean = ricker(T[:, None] - X[:2] / 3000 - 2e-5, 1e5, 3e-5)
    for seed in range(30):
        rng = np.random.default_rng(seed)
        u = clean * (1 + calibrated * rng.standard_normal(2))
        made = record(u + 1e-3 * rng.standard_normal(u.shape), T, X[:2])
        for gains, found in ((calibrated, held), (0.0, alike)):
            own = in_space(made, omega, gain_error=gains)
            own = own.take(own.valid)
            found += [*(np.abs(own.k - own.omega / 3000) <= own.bar)]
    assert len(held) > 200
    assert 0.85 <= np.mean(held) <= 1
    assert np.mean(alike) < 0.5


def test_receivers_so_close_that_gains_hide_k_are_refused_with_the_option_that_tells_it():
    """A fiftieth of a wave apart, gains of 10 % leave more of ln(U₂/U₁) than k Δx."""
    x = np.array([0.02, 0.0206])
    clean = ricker(T[:, None] - x / 3000 - 2e-5, 1e5, 3e-5)
    made = record(clean + 1e-4 * np.random.default_rng(1).standard_normal(clean.shape), T, x)
    omega = 2 * np.pi * np.array([8e4, 1e5])
    assert all("--gain-error" in why for why in in_space(made, omega).reason)
    assert in_space(made, omega, gain_error=0.001).valid.all()


@pytest.mark.parametrize(("places", "sources"), [((0.02, 0.03), ()), ((0.02, 0.03, 0.06), (0.05,))])
def test_a_note_says_what_two_receivers_on_one_side_do_not_tell(places, sources):
    """Whatever their gains are said to be, one wave is taken for granted."""
    x = np.array(places)
    u = ricker(T[:, None] - np.abs(x - (*sources, 0.0)[0]) / 3000 - 2e-5, 1e5, 3e-5)
    u += 1e-3 * np.random.default_rng(1).standard_normal(u.shape)
    for gains, part in ((None, "10 %"), (0.02, "2 %")):
        of_two = [RecordOfMedium("u", record(u, T, x, sources=sources))]
        (found,) = attenuation(of_two, gain_error=gains)
        assert any(
            "one wave for granted" in note and part in note for note in found.origin.record.notes
        )
