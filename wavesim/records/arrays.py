"""Which of a file's arrays are the values, the times and the positions, and in which units.

Taken by the names given or, where none are, found by name and by shape: the values are the largest
array of two or three axes, or the signals of one length side by side; times and positions are as
long as its axes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.arguments import checked
from wavesim.records.content import Content, RecordError
from wavesim.records.units import NAMES, factor, position_in, unit_in

Float = NDArray[Any]

_TIMES = ("t", "time", "times", "tt", "taxis", "timeaxis", "tvec", "timevector", "timestamp",
          "timestamps")  # fmt: skip
_POSITIONS = ("x", "position", "positions", "pos", "receivers", "offset", "offsets", "distance",
              "distances", "dist", "xaxis", "xvec", "xpos", "rx", "locations", "location",
              "coordinates")  # fmt: skip
_INTERVALS = ("dt", "interval", "delta", "samplinginterval", "sampleinterval", "tstep", "timestep",
              "ts", "xincrement", "tinterval")  # fmt: skip
_RATES = ("fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "sr")
_STARTS = ("tstart", "tzero", "starttime", "toffset", "timeoffset", "xorigin")
_SPACINGS = ("dx", "spacing", "receiverspacing", "channelspacing", "spatialinterval")
_SI = {"time": "s", "position": "m", "frequency": "Hz"}
_TRUTH = "truth_"
# Seconds since 1970 are fewer: this is the year 5138.
_NO_DATE = 1e11
# Spots further off a straight line than this part of it are on none.
_CROOKED = 0.1
_SENT = re.compile(r"transmit|\bsent\b|\binput\b|\bexcit|\bdrive\b|\bgenerator\b", re.IGNORECASE)


@checked
@dataclass(frozen=True)
class Layout:
    """Where in a file the record is, and what the file does not say.

    Args:
        values, time: names of arrays.
        positions: name of an array, or the positions themselves.
        interval: Δt, s; stands before the file's times, whose first is kept.
        spacing: between receivers, m; stands before the file's positions, whose first is kept.
        first: position of the first receiver, m, with a spacing where the file has no positions.
        time_unit, position_unit: of the file's times and positions, and of no number given here;
            what the file says itself where None.
        input: heading or number (from 1, times are 1) of the column that holds the source's signal.
        quiet_from: time from which on no source acts, s; the file's own, or its start, where None.
        sources: positions of sources, m.
        ring: whether receivers go evenly round a periodic bar.
        lattice: whether receivers are all the sites of a lattice.
        placed: whether receivers must have positions; where not, unknown ones are NaN.
        transmitter: whether a heading that says so tells the input where none is named.
    """

    values: str | None = None
    time: str | None = None
    positions: str | Sequence[float] | None = None
    interval: float | None = None
    spacing: float | None = None
    first: float = 0.0
    time_unit: str | None = None
    position_unit: str | None = None
    input: str | int | None = None
    quiet_from: float | None = None
    sources: Sequence[float] = ()
    ring: bool = False
    lattice: bool = False
    placed: bool = True
    transmitter: bool = False

    def __post_init__(self) -> None:
        for kind in ("time", "position"):
            unit = getattr(self, f"{kind}_unit")
            if unit is not None and factor(unit, kind) is None:
                raise RecordError(f"--{kind}-unit {unit}: must be one of {', '.join(NAMES[kind])}")
        for name in ("interval", "spacing"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise RecordError(f"{name} = {value:g}: must be greater than 0")


@dataclass(frozen=True)
class Found:
    """A record's arrays, in SI.

    Attributes:
        values: shape (…, nt, nx), as stored: integers stay integers.
        t: times, shape (nt,), or (nt, nx) where each channel has its own, s.
        x: positions, shape (nx,), m; NaN where unknown.
        labels: of the receivers.
        input: the source's signal, shape (nt,); None without.
        stored: the dtypes that times and positions had, and the factors to s and m.
        notes: what was assumed.
        units: what times and positions were read in, and why, for a message that doubts it.
        rest: scalars and other arrays of the file.
        truth: arrays named truth_….
    """

    values: Float
    t: Float
    x: Float
    labels: tuple[str, ...]
    input: Float | None
    resolution: tuple[float, float]
    notes: tuple[str, ...]
    units: str
    rest: dict[str, Float]
    truth: dict[str, Float]


def find(content: Content, layout: Layout) -> Found:
    """The record in a file's content.

    Raises:
        RecordError: the file does not say enough; the message names the option that does.
    """
    arrays = {n: np.asarray(a) for n, a in content.arrays.items()}
    truth = {n[len(_TRUTH) :]: a for n, a in arrays.items() if n.startswith(_TRUTH)}
    arrays = {n: a for n, a in arrays.items() if not n.startswith(_TRUTH)}
    # Rows and columns of a larger array's length are one row, as MATLAB has no other.
    largest = max((a.size for a in arrays.values()), default=0)
    arrays = {n: a.ravel() if a.ndim == 2 and 1 in a.shape and a.size < largest else a
              for n, a in arrays.items()}  # fmt: skip
    notes = list(content.notes)
    content = replace(content, arrays=arrays, unplaced=dict(content.unplaced))
    if layout.input is None and layout.transmitter:
        layout = replace(layout, input=_transmitter(content))
        if layout.input is not None:
            notes.append(
                f'the column headed "{layout.input}" is taken for what was sent: --input names '
                "another"
            )
    signal = _input(content, layout)
    if content.unplaced:
        left = list(content.unplaced)
        notes.append(
            f"column{'s' if len(left) > 1 else ''} {', '.join(map(repr, left[:4]))}"
            f"{', …' if len(left) > 4 else ''}: the heading says no position, left out"
        )
    values, labels, name = _values(content, layout)
    swapped = np.swapaxes(values, -1, -2)
    fits = [0 if labels else _as_long(content, layout, one.shape[-2:]) for one in (values, swapped)]
    axes = _axes(content, layout, values) if fits[0] >= fits[1] else None
    if axes is None:
        axes = _axes(content, layout, swapped)
        if axes is not None:
            values = swapped
            notes.append(
                f"{name} {np.shape(arrays.get(name, values))}: receivers first, times last"
            )
    elif fits == [0, 0] and not labels and 1 not in values.shape[-2:]:
        notes.append(f"{name} {np.shape(values)}: taken as times down, receivers across, as "
                     "nothing in the file says which is which")  # fmt: skip
    if axes is None:
        raise _unsaid(content, layout, values, labels)
    (t, t_note, t_resolution), (x, x_note, x_resolution) = axes
    if t.ndim == 1 and len(t) == len(x) and np.ndim(arrays.get(name, values)) == 2:
        notes.append(f"{name} is square: taken as times down, receivers across")
    assumed = [n for n in (t_note, x_note) if n]
    if assumed:
        notes.append("; ".join(assumed))
    if _falls(content, layout, values.shape[-2:]):
        t, values = np.array(t[::-1] if t[-1] < t[0] else t), values[..., ::-1, :]
        signal = None if signal is None else signal[::-1]
        notes.append("times fall: frames turned round")
    read_in = "; ".join((t_note or "times in s", x_note or "positions in m"))
    if not labels or len(labels) != values.shape[-1]:
        labels = tuple(f"receiver {j}" for j in range(1, values.shape[-1] + 1))
    rest = {n: a for n, a in arrays.items() if a is not arrays.get(name)}
    return Found(values, t, x, labels, signal, (t_resolution, x_resolution), tuple(notes), read_in,
                 rest, truth)  # fmt: skip


def _bare(name: str) -> str:
    """The last part of a name, without a unit, in small letters: scan/Time_us → time."""
    last = re.split(r"[/.]", name)[-1]
    unit = next((u for kind in _SI if (u := unit_in(last, kind))), None)
    if unit and last.lower().endswith("_" + unit.lower()):
        last = last[: -len(unit) - 1]
    return re.sub(r"[^a-z]", "", last.lower())


def _listed(arrays: dict[str, Float]) -> str:
    shown = [f"{name} {np.shape(a)}" for name, a in arrays.items() if np.ndim(a)]
    return ", ".join(shown[:8] + ["…"] * (len(shown) > 8)) or "none"


def _named(arrays: dict[str, Float], name: str) -> Float:
    if name not in arrays:
        raise RecordError(f"has no array {name!r}; arrays are {_listed(arrays)}")
    return arrays[name]


def _transmitter(content: Content) -> str | None:
    """The one column, or array of one axis, that is headed as a transmitter's; None without."""
    values = content.arrays.get("values")
    if values is not None and values.ndim == 2 and content.labels:
        among = [*content.labels, *content.unplaced]
    else:
        among = [n for n, a in content.arrays.items() if a.ndim == 1 and a.size > 1]
    sent = [name for name in among if _SENT.search(name)]
    return sent[0] if len(sent) == 1 and len(among) > 1 else None


def _input(content: Content, layout: Layout) -> Float | None:
    """The source's signal, taken out of the receivers."""
    wanted = layout.input
    if wanted is None:
        return None
    text = str(wanted).strip()
    values = content.arrays.get("values")
    if values is not None and values.ndim == 2 and content.labels:
        labels = [*content.labels, *content.unplaced]
        columns = [*content.columns, *content.unplaced_columns.values()]
        if len(columns) < len(labels):
            columns = list(range(2, len(labels) + 2))
        kind, _, rest = text.partition(" ")
        as_number = rest if kind == "column" else text
        numbered = [j for j, number in enumerate(columns) if str(number) == as_number]
        at = [j for j, label in enumerate(labels) if text in (label, f"heading {label}")]
        if at and numbered and numbered != at:
            raise RecordError(
                f"--input {text}: is the number of the column headed {labels[numbered[0]]!r}, and "
                f"the heading of column {columns[at[0]]}: say 'column {text}' or 'heading {text}'"
            )
        at = at or numbered
        if not at:
            near = ", ".join(f"{c} {label!r}" for c, label in zip(columns, labels, strict=True))
            raise RecordError(f"--input {text}: no such column; there are {near}")
        (j, *_) = at
        if j >= len(content.labels):
            return np.asarray(content.unplaced.pop(labels[j]), float)
        keep = [i for i in range(len(content.labels)) if i != j]
        content.arrays["values"] = values[:, keep]
        content.labels = tuple(content.labels[i] for i in keep)
        content.columns = tuple(content.columns[i] for i in keep if i < len(content.columns))
        if "x" in content.arrays and len(content.arrays["x"]) == len(keep) + 1:
            content.arrays["x"] = content.arrays["x"][keep]
        return np.asarray(values[:, j], float)
    if text in content.arrays:
        return np.asarray(content.arrays.pop(text), float).ravel()
    if text.isdigit():
        found, _, name = _values(content, layout)
        j = int(text) - 2
        if found.ndim == 2:
            # Positions are the receivers' alone, or the input's too.
            down, across = (
                max(_as_long(content, layout, (n, m)) for m in (count, count - 1))
                for n, count in (found.shape, found.shape[::-1])
            )
            axis = 1 if down >= across else 0
            if 0 <= j < found.shape[axis]:
                if name in content.arrays:
                    content.arrays[name] = np.delete(found, j, axis)
                return np.asarray(np.take(found, j, axis), float)
    raise RecordError(f"--input {text}: no such column; arrays are {_listed(content.arrays)}")


def _values(content: Content, layout: Layout) -> tuple[Float, tuple[str, ...], str]:
    """Values, labels of their columns, and the name of their array."""
    arrays = content.arrays
    if layout.values is not None:
        values = _named(arrays, layout.values)
        if values.ndim == 1:
            values = values[:, None]
        name = layout.values
    else:
        axes = (layout.time, layout.positions)
        spatial = [n for n, a in arrays.items() if _bare(n) in _POSITIONS and a.shape[-1:] <= (3,)]
        tables = {
            n: a for n, a in arrays.items()
            if a.ndim in (2, 3) and a.dtype.kind in "fiubc" and n not in axes and n not in spatial
            and not (_bare(n) in _TIMES and any(b.shape == a.shape and m != n
                                                for m, b in arrays.items()))
        }  # fmt: skip
        if not tables:
            return _side_by_side(content, layout)
        name = max(tables, key=lambda n: tables[n].size)
        values = tables[name]
        equal = [n for n, a in tables.items() if a.shape == values.shape]
        if len(equal) > 1:
            raise RecordError(
                f"holds {len(equal)} arrays of shape {values.shape}; name one with --values: "
                f"{_listed({n: arrays[n] for n in equal})}"
            )
    if values.ndim not in (2, 3):
        raise RecordError(f"values of shape {values.shape}: must have two or three axes")
    return values, content.labels, name


def _side_by_side(content: Content, layout: Layout) -> tuple[Float, tuple[str, ...], str]:
    """Signals of one length, an array each, side by side."""
    arrays = content.arrays
    own = {
        n: a for n, a in arrays.items()
        if a.ndim == 1 and a.dtype.kind in "fiubc" and len(a) > 1 and n != layout.time
        and n != layout.positions and _bare(n) not in _TIMES
    }  # fmt: skip
    times = [n for n, a in arrays.items() if a.ndim == 1 and (_bare(n) in _TIMES
                                                              or n == layout.time)]  # fmt: skip
    length = len(arrays[times[0]]) if times else max((len(a) for a in own.values()), default=0)
    # Positions would be as many as signals, so that one of a signal's length is a signal too.
    own = {n: a for n, a in own.items() if len(a) == length}
    if not own or not (times or layout.interval or _step(content, layout)):
        raise RecordError(
            f"holds no array of two axes, times and receivers; arrays are {_listed(arrays)}"
        )
    said = [s for n in own if (s := position_in(n))]
    if len(said) == len(own):
        content.place(said, f"the name {next(iter(own))!r}")
    return np.stack(list(own.values()), axis=1), tuple(own), "values"


Axis = tuple[Float, str, float]


def _as_long(content: Content, layout: Layout, shape: tuple[int, ...]) -> int:
    """How many of a file's times and positions are as many as these frames and receivers."""
    frames, count = shape
    times, places = (
        _array_of_times(content, layout, shape),
        _array_of_places(content, layout, count),
    )
    given = layout.positions is not None and not isinstance(layout.positions, str)
    many = len(layout.positions or ()) == count if given else places is not None
    return int(times is not None and content.arrays[times].size in (frames, frames * count)) + many


def _axes(content: Content, layout: Layout, values: Float) -> tuple[Axis, Axis] | None:
    frames, count = values.shape[-2:]
    t = _times(content, layout, frames, values.shape[-2:])
    x = _places(content, layout, count)
    return None if t is None or x is None else (t, x)


def _array_of_times(content: Content, layout: Layout, shape: tuple[int, ...]) -> str | None:
    """The name of the times' array: as given, else the first so called and as long."""
    if layout.time is not None:
        _named(content.arrays, layout.time)
        return layout.time
    return next(
        (n for n, a in content.arrays.items()
         if _bare(n) in _TIMES and a.shape in ((shape[0],), shape)),
        None,
    )  # fmt: skip


def _array_of_places(content: Content, layout: Layout, count: int) -> str | None:
    """Likewise of the positions'."""
    if isinstance(layout.positions, str):
        _named(content.arrays, layout.positions)
        return layout.positions
    return next(
        (n for n, a in content.arrays.items()
         if _bare(n) in _POSITIONS and a.dtype.kind in "fiu"
         and a.shape in ((count,), (count, 1), (1, count), (count, 2), (count, 3))),
        None,
    )  # fmt: skip


def _times(
    content: Content, layout: Layout, frames: int, shape: tuple[int, ...]
) -> tuple[Float, str, float] | None:
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
    step = _step(content, layout)
    if step is None:
        return None
    start, note = 0.0, f"times by {step[1]}"
    for key, number in _numbers(content):
        if _bare(key) in _STARTS or re.search(r"(^|[/.])t0(_|$)", key.lower()):
            unit = layout.time_unit or content.units.get(key) or unit_in(key, "time")
            start, note = number * (factor(unit, "time") or 1.0), f"{note}, from its {key} on"
    return start + step[0] * np.arange(frames), note, 0.0


def _falls(content: Content, layout: Layout, shape: tuple[int, ...]) -> bool:
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


def _step(content: Content, layout: Layout) -> tuple[float, str] | None:
    """The interval that a file's numbers say, s, and which of them."""
    for usual, inverse in ((_INTERVALS, False), (_RATES, True)):
        for key, number in _numbers(content):
            if _bare(key) in usual and number > 0:
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
    said = layout.time_unit or content.units.get(name) or unit_in(name, "time")
    said = "s" if name in content.settled else said
    scale = factor(said, "time")
    note = ""
    if said is not None and scale is None and re.match(r"\w+ since ", said):
        scale = factor(said.split()[0], "time")
    if scale is None:
        scale = 1.0
        if np.abs(stored[np.isfinite(stored)]).max(initial=0.0) > _NO_DATE:
            raise RecordError(
                f"{name}: times of {stored.ravel()[0]:.6g} are no seconds since 1970: say what "
                "they are in, with --time-unit (ms, us or ns)"
            )
        note = (
            "no unit of time is said: taken as s"
            if not said
            else (f"unit of time {said!r} is not known: taken as s, --time-unit says otherwise")
        )
    elif scale != 1.0:
        note = f"times in {said}{_says(name, layout.time_unit, 'time', content)}"
    return _scaled(stored, scale), note, _rounding(stored) * scale


def _places(content: Content, layout: Layout, count: int) -> tuple[Float, str, float] | None:
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
        said = layout.position_unit or content.units.get(name) or unit_in(name, "position")
        said = "m" if name in content.settled else said
        scale = factor(said, "position")
        if scale is None:
            scale = 1.0
            note = (
                "no unit of length is said: positions taken as m"
                if not said
                else (
                    f"unit of length {said!r} is not known: positions taken as m, --position-unit "
                    "says otherwise"
                )
            )
        elif scale != 1.0:
            note = f"positions in {said}{_says(name, layout.position_unit, 'position', content)}"
        note = "; ".join(one for one in (bent, note) if one)
        x, resolution = _scaled(stored, scale), _rounding(stored) * scale
    if layout.spacing is not None:
        first = layout.first if x is None else float(x[0])
        return first + layout.spacing * np.arange(count), "", 0.0
    if x is not None:
        return x, note, resolution
    for key, number in arrays.items():
        if number.size == 1 and number.dtype.kind in "fiu" and _bare(key) in _SPACINGS:
            unit = layout.position_unit or content.units.get(key) or unit_in(key, "position")
            step = float(number.ravel()[0]) * (factor(unit, "position") or 1.0)
            if step > 0 and np.isfinite(step):
                return step * np.arange(count), f"positions by {key} of the file", 0.0
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


def along_line(spots: Float, name: str = "") -> tuple[Float, str]:
    """Two or three coordinates as one along the straight line that fits them best.

    Args:
        spots: shape (n, 2) or (n, 3), any unit.
        name: of what they are, before a message.

    Returns:
        Shape (n,), in their unit: the coordinate itself where one alone varies, else distances
        along the line from the first spot on; and what is worth saying.

    Raises:
        RecordError: they are on no line.
    """
    moves = np.ptp(spots, axis=0)
    if (moves > 1e-9 * max(moves.max(), 1e-300)).sum() <= 1:
        return spots[:, int(np.argmax(moves))], ""
    at = spots - spots.mean(axis=0)
    x = at @ line_of(at)
    off = float(np.linalg.norm(at - np.outer(x, line_of(at)), axis=1).max())
    length = float(np.ptp(x))
    if off > _CROOKED * length:
        raise RecordError(
            f"{name}positions are on no straight line: up to {off:.3g} off one of {length:.3g}; "
            "give them along their line with --positions"
        )
    said = f"{name}distances along a line from the first receiver"
    if off > 1e-3 * length:
        said += f", which they are up to {off:.3g} off"
    return x - x[0], said


def line_of(at: Float) -> Float:
    """The direction in which spots about 0 lie, most of them ahead of the first, a unit vector."""
    direction = np.asarray(np.linalg.svd(at, full_matrices=False)[2][0])
    return direction if at[0] @ direction <= 0 else -direction


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


def _unsaid(
    content: Content, layout: Layout, values: Float, labels: tuple[str, ...]
) -> RecordError:
    """What is missing, and the options that give it."""
    frames, count = values.shape[-2:]
    # Which way round it would fit better decides what is called missing.
    if _times(content, layout, frames, (frames, count)) is None and (
        _times(content, layout, count, (count, frames)) is None
    ):
        return RecordError(
            f"no times of {frames} entries for a record of shape {values.shape}; arrays are "
            f"{_listed(content.arrays)}"
            + "".join(f"; {note}" for note in content.notes if "numbers the rows" in note)
            + ": name them with --time, or give --interval"
        )
    if count == 1:
        return RecordError(
            "1 receiver: at least 2 are needed for a wavenumber, 3 where waves run both ways"
        )
    if labels and not content.columns:
        return RecordError(
            f"no positions of {count} receivers: the file says none; give --spacing, or "
            "--positions 0.02,0.025,… in m"
        )
    if labels:
        shown = ", ".join(map(repr, labels[:3])) + (", …" if len(labels) > 3 else "")
        headed = not labels[0].startswith("column ")
        told = f"headings {shown} say none" if headed else "the table has no heading"
        return RecordError(
            f"no positions of {count} receivers: {told}; give --spacing, or --positions "
            "0.02,0.025,… in m, or write headings as x=0.02"
        )
    return RecordError(
        f"no positions of {count} entries for a record of shape {values.shape}; arrays are "
        f"{_listed(content.arrays)}: name them with --positions, or give --spacing"
    )
