"""What is settled before integrating: blocks, stepper, step and frames of a run. No jax."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wavesim.bar import Bar
from wavesim.equations import flux_form
from wavesim.medium import Medium
from wavesim.planewave import block_frequencies, check_hyperbolic
from wavesim.sectors import Block, excited_blocks
from wavesim.source import InitialField, Source
from wavesim.timedomain.timestep import Schedule, schedule, spectral_bound

# Frames in one chunk: as many as fit into about this many bytes, within these limits.
_CHUNK_BYTES = 24e6
_CHUNK_FRAMES = (4, 128)


@dataclass(frozen=True)
class Plan:
    """All that is settled before integrating.

    Attributes:
        medium, bar, sources: the problem.
        blocks: those that the sources set in motion.
        schedule: stepper and step, scaled.
        duration: s.
    """

    medium: Medium
    bar: Bar
    sources: tuple[Source, ...]
    blocks: tuple[Block, ...]
    schedule: Schedule
    duration: float

    @property
    def step(self) -> float:
        """Time step, s."""
        return self.schedule.step * float(self.medium.time_scale)

    @property
    def times(self) -> np.ndarray:
        """Times of the frames, s."""
        return np.linspace(0.0, self.duration, self.schedule.frames)

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields that are integrated and stored."""
        names = [name for block in self.blocks for name in block.fields]
        return tuple(dict.fromkeys(names))

    @property
    def chunk(self) -> int:
        """Frames in one chunk."""
        size = 8 * self.bar.cells * len(self.fields)
        low, high = _CHUNK_FRAMES
        return min(max(low, int(_CHUNK_BYTES / size)), high, self.schedule.frames - 1)


def plan(
    medium: Medium,
    bar: Bar,
    sources: Sequence[Source],
    duration: float,
    samples: int | None = None,
    solver: str = "auto",
    step: float | None = None,
) -> Plan:
    """Settle stepper, step and frames of a run.

    Args:
        medium: its parameters.
        bar: the grid.
        sources: at least one.
        duration: s.
        samples: number of frames, the start among them; None stores twice the sources' band.
        solver: "auto", "propagator", "chebyshev" or "verlet".
        step: longest step allowed, s; None lets the stepper choose.

    Returns:
        The plan.

    Raises:
        ValueError: no source, or a value that can't be used; the message names it.
        NotHyperbolicError: waves of the medium grow without bound.
    """
    if not sources:
        raise ValueError("sources = []: at least one source is needed")
    if not duration > 0:
        raise ValueError(f"duration = {duration:g} s: must be greater than 0")
    frames = samples or default_samples(sources, medium, duration)
    if frames < 2:
        raise ValueError(f"samples = {frames}: must be at least 2")
    check_hyperbolic(medium)
    blocks = excited_blocks([source.field for source in sources])
    bound = spectral_bound(medium, bar, blocks)
    unit = float(medium.time_scale)
    steps = schedule(
        bound,
        duration / unit,
        frames,
        solver,
        step if step is None else step / unit,
        fastest(medium) * unit / bar.spacing,
        bar.cells,
    )
    return Plan(medium, bar, tuple(sources), blocks, steps, duration)


def highest_band(sources: Sequence[Source], medium: Medium) -> float:
    """End of the sources' band, rad/s.

    An initial field has none; in a medium it is the highest frequency of its waves at the end of
    its band of wavenumbers.
    """
    return max(
        max(
            float(block_frequencies(medium, block, [source.highest_wavenumber]).max())
            for block in excited_blocks([source.field])
        )
        if isinstance(source, InitialField)
        else source.band
        for source in sources
    )


def default_samples(sources: Sequence[Source], medium: Medium, duration: float) -> int:
    """Frames that hold twice the band of the highest source.

    A signal whose spectrum falls as a power of ω gets three times what it excites: with twice its
    band, frames were measured to be too few for the verdict on a Hann burst.
    """
    highest = 2 * highest_band(sources, medium)
    for source in sources:
        if math.isinf(source.spectral_end) and math.isfinite(source.band):
            highest = max(highest, 3 * source.excited[1])
    return max(2, math.ceil(duration * highest / math.pi) + 1)


def fastest(medium: Medium) -> float:
    """Speed of the fastest wave at short wavelengths, c_∞ = √(C_φφ/m_φ), m/s."""
    flux = flux_form(medium)
    return float(np.sqrt(np.linalg.eigvalsh(flux.C_phi_phi).max() / flux.m_phi))
