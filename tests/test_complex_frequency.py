"""Plane waves with loss: against closed forms of single laws, and each way round."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from media import media, twelve_by_twelve

from wavesim import planewave
from wavesim.material.damping import Damping, constant_quality
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium

TABLE_1 = Medium(anisotropy=0.25, closure="consistent")
BAR = TABLE_1.time_scale
laws = st.builds(
    lambda mass, stiffness, strengths: Damping(
        mass=mass / BAR,
        stiffness=stiffness * BAR,
        rates=tuple(np.array([0.1, 1.0, 10.0]) / BAR),
        strengths=tuple(strengths),
    ),
    st.floats(0, 0.05),
    st.floats(0, 0.05),
    st.lists(st.floats(0, 0.05), min_size=3, max_size=3),
)


def test_rayleigh_damping_in_closed_form():
    """ω = −iδ ± √(ω₀² − δ²), 2δ = α + β_d ω₀². Tolerance 1e-13, rounding; measured 2e-16."""
    law = Damping(mass=3e4, stiffness=2e-8)
    k = np.linspace(0, 2e4, 50)
    medium = dataclasses.replace(TABLE_1, damping=law)
    base = planewave.frequencies(TABLE_1, "longitudinal", k)
    delta = (law.mass + law.stiffness * base**2) / 2
    exact = -1j * delta + np.sqrt(base**2 - delta**2 + 0j)
    exact[base == 0] = 0
    found = planewave.damped_frequencies(medium, "longitudinal", k)
    assert np.abs(found - exact).max() <= 1e-13 * np.abs(exact).max()


@settings(deadline=None, derandomize=True, max_examples=40)
@given(media(eta=(0.01, 1.0)), laws, st.floats(0.05, 1.0))
def test_damped_waves_solve_the_twelve_equations(medium, law, k_bar):
    """det[m(ω) K(k) − ω² ι(ω)] = 0 on the 12 × 12 matrix in SI.

    Least singular value over the largest: tolerance 1e-13, rounding; measured 1.4e-15.
    """
    medium = dataclasses.replace(medium, damping=law)
    k = 2 * np.pi * k_bar / medium.branch_length
    K, _ = twelve_by_twelve(medium, k)
    for sector in ("longitudinal", "inplane"):
        for omega in planewave.damped_frequencies(medium, sector, [k])[0]:
            assert omega.imag <= 0
            matrix = law.modulus(omega) * K - omega**2 * law.inertia(omega) * np.eye(12)
            values = np.linalg.svd(matrix, compute_uv=False)
            assert values[-1] <= 1e-13 * values[0]


@settings(deadline=None, derandomize=True, max_examples=40)
@given(laws, st.floats(0.05, 1.0))
def test_k_of_omega_undoes_omega_of_k(law, k_bar):
    """k(ω(k)) = k at the complex ω of a wave, both routes of k(ω).

    Tolerance 1e-11 of k: rounding over the slope of flat branches; measured 6e-14.
    """
    medium = dataclasses.replace(TABLE_1, damping=law, G_n_g=0.0)
    k = 2 * np.pi * k_bar / medium.branch_length
    omega = planewave.damped_frequencies(medium, "longitudinal", [k])[0]
    for found in (
        planewave.wavenumber(medium, "longitudinal", omega),
        planewave.complex_waves(medium, ROTATION.blocks[0], omega).k[:, 0],
    ):
        # A root is given with Im k ≥ 0: at these ω it may be −k.
        assert np.minimum(np.abs(found - k), np.abs(found + k)).max() <= 1e-11 * k


def test_constant_quality_takes_its_share_of_every_wave():
    """Spatial loss of long acoustic waves, which have no dispersion: Im k / Re k = 1/2Q.

    Tolerance 1 %: the fitted law holds Q to less than that in mid-band; measured 0.22 %.
    """
    medium = dataclasses.replace(TABLE_1, damping=constant_quality(50.0, (1e3, 1e6)))
    omega = 2 * np.pi * np.geomspace(3e3, 5e4, 20)
    k = planewave.wavenumber(medium, "longitudinal", omega)
    assert np.abs(2 * 50 * k.imag / k.real - 1).max() <= 0.01


@pytest.mark.parametrize("scale", [1.0, 1 + 0.3j])
def test_a_law_that_loses_nothing_leaves_every_bit(scale):
    """Undamped media go the way they went: the same numbers as with Ω left out."""
    omega = scale * np.linspace(0.1, 3, 50) / BAR
    stiffer = dataclasses.replace(TABLE_1, damping=Damping(unrelaxed=4.0))
    assert (
        planewave.wavenumber(TABLE_1, "transverse2", omega)
        == planewave.wavenumber(stiffer, "transverse2", 2 * omega)
    ).all()


def test_nothing_moves_where_there_is_nothing_to_lose():
    base = np.array([0.0, 1.0, 5e6])
    assert (Damping().lossy(base) == base).all()
