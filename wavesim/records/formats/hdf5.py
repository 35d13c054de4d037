"""HDF5 of any layout, and MATLAB's files of version 7.3, which are HDF5."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import LARGEST, Content
from wavesim.records.straight_line import along_line
from wavesim.records.units import measured_by


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
    return content


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
