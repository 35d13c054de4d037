"""A series of pulse tests: its wave is one that moves with the state, whatever its form."""

import numpy as np
import pytest

from wavesim.readings.pulse.common_crosstalk import without_still
from wavesim.readings.pulse.power_law import off_the_law
from wavesim.readings.pulse.reading import Wanted
from wavesim.readings.pulse.series import follow_clearest
from wavesim.readings.pulse.series_reading import read_series
from wavesim.readings.pulse.transmission_record import transmission_record
from wavesim.readings.pulse.wave_packets import packets

L, STRESS = 0.1, np.array([10.0, 20.0, 40.0, 80.0, 160.0])
TIME = L / (60 * STRESS**0.25)


def sine(t, f):
    return np.where((t >= 0) & (t * f < 1), np.sin(2 * np.pi * f * t), 0.0)


def of(seed, f, waves, passed=np.inf, turned=False):
    """A record of waves, (time, part) each; a Gaussian passes what is below a frequency."""
    t = np.arange(-2e-4, 3e-3, 1e-6)
    got = sum(part * sine(t - time, f) for time, part in waves)
    if np.isfinite(passed):
        s = np.arange(-2e-4, 2e-4, 1e-6)
        kernel = np.exp(-((2 * np.pi * passed * s) ** 2) / 2)
        got = np.convolve(got, kernel / kernel.sum(), "same")
    noise = 0.004 * np.random.default_rng(seed).standard_normal(len(t))
    return transmission_record(t, (-1 if turned else 1) * got + noise, sine(t, f), f"{seed}")


def off(records, f, wanted="S"):
    """How far each time is from the truth, in periods sent; all are to count, within their bars."""
    readings, series = read_series(records, L, {}, "stress (kPa)", STRESS.tolist(), Wanted(wanted))
    assert all(one.best.valid for one in readings)
    times = np.array([one.best.time for one in readings])
    errors = np.array([one.best.error for one in readings])
    assert (np.abs(times - TIME) < 1.96 * errors).all()
    assert (np.diff(times) < 0).all()
    assert series.law.b == pytest.approx(0.25, abs=0.03)
    return (times - TIME) * f


def test_cables_that_were_changed_and_other_frequencies_jump_no_half_cycle():
    """A reversed sine lies half a period off itself nearly as well."""
    f = np.array([6e3, 4e3, 6e3, 6e3, 4e3])
    turned = (False, True, True, False, True)
    waves = [[(T, 1.0), (1.5 * T, 0.6)] for T in TIME]
    records = [of(i, f[i], waves[i], turned=turned[i]) for i in range(5)]
    assert np.ptp(off(records, f)) < 0.25


def test_a_medium_that_passes_less_at_low_stress_jumps_no_cycle():
    """What comes through has periods of its own: three times as long at the lowest stress."""
    passed = 6e3 * (STRESS / STRESS[-1]) ** 0.5
    waves = [
        [(T + 0.35 / f, 1.0), (1.4 * T + 0.35 / f, 0.5)] for T, f in zip(TIME, passed, strict=True)
    ]
    records = [of(i, 1.5e4, waves[i], passed[i]) for i in range(5)]
    late = off(records, passed)
    assert np.ptp(late) < 0.5


def test_p_waves_of_two_ways_ahead_of_an_s_wave_are_no_s_wave():
    """A P wave of half the S wave's size, and one from the side: it is known that S is sent."""
    waves = [[(T / 1.8, 0.5), (T / 1.35, 0.42), (T, 1.0), (1.5 * T, 0.7)] for T in TIME]
    records = [of(i, 1.2e4, waves[i]) for i in range(5)]
    assert np.abs(off(records, 1.2e4)).max() < 0.5


def with_crosstalk(times, f, known, fall):
    """Beside the waves a circuit rings at 1.7 f, which what was sent foretells by no coupling; it
    falls by e in some periods 1/f."""
    records = []
    for i, T in enumerate(times):
        one = of(i, f, [(T, 1.0), (1.5 * T, 0.6)])
        s = np.maximum(one.t, 0.0) * f
        got = one.raw + 0.6 * np.sin(2 * np.pi * 1.7 * s) * np.exp(-s / fall)
        records.append(transmission_record(one.t, got, one.sent if known else None, f"{i}"))
    return records


@pytest.mark.parametrize("known", [True, False])
def test_crosstalk_that_rings_into_the_waves_is_told_as_it_stands_still(known):
    """It falls by e in three periods of what was sent, and three come before the first wave."""
    f = 3.0 / TIME[-1]
    assert np.ptp(off(with_crosstalk(TIME, f, known, 3.0), f)) < 0.3


def test_a_wave_that_does_not_move_is_no_crosstalk():
    """The same five times, as of a state that changes nothing: all within their bars."""
    records = with_crosstalk(np.full(5, TIME[2]), 6e3, True, 0.5)
    readings, _ = read_series(records, L, {}, "hours", [1, 2, 3, 4, 5], Wanted("S"))
    for one in readings:
        assert one.best.valid, one.best.reason
        assert abs(one.best.time - TIME[2]) <= 1.96 * one.best.error


@pytest.mark.parametrize(("power", "kept"), [(0.25, 1), (0.0, 2)])
def test_what_stands_still_as_the_waves_move_is_crosstalk_of_an_edge(power, kept):
    """A square's second edge is heard at once; where no wave moves, nothing tells it."""
    stress = np.geomspace(25, 800, 7)
    records = [
        of(i, 1e4, [(1.2e-3 * one, 1.0), (1e-4, 0.4)])
        for i, one in enumerate((stress / 25) ** -power)
    ]
    heard = without_still([packets(one) for one in records], records, range(7))
    assert [len(own) for own in heard] == [kept] * 7


@pytest.mark.parametrize("sound", [3, 4])
def test_records_of_noise_alone_in_a_series_are_told_so(sound):
    """Noise correlates with noise by 0.4 or more somewhere within a period: half were answered."""
    records = [of(i, 6e3, [(T, 1.0), (1.5 * T, 0.6)]) for i, T in enumerate(TIME)]
    for i in range(sound, 5):
        noise = np.random.default_rng(i).standard_normal(len(records[i].t))
        records[i] = transmission_record(records[i].t, noise, records[i].sent, f"{i}")
    readings, _ = read_series(records, L, {}, "stress (kPa)", STRESS.tolist(), Wanted("S"))
    assert [one.best.valid for one in readings] == [i < sound for i in range(5)]
    assert all("out of the noise" in one.best.reason for one in readings[sound:])


@pytest.mark.parametrize("part", [2.0, 1 / 1.8])
def test_a_record_of_another_distance_or_wave_is_not_read_as_of_the_series(part):
    """Its wave comes at twice the time, or as a P wave would: the law of the others, which pulls
    it to their arrival, is no evidence of one."""
    part = np.where(np.arange(5) == 2, part, 1.0)
    records = [
        of(i, 1.2e4, [(a * T, 1.0)]) for i, (a, T) in enumerate(zip(part, TIME, strict=True))
    ]
    readings, series = read_series(records, L, {}, "stress (kPa)", STRESS.tolist(), Wanted("S"))
    assert [one.best.valid for one in readings] == [True, True, False, True, True]
    assert readings[2].best.reason.startswith("by itself it shows another direct wave")
    assert series.law.b == pytest.approx(0.25, abs=0.03)


@pytest.mark.parametrize("part", [2.0, 1 / 1.8])
def test_a_record_that_is_refused_leads_no_other(part):
    """The others are read as they are without it, though it may show its wave best."""
    waves = [[(T, 1.0), (1.5 * T, 0.5)] for T in TIME]
    waves[2] = [(part * TIME[2], 1.0), (1.5 * part * TIME[2], 0.5)]
    records = [of(i, 1.2e4, waves[i]) for i in range(5)]
    some = np.delete(np.arange(5), 2)
    found, _ = read_series(records, L, {}, "stress (kPa)", STRESS.tolist(), Wanted("S"))
    without, _ = read_series(
        [records[i] for i in some], L, {}, "stress (kPa)", STRESS[some].tolist(), Wanted("S")
    )
    assert not found[2].best.valid
    assert [found[i].best.time for i in some] == [one.best.time for one in without]
    assert [found[i].best.error for i in some] == [one.best.error for one in without]


@pytest.mark.parametrize("other", [3, 4])
def test_of_the_clearest_records_those_lead_that_bear_each_other_out(other):
    """The clearest by its own direct wave, which is the others' second one: the times of the first
    stand for all, whichever of them is said to be the clearest."""
    records = [of(i, 1.2e4, [(T, 1.0), (1.5 * T, 0.8)]) for i, T in enumerate(TIME)]
    alone = np.where(np.arange(5) == other, 1.5, 1.0) * TIME
    leaders = [other, *(i for i in (4, 3, 2) if i != other)]
    found = follow_clearest(records, range(5), leaders, 0.0, np.log(TIME), alone, False)
    assert found.time == pytest.approx(TIME, abs=0.2 / 1.2e4)


def test_a_record_under_a_wrong_stress_is_told_with_its_speed_and_has_no_part_in_the_law():
    """The third of six is that of half of the stress that is said of it: its wave is read well
    by itself, and V = 60 σ^0.25 of the others leaves no doubt that it is not of theirs."""
    stress = np.geomspace(10, 320, 6)
    times = L / (60 * (stress * np.where(np.arange(6) == 2, 0.5, 1.0)) ** 0.25)
    records = [of(i, 1.2e4, [(T, 1.0), (1.5 * T, 0.5)]) for i, T in enumerate(times)]
    readings, series = read_series(records, L, {}, "stress (kPa)", stress.tolist(), Wanted("S"))
    assert [one.best.valid for one in readings] == [True, True, False, True, True, True]
    assert "off the others' law" in readings[2].best.reason
    assert "a sensor or its stress another" in readings[2].best.reason
    assert readings[2].best.velocity == pytest.approx(L / times[2], rel=0.05)
    assert series.law.b == pytest.approx(0.25, abs=0.02)


def test_a_law_that_bends_as_where_soil_yields_excludes_none_of_its_records():
    """V ∝ σ^0.08 below σ = 25 and σ^0.27 above it, 5 % bars; of one power, 12 % off is told."""
    stress = np.geomspace(2, 160, 9)
    velocity = 100 * (stress / 25) ** np.where(stress < 25, 0.08, 0.27)
    assert not off_the_law(stress, velocity, 0.025 * velocity).any()
    velocity = 100 * stress**0.27 * np.where(np.arange(9) == 5, 1.12, 1.0)
    off = off_the_law(stress, velocity, 0.025 * velocity)
    assert (off > 0).tolist() == (np.arange(9) == 5).tolist()
    assert off.max() == pytest.approx(np.log(1.12), abs=1e-9)


@pytest.mark.parametrize(("power", "span", "times"), [(0.0, 8, 1.65), (0.5, 20, 1.35)])
def test_a_law_of_another_power_than_grains_have_takes_no_part_of_its_p_waves_for_s_waves(
    power, span, times
):
    """Where V does not grow, S waves of soft states lie on a line with P waves of stiff ones, less
    than a third as large, whose power is likelier; where it grows more, the other way round."""
    stress = np.geomspace(10, 10 * span, 7)
    T = stress**-power
    T *= min(1e-3 / T[3], 2.7e-3 / T[0])
    waves = [[(one / times, 0.3), (one, 1.0), (1.8 * one, 0.2)] for one in T]
    records = [of(i, 6e3, one) for i, one in enumerate(waves)]
    found, _ = read_series(records, L, {}, "stress (kPa)", stress.tolist())
    best = [one.best for one in found]
    assert all(one.valid for one in best)
    assert (np.abs([one.time for one in best] - T) < [1.96 * one.error for one in best]).all()


def test_records_that_end_before_their_s_wave_do_not_make_p_waves_of_the_others():
    """Of seven, four end before it and show its P wave alone; the three others show it as weak."""
    stress = np.geomspace(20, 200, 7)
    T = 1e-3 * (stress / 60) ** -0.25
    records = [of(i, 1e4, [(t / 1.6, 0.12), (t, 1.0), (1.5 * t, 0.3)]) for i, t in enumerate(T)]
    end = T[3] + 1e-5
    cut = [
        transmission_record(r.t[r.t < end], r.raw[r.t < end], r.sent[r.t < end], r.name)
        for r in records
    ]
    found, _ = read_series(cut, L, {}, "stress (kPa)", stress.tolist())
    best = [one.best for one in found]
    assert [one.valid for one in best] == [False] * 4 + [True] * 3
    assert all("at the record's end" in one.reason for one in best[:4])
    assert (np.abs([one.time for one in best] - T)[4:] < [1.96 * b.error for b in best[4:]]).all()


def test_a_p_wave_among_s_records_is_told_though_what_follows_it_copies_the_s_wave():
    """A reflection of a P wave comes when the S wave would, and correlates with it as well."""
    records = [of(i, 1.2e4, [(T, 1.0), (1.6 * T, 0.3)]) for i, T in enumerate(TIME)]
    records[2] = of(2, 1.2e4, [(TIME[2] / 1.6, 1.0), (TIME[2], 0.3), (1.6 * TIME[2], 0.1)])
    found, _ = read_series(records, L, {}, "stress (kPa)", STRESS.tolist())
    assert [one.best.valid for one in found] == [True, True, False, True, True]
    assert "another direct wave than the series'" in found[2].best.reason


def test_p_and_s_records_that_may_be_of_other_waves_each_are_told_as_two_waves():
    """Each shows a guided wave, 1.7 times as late, that may be the direct one as well."""
    slow, fast = (
        [of(i, 1.2e4, [(T / r, 1.0), (1.7 * T / r, 0.36)]) for i, T in enumerate(TIME)]
        for r in (1.0, 1.6)
    )
    stress = np.r_[STRESS, STRESS].tolist()
    found, _ = read_series([*slow, *fast], L, {}, "stress (kPa)", stress)
    assert all("under the same stress" in one.best.reason for one in found)


def test_p_and_s_records_under_the_same_stresses_are_told_as_two_waves():
    """Those of P waves, 1.6 times as fast, have a reflection where the S waves come."""
    slow = [of(i, 1.2e4, [(T, 1.0), (1.5 * T, 0.3)]) for i, T in enumerate(TIME)]
    fast = [of(9 + i, 1.2e4, [(T / 1.6, 1.0), (T, 0.3)]) for i, T in enumerate(TIME)]
    stress = np.r_[STRESS, STRESS].tolist()
    found, series = read_series([*slow, *fast], L, {}, "stress (kPa)", stress)
    assert not any(one.best.valid for one in found)
    assert "under the same stress 9 shows a wave 1.6" in found[0].best.reason
    assert series.law is None
    twice, _ = read_series(slow + slow[::-1], L, {}, "stress", [*STRESS, *STRESS[::-1]])
    assert all(one.best.valid for one in twice)
