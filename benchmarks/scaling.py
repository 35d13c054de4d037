"""How the default stepper's cost and memory grow with the bar and the run.

    python benchmarks/scaling.py [--quick]

Each case runs in its own process and is timed on a second, warm run; the last line printed is JSON.
Two more cases store frames of a bar of a million cells to disk as a run does: memory must depend on
their number no more than the record's few series do.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from problem import problem

# (cells, units of time)
CASES = (
    (1_000, 2000.0),
    (4_096, 2000.0),
    (10_000, 400.0),
    (10_000, 2000.0),
    (30_000, 1000.0),
    (100_000, 400.0),
    (300_000, 200.0),
    (1_000_000, 80.0),
)
_TWICE = 100_000
# Longest step, units of time: the tables of the longest steps take minutes on large bars.
_STEP = 4.0
QUICK = ((1_000, 400.0), (10_000, 200.0))
# (cells, frames), one sector of four fields, half a unit of time between frames.
STORED = ((1_000_000, 9), (1_000_000, 33))
QUICK_STORED = ((100_000, 9), (100_000, 33))

_CASE = """
[medium]
closure = "consistent"
anisotropy = 0.25
[bar]
cells = {cells}
spacing = 1.25e-4
[[sources]]
field = "phi1"
position = {position}
peak_frequency = 8e5
[time]
duration = {duration}
samples = {frames}
"""


def _peak() -> int:
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return size if sys.platform == "darwin" else size * 1024


def advance(cells: int, duration: float) -> dict[str, Any]:
    """Twelve fields, the final frame alone."""
    from wavesim.simulation.plan import plan
    from wavesim.timedomain.integration import Timing, stream

    made = problem(cells, duration)
    unit = float(made.medium.time_scale)
    settled = plan(made.medium, made.bar, made.sources, made.seconds, 2, step=_STEP * unit)
    timing = Timing()
    # What runs for long is timed once; the integration is compiled before it is timed.
    for _ in range(2 if cells <= _TWICE else 1):
        timing = Timing()
        for _ in stream(settled, timing=timing):
            pass
    schedule = settled.schedule
    return {
        "cells": cells,
        "duration": duration,
        "steps": schedule.steps,
        "step": schedule.step,
        "setup": timing.compile,
        "run": timing.integrate,
        "ns_per_cell_and_step": 1e9 * timing.integrate / cells / schedule.steps,
        "ns_per_cell_and_time": 1e9 * timing.integrate / cells / duration,
        "peak_bytes": _peak(),
    }


def store(cells: int, frames: int) -> dict[str, Any]:
    """One sector, every frame to disk, as a run does but without analysis."""
    from wavesim.case.problem import load
    from wavesim.io.result_writer import Results
    from wavesim.timedomain.integration import Timing, pack, stream

    unit = float(problem().medium.time_scale)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.toml"
        numbers = {"position": cells * 1.25e-4 / 2, "duration": 0.5 * unit * (frames - 1)}
        path.write_text(_CASE.format(cells=cells, frames=frames, **numbers), encoding="utf-8")
        made = load(path)
        results, timing = Results(Path(folder) / "result.h5", made), Timing()
        results.create()
        for chunk in stream(made.plan, timing=timing):
            results.append(chunk.first, chunk.values, chunk.energy, pack(chunk.motion))
        streamed = _peak()
        results.finish("complete")
        size = results.path.stat().st_size
    return {
        "cells": cells,
        "frames": frames,
        "fields": len(made.plan.fields),
        "peak_streaming_bytes": streamed,
        "peak_bytes": _peak(),
        "file_bytes": size,
        "run": timing.integrate,
    }


def _apart(what: str, first: float, second: float) -> dict[str, Any]:
    """One case in a process of its own."""
    done = subprocess.run(
        [sys.executable, __file__, what, str(first), str(second)],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        last = done.stderr.strip().splitlines()
        return {"cells": int(first), "failed": last[-1] if last else f"exit {done.returncode}"}
    return dict(json.loads(done.stdout.splitlines()[-1]))


def main(arguments: list[str]) -> None:
    if arguments and arguments[0] == "advance":
        print(json.dumps(advance(int(arguments[1]), float(arguments[2]))))
    elif arguments and arguments[0] == "store":
        print(json.dumps(store(int(arguments[1]), int(arguments[2]))))
    else:
        quick = "--quick" in arguments
        grown = [_apart("advance", *case) for case in (QUICK if quick else CASES)]
        stored = [_apart("store", *case) for case in (QUICK_STORED if quick else STORED)]
        print(json.dumps({"advance": grown, "store": stored}))


if __name__ == "__main__":
    main(sys.argv[1:])
