"""result.h5: written chunk by chunk, readable at any moment of a run and after a crash.

The only importer of h5py. Frames are appended in HDF5's single-writer-multiple-reader mode, and
the file is closed between chunks: a reader sees whole chunks, and a run that is killed leaves a
file that opens. The state to carry on from is kept in two slots in turn, so that one is whole.
"""

from __future__ import annotations

import datetime
import importlib.metadata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from wavesim.equations import ROTATIONS, UNITS
from wavesim.field import Energy, Field
from wavesim.plan import Plan
from wavesim.problem import Problem
from wavesim.verdict import Held

FORMAT_VERSION = 1
FOURIER_CONVENTION = "exp(i(kx - omega t)), angular omega in rad/s"
_VERSIONED = ("wavesim", "jax", "diffrax", "numpy")
_COMPRESSED: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
_CHUNK_POINTS = 16384
_ENERGIES = ("kinetic", "potential", "work", "total")


class StorageError(RuntimeError):
    """A file can't be written or is not what it should be; the message says which and why."""


def versions() -> dict[str, str]:
    """Versions of wavesim and of what its results depend on."""
    return {name: importlib.metadata.version(name) for name in _VERSIONED}


class Results:
    """Writer of one result.h5.

    Args:
        path: of the file.
        problem: what is run.
    """

    def __init__(self, path: Path, problem: Problem) -> None:
        self.path, self.problem = path, problem

    def create(self, state: Sequence[np.ndarray]) -> None:
        """Begin a new file, replacing an old one.

        Args:
            state: arrays like those of the state to carry on from.

        Raises:
            StorageError: the file can't be written.
        """
        try:
            with h5py.File(self.path, "w", libver="latest") as file:
                self._lay_out(file, state)
        except OSError as error:
            raise StorageError(f"{self.path}: can't be written: {error}") from None

    def _lay_out(self, file: h5py.File, state: Sequence[np.ndarray]) -> None:
        settled = self.problem.plan
        file.attrs.update(
            {
                "format": "wavesim",
                "format_version": FORMAT_VERSION,
                "status": "running",
                "title": self.problem.case.title,
                "case": self.problem.resolved,
                "created_utc": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
                "fourier_convention": FOURIER_CONVENTION,
            }
            | versions()
        )
        bar, names = settled.bar, settled.fields
        file["x"], file["x_half"] = bar.nodes, bar.half_nodes
        file.create_dataset("t", (0,), maxshape=(None,), dtype=float, chunks=(4096,))
        for name, unit in (("t", "s"), ("x", "m"), ("x_half", "m")):
            file[name].make_scale(name)
            file[name].attrs["units"] = unit
        width = min(bar.cells, 1024)
        for name in names:
            data = file.create_dataset(
                f"fields/{name}",
                (0, bar.cells),
                maxshape=(None, bar.cells),
                dtype=float,
                chunks=(max(1, min(64, _CHUNK_POINTS // width)), width),
                **_COMPRESSED,
            )
            data.attrs["units"] = UNITS[name]
            data.dims[0].attach_scale(file["t"])
            data.dims[1].attach_scale(file["x" if name in ROTATIONS else "x_half"])
        series = [(f"energy/{part}", "J/m²") for part in _ENERGIES]
        for receiver in self.problem.receivers:
            series += [(f"receivers/{receiver}/{name}", UNITS[name]) for name in names]
        for name, unit in series:
            data = file.create_dataset(name, (0,), maxshape=(None,), dtype=float, chunks=(4096,))
            data.attrs["units"] = unit
            data.dims[0].attach_scale(file["t"])
        file["energy/t"] = h5py.SoftLink("/t")
        for receiver, position in self.problem.receivers.items():
            file[f"receivers/{receiver}"].attrs["position"] = position
        self._sources(file.create_group("source"), settled)
        for slot in ("0", "1"):
            group = file.create_group(f"restart/{slot}")
            group["frame"] = -1
            for number, array in enumerate(state):
                group.create_dataset(str(number), array.shape, dtype=float)

    def _sources(self, group: h5py.Group, settled: Plan) -> None:
        t = settled.times
        for number, source in enumerate(settled.sources):
            entry = group.create_group(str(number))
            entry.attrs.update(
                {
                    "kind": "ricker",
                    "field": source.field,
                    "position": source.position,
                    "peak_frequency": source.peak_frequency,
                    "amplitude": source.amplitude,
                    "width": source.width,
                    "delay": source.peak_time,
                }
            )
            entry["t"], entry["signal"] = t, source.signal(t)

    def append(
        self, first: int, values: dict[str, np.ndarray], energy: Energy, state: Sequence[np.ndarray]
    ) -> None:
        """Append frames and the state after them.

        Args:
            first: index of the first frame.
            values: {field: (frames, N)}, SI.
            energy: of these frames.
            state: arrays to carry on from after the last of them.

        Raises:
            StorageError: the file can't be written (a full disk, say).
        """
        end = first + len(energy.work)
        series = {f"energy/{part}": getattr(energy, part) for part in _ENERGIES}
        bar = self.problem.plan.bar
        for name, data in values.items():
            series[f"fields/{name}"] = data
            for receiver, position in self.problem.receivers.items():
                weights, indices = bar.sampling(position, name not in ROTATIONS)
                series[f"receivers/{receiver}/{name}"] = data[:, indices] @ weights
        try:
            with h5py.File(self.path, "r+", libver="latest") as file:
                file.swmr_mode = True
                for name, data in series.items():
                    file[name].resize(end, axis=0)
                    file[name][first:end] = data
                file["t"].resize(end, axis=0)
                file["t"][first:end] = self.problem.plan.times[first:end]
                slots = [file["restart/0"], file["restart/1"]]
                slot = min(slots, key=lambda s: int(s["frame"][()]))
                slot["frame"][()] = -1
                file.flush()
                for number, array in enumerate(state):
                    slot[str(number)][...] = array
                file.flush()
                slot["frame"][()] = end - 1
        except OSError as error:
            raise StorageError(f"{self.path}: can't be written: {error}") from None

    def carry_on(self) -> tuple[int, list[np.ndarray]]:
        """Last whole state of an interrupted run of the same case.

        Returns:
            Its frame and its arrays.

        Raises:
            StorageError: there is no such run, it was another case, or it has no whole state.
        """
        with _reading(self.path) as file:
            if file.attrs["case"] != self.problem.resolved:
                raise StorageError(
                    f"{self.path}: was made by another case than this; run without --resume, or "
                    "name another folder with --out"
                )
            slots = [file["restart/0"], file["restart/1"]]
            slot = max(slots, key=lambda s: int(s["frame"][()]))
            frame = int(slot["frame"][()])
            if frame < 0:
                raise StorageError(f"{self.path}: holds no state to resume; run without --resume")
            return frame, [slot[str(n)][()] for n in range(len(slot) - 1)]

    def status(self, status: str) -> None:
        """Set the file's status: running, complete or failed."""
        with h5py.File(self.path, "r+", libver="latest") as file:
            file.attrs["status"] = status

    def record(self, held: Sequence[Held]) -> None:
        """Store what was measured, beside the theory."""
        with h5py.File(self.path, "r+", libver="latest") as file:
            for group in ("dispersion", "attenuation"):
                if group in file:
                    del file[group]
            for h in held:
                _record_dispersion(file, h)
                if h.k_exact is not None:
                    _record_attenuation(file, h)


def _put(group: h5py.Group, name: str, data: Any, unit: str) -> None:
    group.create_dataset(name, data=data)
    group[name].attrs["units"] = unit


def _record_dispersion(file: h5py.File, held: Held) -> None:
    block, found = held.measured.block, held.measured.spectrum
    group = file.require_group(f"dispersion/{block.sector}")
    if "power" in group:
        # Blocks of one sector share the axes; their powers add.
        size = min(len(group["omega"]), len(found.omega))
        group["power"][:, :size] += found.power[:, :size]
    else:
        _put(group, "k", found.k, "rad/m")
        _put(group, "omega", found.omega, "rad/s")
        group.create_dataset("power", data=found.power, **_COMPRESSED)
        group["power"].attrs["units"] = "relative to the strongest of its block"
        for axis, name in enumerate(("k", "omega")):
            group[name].make_scale(name)
            group["power"].dims[axis].attach_scale(group[name])
    for branch in held.branches:
        entry = group.create_group(f"branches/{branch.name}")
        _put(entry, "k", branch.k, "rad/m")
        _put(entry, "omega", branch.omega, "rad/s")
        _put(entry, "omega_exact", branch.omega_exact, "rad/s")
        _put(entry, "judged", branch.judged, "–")
    for number, stray in enumerate(held.strays):
        entry = group.create_group(f"branches/unidentified {number + 1} of {block.name}")
        _put(entry, "k", stray.k, "rad/m")
        _put(entry, "omega", stray.omega, "rad/s")


def _record_attenuation(file: h5py.File, held: Held) -> None:
    curve = held.measured.attenuation
    assert curve is not None
    group = file.require_group(f"attenuation/{held.measured.block.sector}")
    _put(group, "omega", curve.omega, "rad/s")
    _put(group, "k", curve.k, "rad/m")
    _put(group, "k_exact", held.k_exact, "rad/m")
    _put(group, "distance", curve.distance, "m")
    group.create_dataset("level", data=curve.level, **_COMPRESSED)
    group["level"].attrs["units"] = "dB"
    group.attrs["sigma"] = curve.sigma
    group.attrs["meaning"] = "k at the complex frequency omega + i sigma (rad/s)"


@contextmanager
def _reading(path: Path) -> Iterator[h5py.File]:
    if not path.is_file():
        raise StorageError(f"{path}: no such file; run the case first")
    try:
        file = h5py.File(path, "r")
    except OSError:
        try:
            # A writer that was killed while appending leaves its mark; this mode reads past it.
            file = h5py.File(path, "r", libver="latest", swmr=True)
        except OSError as error:
            raise StorageError(f"{path}: is not a readable HDF5 file: {error}") from None
    try:
        if file.attrs.get("format") != "wavesim":
            raise StorageError(f"{path}: is not a result of wavesim (attribute format)")
        yield file
    finally:
        file.close()


class _Lazy:
    """A data set that is read when it is asked for."""

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._name = path, name

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray:
        with _reading(self._path) as file:
            return np.asarray(file[self._name][()], dtype=dtype)


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
    with _reading(path) as file:
        return Stored(str(file.attrs["case"]), str(file.attrs["status"]), len(file["t"]))


def read(path: Path, problem: Problem) -> Field:
    """The field of a result file; its arrays are read when they are indexed.

    Args:
        path: of result.h5.
        problem: of its case, as settled from :func:`describe`.

    Raises:
        StorageError: it is not a result of wavesim, or holds fewer than two frames.
    """
    settled = problem.plan
    with _reading(path) as file:
        t = file["t"][()]
        if len(t) < 2:
            raise StorageError(f"{path}: holds {len(t)} frames; at least 2 are needed")
        energy = Energy(*(file[f"energy/{part}"][: len(t)] for part in _ENERGIES[:3]))
        names = list(settled.fields)
    return Field(
        t=t,
        values={name: _Lazy(path, f"fields/{name}") for name in names},
        medium=settled.medium,
        bar=settled.bar,
        sources=settled.sources,
        receivers=problem.receivers,
        energy=energy,
        stepper=settled.schedule.solver,
        step=settled.step,
    )
