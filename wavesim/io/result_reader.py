"""Reading result files."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from wavesim.simulation.field import Energy, Field
from wavesim.simulation.simulation import Simulation

T = TypeVar("T")
# So often may a run put a newer file in place of one that is being read.
_TRIES = 5


class StorageError(RuntimeError, ValueError):
    """A file is not what it should be; the message says which and why."""


class WriteError(StorageError):
    """A file can't be written; the message says why, what is stored, and how to go on."""

    code = 3  # that a command ends with


def stored(path: Path) -> None:
    """Make sure that there is something to carry on from.

    Raises:
        StorageError: there is not.
    """
    if not path.is_file():
        told = "no such file: nothing is stored to carry on from; run without --resume"
        raise StorageError(f"{path}: {told}")


@contextmanager
def reading(path: Path, what: str = "") -> Iterator[h5py.File]:
    """A result file, opened; whatever the library stumbles over is told as damage.

    Raises:
        StorageError: it is not there, not of wavesim, or damaged.
    """
    if not path.is_file():
        raise StorageError(f"{path}: no such file; run the case first")
    try:
        file = h5py.File(path, "r")
    except (OSError, RuntimeError, ValueError) as error:
        raise StorageError(f"{path}: is not a readable HDF5 file: {_first(error)}") from None
    try:
        if file.attrs.get("format") != "wavesim":
            raise StorageError(f"{path}: is not a result of wavesim (attribute format)")
        yield file
    except StorageError:
        raise
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
        part = f"{what}: " if what else ""
        raise StorageError(
            f"{path}: {part}damaged: {_first(error)}; run the case again, or take a whole copy"
        ) from None
    finally:
        with suppress(OSError, RuntimeError):
            file.close()


def _first(error: Exception) -> str:
    return str(error).partition("\n")[0]


# What the library keeps for itself, references among them.
_OF_THE_LIBRARY = ("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST")
CHECKSUM = "sha256"


def checksum(file: h5py.File) -> str:
    """SHA-256 of what HDF5 itself has no checksum of: attributes, as texts among them, and single
    numbers and other arrays that are not stored in chunks."""
    found = hashlib.sha256()

    def add(name: str, item: Any) -> None:
        for key in sorted(item.attrs):
            if key not in (*_OF_THE_LIBRARY, CHECKSUM):
                found.update(f"{name}\0{key}\0{item.attrs[key]!r}\0".encode(errors="replace"))
        if hasattr(item, "chunks") and not (item.chunks or item.is_virtual):
            value = item[()]
            found.update(value if isinstance(value, bytes) else np.asarray(value).tobytes())

    add("", file)
    file.visititems(add)
    return found.hexdigest()


def hold(path: Path, file: h5py.File) -> None:
    """Hold a file's attributes and single numbers to their checksum, where it has one."""
    stored = file.attrs.get(CHECKSUM)
    if stored is not None and stored != checksum(file):
        raise StorageError(
            f"{path}: damaged: its attributes (case, units, names) or single numbers are not those "
            "that were written; run the case again, or take a whole copy"
        )


def _looked_up(path: Path, what: str, look: Callable[[h5py.File], T]) -> T:
    """What is found in a file; once more where a run has put a newer one in its place meanwhile.

    When a run ends the parts that an older file presents are taken away, and HDF5 gives zeros for
    parts that are not there: so these are looked for once all has been read.
    """
    for _ in range(_TRIES):
        known = _identity(path)
        try:
            with reading(path, what) as file:
                found = look(file)
                _hold_parts(path, file)
                return found
        except StorageError:
            if _identity(path) == known:
                raise
    raise StorageError(f"{path}: is being written anew all the time; wait until the run has ended")


def _identity(path: Path) -> tuple[int, int]:
    try:
        found = path.stat()
    except OSError:
        return 0, 0
    return found.st_ino, found.st_mtime_ns


class _Lazy:
    """A data set of which is read what is asked for: of so many frames, whatever is added to it."""

    def __init__(self, path: Path, name: str, frames: int) -> None:
        self._path, self._name, self._frames = path, name, frames

    def __getitem__(self, key: Any) -> np.ndarray:
        first, *rest = key if isinstance(key, tuple) and key else (key,)
        if first is Ellipsis or (isinstance(first, tuple) and not first):
            first = slice(None)
        if isinstance(first, slice) and (first.step or 1) > 0:
            first = slice(*first.indices(self._frames))
        elif isinstance(first, int | np.integer) and first < 0:
            first += self._frames
        elif isinstance(first, np.ndarray) and first.dtype.kind == "b":
            first = np.flatnonzero(first)

        def look(file: h5py.File) -> np.ndarray:
            stored = file[self._name]
            try:
                return np.asarray(stored[(first, *rest)])
            except (TypeError, ValueError):  # HDF5 goes forward alone, NumPy any way
                return np.asarray(stored[: self._frames][(first, *rest)])

        return _looked_up(self._path, self._name, look)

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray:
        return np.asarray(self[()], dtype=dtype)


@dataclass(frozen=True)
class Stored:
    """What a result file says of itself.

    Attributes:
        case: the resolved case, TOML.
        status: running, complete or failed.
        frames: number of frames in it.
    """

    case: str
    status: str
    frames: int


def describe(path: Path) -> Stored:
    """What a result file says of itself.

    Raises:
        StorageError: it is not a result of wavesim.
    """
    with reading(path) as file:
        hold(path, file)
        return Stored(str(file.attrs["case"]), str(file.attrs["status"]), len(file["t"]))


def read(path: Path, simulation: Simulation) -> Field:
    """The field of a result file; its arrays are read when they are indexed.

    Args:
        path: of result.h5.
        simulation: of its case, as built from :func:`describe`.

    Raises:
        StorageError: it is not a result of wavesim, or holds fewer than two frames.
    """

    def look(file: h5py.File) -> tuple[np.ndarray, Energy, str, float]:
        t = file["t"][()]
        if len(t) < 2:
            raise StorageError(f"{path}: holds {len(t)} frames; at least 2 are needed")
        names = [part.name for part in fields(Energy)]
        energy = Energy(**{name: file[f"energy/{name}"][: len(t)] for name in names})
        return t, energy, str(file.attrs["stepper"]), float(file.attrs["step"])

    t, energy, stepper, step = _looked_up(path, "", look)
    values = {name: _Lazy(path, f"fields/{name}", len(t)) for name in simulation.fields}
    return Field(simulation, t, values, energy, stepper, step)


def _hold_parts(path: Path, file: h5py.File) -> None:
    """Refuse a file of a run that has not ended without the parts that it presents."""
    for stored in file["fields"].values():
        if not stored.is_virtual:
            continue
        for name in sorted({source.file_name for source in stored.virtual_sources()} - {"."}):
            if not (path.parent / name).is_file():
                raise StorageError(
                    f"{path}: its part {name} is not beside it: a run that has not ended lies in "
                    "more files than result.h5; copy the whole folder"
                )


def is_result(path: Path) -> bool:
    """Whether a file is HDF5 that wavesim wrote."""
    try:
        with h5py.File(path, "r") as file:
            return bool(file.attrs.get("format") == "wavesim")
    except (OSError, RuntimeError, KeyError, ValueError):
        return False
