"""Points of any program against the truth of a synthetic record."""

from __future__ import annotations

import json

import numpy as np
import pytest
from runs import call

import wavesim as ws
from wavesim.records.files import write
from wavesim.records.point_table import is_points, read_points
from wavesim.records.record import RecordError
from wavesim.records.synthetic import Pulse, Spoil, positions
from wavesim.verdict.score import Truth, points_of

CUTOFF = 3e3


def waves(k):
    """An acoustic branch and one with a cutoff, ω² = ω₀² + (200 k)²."""
    return np.stack([150 * k, np.sqrt(CUTOFF**2 + (200 * k) ** 2)], axis=1)


@pytest.fixture(scope="module")
def ring():
    return ws.synthesize(
        waves, np.linspace(0, 0.05, 1500), positions(64, 0.02), Pulse(900.0, 0.64), 1.28,
        ring=True, spoil=Spoil(noise=0.01, seed=2),
    )  # fmt: skip


@pytest.fixture(scope="module")
def exact():
    k = 2 * np.pi * np.arange(1, 25) / 1.28
    return np.repeat(k, 2), waves(k).ravel()


def test_what_was_read_holds(ring):
    found = ws.score(ring, ws.in_time(ring, 120))
    assert found.false == 0
    assert found.within_bars >= 0.88


def test_exact_points_are_found_without_error(ring, exact):
    k, omega = exact
    found = ws.score(ring, points_of(k, omega, np.full(48, 1.0)), k_max=118)
    assert found.missed == found.false == 0
    assert found.found == found.present >= 30
    assert found.largest_error < 1e-12
    assert found.within_bars == 1.0


def test_a_branch_left_out_is_missed_and_one_put_in_is_false(ring, exact):
    k, omega = exact
    whole = ws.score(ring, points_of(k, omega), k_max=118)
    without = ws.score(ring, points_of(k[::2], omega[::2]), k_max=118)
    assert without.missed + without.found == whole.present
    assert without.missed >= 12
    fake = ws.score(
        ring, points_of(np.append(k, k[:5]), np.append(omega, 1.13 * omega[:5])), k_max=118
    )
    assert fake.false == 5
    twice = ws.score(ring, points_of(np.append(k, k[:3]), np.append(omega, omega[:3])), k_max=118)
    assert twice.false == 3


def test_what_is_missed_and_how_near_is_told_of_each_branch(ring, exact, tmp_path):
    """Of exact points all above 1 kHz are taken out of the first branch, and the second is put off
    by 0.1 % of ω: the shell's tables say just that, of a record with a truth of one's own."""
    k, omega = (part.reshape(24, 2) for part in exact)
    kept = omega[:, 0] < 2 * np.pi * 1000
    np.savez(
        tmp_path / "own.npz", values=ring.values[0], t=ring.t, x=ring.x, ring=True,
        truth_k=np.linspace(0, 130, 200), truth_omega=waves(np.linspace(0, 130, 200)),
    )  # fmt: skip
    rows = [*zip(k[kept, 0], omega[kept, 0], strict=True), *zip(k[:, 1], 1.001 * omega[:, 1],
            strict=True)]  # fmt: skip
    told = "".join(f"{a:.9g},{b / 2e3 / np.pi:.9g}\n" for a, b in rows)
    (tmp_path / "p.csv").write_text("Wavenumber (rad/m),f (kHz)\n" + told)
    words = ["score", tmp_path / "own.npz", tmp_path / "p.csv", "--k-max", "118", "--out"]
    assert call(*words, tmp_path / "s.json").exit_code == 0
    one, two = json.loads((tmp_path / "s.json").read_text())["branches"]
    ((low, high),) = one["missed_Hz"]
    assert 1000 < low < 1000 + 150 / 1.28
    assert high == pytest.approx(one["frequencies_Hz"][1], rel=1e-9)
    assert one["found"] + (high - low) / (150 / 1.28) + 1 == pytest.approx(one["present"], rel=1e-9)
    assert one["median_error"] < 1e-7
    assert (two["missed_Hz"], two["found"]) == ([], two["present"])
    assert two["median_error"] == pytest.approx(1e-3, rel=2e-3)
    assert call(*words, tmp_path / "s.csv").exit_code == 0
    table = np.genfromtxt(tmp_path / "s.csv", delimiter=",", names=True)
    assert len(table) == len(rows)
    far = table["off"] / table["omega"]
    np.testing.assert_allclose(far[table["branch"] == 2], 1e-3, rtol=2e-3)
    assert call(*words, tmp_path / "s.txt").exit_code == 2


@pytest.mark.parametrize(
    ("unit", "size"),
    [("rad/s", 1.0), ("mrad/s", 1e-3), ("Mrad/s", 1e6), ("krad/s", 1e3), ("mHz", 2e-3 * np.pi),
     ("MHz", 2e6 * np.pi)],
)  # fmt: skip
def test_milli_is_not_mega(unit, size, tmp_path):
    (tmp_path / "p.csv").write_text(f"k (rad/m),omega ({unit})\n1,2\n3,4\n")
    found = read_points(tmp_path / "p.csv")["omega"]
    np.testing.assert_allclose(found, [2 * size, 4 * size], rtol=1e-12)


def test_bars_that_are_too_small_show(ring, exact):
    k, omega = exact
    off = omega + 10.0 * np.tile([1, -1], 24)
    assert ws.score(ring, points_of(k, off, np.full(48, 1.0))).within_bars == 0
    assert ws.score(ring, points_of(k, off, np.full(48, 6.0))).within_bars == 1
    assert ws.score(ring, points_of(k, off)).within_bars is None


def test_complex_k_of_the_truth_is_the_closed_forms():
    """k(ω + iσ) of ω² = ω₀² + c²k² by continuation from real k; measured 1e-9."""
    k = np.linspace(0, 300, 801)
    truth = Truth(k, waves(k)[:, 1:])
    omega = np.linspace(4e3, 3e4, 14) + 400j
    exact = np.sqrt(omega**2 - CUTOFF**2) / 200
    assert np.abs(truth.wavenumber(omega) / exact - 1).max() < 1e-6
    assert np.isnan(truth.wavenumber(np.array([1e3 + 400j]))).all()
    assert np.abs(truth.omega(np.array([17.3]))[0, 0] / waves(np.array([17.3]))[0, 1] - 1) < 1e-10


def test_the_command_scores_what_it_wrote_and_what_others_did(tmp_path):
    made = tmp_path / "made.npz"
    line = ws.synthesize(
        lambda k: 150 * k, np.linspace(0, 0.02, 1000), positions(32, 0.02, 0.1), Pulse(900.0),
        20.0, k_max=150.0, spoil=Spoil(noise=0.01),
    )  # fmt: skip
    write(made, line)
    for command in ("dispersion", "attenuation"):
        done = call(command, made, "--out", tmp_path, "--json")
        own = json.loads(done.output)["records"][0]["score"]
        assert own["false"] == 0
        assert own["found"] > 0
        assert own["within_bars"] >= 0.8
        again = call("score", made, tmp_path / f"{command}_made.csv", "--json")
        assert again.exit_code == 0, again.output
        assert json.loads(again.output) == own
    (tmp_path / "other.csv").write_text("f;k\n238.7324;10\n500;20\n")
    found = json.loads(call("score", made, tmp_path / "other.csv", "--json").output)
    assert (found["points"], found["false"]) == (2, 0)
    (tmp_path / "bare.txt").write_text("10 1500 2\n20 6000 2\n")
    found = json.loads(call("score", made, tmp_path / "bare.txt", "--json").output)
    assert (found["points"], found["false"], found["within_bars"]) == (2, 1, 0.5)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("a,b\n1,2\n", "has no column of k"),
        ("k (mm),omega\n1,2\n", "mm is no unit of it: give rad/m"),
        ("k (rad/m),k (1/m),omega\n1,2,3\n", "2 columns are k"),
        ("k (1/m),omega\n1,2\n", "radians or cycles per length"),
        ("k,omega\n1,xx\n", "column omega, row 1: 'xx' is no number"),
        ("k,omega,valid\n1,2,perhaps\n", "must be True or False"),
        ("k,omega\n", "holds no points"),
        ("", "can't be read as a table"),
    ],
)
def test_a_table_that_is_none_is_one_line(tmp_path, ring, content, message):
    write(tmp_path / "ring.npz", ring)
    (tmp_path / "points.csv").write_text(content)
    done = call("score", tmp_path / "ring.npz", tmp_path / "points.csv")
    assert done.exit_code == 2
    assert message in done.output
    assert done.output.count("\n") == 1


def test_a_record_without_truth_is_refused(ring):
    bare = ws.record(ring.values, ring.t, ring.x, ring=True)
    with pytest.raises(RecordError, match=r"carries no truth: add arrays truth_k \(n,\)"):
        ws.score(bare, points_of([1.0], [1.0]))
    with pytest.raises(RecordError, match="must be as many"):
        points_of([1.0, 2.0], [1.0])


def test_units_and_errors_are_found_under_their_usual_names(tmp_path, exact):
    """k in rad/mm and f in kHz after an underscore, errors as std: the same points."""
    k, omega = exact
    rows = [f"{a / 1e3:.12g},{b / 2e3 / np.pi:.12g},{0.01 * b / 2e3 / np.pi:.12g}"
            for a, b in zip(k, omega, strict=True)]  # fmt: skip
    (tmp_path / "p.csv").write_text("\n".join(["k (rad/mm),freq_kHz,std_kHz", *rows]) + "\n")
    found = read_points(tmp_path / "p.csv")
    assert found["k"] == pytest.approx(k)
    assert found["omega"] == pytest.approx(omega)
    assert found["error"] == pytest.approx(0.01 * omega)


@pytest.mark.parametrize(
    "text",
    [
        "k,frequency,error\n3.5,7.25,0.5\n",
        "# of another program\n# made today\n\nk,f,std\n3.5,7.25,0.5\n",
        "k;frequency;error\n3,5;7,25;0,5\n",
        "k\tf\terr\n3,5\t7,25\t0,5\n",
        "k,f,error\nrad/m,Hz,Hz\n3.5,7.25,0.5\n",
        "k;f;error\nrad/mm;kHz;rad/s\n0,0035;0,00725;3,14159265358979\n",
    ],
    ids=["plain", "comments", "decimal commas", "tabs", "units", "units below commas"],
)
def test_an_error_is_in_the_unit_of_its_frequency_however_the_table_is_laid_out(text, tmp_path):
    path = tmp_path / "points.csv"
    path.write_text(text)
    assert is_points(path)
    found = read_points(path)
    read = [found[name][0] for name in ("k", "omega", "error")]
    assert read == pytest.approx([3.5, 2 * np.pi * 7.25, np.pi], rel=1e-12)


def test_a_truth_that_is_no_number_is_refused():
    from wavesim.records.files import from_arrays
    from wavesim.verdict.score import truth_of

    x, t = 0.01 * np.arange(5), 1e-6 * np.arange(64)
    values = np.random.default_rng(1).standard_normal((64, 5))
    truth = {"truth_k": np.arange(9.0), "truth_omega": np.full((9, 2), np.nan)}
    record = from_arrays({"t": t, "x": x, "values": values, **truth})
    with pytest.raises(RecordError, match="must be finite, arrays truth_k"):
        truth_of(record)


def test_a_truth_without_its_record_is_told_as_one(tmp_path, exact):
    np.savez(tmp_path / "t.npz", truth_k=exact[0], truth_omega=exact[1][:, None])
    with pytest.raises(RecordError, match=r"the truth alone.*values \(times, receivers\), t"):
        ws.read_record(tmp_path / "t.npz")
