"""result.h5: readable at any moment of a run and after a crash.

No file that a reader may see is ever changed in place: the frames of a run go to parts beside
result.h5, packed and written once each, and result.h5 itself, which presents them as one array and
holds the last frames, which fill no whole chunk of a part, is written anew after a chunk and moved
into place. A run that is killed, at whatever instant, so leaves a whole file of whole chunks. At
the end the parts are gathered into result.h5, by a thread, while the run is measured.
"""

from __future__ import annotations

import datetime
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from wavesim.grid.points import sampling
from wavesim.io.packing import Gathering, chunk_of, pack, packed_dataset, put
from wavesim.io.result_layout import attach_axes, axis, label, lay_out
from wavesim.io.result_reader import (
    CHECKSUM,
    StorageError,
    WriteError,
    checksum,
    hold,
    reading,
    stored,
)
from wavesim.io.whole_files import way_out, written
from wavesim.material.family import is_macro
from wavesim.simulation.field import Energy
from wavesim.simulation.simulation import Simulation


class Results:
    """Writer of one result.h5.

    Args:
        path: of the file.
        simulation: what is run.
        told: attributes of the file: the resolved "case" as TOML, "title", "stepper", "step" (s).

    Every method raises WriteError if the file can't be written (a full disk, say).
    """

    def __init__(self, path: Path, simulation: Simulation, told: Mapping[str, Any]) -> None:
        self.path, self.simulation, self.told = path, simulation, dict(told)
        self._parts = path.with_name(path.name + ".parts")
        self._created = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        self._ends: list[int] = []
        self._frames = self._stored = 0
        self._tail: dict[str, np.ndarray] = {}
        self._series: dict[str, np.ndarray] = {}
        self._state: Sequence[np.ndarray] = ()
        self._gathering: Future[Gathering] | None = None

    def create(self) -> None:
        """Begin anew: what an earlier run left must not pass for this one's."""
        with self._writing():
            self.path.unlink(missing_ok=True)
            shutil.rmtree(self._parts, ignore_errors=True)
            self._parts.mkdir(parents=True)

    def append(
        self,
        first: int,
        values: dict[str, np.ndarray],
        energy: Energy,
        state: Sequence[np.ndarray],
        present: bool = True,
    ) -> None:
        """Append frames and the state after them.

        Args:
            first: index of the first frame.
            values: {field: (frames, N)}, SI.
            energy: of these frames.
            state: arrays to carry on from after the last of them.
            present: whether result.h5 is to show them now, or when :meth:`present` is called.
        """
        end = first + len(energy.work)
        names = [part.name for part in fields(energy)]
        series = {f"energy/{name}": getattr(energy, name) for name in (*names, "total")}
        bar = self.simulation.bar
        for name, data in values.items():
            for receiver, position in self.simulation.receivers.items():
                weights, indices = sampling(bar, position, not is_macro(name))
                series[f"receivers/{receiver}/{name}"] = data[:, indices] @ weights
        with self._writing():
            self._keep(values)
            self._frames = end
            self._series = {
                name: np.concatenate([self._series.get(name, np.zeros(0)), data])
                for name, data in series.items()
            }
            self._state = state
        if present:
            self.present()

    def present(self) -> None:
        """Write result.h5 anew, so that it shows all that was appended."""
        if self._stored == self._frames:
            return
        with self._writing():
            with written(self.path) as file:
                lay_out(file, *self._known("running"))
                for name in self.simulation.fields:
                    self._show(file, name)
                file.attrs[CHECKSUM] = checksum(file)
            self._stored = self._frames

    def _keep(self, values: Mapping[str, np.ndarray]) -> None:
        """Put frames into a part as far as they fill whole chunks, with those left before."""
        before = self._ends[-1] if self._ends else 0
        whole = {
            name: np.concatenate([self._tail[name], data]) if name in self._tail else data
            for name, data in values.items()
        }
        count = len(next(iter(whole.values())))
        # Of macro- and micro-fields, so that both end at whole chunks.
        high = max(chunk_of(data.shape[1])[0] for data in whole.values())
        full = count // high * high
        if full:
            with written(self._part(before + full)) as part:
                for name, data in whole.items():
                    pack(packed_dataset(part, name, full, data.shape[1]), data[:full])
            self._ends.append(before + full)
        self._tail = {name: data[full:].copy() for name, data in whole.items()}

    @contextmanager
    def gathering(self, stored: Callable[[], object] = lambda: None) -> Iterator[None]:
        """While this lasts, gather all parts into the file to come; :meth:`finish` makes it so.

        What was gathered is thrown away where it ends without that.

        Args:
            stored: returns when all is appended; the gathering begins then, beside who called.
        """

        def begun() -> Gathering:
            stored()
            with self._writing():
                self._room()
                first = [0, *self._ends]
                parts = [(at, self._part(end)) for at, end in zip(first, self._ends, strict=False)]
                if not self._tail:  # gathered before
                    parts = [(0, self.path)]
                points = {name: self._points(name) for name in self.simulation.fields}
                return Gathering(self.path, points, parts, self._tail, self._frames)

        with ThreadPoolExecutor(1) as beside:
            self._gathering = beside.submit(begun)
            try:
                yield
            finally:
                with suppress(Exception):  # told of by who waits for what is stored, or finishes
                    self._gathering.result().abandon()
                self._gathering = None

    def finish(
        self, status: str, tables: Mapping[str, tuple[np.ndarray, str]] | None = None
    ) -> None:
        """Put the file of gathered parts in place, with what was measured beside the theory.

        Args:
            status: complete or failed.
            tables: other arrays with their units, by path.
        """
        if not self._frames:
            return
        if self._gathering is None:
            with self.gathering():
                self.finish(status, tables)
            return
        with self._writing():
            with self._gathering.result().file() as file:
                lay_out(file, *self._known(status))
                for name in self.simulation.fields:
                    label(file, self.simulation, name, file[f"fields/{name}"])
                for path, (values, unit) in (tables or {}).items():
                    put(file, path, values, unit)
                attach_axes(file)
                file.attrs[CHECKSUM] = checksum(file)
            shutil.rmtree(self._parts, ignore_errors=True)

    def carry_on(self) -> tuple[int, list[np.ndarray]]:
        """Last state of an interrupted run of the same case.

        Returns:
            Its frame and its arrays.

        Raises:
            StorageError: there is no such run, it failed, or it was another case.
        """
        stored(self.path)
        with reading(self.path) as file:
            hold(self.path, file)
            if file.attrs["case"] != self.told["case"]:
                raise StorageError(
                    f"{self.path}: was made by another case than this; run without --resume, or "
                    "name another folder with --out"
                )
            if file.attrs["status"] == "failed":
                raise StorageError(
                    f"{self.path}: the integration failed, and would again; change the case and "
                    "run without --resume"
                )
            self._created = str(file.attrs["created_utc"])
            self._ends = file["restart/ends"][()].tolist()
            self._frames = self._stored = len(file["t"])
            running = file.attrs["status"] == "running"
            missing = [e for e in self._ends if not self._part(e).is_file()]
            if missing and running:
                raise StorageError(
                    f"{self._part(missing[0])}: is missing, so that the run can't be resumed; run "
                    "without --resume"
                )
            for name in self.simulation.fields:
                if file[f"fields/{name}"].shape != (self._frames, self._points(name)):
                    raise StorageError(
                        f"{self.path}: damaged: fields/{name} is not of this case; run without "
                        "--resume"
                    )
            names = [f"energy/{name}" for name in file["energy"] if name != "t"]
            for receiver in self.simulation.receivers:
                names += [f"receivers/{receiver}/{name}" for name in self.simulation.fields]
            self._series = {name: file[name][()] for name in names}
            if running:
                tail = self._ends[-1] if self._ends else 0
                self._tail = {n: file[f"fields/{n}"][tail:] for n in self.simulation.fields}
            group = file["restart/state"]
            self._state = [group[str(n)][()] for n in range(len(group))]
            return self._frames - 1, list(self._state)

    def _points(self, name: str) -> int:
        return len(axis(self.simulation, name)[1])

    def _part(self, end: int) -> Path:
        """The part whose frames end before this one."""
        return self._parts / f"{end:08d}.h5"

    @contextmanager
    def _writing(self) -> Iterator[None]:
        # h5py reports some failures, of parts that it reads among them, as RuntimeError.
        try:
            yield
        except StorageError:
            raise
        except (OSError, RuntimeError, ValueError, KeyError) as error:
            what = getattr(error, "strerror", None) or str(error).partition("\n")[0]
            said = f"{self.path}: can't be written: {what}; {self._stored_and(way_out(error))}"
            raise WriteError(said) from error

    def _stored_and(self, remedy: str) -> str:
        """What of the run is stored, and how to go on, with what helps."""
        if not self.path.parent.is_dir():
            return "its folder is gone; run again, and leave it there"
        if not self._stored:
            first = f"{remedy}, or " if remedy else ""
            return f"nothing is stored yet; {first}name another folder with --out"
        first = f"{remedy} and " if remedy else ""
        of = f"{self._stored} of {self.simulation.frames} frames"
        return f"{of} are stored; {first}run again with --resume"

    def _room(self) -> None:
        """Hold the file to come to the room on the disk."""
        needed = sum(
            self._part(end).stat().st_size for end in self._ends if self._part(end).is_file()
        )
        needed += sum(data.nbytes for data in self._tail.values())
        free = shutil.disk_usage(self.path.parent).free
        if needed > free:
            raise WriteError(
                f"{self.path}: can't be written: it may need {needed / 1e6:.3g} MB, and the disk "
                f"has {free / 1e6:.0f} MB left; make room and run again with --resume"
            )

    def _known(self, status: str) -> tuple[Any, ...]:
        """What :func:`lay_out` takes."""
        made = {"status": status, "created_utc": self._created} | self.told
        return self.simulation, made, self._frames, self._series, self._ends, self._state

    def _show(self, file: h5py.File, name: str) -> None:
        """A field as one array, its frames in the parts."""
        points = self._points(name)
        layout = h5py.VirtualLayout((self._frames, points), np.float64)
        first = 0
        for end in self._ends:
            where = self._part(end).relative_to(self.path.parent)
            layout[first:end] = h5py.VirtualSource(str(where), name, (end - first, points))
            first = end
        if first < self._frames:
            kept = put(file, f"restart/tail/{name}", self._tail[name], "")
            layout[first : self._frames] = h5py.VirtualSource(kept)
        shown = file.create_virtual_dataset(f"fields/{name}", layout, np.nan)
        label(file, self.simulation, name, shown)
