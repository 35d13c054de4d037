"""Measure one contestant in this process and print what was found as one line of JSON.

python benchmarks/measure.py MODULE CLASS EXACT.npz '[[target, setting], …]' [--quick]
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from problem import error, problem

# A leapfrog that would run longer than this is measured over part of its steps.
_LONGEST = 60.0
_PILOT_STEPS = 2000
_PART_SECONDS = 4.0
_REPEATS = 15
_ENOUGH_SECONDS = 3.0
# A contestant beside which other programs took more than this of a core is marked.
_OTHERS = 0.1


class _Others:
    """Processor time that other programs take, where the system tells it (Linux)."""

    def __init__(self) -> None:
        self.begun, self.busy, self.own = time.perf_counter(), self._busy(), self._own()

    @staticmethod
    def _busy() -> float:
        stat = Path("/proc/stat")
        if not stat.is_file():
            return 0.0
        user, nice, system, _idle, _wait, irq, soft = stat.read_text().split()[1:8]
        ticks = sum(map(int, (user, nice, system, irq, soft)))
        return ticks / os.sysconf("SC_CLK_TCK")

    @staticmethod
    def _own() -> float:
        spent = os.times()
        return spent.user + spent.system + spent.children_user + spent.children_system

    def share(self) -> float:
        """Cores that they took on average since this was made."""
        others = (self._busy() - self.busy) - (self._own() - self.own)
        return max(0.0, others / (time.perf_counter() - self.begun))


def _timed(call: Any) -> tuple[float, Any]:
    begun = time.perf_counter()
    result = call()
    return time.perf_counter() - begun, result


def _one(peer: Any, target: float, setting: float, exact: Any, quick: bool) -> dict[str, Any]:
    compiling, _ = _timed(lambda: peer.warm_up(setting))
    row: dict[str, Any] = {"target": target, "setting": setting, "extrapolated": False}
    repeats = 1 if quick else _REPEATS
    if peer.kind == "steps" and hasattr(peer, "part"):
        steps = int(setting)
        peer.part(setting, _PILOT_STEPS)
        pilot, _ = _timed(lambda: peer.part(setting, _PILOT_STEPS))
        if pilot * steps / _PILOT_STEPS > (5.0 if quick else _LONGEST):
            count = int(_PART_SECONDS / pilot * _PILOT_STEPS)
            peer.part(setting, count)
            times = [_timed(lambda: peer.part(setting, count))[0] for _ in range(min(2, repeats))]
            seconds = min(times) * steps / count
            return row | {
                "compile": compiling,
                "run": seconds,
                "runs": len(times),
                "error": None,
                "products": steps,
                "extrapolated": True,
            }
    times: list[float] = []
    while len(times) < repeats and (sum(times) < _ENOUGH_SECONDS or len(times) < 1):
        seconds, solution = _timed(lambda: peer.run(setting))
        times.append(seconds)
    whole = statistics.median(times)
    prepared = 0.0
    if hasattr(peer, "integration"):
        # Tables that the contestant makes anew in each run are its set-up; its first call, which
        # compiles, is a run as well.
        compiling -= whole
        integration = statistics.median([peer.integration(setting) for _ in times])
        prepared = max(whole - integration, 0.0)
    return row | {
        "compile": max(compiling, 0.0),
        "prepare": prepared,
        "run": whole - prepared,
        "runs": len(times),
        "error": error(solution.fields, exact),
        "products": solution.products,
    }


def main(arguments: list[str]) -> None:
    module, cls, exact_path, wanted = arguments[:4]
    quick = "--quick" in arguments
    with np.load(exact_path) as stored:
        exact = dict(stored)
    imported, peers = _timed(lambda: importlib.import_module(f"peers.{module}"))
    made = problem()
    base = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    others = _Others()
    setup, peer = _timed(lambda: getattr(peers, cls)(made))
    rows = [_one(peer, target, setting, exact, quick) for target, setting in json.loads(wanted)]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    unit = 1 if sys.platform == "darwin" else 1024
    print(
        json.dumps(
            {
                "import": imported,
                "setup": setup,
                "others": (share := others.share()),
                "disturbed": share > _OTHERS,
                "peak_bytes": peak * unit,
                "peak_above_imports_bytes": (peak - base) * unit,
                "rows": rows,
            }
        )
    )


if __name__ == "__main__":
    main(sys.argv[1:])
