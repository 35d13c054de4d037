"""The paper reproduced: the claims as judged, the page, and the bands as data."""

from __future__ import annotations

import json

import numpy as np
import pytest

from wavesim import planewave
from wavesim.figures.bands import band_figure
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.paper import reproduction as paper
from wavesim.paper.claims import CLOSURES
from wavesim.planewave import bands


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    out = tmp_path_factory.mktemp("paper")
    return out, paper.reproduce(out, dpi=40)


def test_the_claims_are_judged_as_derived_apart(result):
    """Which closure bears out which claim; every statement has a measured number."""
    verdicts = {
        claim["number"]: tuple(claim["verdicts"][c] for c in CLOSURES)
        for claim in result[1]["claims"]
    }
    assert CLOSURES == ("printed", "consistent", "appendix_c")
    part, yes = "in part", "holds"
    assert verdicts == {
        1: (yes, yes, yes),
        2: (part, yes, part),
        3: (yes, yes, yes),
        4: (yes, part, yes),
        5: (yes, yes, yes),
        6: (part, yes, part),
        7: (part, part, part),
        8: (part, part, part),
    }
    for claim in result[1]["claims"]:
        for statements in claim["statements"].values():
            assert all(statement["values"] for statement in statements)


def test_what_rests_on_the_printed_coefficients(result):
    """Of claim 8: RLB1 closes at a = 1 by Appendix C alone, and transverse gaps keep their width
    by the printed equations and coefficients, not by the tensors."""
    statements = {
        closure: {s["text"]: s for s in found}
        for closure, found in result[1]["claims"][7]["statements"].items()
    }
    closes = next(text for text in statements["printed"] if text.startswith("RLB1 closes"))
    keep = next(text for text in statements["printed"] if "change little" in text)
    held = {c: (s[closes]["holds"], s[keep]["holds"]) for c, s in statements.items()}
    assert held == {
        "printed": (False, True),
        "consistent": (False, False),
        "appendix_c": (True, True),
    }
    assert statements["appendix_c"][closes]["values"]["a = 1"] == pytest.approx(0.0056, abs=5e-5)
    assert statements["consistent"][keep]["values"]["RTB2, a = 1"] == pytest.approx(0.277, abs=5e-4)


def test_files_hold_what_was_returned(result):
    out, returned = result
    assert json.loads((out / "paper.json").read_text(encoding="utf-8")) == json.loads(
        json.dumps(returned)
    )
    page = (out / "paper.md").read_text(encoding="utf-8")
    for name in returned["figures"]:
        assert (out / name).stat().st_size > 5000
        assert f"]({name})" in page
    for number in (3, 4, 5, 6):
        assert any(name.startswith(f"figure{number}") for name in returned["figures"])
    assert "| 0.5 | consistent | 0.9826–1.2021 | 1.2762–1.4753 |" in page
    assert not any(len(line.split("|")) not in (1, 5, 6, 7, 8, 9) for line in page.splitlines())


def test_bands_keep_the_contract():
    """{"medium", "sectors": {…: {"k", "omega", "gaps"}}, "full_gaps"}, SI, branches ascending."""
    medium = Medium(anisotropy=0.5)
    found = json.loads(json.dumps(bands.summary(medium)))
    assert list(found["sectors"]) == list(ROTATION.sectors)
    names = []
    for sector, values in found["sectors"].items():
        omega = np.array(values["omega"])
        assert omega.shape == (401, 3)
        assert np.all(np.diff(omega, axis=1) >= 0)
        assert values["k"][0] == 0
        assert values["k"][-1] == pytest.approx(2 * np.pi / medium.branch_length, rel=1e-15)
        np.testing.assert_array_equal(
            omega, planewave.frequencies(medium, sector, np.array(values["k"]))
        )
        names += [gap["name"] for gap in values["gaps"]]
        assert all(gap["lower"] <= gap["upper"] for gap in values["gaps"])
    assert names == ["RLB1", "RLB2", "RTB1", "RTB2", "RTB1", "RTB2", "RSB"]
    assert [tuple(pair) for pair in found["full_gaps"]] == planewave.full_gaps(medium)
    assert found["medium"]["anisotropy"] == 0.5
    assert found["medium"]["closure"] == "printed"


def test_table_of_bands_has_a_row_for_each_distinct_branch():
    rows = {row["branch"]: row for row in bands.table(Medium())}
    assert list(rows) == [
        "LA", "LO1", "LO2", "TA", "TO1", "TO2", "TSO[23]", "TSO(23)", "TSO(22-33)"
    ]  # fmt: skip
    assert rows["LA"]["gap"] == "RLB1"
    assert f"{rows['LA']['gap_lower_bar']:.4f}" == f"{rows['LA']['asymptote_bar']:.4f}" == "0.8911"
    assert f"{rows['LO1']['cutoff_bar']:.4f}" == "1.1939"
    assert rows["LO1"]["cutoff_hz"] / rows["LO1"]["cutoff_bar"] == pytest.approx(785e3, rel=1e-3)
    assert rows["LO2"]["asymptote_hz"] is None
    assert rows["LO2"]["gap"] is None
    assert rows["TSO[23]"]["gap"] == "RSB"


def test_band_figure_has_both_units_and_every_branch():
    figure = band_figure(Medium(anisotropy=0.5))
    main = [axes for axes in figure.axes if axes.get_legend()]
    labels = [text.get_text() for axes in main for text in axes.get_legend().get_texts()]
    assert len(labels) == 9
    assert {"LA", "TO2", "TSO[23]"} < set(labels)
    children = [child for axes in figure.axes for child in axes.child_axes]
    sides = {axes.get_ylabel() for axes in children} | {axes.get_xlabel() for axes in children}
    sides |= {axes.get_ylabel() for axes in figure.axes} | {a.get_xlabel() for a in figure.axes}
    assert {"ω/2π (kHz)", "ω̄", "k (rad/mm)", "k̄ = k l/2π", "Im k (rad/mm)"} <= sides
