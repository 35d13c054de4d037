"""Step and series of real bars: exp(hA) by Chebyshev polynomials, shifted by its losses. No jax."""

from __future__ import annotations

import math

import numpy as np

from wavesim.timedomain.timestep import (
    LONGEST_REACH,
    LONGEST_STEP,
    Float,
    Schedule,
    reach_within,
)

# On a real bar: radians of the sources' band in a step, and decay over it by e to this.
_LONGEST_POWER = 1.6
_MOST_LOSS = 6.0


def expansion_coefficients(
    times: Float, radius: float, shift: float, degree: int | None = None
) -> Float:
    """e^{−sτ} c_k(τ) of exp(τA) = e^{−sτ} Σ_k c_k(τ) φ_k((A + s)/R); c_0 = J_0(τR), c_k = 2J_k(τR).

    Args:
        times: τ, shape (n,), scaled.
        radius: R, at least every |Im λ| of A.
        shift: s; every Re λ of A is within −2s and 0.
        degree: highest k; None stops where, over that rectangle, terms fall below rounding.

    Returns:
        Shape (n, degree + 1).
    """
    from scipy.special import jv

    phase = radius * np.asarray(times)[:, None]
    if degree is None:
        # |φ_k| on the rectangle is at most g^k, g that of its corner.
        corner = shift / radius
        growth = corner + math.sqrt(1 + corner**2)
        longest = float(phase.max())
        most = math.ceil(1.2 * growth * longest + 12 * (1 + longest) ** (1 / 3)) + 40
        k = np.arange(most + 1)
        logs = np.log(np.abs(jv(k, longest)) + 1e-300) + k * math.log(growth)
        degree = int(np.max(np.nonzero(logs - shift * float(np.max(times)) > math.log(1e-18))[0]))
    coefficients = 2 * jv(np.arange(degree + 1), phase)
    coefficients[:, 0] /= 2
    return np.asarray(coefficients * np.exp(-shift * np.asarray(times))[:, None])


def bar_schedule(
    radius: float,
    loss: float,
    band: float,
    duration: float,
    frames: int,
    solver: str = "auto",
    step: float | None = None,
    speed: float = 0.0,
) -> Schedule:
    """Step of a real bar: with layers, ends or losses.

    Args:
        radius: R, at least every frequency of the bar, scaled.
        loss: fastest rate at which anything is lost, scaled.
        band: angular frequency up to which the sources excite, scaled.
        duration: of the run, scaled.
        frames: stored frames, at least 2.
        solver: "auto", "chebyshev" or, without losses, "propagator".
        step: longest step allowed, scaled; None leaves the choice open.
        speed: c_∞ over the cell size at its largest, cells per scaled time.

    Returns:
        The schedule, of the series; ``zones.banded`` says where the propagator is better.

    Raises:
        ValueError: the solver is not for such a bar.
    """
    if solver == "propagator" and loss > 0:
        raise ValueError(
            "solver = 'propagator': is for bars without losses, and this one has damping or an "
            "absorbing end; take 'chebyshev' or 'auto'"
        )
    if solver not in ("auto", "chebyshev", "propagator"):
        raise ValueError(
            f"solver = {solver!r}: is for uniform periodic bars without losses; a bar with layers, "
            "ends or losses takes 'chebyshev' or 'auto'"
        )
    interval = duration / (frames - 1)
    # What is lost is an integral over a step, good to 1e-9 up to this.
    longest = min(_LONGEST_POWER / band, LONGEST_STEP / radius)
    if loss > 0:
        longest = min(longest, 2 * _MOST_LOSS / loss)
    if solver == "propagator" and speed > 0:
        longest = min(longest, (LONGEST_REACH - reach_within(0.0, 0.0)) / (1.25 * speed))
    if step is not None:
        longest = min(longest, step)
    per_frame = max(1, math.ceil(interval / longest * (1 - 1e-12)))
    h = interval / per_frame
    degree = expansion_coefficients(np.array([h]), radius, loss / 2).shape[1] - 1
    reach = reach_within(h, speed)
    return Schedule("chebyshev", h, per_frame, frames, radius**2, degree, reach, loss / 2)
