"""The verdict on a bar with layers or ends: every check can fail; its notes, and its tables."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from madeup import (
    LOSSY,
    PLACES,
    STIFF,
    T,
    cells_of,
    chain,
    field_of,
    plain_field,
    pulsed,
    reading_of,
    scattered_of,
)

from wavesim.case.load import load
from wavesim.case.schema import BandTable
from wavesim.material.damping import quality
from wavesim.readings.bar.eigenfrequencies import Ringing
from wavesim.readings.bar.transmission import Band
from wavesim.simulation.field import Energy
from wavesim.sources import InitialField
from wavesim.timedomain.integrate import simulate
from wavesim.verdict.bar import judge_bar
from wavesim.verdict.bar_answers import bar_notes
from wavesim.verdict.foreseen_errors import foretold
from wavesim.verdict.judgement import measure

OMEGA = np.linspace(1e5, 2e6, 12)
JUDGED = OMEGA < 1.5e6
DEEP = np.where(OMEGA > 1.2e6, 1e-4, 0.5) * np.exp(1j * OMEGA / 1e6)
RIGHT_T = scattered_of(OMEGA, 1.8e5, DEEP, 0.3 * DEEP, DEEP, 0.3 * DEEP, JUDGED)
COSINE = np.linspace(-3, 3, 12) + 0.1j
RIGHT_Q = cells_of(5e-3, OMEGA, 1.8e5, COSINE, COSINE, JUDGED)
RIGHT_RING = Ringing("longitudinal", OMEGA, OMEGA, OMEGA, np.ones(12), 1e3)


@pytest.fixture(scope="module")
def pulse():
    """A right reading of a pulse test: result and exact are the same, k that of the medium."""
    _, test = pulsed(chain((0.06, LOSSY)), "absorbing", PLACES, absorber=8e-3)
    found = test.result.dispersion
    right = dataclasses.replace(
        found, damped=test.k_exact, quality=np.asarray(quality(LOSSY.damping, found.omega))
    )
    result = dataclasses.replace(test.result, dispersion=right)
    return dataclasses.replace(test, result=result, exact=result)


def bent(values, amount, at=3):
    """The values with one of them wrong."""
    values = np.array(values)
    values[at] += amount
    return values


@pytest.mark.parametrize(
    ("right", "wrong", "fails"),
    [
        ({"scattered": (RIGHT_T,)}, {"T": bent(DEEP, 1.1e-3)}, ["T: |ΔT|"]),
        ({"scattered": (RIGHT_T,)}, {"R": bent(0.3 * DEEP, 1.1e-3j)}, ["R: |ΔR|"]),
        ({"scattered": (RIGHT_T,)}, {"T": bent(DEEP, np.nan)}, ["T: |ΔT|", "T down to −60 dB"]),
        (
            {"scattered": (RIGHT_T,)},
            {"T": bent(DEEP, 0.13 * DEEP[3])},
            ["T: |ΔT|", "T down to −60 dB"],
        ),
        ({"scattered": (RIGHT_T,)}, {"T": bent(DEEP, 0.5, at=11)}, []),  # not judged
        ({"cells": (RIGHT_Q,)}, {"cosine": bent(COSINE, 4e-3, at=1)}, ["|Δcos qL|"]),
        ({"cells": (RIGHT_Q,)}, {"cosine": bent(COSINE, 1.1e-3, at=6)}, ["|Δcos qL|"]),
        ({"ringing": (RIGHT_RING,)}, {"found": bent(OMEGA, np.nan)}, ["heard"]),
        ({"ringing": (RIGHT_RING,)}, {"found": bent(OMEGA, 1.1e-6 * OMEGA[3])}, ["maximum"]),
        ({"ringing": (RIGHT_RING,)}, {"found": OMEGA * (1 + 2e-6)}, ["maximum"]),
    ],
)
def test_every_check_of_waves_can_fail(right, wrong, fails):
    field = plain_field()
    checks = judge_bar(field, reading_of(**right))
    assert checks
    assert all(check.passed for check in checks)
    ((kind, (one,)),) = right.items()
    checks = judge_bar(field, reading_of(**{kind: (dataclasses.replace(one, **wrong),)}))
    failed = [check.name for check in checks if not check.passed]
    assert len(failed) == len(fails), failed
    assert all(text in name for text, name in zip(fails, failed, strict=True))


def band_of(low, high, worst, **limits):
    """A band from one frequency of RIGHT_T to another, the exact levels in it as given, dB."""
    ends = OMEGA[[low, high]] / (2 * np.pi)
    asked = BandTable.model_validate({"from": ends[0], "to": ends[1], **limits})
    return Band(asked, (worst, ends[0]), (worst, ends[0]))


@pytest.mark.parametrize(
    ("band", "wrong", "fails"),
    [
        (band_of(2, 5, -30.0, at_most=-30.0, at_least=-30.0), {}, []),
        (band_of(2, 5, -30.0), {"T": bent(DEEP, 1.1e-3)}, ["incident wave"]),
        (band_of(2, 5, -30.0), {"T": bent(DEEP, 1.1e-3, at=6)}, []),
        (band_of(2, 11, -30.0), {}, ["frequencies that the run tells of"]),
        (band_of(2, 5, -29.9, at_most=-30.0), {}, ["at most -30 dB"]),
        (band_of(2, 5, -30.1, at_least=-30.0), {}, ["at least -30 dB"]),
        (band_of(2, 5, float("nan"), at_most=-30.0), {}, ["at most -30 dB"]),
    ],
)
def test_a_band_is_held_to_what_the_run_tells_to_the_exact_t_and_to_its_limits(band, wrong, fails):
    found = dataclasses.replace(RIGHT_T, bands=(band,), **wrong)
    checks = judge_bar(plain_field(), reading_of(scattered=(found,)))
    failed = [c.name for c in checks if "kHz" in c.name and not c.passed]
    assert len(failed) == len(fails), failed
    assert all(text in name for text, name in zip(fails, failed, strict=True))


def test_the_worst_field_of_a_receiver_decides():
    field = plain_field(receivers={"a": 0.01, "b": 0.02})
    right = {"a": {"phi1": 9e-5, "B11": 1e-7}, "b": {"phi1": 1e-6}}
    assert all(check.passed for check in judge_bar(field, reading_of(error=right)))
    for wrong in (1.1e-4, float("nan")):
        checks = judge_bar(field, reading_of(error=right | {"b": {"phi1": 1e-6, "B11": wrong}}))
        assert [check.passed for check in checks] == [True, False]
        assert "signal at b" in checks[1].name
        assert "B11" in checks[1].name


def test_every_check_of_a_pulse_test_can_fail(pulse):
    field = plain_field()
    checks = judge_bar(field, reading_of(pulses=(pulse,)))
    assert [c.name.split(":")[0].split(" over")[0] for c in checks] == [
        "phi1 arrival, threshold",
        "phi1 arrival, envelope",
        "phi1 loss, 1 to 3",
        "phi1 k between receivers",
        "phi1 Q between receivers",
    ]
    assert all(check.passed for check in checks)
    result = pulse.result

    def late(convention):
        one = result.arrivals[convention]
        # 1.1e-3 of a period of 300 kHz.
        moved = dataclasses.replace(one, time=bent(one.time, 1.1e-3 / 3e5, at=1))
        return {"arrivals": result.arrivals | {convention: moved}}

    first = int(np.flatnonzero(result.loss.valid)[0])
    known = int(np.flatnonzero(np.isfinite(result.dispersion.damped))[0])
    wrong = [
        late("threshold"),
        late("envelope"),
        {"loss": dataclasses.replace(result.loss, level=bent(result.loss.level, 1.1, at=first))},
        {
            "dispersion": dataclasses.replace(
                result.dispersion,
                damped=bent(
                    result.dispersion.damped, 1.1e-3 * abs(result.dispersion.damped[known]), known
                ),
            )
        },
        {
            "dispersion": dataclasses.replace(
                result.dispersion, quality=1.03 * result.dispersion.quality
            )
        },
    ]
    for number, change in enumerate(wrong):
        bad = dataclasses.replace(pulse, result=dataclasses.replace(result, **change))
        passed = [check.passed for check in judge_bar(field, reading_of(pulses=(bad,)))]
        assert passed == [n != number for n in range(5)]


def test_energy_is_the_work_where_nothing_is_lost():
    """1e-6 of the work missing fails."""
    work = np.minimum(T / 3e-6, 1.0)
    for given, passes in ((work, True), (work * (1 + 1e-6), False)):
        checks = judge_bar(plain_field(Energy(0.4 * work, 0.6 * work, given)), reading_of())
        assert all(check.passed for check in checks) == passes


def test_what_was_dissipated_never_falls():
    """It is the work less the energy that is left; 1e-6 of it coming back fails."""
    work = np.minimum(T / 3e-6, 1.0)
    for back, passes in ((0.0, True), (1e-6, False)):
        lost = 0.3 * work * (1 - back * (T > 5e-5))
        energy = Energy(0.4 * (work - lost), 0.6 * (work - lost), work)
        (check,) = judge_bar(plain_field(energy, lossy=True), reading_of())
        assert check.passed == passes
        assert "dissipated" in check.name


def test_an_absorbing_layer_may_give_back_what_it_took():
    """κ is damped there, σ is not: a wave that decays in it has σκ < 0. By no stepper's fault."""
    work = np.minimum(T / 3e-6, 1.0)
    lost = 0.3 * work * (1 - 0.01 * (T > 5e-5))
    energy = Energy(0.4 * (work - lost), 0.6 * (work - lost), work)
    assert judge_bar(plain_field(energy, absorbing=True), reading_of()) == []


def test_nothing_judged_makes_no_check():
    nothing = np.zeros(12, bool)
    reading = reading_of(
        scattered=(dataclasses.replace(RIGHT_T, judged=nothing),),
        cells=(dataclasses.replace(RIGHT_Q, judged=nothing),),
    )
    assert judge_bar(plain_field(), reading) == []


def test_notes_say_what_was_not_compared():
    exact = {name: {"phi1": np.zeros(3)} for name in PLACES}
    assert bar_notes(reading_of(exact=exact, ringing=(RIGHT_RING,)), plain_field()) == []
    (note,) = bar_notes(reading_of(), plain_field(receivers={}))
    assert "no receiver" in note
    assert "add [[receivers]]" in note
    hidden = plain_field(receivers=PLACES | {"end": 0.058}, absorbing=True)
    (note,) = bar_notes(reading_of(exact=exact), hidden)
    assert "receiver end: stands in an absorbing layer" in note
    assert "0.008 to 0.052 m" in note


UNITS = {
    "phi1": "rad", "B11": "1/m",
    "omega": "rad/s", "sigma": "rad/s", "exact": "rad/s", "found": "rad/s", "bin": "rad/s",
    "period": "m", "q": "rad/m", "q_exact": "rad/m", "damped": "rad/m", "k_exact": "rad/m",
    "phase_velocity": "m/s", "group_velocity": "m/s", "attenuation": "1/m", "loss": "dB",
} | dict.fromkeys(
    ("T", "R", "T_exact", "R_exact", "T_real", "R_real", "judged", "cosine", "cosine_exact"), "–"
) | dict.fromkeys(("level", "quality"), "–")  # fmt: skip


def test_every_table_has_a_path_and_a_unit(pulse):
    reading = reading_of(
        exact={"a": {"phi1": np.zeros(3), "B11": np.zeros(3)}},
        scattered=(RIGHT_T,),
        cells=(RIGHT_Q,),
        ringing=(RIGHT_RING,),
        pulses=(pulse,),
    )
    tables = reading.tables()
    for path, (values, unit) in tables.items():
        assert unit == UNITS[path.rsplit("/", 1)[1]], path
        assert np.asarray(values).dtype.kind in "fcb", path
    assert {path.rsplit("/", 1)[0] for path in tables} == {
        "exact/a",
        "transmission/longitudinal",
        "bloch/longitudinal",
        "eigenfrequencies/longitudinal",
        "pulse/phi1",
    }
    # k at ω + iσ says nothing without σ.
    for group in ("transmission/longitudinal", "bloch/longitudinal", "pulse/phi1"):
        assert tables[f"{group}/sigma"][0] == pytest.approx(1.8e5)


def test_arrivals_are_held_to_the_period_of_a_signal():
    """An initial field beside it has none; of it arrivals had been allowed no error at all."""
    alone, test = pulsed(chain((0.06, STIFF)), "free", PLACES)
    at_rest = InitialField("phi1", 0.05, width=1e-3)
    both = field_of(alone.layers, alone.bar, [at_rest, *alone.sources], PLACES, alone["phi1"])
    allowed = [
        [c.tolerance for c in judge_bar(field, reading_of(pulses=(test,))) if "arrival" in c.name]
        for field in (alone, both)
    ]
    assert allowed[0] == allowed[1] != []


RING = """
[medium]
closure = "consistent"
[bar]
cells = 128
spacing = 1.25e-4
order = {order}
[[sources]]
field = "phi1"
position = 4e-3
peak_frequency = 1.6e5
[[receivers]]
name = "r"
position = 1.17e-2
[time]
duration = 6e-5
"""


@pytest.mark.parametrize(("order", "right"), [(2, False), (8, True)])
def test_receivers_of_a_ring_are_held_to_exact_signals(tmp_path, order, right):
    """To 1e-4, as those of any bar, and it is said before the run; ω(k) is right to 1e-2 in both.

    The error told is that beside a run on a grid of a third of the cells, by order 12, over the
    largest value anywhere: to a half, as the verdict takes the largest within half a wavelength.
    """
    path = tmp_path / "ring.toml"
    path.write_text(RING.format(order=order))
    case = load(path)
    now = case.simulation
    field = simulate(now.medium, now.bar, now.sources, now.duration, receivers=now.receivers)
    checks = {check.name: check for check in measure(case, field).checks}
    (told,) = (check for name, check in checks.items() if name.startswith("signal at r"))
    assert told.passed == right
    assert [name for name, check in checks.items() if not check.passed] == [told.name] * (not right)
    foreseen = [one for one in foretold(now) if '"r"' in one.what]
    assert [one.passed for one in foreseen] == [right]
    bar = dataclasses.replace(now.bar, cells=384, spacing=now.bar.length / 384, order=12)
    fine = simulate(now.medium, bar, now.sources, now.duration, receivers=now.receivers)
    off = max(
        np.abs(field.at(1.17e-2, name) - fine.at(1.17e-2, name)).max()
        / np.abs(fine.part(name)).max()
        for name in now.fields
    )
    assert right or abs(off / told.measured - 1) <= 0.5
