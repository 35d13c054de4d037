"""The arrays of any HDF5 file, with the units and numbers that its attributes say.

MATLAB's files of version 7.3 are HDF5 too, and so is netCDF 4.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

_UNITS = ("units", "unit", "Units", "Unit", "UNITS", "UNIT")
# What MATLAB keeps beside the variables.
_INTERNAL = ("#refs#", "#subsystem#")


@dataclass
class Stored:
    """What an HDF5 file holds.

    Attributes:
        arrays: by path, up to three axes, those of one entry not counted.
        units: of arrays, where an attribute says one.
        texts: attributes that are one text, by path, those named a unit left out.
        numbers: attributes that are one number, by name, of the file and its groups.
        own: attributes that are one number, of each array and group, by path and by name.
        places: positions of groups that say one (gprMax's receivers), by path, 2 or 3 numbers each.
    """

    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    own: dict[str, dict[str, float]] = field(default_factory=dict)
    places: dict[str, NDArray[Any]] = field(default_factory=dict)


def is_hdf5(path: Path) -> bool:
    """Whether a file can be opened as HDF5."""
    try:
        with h5py.File(path, "r") as file:
            list(file)
    except (OSError, RuntimeError, KeyError, ValueError):
        return False
    return True


def read_arrays(path: Path, largest: int) -> Stored:
    """Every array of numbers in an HDF5 file.

    Raises:
        OSError: it can't be read as HDF5.
        ValueError: an array is larger.
    """
    found = Stored()

    def keep(name: str, item: Any) -> None:
        if name.startswith(_INTERNAL):
            return
        for key, value in item.attrs.items():
            _attribute(found, name, key, value)
        if not isinstance(item, h5py.Dataset) or item.shape is None:
            return
        if h5py.check_ref_dtype(item.dtype) is h5py.Reference:
            parts = _referred(item, largest)
            if parts is not None:
                found.arrays[name] = parts
            return
        if item.attrs.get("MATLAB_class") in (b"char", b"function_handle"):
            return
        kind = item.dtype.kind
        if kind == "V" and item.dtype.names and set(item.dtype.names) == {"real", "imag"}:
            kind = "c"  # as MATLAB stores complex numbers
        if kind not in "fiubcV":
            return
        if np.sum(np.array(item.shape) != 1) > 3:
            return
        if item.size > largest:
            raise ValueError(
                f"array {name!r} of shape {item.shape}: more than {largest:,} samples; cut the "
                "record, or take fewer samples a second"
            )
        values = item[()]
        if kind == "c" and values.dtype.names:
            values = values["real"] + 1j * values["imag"]
        if values.dtype.names:
            for column in values.dtype.names:
                if values[column].dtype.kind in "fiub":
                    found.arrays[f"{name}/{column}"] = np.asarray(values[column])
            return
        found.arrays[name] = np.squeeze(values) if np.ndim(values) > 3 else np.asarray(values)

    with h5py.File(path, "r") as file:
        for key, value in file.attrs.items():
            _attribute(found, "", key, value)
        file.visititems(keep)
    return found


def _referred(item: h5py.Dataset, largest: int) -> NDArray[Any] | None:
    """What a cell array, or a field of an array of structures, of MATLAB's refers to, side by side
    along the last axis; None where that is not numbers of one shape."""
    parts = [item.file[one] for one in item[()].ravel() if one]
    alike = len({one.shape for one in parts if isinstance(one, h5py.Dataset)}) == 1
    if not alike or not all(isinstance(one, h5py.Dataset) for one in parts):
        return None
    first = parts[0]
    text = first.attrs.get("MATLAB_class") == b"char"
    if first.dtype.kind not in "fiu" or text or first.size * len(parts) > largest:
        return None
    return np.stack([np.squeeze(one[()]) for one in parts], axis=-1)


def _attribute(found: Stored, name: str, key: str, value: Any) -> None:
    if isinstance(value, h5py.Empty):
        return
    numbers = np.asarray(value)
    if numbers.dtype.kind not in "fiu":
        one = numbers.ravel()[0] if numbers.size == 1 else value
        text = one.decode("utf-8", "replace") if isinstance(one, bytes) else str(one)
        if key in _UNITS:
            found.units[name] = text
        else:
            found.texts[f"{name}/{key}" if name else key] = text
        return
    if name and numbers.size == 1:
        found.own.setdefault(name, {})[key] = float(numbers.ravel()[0])
    if key.lower() in ("position", "location", "coordinates") and 2 <= numbers.size <= 3:
        found.places[name] = numbers.astype(float).ravel()
    elif numbers.size == 1 and key.isidentifier():
        found.numbers.setdefault(key, float(numbers.ravel()[0]))
