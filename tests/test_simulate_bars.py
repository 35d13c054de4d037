"""Runs on bars with layers, ends and losses, against the exact frequency domain.

The exact route (``wavesim.layered``) has no grid, no time step and no matrix in common with the
simulation: it shares the medium, the loss law and the layers' places. Signals of every field at
every receiver are compared over the whole record, in units of their largest value. Bars are short,
so that records hold echoes from both ends.
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

import wavesim as ws
from wavesim.layered import signals
from wavesim.layered.signals import contour_of
from wavesim.material.layers import as_layers
from wavesim.readings.bar.grid_signals import grid_spectra

LENGTH = 0.016
CELL = 1.25e-4
DURATION, FRAMES = 1e-5, 101
RECEIVERS = {"near": 0.0051, "far": 0.0112}
SOFT = ws.Medium(anisotropy=0.3, closure="consistent")
STIFF = ws.Medium(closure="consistent", G_n_a=9.0, G_n_r=7.0, density=2000.0, particle_radius=6e-4)
SOLIDS = ws.constant_quality(30.0, (2e5, 2e6))
EVERYTHING = dataclasses.replace(SOLIDS, mass=1e5, stiffness=2e-9)


def lossy(medium, damping=EVERYTHING):
    return medium and dataclasses.replace(medium, damping=damping)


def uniform(left, right):
    absorber = 8e-3 if "absorbing" in (left, right) else 0.0
    return ws.Bar(128, CELL, 8, left, right, absorber)


def layered(layers, left, right, cell=CELL):
    return ws.layered_bar(layers, cell, 8, left, right, 4e-3 if "absorbing" in (left, right) else 0)


def off_its_grid(field, receivers):
    """Largest difference of any field from the elimination of the grid's band matrix at each ω."""
    layers, sources, duration = field.layers, field.sources, field.simulation.duration
    grid = contour_of(layers, sources, duration)
    on_grid = grid_spectra(field.simulation, receivers, grid.omega)
    worst = 0.0
    for name, position in receivers.items():
        for key, spectrum in on_grid[name].items():
            value = field.at(position, key)
            off = np.abs(grid.signal(spectrum, field.t) - value).max()
            worst = max(worst, off / np.abs(value).max())
    return worst


def error(medium, bar, sources, receivers=RECEIVERS, duration=DURATION):
    """Largest difference of any field at any receiver, over that field's largest value there.

    Beside it, law: at each ω the run is the elimination of its grid's band matrix, with no step in
    time; 1e-7 of the peak, measured 1e-12 to 5e-8.
    """
    field = ws.simulate(medium, bar, sources, duration, FRAMES)
    layers = as_layers(medium, bar.length)
    if not field.simulation.gradient_felt:
        assert off_its_grid(field, receivers) <= 1e-7
    exact = signals(layers, bar.left, bar.right, sources, receivers, field.t)
    worst = 0.0
    for name, position in receivers.items():
        assert set(exact[name]) == set(field.names)
        for key, expected in exact[name].items():
            size = np.abs(expected).max()
            assert size > 0
            worst = max(worst, float(np.abs(field.at(position, key) - expected).max() / size))
    return worst


@pytest.mark.parametrize("ends", [("free", "fixed"), ("absorbing", "fixed")])
def test_ends(ends):
    """Ends of every kind, echoes included, on cells of l/8; 1e-5, measured 2e-7 to 6e-7 (the grid's
    dispersion and, where it absorbs, what the absorber sends back near cutoffs). The other sides,
    and the ring, are those of tests below."""
    bar = uniform(*ends)
    if "absorbing" in ends:  # the absorber is a part of the bar
        bar = dataclasses.replace(bar, cells=192)
    source = ws.Ricker("phi1", 0.0076 if ends[0] != "absorbing" else 0.0141, 5e5)
    receivers = {"a": 0.0051, "b": 0.0112} if ends[0] != "absorbing" else {"a": 0.0112, "b": 0.0181}
    assert error(SOFT, bar, [source], receivers) <= 1e-5


# Amplitudes such that at each receiver each source alone makes a fair part of the whole: body
# moments, moments at ends, initial fields.
TOGETHER = (
    ws.Ricker("B11", 0.0071, 5e5, amplitude=1e-3),
    ws.Ricker("B22", 0.0091, 4.5e5, width=4e-4, amplitude=1.5e-2),
    ws.GaussianDerivative("phi1", 0.0081, 5e5, width=4e-4, amplitude=1.0),
    ws.Ricker("phi1", 0.0, 5e5, drive="moment"),
    ws.Ricker("phi1", LENGTH, 4e5, drive="moment", amplitude=-1.0),
    ws.ToneBurst("phi1", 0.0, 4e5, cycles=2, window="cos4", drive="moment"),
    ws.InitialField("phi1", 0.0076, 9e-4, 1e-6),
    ws.InitialField("B11", 0.0083, 9e-4, 2e-3),
)


def test_sources_on_a_free_bar():
    """Body moments, surface moments, initial fields; 3e-5, measured 5e-6."""
    assert error(SOFT, uniform("free", "free"), TOGETHER) <= 3e-5


@pytest.mark.parametrize("medium", [SOFT, lossy(SOFT)], ids=["lossless", "lossy"])
def test_prescribed_rotations(medium):
    """φ = g(t) at both ends, held fixed otherwise; 3e-5, measured 5e-6. The ends themselves follow
    g, to 1e-11 whatever the losses; without them, to 1e-12, and the work done there is the energy
    that comes in (1e-11, measured 1e-13)."""
    sources = [
        ws.Ricker("phi1", 0.0, 5e5, amplitude=1e-3, drive="rotation"),
        ws.Ricker("phi1", LENGTH, 4e5, amplitude=1e-3, drive="rotation"),
    ]
    bar = uniform("fixed", "fixed")
    assert error(medium, bar, sources) <= 3e-5
    field = ws.simulate(medium, bar, sources, DURATION, FRAMES)
    atol = 1e-3 * (1e-11 if medium.damping else 1e-12)
    for node, source in ((0, sources[0]), (-1, sources[1])):
        found = field["phi1"][:, node]
        np.testing.assert_allclose(found, source.signal(field.t), rtol=0, atol=atol)
    if not medium.damping:
        energy = field.energy
        assert np.abs(energy.total - energy.work).max() <= 1e-11 * energy.total.max()


def test_a_prescribed_end_does_not_drift():
    """Where g̈ jumps within steps (a hann burst) the end still follows g, to 1e-11, and rests after
    it: the energy is constant from then on, to 1e-11; measured 1e-13."""
    source = ws.ToneBurst("phi1", 0.0, 4e5, cycles=2, amplitude=1e-3, drive="rotation")
    field = ws.simulate(SOFT, uniform("fixed", "free"), [source], DURATION, FRAMES)
    node, total = field["phi1"][:, 0], field.energy.total
    np.testing.assert_allclose(node, source.signal(field.t), rtol=0, atol=1e-11 * 1e-3)
    after = field.t > source.end + field.step
    assert after.sum() > 10
    assert np.ptp(total[after]) <= 1e-11 * total.max()


@pytest.mark.parametrize(
    ("damping", "ends"),
    [
        (ws.Damping(mass=2e5, stiffness=5e-9), ("free", "fixed")),
        (SOLIDS, ("periodic", "periodic")),
    ],
    ids=["friction", "solids"],
)
def test_losses(damping, ends):
    """Every loss law, in echoes and all round a ring; 1e-5, measured 1e-8 to 3e-7."""
    assert error(lossy(SOFT, damping), uniform(*ends), [ws.Ricker("phi1", 0.0076, 5e5)]) <= 1e-5


@pytest.mark.parametrize("field", ["phi1", "B11"])
def test_an_initial_value_where_viscosity_changes(field):
    """Which the exact solver does not have. Viscous stress feels no strain that was there before,
    layer by layer: as its grid has it without a step in time, 1e-6, measured 2e-8 to 6e-7."""
    laws = ws.Damping(mass=1e4, stiffness=2e-9), ws.Damping(stiffness=2e-8)
    layers = bar_of(*(lossy(SOFT, law) for law in laws), edges=(0.0, 0.0076, LENGTH))
    bar, source = layered(layers, "fixed", "free"), ws.InitialField(field, 0.0073, 9e-4, 1e-6)
    run = ws.simulate(layers, bar, [source], DURATION, FRAMES)
    assert off_its_grid(run, RECEIVERS) <= 1e-6


def bar_of(*media, edges=(0.0, 0.0041, 0.0083, 0.0122, LENGTH), closure="consistent"):
    """Layers of these media, on no multiple of the cell; of a pair a layer graded between them."""
    made = []
    for (start, end), medium in zip(itertools.pairwise(edges), media, strict=True):
        pair = medium if isinstance(medium, tuple) else (medium, None)
        pair = [one and dataclasses.replace(one, closure=closure) for one in pair]
        made.append(ws.Layer(start, end, *pair))
    return ws.Layers(tuple(made))


GRADED = (SOFT, dataclasses.replace(SOFT, anisotropy=0.55, density=1900.0))


@pytest.mark.parametrize(
    ("closure", "damping", "right"),
    [
        ("printed", None, "fixed"),
        ("consistent", EVERYTHING, "absorbing"),
    ],
    ids=["lossless", "lossy"],
)
def test_layers(closure, damping, right):
    """Interfaces on no multiple of the cell, jumps of everything, a graded layer, a lossy layer
    between lossless ones; cells of l/16: 1e-4, measured 2e-7 to 2e-5."""
    stiff = lossy(STIFF, damping) if damping else STIFF
    layers = bar_of(SOFT, stiff, GRADED, SOFT, closure=closure)
    receivers = {"inside": 0.0062, "behind": 0.0105}
    bar = layered(layers, "free", right, CELL / 2)
    assert error(layers, bar, [ws.Ricker("phi1", 0.0021, 4.5e5)], receivers) <= 1e-4


def test_two_sectors_and_the_in_plane_waves_at_once():
    """Longitudinal, both transverse and in-plane blocks in one run; 1e-4, measured 1e-5."""
    layers = bar_of(SOFT, STIFF, SOFT, edges=(0.0, 0.0053, 0.0104, LENGTH))
    sources = [ws.Ricker(name, 0.0026, 4e5, width=2e-4) for name in ("phi1", "phi3", "B12", "B23")]
    # In-plane waves do not leave their source: receivers there see all fields move.
    receivers = {"at": 0.0027, "by": 0.0022}
    assert error(layers, layered(layers, "free", "free", CELL / 2), sources, receivers) <= 1e-4


def test_the_gradient_term_where_it_matters():
    """Γ as large as the rest (G_n_g = 2 N·m): B propagates, is continuous at the interface, and its
    double moment vanishes at the ends, fixed and free. 1e-3 on cells of l/8 and less than a sixth
    of that on l/16; measured 3e-5 and 4e-6."""
    soft, stiff = (dataclasses.replace(m, G_n_g=g) for m, g in ((SOFT, 2.0), (STIFF, 4.0)))
    layers = bar_of(soft, stiff, edges=(0.0, 0.0077, LENGTH))
    pulse = [ws.Ricker("phi1", 0.0036, 4e5, width=4e-4)]
    coarse, fine = (
        error(layers, layered(layers, "free", "fixed", cell), pulse) for cell in (CELL, CELL / 2)
    )
    assert coarse <= 1e-3
    assert fine <= coarse / 6


def test_signals_converge():
    """Error of signals behind a jump of everything falls by at least 2⁵ when cells are halved, from
    l/8: order 8 with closures exact to degree 3. Measured 2e-5 and 1e-7, at the source's end of the
    record where slow waves are still resolved."""
    layers = bar_of(SOFT, STIFF, SOFT, edges=(0.0, 0.0053, 0.0104, LENGTH))
    pulse = [ws.Ricker("phi1", 0.0026, 2.5e5, width=3e-4)]
    coarse, fine = (
        error(layers, layered(layers, "free", "free", cell), pulse, {"behind": 0.0112}, 1.6e-5)
        for cell in (CELL, CELL / 2)
    )
    assert coarse <= 1e-3
    assert fine <= coarse / 32


def test_reciprocity():
    """Law: with a symmetric closure, losses and absorbers too, source and receiver exchange: a
    moment on φ₁ here felt in B₁₁ there is a double moment on B₁₁ there felt in φ₁ here. Across an
    interface and a graded layer, off the grid's points; 1e-10 of the peak, measured 4e-13."""
    soft, graded = lossy(SOFT), tuple(lossy(one) for one in GRADED)
    layers = bar_of(soft, graded, soft, edges=(0.0, 0.0053, 0.0104, LENGTH))
    bar = layered(layers, "free", "absorbing")
    here, there = 2.53e-3, 11.37e-3

    def heard(here_acts, field, at):
        """One of the two acts, the other as good as not: what is compiled serves both."""
        sources = [
            ws.Ricker("phi1", here, 5e5, amplitude=1.0 if here_acts else 1e-30),
            ws.Ricker("B11", there, 5e5, amplitude=1e-30 if here_acts else 1.0),
        ]
        return ws.simulate(layers, bar, sources, DURATION, FRAMES).at(at, field)

    one, other = heard(True, "B11", there), heard(False, "phi1", here)
    assert np.abs(one).max() > 0
    assert np.abs(one - other).max() <= 1e-10 * np.abs(one).max()


def test_receivers_of_any_sampling():
    """Between frames a signal is what the exact solver gives there: a hundred times at random, 24
    frames and more from the record's ends, off the grid in x; 1e-5 of the peak. The frames hold
    twice the source's band."""
    bar, pulse = uniform("free", "free"), [ws.Ricker("phi1", 0.0076, 5e5)]
    field = ws.simulate(SOFT, bar, pulse, 2 * DURATION)
    t = np.sort(np.random.default_rng(6129).uniform(0.32, 0.68, 100)) * 2 * DURATION
    exact = signals(as_layers(SOFT, bar.length), "free", "free", pulse, {"a": 0.01134}, t)["a"]
    for name in ("phi1", "B11"):
        found = field.at(0.01134, name, t)
        assert found.shape == t.shape
        assert np.abs(found - exact[name]).max() <= 1e-5 * np.abs(exact[name]).max()


def test_a_grid_that_is_not_of_the_layers_is_refused():
    layers = bar_of(SOFT, STIFF, SOFT, edges=(0.0, 0.0053, 0.0104, LENGTH))
    pulse, bar = [ws.Ricker("phi1", 0.0026, 4e5)], layered(layers, "free", "free")
    with pytest.raises(ValueError, match="layers: 1 given for a grid of 3 stretches"):
        ws.simulate(SOFT, bar, pulse, DURATION)
    with pytest.raises(ValueError, match=r"no layer covers x = 0\.016 to 0\.032 m"):
        ws.simulate(layers, ws.Bar(256, CELL), pulse, DURATION)
