"""Transmission, reflection, Bloch waves of layered stacks: conservation, reciprocity, formulas."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from media import any_media, media

from wavesim import layered as layeredwave
from wavesim import planewave
from wavesim.layered import graded_layer as collocation
from wavesim.layered.cross_section import generator, joined
from wavesim.layered.stack import Stack
from wavesim.layered.star_product import star
from wavesim.material.damping import Damping
from wavesim.material.granular_equations import ROTATION
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium

ONE = Medium(anisotropy=0.25, closure="consistent", G_n_g=0.0)
TWO = Medium(anisotropy=0.6, closure="consistent", density=2300.0, G_n_a=8.0, G_n_g=0.0)
BAR = ONE.time_scale
OMEGA = np.linspace(0.05, 2.5, 60) / BAR


def stacked(*parts):
    """Layers of given thickness in order."""
    edges = np.concatenate([[0.0], np.cumsum([thickness for thickness, _ in parts])])
    return Layers(
        tuple(
            Layer(float(a), float(b), medium)
            for a, b, (_, medium) in zip(edges[:-1], edges[1:], parts, strict=True)
        )
    )


def stacks(medium):
    one = st.tuples(st.floats(1e-4, 1e-2), medium)
    return st.lists(one, min_size=2, max_size=5).map(lambda parts: stacked(*parts))


@settings(deadline=None, derandomize=True, max_examples=60)
@given(stacks(any_media()), st.sampled_from(["longitudinal", "transverse2"]))
def test_what_comes_in_goes_out_without_gradient(layers, sector):
    """R + T = 1 from either side, and the same T both ways, over random stacks of either closure.

    Tolerance 1e-10, rounding near asymptotes. Measured 4e-14 and 3e-15.
    """
    tau = layers.first.time_scale
    found = layeredwave.transmission(layers, sector, OMEGA * BAR / tau, gradient=False)
    for total in (found.power_T + found.power_R, found.power_T_back + found.power_R_back):
        assert np.abs(total[np.isfinite(total)] - 1).max(initial=0.0) <= 1e-10
    both = np.isfinite(found.power_T) & np.isfinite(found.power_T_back)
    assert np.abs(found.power_T - found.power_T_back)[both].max(initial=0.0) <= 1e-10


@settings(deadline=None, derandomize=True, max_examples=30)
@given(stacks(media(eta=(0.05, 1.0), G_n_g=st.just(0.5))))
def test_what_comes_in_goes_out_with_gradient(layers):
    """R + T = 1, all three modes together. Tolerance 1e-8, rounding. Measured 2e-13."""
    tau = layers.first.time_scale
    found = layeredwave.transmission(layers, "longitudinal", OMEGA * BAR / tau)
    total = found.power_T + found.power_R
    assert np.abs(total[np.isfinite(total)] - 1).max(initial=0.0) <= 1e-8


def test_one_interface_has_fresnels_formulas():
    """R = (Z₁ − Z₂)/(Z₁ + Z₂), T = 2Z₁/(Z₁ + Z₂) for φ, Z = ρβω/k, also in gaps.

    Two layers of the half-spaces' own media: phases alone. Tolerance 1e-12, rounding; measured
    2e-14.
    """
    a, b = 1.3e-3, 0.7e-3
    found = layeredwave.transmission(stacked((a, ONE), (b, TWO)), "longitudinal", OMEGA)
    k1, k2 = (planewave.wavenumber(m, "longitudinal", OMEGA) for m in (ONE, TWO))
    Z1, Z2 = ONE.density * ONE.beta * OMEGA / k1, TWO.density * TWO.beta * OMEGA / k2
    R = (Z1 - Z2) / (Z1 + Z2) * np.exp(2j * k1 * a)
    T = 2 * Z1 / (Z1 + Z2) * np.exp(1j * (k1 * a + k2 * b))
    assert np.abs(found.R - R).max() <= 1e-12
    assert np.abs(found.T - T).max() <= 1e-12


def test_a_gap_of_any_thickness_lets_through_what_decay_leaves():
    """|T| = 4|Z₁Z₂|/|Z₁ + Z₂|² e^{−κd} for a gap with κd of 500, where T's matrix overflows.

    Tolerance 1e-11 of T, κd times rounding; measured 1.6e-12.
    """
    gap = dataclasses.replace(ONE, G_n_a=4.0, G_n_r=1.5)
    low, high = (
        planewave.gaps(gap, "longitudinal")[0].lower,
        planewave.asymptotes(ONE, "longitudinal")[0],
    )
    omega = np.array([low + 0.3 * (min(planewave.gaps(gap, "longitudinal")[0].upper, high) - low)])
    k1, k2 = (planewave.wavenumber(m, "longitudinal", omega) for m in (ONE, gap))
    assert k2.real == 0
    thickness = float(500 / k2.imag[0])
    layers = stacked((1e-3, ONE), (thickness, gap), (1e-3, ONE))
    found = layeredwave.transmission(layers, "longitudinal", omega)
    Z1, Z2 = 1 / k1, gap.density * gap.beta / (ONE.density * ONE.beta) / k2
    expected = 4 * abs(Z1 * Z2) / abs(Z1 + Z2) ** 2 * np.exp(-500)
    assert np.abs(np.abs(found.T) / expected - 1).max() <= 1e-11
    assert abs(found.power_R[0] - 1) <= 1e-12


def test_a_damped_layer_decays_as_its_wavenumber():
    """T through a uniform damped stretch = exp(ikL), k of planewave.wavenumber.

    Tolerance 1e-12, rounding; measured 3e-15.
    """
    damping = Damping(mass=0.05 / BAR, stiffness=0.02 * BAR, rates=(1 / BAR,), strengths=(0.2,))
    medium = dataclasses.replace(ONE, damping=damping)
    found = layeredwave.transmission(stacked((2e-3, medium), (3e-3, medium)), "longitudinal", OMEGA)
    k = planewave.wavenumber(medium, "longitudinal", OMEGA)
    assert k.imag.min() > 0
    assert np.abs(found.T - np.exp(5e-3j * k)).max() <= 1e-12
    assert np.abs(found.R).max() <= 1e-12


@pytest.mark.parametrize("gradient", [0.0, 0.5])
def test_graded_steps_are_of_order_sixteen(gradient):
    """The error of S falls by 2¹⁶ from one step to two: log₂ from 14 to 17; measured 15.7 and 14.1.

    It is held against 64 steps; the second halving ends in rounding. The refined S is good to
    1e-10 as stated; measured 3e-15.
    """
    one, two = (dataclasses.replace(m, G_n_g=gradient) for m in (ONE, TWO))
    layer = Layer(0.0, 0.7e-3 if gradient else 3e-3, one, two, "linear")
    stack = Stack(Layers((layer,)), ROTATION.blocks[0], np.array([0.5, 0.7]) / BAR, gradient > 0)
    end = layer.end / stack.units.length

    def system(x, chosen):
        here = joined([stack.section(layer, at * stack.units.length) for at in x])
        return generator(here, stack.scaled[chosen]), np.zeros((len(x), len(chosen), 2 * here.size))

    def whole(steps):
        edges = np.linspace(0, end, steps + 1)
        total = None
        for a, b in itertools.pairwise(edges):
            one_step = collocation.step(system, a, b - a, np.arange(2))
            total = one_step if total is None else star(total, one_step)
        return total.whole

    exact = whole(64)
    errors = [np.abs(whole(n) - exact).max() for n in (1, 2)]
    assert 14 <= np.log2(errors[0] / errors[1]) <= 17
    adaptive = stack.whole().whole
    assert np.abs(adaptive - exact).max() <= 1e-10


def test_bloch_waves_against_eigenvalues_of_the_transfer_matrix():
    """cos qL = ½ tr T with T multiplied out of (φ, σ) matrices in SI; and |e^{iqL}| ≤ 1.

    Tolerance 1e-10 of 1 + |cos qL|, rounding; measured 4e-14.
    """
    cell = stacked((1.5e-3, ONE), (2e-3, TWO), (0.8e-3, ONE))
    T = np.broadcast_to(np.eye(2), (len(OMEGA), 2, 2)).astype(complex)
    for layer in cell.layers:
        k = planewave.wavenumber(layer.medium, "longitudinal", OMEGA)
        D = layer.medium.density * layer.medium.beta * OMEGA**2 / k**2
        phase = k * layer.thickness
        c, s = np.cos(phase), np.sin(phase)
        one = np.array([[c, s / (D * k)], [-D * k * s, c]]).transpose(2, 0, 1)
        T = one @ T
    half = np.trace(T, axis1=1, axis2=2) / 2
    q = layeredwave.bloch(cell, "longitudinal", OMEGA)
    assert np.abs((np.cos(q * cell.length) - half) / (1 + np.abs(half))).max() <= 1e-10
    assert q.imag.min() >= 0
    assert (q.real * cell.length).max() <= np.pi
    assert (q.real * cell.length > -np.pi).all()
    stops = layeredwave.stop_bands(cell, "longitudinal", (OMEGA[0], 0.85 / BAR))
    for omega, decays in zip(OMEGA, q.imag > 0, strict=True):
        if omega < 0.85 / BAR:
            assert decays == any(a <= omega <= b for a, b in stops)
    for a, b in stops:
        for edge in (a, b):
            if OMEGA[0] < edge < 0.85 / BAR:
                at = np.cos(layeredwave.bloch(cell, "longitudinal", edge)[0] * cell.length)
                assert abs(abs(at) - 1) <= 1e-8


def test_at_a_cutoff_itself_is_what_is_beside_it():
    """T and q at the very number at which C_BB − ω²I is singular, as 1e-12 off it; to 1e-4."""
    medium = Medium(anisotropy=0.3, closure="consistent")
    cell = stacked((1.5e-3, medium), (2e-3, TWO), (0.8e-3, medium))
    for edge in planewave.cutoffs(medium, "transverse2"):
        at = edge * np.array([1.0, 1 + 1e-12])
        sent = layeredwave.transmission(cell, "transverse2", at, False)
        assert np.abs(np.diff(sent.T)) <= 1e-4
        assert np.isfinite(layeredwave.bloch(cell, "transverse2", at, False)).all()


def test_bloch_wave_of_a_uniform_cell_is_its_wave():
    """q = k of a uniform medium, folded into −π < qL ≤ π, energy forward; Γ kept and not.

    Tolerance 1e-8 of π/L: with Γ from a general eigenproblem. Measured 2e-16.
    """
    for gradient in (0.0, 0.5):
        medium = dataclasses.replace(ONE, G_n_g=gradient)
        cell = stacked((0.4e-3, medium), (0.6e-3, medium))
        omega = np.array([0.3, 0.6, 0.8]) / BAR
        q = layeredwave.bloch(cell, "longitudinal", omega).reshape(3, -1)
        k = planewave.complex_waves(medium, ROTATION.blocks[0], omega).k[:, 0]
        assert (k.imag == 0).all()
        folded = (k.real * cell.length + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(q * cell.length - folded[:, None]).min(axis=1).max() <= 1e-8


def test_what_has_no_answer_is_refused():
    layers = stacked((1e-3, ONE))
    with pytest.raises(ValueError, match="nothing travels"):
        layeredwave.transmission(layers, "inplane", [1e6])
    with pytest.raises(ValueError, match="omega = 0"):
        layeredwave.transmission(layers, "longitudinal", [0.0])
    with pytest.raises(ValueError, match="Γ is singular"):
        layeredwave.transmission(layers, "longitudinal", [1e6], gradient=True)
