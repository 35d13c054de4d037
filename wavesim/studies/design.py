"""A design: from the wishes of a case to a stack that keeps them, and the case that a run takes."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wavesim.case.layered_case import VariedKey, builder
from wavesim.case.load import Case, build
from wavesim.case.schema import CaseError, parse, tables_of
from wavesim.layered.graded_layer import at_most as at_most_steps
from wavesim.studies.design_asked import problem
from wavesim.studies.design_descent import Search
from wavesim.studies.design_problem import Problem
from wavesim.studies.design_search import Tell, search
from wavesim.studies.design_tolerance import Offset, allowed_offsets, trade_off, yield_of
from wavesim.studies.designed_case import designed_tables

# Digits that a value is written with; what is reached is that of the value as written.
_DIGITS = 10
# A variable that moves no level by more (dB) over its range does not matter.
_MATTERS = 1e-9
# Longest it may take, s, if nothing is said, and what part of it is the search's.
_LONGEST, _SEARCHED = 600.0, 0.9
# Steps through graded layers, of 8 μs, that one look of the exact solver may take in the middle.
_STEPS = 5e5


@dataclass(frozen=True)
class Design:
    """What came of a search.

    Attributes:
        problem: what was sought.
        values: of the variables, as written, shape (n,).
        reached: worst level of each wish, dB, shape (wishes,).
        offsets: how far each variable may be off; None where a wish is missed.
        made: share of designs within the tolerance that keep every wish.
        trade_off: what can be had where a wish is missed.
        evaluations, starts, seconds, seed: of the search.
        why: a search that missed a wish ended, beside its time.
        text: of the case that is the design.
    """

    problem: Problem
    values: Any
    reached: Any
    offsets: list[Offset] | None
    made: float
    trade_off: list[dict[str, Any]]
    evaluations: int
    starts: int
    seconds: float
    seed: int
    why: str
    text: str

    @property
    def short(self) -> Any:
        """By how much each wish is missed, dB, 0 where it is kept."""
        return self.problem.short(self.reached)

    @property
    def met(self) -> bool:
        """Whether every wish is kept."""
        return bool((self.short == 0).all())

    def summary(self) -> dict[str, Any]:
        """All of it as JSON has it."""
        keys = [key.key for key in self.problem.keys]
        bands = [
            {
                "sector": wish.sector,
                "from": wish.low,
                "to": wish.high,
                "limit": wish.limit,
                "kind": "at_most" if wish.most else "at_least",
                "reached": float(level),
                "met": bool(short == 0),
                "short": float(short),
            }
            for wish, level, short in zip(
                self.problem.wishes, self.reached, self.short, strict=True
            )
        ]
        may = self.offsets or []
        return {
            "met": self.met,
            "bands": bands,
            "variables": dict(zip(keys, map(float, self.values), strict=True)),
            "length": self.problem.length(self.values),
            "may_be_off": {
                key: {"down": off.down, "up": off.up, "absolute": off.absolute}
                for key, off in zip(keys, may, strict=bool(may))
            },
            "tolerance": self.problem.tolerance,
            "yield": self.made,
            "trade_off": self.trade_off,
            "evaluations": self.evaluations,
            "starts": self.starts,
            "seconds": self.seconds,
            "seed": self.seed,
        }


def design(
    path: str | Path,
    seed: int = 0,
    overrides: tuple[str, ...] = (),
    at_most: float | None = None,
    serves: Callable[[Case], bool] = lambda case: False,
    tell: Tell | None = None,
) -> Design:
    """Design the stack that a case file asks for.

    Args:
        path: of the case, with [design].
        seed: of the starts and of the yield's sample.
        overrides: "table.key=value", laid over the case.
        at_most: how long it may take, s; by default 40 of its own work, and 600.
        serves: whether a case's grid does, as :func:`wavesim.verdict.cell_size.serves`: the design
            has the coarsest that does, and without this a fine one.
        tell: called with the stage, the first once the case is known to be well, and with the worst
            shortfall so far, dB.

    Raises:
        CaseError: it can't be asked; the message names file, key, value and remedy.
    """
    from tomli_w import dumps

    name, begun = str(path), time.monotonic()
    say: Callable[[str, float], None] = tell or (lambda stage, short: None)
    tables, folder = tables_of(path, overrides)
    own = problem(parse(dumps(tables), name, (), folder), name)
    _exact(own, (own.low + own.high) / 2, name, _STEPS)
    longest = _LONGEST if at_most is None else at_most
    functions = Search(own, begun + _SEARCHED * longest)
    with ThreadPoolExecutor(1) as beside:  # both compile at once
        compiled = beside.submit(functions.begun, np.full((1, len(own.keys)), 0.5), functions.scale)
        _check_matter(functions, name)
        compiled.result()
    say("search", np.inf)
    found = search(functions, seed, at_most, tell)
    functions.until = begun + longest
    values, reached = _written(own, found.values, name)
    short, rows = float(own.short(reached).max()), list[dict[str, Any]]()
    if short:
        say("trade-off", short)
        rows, values = trade_off(functions, values)
        values, reached = _written(own, values, name)
        short = float(own.short(reached).max())
    if met := short == 0:
        say("tolerances", short)

    def by_grid(tables: dict[str, Any]) -> bool:
        with suppress(CaseError):  # of graded layers it is not foretold what a grid does to T
            return not own.graded and serves(build(parse(dumps(tables), name, (), folder), name))
        return False

    return Design(
        own,
        values,
        reached,
        allowed_offsets(functions, values) if met else None,
        yield_of(functions, values, own.tolerance, seed) if met else 0.0,
        [] if met else rows,
        functions.evaluations,
        found.starts,
        found.seconds,
        seed,
        found.why,
        dumps(designed_tables(tables, own, values.tolist(), by_grid)),
    )


def _written(own: Problem, values: Any, name: str) -> tuple[Any, Any]:
    """Values as they are written, and what is reached with these."""
    values = np.array([float(f"{value:.{_DIGITS}g}") for value in values])
    values = np.clip(values, own.low, own.high)
    return values, _exact(own, values, name)


def _exact(own: Problem, values: Any, name: str, steps: float = np.inf) -> Any:
    """Worst level of each wish, dB, (wishes,), in so many steps through graded layers.

    Raises:
        CaseError: there is no answer somewhere in a band, or it takes more.
    """
    with at_most_steps(steps):
        found, _ = builder(name)(("design", "variables"), own.exact, values)
    for wish, level in zip(own.wishes, found, strict=True):
        if np.isnan(level):
            raise CaseError(
                f"{name}: [[layers]]: a graded layer without losses has its asymptote between "
                f"{wish.low:g} and {wish.high:g} Hz, where waves pile up and T has no answer; "
                "give it a quality_factor with a quality_band"
            )
    return found


def _check_matter(functions: Search, name: str) -> None:
    """Hold each variable to a level that it moves, somewhere in the box."""
    own = functions.problem
    rng = np.random.default_rng(0)
    base = rng.random((3, len(own.keys)))
    moved = np.repeat(base[None], len(own.keys) + 1, axis=0)
    for n in range(len(own.keys)):
        moved[n + 1, :, n] = 1 - moved[n + 1, :, n]
    members = own.values(moved.reshape(-1, len(own.keys)))
    levels = functions.reached(members).reshape(len(own.keys) + 1, 3, -1)
    change = np.abs(levels[1:] - levels[0]).max(axis=(1, 2))
    for number, (key, moves) in enumerate(zip(own.keys, change, strict=True)):
        if not moves > _MATTERS:
            raise CaseError(
                f'{name}: [[design.variables]]: key = "{key.key}" ({number + 1} of '
                f"{len(own.keys)}): changes nothing in the bands; {_why(own, key)}"
            )


def _why(own: Problem, key: VariedKey) -> str:
    """Why a variable changes nothing, and what to do."""
    for n, side, first in ((0, "left", "first"), (len(own.known.stretches) - 1, "right", "last")):
        if key.name == "thickness" and set(key.layers) == {n}:
            end = own.known.ends[-1 if n else 0]
            return (
                f'the {first} layer stands for a half-space where [bar] {side} = "{end}"; take '
                f'{side} = "half-space", which is beside all layers, or leave the key out'
            )
    return (
        "nor does the thickness of a layer of a half-space's medium, or what Γ alone has; "
        "leave it out"
    )
