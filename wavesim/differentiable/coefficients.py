"""One wave of a block: k and Z at each ω from a rational function of ω², in closed form.

As Γ → 0 a block of one rotation has one wave (``layered.section`` has the equations),

    k² = ι I ω²/𝒟,    Z = k𝒟/ω,    𝒟 = m (n₂ s² + n₁ s + n₀)/(s² − t s + d),    s = I_B ω² ι/m,

with t and d trace and determinant of c_BB, n₂ = c_φφ, n₁ = c_φB c_Bφ − n₂ t,
n₀ = n₂ d − c_φB adj(c_BB) c_Bφ. Everything is in the units of the first medium.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from wavesim.differentiable.sine_and_cosine import sine_and_cosine
from wavesim.differentiable.traced_layers import TracedLayers, medium_of
from wavesim.material.medium import Medium
from wavesim.material.scaling import Scales, block_coefficients, scales
from wavesim.material.sectors import Block


class Wave(NamedTuple):
    """What gives k and Z of one wave, scaled; any shape, alike.

    Attributes:
        n2, n1, n0, t, d: of 𝒟.
        i_phi, i_B: inertias.
    """

    n2: Any
    n1: Any
    n0: Any
    t: Any
    d: Any
    i_phi: Any
    i_B: Any

    def of(self, index: Any) -> Wave:
        """Those of some layers."""
        return Wave(*(value[index] for value in self))

    def stiffness(self, omega: Any, modulus: Any, inertia: Any) -> Any:
        """𝒟 at scaled ω; real where ω, m and ι are."""
        s = self.i_B * omega**2 * inertia / modulus
        above = (self.n2 * s + self.n1) * s + self.n0
        return modulus * above / ((s - self.t) * s + self.d)


class HalfSpace(NamedTuple):
    """Z of the wave that goes out, complex, and whether it carries energy; shape (N,)."""

    Z: Any
    carries: Any


def loss_law(losses: dict[str, Any] | None, index: Any) -> dict[str, Any] | None:
    """The loss laws of some layers."""
    return None if losses is None else {name: value[index] for name, value in losses.items()}


def moduli(losses: dict[str, Any] | None, omega: Any, time: Any) -> tuple[Any, Any]:
    """m(ω) and ι(ω) of one layer (``material.damping``), complex; 1 and 1 without losses.

    Args:
        losses: of one layer.
        omega: scaled, (N,); time: its unit, s.
    """
    if losses is None:
        return 1.0, 1.0
    at = omega / time
    rates, strengths = losses["rates"], losses["strengths"]
    relaxed = jnp.sum(strengths * rates / (rates - 1j * at[..., None]), axis=-1)
    modulus = losses["unrelaxed"] * (1 - relaxed) - 1j * at * losses["stiffness"]
    return modulus, 1 + 1j * losses["mass"] / at


def _outward(wave: Wave, losses: dict[str, Any], omega: Any, time: Any) -> tuple[Any, Any]:
    """Complex k, with Im k ≥ 0 or, where k is real, energy to the right; and Z."""
    m, iota = moduli(losses, omega, time)
    D = wave.stiffness(omega, m, iota)
    k = omega * jnp.sqrt(iota * wave.i_phi / D)
    decays = jnp.abs(k.imag) > 1e-13 * jnp.abs(k)
    k = jnp.where(decays & (k.imag < 0), -k, k)
    return k, k * D / omega


def half_space(wave: Wave, losses: dict[str, Any] | None, omega: Any, time: Any) -> HalfSpace:
    """The wave that goes out into a half-space; arguments of one layer, as :func:`across`."""
    if losses is None:
        D = wave.stiffness(omega, 1.0, 1.0)
        Z = jnp.sqrt(wave.i_phi * jnp.abs(D))
        passes = D > 0
        return HalfSpace(
            jax.lax.complex(jnp.where(passes, Z, 0.0), jnp.where(passes, 0.0, -Z)), passes
        )
    k, Z = _outward(wave, losses, omega, time)
    return HalfSpace(Z, jnp.abs(k.imag) <= 1e-9 * jnp.abs(k))


def across(
    wave: Wave, losses: dict[str, Any] | None, omega: Any, time: Any, h: Any
) -> tuple[Any, Any, Any, Any]:
    """cos kh, sin kh/Z and Z sin kh, each times e^{−Im kh}, and Im kh, of a layer.

    Args:
        wave: of the layer.
        losses: its loss law; None where no layer has one: the three are then real.
        omega: scaled, (N,); time: its unit, s.
        h: its thickness, scaled.
    """
    if losses is None:
        D = wave.stiffness(omega, 1.0, 1.0)
        Z, passes = jnp.sqrt(wave.i_phi * jnp.abs(D)), D > 0
        phase = omega * wave.i_phi / Z * h
        turn, decay = jnp.where(passes, phase, 0.0), jnp.where(passes, 0.0, phase)
        half = jnp.expm1(-2 * decay) / 2
        sin, cos = sine_and_cosine(turn)
        c = jnp.where(passes, cos, 1 + half)
        s = jnp.where(passes, sin, half)
        return c, s / Z, jnp.where(passes, s, -s) * Z, decay
    k, Z = _outward(wave, losses, omega, time)
    turn, decay = k.real * h, k.imag * h
    half = jnp.expm1(-2 * decay) / 2
    sin, cos = sine_and_cosine(turn)
    c = jax.lax.complex(cos * (1 + half), sin * half)
    s = jax.lax.complex(sin * (1 + half), -cos * half)
    return c, s / Z, s * Z, decay


def units_of(stack: TracedLayers) -> Scales:
    """Units of the first medium."""
    return scales(medium_of(stack.kinds[0], {k: v[0] for k, v in stack.first.items()}))


def waves(kinds: tuple[Medium, ...], values: dict[str, Any], block: Block, units: Scales) -> Wave:
    """The wave of each of some media.

    Args:
        kinds: of each, for its closure.
        values: {parameter: (L,)}.
        block: of one rotation and two micro-curvatures.
        units: to scale by.

    Returns:
        Shape (L,) each.
    """
    found: Wave | None = None
    for kind in dict.fromkeys(kinds):
        own = jax.vmap(lambda v, kind=kind: _wave(medium_of(kind, v), block, units))(values)
        if found is None:
            found = own
        else:
            here = jnp.asarray([k == kind for k in kinds])
            found = Wave(*(jnp.where(here, a, b) for a, b in zip(own, found, strict=True)))
    assert found is not None
    return found


def _wave(medium: Medium, block: Block, units: Scales) -> Wave:
    own = block_coefficients(medium, block, units)
    n2, p, q, c = own.c_pp[0, 0], own.c_pb[0], own.c_bp[:, 0], own.c_bb
    t, d = c[0, 0] + c[1, 1], c[0, 0] * c[1, 1] - c[0, 1] * c[1, 0]
    adjugate = p[0] * (c[1, 1] * q[0] - c[0, 1] * q[1]) + p[1] * (c[0, 0] * q[1] - c[1, 0] * q[0])
    n1 = p[0] * q[0] + p[1] * q[1] - n2 * t
    return Wave(n2, n1, n2 * d - adjugate, t, d, own.i_phi, own.i_B)
