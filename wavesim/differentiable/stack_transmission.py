"""T(ω) and R(ω) of a stack of layers as a pure jax function of media, thicknesses and losses.

With v = −iωφ and f = −σ = i g (``layered/``) a layer of thickness h takes (v, g) from its
right end to its left one,

    v → c v + (s/Z) g,    g → c g − Z s v,    c = cos kh,  s = sin kh,

each multiplied by e^{−Im kh}, so that nothing overflows. From the right, where one wave goes out
(v = 1, f = Z), to the left the wanted solution is the one that grows in a gap, and keeps its
precision; on the left it is a wave that comes in, a = (v + f/Z)/2, and one that goes back,
b = (v − f/Z)/2: T = e^{−Σ Im kh}/a, R = b/a. Without losses all is real but the start.

It is the physics of ``layered``, by another route: one vector in place of scattering matrices.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.differentiable.coefficients import (
    Wave,
    across,
    half_space,
    loss_law,
    moduli,
    units_of,
    wave_of,
    waves,
)
from wavesim.differentiable.graded_slices import System, coefficients_along, through_graded
from wavesim.differentiable.stack_with_gradient_term import with_gradient
from wavesim.differentiable.traced_layers import TracedLayers
from wavesim.material.family import Block, travelling_block
from wavesim.material.layers import Grading
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients, Scales


class Scattered(NamedTuple):
    """What a stack lets through and sends back, at each ω.

    Attributes:
        T, R: amplitudes of φ over the incident one, from the left; planes x = 0 and x = L, (N,).
        level: 20 log₁₀|T|, dB, finite where T underflows, (N,).
        power_T, power_R: energy over the incident one; NaN where the incident wave carries none.
    """

    T: Any
    R: Any
    level: Any
    power_T: Any
    power_R: Any


def transmission(
    stack: TracedLayers, sector: str, omega: Any, steps: int | None = None
) -> Scattered:
    """T and R of a stack between half-spaces of its first and its last medium.

    A pure function of the stack's arrays and of ω: ``jax.jit`` (sector and steps static),
    ``jax.grad`` and ``jax.vmap`` go through. In 64-bit floats.

    Args:
        stack: of :func:`~wavesim.differentiable.traced_layers.traced_layers`.
        sector: such as longitudinal or transverse2. Where the stack keeps Γ a block of
            micro-fields alone too, such as inplane(23): ratios are those of its field then.
        omega: real ω, (N,), not 0, rad/s.
        steps: at most so many slices for a graded layer, ``stack.slices`` by default; each ω takes
            those it needs.

    Returns:
        T, R, level and power coefficients; NaN where the slices of a graded layer do not suffice,
        as at an asymptote within it where nothing is lost, at which there is no answer.

    Raises:
        ValueError: the sector is unknown, or nothing travels in it: as Γ → 0 micro-fields alone
            swing on the spot, each at one frequency.
    """
    block = travelling_block(stack.kinds[0].family, sector, stack.kept)
    if omega is None or jnp.iscomplexobj(omega) or jnp.ndim(omega) == 0:
        raise ValueError("omega: must be a list of real frequencies, rad/s")
    solve = with_gradient if stack.kept else _transmission
    with jax.numpy_dtype_promotion("standard"):  # complex where something is lost, real elsewhere
        *found, clear = solve(stack, block, jnp.asarray(omega), steps or stack.slices)
        return Scattered(*(jnp.where(clear, value, jnp.nan) for value in found))


def _transmission(stack: TracedLayers, block: Block, omega: Any, steps: int) -> tuple[Any, ...]:
    units = units_of(stack)
    scaled = omega * units.time
    first = waves(stack.kinds, stack.first, block, units)
    last = first if stack.last is None else waves(stack.kinds, stack.last, block, units)
    left = half_space(first.of(0), loss_law(stack.losses, 0), scaled, units.time)
    right = half_space(last.of(-1), loss_law(stack.losses, -1), scaled, units.time)
    # Where all that acts on v and g is real, real and imaginary part go apart.
    real = stack.losses is None
    state: Any = jnp.ones_like(right.Z), -1j * right.Z, jnp.zeros(scaled.shape)
    if real:
        state = *(jnp.stack([z.real, z.imag]) for z in state[:2]), state[2]
    thickness = stack.thickness / units.length
    clear = jnp.ones(scaled.shape, bool)
    for grading, at in stack.stretches():
        if grading:
            graded = partial(
                _graded, stack, grading=grading, kind=stack.kinds[at[0]], block=block, units=units,
                omega=scaled,
            )  # fmt: skip
            state, enough = through_graded(graded, at, state, _through_slice, len(scaled), steps)
            clear = clear & enough
        else:
            pieces = first.of(at), thickness[at], loss_law(stack.losses, at)
            step = jax.checkpoint(partial(_through_layer, scaled, units.time), prevent_cse=False)
            state, _ = jax.lax.scan(step, state, pieces)
    v, g, lost = state
    if real:
        v, g = (jax.lax.complex(z[0], z[1]) for z in (v, g))
    f = 1j * g
    a, b = (v + f / left.Z) / 2, (v - f / left.Z) / 2
    level = -20 / np.log(10) * (lost + jnp.log(jnp.abs(a)))
    T, R = jnp.exp(-lost) / a, b / a
    incident = jnp.where(left.carries, left.Z.real, jnp.nan)
    through = jnp.where(right.carries, right.Z.real, 0.0) / incident
    power_T, power_R = jnp.abs(T) ** 2 * through, jnp.abs(R) ** 2 * incident / incident
    return T, R, level, power_T, power_R, clear


def _through_layer(omega: Any, time: Any, state: Any, piece: Any) -> Any:
    """(v, g) at the left end of a layer from those at its right end."""
    wave, h, losses = piece
    v, g, lost = state
    c, s_over_Z, Z_s, decay = across(wave, losses, omega, time, h)
    return (c * v + s_over_Z * g, c * g - Z_s * v, lost + decay), None


def _through_slice(state: Any, piece: tuple[Any, ...]) -> Any:
    """The same of a slice of a graded layer, o of which is g; what it grows by is set apart."""
    vv, vg, gv, gg = (one[:, 0, 0] for one in piece)
    v, g, lost = state
    v, g = vv * v + vg * g, gv * v + gg * g
    square = jnp.abs(v) ** 2 + jnp.abs(g) ** 2
    size = jax.lax.stop_gradient(jnp.sqrt(square if v.ndim == 1 else square.sum(axis=0)))
    return v / size, g / size, lost + jnp.log(size)


def _wave_of(*own: Any) -> Wave:
    return wave_of(BlockCoefficients(*own))


def _graded(
    stack: TracedLayers,
    n: Any,
    grading: Grading,
    kind: Medium,
    block: Block,
    units: Scales,
    omega: Any,
) -> System:
    """A graded layer, at scaled ω."""
    thickness = stack.thickness[n] / units.length
    m, iota = (jnp.asarray(x) for x in moduli(loss_law(stack.losses, n), omega, units.time))
    m, iota = (jnp.broadcast_to(x, omega.shape) for x in (m, iota))
    along = coefficients_along(stack, n, kind, grading, block, units)

    def wave(u: Any) -> Wave:
        of: Any = _wave_of
        for _ in range(u.ndim):
            of = jax.vmap(of)
        return of(*along(u)[0])

    def halves(u: Any) -> tuple[Any, Any]:
        own = wave(u)
        at = (x[:, None] for x in (omega, m, iota))
        P = -omega[:, None] / own.stiffness(*at) * thickness
        Q = (omega * iota)[:, None] * own.i_phi * thickness
        return P[..., None, None], Q[..., None, None]

    def rate(u: Any) -> Any:
        own = wave(u)
        square = iota * own.i_phi / own.stiffness(omega, m, iota)
        return omega * jnp.sqrt(jnp.abs(square)) * thickness

    def zeros(u: Any) -> tuple[Any, Any]:
        def zero(omega: Any, m: Any, iota: Any, *own: Any) -> Any:
            return _wave_of(*own).numerator(omega, m, iota)

        own, slopes = along(u)
        still = [jnp.zeros_like(x) for x in (omega, m, iota)]
        found = jax.jvp(jax.vmap(zero), (omega, m, iota, *own), (*still, *slopes))
        return found[0][:, None], found[1][:, None]

    return System(halves, rate, zeros)
