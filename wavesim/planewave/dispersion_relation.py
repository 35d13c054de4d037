"""The spectral solver: plane waves exp(i(kx − ωt)) in an unbounded medium, for real k.

It knows no grid: it shares the medium with the time domain and nothing else. Everything is in SI
at the boundary of this module: k in rad/m, ω in rad/s. Real k is solved here; band edges and gaps
in closed form, complex k(ω), and the search for waves that grow come from modules of their own
and are offered here by name.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, scales
from wavesim.planewave.band_edges import (
    Gap,
    asymptotes,
    cutoffs,
    full_gaps,
    gaps,
    gradient_share,
    open_gaps,
)
from wavesim.planewave.complex_wavenumber import ComplexWaves, complex_waves, wavenumber
from wavesim.planewave.eigenproblem import (
    Complex,
    Eigenmodes,
    Float,
    slope,
    solve,
    spectral_form,
)
from wavesim.planewave.hyperbolicity import NotHyperbolicError, check_hyperbolic, real_frequencies

__all__ = [
    "ComplexWaves",
    "Gap",
    "NotHyperbolicError",
    "asymptotes",
    "block_frequencies",
    "block_group_velocity",
    "block_oscillations",
    "check_hyperbolic",
    "complex_waves",
    "cutoffs",
    "damped_frequencies",
    "frequencies",
    "full_gaps",
    "gaps",
    "gradient_share",
    "group_velocity",
    "long_wave_speed",
    "open_gaps",
    "wavenumber",
]


def _scaled(medium: Medium, k: ArrayLike) -> Float:
    return np.atleast_1d(np.asarray(k, dtype=float)) * medium.length_scale


def block_frequencies(medium: Medium, block: Block, k: ArrayLike) -> Float:
    """ω(k) of one block, branches ascending.

    Args:
        medium: the medium.
        block: one of its family's blocks.
        k: wavenumbers, shape (n,), rad/m.

    Returns:
        Angular frequencies, shape (n, branches of the block), rad/s.

    Raises:
        NotHyperbolicError: an ω(k) is not real.
    """
    scaled = _scaled(medium, k)
    modes = solve(spectral_form(medium, block), scaled)
    return real_frequencies(modes, scaled, block, medium) / medium.time_scale


def block_oscillations(medium: Medium, block: Block, k: ArrayLike) -> Float:
    """Re ω(k) of one block, at which a field of wavenumber k oscillates while losses let it decay.

    Arguments, order and errors as of :func:`block_frequencies`, which it is without losses.
    """
    return np.real(medium.damping.lossy(block_frequencies(medium, block, k)))


def frequencies(medium: Medium, sector: str, k: ArrayLike) -> Float:
    """ω(k) of one sector, branches ascending at each k.

    Args:
        medium: the medium.
        sector: longitudinal, transverse2, transverse3 or inplane.
        k: wavenumbers, shape (n,), rad/m.

    Returns:
        Angular frequencies, shape (n, 3), rad/s.

    Raises:
        NotHyperbolicError: an ω(k) is not real.
        ValueError: no sector has that name.
    """
    parts = [block_frequencies(medium, block, k) for block in medium.family.blocks_of(sector)]
    return np.sort(np.concatenate(parts, axis=1), axis=1)


def damped_frequencies(medium: Medium, sector: str, k: ArrayLike) -> Complex:
    """ω(k) of one sector with the medium's losses: Ω(ω) = ω₀(k), ω₀ of :func:`frequencies`.

    Args:
        medium: the medium; without a loss law ω is ω₀.
        sector: longitudinal, transverse2, transverse3 or inplane.
        k: wavenumbers, shape (n,), rad/m.

    Returns:
        Complex angular frequencies in the order of ω₀, shape (n, 3), rad/s; waves fall as
        exp(Im ω t), Im ω ≤ 0.

    Raises:
        NotHyperbolicError: an ω₀(k) is not real.
        ValueError: no sector has that name.
    """
    return np.asarray(medium.damping.lossy(frequencies(medium, sector, k)), dtype=complex)


def scaled_group_velocity(form: BlockCoefficients, k: Float, modes: Eigenmodes) -> Float:
    """∂ω/∂k = uᵀ(dK/dk)v / 2ω of solved modes, shape (n, m), scaled.

    At k = 0 a branch with ω = 0 starts with the long-wave speed; an optical one is at rest.
    """
    omega = np.sqrt(np.maximum(modes.squares.real, 0.0))
    rising = slope(form, k, modes).real
    still = omega <= 1e-150
    speed = np.where(still, 0.0, rising / np.where(still, 1.0, 2 * omega))
    starting = (k == 0) & still[:, 0]
    if starting.any() and np.shape(form.c_pp)[-1] == 1:
        speed[starting, 0] = _scaled_long_wave_speed(form)
    return speed


def _scaled_long_wave_speed(form: BlockCoefficients) -> float:
    # A pseudo-inverse, as at η = 0 a micro-field that couples to nothing costs no energy.
    static = form.c_pp - form.c_pb @ np.linalg.pinv(form.c_bb, rcond=1e-12) @ form.c_bp
    return float(np.sqrt(static[0, 0]))


def block_group_velocity(medium: Medium, block: Block, k: ArrayLike) -> Float:
    """Group velocity ∂ω/∂k of one block, analytic (Hellmann–Feynman), not by differences.

    Args:
        medium: the medium.
        block: one of its family's blocks.
        k: wavenumbers, shape (n,), rad/m.

    Returns:
        Velocities in the order of :func:`block_frequencies`, shape (n, branches), m/s. At k = 0
        the acoustic branch has its long-wave speed.

    Raises:
        NotHyperbolicError: an ω(k) is not real.
    """
    scaled, form = _scaled(medium, k), spectral_form(medium, block)
    modes = solve(form, scaled)
    real_frequencies(modes, scaled, block, medium)
    speed = scaled_group_velocity(form, scaled, modes)
    return speed * medium.length_scale / medium.time_scale


def group_velocity(medium: Medium, sector: str, k: ArrayLike) -> Float:
    """Group velocity ∂ω/∂k of one sector, in the order of :func:`frequencies`.

    Args:
        medium: the medium.
        sector: longitudinal, transverse2, transverse3 or inplane.
        k: wavenumbers, shape (n,), rad/m.

    Returns:
        Velocities, shape (n, 3), m/s.

    Raises:
        NotHyperbolicError: an ω(k) is not real.
        ValueError: no sector has that name.
    """
    blocks = medium.family.blocks_of(sector)
    omega = np.concatenate([block_frequencies(medium, block, k) for block in blocks], axis=1)
    speed = np.concatenate([block_group_velocity(medium, block, k) for block in blocks], axis=1)
    return np.take_along_axis(speed, np.argsort(omega, axis=1), axis=1)


def wave_speeds(medium: Medium) -> dict[str, float]:
    """Speeds of long waves by what those who measure call them, such as {"P": …, "S": …}, m/s."""
    named = medium.family.waves.items()
    return {name: long_wave_speed(medium, sector) for sector, name in reversed(list(named))}


def long_wave_speed(medium: Medium, sector: str) -> float:
    """Speed of the acoustic branch as k → 0: √((C_φφ − C_φB C_BB⁻¹ C_Bφ)/m_φ), m/s.

    Raises:
        ValueError: the sector has no acoustic branch.
    """
    (block, *others) = medium.family.blocks_of(sector)
    if others or not block.macro:
        raise ValueError(
            f"sector {sector!r} has no acoustic branch: take longitudinal or transverse2"
        )
    speed = _scaled_long_wave_speed(spectral_form(medium, block))
    return speed * float(medium.length_scale) / float(medium.time_scale)


def driven_waves(
    medium: Medium, block: Block, sources: Sequence[Any], k: ArrayLike
) -> tuple[Complex, NDArray[np.float64]]:
    """Frequency and amplitude of each branch once no source acts.

    With right and left eigenvectors v, u of K, uᵀv = 1, a force f̂(k) s(t) leaves q̂ = v (uᵀf̂)
    s(ω)/ω · e^{−iωt} and its conjugate; f̂ of a source at x_s, of width w, is e^{−ikx_s − k²w²/2}.

    Args:
        medium: the medium.
        block: one of its family's blocks.
        sources: those that drive it, by body forces or as initial fields, with field, position,
            width, acts and spectrum(ω).
        k: wavenumbers, shape (n,), rad/m.

    Returns:
        ω with the medium's losses, Im ω ≤ 0, shape (n, branches), rad/s; and √Σ|q̂|² over the
        components and over ±k, at t = 0 where it decays, shape (n, branches), scaled.

    Raises:
        NotHyperbolicError: an ω₀(k) is not real.
    """
    given = np.atleast_1d(np.asarray(k, float))
    modes = solve(spectral_form(medium, block), given * medium.length_scale)
    omega = np.asarray(medium.damping.lossy(block_frequencies(medium, block, given)), complex)
    units, parts = scales(medium), (*block.macro, *block.micro)
    length, time = float(medium.length_scale), float(medium.time_scale)
    power = np.zeros(omega.shape)
    for sign in (1, -1):
        # A force on a micro-field is a quarter of a wave behind one on a macro-field.
        turn = np.where(np.arange(len(parts)) < len(block.macro), 1.0, -1j * sign)
        drive = np.zeros(omega.shape, complex)
        for source in sources:
            if source.acts == "initial":
                unit = units.unit(source.field) * length / (math.sqrt(2 * math.pi) * source.width)
            else:
                unit = units.force(source.field) * length * time**2
            on = turn * [part.get(source.field, 0.0) for part in parts] / float(unit)
            place = -1j * sign * given * source.position - (given * source.width) ** 2 / 2
            part = np.exp(place)[:, None] * source.spectrum(omega)
            drive += part * np.einsum("c,ncb->nb", on, modes.left)
        power += np.abs(drive / np.where(omega == 0, np.inf, omega)) ** 2
    return omega, np.sqrt(power) * np.linalg.norm(modes.right, axis=-2)
