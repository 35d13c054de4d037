"""What layers, ends and losses cost: real bars beside a uniform periodic one, in one process.

    python benchmarks/layers.py [--quick]

Equal cells, frames and duration, longitudinal fields; each bar is run in turn with the others,
warm, and the best of its runs counts. The last line printed is JSON.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import sys
from typing import Any

from problem import problem

CELLS, FRAMES, UNITS, RUNS = 4096, 401, 200.0, 5
QUICK = 512, 41, 20.0, 1


def bars(cells: int) -> dict[str, Any]:
    """{name: (layers or medium, bar)}."""
    import wavesim as ws

    made = problem(cells, UNITS)
    soft = dataclasses.replace(made.medium, closure="consistent")
    stiff = dataclasses.replace(soft, G_n_a=9.0, density=2000.0)
    h = made.bar.spacing
    length = cells * h

    def stack(count: int) -> Any:
        edges = [length * n / count for n in range(count + 1)]
        pairs = itertools.pairwise(edges)
        return ws.Layers(
            tuple(ws.Layer(a, b, (soft, stiff)[n % 2]) for n, (a, b) in enumerate(pairs))
        )

    lossy = dataclasses.replace(soft, damping=ws.constant_quality(40.0, (1e5, 2e6)))
    graded = ws.Layers((ws.Layer(0.0, length, soft, dataclasses.replace(soft, anisotropy=0.6)),))
    ends = {"left": "free", "right": "fixed"}
    absorbing = {"left": "absorbing", "right": "absorbing", "absorber": 64 * h}
    found: dict[str, Any] = {
        "uniform, periodic": (soft, ws.Bar(cells, h)),
        "uniform, two ends": (soft, ws.Bar(cells, h, **ends)),
    }
    for count in (2, 8, 20) if cells > 1000 else (2, 8):
        layers = stack(count)
        found[f"{count} layers"] = layers, ws.layered_bar(layers, h, **ends)
    found["graded throughout"] = graded, ws.layered_bar(graded, h, **ends)
    found["uniform, absorbing ends"] = soft, ws.Bar(cells, h, **absorbing)
    found["uniform, constant Q"] = lossy, ws.Bar(cells, h, **ends)
    return found


def measure(cells: int, frames: int, units: float, runs: int) -> list[dict[str, Any]]:
    """Best warm run of each bar, and its ratio to the first."""
    import wavesim as ws
    from wavesim.simulation.plan import plan
    from wavesim.timedomain.integration import Timing, stream

    plans, best, setup = {}, {}, {}
    for name, (material, bar) in bars(cells).items():
        pulse = [ws.Ricker("phi1", cells * bar.spacing / 3, 785e3)]
        reference = problem(cells, units).medium
        plans[name] = plan(material, bar, pulse, units * float(reference.time_scale), frames)
    for turn in range(runs + 1):
        for name, settled in plans.items():
            timing = Timing()
            for _ in stream(settled, timing=timing):
                pass
            if turn:
                best[name] = min(best.get(name, float("inf")), timing.integrate)
                setup[name] = min(setup.get(name, float("inf")), timing.compile)
    first = best[next(iter(best))]
    return [
        {
            "bar": name,
            "cells": cells,
            "stepper": plans[name].schedule.solver,
            "run": best[name],
            "setup": setup[name],
            "ratio": best[name] / first,
        }
        for name in plans
    ]


if __name__ == "__main__":
    quick = "--quick" in sys.argv
    print(json.dumps(measure(*(QUICK if quick else (CELLS, FRAMES, UNITS, RUNS)))))
