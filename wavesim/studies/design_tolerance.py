"""How far a design may be off as it is made, and what can be had where not all can."""

from __future__ import annotations

from typing import Any

import numpy as np

from wavesim.studies.design_search import Search

# Relative offsets of one variable that are looked at, and members of a yield.
_OFFSETS = np.geomspace(1e-4, 0.3, 25)
MEMBERS = 1000
# By what the weight of one side of a trade-off is multiplied.
_FACTORS = (0.03, 0.3, 3.0, 30.0)


def _short(own: Search, values: Any) -> Any:
    """Worst shortfall of each member, dB."""
    return own.problem.short(own.reached(values)).max(axis=1)


def allowed_offsets(own: Search, values: Any) -> list[tuple[float, float]]:
    """How far down and up each variable may be off, relatively, all others as they are.

    Args:
        own: the problem's functions.
        values: of a design that keeps every wish, shape (n,).

    Returns:
        (down, up) for each, from 0 to 0.3, the largest looked at.
    """
    members = np.repeat(values[None], 2 * len(_OFFSETS) * len(values), axis=0)
    shape = (len(values), 2, len(_OFFSETS), len(values))
    members = members.reshape(shape)
    for n in range(len(values)):
        for side, sign in enumerate((-1.0, 1.0)):
            members[n, side, :, n] *= 1 + sign * _OFFSETS
    kept = (_short(own, members.reshape(-1, len(values))) == 0).reshape(shape[:3])
    found = []
    for sides in kept:
        # Up to the first that fails.
        counts = [int(np.argmin(np.append(side, False))) for side in sides]
        down, up = (float(_OFFSETS[c - 1]) if c else 0.0 for c in counts)
        found.append((down, up))
    return found


def yield_of(own: Search, values: Any, tolerance: float, seed: int) -> float:
    """Share of designs that keep every wish, each variable even within ± its tolerance.

    Args:
        own: the problem's functions.
        values: of the design, shape (n,).
        tolerance: relative.
        seed: of the sample.
    """
    spread = np.random.default_rng(seed).uniform(-1, 1, (MEMBERS, len(values)))
    return float(np.mean(_short(own, values * (1 + tolerance * spread)) == 0))


def trade_off(own: Search, values: Any) -> list[dict[str, Any]]:
    """What is reached where some wishes count for more than others, from the best stack there is.

    Args:
        own: the problem's functions.
        values: of the best stack, shape (n,).

    Returns:
        [{"weights": …, "reached": worst levels in dB, "short": shortfalls in dB}], from the stack
        that favours what is to be stopped to that which favours what is to pass; where all
        wishes are of one kind, each is favoured in turn.
    """
    problem = own.problem
    x = (values - problem.low) / (problem.high - problem.low)
    most = np.array([wish.most for wish in problem.wishes])
    if most.any() and not most.all():
        scales = [np.where(most, 1.0, factor) for factor in _FACTORS]
    elif len(most) > 1:
        scales = [np.where(np.arange(len(most)) == n, _FACTORS[-1], 1.0) for n in range(len(most))]
    else:
        return []
    rows = []
    for scale in scales:
        end = own.moved_on(np.clip(x, 0, 1), scale)
        reached = own.reached(problem.values(end)[None])[0]
        rows.append(
            {
                "weights": [wish.weight * f for wish, f in zip(problem.wishes, scale, strict=True)],
                "reached": reached.tolist(),
                "short": problem.short(reached).tolist(),
            }
        )
    return rows
