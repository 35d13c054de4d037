"""Times and places as files of programs and counters write them: read, and said.

The law: u(t, x) = sin(ω(t − x/c)), held against what is read.
"""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from scipy.io import wavfile

from wavesim.records.files import read
from wavesim.records.formats.csv_and_text import from_text
from wavesim.records.layout import Layout
from wavesim.records.units import position_in

X = 0.03 + 0.012 * np.arange(5)
RNG = np.random.default_rng(4)
T = np.arange(400) * 1e-6 - 3e-5
U = np.exp(-(((T[:, None] - 8e-5 - X / 1500) / 1e-5) ** 2)) + 1e-3 * RNG.normal(size=(400, 5))


def table(path, head, first):
    rows = [",".join(head)]
    rows += [",".join([a, *(f"{v:.8g}" for v in row)]) for a, row in zip(first, U, strict=True)]
    path.write_text("\n".join(rows) + "\n")
    return path


def test_spans_of_time_as_pandas_writes_them_keep_their_zero(tmp_path):
    import pandas

    spans = [str(pandas.Timedelta(round(1e9 * t), "ns")) for t in T]
    assert spans[0].startswith("-1 days +23:59:59.99997")
    found = read(table(tmp_path / "a.csv", ["", *(f"{1e3 * x:g} mm" for x in X)], spans))
    assert found.t == pytest.approx(T, abs=1e-12)
    assert found.x == pytest.approx(X)
    assert found.values[0] == pytest.approx(U, abs=1e-3)


@pytest.mark.parametrize(
    ("heading", "said"),
    [
        ("u(30 mm)/nm", (30.0, "mm")),
        ("v(0.03 m) / (mm/s)", (0.03, "m")),
        ("uz(3 cm)", (3.0, "cm")),
        ("laser (633 nm)", None),
        ("ch1 (1 M)", None),
        ("a (2)", None),
    ],
)
def test_a_quantity_as_a_function_of_place_says_one(heading, said):
    assert position_in(heading) == said


@pytest.mark.parametrize("unit", ["angstrom", "Å", "\u212b", "Angstroms"])
def test_atoms_stand_angstroms_apart_and_move_in_femtoseconds(unit, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["v"] = U
        for name, stored, of in (("time", T * 1e15, "fs"), ("x", X * 1e10, unit)):
            file.create_dataset(name, data=stored).attrs["units"] = of
    found = read(tmp_path / "a.h5")
    assert found.t == pytest.approx(T, abs=1e-18)
    assert found.x == pytest.approx(X)


def test_a_name_of_a_place_with_a_unit_of_length_is_of_positions(tmp_path):
    np.savez(tmp_path / "a.npz", u=U, time_ms=T * 1e3, r_mm=X * 1e3)
    found = read(tmp_path / "a.npz")
    assert found.x == pytest.approx(X)
    np.savez(tmp_path / "b.npz", u=U, time_ms=T * 1e3, r=X * 1e3)
    assert np.isnan(read(tmp_path / "b.npz", Layout(placed=False)).x).all()


@pytest.mark.parametrize("bits", [8, 16, 32])
@pytest.mark.parametrize("step", [1, 7])
def test_a_clock_that_begins_anew_at_its_last_bit_counts_on(bits, step, tmp_path):
    counts = (2**bits - 100 * step + step * np.arange(400)) % 2**bits
    head = ["Time (us)", *(f"x={x:g} m" for x in X)]
    found = read(table(tmp_path / "a.csv", head, [str(n) for n in counts]))
    assert np.diff(found.t) == pytest.approx(step * 1e-6, rel=1e-6)
    assert any(f"begins anew at {2**bits}" in note for note in found.notes)
    # Of ticks nothing says how long they are.
    head[0] = "ticks"
    assert "t" not in from_text(table(tmp_path / "b.csv", head, [str(n) for n in counts])).arrays
    found = read(tmp_path / "b.csv", Layout(interval=1e-6))
    assert found.interval == pytest.approx(1e-6)
    assert found.x == pytest.approx(X)


@pytest.mark.parametrize("kind", [np.int16, np.int32, np.float32])
def test_sound_is_read_by_its_rate(kind, tmp_path):
    size = 1.0 if kind == np.float32 else 0.9 * np.iinfo(kind).max
    stored = (U / np.abs(U).max() * size).astype(kind)
    wavfile.write(tmp_path / "a.wav", 1_000_000, stored)
    found = read(tmp_path / "a.wav", Layout(positions=tuple(X)))
    assert found.interval == pytest.approx(1e-6)
    assert found.x == pytest.approx(X)
    assert found.values[0] / found.values.max() == pytest.approx(U / U.max(), abs=2e-3)
