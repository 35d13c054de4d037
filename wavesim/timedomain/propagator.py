"""The default stepper: the exact propagator of a uniform bar, one dense product a step.

    q⁺ = 2C q − q⁻ + ∫₀^h S(h−τ) g [s(t+τ) + s(t−τ)] dτ
    v⁺ = 2C v − v⁻ + ∫₀^h C(h−τ) g [s(t+τ) − s(t−τ)] dτ

C = cos(h√−L), S = sin(h√−L)/√−L; v = q̇ obeys the same equation with the pulse's derivative, which
the second line holds integrated by parts. Exact at any step, to rounding; in single precision as
``single.py`` has it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.material.medium import Medium
from wavesim.material.scaling import block_coefficients, scales
from wavesim.material.sectors import Block, grouped
from wavesim.timedomain.kernels import Convolution, convolution, convolve, convolve_all, kernels
from wavesim.timedomain.operator import State
from wavesim.timedomain.response import PulseTables, add_pulses, pulse_work
from wavesim.timedomain.single import in_single, recurrence
from wavesim.timedomain.steppers import Motion, WaveSolver
from wavesim.timedomain.timestep import Precision, spectral_bound


class Propagator(WaveSolver):
    """Two-term recurrence of the exact propagator; see the head of this file.

    The step that diffrax takes must be the one that the kernels were made for.
    """

    kernels: tuple[Convolution, ...]
    pulses: PulseTables

    def order(self, terms: Any) -> None:
        return None

    def init(self, terms: Any, t0: Any, t1: Any, y0: Motion, args: Any) -> tuple[State, State]:
        """(q⁻, v⁻) one step before: C q − S v and C v − LS q, and the pulses run backward."""
        C, S, LS = convolve_all(self.kernels, _stack(y0.q, y0.v))
        q = jax.tree.map(lambda c, s: c[0] - s[1], C, S)
        v = jax.tree.map(lambda c, s: c[1] - s[0], C, LS)
        behind = args.forcing.signals(t0 - self.pulses.nodes)
        return add_pulses(self.pulses, behind, -behind, q, v)

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Motion, args: Any, solver_state: Any, made_jump: Any
    ) -> Any:
        now, before = _stack(y0.q, y0.v), _stack(*solver_state)
        made = convolve(self.kernels, now)
        after = tuple(map(recurrence, self.kernels, made, now, before))
        q, v = _part(after, 0), _part(after, 1)

        def driven() -> Motion:
            ahead = args.forcing.signals(t0 + self.pulses.nodes)
            behind = args.forcing.signals(t0 - self.pulses.nodes)
            work = pulse_work(self.pulses, args.forcing, t0, y0.q, y0.v)
            fields = add_pulses(self.pulses, ahead + behind, ahead - behind, q, v)
            return Motion(*fields, y0.work + work)

        still_on = t0 < self.pulses.end + self.pulses.step
        y1 = jax.lax.cond(still_on, driven, lambda: Motion(q, v, y0.work))
        return y1, None, {"y0": y0, "y1": y1}, (y0.q, y0.v), diffrax.RESULTS.successful


def _stack(q: State, v: State) -> State:
    return jax.tree.map(lambda a, b: jnp.stack([a, b]), q, v)


def _part(both: State, index: int) -> State:
    return jax.tree.map(lambda a: a[index], both)


def bar_kernels(
    medium: Medium,
    bar: Bar,
    blocks: Sequence[Block],
    step: float,
    precision: Precision = "double",
) -> tuple[Convolution, ...]:
    """Kernels of all blocks that are integrated.

    Args:
        medium: of plain numbers.
        bar: the grid.
        blocks: those of the operator.
        step: h, scaled.
        precision: of the products of the steps.

    Returns:
        For each group of the operator, its convolution.

    Raises:
        ValueError: the kernels reach round the bar.
    """
    made = []
    for stacked, of_blocks in zip(
        grouped(blocks), block_kernels(medium, bar, blocks, step), strict=True
    ):
        part = convolution(of_blocks, bar.cells)
        if precision == "single":
            part = in_single(part, of_blocks, len(stacked[0].rotations))
        made.append(part)
    return tuple(made)


def block_kernels(
    medium: Medium, bar: Bar, blocks: Sequence[Block], step: float
) -> list[list[np.ndarray]]:
    """For each group of the operator the kernels of its blocks, from arguments likewise."""
    spacing = bar.spacing / medium.length_scale

    def of_block(block: Block) -> np.ndarray:
        bound = spectral_bound(medium, bar, [block])
        return kernels(
            block_coefficients(medium, block, scales(medium)), spacing, bar.order, step, bound
        )

    return [[of_block(block) for block in stacked] for stacked in grouped(blocks)]
