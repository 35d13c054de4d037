"""Synthetic signals: against the modal sum of a finite bar, reciprocity, drives at ends."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest
from collocated import coefficients

from wavesim import layered as layeredwave
from wavesim import planewave
from wavesim.layered.graded_layer import at_most
from wavesim.material.damping import Damping
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium
from wavesim.sources import Ricker

ONE = Medium(anisotropy=0.25, closure="consistent", G_n_g=0.0)
TWO = Medium(anisotropy=0.6, closure="consistent", density=2300.0, G_n_a=8.0, G_n_g=0.0)
BAR = ONE.time_scale
LENGTH = 2e-2
TIMES = np.linspace(0, 4e-5, 41)
NAMES = ["phi1", "B11", "B22", "B33"]


@dataclass(frozen=True)
class Start:
    """An initial value of a field."""

    field: str
    position: float
    width: float
    amplitude: float = 1.0
    drive: str = "initial"

    def spectrum(self, omega):
        return -1j * np.asarray(omega) * self.amplitude


@dataclass(frozen=True)
class Driven(Ricker):
    drive: str = "moment"


def modes(medium, count=500):
    """k = nπ/L and the eigenpairs of φ = Σ sin, B = Σ cos of a bar fixed at both ends, in SI."""
    Ip, Ib, pp, pB, Bp, BB, G = coefficients(medium, "phi1", NAMES[1:])
    k = np.arange(count) * np.pi / LENGTH
    K = np.zeros((count, 4, 4))
    K[:, 0, 0] = k**2 * pp
    K[:, 0, 1:], K[:, 1:, 0] = -k[:, None] * pB, -k[:, None] * Bp
    K[:, 1:, 1:] = BB + k[:, None, None] ** 2 * G
    root = np.sqrt(np.array([Ip, Ib, Ib, Ib]))
    squares, V = np.linalg.eigh(K / np.outer(root, root))
    return k, root, np.sqrt(np.maximum(squares, 0)), V


def modal_sum(medium, source, x):
    """Fields at x for a Ricker pulse or an initial value: sums over modes, pulses by quadrature."""
    k, root, omega, V = modes(medium)
    i = NAMES.index(source.field)
    shape = np.sin if i == 0 else np.cos
    weight = np.where(k == 0, 1, 2) / LENGTH * np.exp(-((k * source.width) ** 2) / 2)
    force = np.zeros((len(k), 4))
    force[:, i] = weight * shape(k * source.position)
    starting = isinstance(source, Start)
    if starting:
        force *= source.amplitude * np.sqrt(2 * np.pi) * source.width * root**2
    along = np.einsum("nij,ni->nj", V, force / root)
    nodes, weights = np.polynomial.legendre.leggauss(300)
    found = {name: [] for name in NAMES}
    for t in TIMES:
        if starting:
            # q̈ + dq̇ + ω²q = 0 from 1 at rest.
            drag = (medium.damping.mass + medium.damping.stiffness * omega**2) / 2
            rate = np.sqrt(omega**2 - drag**2 + 1e-9 * drag**2 + 0j)
            up, down = np.exp((1j * rate - drag) * t), np.exp((-1j * rate - drag) * t)
            grown = ((up + down) / 2 + drag * (up - down) / 2j / np.where(rate == 0, 1, rate)).real
        else:
            end = min(t, source.end)
            tau = end * (nodes + 1) / 2
            pulse = end / 2 * weights * source.signal(tau)
            lag = t - tau
            grown = (lag * np.sinc(omega[..., None] * lag / np.pi)) @ pulse
        y = np.einsum("nij,nj->ni", V, along * grown) / root
        for q, name in enumerate(NAMES):
            found[name].append((np.sin if q == 0 else np.cos)(k * x) @ y[:, q])
    return {name: np.array(values) for name, values in found.items()}


def compare(found, known, tolerance):
    for name, values in known.items():
        assert np.abs(found[name] - values).max() <= tolerance * np.abs(values).max()


@pytest.mark.parametrize("gradient", [0.0, 0.5])
@pytest.mark.parametrize("field", ["phi1", "B22"])
def test_signals_are_the_modal_sum_of_a_finite_bar(gradient, field):
    """Fixed at both ends, inside the source and beyond it; B22 drives the in-plane block as well.

    Tolerance 1e-6 as stated for signals; measured 5e-9.
    """
    medium = dataclasses.replace(ONE, G_n_g=gradient)
    layers = Layers((Layer(0.0, 0.7 * LENGTH, medium), Layer(0.7 * LENGTH, LENGTH, medium)))
    source = Ricker(field, 8.1e-3, 5e5, amplitude=2.0, width=2.5e-4)
    at = {"near": 8.3e-3, "far": 1.71e-2}
    found = layeredwave.signals(layers, "fixed", "fixed", [source], at, TIMES)
    for name, x in at.items():
        compare(found[name], modal_sum(medium, source, x), 1e-6)


@pytest.mark.parametrize(
    ("field", "law"),
    [("B11", Damping()), ("phi1", Damping(mass=2e5)), ("phi1", Damping(stiffness=2e-8))],
    ids=["lossless", "mass", "viscous"],
)
def test_an_initial_value_is_let_go_from_rest(field, law):
    """cos ωt of each mode from t = 0, where the signal jumps; with losses a damped one, whose
    viscous stress knows no strain before. Tolerance 1e-6, measured 5e-9; 3e-5 with losses,
    measured 1.2e-5, at t = 0 alone."""
    medium = dataclasses.replace(ONE, damping=law)
    layers = Layers((Layer(0.0, LENGTH, medium),))
    source = Start(field, 8.1e-3, 5e-4, amplitude=3.0)
    at = {"near": 8.3e-3, "far": 1.31e-2}
    found = layeredwave.signals(layers, "fixed", "fixed", [source], at, TIMES)
    for name, x in at.items():
        compare(found[name], modal_sum(medium, source, x), 3e-5 if law else 1e-6)


@pytest.mark.parametrize("source", [Ricker("phi1", 8.1e-3, 5e5), Start("phi1", 8.1e-3, 5e-4)])
def test_a_signal_at_one_time_is_the_same_whatever_others_are_asked_for(source):
    """Even times go by FFT, any others by the sum itself.

    Tolerance 1e-9, what the transform leaves of the largest value; measured 9e-11.
    """
    layers = Layers((Layer(0.0, LENGTH, ONE),))
    some = np.sort(np.concatenate([TIMES[::7], TIMES[3::9], [TIMES[-1]]]))
    even, odd = (
        layeredwave.signals(layers, "fixed", "free", [source], {"r": 1.31e-2}, t)["r"]["phi1"]
        for t in (TIMES, some)
    )
    there = even[np.searchsorted(TIMES, some)]
    assert np.abs(odd - there).max() <= 1e-9 * np.abs(even).max()


@pytest.mark.parametrize("gradient", [0.0, 0.5])
@pytest.mark.parametrize("ends", [("free", "absorbing"), ("periodic", "periodic")])
def test_source_and_receiver_change_places(gradient, ends):
    """φ at x₂ of a moment at x₁ = φ at x₁ of one at x₂, and likewise for B11 and Π with widths.

    Over a graded, damped, layered bar. Tolerance 1e-10 of the spectrum, that of graded layers;
    measured 4e-15.
    """
    loss = Damping(mass=0.03 / BAR, stiffness=0.02 * BAR)
    one, two = (dataclasses.replace(m, G_n_g=gradient, damping=loss) for m in (ONE, TWO))
    layers = Layers((Layer(0.0, 2e-3, one), Layer(2e-3, 5e-3, one, two), Layer(5e-3, 7e-3, two)))
    omega = np.array([0.4, 0.95, 1.4]) / BAR + 0.01j / BAR
    here, there = 1.3e-3, 4.2e-3
    for field in ("phi1", "B11") if gradient else ("phi1",):
        values = [
            layeredwave.field_spectra(
                layers, *ends, [Ricker(field, a, 6e5)], {"r": b}, omega, gradient > 0
            )["r"][field]
            for a, b in ((here, there), (there, here))
        ]
        assert np.abs(values[0] / values[1] - 1).max() <= 1e-10


def test_drives_at_ends_by_impedance():
    """A half-infinite bar: moment g at a free left end gives φ by its impedance Z.

    With n = −1, −σ = g: f = g = Zv, φ = i g e^{ikx}/(ωZ); a prescribed φ = g gives g e^{ikx}.
    Tolerance 1e-12, rounding; measured 1.3e-13.
    """
    layers = Layers((Layer(0.0, 3e-3, ONE), Layer(3e-3, 5e-3, ONE)))
    omega = np.array([0.4, 0.95, 1.4]) / BAR + 0.01j / BAR
    k = planewave.wavenumber(ONE, "longitudinal", omega)
    Z = ONE.density * ONE.beta * omega / k
    wave = np.exp(1j * k * 4e-3)
    for end, drive, known in (("free", "moment", 1j / (omega * Z)), ("fixed", "rotation", 1.0)):
        source = Driven("phi1", 0.0, 5e5, drive=drive)
        found = layeredwave.field_spectra(
            layers, end, "absorbing", [source], {"r": 4e-3}, omega, False
        )["r"]["phi1"]
        expected = known * wave * source.spectrum(omega)
        assert np.abs(found / expected - 1).max() <= 1e-12
    with pytest.raises(ValueError, match="needs a free end, not 'fixed'"):
        layeredwave.signals(layers, "fixed", "free", [Driven("phi1", 0.0, 5e5)], {"r": 1e-3}, TIMES)


def test_what_has_no_answer_is_refused():
    layers = Layers((Layer(0.0, LENGTH, ONE),))
    source = Ricker("B11", 8e-3, 5e5)
    with pytest.raises(ValueError, match="both ends must be periodic"):
        layeredwave.signals(layers, "periodic", "free", [source], {"r": 0.0}, TIMES)
    with pytest.raises(ValueError, match="give the source a width"):
        layeredwave.signals(layers, "fixed", "free", [source], {"r": 8e-3}, TIMES)
    with pytest.raises(ValueError, match="receiver 'r' at 1 m"):
        layeredwave.signals(layers, "fixed", "free", [source], {"r": 1.0}, TIMES)
    graded = Layers((Layer(0.0, LENGTH, ONE, TWO),))
    with at_most(1e3), pytest.raises(ValueError, match=r"0 to 0\.02 m takes too many steps"):
        layeredwave.signals(graded, "fixed", "free", [source], {"r": 0.0}, TIMES)
    inside = Driven("phi1", 8e-3, 5e5)
    with pytest.raises(ValueError, match=r"acts at an end; give it position = 0 or 0\.02 m"):
        layeredwave.signals(layers, "free", "free", [inside], {"r": 1e-3}, TIMES)
    for ends, wide in (("absorbing", 1.4e-3), ("periodic", 1.7e-3)):
        over = Ricker("phi1", 8e-3, 5e5, width=wide)
        with pytest.raises(ValueError, match=r"stands out over .* take at most 0\.001"):
            layeredwave.signals(layers, ends, ends, [over], {"r": 1e-3}, TIMES)
    lossy = Layer(9e-3, LENGTH, dataclasses.replace(ONE, damping=Damping(stiffness=1e-9)))
    two = Layers((Layer(0.0, 9e-3, ONE), lossy))
    with pytest.raises(ValueError, match="place it within one layer"):
        layeredwave.signals(two, "free", "free", [Start("phi1", 8e-3, 5e-4)], {"r": 1e-3}, TIMES)
