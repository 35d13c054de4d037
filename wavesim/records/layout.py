"""What a caller says of a file: where in it the record is, and what the file does not say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wavesim.material.arguments import checked
from wavesim.records.content import RecordError
from wavesim.records.units import NAMES, factor


@checked
@dataclass(frozen=True)
class Layout:
    """Where in a file the record is, and what the file does not say.

    Args:
        values, time: names of arrays.
        positions: name of an array, or the positions themselves.
        interval: Δt, s; stands before the file's times, whose first is kept.
        spacing: between receivers, m; stands before the file's positions, whose first is kept.
        receivers: how many there are, where nothing tells which axis of an array is theirs.
        first: position of the first receiver, m, with a spacing where the file has no positions.
        time_unit, position_unit: of the file's times and positions, and of no number given here;
            what the file says itself where None.
        input: heading or number (from 1, times are 1) of the column that holds the source's signal.
        quiet_from: time from which on no source acts, s; the file's own, or its start, where None.
        sources: positions of sources, m.
        ring: whether receivers go evenly round a periodic bar.
        lattice: whether receivers are all the sites of a lattice.
        as_recorded: whether channels along a line are taken as they are, and not held against each
            other.
        placed: whether receivers must have positions; where not, unknown ones are NaN.
        transmitter: whether a heading that says so tells the input where none is named.
    """

    values: str | None = None
    time: str | None = None
    positions: str | Sequence[float] | None = None
    interval: float | None = None
    spacing: float | None = None
    receivers: int | None = None
    first: float = 0.0
    time_unit: str | None = None
    position_unit: str | None = None
    input: str | int | None = None
    quiet_from: float | None = None
    sources: Sequence[float] = ()
    ring: bool = False
    lattice: bool = False
    as_recorded: bool = False
    placed: bool = True
    transmitter: bool = False

    def __post_init__(self) -> None:
        for kind in ("time", "position"):
            unit = getattr(self, f"{kind}_unit")
            if unit is not None and factor(unit, kind) is None:
                raise RecordError(f"--{kind}-unit {unit}: must be one of {', '.join(NAMES[kind])}")
        for name in ("interval", "spacing"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise RecordError(f"{name} = {value:g}: must be greater than 0")


def told_files(files: Sequence[str | Path]) -> str:
    """Files of one record in a message."""
    return str(files[0]) if len(files) == 1 else f"{files[0]} and {len(files) - 1} more"
