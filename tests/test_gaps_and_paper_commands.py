"""The commands `gaps` and `paper`."""

from __future__ import annotations

import json

import numpy as np
import pytest
from runs import SHIPPED, call

CASE = SHIPPED["isotropic"]


def test_gaps_writes_a_table_and_a_figure(tmp_path):
    arguments = ["gaps", CASE, "--x", "anisotropy", "0", "0.5", "--points", "6"]
    answer = call(*arguments, "--out", tmp_path)
    assert answer.exit_code == 0, answer.output
    table = np.genfromtxt(tmp_path / "gap_map.csv", delimiter=",", names=True)
    assert table.shape == (36,)
    assert table["anisotropy"].max() == 0.5
    assert (table["RLB1_upper_kHz"] >= table["RLB1_lower_kHz"]).all()
    assert (tmp_path / "gap_map.png").stat().st_size > 10_000


MEDIUM = '[medium]\nclosure = "consistent"\nanisotropy = 0.25\n'
LAYERED = (
    MEDIUM
    + "[[layers]]\nthickness = 0.01\n"
    + "[[layers]]\nthickness = 0.02\nG_n_a = 10.0\n"
    + "[[layers]]\nthickness = 0.01\n"
)


@pytest.fixture
def written(tmp_path):
    """A file of the given text."""

    def write(text):
        path = tmp_path / "media.toml"
        path.write_text(text)
        return path

    return write


def test_a_medium_is_all_that_bands_and_gaps_need(written, tmp_path):
    """The map's file holds what the plane-wave solver says, six digits of it, and is small."""
    path = written(MEDIUM)
    answer = json.loads(call("bands", path, "--json").stdout)
    assert "layers" not in answer
    assert "RLB1" in call("bands", path).stdout
    assert call("gaps", path, "--out", tmp_path / "map").exit_code == 0
    file = tmp_path / "map" / "gap_map.csv"
    assert file.stat().st_size < 2e6
    with file.open() as lines:
        heading = next(lines).strip().split(",")
    assert heading[2:4] == ["RLB1_lower (kHz)", "RLB1_upper (kHz)"]
    rows = np.loadtxt(file, delimiter=",", skiprows=1)
    (row,) = rows[(rows[:, 0] == 0.25) & (rows[:, 1] == 0.5)]
    (gap, _) = answer["sectors"]["longitudinal"]["gaps"]
    exact = [gap["lower"] / 2e3 / np.pi, gap["upper"] / 2e3 / np.pi]
    assert row[2:4] == pytest.approx(exact, rel=1e-5)


def test_layers_have_bands_and_maps_of_their_own(written, tmp_path):
    """Each distinct medium once, where it is first; edges go as √G_n_a where all else is equal."""
    path = written(LAYERED)
    answer = json.loads(call("bands", path, "--json", "--out", tmp_path).stdout)
    assert [layer["position"] for layer in answer["layers"]] == [0.0, 0.01]
    assert [layer["medium"]["G_n_a"] for layer in answer["layers"]] == [5.0, 10.0]
    assert answer["layers"][0]["sectors"] == answer["sectors"]
    told = call("bands", path).stdout
    assert "Layer 1, from 0 mm:" in told
    assert "Layer 2, from 10 mm:" in told
    assert "Layer 3" not in told
    done = call("gaps", path, "--points", "3", "--out", tmp_path)
    assert done.exit_code == 0
    names = {"gap_map_1.csv", "gap_map_2.csv", "bands_1.png", "bands_2.png"}
    assert names <= {file.name for file in tmp_path.iterdir()}


@pytest.mark.parametrize("command", ["bands", "gaps"])
def test_tables_keep_within_80_columns(command, written, tmp_path):
    for line in call(command, written(LAYERED), "--out", tmp_path / "o").stdout.splitlines():
        assert len(line) <= 80 or str(tmp_path) in line


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--x", "anisotropy", "0", "3"], "anisotropy = 3: must be between -1 and 2"),
        (["--x", "eta", "0", "1"], "parameter 'eta': must be one of"),
        (["--x", "stiffness_ratio", "0", "1"], "both axes"),
    ],
)
def test_gaps_refuses_what_it_can_not_map(arguments, said, tmp_path):
    answer = call("gaps", CASE, *arguments, "--out", tmp_path)
    assert answer.exit_code == 2
    assert said in answer.stderr
    assert not list(tmp_path.iterdir())


def test_paper_says_when_it_can_not_write(tmp_path):
    taken = tmp_path / "file"
    taken.write_text("")
    answer = call("paper", "--out", taken)
    assert answer.exit_code == 2
    assert "can't be written" in answer.stderr
