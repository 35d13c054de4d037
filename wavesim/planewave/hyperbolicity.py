"""Whether every plane wave of a medium has a real frequency, and how fast it grows if not."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from wavesim.material.family import Block
from wavesim.material.medium import Medium
from wavesim.material.scaling import BlockCoefficients
from wavesim.planewave.eigenproblem import Eigenmodes, Float, is_symmetric, solve, spectral_form

# ω² that is negative, or complex, by less than these of the largest |ω²| at its k is rounding, or
# of 1, near which scaled frequencies are: a wave that costs no energy (η = 0) has ω² of rounding.
# Where one of two equal waves drives the other and not the reverse, rounding ε turns a double
# ω² into a complex pair √ε apart; a growth that weak is a part in 1e-7 per cycle or less.
_NEGATIVE, _COMPLEX = 1e-11, 1e-7


class NotHyperbolicError(ValueError):
    """Some ω(k) of the medium is not real: its waves grow without bound.

    Attributes:
        k: wavenumber of the fastest growth found, rad/m.
        growth_rate: Im ω there, 1/s.
        sector: the sector it was found in.
    """

    def __init__(self, sector: str, k: float, growth_rate: float, medium: Medium) -> None:
        self.sector, self.k, self.growth_rate = sector, k, growth_rate
        super().__init__(
            f"{medium.settings}: the {sector} waves of closure {medium.closure!r} are "
            f"unstable: at k = {k:.4g} rad/m they grow as exp({growth_rate:.3g}/s · t); bring "
            "anisotropy nearer to 0, where no closure is, or take closure 'consistent'"
        )


def growth_rates(squares: Any) -> Float:
    """Im ω of modes with given ω², 0 where it is rounding; shape (..., m) as given, scaled."""
    squares = np.asarray(squares, dtype=complex)
    size = np.maximum(np.abs(squares).max(axis=-1, keepdims=True), 1.0)
    growth = np.abs(np.sqrt(squares).imag)
    rounding = (np.abs(squares.imag) < _COMPLEX * size) & (-squares.real < _NEGATIVE * size)
    return np.where(rounding, 0.0, growth)


def real_frequencies(modes: Eigenmodes, k: Float, block: Block, medium: Medium) -> Float:
    """ω of solved modes, scaled, shape (n, m), ascending.

    Raises:
        NotHyperbolicError: one is not real; it names the fastest growth among these k.
    """
    growth = growth_rates(modes.squares)
    if growth.any():
        worst = np.unravel_index(np.argmax(growth), growth.shape)
        raise NotHyperbolicError(
            block.sector,
            float(k[worst[0]] / medium.length_scale),
            float(growth[worst] / medium.time_scale),
            medium,
        )
    return np.sqrt(np.maximum(modes.squares.real, 0.0))


def _spread(squares: Any) -> Float:
    """Least distance of two ω² relative to the largest; it is 0 where two waves turn complex."""
    real = np.sort(np.asarray(squares).real, axis=-1)
    return np.diff(real, axis=-1).min(axis=-1) / np.abs(real).max(axis=-1)


def _least(function: Callable[[Float], Float], low: float, high: float) -> float:
    """Where a function is least between two bounds, by grids ever finer about its least value."""
    for _ in range(13):
        x = np.linspace(low, high, 17)
        i = int(np.argmin(function(x)))
        low, high = x[max(i - 1, 0)], x[min(i + 1, 16)]
    return float(x[i])


def fastest_growth(form: BlockCoefficients) -> tuple[float, float]:
    """The wavenumber of fastest growth of a block and Im ω there, both scaled; (0, 0) if none.

    Real ω² turn complex only where two of them meet, so besides a scan over k from 0 far into
    the asymptotes each local least distance of two ω² is followed down to where it is least.
    A symmetric system grows only through a negative ω², and then over a range of k.
    """
    k = np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 1401)])
    squares = solve(form, k).squares
    if not is_symmetric(form) and squares.shape[-1] > 1:
        spread = _spread(squares)
        lows = 1 + np.flatnonzero((spread[1:-1] <= spread[:-2]) & (spread[1:-1] <= spread[2:]))
        found = [
            _least(lambda x: _spread(solve(form, x).squares), k[i - 1], k[i + 1]) for i in lows
        ]
        k = np.sort(np.concatenate([k, found]))
        squares = solve(form, k).squares
    growth = growth_rates(squares).max(axis=-1)
    top = int(np.argmax(growth))
    if growth[top] == 0:
        return 0.0, 0.0

    def slowness(x: Float) -> Float:
        return -growth_rates(solve(form, x).squares).max(axis=-1)

    best = _least(slowness, k[max(top - 1, 0)], k[min(top + 1, len(k) - 1)])
    return best, -float(slowness(np.array([best]))[0])


@functools.lru_cache(maxsize=20_000)
def _worst(medium: Medium) -> tuple[tuple[float, float], Block]:
    """The block of fastest growth."""
    return max(
        ((fastest_growth(spectral_form(medium, block)), block) for block in medium.family.blocks),
        key=lambda found: found[0][1],
    )


def check_reckoned(medium: Medium) -> None:
    """Hold a medium's numbers to what floating point has room for.

    Raises:
        ValueError: they are too large or too small beside each other.
    """
    with np.errstate(all="ignore"):
        try:
            numbers: list[Any] = [
                getattr(form, name)
                for form in (spectral_form(medium, block) for block in medium.family.blocks)
                for name in ("c_pp", "c_pb", "c_bp", "c_bb", "gamma")
            ]
            if medium.closure != "appendix_c":  # which has no wave equations
                numbers.append(medium.fastest)
            sound = all(np.isfinite(part).all() for part in numbers)
        except ArithmeticError:
            sound = False
    if not sound:
        given = {n: abs(float(value)) for n, value in medium.parameters.items() if value}
        name = max(given, key=lambda n: abs(math.log10(given[n])))
        raise ValueError(
            f"{name} = {given[name]:g}: too large, or too small, to reckon with beside the others; "
            "see that it is in SI units"
        )


def check_hyperbolic(medium: Medium) -> None:
    """Look for a real k with an ω that is not real.

    Args:
        medium: the medium, any closure.

    Raises:
        NotHyperbolicError: one was found; it says where growth is fastest, and how fast.
    """
    check_reckoned(medium)
    if medium.stable:
        return
    try:
        (k, growth), block = _worst(medium)
    except TypeError:  # numbers that jax holds have no hash
        (k, growth), block = _worst.__wrapped__(medium)
    if growth > 0:
        raise NotHyperbolicError(
            block.sector, k / float(medium.length_scale), growth / float(medium.time_scale), medium
        )
