"""Which stepper, which time step, and of which degree: settled before anything runs. No jax.

The series of exp(hA) is cut where its terms fall below rounding: about hR + 30 products with A for
a step h, R ≥ every frequency of the bar. Tal-Ezer, SIAM J. Numer. Anal. 23, 11 (1986).
"""

from __future__ import annotations

import cmath
import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.grid.bar import Bar
from wavesim.grid.stencils import difference_norm
from wavesim.material.family import Block
from wavesim.material.layers import Layers
from wavesim.material.medium import Medium
from wavesim.material.scaling import Scales, block_coefficients, scales
from wavesim.simulation.simulation import Simulation
from wavesim.timedomain.absorber import strongest_absorption

Float = NDArray[np.float64]

# Explicit solvers of diffrax: products with A in a step, and the step in units of 1/R that is taken
# unless a shorter one is asked for.
EXPLICIT: dict[str, tuple[int, float]] = {
    "Bosh3": (3, 0.05),
    "Tsit5": (6, 0.35),
    "Dopri5": (6, 0.25),
    "Dopri8": (13, 1.0),
}

# Closures at ends add up to 2 % to the highest frequency of an endless bar.
_ENDS = 1.05
# A step of the series longer than this many radians only costs memory.
_LONGEST_STEP = 200.0
# Decay of what is lost fastest over a step, by e to twice this: rounding then is felt at 1e-9.
_MOST_DECAY = 16.0
# Growth, as a power of e, of the terms of a mode that is fast and loses nothing, where others do:
# rounding then is felt at 1e-8 of what there is of it.
_MOST_GROWTH = 18.0
# A propagator that reaches further than this many cells only costs memory.
_LONGEST_REACH = 160
# Points of a run whose rows of the propagator are held as one dense matrix.
RUN = 32
# Rows of a propagator that are held, at most, bytes.
_MOST_ROWS = 5e8
# Gauss nodes beyond half the phase of what they integrate.
_EXTRA_NODES = 14
# A field of more bytes than this is taken for a slip of the pen, as are more steps.
_LARGEST = 1e12
_MOST_STEPS = 10**8
# Frames in one chunk: as many as fit into about this many bytes, within these limits.
_CHUNK_BYTES = 24e6
_CHUNK_FRAMES = (4, 128)
# Runs of like media share what is compiled if their tables have the same size.
_ROUND = 8


@dataclass(frozen=True)
class TimeStep:
    """How a simulation is stepped; all times scaled.

    Attributes:
        solver: "propagator", "chebyshev", or the name of a solver of diffrax.
        step: h.
        per_frame: steps from one frame to the next.
        frames: number of frames, the start among them.
        radius: R ≥ every frequency of the bar.
        shift: s, half the fastest loss rate.
        degree: of the series of exp(hA).
        nodes: Gauss nodes of a step, at which signals are taken.
        reach: cells beyond which nothing is felt within a step, to rounding.
    """

    solver: str
    step: float
    per_frame: int
    frames: int
    radius: float
    shift: float
    degree: int
    nodes: int
    reach: int

    @property
    def steps(self) -> int:
        """Number of steps of the run."""
        return (self.frames - 1) * self.per_frame

    @property
    def operator_products(self) -> int:
        """Products with a state that the run takes: with A, or one a step of the propagator."""
        if self.solver == "propagator":
            return self.steps
        each = EXPLICIT[self.solver][0] if self.solver in EXPLICIT else self.degree
        return self.steps * each


def time_step(simulation: Simulation) -> TimeStep:
    """Stepper, step and tables' sizes for a simulation.

    "auto" takes the propagator where nothing is lost, and else the series; both are exact to
    rounding at any step, and take the frame interval as their step unless it is very long.

    Raises:
        ValueError: the run is too large to be meant.
    """
    asked, lossy = simulation.solver, simulation.lossy
    unit = float(scales(simulation.medium).time)
    interval = simulation.interval / unit
    radius = highest_frequency(simulation)
    loss = fastest_loss(simulation, radius)
    speed = _cells_per_time(simulation) * unit
    solver = asked
    if asked == "auto":
        solver = "chebyshev" if lossy or _rows_held(simulation) > _MOST_ROWS else "propagator"
    if solver == "propagator":
        longest = (_LONGEST_REACH - _reach(0.0, 0.0)) / (1.25 * speed)
    elif solver == "chebyshev":
        longest = _LONGEST_STEP / radius
        if loss > 0:
            grows = radius * math.log(_growth(radius, loss / 2)) - loss / 2
            longest = min(longest, 2 * _MOST_DECAY / loss)
            longest = min(longest, _MOST_GROWTH / grows) if grows > 0 else longest
    else:
        longest = EXPLICIT[solver][1] / (radius + loss)
    if simulation.step is not None:
        longest = min(longest, simulation.step / unit)
    per_frame = max(1, math.ceil(interval / longest * (1 - 1e-12)))
    h = interval / per_frame
    degree = series_coefficients(np.array([h]), radius, loss / 2).shape[1] - 1
    nodes = math.ceil(h * (radius + loss) / 2) + _EXTRA_NODES
    made = TimeStep(
        solver, h, per_frame, simulation.frames, radius, loss / 2,
        _rounded(degree + 1) - 1, _rounded(nodes), _rounded(_reach(h, speed)),
    )  # fmt: skip
    _check_size(simulation, made)
    return made


def chunk_frames(simulation: Simulation) -> int:
    """Frames that are integrated in one go, stored and told of."""
    size = 8 * simulation.bar.cells * len(simulation.fields)
    low, high = _CHUNK_FRAMES
    return min(max(low, int(_CHUNK_BYTES / size)), high, simulation.frames - 1)


def _check_size(simulation: Simulation, step: TimeStep) -> None:
    """Refuse what no machine holds; what this one can do is told by ``cost``.

    Raises:
        ValueError: the frames are too many to store, or the steps to take.
    """
    frames, cells, fields = simulation.frames, simulation.bar.cells, len(simulation.fields)
    stored = 8.0 * frames * cells * fields
    given = f"duration = {simulation.duration:g}"
    if simulation.samples is not None:
        given = f"samples = {simulation.samples}"
    if stored > _LARGEST:
        raise ValueError(
            f"{given}: {frames:.6g} frames of {fields} fields on a bar of {cells:.6g} cells are "
            f"{stored / 1e12:.3g} TB, more than {_LARGEST / 1e12:g} TB; lower it, or take fewer "
            "cells"
        )
    if step.steps > _MOST_STEPS:
        seconds = step.step * float(scales(simulation.medium).time)
        raise ValueError(
            f"duration = {simulation.duration:g} takes {step.steps:.3g} steps of {seconds:.3g} s, "
            f"more than {_MOST_STEPS:.0e}; shorten it, or {slower(simulation, step)}"
        )


def slower(simulation: Simulation, step: TimeStep) -> str:
    """What to change where a run takes too many steps, or products."""
    if simulation.solver != "auto":
        return f'leave [time] solver (now "{simulation.solver}") at "auto"'
    if simulation.step is not None:
        return f'leave [time] step (now {simulation.step:g} s) at "auto"'
    if step.shift > step.radius:  # losses set the pace
        laws = [layer.medium.damping for layer in simulation.layers.layers]
        mass, stiffness = max(law.mass for law in laws), max(law.stiffness for law in laws)
        squared = (step.radius / float(scales(simulation.medium).time)) ** 2
        if mass + stiffness * squared > 0:
            key = "mass" if mass > stiffness * squared else "stiffness"
            return (
                f"lower {key}_damping (now {mass if key == 'mass' else stiffness:g}), by which "
                "waves on the grid die far faster than they swing"
            )
    return (
        "lower [time] samples, or look for a medium far stiffer, or far lighter, than the others, "
        "which sets the pace for all"
    )


def _rounded(size: int) -> int:
    return -(-size // _ROUND) * _ROUND


def _reach(step: float, speed: float) -> int:
    """Cells beyond which nothing is felt within a step, to rounding.

    A front at c_∞ and a tail ahead of it that falls faster than any power; the constants bound
    what was measured for orders 2 to 12 and steps of 0.5 to 16 units of time.
    """
    return math.ceil(1.25 * speed * step) + 30


def _cells_per_time(simulation: Simulation) -> float:
    """Largest c_∞ over the cell size, 1/s."""
    return max(
        medium.fastest / size
        for layer, _, size in simulation.stretches
        for medium in layer.sampled()
    )


def _rows_held(simulation: Simulation) -> float:
    """Bytes that the rows of a propagator take where those of graded layers are all different."""
    window = RUN + 2 * _LONGEST_REACH
    graded = sum(cells for layer, cells, _ in simulation.stretches if layer.last is not None)
    entries = sum(len(block.macro + block.micro) ** 2 for block in simulation.blocks)
    return 8.0 * graded * window * entries


def highest_frequency(simulation: Simulation, layers: Layers | None = None) -> float:
    """R ≥ every frequency of a bar, scaled.

    By Rayleigh's quotient: at each point the strains (κ, B) are at most (‖D‖ φ, B) in size, so no
    ω² exceeds the largest eigenvalue of the stiffnesses there, with ‖D‖ at each φ, against the
    inertias. Stretches are joined as finite elements are: no mode of the whole is faster than
    the fastest of its parts.
    """
    units = scales(simulation.medium)
    bar, layers, largest = simulation.bar, layers or simulation.layers, 0.0
    looked_at = [
        (medium, difference_norm(spacing / float(units.length), bar.order))
        for layer, (_, spacing) in zip(layers.layers, bar.all_stretches, strict=True)
        for medium in layer.sampled()
    ]
    for block in simulation.blocks:
        matrices = [bound_matrix(medium, block, units, norm) for medium, norm in looked_at]
        largest = max(largest, float(np.abs(np.linalg.eigvals(np.stack(matrices))).max()))
    return math.sqrt(1.01 * largest) * closure_factor(bar)


def bound_matrix(medium: Medium, block: Block, units: Scales, norm: Any, xp: Any = np) -> Any:
    """A matrix whose largest eigenvalue no ω² of a block exceeds where ‖D‖ is norm, all scaled.

    Args:
        medium: the medium; its parameters may be traced by jax, with ``xp`` its numpy.
        block: one of its family's.
        units: to scale by.
        norm: ‖D‖.
        xp: numpy or jax.numpy.
    """
    c = block_coefficients(medium, block, units)
    on_phi = xp.concatenate([norm**2 * c.c_pp, -norm * c.c_pb], 1) / c.i_phi
    on_B = xp.concatenate([-norm * c.c_bp, c.c_bb + norm**2 * c.gamma], 1) / c.i_B
    return xp.concatenate([on_phi, on_B]) * medium.damping.unrelaxed


def closure_factor(bar: Bar) -> float:
    """By how much closures at ends and interfaces raise the highest frequency, at most."""
    return 1.0 if bar.uniform and bar.periodic else _ENDS


def fastest_loss(simulation: Simulation, radius: float) -> float:
    """Largest rate at which anything on a bar is lost, scaled."""
    unit = float(scales(simulation.medium).time)
    rates = [0.0]
    for layer in simulation.layers.layers:
        law = layer.medium.damping
        rayleigh = law.mass * unit + law.stiffness / unit * radius**2
        rates.append(rayleigh + max(law.rates, default=0.0) * unit)
    ends = [strongest_absorption(simulation.layers, simulation.bar, e) for e in ("left", "right")]
    return max(rates) + max(ends) * unit


def _growth(radius: float, shift: float) -> float:
    """g of |φ_k((A + s)/R)| ≤ g^k, that of the fastest mode there may be if it loses nothing."""
    z = shift / radius + 1j / _ENDS  # R is so much beyond the fastest mode
    return float(abs(z + cmath.sqrt(z**2 + 1)))


def series_coefficients(
    times: Float, radius: float, shift: float, degree: int | None = None
) -> Float:
    """e^{−sτ} c_k(τ) of exp(τA) = e^{−sτ} Σ_k c_k(τ) φ_k((A + s)/R); c_0 = J_0(τR), c_k = 2J_k(τR).

    φ_0 = 1, φ_1 = X, φ_{k+1} = 2X φ_k + φ_{k−1}, that is φ_k(X) = i^k T_k(−iX).

    Args:
        times: τ, shape (n,), scaled.
        radius: R, at least every |Im λ| of A.
        shift: s; every Re λ of A is within −2s and 0.
        degree: highest k; None stops where, over that rectangle, terms fall below rounding.

    Returns:
        Shape (n, degree + 1).
    """
    from scipy.special import jv

    times = np.asarray(times)
    phase = radius * times[:, None]
    if degree is None:
        # |φ_k| is at most g^k on the real axis; near the corners it grows by more (_growth), which
        # the length of a step bounds.
        corner = shift / radius
        growth = corner + math.sqrt(1 + corner**2)
        longest = float(phase.max())
        most = math.ceil(1.2 * growth * longest + 12 * (1 + longest) ** (1 / 3)) + 40
        k = np.arange(most + 1)
        logs = np.log(np.abs(jv(k, longest)) + 1e-300) + k * math.log(growth)
        kept = np.nonzero(logs - shift * float(times.max()) > math.log(1e-17))[0]
        degree = int(np.max(kept))
    coefficients = 2 * jv(np.arange(degree + 1), phase)
    coefficients[:, 0] /= 2
    return np.asarray(coefficients * np.exp(-shift * times)[:, None])


@functools.cache
def gauss_nodes(count: int) -> tuple[Float, Float]:
    """Nodes and weights of Gauss's rule on [−1, 1], which are not to be changed."""
    return np.polynomial.legendre.leggauss(count)


def nodes_of(step: TimeStep) -> tuple[Float, Float]:
    """Gauss nodes τ_n of a step and their weights, shape (nodes,) each, scaled."""
    x, weights = gauss_nodes(step.nodes)
    return step.step * (1 + x) / 2, step.step * weights / 2
