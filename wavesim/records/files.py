"""Records from files: HDF5, NPZ, CSV, and NumPy's own, whoever wrote them.

Arrays are taken by the names given or, where none are, found by name and by shape: the record is
the largest array of two or three axes, times and positions ascend and are as long as its axes.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.record import Record, RecordError, record

Float = NDArray[Any]

_TIMES = ("t", "time", "times", "t_s")
_POSITIONS = ("x", "position", "positions", "receivers", "x_m", "offset", "offsets")
_TRUTH = "truth_"
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
HDF5 = (".h5", ".hdf5", ".hdf", ".he5", ".nc")


@dataclass(frozen=True)
class Layout:
    """Where in a file the record is, and what the file does not say.

    Args:
        values, time, positions: names of arrays.
        interval: Δt, s, where the file has no times.
        spacing: between receivers, m, where it has no positions.
        first: position of the first receiver, m, with a spacing.
        quiet_from: time from which on no source acts, s; the file's own, or its start, where None.
        sources: positions of sources, m.
        ring: whether receivers go evenly round a periodic bar.
        lattice: whether receivers are all the sites of a lattice.
    """

    values: str | None = None
    time: str | None = None
    positions: str | None = None
    interval: float | None = None
    spacing: float | None = None
    first: float = 0.0
    quiet_from: float | None = None
    sources: Sequence[float] = ()
    ring: bool = False
    lattice: bool = False


def read(path: str | Path, layout: Layout | None = None) -> Record:
    """Read a record from a file.

    Args:
        path: .csv, .txt or .tsv with a column of times and one for each receiver, its position (m)
            in the heading; .npz, .npy; .h5 and other HDF5.
        layout: what the file does not say for itself.

    Returns:
        The record, remedied where need be (``wavesim.records.record``).

    Raises:
        RecordError: the file can't be read or used; the message names it.
    """
    path, layout = Path(path), layout or Layout()
    if not path.is_file():
        raise RecordError(f"{path}: no such file")
    try:
        return _build(_arrays(path), layout)
    except RecordError as error:
        raise RecordError(f"{path}: {error}") from None


def from_arrays(arrays: Mapping[str, Any], layout: Layout | None = None) -> Record:
    """A record from named arrays, as :func:`read` finds them in a file."""
    return _build({name: np.asarray(a) for name, a in arrays.items()}, layout or Layout())


def _arrays(path: Path) -> dict[str, Float]:
    kind = path.suffix.lower()
    if kind in (".csv", ".txt", ".tsv", ".dat"):
        return _from_text(path)
    if kind in HDF5:
        from wavesim.io.result_reader import StorageError, read_arrays

        try:
            return read_arrays(path)
        except StorageError as error:
            raise RecordError(str(error).split(": ", 1)[-1]) from None
    if kind in (".npz", ".npy"):
        try:
            loaded = np.load(path, allow_pickle=False)
        except (OSError, ValueError) as error:
            raise RecordError(f"can't be read as NumPy's: {error}") from None
        if kind == ".npy":
            return {"values": loaded}
        with loaded:
            return {name: loaded[name] for name in loaded.files}
    raise RecordError(
        f"of a kind that is not known ({kind or 'no suffix'}): give .csv, .npz, .npy or HDF5"
    )


def _from_text(path: Path) -> dict[str, Float]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordError(f"can't be read as text: {error}") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        raise RecordError("holds no table: a heading and a row for each time are needed")
    delimiter = max(",;\t", key=lines[0].count)
    rows = list(csv.reader(lines, delimiter=delimiter))
    heading = [cell.strip() for cell in rows[0]]
    body = rows[1:]
    if all(_is_number(cell) for cell in heading):
        raise RecordError(
            "has no heading: name the columns, times first, then each receiver's position in m"
        )
    width = len(heading)
    bad = next((i for i, row in enumerate(body) if len(row) != width), None)
    if bad is not None:
        raise RecordError(f"row {bad + 2} has {len(body[bad])} cells; the heading has {width}")
    try:
        table = np.array([[float(c) if c.strip() else np.nan for c in row] for row in body])
    except ValueError as error:
        raise RecordError(f"holds a cell that is no number: {error}") from None
    places = [_NUMBER.search(name) for name in heading[1:]]
    arrays = {"t": table[:, 0], "values": table[:, 1:]}
    if all(places):
        arrays["x"] = np.array([float(p.group()) for p in places if p])
    return arrays


def _is_number(cell: str) -> bool:
    return _NUMBER.fullmatch(cell.strip()) is not None


def _build(arrays: dict[str, Float], layout: Layout) -> Record:
    truth = {n[len(_TRUTH) :]: a for n, a in arrays.items() if n.startswith(_TRUTH)}
    arrays = {n: a for n, a in arrays.items() if not n.startswith(_TRUTH)}
    values = _values(arrays, layout)
    frames, count = values.shape[-2:]
    t = _axis(arrays, layout.time, _TIMES, frames, layout.interval, 0.0, "times", "interval")
    x = _axis(
        arrays, layout.positions, _POSITIONS, count, layout.spacing, layout.first, "positions",
        "spacing",
    )  # fmt: skip
    swapped = np.swapaxes(values, -1, -2)
    if t is None or x is None:
        frames, count = swapped.shape[-2:]
        t2 = _axis(arrays, layout.time, _TIMES, frames, layout.interval, 0.0, "times", "interval")
        x2 = _axis(
            arrays, layout.positions, _POSITIONS, count, layout.spacing, layout.first,
            "positions", "spacing",
        )  # fmt: skip
        if t2 is not None and x2 is not None:
            values, t, x = swapped, t2, x2
    if t is None or x is None:
        what, name, option = (
            ("times", "time", "interval") if t is None else ("positions", "positions", "spacing")
        )
        raise RecordError(
            f"no {what} of {values.shape[-2 if t is None else -1]} entries for a record of shape "
            f"{values.shape}; arrays are {_listed(arrays)}: name them with --{name}, or give "
            f"--{option}"
        )
    quiet = layout.quiet_from
    if quiet is None:
        quiet = float(arrays["quiet_from"]) if _scalar(arrays, "quiet_from") else float(t[0])
    sources = list(layout.sources)
    if not sources and "sources" in arrays:
        sources = [float(s) for s in np.atleast_1d(arrays["sources"])]
    flags = {name: bool(arrays[name]) if _scalar(arrays, name) else False
             for name in ("ring", "lattice")}  # fmt: skip
    return record(
        values,
        t,
        x,
        ring=layout.ring or flags["ring"],
        quiet_from=quiet,
        sources=sources,
        answer=truth or None,
        lattice=layout.lattice or flags["lattice"],
    )


def _scalar(arrays: dict[str, Float], name: str) -> bool:
    return name in arrays and np.size(arrays[name]) == 1


def _listed(arrays: dict[str, Float]) -> str:
    return ", ".join(f"{name} {np.shape(a)}" for name, a in arrays.items()) or "none"


def _named(arrays: dict[str, Float], name: str) -> Float:
    if name not in arrays:
        raise RecordError(f"has no array {name!r}; arrays are {_listed(arrays)}")
    return np.asarray(arrays[name])


def _values(arrays: dict[str, Float], layout: Layout) -> Float:
    if layout.values is not None:
        values = _named(arrays, layout.values)
    else:
        candidates = [a for a in arrays.values() if np.ndim(a) in (2, 3)]
        if not candidates:
            raise RecordError(
                f"holds no array of two axes, times and receivers; arrays are {_listed(arrays)}"
            )
        values = max(candidates, key=np.size)
        equal = sum(a.shape == values.shape for a in candidates)
        if equal > 1:
            raise RecordError(
                f"holds {equal} arrays of shape {values.shape}; name one with --values: "
                f"{_listed(arrays)}"
            )
    if values.ndim not in (2, 3):
        raise RecordError(f"values of shape {values.shape}: must have two or three axes")
    return np.asarray(values, float)


def _axis(
    arrays: dict[str, Float],
    name: str | None,
    usual: Sequence[str],
    count: int,
    step: float | None,
    first: float,
    what: str,
    option: str,
) -> Float | None:
    """Times or positions: by name given, by spacing given, by usual name, or by shape."""
    if name is not None:
        found = _named(arrays, name).ravel()
        return np.asarray(found, float) if len(found) == count else None
    if step is not None:
        if not step > 0:
            raise RecordError(f"{option} = {step:g}: must be greater than 0")
        return first + step * np.arange(count)
    for key, array in arrays.items():
        if key.lower().rsplit("/", 1)[-1] in usual and np.shape(array) == (count,):
            return np.asarray(array, float)
    return None


def write(path: str | Path, saved: Record) -> None:
    """Write a record, with its truth where it has one.

    Args:
        path: .npz for everything, or .csv for times and receivers alone.
        saved: the record; of one component for .csv.

    Raises:
        RecordError: the suffix is another, or the file can't be written.
    """
    path = Path(path)
    values = saved.values[0] if len(saved.values) == 1 else saved.values
    try:
        if path.suffix == ".npz":
            truth = {f"{_TRUTH}{name}": a for name, a in (saved.answer or {}).items()}
            np.savez_compressed(
                path,
                t=saved.t,
                x=saved.x,
                values=values,
                quiet_from=saved.quiet_from,
                sources=np.array(saved.sources),
                ring=saved.ring,
                lattice=saved.lattice,
                **truth,
            )
        elif path.suffix == ".csv" and values.ndim == 2:
            heading = ",".join(["t_s", *(f"x={x:.9g}" for x in saved.x)])
            table = np.column_stack([saved.t, values])
            formats = ["%.15g"] + ["%.9g"] * len(saved.x)
            np.savetxt(path, table, formats, ",", header=heading, comments="")
        else:
            raise RecordError(f"{path}: must end in .npz, or in .csv for one component")
    except OSError as error:
        raise RecordError(f"{path}: can't be written: {error.strerror}") from None
