"""The search for a stack: rounds from many starts until every wish is kept.

A round takes points of a Sobol sequence down by gradients (``Problem.descent``), and the best of
these by linear programs (``design_descent``). Then they go on until every wish is kept by the
exact solver too: where one is missed there, as at a narrow resonance, that frequency is asked from
then on.
Rounds follow each other, two at a time, one from fresh starts, the other about the best there are.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from wavesim.studies.design_descent import RADIUS, Search, Stack
from wavesim.studies.design_tolerance import yield_of

# Of a round: starts at most, fewer where layers or wishes are many, so that it takes as long; and
# those that go on, until one has so much room.
_STARTS, _LAYERS, _FOLLOWED, _ENOUGH = 64, 1024, 4, -0.2
# So many that miss by no more go on, by so many steps between one look of the exact solver and the
# next; there are so many looks, and so many that better nothing.
_POLISHED, _HOPELESS, _BETWEEN, _LOOKS, _IDLE = 3, 1.0, 8, 12, 4
# A look's frequencies are kept while so many follow.
_KEPT = 40
_SECONDS = 40.0
# What lacks less (dB) is given twice the time.
_NEARLY = 1.0
# What lacks more is given up once so many rounds from fresh starts end at the same, or so near it.
_AGREE, _SAME = 3, 1.02
_MOST = 100_000
# Every round but the first has one that begins about so many best, moved by such parts of x, this
# far down.
_ELITE, _MOVES, _BEGIN = 4, (0.03, 0.1, 0.3), 0.4
# Rounds that go side by side: a fixed number, so that a seed gives one answer on any machine.
_SIDE_BY_SIDE = 2
# A stack that keeps all goes on to keep it as it is made too: in bands wider by these parts of the
# tolerance, then down e/s in the widest had, so many steps each, until this part
# of so many made keep all.
_SURER, _STEPS, _SURE, _MADE = ((0.3, False), (1.0, False), (1.0, True)), 16, 0.95, 128


@dataclass(frozen=True)
class Found:
    """The best stack of a search.

    Attributes:
        values: of the variables, in their units, shape (n,).
        starts: from how many starts.
        seconds: it took.
        why: it ended where a wish is missed, as a sentence goes on; "" of its time as usual.
    """

    values: Any
    starts: int
    seconds: float
    why: str


@dataclass(frozen=True)
class Kept:
    """What came of a round.

    Attributes:
        short: by how much the worst wish is missed, dB.
        made: share of stacks as they are made that keep all, of some.
        x: from 0 to 1, (n,).
    """

    short: float
    made: float
    x: Any


Tell = Callable[[str, float], None]


def search(own: Search, seed: int, seconds: float | None = None, tell: Tell | None = None) -> Found:
    """Look for a stack that keeps every wish, until its time is up.

    Args:
        own: the problem's functions.
        seed: of the starts.
        seconds: of its own work after which no further round is begun; by default 40, and twice as
            many where less than 1 dB lacks.
        tell: called with the stage and the worst shortfall so far, dB.

    Returns:
        The first that keeps all; the best there was where none does.
    """
    from scipy.stats import qmc

    begun, worked = time.perf_counter(), time.process_time()
    say = tell or (lambda stage, short: None)
    enough, nearly = (seconds, seconds) if seconds else (_SECONDS, 2 * _SECONDS)
    points = qmc.Sobol(len(own.problem.keys), seed=seed)
    rng = np.random.default_rng(seed)
    found, afresh = list[Kept](), list[float]()
    best: Kept | None = None
    layers = sum(16 if grading else 1 for grading in own.problem.stack.gradings)
    most = min(_STARTS, max(1, _LAYERS // (layers * len(own.problem.wishes))))
    count, done = 1 << int(np.log2(most)), 0
    with ThreadPoolExecutor(_SIDE_BY_SIDE) as pool:
        while done < _MOST:
            starts = [(points.random(count), 0.0) for _ in range(_SIDE_BY_SIDE)]
            if found:
                starts[-1] = _about([one.x for one in found[:_ELITE]], count, rng), _BEGIN
            new = list(pool.map(partial(_round, own, done), *zip(*starts, strict=True)))
            afresh.append(new[0].short)
            found += new
            found.sort(key=lambda one: (one.short, -one.made))
            done += count * len(starts)
            still, best = best is found[0], found[0]
            sure = f" for a yield above {100 * best.made:.0f} %"
            say("search" + ("" if best.short else sure), best.short)
            # Not what other programs took of the time.
            taken = min(time.perf_counter() - begun, time.process_time() - worked)
            kept = best.short == 0 and (best.made >= _SURE or still)
            same = sum(short <= _SAME * best.short for short in afresh) >= _AGREE
            hopeless = best.short > _NEARLY and same
            over = taken > (nearly if 0 < best.short < _NEARLY else enough)
            if kept or hopeless or own.ended or over:
                break
    values, taken = own.problem.values(found[0].x), time.perf_counter() - begun
    why = "its time was up; more (--at-most 30min), " if own.ended else ""
    if hopeless:
        why = f"{_AGREE} searches afresh end at the same, so likely none does; "
    return Found(values, done, taken, why)


def _about(best: list[Any], count: int, rng: Any) -> Any:
    """Starts about the best stacks so far: half of what varies moved, by little or by much."""
    x = np.array(best)[np.arange(count) % len(best)]
    moved = rng.choice(_MOVES, (len(x), 1)) * rng.standard_normal(x.shape)
    return np.clip(x + np.where(rng.random(x.shape) < 0.5, moved, 0.0), 0.0, 1.0)


def _round(own: Search, seed: int, starts: Any, begin: float) -> Kept:
    """The best that comes of some starts, (members, n), at this part of the way down."""
    stacks = own.descended(starts, seed, begin)
    stacks = own.down_the_peaks(stacks[:_FOLLOWED], own.scale, _STEPS, enough=_ENOUGH)
    stacks = sorted(stacks, key=lambda one: one.worst)
    going = [one for one in stacks[:_POLISHED] if one.worst < _HOPELESS]
    if going:
        return _polished(own, going)
    return Kept(float(_short(own, stacks[0].x[None])[0].max()), 0.0, stacks[0].x)


def _short(own: Search, x: Any) -> tuple[Any, Any]:
    """By how much stacks x (members, n) miss each wish, dB, and where worst, Hz, (members,
    wishes) each: on the finer net, and of those that keep all there by the exact solver,
    which looks closer where T may be narrow; once the time is up not by that, as it takes seconds
    of graded layers and has the last word on the stack that is found."""
    values = own.problem.values(x)
    level, where = own.worst_levels(values)
    short = own.problem.short(level)
    for n in () if own.ended else np.flatnonzero((short == 0).all(axis=1)):
        level, where[n] = own.problem.exact(values[n])
        short[n] = np.nan_to_num(own.problem.short(level), nan=np.inf)
        if (short[n] == 0).all():
            break
    return short, where


def _polished(own: Search, stacks: list[Stack]) -> Kept:
    """Stacks moved on until one keeps all by the exact solver too, then to be surer of it."""
    best, least, idle = stacks[0], np.inf, 0
    asked = [[list[float]() for _ in own.problem.wishes] for _ in stacks]
    for look in range(_LOOKS):
        if look:
            stacks = own.down_the_peaks(
                stacks, own.scale, _BETWEEN, enough=_ENOUGH / 2, asked=asked
            )
        short, where = _short(own, np.array([one.x for one in stacks]))
        for known, *found in zip(asked, short, where, strict=True):
            for frequencies, lacks, at in zip(known, *found, strict=True):
                frequencies += [at] * bool(lacks > 0)
                del frequencies[:-_KEPT]
        worst = short.max(axis=1)
        n = int(np.argmin(worst))
        idle = 0 if worst[n] < least else idle + 1
        if worst[n] < least:
            best, least, frequencies = stacks[n], float(worst[n]), asked[n]
        if least == 0 or idle == _IDLE or own.ended:
            break
    return _surer(own, best, frequencies) if least == 0 else Kept(least, 0.0, best.x)


def _surer(own: Search, one: Stack, asked: Any) -> Kept:
    """What a stack that keeps all comes to as more of those made are to keep it."""
    tolerance = own.problem.tolerance

    def made(x: Any) -> float:
        return yield_of(own, own.problem.values(x), tolerance, 0, _MADE)

    best, width = Kept(0.0, made(one.x), one.x), 0.0
    for part, sure in _SURER:
        if best.made >= _SURE or own.ended:
            break
        wider = width if sure else part * tolerance
        begun, enough = [replace(one, radius=RADIUS)], -np.inf if sure else _ENOUGH / 2
        [new] = own.down_the_peaks(
            begun, own.scale, _STEPS, wider=wider, sure=sure, enough=enough, asked=[asked]
        )
        if new.worst <= 0:
            width = wider
        if _short(own, new.x[None])[0].max() > 0:
            continue
        found = Kept(0.0, made(new.x), new.x)
        if found.made >= best.made:
            best, one = found, new
    return best
