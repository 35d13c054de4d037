"""netCDF, and xarray's arrays: coordinates with units, dimensions with names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from wavesim.records.content import Content, RecordError, check_size
from wavesim.records.units import factor, is_time, unit_in

_PLACES = ("x", "distance", "dist", "position", "offset", "receiver", "channel", "trace", "r", "z")


def from_netcdf(path: Path) -> Content:
    """Variables of a netCDF file, times first; by xarray, with h5netcdf or scipy."""
    import xarray

    from wavesim.io.hdf5_arrays import is_hdf5

    with path.open("rb") as file:
        classic = file.read(3) == b"CDF"
    if not classic and not is_hdf5(path):
        raise RecordError("can't be read as netCDF: it is neither of version 3 nor of version 4")
    options: dict[str, Any] = {"engine": "scipy", "mmap": False} if classic else {}
    options = options or {"engine": "h5netcdf"}
    with xarray.open_dataset(path, decode_timedelta=False, **options) as found:
        return of_dataset(found)


def of_dataset(dataset: Any) -> Content:
    """Variables of an xarray Dataset or DataArray, times first."""
    if not hasattr(dataset, "data_vars"):
        dataset = dataset.to_dataset(name=dataset.name or "values")
    content = Content({})
    for name, variable in dataset.variables.items():
        if variable.dtype.kind not in "fiubcmM" or variable.ndim > 3:
            continue
        check_size(variable.shape, str(name))
        values, dims = np.asarray(variable.values), [str(d) for d in variable.dims]
        times = [d for d in dims if _of_time(dataset, d)]
        if variable.ndim in (2, 3) and len(times) == 1:
            values = np.moveaxis(values, dims.index(times[0]), -2)
            content.notes.append(f"{name}: times along its dimension {times[0]!r}")
        content.arrays[str(name)] = values
        unit = variable.attrs.get("units", variable.attrs.get("unit"))
        long = str(variable.attrs.get("long_name", ""))
        unit = unit or unit_in(long, "time") or unit_in(long, "position")
        if unit is not None:
            content.units[str(name)] = str(unit)
    for key, value in dataset.attrs.items():
        number = np.asarray(value)
        if number.dtype.kind in "fiu" and number.size == 1:
            content.arrays.setdefault(str(key), number.reshape(()))
    content.notes = list(dict.fromkeys(content.notes))[:1]
    return content


def _of_time(dataset: Any, dimension: str) -> bool:
    if is_time(dimension):
        return True
    if dimension.lower() in _PLACES or dimension not in dataset.variables:
        return False
    own = dataset[dimension]
    return own.dtype.kind in "mM" or factor(own.attrs.get("units"), "time") is not None
