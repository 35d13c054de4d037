"""Work of a real bar's sources within one exact step, prepared as small tables.

The step applies ŝ, the polynomial through the signals at its Gauss nodes τ_n, so that the work
must be that of ŝ too. With ŝ and the rates held as Legendre series Σ_p a_p P_p(2τ/h − 1),

    W = Σ_e Σ_p a_ep ∫₀^h P_p O_e y(t+τ) dτ,
    O_e y(t+τ) = O_e exp(τA) y + Σ_i ∫₀^τ O_e exp((τ−τ′)A) G_i ŝ_i(t+τ′) dτ′,

O_e of ``barequation.py``. Both parts are Chebyshev sums of O_e φ_k(X), by the recurrence in Xᵀ:
the first in a window about the source, as nothing else is felt there within a step; the second as
the numbers O_e φ_k(X) G_i. All integrals are exact for polynomials as high as occur. No energy
enters: the energy balance is a true check.
"""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from wavesim.timedomain.barequation import BarEquation
from wavesim.timedomain.barseries import EXTRA_NODES, Series, chebyshev_terms
from wavesim.timedomain.barstep import expansion_coefficients
from wavesim.timedomain.group import State
from wavesim.timedomain.pushes import driven_windows, windowed
from wavesim.timedomain.response import gauss, legendre_transform


class Work(eqx.Module):
    """Tables for the work in a step.

    Attributes:
        rows: ∫ P_p O_e exp(τA) dτ, of each group, shape (entries, p, tracks, blocks, points); None
            where no source acts on it.
        points: where that is, shape (entries, points).
        own: from the signals at the nodes, shape (entries, p, sources, nodes).
        values, risen: Legendre series of ŝ, and of its integral from 0, shape (p, nodes).
    """

    rows: tuple[jax.Array | None, ...]
    points: tuple[np.ndarray | None, ...]
    own: jax.Array
    values: jax.Array
    risen: jax.Array

    def done(self, equation: BarEquation, y: State, signals: jax.Array) -> jax.Array:
        """Work in the step from a state, from the signals at its nodes, (sources, nodes)."""
        felt = jnp.einsum("epjn,jn->ep", self.own, signals)
        for parts, rows, points in zip(y, self.rows, self.points, strict=True):
            if rows is not None:
                seen = jnp.stack([part[:, points] for part in parts])
                felt = felt + jnp.einsum("eptbx,tbex->ep", rows, seen)
        risen = (signals @ self.risen.T)[equation.held]
        risen = risen.at[:, 0].add(equation.held_rates(y))
        return jnp.sum(jnp.concatenate([signals @ self.values.T, risen]) * felt)


def work(equation: BarEquation, made: Series, reach: int, periodic: bool) -> Work | None:
    """Prepare the tables; None where there is no signal.

    Args:
        equation: of the bar.
        made: coefficients of the step.
        reach: cells beyond which nothing is felt within it.
        periodic: whether the bar is.
    """
    if not equation.drives.sources:
        return None
    count, degree, h = len(made.nodes), made.degree, made.step
    transform = legendre_transform(count)
    values = np.pad(transform, ((0, 1), (0, 0)))
    risen = h / 2 * np.polynomial.legendre.legint(transform, lbnd=-1, axis=0)
    legendre = np.polynomial.legendre.legvander

    # ∫ P_p c_k over the step.
    x, weights = gauss((degree + count) // 2 + EXTRA_NODES)
    at = expansion_coefficients(h * x, made.radius, made.shift, degree)
    first = legendre(2 * x - 1, count).T @ (h * weights[:, None] * at)

    # ∫ P_p(τ) ŝ(τ − λ) dτ from λ to h at lags λ, and the integral over these.
    lags, weights = gauss(degree // 2 + count + EXTRA_NODES)
    inner, inner_weights = gauss(count + 1)
    after = lags[:, None] + (1 - lags[:, None]) * inner
    measure = h**2 * weights[:, None] * (1 - lags[:, None]) * inner_weights
    ahead = legendre(2 * after - 1, count) * measure[..., None]
    behind = legendre(2 * (after - lags[:, None]) - 1, count - 1)
    paired = np.swapaxes(ahead, 1, 2) @ behind @ transform
    at = expansion_coefficients(h * lags, made.radius, made.shift, degree)

    entries = np.append(np.arange(len(equation.drives.sources)), equation.held)
    windows = driven_windows(equation, reach, periodic)
    found = tuple(None if window is None else window[entries] for window in windows)
    rows, moments = _rows(equation, made, first, found)
    kernel = np.einsum("fk,eki->fei", at, np.asarray(moments))
    own = np.einsum("fpn,fei->epin", paired, kernel, optimize=True)
    return Work(rows, found, jnp.asarray(own), jnp.asarray(values), jnp.asarray(risen))


@eqx.filter_jit
def _rows(
    equation: BarEquation, made: Series, factors: np.ndarray, windows: tuple[np.ndarray | None, ...]
) -> tuple[tuple[jax.Array | None, ...], jax.Array]:
    """Σ_k f_pk O_e φ_k(X) in the windows, and O_e φ_k(X) G_i, shape (entries, degree + 1, i)."""
    A, drives = equation.generator, equation.drives
    back = jax.linear_transpose(A, A.zero())
    unit = jax.linear_transpose(equation.responses, A.zero())

    def of_entry(entry: jax.Array, points: Any) -> Any:
        def seen(z: State) -> Any:
            return windowed(z, points), drives.read(z)

        terms, moments = chebyshev_terms(lambda z: back(z)[0], made, unit(entry)[0], seen)
        return jax.tree.map(lambda term: jnp.tensordot(factors, term, 1), terms), moments

    entries = len(drives.sources) + len(equation.held)
    return jax.lax.map(lambda one: of_entry(*one), (jnp.eye(entries), windows))
