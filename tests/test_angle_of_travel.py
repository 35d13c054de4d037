"""Waves at an angle: the tensors turned, isotropy, the mirror, and the sectors along the axis."""

from __future__ import annotations

import modes_at_an_angle as every
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from media import media

from wavesim import planewave
from wavesim.material.contact_tensors import (
    average_stiffness,
    direction_moments,
    gradient_stiffness,
    relative_stiffness,
)
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients
from wavesim.planewave.eigenproblem import solve

property_test = settings(deadline=None, derandomize=True, max_examples=40)
angles = st.floats(-np.pi, np.pi)
MEDIUM = Medium(anisotropy=1.0, closure="consistent")


def turn(theta):
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turned(tensor, Q):
    """The tensor of the body turned by Q: Q on every index."""
    for axis in range(tensor.ndim):
        tensor = np.moveaxis(np.tensordot(Q, tensor, axes=(1, axis)), 0, axis)
    return tensor


def by_formula(normal, eta, count, fabric, scale):
    """scale ⟨G_ik n…n⟩, count n's beside G, with ξ = (δ_pq + F_pq) n_p n_q/4π for any fabric F."""
    weight = np.eye(3) + fabric
    aligned = np.tensordot(direction_moments(count + 4), weight, axes=2)
    spread = np.tensordot(direction_moments(count + 2), weight, axes=2)
    return scale * normal * ((1 - eta) * aligned + eta * np.multiply.outer(np.eye(3), spread))


@property_test
@given(media(), angles)
def test_tensors_turned_by_hand_are_those_of_the_turned_fabric(medium, theta):
    """J, M, N turned on every index = the averages under Q F Qᵀ, to 1e-13 of the largest entry."""
    Q = turn(theta)
    a = medium.anisotropy
    fabric = Q @ np.diag([a, -a / 2, -a / 2]) @ Q.T
    area = medium.branch_length**2 * medium.contact_density
    eta = medium.stiffness_ratio
    for tensor, normal in (
        (average_stiffness(medium), medium.G_n_a),
        (relative_stiffness(medium), medium.G_n_r),
    ):
        expected = by_formula(normal, eta, 2, fabric, area).transpose(0, 2, 1, 3)
        assert np.abs(turned(tensor, Q) - expected).max() <= 1e-13 * np.abs(expected).max()
    tensor = gradient_stiffness(medium)
    scale = area * medium.branch_length**2 / 4
    expected = by_formula(medium.G_n_g, eta, 4, fabric, scale).transpose(0, 2, 3, 1, 4, 5)
    assert np.abs(turned(tensor, Q) - expected).max() <= 1e-13 * np.abs(expected).max()


@property_test
@given(media(), angles, st.floats(0.02, 1.0))
def test_contraction_with_the_direction_is_the_turned_body_along_its_axis(medium, theta, k_bar):
    """Waves along n(θ) = waves along x₁ of the body turned by −θ: ω² to 1e-13 of the largest."""
    tensors = every.scaled_tensors(medium)
    Q = turn(-theta)
    names = ("c_pp", "c_pb", "c_bp", "c_bb", "gamma")
    back = BlockCoefficients(*(turned(getattr(tensors, name), Q) for name in names))
    k = np.array([2 * np.pi * k_bar])
    one = solve(every.direction_form(medium, theta), k).squares
    two = solve(every.contract(back, np.array([1.0, 0.0, 0.0])), k).squares
    np.testing.assert_allclose(one, two, rtol=0, atol=2e-13 * np.abs(one).max())


@property_test
@given(media(), st.floats(0.02, 1.0))
def test_along_the_axis_they_are_the_four_sectors(medium, k_bar):
    """θ = 0 gives the equations of closure "consistent": ω² to 1e-13 of the largest."""
    k = 2 * np.pi * k_bar / medium.branch_length
    sectors = np.concatenate([planewave.frequencies(medium, s, k)[0] for s in ROTATION.sectors])
    found = every.frequencies(medium, 0.0, k)[0]
    scale = found.max() ** 2
    np.testing.assert_allclose(found**2, np.sort(sectors) ** 2, rtol=0, atol=1e-13 * scale)


@property_test
@given(media(a=(0.0, 0.0)), angles, st.floats(0.02, 1.0))
def test_isotropic_bands_are_the_same_in_every_direction(medium, theta, k_bar):
    """Law: a = 0 is isotropic. ω² to 1e-13 of the largest (rounding of a 12 × 12 eigenproblem)."""
    k = 2 * np.pi * k_bar / medium.branch_length
    one, two = (every.frequencies(medium, x, k)[0] ** 2 for x in (0.0, theta))
    np.testing.assert_allclose(two, one, rtol=0, atol=1e-13 * one.max())


def test_anisotropic_bands_are_not():
    one, two = (every.frequencies(MEDIUM, x, 500.0)[0] for x in (0.0, np.pi / 2))
    assert np.abs(two / one - 1).max() > 0.1


@property_test
@given(media(), angles, st.floats(0.02, 1.0))
def test_the_mirror_splits_the_twelve_fields_at_every_angle(medium, theta, k_bar):
    """The five fields with φ₃ and the seven with φ₁, φ₂ exchange nothing, exactly."""
    form = every.direction_form(medium, theta)
    k = np.array([2 * np.pi * k_bar])
    parts = [solve(every.kind_form(form, kind), k).squares[0] for kind in every.KINDS]
    assert [len(part) for part in parts] == [7, 5]
    whole = solve(form, k).squares[0]
    np.testing.assert_allclose(
        np.sort(np.concatenate(parts)), np.sort(whole), rtol=0, atol=1e-13 * whole.max()
    )
