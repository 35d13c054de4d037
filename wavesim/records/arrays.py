"""Which of a file's arrays are the values, the times and the positions, and in which units.

Taken by the names given or, where none are, found by name and by shape: the values are the largest
array of two or three axes, or the signals of one length side by side; times and positions are as
long as its axes.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.axes import (
    POSITIONS,
    TIMES,
    as_long,
    axes_of,
    bare,
    check_spectra,
    interval_said,
    is_axis,
    listed,
    named,
    times_fall,
    times_of,
)
from wavesim.records.content import Content, RecordError, sent_first, without_single_axes
from wavesim.records.faults.gaps import FEWEST_FRAMES
from wavesim.records.layout import Layout
from wavesim.records.units import named_as, position_in

Float = NDArray[Any]

_TRUTH = "truth_"
_SENT = re.compile(r"transmit|\bsent\b|\binput\b|\bexcit|\bdrive\b|\bgenerator\b", re.IGNORECASE)
# Beside what is incident, what is transmitted has gone through.
_THROUGH = re.compile(r"\bincident\b|\breflected\b", re.IGNORECASE)
# Of an array that nothing tells the axes of: its first frames, as a part of all, and their power
# over the mean where they are at rest, and where they are not.
_FIRST, _QUIET, _LOUD = 0.01, 0.2, 0.5


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
    if truth and not arrays:
        raise RecordError(
            "holds the truth alone: which waves can be missed is told by the record, its values "
            "(times, receivers), t (s) and x (m), beside it"
        )
    # Rows and columns are of one axis, as MATLAB has no other.
    arrays = {n: a.ravel() if a.ndim == 2 and 1 in a.shape and not content.labels
              else without_single_axes(a)
              for n, a in arrays.items()}  # fmt: skip
    notes = list(content.notes)
    content = replace(content, arrays=arrays, unplaced=dict(content.unplaced))
    chosen = {part: getattr(layout, part) for part in ("values", "time", "positions")}
    meant: dict[str, Any] = {
        part: named(arrays, one) for part, one in chosen.items() if isinstance(one, str)
    }
    layout = replace(layout, **meant)
    if layout.input is None and layout.transmitter:
        layout = replace(layout, input=_transmitter(content, layout))
        if layout.input is not None:
            notes.append(
                f'the column headed "{layout.input}" is taken for what was sent: --input names '
                "another"
            )
    signal = _input(content, layout, notes)
    if content.unplaced:
        left = list(content.unplaced)
        notes.append(
            f"column{'s' if len(left) > 1 else ''} {', '.join(map(repr, left[:4]))}"
            f"{', …' if len(left) > 4 else ''}: the heading says no position, left out"
        )
    values, labels, name = _values(content, layout)
    swapped = np.swapaxes(values, -1, -2)
    first = len(values) if values.ndim == 3 else 0
    clock = any(a.shape == (first,) and is_axis(content, n, "time") for n, a in arrays.items())
    if first not in values.shape[1:] and (clock or first > max(values.shape[1:])):
        raise RecordError(
            f"{name} {values.shape}: of three axes the first must be that of components, before "
            f"times and receivers; save one line of it, as {name}[:, :, 0], or a mean over an axis"
        )
    if layout.receivers not in (None, *values.shape[-2:]):
        raise RecordError(f"--receivers {layout.receivers}: the record is of shape {values.shape}")
    fits = [0 if labels else as_long(content, layout, one.shape[-2:]) for one in (values, swapped)]
    untold = fits == [0, 0] and not labels and 1 not in values.shape[-2:]
    lies, how = _lies_across(values, name) if untold else (fits[0] < fits[1], "")
    check_spectra(content, layout, values.shape[-2:])
    axes = None if lies else axes_of(content, layout, values)
    if axes is None:
        axes = axes_of(content, layout, swapped)
        if axes is not None:
            values = swapped
            notes.append(
                f"{name} {np.shape(arrays.get(name, values))}: receivers first, times last{how}"
            )
    elif how:
        notes.append(f"{name} {np.shape(values)}: taken as times down, receivers across, {how}")
    if axes is None:
        raise _unsaid(content, layout, values, labels)
    (t, t_note, t_resolution), (x, x_note, x_resolution) = axes
    assumed = [n for n in (t_note, x_note) if n]
    if assumed:
        notes.append("; ".join(assumed))
    if times_fall(content, layout, values.shape[-2:]):
        t, values = np.array(t[::-1] if t[-1] < t[0] else t), values[..., ::-1, :]
        signal = None if signal is None else signal[::-1]
        notes.append("times fall: frames turned round")
    read_in = "; ".join((t_note or "times in s", x_note or "positions in m"))
    if not labels or len(labels) != values.shape[-1]:
        labels = tuple(f"receiver {j}" for j in range(1, values.shape[-1] + 1))
    rest = {n: a for n, a in arrays.items() if a is not arrays.get(name)}
    return Found(values, t, x, labels, signal, (t_resolution, x_resolution), tuple(notes), read_in,
                 rest, truth)  # fmt: skip


def _lies_across(values: Float, name: str) -> tuple[bool, str]:
    """Whether receivers lie down and times across an array that nothing else tells the axes of,
    and by what that is known: a record begins at rest, and along its receivers it does not.

    Raises:
        RecordError: that does not tell, and so it would have more receivers than frames.
    """
    frames, count = values.shape[-2:]
    # Of two ways the one that has the frames of a record.
    if (frames < FEWEST_FRAMES) != (count < FEWEST_FRAMES):
        return frames < FEWEST_FRAMES, ", as so few are no frames"
    if frames >= count or count < FEWEST_FRAMES:
        return False, "as nothing in the file says which is which"
    power = np.abs(np.nan_to_num(values.astype(complex if values.dtype.kind == "c" else float)))
    power = (power - np.median(power)) ** 2
    power = power.reshape(-1, frames, count).mean(axis=0) / (power.mean() or 1.0)
    first = (power[: max(1, int(_FIRST * frames))].mean(),
             power[:, : max(1, int(_FIRST * count))].mean())  # fmt: skip
    if first[0] < _QUIET and first[1] > _LOUD:
        return False, "as so it begins at rest"
    # What spreads to both sides from where it was at first does not pass receivers that lie down.
    middle = power @ np.arange(count) / np.maximum(power.sum(axis=1), 1e-300)
    if first[1] < _QUIET and first[0] > _LOUD and middle.std() > _FIRST * count:
        return True, ", as so it begins at rest"
    raise RecordError(
        f"{name} {values.shape}: {count} receivers and {frames} times, or the other way round? "
        f"nothing in the file says: give --receivers {frames} or --receivers {count}"
    )


def _transmitter(content: Content, layout: Layout) -> str | None:
    """The one column, or array of one axis, that is headed as a transmitter's; None without, and
    where positions are given that it would have too."""
    values = content.arrays.get("values")
    if values is not None and values.ndim == 2 and content.labels:
        among = [*content.labels, *content.unplaced]
    else:
        among = [n for n, a in content.arrays.items() if a.ndim == 1 and a.size > 1]
    sent = [name for name in among if _SENT.search(name)]
    places = layout.positions if not isinstance(layout.positions, str) else None
    counted = len(places or ()) == len(among) or (layout.spacing is not None and len(among) == 2)
    other = counted or any(map(_THROUGH.search, among))
    return sent[0] if len(sent) == 1 and len(among) > 1 and not other else None


def _input(content: Content, layout: Layout, notes: list[str]) -> Float | None:
    """The source's signal, taken out of the receivers, with a note where two may be meant."""
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
        at = named_as(text, labels) or (named_as(rest, labels) if kind == "heading" else [])
        if at and numbered and numbered != at:
            two = f"--input {text}: the column headed {labels[numbered[0]]!r} has that number, and "
            two += f"column {columns[at[0]]} that heading"
            at = [sent_first((numbered[0], at[0]), values, two, text)]
            notes.append(f"{two}: column {columns[at[0]]}, which comes first, is what was sent")
        at = at or numbered
        if len(at) != 1:
            near = ", ".join(f"{c} {label!r}" for c, label in zip(columns, labels, strict=True))
            what = "several columns" if at else "no such column"
            raise RecordError(f"--input {text}: {what}; there are {near}")
        (j, *_) = at
        if j >= len(content.labels):
            return _real(content.unplaced.pop(labels[j]))
        keep = [i for i in range(len(content.labels)) if i != j]
        content.arrays["values"] = values[:, keep]
        content.labels = tuple(content.labels[i] for i in keep)
        content.columns = tuple(content.columns[i] for i in keep if i < len(content.columns))
        if "x" in content.arrays and len(content.arrays["x"]) == len(keep) + 1:
            content.arrays["x"] = content.arrays["x"][keep]
        return _real(values[:, j])
    if named_as(text, list(content.arrays)):
        return _real(content.arrays.pop(named(content.arrays, text))).ravel()
    if text.isdigit():
        found, _, name = _values(content, layout)
        j = int(text) - 2
        if found.ndim == 2:
            # Positions are the receivers' alone, or the input's too.
            down, across = (
                max(as_long(content, layout, (n, m)) for m in (count, count - 1))
                for n, count in (found.shape, found.shape[::-1])
            )
            axis = 1 if down >= across else 0
            if 0 <= j < found.shape[axis]:
                if name in content.arrays:
                    content.arrays[name] = np.delete(found, j, axis)
                return _real(np.take(found, j, axis))
    raise RecordError(f"--input {text}: no such column; arrays are {listed(content.arrays)}")


def _real(signal: Float) -> Float:
    """As numbers; a record of complex ones is refused with its receivers."""
    return np.asarray(np.real(signal), float)


def _values(content: Content, layout: Layout) -> tuple[Float, tuple[str, ...], str]:
    """Values, labels of their columns, and the name of their array."""
    arrays = content.arrays
    if layout.values is not None:
        name, values = layout.values, arrays[layout.values]
        values = values[:, None] if values.ndim == 1 else values
    else:
        axes = (layout.time, layout.positions)
        spatial = [n for n, a in arrays.items() if bare(n) in POSITIONS and a.shape[-1:] <= (3,)]
        tables = {
            n: a for n, a in arrays.items()
            if a.ndim in (2, 3) and a.dtype.kind in "fiubc" and n not in axes and n not in spatial
            and not (bare(n) in TIMES and any(b.shape == a.shape and m != n
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
                f"{listed({n: arrays[n] for n in equal})}"
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
        and n != layout.positions and not is_axis(content, n, "time")
    }  # fmt: skip
    times = [n for n, a in arrays.items()
             if a.ndim == 1 and (n == layout.time or is_axis(content, n, "time"))]  # fmt: skip
    length = len(arrays[times[0]]) if times else max((len(a) for a in own.values()), default=0)
    # Positions would be as many as signals, so that one of a signal's length is a signal too.
    own = {n: a for n, a in own.items() if len(a) == length}
    if not own or not (times or layout.interval or interval_said(content, layout)):
        raise RecordError(
            f"holds no array of two axes, times and receivers; arrays are {listed(arrays)}"
        )
    said = [s for n in own if (s := position_in(n))]
    if len(said) == len(own):
        content.place(said, f"the name {next(iter(own))!r}")
    return np.stack(list(own.values()), axis=1), tuple(own), "values"


def _unsaid(
    content: Content, layout: Layout, values: Float, labels: tuple[str, ...]
) -> RecordError:
    """What is missing, and the options that give it."""
    frames, count = values.shape[-2:]
    # Which way round it would fit better decides what is called missing.
    ways = (frames, count), (count, frames)
    if all(times_of(content, layout, one[0], one) is None for one in ways):
        return RecordError(
            f"no times of {max(frames, count)} entries for a record of shape {values.shape}; "
            f"arrays are {listed(content.arrays)}"
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
        f"{listed(content.arrays)}: name them with --positions, or give --spacing"
    )
