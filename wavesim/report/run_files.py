"""What a run writes beside its fields, summary.json and the page; and what an earlier one left."""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavesim.material.shown import plain

if TYPE_CHECKING:
    from wavesim.case.load import Case
    from wavesim.timedomain.time_step import TimeStep
    from wavesim.verdict.judgement import Found

# What a picture's name begins with, and what it ends with.
_FIGURES = {"spacetime", "receivers", "energy", "bar", "signals", "dispersion", "attenuation"}
_FIGURES |= {"transmission", "bloch", "eigenfrequencies", "arrivals", "loss", "velocities"}
_PICTURES = (".png", ".pdf", ".svg")


def summary(case: Case, steps: TimeStep, found: Found, timing: dict[str, float]) -> dict[str, Any]:
    """What summary.json tells of a run.

    Args:
        case: that was run.
        steps: how it was stepped.
        found: of ``verdict.judgement.measure``.
        timing: seconds that each stage took.
    """
    from wavesim.io.result_layout import versions
    from wavesim.material.scaling import scales

    told = {
        "title": case.title,
        "checks": [check.row() for check in found.checks],
        "passed": all(check.passed for check in found.checks),
        "timing": timing,
        "stepper": steps.solver,
        "step": steps.step * float(scales(case.simulation.medium).time),
        "steps": steps.steps,
        "operator_products": steps.operator_products,
        "cells": case.simulation.bar.cells,
        "fields": list(case.simulation.fields),
        "peak_memory_bytes": peak_memory(),
        "versions": versions(),
        "answers": found.answers,
    }
    made: dict[str, Any] = plain(told | found.summary)
    return made


def write(
    summary: dict[str, Any],
    notes: Sequence[str],
    data: dict[str, Any] | None,
    resolved: str,
    folder: Path,
    rerun: str,
) -> None:
    """Write summary.json, and report.html where there is what it is drawn from.

    Args:
        summary, notes: of the run.
        data: of ``report.page_data``; None without.
        resolved: the case as it was run, TOML.
        folder: where to.
        rerun: the command that runs the case.

    Raises:
        OSError: a file can't be written.
    """
    from wavesim.io.whole_files import write_whole
    from wavesim.report.page import page

    text = json.dumps(summary, indent=1, ensure_ascii=False) + "\n"
    write_whole(folder / "summary.json", text.encode())
    if data is not None:
        made = page(summary, data, resolved, folder, rerun, notes)
        write_whole(folder / "report.html", made.encode())


def take_away_old(folder: Path) -> None:
    """An earlier run's verdict must not be taken for this one's."""
    for name in ("summary.json", "report.html", "overview.png"):
        (folder / name).unlink(missing_ok=True)
    for picture in (folder / "figures").glob("*.*"):
        if picture.stem.partition("_")[0] in _FIGURES and picture.suffix in _PICTURES:
            picture.unlink(missing_ok=True)


def peak_memory() -> int:
    """Largest memory of this process so far and of the largest it has waited for, bytes."""
    whom = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
    size = sum(resource.getrusage(who).ru_maxrss for who in whom)
    return size if sys.platform == "darwin" else size * 1024
