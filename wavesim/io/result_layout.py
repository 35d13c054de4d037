"""Where what is no frame stands in result.h5: axes, series, sources, what to carry on from."""

from __future__ import annotations

import functools
import importlib.metadata
from collections.abc import Mapping, Sequence
from typing import Any

import h5py
import numpy as np

from wavesim.io.packing import put
from wavesim.material.family import is_macro, known_field
from wavesim.simulation.simulation import Simulation
from wavesim.sources import parameters

FORMAT_VERSION = 1
FOURIER_CONVENTION = "exp(i(kx - omega t)), angular omega in rad/s"
_VERSIONED = ("wavesim", "jax", "diffrax", "numpy")


@functools.cache
def versions() -> dict[str, str]:
    """Versions of wavesim and of what its results depend on."""
    return {name: importlib.metadata.version(name) for name in _VERSIONED}


def lay_out(
    file: h5py.File,
    simulation: Simulation,
    told: dict[str, Any],
    frames: int,
    series: Mapping[str, np.ndarray],
    ends: Sequence[int],
    state: Sequence[np.ndarray],
) -> None:
    """Everything but the fields and what was measured.

    Args:
        file: a new one.
        simulation: what is run.
        told: attributes of the file.
        frames: stored so far.
        series: of energy and at receivers, by path, shape (frames,).
        ends: frames that the parts end before.
        state: arrays to carry on from.
    """
    axes = {"t": simulation.times[:frames]}
    axes |= dict(axis(simulation, name) for name in simulation.fields)
    file.attrs.update(
        {
            "format": "wavesim",
            "format_version": FORMAT_VERSION,
            "fourier_convention": FOURIER_CONVENTION,
        }
        | told
        | versions()
    )
    for name, values in axes.items():
        put(file, name, values, "s" if name == "t" else "m")
        file[name].make_scale(name)
    units = {name: known_field(name).unit for name in simulation.fields}
    for name, values in series.items():
        put(file, name, values, units.get(name.rpartition("/")[2], "J/m²"))
        file[name].dims[0].attach_scale(file["t"])
    file["energy/t"] = h5py.SoftLink("/t")
    for receiver, position in simulation.receivers.items():
        file[f"receivers/{receiver}"].attrs["position"] = position
    _sources(file.create_group("source"), simulation)
    file["restart/ends"] = np.array(ends, np.int64)
    for number, array in enumerate(state):
        put(file, f"restart/state/{number}", np.asarray(array), "")


def axis(simulation: Simulation, name: str) -> tuple[str, np.ndarray]:
    """Where a field lives: name of the scale, and positions in m."""
    bar = simulation.bar
    return ("x", bar.nodes) if is_macro(name) else ("x_half", bar.half_nodes)


def label(file: h5py.File, simulation: Simulation, name: str, data: h5py.Dataset) -> None:
    """Give a field its unit and its axes."""
    data.attrs["units"] = known_field(name).unit
    data.dims[0].attach_scale(file["t"])
    data.dims[1].attach_scale(file[axis(simulation, name)[0]])


def _sources(group: h5py.Group, simulation: Simulation) -> None:
    t = simulation.times
    for number, source in enumerate(simulation.sources):
        entry = group.create_group(str(number))
        entry.attrs["kind"] = source.kind
        for name, value in parameters(source).items():
            if isinstance(value, tuple):  # longer than an attribute may be
                entry[name] = value
            else:
                entry.attrs[name] = value
        put(entry, "t", t, "s")
        put(entry, "signal", source.signal(t), "")


def attach_axes(file: h5py.File) -> None:
    """Make k and ω the axes of each spectrum."""
    for group in file.get("dispersion", {}).values():
        for number, name in enumerate(("k", "omega")):
            group[name].make_scale(name)
            group["power"].dims[number].attach_scale(group[name])
