"""NumPy's own files: .npz with named arrays, .npy with one."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from wavesim.records.content import Content, RecordError, check_size, without_single_axes
from wavesim.records.units import measured_by


def from_npz(path: Path) -> Content:
    """Arrays of an .npz, or the one of an .npy; columns of structured ones by name."""
    content = Content({})
    if not zipfile.is_zipfile(path):
        with path.open("rb") as file:
            check_size(_shape(file), "values")
        _take(content, "values", np.load(path, allow_pickle=False))
        return content
    for name, shape in _shapes(path).items():
        check_size(shape, name)
    with np.load(path, allow_pickle=False) as loaded:
        for name in loaded.files:
            _take(content, name, loaded[name])
    return content


def _shapes(path: Path) -> dict[str, tuple[int, ...]]:
    with zipfile.ZipFile(path) as folder:
        found = {}
        for name in folder.namelist():
            if name.endswith(".npy"):
                with folder.open(name) as file:
                    found[name[:-4]] = _shape(file)
        return found


def _shape(file: Any) -> tuple[int, ...]:
    from numpy.lib import format as layout

    major, _ = layout.read_magic(file)
    read = layout.read_array_header_1_0 if major == 1 else layout.read_array_header_2_0
    return tuple(read(file)[0])


def _take(content: Content, name: str, array: Any) -> None:
    if not isinstance(array, np.ndarray):
        raise RecordError(f"can't be read as NumPy's: {name!r} in it is no array")
    array = without_single_axes(array)
    if array.dtype.names:
        for column in array.dtype.names:
            _take(content, column if name == "values" else f"{name}/{column}", array[column])
    elif array.dtype.kind in "US" and array.size == 1:
        # Units as text: t_unit = "us".
        if of := measured_by(name):
            content.units[of] = str(array.ravel()[0])
    elif array.dtype.kind in "fiubcmM" and array.ndim <= 3:
        content.arrays[name] = array
