"""Whole runs of a sweep on one worker and on two, of one thread each.

    python benchmarks/sweep_workers.py [MEMBERS]

Prints the seconds of each, from the first member's end to the last's, so that what a process takes
to start and to load is left out, and their ratio. On two cores that nothing else uses.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

CASES = Path(__file__).parents[1] / "cases"


def seconds(workers: int, members: int) -> float:
    """Of all members but the first of each worker."""
    from wavesim.studies.sweep import sweep

    with tempfile.TemporaryDirectory() as folder:
        vary = [f"layers.1.anisotropy=0.1:0.4:{members}"]
        asked = sweep(CASES / "slab.toml", vary, "run", folder=folder)
        data = asked.go(workers=workers)
        ended = np.sort(data["finished"].values)
    # The rate of all that came after each worker's first.
    return float((ended[-1] - ended[workers - 1]) * members / (members - workers))


def main() -> None:
    """Time both and print."""
    members = int(sys.argv[1]) if len(sys.argv) > 1 else 64
    one, two = seconds(1, members), seconds(2, members)
    print(f"{members} runs: one worker {one:.1f} s, two {two:.1f} s, ratio {one / two:.2f}")


if __name__ == "__main__":
    main()
