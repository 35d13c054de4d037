"""Many steps of a uniform periodic bar in one: the exact propagator by Fourier transform in space.

    (q̂, q̇̂)(t + nh) = Mⁿ (q̂, q̇̂)(t),    M = [[Ĉ, Ŝ], [L̂Ŝ, Ĉ]] for each wavenumber of the bar

Round a periodic bar the kernels of C, S and LS are circulant, so that transforms make them small
matrices: a step costs two transforms however long it is, and the dense products of the banded
propagator cost less only where a step is short. Powers of M are products, not powers of its
eigenvalues, which no closure needs to have. The sources enter as they do a step of the Chebyshev
stepper (``response.py``), over steps of h; where none acts n steps are taken at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.kernels import check_reach
from wavesim.timedomain.operator import State
from wavesim.timedomain.response import PulseTables, add_pulses, pulse_work
from wavesim.timedomain.steppers import Motion, WaveEquation, WaveSolver


class Circulant(eqx.Module):
    """Mⁿ of all groups.

    Attributes:
        powers: for each group shape (2 fields, 2 fields, blocks, N/2 + 1), complex.
        cells: N.
    """

    powers: tuple[jax.Array, ...]
    cells: int = eqx.field(static=True)

    def __call__(self, q: State, v: State) -> tuple[State, State]:
        """(q, q̇) after n steps without sources."""
        new_q, new_v = [], []
        for power, *group in zip(self.powers, q, v, strict=True):
            before = jnp.fft.rfft(jnp.stack([*group[0], *group[1]]))
            after = jnp.fft.irfft((power * before).sum(axis=1), self.cells)
            new_q.append(tuple(after[: len(group[0])]))
            new_v.append(tuple(after[len(group[0]) :]))
        return tuple(new_q), tuple(new_v)


def circulant(of_groups: Sequence[Sequence[np.ndarray]], cells: int, count: int) -> Circulant:
    """Powers of a step's propagator.

    Args:
        of_groups: for each group the kernels of its blocks (``kernels.kernels``).
        cells: N.
        count: n.

    Raises:
        ValueError: the kernels reach round the bar.
    """
    made = []
    for of_blocks in of_groups:
        steps = np.stack([_symbol(kernel, cells) for kernel in of_blocks])
        made.append(jnp.asarray(np.linalg.matrix_power(steps, count).transpose(2, 3, 0, 1)))
    return Circulant(tuple(made), cells)


def _symbol(kernel: np.ndarray, cells: int) -> np.ndarray:
    """M of a block, shape (N/2 + 1, 2 fields, 2 fields), of its kernels of C, S and LS."""
    length = kernel.shape[-1]
    check_reach(length // 2, length, cells)
    ring = np.zeros((*kernel.shape[:-1], cells))
    ring[..., (np.arange(length) - length // 2) % cells] = kernel
    C, S, LS = np.fft.rfft(ring).transpose(0, 3, 1, 2)
    return np.block([[C, S], [LS, C]])


class Driven(eqx.Module):
    """A step of h while sources act: the propagator over it, and the sources' tables."""

    once: Circulant
    pulses: PulseTables

    def __call__(self, t: jax.Array, y: Motion, equation: WaveEquation) -> Motion:
        """The motion a step later."""
        signal = equation.forcing.signals(t + self.pulses.nodes)
        work = pulse_work(self.pulses, equation.forcing, t, y.q, y.v)
        fields = add_pulses(self.pulses, signal, signal, *self.once(y.q, y.v))
        return Motion(*fields, y.work + work)


class Strides(WaveSolver):
    """Strides of many steps in one where no source acts, after steps of h where one may.

    The steps and strides that diffrax takes must be those that the tables were made for.

    Attributes:
        stride: the propagator over a stride.
        driven: a step with sources; None where all have ended.
    """

    stride: Circulant
    driven: Driven | None = None

    def order(self, terms: Any) -> None:
        return None

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any) -> None:
        return None

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Motion, args: Any, solver_state: Any, made_jump: Any
    ) -> Any:
        def silent() -> Motion:
            return Motion(*self.stride(y0.q, y0.v), y0.work)

        driven = self.driven
        if driven is None:
            y1 = silent()
        else:
            one_step = t1 - t0 < 1.5 * driven.pulses.step
            y1 = jax.lax.cond(one_step, lambda: driven(t0, y0, args), silent)
        return y1, None, {"y0": y0, "y1": y1}, None, diffrax.RESULTS.successful
