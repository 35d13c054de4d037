"""Waves of one medium where the gradient term counts, at each ω, as pure jax functions.

The roots K of det(G₀ + K G₁) of ``stack_with_gradient_term.py``, and for each a column of the
adjugate.
"""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.differentiable.coefficients import moduli

# Of roots by the method of Ehrlich and Aberth, which converges to the third order.
_ITERATIONS = 30


class Waves(NamedTuple):
    """Waves to the right, columns, with mirror images to the left.

    Attributes:
        k: scaled, (N, n).
        a, b: (√z v ± f/√z)/2 of those to the right, (N, n, n); a_left, b_left: to the left.
        first: √z v of the block's first field, (N, n).
        flux: Re(f* v), (N, n).
    """

    k: Any
    a: Any
    b: Any
    a_left: Any
    b_left: Any
    first: Any
    flux: Any


def waves_of(omega: Any, time: Any, z: Any, own: tuple[Any, ...], losses: Any) -> Waves:
    """Waves of one medium at each ω.

    Args:
        omega: ω, scaled, shape (N,).
        time: unit of time, s.
        z: weights of the fields, shape (n,).
        own: of ``stack_with_gradient_term._coefficients``, of one layer.
        losses: its law of losses, or None.
    """
    c_pp, c_pb, c_bp, c_bb, gamma, i_phi, i_B = own
    p, b, count = c_pp.shape[0], c_bb.shape[0], len(omega)
    m, iota = (jnp.broadcast_to(one, (count,)) for one in moduli(losses, omega.real, time))
    w = omega**2 * iota / m
    if losses is None:
        w = w.real
    zero, one = jnp.zeros_like(w)[:, None, None], jnp.ones_like(w)[:, None, None]
    M = c_bb - (w * i_B)[:, None, None] * jnp.eye(b)
    G0 = jnp.block([[(-w * i_phi)[:, None, None] * jnp.eye(p), zero * c_pb], [-c_bp * one, M]])
    G1 = jnp.block([[c_pp * one, -c_pb * one], [zero * c_bp, gamma * one]])
    K = _roots(_polynomial(G0, G1))
    G = G0[:, None] + K[..., None, None] * G1[:, None]
    columns = _adjugate(G)  # (N, waves, n, n), of rank 1
    best = jnp.argmax(jnp.abs(columns).max(axis=2), axis=2)
    x = jnp.take_along_axis(columns, best[:, :, None, None], axis=3)[..., 0]
    x = x / jax.lax.stop_gradient(jnp.abs(x).max(axis=2, keepdims=True))
    x = jnp.swapaxes(x, 1, 2)  # (N, n, waves)
    k = jnp.sqrt(K)
    k = jnp.where((jnp.abs(k.imag) > 1e-13 * jnp.abs(k)) & (k.imag < 0), -k, k)
    root = jnp.sqrt(z)[:, None]

    def fields(k: Any) -> tuple[Any, Any]:
        ik, at = 1j * k[:, None, :], omega[:, None, None]
        phi, micro = x[:, :p], x[:, p:]
        v = jnp.concatenate([-1j * at * phi, -1j * at * ik * micro], axis=1)
        strain = jnp.einsum("ij,njw->niw", c_pp, phi) - jnp.einsum("ij,njw->niw", c_pb, micro)
        bent = jnp.einsum("ij,njw->niw", gamma, micro)
        f = -m[:, None, None] * jnp.concatenate([ik * strain, ik**2 * bent], axis=1)
        return root * v, f / root

    v, f = fields(k)
    flux = jnp.sum((jnp.conj(f) * v).real, axis=1)
    turned = (jnp.abs(k.imag) <= 1e-13 * jnp.abs(k)) & (flux < 0)
    k, flux = jnp.where(turned, -k, k), jnp.where(turned, -flux, flux)
    (v, f), (v_left, f_left) = fields(k), fields(-k)
    return Waves(
        k, (v + f) / 2, (v - f) / 2, (v_left + f_left) / 2, (v_left - f_left) / 2, v[:, 0], flux
    )


def _polynomial(G0: Any, G1: Any) -> Any:
    """Coefficients of det(G₀ + K G₁), lowest power first, (N, n + 1): by rows of one or other."""
    n = G0.shape[-1]
    rows = np.array(list(itertools.product((False, True), repeat=n)))
    mixed = jnp.where(rows[:, :, None], G1[:, None], G0[:, None])
    return _determinant(mixed) @ (rows.sum(axis=1)[:, None] == np.arange(n + 1)).astype(float)


def _roots(c: Any) -> Any:
    """Roots of Σ c_j K^j, complex, (N, n): found without derivatives, then one step of Newton."""
    n, real = c.shape[1] - 1, not jnp.iscomplexobj(c)
    powers = c + 0j
    held = jax.lax.stop_gradient(powers)

    def value(c: Any, x: Any) -> tuple[Any, Any]:
        total, slope = c[:, n, None] * jnp.ones_like(x), jnp.zeros_like(x)
        for j in range(n - 1, -1, -1):
            slope = slope * x + total
            total = total * x + c[:, j, None]
        return total, slope

    def better(_: Any, x: Any) -> Any:
        total, slope = value(held, x)
        newton = total / jnp.where(slope == 0, 1e-300, slope)
        apart = x[:, :, None] - x[:, None, :]
        apart = jnp.where(apart == 0, jnp.inf, apart)
        return x - newton / (1 - newton * jnp.sum(1 / apart, axis=2))

    sizes = jnp.abs(held[:, :-1] / jnp.where(held[:, 1:] == 0, 1e-300, held[:, 1:]))
    start = sizes * jnp.exp(1j * (0.7 + 2.1 * jnp.arange(n)))
    x = jax.lax.fori_loop(0, _ITERATIONS, better, start)
    if real:
        x = jnp.where(jnp.abs(x.imag) <= 1e-13 * jnp.abs(x), x.real + 0j, x)
    x = jax.lax.stop_gradient(x)
    total, slope = value(powers, x)
    return x - total / jax.lax.stop_gradient(jnp.where(slope == 0, 1e-300, slope))


def _cross(u: Any, v: Any) -> Any:
    on, back = np.array([1, 2, 0]), np.array([2, 0, 1])
    return u[..., on] * v[..., back] - u[..., back] * v[..., on]


def _adjugate(matrix: Any) -> Any:
    """Of 1 × 1 to 3 × 3."""
    n = matrix.shape[-1]
    if n == 1:
        return jnp.ones_like(matrix)
    if n == 2:
        turned = matrix[..., ::-1, ::-1]
        return jnp.swapaxes(turned, -1, -2) * np.array([[1.0, -1.0], [-1.0, 1.0]])
    one, two, three = (matrix[..., j] for j in range(3))
    return jnp.stack([_cross(two, three), _cross(three, one), _cross(one, two)], axis=-2)


def _determinant(matrix: Any) -> Any:
    return jnp.sum(_adjugate(matrix)[..., 0, :] * matrix[..., :, 0], axis=-1)


def inverse(matrix: Any) -> Any:
    """By cofactors: small matrices go to no library, which may wait for its threads for ever."""
    adjugate = _adjugate(matrix)
    whole = jnp.sum(adjugate[..., 0, :] * matrix[..., :, 0], axis=-1)
    return adjugate / whole[..., None, None]
