"""The few rows that a run answers with: each number by another route, and advice that works."""

from __future__ import annotations

import dataclasses
import shlex
from io import StringIO

import numpy as np
import pytest
from madeup import SOFT, STIFF, chain, field_of, reading_of, scattered_of
from rich.console import Console
from rich.text import Text

from wavesim import planewave
from wavesim.case.load import load
from wavesim.grid.bar import layered_bar
from wavesim.layered.transmission import Specimen
from wavesim.layered.transmission import specimen as between
from wavesim.material.shown import with_error
from wavesim.readings.bar.transmission import specimen
from wavesim.report.answers import answers, verdict
from wavesim.report.terminal import new_table
from wavesim.sources import Ricker
from wavesim.verdict.bar_answers import of_bar
from wavesim.verdict.endless import endless_notes, of_endless

KHZ = 2e3 * np.pi


@pytest.mark.parametrize("width", [18, 26, 40, 60, 79, 80, 200])
def test_no_digit_of_a_table_is_lost_however_narrow_the_terminal(width):
    """Every number is whole where there is room for it and its row's name, and else goes on below;
    no line is wider than the terminal."""
    table = new_table("receiver", "first break\n(µs)", "threshold (µs)", "correlation (µs)")
    numbers = ["2510.303 ± 6e-05", "2454.135 ± 0.00001", "2538.5964 ± 0.0003"]
    table.add_row("x=10 mm", "–", Text("13.45"), "14.444")
    table.add_section()
    table.add_row("velocity (m/s)", *numbers)
    out = StringIO()
    Console(file=out, width=width, highlight=False).print(table)
    lines = out.getvalue().splitlines()
    assert max(map(len, lines)) <= width
    for number in [*numbers, "13.45", "14.444"]:
        if width >= 40:
            assert any(number in line for line in lines), number
        else:
            digits = "".join(line[-width // 2 :].strip() for line in lines)
            assert all(part in digits for part in number.split(" ± ")[-1:])


@pytest.mark.parametrize("value", [0.0, 4.2e-7, 0.0123, 1.0, -713.4, 36963.7, -9.9996e5, 2.5e11])
@pytest.mark.parametrize("error", [3.3e-12, 9.96e-5, 0.19, 12.0, 4.7e4])
def test_a_value_stands_to_two_digits_of_its_error(value, error):
    """Both are read back to half a unit of the error's second digit, the value to its seventh at
    the finest, beside which the error has one, and no more is written."""
    told = with_error(value, error)
    read, bar = (float(part) for part in told.split(" ± "))
    unit = 10.0 ** (np.floor(np.log10(error)) - (1 if error >= 1e-6 * abs(value) else 0))
    assert bar == pytest.approx(error, abs=0.51 * unit)
    assert read == pytest.approx(value, abs=max(0.51 * unit, 5e-7 * abs(value)))
    digits = told.split(" ± ")[0].split("e")[0].replace(".", "").strip("-0")
    assert len(digits) <= 9
    assert with_error(value) == f"{value:.6g}"
    assert with_error(np.nan, error) == "–"


def test_gaps_of_a_ring_are_those_of_its_medium_with_the_decay_in_their_middle(small_run):
    """Edges and Im k by the plane-wave solver; what was measured there to 1e-4."""
    medium = small_run.field.medium
    rows = {row["gap"]: row for row in small_run.summary["answers"]["gaps"]}
    for gap in planewave.gaps(medium, "longitudinal"):
        row = rows[gap.name]
        assert row["lower"] == pytest.approx(gap.lower / 2 / np.pi, rel=1e-12)
        assert row["upper"] == pytest.approx(gap.upper / 2 / np.pi, rel=1e-12)
        assert row["frequency"] == pytest.approx((gap.lower + gap.upper) / 4 / np.pi, rel=1e-12)
        k = planewave.wavenumber(medium, "longitudinal", 2 * np.pi * row["frequency"])
        decibels = 20 * np.log10(np.e) * np.ravel(k)[0].imag
        assert row["attenuation_at_real_frequency"] == pytest.approx(decibels, rel=1e-9)
        assert row["attenuation"] == pytest.approx(row["attenuation_exact"], rel=1e-4)
    assert rows["RSB"]["attenuation"] is None
    assert rows["RTB1"]["frequencies"] == 0
    assert "not driven" in rows["RTB1"]["closer"]
    free = [(row["lower"], row["upper"]) for row in small_run.summary["answers"]["full_gaps"]]
    for low, high in free:  # each is in a gap of every sector that travels, or past its branches
        for sector in medium.family.travelling:
            k = np.linspace(0, 0.999 * np.pi / 1.25e-4, 400)
            omega = planewave.frequencies(medium, sector, k) / KHZ / 1e3
            assert not ((omega > low * (1 + 1e-9)) & (omega < high * (1 - 1e-9))).any()
    # Where there is no number a word says why, once for all that have none for the same reason.
    told = answers(small_run.summary)[0].note
    assert all((row["untold"] == "") == (row["attenuation"] is not None) for row in rows.values())
    assert "RTB1, RTB2: no source drives transverse waves" in told


def test_what_a_receiver_has_lost_in_a_gap_is_the_decay_times_the_way(shipped, small_run):
    """−8.686 Im k(ω) d dB, k of the plane-wave solver, d the shorter way round a ring; 20 dB are
    lost within the distance told. On a finite bar of one medium as on a ring."""
    for run in (small_run, shipped("pulse_test")):
        field, found = run.field, run.summary["answers"]
        assert [row["receiver"] for row in found["receivers"]]
        for row in found["gaps"]:
            if row["sector"] != "longitudinal":
                continue
            omega = 2 * np.pi * row["frequency"]
            k = planewave.wavenumber(field.medium, "longitudinal", omega).item()
            within = row["twenty_decibels_within"]
            assert np.exp(-k.imag * within) == pytest.approx(0.1, rel=1e-9)
            for receiver in found["receivers"]:
                way = abs(field.receivers[receiver["receiver"]] - field.sources[0].position)
                way = min(way, field.bar.length - way) if field.bar.periodic else way
                assert receiver["distance"] == pytest.approx(way, rel=1e-12)
                left = 10 ** (receiver[row["gap"]] / 20)
                assert left == pytest.approx(np.exp(-k.imag * way), rel=1e-9)


def test_a_gap_told_at_no_frequency_is_named_as_in_tables_with_what_tells_it(small_run, small_held):
    """What a record's end leaves out falls as e^−σT: with the damping named it is small enough.
    At one frequency alone, that is the answer."""
    field = small_run.field
    (gap, *_), (held, *_) = planewave.gaps(field.medium, "longitudinal"), small_held
    curve = held.measured.attenuation
    inside = (curve.omega > gap.lower) & (curve.omega < gap.upper)
    one = inside & (np.cumsum(inside) == inside.sum() // 2)
    for known in (inside & False, one):
        error = np.where(inside & ~known, 1e-2 * np.abs(curve.k), 1e-9)
        curve_of = dataclasses.replace(curve, error=error)
        changed = dataclasses.replace(
            held, measured=dataclasses.replace(held.measured, attenuation=curve_of)
        )
        (row, *_) = of_endless(field, [changed])["gaps"]
        told = [note for note in endless_notes(field, [changed]) if "can't be told" in note]
        if known.any():
            assert not told
            decibels = 20 * np.log10(np.e) * curve.k[known][0].imag
            assert row["attenuation"] == pytest.approx(decibels, rel=1e-12)
            assert row["frequencies"] == 1
            continue
        assert row["attenuation"] is None
        assert "this record does not tell it" in row["untold"]
        (note,) = told
        assert f"longitudinal {gap.name};" in note
        now, raised = curve.sigma * field.t[-1], float(note.partition("damping to ")[2].split()[0])
        assert 1e-2 * np.exp(now - raised) < 0.3 * 1e-3


def test_advice_is_one_that_a_case_takes_and_shows_more_of_the_gap(small_run, small_case):
    """Frequencies twice as fine where the gap is driven, or else the source in it."""
    before = small_run.loaded.simulation
    for row in small_run.summary["answers"]["gaps"]:
        words = shlex.split(row["closer"])
        assert bool(words) == (row["sector"] != "inplane")  # which do not travel
        if not words or words[0] != "--set":
            continue
        case = load(small_case, words[1::2])
        changed = [s for s in case.simulation.sources if s.peak_frequency != 1e6]
        for source in changed:
            assert row["lower"] < source.peak_frequency < row["upper"]
        if not changed:
            assert case.simulation.duration == pytest.approx(2 * before.duration)
            assert case.analysis.frequencies == 2 * small_run.loaded.analysis.frequencies
            longer = case.simulation.bar.length / before.bar.length
            assert longer == pytest.approx(case.simulation.duration / before.duration)


def test_long_waves_go_at_their_speed(small_run):
    """Phase velocity at the lowest judged k, k̄ = 0.02: below the long-wave speed by 1 % at most."""
    (row,) = small_run.summary["answers"]["velocities"]
    speed = planewave.long_wave_speed(small_run.field.medium, "longitudinal")
    assert row["wave"] == "LA"
    assert 0.99 * speed < row["velocity_exact"] < speed
    assert row["velocity"] == pytest.approx(row["velocity_exact"], rel=1e-4)


def nothing_more(self, sector, bands):
    """Of a level that is made up its layers know nothing."""
    return np.zeros(0), np.zeros(0)


def test_stop_bands_are_where_a_level_crosses_20_decibels(monkeypatch):
    """|T| falls as a straight line in dB from 0 at 400 kHz to −40 at 500, and back to 600: below
    −20 dB from 450 to 550 kHz. What lies deeper than a record can tell has no level."""
    monkeypatch.setattr(Specimen, "peaks_within", nothing_more)
    omega = np.linspace(3e5, 8e5, 101) * 2 * np.pi
    level = np.interp(omega / KHZ, [400, 500, 600], [0, -40, 0])
    layers = chain((0.02, STIFF), (0.006, SOFT), (0.02, STIFF))
    bar = layered_bar(layers, 1.25e-4, 8, "absorbing", "absorbing", 8e-3)
    field = field_of(layers, bar, [Ricker("phi1", 0.008, 5e5)], {"a": 0.015})
    for depth, seen in ((1.0, True), (5.0, False)):
        T = 10 ** (depth * level / 20) + 0j
        known = np.ones(len(omega), bool)
        found = scattered_of(omega, 1e5, T, T, T, T, known)
        band, most = of_bar(field, reading_of(scattered=(found,)))["transmission"]
        half = 50 + 50 * (1 - 1 / depth)
        assert band["lower"] == pytest.approx((500 - half) * 1e3, rel=2e-3)
        assert band["upper"] == pytest.approx((500 + half) * 1e3, rel=2e-3)
        assert (band["lower_open"], band["upper_open"]) == (False, False)
        assert (band["level"] is not None) is seen
        assert band["level_exact"] == pytest.approx(-40 * depth, abs=1)
        assert most["where"] == "most passes"
        assert most["level"] == pytest.approx(0, abs=1e-9)


def test_stop_bands_are_those_of_a_steady_wave_and_open_where_the_run_ends(monkeypatch):
    """At real ω −40 dB from 500 kHz on, −10 dB below; the run tells of 300 to 800 kHz, and sees 20
    dB less at ω + iσ all over."""
    monkeypatch.setattr(Specimen, "peaks_within", nothing_more)
    omega = np.linspace(3e5, 9e5, 121) * 2 * np.pi
    real = np.where(omega < 500 * KHZ, 10**-0.5, 1e-2) + 0j
    layers = chain((0.02, STIFF), (0.006, SOFT), (0.02, STIFF))
    bar = layered_bar(layers, 1.25e-4, 8, "absorbing", "absorbing", 8e-3)
    field = field_of(layers, bar, [Ricker("phi1", 0.008, 5e5)], {"a": 0.015})
    T, judged = real / 10, omega <= 800 * KHZ
    found = scattered_of(omega, 1e5, T, T, T, T, judged, real=real)
    band, most = of_bar(field, reading_of(scattered=(found,)))["transmission"]
    assert band["lower"] == pytest.approx(5e5, abs=5e3)
    assert band["upper"] == pytest.approx(8e5, rel=1e-9)
    assert (band["lower_open"], band["upper_open"]) == (False, True)
    assert (band["level_at_real_frequency"], band["level"]) == pytest.approx((-40, -60))
    assert (most["level_at_real_frequency"], most["level"]) == pytest.approx((-10, -30))
    (table,) = answers({"answers": {"transmission": [band, most]}})
    assert "800 or more" in [column.shown(band) for column in table.columns]
    # What shows more of it drives its upper end, in frames that hold what it drives.
    given = dict(pair.split("=") for pair in shlex.split(band["closer"])[1::2])
    source = Ricker("phi1", 0.008, float(given["sources.0.peak_frequency"]))
    assert source.peak_frequency == pytest.approx(8e5, rel=1e-2)
    samples = int(given.get("time.samples", len(field.t)))
    highest = np.pi * (samples - 1) / field.t[-1]
    assert abs(source.spectrum(highest)) < 1e-3 * abs(source.spectrum(2 * np.pi * 8e5))


def test_nothing_passes_a_stop_band_however_many_resonances_crowd_below_it():
    """A slab without losses: T = 1/(cos kd − ½i(r + 1/r) sin kd), r = k₀/k, with k → ∞ at the
    asymptote, where its gap begins, and resonances ever narrower below."""
    d = 0.006
    layers = chain((0.02, STIFF), (d, SOFT), (0.02, STIFF))
    bar = layered_bar(layers, 1.25e-4, 8, "absorbing", "absorbing", 8e-3)
    field = field_of(layers, bar, [Ricker("phi1", 0.008, 6e5)], {"a": 0.015})
    (block,) = field.blocks
    known = specimen(field, block, 120, 18.0)
    told = known.omega, known.sigma, *[known.T_exact] * 4, known.judged
    found = dataclasses.replace(scattered_of(*told), line=known.line)
    bands = of_bar(field, reading_of(scattered=(found,)))["transmission"][:-1]
    gap = planewave.gaps(SOFT, block.sector)[0]
    assert any(band["lower"] == pytest.approx(gap.lower / 2 / np.pi, rel=1e-4) for band in bands)
    for band in bands:
        omega = 2 * np.pi * np.linspace(band["lower"], band["upper"], 4001)[1:-1]
        k, outside = (planewave.wavenumber(one, block.sector, omega) for one in (SOFT, STIFF))
        T = 1 / (np.cos(k * d) - 0.5j * (outside / k + k / outside) * np.sin(k * d))
        assert (np.abs(T) < 0.1 * 1.001).all()


def check(name, passed, **more):
    numbers = {"measured": 0.0 if passed else 1.0, "reference": 0.0, "tolerance": 0.1, "unit": "–"}
    return {"name": name, "passed": passed} | numbers | more


def test_verdict_is_a_sentence_that_names_what_fell_short():
    assert verdict({"checks": []}).startswith("Nothing was checked")
    good = [check("signal at a: |Δu|/peak", True)] * 3
    assert verdict({"checks": good}).startswith("3 of 3 checks passed: the simulation agrees")
    alone = verdict({"checks": [check("energy − work over energy", True)]})
    assert "of energy alone" in alone
    assert "exact" not in alone
    told = verdict({"checks": [*good, check("T of x: |ΔT| …", False), check("R: |ΔR|", False)]})
    assert "3 of 5 checks passed" in told
    assert "“T of x” and 1 more fell short" in told
    assert "\n" not in told


def test_every_answer_has_its_table(small_run):
    tables = answers(small_run.summary)
    assert [len(table.rows) for table in tables] == [
        len(rows) for rows in small_run.summary["answers"].values()
    ]
    for table in tables:
        for column in table.columns:
            assert any(column.key in row for row in table.rows)


def test_no_narrow_pass_band_lies_in_a_stop_band(shipped):
    """Of eight cells each pass band has seven resonances, some narrower than a frequency of the
    line: of 4,000 frequencies in each band told, no more than 0.2 % pass (9 % were)."""
    run = shipped("bragg_mirror")
    known = between(run.field.layers)
    for row in run.summary["answers"]["transmission"]:
        if row["lower"] is None:
            continue
        omega = 2 * np.pi * np.linspace(row["lower"], row["upper"], 4002)[1:-1]
        level = np.abs(known.at_real(row["sector"], omega).T)
        assert np.mean(level > 0.1) <= 2e-3, row["where"]
