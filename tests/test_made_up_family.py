"""Law of the house: a family is data. A third one, made up here, runs from medium to verdict.

Beads on a string, each with two pendulums: one macro-field, two micro-fields, one sector.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pytest

import wavesim as ws


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


@pytest.mark.parametrize("drive", ["pull", "hold"])
def test_a_bar_of_two_of_its_media_passes_the_verdict(drive):
    """Driven at its end in the family's own words, held against the exact layered solution."""
    layers = ws.Layers((ws.Layer(0, 1.5, MEDIUM), ws.Layer(1.5, 2.0, HEAVY)))
    bar = ws.layered_bar(layers, 0.1 / 16, 8, "free" if drive == "pull" else "fixed", "fixed")
    pulse = ws.Ricker("w1", position=0.0, peak_frequency=PITCH, drive=drive)
    receivers = {"a": 0.4, "b": 1.2}
    field = ws.simulate(layers, bar, [pulse], 100 * MEDIUM.time_scale, receivers=receivers)
    checks = ws.judge_bar(field, ws.read_bar(field))
    assert len(checks) >= 5
    assert [check.name for check in checks if not check.passed] == []
