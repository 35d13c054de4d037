"""Single precision: the dense product of a step in float32, state and sums in float64.

    q⁺ = q + (q − q⁻) + 2 (C − 1) q,     ((C − 1) q)_n = F_n − F_{n−1} for a rotation

What is rounded is then the change in a step, not the field, and for a rotation the flux F of that
change: the mean rotation, which nothing holds back, is left alone. As rounding of C or of C − 1 it
would drift, with an error that grows with the number of steps.

Diffrax raises a state to the type of its times, and single times count no long run. A state in
float64 needs neither those nor other sources, energies and restarts, and was measured to lose no
speed beside one in float32.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.kernels import Convolution, dense


def in_single(part: Convolution, of_blocks: Sequence[np.ndarray], rotations: int) -> Convolution:
    """A group's convolution with the product with C in float32.

    Args:
        part: of :func:`kernels.convolution`.
        of_blocks: the kernels it was made of.
        rotations: number of rotations in each block.
    """
    made = []
    for kernel in of_blocks:
        change, own = kernel[:1].copy(), np.arange(kernel.shape[1])
        change[0, own, own, kernel.shape[-1] // 2] -= 1
        change[0, :rotations] = np.cumsum(change[0, :rotations], axis=-1)
        made.append(dense(change, part.run, part.reach))
    rounded = jnp.asarray(np.stack(made), jnp.float32)
    return dataclasses.replace(part, cosine=rounded, fluxes=rotations)


def recurrence(
    part: Convolution,
    made: Sequence[jax.Array],
    now: Sequence[jax.Array],
    before: Sequence[jax.Array],
) -> tuple[jax.Array, ...]:
    """A group after a step without sources, 2C q − q⁻.

    Args:
        part: its convolution.
        made: product of its matrix with q.
        now, before: q and q⁻, components of shape (tracks, blocks, N).
    """
    if part.fluxes is None:
        return tuple(2 * c - b for c, b in zip(made, before, strict=True))
    changes = [change.astype(float) for change in made]
    for i in range(part.fluxes):
        changes[i] = changes[i] - jnp.roll(changes[i], 1, axis=-1)
    return tuple(q + (q - b) + 2 * c for q, b, c in zip(now, before, changes, strict=True))
