"""Layers and signals that can't be: `run` and `check` refuse them by the same one line."""

import numpy as np
import pytest
from runs import call

from wavesim.case.load import load

GOOD = """\
[bar]
length = 0.032
spacing = 1.25e-4
left = "free"
right = "fixed"

[[layers]]
from = 0.0
to = 0.020

[[layers]]
from = 0.020
to = 0.032
density = 2000.0

[[sources]]
field = "phi1"
position = 0.008
peak_frequency = 2.0e5

[[receivers]]
name = "a"
position = 0.024

[time]
duration = 4.0e-6
"""
BAD = {
    "overlap": ("layers.1.from=0.019", "[[layers]] number 2: from = 0.019", "begin it at 0.02"),
    "gap": ("layers.1.from=0.021", "[[layers]] number 2: from = 0.021", "begin this one at 0.02"),
    "no thickness": ("layers.0.to=0.0", "[[layers]] number 1: to = 0", "thickness"),
    "short of the end": ("layers.1.to=0.031", "to = 0.031", "end it with the bar"),
    "receiver outside": ("receivers.0.position=0.033", "position = 0.033", "0 to 0.032 m"),
    "graded closure": ("layers.0.mass_damping=[1, 2]", "mass_damping = [1, 2]", "can't be graded"),
}


def told(path, *overrides):
    """The one line that `run` and `check` both refuse a case with."""
    lines = set()
    for command in ("run", "check"):
        extra = [word for override in overrides for word in ("--set", override)]
        result = call(command, path, *extra)
        assert result.exit_code == 2
        assert result.stdout == ""
        (line,) = result.stderr.splitlines()
        lines.add(line)
    (line,) = lines
    assert line.startswith(f"wavesim: {path}: ")
    return line


@pytest.fixture
def good(tmp_path):
    path = tmp_path / "bar.toml"
    path.write_text(GOOD)
    assert not load(path).simulation.endless
    return path


@pytest.mark.parametrize("what", BAD)
def test_bad_layers_give_2_and_one_line(what, good):
    override, given, remedy = BAD[what]
    line = told(good, override)
    assert given in line
    assert remedy in line.partition(given)[2]


def test_a_layer_too_thin_for_the_grid_has_cells_of_its_own(good):
    """16 of order 8, a sixteenth of a millimetre each for 1 mm; the others as they are asked."""
    overrides = ["layers.0.to=0.031", "layers.1.from=0.031"]
    asked = load(good).simulation.bar.all_stretches
    stretches = load(good, overrides).simulation.bar.all_stretches
    assert stretches[1] == (16, pytest.approx(6.25e-5))
    assert stretches[0][1] == asked[0][1]


def test_a_recorded_signal_with_a_hole_gives_2_and_one_line(good, tmp_path):
    t = np.arange(200) * 1e-7
    rows = [f"{a:.9e},{np.exp(-(((a - 8e-6) / 2e-6) ** 2)):.9e}" for a in t]
    (tmp_path / "signal.csv").write_text("\n".join(["t,value", *rows]))
    recorded = 'kind = "recorded"\nfile = "signal.csv"'
    good.write_text(GOOD.replace("peak_frequency = 2.0e5", recorded))
    assert load(good).simulation.sources[0].kind == "recorded"
    (tmp_path / "signal.csv").write_text("\n".join(["t,value", *rows[:90], *rows[93:]]))
    line = told(good)
    assert 'file = "signal.csv": line 92' in line
    assert "fill it in by interpolation" in line


def test_of_many_media_looked_at_together_the_one_that_grows_is_named(tmp_path):
    stable = "[[layers]]\nthickness = 0.001\nanisotropy = -{}\n"
    head = '[medium]\nclosure = "printed"\nstiffness_ratio = 1.3\n' + GOOD.split("[[layers]]")[0]
    rest = "[[sources]]" + GOOD.split("[[sources]]")[1]
    layers = [stable.format(n / 40) for n in range(32)]
    path = tmp_path / "many.toml"
    path.write_text(head + "".join(layers) + rest)
    assert call("check", path).exit_code in (0, 1)
    layers[20] = "[[layers]]\nthickness = 0.001\nanisotropy = 2.0\n"
    path.write_text(head + "".join(layers) + rest)
    line = told(path)
    assert "[[layers]] number 21:" in line
    assert "unstable" in line
