"""What is said of numbers given as text: the unit, the form, and the number that was meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from wavesim.case.load import build, load
from wavesim.case.schema import CaseError, CaseFile, parse
from wavesim.case.units import UNITS, numbered

CASES = Path(__file__).parent.parent / "cases"


def told(case, *overrides):
    with pytest.raises(CaseError) as caught:
        load(CASES / case, overrides)
    return str(caught.value).split(".toml: ")[1]


@pytest.mark.parametrize(
    ("case", "override", "line"),
    [
        ("pulse_test", "sources.0.frequency='50 kHz'",
         '[[sources]] number 1: frequency = "50 kHz": must be a number in Hz, without quotes or '
         "unit: 50000.0"),
        ("pulse_test", "sources.0.frequency='0.3MHz'", "unit: 300000.0"),
        ("slab", "sources.0.peak_frequency='600e3'", "Hz, without quotes or unit: 600000.0"),
        ("slab", "bar.length='64 mm'", "[bar] length = \"64 mm\": must be a number in m, without "
         "quotes or unit: 0.064"),
        ("slab", "time.duration='160 us'", "a number in s, without quotes or unit: 0.00016"),
        ("slab", "time.duration='160 µs'", "unit: 0.00016"),
        ("slab", "time.duration='soon'", "a number in s, without quotes or unit"),
        ("slab", "layers.1.from='28 mm'", "[[layers]] number 2: from = \"28 mm\": must be a number "
         "in m, without quotes or unit: 0.028"),
        ("slab", "layers.1.density='2400 kg/m3'", "must be a number in kg/m³, or a pair"),
        ("slab", "layers.1.G_n_a='7'", "must be a number in N·m, or a pair [at from, at to], "
         "without quotes or unit: 7.0"),
        ("slab", "time.step='5 ns'", "unit: 5e-09"),
        ("slab", "receivers.0.position='2 inch'", "a number in m, without quotes or unit"),
        ("lossy", "medium.quality_band='50-2000 kHz'", "an array of numbers in Hz"),
        ("slab", "boundary.left='free'", "[boundary]: unknown table; known are title, medium"),
        ("slab", "duration=1e-4", "unknown key; did you mean time.duration?"),
        ("slab", "sources[x].peak_frequency=1e6", "unknown table; did you mean sources"),
        ("slab", "sources[0].peak_frequency='1 MHz'", "unit: 1000000.0"),
        ("slab", "bar.constrained-x=3", "constrained-x = 3: unknown key"),
        ("slab", "bar.left=2026-01-01", "[bar] left = 2026-01-01: must be"),
        ("slab", "bar.left=[true, {a=07:32:00}]", "[bar] left = [true, {a = 07:32:00}]: must be"),
        ("slab", "layer=[{from=0.0}]", "[[layer]]: unknown table; did you mean layers?"),
    ],
)  # fmt: skip
def test_text_in_place_of_a_number_says_unit_and_form(case, override, line):
    assert line in told(f"{case}.toml", override)


def test_what_is_not_clear_is_not_guessed():
    text = "x: must be a number"
    assert numbered("length", text, "2 inch").endswith("in m, without quotes or unit")
    assert numbered("length", text, "5 kHz").endswith("without quotes or unit")
    assert numbered("anisotropy", text, "a quarter") == f"{text}, without quotes or unit"
    # mHz is not MHz in a laboratory, but nobody means millihertz here.
    assert numbered("frequency", text, "1.5 MHz").endswith(": 1500000.0")


def test_units_are_of_keys_that_exist():
    """Every key with a unit is one of the tables, so that none is left when one is renamed."""
    import json

    keys = json.dumps(CaseFile.model_json_schema())
    assert [key for key in UNITS if f'"{key}"' not in keys] == []


@pytest.mark.parametrize("case", ["slab", "stack"])
def test_a_thin_layer_gets_cells_enough_beside_a_spacing(case):
    """And what is resolved of the case has the same grid again."""
    thin = ["layers.0.layers.0.thickness=3e-4"]
    if case == "slab":
        thin = ["layers.1.to=0.0285", "layers.2.from=0.0285"]
    made = load(CASES / f"{case}.toml", thin)
    assert made.simulation.bar.stretches[1][0] == 16
    again = build(parse(made.resolved("auto", 1e-7), "again"), "again")
    assert again.simulation.bar == made.simulation.bar
