"""Files of instruments and other programs: the same numbers, in SI, from every format.

The law: reading is exact. What was written is known to the last digit, by the arrays it was written
from; times in s and positions in m whatever unit the file has them in.
"""

from __future__ import annotations

import warnings

import h5py
import numpy as np
import pytest
import scipy.io

from wavesim.records.files import Layout, from_arrays, from_xarray, read
from wavesim.records.formats.seismic import of_stream
from wavesim.records.record import RecordError, record

N, M = 64, 4
T = np.arange(N) * 5e-7
X = 0.02 + 0.005 * np.arange(M)
U = np.round(np.random.default_rng(4).standard_normal((N, M)), 6)


def same(found, t=T, x=X, u=U):
    assert found.t == pytest.approx(t, abs=1e-15 + 1e-9 * t[-1])
    assert found.x == pytest.approx(x, rel=1e-12)
    assert np.abs(found.values[0] - u).max() <= 1e-12


def rows(t=T, u=U, comma=",", decimal=".", form="%.12g"):
    lines = [comma.join(form % v for v in (a, *row)).replace(".", decimal)
             for a, row in zip(t, u, strict=True)]  # fmt: skip
    return "\n".join(lines) + "\n"


PLACES = [f"x={v:g} m" for v in X]
HEAD = ",".join(["t_s", *PLACES]) + "\n"
GERMAN = ";".join(["Zeit (s)", *(f"x={v:g} m".replace(".", ",") for v in X)]) + "\n"
NUMBERED = "".join(f"{i},{line}\n" for i, line in enumerate(rows().splitlines()))
QUOTED = "".join(
    ",".join(f'"{cell}"' for cell in line.split(";")) + "\n"
    for line in rows(comma=";", decimal=",").splitlines()
)
CLOCKS = ",".join(f"Time {i},{p}" for i, p in enumerate(PLACES)) + "\n"
CLOCKS += "".join(
    ",".join(f"{a:.9g},{b:.9g}" for b in row) + "\n" for a, row in zip(T, U, strict=True)
)
PLACED = ",".join(PLACES)
BIG = ("1,234.5", "-12,345.25", "1,234,567.5", "12.5")


def parted(mark, decimal):
    """Numbers of BIG in turn at four receivers, of which thousands are parted."""
    cells = [one.replace(",", "_").replace(".", decimal).replace("_", mark) for one in BIG]
    times = [f"{a:.12g}".replace(".", decimal) for a in T * 1e6]
    lines = [";".join([a, *cells[i % 4 :], *cells[: i % 4]]) for i, a in enumerate(times)]
    return HEAD.replace("t_s", "t_us").replace(",", ";") + "\n".join(lines) + "\n"


TEXTS = {
    "plain": HEAD + rows(),
    "a row of units": f"x-axis,{PLACED}\nsecond,Volt,Volt,Volt,Volt\n" + rows(),
    "us in the row of units": f"Time,{PLACED}\n(us),(V),(V),(V),(V)\n" + rows(T * 1e6),
    "us in the heading": HEAD.replace("t_s", "Time (us)") + rows(T * 1e6),
    "ms": HEAD.replace("t_s", "t_ms") + rows(T * 1e3),
    "us in a row of metadata": "X Units,us\nY Units,V\n" + HEAD.replace("t_s", "t") + rows(T * 1e6),
    "ms in a comment": "# time in ms, voltages in mV\n" + HEAD.replace("t_s", "t") + rows(T * 1e3),
    "units of all in a comment": "# Units: us, V\n" + HEAD.replace("t_s", "t") + rows(T * 1e6),
    "a power of ten": HEAD.replace("t_s", "Time (x10^-3 s)") + rows(T * 1e3),
    "tex": HEAD.replace("t_s", r"$t$ [$\mu$s]") + rows(T * 1e6),
    "a hump": HEAD.replace("t_s", "timeUs") + rows(T * 1e6),
    "a row of blank cells": HEAD + rows().replace("\n", "\n,,,,\n", 3),
    "a row of places with decimal commas": "x (mm);20,0;25,0;30,0;35,0\nt_s;a;b;c;d\n"
    + rows(comma=";", decimal=","),
    "remarks below the units": f"Name,Time,{PLACED}\nUnit,ms,V,V,V,V\nRemark,,sent,a,b,c\n"
    + "".join(f",{line}\n" for line in rows(T * 1e3).splitlines()),
    "an interval with its unit in brackets": f"Sample,{PLACED}\nSampling interval (us),0.5,,,\n"
    + "".join(f"{i},{line.split(',', 1)[1]}\n" for i, line in enumerate(rows().splitlines())),
    "a rate in a comment": f"# decimation = 64; fs = 2 MS/s\n{PLACED}\n"
    + "".join(line.split(",", 1)[1] + "\n" for line in rows().splitlines()),
    "ten to a power, times": HEAD.replace("t_s", "Time [x1e-6 s]") + rows(T * 1e6),
    "milliseconds in Spanish": HEAD.replace("t_s", "Tiempo (milisegundos)") + rows(T * 1e3),
    "ms in Russian": HEAD.replace("t_s", "Время (мс)") + rows(T * 1e3),
    "metadata above": "".join(f"Key {i},Value\n" for i in range(20)) + HEAD + rows(),
    "comments above": "% Model, bar\n% Version, 6\n" + HEAD + rows(),
    "heading in a comment": "# written by hand\n# " + HEAD + rows(),
    "semicolons, decimal commas": GERMAN + rows(comma=";", decimal=","),
    "quoted decimal commas": HEAD + QUOTED,
    "tabs": HEAD.replace(",", "\t") + rows(comma="\t"),
    "white space": HEAD.replace(" m", "m").replace(",", " ") + rows(comma="  "),
    "positions in mm": "time," + ",".join(f"{v * 1e3:g} mm" for v in X) + "\n" + rows(),
    "places behind @": "time (s)," + ",".join(f"ch{v:g} @ {v:g} m" for v in X) + "\n" + rows(),
    "a row of positions": "x (mm)," + ",".join(f"{v * 1e3:g}" for v in X) + "\nTime,a,b,c,d\n"
    + rows(),
    "depths in a comment": "# depth (m)," + ",".join(f"{v:g}" for v in X) + "\nTime,a,b,c,d\n"
    + rows(),
    "places in a comment": "% positions [cm]: " + " ".join(f"{v * 1e2:g}" for v in X)
    + "\nTime,a,b,c,d\n" + rows(),
    "rows numbered": "Sample," + HEAD + NUMBERED,
    "a clock for each": CLOCKS,
    "carriage returns": (HEAD + rows()).replace("\n", "\r\n"),
    "ends in separators": (HEAD + rows()).replace("\n", ",\n"),
    "a remark's column": HEAD.replace("\n", ",Comment\n") + rows().replace("\n", ",\n"),
    "cut within its last row": HEAD + rows() + "3.2e-05,0.1,0.",
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_a_table_of_text_whoever_wrote_it(tmp_path, name):
    path = tmp_path / "a.csv"
    path.write_text(TEXTS[name], encoding="utf-8")
    same(read(path))


@pytest.mark.parametrize(
    ("mark", "decimal"), [(",", "."), (".", ","), (" ", ","), ("\u202f", ","), ("'", ".")]
)
def test_thousands_may_be_parted(tmp_path, mark, decimal):
    path = tmp_path / "big.csv"
    path.write_text(parted(mark, decimal), encoding="utf-8")
    numbers = [float(one.replace(",", "")) for one in BIG]
    found = from_arrays(
        {"t": T, "x": X, "u": [numbers[i % 4 :] + numbers[: i % 4] for i in range(N)]}
    )
    same(read(path), u=found.values[0])


@pytest.mark.parametrize("form", ["{} ({})", "{} / {}"])
def test_columns_in_units_of_their_own_are_put_in_one(tmp_path, form):
    names = map(form.format, PLACES, ("V", "mV", "V", "mV"))
    path = tmp_path / "units.csv"
    path.write_text(",".join(["t_s", *names]) + "\n" + rows(u=U * [1, 1000, 1, 1000]))
    same(read(path))


@pytest.mark.parametrize(
    "encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-32", "latin-1", "cp437"]
)
def test_a_table_in_another_encoding(tmp_path, encoding):
    path = tmp_path / "a.txt"
    path.write_text(HEAD.replace("t_s", "Zeit/µs") + rows(T * 1e6), encoding=encoding)
    same(read(path))


def test_a_table_in_cyrillic_letters_of_one_byte(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(HEAD.replace("t_s,", "Время (мкс),") + rows(T * 1e6), encoding="cp1251")
    same(read(path))


def test_units_that_cannot_be_are_told_by_where_the_file_says_them(tmp_path):
    t = np.arange(400) * 5e-7
    u = np.exp(-(((t[:, None] - 1e-4 - X / 3000) / 1e-5) ** 2))
    path = tmp_path / "a.csv"
    path.write_text(HEAD.replace("t_s", "Zeit/µs") + rows(t, u), encoding="cp1252")
    with pytest.raises(RecordError, match=r"times in µs, as row 1 \('Zeit/µs'\) says"):
        read(path)
    assert read(path, Layout(time_unit="s")).t == pytest.approx(t, abs=1e-12)


def test_dates_and_times_of_day(tmp_path):
    dates = np.datetime64("2024-03-01T12:00:00", "ns") + (np.arange(N) * 500).astype("m8[ns]")
    lines = [
        ",".join([str(d), *(f"{v:.9g}" for v in row)]) for d, row in zip(dates, U, strict=True)
    ]
    (tmp_path / "a.csv").write_text(HEAD.replace("t_s", "Timestamp") + "\n".join(lines) + "\n")
    same(read(tmp_path / "a.csv"))
    np.savez(tmp_path / "a.npz", t=dates, x=X, values=U)
    same(read(tmp_path / "a.npz"))
    np.savez(tmp_path / "b.npz", time=dates - dates[0], x_mm=X * 1e3, values=U)
    same(read(tmp_path / "b.npz"))


def test_marks_of_overload_are_missing_samples(tmp_path):
    lines = (HEAD + rows()).splitlines()
    cells = lines[30].split(",")
    cells[2] = "OL"
    lines[30] = ",".join(cells)
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    found = read(tmp_path / "a.csv")
    assert any("missing" in f.what for f in found.findings)
    others = np.arange(N) != 29
    assert np.abs(found.values[0] - U)[others].max() < 1e-12


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "Time (s),Channel 1 (V),Channel 2 (V)\n" + rows(u=U[:, :2]),
            r"Channel 1 \(V\).*--spacing",
        ),
        ("Time (s),1,2\n" + rows(u=U[:, :2]), r"headings '1', '2' say none.*--spacing"),
        ("Time (s),S-1,S-2\n" + rows(u=U[:, :2]), r"'S-1', 'S-2' say none"),
        (rows(), "no heading; give --spacing"),
        (
            HEAD + rows().replace(f"{U[3, 1]:g}", "bad7", 1),
            r"row 5, column 3 .*'bad7' is no number",
        ),
        (
            "t (us),x (mm),u\n" + "".join(f"{i // 4},{i % 4},0.{i}\n" for i in range(99)),
            r"column 2 \('x \(mm\)'\) holds places.*a column for each receiver",
        ),
        (
            HEAD
            + "".join(f"{i},{1.1 + i / 1e3:.3f},{i},2,3\n" for i in range(64))
            + "64,105,0,2,3\n",
            r"column 2 .*holds '1.100' beside '105', as of thousands",
        ),
        (HEAD + rows().replace(f"{U[3, 1]:g}", '"', 1), "row 5: a quotation mark has no other"),
        (
            HEAD + rows().replace("\n", ",7\n", 1),
            r"row 2 has 6 cells; the heading has 5.*semicolons",
        ),
    ],
    ids=[
        "channels",
        "numbers",
        "sensors",
        "no heading",
        "a word",
        "a row for each time and place",
        "thousands or decimals",
        "a quotation mark",
        "decimal commas",
    ],
)
def test_a_message_names_row_column_and_option(tmp_path, text, message):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(RecordError, match=message):
        read(tmp_path / "a.csv")


def test_options_say_what_a_file_does_not(tmp_path):
    (tmp_path / "a.csv").write_text("Time,1,2,3,4\n" + rows(T * 1e6))
    placed = Layout(spacing=5e-3, first=0.02, time_unit="us")
    same(read(tmp_path / "a.csv", placed))
    same(read(tmp_path / "a.csv", Layout(positions=tuple(X), time_unit="us")))
    same(read(tmp_path / "a.csv", Layout(positions=tuple(X), interval=5e-7)))
    with pytest.raises(RecordError, match="--time-unit parsec: must be one of s, ms"):
        Layout(time_unit="parsec")
    # A unit is of the numbers as they are written, and of none that is known without it.
    (tmp_path / "b.csv").write_text(TEXTS["positions in mm"])
    same(read(tmp_path / "b.csv", Layout(position_unit="mm")))
    same(read(tmp_path / "b.csv", Layout(position_unit="m")), x=X * 1e3)
    mixed = HEAD.replace("x=0.02 m", "x=20 mm")
    (tmp_path / "c.csv").write_text(mixed + rows())
    same(read(tmp_path / "c.csv", Layout(position_unit="mm")))
    dated = [f"2024-03-01T12:00:{i:02d}.5,{line.split(',', 1)[1]}"
             for i, line in enumerate(rows().splitlines()[:50])]  # fmt: skip
    (tmp_path / "d.csv").write_text(HEAD.replace("t_s", "Date") + "\n".join(dated) + "\n")
    found = read(tmp_path / "d.csv", Layout(time_unit="us"))
    assert found.interval == pytest.approx(1.0, rel=1e-12)
    for said in ("Sample Interval,0.5,us", "#CLOCK=0.5uS", "Sampling Rate,2,MHz", "fs = 2 MHz",
                 "Record Rate(fps),2000000", "# Frame rate: 2000000 fps"):  # fmt: skip
        values = "".join(line.split(",", 1)[1] + "\n" for line in rows().splitlines())
        (tmp_path / "e.csv").write_text(f"{said}\n{','.join(PLACES)}\n{values}")
        same(read(tmp_path / "e.csv"))
        same(read(tmp_path / "e.csv", Layout(time_unit="us")))


def test_units_are_read_wherever_arrays_say_them(tmp_path):
    """As an entry or an attribute of another name, in a long name, in the name of a start."""
    import xarray

    paths = [tmp_path / name for name in ("a.npz", "b.mat", "c.h5", "d.h5", "e.nc", "f.npz")]
    np.savez(paths[0], time=T * 1e3, timeUnits="ms", x=X, u=U)
    scipy.io.savemat(paths[1], {"time": T * 1e3, "timeUnits": "ms", "x": X, "u": U})
    with h5py.File(paths[2], "w") as file:
        file.create_group("scan").attrs["time_units"] = "ms"
        file["scan/time"], file["scan/x"], file["scan/u"] = T * 1e3, X, U
    with h5py.File(paths[3], "w") as file:
        file["x"], file["u"] = X, U
        file.attrs.update({"dt": 0.5, "dt_unit": "us"})
    long = {"time": ("time", T * 1e6, {"long_name": "time [us]"}), "x": X}
    xarray.Dataset({"u": (("time", "x"), U)}, long).to_netcdf(paths[4], engine="h5netcdf")
    np.savez(paths[5], fs_kHz=2e3, t0_us=0.0, x=X, u=U)
    for path in paths:
        same(read(path))


def test_rates_are_in_the_unit_that_is_said(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["u"], file["x"] = U, X
        file.create_dataset("fs", data=2000.0).attrs["units"] = "kHz"
    same(read(tmp_path / "a.h5"))
    for name, extra in (("fs", {"fs_unit": "MS/s"}), ("sample_rate_MHz", {})):
        np.savez(tmp_path / "a.npz", u=U, x=X, **{name: 2.0}, **extra)
        same(read(tmp_path / "a.npz"))
    np.savez(tmp_path / "a.npz", u=U, x=X, fs=2e6, fs_unit="fathoms")
    same(read(tmp_path / "a.npz"))
    assert "'fathoms' is not known: taken as Hz" in read(tmp_path / "a.npz").notes[0]


def test_arrays_as_long_as_an_axis_say_which_it_is():
    """Beside an interval and a spacing, which fit either way."""
    own = {"u": U.T, "t": T, "x": X, "dt": T[1], "dx": 5e-3}
    same(from_arrays(own))
    same(from_arrays({n: own[n] for n in ("u", "t", "dt", "dx")}), x=X - X[0])
    same(from_arrays({n: own[n] for n in ("u", "x", "dt", "dx")}))
    same(from_arrays(own, Layout(interval=T[1], spacing=5e-3)))
    bare = from_arrays({"u": np.c_[U, U][:32], "dt": T[1], "dx": 5e-3})
    assert "taken as times down, receivers across" in bare.notes[0]
    # No record has two frames; rows and columns alone are signals, of one receiver too.
    same(from_arrays({"u": U[:, :2].T, "fs": 2e6, "dx": 5e-3}), x=X[:2] - X[0], u=U[:, :2])
    one = from_arrays({"u": U[:, :1].T, "time": T[None]}, Layout(placed=False))
    assert (one.values[0, :, 0] == U[:, 0]).all()
    assert one.t == pytest.approx(T)


def test_images_are_no_components_of_a_line():
    """Of a stack (times, x, y) one line is asked for, whatever else is said of times; one line of
    it is read by its frame rate."""
    stack = np.random.default_rng(1).standard_normal((400, 64, 24))
    more = {"x_mm": np.arange(64.0), "y_mm": np.arange(24.0), "fps": np.array(5e5)}
    for given in ({}, {"interval": 2e-6}):
        with pytest.raises(RecordError, match=r"ux \(400, 64, 24\): of three axes .*ux\[:, :, 0\]"):
            from_arrays({"ux": stack, **more}, Layout(**given))
    found = from_arrays({"ux": stack[:, :, 0], "x_mm": more["x_mm"], "fps": more["fps"]})
    assert found.values.shape == (1, 400, 64)
    assert found.t[1] == pytest.approx(2e-6)


def test_correlations_have_lags_for_times():
    lags = np.arange(-400, 401) * 5e-3
    values = np.random.default_rng(1).standard_normal((24, 801))
    found = from_arrays({"ccf": values, "lags": lags, "distance_m": 5.0 * np.arange(24)})
    assert found.values.shape == (1, 801, 24)
    np.testing.assert_allclose(found.t, lags)


def test_an_axis_is_known_by_its_unit_alone(tmp_path):
    """Where its name says nothing: a coordinate in cm is of places, one in ms of times."""
    import xarray

    axes = {
        "lag": ("lag", T * 1e3, {"units": "ms"}),
        "sensor": ("sensor", X * 100, {"units": "cm"}),
    }
    same(from_xarray(xarray.DataArray(U.T, axes, ("sensor", "lag"))))


def test_places_in_two_axes_are_along_their_line():
    """In whatever order: a receiver behind the first one is behind it."""
    order = np.array([1, 0, 2, 3])
    spots = 7.0 + np.outer(X, (0.6, 0.8))
    found = from_arrays({"u": U[:, order], "t": T, "xpos": spots[order]})
    same(found, x=X - X[1])
    corner = np.c_[np.minimum(X, X[1]), np.maximum(X, X[1])]
    for bent in (corner, np.c_[np.cos(100 * np.pi * X), np.sin(100 * np.pi * X)]):
        with pytest.raises(RecordError, match="on no straight line"):
            from_arrays({"u": U, "t": T, "xpos": bent})


def test_a_length_in_brackets_is_a_place_behind_a_receiver_alone(tmp_path):
    """A wavelength, a range or a load (1 MΩ) is none."""
    table = rows(T * 1e6)
    for names, placed in (
        (("ch{}", "Channel {}", "sensor_{}"), True),
        (("laser {}", "range {}", "gain"), False),
    ):
        for name in names:
            headings = ",".join(f"{name.format(j)} ({1e3 * x:g} mm)" for j, x in enumerate(X, 1))
            path = tmp_path / f"{name.format(0).strip()}.csv"
            path.write_text(f"t_us,{headings}\n{table}")
            if placed:
                same(read(path), x=X)
                continue
            with pytest.raises(RecordError, match="no positions"):
                read(path)


@pytest.mark.parametrize("part", [1e-306, 1e40])
def test_places_whose_squares_are_no_numbers_are_refused_whoever_asks(part):
    with pytest.raises(RecordError, match=r"positions .* give them between"):
        record(U, T, X * part, placed=False)


def test_hdf5_with_units_and_groups_with_places(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("scan/time", data=T * 1e6).attrs["units"] = "us"
        file.create_dataset("scan/x", data=X * 1e3).attrs["units"] = "mm"
        file["scan/u"] = U
    same(read(tmp_path / "a.h5"))
    with h5py.File(tmp_path / "b.out", "w") as file:
        file.attrs["dt"] = 5e-7
        for j in range(M):
            group = file.create_group(f"rxs/rx{j + 1}")
            group.attrs["Position"] = [X[j], 0.0, 0.0]
            group["Ez"] = U[:, j]
            group["Ex"] = 0 * U[:, j]
    same(read(tmp_path / "b.out"))


@pytest.mark.parametrize("grouped", [False, True])
def test_hdf5_of_an_array_for_each_receiver(tmp_path, grouped):
    """By the order of their numbers, not 1, 10, 11, 2, and at the positions that attributes say."""
    u, x = np.tile(U, 3) * np.arange(1, 13), 0.02 + 0.005 * np.arange(12)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["sample_rate"], file.attrs["spacing"] = 2e6, 0.005
        for j in range(12):
            file.create_dataset(f"ch{j + 1}" + "/data" * grouped, data=u[:, j])
    found = read(tmp_path / "a.h5")
    assert np.diff(found.x) == pytest.approx(0.005)
    assert np.array_equal(found.values[0], u)
    with h5py.File(tmp_path / "a.h5", "a") as file:
        for j in range(12):
            file[f"ch{j + 1}"].attrs["x_mm"] = 1e3 * x[j] ** 2
    assert read(tmp_path / "a.h5").x == pytest.approx(x**2)


def test_matlab_both_ways(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"t": T, "x": X, "u": U})
    same(read(tmp_path / "a.mat"))
    scipy.io.savemat(tmp_path / "b.mat", {"scan": {"time": T, "pos": X, "u": U.T}})
    same(read(tmp_path / "b.mat"))
    scipy.io.savemat(tmp_path / "d.mat", {"Tstart": -1e-5, "Tinterval": 5e-7, "A": U[:, 0],
                                          "rx": U[:, 1]})  # fmt: skip
    one = read(tmp_path / "d.mat", Layout(placed=False))
    assert one.t == pytest.approx(T - 1e-5, abs=1e-15)
    assert np.array_equal(one.values[0], U[:, :2])
    # Version 7.3 is HDF5, with axes the other way round and a block before it.
    with h5py.File(tmp_path / "c.mat", "w", userblock_size=512) as file:
        for name, array in {"t": T[None], "x": X[:, None], "u": U.T}.items():
            file.create_dataset(name, data=array).attrs["MATLAB_class"] = np.bytes_("double")
    raw = bytearray((tmp_path / "c.mat").read_bytes())
    raw[:19] = b"MATLAB 7.3 MAT-file"
    (tmp_path / "c.mat").write_bytes(raw)
    same(read(tmp_path / "c.mat"))


@pytest.mark.parametrize("engine", ["h5netcdf", "scipy"])
def test_netcdf_and_xarray(tmp_path, engine):
    import xarray

    array = xarray.DataArray(
        U.T, dims=("distance", "time"), name="u",
        coords={"distance": ("distance", X * 1e3, {"units": "mm"}),
                "time": ("time", T * 1e3, {"units": "ms"})},
    )  # fmt: skip
    array.to_netcdf(tmp_path / "a.nc", engine=engine)
    same(read(tmp_path / "a.nc"))
    same(from_xarray(array))


def test_seismic_formats(tmp_path):
    obspy = pytest.importorskip("obspy")
    from obspy.io.segy.segy import SEGYBinaryFileHeader, SEGYTraceHeader

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # obspy's own
        traces = [obspy.Trace(U[:, j].astype("f4"), {"delta": 1e-3, "station": f"R{j}"})
                  for j in range(M)]  # fmt: skip
        for j, trace in enumerate(traces):
            trace.stats.segy = obspy.core.AttribDict(trace_header=SEGYTraceHeader())
            header = trace.stats.segy.trace_header
            name = "distance_from_center_of_the_source_point_to_the_center_of_the_receiver_group"
            setattr(header, name, 10 + 2 * j)
        stream = obspy.Stream(traces)
        stream.write(str(tmp_path / "a.segy"), format="SEGY", data_encoding=5)
        stream.write(str(tmp_path / "a.mseed"), format="MSEED")
        # Feet; offsets in whole ones, coordinates in tenths; recording begins before the blow.
        stream.stats = obspy.core.AttribDict(binary_file_header=SEGYBinaryFileHeader())
        stream.stats.binary_file_header.measurement_system = 2
        stream.stats.textual_file_header = b""
        for j, trace in enumerate(traces):
            header = trace.stats.segy.trace_header
            setattr(header, name, round(10 + 2.4 * j))
            header.scalar_to_be_applied_to_all_coordinates, header.coordinate_units = -10, 1
            header.source_coordinate_x, header.group_coordinate_x = 5000, 5100 + 24 * j
            header.delay_recording_time = -30
        stream.write(str(tmp_path / "ft.segy"), format="SEGY", data_encoding=5)
        alone = obspy.Trace(U[:, 0].astype("f4"), {"delta": 1e-3})
        alone.write(str(tmp_path / "a.sac"), format="SAC")
        alone.stats.sac = {"dist": 0.02}  # km
        alone.write(str(tmp_path / "placed.sac"), format="SAC")
        # A source among the receivers, with offsets that have no sign.
        for j, trace in enumerate(traces):
            header = trace.stats.segy.trace_header
            header.delay_recording_time = 0
            setattr(header, name, round(abs(20 * j - 23)))
            header.source_coordinate_x, header.group_coordinate_x = 5230, 5000 + 200 * j
        stream.stats.binary_file_header.measurement_system = 1
        stream.write(str(tmp_path / "split.segy"), format="SEGY", data_encoding=5)
    t, u = np.arange(N) * 1e-3, U.astype("f4").astype(float)
    same(read(tmp_path / "split.segy"), t, 20.0 * np.arange(M) - 23, u)
    # Offsets count from the source, which so is known, but where the user places receivers.
    assert read(tmp_path / "split.segy").sources == (0.0,)
    assert read(tmp_path / "split.segy", Layout(spacing=2.0)).sources == ()
    for j, trace in enumerate(traces):
        del trace.stats.segy
        trace.stats.seg2 = {"RECEIVER_LOCATION": f"{100 + j}.25", "SOURCE_LOCATION": "98.75 0 0"}
    stream.stats = obspy.core.AttribDict(seg2={"UNITS": "FEET"})
    located = of_stream(stream).arrays
    assert located["x"][0] == 100.25
    assert located["sources"] == pytest.approx([98.75 * 0.3048])
    same(read(tmp_path / "a.segy"), t, 10 + 2.0 * np.arange(M), u)
    same(read(tmp_path / "ft.segy"), t - 0.03, 0.3048 * (10 + 2.4 * np.arange(M)), u)
    same(read(tmp_path / "a.mseed", Layout(spacing=2.0)), t, 2.0 * np.arange(M), u)
    with pytest.raises(RecordError, match="4 receivers: the file says none; give --spacing"):
        read(tmp_path / "a.mseed")
    same(read(tmp_path / "placed.sac", Layout(placed=False)), t, np.array([20.0]), u[:, :1])
    one = read(tmp_path / "a.sac", Layout(placed=False))
    assert one.values.shape == (1, N, 1)
    assert np.abs(one.values[0, :, 0] - u[:, 0]).max() < 1e-12


@pytest.mark.parametrize("interval", [5e-7, 2.5e-6, 1 / 512])
def test_intervals_of_traces_are_as_the_header_has_them(tmp_path, interval):
    """Not whole µs, which obspy makes of SAC's; SEG-Y and SU have no others, and say so."""
    obspy = pytest.importorskip("obspy")
    traces = [obspy.Trace(U[:, j].astype("f4"), {"delta": interval, "station": f"R{j}"})
              for j in range(M)]  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # obspy's own
        for j, trace in enumerate(traces):
            trace.write(str(tmp_path / f"{j}.sac"), format="SAC")
        obspy.Stream(traces).write(str(tmp_path / "a.segy"), format="SEGY", data_encoding=5)
        t, u = interval * np.arange(N), U.astype("f4").astype(float)
        same(read(sorted(tmp_path.glob("*.sac")), Layout(spacing=2.0)), t, 2.0 * np.arange(M), u)
        if interval < 1e-6:
            with pytest.raises(RecordError, match=r"no times .* or give --interval"):
                read(tmp_path / "a.segy", Layout(spacing=2.0))
        elif interval < 1e-4:
            noted = read(tmp_path / "a.segy", Layout(spacing=2.0)).notes
            assert any("interval of 2 µs is of whole µs" in note for note in noted)
        same(
            read(tmp_path / "a.segy", Layout(spacing=2.0, interval=interval)),
            t,
            2.0 * np.arange(M),
            u,
        )


def test_receivers_of_one_record_may_stand_in_files_of_their_own(tmp_path):
    """Names as a shell lists them, R1, R10, R2; a file that begins later, and one that is cut."""
    t, x = np.arange(400) * 1e-4, 5.0 + 2.0 * np.arange(12)
    u = np.sin(2e3 * np.maximum(t[:, None] - 4e-3 - x / 4e3, 0)) ** 3
    for j in range(12):
        rows = slice(3 if j == 4 else 0, 360 if j == 7 else 400)
        np.savetxt(tmp_path / f"R{j + 1}.Z.semd", np.column_stack([t, u[:, j]])[rows])
    files = sorted(tmp_path.glob("*.semd"), key=str)
    assert files[1].name == "R10.Z.semd"
    found = read(files, Layout(spacing=2.0, first=5.0))
    assert found.x == pytest.approx(x)
    assert found.labels[:2] == ("R1.Z", "R2.Z")
    whole = slice(0, 300)
    assert found.t[whole] == pytest.approx(t[whole], abs=1e-12)
    assert np.abs(found.values[0][whole] - u[whole]).max() < 1e-9
    with pytest.raises(
        RecordError, match=r"R1.Z.semd and 11 more: positions of 12 receivers.*--spacing"
    ):
        read(files)
    with pytest.raises(RecordError, match="--positions: 2 given for 12 receivers"):
        read(files, Layout(positions=(1.0, 2.0)))
    (tmp_path / "R3.Z.semd").write_text("no numbers")
    with pytest.raises(RecordError, match=r" and 11 more: R3\.Z\.semd: "):
        read(files, Layout(spacing=2.0))


def test_traces_of_one_shot_may_stand_in_files_of_their_own(tmp_path):
    """Each of SAC's is of one trace, with a date and a distance."""
    obspy = pytest.importorskip("obspy")
    begin = obspy.UTCDateTime(2024, 3, 1)
    for j in range(M):
        trace = obspy.Trace(U[:, j].astype("f4"), {"delta": 1e-3, "starttime": begin})
        trace.stats.sac = {"dist": 0.02 + 0.005 * j}  # km
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # obspy's own
            trace.write(str(tmp_path / f"{M - j}.sac"), format="SAC")
    found = read(sorted(tmp_path.glob("*.sac")))
    same(found, np.arange(N) * 1e-3, 20.0 + 5 * np.arange(M), U.astype("f4").astype(float))


SCOPE = -2e-4 + 2.5e-6 * np.arange(200)
SENT, GOT = np.round(np.random.default_rng(8).standard_normal((2, 200)), 4)
LVM = "LabVIEW Measurement\nSeparator\tTab\nX_Columns\tNo\n***End_of_Header***\nChannels\t2\n"
SCOPES = {
    "samples counted, start and increment beside the headings": (
        "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-2.0e-04,2.5e-06\n",
        [f"{i},{a},{b}," for i, (a, b) in enumerate(zip(SENT, GOT, strict=True))],
        "2",
    ),
    "settings in the headings": (
        "CH1,CH2,t0 =-2.0e-04, tInc = 2.5e-06,\n",
        [f"{a},{b},,," for a, b in zip(SENT, GOT, strict=True)],
        "CH1",
    ),
    "settings beside the first rows": (
        "",
        [f"{key},{t:.7f},{a},{t:.7f},{b},"
         for key, t, a, b in zip(["Points,200", "Interval,2.5e-6", ","] + [","] * 197,
                                 SCOPE, SENT, GOT, strict=True)],
        "4",
    ),
    "no times but a start and steps": (
        LVM + "X0\t-2.0E-4\t-2.0E-4\nDelta_X\t2.5E-6\t2.5E-6\nX_Value\tA\tB\n",
        [f"\t{a}\t{b}" for a, b in zip(SENT, GOT, strict=True)],
        "A",
    ),
    "no times, and a heading for remarks": (
        LVM + "X0\t-2.0E-4\t-2.0E-4\nDelta_X\t2.5E-6\t2.5E-6\nX_Value\tA\tB\tComment\n",
        [f"\t{a}\t{b}" for a, b in zip(SENT, GOT, strict=True)],
        "A",
    ),
    "times rounded to four samples, and a start and steps": (
        LVM + "X0\t-2.0E-4\t-2.0E-4\nDelta_X\t2.5E-6\t2.5E-6\nX_Value\tA\tB\n",
        [f"{t:.5f}\t{a}\t{b}" for t, a, b in zip(SCOPE, SENT, GOT, strict=True)],
        "A",
    ),
    "times, and settings in the headings": (
        "Time(S),CH1V,CH2V,t0 = -2.0e-04, tInc = 2.5e-06\n",
        [f"{t:.7f},{a},{b}" for t, a, b in zip(SCOPE, SENT, GOT, strict=True)],
        "CH1V",
    ),
    "the time of day above the numbers": (
        '"HResolution",2.5E-06,2.5E-06\n"HOffset",-2.0E-04,-2.0E-04\n"Time","10:00:00","10:00:00"\n',
        [f"{a},{b}" for a, b in zip(SENT, GOT, strict=True)],
        "1",
    ),
    "numbers for headings": (
        "x-axis,1,2\nsecond,Volt,Volt\n",
        [f"{t:.7f},{a},{b}" for t, a, b in zip(SCOPE, SENT, GOT, strict=True)],
        "column 2",
    ),
    "columns named in a comment": (
        "% columns: time[us] sent[V] received[V]\n",
        [f" {t * 1e6:.1f}  {a}  {b}" for t, a, b in zip(SCOPE, SENT, GOT, strict=True)],
        "2",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", SCOPES)
def test_tables_of_oscilloscopes_are_read_with_their_own_times(tmp_path, kind):
    """Rigol's, Tektronix', National Instruments', Keysight's ways: two channels, t from −0.2 ms."""
    head, lines, column = SCOPES[kind]
    (tmp_path / "a.csv").write_text(head + "\n".join(lines) + "\n")
    found = read(tmp_path / "a.csv", Layout(input=column, placed=False))
    assert found.t == pytest.approx(SCOPE, abs=1e-12)
    assert np.array_equal(found.values[0], GOT[:, None])
    assert np.array_equal(found.input, SENT)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Sample,A,B\n" + "".join(f"{i},{v},{v}\n" for i, v in enumerate(GOT)), "numbers the rows"),
        ("#CLOCK=2.5uS\n" + "".join(f"{v}\n" for v in GOT), "no times of 200"),
        ("Time,A\n" + 2 * "".join(f"{t:.7f},{v:.4f}\n" for t, v in zip(SCOPE, GOT, strict=True)),
         "times begin anew 1 times"),
        ("Frequency (kHz),A,B\n" + rows(u=U[:, :2]), "column 1 .* holds frequencies"),
        ("Distance (mm),A,B\n" + rows(u=U[:, :2]), "column 1 .* holds places"),
        ("timestamp,A,B\n" + rows(1.7e13 + 2 * np.arange(N), U[:, :2], form="%.14g"),
         "no seconds since 1970: .*--time-unit"),
    ],
    ids=["samples counted", "a clock without a start", "segments", "frequencies", "places",
         "of no unit since 1970"],
)  # fmt: skip
def test_what_holds_no_times_is_refused(tmp_path, text, message):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(RecordError, match=message):
        read(tmp_path / "a.csv", Layout(placed=False))


def test_the_sources_signal_is_no_receiver(tmp_path):
    (tmp_path / "a.csv").write_text("time (s),sent,got\n" + rows(u=U[:, :2]))
    for column in ("2", "sent"):
        found = read(tmp_path / "a.csv", Layout(input=column, placed=False))
        assert found.labels == ("got",)
        assert np.array_equal(found.input, U[:, 0])
    for more in ({"t": T, "x": X[1:]}, {"dt": T[1] - T[0], "x": X[1:]}, {"t": T}):
        for values in (U, U.T):
            np.savez(tmp_path / "a.npz", u=values, **more)
            layout = Layout(input=2, spacing=0.01) if "x" not in more else Layout(input=2)
            found = read(tmp_path / "a.npz", layout)
            assert np.array_equal(found.input, U[:, 0])
            assert found.values.shape == (1, len(T), len(X) - 1)
    with pytest.raises(
        RecordError, match=r"--input 9: no such column; there are 2 'sent', 3 'got'"
    ):
        read(tmp_path / "a.csv", Layout(input="9", placed=False))


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_matlabs_cells_are_receivers_side_by_side(tmp_path, version):
    path = tmp_path / "cells.mat"
    if version == "5":
        cells = np.empty(M, object)
        cells[:] = [U[:, [j]] for j in range(M)]
        scipy.io.savemat(path, {"traces": cells, "dt": T[1], "x_mm": 1e3 * X})
    else:
        with h5py.File(path, "w") as file:
            cells = file.create_dataset("traces", (1, M), dtype=h5py.ref_dtype)
            cells.attrs["MATLAB_class"] = np.bytes_("cell")
            for j in range(M):
                cells[0, j] = file.create_dataset(f"#refs#/{j}", data=U[:, j][None]).ref
            file["dt"], file["x_mm"] = [[T[1]]], 1e3 * X[:, None]
    same(read(path, Layout()))


def test_axes_of_one_entry_tell_nothing(tmp_path):
    path = tmp_path / "stacked.npz"
    np.savez(path, data=U.T[None, :, :, None].astype(">f8"), time_us=1e6 * T, x_mm=1e3 * X)
    same(read(path, Layout()))


def test_dates_are_times_whatever_their_name_is(tmp_path):
    xarray = pytest.importorskip("xarray")
    frames = np.datetime64("2024-01-01T00:00:00", "ns") + np.round(T * 1e9).astype("m8[ns]")
    coords = {"frame": frames, "x": ("sensor", 100 * X, {"units": "cm"})}
    xarray.DataArray(U, coords, ("frame", "sensor"), "v").to_netcdf(
        tmp_path / "frames.nc", engine="h5netcdf"
    )
    same(read(tmp_path / "frames.nc", Layout()))


def test_rows_of_words_below_the_numbers_are_none(tmp_path):
    path = tmp_path / "with_statistics.csv"
    below = f"Max,{','.join(f'{v:g}' for v in U.max(0))}\nMean,0,0,0,0\nend of record\n"
    path.write_text(HEAD + rows() + below)
    found = read(path, Layout())
    same(found)
    assert "3 rows below the numbers: left out" in found.notes


def test_a_clock_may_pass_midnight(tmp_path):
    day = np.datetime64("2024-03-01T23:59:59.990", "us") + np.round(T * 1e9).astype("m8[us]")
    lines = [f"{str(when)[11:]},{line.partition(',')[2]}"
             for when, line in zip(day, rows().splitlines(), strict=True)]  # fmt: skip
    path = tmp_path / "night.csv"
    path.write_text(HEAD.replace("t_s", "Time") + "\n".join(lines) + "\n")
    same(read(path, Layout()), t=1e3 * T)


def test_a_unit_may_stand_for_the_name_of_times_and_in_brackets_for_places(tmp_path):
    path = tmp_path / "short.csv"
    path.write_text("us," + ",".join(f"Ch{j} ({v / 0.0254:.12g} in)" for j, v in enumerate(X))
                    + "\n" + rows(1e6 * T))  # fmt: skip
    same(read(path, Layout()))


@pytest.mark.parametrize("layout", [Layout(), Layout(time="f")])
def test_spectra_are_no_signals(tmp_path, layout):
    path = tmp_path / "response.npz"
    np.savez(path, H=U, f=1e3 * np.arange(N), x=X)
    with pytest.raises(RecordError, match=r"f \(64,\) holds frequencies"):
        read(path, layout)


def test_traces_of_sac_count_from_the_event(tmp_path):
    """With reference times of their own, b − o is what says when each begins."""
    obspy = pytest.importorskip("obspy")
    u, t, cut = np.vstack([0 * U, U]), np.arange(2 * N) / 1000, (0, 7, 3, 12)
    for j, first in enumerate(cut):
        trace = obspy.Trace(u[first:, j].astype("f4"), {"delta": 1e-3})
        trace.stats.sac = {"b": t[first] + 0.5, "o": 0.5, "dist": X[j]}
        trace.write(str(tmp_path / f"R{j}.sac"), format="SAC")
    from wavesim.records.formats.seismic import from_seismic

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = from_seismic(*(tmp_path / f"R{j}.sac" for j in range(M)))
    assert found.arrays["t"] == pytest.approx(t, abs=1e-6)
    for j, first in enumerate(cut):
        assert np.isnan(found.arrays["values"][:first, j]).all()
        assert found.arrays["values"][first:, j] == pytest.approx(u[first:, j], abs=1e-6)


SLOW, FAST = 2e-7 * np.arange(1500), 1.3e-7 * np.arange(1500) + 0.4e-7


def burst(t, x):
    """A pulse about 150 kHz at 1500 m/s, and a tone of 3 MHz that the slower clock can't hold."""
    late = (t - 4e-5 - x / 1500) * 1.5e5
    return np.exp(-(late**2)) * np.cos(2 * np.pi * late), np.cos(2 * np.pi * 3e6 * t)


@pytest.mark.parametrize("kind", ["csv", "unnamed", "npz", "files"])
def test_channels_of_two_rates_are_put_on_the_slower(tmp_path, kind):
    """What both rates can hold is kept, whatever else the faster one has heard."""
    times = [(SLOW, FAST)[j % 2] for j in range(6)]
    x = 0.01 + 0.007 * np.arange(6)
    signals = [sum(burst(t, p)) if t is FAST else burst(t, p)[0]
               for t, p in zip(times, x, strict=True)]  # fmt: skip
    path = [tmp_path / f"two{j}.csv" for j in range(6)] if kind == "files" else tmp_path / "two.csv"
    layout = Layout(positions=list(x))
    if kind == "files":
        for one, t, v in zip(path, times, signals, strict=True):
            many = slice(None) if t is FAST else slice(1000)  # each with frames of its own
            np.savetxt(one, np.c_[t, v][many], "%.12g", ",", header="t_s,u", comments="")
    elif kind == "npz":
        path = path.with_suffix(".npz")
        np.savez(path, t=np.stack(times, 1), u=np.stack(signals, 1), x=x)
    else:
        named = kind == "csv"
        head = ",".join(f"t{j} (us),x={1e3 * p:g} mm" if named else f"a{j},b{j}"
                        for j, p in enumerate(x))  # fmt: skip
        unit = 1e6 if named else 1.0
        columns = [c for t, v in zip(times, signals, strict=True) for c in (t * unit, v)]
        np.savetxt(path, np.stack(columns, 1), "%.12g", ",", header=head, comments="")
        layout = Layout() if named else layout
    found = read(path, layout)
    assert found.x == pytest.approx(x)
    assert found.t == pytest.approx(SLOW[1 : len(found.t) + 1], rel=1e-9)
    assert 900 < len(found.t) < 1000
    truth = np.stack([burst(found.t, p)[0] for p in x], 1)
    assert np.abs(found.values[0] - truth)[60:-60].max() < 3e-4
    assert any("Nyquist" in note and "3 with up to 1.54 times" in note for note in found.notes)


def test_channels_of_two_rates_that_hardly_overlap_are_refused():
    t = np.stack([SLOW, FAST + 2.9e-4], 1)
    with pytest.raises(RecordError, match="differ in rate, and the slowest has 49 frames"):
        record(np.stack([burst(one, 0.0)[0] for one in t.T], 1), t, [0.0, 0.01])
