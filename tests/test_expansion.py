"""The Chebyshev series of exp(hA) with sources, and the balance of work and losses."""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.sparse
from jax.flatten_util import ravel_pytree
from realbars import CELL, EVERYTHING, SOFT, dense, fitted, lossy, three
from scipy.sparse.linalg import expm_multiply

from wavesim.grid.bar import Bar
from wavesim.material.damping import Damping
from wavesim.simulation.plan import Plan, plan
from wavesim.sources import InitialField, Recorded, Ricker, ToneBurst
from wavesim.timedomain import assembly, program
from wavesim.timedomain.barstep import expansion_coefficients
from wavesim.timedomain.expansion import Expansion
from wavesim.timedomain.integration import simulate, stream

PULSE = Ricker("phi1", 1.3e-3, 6e5)


# Its derivatives jump at its ends, 2 and 6 μs: there losses are taken within a step.
KINKED = ToneBurst("phi1", 1.3e-3, 7.5e5, 3, "hann", start=2e-6)


def settled(layers, ends, source=PULSE, **options):
    return plan(layers, fitted(layers, *ends), [source], 6e-6, **options)


def stepped(stepper, equation, h, motion, t):
    """A motion one step on."""
    begun = stepper.init(None, t, t + h, motion, equation)
    return stepper.step(None, t, t + h, motion, equation, begun, False)[0]


@pytest.mark.parametrize("closure", ["printed", "consistent"])
@pytest.mark.parametrize("damping", [None, EVERYTHING], ids=["lossless", "lossy"])
@pytest.mark.parametrize("ends", [("free", "fixed"), ("free", "absorbing")])
@pytest.mark.parametrize("source", [PULSE, KINKED], ids=["ricker", "hann"])
def test_a_step_is_the_matrix_exponential(closure, damping, ends, source, rng):
    """Law: y(t + h) = exp(hA) y + ∫ exp((h−τ)A) G s(t+τ) dτ, by Taylor sums and 40 Gauss nodes.

    From random states amid the pulse; to 1e-12 of the largest; measured 8e-14.
    """
    layers = three(closure, damping)
    made = settled(layers, ends, source, solver="chebyshev")
    equation, rest = assembly.equation_of(made)
    stepper = assembly.stepper_of(made, equation)
    assert isinstance(stepper, Expansion)
    A, unravel = dense(equation.generator)
    h, t = made.schedule.step, 3.1e-6 / float(made.medium.time_scale)
    y = np.where(np.abs(A).sum(axis=0) + np.abs(A).sum(axis=1) > 0, rng.normal(size=len(A)), 0.0)
    motion = rest._replace(y=unravel(jnp.asarray(y)))
    step = jax.jit(functools.partial(stepped, stepper, equation, h))
    got = np.asarray(ravel_pytree(step(motion, t).y)[0])
    unit = equation.drives.add(equation.generator.zero(), jnp.ones(1))
    G = np.asarray(ravel_pytree(unit)[0])
    sparse = scipy.sparse.csr_matrix(A)
    expected = expm_multiply(h * sparse, y)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    for x, w in zip((nodes + 1) / 2, weights / 2, strict=True):
        s = float(equation.drives.signals(jnp.asarray(t + h * x))[0])
        expected += h * w * s * expm_multiply(h * (1 - x) * sparse, G)
    assert np.abs(G).max() > 0
    assert np.abs(got - expected).max() <= 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("shift", [0.0, 6.0])
def test_coefficients_sum_to_the_exponential(shift):
    """Σ e^{−sτ} c_k(τ) φ_k((λ + s)/R) = e^{λτ} for λ over the rectangle −2s ≤ Re λ ≤ 0, |Im λ| ≤ R;
    to 1e-13, measured 3e-15 (s = 0) and 3e-14."""
    R, tau = 18.0, 0.5
    c = expansion_coefficients(np.array([tau]), R, shift)[0]
    x, y = np.meshgrid(np.linspace(-2 * shift, 0, 9), np.linspace(-R, R, 41))
    z = (x + 1j * y + shift) / R
    before, now = np.ones_like(z), z
    total = c[0] * before + c[1] * now
    for value in c[2:]:
        before, now = now, 2 * z * now + before
        total = total + value * now
    assert np.abs(total - np.exp((x + 1j * y) * tau)).max() <= 1e-13
    # At half of that many terms it is missed.
    assert abs(c[len(c) // 2]) > 1e-9


@pytest.mark.parametrize(
    ("damping", "ends"),
    [(None, ("free", "fixed")), (EVERYTHING, ("free", "fixed")), (None, ("free", "absorbing"))],
    ids=["lossless", "lossy", "absorbing"],
)
def test_energy_and_what_is_lost_make_up_the_work(damping, ends):
    """Law: energy + dissipated = work at all times, pulse included; to 1e-11 of the largest energy.
    Work and losses are integrals over steps, formed without the energy. Measured 1e-13."""
    layers = three(damping=damping)
    field = simulate(layers, fitted(layers, *ends), [PULSE, Ricker("B22", 4e-3, 5e5)], 2e-5)
    energy = field.energy
    lost = 0.0 if energy.dissipated is None else energy.dissipated
    largest = energy.total.max()
    assert np.abs(energy.total + lost - energy.work).max() <= 1e-11 * largest
    assert energy.work[-1] > 0.1 * largest
    if damping or "absorbing" in ends:
        assert energy.dissipated[-1] > 5e-3 * largest
    if damping:
        assert np.diff(energy.dissipated).min() >= -1e-12 * largest


F = 4e5
SAMPLED = 1e-6 + np.arange(62) / (8 * F)
BURST = ToneBurst("phi1", 0.0, F, start=2e-6)
NOISE = 0.01 * np.random.default_rng(6129).normal(size=62) * np.hanning(62)
RECORD = {"times": SAMPLED, "values": BURST.signal(SAMPLED) + NOISE}
KINKED = {
    "hann": functools.partial(ToneBurst, frequency=F),
    "noisy record": functools.partial(Recorded, **RECORD),
}


@pytest.mark.parametrize("signal", KINKED)
@pytest.mark.parametrize(
    ("solver", "damping", "right"),
    [
        ("propagator", None, "free"),
        ("chebyshev", None, "free"),
        ("auto", EVERYTHING, "free"),
        ("auto", None, "absorbing"),
    ],
    ids=["propagator", "series", "lossy", "absorbing"],
)
def test_energy_with_signals_that_have_kinks(signal, solver, damping, right):
    """Law: as above, at the step that is taken by default: the work is that of what the step
    applies, whatever the signal. A hann burst, and a record of eight samples to a period with 1 %
    noise; prescribed rotation, body moment and surface moment at once. Without losses to 1e-11,
    measured 1e-13; with, to 5e-9 (what is lost is a Gauss sum over each step), measured 2e-9."""
    layers = three(damping=damping)
    make = KINKED[signal]
    sources = [
        make(field="phi1", position=0.0, amplitude=1e-3, drive="rotation"),
        make(field="B11", position=1.3e-3, amplitude=1e-3),
    ]
    if right == "free":
        sources.append(make(field="phi1", position=layers.length, drive="moment"))
    energy = simulate(layers, fitted(layers, "fixed", right), sources, 2.4e-5, solver=solver).energy
    lost = 0.0 if energy.dissipated is None else energy.dissipated
    largest = energy.total.max()
    tolerance = 1e-11 if energy.dissipated is None else 5e-9
    assert np.abs(energy.total + lost - energy.work).max() <= tolerance * largest
    assert energy.work.max() > 0.5 * largest


def test_work_by_a_finer_rule():
    """Law: W = ∫ s ⟨G, v⟩ dt and, of a prescribed rotation, besides ∫ ġ · (force that holds) dt.

    One default step amid two pulses, from a random state with losses, cut into 24 whose powers are
    summed by Simpson's rule: to 1e-7 of the work, measured 4e-9."""
    layers = three(damping=EVERYTHING)
    sources = [PULSE, Ricker("phi1", 0.0, 4e5, amplitude=1e-3, drive="rotation")]
    made = plan(layers, fitted(layers, "fixed", "free"), sources, 6e-6)
    fine = plan(layers, made.bar, sources, 6e-6, step=made.step / 24)
    assert fine.schedule.step == pytest.approx(made.schedule.step / 24)
    equation, rest = assembly.equation_of(made)
    t = 20 * made.schedule.step

    def steps(plan_):
        stepper = assembly.stepper_of(plan_, equation)
        return jax.jit(functools.partial(stepped, stepper, equation, plan_.schedule.step))

    one = steps(made)
    motion = rest
    for n in range(20):
        motion = one(motion, jnp.asarray(n * made.schedule.step))
    work = float(one(motion, jnp.asarray(t)).work - motion.work)
    part = steps(fine)
    powers = [float(equation(jnp.asarray(t), motion).work)]
    for n in range(24):
        at = jnp.asarray(t + n * fine.schedule.step)
        motion = part(motion, at)
        powers.append(float(equation(at + fine.schedule.step, motion).work))
    weights = np.array([1.0, *[4.0, 2.0] * 11, 4.0, 1.0]) * fine.schedule.step / 3
    assert work == pytest.approx(float(weights @ powers), rel=1e-7)


def test_an_initial_field_keeps_its_energy():
    """Law: an initial field on a lossless bar rings on with the energy that it has at t = 0; to
    1e-11 of it, measured 1e-13. Whose energy that is, is held by test_real_bars."""
    layers = three()
    start = InitialField("phi1", 3e-3, 3e-4, 1e-3)
    field = simulate(layers, fitted(layers, "free", "fixed"), [start], 6e-6, 60)
    total = field.energy.total
    assert total[0] > 0
    assert np.ptp(total) <= 1e-11 * total[0]
    assert np.ptp(field.energy.kinetic) > 0.1 * total[0]


@pytest.mark.parametrize("damping", [None, EVERYTHING], ids=["lossless", "lossy"])
def test_carrying_on_gives_the_same_bits(damping, monkeypatch):
    monkeypatch.setattr(Plan, "chunk", property(lambda self: 7))
    made = settled(three(damping=damping), ("free", "absorbing"), samples=29)
    chunks = list(stream(made))
    carried = list(stream(made, start=(14, chunks[2].motion)))
    for one, other in zip(chunks[3:], carried, strict=True):
        for name in made.fields:
            np.testing.assert_array_equal(one.values[name], other.values[name])
        for part in one.energy.parts:
            np.testing.assert_array_equal(getattr(one.energy, part), getattr(other.energy, part))


def test_uniform_periodic_bars_agree_by_both_routes():
    """A loss of 1e-9 1/s sends a uniform periodic bar through A; it must give what the plain
    propagator gives, to 1e-11 of the largest; measured 2e-13."""
    pulse = [Ricker("phi1", 0.016, 6e5), Ricker("B23", 0.02, 5e5)]
    bar = Bar(256, CELL)
    medium = dataclasses.replace(SOFT, G_n_g=0.0)  # a real bar leaves out what is negligible
    plain = simulate(medium, bar, pulse, 8e-6, 40)
    other = simulate(lossy(medium, Damping(mass=1e-9)), bar, pulse, 8e-6, 40)
    assert (plain.stepper, other.stepper) == ("propagator", "chebyshev")
    for name in plain.names:
        size = np.abs(plain[name]).max()
        assert np.abs(plain[name] - other[name]).max() <= 1e-11 * size


def test_a_second_run_compiles_nothing_new():
    """One compiled function serves bars of one shape, other media and sources' places included."""
    layers = three()
    before = len(program._COMPILED)
    bar = fitted(layers, "free", "absorbing")
    simulate(layers, bar, [PULSE], 2e-6, 9)
    after = len(program._COMPILED)
    simulate(layers, bar, [PULSE], 2e-6, 9)
    assert len(program._COMPILED) == after <= before + 2  # the stepper's start is one of its own


def test_what_a_plan_of_a_real_bar_refuses():
    layers = three(damping=EVERYTHING)
    with pytest.raises(ValueError, match="solver = 'verlet': is for uniform periodic bars"):
        settled(layers, ("free", "fixed"), solver="verlet")
    with pytest.raises(ValueError, match="layers: 1 given for a grid of 3 stretches"):
        plan(SOFT, fitted(layers, "free", "fixed"), [PULSE], 6e-6)
    with pytest.raises(ValueError, match=r"layers end at 0\.00825 m, the bar at"):
        plan(layers, Bar(256, CELL), [PULSE], 6e-6)
