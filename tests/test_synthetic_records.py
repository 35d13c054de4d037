"""Synthetic records against quadrature, a chain's own equations, and the simulator."""

from __future__ import annotations

import numpy as np
import pytest
from chains import Beam, Diatomic, MassInMass
from media import MEDIUM
from scipy.integrate import quad

from wavesim.material.granular_equations import ROTATION
from wavesim.records.record import RecordError
from wavesim.records.relations import Given, OfMedium
from wavesim.records.synthetic import Pulse, Spoil, driven, positions, synthesize

CHAIN = MassInMass(0.01, 1e6, 0.01, 2e5, 0.005)
PAIR = Diatomic(0.01, 1e6, 0.01, 0.005)


@pytest.mark.parametrize("decay", [0.0, 200.0])
@pytest.mark.parametrize("omega", [1e-3, 300.0, 2e4])
def test_a_driven_oscillator_against_quadrature(omega, decay):
    # Law: q = ∫ e^{−γ(t−τ)} sin ω(t−τ)/ω s(τ) dτ, during the pulse and after. Tolerance: of quad,
    # measured 5e-12 at most.
    f, t0 = 1e3, 2e-3

    def pulse(tau):
        u = (np.pi * f * (tau - t0)) ** 2
        return (1 - 2 * u) * np.exp(-u)

    for t in (1e-3, 2.2e-3, 6e-3):
        expected = quad(
            lambda tau, t=t: np.exp(-decay * (t - tau)) * np.sin(omega * (t - tau)) * pulse(tau),
            0, min(t, 4.5e-3), limit=400, epsabs=1e-16, epsrel=1e-12,
        )[0] / omega  # fmt: skip
        found = driven(np.array([omega - 1j * decay]), np.array([t]), f, t0)[0, 0]
        assert found == pytest.approx(expected, rel=1e-10)


def test_what_decays_without_a_frequency_is_the_limit_of_low_ones():
    t = np.array([1e-3, 2.2e-3, 6e-3])
    still, slow = driven(np.array([-200j, 0.1 - 200j]), t, 1e3, 2e-3).T
    assert still == pytest.approx(slow, rel=1e-6)


def test_a_free_mass_follows_the_pulse_twice_integrated():
    # q̈ = s: second difference of q against s, h = 1e-7 s; measured 4e-7 of the peak.
    h = 1e-7
    t = 1.7e-3 + h * np.arange(-1, 2)
    q = driven(np.zeros(1), t, 1e3, 2e-3)[:, 0]
    u = (np.pi * 1e3 * (t[1] - 2e-3)) ** 2
    assert (q[0] - 2 * q[1] + q[2]) / h**2 == pytest.approx((1 - 2 * u) * np.exp(-u), abs=1e-5)


@pytest.mark.parametrize("kind", [CHAIN, PAIR])
def test_a_chain_against_its_own_equations_site_by_site(kind):
    """Modes of the 2N × 2N stiffness matrix, N = 31, not Bloch waves, drive the same record.

    Law: m ü = −K u + m s(t) on site 5; tolerance 1e-11 of the peak. Measured 2e-14.
    """
    n, outer = 31, np.arange(31)
    K = np.zeros((2 * n, 2 * n))

    def spring(i, j, k):
        K[[i, j], [i, j]] += k
        K[[i, j], [j, i]] -= k

    for i in outer:
        if isinstance(kind, MassInMass):
            spring(i, (i + 1) % n, kind.spring)
            spring(i, n + i, kind.inner_spring)
            mass = np.r_[np.full(n, kind.mass), np.full(n, kind.inner_mass)]
        else:
            spring(i, n + i, kind.spring)
            spring(n + i, (i + 1) % n, kind.spring)
            mass = np.r_[np.full(n, kind.mass), np.full(n, kind.other_mass)]
    root = np.sqrt(mass)
    squares, modes = np.linalg.eigh(K / root[:, None] / root)
    omega = np.sqrt(np.maximum(squares, 0))
    omega[omega < 1e-3] = 0.0
    t = np.linspace(0, 0.02, 200)
    q = driven(omega, t, 1500.0, 2e-3)
    expected = (q * modes[5]) @ modes[:n].T
    made = synthesize(
        kind, t, positions(n, 0.01), Pulse(1500.0, 0.05, 2e-3), n * 0.01, ring=True, lattice=True
    )
    # A unit force per mass on one site is a line source of strength a.
    found = made.values[0] * 0.01
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()


def test_waves_of_a_medium_against_the_simulator():
    """The simulated φ₁ at four nodes, from a Gaussian source, is that of its grid's relation.

    Tolerance: the source's Gaussian and the stepper's rounding, 1e-9 of the peak; measured 2e-13.
    """
    import wavesim as ws

    bar = ws.Bar(cells=512, spacing=1.25e-4)
    width, at = 5e-4, 256 * 1.25e-4
    source = ws.Ricker("phi1", position=at, peak_frequency=6e5, width=width)
    field = ws.simulate(MEDIUM, bar, [source], duration=1.2e-5, samples=61)
    nodes = np.array([256, 270, 300, 400])
    relation = OfMedium(MEDIUM, ROTATION.blocks[0], bar)
    made = synthesize(
        relation, field.t, bar.nodes[nodes], Pulse(6e5, at, source.peak_time, width=width),
        bar.length, k_max=np.pi / bar.spacing * 0.999,
    )  # fmt: skip
    medium = MEDIUM
    force = float(medium.density * medium.beta)
    found, expected = made.values[0] / force, field["phi1"][:, nodes]
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


def test_spoiling_is_what_it_says():
    t, x = np.linspace(0, 0.02, 400), positions(41, 0.01)
    pulse, length = Pulse(1500.0, 0.2), 0.41
    clean = synthesize(CHAIN, t, x, pulse, length)
    assert np.array_equal(clean.values[0], clean.answer["clean"])
    peak = np.abs(clean.values).max()
    noisy = synthesize(CHAIN, t, x, pulse, length, spoil=Spoil(noise=0.05, seed=3))
    # 16,400 samples: the standard deviation is known to 0.6 %.
    assert np.std(noisy.values - clean.values) == pytest.approx(0.05 * peak, rel=0.03)
    again = synthesize(CHAIN, t, x, pulse, length, spoil=Spoil(noise=0.05, seed=3))
    assert np.array_equal(noisy.values, again.values)
    coarse = synthesize(CHAIN, t, x, pulse, length, spoil=Spoil(bits=6))
    step = 2 * peak / 2**6
    assert np.abs(coarse.values - clean.values).max() == pytest.approx(step / 2, rel=0.02)
    assert len(np.unique(np.round(coarse.values / step, 6))) <= 2**6 + 1
    dead = synthesize(CHAIN, t, x, pulse, length, spoil=Spoil(dead=3, seed=1))
    assert len(dead.x) == 38
    assert not np.isin(x[dead.answer["dead"]], dead.x).any()
    jittered = synthesize(CHAIN, t, x, pulse, length, spoil=Spoil(jitter=2e-6, seed=5))
    # To first order the error is u̇ times the jitter.
    rate = np.gradient(clean.values[0], t, axis=0)
    ratio = np.std(jittered.values - clean.values) / (2e-6 * np.sqrt(np.mean(rate**2)))
    assert ratio == pytest.approx(1, abs=0.15)


def test_a_relation_of_ones_own_decays_as_it_says():
    def lossy(k):
        return np.stack([200 * k, 9e3 + 0 * k - 1j * (50 + 0.1 * k)], axis=1)

    from wavesim.readings.dispersion.frequency_at_wavenumber import in_time

    t, x = np.linspace(0, 0.04, 1200), positions(64, 0.02)
    made = synthesize(lossy, t, x, Pulse(1500.0, 0.64), 1.28, ring=True)
    points = in_time(made, k_max=120.0)
    points = points.take(points.valid)
    flat = np.abs(points.omega - 9e3) < 1
    assert flat.sum() >= 20
    assert np.abs(points.decay[flat] / (50 + 0.1 * points.k[flat]) - 1).max() < 1e-8
    assert np.abs(points.omega[~flat] / (200 * points.k[~flat]) - 1).max() < 1e-9


def test_what_cannot_be_made_is_said():
    t, x = np.linspace(0, 0.02, 400), positions(41, 0.01)
    with pytest.raises(RecordError, match=r"length = 0\.001 m: holds 0 wavenumbers"):
        synthesize(CHAIN, t, x, Pulse(1500.0), 0.001)
    with pytest.raises(RecordError, match="holds inf wavenumbers"):
        synthesize(CHAIN, t, 1e300 * x, Pulse(1500.0), 1e302, 1e9)
    with pytest.raises(RecordError, match="noise = -1"):
        Spoil(noise=-1)
    with pytest.raises(ValueError, match="no k"):
        Given(lambda k: k).wavenumber(np.ones(1, complex))


@pytest.mark.parametrize("relation", [CHAIN, PAIR, Beam(5.0)])
def test_k_of_omega_is_the_inverse_of_omega_of_k(relation):
    k = np.linspace(1.0, 310.0, 60)
    omega = relation.omega(k)
    for branch in omega.T:
        # Just above the real axis, where the outgoing root is meant; |k| as the sign is a choice.
        back = relation.wavenumber(branch * (1 + 1e-13j))
        assert np.abs(np.abs(back.real) / k - 1).max() < 1e-6
        assert np.abs(relation.omega(np.abs(back.real)) / omega - 1).max() < 1e-8
