"""The default stepper: the exact propagator of a uniform bar, one dense product a step.

    q⁺ = 2C q − q⁻ + ∫₀^h S(h−τ) g [s(t+τ) + s(t−τ)] dτ
    v⁺ = 2C v − v⁻ + ∫₀^h C(h−τ) g [s(t+τ) − s(t−τ)] dτ

C = cos(h√−L), S = sin(h√−L)/√−L; v = q̇ obeys the same equation with the pulse's derivative, which
the second line holds integrated by parts. Exact at any step, to rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.bar import Bar
from wavesim.kernels import Convolutions, convolution, convolve, kernels
from wavesim.medium import Medium
from wavesim.operator import State
from wavesim.response import PulseTables, add_pulses, pulse_work
from wavesim.sectors import Block, block_form, grouped
from wavesim.steppers import Motion, WaveSolver
from wavesim.timestep import spectral_bound


class Propagator(WaveSolver):
    """Two-term recurrence of the exact propagator; see the head of this file.

    The step that diffrax takes must be the one that the kernels were made for.
    """

    kernels: Convolutions
    pulses: PulseTables

    def order(self, terms: Any) -> None:
        return None

    def init(self, terms: Any, t0: Any, t1: Any, y0: Motion, args: Any) -> tuple[State, State]:
        """(q⁻, v⁻) one step before: C q − S v and C v − LS q, and the pulses run backward."""
        both = _stack(y0.q, y0.v)
        c = convolve(self.kernels, "cosine", both)
        s = convolve(self.kernels, "sine", both)
        Sq, Sv = _part(s, 0), _part(s, 1)
        q = jax.tree.map(jnp.subtract, _part(c, 0), Sv)
        v = jax.tree.map(jnp.subtract, _part(c, 1), args.operator(Sq))
        behind = args.forcing.signals(t0 - self.pulses.nodes)
        return add_pulses(self.pulses, behind, -behind, q, v)

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Motion, args: Any, solver_state: Any, made_jump: Any
    ) -> Any:
        both = convolve(self.kernels, "cosine", _stack(y0.q, y0.v))
        before = _stack(*solver_state)
        after = jax.tree.map(lambda a, b: 2 * a - b, both, before)
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


def bar_kernels(medium: Medium, bar: Bar, blocks: Sequence[Block], step: float) -> Convolutions:
    """Kernels of all blocks that are integrated; blocks of one relation share theirs.

    Args:
        medium: of plain numbers.
        bar: the grid.
        blocks: those of the operator.
        step: h, scaled.

    Returns:
        For each group of the operator, its convolutions.

    Raises:
        ValueError: the kernels reach round the bar.
    """
    spacing = bar.spacing / medium.length_scale
    groups = []
    for stacked in grouped(blocks):
        alike: list[tuple[Any, list[int]]] = []
        for number, block in enumerate(stacked):
            form = block_form(medium, block)
            for other, numbers in alike:
                if _same(form, other):
                    numbers.append(number)
                    break
            else:
                alike.append((form, [number]))
        groups.append(
            tuple(
                convolution(
                    kernels(
                        form,
                        spacing,
                        bar.order,
                        step,
                        spectral_bound(medium, bar, [stacked[numbers[0]]]),
                    ),
                    tuple(numbers),
                    bar.cells,
                )
                for form, numbers in alike
            )
        )
    return tuple(groups)


def _same(one: Any, other: Any) -> bool:
    names = ("c_pp", "c_pb", "c_bp", "c_bb", "gamma")
    return all(np.array_equal(getattr(one, n), getattr(other, n)) for n in names)
