"""The printed dispersion coefficients, each as a formula written out apart from the program."""

from __future__ import annotations

from pathlib import Path

import misprints as findings
import numpy as np
import pytest

from wavesim import planewave
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.planewave import appendix_c
from wavesim.planewave import eigenproblem as spectral

# Appendix C as printed, signs restored; b, p, w are the shorthand of Appendix B. T33 is given the
# l²/4 that is missing in print.
FORMULAS = {
    "L11": "(b1+p1)*(5+2*a)+(b2+p2)*(16+10*a)",
    "L12": "5*p1+30*p2+(2*p1+12*p2)*a",
    "L13": "5*p1+9*p2+(2*p1+9*p2)*a",
    "L21": "5*p1+30*p2+(6*p1+8*p2)*a",
    "L22": "l**2/4*(35*w1+280*w2+14*w1*a+112*w2*a)",
    "L23": "l**2/4*(14*w1+112*w2+11*w1*a+88*w2*a)",
    "L31": "5*p1+9*p2+(4*p1+7*p2)*a",
    "L33": "l**2/8*(49*w1+149*w2+25*w1*a+119*w2*a)",
    "L220": "15*p1+90*p2",
    "L230": "(6*p1+15*p2)*a",
    "L330": "(15*p1+27*p2+6*p1*a+6*p2*a)/2",
    "T11": "(b1+p1)*(5+2*a)+(b2+p2)*(2-a)",
    "T12": "5*p1+9*p2+2*p1*a",
    "T13": "(p1-p2)*(5+2*a)",
    "T21": "5*p1+9*p2+(p1+p2)*a",
    "T22": "l**2/4*(28*w1+80*w2+(13*w1+23*w2)*a)",
    "T23": "l**2/4*(w1-w2)*(14+11*a)",
    "T31": "(p1-p2)*(5+a)",
    "T33": "l**2/4*(w1-w2)*(28+13*a)",
    "T220": "10*p1+18*p2+2*(p1+p2)*a",
    "T330": "(p1-p2)*(10+2*a)",
    "S11": "l**2/4*(7*w1+11*w2-3*w2*a+w1*a)",
    "S110": "5*p1+9*p2-2*p1*a-2*p2*a",
    "S22": "l**2/4*(w1-w2)*(7+a)",
    "S220": "(p1-p2)*(5-2*a)",
}
MEDIUM = Medium(
    anisotropy=0.37,
    stiffness_ratio=0.3,
    branch_length=1.3e-3,
    particle_radius=6e-4,
    contact_density=7e8,
    density=1400.0,
    G_n_a=4.0,
    G_n_r=7.0,
    G_n_g=0.9,
    closure="appendix_c",
)


def shorthand(medium):
    """b, p, w of Appendix B from the contact stiffnesses, and a, l."""
    values = {"a": medium.anisotropy, "l": medium.branch_length}
    for letter, normal, many, over in (
        ("b", medium.G_n_a, 6, 105),
        ("p", medium.G_n_r, 6, 105),
        ("w", medium.G_n_g, 8, 945),
    ):
        tangential = medium.stiffness_ratio * normal
        values[f"{letter}1"] = (normal + many * tangential) / over
        values[f"{letter}2"] = (normal - tangential) / over
    return values


def value(name, medium=MEDIUM):
    return eval(FORMULAS[name], {}, shorthand(medium))


@pytest.mark.parametrize("name", FORMULAS)
def test_every_printed_coefficient(name):
    """Constant and sign of each, to rounding; a wrong factor of one term moves it by 1e-3."""
    assert appendix_c.PRINTED.keys() == FORMULAS.keys()
    assert appendix_c.PRINTED[name].value(MEDIUM) == pytest.approx(value(name), rel=1e-14)


def determinant(block, k, omega):
    """The printed determinant of Eqs. (51)–(54) in SI, with ω as given."""
    c = {name: value(name) for name in FORMULAS}
    per_area = MEDIUM.branch_length**2 * MEDIUM.contact_density
    phi, bend = (MEDIUM.density * x / per_area * omega**2 for x in (MEDIUM.beta, MEDIUM.gamma))
    if block == "longitudinal":
        coupled = c["L23"] * k**2 + c["L230"]
        matrix = [
            [c["L11"] * k**2 - phi, c["L12"] * k, c["L13"] * k],
            [c["L21"] * k, c["L22"] * k**2 + c["L220"] - 3 * bend, coupled],
            [c["L31"] * k, coupled, c["L33"] * k**2 + c["L330"] - 1.5 * bend],
        ]
    elif block.startswith("transverse"):
        matrix = [
            [c["T11"] * k**2 - phi, c["T12"] * k, c["T13"] * k],
            [c["T21"] * k, c["T22"] * k**2 + c["T220"] - 2 * bend, c["T23"] * k**2],
            [c["T31"] * k, c["T23"] * k**2, c["T33"] * k**2 + c["T330"] - 2 * bend],
        ]
    else:
        number = "22" if block == "inplane[23]" else "11"
        matrix = [[c[f"S{number}"] * k**2 + c[f"S{number}0"] - bend]]
    return np.linalg.det(np.array(matrix))


@pytest.mark.parametrize("block", ROTATION.blocks, ids=lambda block: block.name)
def test_frequencies_make_the_printed_determinant_vanish(block):
    """Roots of the printed determinant, found as sign changes on both sides of each ω(k).

    A coefficient wrongly placed, or with a wrong sign, moves the root. Tolerance 1e-9 of ω.
    """
    for k_bar in (0.0, 0.1, 0.4, 1.0):
        k = 2 * np.pi * k_bar / MEDIUM.branch_length
        for omega in planewave.block_frequencies(MEDIUM, block, k)[0]:
            if omega > 0:
                below, above = (determinant(block.name, k, omega * (1 + x)) for x in (-1e-9, 1e-9))
                assert below * above < 0


def test_closures_coincide_in_an_isotropic_medium():
    """At a = 0 the three are one: every coefficient of every block, to rounding."""
    for block in ROTATION.blocks:
        one, two = (
            spectral.spectral_form(Medium(closure=closure, G_n_g=0.1), block)
            for closure in ("appendix_c", "consistent")
        )
        for name in ("c_pp", "c_pb", "c_bp", "c_bb", "gamma"):
            np.testing.assert_allclose(
                getattr(one, name), getattr(two, name), rtol=1e-12, atol=1e-15
            )


def test_findings_name_the_coefficients_that_differ():
    """Derived from the equations and tensors, not listed: eleven of 25 differ, four hold by both
    the equations and Appendix C but not by the tensors, and so on."""
    found = {finding.name: finding for finding in findings.appendix_c_findings()}
    assert len(found) == 25
    differ = {name for name, finding in found.items() if not finding.agrees}
    assert differ == {
        "L21", "L31", "L23′", "L33′", "T21", "T31", "T22′", "T33′", "S11", "S11′", "S22′"
    }  # fmt: skip
    misprints = {name for name, f in found.items() if f.printed != f.equations}
    assert misprints == {"L21", "S11"}
    assert found["L21"].printed == (5, 30, 6, 8)
    assert found["L21"].equations == (5, 30, 4, 10)
    assert found["L21"].tensors == (5, 30, 2, 12)
    assert found["S11"].text(found["S11"].equations) == "(l²/4)(7w₁ + 11w₂ + w₁a − w₂a)"
    symmetric = {"L21": "L12", "L31": "L13", "T21": "T12", "T31": "T13"}
    for there, back in symmetric.items():
        assert found[there].tensors == found[back].printed


def test_findings_on_the_wave_equations():
    """Only the nine diagonal terms of Eqs. (29)–(37) differ from the tensor M."""
    found = findings.equation_findings()
    differ = [finding for finding in found if not finding.agrees]
    assert len(differ) == 9
    assert all(f.name.split()[1] == f.name.split()[-1] for f in differ)
    by_name = {finding.name: finding for finding in found}
    first = by_name["(29) B11 in the equation of B11"]
    assert (first.printed, first.tensors) == ((5, 16, 4, 8), (5, 16, 2, 10))


@pytest.mark.parametrize(
    "finding",
    [f for f in (*findings.appendix_c_findings(), *findings.equation_findings()) if not f.agrees],
    ids=lambda finding: finding.name,
)
def test_what_is_misprinted_is_told_as_it_is_derived(finding):
    """Each coefficient that differs has its row in docs/physics.md."""
    told = (Path(__file__).parents[1] / "docs" / "physics.md").read_text(encoding="utf-8")
    found = (finding.printed, finding.equations, finding.tensors)
    written = [finding.text(factors) for factors in found]
    if finding.name.startswith("("):  # of an equation: the coefficient of a field in its own
        del written[1]
    cells = " | ".join(written)
    assert f"| {finding.name.partition(' in ')[0]} | {cells} |" in told
