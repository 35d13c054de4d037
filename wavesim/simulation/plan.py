"""What is settled before integrating: blocks, stepper, step and frames of a run. No jax."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.grid.bar import Bar
from wavesim.material.layers import Layers, as_layers
from wavesim.material.medium import Medium
from wavesim.material.sectors import Block, excited_blocks
from wavesim.material.wave_equations import fastest_speed
from wavesim.planewave.band_edges import keeps_gradient
from wavesim.planewave.dispersion_relation import (
    block_frequencies,
    check_hyperbolic,
)
from wavesim.sources import InitialField, Source
from wavesim.timedomain.barstep import bar_schedule
from wavesim.timedomain.timestep import (
    PRECISIONS,
    Precision,
    Schedule,
    schedule,
    single_error,
    spectral_bound,
)
from wavesim.timedomain.zones import banded

# Highest frequency of a stretch with closures over that of an endless one, at most.
_ENDS = 1.05
# Amplitudes of sources up to this, and down to its inverse, leave room in float32 for their field.
_RANGE = 1e20
# Frames in one chunk: as many as fit into about this many bytes, within these limits.
_CHUNK_BYTES = 24e6
_CHUNK_FRAMES = (4, 128)


@dataclass(frozen=True)
class Plan:
    """All that is settled before integrating.

    Attributes:
        layers, bar, sources: the problem.
        blocks: those that the sources set in motion.
        schedule: stepper and step, scaled.
        duration: s.
        precision: of the products of the steps, and of the fields that are kept.
    """

    layers: Layers
    bar: Bar
    sources: tuple[Source, ...]
    blocks: tuple[Block, ...]
    schedule: Schedule
    duration: float
    precision: Precision = "double"

    @property
    def medium(self) -> Medium:
        """The medium at the left end, whose units are used."""
        return self.layers.first

    @property
    def real(self) -> bool:
        """Whether the bar has layers, ends or losses: not uniform, periodic and lossless."""
        return self.schedule.shift is not None

    @property
    def endless(self) -> bool:
        """Whether it stands for an endless bar of one medium: joined ends, one uniform layer."""
        return self.bar.periodic and self.layers.uniform

    @property
    def with_gradient(self) -> bool:
        """Whether the gradient term is kept."""
        return not self.real or keeps_gradient(self.layers)

    @property
    def balanced(self) -> bool:
        """Whether the closure conserves energy in every layer, losses apart."""
        return self.layers.conserves_energy

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
    def rounding(self) -> float:
        """Largest error of a field by single precision, in units of the largest; 0 for double."""
        return single_error(self.schedule) if self.precision == "single" else 0.0

    @property
    def stored(self) -> np.dtype[Any]:
        """Type of the numbers of the fields that are kept."""
        return np.dtype(np.float32 if self.precision == "single" else np.float64)

    @property
    def chunk(self) -> int:
        """Frames in one chunk."""
        size = 8 * self.bar.cells * len(self.fields)
        low, high = _CHUNK_FRAMES
        return min(max(low, int(_CHUNK_BYTES / size)), high, self.schedule.frames - 1)


def plan(
    medium: Medium | Layers,
    bar: Bar,
    sources: Sequence[Source],
    duration: float,
    samples: int | None = None,
    solver: str = "auto",
    step: float | None = None,
    precision: Precision = "double",
) -> Plan:
    """Settle stepper, step and frames of a run.

    Args:
        medium: what the bar is made of, a medium or layers.
        bar: the grid.
        sources: at least one.
        duration: s.
        samples: number of frames, the start among them; None stores twice the sources' band.
        solver: "auto", "propagator", "chebyshev" or "verlet".
        step: longest step allowed, s; None lets the stepper choose.
        precision: "double" or, where solver "propagator" serves, "single".

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
    if precision not in PRECISIONS:
        raise ValueError(f"precision = {precision!r}: must be one of {', '.join(PRECISIONS)}")
    layers = as_layers(medium, bar.length)
    reference = layers.first
    frames = samples or default_samples(sources, reference, duration)
    if frames < 2:
        raise ValueError(f"samples = {frames}: must be at least 2")
    if max(len(bar.stretches), 1) != len(layers.layers):
        raise ValueError(
            f"layers: {len(layers.layers)} given for a grid of {max(len(bar.stretches), 1)} "
            "stretches; make the bar with layered_bar(layers, spacing)"
        )
    for one in layers.media:
        check_hyperbolic(one)
    blocks = excited_blocks([source.field for source in sources])
    unit = float(reference.time_scale)
    longest = step if step is None else step / unit
    if is_plain(layers, bar, sources):
        bound = spectral_bound(reference, bar, blocks)
        speed = fastest_speed(reference) * unit / bar.spacing
        # Strides are not in single precision.
        ends = [math.inf if precision == "single" else source.end for source in sources]
        about = (solver, longest, speed, bar.cells, max(ends) / unit)
        steps = schedule(bound, duration / unit, frames, *about)
    else:
        radius = highest_frequency(layers, bar, blocks, reference)
        band = highest_band(sources, reference) * unit
        loss = fastest_loss(layers, bar, radius)
        speed = max(
            fastest_speed(one) * unit / size
            for layer, (_, size) in zip(layers.layers, stretches(bar), strict=True)
            for one in layer.sampled()
        )
        steps = bar_schedule(radius, loss, band, duration / unit, frames, solver, longest, speed)
        if loss == 0 and solver != "chebyshev":
            sizes = tuple(len(block.rotations + block.curvatures) for block in blocks)
            steps = banded(steps, layers, bar, sizes, speed, solver == "propagator")
    if precision == "single" and not (steps.solver == "propagator" and steps.shift is None):
        what = "bar with layers, ends or losses" if steps.shift is not None else "run"
        remedy = "" if steps.shift is not None else "solver 'propagator' or "
        raise ValueError(
            "precision = 'single': is for uniform periodic lossless bars stepped by solver "
            f"'propagator', and this {what} is stepped by {steps.solver!r}; take {remedy}'double'"
        )
    beyond = [s.amplitude for s in sources if not 1 / _RANGE <= (abs(s.amplitude) or 1) <= _RANGE]
    if precision == "single" and beyond:
        raise ValueError(
            f"precision = 'single': float32 may not hold the field of amplitude = {beyond[0]:g}; "
            f"take one between {1 / _RANGE:g} and {_RANGE:g}, or 'double'"
        )
    return Plan(layers, bar, tuple(sources), blocks, steps, duration, precision)


def is_plain(layers: Layers, bar: Bar, sources: Sequence[Source]) -> bool:
    """Whether a bar is uniform, periodic and lossless, driven by body moments from rest."""
    return (
        bar.periodic
        and layers.uniform
        and not layers.lossy
        and all(source.drive == "body" for source in sources)
    )


def stretches(bar: Bar) -> tuple[tuple[int, float], ...]:
    """(cells, spacing) of each stretch of a bar."""
    return bar.stretches or ((bar.cells, bar.spacing),)


def highest_frequency(
    layers: Layers, bar: Bar, blocks: Sequence[Block], reference: Medium
) -> float:
    """R ≥ every frequency of the bar, scaled: that of the fastest stretch with free ends.

    Stretches are joined as finite elements are, so that no mode of the whole is faster than the
    fastest of its parts (Rayleigh's quotient); closures at their ends add up to 2 %.

    Args:
        layers: what it is made of.
        bar: its grid.
        blocks: those that are integrated.
        reference: the medium whose units to scale by.
    """
    squares = []
    for layer, (_, spacing) in zip(layers.layers, stretches(bar), strict=True):
        unrelaxed = layer.medium.damping.unrelaxed
        for medium in layer.sampled():
            bound = spectral_bound(medium, bar, blocks, spacing=spacing)
            ratio = (reference.time_scale / medium.time_scale) ** 2
            squares.append(unrelaxed * ratio * bound)
    return math.sqrt(max(squares)) * _ENDS


def fastest_loss(layers: Layers, bar: Bar, radius: float) -> float:
    """Largest rate at which anything on a bar is lost, scaled.

    Args:
        layers: what it is made of.
        bar: its grid and ends.
        radius: its highest frequency, scaled.
    """
    unit = float(layers.first.time_scale)
    rates = [0.0]
    for layer in layers.layers:
        law = layer.medium.damping
        rayleigh = law.mass * unit + law.stiffness / unit * radius**2
        rates.append(rayleigh + max(law.rates, default=0.0) * unit)
    return max(rates) + max(absorption(layers, bar, end) for end in ("left", "right")) * unit


# Reflection of an absorbing layer of the fastest wave, before the grid's own. Slower waves, and
# those near a cutoff, whose phase velocity is high, are reflected more: R to the power c_∞/c.
REFLECTION = 1e-32


def absorption(layers: Layers, bar: Bar, end: str) -> float:
    """Largest d of the absorbing layer at an end, 1/s: −4 c_∞ ln R/2W, R = 1e-32; 0 elsewhere."""
    if getattr(bar, end) != "absorbing":
        return 0.0
    medium = layers.at(0.0 if end == "left" else layers.length)
    return -4 * fastest_speed(medium) * math.log(REFLECTION) / (2 * bar.absorber)


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
