"""Run the whole benchmark and write results.json and results.md beside this file.

    python benchmarks/run.py [--quick] [--no-scaling]

``--no-scaling`` keeps the scaling table that is there.

``--quick`` measures each contestant once, at the loosest target, and writes nothing: for
development. The settings are those of settings.json; ``python benchmarks/search.py`` finds them.
"""

from __future__ import annotations

import argparse
import datetime
import importlib.metadata
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from table import markdown

HERE = Path(__file__).resolve().parent
TARGETS = ("1e-03", "1e-04", "1e-06")

# (name, module, class, its settings in settings.json; None: exact, at one setting)
CONTESTANTS: tuple[tuple[str, str, str, str | None], ...] = (
    ("wavesim, default, final frame", "wavesim_steppers", "Peer", None),
    ("wavesim, default, 401 frames", "wavesim_steppers", "Frames", None),
    ("wavesim, single precision, 401 frames", "wavesim_steppers", "Single", None),
    ("wavesim, chebyshev", "wavesim_steppers", "Chebyshev", None),
    ("wavesim, verlet", "wavesim_steppers", "Verlet", "leapfrog"),
    ("exact modal, final frame", "modal", "Peer", None),
    ("exact modal, 401 frames", "modal", "Frames", None),
    ("numba leapfrog", "numba_leapfrog", "Peer", "leapfrog"),
    ("Devito leapfrog, one thread", "devito_leapfrog", "Peer", "leapfrog"),
    ("Devito leapfrog, all cores", "devito_leapfrog", "Threads", "leapfrog"),
    ("NumPy leapfrog, sparse matrix", "numpy_leapfrog", "Peer", "leapfrog"),
    ("diffrax Dopri8", "diffrax_stock", "Dopri8", "dopri8"),
    ("diffrax Tsit5", "diffrax_stock", "Peer", "tsit5"),
    ("SciPy DOP853, sparse matrix", "scipy_dop853", "Peer", "dop853"),
)
# Contestants that lose to their like are not run at every target.
LOOSE_ONLY = {"wavesim, verlet": 2, "Devito leapfrog, all cores": 1}
PACKAGES = ("wavesim", "jax", "diffrax", "numpy", "scipy", "numba", "devito")


def _python(arguments: list[str]) -> tuple[str, str]:
    """Standard output of a script in its own process, and why it failed if it did."""
    environment = os.environ | {"PYTHONPATH": str(HERE)}
    done = subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        cwd=HERE,
    )
    why = done.stderr.strip().splitlines()[-1] if done.returncode and done.stderr.strip() else ""
    return done.stdout, why or ("" if done.returncode == 0 else f"exit code {done.returncode}")


def _measure(
    contestant: tuple[str, str, str, str | None], exact: Path, kept: Any, quick: bool
) -> dict[str, Any]:
    name, module, cls, scheme = contestant
    if scheme is None:
        wanted: list[Any] = [[1e-6, 0]]
    else:
        targets = TARGETS[: 1 if quick else LOOSE_ONLY.get(name, len(TARGETS))]
        wanted = [[float(t), kept[scheme][t]] for t in targets]
    arguments = ["measure.py", module, cls, str(exact), json.dumps(wanted)]
    out, why = _python(arguments + (["--quick"] if quick else []))
    if why:
        return {"name": name, "skipped": why}
    return {"name": name, "exact": scheme is None} | json.loads(out.splitlines()[-1])


def machine() -> dict[str, Any]:
    """What it ran on."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        model = names[0].partition(":")[2].strip() if names else model
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": versions,
        "date": datetime.date.today().isoformat(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--no-scaling", action="store_true")
    parser.add_argument("--only", default="", help="part of a contestant's name")
    parser.add_argument(
        "--again",
        action="store_true",
        help="measure once more, and replace, what other programs disturbed",
    )
    options = parser.parse_args()
    kept = json.loads((HERE / "settings.json").read_text(encoding="utf-8"))
    kept_results = HERE / "results.json"
    before: dict[str, Any] = {}
    if kept_results.is_file():
        before = json.loads(kept_results.read_text(encoding="utf-8"))
    known = {entry["name"]: entry for entry in before.get("contestants", ())}
    results: dict[str, Any] = {"machine": machine(), "contestants": []}
    with tempfile.TemporaryDirectory() as folder:
        exact = Path(folder) / "exact.npz"
        _, why = _python(["reference.py", str(exact)])
        if why:
            sys.exit(f"the exact solution failed: {why}")
        for contestant in CONTESTANTS:
            name = contestant[0]
            kept_one = known.get(name) if options.again else None
            if kept_one and not (kept_one.get("disturbed", True) and options.only in name):
                results["contestants"].append(kept_one)
            elif options.only in name:
                found = _measure(contestant, exact, kept, options.quick)
                results["contestants"].append(found | {"again": options.again})
                print(json.dumps(found), flush=True)
    if options.again:
        results["layers"] = before.get("layers", [])
    else:
        out, why = _python(["layers.py"] + (["--quick"] if options.quick else []))
        results["layers"] = {"skipped": why} if why else json.loads(out.splitlines()[-1])
    if options.no_scaling or options.again:
        results["scaling"] = before.get("scaling", {})
    else:
        out, why = _python(["scaling.py"] + (["--quick"] if options.quick else []))
        results["scaling"] = {"skipped": why} if why else json.loads(out.splitlines()[-1])
    print(markdown(results))
    if not options.quick and (options.again or not options.only):
        kept_results.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
        (HERE / "results.md").write_text(markdown(results), encoding="utf-8")


if __name__ == "__main__":
    main()
