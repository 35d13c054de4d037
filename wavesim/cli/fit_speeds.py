"""The ways of ``fit`` that begin from P and S speeds: one pair, or two series over a state."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from wavesim.report.terminal import BAD_INPUT, console, stop


def _read(path: str) -> Any:
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
        return found["records"] and found
    except (OSError, UnicodeDecodeError) as error:
        stop(f"{path}: can't be read: {error}; name pulse.json of wavesim pulse --out", BAD_INPUT)
    except (ValueError, KeyError, TypeError):
        stop(f"{path}: not what wavesim pulse --json writes; name its pulse.json", BAD_INPUT)


def of_pair(speeds: tuple[float, float], errors: tuple[float, float] | None, start: Any) -> Any:
    """The fit of one pair, as plain data."""
    from wavesim.studies.speed_fit import fit_speeds

    return fit_speeds(*speeds, start, errors or (math.nan, math.nan)).summary()


def of_series(p: str, s: str, start: Any) -> Any:
    """The fits of two series, as plain data: the first state's, and all under "series"."""
    from wavesim.studies.speed_fit import fit_series

    fits, law = fit_series(_read(p), _read(s), start)
    rows = [{"parameter": one.parameter} | one.summary()["parameters"] for one in fits]
    reasons = [one.reason for one in fits if one.reason]
    answer = fits[0].summary() | {"series": rows, "law": law, "valid": not reasons}
    return answer


def show(answer: dict[str, Any]) -> None:
    """Print a series of fits, a line for each state; of a pair, as any fit."""
    from wavesim.report.fit_tables import show_fit

    if "series" not in answer:
        one = answer["parameters"]["medium.K_n_a"]
        if one["reason"]:
            console().print(f"No medium has these speeds: {one['reason']}.", markup=False)
        else:
            show_fit(console(), answer)
        return
    for row in answer["series"]:
        parts = []
        for key in ("medium.K_n_a", "medium.stiffness_ratio"):
            one = row[key]
            if one["reason"]:
                parts = [one["reason"]]
                break
            bar = "" if one["error"] is None else f" ± {one['error']:.2g}"
            parts.append(f"{key.partition('.')[2]} = {one['value']:.4g}{bar}")
        console().print(f"{row['parameter']:g}: {', '.join(parts)}", markup=False)
    if answer["law"]:
        law = answer["law"]
        console().print(
            f"K_n_a = {law['c']:.4g} · parameter^({law['b']:.3f} ± {law['b_error']:.2g})",
            markup=False,
        )
    for note in answer["notes"]:
        console().print(f"Note: {note}.", markup=False)
