"""What is simulated: layers, grid, sources, receivers, time. No jax.

One description for all: the time domain integrates it, the exact solvers solve it, readings and
figures ask it what they look at.
"""

from __future__ import annotations

import functools
import math
import numbers
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from wavesim.grid.bar import Bar, layered_bar
from wavesim.grid.points import sampling
from wavesim.grid.stencils import modified_wavenumber
from wavesim.grid.summation_by_parts import closure
from wavesim.material.arguments import checked
from wavesim.material.family import Block
from wavesim.material.layers import Layer, Layers, as_layers
from wavesim.material.medium import Medium
from wavesim.material.shown import Shown, quantity
from wavesim.planewave import block_frequencies, check_hyperbolic
from wavesim.planewave.band_edges import keeps_gradient
from wavesim.planewave.hyperbolicity import check_reckoned
from wavesim.planewave.many_media import doubtful
from wavesim.sources import Chirp, InitialField, Recorded, Source, ToneBurst

# "auto" takes "propagator" where nothing is lost, else "chebyshev"; the others are diffrax's own.
SOLVERS: tuple[str, ...] = (
    "auto",
    "propagator",
    "chebyshev",
    "Bosh3",
    "Tsit5",
    "Dopri5",
    "Dopri8",
)


# A run of fewer frames by default shows nothing.
_FEWEST_FRAMES = 6


@checked
@dataclass(frozen=True, repr=False)
class Simulation(Shown):
    """A bar, what drives it, and how long.

    Args:
        layers: what the bar is made of, one layer where it is uniform.
        bar: the grid and its ends; of layers, that of ``layered_bar``.
        sources: what drives it, at least one.
        duration: s.
        samples: number of frames, the start among them; None stores twice the sources' band.
        receivers: {name: position in m}.
        solver: "auto", "propagator", "chebyshev", or an explicit solver of diffrax by its name.
        step: longest time step allowed, s; None lets the stepper choose.

    Raises:
        ValueError: no source, or a value that can't be used; the message names it.
        NotHyperbolicError: waves of a medium grow without bound.
    """

    layers: Layers
    bar: Bar
    sources: tuple[Source, ...]
    duration: float
    samples: int | None = None
    receivers: Mapping[str, float] = field(default_factory=dict)
    solver: str = "auto"
    step: float | None = None

    def __post_init__(self) -> None:
        if not self.sources:
            raise ValueError("sources = []: at least one source is needed")
        if not (isinstance(self.duration, numbers.Real) and 0 < self.duration < math.inf):
            told = f"{self.duration:g}" if isinstance(self.duration, numbers.Real) else "no number"
            raise ValueError(f"duration = {told} s: must be greater than 0, and finite")
        if not isinstance(self.samples, numbers.Integral | None):
            raise ValueError(f"samples = {self.samples}: must be a whole number")
        if self.samples is not None and self.samples < 2:
            raise ValueError(f"samples = {self.samples}: must be at least 2")
        if self.step is not None and not self.step > 0:
            raise ValueError(f"step = {self.step:g} s: must be greater than 0")
        if self.solver not in SOLVERS:
            raise ValueError(f"solver = {self.solver!r}: must be one of {', '.join(SOLVERS)}")
        if self.solver == "propagator" and self.lossy:
            raise ValueError(
                "solver = 'propagator': is for bars without losses, and this one has damping or "
                "an absorbing end; take 'chebyshev' or 'auto'"
            )
        stretches, layers = len(self.bar.all_stretches), len(self.layers.layers)
        if stretches != layers:
            raise ValueError(
                f"layers: {layers} given for a grid of {stretches} stretches; make the bar with "
                "layered_bar(layers, spacing)"
            )
        for name, position in self.receivers.items():
            try:
                sampling(self.bar, position, False)
            except ValueError as error:
                raise ValueError(f"receivers, {name!r}: {error}") from None
        media = _looked_at(self.layers)
        if any(medium.family is not self.medium.family for medium in media):
            raise ValueError("layers: the media of a bar must be of one family")
        for medium, doubted in zip(media, doubtful(media), strict=True):
            (check_hyperbolic if doubted else check_reckoned)(medium)
        self.blocks  # noqa: B018  (says which source drives none)
        if self.samples is None and self.frames < _FEWEST_FRAMES:
            raise ValueError(
                f"duration = {self.duration:g}: holds only {self.frames} frames of signals so "
                "slow; lengthen it, give samples, or see that frequencies are in Hz and the times "
                "of a recorded signal in seconds"
            )

    def told(self) -> dict[str, str]:
        """Bar, sources, receivers and time."""
        driven = ", ".join(
            f"{one.kind} on {one.field} at {quantity(one.position, 'm')}" for one in self.sources
        )
        return {
            "bar": ", ".join(self.bar.told().values()),
            "layers": str(len(self.layers.layers)),
            "sources": driven,
            "receivers": ", ".join(self.receivers) or "none",
            "duration": f"{quantity(self.duration, 's')}, {self.frames} frames",
        }

    @property
    def medium(self) -> Medium:
        """The medium at the left end, whose units are used."""
        return self.layers.first

    @property
    def stretches(self) -> tuple[tuple[Layer, int, float], ...]:
        """Each layer with its number of cells and their size, m."""
        pairs = zip(self.layers.layers, self.bar.all_stretches, strict=True)
        return tuple((layer, cells, size) for layer, (cells, size) in pairs)

    @property
    def endless(self) -> bool:
        """Whether it stands for an endless bar of one medium: joined ends, one uniform layer."""
        return self.bar.periodic and self.layers.uniform

    @property
    def lossy(self) -> bool:
        """Whether anything of a wave is lost, to damping or at an absorbing end."""
        return self.layers.lossy or "absorbing" in (self.bar.left, self.bar.right)

    @functools.cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks that the sources set in motion; no others are integrated."""
        return self.medium.family.excited([source.field for source in self.sources])

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields that are integrated and stored."""
        return tuple(dict.fromkeys(name for block in self.blocks for name in block.fields))

    @functools.cached_property
    def with_gradient(self) -> bool:
        """Whether the gradient term is kept: where it is felt, or costs nothing to keep."""
        return not self.lossy or self.gradient_felt

    @functools.cached_property
    def gradient_felt(self) -> bool:
        """Whether the gradient term counts in some medium of the bar."""
        return keeps_gradient(self.layers)

    @functools.cached_property
    def frames(self) -> int:
        """Number of frames, the start among them."""
        return self.samples or default_samples(self.sources, self.layers, self.duration)

    @property
    def interval(self) -> float:
        """Time between frames, s."""
        return self.duration / (self.frames - 1)

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the frames, shape (frames,), s."""
        return np.linspace(0.0, self.duration, self.frames)

    @functools.cached_property
    def band(self) -> float:
        """End of the sources' band, rad/s."""
        return highest_band(self.sources, self.layers)


def simulation(
    medium: Medium | Layers,
    bar: Bar,
    sources: Sequence[Source],
    duration: float,
    samples: int | None = None,
    receivers: Mapping[str, float] | None = None,
    solver: str = "auto",
    step: float | None = None,
) -> Simulation:
    """A simulation of a medium or of layers; arguments and errors as of :class:`Simulation`."""
    layers = as_layers(medium, bar.length)
    known = tuple(sources), duration, samples, dict(receivers or {}), solver, step
    return Simulation(layers, bar, *known)


def with_spacing(simulated: Simulation, spacing: float) -> Simulation:
    """The same on a grid of other cells (m), as a case with that [bar] spacing has it."""
    bar, layers = simulated.bar, simulated.layers
    if bar.stretches:
        least = closure(bar.order).cells
        sizes = [min(spacing, layer.thickness / least) for layer in layers.layers]
        made = layered_bar(layers, sizes, bar.order, bar.left, bar.right, bar.absorber)
    else:
        cells = round(bar.length / spacing)
        made = replace(bar, cells=cells, spacing=bar.length / cells)
    return replace(simulated, bar=made)


def at_double_moment(simulated: Simulation, position: float) -> bool:
    """Whether a place is that of a point source on a micro-field, which is infinite there."""
    return any(
        source.staggered
        and source.acts == "body"
        and source.width == 0
        and abs(source.position - position) <= 1e-9 * simulated.bar.length
        for source in simulated.sources
    )


def highest_band(sources: Sequence[Source], layers: Layers) -> float:
    """End of the sources' band, rad/s.

    An initial field has none; on a bar it is the highest frequency, in any of its media, of waves
    at the end of its band of wavenumbers.
    """
    return max(
        max(
            float(block_frequencies(medium, block, [source.highest_wavenumber]).max())
            for medium in layers.media
            for block in medium.family.excited([source.field])
        )
        if isinstance(source, InitialField)
        else source.band
        for source in sources
    )


def default_samples(sources: Sequence[Source], layers: Layers, duration: float) -> int:
    """Frames that hold twice the band of the highest source.

    A signal whose spectrum falls as a power of ω gets three times what it excites: with twice its
    band, frames were measured to be too few for the verdict on a Hann burst.
    """
    highest = 2 * highest_band(sources, layers)
    for source in sources:
        if math.isinf(source.spectral_end) and math.isfinite(source.band):
            highest = max(highest, 3 * source.excited[1])
    return max(2, math.ceil(duration * highest / math.pi) + 1)


def _looked_at(layers: Layers) -> tuple[Medium, ...]:
    """Media whose waves may grow, each once: of a graded layer the ends, and what is between them
    where it is not known beforehand to be stable."""
    ends = [layer.ends for layer in layers.layers]
    if not all(medium.stable for pair in ends for medium in pair):
        return layers.media
    found = tuple(medium for pair in ends for medium in pair)
    try:
        return tuple(dict.fromkeys(found))
    except TypeError:  # numbers that jax holds have no hash
        return found


_PHASE_ERROR = 0.01


def check_carried(source: Source, layers: Layers, bar: Bar) -> None:
    """Hold a source's frequency to what the grid can carry in every layer of the bar.

    Raises:
        ValueError: the frequency is above :func:`highest_carried`; of an initial field, it is
            too narrow.
    """
    if isinstance(source, InitialField):
        limit = largest_phase(bar.order) / bar.spacing
        if source.highest_wavenumber > limit:
            least = source.width * source.highest_wavenumber / limit
            raise ValueError(
                f"width = {source.width:g}: the grid carries wavenumbers up to {limit:.4g} rad/m "
                f"(order {bar.order}; there a wave's phase is off by 1 %); take at least "
                f"{least:.3g}, or a finer [bar] spacing"
            )
        return
    key, frequency = _peak(source)
    highest = highest_carried(layers, bar)
    if frequency > highest:
        spacing = bar.spacing * highest / frequency
        raise ValueError(
            f"{key} = {frequency:g}: the grid carries at most "
            f"{highest:.4g} Hz (order {bar.order}; there the fastest wave's phase is off by 1 %); "
            f"lower it, or take [bar] spacing ≤ {spacing:.3g}"
        )


def _peak(source: Source) -> tuple[str, float]:
    """The key that says how high a source goes, and that frequency, Hz."""
    if isinstance(source, ToneBurst):
        return "frequency", source.frequency
    if isinstance(source, Chirp):
        return "high", source.high
    if isinstance(source, Recorded):
        return "peak of the recorded spectrum", source.peak_frequency
    return "peak_frequency", source.peak_frequency


def highest_carried(layers: Layers, bar: Bar) -> float:
    """Frequency at which the grid's phase error on the fastest wave of some layer reaches 1 %, Hz.

    The fastest wave has c_∞ = √(C_φφ/m_φ); at a given frequency it is the longest.
    """
    cells = min(
        medium.fastest / size
        for layer, (_, size) in zip(layers.layers, bar.all_stretches, strict=True)
        for medium in layer.sampled()
    )
    return cells * largest_phase(bar.order) / (2 * math.pi)


@functools.cache
def largest_phase(order: int) -> float:
    """kh at which differences of an order slow a wave down by 1 %."""
    phase = np.linspace(1e-3, math.pi, 20001)
    slowing = 1 - modified_wavenumber(phase, 1.0, order) / phase
    return float(np.interp(_PHASE_ERROR, slowing, phase))
