"""Fields of bars made up so that what is to be read from them is known."""

from __future__ import annotations

import dataclasses

import numpy as np

from wavesim.grid.bar import layered_bar
from wavesim.material.damping import Damping, constant_quality
from wavesim.material.granular_equations import ROTATION
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium
from wavesim.readings.bar.bloch import Cells
from wavesim.readings.bar.pulse_test import pulse_test
from wavesim.readings.bar.reading import Reading
from wavesim.readings.bar.transmission import Scattered
from wavesim.simulation.field import Field
from wavesim.simulation.simulation import simulation
from wavesim.sources import Ricker

SOFT = Medium(closure="consistent")
STIFF = Medium(closure="consistent", G_n_a=20.0, G_n_r=20.0)
LOSSY = dataclasses.replace(STIFF, damping=constant_quality(50.0, (5e4, 2e6)))
LONGITUDINAL = next(block for block in ROTATION.blocks if block.sector == "longitudinal")
T = np.linspace(0, 1e-4, 801)


def made_field(t, values, medium, bar, sources, receivers=None, energy=None, **more):
    """A field of given values on a bar of a medium or of layers."""
    made_by = simulation(medium, bar, sources, float(t[-1]), len(t), receivers)
    return Field(made_by, t, values, energy, **more)


def field_of(layers, bar, sources, receivers=(), values=None, t=T, energy=None):
    """A field of phi1 alone; where no values are given each holds its own position."""
    made = np.broadcast_to(bar.nodes, (len(t), len(bar.nodes))) if values is None else values
    places = receivers if isinstance(receivers, dict) else {str(n): x for n, x in receivers}
    return made_field(t, {"phi1": made}, layers, bar, sources, places, energy)


def chain(*stretches, start=0.0):
    """Layers of given (thickness, medium)."""
    found = []
    for thickness, medium in stretches:
        found.append(Layer(start, start + thickness, medium))
        start = found[-1].end
    return Layers(tuple(found))


SPEED = 0.9 * STIFF.fastest


def pulsed(layers, right, places, source=None, echo=0.0, absorber=0.0, t=T):
    """Pulses that pass the receivers at SPEED, and perhaps come back after a gate has closed."""
    bar = layered_bar(layers, 1.25e-4, 8, "free", right, absorber)
    source = source or Ricker("phi1", 0.004, 3e5)
    own = Ricker("phi1", 0.004, 3e5)
    made = own.signal(t[:, None] - (bar.nodes - 0.004) / SPEED)
    if echo:
        made = made + 0.7 * own.signal(t[:, None] - echo - (bar.nodes - 0.004) / SPEED)
    field = field_of(layers, bar, [source], places, made, t)
    exact = {name: {"phi1": field.at(x, "phi1")} for name, x in places.items()}
    return field, pulse_test(field, LONGITUDINAL, exact, 18.0)


PLACES = {"1": 0.010, "2": 0.014, "3": 0.018}


def plain_field(energy=None, receivers=PLACES, absorbing=False, lossy=False):
    medium = dataclasses.replace(STIFF, damping=Damping(mass=1e3)) if lossy else STIFF
    layers = chain((0.06, medium))
    ends = ("absorbing", "absorbing", 8e-3) if absorbing else ("free", "free", 0.0)
    bar = layered_bar(layers, 1.25e-4, 8, *ends)
    values = np.zeros((len(T), len(bar.nodes)))
    source = Ricker("phi1", 0.012, 3e5)
    return field_of(layers, bar, [source], receivers, values, energy=energy)


def reading_of(error=None, scattered=(), cells=(), ringing=(), pulses=(), exact=None):
    return Reading(exact or {}, error or {}, scattered, cells, ringing, pulses)


def scattered_of(omega, sigma, T, R, T_exact, R_exact, judged, line=None, real=None):
    """T and R of longitudinal waves, made up; at real ω as at ω + iσ unless given."""
    real = T_exact if real is None else real
    return Scattered(
        sector="longitudinal", before=slice(0), behind=slice(0), faces=(0.0, 0.0), k=(omega, omega),
        omega=omega, sigma=sigma, T=T, R=R, T_exact=T_exact, R_exact=R_exact, judged=judged,
        line=line or (omega, T_exact, R_exact, real), T_real=real, R_real=real,
    )  # fmt: skip


def cells_of(period, omega, sigma, q, cosine, judged, line=None):
    """Bloch waves of a longitudinal stack, made up, as they should be."""
    return Cells(
        sector="longitudinal", period=period, nodes=slice(0), step=1, omega=omega, sigma=sigma,
        cosine_exact=cosine, driven=judged, line=line or (omega, q), q=q, q_exact=q, cosine=cosine,
        judged=judged,
    )  # fmt: skip
