"""What diffrax integrates: ẏ = A y + Σ_j G_j s_j(t), together with the work of its sources."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax

from wavesim.timedomain.energy_and_work import energy, power
from wavesim.timedomain.operator import Operator, States
from wavesim.timedomain.source_terms import SourceTerms


class Motion(NamedTuple):
    """State of a run, scaled.

    Attributes:
        y: fields, rates and memory.
        work: done by the sources since the start, energy per area of the section.
    """

    y: States
    work: Any


class Equation(eqx.Module):
    """ẏ = A y + Σ_j G_j s_j(t), and Ẇ the power of the sources.

    Attributes:
        operator: A.
        sources: Σ_j G_j s_j(t).
    """

    operator: Operator
    sources: SourceTerms

    def __call__(self, t: Any, motion: Motion) -> Motion:
        """Rate of a motion at a scaled time."""
        signals = self.sources.at(t)
        rate = self.sources.add(self.operator(motion.y), signals)
        return Motion(rate, power(self.operator, self.sources, motion.y, signals))

    def observe(self, motion: Motion) -> Any:
        """(φ, B) of each group, kinetic and stored energy, and work."""
        kinetic, stored = energy(self.operator, motion.y)
        return [(part.phi, part.B) for part in motion.y], kinetic, stored, motion.work


class Run(eqx.Module):
    """An equation in time counted in steps from where an integration begins.

    Attributes:
        equation: what is integrated.
        at: number of steps taken before.
        h: the step, scaled.
    """

    equation: Any
    at: Any
    h: Any

    def time(self, steps: Any) -> Any:
        """Scaled time after so many steps."""
        return (self.at + steps) * self.h

    def rate(self, steps: Any, motion: Motion) -> Motion:
        """Change of a motion in a step, by its rate."""
        rate: Motion = self.equation(self.time(steps), motion)
        return jax.tree.map(lambda part: self.h * part, rate)
