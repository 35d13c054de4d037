"""The leapfrog scheme that several peers share: its step limit and its sampled forces.

    v ← v + h (L q + f(t_n)),    q ← q + h v,    t_{n+1} = t_n + h

of second order, stable for h < 2/√Λ. It starts at rest.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from problem import Problem

from wavesim.material.sectors import BLOCKS
from wavesim.timedomain.timestep import spectral_bound

Float = NDArray[np.float64]


def least_steps(problem: Problem) -> int:
    """Fewest steps over the duration that are stable; Λ is 1 % above the largest eigenvalue."""
    bound = spectral_bound(problem.medium, problem.bar, BLOCKS)
    return math.ceil(problem.duration * math.sqrt(bound) / 2)


def forces(problem: Problem, steps: int) -> tuple[Float, int]:
    """h² times the signal of each drive before each step, as long as any acts.

    Returns:
        Shape (driven steps, drives), strengths included, and the number of driven steps.
    """
    h = problem.duration / steps
    count = min(steps, math.ceil(problem.quiet_from / h) + 1)
    t = np.arange(count) * h
    columns = [h**2 * drive.strength * drive.signal(t) for drive in problem.drives]
    return np.stack(columns, axis=-1), count
