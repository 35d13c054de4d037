"""HDF5 of any layout, and MATLAB's files of version 7.3, which are HDF5."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.axes import TIMES, bare
from wavesim.records.content import LARGEST, Content
from wavesim.records.straight_line import along_line
from wavesim.records.units import measured_by, position_in


def from_hdf5(path: Path) -> Content:
    """Every array in the file; receivers that are groups with a position (gprMax) as one array."""
    from wavesim.io.hdf5_arrays import read_arrays

    stored = read_arrays(path, LARGEST)
    said = {of: text for path, text in stored.texts.items() if (of := measured_by(path))}
    # Numbers that are attributes have no path.
    said |= {of.rsplit("/", 1)[-1]: text for of, text in said.items()}
    content = Content(dict(stored.arrays), said | stored.units)
    for name, number in stored.numbers.items():
        content.arrays.setdefault(name, np.array(number))
    _of_groups(stored.places, content)
    _of_channels(stored.own, content)
    return content


def _of_channels(own: dict[str, dict[str, float]], content: Content) -> None:
    """Arrays of one axis in the order of the numbers in their names, as HDF5 lists 1, 10, 2; each
    named by the position that an attribute of its own, or of its group, says."""
    by_number = sorted(content.arrays, key=lambda name: [
        (int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)
    ])  # fmt: skip
    content.arrays = {name: content.arrays[name] for name in by_number}
    said = {name: own.get(name, {}) | own.get(name.rpartition("/")[0], {}) for name in by_number}
    said = {name: keys for name, keys in said.items()
            if keys and content.arrays[name].ndim == 1 and bare(name) not in TIMES}  # fmt: skip
    shared = set.intersection(*map(set, said.values())) if len(said) > 1 else set()
    # The same for all is no place, and of two that differ nothing says which is.
    named = [key for key in sorted(shared) if position_in(f"{key}=1")
             and len({keys[key] for keys in said.values()}) == len(said)]  # fmt: skip
    if len(named) == 1:
        key, unit = named[0], content.units.get(named[0], "")
        place = {
            name: f"{name} {key}={keys[key]:.17g} {unit}".strip() for name, keys in said.items()
        }
        content.arrays = {place.get(name, name): a for name, a in content.arrays.items()}


def _of_groups(places: dict[str, NDArray[Any]], content: Content) -> None:
    """Groups with a position each, with signals of the same names: an array for each name."""
    groups = [name for name in places if any(a.startswith(f"{name}/") for a in content.arrays)]
    if not groups:
        return
    inside = [
        {a[len(name) + 1 :] for a in content.arrays if a.startswith(f"{name}/")}
        for name in groups
    ]  # fmt: skip
    shared = sorted(set.intersection(*inside))
    spots = np.stack([np.resize(places[name], 3) if places[name].size == 3
                      else np.r_[places[name], np.zeros(3 - places[name].size)]
                      for name in groups])  # fmt: skip
    x, said = along_line(spots, "groups' positions: ")
    content.notes += [said] if said else []
    stacked = {}
    for name in shared:
        signals = [content.arrays[f"{group}/{name}"] for group in groups]
        if signals[0].ndim == 1 and len({s.shape for s in signals}) == 1:
            stacked[name] = np.stack(signals, axis=1)
    if not stacked:
        return
    for group in groups:
        for name in shared:
            content.arrays.pop(f"{group}/{name}", None)
    driven = {n: a for n, a in stacked.items() if np.any(a)}
    content.arrays |= driven or stacked
    content.arrays["positions"] = x
    content.units["positions"] = "m"
    content.labels = tuple(group.rsplit("/", 1)[-1] for group in groups)
