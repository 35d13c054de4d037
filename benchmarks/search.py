"""The cheapest settings that reach a target error, with the error seen, kept in settings.json.

    python benchmarks/search.py [--folder FOLDER] [PROBLEM/SCHEME …]

It uses no clock, so it is done once. The leapfrogs are one scheme and share a search.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from collections.abc import Callable
from pathlib import Path

from run import CONTESTANTS, HERE, TARGETS, Folder

KEPT = HERE / "settings.json"


def steps(of: Callable[[float], float], now: int, target: float) -> int:
    """Fewest steps of a leapfrog between frames, to 1 %, by error ∝ 1/steps²."""
    while not 0.98 * target < (seen := of(now)) <= target:
        now = math.ceil(now * math.sqrt(seen / target / 0.995))
    return now


def tolerance(of: Callable[[float], float], n: int, target: float) -> int:
    """Least n of which the tolerance 10^(−n/4) reaches the target."""
    while (seen := of(10 ** (-n / 4))) > target:
        n += max(1, int(3 * math.log10(seen / target)))
    while of(10 ** (-(n - 1) / 4)) <= target:
        n -= 1
    return n


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path)
    parser.add_argument("wanted", nargs="*")
    options = parser.parse_args()
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.is_file() else {}
    done = set()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Folder(options.folder or Path(scratch))
        for contestant, (_, _, scheme, problems, _) in CONTESTANTS.items():
            for name in problems:
                key = f"{name}/{scheme}"
                if scheme is None or key in done or key not in (options.wanted or [key]):
                    continue
                done.add(key)
                tried: dict[float, float] = {}

                def of(setting: float, who=contestant, name=name, tried=tried) -> float:
                    if setting not in tried:
                        found = folder.measured(who, name, setting, True, False, False)
                        tried[setting] = found.get("error", math.inf)
                        print(f"{name}, {who}: {setting:g} gives {found}", flush=True)
                    return tried[setting]

                best = kept.setdefault(name, {})[scheme] = {}
                at = 100 if scheme == "leapfrog" else 20
                for target in TARGETS[::-1]:
                    if scheme == "leapfrog":
                        setting = at = steps(of, at, float(target))
                    else:
                        at = tolerance(of, at, float(target))
                        setting = 10 ** (-at / 4)
                    best[target] = [setting, of(setting)]
                KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
