"""SEG-Y, SAC, miniSEED and what else obspy reads: traces with a start, an interval, a place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from wavesim.records.content import Content, RecordError, check_size
from wavesim.records.straight_line import along_line, line_of
from wavesim.records.units import factor

FORMATS = {
    ".sgy": "SEGY", ".segy": "SEGY", ".su": "SU", ".sac": "SAC", ".mseed": "MSEED",
    ".miniseed": "MSEED", ".msd": "MSEED", ".seg2": "SEG2", ".sg2": "SEG2", ".gse": "GSE2",
}  # fmt: skip
# What SAC has where nothing is said.
_UNSET = -12345.0
# Shorter intervals in whole µs, s, may be off by more than a hundredth.
_COARSE = 50e-6


def from_seismic(*paths: Path) -> Content:
    """Traces of one interval as an array; offsets where the headers say them."""
    stream = _stream(paths[0])
    for path in paths[1:]:
        stream += _stream(path)
    return of_stream(stream)


def _stream(path: Path) -> Any:
    try:
        from obspy import read
    except ImportError:
        raise RecordError(
            "needs obspy to be read: pip install 'wavesim[seismic]', or save it as CSV or NPZ"
        ) from None
    kind = FORMATS.get(path.suffix.lower(), "SEG2")
    options = {"unpack_trace_headers": True} if kind in ("SEGY", "SU") else {}
    return read(str(path), format=kind, **options)


def of_stream(stream: Any) -> Content:
    """Traces of an obspy Stream.

    Raises:
        RecordError: it holds none, or traces of different intervals.
    """
    if not len(stream):
        raise RecordError("holds no trace")
    steps = np.array([_interval(trace) for trace in stream])
    step = float(np.median(steps))
    if not np.abs(steps - step).max() <= 1e-6 * step:
        raise RecordError(
            f"traces have sampling intervals from {steps.min():g} to {steps.max():g} s: resample "
            "them alike, or save those of one interval"
        )
    begin = min(trace.stats.starttime for trace in stream)
    starts = [trace.stats.starttime - begin for trace in stream]
    of_event = all("sac" in t.stats and t.stats.sac.get("o", _UNSET) != _UNSET for t in stream)
    if of_event:
        # Each counts from the event, whatever day its reference time is of.
        starts = [_delay(trace) for trace in stream]
    late = [(start - min(starts)) / step if step > 0 else 0.0 for start in starts]
    shifts = [round(one) for one in late]
    off = max(abs(one - shift) for one, shift in zip(late, shifts, strict=True))
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
    content = Content({"values": values}, labels=tuple(labels))
    if step > 0:
        content.arrays["t"], content.units["t"] = step * np.arange(count), "s"
        if any(kind in stream[0].stats for kind in ("segy", "su")) and step < _COARSE:
            content.notes.append(
                f"the headers' interval of {step * 1e6:g} µs is of whole µs: where it was rounded, "
                "--interval says it"
            )
    if off > 0.05:
        content.notes.append(
            f"traces begin up to {off:.2g} of an interval apart: taken on one clock"
        )
    first = [stream[names.index(label)] for label in labels]
    begins = {min(starts)} if of_event else {_delay(trace) for trace in first}
    if step > 0 and len(begins) == 1 and begins != {0.0}:
        (delay,) = begins
        content.arrays["t"] = delay + content.arrays["t"]
        content.notes.append(f"times begin at the delay in the headers, {delay:g} s")
    _place(content, stream, first)
    return content


def _interval(trace: Any) -> float:
    """Δt, s: of SAC as its header has it, in float32, as obspy makes whole µs of it; 0 where that
    of SEG-Y or SU has none, of which obspy makes 1 s."""
    if "sac" in trace.stats:
        return float(f"{trace.stats.sac.delta:.7g}")
    traces = trace.stats.get("segy") or trace.stats.get("su")
    if traces and not traces.trace_header.get("sample_interval_in_ms_for_this_trace", 1):
        return 0.0
    return float(trace.stats.delta)


def _place(content: Content, stream: Any, traces: list[Any]) -> None:
    """Positions by the headers: offsets from the source, else coordinates along the line."""
    unit = _unit(stream)
    offsets, (places, to_source) = _offsets(traces), _coordinates(traces)
    what = "offsets"
    if offsets is not None and to_source is not None:
        # Offsets are whole numbers; coordinates may be finer.
        near = np.abs(np.abs(offsets) - np.abs(to_source)) <= 1
        if (offsets < 0).any():
            to_source = np.copysign(to_source, offsets)
        if near.all() and len(set(to_source.tolist())) == len(to_source):
            offsets, what = to_source, "offsets and coordinates"
    usable = _usable(offsets)
    if usable is None:
        usable, what = _usable(places), "coordinates"
    if usable is None:
        own = [] if offsets is None else offsets.tolist()
        repeated = next((x for x in own if own.count(x) > 1), 0.0)
        if repeated:
            content.notes.append(
                f"offsets in the traces' headers repeat ({repeated:g} {unit}): no positions by them"
            )
        return
    content.arrays["x"] = usable
    content.units["x"] = unit
    content.notes.append(f"positions by the {what} in the traces' headers, in {unit}")
    source = _source(traces) if what == "offsets" else 0.0 if what != "coordinates" else None
    if source is not None:
        content.arrays["sources"] = np.array([source * (factor(unit, "position") or 1.0)])


def _unit(stream: Any) -> str:
    """What lengths are in: SEG-Y's and SEG-2's headers say feet, or metres."""
    stats = getattr(stream, "stats", {})
    header = stats.get("binary_file_header") if hasattr(stats, "get") else None
    said = str(stats.get("seg2", {}).get("UNITS", "")) if hasattr(stats, "get") else ""
    feet = getattr(header, "measurement_system", 0) == 2 or said.upper().startswith("FEET")
    return "ft" if feet else "m"


def _delay(trace: Any) -> float:
    """When a trace begins after its source, s, as its header says."""
    stats = trace.stats
    if "seg2" in stats:
        value = str(stats.seg2.get("DELAY", "0")).split()
        try:
            return float(value[0]) if value else 0.0
        except ValueError:
            return 0.0
    if "sac" in stats:  # from the origin of the event
        origin = stats.sac.get("o", _UNSET)
        return float(stats.sac.get("b", 0.0)) - origin if origin != _UNSET else 0.0
    header = stats.get("segy") or stats.get("su")
    # A whole number of ms.
    return header.trace_header.delay_recording_time * 1e-3 if header else 0.0


def _offsets(traces: list[Any]) -> np.ndarray | None:
    """Distance from source to receiver: SEG-Y's, SU's, SAC's (km there); SEG-2's locations."""
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
            value = value * 1e3 if value not in (_UNSET,) else np.nan
        elif "seg2" in stats:
            value = str(stats.seg2.get("RECEIVER_LOCATION", "nan")).split()[0]
        else:
            return None
        try:
            found.append(float(value))
        except (TypeError, ValueError):
            return None
    return np.array(found)


def _source(traces: list[Any]) -> float | None:
    """Where offsets count from: 0, but for SEG-2's locations, which have one of the source."""
    said = {str(t.stats.seg2.get("SOURCE_LOCATION", "nan")).split()[0]
            for t in traces if "seg2" in t.stats}  # fmt: skip
    if not said:
        return 0.0
    try:
        (place,) = map(float, said)
    except ValueError:
        return None
    return place if np.isfinite(place) else None


def _coordinates(traces: list[Any]) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Along the receivers' line from the first, and from the source, negative behind it."""
    spots, sources = [], []
    for trace in traces:
        header = trace.stats.get("segy") or trace.stats.get("su")
        if header is None:
            return None, None
        header = header.trace_header
        if header.coordinate_units not in (0, 1):
            # Angles, on a sphere.
            return None, None
        scale = float(header.scalar_to_be_applied_to_all_coordinates or 1)
        scale = scale if scale > 0 else -1 / scale
        spots.append([header.group_coordinate_x * scale, header.group_coordinate_y * scale])
        sources.append([header.source_coordinate_x * scale, header.source_coordinate_y * scale])
    at, source = np.array(spots, float), np.array(sources, float)
    to_source = np.linalg.norm(at - source, axis=1)
    try:
        places, _ = along_line(at)
    except RecordError:
        return None, to_source
    # Behind a source that stands in their line distances count back from it.
    middle = at.mean(axis=0)
    direction = line_of(at - middle)
    ahead, shot = (at - middle) @ direction, (source - middle) @ direction
    aside = np.linalg.norm(source - middle - np.outer(shot, direction), axis=1)
    in_line = aside.max() <= 0.1 * np.ptp(ahead) / max(len(at) - 1, 1)
    return places, np.copysign(to_source, ahead - shot) if in_line else to_source


def _usable(places: np.ndarray | None) -> np.ndarray | None:
    if places is None or not np.isfinite(places).all():
        return None
    # Of one trace a place of 0 is a header that nobody filled in.
    return places if len(set(places.tolist())) == len(places) and places.any() else None
