"""What a file holds, before anything is made of it: named arrays, their units, what was assumed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.units import Said, alike

# More than this is no record that can be read off at once: 2 GB of float64.
LARGEST = 250_000_000
# Signals begin one after the other where this part of the record lies between.
_CLEARLY = 0.02
# A step is above half of its peak for this part of what follows its beginning.
_STAYS = 0.9


class RecordError(ValueError):
    """A record can't be used; the message names what is wrong, the limit and the remedy."""


class UnitsError(RecordError):
    """What times and positions are read in can't be right."""


@dataclass
class Content:
    """Named arrays of a file.

    Attributes:
        arrays: by name, as stored.
        units: of arrays, by name, where the file says one.
        labels: names of the receivers, where "values" came from columns; as many.
        columns: numbers of those columns in the file, from 1, times counted.
        notes: what was assumed or left out, a line each.
        overload: how many samples were marked as out of range, by label.
        unplaced, unplaced_columns: columns whose heading says no position where others' do, and
            their numbers: a transmitter's voltage, a temperature.
        said_in: where units are said, by name: "row 1 ('Zeit/µs')".
        settled: names of arrays that are in SI whatever unit is given, as dates are.
    """

    arrays: dict[str, NDArray[Any]]
    units: dict[str, str] = field(default_factory=dict)
    labels: tuple[str, ...] = ()
    columns: tuple[int, ...] = ()
    notes: list[str] = field(default_factory=list)
    overload: dict[str, int] = field(default_factory=dict)
    unplaced: dict[str, NDArray[Any]] = field(default_factory=dict)
    unplaced_columns: dict[str, int] = field(default_factory=dict)
    said_in: dict[str, str] = field(default_factory=dict)
    settled: set[str] = field(default_factory=set)

    def place(self, said: Sequence[Said], where: str) -> None:
        """Receivers where headings say: x, with the unit that all of them say.

        Args:
            said: of each receiver its position and unit.
            where: what says so, for a note.
        """
        numbers, unit, differ = alike(said)
        self.arrays["x"] = np.array(numbers)
        if differ:
            self.settled.add("x")
        elif unit is not None:
            self.units["x"], self.said_in["x"] = unit, where


def check_size(shape: tuple[int, ...], name: str) -> None:
    """Refuse an array too large to be read."""
    count = int(np.prod([int(n) for n in shape], dtype=object)) if shape else 1
    if count > LARGEST:
        raise RecordError(
            f"array {name!r} of shape {tuple(int(n) for n in shape)}: more than {LARGEST:,} "
            "samples; cut the record, or take fewer samples a second"
        )


def without_single_axes(array: NDArray[Any]) -> NDArray[Any]:
    """An array of three axes or more without those of one entry, which tell nothing."""
    return np.squeeze(array) if array.ndim > 2 else array


def sent_first(columns: Sequence[int], values: NDArray[Any], said: str, text: str) -> int:
    """Which of two columns is what was sent, the other what was received of it: it reaches half of
    its peak first, or, where crosstalk comes at once, is over first, or is a step.

    Args:
        columns: their indices.
        values: shape (nt, more).
        said, text: for a message, why both may be meant, and what was asked for.

    Raises:
        RecordError: neither is clear.
    """
    unclear = RecordError(f"{said}: say 'column {text}' or 'heading {text}'")
    if max(columns) >= values.shape[1]:
        raise unclear
    begun, over, stays = np.zeros((3, 2))
    for k, j in enumerate(columns):
        u = np.nan_to_num(values[:, j].astype(float))
        size = np.abs(u - np.median(u[: max(4, len(u) // 50)]))
        loud = np.flatnonzero(size >= size.max() / 2)
        begun[k], over[k] = loud[[0, -1]] / len(u)
        stays[k] = len(loud) / (len(u) - loud[0])
    order = begun
    if abs(begun[0] - begun[1]) <= _CLEARLY:
        # A step stays; else what was sent is over sooner.
        order = -stays if stays.max() > _STAYS else over
    if not abs(order[0] - order[1]) > _CLEARLY:
        raise unclear
    return columns[int(np.argmin(order))]
