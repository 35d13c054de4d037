"""Readings of pulse tests as plain data: for JSON, tables, summary.json."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from wavesim.material.shown import plain
from wavesim.readings.pulse.reading import Reading
from wavesim.readings.pulse.series_law import Series


def of_reading(one: Reading) -> dict[str, Any]:
    """A record: receivers with their arrivals, the best travel time, and what else there is."""
    answer: dict[str, Any] = {
        "file": one.file,
        "receivers": [
            {
                "name": receiver.name,
                "position": receiver.position,
                "arrivals": {
                    convention: vars(found) | {"valid": not found.reason}
                    for convention, found in receiver.arrivals.items()
                },
            }
            for receiver in one.receivers
        ],
        "best": vars(one.best),
        "notes": list(one.notes),
    }
    if one.packets:
        answer["packets"] = [
            {"name": p.name, "wave": p.wave, "time": p.begins, "top": p.top, "size": p.size}
            for p in one.packets
        ]
    if one.result is not None:
        tables = one.result.rows()
        quality, (ratio,) = one.result.quality, tables["quality"]
        answer["velocities"] = tables["velocities"]
        answer["quality"] = {
            "value": quality.quality,
            "error": quality.error,
            "at_least": quality.at_least,
            "inverse": quality.inverse,
            "inverse_error": quality.inverse_error,
            "band": list(quality.band),
            "frequencies": quality.used,
            "valid": not quality.reason,
            "reason": quality.reason,
        }
        answer["spectral_ratio"] = {
            "value": ratio["quality"],
            "error": ratio["error"],
            "valid": not ratio["reason"],
            "reason": ratio["reason"],
        }
        rows = tables["frequencies"]
        answer["frequencies"] = {key: [row[key] for row in rows] for key in rows[0]} if rows else {}
    return dict(plain(answer))


def of_series(series: Series | None, readings: Sequence[Reading]) -> dict[str, Any] | None:
    """The law of a series and what was set aside; None where there is no series."""
    if series is None:
        return None
    law = series.law
    fit = None if law is None else {
        "a": law.a, "a_error": law.a_error, "b": law.b, "b_error": law.b_error
    }  # fmt: skip
    aside = [readings[i].file for i in law.outliers] if law is not None else []
    return dict(
        plain({"parameter": series.parameter, "values": series.values, "fit": fit,
               "scatter": law.scatter if law is not None else None, "outliers": aside})
    )  # fmt: skip


def answer(readings: Sequence[Reading], series: Series | None) -> dict[str, Any]:
    """All of it, as ``wavesim pulse --json`` prints it."""
    return {"records": [of_reading(one) for one in readings], "series": of_series(series, readings)}
