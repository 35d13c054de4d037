"""Tables of a record beside a case, and of a fit."""

from __future__ import annotations

import math
from typing import Any

from rich.console import Console

from wavesim.material.shown import with_error
from wavesim.readings.misfit import Comparison
from wavesim.report.pulse_tables import in_time
from wavesim.report.terminal import new_table


def show_comparison(console: Console, found: Comparison) -> None:
    """Print what is left, in parts."""
    scale, unit = in_time(max((abs(one.arrival) for one in found.receivers), default=0.0))
    headings = "position (mm)", "left over", f"later by ({unit})", "larger by", "spectrum (dB)"
    table = new_table("receiver", *headings)
    for one in found.receivers:
        table.add_row(
            one.name, f"{one.position * 1e3:.5g}", f"{one.residual:.2%}",
            f"{one.arrival * scale:.4g}", f"× {one.amplitude:.4g}", f"{one.spectrum:.2g}",
        )  # fmt: skip
    console.print(table)
    time, word = in_time(found.lag)
    console.print(f"lag {with_error(found.lag * time, found.lag_error * time, word)}")
    scale_of = with_error(found.scale, found.scale_error)
    console.print(f"scale {scale_of}, unit of the record over that of {found.measured.field}")
    console.print(f"left over {found.residual:.3%} of the record's rms")
    for note in found.measured.notes:
        console.print(f"Note: {note}.", markup=False)


def show_fit(console: Console, answer: dict[str, Any]) -> None:
    """Print a fit."""
    for key, one in answer["parameters"].items():
        if one["error"] is None:
            console.print(f"{key} = {one['value']:.6g}", markup=False)
        else:
            console.print(f"{key} = {with_error(one['value'], one['error'])}", markup=False)
        if one["reason"]:
            console.print(f"  does not count: {one['reason']}.", markup=False)
    for key, one in answer["nuisances"].items():
        error = math.nan if one["error"] is None else one["error"]
        size = max(abs(one["value"]), 0.0 if math.isnan(error) else error)
        scale, unit = in_time(size) if key == "lag" else (1.0, "")
        told = with_error(one["value"] * scale, error * scale, unit) if unit else None
        console.print(f"{key} {told or with_error(one['value'], error)}", markup=False)
    if any(one["error"] is not None for one in answer["parameters"].values()):
        console.print("± is one standard error.")
    for pair in answer["correlations"]:
        a, b = pair["keys"]
        console.print(f"Errors of {a} and {b} hang together: correlation {pair['value']:.3f}.",
                      markup=False)  # fmt: skip
    if answer["kind"] == "waveforms":
        console.print(f"left over {answer['residual']:.3%} of the record's rms, "
                      f"{answer['evaluations']} runs")  # fmt: skip
    for note in answer["notes"]:
        console.print(f"Note: {note}.", markup=False)
