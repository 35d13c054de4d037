"""SEG-Y, SAC, miniSEED and what else obspy reads: traces with a start, an interval, a place."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from wavesim.records.content import Content, RecordError, check_size

FORMATS = {
    ".sgy": "SEGY", ".segy": "SEGY", ".su": "SU", ".sac": "SAC", ".mseed": "MSEED",
    ".miniseed": "MSEED", ".msd": "MSEED", ".seg2": "SEG2", ".sg2": "SEG2", ".gse": "GSE2",
}  # fmt: skip


def from_seismic(path: Path) -> Content:
    """Traces of one length and interval as an array; offsets where the headers say them."""
    try:
        from obspy import read
    except ImportError:
        raise RecordError(
            "needs obspy to be read: pip install 'wavesim[seismic]', or save it as CSV or NPZ"
        ) from None
    kind = FORMATS[path.suffix.lower()]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            options = {"unpack_trace_headers": True} if kind in ("SEGY", "SU") else {}
            stream = read(str(path), format=kind, **options)
    except Exception as error:
        # Anything at all may be raised by a file that is cut or damaged.
        text = " ".join(str(error).split())[:120] or type(error).__name__
        raise RecordError(f"can't be read as {kind}: {text}") from None
    return of_stream(stream)


def of_stream(stream: Any) -> Content:
    """Traces of an obspy Stream.

    Raises:
        RecordError: it holds none, or traces of different intervals.
    """
    if not len(stream):
        raise RecordError("holds no trace")
    steps = np.array([trace.stats.delta for trace in stream])
    step = float(np.median(steps))
    if not (step > 0 and np.abs(steps - step).max() <= 1e-6 * step):
        raise RecordError(
            f"traces have sampling intervals from {steps.min():g} to {steps.max():g} s: resample "
            "them alike, or save those of one interval"
        )
    begin = min(trace.stats.starttime for trace in stream)
    shifts = [round((trace.stats.starttime - begin) / step) for trace in stream]
    off = max(abs((t.stats.starttime - begin) / step - s)
              for t, s in zip(stream, shifts, strict=True))  # fmt: skip
    count = max(s + len(t.data) for t, s in zip(stream, shifts, strict=True))
    check_size((count, len(stream)), "traces")
    # Traces of one name that follow each other are one receiver.
    names = [trace.id if trace.id.strip(".") else f"trace {n}" for n, trace in enumerate(stream, 1)]
    if len(set(names)) < len(names) and all(s == shifts[0] for s in shifts):
        names = [f"trace {n}" for n in range(1, len(names) + 1)]
    labels = list(dict.fromkeys(names))
    values = np.full((count, len(labels)), np.nan)
    for trace, shift, name in zip(stream, shifts, names, strict=True):
        data = np.ma.filled(np.ma.asarray(trace.data).astype(float), np.nan)
        values[shift : shift + len(data), labels.index(name)] = data
    content = Content({"t": step * np.arange(count), "values": values}, {"t": "s"}, tuple(labels))
    if off > 0.05:
        content.notes.append(
            f"traces begin up to {off:.2g} of an interval apart: taken on one clock"
        )
    first = [stream[names.index(label)] for label in labels]
    for places, what in ((_offsets(first), "offsets"), (_coordinates(first), "coordinates")):
        if places is not None:
            content.arrays["x"] = places
            content.units["x"] = "m"
            content.notes.append(f"positions by the {what} in the traces' headers, in m")
            break
    return content


def _offsets(traces: list[Any]) -> np.ndarray | None:
    """Distance from source to receiver, m: SEG-Y's, SU's, SAC's (km there)."""
    found = []
    for trace in traces:
        stats = trace.stats
        if "segy" in stats or "su" in stats:
            header = (stats.get("segy") or stats.get("su")).trace_header
            value = (
                header.distance_from_center_of_the_source_point_to_the_center_of_the_receiver_group
            )
        elif "sac" in stats:
            value = stats.sac.get("dist", np.nan)
            value = value * 1e3 if value not in (-12345.0,) else np.nan
        elif "seg2" in stats:
            value = str(stats.seg2.get("RECEIVER_LOCATION", "nan")).split()[0]
        else:
            return None
        try:
            found.append(float(value))
        except (TypeError, ValueError):
            return None
    return _usable(np.array(found))


def _coordinates(traces: list[Any]) -> np.ndarray | None:
    """Along the line of the receivers' coordinates, m, from the first."""
    found = []
    for trace in traces:
        header = trace.stats.get("segy") or trace.stats.get("su")
        if header is None:
            return None
        header = header.trace_header
        scale = float(header.scalar_to_be_applied_to_all_coordinates or 1)
        scale = scale if scale > 0 else -1 / scale
        found.append([header.group_coordinate_x * scale, header.group_coordinate_y * scale])
    spots = np.array(found, float)
    return _usable(np.linalg.norm(spots - spots[0], axis=1))


def _usable(places: np.ndarray) -> np.ndarray | None:
    good = np.isfinite(places).all() and len(set(places.tolist())) == len(places) > 1
    return places if good else None
