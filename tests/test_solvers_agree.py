"""Ways to step one equation: exact series, exact propagator, and diffrax's own explicit solvers."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from exact import modal_field

import wavesim as ws

CELL = 1.25e-4
FIRST = ws.Medium(anisotropy=0.3, closure="consistent")
SECOND = ws.Medium(closure="consistent", G_n_a=9.0, density=2000.0)
THIRD = dataclasses.replace(FIRST, anisotropy=0.8)
GRADIENT = dataclasses.replace(FIRST, G_n_g=2.0)
LOSSY = dataclasses.replace(ws.constant_quality(30.0, (2e5, 2e6)), mass=1e5, stiffness=2e-9)


def stack(*cells_and_media, closure=None):
    """Layers of these thicknesses in cells; of a pair of media a layer graded between them."""
    made, start = [], 0.0
    for cells, medium in cells_and_media:
        pair = medium if isinstance(medium, tuple) else (medium, None)
        if closure:
            pair = [one and dataclasses.replace(one, closure=closure) for one in pair]
        made.append(ws.Layer(start, start + cells * CELL, *pair))
        start = made[-1].end
    return ws.Layers(tuple(made))


BODY = (ws.Ricker("phi1", 1.1 * CELL, 7e5),
        ws.Ricker("B22", 45 * CELL, 9e5, amplitude=3e-4, width=2.5e-4))  # fmt: skip
ENDS = (ws.Ricker("phi1", 0.0, 5e5, amplitude=1e-3, drive="rotation"),
        ws.Ricker("B11", 15 * CELL, 5e5, amplitude=1e-3))  # fmt: skip

# (layers, order, left, right, sources, frames): interfaces within each other's reach, one layer
# that is all closures; a graded layer, and cells of a size of their own, as 60.4 of them are none;
# a bar of fewer points than are taken together;
# a bar that is driven at an end, short and long.
BARS = {
    "near": (
        stack((50, FIRST), (24, SECOND), (16, THIRD), (57, FIRST), (160, SECOND)),
        8, "free", "free", BODY, 801,
    ),
    "graded ring": (
        stack((60.4, FIRST), (69.7, (FIRST, THIRD)), (150, SECOND), closure="printed"),
        4, "periodic", "periodic", BODY, 81,
    ),
    "short, gradient term": (stack((40, GRADIENT)), 12, "fixed", "free", ENDS, 81),
    "fewer points than a run": (
        stack((9, FIRST), (10, SECOND)),
        2, "free", "fixed", (ws.Ricker("phi2", 5 * CELL, 7e5),), 81,
    ),
    "long, gradient term": (stack((140, GRADIENT)), 12, "fixed", "free", ENDS, 81),
}  # fmt: skip


def of(name, solver):
    layers, order, left, right, sources, frames = BARS[name]
    bar = ws.layered_bar(layers, CELL, order, left, right)
    return ws.simulate(layers, bar, sources, (frames - 1) * 1.25e-7, frames, solver)


def agree(one, other, tolerance):
    assert set(one.names) == set(other.names)
    for name in other.names:
        size = np.abs(other[name]).max()
        assert size > 0
        assert np.abs(one[name] - other[name]).max() <= tolerance * size, name


@pytest.mark.parametrize("name", BARS)
def test_the_propagator_and_the_series_agree(name):
    """Law: both solve the same equations exactly, whatever the layers, ends and sources.

    Every field at every frame to 1e-11 of its largest, over 49 units of time, and to 1e-10 over
    490: rounding of the recurrence, the frequencies of whose fastest modes are known to 1e-15 of
    themselves. The work to 1e-12 of its largest. Measured 1e-13 to 1e-12. Where the closure is
    symmetric energy is the work all the while, and constant after the last pulse, to 1e-11.
    """
    rows, series = of(name, "propagator"), of(name, "chebyshev")
    assert (rows.stepper, series.stepper) == ("propagator", "chebyshev")
    agree(rows, series, 1e-10 if len(rows.t) > 100 else 1e-11)
    work = series.energy.work
    assert np.abs(rows.energy.work - work).max() <= 1e-12 * np.abs(work).max()
    if rows.medium.closure == "consistent":
        energy, largest = rows.energy, rows.energy.total.max()
        assert np.abs(energy.total - energy.work).max() <= 1e-11 * largest
        assert np.ptp(energy.total[rows.t > rows.quiet_from]) <= 1e-11 * largest


def test_an_explicit_solver_has_its_order():
    """Law: the error against the exact modal solution falls as h^order, within ±0.1.

    All fields 4 µs after the start, on cells of l/2, at 0.12 and 0.06 radians of the fastest mode;
    errors 1e-8 to 1e-12. Measured 5.05.
    """
    solver, order, steps, errors = "Tsit5", 5, (1400, 2800), []
    medium, bar = ws.Medium(anisotropy=0.4, closure="printed"), ws.Bar(48, 5e-4, 4)
    source, end = ws.Ricker("phi1", 8.3e-3, 1.2e6), 4e-6
    exact = modal_field(medium, bar, [source], [end])
    for count in steps:
        field = ws.simulate(medium, bar, [source], end, 2, solver, end / count * 1.0001)
        assert field.stepper == solver
        assert field.step == pytest.approx(end / count)
        found = [
            np.abs(field[n][-1] - exact[n][0]).max() / np.abs(exact[n]).max() for n in field.names
        ]
        errors.append(max(found))
    assert errors[0] < 1e-4
    slope = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.1)


def test_dopri8_agrees_with_the_series():
    """Law: diffrax's own Dopri8 on the same equation gives the same field and the same work, with
    layers, losses and absorbers, prescribed rotation and body moment. Its step of half a radian of
    the fastest mode leaves 1e-10; held to 1e-8."""
    media = [dataclasses.replace(m, damping=LOSSY) for m in (FIRST, SECOND)]
    layers = stack((40, media[0]), (45, media[1]), (70, media[0]))
    bar = ws.layered_bar(layers, CELL, 8, "fixed", "absorbing", 8e-3)
    known = layers, bar, ENDS, 6e-6, 31
    other = ws.simulate(*known)
    assert other.stepper == "chebyshev"
    field = ws.simulate(*known, "Dopri8", 5e-9)
    agree(field, other, 1e-8)
    work = other.energy.work
    assert np.abs(field.energy.work - work).max() <= 1e-8 * np.abs(work).max()


def test_the_propagator_is_refused_where_waves_are_lost():
    pulse = [ws.Ricker("phi1", 0.02, 785e3)]
    lossy = dataclasses.replace(FIRST, damping=ws.Damping(mass=1e4))
    absorbing = ws.Bar(512, CELL, 8, "absorbing", "free", 8e-3)
    for medium, bar in ((lossy, ws.Bar(512, CELL, 8, "free", "free")), (FIRST, absorbing)):
        with pytest.raises(ValueError, match="solver = 'propagator': is for bars without losses"):
            ws.simulate(medium, bar, pulse, 1e-5, 21, "propagator")
