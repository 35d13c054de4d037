"""results.json as a page: what it takes beside wavesim first, then the seconds."""

from __future__ import annotations

import statistics
from typing import Any

Row = dict[str, Any]
TITLES = {
    "ring": "uniform ring",
    "layered": "layered bar, free ends",
    "lossy": "lossy bar, absorbing ends",
}
_OURS = "wavesim"
# Goals on the ring at 1e-6: times as long as wavesim, cold and warm.
_GOALS = {"SciPy DOP853": (30, 250), "the best of the others": (5, 25)}


def total(run: dict[str, float]) -> float:
    """Seconds of a run."""
    return sum(run.values())


def reaching(rows: list[Row], problem: str, target: str) -> dict[str, Row]:
    """{contestant: its row} of one problem that holds for a target and was measured."""
    return {
        row["contestant"]: row
        for row in rows
        if row["problem"] == problem and row["target"] in (target, "any") and "failed" not in row
    }


def ratio(rows: dict[str, Row], contestant: str, which: str) -> float:
    """Its time over wavesim's, "cold" or "warm"."""
    return total(rows[contestant][which]) / total(rows[_OURS][which])


def _number(value: float) -> str:
    return f"{value:.0f}" if value >= 99.5 else f"{value:.2g}" if value < 9.95 else f"{value:.1f}"


def _short(rows: list[Row], target: str) -> str:
    problems = [name for name in TITLES if _OURS in reaching(rows, name, target)]
    known = {name: reaching(rows, name, target) for name in problems}
    text = f"| at {float(target):.0e} |" + "".join(
        f" {TITLES[name]}: cold | warm |" for name in problems
    )
    text += "\n|---|" + "---:|---:|" * len(problems) + "\n"
    for contestant in dict.fromkeys(row["contestant"] for row in rows):
        line = f"| {contestant} |"
        for name in problems:
            for which in ("cold", "warm"):
                row = known[name].get(contestant)
                if row is None:
                    line += " |"
                elif contestant == _OURS:
                    line += f" {_number(total(row[which]))} s |"
                else:
                    about = "~" if row["tenth"] else ""
                    line += f" {about}{_number(ratio(known[name], contestant, which))} × |"
        text += line + "\n"
    return text


def _goals(rows: list[Row]) -> str:
    known = reaching(rows, "ring", "1e-06")
    if _OURS not in known or "SciPy DOP853" not in known:
        return ""
    others = [name for name in known if not name.startswith(_OURS) and name != "SciPy DOP853"]
    text = (
        "| ring, 1e-6: times as long as wavesim | cold: at least | seen | warm: at least | seen |\n"
    )
    text += "|---|---:|---:|---:|---:|\n"
    for name, goals in _GOALS.items():
        line = f"| {name} |"
        for which, least in zip(("cold", "warm"), goals, strict=True):
            among = [name] if name in known else others
            best = min(among, key=lambda one, which=which: ratio(known, one, which))
            seen = ratio(known, best, which)
            who = "" if name in known else f" ({best})"
            met = "met" if seen >= least else "not met"
            line += f" {least} | {_number(seen)}{who}, {met} |"
        text += line + "\n"
    return "\n## Goals\n\n" + text


def _seconds(rows: list[Row], problem: str) -> str:
    text = (
        "| contestant | target | setting | error | cold, s | imports | set-up, compilation | steps "
        "| warm, s | set-up |\n|---|---|---:|---:|---:|---:|---:|---:|---:|---:|\n"
    )
    for row in rows:
        if row["problem"] != problem:
            continue
        name, target = row["contestant"], row["target"].replace("e-0", "e-")
        if "failed" in row:
            text += f"| {name} | {target} | failed: {row['failed']} |" + " |" * 7 + "\n"
            continue
        about = "~" if row["tenth"] else ""
        number = row["setting"]
        setting = f"{number:.0f}" if number >= 1 else f"{number:.2g}" if number else "–"
        seen = "–" if row["error"] is None else f"{row['error']:.1e}"
        cold, warm = row["cold"], row["warm"]
        parts = (cold["imports"], cold["prepare"], cold["steps"])
        text += f"| {name} | {target} | {setting} | {seen} | {about}{_number(total(cold))} | "
        text += " | ".join(_number(part) for part in parts)
        text += f" | {about}{_number(total(warm))} | {_number(warm['prepare'])} |\n"
    return text


def into(page: str, results: dict[str, Any]) -> str:
    """A page of the documents with the table at 1e-6 between its two marks."""
    before, begin, rest = page.partition("<!-- from results.md -->\n")
    _, end, after = rest.partition("<!-- to here -->\n")
    return before + begin + _short(results["rows"], "1e-06") + end + after


def markdown(results: dict[str, Any]) -> str:
    """The page."""
    host, rows = results["machine"], results["rows"]
    versions = ", ".join(f"{name} {version}" for name, version in host["versions"].items())
    text = (
        "# Results\n\n"
        "Written by `python benchmarks/run.py`, all from one run; [README.md](README.md) says what "
        "is measured.\n\n"
        f"{host['cores']} cores, {host['processor']}, Python {host['python']}; {versions}; "
        f"{host['date']}; load of the machine {min(host['load'])} to {max(host['load'])}, "
        f"{statistics.median(host['load'])} in the median (1 or 2 is this run's own).\n\n"
        "Twelve fields, 4,096 cells, 200 units of time, 401 frames in memory. Times over "
        "wavesim's, at settings that reach the error; ~: steps of a tenth of the time, ten times.\n"
    )
    for target in ("1e-06", "1e-04"):
        text += "\n" + _short(rows, target)
    text += _goals(rows)
    for problem in dict.fromkeys(row["problem"] for row in rows):
        text += f"\n## {TITLES[problem].capitalize()}: seconds\n\n" + _seconds(rows, problem)
    return text
