"""What ``wavesim dispersion`` and ``attenuation`` tell: a medium fitted, and all as one object."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from wavesim.material.medium import Medium
from wavesim.readings.dispersion.points import plain
from wavesim.studies.medium_fit import Fitted, Observed, fit
from wavesim.verdict.record import Recovered, checks
from wavesim.verdict.recovered_points import Matched


def fitted(results: Sequence[Recovered], start: Medium, parameters: Sequence[str]) -> Fitted:
    """Parameters of the medium that the points tell of."""
    observed = [
        Observed(one.origin.block, one.points, one.origin.bar)
        for one in results
        if one.origin.block is not None
    ]
    return fit(observed, start, parameters)


def summary(results: Sequence[Recovered], fit_of: Fitted | None = None) -> dict[str, Any]:
    """All that was found as one object for JSON, SI units, NaN as null."""
    entries = []
    for one in results:
        points, record = one.points, one.origin.record
        entry: dict[str, Any] = {
            "name": one.origin.name,
            "method": points.method,
            "frames": len(record.t),
            "receivers": len(record.x),
            "notes": list(record.notes),
            "branches": len(points.branches),
            "points": {n: plain(column) for n, column in points.columns().items()},
        }
        if isinstance(one.matched, Matched):
            entry["waves"] = one.matched.rows()
            entry["false_points"] = len(one.matched.false_k)
        elif one.matched is not None:
            entry["error_grid"] = plain(one.matched.error(False))
            entry["error_continuum"] = plain(one.matched.error(True))
        if one.score is not None:
            entry["score"] = one.score.row()
        entries.append(entry)
    found = checks(results)
    answer: dict[str, Any] = {
        "records": entries,
        "checks": [check.row() for check in found],
        "passed": all(check.passed for check in found),
    }
    if fit_of is not None:
        answer["fit"] = {
            "values": fit_of.values,
            "standard_errors": fit_of.errors,
            "chi_square": fit_of.chi_square,
            "points": fit_of.points,
        }
    return answer
