"""Tables of a record beside a case, and of a fit."""

from __future__ import annotations

import math
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from wavesim.readings.misfit import Comparison
from wavesim.report.pulse_tables import in_time, number


def show_comparison(console: Console, found: Comparison) -> None:
    """Print what is left, in parts."""
    scale, unit = in_time(max((abs(one.arrival) for one in found.receivers), default=0.0))
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("receiver", "position (mm)", "left over", f"later by ({unit})", "larger by",
                    "spectrum (dB)"):  # fmt: skip
        table.add_column(heading, justify="left" if heading == "receiver" else "right")
    for one in found.receivers:
        table.add_row(
            one.name, f"{one.position * 1e3:.5g}", f"{one.residual:.2%}",
            f"{one.arrival * scale:.4g}", f"× {one.amplitude:.4g}", f"{one.spectrum:.2g}",
        )  # fmt: skip
    console.print(table)
    time, word = in_time(found.lag)
    console.print(f"lag {number(found.lag * time, found.lag_error * time, word)}")
    scale_of = _in_digits(found.scale, found.scale_error)
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
            console.print(f"{key} = {_in_digits(one['value'], one['error'])}", markup=False)
        if one["reason"]:
            console.print(f"  does not count: {one['reason']}.", markup=False)
    for key, one in answer["nuisances"].items():
        error = math.nan if one["error"] is None else one["error"]
        console.print(f"{key} {_in_digits(one['value'], error)}", markup=False)
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


def _in_digits(value: float, error: float) -> str:
    """To two digits of the error, whatever the size: "-3.700e+04 ± 1.2e+01"."""
    if not math.isfinite(error) or error <= 0 or value == 0:
        return f"{value:.6g}"
    if 1e-3 <= abs(value) < 1e6 and error >= 1e-6:
        return number(value, error)
    digits = max(1, 2 + math.floor(math.log10(abs(value) / error)))
    return f"{value:.{min(digits, 12)}e} ± {error:.1e}"
