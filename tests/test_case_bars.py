"""The case file of a bar as in a laboratory: kinds of sources, ends, losses, layers."""

import copy
import dataclasses
import tomllib

import numpy as np
import pytest
import tomli_w

from wavesim.case.load import build, load
from wavesim.case.schema import CaseError, parse
from wavesim.material.damping import constant_quality
from wavesim.material.layers import Layer, Layers, as_layers
from wavesim.material.medium import Medium
from wavesim.sources import Recorded, parameters

PULSE = {"field": "phi1", "position": 0.016, "peak_frequency": 6e5}
BASE = {
    "bar": {"length": 0.032, "spacing": 1.25e-4},
    "sources": [PULSE],
    "time": {"duration": 4e-6},
}
TIMES = np.arange(160) * 1e-7
VALUES = np.exp(-(((TIMES - 8e-6) / 1.6e-6) ** 2)) * np.sin(2 * np.pi * 6e5 * TIMES)
OWN = {
    "ricker": {"peak_frequency": 6e5, "delay": 3e-6},
    "gaussian-derivative": {"peak_frequency": 6e5},
    "tone-burst": {"frequency": 6e5, "cycles": 3.5, "window": "cos4", "start": 1e-6},
    "chirp": {"low": 1e5, "high": 6e5, "duration": 3e-5, "taper": 0.2},
    "recorded": {"file": "signal.csv", "amplitude": 2.0},
    "initial": {"width": 1e-3, "amplitude": 1e-4},
}


@pytest.fixture
def folder(tmp_path):
    """Where a recorded signal stands beside the case."""
    (tmp_path / "signal.csv").write_text(
        "t,v\n" + "".join(f"{t},{v}\n" for t, v in zip(TIMES, VALUES, strict=True))
    )
    return tmp_path


def tables(**changed):
    return copy.deepcopy(BASE) | changed


def made(given, *overrides, folder="."):
    """The case of tables."""
    return build(parse(tomli_w.dumps(given), "my.toml", overrides, folder), "my.toml")


def message_of(given, *overrides, folder="."):
    with pytest.raises(CaseError) as caught:
        made(given, *overrides, folder=folder)
    return str(caught.value)


def again(case):
    """The simulation of the resolved case, whose own resolved text must be the same."""
    text = case.resolved("auto", 1e-8)
    second = build(parse(text, "resolved.toml"), "resolved.toml")
    assert second.resolved("auto", 1e-8) == text
    return second.simulation


def plain(medium):
    """A medium without the difference between what is given and what stands for None."""
    return dataclasses.replace(medium, rotation_inertia=medium.beta, curvature_inertia=medium.gamma)


@pytest.mark.parametrize("kind", OWN)
def test_source_of_each_kind_is_built_and_repeats_itself(kind, folder):
    """What the file says is what the source has, and the resolved case makes the same source."""
    given = {"kind": kind, "field": "phi2", "position": 0.016} | OWN[kind]
    case = made(tables(sources=[given]), folder=folder)
    (source,) = case.simulation.sources
    assert source.kind == kind
    has = parameters(source) | {"kind": kind}
    for key, value in given.items():
        if key != "file":
            assert has[key] == value
    (repeated,) = again(case).sources
    assert parameters(repeated) == parameters(source)
    assert type(repeated) is type(source)


def test_recorded_signal_is_inlined(folder):
    """The resolved case needs no file: its arrays are the file's columns, to the last bit."""
    path = folder / "case.toml"
    given = {"kind": "recorded", "field": "phi1", "position": 0.01, "file": "signal.csv"}
    path.write_text(tomli_w.dumps(tables(sources=[given])))
    case = load(path)
    expected = (Recorded("phi1", 0.01, TIMES.tolist(), VALUES.tolist()),)
    assert case.simulation.sources == expected
    (table,) = tomllib.loads(case.resolved("auto", 1e-8))["sources"]
    assert "file" not in table
    assert (table["times"], table["values"]) == (TIMES.tolist(), VALUES.tolist())
    (repeated,) = again(case).sources
    assert parameters(repeated) == parameters(expected[0])


@pytest.mark.parametrize(("side", "position"), [("left", 0.0), ("right", 0.032)])
@pytest.mark.parametrize(("drive", "end"), [("moment", "free"), ("rotation", "fixed")])
def test_source_at_an_end(side, position, drive, end):
    given = {"field": "phi1", "peak_frequency": 6e5, "drive": drive, "end": side}
    bar = BASE["bar"] | {"left": "absorbing", "right": "absorbing"} | {side: end}
    case = made(tables(bar=bar, sources=[given]))
    (source,) = case.simulation.sources
    assert (source.drive, source.position) == (drive, position)
    assert again(case).sources == (dataclasses.replace(source, delay=source.peak_time),)


def test_ends_and_absorber():
    """Periodic by default, with no absorber; else 8 branch lengths of the medium at that end."""

    def ends(bar, **more):
        simulation = made(tables(bar=bar, **more)).simulation
        return simulation.bar.left, simulation.bar.right, simulation.bar.absorber

    assert ends(BASE["bar"]) == ("periodic", "periodic", 0)
    bar = BASE["bar"] | {"left": "free", "right": "absorbing"}
    assert ends(bar) == ("free", "absorbing", 8e-3)
    assert again(made(tables(bar=bar))).bar.absorber == 8e-3
    layers = [{"from": 0.0, "to": 0.016}, {"from": 0.016, "to": 0.032, "branch_length": 1.5e-3}]
    assert ends(bar, layers=layers)[2] == 8 * 1.5e-3
    assert ends(bar | {"absorber": 5e-3})[2] == 5e-3


def test_losses():
    """Rayleigh keys and a quality factor make one law, lossless by default."""
    assert not made(BASE).medium.damping
    medium = {
        "mass_damping": 30.0,
        "stiffness_damping": 2e-9,
        "quality_factor": 40.0,
        "quality_band": [1e5, 1e6],
    }
    case = made(tables(medium=medium))
    expected = dataclasses.replace(constant_quality(40.0, (1e5, 1e6)), mass=30.0, stiffness=2e-9)
    assert case.simulation.medium.damping == expected
    assert again(case).medium.damping == expected


LAYERS = [
    {"from": 0.0, "to": 0.01, "closure": "consistent", "quality_factor": 50.0},
    {"from": 0.01, "to": 0.02, "density": [1500.0, 1800.0], "particle_radius": [5e-4, 4e-4]},
    {"from": 0.02, "to": 0.032, "grading": "linear", "anisotropy": [0.0, 0.2], "mass_damping": 7.0},
]


def test_layers_are_built_and_repeat_themselves():
    """Each layer against one built by hand: defaults from [medium], pairs at both ends."""
    shared = {"stiffness_ratio": 0.4, "quality_factor": 30.0, "quality_band": [1e5, 1e6]}
    case = made(tables(medium=shared, layers=LAYERS))
    low, high = (constant_quality(q, (1e5, 1e6)) for q in (30.0, 50.0))
    common = {"stiffness_ratio": 0.4, "damping": low}
    heavy = dataclasses.replace(low, mass=7.0)
    expected = Layers(
        (
            Layer(0.0, 0.01, Medium(stiffness_ratio=0.4, closure="consistent", damping=high)),
            Layer(
                0.01,
                0.02,
                Medium(density=1500.0, particle_radius=5e-4, **common),
                Medium(density=1800.0, particle_radius=4e-4, **common),
            ),
            Layer(
                0.02,
                0.032,
                Medium(stiffness_ratio=0.4, damping=heavy),
                Medium(anisotropy=0.2, stiffness_ratio=0.4, damping=heavy),
                "linear",
            ),
        )
    )
    assert case.simulation.layers == expected
    repeated = again(case).layers
    for one, other in zip(repeated.layers, expected.layers, strict=True):
        assert (one.start, one.end, one.grading) == (other.start, other.end, other.grading)
        assert plain(one.medium) == plain(other.medium)
        assert (one.last is None) == (other.last is None)
        if one.last is not None:
            assert plain(one.last) == plain(other.last)
    for x in np.linspace(0, 0.032, 33):
        assert plain(repeated.at(x)) == plain(expected.at(x))


def test_one_uniform_layer_is_a_uniform_bar():
    simulation = made(tables(layers=[{"from": 0.0, "to": 0.032, "density": 1600.0}])).simulation
    assert simulation.endless
    assert simulation.layers == as_layers(Medium(density=1600.0), 0.032)


def test_grid_follows_the_shortest_branch_length_and_the_slowest_layer():
    bar = {"length": 0.032}
    layers = [{"from": 0.0, "to": 0.016}, {"from": 0.016, "to": 0.032, "branch_length": 5e-4}]
    assert made(tables(bar=bar, layers=layers)).simulation.bar.spacing == 5e-4 / 8
    uniform = message_of(tables(sources=[PULSE | {"peak_frequency": 2e7}]))
    slow = [{"from": 0.0, "to": 0.016}, {"from": 0.016, "to": 0.032, "density": 4 * 1570.0}]
    layered = message_of(tables(sources=[PULSE | {"peak_frequency": 2e7}], layers=slow))
    highest = [float(m.split("at most ")[1].split(" Hz")[0]) for m in (uniform, layered)]
    # Four times the density, half the speed; numbers are told to four digits.
    assert highest[0] == pytest.approx(2 * highest[1], rel=1e-3)


def source(**keys):
    own = ", ".join(f"{key}={value}" for key, value in ({"field": "'phi1'"} | keys).items())
    return f"sources=[{{{own}}}]"


def layered(*rows):
    return "layers=[" + ", ".join(f"{{{row}}}" for row in rows) + "]"


WHOLE = "from=0, to=0.032"
FIRST = "[[sources]] number 1: "
LAYER = "[[layers]] number 1: "
BAD = [
    # sources: the keys of their kind
    ("sources.0.kind='sine'", FIRST + 'kind = "sine"', '"tone-burst", "chirp", "recorded"'),
    ("sources.0.kind=3", FIRST + "kind = 3", '"ricker"'),
    ("sources.0.cycles=3", FIRST + "cycles = 3", 'of kind "ricker"; known are field, position'),
    ("sources.0.kind='tone-burst'", FIRST + "peak_frequency = 600000.0", "mean frequency?"),
    (source(kind="'chirp'", positio=1), FIRST + "positio = 1", 'of kind "chirp"; did you mean'),
    (source(kind="'tone-burst'", position=0.01), FIRST + "frequency", "required"),
    (
        source(kind="'tone-burst'", position=0.01, frequency=6e5, window="'rect'"),
        FIRST + 'window = "rect"',
        '"hann", "cos4" or "cos6"',
    ),
    (
        source(kind="'tone-burst'", position=0.01, frequency=6e5, cycles=0.5),
        FIRST + "cycles = 0.5",
        "1 or greater",
    ),
    (
        source(kind="'tone-burst'", position=0.01, frequency=5e7),
        FIRST + "frequency = 5e+07",
        "lower it",
    ),
    (
        source(kind="'chirp'", position=0.01, low=6e5, high=1e5, duration=1e-4),
        FIRST + "low = 600000",
        "below high",
    ),
    (
        source(kind="'chirp'", position=0.01, low=1e5, high=5e7, duration=1e-4),
        FIRST + "high = 5e+07",
        "lower it",
    ),
    (source(kind="'recorded'", position=0.01), FIRST + "file", "add the path of a CSV file"),
    (source(kind="'recorded'", position=0.01, fil="'a'"), FIRST + 'fil = "a"', "mean file?"),
    (source(kind="'recorded'", position=0.01, file=3), FIRST + "file = 3", "text in quotes"),
    (
        source(kind="'recorded'", position=0.01, file="'no.csv'"),
        FIRST + 'file = "no.csv": no such file',
        "case file's folder",
    ),
    (
        source(kind="'recorded'", position=0.01, file="'gap.csv'"),
        FIRST + 'file = "gap.csv": line 30: t = 3e-06: a gap of',
        "fill it in by interpolation",
    ),
    (
        source(kind="'recorded'", position=0.01, file="'signal.csv'", times=[0, 1]),
        FIRST + 'file = "signal.csv": times is given too',
        "give file, or times and values",
    ),
    (
        source(kind="'recorded'", position=0.01, times=[0, 1], values="[0, 'a']"),
        FIRST + 'values[1] = "a"',
        "a number",
    ),
    (source(kind="'recorded'", position=0.01, times=[0.0, 1.0]), FIRST + "times: 2", "one each"),
    (source(kind="'recorded'", position=0.01, times=3), FIRST + "times = 3", "an array of numbers"),
    (source(kind="'initial'", position=0.01), FIRST + "width", "required"),
    (source(kind="'initial'", position=0.01, width=1e-5), FIRST + "width = 1e-05", "at least"),
    (source(kind="'initial'", position=0.01, width=1, drive="'body'"), FIRST + "drive", "unknown"),
    # drives
    ("sources.0.drive='push'", FIRST + 'drive = "push"', '"moment" or "rotation"'),
    ("sources.0.drive='moment'", FIRST + "position = 0.016", 'give end = "left" or "right"'),
    ("sources.0.end='left'", FIRST + 'end = "left"', "give position"),
    (source(drive="'moment'", peak_frequency=6e5), FIRST + "end: required", "add"),
    (
        source(drive="'moment'", peak_frequency=6e5, end="'top'"),
        FIRST + 'end = "top"',
        '"left" or "right"',
    ),
    (
        source(drive="'moment'", peak_frequency=6e5, end="'left'"),
        FIRST + 'drive = "moment"',
        '[bar] left = "periodic"; set that to "free"',
    ),
    (
        source(field="'B11'", drive="'rotation'", peak_frequency=6e5, end="'left'"),
        FIRST + 'field = "B11"',
        "one of phi1, phi2, phi3",
    ),
    (
        source(drive="'rotation'", peak_frequency=6e5, end="'left'", width=1e-3),
        FIRST + "width = 0.001",
        "leave it out",
    ),
    # ends
    ("bar.left='soft'", '[bar] left = "soft"', '"free" or "absorbing"'),
    ("bar.left='free'", '[bar] left = "free": right is "periodic"', "give right too"),
    ("bar.right='fixed'", '[bar] right = "fixed": left is "periodic"', "give left too"),
    ("bar.absorber=0.004", "[bar] absorber = 0.004", "leave absorber out"),
    # losses
    ("medium.mass_damping=-1", "[medium] mass_damping = -1", "0 or greater"),
    ("medium.stiffness_damping=nan", "[medium] stiffness_damping = nan", "finite"),
    ("medium.quality_factor=1", "[medium] quality_factor = 1", "greater than 1"),
    ("medium.quality_factor=50", "[medium] quality_factor = 50", "add quality_band"),
    ("medium.quality_band=[1e5, 1e6]", "[medium] quality_band = [100000.0, 1000000.0]", "add it"),
    ("medium.quality_band=[1e6, 1e5]", "[medium] quality_band = [1000000.0, 1", "0 < f1 < f2"),
    ("medium.quality_band=1e5", "[medium] quality_band = 100000.0", "an array of numbers"),
    ("medium.quality_band=['a', 1]", '[medium] quality_band[0] = "a"', "a number"),
    # layers
    ("layers=3", "layers = 3", "an array of tables"),
    (layered("from=0, to=0.02"), LAYER + "to = 0.02", "no layer covers x = 0.02 to 0.032 m"),
    (layered("from=0.01, to=0.032"), LAYER + "from = 0.01", "begin this one at 0"),
    (layered("from=0, to=0.05"), LAYER + "to = 0.05", "the bar ends at 0.032 m"),
    (layered("from=0, to=0"), LAYER + "to = 0", "thickness"),
    (layered("to=0.032"), LAYER + "from", "required"),
    (
        layered("from=0, to=0.02", "from=0.01, to=0.032"),
        "[[layers]] number 2: from = 0.01: overlaps",
        "begin it at 0.02",
    ),
    (
        layered("from=0, to=0.01", "from=0.02, to=0.032"),
        "[[layers]] number 2: from = 0.02: no layer covers x = 0.01 to 0.02 m",
        "begin this one at 0.01",
    ),
    (layered(WHOLE + ", frm=0"), LAYER + "frm = 0", "did you mean from?"),
    (layered(WHOLE + ", start=0"), LAYER + "start = 0", "unknown key"),
    (layered(WHOLE + ", density=[1500]"), LAYER + "density = [1500]", "a pair [at from, at to]"),
    (layered(WHOLE + ", density='a'"), LAYER + 'density = "a"', "a pair [at from, at to]"),
    (layered(WHOLE + ", density=[1500, -1]"), LAYER + "density = -1", "greater than 0"),
    (layered(WHOLE + ", grading='cubic'"), LAYER + 'grading = "cubic"', '"smooth" or "linear"'),
    (layered(WHOLE + ", mass_damping=[1, 2]"), LAYER + "mass_damping = [1, 2]", "can't be graded"),
    (layered(WHOLE + ", quality_factor=[9, 8]"), LAYER + "quality_factor = [9", "can't be graded"),
    (layered(WHOLE + ", quality_factor=9"), LAYER + "quality_factor = 9", "add quality_band"),
    (layered(WHOLE + ", anisotropy=[0.0, 2.0]"), LAYER + "anisotropy = 2", "unstable"),
]


@pytest.mark.parametrize(("override", "given", "remedy"), BAD, ids=[row[0] for row in BAD])
def test_bad_value_is_told_in_one_line(override, given, remedy, folder):
    rows = (folder / "signal.csv").read_text().splitlines()
    (folder / "gap.csv").write_text("\n".join([*rows[1:30], *rows[31:]]))
    message = message_of(BASE, override, folder=folder)
    assert message.startswith("my.toml: ")
    assert "\n" not in message
    assert given in message
    assert remedy in message.partition(given)[2]
    assert len(message) < 330


def test_absorber_must_leave_something():
    message = message_of(BASE, "bar.left='absorbing'", "bar.right='absorbing'", "bar.absorber=0.02")
    assert "[bar] absorber = 0.02: " in message
    assert "take less than 0.016" in message


@pytest.mark.parametrize(
    "overrides",
    [
        ("bar.left='free'", "bar.right='fixed'"),
        ("bar.left='absorbing'", "bar.right='free'", "bar.absorber=0.004"),
        ("medium.mass_damping=3", "medium.quality_factor=40", "medium.quality_band=[1e5, 2e6]"),
        (layered(WHOLE + ", density=[1500, 1600]"),),
        (source(kind="'initial'", position=0.01, width=1e-3),),
    ],
    ids=["ends", "absorber", "losses", "graded", "initial"],
)
def test_a_real_bar_resolves_to_itself(overrides):
    """What a bar with ends, losses or layers resolves to makes the same bar and text."""
    case = made(BASE, *overrides)
    assert again(case).bar == case.simulation.bar
