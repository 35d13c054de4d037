"""T and R where the gradient term Γ counts: all waves of a block at each ω, as pure jax functions.

With w = ω²ι/m and B = ik b a wave of p ≤ 1 macro- and up to two micro-fields (``layered/``
has the equations) obeys, with K = k²,

    (G₀ + K G₁)(φ, b) = 0,    G₀ = (−w I_φ   0          ),    G₁ = (C_φφ  −C_φB),
                                   (−C_Bφ    C_BB − w I_B)          (0      Γ   )

so that the K are roots of a polynomial of degree p + b, and (φ, b) a column of the adjugate. Fields
are counted as a = (√z v + f/√z)/2 to the right and b = (√z v − f/√z)/2 to the left; from the right
half-space to the left one goes what is sent back, b = ρ a, and what gets through, a_L → W a_L, with
decaying exponentials alone. It is the physics of ``layered``, by another route.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.differentiable.coefficients import loss_law, moduli, of_each, units_of
from wavesim.differentiable.graded_slices import System, coefficients_along, through_graded
from wavesim.differentiable.traced_layers import TracedLayers
from wavesim.differentiable.waves_of_medium import Waves, inverse, waves_of
from wavesim.material.family import Block
from wavesim.material.layers import Grading
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, Scales, block_coefficients


def with_gradient(stack: TracedLayers, block: Block, omega: Any, steps: int) -> tuple[Any, ...]:
    """T, R, level and power coefficients, as ``stack_transmission.Scattered`` has them, and whether
    they are known, (N,) each.

    Args:
        stack: a stack.
        block: of up to three fields.
        omega: real ω, (N,), not 0, rad/s.
        steps: at most so many slices for a graded layer.
    """
    n, p, units = len(block.macro) + len(block.micro), len(block.macro), units_of(stack)
    scaled = omega * units.time + 0j
    own = _coefficients(stack.kinds, stack.first, block, units)
    last = own
    if stack.last is not None:
        last = _coefficients(stack.kinds, stack.last, block, units)
    z = jax.lax.stop_gradient(_impedance(own))
    waves = partial(waves_of, scaled, units.time, z)
    ends = jax.tree.map(lambda first, last: jnp.stack([first[0], last[-1]]), own, last)
    both = jax.vmap(waves)(ends, loss_law(stack.losses, np.array([0, -1])))
    left, right = (jax.tree.map(lambda x, n=n: x[n], both) for n in (0, 1))

    def layer(state: Any, piece: Any) -> Any:
        rho, through, lost = state
        coefficients, losses, h = piece
        here = waves(coefficients, losses)
        decay = jnp.exp(1j * here.k * h)
        sent = _sent(here, rho)  # at the right end
        there = decay[:, :, None] * sent * decay[:, None, :]  # the same at the left one
        entering = inverse(here.a + here.a_left @ there)
        rho = (here.b + here.b_left @ there) @ entering
        through = through @ ((here.a + here.a_left @ sent) * decay[:, None, :]) @ entering
        return (rho, *_apart(through, lost)), None

    unit = jnp.broadcast_to(jnp.eye(n, dtype=complex), right.a.shape)
    state = right.b @ inverse(right.a), unit, jnp.zeros(len(omega))
    pieces = own, stack.losses, stack.thickness / units.length
    clear = jnp.ones(len(omega), bool)
    for grading, at in stack.stretches():
        if grading:
            graded = partial(
                _graded, stack, grading=grading, kind=stack.kinds[at[0]], block=block, units=units,
                omega=scaled, z=z,
            )  # fmt: skip
            step = partial(_through_slice, p)
            state, enough = through_graded(graded, at, state, step, len(omega), steps)
            clear = clear & enough
        else:
            some = jax.tree.map(lambda x, at=at: x[at], pieces)
            state, _ = jax.lax.scan(jax.checkpoint(layer), state, some)
    rho, through, lost = state
    # Index 0 of a wave is that of the smallest |k|, the one of the closed form.
    come, go = (jnp.argmin(jnp.abs(one.k), axis=1)[:, None] for one in (left, right))
    incident = jnp.take_along_axis(jnp.eye(n)[None], come[:, :, None], axis=1)[:, 0, :, None]
    back = _sent(left, rho) @ incident
    on = inverse(right.a) @ (through @ (left.a @ incident + left.a_left @ back))
    on, back = on[..., 0], back[..., 0]

    def chosen(values: Any, at: Any) -> Any:
        return jnp.take_along_axis(values, at, axis=1)[:, 0]

    ratio = chosen(on * right.first, go) / chosen(left.first, come)
    known = chosen(left.flux, come)
    known = jnp.where(chosen(_carries(left), come) & (known > 0), known, jnp.nan)
    power_T, power_R = (
        jnp.sum(jnp.abs(sent) ** 2 * jnp.where(_carries(one), one.flux, 0.0), axis=1) / known
        for sent, one in ((on, right), (back, left))
    )
    level = 20 / np.log(10) * (jnp.log(jnp.abs(ratio)) - lost)
    R = chosen(back, come) * (1.0 if p else -1.0)
    return jnp.exp(-lost) * ratio, R, level, jnp.exp(-2 * lost) * power_T, power_R, clear


def _apart(through: Any, lost: Any) -> tuple[Any, Any]:
    """What gets through without its size, and what was set apart of it."""
    size = jax.lax.stop_gradient(jnp.abs(through).max(axis=(1, 2)))
    size = jnp.where(size > 0, size, 1.0)
    return through / size[:, None, None], lost - jnp.log(size)


def _through_slice(macro: int, state: Any, piece: tuple[Any, ...]) -> Any:
    """ρ and W at the left end of a slice: e = a ± b and o = a ∓ b, + of a macro-field."""
    rho, through, lost = state
    ee, eo, oe, oo = piece
    n = rho.shape[-1]
    sign = np.where(np.arange(n) < macro, 1.0, -1.0)[:, None]
    e, o = np.eye(n) + sign * rho, np.eye(n) - sign * rho
    e, o = ee @ e + eo @ o, oe @ e + oo @ o
    entering = inverse((e + o) / 2)
    return (sign * (e - o) / 2 @ entering, *_apart(through @ entering, lost))


def _graded(
    stack: TracedLayers,
    n: Any,
    grading: Grading,
    kind: Medium,
    block: Block,
    units: Scales,
    omega: Any,
    z: Any,
) -> System:
    """A graded layer, at scaled complex ω: P and Q of ``layered/``, weighted by √z."""
    p, size = len(block.macro), len(z)
    thickness = stack.thickness[n] / units.length
    m, iota = moduli(loss_law(stack.losses, n), omega.real, units.time)
    m, iota = (jnp.broadcast_to(jnp.asarray(x) + 0j, omega.shape) for x in (m, iota))
    root = jnp.sqrt(z)
    even = jnp.concatenate([root[:p], 1 / root[p:]])

    along = coefficients_along(stack, n, kind, grading, block, units)

    def halves(u: Any) -> tuple[Any, Any]:
        own = BlockCoefficients(*along(u)[0])
        at, modulus, inertia = (x[:, None, None, None] for x in (omega, m, iota))
        unit = np.eye(size - p)
        of_B = modulus * own.c_bb - at**2 * inertia * own.i_B[..., None, None] * unit
        P, Q = -1j / at * of_B, 1j * at / modulus * inverse(own.gamma)
        if p:
            over = 1 / own.c_pp
            P = P + 1j / at * modulus * (own.c_bp @ own.c_pb) * over
            P = jnp.block([[1j * at / modulus * over, own.c_pb * over], [-own.c_bp * over, P]])
            of_phi = 1j * at * inertia * own.i_phi[..., None, None]
            none = jnp.zeros((*u.shape, 1, size - p))
            Q = jnp.block([[of_phi, none], [jnp.swapaxes(none, -1, -2), Q]])
        turn = even[:, None] * even
        return P * turn * thickness, Q / turn * thickness

    def rate(u: Any) -> Any:
        P, Q = halves(u[:, None])
        square = (P @ Q)[:, 0]
        fourth = square @ square
        return jnp.sqrt(jnp.sum(jnp.abs(fourth @ fourth) ** 2, axis=(1, 2))) ** (1 / 8)

    def zeros(u: Any) -> tuple[Any, Any]:
        def of(c_pp: Any, gamma: Any) -> Any:
            diagonals = (jnp.diagonal(c, axis1=1, axis2=2) for c in (c_pp, gamma))
            return jnp.concatenate(list(diagonals), axis=1)

        own, slopes = along(u)
        return of(own[0], own[4]), of(slopes[0], slopes[4])

    return System(halves, rate, zeros)


def _sent(here: Waves, rho: Any) -> Any:
    """Amplitudes of the waves to the left that ρ sends back, by those to the right."""
    return inverse(here.b_left - rho @ here.a_left) @ (rho @ here.a - here.b)


def _carries(waves: Waves) -> Any:
    return jnp.abs(waves.k.imag) <= 1e-9 * jnp.abs(waves.k)


def _coefficients(
    kinds: tuple[Medium, ...], values: dict[str, Any], block: Block, units: Scales
) -> tuple[Any, ...]:
    """c_pp, c_pb, c_bp, c_bb, Γ and inertias of each layer, scaled, (L, …)."""

    def of(medium: Medium) -> tuple[Any, ...]:
        return tuple(vars(block_coefficients(medium, block, units)).values())

    made: tuple[Any, ...] = of_each(kinds, values, of)
    return made


def _impedance(own: tuple[Any, ...]) -> Any:
    """The geometric mean of √(I_φ C_φφ) and √(I_B Γ_jj) over the layers, (n,)."""
    c_pp, _, _, _, gamma, i_phi, i_B = own
    diagonals = (
        jnp.diagonal(c, axis1=1, axis2=2) * i[:, None] for c, i in ((c_pp, i_phi), (gamma, i_B))
    )
    return jnp.exp(jnp.mean(jnp.log(jnp.concatenate(list(diagonals), axis=1)) / 2, axis=0))
