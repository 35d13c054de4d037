"""How strongly sources set the plane waves of an endless bar in motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.planewave.dispersion_relation import block_frequencies
from wavesim.planewave.eigenproblem import solve, spectral_form

Complex = NDArray[np.complex128]


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
