"""results.json as a page of tables."""

from __future__ import annotations

from typing import Any

WAVESIM = "wavesim, default, final frame"
_HEAD = (
    "| contestant | target | setting | error | run, s | set-up, s | compile, s | products "
    "| peak MiB | run ÷ wavesim | with set-up |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|\n"
)


def _number(value: float | None, digits: int = 3) -> str:
    if value is None:
        return "–"
    return f"{value:.{digits}g}" if value < 1000 else f"{value:.0f}"


def _mark(contestant: dict[str, Any]) -> str:
    again = " †" if contestant.get("again") else ""
    return again + (r" \*" if contestant.get("disturbed") else "")


def _rows(results: dict[str, Any]) -> list[str]:
    done = {c["name"]: c for c in results["contestants"] if "rows" in c}
    base = done.get(WAVESIM)
    lines = []
    for contestant in results["contestants"]:
        if "rows" not in contestant:
            reason = f"skipped: {contestant['skipped']}"
            lines.append(f"| {contestant['name']} | {reason} |" + " |" * 9)
            continue
        for row in contestant["rows"]:
            setup = contestant["setup"] + max(row.get("prepare", 0.0), 0.0)
            ratio = whole = None
            if base:
                best = base["rows"][0]
                ratio = row["run"] / best["run"]
                whole = (row["run"] + setup) / (best["run"] + base["setup"] + best["prepare"])
            setting = f"{row['setting']:.3g}" if row["setting"] < 1 else f"{row['setting']:.0f}"
            lines.append(
                f"| {contestant['name']}{_mark(contestant)} "
                f"| {'any' if contestant['exact'] else format(row['target'], '.0e')} "
                f"| {'–' if contestant['exact'] else setting} "
                f"| {'(order 2)' if row['error'] is None else format(row['error'], '.1e')} "
                f"| {'~' if row['extrapolated'] else ''}{_number(row['run'])} "
                f"| {_number(setup)} | {_number(row['compile'])} "
                f"| {row['products'] if row['products'] is not None else '–'} "
                f"| {contestant['peak_bytes'] / 2**20:.0f} "
                f"| {_number(ratio)} | {_number(whole)} |"
            )
    return lines


def _scaling(found: dict[str, Any]) -> str:
    if "skipped" in found:
        return f"Skipped: {found['skipped']}\n"
    text = (
        "Default stepper, twelve fields, final frame only; up to 100,000 cells the second run in "
        "the process.\n\n"
        "| cells | units of time | steps | run, s | set-up, s | ns a cell and step "
        "| ns a cell and unit of time | peak MiB |\n|---|---|---|---|---|---|---|---|\n"
    )
    for row in found["advance"]:
        if "failed" in row:
            text += f"| {row['cells']} | failed: {row['failed']} |" + " |" * 6 + "\n"
            continue
        text += (
            f"| {row['cells']} | {row['duration']:.0f} | {row['steps']} | {_number(row['run'])} "
            f"| {_number(row['setup'])} | {_number(row['ns_per_cell_and_step'])} "
            f"| {_number(row['ns_per_cell_and_time'])} | {row['peak_bytes'] / 2**20:.0f} |\n"
        )
    text += (
        "\nFrames stored to disk, one sector of four fields, no analysis.\n\n"
        "| cells | frames | peak MiB while streaming | peak MiB | file, MiB |\n"
        "|---|---|---|---|---|\n"
    )
    for row in found["store"]:
        if "failed" in row:
            text += f"| {row['cells']} | failed: {row['failed']} |" + " |" * 3 + "\n"
            continue
        text += (
            f"| {row['cells']} | {row['frames']} | {row['peak_streaming_bytes'] / 2**20:.0f} "
            f"| {row['peak_bytes'] / 2**20:.0f} | {row['file_bytes'] / 2**20:.0f} |\n"
        )
    return text


def _layers(found: Any) -> str:
    if isinstance(found, dict):
        return f"Failed: {found['skipped']}\n"
    text = (
        "Layers, ends and losses beside a uniform periodic bar: longitudinal fields, equal cells, "
        "401 frames over 200 units of time, in turn in one process of their own, warm, best of 5."
        "\n\n"
        "| bar | cells | stepper | run, s | set-up, s | ÷ uniform |\n|---|---|---|---|---|---|\n"
    )
    for row in found:
        text += (
            f"| {row['bar']} | {row['cells']} | {row['stepper']} | {_number(row['run'])} "
            f"| {_number(row['setup'])} | {row['ratio']:.2f} |\n"
        )
    return text


def markdown(results: dict[str, Any]) -> str:
    """The page."""
    host = results["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in host["versions"].items())
    text = (
        "# Results\n\n"
        "Written by `python benchmarks/run.py`; all of it from one run. How it is measured, and "
        "what is done for each contestant, stands in [README.md](README.md).\n\n"
        f"{host['processor']}, {host['cores']} cores, Python {host['python']}; {versions}; "
        f"{host['date']}.\n\n"
        "Twelve fields, 4,096 cells of l/8, order 8, 200 units of time, float64 but where named. "
        "Setting: steps of a leapfrog, tolerance (relative and absolute) of an adaptive solver. "
        "~: time of some of the steps, in proportion. Ratios are to the default stepper, final "
        "frame.\n\n"
    )
    if any(contestant.get("disturbed") for contestant in results["contestants"]):
        text += (
            "\\* Other programs took part of the machine while this was measured; the contestant "
            "is faster than this by an unknown part, and its ratio is no claim.\n\n"
        )
    if any(contestant.get("again") for contestant in results["contestants"]):
        text += (
            "† Measured once more, after the one run that all others are from, in which other "
            "programs disturbed it.\n\n"
        )
    text += _HEAD + "\n".join(_rows(results)) + "\n"
    if results.get("layers"):
        text += "\n## Real bars\n\n" + _layers(results["layers"])
    if results.get("scaling"):
        text += "\n## Scaling\n\n" + _scaling(results["scaling"])
    return text
