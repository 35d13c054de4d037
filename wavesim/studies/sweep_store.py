"""A sweep's dataset on disk: zarr, a file for each variable of each block of members.

Each file is written aside and moved into place, and a member's status last: whatever is killed at
whatever moment, what has a status is there whole, and the dataset opens (``xarray.open_zarr``).
"""

from __future__ import annotations

import json
import math
import shutil
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.studies.variation import Region, SweepError, Variation
from wavesim.timedomain.cost import free, rounded, size

PENDING, DONE, FAILED = 0, 1, 2
# What stands for a number that is not there, by its kind; all of them are read as NaN.
_NOT_THERE = {"f": np.nan, "c": complex(np.nan, np.nan), "i": -1}
_STATUS = {"flag_values": [PENDING, DONE, FAILED], "flag_meanings": "pending done failed"}


@dataclass(frozen=True)
class Variable:
    """A variable that a sweep measures of each member.

    Attributes:
        dimensions: beside those of the members.
        unit: SI, "1" for a number without one.
        about: what it is, in a line.
        kind: numpy's dtype; numbers not there are NaN.
    """

    dimensions: tuple[str, ...]
    unit: str
    about: str
    kind: Any = "f8"


@dataclass(frozen=True)
class Layout:
    """What is stored of a sweep.

    Attributes:
        variables: by name.
        coordinates: {name: (values, unit)} of the variables' own dimensions.
        members: in a block, at most.
        labels: {name: (values, dimension)} of what is said along one of these dimensions.
    """

    variables: Mapping[str, Variable]
    coordinates: Mapping[str, tuple[Any, str]] = field(default_factory=dict)
    members: int = 1
    labels: Mapping[str, tuple[Any, str]] = field(default_factory=dict)


_OWN = {
    "status": Variable((), "1", "0 not yet, 1 done, 2 failed", "i1"),
    "message": Variable((), "1", "why a member failed", str),
    "seconds": Variable((), "s", "time that the member took"),
    "finished": Variable((), "s", "when it was written, seconds since 1970"),
}


class Store:
    """The dataset of one sweep.

    Attributes:
        path: of the dataset.
        blocks: where each block of members lies.
    """

    def __init__(
        self, path: Path, varied: Variation, layout: Layout, told: Mapping[str, Any]
    ) -> None:
        """Describe a dataset; :meth:`create` or :meth:`carry_on` comes next.

        Args:
            path: of the dataset.
            varied: its members.
            layout: what is measured of each.
            told: attributes that say what sweep it is; one of others is not carried on.
        """
        self.path, self._varied, self._layout = path, varied, layout
        self._told = {name: json.loads(json.dumps(value)) for name, value in told.items()}
        self._chunks, self.blocks = varied.blocks(layout.members)
        self._group: Any = None
        self._status: NDArray[np.int8] = np.zeros(varied.shape, np.int8)

    def check_room(self) -> None:
        """Hold the dataset to the disk.

        Raises:
            SweepError: it may take more than is free.
        """
        count, sizes = math.prod(self._varied.shape), self._sizes
        each = sum(
            (8 if one.kind is str else np.dtype(one.kind).itemsize)
            * math.prod(sizes[d] for d in one.dimensions)
            for one in (*self._layout.variables.values(), *_OWN.values())
        )
        room = free(self.path.parent)
        if count * each > room:
            raise SweepError(
                f"{count} members take {size(count * each)} of disk; more than {size(room)}, which "
                f"is free there: take at most {rounded(room / each)}, or another folder by --out"
            )

    def create(self) -> None:
        """Begin anew, without any member; an older dataset is replaced.

        Raises:
            OSError: it can't be written.
        """
        import zarr

        aside = self.path.with_name(f"{self.path.name}.{uuid.uuid4().hex}")
        try:
            named = {"coordinates": " ".join([*self._varied.keys, *self._layout.labels])}
            group = zarr.create_group(aside, zarr_format=2, attributes=self._told | named)
            for name, values, unit, dimension in self._coordinates():
                made = self._array(
                    group, name, (dimension,), values.shape, values.shape, values.dtype
                )
                made[...] = values
                made.update_attributes({"units": unit})
            shape, chunks = self._varied.shape, self._chunks
            sizes = self._sizes
            for name, one in (*self._layout.variables.items(), *_OWN.items()):
                own = tuple(sizes[d] for d in one.dimensions)
                made = self._array(
                    group, name, (*self._varied.dimensions, *one.dimensions),
                    shape + own, chunks + own, one.kind,
                )  # fmt: skip
                more = _STATUS if name == "status" else {"units": one.unit}
                made.update_attributes({"long_name": one.about} | more)
            zarr.consolidate_metadata(aside)
            if self.path.exists():
                shutil.rmtree(self.path)
            aside.rename(self.path)
        finally:
            shutil.rmtree(aside, ignore_errors=True)
        self._group = zarr.open_group(self.path, mode="r+")

    def carry_on(self) -> int:
        """Open the dataset of a sweep that was ended.

        Returns:
            Number of members that it has.

        Raises:
            SweepError: there is none, or it is of another sweep.
        """
        import zarr

        try:
            self._group = zarr.open_group(self.path, mode="r+", use_consolidated=False)
            there = dict(self._group.attrs)
            self._status = np.asarray(self._group["status"][...])
        except (FileNotFoundError, KeyError, ValueError):
            raise SweepError(
                f"--resume: no sweep in {self.path}; leave --resume out to begin one"
            ) from None
        for name, value in self._told.items():
            if there.get(name) != value and not name.endswith("version"):
                raise SweepError(
                    f"--resume: {self.path} is of another sweep ({name} differs); ask for that "
                    "one, or leave --resume out to begin anew"
                )
        for left in self.path.rglob("*.partial"):
            left.unlink(missing_ok=True)
        return int(np.count_nonzero(self._status))

    @property
    def pending(self) -> list[Region]:
        """Blocks that have members to come."""
        return [region for region in self.blocks if (self._status[region] == PENDING).any()]

    @property
    def failed(self) -> int:
        """Number of members that failed."""
        return int(np.count_nonzero(self._status == FAILED))

    def write(
        self, region: Region, found: Mapping[str, Any], messages: Any, seconds: float, now: float
    ) -> None:
        """Write what was measured of a block, its status last.

        Args:
            region: of the members.
            found: values by variable, shape (members, …) each; none where all failed.
            messages: why members failed, "" where one did not, shape (members,).
            seconds: that a member took.
            now: seconds since 1970.

        Raises:
            OSError: it can't be written.
        """
        shape = self._status[region].shape
        messages = np.asarray(messages, dtype=object).reshape(shape)
        for name, values in found.items():
            values = np.asarray(values)
            self._group[name][region] = values.reshape(*shape, *values.shape[1:])
        self._group["message"][region] = messages
        self._group["seconds"][region] = np.full(shape, seconds)
        self._group["finished"][region] = np.full(shape, now)
        status = np.where(messages == "", DONE, FAILED).astype("i1")
        self._group["status"][region] = status
        self._status[region] = status

    def open(self) -> Any:
        """The dataset, read where it is looked at."""
        import xarray

        return xarray.open_zarr(self.path)

    @property
    def _sizes(self) -> dict[str, int]:
        return {name: len(values) for name, (values, _) in self._layout.coordinates.items()}

    def _array(
        self, group: Any, name: str, dimensions: Any, shape: Any, chunks: Any, kind: Any
    ) -> Any:
        kind = str if kind is str or np.dtype(kind).kind in "UO" else np.dtype(kind)
        fill = None if kind is str or name == "status" else _NOT_THERE.get(kind.kind)
        made = group.create_array(
            name, shape=shape, chunks=tuple(max(1, n) for n in chunks), dtype=kind, fill_value=fill
        )
        made.update_attributes({"_ARRAY_DIMENSIONS": list(dimensions)})
        return made

    def _coordinates(self) -> Any:
        """(name, values, unit, dimension) of all coordinates."""
        varied = self._varied
        for number, axis in enumerate(varied.axes):
            values, dimension = varied.values[:, number], "member"
            if varied.sampler == "grid":
                dimension = axis.key
                values = np.linspace(axis.low, axis.high, axis.count)
            yield axis.key, values, axis.unit, dimension
        own = {
            name: (values, unit, name) for name, (values, unit) in self._layout.coordinates.items()
        }
        own |= {name: (values, "1", along) for name, (values, along) in self._layout.labels.items()}
        for name, (values, unit, dimension) in own.items():
            array = np.asarray(values)
            kept = array.astype(object) if array.dtype.kind == "U" else array
            yield name, kept, unit, dimension
