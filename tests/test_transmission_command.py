"""`wavesim transmission`: the exact T and R of a case's layers, by a transfer matrix in SI."""

from __future__ import annotations

import json

import numpy as np
import pytest
from runs import call

from wavesim import planewave
from wavesim.case.layered_case import load_layers

CASE = """\
title = "A stack"
medium = { closure = "consistent", G_n_a = 40.0, G_n_r = 40.0 }
bar = { left = "half-space", right = "half-space" }
[[layers]]
repeat = 3
layers = [{ thickness = 1e-3, G_n_a = 10.0 }, { thickness = 1.5e-3 }]
"""


def transfer(layers, sector, omega):
    """T at the faces, from (φ, σ) carried through every layer, and each Z by hand."""
    state = np.eye(2)[None] + np.zeros((len(omega), 1, 1), dtype=complex)
    own = layers.layers
    wave = [planewave.wavenumber(layer.medium, sector, omega) for layer in own]
    stiff = [layer.medium.inertias[0] * omega**2 / k**2 for layer, k in zip(own, wave, strict=True)]
    for layer, k, D in zip(own[1:-1], wave[1:-1], stiff[1:-1], strict=True):
        c, s = np.cos(k * layer.thickness), np.sin(k * layer.thickness)
        state = np.array([[c, s / (D * k)], [-D * k * s, c]]).transpose(2, 0, 1) @ state
    one, two = 1j * wave[0] * stiff[0], 1j * wave[-1] * stiff[-1]
    (a, b), (c, d) = state[:, 0].T, state[:, 1].T
    # 1 + R = (d − b two) T and one (1 − R) = (a two − c) T, as det = 1.
    T = 2 / (d - b * two + (a * two - c) / one)
    return T, (d - b * two) * T - 1


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "stack.toml"
    path.write_text(CASE)
    return path


def test_it_is_what_a_transfer_matrix_gives(path, tmp_path):
    """T, R to 1e-9, R + T = 1 to 1e-10, in JSON, in the files, at the frequencies asked for."""
    words = ("--band", "2e5", "9e5", "--points", "60")
    result = call("transmission", path, *words, "--json", "-o", tmp_path / "out")
    assert result.exit_code == 0
    answer = json.loads(result.stdout)
    assert json.loads((tmp_path / "out" / "transmission.json").read_text()) == answer
    assert (tmp_path / "out" / "transmission.png").stat().st_size > 10_000
    columns = np.genfromtxt(tmp_path / "out" / "transmission.csv", delimiter=",", names=True)
    assert set(answer["sectors"]) == {"longitudinal", "transverse2", "transverse3"}
    frequency = np.linspace(2e5, 9e5, 60)
    layers = load_layers(path).layers
    for sector, found in answer["sectors"].items():
        assert np.abs(np.array(found["frequency"]) / frequency - 1).max() <= 1e-14
        T, R = (np.array(found[name]) @ [1, 1j] for name in "TR")
        for one, two in zip((T, R), transfer(layers, sector, 2 * np.pi * frequency), strict=True):
            assert np.abs(one - two).max() <= 1e-9
        energy = np.array(found["transmitted"]) + np.array(found["reflected"])
        assert np.abs(energy - 1).max() <= 1e-10
        assert np.abs(columns[f"{sector}_T_dB"] - 20 * np.log10(np.abs(T))).max() <= 1e-9


def test_losses_take_energy_and_a_graded_layer_has_no_answer_at_its_asymptote(path, tmp_path):
    """Each is said, and numbers that are none are null."""
    lossy = CASE.replace(
        "G_n_a = 10.0", "G_n_a = 10.0, quality_factor = 20.0, quality_band = [1e5, 1e6]"
    )
    path.write_text(lossy)
    found = json.loads(call("transmission", path, "--points", "40", "--json").stdout)
    own = found["sectors"]["longitudinal"]
    energy = np.array(own["transmitted"][:30]) + np.array(own["reflected"][:30])
    assert (energy < 1).all()
    path.write_text(CASE.replace("G_n_a = 10.0", "G_n_a = [10.0, 14.0]"))
    found = json.loads(call("transmission", path, "--points", "40", "--json").stdout)
    assert None in found["sectors"]["longitudinal"]["transmitted"]
    assert any("asymptote" in note for note in found["notes"])


def test_a_band_of_the_case_is_told_and_judged(path):
    """Its highest and lowest level, by the transfer matrix; a limit between them is missed."""
    bands = "analysis.bands=[{from=3e5,to=5e5,at_most=0.0},{from=3e5,to=5e5,at_least=-1.0}]"
    found = json.loads(call("transmission", path, "--set", bands, "--json").stdout)
    omega = 2 * np.pi * np.linspace(3e5, 5e5, 801)
    level = 20 * np.log10(np.abs(transfer(load_layers(path).layers, "longitudinal", omega)[0]))
    assert level.min() < -1
    for band, kept in zip(found["bands"], (True, False), strict=True):
        # Looked at more closely than every 250 Hz.
        assert band["highest"] == pytest.approx(level.max(), abs=1e-5)
        assert band["lowest"] == pytest.approx(level.min(), abs=1e-5)
        assert band["kept"] == kept


def test_a_band_says_its_unit_and_one_far_too_low_is_told(path):
    """600kHz is 6e5; 600 to 1000 is taken as Hz, and a note says what to write for kHz."""
    words = ("--points", "3", "--json")
    one, two, low = (
        json.loads(call("transmission", path, "--band", *band, *words).stdout)
        for band in (("600kHz", "0.9 MHz"), ("6e5", "900000"), ("600", "1000"))
    )
    assert one == two
    assert not any("kHz was meant" in note for note in one["notes"])
    assert "--band 600kHz 1000kHz" in low["notes"][0]


def test_names_of_gaps_far_off_what_is_shown_are_not_drawn(tmp_path):
    """At 1 to 2 Hz their places are half a million widths of the picture away."""
    done = call("transmission", "slab", "--band", "1", "2", "--points", "3", "--out", tmp_path)
    assert done.exit_code == 0, done.output
    assert (tmp_path / "transmission.png").exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--band", "9e5", "2e5"), "--band 900000 200000: must be two frequencies in Hz"),
        (("--set", "layers=[{thickness=1e-3}]", "--set", "bar.left='free'", "--set",
          "bar.right='free'"), "there are none to be passed"),
        (("--set", "layers.0.repeat=-1"), "repeat = -1: must be greater than 0"),
    ],
)  # fmt: skip
def test_bad_input_gives_2_and_one_line(path, words, told):
    result = call("transmission", path, *words)
    assert result.exit_code == 2
    assert told in result.stderr
    assert len(result.stderr.splitlines()) == 1
