"""The settings that reach a target error, found by a short search and kept in settings.json.

The search depends on no clock, so it is done once and its result is kept; a measured run checks
the error again. The leapfrogs are one scheme and share a search.
"""

from __future__ import annotations

import importlib
import json
import math
import sys
from pathlib import Path

import numpy as np
from problem import Problem, error, exact_fields, problem

TARGETS = (1e-3, 1e-4, 1e-6)
KEPT = Path(__file__).with_name("settings.json")
SEARCHED = {
    "leapfrog": ("numba_leapfrog", "Peer"),
    "dop853": ("scipy_dop853", "Peer"),
    "tsit5": ("diffrax_stock", "Peer"),
    "dopri8": ("diffrax_stock", "Dopri8"),
}


def key(target: float) -> str:
    """How a target is written in settings.json: 1e-03."""
    return f"{target:.0e}"


def search(name: str, made: Problem, exact: dict[str, np.ndarray]) -> dict[str, float]:
    """Settings of one scheme for every target."""
    module, cls = SEARCHED[name]
    peer = getattr(importlib.import_module(f"peers.{module}"), cls)(made)
    tried: dict[float, float] = {}

    def of(setting: float) -> float:
        if setting not in tried:
            peer.warm_up(setting)
            tried[setting] = error(peer.run(setting).fields, exact)
            print(f"{name}: {setting:g} gives {tried[setting]:.2e}", flush=True)
        return tried[setting]

    if peer.kind == "steps":
        return {key(target): _steps(of, peer.least_steps, target) for target in TARGETS}
    return {key(target): _tolerance(of, target) for target in TARGETS}


def _steps(of, least: int, target: float) -> int:  # type: ignore[no-untyped-def]
    """Fewest steps, to 1 %, from error ∝ 1/steps²."""
    steps = 8 * least
    while True:
        # Below 1e-5 the law holds to 1e-4 and a trial only costs time.
        steps = math.ceil(steps * math.sqrt(of(steps) / target) * 1.002)
        if target < 1e-5 or 0.97 * target <= of(steps) <= target:
            return steps


def _tolerance(of, target: float) -> float:  # type: ignore[no-untyped-def]
    """Largest 10^(−n/4) that reaches the target."""
    n = math.ceil(-4 * math.log10(target))
    while of(10 ** (-n / 4)) > target:
        n += 1
    while of(10 ** (-(n - 1) / 4)) <= target:
        n -= 1
    return 10 ** (-n / 4)


def main(names: list[str]) -> None:
    made = problem()
    exact = exact_fields(made)
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.is_file() else {}
    for name in names or SEARCHED:
        kept[name] = search(name, made, exact)
        KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
