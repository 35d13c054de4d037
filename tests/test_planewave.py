"""The spectral solver for real k: its accuracy, its laws, and the numbers it is known to give."""

from __future__ import annotations

import dataclasses

import mode_shapes as modes
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from media import any_media, media, printed_media, twelve_by_twelve

from wavesim import planewave
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.planewave import eigenproblem as spectral
from wavesim.planewave import hyperbolicity

property_test = settings(deadline=None, derandomize=True, max_examples=60)
k_bars = st.floats(0.02, 1.0)
# Media without waves of ω = 0, which η = 0 has: laws relative to ω need one.
moving = {"eta": (0.01, 1.0)}
TABLE_1 = Medium()
BAR = TABLE_1.time_scale


def per_metre(medium, k_bar):
    return 2 * np.pi * k_bar / medium.branch_length


def fastest(medium, block):
    """c∞ = √(C_φφ/m_φ) of a block, or of a block without rotation 1, m/s."""
    form = spectral.spectral_form(medium, block)
    scaled = np.sqrt(form.c_pp[0, 0]) if form.c_pp.size else 1.0
    return scaled * medium.length_scale / medium.time_scale


# ---- accuracy ------------------------------------------------------------------------------


@property_test
@given(any_media(), k_bars)
def test_modes_solve_the_twelve_equations(medium, k_bar):
    """Law: (K(k) − ω²) v = 0 with the mode shapes as given out, in SI, all twelve fields.

    Tolerance 1e-12 of ‖K‖‖v‖ as asked; measured at most 2e-15 over 300 media.
    """
    k = per_metre(medium, k_bar)
    K, root = twelve_by_twelve(medium, k)
    for block in ROTATION.blocks:
        found = modes.block_modes(medium, block, [k])
        for omega, shape in zip(found.omega[0], found.shapes[0], strict=True):
            v = root * shape
            residual = np.linalg.norm(K @ v - omega**2 * v)
            assert residual <= 1e-12 * np.linalg.norm(K) * np.linalg.norm(v)


@property_test
@given(any_media(), k_bars)
def test_sectors_agree_with_the_twelve_by_twelve_matrix(medium, k_bar):
    """Two routes: eigenvalues of the 12 × 12 matrix in SI, and the scaled sectors.

    Tolerance 1e-10 of ω, on top of what rounding of the 12 × 12 eigenvalues (1e-15 ‖K‖) allows
    an ω² much less than ‖K‖. Measured at most 3e-13 of ω and 2e-15 ‖K‖ over 300 media.
    """
    k = per_metre(medium, k_bar)
    K, _ = twelve_by_twelve(medium, k)
    expected = np.sort(np.linalg.eigvals(K).real)
    squares = np.sort(
        np.concatenate([planewave.frequencies(medium, s, k).ravel() for s in ROTATION.sectors]) ** 2
    )
    allowed = 1e-10 * squares + 1e-14 * np.linalg.norm(K)
    assert np.all(np.abs(squares - expected) <= allowed)


@property_test
@given(any_media(**moving, G_n_g=st.just(0.0)), k_bars)
def test_closed_form_inverts_the_eigenvalues(medium, k_bar):
    """Two routes at Γ = 0: k² = ω²/D(ω²) at ω(k) gives k back.

    δk = δω/(∂ω/∂k): the error is measured as one of ω and held to 1e-10 of it; a branch so flat
    that its ω is the pole of D to rounding (a wave that does not couple to φ) has no k(ω).
    """
    k = per_metre(medium, k_bar)
    for sector in ("longitudinal", "transverse2"):
        omega = planewave.frequencies(medium, sector, k)[0]
        speed = planewave.group_velocity(medium, sector, k)[0]
        for w, v in zip(omega, speed, strict=True):
            if abs(v) * k > 1e-4 * w:
                back = planewave.wavenumber(medium, sector, w)[0]
                assert abs(back - k) * abs(v) <= 1e-10 * w


def _determinant(form, k, square):
    """det(K(k) − ω²) by the rule of Sarrus, exact for complex k too."""
    m = spectral.stiffness(form, k) - square * np.eye(spectral.stiffness(form, 1.0).shape[-1])
    if m.shape == (1, 1):
        return m[0, 0]
    return (
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1])
        - m[0, 1] * (m[1, 0] * m[2, 2] - m[1, 2] * m[2, 0])
        + m[0, 2] * (m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0])
    )


@property_test
@given(
    st.one_of(any_media(**moving), media("appendix_c", a=(0.0, 0.5), eta=(0.01, 1.0))),
    st.floats(0.05, 1.0),
)
def test_group_velocity_against_complex_steps(medium, k_bar):
    """∂ω/∂k = −(∂F/∂k)/(∂F/∂ω), F = det(K(k) − ω²), both by complex steps of 1e-30, no difference.

    Tolerance 1e-9 of c∞; where two ω² of a block are near (distance d), ∂F/∂ω ~ d loses digits,
    and 1e-9 is divided by d relative to the largest ω². Measured at most 3e-14.
    """
    k = k_bar * 2 * np.pi
    for block in ROTATION.blocks:
        form = spectral.spectral_form(medium, block)
        squares = spectral.solve(form, np.array([k])).squares[0]
        assume((hyperbolicity.growth_rates(squares) == 0).all())  # as some of Appendix C's grow
        squares = np.real(squares)
        speed = planewave.block_group_velocity(medium, block, k / medium.length_scale)[0]
        to_si = medium.length_scale / medium.time_scale
        limit = fastest(medium, block) / to_si
        for i, square in enumerate(squares):
            step = 1e-30
            by_k = _determinant(form, k + 1j * step, square).imag / step
            by_square = _determinant(form, k, square + 1j * step).imag / step
            others = np.abs(np.delete(squares, i) - square) / squares.max()
            near = others.min(initial=1.0)
            if near > 1e-6:
                expected = -by_k / by_square / (2 * np.sqrt(square))
                assert abs(speed[i] / to_si - expected) <= 1e-9 / near * max(limit, 1e-3)


@property_test
@given(media(**moving), k_bars)
def test_group_velocity_is_energy_velocity(medium, k_bar):
    """Law: in a conservative medium energy travels at ∂ω/∂k. Tolerance 1e-9 of c∞;
    measured at most 1e-15 over 300 media."""
    k = per_metre(medium, k_bar)
    for block in ROTATION.blocks:
        group = planewave.block_group_velocity(medium, block, k)
        energy = modes.energy_velocity(medium, block, k)
        size = max(fastest(medium, block), np.abs(group).max())
        assert np.abs(group - energy).max() <= 1e-9 * size


@property_test
@given(any_media(**moving), k_bars)
def test_modes_hold_one_joule_per_cubic_metre(medium, k_bar):
    """½ ω² (ρβ|Φ|² + ργ|B|²) = 1 J/m³, twice the mean kinetic energy density. Rounding only."""
    k = per_metre(medium, k_bar)
    for block in ROTATION.blocks:
        found = modes.block_modes(medium, block, [k])
        phi, bend = found.shapes[0][:, :3], found.shapes[0][:, 3:]
        inertia = medium.beta * np.sum(np.abs(phi) ** 2, axis=1)
        inertia += medium.gamma * np.sum(np.abs(bend) ** 2, axis=1)
        energy = 0.5 * found.omega[0] ** 2 * medium.density * inertia
        np.testing.assert_allclose(energy, 1.0, rtol=1e-12)


def test_energy_velocity_wants_an_energy():
    with pytest.raises(ValueError, match=r"is not symmetric.*consistent"):
        modes.energy_velocity(Medium(anisotropy=0.5), ROTATION.blocks[0], [100.0])
    with pytest.raises(ValueError, match="k = 0"):
        modes.energy_velocity(TABLE_1, ROTATION.blocks[0], [0.0])


# ---- known numbers ---------------------------------------------------------------------------

GAPS = {
    (0.0, "printed"): "0.8911–1.1939 1.3519–1.4270 0.7706–1.0090 1.1053–1.1939 1.0090–1.1939",
    (0.0, "consistent"): "0.8911–1.1939 1.3519–1.4270 0.7706–1.0090 1.1053–1.1939 1.0090–1.1939",
    (0.0, "appendix_c"): "0.8911–1.1939 1.3519–1.4270 0.7706–1.0090 1.1053–1.1939 1.0090–1.1939",
    (0.5, "consistent"): "0.9826–1.2021 1.2762–1.4753 0.8319–1.0104 1.0705–1.2464 0.9572–1.1249",
    (0.5, "printed"): "1.0276–1.1814 1.2403–1.5256 0.8063–1.0583 1.1578–1.2475 0.9025–1.0787",
    (0.5, "appendix_c"): "1.0195–1.1814 1.2303–1.5256 0.8063–1.0583 1.1578–1.2475 0.9025–1.0787",
    (1.0, "appendix_c"): "1.0563–1.0619 1.1702–1.6904 0.8405–1.1053 1.2078–1.2989 0.7816–0.9496",
}


@pytest.mark.parametrize(("a", "closure"), GAPS)
def test_gap_edges_to_the_digits_of_the_table(a, closure):
    """The table of reference gap edges, ω̄ at η = 0.5, derived apart from this program."""
    medium = Medium(anisotropy=a, closure=closure)
    found = [
        f"{gap.lower * BAR:.4f}–{gap.upper * BAR:.4f}"
        for sector in ("longitudinal", "transverse2", "inplane")
        for gap in planewave.gaps(medium, sector)
    ]
    assert " ".join(found) == GAPS[a, closure]


def test_findings_on_the_paper_in_numbers():
    """With the paper's own tensors: TO(B[12]) falls, RTB2 widens, RLB1 stays open at a = 1.
    With the printed coefficients longitudinal waves of k̄ = 0.45 grow at 8e4 1/s for η = 0.6."""
    medium = Medium(anisotropy=1.0, closure="consistent")
    rlb1, _ = planewave.gaps(medium, "longitudinal")
    _, rtb2 = planewave.gaps(medium, "transverse2")
    _, rtb2_before = planewave.gaps(TABLE_1, "transverse2")
    assert f"{planewave.cutoffs(medium, 'transverse2')[0] * BAR:.3f}" == "0.984"
    assert f"{(rtb2_before.upper - rtb2_before.lower) * BAR:.3f}" == "0.089"
    assert f"{(rtb2.upper - rtb2.lower) * BAR:.3f}" == "0.277"
    assert f"{rlb1.lower * BAR:.4f}–{rlb1.upper * BAR:.4f}" == "1.0466–1.1388"
    with pytest.raises(planewave.NotHyperbolicError) as error:
        planewave.check_hyperbolic(
            Medium(anisotropy=1.0, stiffness_ratio=0.6, closure="appendix_c")
        )
    assert error.value.k * 1e-3 / (2 * np.pi) == pytest.approx(0.45, abs=5e-3)
    assert error.value.growth_rate == pytest.approx(8e4, rel=0.05)


def test_speeds_and_the_unit_of_frequency():
    """Fastest 4121 and 3569, long-wave 2914 and 2524 m/s at a = 0; ω̄ = 1 is about 785 kHz."""
    assert round(fastest(TABLE_1, ROTATION.blocks[0])) == 4121
    assert round(fastest(TABLE_1, ROTATION.blocks[1])) == 3569
    assert round(planewave.long_wave_speed(TABLE_1, "longitudinal")) == 2914
    assert round(planewave.long_wave_speed(TABLE_1, "transverse2")) == 2524
    assert round(1e-3 / (2 * np.pi * BAR)) == 785
    with pytest.raises(ValueError, match="no acoustic branch"):
        planewave.long_wave_speed(TABLE_1, "inplane")


@pytest.mark.parametrize("closure", ["printed", "consistent"])
def test_long_waves_are_exact_relative_to_themselves(closure):
    """ω → c₀k as k → 0. At k̄ = 1e-6 ω² is 1e-11 of ‖K‖: eigenvalues alone would keep 5 digits.

    Resolution: (k̄)² = 1e-12 of dispersion. Tolerance 1e-10; measured 3e-12.
    """
    medium = Medium(anisotropy=0.5, closure=closure)
    k = per_metre(medium, 1e-6)
    for sector in ("longitudinal", "transverse2"):
        speed = planewave.long_wave_speed(medium, sector)
        assert abs(planewave.frequencies(medium, sector, k)[0, 0] / k / speed - 1) < 1e-10
        assert abs(planewave.group_velocity(medium, sector, k)[0, 0] / speed - 1) < 1e-10
        assert planewave.group_velocity(medium, sector, 0.0)[0, 0] == speed


def test_without_tangential_stiffness_long_waves_still_have_a_speed():
    """At η = 0 B[12] costs no energy and has ω = 0; TA keeps its speed, the limit η → 0."""
    speeds = [
        planewave.long_wave_speed(Medium(stiffness_ratio=eta), "transverse2") for eta in (0.0, 1e-7)
    ]
    assert speeds[0] == pytest.approx(speeds[1], rel=1e-6)
    assert np.isfinite(
        planewave.group_velocity(Medium(stiffness_ratio=0.0), "transverse2", 0.0)
    ).all()


# ---- laws --------------------------------------------------------------------------------------


@property_test
@given(media(), st.floats(0.0, 1.0))
def test_consistent_media_are_stable(medium, k_bar):
    """ω² ≥ 0: the energy is a sum of squares. The 12 × 12 matrix is Hermitian and not negative."""
    K, _ = twelve_by_twelve(medium, per_metre(medium, k_bar))
    assert np.abs(K - K.conj().T).max() <= 1e-13 * np.abs(K).max()
    assert np.linalg.eigvalsh(K).min() >= -1e-13 * np.abs(K).max()
    planewave.check_hyperbolic(medium)


@settings(deadline=None, derandomize=True, max_examples=25)
@given(printed_media(G_n_g=st.just(1.25e-11)))
def test_printed_media_are_stable_where_the_paper_looks(medium):
    """ω² of Eqs. (26)–(37) stays real for 0 ≤ a ≤ 1, 0 ≤ η ≤ 1 and the gradient stiffness of
    Table 1, whatever the other parameters. (With G_n_g = 1 N·m some media grow.)"""
    planewave.check_hyperbolic(medium)


@property_test
@given(media())
def test_gap_edges_interlace(medium):
    """asymptote₁ ≤ cutoff₁ ≤ asymptote₂ ≤ cutoff₂: removing c_bp c_pp⁻¹ c_pb, of rank one and not
    negative, from c_bb moves its eigenvalues down, and none past the next (Cauchy)."""
    for sector in ("longitudinal", "transverse2"):
        low, high = planewave.asymptotes(medium, sector), planewave.cutoffs(medium, sector)
        edges = np.ravel(np.column_stack([low, high])) ** 2
        assert np.all(np.diff(edges) >= -1e-12 * edges[-1])
        assert all(gap.upper >= gap.lower for gap in planewave.gaps(medium, sector))
    for low, high in planewave.full_gaps(medium):
        assert low < high


@property_test
@given(media(eta=(1.0, 1.0)))
def test_equal_stiffness_closes_the_upper_gaps_of_isotropic_media(medium):
    """η = 1: G is isotropic and M diagonal. RSB closes for every a. RLB2 and RTB2 run between
    the two diagonal components M₂₂₂₂ ∝ 5 − a and M₁₁₁₁ ∝ 5 + 2a, so they close at a = 0 alone
    (for a > 0 the wave with 5 − a does not couple to φ and is both asymptote and cutoff)."""
    isotropic = dataclasses.replace(medium, anisotropy=0.0)
    size = planewave.cutoffs(isotropic, "longitudinal")[-1]
    for name, gap in {
        gap.name: gap for s in ROTATION.sectors for gap in planewave.gaps(isotropic, s)
    }.items():
        if name in ("RLB2", "RTB2", "RSB"):
            assert gap.upper - gap.lower <= 1e-7 * size, name
    (shear,) = planewave.gaps(medium, "inplane")
    assert shear.upper - shear.lower <= 1e-12 * shear.upper


def test_equal_stiffness_leaves_the_upper_gaps_of_other_media_open():
    """At η = 1, a = 0.5 RLB2 runs from √((5 − a)p₁/m_B) to √((5 + 2a)p₁/m_B), by hand."""
    medium = Medium(anisotropy=0.5, stiffness_ratio=1.0, closure="consistent")
    p1_per_inertia = medium.G_n_r / 15 * medium.branch_length**2 * medium.contact_density
    p1_per_inertia /= medium.density * medium.gamma
    for sector in ("longitudinal", "transverse2"):
        gap = planewave.gaps(medium, sector)[1]
        assert gap.lower == pytest.approx(np.sqrt(4.5 * p1_per_inertia), rel=1e-12)
        assert gap.upper == pytest.approx(np.sqrt(6.0 * p1_per_inertia), rel=1e-12)


@property_test
@given(any_media())
def test_no_tangential_stiffness_closes_rtb1(medium):
    """η = 0: contacts resist no rotation across them, so B[12] costs nothing and TO starts at 0.

    Edges are √ of eigenvalues whose rounding is 1e-16 of the largest: 1e-7 of the largest ω.
    """
    free = dataclasses.replace(medium, stiffness_ratio=0.0)
    gap = planewave.gaps(free, "transverse2")[0]
    assert gap.upper <= 1e-7 * planewave.cutoffs(free, "transverse2")[-1]


@property_test
@given(any_media(**moving), k_bars, st.floats(0.1, 10.0))
def test_stiffness_scales_the_square_of_frequency(medium, k_bar, c):
    """All stiffnesses times c: ω times √c, to 1e-12."""
    stiff = {name: c * getattr(medium, name) for name in ("G_n_a", "G_n_r", "G_n_g")}
    other = dataclasses.replace(medium, **stiff)
    k = per_metre(medium, k_bar)
    for sector in ROTATION.sectors:
        one, two = (planewave.frequencies(m, sector, k) for m in (medium, other))
        np.testing.assert_allclose(two, np.sqrt(c) * one, rtol=1e-12, atol=1e-15 * one.max())


@property_test
@given(any_media(**moving), k_bars, st.floats(0.1, 10.0))
def test_length_scales_frequency_by_the_power_of_five_halves(medium, k_bar, c):
    """All lengths times c (so N_p over c³): ω(k/c) times c^(−5/2), to 1e-12.

    m_φ ~ R²/(l²N_p) ~ c³ with k² ~ c⁻², and m_B ~ R⁴/(l²N_p) ~ c⁵, for stiffnesses in N·m.
    """
    other = dataclasses.replace(
        medium,
        branch_length=c * medium.branch_length,
        particle_radius=c * medium.particle_radius,
        contact_density=medium.contact_density / c**3,
    )
    k = per_metre(medium, k_bar)
    for sector in ROTATION.sectors:
        one = planewave.frequencies(medium, sector, k)
        two = planewave.frequencies(other, sector, k / c)
        np.testing.assert_allclose(two, c**-2.5 * one, rtol=1e-12, atol=1e-15 * one.max())


# ---- waves that grow ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "medium",
    [
        Medium(anisotropy=2.0, stiffness_ratio=1.3),
        Medium(anisotropy=1.0, stiffness_ratio=0.6, closure="appendix_c"),
    ],
)
def test_growing_waves_are_found_with_their_k_and_rate(medium):
    """check_hyperbolic names a k at which det(K(k) − (ω + iσ)²) = 0 has σ the rate it names, and
    no k within a decade either side, on a grid of 4001, grows faster (to 1e-6)."""
    with pytest.raises(planewave.NotHyperbolicError, match=r"longitudinal.*unstable") as error:
        planewave.check_hyperbolic(medium)
    k, rate = error.value.k, error.value.growth_rate
    assert error.value.sector == "longitudinal"
    form = spectral.spectral_form(medium, ROTATION.blocks[0])

    def growth(wavenumber):
        K = spectral.stiffness(form, wavenumber * medium.length_scale)
        return np.sqrt(np.linalg.eigvals(K).astype(complex)).imag.max() / medium.time_scale

    assert growth(k) == pytest.approx(rate, rel=1e-6)
    around = [growth(x) for x in k * np.geomspace(0.1, 10, 4001)]
    assert max(around) <= rate * (1 + 1e-6)
    with pytest.raises(planewave.NotHyperbolicError):
        planewave.frequencies(medium, "longitudinal", k)


def test_a_window_of_growth_between_the_points_of_a_scan_is_found():
    """Near the edge of stability growth is confined to a window of k too narrow for a scan; it
    is found because two ω² come near each other on both sides of it."""
    low, high = 0.5, 0.6
    for _ in range(40):
        eta = 0.5 * (low + high)
        try:
            planewave.check_hyperbolic(
                Medium(anisotropy=1.0, stiffness_ratio=eta, closure="appendix_c")
            )
            low = eta
        except planewave.NotHyperbolicError:
            high = eta
    medium = Medium(anisotropy=1.0, stiffness_ratio=high, closure="appendix_c")
    scan = np.geomspace(1e-3, 1e4, 1401)
    squares = spectral.solve(spectral.spectral_form(medium, ROTATION.blocks[0]), scan).squares
    assert not hyperbolicity.growth_rates(squares).any()
    with pytest.raises(planewave.NotHyperbolicError):
        planewave.check_hyperbolic(medium)


# ---- what is refused -----------------------------------------------------------------------------


def test_unknown_sectors_are_refused():
    for call in (planewave.frequencies, planewave.group_velocity, planewave.wavenumber):
        with pytest.raises(ValueError, match="sector 'axial': must be one of longitudinal"):
            call(TABLE_1, "axial", [1.0])


def test_gradient_share_of_table_1_is_negligible():
    """Γ(2π/l)²/C_BB with Table 1: about 1e-12 of the rest times (2π)², so gaps are fair without."""
    assert 1e-12 < planewave.gradient_share(TABLE_1) < 1e-9
    for eta in (0.0, 0.5):  # a micro-field of no stiffness has no share either
        none = dataclasses.replace(TABLE_1, G_n_g=0.0, stiffness_ratio=eta)
        assert planewave.gradient_share(none) == 0
