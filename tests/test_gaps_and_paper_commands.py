"""The commands `gaps` and `paper`."""

from __future__ import annotations

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
    assert (table["RLB1_upper"] >= table["RLB1_lower"]).all()
    assert (tmp_path / "gap_map.png").stat().st_size > 10_000


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
