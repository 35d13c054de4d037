"""MATLAB's files before version 7.3, by scipy; structures are taken apart."""

from __future__ import annotations

import contextlib
import multiprocessing
from pathlib import Path
from typing import Any

import numpy as np

from wavesim.records.content import Content, RecordError, check_size, without_single_axes
from wavesim.records.units import measured_by

_DEEPEST = 4


def from_matlab(path: Path) -> Content:
    """Every array of numbers in a .mat file, with names as structure.field."""
    # Damage may end the process that reads it, as compiled code does: try it in another.
    if "fork" in multiprocessing.get_all_start_methods():
        trial = multiprocessing.get_context("fork").Process(target=_tried, args=(path,))
        trial.start()
        trial.join()
        if (trial.exitcode or 0) < 0:
            raise RecordError("can't be read as MATLAB's: it is damaged; save it again")
    content = Content({})
    for name, value in _loaded(path).items():
        if not name.startswith("__"):
            _take(content, name, value, 0)
    return content


def _loaded(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat, whosmat

    for name, shape, _ in whosmat(path):
        check_size(shape, name)
    return dict(loadmat(path, squeeze_me=False, struct_as_record=True))


def _tried(path: Path) -> None:
    with contextlib.suppress(Exception):  # which the reader tells of
        _loaded(path)


def _take(content: Content, name: str, value: Any, depth: int) -> None:
    array = without_single_axes(np.asarray(value))
    if array.dtype.names and depth < _DEEPEST:
        if array.size == 1:
            for key in array.dtype.names:
                _take(content, f"{name}.{key}", array.ravel()[0][key], depth + 1)
        else:  # an array of structures: receivers with a signal each
            for key in array.dtype.names:
                _beside(content, f"{name}.{key}", [one[key] for one in array.ravel()], depth)
    elif array.dtype == object and array.size == 1 and depth < _DEEPEST:
        _take(content, name, array.ravel()[0], depth + 1)
    elif array.dtype == object and array.size and depth < _DEEPEST:  # cells: a receiver each
        own = [np.asarray(one).dtype.names for one in array.ravel()]
        for key in own[0] or ():
            if all(names and key in names for names in own):
                fields = [np.asarray(one)[key].ravel()[0] for one in array.ravel()]
                _beside(content, f"{name}.{key}", fields, depth)
        if not any(own):
            _beside(content, name, list(array.ravel()), depth)
    elif array.dtype.kind in "US" and array.size == 1:
        if of := measured_by(name):
            content.units[of] = str(array.ravel()[0])
    elif array.dtype.kind in "fiubc" and array.ndim <= 3:
        content.arrays[name] = array.ravel() if array.ndim == 2 and 1 in array.shape else array


def _beside(content: Content, name: str, parts: list[Any], depth: int) -> None:
    """Arrays of numbers of one shape, side by side."""
    arrays = [np.asarray(part).squeeze() for part in parts]
    if arrays[0].dtype.kind in "fiu" and len({one.shape for one in arrays}) == 1:
        _take(content, name, np.stack(arrays, axis=-1 if arrays[0].ndim else 0), depth + 1)
