"""Bars with layers, ends and losses that several tests share, and A of them as a dense matrix."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from wavesim.grid.bar import Bar, layered_bar
from wavesim.material.damping import Damping, constant_quality
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import Medium
from wavesim.material.sectors import BLOCKS
from wavesim.timedomain.generator import generator

CELL = 1.25e-4
SOFT = Medium(anisotropy=0.3, closure="consistent")
STIFF = Medium(closure="consistent", G_n_a=9.0, G_n_r=7.0, density=2000.0, particle_radius=6e-4)
LOSSY = constant_quality(30.0, (2e5, 2e6))
EVERYTHING = dataclasses.replace(LOSSY, mass=1e5, stiffness=2e-9)


def lossy(medium: Medium, damping: Damping = LOSSY) -> Medium:
    return dataclasses.replace(medium, damping=damping)


def three(closure="consistent", damping=None, thin=2.5e-3):
    """Uniform, graded and uniform, each stretch with cells of its own size."""
    soft = dataclasses.replace(SOFT, closure=closure)
    stiff = dataclasses.replace(STIFF, closure=closure)
    middle = dataclasses.replace(soft, anisotropy=0.6)
    if damping is not None:
        soft, middle = lossy(soft, damping), lossy(middle, damping)
    return Layers(
        (
            Layer(0.0, thin, soft),
            Layer(thin, 2.1 * thin, soft, middle),
            Layer(2.1 * thin, 3.3 * thin, stiff),
        )
    )


def built(layers, bar: Bar, blocks=BLOCKS[:1], with_gradient=False):
    return generator(layers, bar, blocks, layers.first, with_gradient)


def dense(A):
    """A as a matrix over the flattened state, by its action on each unit state; and unravel."""
    flat, unravel = ravel_pytree(A.zero())
    columns = jax.jit(jax.vmap(lambda e: ravel_pytree(A(unravel(e)))[0]))(jnp.eye(flat.size))
    return np.asarray(columns).T, unravel


def fitted(layers, left, right, order=8, cell=CELL):
    return layered_bar(
        layers, cell, order, left, right, 2e-3 if "absorbing" in (left, right) else 0
    )
