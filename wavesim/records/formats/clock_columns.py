"""Which columns of a table are times: by name or unit, or as they ascend as no wave does."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.formats.text_table import Table
from wavesim.records.units import factor, is_index, is_time, position_in, unit_in

# A column that goes evenly upward to this part of its step, and is not named otherwise, is a clock.
_EVEN = 0.51
# Counters begin anew at 2 to the power of one of these.
_BITS = range(8, 49)
# Of what counts nothing says how long one takes.
_COUNTS = re.compile(r"tick|count|sample|index", re.IGNORECASE)


def counts_rows(table: Table, kept: list[int], sampled: bool) -> bool:
    """Whether the first column numbers rows: by its name, or as the interval is said elsewhere."""
    first = table.data[:, kept[0]]
    steps = np.diff(first)
    if not (len(steps) and np.isfinite(first).all() and (steps == 1).all()):
        return False
    heading = table.headings[kept[0]]
    if sampled and first[0] in (0, 1):
        return factor(table.units[kept[0]], "time") is None and unit_in(heading, "time") is None
    if heading.strip():
        return is_index(heading)
    return len(kept) > 2 and first[0] in (0, 1) and _ascends_evenly(table.data[:, kept[1]])


def clocks_of(table: Table, kept: list[int], counted: bool) -> list[int]:
    """Columns of times: those so named, else the first if it ascends; and those that go with it.

    Beside a column that counts rows the first is none that does not go evenly.
    """
    named = [
        c for c in kept
        if is_time(table.headings[c]) or factor(table.units[c], "time") is not None
        or (unit_in(table.headings[c], "time") and _rises(table.data[:, c]))
        or (not table.headings[c].strip() and c == kept[0] and _ascends(table.data[:, c]))
    ]  # fmt: skip
    if (
        not named
        and (_ascends_evenly if counted else _ascends)(table.data[:, kept[0]])
        and (position_in(table.headings[kept[0]]) is None)
    ):
        named = [kept[0]]
    if not named:
        return []
    # One for each channel: columns that rise evenly, every other one, as no wave does.
    other = [c for c in kept if c >= named[0] and (c - named[0]) % 2 == 0]
    alike = [
        c for c in other
        if position_in(table.headings[c]) is None and _ascends_evenly(table.data[:, c])
    ]  # fmt: skip
    steps = {c: float(np.nanmedian(np.diff(table.data[:, c]))) for c in (named[0], *alike)}
    if len(alike) < len(other):
        alike = [c for c in alike if np.isclose(steps[c], steps[named[0]], rtol=0.05)]
    return sorted({*named, *alike})


def counted_on(table: Table, kept: list[int]) -> list[str]:
    """Times of a counter that begins anew at 2ⁿ, counted on, and a sentence for each."""
    notes = []
    for c in kept:
        heading, column = table.headings[c], table.data[:, c]
        timed = is_time(heading) or factor(table.units[c], "time") or unit_in(heading, "time")
        steps = np.diff(column)
        if not timed or _COUNTS.search(heading) or not len(steps) or not (steps < 0).any():
            continue
        usual = float(np.median(steps))
        for size in (2.0**n for n in _BITS):
            right = np.where(steps < 0, steps + size, steps)
            if usual > 0 and np.abs(right - usual).max() <= _EVEN * usual and column.max() < size:
                table.data[:, c] = column[0] + np.r_[0, np.cumsum(right)]
                notes.append(f"column {table.columns[c]} begins anew at {size:.0f} "
                             f"{int((steps < 0).sum())} times: counted on")  # fmt: skip
                break
    return notes


def _rises(column: NDArray[Any]) -> bool:
    steps = np.diff(column[np.isfinite(column)])
    return len(steps) > 0 and bool((steps > 0).all())


def _ascends(column: NDArray[Any]) -> bool:
    steps = np.diff(column[np.isfinite(column)])
    return len(steps) > 0 and bool((steps >= 0).all()) and bool((steps > 0).any())


def _ascends_evenly(column: NDArray[Any]) -> bool:
    if not np.isfinite(column).all() or len(column) < 3:
        return False
    steps = np.diff(column)
    even = np.linspace(column[0], column[-1], len(column))
    return (
        bool((steps >= 0).all())
        and steps.mean() > 0
        and bool(np.abs(column - even).max() <= _EVEN * max(steps.max(), 2 * steps.mean()))
    )
