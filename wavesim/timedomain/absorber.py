"""The absorbing layer at an end: how its friction grows with depth.

A matched layer stretches ∂ₓ to ∂ₓ/(1 + d/∂ₜ) with d = d₀ (depth/W)³, d₀ = −4 c_∞ ln R/2W: the
fastest wave, of speed c_∞, goes there and back through it with the amplitude R, before the grid's
own reflection. No branch of these media runs backward, so that such a layer is stable.

In a gap, where D(ω²) < 0, it gives energy instead of taking it, and a wave caught in a layer of the
bar next to it, whose tail reaches its end, would grow, by 1e-3 in a unit of time at the worst that
was found. So deep inside, where no propagating wave comes, B is calmed by friction
α_B = 2.5e-3 d₀ (depth/W)¹²: growth then is rounding where W is eight branch lengths, 1e-8 at four.
"""

from __future__ import annotations

import math

import numpy as np

from wavesim.grid.bar import Bar
from wavesim.material.layers import Layers

# Of the fastest wave. Slower waves, and those near a cutoff, whose phase velocity c is high, are
# reflected more or less: R to the power c_∞/c.
REFLECTION = 1e-28
_POWER = 3
_CALM = 2.5e-3
# One of fewer branch lengths reflects more than 1e-4.
_LEAST_LENGTHS = 4


def least_absorber(layers: Layers) -> float:
    """Length (m) below which an absorbing layer reflects too much."""
    return _LEAST_LENGTHS * max(float(medium.length_scale) for medium in layers.media)


def strongest_absorption(layers: Layers, bar: Bar, end: str) -> float:
    """d₀ at an end, 1/s; 0 where it does not absorb.

    Args:
        layers: what the bar is made of, of plain numbers.
        bar: its grid.
        end: "left" or "right".
    """
    if getattr(bar, end) != "absorbing":
        return 0.0
    medium = layers.at(0.0 if end == "left" else layers.length)
    return -4 * medium.fastest * math.log(REFLECTION) / (2 * bar.absorber)


def absorption(layers: Layers, bar: Bar, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """d and α_B at positions on a bar.

    Args:
        layers: what it is made of, of plain numbers.
        bar: its grid.
        x: positions, shape (n,), m.

    Returns:
        Both of shape (n,), 1/s.
    """
    d, calm = np.zeros(len(x)), np.zeros(len(x))
    for end in ("left", "right"):
        most = strongest_absorption(layers, bar, end)
        if most:
            inward = x if end == "left" else bar.length - x
            depth = np.clip(1 - inward / bar.absorber, 0, 1)
            d += most * depth**_POWER
            calm += _CALM * most * depth ** (4 * _POWER)
    return d, calm
