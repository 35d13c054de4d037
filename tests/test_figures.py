"""Figures: all are written, the two scales of each axis agree, and gaps stand where they should."""

import dataclasses
import struct
import sys

import matplotlib
import numpy as np
import pytest
from madeup import made_field
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from runs import call

from wavesim import planewave
from wavesim.figures import endless as figures
from wavesim.figures import field as fieldfigures
from wavesim.figures import style
from wavesim.grid.bar import Bar
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.material.shown import decibels
from wavesim.readings import amplitude_map
from wavesim.records.files import read as read_record
from wavesim.sources import Ricker
from wavesim.worker import Worker

DRAWN = (
    "attenuation_longitudinal",
    "dispersion_inplane",
    "dispersion_longitudinal",
    "energy",
    "receivers",
    "spacetime",
)
TO_KHZ = 1 / (2e3 * np.pi)


@pytest.fixture(scope="module")
def drawn(small_run, small_held):
    """Every figure of the small run, by name, laid out but not written."""
    field = small_run.field
    with matplotlib.rc_context(style.STYLE):
        made = {
            "spacetime": fieldfigures.spacetime(field),
            "dispersion": figures.dispersion(field, small_held, "longitudinal"),
            "inplane": figures.dispersion(field, small_held, "inplane"),
            "attenuation": figures.attenuation(field, small_held[0]),
            "receivers": fieldfigures.receivers(field),
            "energy": fieldfigures.energy(field),
        }
        for figure in made.values():
            figure.draw_without_rendering()
    return made


def secondary(axes):
    """The scaled axes that stand opposite: {"top" or "right": axes}."""
    return {("top" if a._orientation == "x" else "right"): a for a in axes.child_axes}


def spans(axes, upright):
    """Shaded intervals along frequency, kHz."""
    found = []
    for patch in axes.patches:
        box = patch.get_extents().transformed(axes.transData.inverted())
        if patch.get_zorder() == style.GAP["zorder"]:
            found.append((box.x0, box.x1) if upright else (box.y0, box.y1))
    return sorted(found)


def gaps_in_khz(medium, sector):
    return [
        (g.lower * TO_KHZ, g.upper * TO_KHZ)
        for g in planewave.gaps(medium, sector)
        if g.upper > g.lower
    ]


def test_every_figure_is_written(small_run, tmp_path):
    """From the run's folder, at the size that was asked for, none of them blank."""
    result = call("figures", small_run.folder, "--out", tmp_path / "figures")
    assert (result.exit_code, result.stderr) == (0, "")
    files = sorted(p.name for p in (tmp_path / "figures").iterdir())
    assert files == [f"{name}.png" for name in DRAWN]
    for name in files:
        content = (tmp_path / "figures" / name).read_bytes()
        assert content[:8] == b"\x89PNG\r\n\x1a\n"
        width, height = struct.unpack(">II", content[16:24])
        assert 700 <= width <= 2000
        assert 450 <= height <= 2000
        assert len(content) > 15_000


@pytest.mark.parametrize(("kind", "head"), [("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_one_figure_in_a_format_for_paper(small_run, tmp_path, kind, head):
    """That one and no other; drawn twice it is one file, byte for byte but for names in an SVG."""
    result = call("figures", small_run.folder, "--only", "energy", "--format", kind,
                  "--out", tmp_path)  # fmt: skip
    assert (result.exit_code, result.stderr) == (0, "")
    (path,) = tmp_path.iterdir()
    assert path.name == f"energy.{kind}"
    assert path.read_bytes()[: len(head)] == head


def test_signals_as_tables_are_read_back_as_they_were(small_run, tmp_path):
    """Times, places and values of each field, to the digits written, by the reader of any record;
    the headings name receiver, place and unit."""
    call("figures", small_run.folder, "--format", "csv", "-o", tmp_path)
    field = small_run.field
    assert {path.stem for path in tmp_path.iterdir()} == {f"receivers_{n}" for n in field.names}
    for name in field.names:
        path = tmp_path / f"receivers_{name}.csv"
        heads = path.read_text(encoding="utf-8").splitlines()[0].split(",")
        read = read_record(path)
        np.testing.assert_allclose(read.t, field.t, rtol=1e-11)
        places = sorted(field.receivers.items(), key=lambda item: item[1])
        for n, (receiver, x) in enumerate(places):
            assert heads[n + 1] == f"{receiver} x={x * 1e3:.9g} mm ({field.unit(name)})"
            assert read.x[n] == pytest.approx(x, rel=1e-9)
            np.testing.assert_allclose(read.values[0][:, n], field.at(x, name), rtol=1e-11)
    told = call("figures", small_run.folder, "--format", "csv", "--only", "energy")
    assert told.exit_code == 2
    assert f"receivers_{field.names[0]}" in told.stderr


def test_a_figure_that_is_none_is_told_with_those_there_are(small_run, tmp_path):
    result = call("figures", small_run.folder, "--only", "energie", "--out", tmp_path / "none")
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert "--only energie: must be one of spacetime, receivers, energy" in line
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("what", ["nothing", "no result"])
def test_figures_of_no_run_give_2_and_one_line(tmp_path, what):
    folder = tmp_path / "folder"
    if what == "no result":
        folder.mkdir()
        (folder / "result.h5").write_text("not HDF5")
    result = call("figures", folder)
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1


def test_a_heading_is_shown_whole_and_a_record_s_name_by_its_ends():
    """A heading has a page's width, a name in a title that of a figure of 6 inches."""
    heading = "Band gaps of rotation waves: all twelve waves from one pulse"
    assert style.as_written(heading) == heading
    name = style.name_in_title(f"first_{'x' * 80}_last")
    assert len(name) < 50
    assert (name[:6], name[-5:]) == ("first_", "_last")


def test_a_run_writes_one_picture_and_draws_the_rest_on_demand(small_case, small_run, tmp_path):
    assert (small_run.folder / "overview.png").read_bytes()[1:4] == b"PNG"
    assert not (small_run.folder / "figures").exists()
    short = ("--set", "time.duration=2e-5", "--set", "bar.length=0.096", "--out", tmp_path)
    short = ("run", small_case, "--quiet", *short)
    assert call(*short, "--figures").exit_code in (0, 1)
    made = {path.stem for path in (tmp_path / "figures").glob("*.png")}
    assert made == {*DRAWN}
    # Those of an earlier run are not taken for the next one's; what else lies there is left.
    (tmp_path / "figures" / "mine.png").write_bytes(b"")
    assert call(*short).exit_code in (0, 1)
    assert [path.name for path in (tmp_path / "figures").iterdir()] == ["mine.png"]


@pytest.mark.parametrize(
    ("name", "panel", "side", "label", "unit"),
    [
        ("spacetime", 0, "top", "x / l", lambda m: 1e-3 / m.length_scale),
        ("spacetime", 0, "right", "t / √", lambda m: 1e-6 / m.time_scale),
        ("dispersion", 0, "top", "k̄", lambda m: 1e3 * m.length_scale / 2 / np.pi),
        ("dispersion", 0, "right", "ω̄", lambda m: 2e3 * np.pi * m.time_scale),
        ("inplane", 0, "right", "ω̄", lambda m: 2e3 * np.pi * m.time_scale),
        ("attenuation", 0, "top", "ω̄", lambda m: 2e3 * np.pi * m.time_scale),
        ("attenuation", 1, "right", "Im k l", lambda m: 1e3 * np.log(10) / 20 * m.length_scale),
        ("attenuation", 2, "right", "Re k l/2π", lambda m: 1e3 * m.length_scale / 2 / np.pi),
        ("receivers", 0, "top", "t / √", lambda m: 1e-6 / m.time_scale),
        ("receivers", 1, "top", "ω̄", lambda m: 2e3 * np.pi * m.time_scale),
        ("energy", 0, "top", "t / √", lambda m: 1e-6 / m.time_scale),
    ],
)
def test_scaled_axis_stands_opposite_the_si_one(drawn, small_run, name, panel, side, label, unit):
    """The ends of the scaled axis are those of the SI axis times the unit, to rounding."""
    medium = small_run.field.medium
    axes = drawn[name].axes[panel]
    other = secondary(axes)[side]
    si = axes.get_xlim() if side == "top" else axes.get_ylim()
    scaled = other.get_xlim() if side == "top" else other.get_ylim()
    np.testing.assert_allclose(scaled, np.array(si) * float(unit(medium)), rtol=1e-12)
    shown = other.get_xlabel() if side == "top" else other.get_ylabel()
    assert label in shown


@pytest.mark.parametrize("name", ["spacetime", "dispersion", "attenuation", "receivers", "energy"])
def test_every_axis_names_its_quantity_and_unit(drawn, name):
    """An SI label has a unit in brackets; those hidden by sharing an axis are its neighbour's."""
    figure = drawn[name]
    assert isinstance(figure, Figure)
    labels = [text for a in figure.axes for text in (a.get_xlabel(), a.get_ylabel()) if text]
    assert len(labels) >= 2
    for text in labels:
        assert "(" in text
        assert text.endswith(")")


def test_labels_stay_inside_the_figure(drawn):
    """Titles and axis labels, those of the opposite axes too, to a pixel."""
    for figure in drawn.values():
        renderer = FigureCanvasAgg(figure).get_renderer()
        frame = figure.bbox.padded(1)
        for axes in figure.axes:
            for one in (axes, *axes.child_axes):
                for text in (one.title, one.xaxis.label, one.yaxis.label):
                    if text.get_text():
                        box = text.get_window_extent(renderer)
                        assert frame.contains(box.x0, box.y0), text.get_text()
                        assert frame.contains(box.x1, box.y1), text.get_text()


def test_gaps_are_shaded_at_their_frequencies(drawn, small_run):
    """Edges of the shading against the spectral solver, in kHz, to 1e-9."""
    medium = small_run.field.medium
    longitudinal, inplane = gaps_in_khz(medium, "longitudinal"), gaps_in_khz(medium, "inplane")
    assert len(longitudinal) == 2
    assert len(inplane) == 1
    for axes, upright, expected in (
        (drawn["dispersion"].axes[0], False, longitudinal),
        (drawn["inplane"].axes[0], False, inplane),
        (drawn["attenuation"].axes[1], True, longitudinal),
        (drawn["attenuation"].axes[2], True, longitudinal),
        (drawn["receivers"].axes[1], True, longitudinal),
    ):
        np.testing.assert_allclose(spans(axes, upright), expected, rtol=1e-9)
        names = {text.get_text() for text in axes.texts}
        assert {name for name in names if name.startswith("R")} in ({"RLB1", "RLB2"}, {"RSB"})
    assert spans(drawn["attenuation"].axes[0], True) == []


def test_theory_and_points_are_drawn_where_they_belong(drawn, small_run, small_held):
    medium = small_run.field.medium
    axes = drawn["dispersion"].axes[0]
    points = [line for line in axes.lines if line.get_marker() == "o"]
    theory = [line for line in axes.lines if line not in points]
    assert len(theory) == len(points) == 3
    for number, line in enumerate(theory):
        k, omega = line.get_data()
        exact = planewave.frequencies(medium, "longitudinal", k * 1e3)[:, number] * TO_KHZ
        np.testing.assert_allclose(omega, exact, rtol=1e-12)
    for line in points:
        k, omega = line.get_data()
        exact = planewave.frequencies(medium, "longitudinal", k * 1e3) * TO_KHZ
        # a tenth of a bin, also where the branch is too near to ω = 0 to be judged
        bin_khz = small_held[0].measured.spectrum.bin * TO_KHZ
        assert np.abs(exact - omega[:, None]).min(axis=1).max() < 0.1 * bin_khz
        assert len(k) > 20
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["plane-wave solver", "recovered"]

    # Attenuation in dB/mm is 20 log₁₀ e · Im k.
    curve = small_held[0].measured.attenuation
    (measured,) = [line for line in drawn["attenuation"].axes[1].lines if line.get_marker() == "o"]
    np.testing.assert_allclose(measured.get_xdata(), curve.omega * TO_KHZ, rtol=1e-12)
    np.testing.assert_allclose(
        measured.get_ydata(), 20 * np.log10(np.e) * curve.k.imag / 1e3, rtol=1e-12
    )


def test_picture_of_the_spectrum_lies_on_its_axes(drawn, small_held):
    """Pixel centres of the 2D spectrum stand at the wavenumbers of the bar."""
    found = small_held[0].measured.spectrum
    (image,) = drawn["dispersion"].axes[0].images
    left, right, bottom, top = image.get_extent()
    rows, columns = image.get_array().shape
    centres = left + (np.arange(columns) + 0.5) * (right - left) / columns
    np.testing.assert_allclose(centres, found.k / 1e3, atol=1e-9)
    # Each row is the largest of a tile of frequencies, so that no peak is lost.
    each = -(-len(found.omega) // rows)
    step = (top - bottom) / rows / each
    assert rows <= 1200
    assert bottom + step * (np.arange(len(found.omega)) + 0.5) == pytest.approx(
        found.omega * TO_KHZ, abs=1e-6
    )
    assert image.get_array().max() == pytest.approx(0.0, abs=1e-9)


def test_colours_are_readable_in_grey():
    """Lightness of the map falls all the way, so that it prints in grey."""
    colours = style.MAP(np.linspace(0, 1, 64))[:, :3]
    lightness = colours @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(lightness) < 0).all()


def test_decibels():
    np.testing.assert_allclose(
        decibels(np.array([10.0, -1.0, 0.1, 0.0]), 10.0), [0, -20, -40, -300]
    )


def test_thinning_keeps_the_largest():
    values = np.zeros((1000, 900))
    values[777, 555] = 3.0
    thin = style.thin(values, (90, 70))
    assert thin.shape[0] <= 90
    assert thin.shape[1] <= 70
    assert thin.max() == 3.0
    np.testing.assert_array_equal(style.thin(values[:80, :60], (90, 70)), values[:80, :60])


@pytest.mark.parametrize("scale", [0.0, 1e-300])
def test_field_with_nothing_in_it_can_be_drawn(small_run, scale):
    """No warning of a logarithm, a division or the layout (warnings are errors here)."""
    from wavesim.readings.dispersion.extract import extract
    from wavesim.verdict.branches import hold

    full = small_run.field
    made = made_field(
        full.t[:8],
        {name: scale * full[name][:8] for name in full.names},
        full.medium,
        full.bar,
        (Ricker("phi1", 0.064, 1e4),),
        full.receivers,
    )
    held = [hold(made, m, (125.0, 3142.0)) for m in extract(made)]
    with matplotlib.rc_context(style.STYLE):
        for figure in (
            fieldfigures.spacetime(made),
            figures.dispersion(made, held, "longitudinal"),
            fieldfigures.receivers(made),
        ):
            figure.draw_without_rendering()


def test_amplitude_of_a_record_read_in_parts(small_run, monkeypatch):
    """√(2⟨Σq²⟩) over tiles, the same to rounding however much is read at a time, and by the plain
    formula where a tile is longer than a period, so that nothing more is averaged."""
    field = small_run.field
    whole = amplitude_map.amplitude_map(field, "inplane", (17, 41))
    monkeypatch.setattr(amplitude_map, "_AT_ONCE", 1e6)
    parts = amplitude_map.amplitude_map(field, "inplane", (17, 41))
    np.testing.assert_allclose(parts, whole, rtol=1e-12)
    blocks = [b for b in field.blocks if b.sector == "inplane"]
    square = sum(np.square(values) for b in blocks for values, _ in field.components(b))
    high, wide = (-(-n // m) for n, m in zip(square.shape, (17, 41), strict=True))
    assert high * field.interval > 1 / field.sources[0].peak_frequency
    plain = [
        [square[i : i + high, j : j + wide].mean() for j in range(0, square.shape[1], wide)]
        for i in range(0, square.shape[0], high)
    ]
    np.testing.assert_allclose(whole, np.sqrt(2 * np.array(plain)), rtol=1e-12)


def test_tiles_of_a_picture_hold_what_is_there_at_their_place_and_time():
    """A field at one node and frame alone is in the tile that spans them."""
    medium, bar = Medium(), Bar(cells=100, spacing=1.25e-4)
    t = np.arange(50) * 1e-7
    for node, frame in ((0, 0), (37, 21), (99, 49)):
        values = {name: np.zeros((50, 100)) for name in ("phi1", "B11", "B22", "B33")}
        values["phi1"][frame, node] = 1.0
        made = made_field(t, values, medium, bar, [Ricker("phi1", 6e-3, 1e9)])
        amplitude = amplitude_map.amplitude_map(made, "longitudinal", (22, 30))
        row, column = np.unravel_index(np.argmax(amplitude), amplitude.shape)
        right, early, late = amplitude_map.tile_ends(made, (22, 30))
        high, wide = (late - early) / len(amplitude), right / amplitude.shape[1]
        assert early + row * high < t[frame] < early + (row + 1) * high
        assert column * wide - 1e-9 <= bar.nodes[node] < (column + 1) * wide


def test_amplitude_of_a_steady_wave_is_its_amplitude():
    """A sin(kx − ωt), twelve frames to a period: A in every tile that sees a whole period, whatever
    its phase there; a running mean over 13 frames for 12 is off by 1/26 of it at most."""
    medium, bar = Medium(), Bar(cells=512, spacing=1.25e-4)
    t = np.arange(600) / 12e6
    wave = 3.0 * np.sin(2 * np.pi * (8 * bar.nodes / bar.length - 1e6 * t[:, None]))
    still = dict.fromkeys(("B11", "B22", "B33"), np.zeros((600, 512)))
    made = made_field(t, {"phi1": wave} | still, medium, bar, [Ricker("phi1", 0.032, 1e6)])
    amplitude = 3.0 / scales(medium).unit("phi1")
    shown = amplitude_map.amplitude_map(made, "longitudinal", (600, 128))
    np.testing.assert_allclose(shown[6:-6], amplitude, rtol=1 / 26)


def drawn_by_forks(folder, field):
    with Worker() as beside:
        drawing = "wavesim.figures.drawing"
        names = beside.ask(f"{drawing}.names", field, None).result()
        made = [beside.ask(f"{drawing}.draw", folder, field, None, n, "png") for n in names]
        return [one.result() for one in made]


def test_forks_draw_what_this_process_would(small_run, tmp_path):
    """The same files, to the byte."""
    field = small_run.field
    here = style.write(fieldfigures.of_field(field), tmp_path / "here")
    there = drawn_by_forks(tmp_path / "there", field)
    assert [p.name for p in there] == [p.name for p in here]
    for a, b in zip(here, there, strict=True):
        assert a.read_bytes() == b.read_bytes()


def test_what_goes_wrong_in_drawing_is_raised_here(small_run, tmp_path):
    field = small_run.field
    (tmp_path / "figures").write_text("in the way")
    with pytest.raises(FileExistsError):
        drawn_by_forks(tmp_path / "figures", field)
    rest = {name: values for name, values in field.values.items() if name != "phi1"}
    gone = dataclasses.replace(field, values=rest)
    with pytest.raises(ValueError, match="phi1"):
        drawn_by_forks(tmp_path / "other", gone)


def test_animation_shows_the_field_frame_by_frame(small_run, tmp_path):
    """As many frames as were asked for, each another picture; the pulse fills the width in time."""
    path = tmp_path / "pulse.gif"
    result = call("animate", small_run.folder, "--frames", "9", "--out", path)
    assert (result.exit_code, result.stderr) == (0, "")
    with Image.open(path) as animation:
        assert animation.n_frames == 9
        assert animation.size == (800, 320)
        red = []
        for number in range(9):
            animation.seek(number)
            picture = np.asarray(animation.convert("RGB")).astype(int)
            line = (picture[..., 0] > 150) & (picture[..., 1] < 90)
            moving = np.flatnonzero(np.ptp(np.where(line, np.arange(320)[:, None], 0), axis=0))
            columns = np.flatnonzero(line.sum(axis=0) > 4)
            red.append(0 if len(moving) == 0 or len(columns) == 0 else int(np.ptp(columns)))
    assert red[0] == 0
    assert red[-1] > 300


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(("--field", "phi2"), "--field phi2: must be one of phi1, "), (("--format", "mp4"), "ffmpeg")],
)
def test_animation_that_can_not_be_made_gives_2(small_run, tmp_path, monkeypatch, arguments, said):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)  # as where it is not installed
    result = call("animate", small_run.folder, *arguments, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert said in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_branches_and_receivers_are_named_and_waves_gone_round_marked(drawn, small_run):
    """The mark begins at an end when the fastest wave is there, and runs back at its speed: that of
    k → ∞, √(C/m), by the slope of the highest branch between two large wavenumbers."""
    names = {text.get_text() for text in drawn["dispersion"].axes[0].texts}
    assert {"LA", "LO1", "LO2"} <= names
    joined = ", ".join(text.get_text() for text in drawn["inplane"].axes[0].texts)
    assert {"TSO[23]", "TSO(23)", "TSO(22-33)"} >= {n for n in joined.split(", ") if "TSO" in n}
    axes = drawn["spacetime"].axes[0]
    assert {"near", "far"} <= {text.get_text() for text in axes.texts}
    rounds = [line for line in axes.lines if line.get_color() == "white"]
    assert rounds
    field = small_run.field
    k = np.array([3e5, 3.1e5])
    low, high = planewave.frequencies(field.medium, "longitudinal", k)[:, -1]
    speed = (high - low) / (k[1] - k[0])
    for line in rounds:
        (x, last), (t, end) = (np.array(v, float) for v in line.get_data())
        assert min(x, field.bar.length * 1e3 - x) < 1e-9
        assert abs(last - x) * 1e-3 / ((end - t) * 1e-6) == pytest.approx(speed, rel=1e-3)
        assert t == pytest.approx(field.bar.length / 2 / speed * 1e6, rel=1e-3)


def test_what_stays_where_it_is_driven_has_no_panel(drawn):
    titles = [axes.get_title() for axes in drawn["spacetime"].axes if axes.get_title()]
    assert len(titles) == 1
    assert "B₂₃" in drawn["spacetime"].get_supxlabel()
