"""Layers of a bar: that they follow each other, and what a graded one is made of."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from runs import refused

from wavesim.material.damping import Damping
from wavesim.material.layers import Layer, Layers, as_layers
from wavesim.material.medium import Medium

SOFT = Medium(closure="consistent")
STIFF = Medium(closure="consistent", G_n_a=9.0, density=2000.0, particle_radius=6e-4)


def test_layers_follow_each_other():
    layers = Layers((Layer(0, 1e-2, SOFT), Layer(1e-2, 3e-2, STIFF), Layer(3e-2, 4e-2, SOFT)))
    assert layers.length == 4e-2
    assert layers.interfaces == (1e-2, 3e-2)
    assert layers.first == SOFT
    # An interface belongs to the layer on its right, the end of the bar to the last.
    for position, medium in ((0, SOFT), (9.99e-3, SOFT), (1e-2, STIFF), (3e-2, SOFT), (4e-2, SOFT)):
        assert layers.at(position) == medium
    # Rounding of an edge is no gap.
    Layers((Layer(0, 0.1 + 0.2, SOFT), Layer(0.3, 0.4, STIFF)))


BAD = [
    (
        lambda: Layers((Layer(0, 1e-2, SOFT), Layer(2e-2, 3e-2, SOFT))),
        "layer 2: from = 0.02: no layer covers x = 0.01 to 0.02 m",
        "begin this one at 0.01",
    ),
    (
        lambda: Layers((Layer(0, 2e-2, SOFT), Layer(1e-2, 3e-2, SOFT))),
        "layer 2: from = 0.01: overlaps the layer before it, which ends at 0.02 m",
        "begin it at 0.02",
    ),
    (lambda: Layers((Layer(1e-3, 1e-2, SOFT),)), "layer 1: from = 0.001", "begin this one at 0"),
    (lambda: Layers(()), "layers = []", "at least one"),
    (lambda: Layer(1e-2, 1e-2, SOFT), "from = 0.01, to = 0.01", "greater than 0"),
    (lambda: Layer(2e-2, 1e-2, SOFT), "from = 0.02, to = 0.01", "greater than 0"),
    (lambda: Layer(0.0, float("nan"), SOFT), "end = nan", "finite"),
    (lambda: Layer(0, 1, SOFT, STIFF, "cubic"), "grading = 'cubic'", "smooth, linear"),
    (
        lambda: Layer(0, 1, SOFT, dataclasses.replace(STIFF, closure="printed")),
        "closure, damping",
        "the same at both ends",
    ),
    (
        lambda: Layer(0, 1, SOFT, dataclasses.replace(STIFF, damping=Damping(mass=1.0))),
        "closure, damping",
        "the same at both ends",
    ),
    (
        lambda: as_layers([Layer(0, 1e-2, SOFT)], 2e-2),
        "to = 0.01: no layer covers x = 0.01 to 0.02 m",
        "end it with the bar",
    ),
]


@pytest.mark.parametrize(
    ("make", "given", "remedy"), BAD, ids=[f"{n} {row[1]}" for n, row in enumerate(BAD)]
)
def test_what_are_no_layers_is_told_in_one_line(make, given, remedy):
    refused(make, given, remedy)


def test_as_layers_takes_a_medium_layers_or_a_list():
    stretches = [Layer(0, 1e-2, SOFT), Layer(1e-2, 2e-2, STIFF)]
    whole = Layers(tuple(stretches))
    assert as_layers(whole, 2e-2) is whole
    assert as_layers(stretches, 2e-2) == whole
    assert as_layers(SOFT, 2e-2) == Layers((Layer(0.0, 2e-2, SOFT),))


@pytest.mark.parametrize("grading", ["smooth", "linear"])
def test_a_graded_layer_goes_from_one_medium_to_the_other(grading):
    """Every parameter, β and γ too, by one weight w; w(s) + w(1 − s) = 1, both to rounding."""
    layer = Layer(1e-2, 3e-2, SOFT, STIFF, grading)
    for end, medium in ((1e-2, SOFT), (3e-2, STIFF)):
        made = layer.at(end)
        for name in list(SOFT.known())[:-2]:
            assert getattr(made, name) == getattr(medium, name)
        np.testing.assert_allclose([made.beta, made.gamma], [medium.beta, medium.gamma], rtol=1e-14)
    weights = []
    for s in np.linspace(0, 1, 21):
        made = layer.at(1e-2 + 2e-2 * s)
        w = (made.G_n_a - SOFT.G_n_a) / (STIFF.G_n_a - SOFT.G_n_a)
        for attribute in ("density", "particle_radius", "beta", "gamma"):
            first, last = getattr(SOFT, attribute), getattr(STIFF, attribute)
            expected = (1 - w) * first + w * last
            np.testing.assert_allclose(getattr(made, attribute), expected, rtol=1e-12)
        weights.append(w)
    np.testing.assert_allclose(np.add(weights, weights[::-1]), 1, rtol=1e-12)
    assert (np.diff(weights) > 0).all()
    if grading == "linear":
        np.testing.assert_allclose(weights, np.linspace(0, 1, 21), atol=1e-12)
    # Past its ends it is as at them, and a uniform layer is one medium.
    assert layer.at(0.0) == layer.at(1e-2)
    assert Layer(0, 1, SOFT).at(0.5) is SOFT


def test_a_smooth_layer_is_level_to_second_order_at_its_ends():
    """w ≈ 10 s³ near the start: p changes by the third power of the distance. Ratio of changes at
    s and 2s is 8 within 15 s/10 (next term) = 2 %. A linear one gives 2."""
    for grading, ratio in (("smooth", 8.0), ("linear", 2.0)):
        layer = Layer(0.0, 1.0, SOFT, STIFF, grading)
        for side in (0.0, 1.0):
            here = layer.at(side).G_n_a
            near, far = (abs(layer.at(abs(side - s)).G_n_a - here) for s in (0.005, 0.01))
            np.testing.assert_allclose(far / near, ratio, rtol=0.02)


def test_what_layers_say_of_the_whole_bar():
    """Its media once each, both ends of a graded layer among them; what holds of one, or of all."""
    lossy = dataclasses.replace(SOFT, damping=Damping(mass=1.0))
    bar = Layers((Layer(0, 1, SOFT), Layer(1, 2, SOFT, STIFF), Layer(2, 4, lossy)))
    assert bar.media[0] == SOFT
    assert bar.media[-1] == lossy
    graded = bar.media[1:-1]
    assert [one.density for one in graded] == sorted(one.density for one in graded)
    assert (graded[0].parameters, graded[-1].parameters) == (SOFT.parameters, STIFF.parameters)
    assert bar.lossy
    assert not bar.uniform
    assert as_layers(SOFT, 1.0).uniform
    assert not as_layers(SOFT, 1.0).lossy
    plain = bar.mapped(lambda one: dataclasses.replace(one, damping=Damping()))
    assert not plain.lossy
    assert plain.layers[:2] == bar.layers[:2]


@pytest.mark.parametrize(
    ("closure", "a", "conserves"),
    [("printed", 0.0, True), ("printed", 0.2, False), ("consistent", 0.2, True)],
)
def test_a_bar_conserves_energy_where_every_medium_has_symmetric_equations(closure, a, conserves):
    """What the closure says, seen in the matrices: C_Bφ = C_φBᵀ, C_BB and Γ symmetric to 1e-13."""
    medium = Medium(closure=closure, anisotropy=a)
    bar = Layers((Layer(0, 1, Medium(closure=closure)), Layer(1, 2, medium)))
    form = medium.flux_form()
    pairs = ((form.C_phi_B, form.C_B_phi.T), (form.C_B_B, form.C_B_B.T), (form.Gamma, form.Gamma.T))
    seen = all(np.allclose(one, other, rtol=1e-13, atol=0) for one, other in pairs)
    assert (bar.conserves_energy, medium.conserves_energy, seen) == (conserves,) * 3
