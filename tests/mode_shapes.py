"""Mode shapes in SI, normalised by energy, and the velocity at which energy travels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.material.scaling import scales
from wavesim.planewave.dispersion_relation import scaled_group_velocity
from wavesim.planewave.eigenproblem import Complex, Float, is_symmetric, solve, spectral_form
from wavesim.planewave.hyperbolicity import real_frequencies


@dataclass(frozen=True)
class Modes:
    """The plane waves of one block at real wavenumbers, ascending in ω at each.

    Attributes:
        block: the block.
        k: shape (n,), rad/m.
        omega: shape (n, m), rad/s.
        group_velocity: ∂ω/∂k, shape (n, m), m/s.
        shapes: complex amplitudes in e^{i(kx−ωt)} of the family's fields, shape (n, m, fields), SI,
            for a mean energy density of 1 J/m³, with Φ real and ≥ 0. A wave with ω = 0 holds no
            energy at any amplitude: it is given one unit.
    """

    block: Block
    k: Float
    omega: Float
    group_velocity: Float
    shapes: Complex


def block_modes(medium: Medium, block: Block, k: ArrayLike) -> Modes:
    """Frequencies, group velocities and mode shapes of one block.

    The mean energy density of a plane wave is twice its kinetic part, so that
    ½ ω² (m_φ |Φ|² + m_B |B|²) = 1 J/m³; closures that conserve no energy are normalised alike.

    Args:
        medium: the medium.
        block: one of its family's blocks.
        k: wavenumbers, shape (n,), rad/m.

    Raises:
        NotHyperbolicError: an ω(k) is not real.
    """
    given = np.atleast_1d(np.asarray(k, dtype=float))
    scaled, form = given * medium.length_scale, spectral_form(medium, block)
    solved, units = solve(form, scaled), scales(medium)
    omega = real_frequencies(solved, scaled, block, medium)
    vectors = np.swapaxes(np.real(solved.right), -1, -2)
    vectors = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    vectors = np.where(vectors[..., :1] < 0, -vectors, vectors)
    resting = omega == 0
    density = float(units.energy / units.length)
    amplitude = np.where(resting, 1.0, (2 / density) ** 0.5 / np.where(resting, 1.0, omega))
    vectors = vectors * amplitude[..., None]
    p, family = len(block.macro), medium.part(block).family
    units = units.of(family)
    of_macro, of_micro = block.projections(family)
    macro = float(units.macro) * (vectors[..., :p] @ of_macro)
    micro = float(units.micro) * (vectors[..., p:] @ of_micro)
    return Modes(
        block,
        given,
        omega / medium.time_scale,
        scaled_group_velocity(form, scaled, solved) * medium.length_scale / medium.time_scale,
        np.concatenate([macro.astype(complex), 1j * micro], axis=-1),
    )


def energy_velocity(medium: Medium, block: Block, k: ArrayLike) -> Float:
    """Mean power flow over mean energy density of each plane wave, closure "consistent".

    P = −½ Re(σ φ̇* + (Γ ∂ₓB)·Ḃ*), and E = ¼ (|φ̇|² + |Ḃ|²) + ¼ (κ*C_φφ κ − 2 Re κ*C_φB B + B*C_BB B +
    ∂ₓB*Γ ∂ₓB), kinetic and potential, in scaled form. It equals ∂ω/∂k, by another way.

    Args:
        medium: the medium; its equations must be symmetric.
        block: one of its family's blocks.
        k: wavenumbers, shape (n,), not 0, rad/m.

    Returns:
        Velocities in the order of ``block_frequencies``, shape (n, branches), m/s.

    Raises:
        ValueError: a k is 0, or the medium conserves no energy of this form.
    """
    scaled = np.atleast_1d(np.asarray(k, dtype=float)) * medium.length_scale
    form = spectral_form(medium, block)
    if not is_symmetric(form):
        raise ValueError(
            f"closure = {medium.closure!r} of this medium is not symmetric and conserves no "
            "energy: take closure 'consistent', or group_velocity"
        )
    if (scaled == 0).any():
        raise ValueError("k = 0: must not be 0; no energy travels there, see long_wave_speed")
    solved = solve(form, scaled)
    omega = np.sqrt(solved.squares)[..., None]
    vectors = np.swapaxes(solved.right, -1, -2).astype(complex)
    p = len(block.macro)
    wave = 1j * scaled[:, None, None]
    phi, bend = vectors[..., :p], 1j * vectors[..., p:]
    kappa, bend_slope = wave * phi, wave * bend
    stress = kappa @ form.c_pp.T - bend @ form.c_pb.T

    def dot(one: Any, other: Any) -> Float:
        return np.real(np.sum(np.conj(one) * other, axis=-1))

    flow = -0.5 * (
        dot(-1j * omega * phi, stress) + dot(-1j * omega * bend, bend_slope @ form.gamma.T)
    )
    kinetic = 0.25 * (omega**2)[..., 0] * (dot(phi, phi) + dot(bend, bend))
    potential = 0.25 * (
        dot(kappa, kappa @ form.c_pp.T)
        - 2 * dot(kappa, bend @ form.c_pb.T)
        + dot(bend, bend @ form.c_bb.T)
        + dot(bend_slope, bend_slope @ form.gamma.T)
    )
    return flow / (kinetic + potential) * medium.length_scale / medium.time_scale
