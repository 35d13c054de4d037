"""Choice of stepper, step and polynomial degree from the operator's spectral bound. No jax.

Cosine and sine propagators of q̈ = L q, L of spectrum −[0, Λ], over a step h:

    C(λ) = cos(h√λ),    S(λ) = sin(h√λ)/√λ,    λ = Λ (1 − x)/2,  x ∈ [−1, 1]

are entire in λ; their Chebyshev series converges faster than any power once the degree passes
h√Λ/2 (Tal-Ezer, Kosloff & Koren, Geophys. Prospect. 35, 479 (1987)).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from wavesim.grid.bar import Bar
from wavesim.grid.stencils import largest_modified_wavenumber
from wavesim.material.medium import Medium
from wavesim.material.scaling import block_coefficients, scales
from wavesim.material.sectors import Block

Float = NDArray[np.float64]
Solver = Literal["auto", "propagator", "chebyshev", "verlet"]
Precision = Literal["double", "single"]

SOLVERS: tuple[str, ...] = ("auto", "propagator", "chebyshev", "verlet")
PRECISIONS: tuple[str, ...] = ("double", "single")

# Rounding of a value of size 1: a series is cut where its terms fall to a few of it.
SERIES_TOLERANCE = 2e-16
# Verlet by default takes this part of the longest stable step 2/√Λ.
_VERLET_SAFETY = 0.25
# A Chebyshev step longer than this many radians of the fastest mode only costs memory.
LONGEST_STEP = 200.0
# The propagator takes at least this many cells in one run (``wavesim.timedomain.kernels``).
SHORTEST_RUN = 64
# Error of single precision for each radian of the fastest mode in a step and root of the number of
# steps, in units of 2⁻²³: 0.2 to 4.6 in 19 runs, and room (docs/performance.md).
_SINGLE = 8.0
# A propagator reaching further than this many cells only costs memory.
LONGEST_REACH = 160
# Propagators of a whole ring hold some 120 complex numbers for each of N/2 wavenumbers.
LARGEST_RING = 100_000
# Steps times cells that take as long as to compile a program, some 1.5 s.
WORTH_A_PROGRAM = 5e6


def spectral_bound(
    medium: Medium,
    bar: Bar,
    blocks: Sequence[Block],
    reference: Medium | None = None,
    spacing: float | None = None,
) -> float:
    """Λ ≥ every eigenvalue of −L: the squared frequency of the fastest mode, scaled.

    Each wavenumber k of the grid acts through its modified wavenumber k̃ ≤ k̃_max alone, and
    frequencies rise with k̃, so the bound is the largest eigenvalue at k̃_max; 1 % is added.

    Args:
        medium: the medium.
        bar: the grid.
        blocks: the blocks that are integrated.
        reference: the medium whose units to scale by.
        spacing: cell size where it is not the bar's, m.

    Returns:
        Λ, in 1/time² of the scaled units.
    """
    length = (reference or medium).length_scale
    k = largest_modified_wavenumber((spacing or bar.spacing) / length, bar.order)
    bounds = []
    for block in blocks:
        form = block_coefficients(medium, block, scales(reference or medium)).per_inertia()
        matrix = np.block(
            [
                [k**2 * form.c_pp, -k * form.c_pb],
                [-k * form.c_bp, form.c_bb + k**2 * form.gamma],
            ]
        )
        bounds.append(float(np.abs(np.linalg.eigvals(matrix)).max()))
    return 1.01 * max(bounds)


def chebyshev_series(function: Callable[[Float], Float], bound: float, degree: int) -> Float:
    """Chebyshev coefficients of f(λ) on [0, Λ] in x = 1 − 2λ/Λ, by interpolation.

    Args:
        function: f, vectorised: λ of shape (n,) to values of shape (…, n).
        bound: Λ.
        degree: highest degree.

    Returns:
        Coefficients a_0 … a_degree along the last axis: f ≈ Σ a_k T_k(x).
    """
    n = 2 * degree + 2
    # λ = Λ (1 − cos θ)/2 without its cancellation, which a long step would magnify near λ = 0.
    half_angle = np.pi * (np.arange(n) + 0.5) / (2 * n)
    coefficients = dct(function(bound * np.sin(half_angle) ** 2), type=2, axis=-1) / n
    coefficients[..., 0] /= 2
    return np.asarray(coefficients[..., : degree + 1])


def cosine(duration: Float | float, eigenvalue: Float) -> Float:
    """C = cos(h√λ); h of shape (…) against λ of shape (n,) gives (…, n)."""
    return np.cos(np.multiply.outer(duration, np.sqrt(eigenvalue)))


def sine(duration: Float | float, eigenvalue: Float) -> Float:
    """S = sin(h√λ)/√λ = h sinc(h√λ/π); shapes as for :func:`cosine`."""
    phase = np.multiply.outer(duration, np.sqrt(eigenvalue))
    return np.asarray(duration)[..., None] * np.sinc(phase / np.pi)


def series_degree(step: float, bound: float) -> int:
    """Degree at which the series of C, S/h and λS/√Λ are exact to rounding."""
    radians = step * math.sqrt(bound)
    trial = math.ceil(0.5 * radians + 12 * (1 + radians) ** (1 / 3)) + 12
    root = math.sqrt(bound)

    def all_three(eigenvalue: Float) -> Float:
        s = sine(step, eigenvalue)
        return np.stack([cosine(step, eigenvalue), s / step, s * eigenvalue / root])

    size = np.abs(chebyshev_series(all_three, bound, trial)).max(axis=0)
    # Terms at rounding level, which rises with the phase h√λ, are noise of the interpolation; the
    # last one above it counts.
    noise = SERIES_TOLERANCE * (4 + radians / 16)
    return int(np.max(np.nonzero(size > noise)[0]))


@dataclass(frozen=True)
class Leg:
    """Frames of a run that are stepped alike.

    Attributes:
        frames: how many.
        steps: steps of h that each of them begins with.
        stride: steps of h that the rest of it is, taken in one (``circulant.py``); 0: no rest.
    """

    frames: int
    steps: int
    stride: int = 0

    @property
    def taken(self) -> int:
        """Steps that a frame takes, a stride counted as one."""
        return self.steps + bool(self.stride)


@dataclass(frozen=True)
class Schedule:
    """How a run is stepped; all times scaled.

    Attributes:
        solver: "propagator", "chebyshev" or "verlet".
        step: h.
        steps_per_frame: steps of h from one stored frame to the next.
        frames: number of stored frames, the start among them.
        bound: Λ, the spectral bound.
        degree: of the Chebyshev series; 1 for Verlet.
        reach: cells beyond which nothing is felt within a step, to rounding.
        shift: half the fastest loss rate, of the series that steps a real bar; None where the
            bar is uniform, periodic and lossless.
        quiet: steps of h after which no source acts, so that the rest of a frame is taken in one;
            None where every step is one of h.
    """

    solver: str
    step: float
    steps_per_frame: int
    frames: int
    bound: float
    degree: int
    reach: int
    shift: float | None = None
    quiet: int | None = None

    @property
    def legs(self) -> tuple[Leg, ...]:
        """The frames after the first, in order.

        Those in which a source acts, but for a single one, are stepped by h to their ends.
        """
        frames, each = self.frames - 1, self.steps_per_frame
        if self.quiet is None:
            return (Leg(frames, each),)
        driven = min(math.ceil(self.quiet / each), frames)
        begun = self.quiet if driven == 1 and self.quiet < each - 1 else each
        legs = (Leg(driven, begun, each - begun), Leg(frames - driven, 0, each))
        return tuple(leg for leg in legs if leg.frames)

    @property
    def steps(self) -> int:
        """Number of steps of the run, each stride one."""
        return sum(leg.frames * leg.taken for leg in self.legs)

    @property
    def operator_products(self) -> int:
        """Products with a state that the run takes, sources apart.

        They are products of L for the Chebyshev stepper (two series, of q and of q̇) and for
        Verlet, and of the exact propagator, one a step, for "propagator". On a real bar the
        Chebyshev stepper's are of A, each of which holds one of L.
        """
        per_step = 2 * self.degree if self.solver == "chebyshev" else 1
        if self.shift is not None and self.solver == "chebyshev":
            per_step = self.degree
        return self.steps * per_step


def single_error(steps: Schedule) -> float:
    """Largest error of a field by single precision, 8 h√Λ 2⁻²³ √n after n steps.

    Each step rounds a flux that is larger than the change in the field by the cells it comes from,
    about h√Λ, and roundings add up as in a random walk. In scaled units, over the largest value of
    any field of the same block.
    """
    return _SINGLE * steps.step * math.sqrt(steps.bound) * 2.0**-23 * math.sqrt(steps.steps)


def reach_within(step: float, speed: float) -> int:
    """Cells beyond which nothing is felt within a step, to rounding.

    A front at c_∞ and a tail ahead of it that falls faster than any power; the constants bound
    what was measured for orders 2 to 12 and steps of 0.5 to 16 units of time.

    Args:
        step: h, scaled.
        speed: c_∞ over the cell size, cells per scaled time.
    """
    return math.ceil(1.25 * speed * step) + 30


def schedule(
    bound: float,
    duration: float,
    frames: int,
    solver: str = "auto",
    step: float | None = None,
    speed: float = math.inf,
    cells: int = 0,
    quiet_from: float = math.inf,
) -> Schedule:
    """Stepper and step for a run.

    "auto" takes the propagator where the bar is long enough for it, and else the Chebyshev
    stepper; both are accurate to rounding at any step, and take the frame interval as their step
    unless it is very long.

    Args:
        bound: Λ, scaled.
        duration: of the run, scaled.
        frames: stored frames, at least 2.
        solver: one of SOLVERS.
        step: longest step allowed, scaled; None lets the stepper choose.
        speed: c_∞ over the cell size, cells per scaled time.
        cells: number of cells of the bar.
        quiet_from: time from which on no source acts, scaled.

    Returns:
        The schedule; its step divides the frame interval.

    Raises:
        ValueError: the solver is none of those, or the bar is too short for the propagator.
        StepTooLongError: the step is beyond the stability limit of Verlet.
    """
    if solver not in SOLVERS:
        raise ValueError(f"solver = {solver!r}: must be one of {', '.join(SOLVERS)}")
    interval = duration / (frames - 1)

    def divided(longest: float) -> int:
        return max(1, math.ceil(interval / longest * (1 - 1e-12)))

    furthest = min(LONGEST_REACH, (cells - SHORTEST_RUN) // 3)
    longest = (furthest - reach_within(0.0, 0.0)) / (1.25 * speed) if speed > 0 else math.inf
    chosen = solver
    if solver == "auto":
        chosen = "propagator" if longest > 0 else "chebyshev"
    elif solver == "propagator" and longest <= 0:
        raise ValueError(
            f"solver = 'propagator': needs at least "
            f"{3 * reach_within(0.0, 0.0) + SHORTEST_RUN + 3} cells, the bar has {cells}; take "
            "'chebyshev' or a longer bar"
        )
    if chosen == "verlet":
        limit = stability_limit(bound)
        longest = _VERLET_SAFETY * limit
        if step is not None and step > limit:
            raise StepTooLongError(limit / step)
    elif chosen == "chebyshev":
        longest = LONGEST_STEP / math.sqrt(bound)
    if step is not None:
        longest = step if chosen != "propagator" else min(step, longest)
    per_frame = divided(longest)
    h = interval / per_frame
    degree = 1 if chosen == "verlet" else series_degree(h, bound)
    reach = reach_within(h, speed) if math.isfinite(speed) else cells
    made = Schedule(chosen, h, per_frame, frames, bound, degree, reach)
    strides = chosen == "propagator" and per_frame > 1 and step is None and cells <= LARGEST_RING
    if not strides or quiet_from >= duration:
        return made
    strided = dataclasses.replace(made, quiet=max(1, math.ceil(quiet_from / h)))
    # A second leg is a second program to compile.
    saved = (made.steps - strided.steps) * cells
    return strided if len(strided.legs) == 1 or saved > WORTH_A_PROGRAM else made


def stability_limit(bound: float) -> float:
    """Longest stable Verlet step, 2/√Λ, scaled."""
    return 2 / math.sqrt(bound)


class StepTooLongError(ValueError):
    """A Verlet step is beyond 2/√Λ.

    Attributes:
        fraction: limit over the step asked for, < 1.
    """

    def __init__(self, fraction: float) -> None:
        self.fraction = fraction
        super().__init__(
            f"the step is {1 / fraction:.3g} times the stability limit of the Verlet stepper; "
            f"multiply it by at most {fraction:.3g}, or take solver 'chebyshev'"
        )
