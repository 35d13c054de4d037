"""The search for a stack: least squares from many starts, and from the best the worst goes down.

At each of some frequencies of each wish a stack misses by

    e = weight (±(L − limit)) / (1 + |limit|/10),

with L = 20 log₁₀|T| in dB: kept where all e ≤ 0. L and ∂L/∂x of a batch of stacks come from jax at
once (``differentiable.level_slopes``). A round takes the best of some points of a Sobol sequence,
follows them by Levenberg and Marquardt down Σ max(0, e + margin)², and the best of these by linear
programs down the worst,

    min over d of max_i (e_i + J_i d),   |d| ≤ radius,   within box and length,

the radius growing where that foretells well. Both go in lock step, the hopeless left behind.
The best of all go on until every wish is kept on a finer net of frequencies too, and by the exact
solver: where one is missed there, as at a narrow resonance, that frequency is asked from then on.
Rounds follow each other, two at a time, one from fresh starts, the other about the best there are.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wavesim.studies.design_problem import Problem

# Frequencies of a wish: of the search, of the finer net, and of that where a layer is graded.
COARSE, FINE, _FINE_GRADED = 96, 801, 201
# Stacks whose T is computed at once: in the search, and of the last word.
_TOGETHER, MEMBERS = 16, 100
# Of a round: starts, those that go down by least squares, and how far.
_SCREENED, _FOLLOWED, _DESCENTS = 256, 32, 25
# Then so many best go so many steps down their worst.
_STEPS = ((16, 10), (6, 15), (3, 30))
_MARGIN = 0.4
# So many of these go on, by so many steps between one look at the finer net and the next; there
# are so many looks, and so many that better nothing.
_POLISHED, _BETWEEN, _LOOKS, _IDLE = 4, 12, 20, 3
SECONDS = 40.0
# What lacks less (dB) is given twice the time.
_NEARLY = 1.0
_MOST = 100_000
# Every round but the first has one that begins about so many best, moved by such parts of x.
_ELITE, _MOVES = 4, (0.03, 0.1, 0.3)
# Rounds that go side by side: a fixed number, so that a seed gives one answer on any machine.
_SIDE_BY_SIDE = 2
# Bands are asked for wider at either end by these parts of the tolerance, while that can be had.
_WIDER = (0.0, 0.3, 1.0)
# Radius of the first linear program, in x; those beyond these are ended.
_RADIUS, _WIDEST, _LEAST = 0.05, 0.3, 1e-6
# Frequencies whose e lies so far below the worst don't bind a step.
_FAR = 8.0
_TOO_LONG = 100.0
_ROOM = 1e-6


@dataclass(frozen=True)
class Found:
    """The best stack of a search.

    Attributes:
        values: of the variables, in their units, shape (n,).
        evaluations: stacks whose T was computed.
        starts: from how many starts.
        seconds: it took.
    """

    values: Any
    evaluations: int
    starts: int
    seconds: float


@dataclass(frozen=True)
class _Stack:
    """One stack on its way down.

    Attributes:
        x: from 0 to 1, (n,).
        net: frequencies of each wish that it is asked at, Hz, (wishes, COARSE).
        e, J: (M,) and (M, n).
        radius: of its steps.
    """

    x: Any
    net: Any
    e: Any
    J: Any
    radius: float = _RADIUS

    @property
    def worst(self) -> float:
        return float(self.e.max())

    def asked_at(self, short: Any, where: Any) -> Any:
        """The net with the frequency (Hz) at which each wish that is short (dB) is missed worst, in
        place of the nearest that is no end of its band."""
        net = self.net.copy()
        for n in np.flatnonzero(short):
            net[n, 1 + np.argmin(np.abs(net[n, 1:-1] - where[n]))] = where[n]
        return net


class Search:
    """One problem's compiled functions, and a count of what they were asked.

    Args:
        problem: what is sought.
    """

    def __init__(self, problem: Problem) -> None:
        import jax

        self.problem = problem
        self._asked_of: list[int] = []
        self._slopes = problem.slopes()
        self._worst = problem.compiled(_FINE_GRADED if problem.graded else FINE)
        wishes = problem.wishes
        self._limit = np.array([wish.limit for wish in wishes])
        self._sign = np.array([1.0 if wish.most else -1.0 for wish in wishes])
        self._scale = np.array([wish.weight for wish in wishes]) / (1 + np.abs(self._limit) / 10)
        self._net = problem.net(COARSE)
        # The length is linear in x.
        n = len(problem.keys)
        start, whole = jax.value_and_grad(problem.length)(problem.values(np.zeros(n)))
        self._shortest, self._by_x = float(start), np.asarray(whole) * (problem.high - problem.low)

    @property
    def evaluations(self) -> int:
        """How many stacks' T was computed."""
        return sum(self._asked_of)

    def reached(self, values: Any) -> Any:
        """Worst level of each wish on the fine net, dB; values (members, n)."""
        return self._reached(values)[0]

    def _reached(self, values: Any) -> Any:
        """The same, and where, Hz; (2, members, wishes)."""
        values = np.asarray(values)
        self._asked_of.append(len(values))
        parts = []
        for first in range(0, len(values), MEMBERS):
            some = values[first : first + MEMBERS]
            parts.append(np.array(self._worst(_padded(some, MEMBERS)))[:, : len(some)])
        return np.concatenate(parts, axis=1)

    def too_long(self, x: Any) -> Any:
        """By what part of the limit stacks are too long, below 0 where they fit; x (…, n)."""
        limit = self.problem.length_at_most
        return (self._shortest + x @ self._by_x) / limit - 1 if limit else np.full(x.shape[:-1], -1)

    def errors(self, x: Any, nets: Any, scale: Any) -> tuple[Any, Any]:
        """e (members, M) and ∂e/∂x (members, M, n) of stacks.

        Args:
            x: from 0 to 1, (members, n).
            nets: where they are asked, Hz, (members, wishes, COARSE).
            scale: of each wish's e, (wishes,).
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
        bad = ~(np.isfinite(e).all(axis=1) & np.isfinite(J).all(axis=(1, 2)))
        e[bad], J[bad] = 1e6, 0.0
        return e, J

    def _everywhere(self, count: int, wider: float = 0.0) -> Any:
        """Nets of so many stacks, even over each band, wider by a part."""
        net = self.problem.net(COARSE, wider) if wider else self._net
        return np.broadcast_to(net, (count, *net.shape))

    def least_squares(self, x: Any, steps: int) -> Any:
        """Where stacks get by Levenberg and Marquardt, x (members, n), each its best worst e."""
        n, nets = x.shape[1], self._everywhere(len(x))

        def off(x: Any) -> tuple[Any, ...]:
            e, J = self.errors(x, nets, self._scale)
            r = np.maximum(e + _MARGIN * np.repeat(self._scale, COARSE), 0.0) / np.sqrt(COARSE)
            J = np.where(r > 0, 1 / np.sqrt(COARSE), 0.0)[..., None] * J
            over = np.maximum(self.too_long(x) + _ROOM, 0.0)
            limit = self.problem.length_at_most or 1.0
            r = np.concatenate([r, _TOO_LONG * over[:, None]], axis=1)
            slope = np.where(over > 0, _TOO_LONG / limit, 0.0)[:, None, None] * self._by_x
            return r, np.concatenate([J, slope], axis=1), np.where(over > _ROOM, 1e6, e.max(axis=1))

        damped = np.full(len(x), 0.1)
        r, J, worst = off(x)
        best, best_x = worst, x
        for _ in range(steps if best.min() >= 0 else 0):
            A, g = J.transpose(0, 2, 1) @ J, (J.transpose(0, 2, 1) @ r[..., None])[..., 0]
            held = ((x <= 0) & (g > 0)) | ((x >= 1) & (g < 0))
            A = np.where(held[:, :, None] | held[:, None, :], 0.0, A)
            own = np.einsum("bii->bi", A)
            own = own + own.mean(axis=1, keepdims=True) + 1e-12
            A[:, np.arange(n), np.arange(n)] += damped[:, None] * own + held
            step = np.linalg.solve(A, np.where(held, 0.0, -g)[..., None])[..., 0]
            new = np.clip(x + step, 0.0, 1.0)
            r_new, J_new, worst = off(new)
            down = (r_new**2).sum(axis=1) < (r**2).sum(axis=1)
            damped = np.where(down, np.maximum(damped / 3, 1e-6), np.minimum(damped * 4, 1e6))
            x = np.where(down[:, None], new, x)
            r, J = np.where(down[:, None], r_new, r), np.where(down[:, None, None], J_new, J)
            better = worst < best
            best, best_x = np.where(better, worst, best), np.where(better[:, None], new, best_x)
            if best.min() < 0:
                break
        return best_x

    def begun(self, x: Any, nets: Any, scale: Any) -> list[_Stack]:
        """Stacks at x (members, n), cut to their length, to go down from; others as of errors."""
        over = self.too_long(x)
        x = np.where((over > 0)[:, None], self._cut(x), x)
        return [_Stack(*one) for one in zip(x, nets, *self.errors(x, nets, scale), strict=True)]

    def _cut(self, x: Any) -> Any:
        """x with what adds to the length scaled down until it fits."""
        limit = self.problem.length_at_most
        if limit is None:
            return x
        most = (limit * (1 - _ROOM) - self._shortest) / np.maximum(x @ self._by_x, 1e-300)
        return np.where(self._by_x > 0, x * np.minimum(most, 1.0)[:, None], x)

    def down_the_worst(self, stacks: list[_Stack], scale: Any, steps: int) -> list[_Stack]:
        """Stacks after some steps down the worst of their e, the best first."""
        for _ in range(steps):
            going = [n for n, one in enumerate(stacks) if one.radius > _LEAST]
            if not going:
                break
            ways = [self._step(stacks[n]) for n in going]
            new = np.clip([stacks[n].x + ways[m][0] for m, n in enumerate(going)], 0.0, 1.0)
            nets = np.array([stacks[n].net for n in going])
            errors = zip(*self.errors(new, nets, scale), strict=True)
            for n, x, (e, J), (_, foretold) in zip(going, new, errors, ways, strict=True):
                old = stacks[n]
                gain = (old.worst - e.max()) / max(old.worst - foretold, 1e-12)
                if gain <= 0:
                    stacks[n] = replace(old, radius=old.radius / 4)
                else:
                    grown = 2.0 if gain > 0.7 else 0.5 if gain < 0.25 else 1.0
                    stacks[n] = _Stack(x, old.net, e, J, min(old.radius * grown, _WIDEST))
        return sorted(stacks, key=lambda one: one.worst)

    def _step(self, one: _Stack) -> tuple[Any, float]:
        """d of the linear program, and the worst e that it foretells."""
        from scipy.optimize import linprog

        near = one.e > one.worst - _FAR
        A, b = np.hstack([one.J[near], -np.ones((near.sum(), 1))]), -one.e[near]
        limit = self.problem.length_at_most
        if limit is not None:
            A = np.vstack([A, np.append(self._by_x / limit, 0.0)])
            b = np.append(b, -self.too_long(one.x) - _ROOM / 2)
        low = np.append(np.maximum(-one.radius, -one.x), -np.inf)
        high = np.append(np.minimum(one.radius, 1 - one.x), np.inf)
        goal = np.append(np.zeros(len(one.x)), 1.0)
        found = linprog(goal, A, b, bounds=np.stack([low, high], axis=1), method="highs-ds",
                        options={"presolve": False})  # fmt: skip
        if found.x is None:
            return np.zeros(len(one.x)), one.worst
        return found.x[:-1], float(found.x[-1])

    def short(self, x: Any) -> tuple[Any, Any]:
        """By how much stacks x (members, n) miss each wish, dB, and where worst, Hz, (members,
        wishes) each: on the fine net, and of the first that keeps all there by the exact solver,
        which looks closer where T may be narrow."""
        own = self.problem
        values = own.values(x)
        level, where = self._reached(values)
        short = own.short(level)
        for n in np.flatnonzero((short == 0).all(axis=1)):
            level, where[n] = own.exact(values[n])
            short[n] = np.nan_to_num(own.short(level), nan=np.inf)
            if (short[n] == 0).all():
                break
        return short, where

    def round(self, starts: Any) -> _Stack:
        """The best that comes of some starts, (members, n)."""
        x = self._cut(starts)
        if len(x) > _FOLLOWED:
            e, _ = self.errors(x, self._everywhere(len(x)), self._scale)
            order = np.argsort((np.maximum(e, 0) ** 2).mean(axis=1), kind="stable")
            x = x[order[:_FOLLOWED]]
        x = self.least_squares(x, _DESCENTS)
        stacks = self.begun(x, self._everywhere(len(x)), self._scale)
        for most, steps in _STEPS:
            stacks = sorted(stacks, key=lambda one: one.worst)[:most]
            if stacks[0].worst >= 0:
                stacks = self.down_the_worst(stacks, self._scale, steps)
        return self.polished(stacks[:_POLISHED]) if stacks[0].worst < 0 else stacks[0]

    def moved_on(self, x: Any, factors: Any) -> Any:
        """Where x (n,) gets if each wish's weight is multiplied by a factor, (wishes,)."""
        scale = self._scale * factors
        begun = self.begun(x[None], self._everywhere(1), scale)
        return self.down_the_worst(begun, scale, _STEPS[-1][1])[0].x

    def polished(self, stacks: list[_Stack]) -> _Stack:
        """Stacks moved on until one keeps all on the fine net too, and by the exact solver: then in
        bands as much wider as the tolerance asks if that can be had, else less."""
        best, least = stacks[0], np.inf
        for wider in self.problem.tolerance * np.array(_WIDER):
            x, nets = np.array([one.x for one in stacks]), self._everywhere(len(stacks), wider)
            idle = 0
            for _ in range(_LOOKS):
                stacks = self.begun(x, nets, self._scale)
                stacks = self.down_the_worst(stacks, self._scale, _BETWEEN)
                x = np.array([one.x for one in stacks])
                short, where = self.short(x)
                nets = np.array(
                    [one.asked_at(*at) for one, *at in zip(stacks, short, where, strict=True)]
                )
                worst = short.max(axis=1)
                n = int(np.argmin(worst))
                if worst[n] < least or (worst[n] == 0 and stacks[n].worst <= 0):
                    best, least, idle = stacks[n], worst[n], -1
                idle += 1
                if worst[n] == 0 or idle == _IDLE:
                    break
            if worst[n] > 0 or best.worst > 0:
                break
        return best


Tell = Callable[[str, float], None]


def search(own: Search, seed: int, seconds: float = SECONDS, tell: Tell | None = None) -> Found:
    """Look for a stack that keeps every wish.

    Args:
        own: the problem's functions.
        seed: of the starts.
        seconds: of its own work after which no further round is begun; twice as many where less
            than 1 dB lacks.
        tell: called with the stage and the worst shortfall so far, dB.

    Returns:
        The first that keeps all; the best there was where none does.
    """
    from scipy.stats import qmc

    begun, worked = time.perf_counter(), time.process_time()
    say = tell or (lambda stage, short: None)
    points = qmc.Sobol(len(own.problem.keys), seed=seed)
    rng = np.random.default_rng(seed)
    found: list[tuple[float, Any]] = []
    done = 0
    with ThreadPoolExecutor(_SIDE_BY_SIDE) as pool:
        while done < _MOST:
            starts = [points.random(_SCREENED) for _ in range(_SIDE_BY_SIDE)]
            if found:
                starts[-1] = _about([x for _, x in found[:_ELITE]], rng)
            for one, some in zip(pool.map(own.round, starts), starts, strict=True):
                done += len(some)
                found.append((float(own.short(one.x[None])[0].max()), one.x))
            found.sort(key=lambda pair: pair[0])
            say("search", found[0][0])
            # Not what other programs took of the time.
            taken = min(time.perf_counter() - begun, time.process_time() - worked)
            most = 2 * seconds if found[0][0] < _NEARLY else seconds
            if found[0][0] == 0 or taken > most:
                break
    values = own.problem.values(found[0][1])
    return Found(values, own.evaluations, done, time.perf_counter() - begun)


def _about(best: list[Any], rng: Any) -> Any:
    """Starts about the best stacks so far: half of what varies moved, by little or by much."""
    x = np.array(best)[np.arange(_FOLLOWED) % len(best)]
    moved = rng.choice(_MOVES, (len(x), 1)) * rng.standard_normal(x.shape)
    return np.clip(x + np.where(rng.random(x.shape) < 0.5, moved, 0.0), 0.0, 1.0)


def _padded(members: Any, count: int) -> Any:
    """Members up to a whole batch, so that nothing compiles twice."""
    return np.concatenate([members, np.repeat(members[-1:], count - len(members), axis=0)])
