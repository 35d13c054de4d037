"""What a run costs, counted and not timed: products, flops, bytes, compilations.

A bound here is a promise that a change must keep or restate. Each says where it comes from: a law
where there is one, and else the value counted when it was written plus a stated margin.
"""

import dataclasses
import itertools

import jax
import numpy as np
import pytest
from jax import monitoring

from wavesim.grid.bar import Bar, layered_bar
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium
from wavesim.material.sectors import BLOCKS
from wavesim.simulation.plan import plan
from wavesim.sources import Ricker
from wavesim.timedomain.forcing import forcing
from wavesim.timedomain.generator import generator
from wavesim.timedomain.integration import simulate
from wavesim.timedomain.kernels import convolve
from wavesim.timedomain.layered import piecewise
from wavesim.timedomain.operator import Operator, semi_discrete
from wavesim.timedomain.pieces import cut
from wavesim.timedomain.propagator import bar_kernels
from wavesim.timedomain.response import pulse_tables
from wavesim.timedomain.timestep import reach_within

MEDIUM = Medium(anisotropy=0.25, closure="consistent")
BAR = Bar(4096, 1.25e-4)
# All six blocks, twelve fields.
SOURCES = tuple(
    Ricker(field, 0.256 + offset, 785e3)
    for field, offset in (
        ("phi1", 0.0),
        ("phi2", -3e-3),
        ("phi3", 4e-3),
        ("B22", 2e-3),
        ("B23", -5e-3),
    )
)
UNITS = 200.0  # of time


def settled(solver="auto", frames=2):
    return plan(MEDIUM, BAR, SOURCES, UNITS * MEDIUM.time_scale, frames, solver)


def test_products_per_unit_of_time():
    """Chebyshev: two series of degree h√Λ/2 at least, so √Λ = 18.3 products a unit; counted 23.8
    at its longest step, bounded at 1.35 times the law. Verlet at a quarter of its limit: 2√Λ.
    The default steps by 160 cells of reach while pulses act, and takes all the rest in one: three
    products, whatever the duration."""
    root = np.sqrt(settled().schedule.bound)
    chebyshev = settled("chebyshev").schedule.operator_products / UNITS
    assert root <= chebyshev <= 1.35 * root
    assert settled("verlet").schedule.operator_products / UNITS <= 2.02 * root
    default = settled().schedule
    assert default.solver == "propagator"
    assert default.operator_products == 3


@pytest.mark.parametrize("frames", [2, 51, 401])
def test_products_when_frames_are_wanted(frames):
    """A frame costs no more than a step of its own: one step a frame where its interval is within
    reach."""
    schedule = settled(frames=frames).schedule
    assert schedule.steps <= max(3, frames - 1)


@pytest.fixture(scope="module", params=[2, 401], ids=["longest step", "half a unit"])
def stepped(request):
    schedule = settled(frames=request.param).schedule
    return schedule, bar_kernels(MEDIUM, BAR, BLOCKS, schedule.step)


@pytest.mark.parametrize("cells", [4096, 1_000_000])
def test_tables_of_pulses_do_not_grow_with_the_bar(cells, monkeypatch):
    """They are made where a pulse is felt: on the eight cells over which a point between cells is
    spread and r on either side, with one product of L and one of its adjoint for each degree of
    the series and two before."""
    bar = Bar(cells, BAR.spacing)
    made = plan(MEDIUM, bar, SOURCES, UNITS * MEDIUM.time_scale, 401)
    operator = semi_discrete(MEDIUM, bar, made.blocks)
    force = forcing(SOURCES, MEDIUM, bar, made.blocks, operator)
    seen = []
    apply = Operator.__call__

    def counted(self, q):
        seen.append(max(component.shape[-1] for group in q for component in group))
        return apply(self, q)

    monkeypatch.setattr(Operator, "__call__", counted)
    pulse_tables(operator, force, made.schedule)
    assert len(seen) == 2 * (made.schedule.degree + 2)
    assert max(seen) <= 2 * made.schedule.reach + BAR.order


def dense_flops(parts):
    """Multiplications and additions of one step: q and v through each block's matrix."""
    total = 0
    for part in parts:
        blocks, rows, columns = part.cosine.shape
        total += blocks * 2 * -(-part.cells // part.run) * 2 * rows * columns
    return total


def test_dense_flops_of_a_step(stepped):
    """A cell takes 2 tracks × 2 flops × Σ f² (b + 2r) with Σ f² = 3·3² + 3·1² = 30, r within
    reach_within and b ≤ max(64, 0.75 r + 16); the last run may stand out over the bar, 8 %."""
    schedule, parts = stepped
    speed = np.sqrt(0.77916484) / 0.125  # c∞ in cells a unit of time, longitudinal
    reach = reach_within(schedule.step, speed)
    width = 2 * reach + max(64, 0.75 * reach + 16)
    assert dense_flops(parts) <= 1.08 * 4 * 30 * width * BAR.cells


def test_compiled_step_is_the_dense_product(stepped):
    """The compiler's own count of a step's flops is that of the products, to 5 %."""
    _, parts = stepped
    zero = semi_discrete(MEDIUM, BAR, BLOCKS).zero()
    both = jax.tree.map(lambda c: np.zeros((2, *c.shape)), zero)
    cost = jax.jit(lambda state: convolve(parts, state)).lower(both).compile().cost_analysis()
    assert cost["flops"] == pytest.approx(dense_flops(parts), rel=0.05)


@pytest.mark.parametrize(
    ("count", "kinds", "matrices"),
    [(8, 2, 1.22e6), (20, 2, 1.22e6), (8, 8, 4.1e6)],
    ids=["8 layers", "20 layers", "8 of a kind each"],
)
def test_a_layered_step_is_as_cheap_as_a_uniform_one(count, kinds, matrices):
    """No more flops, by the compiler, than on a uniform bar of as many cells, at steps of half a
    unit: the shorter runs (b + 2r = 78 for 110 cells) save more than corrections of 64 by 64
    cells add. Counted 0.78, 0.95, 0.78 times. Bytes of the matrices of one block, which a step
    reads once: 1.10, 1.10, 3.65 MB, bounded a tenth above; equal ones are shared."""
    media = [dataclasses.replace(MEDIUM, density=1500.0 + 100 * n) for n in range(kinds)]
    cells = [BAR.cells // count + n % 10 for n in range(count)]
    edges = (np.cumsum([0, *cells]) * BAR.spacing).tolist()
    layers = Layers(
        tuple(Layer(*ends, media[n % kinds]) for n, ends in enumerate(itertools.pairwise(edges)))
    )
    bar = layered_bar(layers, BAR.spacing)
    duration = UNITS * MEDIUM.time_scale
    made = plan(layers, bar, SOURCES[:1], duration, 401)
    assert (made.schedule.solver, made.schedule.steps) == ("propagator", 400)
    assert made.schedule.operator_products == 400
    A = generator(layers, bar, made.blocks, made.medium, made.with_gradient)
    length = float(made.medium.length_scale)
    part = piecewise(cut(layers, bar, A.groups[0], made.schedule, length))
    both = np.zeros((2, 1, 3, bar.cells + 1))
    flops = jax.jit(part.__call__).lower(both).compile().cost_analysis()["flops"]
    (uniform,) = bar_kernels(MEDIUM, BAR, BLOCKS[:1], made.schedule.step)
    assert flops <= dense_flops([uniform])
    assert sum(leaf.nbytes for leaf in jax.tree.leaves(part)) <= matrices


def test_one_product_with_L():
    """The compiler's count, a cell of all twelve fields. A difference of order 8 takes 12 flops:
    two in each of the three blocks with a rotation and, for Γ, two for each of the nine
    micro-curvatures are 288, the coefficients some 90. Counted 591, as fused loops make some
    differences twice; and 3,961 bytes, against 192 that must be read and written, as
    differences are cut out of padded copies. Both bounded at 3 % above."""
    operator = semi_discrete(MEDIUM, BAR, BLOCKS)
    product = jax.jit(lambda q: operator(q)).lower(operator.zero()).compile()
    cost = product.cost_analysis()
    assert cost["flops"] / BAR.cells <= 610
    assert cost["bytes accessed"] / BAR.cells <= 4080


def pulse_bytes(cells, frames):
    """Two pulses round the middle of a bar; 200 units of time in so many frames."""
    bar, middle = Bar(cells, BAR.spacing), cells * BAR.spacing / 2
    sources = [Ricker("phi1", middle, 785e3), Ricker("B23", middle + 6e-3, 785e3)]
    made = plan(MEDIUM, bar, sources, UNITS * MEDIUM.time_scale, frames)
    operator = semi_discrete(MEDIUM, bar, made.blocks)
    force = forcing(sources, MEDIUM, bar, made.blocks, operator)
    tables = pulse_tables(operator, force, made.schedule)
    return sum(leaf.nbytes for leaf in jax.tree.leaves(tables))


def test_bytes_of_the_pulse_tables():
    """A pulse is felt within reach: the tables do not grow with the bar. Counted 0.20 MB at steps
    of half a unit and 3.04 MB at the longest, bounded a third above."""
    assert pulse_bytes(512, 401) == pulse_bytes(1024, 401) <= 0.27e6
    assert pulse_bytes(1024, 2) <= 4.1e6


def test_a_second_run_compiles_nothing():
    compiled = []

    def listener(event, seconds, **_):
        if "backend_compile" in event:
            compiled.append(seconds)

    def run():
        simulate(MEDIUM, Bar(260, 1.25e-4), [Ricker("phi1", 0.016, 785e3)], 4e-6, 9)

    monitoring.register_event_duration_secs_listener(listener)
    try:
        run()
        assert compiled
        compiled.clear()
        run()
        assert not compiled
    finally:
        monitoring.unregister_event_duration_listener(listener)
