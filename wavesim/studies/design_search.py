"""The search for a stack: from many starts of a Sobol sequence downhill by L-BFGS-B.

The misfit of a stack is the shortfall of each wish averaged over its frequencies, squared (p = 2)
or with the worst of them minded most (p = 8),

    Σ_w weight_w ⟨max(0, ±(L − limit) + margin)^p⟩^(2/p) / (1 + |limit|/10)²,

with L = 20 log₁₀|T| in dB, and that of its length. Its gradient is jax's. Starts are taken in the
order of their misfit, a few side by side, until one keeps every wish on a finer net of frequencies;
it is then moved on to keep them with more and more margin.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.studies.design_problem import Problem

# Frequencies of a wish: of the search, and of the last word.
COARSE, FINE = 96, 801
SCREENED = 1024
# The same where a layer is graded, and dear.
_DEAR_COARSE, _DEAR_FINE, _DEAR_SCREENED = 48, 201, 128
# Starts that go side by side: a fixed number, so that a seed gives one answer on any machine.
_TOGETHER = 4
_MOST_STARTS = 400
SECONDS = 50.0
_MARGIN = 0.4
# The power of a shortfall that is averaged: of the search, and where the worst counts.
_MEAN, _WORST, _NOTHING = 2.0, 8.0, 1e-30
# A miss by less than this (dB) is followed up, so many times.
_NEAR, _MISSES = 4.0, 3
_MARGINS = (1.0, 2.0, 4.0)
_ITERATIONS = 150
# What a stack may be too long by before the misfit tells, over the limit.
_LENGTH_WEIGHT = 1e4
_ROOM = 1e-4


@dataclass(frozen=True)
class Found:
    """The best stack of a search.

    Attributes:
        values: of the variables, in their units, shape (n,).
        reached: worst level of each wish, dB, shape (wishes,).
        evaluations: stacks whose T was computed.
        starts: from how many starts.
        seconds: it took.
    """

    values: Any
    reached: Any
    evaluations: int
    starts: int
    seconds: float


class Search:
    """One problem's compiled functions, and a count of what they were asked.

    Args:
        problem: what is sought.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem, self.evaluations = problem, 0
        dear = problem.graded
        self.coarse, self.screens = (_DEAR_COARSE, _DEAR_SCREENED) if dear else (COARSE, SCREENED)
        self._worst = problem.compiled(_DEAR_FINE if dear else FINE)
        self._value = jax.jit(jax.vmap(self._misfit, in_axes=(0, None, None, None)))
        self._gradient = jax.jit(jax.value_and_grad(self._misfit))

    def _misfit(self, x: Any, margin: Any, weights: Any, power: Any) -> Any:
        own = self.problem
        values, total = own.values(x), jnp.zeros(())
        for n, (wish, level) in enumerate(
            zip(own.wishes, own.levels(values, self.coarse), strict=True)
        ):
            over = (level - wish.limit) if wish.most else (wish.limit - level)
            off = jnp.maximum(over + margin, 0.0) / (1 + abs(wish.limit) / 10)
            total = total + weights[n] * (jnp.mean(off**power) + _NOTHING) ** (2 / power)
        if own.length_at_most is not None:
            over = own.length(values) / own.length_at_most - 1 + _ROOM
            total = total + _LENGTH_WEIGHT * jnp.maximum(over, 0.0) ** 2
        return total

    @property
    def weights(self) -> Any:
        """Those of the wishes as they are asked."""
        return np.array([wish.weight for wish in self.problem.wishes])

    def reached(self, values: Any) -> Any:
        """Worst level of each wish on the fine net, dB; values (members, n)."""
        self.evaluations += len(values)
        return np.asarray(self._worst(jnp.asarray(values)))

    def fits(self, values: Any) -> bool:
        """Whether the length is within its limit."""
        limit = self.problem.length_at_most
        return limit is None or float(self.problem.length(values)) <= limit * (1 + 1e-12)

    def screened(self, x: Any) -> Any:
        """Misfit of many starts, shape (members,)."""
        self.evaluations += len(x)
        return np.asarray(self._value(jnp.asarray(x), _MARGIN, self.weights, _MEAN))

    def downhill(self, x: Any, margin: float, weights: Any = None, power: float = _MEAN) -> Any:
        """Where L-BFGS-B ends from a start, x from 0 to 1, shape (n,); a power above 2 minds the
        worst frequencies more than the rest."""
        from scipy.optimize import minimize

        own = self.weights if weights is None else weights

        def at(x: Any) -> tuple[float, Any]:
            self.evaluations += 1
            value, slope = self._gradient(jnp.asarray(x), margin, own, power)
            slope = np.asarray(slope)
            if not (np.isfinite(value) and np.isfinite(slope).all()):
                return 1e12, np.zeros_like(x)
            return float(value), slope

        bounds = [(0.0, 1.0)] * len(x)
        options = {"maxiter": _ITERATIONS, "maxcor": 20, "ftol": 1e-10, "gtol": 1e-9}
        return minimize(at, x, jac=True, method="L-BFGS-B", bounds=bounds, options=options).x

    def from_start(self, x: Any) -> tuple[float, Any, Any]:
        """Downhill from a start; a near miss goes on with as much more margin as it lacks."""
        x = self.downhill(x, _MARGIN)
        best = (*self.score(x), x)
        for _ in range(_MISSES):
            if not 0 < best[0] < _NEAR:
                break
            for power in (_WORST, _MEAN):
                x = self.downhill(best[2], _MARGIN + 0.5 * best[0], power=power)
                again = (*self.score(x), x)
                best = min(best, again, key=lambda one: one[0])
        short, reached, x = best
        return short, x, reached

    def score(self, x: Any) -> tuple[float, Any]:
        """Worst shortfall of all wishes, dB, infinite where it is too long; and what is reached."""
        values = self.problem.values(x)
        reached = self.reached(values[None])[0]
        short = float(self.problem.short(reached).max()) if self.fits(values) else np.inf
        return short, reached


Tell = Callable[[str, float], None]


def search(own: Search, seed: int, seconds: float = SECONDS, tell: Tell | None = None) -> Found:
    """Look for a stack that keeps every wish.

    Args:
        own: the problem's functions.
        seed: of the starts.
        seconds: after which no further start is made.
        tell: called with the stage and the worst shortfall so far, dB.

    Returns:
        The first that keeps all, moved on for margin; the best there was where none does.
    """
    from scipy.stats import qmc

    begun, say = time.perf_counter(), tell or (lambda stage, short: None)
    starts = qmc.Sobol(len(own.problem.keys), seed=seed).random(own.screens)
    order = np.argsort(own.screened(starts), kind="stable")[:_MOST_STARTS]
    best: tuple[float, Any, Any] = (np.inf, starts[order[0]], None)
    done = 0
    with ThreadPoolExecutor(2) as pool:
        for first in range(0, len(order), _TOGETHER):
            own_starts = starts[order[first : first + _TOGETHER]]
            for one in pool.map(own.from_start, own_starts):
                done += 1
                if one[0] < best[0]:
                    best = one
            say("search", best[0])
            if best[0] == 0 or time.perf_counter() - begun > seconds:
                break
    short, x, reached = best
    if reached is None:
        reached = own.score(x)[1]
    if short == 0:
        x, reached = _with_margin(own, x, reached)
    return Found(own.problem.values(x), reached, own.evaluations, done, time.perf_counter() - begun)


def _margin(own: Search, reached: Any) -> float:
    """By how much the wish that is nearest to its limit is kept, dB."""
    return float(
        min(
            (wish.limit - level) if wish.most else (level - wish.limit)
            for wish, level in zip(own.problem.wishes, reached, strict=True)
        )
    )


def _with_margin(own: Search, x: Any, reached: Any) -> tuple[Any, Any]:
    """A stack that keeps all, moved on while it keeps the nearest by more."""
    most = [-wish.limit for wish in own.problem.wishes if not wish.most]
    for margin in _MARGINS:
        # A pass band has no room above 0 dB.
        asked = min([margin, *(0.7 * room for room in most)])
        new = own.downhill(x, asked, power=_WORST)
        short, there = own.score(new)
        if short > 0 or _margin(own, there) <= _margin(own, reached):
            break
        x, reached = new, there
    return x, reached
