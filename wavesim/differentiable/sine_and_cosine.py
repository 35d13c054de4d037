"""sin x and cos x together, by a Taylor series of the rest after quarter turns.

XLA calls a scalar function for each on a CPU, which takes five times as long as all else that a
layer costs; this is vectorised. Within 3e-16 for |x| ≤ 2²⁰; beyond, the error is that of x in
quarter turns, about 1e-16 |x|, as of any x that large.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import jax
import jax.numpy as jnp

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
    """sin x, cos x; x real, any shape."""
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
