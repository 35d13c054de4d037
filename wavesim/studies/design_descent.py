"""How stacks of a design go down to the end: linear programs on the worst frequency.

At each of some frequencies of each wish a stack misses by

    e = weight (±(L − limit)) / (1 + |limit|/10),

with L = 20 log₁₀|T| in dB: kept where all e ≤ 0. Stacks are made with each variable even within ±
its tolerance, by which e is off by s = ‖∂e/∂x δ‖, a standard deviation; e/s is what to lower where
all are to keep it. L and ∂L/∂x of a batch of stacks come from jax at once
(``differentiable.level_slopes``), and the worst is lowered by

    min over d of max_i (e_i + J_i d),   |d| ≤ radius,   within box and length,

the radius growing where that foretells well. All stacks go in lock step, asked at the peaks of a
finer net of frequencies.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wavesim.studies.design_problem import ROOM, STEPS, Problem

# Frequencies of a wish: of the search, of the finer net, and of that where a layer is graded.
COARSE, FINE, _FINE_GRADED = 96, 801, 201
# Of the coarse ones, where the peaks of the finer net are followed: those even over the band.
_EVEN = 32
# Stacks whose T is computed at once.
_TOGETHER = 4
# Radius of the first linear program, in x; those beyond these are ended.
RADIUS, _WIDEST, _LEAST = 0.05, 0.3, 1e-6
# With a new net, no first radius is less.
_ANEW = 3e-3
# Frequencies whose e lies so far below the worst don't bind a step.
_FAR = 8.0
# Least s.
_STILL = 1e-4


@dataclass(frozen=True)
class Stack:
    """One stack on its way down.

    Attributes:
        x: from 0 to 1, (n,).
        e, J: at some frequencies, (M,) and (M, n).
        worst: e, over the finer net too.
        radius: of its steps.
    """

    x: Any
    e: Any
    J: Any
    worst: float
    radius: float = RADIUS


class Search:
    """One problem's compiled functions, and a count of what they were asked.

    Args:
        problem: what is sought.
        until: when all that goes down stops where it is, s of ``time.monotonic``.
    """

    def __init__(self, problem: Problem, until: float = np.inf) -> None:
        self.problem, self.until = problem, until
        self._asked_of: list[int] = []
        self._slopes, self._levels = problem.slopes(), problem.levels()
        wishes = problem.wishes
        self._limit = np.array([wish.limit for wish in wishes])
        self._sign = np.array([1.0 if wish.most else -1.0 for wish in wishes])
        self.scale = problem.scale
        self._descent = problem.descent()
        self._fine = _FINE_GRADED if problem.graded else FINE

    @property
    def evaluations(self) -> int:
        """How many stacks' T was computed."""
        return sum(self._asked_of)

    @property
    def ended(self) -> bool:
        """Whether its time is up."""
        return time.monotonic() > self.until

    def reached(self, values: Any) -> Any:
        """Worst level of each wish on the finer net, dB; values (members, n)."""
        return self.worst_levels(values)[0]

    def worst_levels(self, values: Any) -> tuple[Any, Any]:
        """The same, and where, Hz; (members, wishes) each."""
        net = self.problem.net(self._fine)
        found, where = [], []
        for first in range(0, len(values), _TOGETHER):  # all levels of all are too many
            level = self._levels_of(np.asarray(values)[first : first + _TOGETHER], net)
            at = (self._sign[:, None] * level).argmax(axis=2)
            found.append(np.take_along_axis(level, at[..., None], axis=2)[..., 0])
            where.append(net[np.arange(len(net)), at])
        return np.concatenate(found), np.concatenate(where)

    def _levels_of(self, values: Any, frequency: Any) -> Any:
        """L of stacks, (members, wishes, count), dB; arguments as of ``Problem.levels``."""
        self._asked_of.append(len(values))
        parts = []
        for first in range(0, len(values), _TOGETHER):
            some = values[first : first + _TOGETHER]
            found = self._levels(_padded(some, _TOGETHER), frequency)
            parts.append(np.asarray(found)[: len(some)])
        return np.concatenate(parts)

    def errors(self, x: Any, nets: Any, scale: Any, sure: bool = False) -> tuple[Any, Any]:
        """e (members, M) and ∂e/∂x (members, M, n) of stacks.

        Args:
            x: from 0 to 1, (members, n).
            nets: where they are asked, Hz, (members, wishes, COARSE).
            scale: of each wish's e, (wishes,).
            sure: both are to be over s.
        """
        self._asked_of.append(len(x))
        parts = []
        for first in range(0, len(x), _TOGETHER):
            some, net = (_padded(a[first : first + _TOGETHER], _TOGETHER) for a in (x, nets))
            parts.append([np.asarray(a)[: len(x) - first] for a in self._slopes(some, net)])
        level, J = (np.concatenate(p) for p in zip(*parts, strict=True))
        limit, sign, scale = (np.repeat(a, COARSE) for a in (self._limit, self._sign, scale))
        e = scale * (sign * (level - limit))
        J = (scale * sign)[:, None] * J
        if sure:
            own = self.problem
            off = own.tolerance * np.abs(own.values(x)) / (own.high - own.low)
            s = np.sqrt(np.einsum("bmn,bn->bm", J**2, off**2 / 3)) + _STILL
            e, J = e / s, J / s[..., None]
        bad = ~(np.isfinite(e).all(axis=1) & np.isfinite(J).all(axis=(1, 2)))
        e[bad], J[bad] = 1e6, 0.0
        return e, J

    def descended(self, x: Any, seed: int, begin: float = 0.0) -> list[Stack]:
        """Stacks from x (members, n) down ``Problem.descent``, the best first."""
        self._asked_of.append(STEPS * len(x))
        return sorted(self.begun(self._descent(x, seed, begin), self.scale), key=lambda s: s.worst)

    def begun(self, x: Any, scale: Any) -> list[Stack]:
        """Stacks at x (members, n), cut to their length, at even frequencies; others as of
        errors."""
        x, net = np.asarray(self.problem.cut(x)), self.problem.net(COARSE)
        e, J = self.errors(x, np.broadcast_to(net, (len(x), *net.shape)), scale)
        return [Stack(*one) for one in zip(x, e, J, e.max(axis=1).tolist(), strict=True)]

    def _down(
        self,
        stacks: list[Stack],
        steps: int,
        at: Callable[[Any, list[int]], list[Stack]],
        enough: float = -np.inf,
    ) -> list[Stack]:
        """Stacks after some steps; at has the new ones at x (members, n), and which they are of."""
        stacks = list(stacks)
        for _ in range(steps):
            going = [n for n, one in enumerate(stacks) if one.radius > _LEAST]
            if not going or self.ended or min(one.worst for one in stacks) < enough:
                break
            ways = self._steps([stacks[n] for n in going])
            x = [stacks[n].x + d for n, (d, _) in zip(going, ways, strict=True)]
            new = at(np.clip(x, 0.0, 1.0), going)
            for n, one, (_, foretold) in zip(going, new, ways, strict=True):
                stacks[n] = _moved(stacks[n], one, foretold)
        return stacks

    def down_the_peaks(
        self,
        stacks: list[Stack],
        scale: Any,
        steps: int,
        wider: float = 0.0,
        sure: bool = False,
        enough: float = -np.inf,
        asked: Any = None,
    ) -> list[Stack]:
        """Stacks after some steps, each new one asked at peaks of its own e on the finer net.

        Args:
            stacks, scale, sure: as of :meth:`begun` and :meth:`errors`.
            steps: at most.
            wider: by what part the bands are wider.
            enough: they stop where one's worst e is below.
            asked: for each stack and wish, frequencies it is asked at besides, Hz.
        """
        frequency = self.problem.net(self._fine, wider)
        asked = asked or [[[]] * len(frequency)] * len(stacks)

        def at(x: Any, asked: Any) -> list[Stack]:
            level = self._levels_of(self.problem.values(x), frequency)
            e = (scale * self._sign)[:, None] * (level - self._limit[:, None])
            nets = np.array(
                [
                    [_peaks(*wish) for wish in zip(own, frequency, more, strict=True)]
                    for own, more in zip(e, asked, strict=True)
                ]
            )
            found, J = self.errors(x, nets, scale, sure)
            worst = np.nan_to_num(e, nan=1e6).max(axis=(1, 2))
            if sure:  # there s is not known
                worst = np.where(worst > 0, worst / _STILL, -np.inf)
            worst = np.maximum(worst, found.max(axis=1))
            return [Stack(*one) for one in zip(x, found, J, worst.tolist(), strict=True)]

        begun = at(np.array([one.x for one in stacks]), asked)
        stacks = [
            replace(new, radius=max(one.radius, _ANEW))
            for one, new in zip(stacks, begun, strict=True)
        ]
        return self._down(stacks, steps, lambda x, n: at(x, [asked[m] for m in n]), enough)

    def _steps(self, stacks: list[Stack]) -> list[tuple[Any, float]]:
        """d of each stack's linear program, and the worst e that it foretells: all are one program,
        whose parts share nothing, as most of a small one's time is spent around it."""
        from scipy.optimize import linprog
        from scipy.sparse import block_diag

        own, parts, least, bounds = self.problem, [], [], []
        for one in stacks:
            near = one.e > one.worst - _FAR
            parts.append(np.hstack([one.J[near], -np.ones((near.sum(), 1))]))
            least.append(-one.e[near])
            if limit := own.length_at_most:
                parts[-1] = np.vstack([parts[-1], np.append(own.by_x / limit, 0.0)])
                least.append([(own.longest * (1 + ROOM / 2) - own.by_x @ one.x) / limit])
            low, high = np.maximum(-one.radius, -one.x), np.minimum(one.radius, 1 - one.x)
            bounds += [*zip(low, high, strict=True), (None, None)]
        goal = np.tile(np.append(np.zeros(len(own.keys)), 1.0), len(stacks))
        found = linprog(goal, block_diag(parts, format="csc"), np.concatenate(least), bounds=bounds,
                        method="highs-ds", options={"presolve": False})  # fmt: skip
        if found.x is not None:
            return [(d[:-1], float(d[-1])) for d in found.x.reshape(len(stacks), -1)]
        if len(stacks) > 1:
            return [way for one in stacks for way in self._steps([one])]
        return [(np.zeros(len(own.keys)), stacks[0].worst)]


def _moved(old: Stack, new: Stack, foretold: float) -> Stack:
    """The new stack where it is better; the old one with less radius."""
    gain = (old.worst - new.worst) / max(old.worst - foretold, 1e-12)
    if gain <= 0:
        return replace(old, radius=old.radius / 4)
    grown = 2.0 if gain > 0.7 else 0.5 if gain < 0.25 else 1.0
    return replace(new, radius=min(old.radius * grown, _WIDEST))


def _peaks(e: Any, frequency: Any, asked: Any) -> Any:
    """Some even frequencies of a wish, those about its highest peaks of e, and those asked, Hz."""
    padded = np.concatenate([[-np.inf], e, [-np.inf]])
    tops = np.flatnonzero((e >= padded[:-2]) & (e >= padded[2:]))
    tops = tops[np.argsort(-e[tops], kind="stable")]
    even = np.round(np.linspace(0, len(e) - 1, _EVEN)).astype(int)
    high = np.argsort(-e, kind="stable")
    beside = np.clip(tops[:, None] + np.array([0, -1, 1]), 0, len(e) - 1).ravel()
    order = np.concatenate([even, beside, high])
    _, first = np.unique(order, return_index=True)
    found = frequency[order[np.sort(first)][:COARSE]]
    asked = asked[-(COARSE - _EVEN) :]
    if len(asked):
        found[-len(asked) :] = asked
    return found


def _padded(members: Any, count: int) -> Any:
    """Members up to a whole batch, so that nothing compiles twice."""
    return np.concatenate([members, np.repeat(members[-1:], count - len(members), axis=0)])
