"""Layers by thickness, groups that repeat, half-spaces: the same bar as by from and to."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from media import any_media
from runs import call

from wavesim.case.layered_case import bar_layers
from wavesim.case.load import build
from wavesim.case.schema import CaseError, parse
from wavesim.material.damping import Damping, constant_quality
from wavesim.material.layers import Layer, Layers

GROUPS = """\
bar = { left = "half-space", right = "half-space" }
medium = { closure = "consistent", G_n_a = 40.0 }
[[layers]]
repeat = 2
  [[layers.layers]]
  thickness = 1e-3
  G_n_a = 10.0
  [[layers.layers]]
  repeat = 3
    [[layers.layers.layers]]
    thickness = 2e-3
    density = [2000.0, 2500.0]
    [[layers.layers.layers]]
    thickness = 5e-4
"""
REST = """\
[[sources]]
field = "phi1"
position = 0.012
peak_frequency = 3e5
[time]
duration = 1e-5
"""


def layers_of(text, *overrides):
    return bar_layers(parse(text, "my.toml", overrides), "my.toml").layers


def test_groups_and_half_spaces_are_what_they_stand_for():
    """24 mm of [medium], twice (1 mm, thrice (2 mm, 0.5 mm)), 24 mm; to the rounding of sums."""
    layers = layers_of(GROUPS)
    own = [1.0, *[2.0, 0.5] * 3]
    expected = np.array([24.0, *own, *own, 24.0]) * 1e-3
    found = np.array([layer.thickness for layer in layers.layers])
    assert np.abs(found - expected).max() <= 1e-15
    assert [layer.medium.G_n_a for layer in layers.layers[:3]] == [40.0, 10.0, 40.0]
    assert layers.layers[2].last.density == 2500.0
    assert layers.layers[2].medium.density == 2000.0


def test_a_case_by_thickness_is_the_case_by_from_and_to():
    """Its grid, and what resolved.toml repeats of it; a layer has the cells its closures take."""
    case = build(parse(GROUPS + REST, "my.toml"), "my.toml")
    assert case.simulation.bar.left == "absorbing"
    assert min(cells for cells, _ in case.simulation.bar.stretches) == 16
    again = build(parse(case.resolved("auto", 1e-8), "again.toml"), "again.toml")
    assert again.simulation.bar == case.simulation.bar
    assert again.simulation.layers.interfaces == case.simulation.layers.interfaces


LAWS = st.sampled_from(
    [Damping(), constant_quality(30.0, (1e5, 1e6)), Damping(mass=1e3, stiffness=1e-9)]
)
INERTIA = st.sampled_from([{}, {"rotation_inertia": 2e-7}])
MEDIA = st.builds(lambda medium, own: dataclasses.replace(medium, **own), any_media(), INERTIA)
PIECES = st.tuples(st.floats(1e-4, 1e-2), MEDIA, MEDIA, st.booleans(), LAWS)


@settings(deadline=None, derandomize=True, max_examples=25)
@given(st.lists(PIECES, min_size=2, max_size=4), st.integers(1, 3))
def test_layers_written_as_a_case_are_read_as_they_were(pieces, times):
    """Fourteen digits of each number; inertias that are given here and follow from R there."""
    layers, end = [], 0.0
    for thickness, medium, other, graded, law in pieces * times:
        one = dataclasses.replace(medium, damping=law)
        last = dataclasses.replace(other, damping=law, closure=one.closure) if graded else None
        if last is not None and one.closure == "printed":
            last = dataclasses.replace(one, density=one.density * 1.5)
        layers.append(Layer(end, end + thickness, one, last))
        end += thickness
    read = layers_of(Layers(tuple(layers)).case_text())
    assert len(read.layers) == len(layers)
    for one, two in zip(layers, read.layers, strict=True):
        assert one.thickness == pytest.approx(two.thickness, rel=1e-12)
        assert one.medium.damping == two.medium.damping
        for x in (one.start, one.end):
            given = one.at(x).parameters
            told = two.at(two.start if x == one.start else two.end).parameters
            for name, value in given.items():
                assert value == pytest.approx(told[name], rel=1e-12, abs=1e-300)


BAD = {
    "layers.0.repeat=0": "[[layers]] number 1: repeat = 0: must be greater than 0",
    "layers.0.layers.0.thickness=-1": (
        "[[layers]] number 1, [[layers.layers]] number 1: thickness = -1: must be greater"
    ),
    "layers.0.layers.0.thicknes=1": "thicknes = 1: unknown key; did you mean thickness?",
    "layers.0.layers=[]": "repeat = 2: has no layers to repeat; add [[layers.layers]]",
    "layers.0.thickness=1": "thickness: a group has repeat and [[layers.layers]] alone",
    "layers.0.layers.0.from=0": "thickness = 0.001: stands in place of from and to",
    "layers.0.layers.1.repeat=9999": "more than 10000 layers; lower a repeat",
    "layers=[]": '[bar] left = "half-space": stands beside layers, and there are none',
    "layers=[{density=3}]": "thickness, or from and to: neither is given; give one of the two",
    "layers=[{to=3}]": "from: required, but not given; add it",
    "layers=[{from=0,to=1}]": 'from = 0: [bar] left = "half-space" puts a buffer before',
}


@pytest.mark.parametrize("override", BAD)
def test_bad_layers_are_told_in_one_line(override):
    with pytest.raises(CaseError) as caught:
        layers_of(GROUPS, override)
    assert str(caught.value).startswith("my.toml: [")
    assert BAD[override] in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bands_need_no_simulation_and_a_run_says_what_it_needs(tmp_path):
    path = tmp_path / "stack.toml"
    path.write_text(GROUPS)
    assert call("bands", path, "--json").exit_code == 0
    for command in ("run", "check"):
        result = call(command, path)
        assert result.exit_code == 2
        told = f"wavesim: {path}: [[sources]]: required, but not given; add it (what needs no "
        assert result.stderr == f"{told}simulation, as bands, gaps or design, does without)\n"
