"""The medium: admissible ranges, messages, units, and its life as a pytree of jax."""

from __future__ import annotations

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import wavesim.timedomain.operator  # noqa: F401 - registers the medium with jax
from wavesim.material.contact_tensors import (
    average_stiffness,
    gradient_stiffness,
    relative_stiffness,
)
from wavesim.material.granular_equations import CLOSURES
from wavesim.material.medium import Medium
from wavesim.material.parameter import PARAMETERS

POSITIVE = (
    "branch_length",
    "particle_radius",
    "contact_density",
    "density",
    "G_n_a",
    "G_n_r",
    "rotation_inertia",
    "curvature_inertia",
)


def test_defaults_are_table_1():
    """Table 1 of the paper, with G_n^g's lost minus sign, a = 0 and η = 0.5."""
    medium = Medium()
    assert not medium.damping
    values = {f.name: getattr(medium, f.name) for f in dataclasses.fields(medium)}
    del values["damping"]
    assert values == {
        "anisotropy": 0.0,
        "stiffness_ratio": 0.5,
        "branch_length": 1e-3,
        "particle_radius": 5e-4,
        "contact_density": 1e9,
        "density": 1570.0,
        "G_n_a": 5.0,
        "G_n_r": 5.0,
        "G_n_g": 1.25e-11,
        "closure": "printed",
        "rotation_inertia": None,
        "curvature_inertia": None,
    }
    assert set(Medium().known()) == set(values) - {"closure"}
    # β = 2R²/5 = 1e-7 m², γ = 12R⁴/35 = 2.142857e-14 m⁴.
    assert medium.beta == pytest.approx(1e-7, rel=1e-14)
    assert medium.gamma == pytest.approx(12 / 35 * 6.25e-14, rel=1e-14)
    assert medium.length_scale == 1e-3


def test_inertia_that_is_given():
    """A sphere's own averages, 3R²/5 and 3R⁴/7, in place of the printed ones."""
    medium = Medium(rotation_inertia=1.5e-7, curvature_inertia=2.7e-14)
    assert (medium.beta, medium.gamma) == (1.5e-7, 2.7e-14)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(rho=st.floats(1, 1e5), R=st.floats(1e-5, 1), G=st.floats(1e-3, 1e3))
def test_unit_of_time(rho, R, G):
    """ω̄ = ω √(4πρR⁵/3G_n^a): the frequency √(G/I) of a ball of mass m = 4πρR³/3 with I = m R²."""
    medium = Medium(density=rho, particle_radius=R, G_n_a=G)
    mass = rho * 4 / 3 * math.pi * R**3
    assert 1 / medium.time_scale == pytest.approx(math.sqrt(G / (mass * R**2)), rel=1e-13)


def test_a_unit_of_frequency_is_785_kilohertz():
    assert 1 / (2 * math.pi * Medium().time_scale) == pytest.approx(785e3, rel=5e-4)


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("anisotropy", -1.001, r"between -1 and 2 \(the contact density is negative in some"),
        ("anisotropy", 2.01, r"between -1 and 2 \("),
        ("stiffness_ratio", -0.01, r"0 or greater \(a tangential stiffness can't be negative\)"),
        ("G_n_g", -1e-12, r"0 or greater"),
        *((name, value, r"greater than 0") for name in POSITIVE for value in (0.0, -1.0)),
    ],
)
def test_out_of_range(name, value, allowed):
    """The message names the key, the value and what is allowed."""
    with pytest.raises(ValueError, match=rf"^{name} = {value:g}: must be {allowed}"):
        Medium(**{name: value})
    with pytest.raises(ValueError, match=rf"^{name} = {value:g}: must be {allowed}"):
        PARAMETERS[name].check(name, value)


@pytest.mark.parametrize("name", Medium().known())
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_not_finite(name, value):
    with pytest.raises(ValueError, match=rf"^{name} = {value}: must be a finite number"):
        Medium(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("anisotropy", -1.0),
        ("anisotropy", 2.0),
        ("anisotropy", 1),
        ("stiffness_ratio", 0.0),
        ("stiffness_ratio", 12.5),
        ("G_n_g", 0.0),
        ("density", np.float64(3.0)),
    ],
)
def test_ends_of_the_ranges_are_admissible(name, value):
    assert getattr(Medium(**{name: value}), name) == value


def test_numpy_numbers_are_checked_too():
    for value in (np.float64(2.5), np.float32(2.5), np.int64(3), 3):
        with pytest.raises(ValueError, match=r"^anisotropy = .*: must be between -1 and 2"):
            Medium(anisotropy=value)


def test_closures():
    """Two have wave equations; the third has dispersion coefficients alone, and says so."""
    assert CLOSURES == ("printed", "consistent")
    with pytest.raises(ValueError, match=r"closure = 'b': must be one of printed, consistent, app"):
        Medium(closure="b")
    with pytest.raises(ValueError, match=r"closure = 'appendix_c' has no wave equations"):
        (Medium(closure="appendix_c")).flux_form()


@settings(max_examples=50, deadline=None, derandomize=True)
@given(a=st.floats(-1.5, 2.5), eta=st.floats(0, 2))
def test_the_range_of_anisotropy_is_where_contacts_are_not_negative(a, eta):
    """Law: 4π ξ(n) = 1 + a(3n₁² − 1)/2 ≥ 0 in every direction, just where a medium can be made."""
    c = np.linspace(-1, 1, 2001)
    possible = (1 + a * (3 * c**2 - 1) / 2).min() >= 0
    try:
        Medium(anisotropy=a, stiffness_ratio=eta)
    except ValueError:
        assert not possible
    else:
        assert possible


def test_a_medium_is_a_pytree_whose_closure_is_fixed():
    """Parameters are leaves that jax may trace; the closure chooses the equations and is not."""
    medium = Medium(closure="consistent", rotation_inertia=2e-7)
    leaves, tree = jax.tree.flatten(medium)
    assert len(leaves) == len(medium.known()) - 1  # curvature_inertia is None, no leaf
    assert jax.tree.unflatten(tree, leaves) == medium
    doubled = jax.tree.map(lambda x: 2 * x, medium)
    assert doubled.density == 2 * medium.density
    assert doubled.closure == "consistent"
    # 2a would be out of range for a = 1.5; a traced value is not a number to check.
    assert jax.jit(lambda m: m.anisotropy * 2)(Medium(anisotropy=1.5)) == 3.0


def test_tensors_of_a_traced_medium_are_those_of_numbers():
    medium = Medium(anisotropy=0.37, stiffness_ratio=0.8)
    for make in (average_stiffness, relative_stiffness, gradient_stiffness):
        expected = make(medium)
        traced = jax.jit(make)(medium)
        assert isinstance(traced, jax.Array)
        np.testing.assert_allclose(traced, expected, rtol=0, atol=1e-14 * np.abs(expected).max())


def test_derivative_of_the_stiffness_by_the_anisotropy():
    """Appendix B is linear in a: M₁₁₁₁ has 2p₁ + 10p₂ per a, M₁₁₂₂ has p₂. To 1e-13."""
    medium = Medium(stiffness_ratio=0.3)
    p1, p2 = 5.0 * (1 + 6 * 0.3) / 105, 5.0 * (1 - 0.3) / 105

    def components(a):
        M = relative_stiffness(dataclasses.replace(medium, anisotropy=a))
        return jnp.stack([M[0, 0, 0, 0], M[0, 0, 1, 1]]) / (1e-6 * 1e9)

    slope = jax.jacfwd(components)(0.4)
    np.testing.assert_allclose(slope, [2 * p1 + 10 * p2, p2], rtol=1e-13)
