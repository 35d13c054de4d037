"""Law of the house: a family is data. A third one, made up here, runs from medium to verdict.

Beads on a string, each with two pendulums: one macro-field, two micro-fields, one sector.
"""

import json
import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pytest
from runs import call

import wavesim as ws
from wavesim.planewave.gap_map import gap_map


@dataclass(frozen=True)
class Beads(ws.Medium):
    tension: Annotated[Any, ws.Parameter("T", "N")] = 40.0
    springs: Annotated[Any, ws.Parameter("s", "N")] = 10.0
    length_scale = 0.1
    family = ws.Family(
        name="beads",
        macro=("w1",),
        micro=("C1", "C2"),
        blocks=(ws.Block("sway", "sway", ({"w1": 1},), ({"C1": 1}, {"C2": 1}), ("A", "O1", "O2")),),
        gaps={"sway": ("XB1", "XB2")},
        units=("m", "–"),
        symbols=("w", "C"),
        drives={"pull": "surface", "hold": "prescribed"},
    )

    def flux_form(self):
        to, own = np.array([[1.0, 0.6]]), np.array([[1.2, 0.1], [0.1, 2.5]])
        string = np.eye(1) * self.tension
        s = self.springs
        return ws.FluxForm(0.5, 0.002, string, s * to, s * to.T, s * own, np.zeros((2, 2)))


MEDIUM, HEAVY = Beads(), Beads(tension=90.0, springs=15.0)
PITCH = 0.3 / (2 * math.pi * MEDIUM.time_scale)


def test_its_waves_on_a_ring_pass_the_verdict():
    """Edges by hand: ω² of C_BB/m_B, and of (C_BB − C_Bφ C_φφ⁻¹ C_φB)/m_B."""
    form = MEDIUM.flux_form()
    upper = np.linalg.eigvalsh(form.C_B_B / form.m_B) ** 0.5
    bare = form.C_B_B - form.C_B_phi @ form.C_phi_B / MEDIUM.tension
    lower = np.linalg.eigvalsh(bare / form.m_B) ** 0.5
    gaps = ws.planewave.gaps(MEDIUM, "sway")
    assert [gap.name for gap in gaps] == ["XB1", "XB2"]
    np.testing.assert_allclose([[g.lower, g.upper] for g in gaps], np.c_[lower, upper], rtol=1e-12)
    bar = ws.Bar(cells=1024, spacing=0.0125)
    pulses = [
        ws.Ricker("w1", position=6.4, peak_frequency=3 * PITCH),
        ws.Ricker("C1", position=6.4, peak_frequency=3 * PITCH, amplitude=0.06),
    ]
    field = ws.simulate(MEDIUM, bar, pulses, 300 * MEDIUM.time_scale)
    (measured,) = ws.extract(field)
    checks = ws.judge(field, [ws.hold(field, measured)])
    assert len(checks) >= 14
    assert [check.name for check in checks if not check.passed] == []
    assert field.unit("C1") == "–"
    assert measured.plot().axes[0].get_title() == "sway: w₁, C₁, C₂"


def test_a_bar_of_two_of_its_media_passes_the_verdict():
    """Driven at its end in the family's own words, held against the exact layered solution."""
    layers = ws.Layers((ws.Layer(0, 1.5, MEDIUM), ws.Layer(1.5, 2.0, HEAVY)))
    bar = ws.layered_bar(layers, 0.1 / 16, 8, "fixed", "fixed")
    pulse = ws.Ricker("w1", position=0.0, peak_frequency=PITCH, drive="hold")
    receivers = {"a": 0.4, "b": 1.2}
    field = ws.simulate(layers, bar, [pulse], 100 * MEDIUM.time_scale, receivers=receivers)
    checks = ws.judge_bar(field, ws.read_bar(field))
    assert len(checks) >= 5
    assert [check.name for check in checks if not check.passed] == []


CASE = f"""\
medium = {{ family = "beads", springs = 10.0 }}
bar = {{ left = "free", right = "fixed", spacing = 6.25e-3 }}
layers = [
    {{ from = 0.0, to = 1.5 }},
    {{ from = 1.5, to = 2.0, tension = 90.0, springs = 15.0 }},
]
sources = [{{ field = "w1", end = "left", drive = "pull", peak_frequency = {PITCH} }}]
receivers = [{{ name = "a", position = 0.4 }}, {{ name = "b", position = 1.2 }}]
time.duration = {100 * MEDIUM.time_scale}
"""


def test_a_case_file_of_it_runs_to_its_verdict(tmp_path):
    """In the process that made the family, after case files were read already: its keys have their
    ranges, layers are of it, and figures, page and verdict are there."""
    assert ws.load("slab").medium.family.name == "rotation"
    case = tmp_path / "beads.toml"
    case.write_text(CASE)
    result = call("run", case, "--out", tmp_path, "--quiet")
    assert result.exit_code == 0, result.output
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert len(summary["checks"]) >= 5
    assert all(check["passed"] for check in summary["checks"])
    assert "could not" not in result.output
    assert (tmp_path / "overview.png").stat().st_size > 10_000
    assert ws.open(tmp_path).field.layers.media == (MEDIUM, HEAVY)
    for wrong, told in (
        ("tension=-1", r"[medium] tension = -1: must be greater than 0"),
        ("tensio=1", "tensio = 1: unknown key; did you mean tension?"),
        ("anisotropy=0", "is no key of family beads, which has tension, springs of its own"),
    ):
        refused = call("check", case, "--set", f"medium.{wrong}")
        assert refused.exit_code == 2
        assert told in refused.output


def test_maps_of_its_gaps_hold_those_of_each_medium():
    """Over both of its parameters; 1e-12 of planewave.gaps."""
    found = gap_map(MEDIUM, ("tension", [30.0, 60.0]), ("springs", [8.0, 12.0, 16.0]))
    for i, springs in enumerate((8.0, 12.0, 16.0)):
        for j, tension in enumerate((30.0, 60.0)):
            for gap in ws.planewave.gaps(Beads(tension=tension, springs=springs), "sway"):
                one = found.sel(gap=gap.name).isel(tension=j, springs=i)
                edges = float(one["lower"]), float(one["upper"])
                assert edges == pytest.approx((gap.lower, gap.upper), rel=1e-12)
