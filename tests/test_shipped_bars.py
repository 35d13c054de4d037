"""Shipped cases of bars with layers and ends, run whole: their files against independent routes."""

import h5py
import numpy as np
import pytest
from runs import SHIPPED, call
from scipy.interpolate import BarycentricInterpolator

from wavesim.case.load import load
from wavesim.figures.drawing import drawings
from wavesim.material.family import known_field
from wavesim.material.granular_equations import ROTATION
from wavesim.verdict.judgement import measure

NAMES = [
    "band_stop",
    "bender_element",
    "bragg_mirror",
    "free_bar",
    "lossy",
    "p_wave_filter",
    "pulse_test",
    "rainbow",
    "slab",
    "stack",
]
LONGITUDINAL = ("phi1", "B11", "B22", "B33")
# Figures beside those of every bar; cases that are not here are of a kind with one that is.
FIGURES = {
    "bender_element": {"arrivals_u2"},
    "bragg_mirror": {"transmission_longitudinal", "bloch_longitudinal"},
    "free_bar": {"eigenfrequencies_longitudinal", "eigenfrequencies_transverse2"},
    "pulse_test": {"arrivals_phi1", "velocities_phi1", "loss_phi1"},
    "slab": {"transmission_longitudinal"},
}


@pytest.fixture(scope="module", params=NAMES)
def done(request, shipped):
    """Run of a case."""
    return shipped(request.param)


def test_every_bar_that_is_not_endless_is_listed():
    assert [name for name, path in SHIPPED.items() if not load(path).simulation.endless] == NAMES


def test_signals_are_judged_and_figures_offered(done):
    """Every receiver's signals are among the checks, and so is the energy where nothing absorbs."""
    names = [check["name"] for check in done.summary["checks"]]
    for receiver in done.field.receivers:
        assert any(name.startswith(f"signal at {receiver}:") for name in names)
    absorbs = "absorbing" in (done.field.bar.left, done.field.bar.right)
    assert any("energy" in name for name in names) is not absorbs
    assert (done.folder / "overview.png").read_bytes()[1:4] == b"PNG"
    if done.case.stem in FIGURES:
        wanted = {"bar", "signals", "spacetime", "receivers", "energy"}
        offered = drawings(done.field, measure(done.loaded, done.field).shown)
        assert set(offered) >= wanted | FIGURES[done.case.stem]


def test_layout_of_the_result(done):
    """N + 1 nodes, N half-nodes; every field on t and on its own points; units throughout."""
    bar, names = done.field.bar, done.field.names
    with h5py.File(done.result, "r") as file:
        assert (file["x"].shape, file["x_half"].shape) == ((bar.cells + 1,), (bar.cells,))
        np.testing.assert_array_equal(file["x"][()], bar.nodes)
        np.testing.assert_allclose(
            file["x_half"][()], (file["x"][1:] + file["x"][:-1]) / 2, rtol=1e-12
        )
        assert set(file["fields"]) == set(names) == set(done.field.simulation.fields)
        for field in names:
            data = file[f"fields/{field}"]
            along = "x" if field in done.field.medium.family.macro else "x_half"
            assert data.dims[0][0] == file["t"]
            assert data.dims[1][0] == file[along]
            assert data.shape == (len(file["t"]), len(file[along]))
            assert data.attrs["units"] == known_field(field).unit
        for receiver in done.field.receivers:
            for field in names:
                for group in ("receivers", "exact"):
                    data = file[f"{group}/{receiver}/{field}"]
                    assert data.shape == file["t"].shape
                    assert data.attrs["units"] == known_field(field).unit
        for group in ("transmission", "pulse", "energy"):
            for data in file.get(group, {}).values():
                parts = data.values() if isinstance(data, h5py.Group) else [data]
                assert all("units" in part.attrs for part in parts)


def test_receivers_agree_with_the_exact_solver_and_with_the_stored_field(done):
    """Against the frequency domain 1e-4 of each field's peak, from the file itself; and the
    polynomial through the eight nearest points of the stored field, barycentric, to 1e-10."""
    with h5py.File(done.result, "r") as file:
        for receiver, position in done.field.receivers.items():
            for field in done.field.names:
                found, exact = (file[f"{g}/{receiver}/{field}"][()] for g in ("receivers", "exact"))
                peak = np.abs(exact).max()
                assert peak > 0
                assert np.abs(found - exact).max() <= 1e-4 * peak
                x = file["x" if field in done.field.medium.family.macro else "x_half"][()]
                near = np.sort(np.argsort(np.abs(x - position), kind="stable")[:8])
                values = file[f"fields/{field}"][:, near[0] : near[-1] + 1]
                through = BarycentricInterpolator(x[near], values.T)(position)
                assert np.abs(through - found).max() <= 1e-10 * peak


def test_energy_is_the_work_less_what_is_lost(done):
    """Kinetic + potential = work where nothing is lost, 1e-9 of the largest energy. Elsewhere the
    work less that, what dampers and absorbers have taken, only grows (1e-9 of the largest energy),
    and by the end is more than a tenth: this could fail."""
    with h5py.File(done.result, "r") as file:
        energy = {key: data[()] for key, data in file["energy"].items()}
    total, size = energy["kinetic"] + energy["potential"], energy["total"].max()
    np.testing.assert_allclose(energy["total"], total, rtol=1e-13)
    lost = energy["work"] - total
    if done.case.stem == "free_bar":
        assert np.abs(lost).max() <= 1e-9 * size
    else:
        assert np.diff(lost).min() >= -1e-9 * size
        assert lost[-1] > 0.1 * size


def stiffness(medium, s):
    """D(s) and k(s) of D φ″ = −m_φ s² φ, longitudinal, Γ → 0: the wave equations in SI with B taken
    out, D = C_φφ − C_φB (C_BB − m_B s²)⁻¹ C_Bφ; Im k > 0."""
    flux = medium.flux_form()
    at = [ROTATION.micro.index(name) for name in LONGITUDINAL[1:]]
    D = np.empty(len(s), complex)
    for row, w in enumerate(s):
        inner = flux.C_B_B[np.ix_(at, at)] - flux.m_B * w**2 * np.eye(3)
        D[row] = flux.C_phi_phi[0, 0] - flux.C_phi_B[0, at] @ np.linalg.solve(
            inner, flux.C_B_phi[at, 0]
        )
    k = np.sqrt(flux.m_phi * s**2 / D)
    return D, np.where(k.imag > 0, k, -k)


def test_transmission_of_the_slab_by_its_closed_form(shipped):
    """A slab of thickness d and Z₂ = D₂k₂ between half-spaces of Z₁, φ and Dφ′ continuous:

        T = 4 Z₁Z₂/N,   R = (Z₁² − Z₂²)(e^{−ik₂d} − e^{ik₂d})/N,
        N = (Z₁ + Z₂)² e^{−ik₂d} − (Z₁ − Z₂)² e^{ik₂d},

    at ω + iσ. The stored exact values to 1e-6 (slivers of buffer), the measured ones to 1e-3 where
    judged; in the gaps T falls below −40 dB."""
    slab = shipped("slab")
    outer, inner = (slab.field.layers.layers[n] for n in (0, 1))
    with h5py.File(slab.result, "r") as file:
        stored = {key: data[()] for key, data in file["transmission/longitudinal"].items()}
    s = stored["omega"] + 1j * stored["sigma"]
    (D1, k1), (D2, k2) = stiffness(outer.medium, s), stiffness(inner.medium, s)
    Z1, Z2 = D1 * k1, D2 * k2
    ahead, back = np.exp(1j * k2 * inner.thickness), np.exp(-1j * k2 * inner.thickness)
    whole = (Z1 + Z2) ** 2 * back - (Z1 - Z2) ** 2 * ahead
    exact = {"T": 4 * Z1 * Z2 / whole, "R": (Z1**2 - Z2**2) * (back - ahead) / whole}
    judged = stored["judged"].astype(bool)
    assert judged.sum() >= 50
    for name, value in exact.items():
        assert np.abs(stored[f"{name}_exact"] - value)[judged].max() <= 1e-6
        assert np.abs(stored[name] - value)[judged].max() <= 1e-3
    assert np.abs(exact["T"][judged]).min() < 1e-2
    assert np.abs(exact["T"][judged]).max() > 0.5


def test_pulse_test_is_in_the_summary(shipped):
    """The first wave of a medium goes no faster than c_∞ = √(C_φφ/ρβ); arrivals ascend with x."""
    run = shipped("pulse_test")
    (test,) = run.summary["pulse_tests"]
    assert (test["field"], test["sector"]) == ("phi1", "longitudinal")
    flux = (run.field.medium).flux_form()
    unrelaxed = run.field.medium.damping.unrelaxed
    fastest = np.sqrt(unrelaxed * flux.C_phi_phi[0, 0] / flux.m_phi)
    picks = [a for a in test["arrivals"] if a["convention"] == "threshold"]
    assert [a["receiver"] for a in picks] == list(run.field.receivers)
    times = [a["time_s"] for a in picks]
    assert (np.diff(times) > 0).all()
    for pick in picks:
        assert pick["time_s"] >= pick["position_m"] / fastest


@pytest.mark.parametrize("command", ["dispersion", "attenuation"])
def test_a_bar_with_ends_is_no_ring_to_the_laboratory(command, shipped):
    """ω(k) and k(ω) of a ring are not to be had from it: one line, and where its readings are."""
    file = shipped("pulse_test").result
    result = call(command, file)
    assert result.exit_code == 2
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"wavesim: {file}: is of a bar with layers or ends")
    assert "summary.json" in line


def test_a_run_says_what_its_slab_is_as_a_filter(shipped):
    """T and R at real ω, stored beside those at ω + iσ, by a transfer matrix in SI, to 1e-9."""
    from test_transmission_command import transfer

    done = shipped("slab")
    with h5py.File(done.folder / "result.h5") as file:
        group = file["transmission/longitudinal"]
        omega, T, R = (group[name][()] for name in ("omega", "T_real", "R_real"))
    layers = done.field.layers
    clear = np.abs(omega / 2 / np.pi - 7.37e5) > 1e4  # the slab's asymptote
    for found, exact in zip((T, R), transfer(layers, "longitudinal", omega), strict=True):
        assert np.abs(found - exact)[clear].max() <= 1e-9
