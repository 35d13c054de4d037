"""Energy against work on bars with layers, ends and losses, whatever drives them."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

import wavesim as ws
from wavesim.material.scaling import scales
from wavesim.timedomain.integrate import equation_of
from wavesim.timedomain.sparse_matrix import flat, sparse_matrix, unflat

CELL = 1.25e-4
SOFT = ws.Medium(anisotropy=0.3, closure="consistent")
STIFF = ws.Medium(closure="consistent", G_n_a=9.0, G_n_r=7.0, density=2000.0, particle_radius=6e-4)
LOSSY = dataclasses.replace(ws.constant_quality(30.0, (2e5, 2e6)), mass=1e5, stiffness=2e-9)


def three(damping=None, last=3e-3):
    """Uniform, graded and uniform, each stretch with cells of its own size."""
    soft, middle, stiff = SOFT, dataclasses.replace(SOFT, anisotropy=0.6), STIFF
    if damping:
        soft, middle = (dataclasses.replace(m, damping=damping) for m in (soft, middle))
    return ws.Layers(
        (
            ws.Layer(0.0, 2.5e-3, soft),
            ws.Layer(2.5e-3, 5.25e-3, soft, middle),
            ws.Layer(5.25e-3, 5.25e-3 + last, stiff),
        )
    )


def run(layers, ends, sources, duration, frames, solver="auto"):
    absorber = 8e-3 if "absorbing" in ends else 0.0
    bar = ws.layered_bar(layers, CELL, 8, *ends, absorber)
    return ws.simulate(layers, bar, sources, duration, frames, solver)


F = 4e5
SAMPLED = 1e-6 + np.arange(62) / (8 * F)
BURST = ws.ToneBurst("phi1", 0.0, F, start=2e-6)
NOISE = 0.01 * np.random.default_rng(6129).normal(size=62) * np.hanning(62)
RECORD = {"times": SAMPLED, "values": BURST.signal(SAMPLED) + NOISE}
# Signals whose derivatives jump within a step: a hann burst, and a record of eight samples to a
# period with 1 % noise.
HANN = functools.partial(ws.ToneBurst, frequency=F)
NOISY = functools.partial(ws.Recorded, **RECORD)


@pytest.mark.parametrize("solver", ["propagator", "chebyshev"])
def test_energy_is_the_work_whatever_the_signal(solver):
    """Law: no losses, energy is the work of the sources, at the step that is taken by default: the
    work is that of what the step applies. Prescribed rotation, body moment and surface moment at
    once, by signals with kinks; to 1e-11 of the largest energy at all times, measured 1e-13."""
    layers = three()
    sources = [
        HANN(field="phi1", position=0.0, amplitude=1e-3, drive="rotation"),
        NOISY(field="phi1", position=0.0, amplitude=5e-4, drive="rotation"),
        NOISY(field="B11", position=1.3e-3, amplitude=1e-3),
        HANN(field="B11", position=2.9e-3, amplitude=1e-3),
        HANN(field="phi1", position=layers.length, drive="moment"),
        NOISY(field="phi1", position=layers.length, drive="moment", amplitude=-0.7),
    ]
    energy = run(layers, ("fixed", "free"), sources, 2.4e-5, 193, solver).energy
    largest = energy.total.max()
    assert np.abs(energy.total - energy.work).max() <= 1e-11 * largest
    assert energy.work.max() > 0.5 * largest


def test_what_is_absorbed_never_comes_back():
    """Law: the work less the stored energy is what absorbers have taken: it never falls, by more
    than 1e-9 of the largest energy, whatever the signal. (Of losses, below.)"""
    sources = [
        HANN(field="phi1", position=0.0, amplitude=1e-3, drive="rotation"),
        HANN(field="B11", position=1.3e-3, amplitude=1e-3),
    ]
    layers = three(last=11e-3)  # the absorber is a part of the bar
    energy = run(layers, ("fixed", "absorbing"), sources, 2.4e-5, 193).energy
    lost, largest = energy.work - energy.total, energy.total.max()
    assert np.diff(lost).min() >= -1e-9 * largest
    assert lost[-1] > 5e-3 * largest


@pytest.mark.parametrize("damping", [None, LOSSY], ids=["lossless", "lossy"])
def test_work_is_what_the_sources_do_on_the_field_that_is_recorded(damping):
    """Law: W = Σ ∫ s(t) u̇(x_s, t) dt = Σ s u − ∫ ṡ u dt, by quintic splines through the signals at
    the sources, frames 20 ns apart; to 1e-7 of the largest work, measured 1e-9. What dampers have
    taken of it, the work less the stored energy, never falls (1e-9 of the largest energy).

    φ = 0 at a fixed end, though a source's stencil reaches it, and what holds it does no work."""
    layers = three(damping)
    beside_end = ws.Ricker("phi1", 1.1 * CELL, 7e5, amplitude=8.0)
    sources = [
        beside_end,
        ws.Ricker("phi1", 1.3e-3, 6e5, amplitude=8.0),
        ws.Ricker("B11", 4.1e-3, 5e5, amplitude=1e-3),
        ws.Ricker("phi1", layers.length, 5e5, amplitude=6.0, drive="moment"),
    ]
    field = run(layers, ("fixed", "free"), sources, 8e-6, 401)
    assert not np.any(field["phi1"][:, 0])
    t, work = field.t, 0.0
    for source in sources:
        u, small = field.at(source.position, source.field), 1e-5 / source.peak_frequency
        rate = (source.signal(t + small) - source.signal(t - small)) / (2 * small)
        done = source.signal(t) * u - make_interp_spline(t, rate * u, 5).antiderivative()(t)
        assert np.abs(done).max() > 0.05 * np.abs(field.energy.work).max() or source is beside_end
        work = work + done
    largest = np.abs(field.energy.work).max()
    assert np.abs(field.energy.work - work).max() <= 1e-7 * largest
    if damping:
        lost = field.energy.work - field.energy.total
        assert np.diff(lost).min() >= -1e-9 * field.energy.total.max()
        assert lost[-1] > 5e-3 * field.energy.total.max()


def test_an_initial_field_keeps_its_energy():
    """Law: an initial field on a lossless bar rings on with the energy that it has at t = 0; to
    1e-11 of it, measured 1e-13. Whose energy that is, is held by test_simulate_bars."""
    start = ws.InitialField("phi1", 3e-3, 3e-4, 1e-3)
    energy = run(three(), ("free", "fixed"), [start], 6e-6, 60).energy
    assert energy.total[0] > 0
    assert np.ptp(energy.total) <= 1e-11 * energy.total[0]
    assert np.ptp(energy.kinetic) > 0.1 * energy.total[0]


def power_lost(group, y):
    """What dampers, solids and absorbing ends take of a state, from its parts; losses are positive:

    β_d ė·C ė + Σ_l Y_l ω_l (e − ζ_l)·C (e − ζ_l) + d κ·σ̂ + m (α + d) v² + m α d φ v.
    """
    law, H = group.losses, group.half_norm

    def form(e, other, factor):
        C = group.c.stiffness[:, :, 0]
        return np.einsum("in,ijn,jn->", factor * H * e, C, other)

    e = np.concatenate([y.kappa, y.B])[:, 0]
    kappa_rate = np.asarray(group.D(y.phi_rate)) - law.absorb_half * y.kappa
    e_rate = np.concatenate([kappa_rate, y.B_rate])[:, 0]
    lost = form(e_rate, e_rate, law.stiffness)
    e_hat = e + law.stiffness * e_rate
    for rate, strength, of_kappa, of_B in zip(
        law.rates, law.strengths, y.zeta_kappa, y.zeta_B, strict=True
    ):
        lag = e - np.concatenate([of_kappa, of_B])[:, 0]
        lost += form(lag, lag, strength * rate)
        e_hat = e_hat - strength * (e - lag)
    sigma = np.einsum("jn,jn->n", group.c.stiffness[0, :, 0], e_hat)
    lost += np.sum(H * law.absorb_half * y.kappa[0, 0] * sigma)
    of_phi, of_B = group.mass
    free = group.free[0] != 0
    pull = law.drag_node * y.phi_rate[0, 0] + law.spring_node * y.phi[0, 0]
    lost += np.sum(of_phi[0] * free * pull * y.phi_rate[0, 0])
    return lost + np.sum(of_B * law.drag_half * y.B_rate[:, 0] ** 2)


def test_what_is_dissipated_is_the_power_lost_over_time():
    """Law: work − stored energy = ∫ power lost dt. The left side is the run's, the right a Gauss
    sum over states by DOP853 on the sparse A, every loss and an absorbing end among them. To 1e-8
    of what is dissipated; measured 3e-12."""
    medium = dataclasses.replace(SOFT, damping=LOSSY)
    bar = ws.Bar(96, CELL, 8, "free", "absorbing", 4e-3)
    source = ws.Ricker("phi1", 0.0041, 6e5)
    duration = 6e-6
    field = ws.simulate(medium, bar, [source], duration, samples=9)
    equation, start = equation_of(field.simulation)
    A, (group,) = sparse_matrix(equation.operator), equation.operator.groups
    unit = scales(medium)
    push = flat(equation.sources.add(start.y, np.ones(1)))
    end = duration / float(unit.time)

    def rate(t, y):
        return A @ y + push * source.signal(t * float(unit.time))

    x, weights = np.polynomial.legendre.leggauss(160)
    times = end * (1 + x) / 2
    solved = solve_ivp(
        rate, (0, end), flat(start.y), "DOP853", times, rtol=1e-11, atol=1e-16 * abs(push).max()
    )
    powers = [power_lost(group, unflat(y, start.y)[0]) for y in solved.y.T]
    lost = float(unit.energy) * end / 2 * np.dot(weights, powers)
    assert field.energy.dissipated[-1] == pytest.approx(lost, rel=1e-8)
    assert lost > 0.05 * field.energy.work[-1]
