"""The bar with ends and layers: where its points lie, sampling, and sources laid on the grid."""

from __future__ import annotations

import numpy as np
import pytest
from runs import refused

from wavesim.grid.bar import Bar, layered_bar
from wavesim.grid.points import sampling, spread
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium
from wavesim.simulation.simulation import highest_carried

ENDED = Bar(64, 1.25e-4, 8, "free", "fixed")
STEPPED = layered_bar(
    Layers(
        (
            Layer(0.0, 4e-3, Medium()),
            Layer(4e-3, 6.05e-3, Medium(density=2000.0)),
            Layer(6.05e-3, 9e-3, Medium()),
        )
    ),
    1.25e-4,
)
RING = Bar(64, 1.25e-4)
EDGES = np.array([0.0, 4e-3, 6.05e-3, 9e-3])


def field_of(bar, staggered):
    return bar.half_nodes if staggered else bar.nodes


@pytest.mark.parametrize("end", ["free", "fixed", "absorbing"])
def test_points_of_a_bar_with_ends(end):
    """N + 1 nodes from 0 to L, N half-nodes in the middle of the cells."""
    bar = Bar(64, 1.25e-4, 8, end, end, 1e-3 if end == "absorbing" else 0.0)
    assert (len(bar.nodes), len(bar.half_nodes), bar.length) == (65, 64, 64 * 1.25e-4)
    assert bar.nodes[0] == 0
    np.testing.assert_allclose(bar.nodes[-1], bar.length, rtol=1e-15)
    np.testing.assert_allclose(np.diff(bar.nodes), bar.cell_sizes, rtol=1e-12)
    np.testing.assert_allclose(bar.half_nodes, (bar.nodes[1:] + bar.nodes[:-1]) / 2, rtol=1e-12)
    assert len(RING.nodes) == len(RING.half_nodes) == 64


def test_layers_have_cells_of_their_own_size_and_nodes_at_their_faces():
    """Each a whole number of cells, the nearest to what was asked: 32, 16 and 24 of them."""
    assert [cells for cells, _ in STEPPED.stretches] == [32, 16, 24]
    assert STEPPED.spacing == max(size for _, size in STEPPED.stretches)
    np.testing.assert_allclose(STEPPED.spacing, 2.05e-3 / 16, rtol=1e-12)
    np.testing.assert_allclose(STEPPED.nodes[[0, 32, 48, 72]], EDGES, rtol=1e-14)
    assert STEPPED.cells == len(STEPPED.half_nodes) == len(STEPPED.nodes) - 1 == 72
    np.testing.assert_allclose(np.diff(STEPPED.nodes), STEPPED.cell_sizes, rtol=1e-11)
    assert not STEPPED.uniform
    assert ENDED.uniform


@pytest.mark.parametrize(
    ("left", "right", "clear"),
    [
        ("free", "fixed", (0.0, 0.012)),
        ("absorbing", "free", (2e-3, 0.012)),
        ("fixed", "absorbing", (0.0, 0.010)),
        ("absorbing", "absorbing", (2e-3, 0.010)),
    ],
)
def test_clear_is_what_no_absorber_takes(left, right, clear):
    absorber = 2e-3 if "absorbing" in (left, right) else 0.0
    bar = Bar(96, 1.25e-4, 8, left, right, absorber)
    np.testing.assert_allclose(bar.clear, clear, rtol=1e-12)


@pytest.mark.parametrize("staggered", [False, True], ids=["node", "half-node"])
@pytest.mark.parametrize("order", [2, 6, 8])
@pytest.mark.parametrize("name", ["ended", "stepped"])
def test_sampling_is_exact_for_polynomials_up_to_the_end(name, order, staggered):
    """Degree order − 1 through order points, anywhere from end to end: near ends the points are
    those that there are. Beyond the outermost half-node it extrapolates by half a cell. In units of
    the bar, 1e-11 (weights of up to 10 at the ends, powers of up to 1). Measured ≤ 1e-13."""
    if name == "ended":
        bar = Bar(64, 1.25e-4, order, "free", "fixed")
    else:
        bar = layered_bar(
            Layers((Layer(0.0, 4e-3, Medium()), Layer(4e-3, 7e-3, Medium(density=2e3)))),
            1.25e-4,
            order,
        )
    x = field_of(bar, staggered) / bar.length
    for position in np.concatenate([np.linspace(0, 1, 211), [1e-9, 1 - 1e-9]]) * bar.length:
        weights, indices = sampling(bar, position, staggered)
        for degree in range(order):
            found = weights @ (x[indices] ** degree)
            assert abs(found - (position / bar.length) ** degree) <= 1e-11, (position, degree)
    # It could fail: a degree more is not exact.
    worst = max(
        abs(np.dot(w, x[i] ** order) - (p / bar.length) ** order)
        for p in np.linspace(0.1, 0.9, 37) * bar.length
        for w, i in [sampling(bar, p, staggered)]
    )
    assert worst > (1e-5 if order == 2 else 1e-14)


@pytest.mark.parametrize("staggered", [False, True], ids=["node", "half-node"])
def test_sampling_never_reaches_across_an_interface(staggered):
    """A field with a kink at each face, and on half-nodes a jump, is still read exactly: cubic
    pieces of their own in every layer. At a face it is that of the layer on its right, as
    Layers.layer_at has it. 1e-12 of its size; across a face it would be 1e-3 and more."""
    x = field_of(STEPPED, staggered)
    rng = np.random.default_rng(8)
    pieces = rng.standard_normal((3, 4))

    def value(at, layer):
        s = (at - EDGES[layer]) / 1e-3
        jump = 0.0 if not staggered else pieces[layer, 0]
        return jump + pieces[layer, 1] * s + pieces[layer, 2] * s**2 + pieces[layer, 3] * s**3

    owner = np.clip(np.searchsorted(EDGES, x, side="right") - 1, 0, 2)
    values = np.array([value(at, layer) for at, layer in zip(x, owner, strict=True)])
    if not staggered:
        # Continuous on nodes: each piece starts where the one before it ended.
        start = np.zeros(3)
        for layer in (1, 2):
            start[layer] = start[layer - 1] + value(EDGES[layer], layer - 1)
        values += start[owner]
    else:
        start = np.zeros(3)
    size = np.abs(values).max()
    for position in [*np.linspace(0, STEPPED.length, 307)[1:-1], *EDGES[1:3]]:
        layer = int(np.searchsorted(EDGES, position, side="right") - 1)
        weights, indices = sampling(STEPPED, position, staggered)
        exact = value(position, layer) + start[layer]
        assert abs(weights @ values[indices] - exact) <= 1e-12 * size, position
        assert (owner[indices] == layer).all() or not staggered
    # It could fail: points from both sides of a face give another value.
    near = np.flatnonzero(np.abs(x - EDGES[2]) < 3.9 * 1.25e-4)
    through = np.polynomial.Polynomial.fit(x[near], values[near], len(near) - 1)
    at = EDGES[2] + 2e-5
    assert abs(through(at) - value(at, 2) - start[2]) > 1e-4 * size


@pytest.mark.parametrize("staggered", [False, True], ids=["node", "half-node"])
@pytest.mark.parametrize("bar", [RING, ENDED, STEPPED], ids=["ring", "ended", "stepped"])
def test_a_point_source_is_the_transpose_of_sampling(bar, staggered):
    """⟨density, u⟩ in the norm of the grid is u(x_s) as sampled, for any u, and so 1 for u = 1: a
    source and a receiver can change places. Rounding, 1e-13."""
    norms = bar.differences
    norm = norms.half_norm if staggered else norms.node_norm
    u = np.random.default_rng(9).standard_normal(len(field_of(bar, staggered)))
    for position in np.linspace(0, bar.length * (1 if not bar.periodic else 0.999), 83):
        density, at = spread(bar, position, 0.0, staggered)
        weights, indices = sampling(bar, position, staggered)
        np.testing.assert_allclose(
            np.sum(density * norm[at] * u[at]), weights @ u[indices], rtol=0, atol=1e-12
        )
        assert abs(np.sum(density * norm[at]) - 1) <= 1e-12


@pytest.mark.parametrize("staggered", [False, True], ids=["node", "half-node"])
@pytest.mark.parametrize(
    ("bar", "position", "tolerance"),
    [
        # Uniform there: the trapezoidal rule, e^{−2π²(w/h)²} = 1e-34 at w = 2h, cut at 8.5 w.
        (RING, 1e-4, 1e-14),
        (ENDED, 3.9e-3, 1e-14),
    ],
    ids=["round a ring", "ended"],
)
def test_a_gaussian_source_has_mass_1(bar, position, tolerance, staggered):
    norms = bar.differences
    norm = norms.half_norm if staggered else norms.node_norm
    density, at = spread(bar, position, 2.5e-4, staggered)
    assert abs(np.sum(density * norm[at]) - 1) <= tolerance
    x = field_of(bar, staggered)[at]
    shift = x - position
    if bar.periodic:
        shift = (shift + bar.length / 2) % bar.length - bar.length / 2
    # Its centre and its spread are those asked for.
    weight = density * norm[at]
    assert abs(np.sum(weight * shift)) <= 2.5e-4 * max(10 * tolerance, 1e-13)
    np.testing.assert_allclose(
        np.sum(weight * shift**2), 2.5e-4**2, rtol=max(30 * tolerance, 1e-12)
    )


@pytest.mark.parametrize("staggered", [False, True], ids=["node", "half-node"])
def test_a_gaussian_across_faces_has_mass_1(staggered):
    """Next to a face the norms integrate a Gaussian of two cells only to 1e-3: laid as a mean of
    points it has mass 1, and its centre where it was asked for, to rounding."""
    layers = Layers(
        (Layer(0, 4e-3, Medium()), Layer(4e-3, 6.05e-3, Medium()), Layer(6.05e-3, 9e-3, Medium()))
    )
    for spacing in (1.25e-4, 6.25e-5):
        bar = layered_bar(layers, spacing)
        norm = bar.differences.half_norm if staggered else bar.differences.node_norm
        x = field_of(bar, staggered)
        for position in (3.7e-3, 4e-3, 4.1e-3, 5.1e-3, 6e-3):
            density, at = spread(bar, position, 2.5e-4, staggered)
            assert abs(np.sum(density * norm[at]) - 1) <= 1e-9
            assert abs(np.sum(density * norm[at] * (x[at] - position))) <= 1e-9 * spacing


def thin():
    return Layers((Layer(0.0, 8e-3, Medium()), Layer(8e-3, 8.5e-3, Medium(density=2e3))))


BAD = [
    (lambda: Bar(64, 1e-4, 8, "free"), 'left = "free", right = "periodic": ', "at both ends or"),
    (lambda: Bar(64, 1e-4, 8, "periodic", "fixed"), 'right = "fixed": ', "at both ends or"),
    (lambda: Bar(64, 1e-4, 8, "soft", "free"), "left = 'soft': ", "free, absorbing"),
    (lambda: Bar(64, 1e-4, 8, "free", "absorbing"), "absorber = 0 m: ", "8 branch lengths"),
    (
        lambda: Bar(64, 1e-4, 8, "absorbing", "absorbing", 2.7e-3),
        "absorber = 0.0027 m: 2 of them",
        "shorten them or lengthen the bar",
    ),
    (lambda: layered_bar(thin(), 1.25e-4), "cells = 4 (layer 2, 0.0005 m thick)", "or less, or"),
    (lambda: Bar(8, 1e-4, 8, "free", "free"), "cells = 8: ", "refine the spacing"),
    (lambda: Bar(64, 0.0), "spacing = 0 m: ", "greater than 0"),
    (lambda: Bar(64, 1e-4, 7), "order = 7: ", "2, 4, 6"),
    (lambda: sampling(ENDED, -1e-6, False), "position = -1e-06 m: ", "0 to 0.008 m"),
    (lambda: sampling(ENDED, 8.1e-3, True), "position = 0.0081 m: ", "0 to 0.008 m"),
    (lambda: spread(ENDED, 1e-3, 2e-4, False), "width = 0.0002 m: ", "0.000118 m, or move it"),
    (lambda: spread(RING, 1e-3, 5e-4, False), "width = 0.0005 m: ", "take at most"),
]


@pytest.mark.parametrize(("make", "given", "remedy"), BAD, ids=[row[1] for row in BAD])
def test_what_is_no_bar_is_told_in_one_line(make, given, remedy):
    refused(make, given, remedy)


def test_the_spacing_told_for_a_thin_layer_is_enough():
    with pytest.raises(ValueError, match="spacing of") as caught:
        layered_bar(thin(), 1.25e-4)
    told = float(str(caught.value).split("spacing of ")[1].split(" m")[0])
    assert layered_bar(thin(), told).stretches[1][0] >= 16
    with pytest.raises(ValueError, match="layer 2"):
        layered_bar(thin(), 1.1 * told)


def test_a_layer_that_is_as_much_slower_as_it_is_finer_carries_the_same():
    """Cells in proportion to c_∞, from a medium to one of four times the density: what a grid of
    both carries is what that of the first alone does."""
    fast, slow = Medium(), Medium(density=4 * 1570.0)
    alone = Layers((Layer(0.0, 8e-3, fast),))
    both = Layers((Layer(0.0, 8e-3, fast), Layer(8e-3, 12e-3, slow)))
    expected = highest_carried(alone, layered_bar(alone, 2e-4))
    assert highest_carried(both, layered_bar(both, [2e-4, 1e-4])) == pytest.approx(expected)
    assert highest_carried(both, layered_bar(both, 2e-4)) == pytest.approx(expected / 2)
