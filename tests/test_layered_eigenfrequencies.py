"""Eigenfrequencies of finite bars: closed forms, none missed, and with loss."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from wavesim import layered as layeredwave
from wavesim import planewave
from wavesim.layered.stack import Stack, returned
from wavesim.material.damping import Damping
from wavesim.material.granular_equations import ROTATION
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium

ONE = Medium(anisotropy=0.25, closure="consistent", G_n_g=0.0)
TWO = Medium(anisotropy=0.6, closure="consistent", density=2300.0, G_n_a=8.0, G_n_g=0.0)
BAR = ONE.time_scale
LENGTH, SPLIT = 1e-2, np.sqrt(2) - 1
BAND = (0.02 / BAR, 2.0 / BAR)


def uniform(medium):
    """In two layers, so that something has to be joined."""
    return Layers((Layer(0.0, SPLIT * LENGTH, medium), Layer(SPLIT * LENGTH, LENGTH, medium)))


def known(medium, half_waves, band):
    omega = np.sort(planewave.frequencies(medium, "longitudinal", half_waves * np.pi / LENGTH), 0)
    omega = np.sort(omega.ravel())
    return omega[(omega > band[0]) & (omega < band[1])]


@pytest.mark.parametrize(
    ("left", "right", "half_waves"),
    [
        ("fixed", "fixed", np.arange(300.0)),
        ("free", "free", np.arange(1, 300.0)),
        ("fixed", "free", np.arange(300.0) + 0.5),
        ("periodic", "periodic", np.concatenate([[0.0], np.repeat(np.arange(2, 300.0, 2), 2)])),
    ],
)
def test_uniform_bars_have_whole_half_waves(left, right, half_waves):
    """ω(k = nπ/L), each once (round a ring, twice), optical branches included.

    Tolerance 1e-12 of ω, bisection to rounding; measured 8e-16. Below the asymptotes those closer
    than the stated spacing on average are left out, and none else.
    """
    spacing = 1e-3 / BAR
    found = layeredwave.resonances(uniform(ONE), left, right, "longitudinal", BAND, spacing=spacing)
    expected = known(ONE, half_waves, BAND)
    ceilings = planewave.asymptotes(ONE, "longitudinal")
    kept = []
    for low, high in zip([0.0, *ceilings], [*ceilings, np.inf], strict=True):
        own, got = (w[(w > low) & (w < high)] for w in (expected, found))
        assert len(got) > 3 or high > BAND[1] or low > 0
        assert np.abs(got / own[: len(got)] - 1).max(initial=0.0) <= 1e-12
        if len(got) < len(own):
            # A ring has two at each frequency: the spacing is the mean one.
            near = own[len(got) : len(got) + 5]
            assert (near[-1] - near[0]) / 4 <= 1.3 * spacing
        kept.append(len(got))
    assert sum(kept) == len(found)


@pytest.mark.parametrize(
    ("left", "right", "half_waves"),
    [("fixed", "fixed", np.arange(60.0)), ("periodic", "periodic", None)],
)
def test_with_gradient_too(left, right, half_waves):
    """The same with Γ large: every branch, no asymptote. Tolerance 1e-12; measured 2e-14."""
    medium = dataclasses.replace(ONE, G_n_g=0.5)
    if half_waves is None:
        half_waves = np.concatenate([[0.0], np.repeat(np.arange(2, 60.0, 2), 2)])
    found = layeredwave.resonances(uniform(medium), left, right, "longitudinal", BAND)
    expected = known(medium, half_waves, BAND)
    assert len(found) == len(expected)
    assert np.abs(found / expected - 1).max() <= 1e-12


@pytest.mark.parametrize("gradient", [0.0, 0.5])
@pytest.mark.parametrize("graded", [False, True])
def test_layered_bars_resonate_where_a_wave_returns_as_it_left(gradient, graded):
    """det(1 − S R) = 0 at each, by scattering matrices that the count does not use.

    Its least singular value, over that halfway to the next: tolerance 1e-7, as it falls linearly;
    measured 2e-14.
    """
    one, two = (dataclasses.replace(m, G_n_g=gradient) for m in (ONE, TWO))
    layers = Layers(
        (
            Layer(0.0, 2e-3, one),
            Layer(2e-3, 4e-3, one, two if graded else None),
            Layer(4e-3, 7e-3, two),
        )
    )
    found = layeredwave.resonances(layers, "fixed", "free", "longitudinal", (0.05 / BAR, 0.8 / BAR))
    assert len(found) >= 3

    def least(omega):
        stack = Stack(layers, ROTATION.blocks[0], omega, gradient > 0)
        S, R = stack.whole().whole, returned(stack, "fixed", "free")
        return np.linalg.svd(np.eye(S.shape[-1]) - S @ R, compute_uv=False)[:, -1]

    halfway = least((found[1:] + found[:-1]) / 2).min()
    assert least(found).max() / halfway <= 1e-7


@pytest.mark.parametrize(
    ("rate", "alike"), [(0.02, True), (0.02, False), (0.3, True), (2.0, True), (2.0, False)]
)
def test_damped_bars_resonate_where_a_wave_returns_as_it_left(rate, alike):
    """With one law for all layers and with two, at losses up to where the waves are overdamped:
    det(1 − S R) = 0 by scattering matrices, whose least singular value is held to 1e-9 of that a
    hundredth of ω away. Where laws differ those that can't be followed are NaN.
    """
    damping = Damping(rate / BAR, 0.01 * BAR, rates=(1 / BAR,), strengths=(0.1,))
    other = damping if alike else Damping(mass=rate / 2 / BAR)
    one, two = (dataclasses.replace(m, damping=law) for m, law in ((ONE, damping), (TWO, other)))
    layers = Layers((Layer(0.0, 4e-3, one), Layer(4e-3, 7e-3, two)))
    band = (0.05 / BAR, 0.8 / BAR)
    found = layeredwave.resonances(layers, "fixed", "free", "longitudinal", band)
    assert len(found) > 3
    known = found[np.isfinite(found)]
    if alike or rate < 1:
        assert len(known) == len(found)
    assert (known.imag < 0).all()
    assert (known.real == 0).any() == (alike and rate > 0.1)

    def least(omega):
        stack = Stack(layers, ROTATION.blocks[0], omega, False)
        S, R = stack.whole().whole, returned(stack, "fixed", "free")
        return np.linalg.svd(np.eye(S.shape[-1]) - S @ R, compute_uv=False)[:, -1]

    assert (least(known) <= 1e-9 * least(known * 1.01)).all()


@pytest.mark.parametrize("density", [1570.0, 1575.0])
@pytest.mark.parametrize("gradient", [0.0, 0.5])
def test_pairs_of_a_ring_stay_two_where_laws_of_loss_differ(density, gradient):
    """Winding of det(1 − S R) round each eigenfrequency: as many as are given within.

    A ring of one medium has each twice without loss; of two media that are nearly one, two that
    losses push past each other. Each circle goes through no other.
    """
    one, two, three = (
        dataclasses.replace(ONE, G_n_g=gradient, damping=law, density=rho)
        for law, rho in (
            (Damping(mass=0.09 / BAR), 1570.0),
            (Damping(stiffness=0.004 * BAR), density),
            (Damping(rates=(1 / BAR,), strengths=(0.04,)), 1570.0),
        )
    )
    parts = ((0.0, 3e-3, one), (3e-3, 5e-3, two), (5e-3, 8.5e-3, three))
    layers = Layers(tuple(Layer(*part) for part in parts))
    found = layeredwave.resonances(
        layers, *2 * ["periodic"], "longitudinal", (0.05 / BAR, 0.7 / BAR)
    )
    assert len(found) in (2, 4, 6)
    assert np.isfinite(found).all()
    for own in found:
        distance = np.abs(found - own) / abs(own)
        apart = distance[distance > 1e-9].min(initial=2e-3)
        at = own * (1 + apart / 2 * np.exp(1j * np.linspace(0, 2 * np.pi, 257)))
        stack = Stack(layers, ROTATION.blocks[0], at, gradient > 0)
        S, R = stack.whole().whole, returned(stack, "periodic", "periodic")
        turned = np.unwrap(np.angle(np.linalg.det(np.eye(S.shape[-1]) - S @ R)))
        assert round((turned[-1] - turned[0]) / (2 * np.pi)) == (distance <= 1e-9).sum()


def test_what_has_no_answer_is_refused():
    with pytest.raises(ValueError, match="right = 'absorbing'"):
        layeredwave.resonances(uniform(ONE), "fixed", "absorbing", "longitudinal", BAND)
    with pytest.raises(ValueError, match="0 < ω1 < ω2"):
        layeredwave.resonances(uniform(ONE), "fixed", "free", "longitudinal", (2.0, 1.0))
