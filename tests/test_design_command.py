"""`wavesim design`: a wish kept by anybody's transfer matrix, or by how much it is missed."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from runs import call
from test_transmission_command import transfer

from wavesim.case.layered_case import load_layers
from wavesim.case.load import load
from wavesim.case.schema import CaseError, read
from wavesim.material.layers import Layers
from wavesim.studies.design_asked import problem
from wavesim.studies.design_descent import Search
from wavesim.studies.design_tolerance import allowed_offsets

CASE = """\
title = "A wish"
medium = { closure = "consistent", G_n_a = 40.0, G_n_r = 40.0 }
bar = { left = "half-space", right = "half-space" }
[[layers]]
thickness = 3e-3
G_n_a = 20.0
[[layers]]
repeat = 2
layers = [{ thickness = 2e-3, G_n_a = 6.0 }]
[design]
length_at_most = 0.012
thickness_at_least = 5e-4
tolerance = 0.002
[[design.bands]]
sector = "longitudinal"
from = 6e5
to = 7e5
at_most = -40
[[design.bands]]
sector = "longitudinal"
from = 2e5
to = 3e5
at_least = -3
[[design.variables]]
key = "layers.*.thickness"
from = 2e-4
to = 6e-3
[[design.variables]]
key = "layers.1.layers.0.thickness"
from = 5e-4
to = 3e-3
[[design.variables]]
key = "layers.1.layers.*.G_n_a"
from = 3.0
to = 40.0
[[design.variables]]
key = "layers.1.layers.0.G_n_r"
from = 3.0
to = 40.0
"""


SOFTER = """\
[[layers]]
thickness = 0.024
G_n_a = 10.0
G_n_r = 10.0
"""


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "wish.toml"
    path.write_text(CASE)
    return path


def level_of(layers, wish):
    """|T| in dB over a band, by a transfer matrix in SI."""
    omega = 2 * np.pi * np.linspace(wish["from"], wish["to"], 2001)
    with np.errstate(over="ignore", invalid="ignore"):  # at an asymptote
        T = np.nan_to_num(transfer(layers, wish["sector"], omega)[0])
    return 20 * np.log10(np.maximum(np.abs(T), 1e-30))


def test_a_wish_is_kept_by_another_transfer_matrix_and_runs(path, tmp_path):
    """Each limit, over 2001 frequencies; lengths; that design.toml is a case."""
    result = call("design", path, "--out", tmp_path, "--seed", "3")
    assert result.exit_code == 0, result.stderr
    answer = json.loads((tmp_path / "design.json").read_text())
    assert answer["met"]
    assert set(answer["variables"]) == {
        "layers.0.thickness", "layers.1.layers.0.thickness",
        "layers.1.layers.0.G_n_a", "layers.1.layers.0.G_n_r",
    }  # fmt: skip
    layers = load_layers(tmp_path / "design.toml").layers
    for band in answer["bands"]:
        level = level_of(layers, band)
        worst = level.max() if band["kind"] == "at_most" else level.min()
        assert worst == pytest.approx(band["reached"], abs=0.05)
        assert worst <= -40 if band["kind"] == "at_most" else worst >= -3
    inner = [layer.thickness for layer in layers.layers[1:-1]]
    assert sum(inner) == pytest.approx(answer["length"], rel=1e-9)
    assert sum(inner) <= 0.012
    assert min(inner) >= 5e-4 * (1 - 1e-9)
    assert 0 <= answer["yield"] <= 1
    assert (tmp_path / "design.png").stat().st_size > 10_000
    assert not load(tmp_path / "design.toml").simulation.endless
    # What a variable may be off by keeps the wish.
    for key, off in answer["may_be_off"].items():
        value = answer["variables"][key] * (1 + off["up"])
        moved = load_layers(tmp_path / "design.toml", [f"{key}={value!r}"]).layers
        levels = [level_of(moved, band) for band in answer["bands"]]
        assert levels[0].max() <= -40 + 0.05
        assert levels[1].min() >= -3 - 0.05


def test_a_wish_that_can_t_be_kept_gives_1_and_says_by_how_much(path, tmp_path):
    """12 mm can't stop 100 to 120 kHz by 60 dB; what is reached is the transfer matrix's."""
    words = ("--set", "design.bands.0.from=1e5", "--set", "design.bands.0.to=1.2e5",
             "--set", "design.bands.0.at_most=-60")  # fmt: skip
    result = call("design", path, "--out", tmp_path, "--at-most", "8s", *words)
    assert result.exit_code == 1
    assert "lacks" in result.stdout
    answer = json.loads((tmp_path / "design.json").read_text())
    assert not answer["met"]
    layers = load_layers(tmp_path / "design.toml").layers
    for band in answer["bands"]:
        level = level_of(layers, band)
        worst = level.max() if band["kind"] == "at_most" else level.min()
        assert worst == pytest.approx(band["reached"], abs=0.05)
        assert band["met"] == (band["short"] == 0)
    # The trade-off goes from stopping much to passing much.
    stopped = [row["reached"][0] for row in answer["trade_off"]]
    passed = [row["reached"][1] for row in answer["trade_off"]]
    assert stopped[0] <= stopped[-1] + 0.1
    assert passed[-1] >= passed[0] - 0.1


BAD = {
    "design.variables.0.key='layers.0.thicknes'": "did you mean thickness?",
    "design.variables.0.key='layers.9.thickness'": "no layer stands at layers.9; name one of",
    "design.variables.0.key='layers.*.colour'": "'colour' can't be varied",
    "design.variables.0.from=6e-3": "must be greater than from = 0.006, or nothing varies",
    "design.variables.0.from=-1.0": "a thickness must be greater than 0",
    "design.variables.2.from=-3.0": "G_n_a must be greater than 0",
    "design.variables.1.key='layers.0.thickness'": "sets what \"layers.0.thickness\" sets already",
    "design.variables=[]": "[[design.variables]]: required",
    "design.bands=[]": "[[design.bands]]: required",
    "design.bands.0.to=5e5": "to = 500000: must be greater than from = 600000",
    "design.bands.0.to=2.2e6": "the first half-space carries no longitudinal wave between",
    "design.bands.0.sector='inplane'": "must be one of longitudinal, transverse2, transverse3",
    "design.bands.0.at_most='much'": "must be a number",
    "design.bands.1.from=6.5e5": "must be greater than from",
    "design.bands.1={from=6.5e5,to=6.6e5,at_least=-1.0}": "nothing can be both",
    "design.bands.1={from=1e5,to=2e5}": "at_most, at_least: neither is given",
    "design.bands.1={from=1e5,to=2e5,at_least=3.0}": "a stack gives no energy",
    "design.length_at_most=1e-3": "the thinnest stack there is has 0.0015 m",
    "design.thickness_at_least=7e-3": "leaves nothing above [design] thickness_at_least",
    "design.tolerance=-1.0": "must be 0 or greater",
    "bar.left='fixed'": 'the first layer stands for a half-space where [bar] left = "fixed"',
    "layers=[]": "[[layers]]",
    "layers.0.thickness=[]": "thickness",
}  # fmt: skip


@pytest.mark.parametrize("override", BAD)
def test_bad_input_gives_2_and_one_line(override, path, tmp_path):
    result = call("design", path, "--out", tmp_path, "--set", override)
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert BAD[override] in result.stderr
    assert not (tmp_path / "design.toml").exists()


def test_what_passes_is_bounded_by_energy(path):
    """|T|² Z₂/Z₁ ≤ 1: into softer grains the amplitude rises, and no wish beyond that is taken.

    Z₁/Z₂ = (1 + R)/(1 − R) by R of a transfer matrix, where the two half-spaces meet.
    """
    inner = CASE[CASE.index("[[layers]]") : CASE.index("[design]")]
    text = (
        CASE.replace("half-space", "absorbing")
        .replace(inner, "[[layers]]\nthickness = 0.024\n" + inner + SOFTER)
        .replace("layers.1.layers", "layers.2.layers")
        .replace("length_at_most", "# length_at_most")
    )
    path.write_text(text)
    one, *_, two = load_layers(path).layers.layers
    sides = Layers((one, replace(two, start=one.end, end=one.end + two.thickness)))
    R = transfer(sides, "longitudinal", 2 * np.pi * np.linspace(2e5, 3e5, 400))[1].real
    most = (10 * np.log10((1 + R) / (1 - R))).min()
    assert most > 1
    path.write_text(text.replace("at_least = -3", f"at_least = {most - 1e-6}"))
    problem(read(path), str(path))
    path.write_text(text.replace("at_least = -3", f"at_least = {most + 1e-6}"))
    with pytest.raises(CaseError, match="a stack gives no energy"):
        problem(read(path), str(path))


def test_a_variable_of_value_0_may_be_off_absolutely(path):
    """0.5 % above a = 0 keeps a wish with so much room, and the offset is one of a itself."""
    other = 'layers.1.layers.0.anisotropy"\nfrom = 0.0\nto = 0.8'
    path.write_text(CASE.replace('layers.1.layers.0.G_n_r"\nfrom = 3.0\nto = 40.0', other))
    own = Search(problem(read(path), str(path)))
    values = np.append(own.problem.low[:-1], 0.0)
    level = own.reached(values[None])[0]
    wishes = tuple(
        replace(wish, limit=float(reached) + (1.0 if wish.most else -1.0))
        for wish, reached in zip(own.problem.wishes, level, strict=True)
    )
    own.problem = replace(own.problem, wishes=wishes)
    *others, last = allowed_offsets(own, values)
    assert not any(off.absolute for off in others)
    assert last.absolute
    assert last.down == 0  # a may not be below 0 in this range
    assert 0 < last.up <= 0.3 * 0.8
    moved = own.reached(np.append(values[:-1], last.up)[None])
    assert (own.problem.short(moved) == 0).all()


def test_a_variable_that_does_not_matter_is_told(path, tmp_path):
    """The gradient stiffness, which Γ alone has, moves nothing."""
    key = "design.variables.3={key='layers.0.G_n_g',from=1e-12,to=1e-11}"
    result = call("design", path, "--out", tmp_path, "--set", key)
    assert result.exit_code == 2
    assert "changes nothing in the bands" in result.stderr
