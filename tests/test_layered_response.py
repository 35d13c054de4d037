"""The exact response of layered bars against a boundary-value solve that knows no waves."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from collocated import fields

from wavesim import layered as layeredwave
from wavesim import planewave
from wavesim.material.damping import Damping
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium
from wavesim.sources import Ricker

ONE = Medium(anisotropy=0.25, closure="consistent", G_n_g=0.0)
TWO = Medium(anisotropy=0.6, closure="consistent", density=2300.0, G_n_a=8.0, G_n_g=0.0)
BAR = ONE.time_scale
LOSS = Damping(mass=0.03 / BAR, stiffness=0.02 * BAR, rates=(1 / BAR,), strengths=(0.1,))


def bar(gradient, loss, graded):
    """Two uniform layers with a third between them, graded or not."""
    one, two = (
        dataclasses.replace(medium, G_n_g=share * gradient, damping=Damping() if not loss else LOSS)
        for medium, share in ((ONE, 1.0), (TWO, 1.5))
    )
    middle = Layer(2e-3, 4.5e-3, one, two) if graded else Layer(2e-3, 4.5e-3, two)
    return Layers((Layer(0.0, 2e-3, one), middle, Layer(4.5e-3, 6e-3, two if graded else one)))


@pytest.mark.parametrize(
    ("field", "graded", "gradient", "loss", "ends"),
    [
        ("phi1", False, 0.0, False, ("fixed", "free")),
        ("B11", True, 0.0, False, ("free", "free")),
        ("phi1", True, 0.0, True, ("free", "absorbing")),
        ("B22", False, 0.0, True, ("fixed", "absorbing")),
        ("phi1", True, 0.5, True, ("fixed", "fixed")),
        ("B11", False, 0.5, False, ("fixed", "free")),
        ("B22", True, 0.5, False, ("free", "free")),
    ],
)
def test_fields_are_those_of_a_boundary_value_solve(field, graded, gradient, loss, ends):
    """All fields, inside the source and away from it, in its layer and in others, at complex ω.

    Tolerance 1e-7 of the largest value: the collocation matrix, of condition 1e8 and more, leaves
    that much. Measured at most 7e-8.
    """
    layers = bar(gradient, loss, graded)
    # A Gaussian over the graded layer and into its neighbour.
    source = Ricker(field, position=3.4e-3, peak_frequency=6e5, width=4e-4)
    receivers = {"a": 1.1e-3, "b": 3.3e-3, "c": 4.1e-3, "d": 5.2e-3}
    band, gap = 0.5 / BAR + 0.02j / BAR, 1.3 / BAR + 0.05j / BAR
    for omega in (gap,) if gradient else (band, gap):
        found = layeredwave.field_spectra(
            layers, *ends, [source], receivers, omega, gradient=gradient > 0
        )
        far = ends[1]
        if far == "absorbing":
            end = layers.at(layers.length)
            # Z = ρβ ω ι/k, the impedance of the wave that goes on beyond the end.
            k = planewave.wavenumber(end, "longitudinal", omega)[0]
            far = end.density * end.beta * omega * end.damping.inertia(omega) / k
        known = fields(layers, ends[0], far, source, omega, list(receivers.values()), gradient > 0)
        for name, values in known.items():
            own = np.array([found[receiver][name][0] for receiver in receivers])
            assert np.abs(own - values).max() <= 1e-7 * np.abs(values).max()
