"""Samples that are not there, whatever stands in their place; and channels that are well beside.

The law: the pulse of `test_record_faults.py`, k = ω/c exactly, in white noise.
"""

from __future__ import annotations

import numpy as np
import pytest
from test_record_faults import CLEAN, SPEED, N, T, X, along, changed, put, ricker

from wavesim.records.record import record

BEST, _, MANY, _ = along(CLEAN)
END = slice(250, None)  # the wave has passed all receivers at 210
UNEVEN = ([0.5, 0.5, 1.5, 0.3], [1.0, 1.0, 0.5, 0.5], [1.0, 0.8, 1.0, 0.3], [1.5, 0.8, 0.8, 0.8])


@pytest.mark.parametrize("steps", UNEVEN)
def test_uneven_receivers_more_than_half_a_wavelength_apart_are_well(steps, rng):
    """No k within ±π/d is theirs, and no receiver is to blame: steps in wavelengths of 5e4 Hz."""
    x = 0.03 + np.r_[0, np.cumsum(steps)] * SPEED / 5e4
    u = ricker(T[:, None] - x / SPEED) * np.exp(-x) + 1e-3 * rng.standard_normal((len(T), len(x)))
    assert not record(u, T, x).findings
    if not (2 * np.array(steps) % 1).any():
        return  # half waves tell no polarity
    u[:, 2] *= -1
    (told,) = record(u, T, x).findings
    assert (told.what, told.where) == ("reversed", f"x = {x[2]:g} m")


@pytest.mark.parametrize("which", [(3,), (0,), (2, 3, 6)])
def test_a_channel_that_ends_when_its_wave_has_passed_is_read_as_far_as_it_goes(which):
    u = changed(put(np.nan, END, list(which)))
    error, held, many, one = along(u)
    assert len(one.origin.record.x) == N
    assert error < 3 * BEST
    assert held >= 0.9
    assert many >= 0.9 * MANY
    late = changed(put(np.nan, slice(0, 30), list(which)))
    assert along(late)[0] < 3 * BEST


def test_a_channel_that_ends_within_its_wave_is_left_out_alone():
    u = changed(put(np.nan, slice(110, None), 3))
    error, held, _, _ = along(u)
    found = record(u, T, X)
    assert found.broken.tolist() == [j == 3 for j in range(N)]
    assert not {f.what for f in found.findings} & {"dead", "misfit", "mis-scaled", "delayed"}
    assert error < 3 * BEST
    assert held >= 0.9
    # Where all others hear an echo later, it is not known whether this one does.
    echo = CLEAN + 0.4 * np.roll(CLEAN, 500, axis=0)
    echo[END, 3] = np.nan
    assert record(echo, T, X).broken[3]


def filled(how, which=(1, 4), begin=95, long=30):
    """The record with a stretch of so many samples within the wave filled in as programs do."""
    u = CLEAN.copy()
    for j in which:
        a, b = begin + 10 * j, begin + 10 * j + long
        u[a:b, j] = {
            "straight": np.interp(np.arange(a, b), [a - 1, b], u[[a - 1, b], j]),
            "held": u[a - 1, j],
            "zero": 0.0,
        }[how]
    return u


STORED = {
    "doubles": lambda u: u,
    "singles": lambda u: u.astype(np.float32),
    "16 bits": lambda u: np.round(u * 3e4).astype(np.int16),
    "five decimals": lambda u: np.round(u, 5),
}


@pytest.mark.parametrize("stored", STORED)
@pytest.mark.parametrize("how", ["straight", "held", "zero"])
def test_stretches_that_were_filled_in_are_missing(how, stored):
    """Where the wave is, these receivers are left out; where all is quiet nothing is lost."""
    u = STORED[stored](filled(how))
    found = record(u, T, X)
    told = {finding.what for finding in found.findings}
    assert told & {"filled in", "stuck"}
    assert found.broken.tolist() == [j in (1, 4) for j in range(N)]
    if stored == "doubles":
        error, held, _, _ = along(u)
        assert error < 3 * BEST
        assert held >= 0.9
    quiet = record(STORED[stored](filled(how, begin=500)), T, X)
    (told,) = [finding for finding in quiet.findings if finding.what == "filled in"]
    assert told.where == "x = 0.025, 0.04 m, from t = 0.000255 s"
    assert not quiet.broken.any()
    everywhere = CLEAN.copy()
    everywhere[500:560] = 0
    assert "filled in" in {finding.what for finding in record(everywhere, T, X).findings}


SMOOTH = ricker(T[:, None] - X / SPEED)
LATE = T[:, None] - 1e-4 - X / SPEED
BURST = np.where(np.abs(LATE) < 4e-5, np.sin(2 * np.pi * 5e4 * LATE), 0)


@pytest.mark.parametrize(
    "u",
    [
        CLEAN,
        np.round(CLEAN * 100),
        np.round(SMOOTH * 100),
        np.round(CLEAN * 3000),
        CLEAN.astype(np.float32),
        SMOOTH.astype(np.float32),
        SMOOTH,
        np.array([float(f"{v:.4g}") for v in CLEAN.ravel()]).reshape(CLEAN.shape),
        np.array([float(f"{v:.4g}") for v in SMOOTH.ravel()]).reshape(CLEAN.shape),
        BURST + 0.5 * np.roll(BURST, 400, axis=0),
    ],
)
def test_nothing_was_filled_in_where_noise_is_less_than_rounding_or_none(u):
    assert "filled in" not in {finding.what for finding in record(u, T, X).findings}


@pytest.mark.parametrize("part", [0.35, 0.4])
def test_samples_that_noise_hardly_moves_are_no_gaps(part):
    """Where noise is below a digitiser's step, samples at rest stand still by themselves."""
    t, step = np.arange(1600) * 1e-6, 1 / 2000
    late = t[:, None] - 2e-4 - X / 1000
    burst = np.sin(2 * np.pi * 4e4 * late) * np.sin(np.pi * late / 3e-4)
    u = np.where((late > 0) & (late < 3e-4), burst, 0.0)
    for seed in range(6):
        noise = part * step * np.random.default_rng(seed).normal(size=u.shape)
        found = record(np.round((u + noise) / step) * step, t, X).findings
        assert not any(one.what == "filled in" for one in found)


def test_a_digitisers_steps_are_no_noise_that_a_quiet_part_lacks():
    """Noise is a fifth of a step, so that samples before a train of echoes stand still."""
    t, step = np.arange(340) * 1e-6, 1 / 110
    for seed in range(8):
        rng = np.random.default_rng(seed)
        u = np.zeros((340, 2))
        for at in np.r_[7e-5, rng.uniform(8e-5, 3.4e-4, 60)]:
            late = (t[:, None] - at - np.array([0, 1e-5])) * 3e4
            u += rng.normal() * np.where((late > 0) & (late < 1), np.sin(2 * np.pi * late), 0.0)
        u = u / np.abs(u).max() + 0.2 * step * rng.normal(size=u.shape)
        found = record(np.round(u / step) * step, t, np.array([0.0, 0.01])).findings
        assert not any(one.what == "filled in" for one in found)
