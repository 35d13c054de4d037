"""Sources on the grid: which points of which components a pulse drives, and how hard.

Scaled units throughout, times included. The profiles are numpy arrays: plain numbers also under
``jax.jit``, where ``wavesim.timedomain.response`` must see which cells a pulse drives.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.grid.bar import Bar
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.material.sectors import Block, grouped
from wavesim.sources import Source
from wavesim.timedomain.operator import Operator, State


class Forcing(eqx.Module):
    """Σ_j g_j s_j(t): profiles g_j over the grid, signals s_j of unit amplitude scale.

    Attributes:
        profiles: for each source a state g_j.
        pulses: the sources, whose signals are s_j(t).
        time_scale: s in one scaled unit of time.
    """

    profiles: tuple[State, ...]
    pulses: tuple[Source, ...] = eqx.field(static=True)
    time_scale: float = eqx.field(static=True)

    def signals(self, t: jax.Array) -> jax.Array:
        """s_j at scaled times t of any shape; result (sources, *shape of t)."""
        return jnp.stack([pulse.signal(t * self.time_scale) for pulse in self.pulses])

    def __call__(self, t: jax.Array) -> State:
        """Σ_j g_j s_j(t)."""
        amounts = self.signals(t)
        terms = [
            jax.tree.map(lambda g, s=s: s * g, profile)
            for s, profile in zip(amounts, self.profiles, strict=True)
        ]
        return jax.tree.map(lambda *parts: sum(parts), *terms)


def forcing(
    pulses: Sequence[Source],
    medium: Medium,
    bar: Bar,
    blocks: Sequence[Block],
    operator: Operator,
) -> Forcing:
    """Lay the sources on the grid of an operator.

    Args:
        pulses: the sources, at least one.
        medium: the medium whose units the operator is scaled by, of plain numbers.
        bar: the grid.
        blocks: those of the operator.
        operator: for the shape of its states.

    Returns:
        The forcing.

    Raises:
        ValueError: a source is outside the bar or too wide for it.
    """
    units = scales(medium)
    profiles = []
    for pulse in pulses:
        density, indices = bar.spread(pulse.position, pulse.width, pulse.staggered)
        line = np.zeros(bar.cells)
        np.add.at(line, indices, density)
        line /= units.force(pulse.field)
        profiles.append(_on_blocks(pulse.field, line, blocks, operator.zero()))
    return Forcing(tuple(profiles), tuple(pulses), float(units.time))


def _on_blocks(field: str, line: np.ndarray, blocks: Sequence[Block], zero: State) -> State:
    state: list[Any] = []
    for components, stacked in zip(zero, grouped(blocks), strict=True):
        arrays = [np.zeros(component.shape) for component in components]
        for s, block in enumerate(stacked):
            for array, part in zip(arrays, block.rotations + block.curvatures, strict=True):
                array[s] += part.get(field, 0.0) * line
        state.append(tuple(arrays))
    return tuple(state)
