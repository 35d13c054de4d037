"""One wave of a block: k and Z at each ω from a rational function of ω², in closed form.

As Γ → 0 a block of one macro- and b micro-fields has one wave (``layered.cross_section`` has the
equations),

    k² = ι I ω²/𝒟,    Z = k𝒟/ω,    s = I_B ω² ι/m,
    𝒟 = m [c_φφ det(s − c_BB) + c_φB adj(s − c_BB) c_Bφ]/det(s − c_BB):

two polynomials in s, by the recurrence of Faddeev and Le Verrier. Everything is in
the units of the first medium.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.differentiable.traced_layers import TracedLayers, medium_of
from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, Scales, block_coefficients, scales

# π/2 in two parts, of which the first times a count below 2²² is exact.
_QUARTER = Fraction("3.14159265358979323846264338327950288419716939937510") / 2
_FIRST = round(_QUARTER * 2**29) / 2**29
_SECOND = float(_QUARTER - Fraction(_FIRST))
# On |r| ≤ π/4 the next terms are below 1e-18.
_SINE = [(-1) ** n / math.factorial(2 * n + 1) for n in range(9)]
_COSINE = [(-1) ** n / math.factorial(2 * n) for n in range(9)]
_MOST = 0.8


@jax.custom_jvp
def sine_and_cosine(x: Any) -> tuple[Any, Any]:
    """sin x and cos x, x real, by a Taylor series of the rest after quarter turns.

    XLA calls a scalar function for each on a CPU, which takes three times as long as all else of a
    layer; this is vectorised. Within 3e-16 for |x| ≤ 2²⁰; beyond, off as x in quarter turns is.
    """
    turns = jnp.round(x * (2 / math.pi))
    rest = jnp.clip((x - turns * _FIRST) - turns * _SECOND, -_MOST, _MOST)
    square = rest * rest
    sine = rest * _horner(_SINE, square)
    cosine = _horner(_COSINE, square)
    quarter = turns - 4 * jnp.floor(turns / 4)
    odd = (quarter == 1) | (quarter == 3)
    sine, cosine = jnp.where(odd, cosine, sine), jnp.where(odd, sine, cosine)
    return (
        jnp.where(quarter >= 2, -sine, sine),
        jnp.where((quarter == 1) | (quarter == 2), -cosine, cosine),
    )


@sine_and_cosine.defjvp
def _derivative(primals: Any, tangents: Any) -> Any:
    sine, cosine = sine_and_cosine(*primals)
    (dx,) = tangents
    return (sine, cosine), (cosine * dx, -sine * dx)


def _horner(coefficients: list[float], x: Any) -> Any:
    total = jnp.full_like(x, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        total = total * x + coefficient
    return total


class Wave(NamedTuple):
    """What gives k and Z of one wave, scaled; arrays of any shape, alike.

    Attributes:
        above, below: coefficients of the two polynomials of 𝒟, highest power first.
        i_phi, i_B: inertias.
    """

    above: tuple[Any, ...]
    below: tuple[Any, ...]
    i_phi: Any
    i_B: Any

    def of(self, index: Any) -> Wave:
        """Those of some layers."""
        return jax.tree.map(lambda value: value[index], self)

    def stiffness(self, omega: Any, modulus: Any, inertia: Any) -> Any:
        """𝒟 at scaled ω; real where ω, m and ι are."""
        above, below = self._polynomials(omega, modulus, inertia)
        return modulus * above / below

    def numerator(self, omega: Any, modulus: Any, inertia: Any) -> Any:
        """What is 0 where 𝒟 is."""
        return self._polynomials(omega, modulus, inertia)[0]

    def _polynomials(self, omega: Any, modulus: Any, inertia: Any) -> tuple[Any, Any]:
        s = self.i_B * omega**2 * inertia / modulus
        above, below = (functools.reduce(lambda x, c: x * s + c, p) for p in self[:2])
        return above, below


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


def _outward(wave: Wave, losses: dict[str, Any] | None, omega: Any, time: Any) -> tuple[Any, Any]:
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
        losses: its loss law; None where no layer has one: at real ω the three are then real.
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
        block: with a macro-field.
        units: to scale by.

    Returns:
        Shape (L,) each.
    """
    found: Wave = of_each(kinds, values, lambda m: wave_of(block_coefficients(m, block, units)))
    return found


def of_each(
    kinds: tuple[Medium, ...], values: dict[str, Any], make: Callable[[Medium], Any]
) -> Any:
    """What is made of each of some media, arrays of (L, …); arguments as of :func:`waves`."""
    found: Any = None
    for kind in dict.fromkeys(kinds):
        own = jax.vmap(lambda v, kind=kind: make(medium_of(kind, v)))(values)
        if found is not None:
            here = jnp.asarray([k == kind for k in kinds])
            own = jax.tree.map(
                lambda a, b, here=here: jnp.where(here.reshape(-1, *[1] * (a.ndim - 1)), a, b),
                own,
                found,
            )
        found = own
    return found


def wave_of(own: BlockCoefficients) -> Wave:
    """The wave of one block with a macro-field."""
    c_pp, p, q, c = own.c_pp[0, 0], own.c_pb[0], own.c_bp[:, 0], own.c_bb
    unit = np.eye(len(c))
    above, below, adjugate = [c_pp], [jnp.ones_like(c_pp)], jnp.asarray(unit)
    for j in range(1, len(c) + 1):
        product = c @ adjugate
        below.append(-jnp.trace(product) / j)
        above.append(c_pp * below[-1] + p @ adjugate @ q)
        adjugate = product + below[-1] * unit
    return Wave(tuple(above), tuple(below), own.i_phi * below[0], own.i_B * below[0])
