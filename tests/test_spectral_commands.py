"""The commands `gaps` and `paper`, and that the spectral side stays by itself."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from wavesim.cli.main import main

CASE = str(Path(__file__).parents[1] / "cases" / "isotropic.toml")


def test_gaps_writes_a_table_and_a_figure(tmp_path):
    arguments = ["gaps", CASE, "--x", "anisotropy", "0", "0.5", "--points", "6"]
    answer = CliRunner().invoke(main, [*arguments, "--out", str(tmp_path)])
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
    answer = CliRunner().invoke(main, ["gaps", CASE, *arguments, "--out", str(tmp_path)])
    assert answer.exit_code == 2
    assert said in answer.stderr
    assert not list(tmp_path.iterdir())


def test_paper_says_when_it_can_not_write(tmp_path):
    taken = tmp_path / "file"
    taken.write_text("")
    answer = CliRunner().invoke(main, ["paper", "--out", str(taken)])
    assert answer.exit_code == 2
    assert "can't be written" in answer.stderr


@pytest.mark.parametrize(
    "module",
    [
        "planewave",
        "spectral.branches",
        "spectral.gapmap",
        "spectral.direction",
        "spectral.bands",
        "paper.claims",
        "paper.findings",
    ],
)
def test_the_spectral_side_shares_only_the_medium(module):
    """The check against it is worth something only if it knows no grid; nor does it draw."""
    forbidden = ["jax", "matplotlib"]
    forbidden += ["wavesim.grid.bar", "wavesim.grid.stencils"]
    forbidden += [f"wavesim.timedomain.{n}" for n in ("operator", "steppers", "integration")]
    code = f"import sys, wavesim.{module}; print([m for m in {forbidden} if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
