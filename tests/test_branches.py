"""Branches through crossings and near misses."""

from __future__ import annotations

import numpy as np
import pytest
from modes_at_an_angle import KINDS, direction_form, kind_form

from wavesim.material.medium import Medium
from wavesim.material.rotation_equations import ROTATION
from wavesim.planewave.branches import follow, track
from wavesim.planewave.eigenproblem import solve, spectral_form

LONGITUDINAL = ROTATION.blocks[0]


def bars(medium, count, k_bar=1.0):
    return np.linspace(0.01, k_bar, count) * 2 * np.pi / medium.branch_length


@pytest.mark.parametrize("count", [5, 40, 400])
def test_a_wave_that_is_coupled_to_nothing_is_followed_through_the_one_it_crosses(count):
    """η = 1: M is diagonal and (B22 + B33)/√2 alone, at ω² = M₂₂₂₂/m_B for every k. At a = 1.5 it
    lies at 3.5 p₁ where LA tends to (5 + 2a)p₁/2 = 4 p₁, so LA rises through it. Exact."""
    medium = Medium(anisotropy=1.5, stiffness_ratio=1.0, closure="consistent")
    found = follow(medium, LONGITUDINAL, bars(medium, count))
    flat = np.sqrt(spectral_form(medium, LONGITUDINAL).c_bb[1, 1]) / medium.time_scale
    acoustic, alone, _ = found.T
    np.testing.assert_allclose(alone, flat, rtol=1e-9)
    assert acoustic[0] < alone[0]
    assert acoustic[-1] > alone[-1]


@pytest.mark.parametrize("count", [5, 40, 400])
@pytest.mark.parametrize("eta", [0.99, 0.999, 0.99999])
def test_a_near_miss_is_no_crossing_however_coarse_the_steps(eta, count):
    """η < 1 couples them: the two come near, exchange shapes and part, however few the points.

    At η = 0.99999 they pass at a relative distance of about 1e-6, in 1e-6 of the range of k.
    """
    medium = Medium(anisotropy=1.5, stiffness_ratio=eta, closure="consistent")
    found = follow(medium, LONGITUDINAL, bars(medium, count))
    assert np.all(np.diff(found, axis=1) > 0)
    flat = np.sqrt(spectral_form(medium, LONGITUDINAL).c_bb[1, 1]) / medium.time_scale
    assert found[0, 1] == pytest.approx(flat, rel=0.02)
    assert found[-1, 0] == pytest.approx(flat, rel=0.02)


def test_printed_branches_are_followed_too():
    """Left and right modes differ: overlaps are u†v. Nothing crosses at a = 0.5, η = 0.5."""
    medium = Medium(anisotropy=0.5)
    for block in ROTATION.blocks:
        found = follow(medium, block, bars(medium, 50))
        assert found.shape == (50, len(block.branches))
        assert np.all(np.diff(found, axis=1) > 0)


def test_branches_are_followed_over_directions():
    """At fixed k the seven waves with rotation in the plane cross each other over θ; after half a
    turn the medium is the same, and each frequency comes back as a set, and each is smooth:
    halving the step in θ halves the largest jump (ratio within 0.4 to 0.6)."""
    medium = Medium(anisotropy=1.0, closure="consistent")
    k = np.array([2.0])

    def solver(angles):
        forms = [kind_form(direction_form(medium, float(x)), KINDS[0]) for x in angles]
        found = [solve(form, k) for form in forms]
        return type(found[0])(
            *(np.stack([getattr(x, n)[0] for x in found]) for n in ("squares", "right", "left"))
        )

    jumps = []
    for count in (31, 61):
        theta = np.linspace(0.0, np.pi, count)
        squares = solver(theta).squares
        assert squares.shape[1] == 7
        followed = np.take_along_axis(squares, track(solver, theta), axis=1)
        np.testing.assert_allclose(np.sort(followed[-1]), np.sort(followed[0]), rtol=1e-10)
        jumps.append(np.abs(np.diff(np.sqrt(followed), axis=0)).max())
    assert 0.4 < jumps[1] / jumps[0] < 0.6
