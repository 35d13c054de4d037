"""T of a stack at many frequencies: wavesim in jax and in numpy beside packages for optical stacks.

    python benchmarks/transmission.py

The others do the same arithmetic per layer and frequency, a wave with its own k and Z, on an
optical stack of the same size; tmm takes one wavelength at a time, tmm-fast, where it is installed,
all. Milliseconds a stack, the best of several calls.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import numpy as np

LAYERS, FREQUENCIES, BATCH = 18, 400, 1000


def best(call: Callable[[], Any], times: int) -> float:
    """Seconds of the fastest of some calls, one before them not counted."""
    call()
    taken = []
    for _ in range(times):
        begun = time.perf_counter()
        call()
        taken.append(time.perf_counter() - begun)
    return min(taken)


def ours() -> list[tuple[str, float]]:
    """Value, value and gradient, a batch, and the scattering matrices of layered/."""
    import jax
    import jax.numpy as jnp

    from wavesim import layered
    from wavesim.differentiable.stack_transmission import transmission
    from wavesim.differentiable.traced_layers import traced_layers
    from wavesim.material.layers import Layer, Layers
    from wavesim.material.medium import Medium

    rng, end, made = np.random.default_rng(1), 0.0, []
    for G in rng.uniform(3, 40, LAYERS):
        start, end = end, end + rng.uniform(2e-4, 6e-3)
        made.append(Layer(start, end, Medium(closure="consistent", G_n_a=G, G_n_r=G)))
    layers, omega = Layers(tuple(made)), 2 * np.pi * np.linspace(1e5, 5e5, FREQUENCIES)
    stack = traced_layers(layers)

    def power(stack: Any) -> Any:
        return jnp.sum(jnp.abs(transmission(stack, "longitudinal", omega).T) ** 2)

    def many(scale: Any) -> Any:
        own = dataclasses.replace(stack, thickness=stack.thickness * scale)
        return transmission(own, "longitudinal", omega).T

    value, gradient = jax.jit(power), jax.jit(jax.value_and_grad(power))
    batch, scales = jax.jit(jax.vmap(many)), jnp.linspace(0.8, 1.2, BATCH)
    wait = jax.block_until_ready
    return [
        ("wavesim, jax: value", best(lambda: wait(value(stack)), 30)),
        ("wavesim, jax: value and gradient", best(lambda: wait(gradient(stack)), 30)),
        (f"wavesim, jax: one of {BATCH}", best(lambda: wait(batch(scales)), 3) / BATCH),
        (
            "wavesim, numpy: layered.transmission",
            best(lambda: layered.transmission(layers, "longitudinal", omega), 3),
        ),
    ]


def others() -> list[tuple[str, float]]:
    """The packages that are installed."""
    rng, found = np.random.default_rng(1), []
    n = np.concatenate([[1.0], rng.uniform(1.3, 2.5, LAYERS - 2), [1.0]])
    d = np.concatenate([[np.inf], rng.uniform(50, 400, LAYERS - 2), [np.inf]])
    wavelengths = np.linspace(400, 800, FREQUENCIES)
    try:
        import tmm

        def one_by_one() -> None:
            for wavelength in wavelengths:
                tmm.coh_tmm("s", n, d, 0.0, wavelength)

        found.append(("tmm", best(one_by_one, 3)))
    except ImportError:
        print("tmm is not installed: pip install -e '.[bench]'")
    try:
        import tmm_fast

        indices = np.repeat(n[None, :, None], FREQUENCIES, axis=2) + 0j
        arguments = ("s", indices, d[None], np.array([0.0]), wavelengths)
        found.append(("tmm-fast", best(lambda: tmm_fast.coh_tmm(*arguments), 5)))
    except ImportError:
        print("tmm-fast is not installed: pip install tmm-fast (needs torch)")
    return found


if __name__ == "__main__":
    print(f"T of {LAYERS} layers at {FREQUENCIES} frequencies, ms a stack")
    for name, seconds in ours() + others():
        print(f"{name:<40}{1e3 * seconds:10.3f}")
