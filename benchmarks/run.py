"""Measure all contestants; write results.json, results.md and the table of docs/performance.md.

    python benchmarks/run.py [--only PART] [--problems ring,…] [--rounds N] [--folder FOLDER]

A process of its own for each measurement, contestants in turn, with compile caches that are empty.
Settings are those of settings.json, which ``python benchmarks/search.py`` finds.
"""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from problems import FRAMES, PROBLEMS, error, exact, for_peers, in_fields, problem
from table import into, markdown

HERE = Path(__file__).resolve().parent
DOCUMENT = HERE.parent / "docs" / "performance.md"
TARGETS = ("1e-06", "1e-04")
# A slow contestant is measured over a tenth of the time, and its steps count ten times.
TENTH = (FRAMES - 1) // 10 + 1
# No more processes for a contestant that has taken so many seconds; wavesim has all rounds.
_ENOUGH = 25.0

# {name: (module, class, name in settings.json or None where it is exact, problems, those of which
# a tenth is measured)}
CONTESTANTS: dict[str, tuple[str, str, str | None, tuple[str, ...], tuple[str, ...]]] = {
    "wavesim": ("wavesim_call", "Default", None, PROBLEMS, ()),
    "wavesim, chebyshev": ("wavesim_call", "Chebyshev", None, ("ring", "layered"), ()),
    "wavesim, Tsit5": ("wavesim_call", "Tsit5", None, ("ring",), ("ring",)),
    "numba leapfrog": ("numba_leapfrog", "Peer", "leapfrog", ("ring", "layered"), ()),
    "diffrax Tsit5": ("diffrax_stock", "Tsit5", "diffrax Tsit5", ("ring",), ()),
    "diffrax Dopri8": ("diffrax_stock", "Dopri8", "diffrax Dopri8", ("ring",), ()),
    "SciPy DOP853": ("dop853", "Peer", "DOP853", PROBLEMS, ()),
    "SciPy expm_multiply": ("expm_multiply", "Peer", None, PROBLEMS, ()),
    "Devito leapfrog": ("devito_leapfrog", "Peer", "leapfrog", ("ring",), ("ring",)),
    "NumPy leapfrog": ("numpy_leapfrog", "Peer", "leapfrog", ("ring",), ("ring",)),
}
# Their products of vectors are too small to share: on two threads they take longer.
_ONE_THREAD = ("dop853", "expm_multiply", "numpy_leapfrog")
PACKAGES = ("wavesim", "jax", "diffrax", "numpy", "scipy", "numba", "devito")


class Folder:
    """Problems for the peers and their references, made once in a folder."""

    def __init__(self, path: Path) -> None:
        self.path = path
        path.mkdir(parents=True, exist_ok=True)

    def given(self, name: str) -> list[str]:
        """Files of the problem and of its other medium."""
        files = [self.path / f"{name}-{other}.npz" for other in (0, 1)]
        for other, file in enumerate(files):
            if not file.is_file():
                np.savez(file, **for_peers(problem(name, bool(other))))
        return list(map(str, files))

    def reference(self, name: str) -> Any:
        """Of :func:`problems.exact`."""
        file = self.path / f"{name}-exact.npy"
        if not file.is_file():
            np.save(file, exact(name))
        return np.load(file)

    def measured(
        self, contestant: str, name: str, setting: float, check: bool, warm: bool, tenth: bool
    ) -> dict[str, Any]:
        """One process of a contestant; where checked with its error, over the frames it makes."""
        module, cls = CONTESTANTS[contestant][:2]
        with tempfile.TemporaryDirectory() as scratch:
            asked = {
                "module": f"peers.{module}",
                "cls": cls,
                "problem": name,
                "given": self.given(name),
                "setting": setting,
                "frames": TENTH if tenth else FRAMES,
                "keep": f"{scratch}/frames.npy" if check else "",
                "warm": warm,
            }
            empty = dict.fromkeys(("XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "TMPDIR"), scratch)
            settled = {"PYTHONPATH": str(HERE), "JAX_PLATFORMS": "cpu"}
            if module in _ONE_THREAD:
                settled["OPENBLAS_NUM_THREADS"] = "1"
            begun = {"begun": time.monotonic()}
            done = subprocess.run(
                [sys.executable, str(HERE / "measure.py"), json.dumps(asked | begun)],
                capture_output=True,
                text=True,
                check=False,
                env=os.environ | empty | settled,
            )
            if done.returncode:
                return {"failed": (done.stderr.strip().splitlines() or ["no message"])[-1]}
            found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
            if check:
                frames = np.load(asked["keep"])
                fields = frames if frames.ndim == 3 else in_fields(name, frames)
                found["error"] = error(fields, self.reference(name))
        return found


def machine() -> dict[str, Any]:
    """What it ran on, in general words."""
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return {
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "load": [round(os.getloadavg()[0], 1)],
        "python": platform.python_version(),
        "versions": versions,
        "date": datetime.date.today().isoformat(),
    }


def median(runs: list[dict[str, float]], times: float) -> dict[str, float]:
    """The run that took the median time (the lower of two); a part of the steps in proportion."""
    scaled = [run | {"steps": times * run["steps"]} for run in runs]
    middle = statistics.median_low(sum(run.values()) for run in scaled)
    return next(run for run in scaled if sum(run.values()) == middle)


def summed(row: dict[str, Any]) -> dict[str, Any]:
    """A row with medians in place of its runs."""
    if "failed" in row:
        return row
    times = 10.0 if row["tenth"] else 1.0
    middle = {which: median(row[which], times) for which in ("cold", "warm")}
    return row | {"processes": len(row["cold"])} | middle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="part of a contestant's name")
    parser.add_argument("--problems", default=",".join(PROBLEMS))
    parser.add_argument("--rounds", type=int, default=3, help="processes of each, at most")
    parser.add_argument("--folder", type=Path, help="where problems and references are kept")
    options = parser.parse_args()
    settings = json.loads((HERE / "settings.json").read_text(encoding="utf-8"))
    results: dict[str, Any] = {"machine": machine(), "rows": []}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Folder(options.folder or Path(scratch))
        rows = []
        for name in options.problems.split(","):
            folder.given(name)
            folder.reference(name)
            for contestant, (_, _, scheme, where, tenths) in CONTESTANTS.items():
                if name not in where or options.only not in contestant:
                    continue
                kept = settings[name][scheme] if scheme else {"any": [0, None]}
                for target, (setting, seen) in kept.items():
                    row = {"problem": name, "contestant": contestant, "target": target}
                    row |= {"setting": setting, "error": seen, "tenth": name in tenths}
                    rows.append(row | {"cold": [], "warm": [], "spent": 0.0})
        for turn in range(options.rounds):
            for row in rows:
                spent = row["spent"] > _ENOUGH and row["contestant"] != "wavesim"
                if spent or "failed" in row:
                    continue
                begun = time.monotonic()
                results["machine"]["load"].append(round(os.getloadavg()[0], 1))
                tenth = row["tenth"]
                found = folder.measured(
                    row["contestant"], row["problem"], row["setting"],
                    check=turn == 0 and (not tenth or row["error"] is None), warm=True, tenth=tenth,
                )  # fmt: skip
                row["spent"] += time.monotonic() - begun
                if "failed" in found:
                    row["failed"] = found["failed"]
                    continue
                row["error"] = found.get("error", row["error"])
                row["cold"].append(found["cold"])
                row["warm"] += found["warm"]
                print(turn, row["problem"], row["contestant"], row["target"], found, flush=True)
            results["rows"] = [summed(row) for row in rows]
            page = markdown(results)
            if not options.only and options.problems == ",".join(PROBLEMS):
                text = json.dumps(results, indent=1) + "\n"
                (HERE / "results.json").write_text(text, encoding="utf-8")
                (HERE / "results.md").write_text(page, encoding="utf-8")
                told = into(DOCUMENT.read_text(encoding="utf-8"), results)
                DOCUMENT.write_text(told, encoding="utf-8")
    print(page)


if __name__ == "__main__":
    main()
