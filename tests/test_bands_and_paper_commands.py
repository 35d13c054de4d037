"""The commands `bands` and `paper`."""

from __future__ import annotations

import json

import pytest
from runs import call

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


def test_a_medium_is_all_that_bands_need(written):
    path = written(MEDIUM)
    assert "layers" not in json.loads(call("bands", path, "--json").stdout)
    assert "RLB1" in call("bands", path).stdout


def test_layers_have_bands_of_their_own(written, tmp_path):
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
    assert {"bands_1.png", "bands_2.png"} <= {file.name for file in tmp_path.iterdir()}


def test_tables_keep_within_80_columns(written, tmp_path):
    for line in call("bands", written(LAYERED), "--out", tmp_path / "o").stdout.splitlines():
        assert len(line) <= 80 or str(tmp_path) in line


def test_paper_says_when_it_can_not_write(tmp_path):
    taken = tmp_path / "file"
    taken.write_text("")
    answer = call("paper", "--out", taken)
    assert answer.exit_code == 2
    assert "can't be written" in answer.stderr
