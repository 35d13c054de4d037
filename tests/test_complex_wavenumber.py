"""Complex wavenumbers: roots of the determinant, limits, and which of ±k is given."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from media import any_media, media

from wavesim import planewave
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.planewave import eigenproblem as spectral
from wavesim.planewave.complex_wavenumber import complex_waves, wavenumber

property_test = settings(deadline=None, derandomize=True, max_examples=60)
omega_bars = st.floats(0.05, 3.0)
TABLE_1 = Medium()
BAR = TABLE_1.time_scale


def relative_determinant(form, k, omega):
    """|det(K(k) − ω²)| over the sum of the sizes of its terms (scaled k and ω)."""
    m = spectral.stiffness(form, k) - omega**2 * np.eye(spectral.stiffness(form, 1.0).shape[-1])
    sizes = np.abs(spectral.stiffness(form, k)) + abs(omega) ** 2 * np.eye(len(m))
    total, largest = 0.0, 0.0
    for order in itertools.permutations(range(len(m))):
        sign = np.linalg.det(np.eye(len(m))[list(order)])
        total += sign * np.prod([m[i, j] for i, j in enumerate(order)])
        largest += np.prod([sizes[i, j] for i, j in enumerate(order)])
    return abs(total) / largest


@property_test
@given(st.one_of(any_media(), media("appendix_c", a=(-1.0, 2.0))), omega_bars, st.floats(-0.5, 0.5))
def test_roots_make_the_determinant_vanish(medium, real, imaginary):
    """det(K(k) − ω²) = 0 at every root, for real and for complex ω, Γ from 1e-12 of M to as much.

    Tolerance 1e-10 of the sum of the sizes of the determinant's terms; measured at most 7e-13.
    """
    for block in ROTATION.blocks:
        form = spectral.spectral_form(medium, block)
        for omega in (real, complex(real, imaginary)):
            waves = complex_waves(medium, block, omega / medium.time_scale)
            assert np.isfinite(waves.k).all()
            for k in waves.k[0] * medium.length_scale:
                assert relative_determinant(form, k, omega) <= 1e-10


@property_test
@given(any_media(eta=(0.01, 0.99)), omega_bars)
def test_there_is_one_pair_and_one_more_for_each_rank_of_the_gradient_term(medium, omega_bar):
    """Degree of det in k²: 1 + rank Γ with a rotation, rank Γ without."""
    omega = omega_bar / medium.time_scale
    without = dataclasses.replace(medium, G_n_g=0.0)
    for block in ROTATION.blocks:
        p, b = len(block.macro), len(block.micro)
        assert complex_waves(medium, block, omega).k.shape == (1, p + b)
        assert complex_waves(without, block, omega).k.shape == (1, p)


@property_test
@given(any_media(), omega_bars, st.floats(0.0, 0.5))
def test_roots_decay_or_carry_energy_forward(medium, real, imaginary):
    """Im k ≥ 0 always; a real k is the limit of one that decays as Im ω → 0+ (ω + i0).

    A step of 1e-7 in Im ω must move each real root to Im k > 0. Flat waves, whose k moves by more
    than itself, are left out.
    """
    for block in ROTATION.blocks:
        omega = np.array([real]) / medium.time_scale
        assert np.all(complex_waves(medium, block, omega + 1j * imaginary / BAR).k.imag >= 0)
        here = complex_waves(medium, block, omega)
        there = complex_waves(medium, block, omega * (1 + 1e-7j))
        for k, moved in zip(here.k[0], there.k[0], strict=True):
            if k.imag == 0 and abs(moved - k) < 0.01 * abs(k):
                assert moved.imag > 0


@property_test
@given(any_media(eta=(0.01, 1.0)), st.floats(0.05, 1.0))
def test_a_real_wave_is_among_the_roots_of_its_frequency(medium, k_bar):
    """k(ω(k)) holds k: the quadratic problem inverts the eigenvalue problem, Γ included.

    The error in k is that in ω over the slope, so it is weighed by it: 1e-10 of ω. Waves that are
    flat to 1e-4 have no k(ω) that rounding leaves.
    """
    k = 2 * np.pi * k_bar / medium.branch_length
    for block in ROTATION.blocks:
        omega = planewave.block_frequencies(medium, block, k)[0]
        speed = planewave.block_group_velocity(medium, block, k)[0]
        for w, v in zip(omega, speed, strict=True):
            if abs(v) * k > 1e-4 * w:
                roots = complex_waves(medium, block, w).k[0]
                nearest = np.abs(roots - np.sign(v) * k).min()
                assert nearest * abs(v) <= 1e-10 * w


@pytest.mark.parametrize("closure", ["printed", "consistent", "appendix_c"])
def test_full_problem_tends_to_the_closed_form_linearly_in_the_gradient_term(closure):
    """k_Γ − k₀ ~ Γ: slope of the log-log fit over three decades 1 ± 0.01, in a gap and in bands."""
    sizes = np.geomspace(1e-9, 1e-6, 4)
    omega = np.array([0.4, 0.95, 1.15, 1.4, 2.0]) / BAR
    for sector, block in (
        ("longitudinal", ROTATION.blocks[0]),
        ("transverse2", ROTATION.blocks[1]),
    ):
        errors = []
        for size in sizes:
            medium = Medium(anisotropy=0.25, G_n_g=5.0 * size, closure=closure)
            exact = wavenumber(medium, sector, omega)
            errors.append(np.abs(complex_waves(medium, block, omega).k[:, 0] / exact - 1))
        slopes = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
        np.testing.assert_allclose(slopes, 1.0, atol=0.01)


def test_with_table_1_the_closed_form_is_the_wave():
    """Γ is 1e-12 of M: the pair of the closed form differs by less than 1e-8 from the full one."""
    omega = np.linspace(0.05, 3.0, 200) / BAR
    for sector, block in (
        ("longitudinal", ROTATION.blocks[0]),
        ("transverse2", ROTATION.blocks[1]),
    ):
        full = complex_waves(TABLE_1, block, omega)
        closed = wavenumber(TABLE_1, sector, omega)
        near_asymptote = np.abs(closed) * TABLE_1.branch_length > 100
        error = np.abs(full.k[:, 0] / closed - 1)
        assert error[~near_asymptote].max() < 1e-8


def test_in_a_gap_decay_goes_from_infinite_at_the_lower_edge_to_none_at_the_upper():
    """k is imaginary inside and Im k falls all the way, from over 1e3/l to under 1e-3/l."""
    for closure in ("printed", "consistent", "appendix_c"):
        medium = Medium(anisotropy=0.5, closure=closure)
        for sector in ("longitudinal", "transverse2"):
            for gap in planewave.gaps(medium, sector):
                inside = gap.lower + (gap.upper - gap.lower) * np.linspace(1e-9, 1 - 1e-9, 301)
                k = wavenumber(medium, sector, inside) * medium.branch_length
                assert np.abs(k.real).max() == 0
                assert np.all(np.diff(k.imag) < 0)
                assert k.imag[0] > 1e3
                assert k.imag[-1] < 1e-3


def test_decay_length_is_the_distance_of_one_e():
    waves = complex_waves(TABLE_1, ROTATION.blocks[0], np.array([0.5, 1.0]) / BAR)
    assert waves.sector == "longitudinal"
    assert waves.propagates[:, 0].tolist() == [True, False]
    assert np.isinf(waves.decay_length[0, 0])
    assert waves.decay_length[1, 0] * waves.k[1, 0].imag == pytest.approx(1)
    # The two others live on √(Γ/C_BB), a millionth of a particle: in the gap at ω̄ = 1 the one that
    # comes from the branch below has become such a ripple, which the named gap leaves out.
    assert waves.propagates[:, 1:].tolist() == [[False, False], [True, False]]
    assert np.all(np.abs(waves.k[:, 1:]) > 1e5 / TABLE_1.branch_length)


def test_in_plane_waves_by_hand():
    """ω² = c + γk² has one root: k² = (ω² − c)/γ, evanescent below the cutoff, real above."""
    block = ROTATION.blocks[3]
    form = spectral.spectral_form(TABLE_1, block)
    for omega_bar in (0.5, 2.0):
        (k,) = complex_waves(TABLE_1, block, omega_bar / BAR).k[0] * TABLE_1.length_scale
        expected = np.emath.sqrt((omega_bar**2 - form.c_bb[0, 0]) / form.gamma[0, 0])
        assert k == pytest.approx(expected, rel=1e-12)


def test_what_has_no_answer_is_refused():
    with pytest.raises(ValueError, match="omega = 0"):
        complex_waves(TABLE_1, ROTATION.blocks[0], [0.0, 1.0])
    with pytest.raises(ValueError, match="'inplane' has no propagating wave"):
        wavenumber(TABLE_1, "inplane", [1.0])


@property_test
@given(any_media(), omega_bars, st.floats(0.0, 0.5))
def test_fields_are_real(medium, real, imaginary):
    """exp(i(kx − ωt)) and its conjugate are one wave: k(−ω*) = −k(ω)*, to rounding."""
    omega = np.array([complex(real, imaginary)]) / medium.time_scale
    for block in ROTATION.blocks:
        for at in (omega, omega.real):
            there, back = (complex_waves(medium, block, w).k for w in (at, -np.conj(at)))
            assert np.abs(back + np.conj(there)).max(initial=0.0) <= 1e-9 * np.abs(there).min(
                initial=1e300
            )
    for at in (omega, omega.real):
        there, back = (wavenumber(medium, "longitudinal", w) for w in (at, -np.conj(at)))
        assert np.abs(back + np.conj(there)).max() <= 1e-12 * np.abs(there).max()
