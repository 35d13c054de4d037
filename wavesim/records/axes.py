"""Which of a file's arrays or numbers are the times and the positions, and in which units."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.content import Content, RecordError
from wavesim.records.layout import Layout
from wavesim.records.straight_line import along_line
from wavesim.records.units import TIME, factor, named_as, unit_in

Float = NDArray[Any]

TIMES = ("t", "time", "times", "tt", "taxis", "timeaxis", "tvec", "timevector", "timestamp",
          "timestamps", "rawdatatime", "lag", "lags")  # fmt: skip
POSITIONS = ("x", "position", "positions", "pos", "receivers", "offset", "offsets", "distance",
              "distances", "dist", "xaxis", "xvec", "xpos", "rx", "locations", "location",
              "coordinates")  # fmt: skip
# Positions where a unit of length stands in their name too.
_PLACES = ("r", "y", "z", "range", "radius", "depth", "depths", "offs", "place", "places")
INTERVALS = ("dt", "interval", "delta", "samplinginterval", "sampleinterval", "samplingperiod",
             "sampleperiod", "timeinterval", "tstep", "timestep", "ts", "xinc", "xincrement",
             "deltax", "tinterval", "tinc", "hresolution", "wfincrement")  # fmt: skip
RATES = ("fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "sr",
         "outputdatarate", "fps", "framerate", "recordrate", "framespersecond", "prf",
         "pulserate")  # fmt: skip
STARTS = ("tstart", "tzero", "starttime", "toffset", "timeoffset", "xorigin", "xorg", "hoffset")
_FREQUENCIES = ("f", "freq", "freqs", "frequency", "frequencies", "freqvec", "omega")
_SPACINGS = ("dx", "spacing", "receiverspacing", "channelspacing", "spatialinterval",
             "spatialsamplinginterval")  # fmt: skip
_COUNTS = ("nch", "nchannels", "channels", "numchannels", "numberofchannels", "nx", "nreceivers",
           "receivers", "ntraces", "traces", "numberoftraces", "numberofloci", "nloci")  # fmt: skip
_SI = {"time": "s", "position": "m", "frequency": "Hz"}
# Seconds since 1970 are fewer: this is the year 5138. Dates are of 1980 to 2100.
_NO_DATE, _DATES = 1e11, (3.2e8, 4.1e9)
UNSAID = "no unit of {} is said"
Axis = tuple[Float, str, float]


def bare(name: str) -> str:
    """The last part of a name, without a unit, in small letters: scan/Time_us → time."""
    last = re.split(r"[/.]", name)[-1]
    unit = next((u for kind in _SI if (u := unit_in(last, kind))), None)
    if unit and last.lower().endswith("_" + unit.lower()):
        last = last[: -len(unit) - 1]
    return re.sub(r"[^a-z]", "", last.lower())


def is_axis(content: Content, name: str, kind: str) -> bool:
    """Whether an array is called as times ("time") or positions are, or says a unit of theirs."""
    usual = TIMES if kind == "time" else POSITIONS
    dates = name in content.arrays and content.arrays[name].dtype.kind in "mM"
    if dates:
        return kind == "time"
    placed = kind == "position" and bare(name) in _PLACES and unit_in(name, kind) is not None
    return bare(name) in usual or placed or factor(content.units.get(name), kind) is not None


def listed(arrays: dict[str, Float]) -> str:
    """Arrays with their shapes, for a message."""
    shown = [f"{name} {np.shape(a)}" for name, a in arrays.items() if np.ndim(a)]
    return ", ".join(shown[:8] + ["…"] * (len(shown) > 8)) or "none"


def named(arrays: dict[str, Float], text: str) -> str:
    """The name of the one array that a text means."""
    own = list(arrays)
    at = named_as(text, own)
    if len(at) != 1:
        what = "several arrays" if at else "no array"
        raise RecordError(f"has {what} {text!r}; arrays are {listed(arrays)}")
    return own[at[0]]


def as_long(content: Content, layout: Layout, shape: tuple[int, ...]) -> int:
    """How many of a file's times and positions are as many as these frames and receivers."""
    frames, count = shape
    times, places = (
        _array_of_times(content, layout, shape),
        _array_of_places(content, layout, count),
    )
    given = layout.positions is not None and not isinstance(layout.positions, str)
    many = len(layout.positions or ()) == count if given else places is not None
    long = times is not None and content.arrays[times].size in (frames, frames * count)
    if layout.receivers is not None:
        return 3 * (layout.receivers == count)
    said = any(bare(key) in _COUNTS and n == count != frames for key, n in _numbers(content))
    return int(long) + many + (said and not long and not many)


def axes_of(content: Content, layout: Layout, values: Float) -> tuple[Axis, Axis] | None:
    """Times and positions, each with what was assumed and its rounding; None where one lacks."""
    frames, count = values.shape[-2:]
    t = times_of(content, layout, frames, values.shape[-2:])
    x = places_of(content, layout, count)
    return None if t is None or x is None else (t, x)


def _array_of_times(content: Content, layout: Layout, shape: tuple[int, ...]) -> str | None:
    """The name of the times' array: as given, else the first so called and as long."""
    if layout.time is not None:
        return layout.time
    return next(
        (n for n, a in content.arrays.items()
         if is_axis(content, n, "time") and a.shape in ((shape[0],), shape)),
        None,
    )  # fmt: skip


def check_spectra(content: Content, layout: Layout, lengths: tuple[int, ...]) -> None:
    """Refuse spectra: an array of frequencies as long as one of the values' axes, and no times."""
    ways = (lengths, lengths[::-1])
    said = [_array_of_times(content, layout, way) for way in ways]
    if layout.time is None and (any(said) or layout.interval or interval_said(content, layout)):
        return
    for name, a in content.arrays.items():
        along = name == layout.time or (a.ndim == 1 and a.size in lengths)
        if along and (
            bare(name) in _FREQUENCIES or factor(content.units.get(name), "frequency") is not None
        ):
            raise RecordError(
                f"{name} {np.shape(a)} holds frequencies: values along it are spectra, and signals "
                "in time are needed; transform them back, with their phases"
            )


def _array_of_places(content: Content, layout: Layout, count: int) -> str | None:
    """Likewise of the positions'."""
    if isinstance(layout.positions, str):
        return layout.positions
    return next(
        (n for n, a in content.arrays.items()
         if is_axis(content, n, "position") and a.dtype.kind in "fiu"
         and a.shape in ((count,), (count, 1), (1, count), (count, 2), (count, 3))),
        None,
    )  # fmt: skip


def times_of(
    content: Content, layout: Layout, frames: int, shape: tuple[int, ...]
) -> tuple[Float, str, float] | None:
    """Times of so many frames, s, what was assumed, and the rounding of their storage, s."""
    name = _array_of_times(content, layout, shape)
    stored = None if name is None else content.arrays[name]
    if stored is not None and stored.shape != shape:
        stored = stored.ravel()
        if len(stored) != frames:
            return None
    note, resolution = "", 0.0
    t: Float | None = None
    if stored is not None:
        t, note, resolution = _seconds(stored, name or "", content, layout)
    if layout.interval is not None:
        first = 0.0 if t is None else float(np.asarray(t).ravel()[0])
        # The times given count from the file's first, whatever the others say.
        return first + layout.interval * np.arange(frames), "", 0.0
    if t is not None:
        return t, note, resolution
    step = interval_said(content, layout)
    if step is None:
        return None
    start, note = 0.0, f"times by {step[1]}"
    for key, number in _numbers(content):
        if bare(key) in STARTS or re.search(r"(^|[/.])t0(_|$)", key.lower()):
            unit = layout.time_unit or content.units.get(key) or unit_in(key, "time")
            start, note = number * (factor(unit, "time") or 1.0), f"{note}, from its {key} on"
    return start + step[0] * np.arange(frames), note, 0.0


def times_fall(content: Content, layout: Layout, shape: tuple[int, ...]) -> bool:
    """Whether the last frame is the first in time."""
    name = _array_of_times(content, layout, shape)
    stored = np.empty(0) if name is None else content.arrays[name].ravel()
    return len(stored) == shape[0] > 1 and bool((stored[1:] < stored[:-1]).all())


def _numbers(content: Content) -> list[tuple[str, float]]:
    """Single real numbers of a file, with their names."""
    return [
        (key, float(a.ravel()[0]))
        for key, a in content.arrays.items()
        if a.size == 1 and a.dtype.kind in "fiu" and np.isfinite(a).all()
    ]


def interval_said(content: Content, layout: Layout) -> tuple[float, str] | None:
    """The interval that a file's numbers say, s, and which of them."""
    for usual, inverse in ((INTERVALS, False), (RATES, True)):
        for key, number in _numbers(content):
            if bare(key) in usual and number > 0:
                kind = "frequency" if inverse else "time"
                given = None if inverse else layout.time_unit
                unit = given or content.units.get(key) or unit_in(key, kind)
                scale, said = factor(unit, kind), f"{key} of the file"
                if scale is None and unit:
                    said += f", whose unit {unit!r} is not known: taken as {_SI[kind]}"
                elif scale not in (None, 1.0):
                    said += f", in {unit}"
                value = number * (scale or 1.0)
                return 1 / value if inverse else value, said
    return None


def _seconds(
    stored: Float, name: str, content: Content, layout: Layout
) -> tuple[Float, str, float]:
    """Times in s, what was assumed, and the rounding that their storage has, s."""
    if stored.dtype.kind in "mM":
        if np.isnat(stored).any():
            raise RecordError(f"{name}: holds times that are not there (NaT); give every time")
        if np.datetime_data(stored.dtype)[0] in ("Y", "M"):
            raise RecordError(f"{name}: holds dates of years or months; give times in s")
        since = stored - stored.ravel()[0]
        unit = np.datetime_data(stored.dtype)[0]
        tick = float(np.ones(1, f"m8[{unit}]")[0] / np.timedelta64(1, "s"))
        return since / np.timedelta64(1, "s"), f"{name}: seconds from the first sample", tick
    if stored.dtype.kind not in "fiu":
        raise RecordError(f"{name}: holds no real numbers; give times in s")
    values, note, resolution = _in_si(stored, name, "time", content, layout)
    if "taken as" in note and np.abs(values[np.isfinite(values)]).max(initial=0.0) > _NO_DATE:
        begin = stored.ravel()[0]
        for unit in ("ms", "us", "ns"):
            if _DATES[0] < begin * TIME[unit] < _DATES[1]:
                said = (
                    f"{name}: {unit} since 1970, as their size says; seconds from the first sample"
                )
                return _scaled(stored - begin, TIME[unit]), said, _rounding(stored) * TIME[unit]
        raise RecordError(
            f"{name}: times of {stored.ravel()[0]:.6g} are no seconds since 1970: say what "
            "they are in, with --time-unit (ms, us or ns)"
        )
    return values, note, resolution


def _in_si(
    stored: Float, name: str, kind: str, content: Content, layout: Layout
) -> tuple[Float, str, float]:
    """Times in s or positions in m, what was assumed of their unit, and their rounding."""
    given = getattr(layout, f"{kind}_unit")
    said = given or content.units.get(name) or unit_in(name, kind)
    said = _SI[kind] if name in content.settled else said
    scale = factor(said, kind)
    if said is not None and scale is None and re.match(r"\w+ since ", said):
        scale = factor(said.split()[0], kind)
    si, what = f"taken as {_SI[kind]}", {"time": "time", "position": "length"}[kind]
    if kind == "position":
        si = f"positions {si}"
    if scale is None and not said:
        note = f"{UNSAID.format(what)}: {si}"
    elif scale is None:
        note = f"unit of {what} {said!r} is not known: {si}, --{kind}-unit says otherwise"
    elif scale != 1.0:
        note = f"{kind}s in {said}{_says(name, given, kind, content)}"
    else:
        note = ""
    scale = scale or 1.0
    return _scaled(stored, scale), note, _rounding(stored) * scale


def places_of(content: Content, layout: Layout, count: int) -> tuple[Float, str, float] | None:
    """Positions of so many receivers, m, what was assumed, and their rounding, m."""
    arrays = content.arrays
    note, resolution, x = "", 0.0, None
    if layout.positions is not None and not isinstance(layout.positions, str):
        given = np.asarray(layout.positions, float)
        if len(given) != count:
            raise RecordError(
                f"--positions: {len(given)} given for {count} receivers; give one for each"
            )
        return given, "", 0.0
    name = _array_of_places(content, layout, count)
    if name is not None:
        stored = arrays[name]
        bent = ""
        if stored.ndim == 2 and stored.shape[0] == count and stored.shape[1] in (2, 3):
            stored, bent = along_line(stored.astype(float), f"{name}: ")
        stored = stored.ravel()
        if len(stored) != count:
            return None
        x, note, resolution = _in_si(stored, name, "position", content, layout)
        note = "; ".join(one for one in (bent, note) if one)
    if layout.spacing is not None:
        first = layout.first if x is None else float(x[0])
        return first + layout.spacing * np.arange(count), "", 0.0
    if x is not None:
        return x, note, resolution
    for key, number in arrays.items():
        if number.size == 1 and number.dtype.kind in "fiu" and bare(key) in _SPACINGS:
            unit = layout.position_unit or content.units.get(key) or unit_in(key, "position")
            step = float(number.ravel()[0]) * (factor(unit, "position") or 1.0)
            if step > 0 and np.isfinite(step):
                begin = next(
                    (
                        float(a.ravel()[0])
                        for n, a in arrays.items()
                        if a.size == 1 and re.search(r"(^|[/.])x_?(0|start|first)(_|$)", n.lower())
                    ),
                    0.0,
                )
                begin *= factor(unit, "position") or 1.0
                return begin + step * np.arange(count), f"positions by {key} of the file", 0.0
    if not layout.placed:
        return np.full(count, np.nan), "", 0.0
    return None


def _says(name: str, given: str | None, kind: str, content: Content) -> str:
    """Where a unit is said, as the end of a note."""
    if given is not None:
        return f", as --{kind}-unit says"
    place = content.said_in.get(name)
    if place is None:
        place = f"the unit of {name!r}" if name in content.units else f"the name {name!r}"
    return f", as {place} says"


def _scaled(stored: Float, scale: float) -> Float:
    """In SI; decimals stay decimals: 20 mm is 0.02 m to the last digit."""
    if scale == 1.0:
        return np.asarray(stored, float)
    inverse = round(1 / scale)
    if scale < 1 and abs(inverse * scale - 1) < 1e-12:
        return np.asarray(stored, float) / inverse
    return np.asarray(stored, float) * scale


def _rounding(stored: Float) -> float:
    """How far apart the numbers are that the storage can hold, at the largest there."""
    if stored.dtype.kind in "iu":
        return 1.0
    finite = stored[np.isfinite(stored)]
    return float(np.spacing(np.abs(finite).max())) if len(finite) else 0.0
