"""Records from files, whoever wrote them, by what the file begins with, else by its suffix."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.arrays import Found, find
from wavesim.records.axes import places_of
from wavesim.records.content import Content, RecordError, UnitsError
from wavesim.records.faults.moveout import arrivals, speed
from wavesim.records.faults.quiet import rest
from wavesim.records.layout import Layout, told_files
from wavesim.records.record import Record, record

Float = NDArray[Any]

_TRUTH = "truth_"
HDF5 = (".h5", ".hdf5", ".hdf", ".he5", ".nc", ".nc4", ".mat")
_TEXT = (".csv", ".txt", ".tsv", ".dat", ".asc", ".ascii", ".prn", ".tab", ".lvm", ".xy", ".out")
_SEISMIC = (".sgy", ".segy", ".su", ".sac", ".mseed", ".miniseed", ".msd", ".seg2", ".sg2", ".gse")


def read(path: str | Path | Sequence[str | Path], layout: Layout | None = None) -> Record:
    """Read a record from a file, or from several, each of some of its receivers.

    Args:
        path: .csv, .txt and other tables of text, with a column of times and one for each receiver;
            .npz, .npy; HDF5 and MATLAB's .mat; netCDF; SEG-Y, SAC, miniSEED. Of several files
            receivers stand in their order, or that of the numbers in their names where that is the
            only thing by which the files are not in it, as a shell lists 1, 10, 2.
        layout: what the file does not say for itself.

    Returns:
        The record, looked over and cured (``wavesim.records.record``).

    Raises:
        RecordError: the file can't be read or used; the message names it.
    """
    layout = layout or Layout()
    paths = _in_order([Path(path)] if isinstance(path, (str, Path)) else [Path(p) for p in path])
    if len(paths) == 1:
        (path,) = map(file_of, paths)
        with _named(path):
            return _built(find(_content(path), layout), layout)
    with _named(told_files(paths)):
        return _of_several(paths, layout)


@contextmanager
def _named(what: Path | str) -> Iterator[None]:
    """What goes wrong names the file."""
    try:
        yield
    except RecordError as error:
        raise RecordError(f"{what}: {error}") from None
    except OSError as error:
        raise RecordError(f"{what}: can't be read: {error.strerror or error}") from None
    except MemoryError:
        raise RecordError(f"{what}: too large for the memory there is; cut the record") from None


def _content(path: Path) -> Content:
    if path.is_dir():
        raise RecordError("is a folder without a result.h5: give a file, or the folder of a run")
    if not path.is_file():
        raise RecordError("no such file")
    return content_of(path)


def _in_order(paths: list[Path]) -> list[Path]:
    """Files as given, but by the numbers in their names where only those are out of order."""
    names = [str(path) for path in paths]
    alike = len({re.sub(r"\d+", "0", name) for name in names}) == 1
    if not alike or names != sorted(names):
        return paths
    return sorted(paths, key=lambda path: [int(n) for n in re.findall(r"\d+", str(path))])


def _of_several(paths: list[Path], layout: Layout) -> Record:
    """A record whose receivers stand in files of their own, on one clock."""
    order = f"{len(paths)} files as receivers of one record, {paths[0].name} to {paths[-1].name}"
    if all(path.suffix.lower() in _SEISMIC for path in paths):  # whose clocks have a date
        try:
            content = content_of(*paths)
        except (RecordError, OSError):
            for path in paths:  # which of them it is
                with _named(path.name):
                    _content(path)
            raise
        content.notes.append(order)
        return _built(find(content, layout), layout)
    if any(own_result(path) for path in paths):
        raise RecordError("one of them is a run, which is a record of its own: give it alone")
    alone = replace(layout, placed=False, positions=None, spacing=None)
    parts = []
    for path in paths:
        with _named(path.name):
            parts.append(find(_content(path), alone))
            if parts[-1].values.ndim != 2:
                raise RecordError("each file must hold times and a signal at each receiver")
    each = [(part, path, j) for part, path in zip(parts, paths, strict=True)
            for j in range(part.values.shape[-1])]  # fmt: skip
    count = max(len(part.values) for part in parts)
    values, t = np.full((2, count, len(each)), np.nan)
    for n, (part, _, j) in enumerate(each):
        own, frames = part.t if part.t.ndim == 1 else part.t[:, j], len(part.values)
        step = (own[-1] - own[0]) / max(frames - 1, 1)
        values[:frames, n] = part.values[:, j]
        t[:, n] = np.r_[own, own[-1] + step * np.arange(1, count - frames + 1)]
    x = np.array([part.x[j] for part, _, j in each])
    asked = replace(layout, positions=None) if isinstance(layout.positions, str) else layout
    said = Content({"x": x} if np.isfinite(x).all() else {}, settled={"x"})
    if (placed := places_of(said, asked, len(each))) is None:
        raise RecordError(
            f"positions of {len(each)} receivers: the files say none; give --spacing, or "
            "--positions X1,X2,… in their order"
        )
    labels = tuple(path.stem if part.values.shape[-1] == 1 else f"{path.stem} {part.labels[j]}"
                   for part, path, j in each)  # fmt: skip
    notes = dict.fromkeys(note for part in parts for note in part.notes)
    whole = replace(parts[0], values=values, t=t, x=placed[0], labels=labels, notes=(order, *notes))
    return _built(whole, layout)


def file_of(path: Path) -> Path:
    """A record's file: of the folder of a run its result.h5."""
    inside = path / "result.h5"
    return inside if inside.is_file() else path


def own_result(path: str | Path) -> Path | None:
    """The result.h5 of one of wavesim's runs, of its folder or its file; None of any other."""
    path = file_of(Path(path))
    if path.suffix.lower() not in HDF5 or not path.is_file():
        return None
    from wavesim.io.result_reader import is_result

    return path if is_result(path) else None


def from_arrays(arrays: Mapping[str, Any], layout: Layout | None = None) -> Record:
    """A record from named arrays, as :func:`read` finds them in a file."""
    layout = layout or Layout()
    return _built(find(Content({n: np.asarray(a) for n, a in arrays.items()}), layout), layout)


def from_xarray(dataset: Any, layout: Layout | None = None) -> Record:
    """A record from an xarray DataArray or Dataset, with its coordinates and their units."""
    from wavesim.records.formats.netcdf import of_dataset

    layout = layout or Layout()
    return _built(find(of_dataset(dataset), layout), layout)


def content_of(*paths: Path) -> Content:
    """What a file holds, or several of traces, as named arrays.

    Raises:
        RecordError: it is of no kind that is known, or not what it says.
    """
    reader, kind = _reader(paths[0])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return reader(*paths)
    except (RecordError, MemoryError):
        raise
    except Exception as error:
        # Anything at all may be raised by a file that is cut or damaged.
        text = " ".join(str(error).strip("'\"").split())[:160] or type(error).__name__
        raise RecordError(f"can't be read as {kind}: {text}") from None


def _reader(path: Path) -> tuple[Callable[..., Content], str]:
    """What reads a file, and what it is taken for."""
    kind = path.suffix.lower()
    with path.open("rb") as file:
        start = file.read(512)
    # Seismographs write SEG-2 as .dat: its block of file data has a mark, and bytes of 0.
    seg2 = start.startswith((b"\x55\x3a", b"\x3a\x55")) and b"\0" in start[:64]
    hdf5 = start.startswith(b"\x89HDF") or start[:10] == b"MATLAB 7.3" or kind in HDF5[:4]
    if kind in _SEISMIC or seg2:
        from wavesim.records.formats.seismic import FORMATS, from_seismic

        return from_seismic, FORMATS.get(kind, "SEG2")
    if start.startswith(b"CDF") or kind in (".nc", ".nc4"):
        from wavesim.records.formats.netcdf import from_netcdf

        return from_netcdf, "netCDF"
    if hdf5:
        from wavesim.records.formats.hdf5 import from_hdf5

        return from_hdf5, "HDF5"
    if start.startswith(b"MATLAB 5.0") or kind == ".mat":
        from wavesim.records.formats.matlab import from_matlab

        return from_matlab, "MATLAB's"
    if start.startswith((b"PK", b"\x93NUMPY")) or kind in (".npz", ".npy"):
        from wavesim.records.formats.numpy_files import from_npz

        return from_npz, "NumPy's"
    if start[:4] in (b"RIFF", b"RIFX", b"RF64") and start[8:12] == b"WAVE":
        from wavesim.records.formats.wav import from_wav

        return from_wav, "WAV"
    numbers = re.fullmatch(rb"[\s\d.,;eE+-]*\d[\s\d.,;eE+-]*", start)
    if kind in _TEXT or numbers:
        from wavesim.records.formats.csv_and_text import from_text

        return from_text, "text"
    raise RecordError(
        f"of a kind that is not known ({kind or 'no suffix'}): give .csv or other text, .npz, "
        ".npy, HDF5, .mat, netCDF, SEG-Y, SAC, miniSEED or .wav"
    )


def _built(found: Found, layout: Layout) -> Record:
    rest = found.rest
    quiet = _scalar(rest, "quiet_from") if layout.quiet_from is None else layout.quiet_from
    sources = list(layout.sources)
    own = layout.positions is None and layout.spacing is None  # sources stand among them
    if not sources and own and "sources" in rest and rest["sources"].dtype.kind in "fiu":
        sources = [float(s) for s in np.atleast_1d(rest["sources"]).ravel()]
    try:
        made = record(
            found.values,
            found.t,
            found.x,
            ring=layout.ring or bool(_scalar(rest, "ring")),
            quiet_from=quiet,
            sources=sources,
            answer=found.truth or None,
            lattice=layout.lattice or bool(_scalar(rest, "lattice")),
            labels=found.labels,
            input=found.input,
            storage=found.resolution,
            notes=found.notes,
            placed=layout.placed,
            as_recorded=layout.as_recorded,
        )
    except UnitsError as error:
        raise RecordError(f"{error} ({found.units})") from None
    if "taken as" not in found.units or not np.isfinite(v := speed_of(made)):
        return made
    by_it = f"by what was assumed of units the signal goes along the receivers at {v:.3g} m/s"
    return replace(made, notes=(*made.notes, by_it))


def speed_of(made: Record) -> float:
    """Speed at which the signal goes along a line of receivers, m/s; NaN where none is told."""
    if made.ring or not np.isfinite(made.x).all():
        return float("nan")
    own = made.values[int(np.argmax(np.abs(made.values).max(axis=(1, 2))))]
    return speed(made.x, arrivals(own, made.t, rest(own, np.zeros(len(made.x))))[0])


def _scalar(arrays: Mapping[str, Float], name: str) -> float | None:
    array = arrays.get(name)
    one = array is not None and array.size == 1 and array.dtype.kind in "fiub"
    return float(array.ravel()[0]) if array is not None and one else None


def write(path: str | Path, saved: Record) -> None:
    """Write a record, with its truth where it has one.

    Args:
        path: .npz for everything, or .csv for times and receivers alone.
        saved: the record; of one component for .csv.

    Raises:
        RecordError: the suffix is another, or the file can't be written.
    """
    path = Path(path)
    values = saved.values if saved.whole is None else saved.whole
    if saved.whole is None and saved.missing.any():
        values = np.where(saved.missing[:, None], np.nan, values)
    values = values[0] if len(values) == 1 else values
    try:
        if path.suffix == ".npz":
            known = {f"{_TRUTH}{name}": a for name, a in (saved.answer or {}).items()}
            if not saved.driven:
                known["quiet_from"] = np.array(saved.quiet_from)
            np.savez_compressed(
                path,
                t=saved.t,
                x=saved.x,
                t_unit="s",
                x_unit="m",
                values=values,
                sources=np.array(saved.sources),
                ring=saved.ring,
                lattice=saved.lattice,
                **known,
            )
        elif path.suffix == ".csv" and values.ndim == 2:
            heading = ",".join(["t_s", *(f"x={x:.9g} m" for x in saved.x)])
            table = np.column_stack([saved.t, values])
            formats = ["%.15g"] + ["%.9g"] * len(saved.x)
            np.savetxt(path, table, formats, ",", header=heading, comments="")
        else:
            raise RecordError(f"{path}: must end in .npz, or in .csv for one component")
    except OSError as error:
        raise RecordError(f"{path}: can't be written: {error.strerror}") from None


__all__ = ["HDF5", "Layout", "content_of", "from_arrays", "from_xarray", "read", "write"]
