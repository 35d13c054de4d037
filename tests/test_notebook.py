"""What a notebook shows of a thing is what the thing is: a line, a table, a picture, a data set."""

import re

import numpy as np
import pytest

import wavesim as ws

SOFT = ws.Medium(closure="consistent", anisotropy=0.25)
STIFF = ws.Medium(closure="consistent", G_n_a=40.0, G_n_r=40.0)
LAYERS = ws.Layers((ws.Layer(0, 0.02, SOFT), ws.Layer(0.02, 0.05, SOFT, ws.Medium(
    closure="consistent", anisotropy=0.25, G_n_a=9.0))))  # fmt: skip
BAR = ws.layered_bar(LAYERS, 2.5e-4, left="fixed", right="free")
SIMULATION = ws.Simulation(LAYERS, BAR, (ws.Ricker("phi1", 0.01, 4e5),), 2e-5, 32, {"near": 0.015})


@pytest.fixture(scope="module")
def points():
    t, k = np.arange(200) * 1e-6, 40.0
    x = np.arange(16) * 0.01
    phase = 2 * np.pi * 5e4 * (t[:, None] - 6e-5) - k * x
    wave = np.cos(phase) * np.exp(-((phase / 3) ** 2))
    return ws.in_space(ws.record(wave, t, x), omega=2 * np.pi * np.array([5e4]))


def shown():
    slab = ws.Layers(
        (ws.Layer(0, 0.02, STIFF), ws.Layer(0.02, 0.026, SOFT), ws.Layer(0.026, 0.05, STIFF))
    )
    T = ws.layeredwave.transmission(slab, "longitudinal", 2 * np.pi * np.linspace(1e5, 9e5, 50))
    return [SOFT, LAYERS, BAR, SIMULATION, T]


@pytest.mark.parametrize("thing", shown(), ids=lambda thing: type(thing).__name__)
def test_a_thing_is_told_in_a_line_and_a_small_table(thing):
    assert "\n" not in repr(thing)
    assert len(repr(thing)) < 400
    rows = re.findall("<tr>", thing._repr_html_())
    assert 2 <= len(rows) <= 16


def test_the_line_of_a_medium_makes_it_again():
    for medium in (ws.Medium(), SOFT, ws.Medium(density=1200.0, rotation_inertia=1e-7)):
        assert eval(repr(medium), {"Medium": ws.Medium}) == medium


def test_text_in_a_table_is_no_markup():
    from wavesim.material.shown import table

    assert "<b>" not in table({"<b>": "<b>"})


@pytest.mark.parametrize("thing", shown(), ids=lambda thing: type(thing).__name__)
def test_a_thing_has_a_picture_that_a_notebook_shows(thing):
    figure = thing.plot()
    assert figure._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="nothing"):
        thing.plot(nothing=1)


def test_the_picture_of_layers_is_their_parameter():
    (axes,) = LAYERS.plot(parameter="G_n_a").axes
    x, y = axes.lines[0].get_data()
    expected = [float(LAYERS.at(at * 1e-3).G_n_a) for at in x[50:70]]
    np.testing.assert_allclose(y[50:70], expected, rtol=1e-12)


def test_points_as_a_data_set_are_their_columns(points):
    found = points.to_xarray()
    assert found.k_real_rad_per_m.values == pytest.approx([40.0], rel=1e-3)
    assert points.plot().axes


def test_transmission_as_a_data_set_is_over_frequency():
    T = shown()[-1]
    data = T.to_xarray()
    at = float(data.omega[7])
    assert complex(data.T_back.sel(omega=at)) == T.T_back[7]
    assert float((data.power_T + data.power_R).sel(omega=at)) == pytest.approx(1.0, abs=1e-10)


def test_a_run_is_opened_from_its_folder(small_run):
    run = ws.open(small_run.folder)
    assert (run.status, run.passed) == ("complete", small_run.summary["passed"])
    assert list(run.checks.name) == [check["name"] for check in small_run.summary["checks"]]
    data, field = run.to_xarray(), small_run.field
    frame, point = 40, 300
    where = {"t": field.t[frame], "x_half": field.bar.half_nodes[point]}
    assert float(data.B11.sel(where)) == field["B11"][frame, point]
    assert (data.B11.units, data.t.units) == ("1/m", "s")
    assert "phi1" in repr(run.field)
    assert run.plot()._repr_png_()
    (measured,) = [m for m in ws.extract(run.field) if m.block.macro]
    assert "branches" in measured._repr_html_()
    assert measured.plot().axes


def test_a_folder_without_a_run_is_told(tmp_path):
    with pytest.raises(RuntimeError, match="no such file; run the case first"):
        ws.open(tmp_path)


def test_progress_goes_to_the_end(capsys):
    told = []
    with ws.progress("counting") as tell:
        for part in (0.5, 1.0):
            tell(part)
            told.append(part)
    assert told[-1] == 1.0
    assert "100 %" in capsys.readouterr().out
