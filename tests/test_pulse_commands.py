"""The command ``pulse``: records of files and of runs, what it prints, writes and refuses."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from transducers import record

import wavesim as ws
from wavesim.cli.main import main
from wavesim.cli.series_values import states
from wavesim.material.layers import as_layers
from wavesim.planewave.dispersion_relation import frequencies
from wavesim.records.content import RecordError, sent_first
from wavesim.records.of_pulse_test import of_field
from wavesim.simulation.field import Field

STRESS = np.array([5, 10, 20, 40, 80.0])
SPEED = 60 * STRESS**0.27


def pulse(*words):
    return CliRunner().invoke(main, ["pulse", *map(str, words)])


def test_q_of_the_pulse_test_comes_back_from_its_receivers(shipped):
    """The law has Q = 60: to 5 %, within the bars, over the band and at each frequency of it
    (3.5 % next to the gap, 1 % elsewhere); the spectral ratio (34) is refused."""
    run = shipped("pulse_test")
    (one,) = json.loads(pulse(run.folder, "--json").output)["records"]
    q = one["quality"]
    assert q["valid"]
    assert q["value"] == pytest.approx(60, rel=0.05)
    assert abs(q["value"] - 60) <= 2 * q["error"]
    each, error = (np.array(one["frequencies"][k], float) for k in ("quality", "quality_error"))
    assert np.nanmax(np.abs(each / 60 - 1)) <= 0.05
    own = np.isfinite(each)
    assert own.sum() >= 11
    assert np.mean(np.abs(each - 60)[own] <= 2 * error[own]) >= 0.9
    assert not one["spectral_ratio"]["valid"]
    assert "the velocity changes by" in one["spectral_ratio"]["reason"]
    told = run.summary["pulse"]["records"][0]
    assert told["quality"] == q


def test_what_was_sent_may_stand_in_a_file_of_its_own(tmp_path):
    """As of scopes that write a file for each channel: read as from two columns; of another clock,
    refused."""
    table = np.column_stack(record(120.0, seed=1))
    for name, columns in (("both", [0, 1, 2]), ("sent", [0, 1]), ("heard", [0, 2])):
        head = ["Time (s)", "a", "b"][: len(columns)]
        np.savetxt(tmp_path / f"{name}.csv", table[:, columns], delimiter=",",
                   header=",".join(head), comments="")  # fmt: skip
    ways = (("both", 2), ("heard", tmp_path / "sent.csv"))
    one, other = (
        json.loads(pulse(tmp_path / f"{name}.csv", "--input", sent, "--distance", 0.12,
                         "--json").output)["records"][0]["best"]
        for name, sent in ways
    )  # fmt: skip
    assert one == other
    table[:, 0] *= 2
    np.savetxt(tmp_path / "sent.csv", table[:, :2], delimiter=",", header="Time (s),a", comments="")
    wrong = pulse(tmp_path / "heard.csv", "--input", tmp_path / "sent.csv", "--distance", 0.12)
    assert wrong.exit_code == 2
    assert "its clock is not that of" in wrong.stderr


def test_receivers_on_a_ring_tell_the_phase_velocity_within_their_bars(shipped):
    """Truth: ω/k of the plane-wave solver. Waves come round the bar, and others still pass."""
    run = shipped("bandgap_pulse")
    one = json.loads(pulse(run.folder, "--json").output)["records"][0]["frequencies"]
    f, c, error = (
        np.array(one[name], float)
        for name in ("frequency_Hz", "phase_velocity_m_s", "phase_velocity_error_m_s")
    )
    k = np.linspace(1.0, 4000.0, 4000)
    exact = (
        2
        * np.pi
        * f
        / np.interp(2 * np.pi * f, frequencies(run.field.medium, "longitudinal", k)[:, 0], k)
    )
    own = np.isfinite(error)
    assert own.sum() > 20
    assert f[own][0] < 5e4
    off = np.abs(c - exact)[own] / error[own]
    assert np.mean(off <= 2) >= 0.8
    assert off.max() <= 3.5


@pytest.mark.parametrize("size", [0.0, 0.5])
def test_inspect_tells_crosstalk_where_there_is_some(size, tmp_path):
    """Beside what was sent, at its size; a record without any has no such finding."""
    t, sent, got = record(120.0, crosstalk=size)
    np.savez(tmp_path / "one.npz", t=t, sent=sent, received=got)
    words = ["inspect", str(tmp_path / "one.npz"), "--input", "sent", "--json"]
    shown = json.loads(CliRunner().invoke(main, words).output)
    told = [one for one in shown["findings"] if one["what"] == "crosstalk"]
    assert [one["size"].endswith("% of the peak") for one in told] == [True] * (size > 0)


def test_q_holds_with_one_per_cent_of_noise(shipped, tmp_path):
    """Ten seeds, within two errors in eight or more; those are below 10 %."""
    field = shipped("pulse_test").field
    u = np.stack([field.at(x, "phi1") for x in field.receivers.values()], axis=1)
    heading = ",".join(["t_s", *(f"x={1e3 * x:g} mm" for x in field.receivers.values())])
    inside = 0
    for seed in range(10):
        noise = 0.01 * np.abs(u).max() * np.random.default_rng(seed).standard_normal(u.shape)
        file = tmp_path / "noisy.csv"
        table = np.column_stack([field.t, u + noise])
        np.savetxt(file, table, delimiter=",", header=heading, comments="")
        q = json.loads(pulse(file, "--json").output)["records"][0]["quality"]
        assert q["valid"]
        assert q["error"] <= 6
        inside += abs(q["value"] - 60) <= 2 * q["error"]
    assert inside >= 8


def test_a_series_may_be_columns_of_one_file(tmp_path):
    """Columns without places are records of one receiver, in their order."""
    made = [record(c, seed=i) for i, c in enumerate(SPEED)]
    (t, sent, _), file = made[0], tmp_path / "all.csv"
    table = np.column_stack([1e3 * t, sent, *(got for _, _, got in made)])
    heading = "Time (ms);Input (V);" + ";".join(f"{s:g} kPa (mV)" for s in STRESS)
    np.savetxt(file, table, "%.7g", ";", header=heading, comments="")
    given = ["--input", "Input (V)", "--distance", 0.12, "--against", "stress=5,10,20,40,80"]
    answer = pulse(file, *given, "--json", "--out", tmp_path / "out")
    assert answer.exit_code == 0, answer.output
    found = json.loads(answer.output)
    speed = np.array([one["best"]["velocity"] for one in found["records"]])
    assert np.abs(speed / SPEED - 1).max() <= 0.05
    assert found["records"][2]["file"].endswith("20 kPa (mV)")
    assert found["series"]["parameter"] == "stress"
    assert found["series"]["fit"]["b"] == pytest.approx(0.27, abs=0.02)
    assert found["series"]["outliers"] == []
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "pulse.json", "pulse_records.png", "pulse_series.png"
    }  # fmt: skip


def test_one_bad_file_of_a_series_is_refused_and_the_others_read(tmp_path):
    files = []
    for i, c in enumerate(SPEED):
        files.append(tmp_path / f"{i}.csv")
        np.savetxt(files[-1], np.column_stack(record(c, seed=i)), "%.7g", ",")
    files[3].write_text("no numbers\nat all\n")
    answer = pulse(*files, "--input", 2, "--distance", 0.12, "--against",
                   "stress=5,10,20,40,80", "--json")  # fmt: skip
    assert answer.exit_code == 0
    found = json.loads(answer.output)
    valid = [one["best"]["valid"] for one in found["records"]]
    assert valid == [True, True, True, False, True]
    assert "3.csv" in found["records"][3]["best"]["reason"]
    assert found["series"]["fit"]["b"] == pytest.approx(0.27, abs=0.02)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--input", "7"], "--input 7: no such column"),
        (["--input", "2"], "no position is known: give --distance"),
        (["--input", "2", "--distance", "0"], "--distance 0: must be greater than 0"),
        (["--input", "2", "--distance", "1,2"], "--distance: 2 values for 1 records"),
        (["--input", "2", "--distance", "1", "--against", "stress"], "must be NAME=V1,V2"),
        (
            ["--input", "2", "--distance", "1", "--against", "p=10kPa,0.1MPa"],
            "give all in one unit",
        ),
        (["--input", "2", "--distance", "1", "--against", "s=1,2"], "2 values for 1 records"),
        (["--input", "2", "--distance", "1", "--delay", "1", "--face-to-face", "x"], "one of the"),
    ],
)
def test_what_is_asked_wrongly_is_one_line(words, message, tmp_path):
    file = tmp_path / "r.csv"
    np.savetxt(file, np.column_stack(record(120.0)), "%.7g", ",")
    answer = pulse(file, *words)
    assert answer.exit_code == 2
    assert message in answer.output
    assert answer.output.count("\n") == 1


def test_nothing_but_noise_ends_with_one(tmp_path):
    file, (t, sent, _) = tmp_path / "r.csv", record(120.0)
    noise = np.random.default_rng(3).standard_normal(len(t))
    np.savetxt(file, np.column_stack([t, sent, noise]), "%.7g", ",")
    answer = pulse(file, "--input", 2, "--distance", 0.12)
    assert answer.exit_code == 1
    assert "refused" in answer.output


def test_a_heading_that_is_a_number_is_taken_for_a_column_where_that_is_said_or_comes_first(
    tmp_path,
):
    """A scope heads its channels 1 and 2, in columns 2 and 3: the sent one is 1, or column 2."""
    t = np.arange(0, 1e-3, 5e-7)

    def ricker(late):
        phase = (np.pi * 2e4 * (t - 8e-5 - late)) ** 2
        return (1 - 2 * phase) * np.exp(-phase)

    table = np.column_stack([t, ricker(0.0), 0.1 * ricker(4e-4)])
    table[:, 2] += 1e-4 * np.random.default_rng(3).normal(size=len(t))
    path = tmp_path / "scope.csv"
    np.savetxt(path, table, "%.8e", ",", header="x-axis,1,2\nsecond,Volt,Volt", comments="")
    asked = "--distance", "100mm", "--json"
    for column in ("1", "2", "column 2", "heading 1"):
        (one,) = json.loads(pulse(path, "--input", column, *asked).output)["records"]
        assert one["receivers"][0]["arrivals"]["correlation"]["time"] == pytest.approx(4e-4, 1e-3)
        assert abs(one["best"]["velocity"] - 250) <= 2 * one["best"]["velocity_error"]
    told = " ".join(pulse(path, "--input", "2", "--distance", "100mm").output.split())
    assert "column 2, which comes first, is what was sent" in told
    # Strong crosstalk comes at once, but what was sent is over sooner.
    crosstalk = np.column_stack([t, ricker(0.0), 0.1 * ricker(4e-4) + 0.2 * ricker(0.0)])
    assert sent_first((1, 2), crosstalk, "", "2") == 1
    assert sent_first((2, 1), crosstalk, "", "2") == 1
    crosstalk[:, 1] = t > 8e-5  # a step
    assert sent_first((1, 2), crosstalk, "", "2") == 1
    table[:, 2] = table[:, 1]
    np.savetxt(path, table, "%.8e", ",", header="x-axis,1,2\nsecond,Volt,Volt", comments="")
    refused = pulse(path, "--input", "2", *asked)
    assert refused.exit_code == 2
    assert "say 'column 2' or 'heading 2'" in refused.output
    table[:, 2] = 0.1 * ricker(4e-4)
    np.savetxt(path, table, "%.8e", ",", header="x-axis,1,2\nsecond,Volt,Volt", comments="")
    refused = pulse(path, "--input", "1", "--distance", "100")
    assert refused.exit_code == 1
    assert "faster than waves in any solid" in " ".join(refused.output.split())
    told = pulse(path, "--input", "1", "--distance", "100mm").output
    assert "Taken is the first break. By convention, ms:" in told
    told = pulse(path, "--input", "column 2", "--distance", "100mm", "--delay", "20us").output
    assert "the system's delay in them (0.02 for the first break): first" in " ".join(told.split())


def test_a_column_headed_as_the_transmitter_is_what_was_sent_and_a_series_goes_by_its_names(
    tmp_path,
):
    """Speeds without --input are those with it; values in another order than the names say are
    refused, with the order that they have."""
    for name, c in (("50", 60 * 50**0.27), ("200", 60 * 200**0.27)):
        table = np.column_stack(record(c, noise=0.002))
        head = "Time (s),Transmitter (V),Receiver (V)"
        np.savetxt(tmp_path / f"at_{name}kPa.csv", table, "%.9g", ",", header=head, comments="")
    files, given = sorted(tmp_path.glob("at_*.csv")), ["--distance", 0.12, "--json"]
    (one,) = json.loads(pulse(files[0], *given).output)["records"]
    (told,) = json.loads(pulse(files[0], "--input", 2, *given).output)["records"]
    assert one["best"] == told["best"]
    assert abs(one["best"]["velocity"] - 60 * 200**0.27) <= 2 * one["best"]["velocity_error"]
    answer = pulse(*files, *given, "--against", "stress=50,200")
    assert answer.exit_code == 2
    assert "is named 200; in the order of the files: 200,50" in answer.output
    assert pulse(*files, *given, "--against", "stress=200,50").exit_code == 0


def test_values_in_steady_order_are_refused_of_files_that_the_shell_has_in_another(tmp_path):
    """scope_10 comes before scope_9: values would be taken for each other. In order of the files'
    numbers, or with values in the shell's order, each has its own."""
    for name, p in (("9", 50), ("10", 100), ("11", 200)):
        table = np.column_stack(record(60 * p**0.27, noise=0.002))
        head = "Time (s),Transmitter (V),Receiver (V)"
        np.savetxt(tmp_path / f"scope_{name}.csv", table, "%.9g", ",", header=head, comments="")
    files, given = sorted(tmp_path.glob("*.csv")), ["--distance", 0.12, "--json"]
    answer = pulse(*files, *given, "--against", "stress=50,100,200")
    assert answer.exit_code == 2
    assert "ls -v" in answer.output
    for order, values in ((files, "100,200,50"), (files[-1:] + files[:-1], "50,100,200")):
        answer = pulse(*order, *given, "--against", f"stress={values}")
        law = json.loads(answer.output)["series"]["fit"]
        assert law["b"] == pytest.approx(0.27, abs=2 * law["b_error"])


@pytest.mark.parametrize(
    "table",
    ["50\n100\n200\n", "stress (kPa)\n50\n100\n200", "# by hand\n1 50\n2 100\n3 200\n",
     "scope_3.csv, 200\nscope_1.csv, 50\nscope_2.csv, 100\n"],
)  # fmt: skip
def test_a_series_goes_by_a_table_as_by_its_values(table, tmp_path):
    """In the order of the files, or by their names."""
    stresses = tmp_path / "stresses.txt"
    stresses.write_text(table)
    files = [f"scope_{n}.csv" for n in (1, 2, 3)]
    assert states(f"stress={stresses}", files).values == (50, 100, 200)
    assert ("(kPa)" in states(f"stress={stresses}", files).parameter) == ("kPa" in table)
    if "scope" in table:
        turned = states(f"stress={stresses}", files[::-1])
        assert turned.values == (200, 100, 50)
        with pytest.raises(SystemExit):
            states(f"stress={stresses}", [*files, "scope_4.csv"])


def test_specimens_of_several_lengths_tell_a_velocity_without_the_systems_delay(tmp_path):
    """30 µs that nobody says make 80 mm 4 % slow; together they come off, and c(10 kHz) is told. Of
    one length twice nothing is told together."""
    for mm in (80, 120, 160):
        made = record(120.0, mm / 1e3, 40.0, 0.0, 0.0, 0.0, 0.0, 0.002, 12, delay=3e-5)
        head = "Time (s),Transmitter (V),Receiver (V)"
        name = tmp_path / f"rod_{mm:03d}.csv"
        np.savetxt(name, np.column_stack(made), "%.9g", ",", header=head, comments="")
    files = sorted(tmp_path.glob("*.csv"))
    given = [*files, "--json", "--distance"]
    (*_, together) = json.loads(pulse(*given, "80mm,120mm,160mm").output)["records"]
    assert together["file"] == "all lengths"
    names = ("frequency_Hz", "phase_velocity_m_s", "phase_velocity_error_m_s")
    f, c, error = (np.array(together["frequencies"][name], float) for name in names)
    at = np.nanargmin(np.abs(f - 1e4))
    assert abs(c[at] - 120) <= 3 * error[at] < 3
    assert len(json.loads(pulse(*given, "80mm,80mm,160mm").output)["records"]) == 3


def test_where_waves_go_round_a_ring_at_once_there_is_no_pulse_test():
    """Sources either side of the seam, receivers between them: no frame is of waves one way."""
    layers = as_layers(ws.Medium(), 0.064)
    sources = tuple(ws.Ricker("phi1", x, 4e5) for x in (0.004, 0.056))
    places = {"a": 0.0575, "b": 0.059}
    made = ws.Simulation(layers, ws.Bar(512, 1.25e-4), sources, 2e-5, receivers=places)
    still = {name: np.zeros((made.frames, 512)) for name in made.fields}
    with pytest.raises(RecordError, match=r"gone round the bar.* lengthen"):
        of_field(Field(made, made.times, still), "run")


def test_a_receiver_that_waves_reach_either_way_round_a_ring_has_no_part_in_a_pulse_test():
    """One at 0.42 of the ring is left out, one at 0.6 too; what is nearer is read as it was."""
    layers, bar = as_layers(ws.Medium(), 0.064), ws.Bar(512, 1.25e-4)
    places = {"a": 0.012, "b": 0.02, "c": 0.031, "d": 0.0424}
    made = ws.Simulation(layers, bar, (ws.Ricker("phi1", 0.004, 4e5),), 2e-5, receivers=places)
    still = {name: np.zeros((made.frames, 512)) for name in made.fields}
    (test,) = of_field(Field(made, made.times, still), "run")
    assert test.positions == pytest.approx({"a": 0.008, "b": 0.016})
    assert "c, d: left out, as waves come there either way" in test.notes[0]


@pytest.mark.parametrize("heads", [("Transmitter (V)", "Receiver (mV)"), ("TX / V", "RX / V")])
def test_a_column_is_meant_by_its_heading_with_or_without_its_unit_in_any_case(heads, tmp_path):
    """The same answer by each of its names; what is not unique is refused with all names."""
    t, sent, got = record(120.0)
    path = tmp_path / "one.csv"
    numbers = "\n".join(f"{a:.9g},{b:.9g},{c:.9g}" for a, b, c in zip(t, sent, got, strict=True))
    path.write_text(f"Time (s),{','.join(heads)}\n{numbers}\n")
    bare = heads[0].split(" ")[0]
    names = (heads[0], heads[0].lower(), bare, bare.swapcase(), f"heading {bare}", "2")
    told = {pulse(path, "--input", n, "--distance", 0.08, "--json").output for n in names}
    assert len(told) == 1
    assert json.loads(told.pop())["records"][0]["best"]["valid"]
    path.write_text(f"Time (s),{heads[0]},{bare} (mV)\n{numbers}\n")
    done = pulse(path, "--input", bare, "--distance", 0.08)
    assert done.exit_code == 2
    assert heads[0] in done.output
    assert f"{bare} (mV)" in done.output
    assert done.output.count("\n") == 1


def test_times_that_say_no_unit_make_no_velocity_of_no_wave(tmp_path):
    """ms without a word are seconds of a record: 0.3 m/s in place of 300, and no number stands."""
    t, sent, got = record(300.0)
    rows = "\n".join(f"{a * 1e3:.9g},{b:.9g},{c:.9g}" for a, b, c in zip(t, sent, got, strict=True))
    (tmp_path / "one.csv").write_text(f"t,sent,got\n{rows}\n")
    words = (tmp_path / "one.csv", "--input", "sent", "--distance", 0.12)
    done = pulse(*words)
    assert done.exit_code == 1
    assert "no unit of time is said" in done.output
    told = json.loads(pulse(*words, "--time-unit", "ms", "--json").output)["records"][0]["best"]
    assert told["valid"]
    assert abs(told["velocity"] - 300) <= 2 * told["velocity_error"] <= 60


def test_a_wave_that_runs_towards_smaller_positions_has_its_speed(tmp_path, rng):
    """Receivers counted from the far end, and of negative positions: 1200 m/s both."""
    t, x = np.arange(1000) * 1e-6, 0.02 + 0.004 * np.arange(8)
    late = (np.pi * 2e4 * (t[:, None] - 1.5e-4 - x / 1200)) ** 2
    values = (1 - 2 * late) * np.exp(-late) + 1e-3 * rng.normal(size=late.shape)
    for positions, columns in ((x, values[:, ::-1]), (-x, values)):
        np.savez(tmp_path / "line.npz", t=t, x=positions, values=columns)
        (one,) = json.loads(pulse(tmp_path / "line.npz", "--json").output)["records"]
        assert one["best"]["valid"]
        assert abs(one["best"]["velocity"] - 1200) <= 2 * one["best"]["velocity_error"]
        assert sorted(each["position"] for each in one["receivers"]) == pytest.approx(
            sorted(positions)
        )
        assert any("towards smaller positions" in note for note in one["notes"])
