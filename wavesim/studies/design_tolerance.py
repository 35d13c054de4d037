"""How far a design may be off as it is made, and what can be had where not all can."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesim.studies.design_descent import Search

# Relative offsets of one variable that are looked at, and members of a yield.
_OFFSETS = np.geomspace(1e-4, 0.3, 25)
MEMBERS = 1000
# By what the weight of one side of a trade-off is multiplied.
_FACTORS = (0.03, 0.3, 1.0, 3.0, 30.0)
# Steps from one to the next.
_STEPS = 24


def _short(own: Search, values: Any) -> Any:
    """Worst shortfall of each member, dB."""
    return own.problem.short(own.reached(values)).max(axis=1)


@dataclass(frozen=True)
class Offset:
    """How far one variable may be off, all others as they are.

    Attributes:
        down, up: relatively; in the variable's unit where its value is 0.
        absolute: whether they are.
    """

    down: float
    up: float
    absolute: bool


def _reach(own: Search, values: Any) -> tuple[Any, Any]:
    """What an offset of 1 down and up is: the value's size, and of 0 how far the range goes."""
    zero, size = values == 0, np.abs(values)
    down, up = np.maximum(-own.problem.low, 0.0), np.maximum(own.problem.high, 0.0)
    return np.where(zero, down, size), np.where(zero, up, size)


def allowed_offsets(own: Search, values: Any) -> list[Offset]:
    """How far down and up each variable may be off.

    Args:
        own: the problem's functions.
        values: of a design that keeps every wish, shape (n,).

    Returns:
        Of each, from 0 to 0.3 of its value, the largest looked at; of 0, of its range.
    """
    n, reach = len(values), _reach(own, values)
    members = np.repeat(values[None], 2 * len(_OFFSETS) * n, axis=0)
    members = members.reshape(n, 2, len(_OFFSETS), n)
    for k in range(n):
        for side, sign in enumerate((-1.0, 1.0)):
            members[k, side, :, k] += sign * _OFFSETS * reach[side][k]
    kept = (_short(own, members.reshape(-1, n)) == 0).reshape(members.shape[:3])
    found = []
    for k, sides in enumerate(kept):
        # Up to the first that fails.
        counts = [int(np.argmin(np.append(side, False))) for side in sides]
        zero = bool(values[k] == 0)
        down, up = (
            (float(_OFFSETS[c - 1]) if c else 0.0) * (float(by[k]) if zero else 1.0)
            for c, by in zip(counts, reach, strict=True)
        )
        found.append(Offset(down, up, zero))
    return found


def yield_of(
    own: Search, values: Any, tolerance: float, seed: int, members: int = MEMBERS
) -> float:
    """Share of designs that keep every wish, each variable even within ± its tolerance.

    Args:
        own: the problem's functions.
        values: of the design, shape (n,).
        tolerance: relative; of a value of 0, to its range.
        seed: of the sample.
        members: of it.
    """
    spread = np.random.default_rng(seed).uniform(-1, 1, (members, len(values)))
    down, up = _reach(own, values)
    moved = values + tolerance * spread * np.where(spread < 0, down, up)
    return float(np.mean(_short(own, moved) == 0))


def trade_off(own: Search, values: Any) -> tuple[list[dict[str, Any]], Any]:
    """What is reached where some wishes count for more than others, from the best stack there is.

    Args:
        own: the problem's functions.
        values: of the best stack, shape (n,).

    Returns:
        [{"weights": …, "reached": worst levels in dB, "short": shortfalls in dB}], from the stack
        that favours what is to be stopped to that which favours what is to pass; where all
        wishes are of one kind, all count alike and then each is favoured in turn. All by the exact
        solver. And the values of the variables of the stack whose worst wish lacks least.
    """
    problem = own.problem
    x = (values - problem.low) / (problem.high - problem.low)
    most = np.array([wish.most for wish in problem.wishes])
    if most.any() and not most.all():
        scales = [np.where(most, 1.0, factor) for factor in _FACTORS]
    else:
        favoured = np.where(np.eye(len(most)), _FACTORS[-1], 1.0)
        scales = [np.ones(len(most)), *(favoured if len(most) > 1 else ())]
    rows, ends = [], [values]
    least = [problem.short(problem.exact(values)[0]).max()]
    for scale in scales:
        begun = own.begun(np.clip(x, 0, 1)[None], own.scale * scale)
        ends.append(problem.values(own.down_the_peaks(begun, own.scale * scale, _STEPS)[0].x))
        reached, _ = problem.exact(ends[-1])
        short = problem.short(reached)
        least.append(np.nan_to_num(short, nan=np.inf).max())
        rows.append(
            {
                "weights": [wish.weight * f for wish, f in zip(problem.wishes, scale, strict=True)],
                "reached": reached.tolist(),
                "short": short.tolist(),
            }
        )
    return rows if len(most) > 1 else [], ends[int(np.argmin(least))]
