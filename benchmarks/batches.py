"""Runs and gradients a second of a batch through the time domain, on whatever device jax finds.

    python benchmarks/batches.py [SIZES] [GRADIENT_SIZES]      # such as 1,16,256 1,16

Eight layers between two buffers, 1,024 cells, 481 frames, one receiver, float64; the members differ
in the anisotropy of each layer. The best of three, after a first that compiles.
"""

import dataclasses
import sys
import time

import jax
import jax.numpy as jnp
import numpy as np

import wavesim as ws

HOST = ws.Medium(closure="consistent", anisotropy=0.6, G_n_a=9.0)


def layers(p):
    """A stack of anisotropies p."""
    media = [HOST, *(dataclasses.replace(HOST, G_n_a=5.0, anisotropy=a) for a in p), HOST]
    ends = np.cumsum([0.0, 0.064, *8 * [0.004], 0.032])
    return ws.Layers(tuple(map(ws.Layer, ends[:-1], ends[1:], media)))


BAR = ws.layered_bar(layers(8 * [0.3]), 1.25e-4)
PLAN = ws.Simulation(
    layers(8 * [0.6]), BAR, (ws.Ricker("phi1", 0.03, 6e5),), duration=120e-6, samples=481
)


def signal(p):
    """φ₁ behind the stack."""
    return ws.traced_fields(layers(p), PLAN, [0.11])["phi1"][:, 0]


def energy(p):
    """Σ φ₁², of order 1."""
    return jnp.sum(signal(p) ** 2) * 1e20


def told(what, function, sizes):
    """Print the rate of each size."""
    for size in sizes:
        members = jnp.asarray(np.random.default_rng(1).uniform(0, 0.6, (size, 8)))
        times = []
        for _ in range(4):
            begun = time.perf_counter(), time.process_time()
            jax.block_until_ready(function(members))
            times.append((time.perf_counter() - begun[0], time.process_time() - begun[1]))
        wall, cpu = min(times[1:])
        print(
            f"{what}, {size} members: {size / wall:.1f}/s, {size / cpu:.1f} in a second of "
            f"processor time; the first took {times[0][0]:.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    given = [[int(size) for size in text.split(",")] for text in sys.argv[1:]] or [[1, 16], [1, 16]]
    print(jax.devices(), f"jax {jax.__version__}")
    told("runs", jax.jit(jax.vmap(signal)), given[0])
    if len(given) > 1:
        told("gradients", jax.jit(jax.vmap(jax.value_and_grad(energy))), given[1])
