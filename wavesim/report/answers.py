"""What a run found, told in words and short tables: for the terminal and for the page."""

from __future__ import annotations

from typing import Any

Summary = dict[str, Any]


def verdict(summary: Summary) -> str:
    """The verdict of a run in a sentence; where a check fell short, its name and what to change."""
    checks = summary["checks"]
    short = [check for check in checks if not check["passed"]]
    if not checks:
        return "Nothing was checked: the notes say why."
    if not short:
        return f"All {len(checks)} checks passed: simulation and exact solution agree."
    worst = short[0]
    told = f"{len(short)} of {len(checks)} checks fell short, first {short_name(worst['name'])}"
    remedy = worst.get("remedy")
    return f"{told}: {remedy}." if remedy else f"{told}."


def short_name(name: str) -> str:
    """A check's name without what was compared."""
    for mark in (": |", ": difference", " over "):
        name = name.split(mark)[0]
    return name
