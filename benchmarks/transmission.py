"""T of a stack at many frequencies: wavesim in jax and in numpy beside packages for optical stacks.

    python benchmarks/transmission.py

The others do the same arithmetic per layer and frequency, a wave with its own k and Z, on an
optical stack of the same size; tmm takes one wavelength at a time, tmm-fast, where it is installed,
all, and many stacks at once. Warm: milliseconds a stack, the best of several calls, by the clock
and of processor time. Whole: seconds of a process that is begun, imports and computes one.
"""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

LAYERS, FREQUENCIES, BATCH, OTHER_BATCH = 18, 400, 1000, 100


Times = tuple[str, float, float]


def best(name: str, call: Callable[[], Any], times: int, stacks: int = 1) -> Times:
    """Seconds a stack, by the clock and of processor, of the fastest call but a first one."""
    call()
    taken = []
    for _ in range(times):
        begun = time.perf_counter(), time.process_time()
        call()
        taken.append((time.perf_counter() - begun[0], time.process_time() - begun[1]))
    return name, *(min(one) / stacks for one in zip(*taken, strict=True))


def ours(warm: bool = True) -> list[Times]:
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
    wait = jax.block_until_ready
    if not warm:
        wait(value(stack))
        return []
    batch, scales = jax.jit(jax.vmap(many)), jnp.linspace(0.8, 1.2, BATCH)
    return [
        best("wavesim, jax: value", lambda: wait(value(stack)), 30),
        best("wavesim, jax: value and gradient", lambda: wait(gradient(stack)), 30),
        best(f"wavesim, jax: one of {BATCH}", lambda: wait(batch(scales)), 3, BATCH),
        best(
            "wavesim, numpy: layered.transmission",
            lambda: layered.transmission(layers, "longitudinal", omega),
            3,
        ),
    ]


def optical() -> tuple[Any, Any, Any]:
    """Indices and thicknesses (nm) of a stack, and wavelengths."""
    rng = np.random.default_rng(1)
    n = np.concatenate([[1.0], rng.uniform(1.3, 2.5, LAYERS - 2), [1.0]])
    d = np.concatenate([[np.inf], rng.uniform(50, 400, LAYERS - 2), [np.inf]])
    return n, d, np.linspace(400, 800, FREQUENCIES)


def with_tmm(warm: bool = True) -> list[Times]:
    """Of tmm, one wavelength after another."""
    import tmm

    n, d, wavelengths = optical()

    def one_by_one() -> None:
        for wavelength in wavelengths:
            tmm.coh_tmm("s", n, d, 0.0, wavelength)

    if not warm:
        one_by_one()
        return []
    return [best("tmm: value", one_by_one, 3)]


def with_tmm_fast(warm: bool = True) -> list[Times]:
    """Of tmm-fast, all wavelengths at once; with a gradient by thickness, and in batches."""
    import tmm_fast
    import torch

    n, d, wavelengths = optical()
    indices = np.repeat(n[None, :, None], FREQUENCIES, axis=2) + 0j

    def value(count: int = 1) -> Any:
        many = np.repeat(indices, count, axis=0), np.repeat(d[None], count, axis=0)
        return tmm_fast.coh_tmm("s", *many, np.array([0.0]), wavelengths)["T"]

    def gradient() -> Any:
        inner = torch.tensor(d[1:-1], requires_grad=True)
        end = torch.tensor([np.inf], dtype=inner.dtype)
        found = tmm_fast.coh_tmm(
            "s", torch.tensor(indices), torch.cat([end, inner, end])[None],
            torch.tensor([0.0], dtype=inner.dtype), torch.tensor(wavelengths),
        )["T"]  # fmt: skip
        found.sum().backward()
        return inner.grad

    if not warm:
        value()
        return []
    return [
        best("tmm-fast: value", value, 10),
        best("tmm-fast: value and gradient by thickness", gradient, 10),
        best(f"tmm-fast: one of {OTHER_BATCH}", lambda: value(OTHER_BATCH), 2, OTHER_BATCH),
    ]


CONTESTANTS = {"wavesim": ours, "tmm": with_tmm, "tmm-fast": with_tmm_fast}


def versions() -> str:
    """Of all that is installed."""
    from importlib import metadata

    found = []
    for name in ("wavesim", "jax", "numpy", "tmm", "tmm-fast", "torch"):
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            found.append(f"{name} is not installed")
    return ", ".join(found)


def main() -> None:
    if len(sys.argv) > 1:  # in a process of its own: the whole of it is timed
        CONTESTANTS[sys.argv[1]](False)
        return
    print(
        f"T of {LAYERS} layers at {FREQUENCIES} frequencies; {versions()}; {os.cpu_count()} cores"
    )
    print(f"{'warm, ms a stack':<44}{'wall':>10}{'processor':>12}")
    there = []
    for name, contestant in CONTESTANTS.items():
        try:
            found = contestant()
        except ImportError:
            print(f"{name} is not installed: pip install {name}")
            continue
        there.append(name)
        for told, wall, processor in found:
            print(f"{told:<44}{1e3 * wall:10.3f}{1e3 * processor:12.3f}", flush=True)
    print(f"{'whole process, s':<44}{'wall':>10}{'processor':>12}")
    for name in there:
        begun, before = time.perf_counter(), os.times()
        subprocess.run([sys.executable, __file__, name], check=True)
        wall, after = time.perf_counter() - begun, os.times()
        processor = sum(after[2:4]) - sum(before[2:4])
        print(f"{name:<44}{wall:10.2f}{processor:12.2f}", flush=True)


if __name__ == "__main__":
    main()
