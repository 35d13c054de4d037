"""Records of pulse tests from files: transmitter and receivers told apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.planewave.dispersion_relation import block_group_velocity
from wavesim.records.content import RecordError
from wavesim.records.files import own_result, read
from wavesim.records.fitness import for_pulse_test, levelled
from wavesim.records.layout import Layout
from wavesim.records.record import Record

Float = NDArray[Any]

UNLIKE = (
    "the receivers stand in layers that differ: a velocity between them is of the path, and there "
    "is no α or Q of a medium; put two receivers or more into one layer"
)
# Receivers beyond this part of a ring hear almost at once what came either way.
_PART_OF_RING = 0.4
# A test that waves round the ring leave fewer frames of is none.
_FEWEST_FRAMES = 32


@dataclass(frozen=True)
class PulseTestRecord:
    """What a pulse test recorded.

    Attributes:
        name: of the file, with the column's or the field's where it holds several.
        t: times, shape (nt,), s.
        signals: of each receiver, shape (nt,).
        positions: of each, m, from the source or an origin of their own; NaN where unknown.
        sent: what was sent, shape (nt,); None where it was not recorded.
        notes: what was done to the file's numbers, and assumed.
        unlike: why there is not one medium between the receivers; "" where there may be.
        noise: of the signals where they show none, their unit; 0 in a simulation, else NaN.
        levelled: why their amplitudes tell nothing; "" where they do.
    """

    name: str
    t: Float
    signals: dict[str, Float]
    positions: dict[str, float]
    sent: Float | None
    notes: tuple[str, ...] = ()
    unlike: str = ""
    noise: float = np.nan
    levelled: str = ""

    @property
    def placed(self) -> bool:
        """Whether two receivers or more have positions."""
        return sum(np.isfinite(x) for x in self.positions.values()) > 1


def of_pulse_file(path: str | Path, layout: Layout) -> list[PulseTestRecord]:
    """The pulse tests of a file: one with placed receivers, or one for each column without a place.

    Args:
        path: of any file that a record can be read from, or of a run's folder or result.h5.
        layout: what the file does not say; its ``input`` is the transmitter's column, or a file of
            its own, of the same clock.

    Raises:
        RecordError: the file can't be used.
    """
    if layout.input is not None and Path(str(layout.input)).is_file():
        t, sent = _sent_by_itself(Path(str(layout.input)), layout)
        tests = of_pulse_file(path, replace(layout, input=None))
        for one in tests:
            if t.shape != one.t.shape or np.abs(t - one.t).max() > 0.5 * (t[1] - t[0]):
                raise RecordError(f"--input {layout.input}: its clock is not that of {path}")
        return [replace(one, sent=sent) for one in tests]
    path = Path(path)
    result = own_result(path)
    if result is not None:
        return _of_run(result)
    record = read(path, replace(layout, placed=False, transmitter=True))
    if len(record.values) > 1:
        raise RecordError(
            f"{path}: holds {len(record.values)} components ({', '.join(record.names)}); name one "
            "with --values"
        )
    try:
        record = for_pulse_test(record)
    except RecordError as error:
        raise RecordError(f"{path}: {error}") from None
    labels = record.labels or tuple(f"receiver {j + 1}" for j in range(len(record.x)))
    values, notes = record.values[0], record.notes
    missing = record.missing if len(record.missing) else np.zeros(len(record.t), bool)
    if missing.any():
        own = np.flatnonzero(~missing)
        values = np.stack([np.interp(np.arange(len(missing)), own, u[own]) for u in values.T], 1)
        notes = (*notes, f"{missing.sum()} missing frames bridged by straight lines")
    columns = {label: values[:, j] for j, label in enumerate(labels)}
    places = dict(zip(labels, record.x.tolist(), strict=True))
    source, how = _among(record)
    if source is not None:
        places = _beside(places, [(source, 0.0)])
        columns = {name: columns[name] for name in places}
        notes = (
            *notes,
            f"{how}, and the {len(places)} receivers on one side of it are read, counted from it",
        )
    whole = PulseTestRecord(
        str(path), record.t, columns, places, record.input, notes, levelled=levelled(record)
    )
    if whole.placed or len(labels) == 1:
        return [whole]
    return [
        replace(
            whole, name=f"{path}: {label}", signals={label: u}, positions={label: places[label]}
        )
        for label, u in columns.items()
    ]


def _among(record: Record) -> tuple[float | None, str]:
    """Where a source stands among the receivers, by the file or by what they show, and in words;
    None where none does."""
    if not np.isfinite(record.x).all():
        return None, ""
    inside = [x for x in record.sources if record.x.min() < x < record.x.max()]
    if len(record.sources) == 1 and inside:
        return inside[0], f"the source stands among the receivers, at x = {inside[0]:.3g} m"
    seen = record.source_seen
    if seen is None:
        return None, ""
    return seen, f"the signal comes first near x = {seen:.3g} m: a source stands there"


def _sent_by_itself(path: Path, layout: Layout) -> tuple[Float, Float]:
    """Times and samples of a file that holds what was sent alone."""
    found = read(path, replace(layout, input=None, placed=False, positions=None, spacing=None))
    if found.values.shape[0] * found.values.shape[-1] != 1:
        raise RecordError(f"--input {path}: must hold one channel, what was sent")
    return np.asarray(found.t), np.asarray(found.values[0, :, 0])


def _of_run(path: Path) -> list[PulseTestRecord]:
    """Rotations at the receivers of a run, on that side of its sources where most stand."""
    from wavesim.io.result_reader import StorageError
    from wavesim.records.run_folder import field_of

    field = field_of(path)
    try:
        return of_field(field, str(path))
    except RecordError as error:
        raise RecordError(f"{path}: {error}") from None
    except StorageError as error:
        raise RecordError(str(error)) from None


def of_field(field: Any, name: str) -> list[PulseTestRecord]:
    """Pulse tests of a simulated field, one for each macro-field that its sources drive.

    Raises:
        RecordError: there are no receivers to one side of the sources.
    """
    found, round_at_once = [], False
    for block in field.blocks:
        own = [s for s in field.sources if s.field in block.fields]
        if not (block.macro and own and field.receivers):
            continue
        (macro,) = block.macro[0]
        reach = [(s.position, 5 * float(getattr(s, "width", 0.0) or 0.0)) for s in own]
        places = _beside(field.receivers, reach)
        if not places:
            continue
        beyond = [
            key
            for key, x in places.items()
            if field.bar.periodic and x > _PART_OF_RING * field.bar.length
        ]
        places = {key: x for key, x in places.items() if key not in beyond}
        if not places:
            round_at_once = True
            continue
        (source, *others) = own
        t = np.asarray(field.t)
        sent = None if others or not hasattr(source, "signal") else np.asarray(source.signal(t))
        signals = {key: np.asarray(field.at(field.receivers[key], macro)) for key in places}
        layers = [field.layers.layer_at(field.receivers[key]) for key in places]
        one = len(set(map(id, layers))) == 1 and layers[0].last is None
        end = _gone_round(field, block, own, places)
        notes: tuple[str, ...] = ()
        if beyond:
            notes = (
                f"{', '.join(beyond)}: left out, as waves come there either way round the bar",
            )
        if end < t[-1]:
            kept = t < end
            if kept.sum() < _FEWEST_FRAMES:
                round_at_once = True
                continue
            t, signals = t[kept], {key: u[kept] for key, u in signals.items()}
            sent = None if sent is None else sent[kept]
            notes += (f"read up to {end:.4g} s, before waves come that have gone round the bar",)
        record = PulseTestRecord(f"{name}: {macro}", t, signals, places, sent, notes)
        found.append(replace(record, unlike="" if one else UNLIKE, noise=0.0))
    if round_at_once and not found:
        raise RecordError(
            "waves that have gone round the bar come with the first: lengthen [bar] length, or "
            "move [[receivers]] nearer to the sources"
        )
    if not found:
        raise RecordError(
            "holds no receivers beside its sources: add [[receivers]] to the case and run it again"
        )
    return found


def _gone_round(field: Any, block: Any, sources: list[Any], places: Mapping[str, float]) -> float:
    """When the lowest branch's first wave reaches a receiver the other way round a ring, s; ∞
    where none does. Other branches have other frequencies, and are mixed up with none of its."""
    length, furthest = field.bar.length, max(places.values())
    if not field.bar.periodic:
        return np.inf
    k = np.geomspace(1e-3, 1.0, 64) * np.pi / field.bar.spacing
    media = {medium for layer in field.layers.layers for medium in layer.ends}
    speed = max(float(block_group_velocity(one, block, k)[..., 0].max()) for one in media)
    at = [s.position for s in sources]
    begin = min(max(s.onset, 0.0) for s in sources)
    return float(begin + (length - furthest - max(at) + min(at)) / speed)


def _beside(receivers: Mapping[str, float], sources: list[tuple[float, float]]) -> dict[str, float]:
    """Distances from sources of some reach of the receivers on the side where most stand."""
    high, low = max(x + w for x, w in sources), min(x - w for x, w in sources)
    after = {name: x - max(p for p, _ in sources) for name, x in receivers.items() if x > high}
    before = {name: min(p for p, _ in sources) - x for name, x in receivers.items() if x < low}
    return after if len(after) >= len(before) else before


def of_lengths(tests: Sequence[Any], single: dict[int, Any]) -> Any:
    """Tests of specimens of several lengths as one of receivers at these, which needs no delay;
    None where lengths are alike, or clocks are not."""
    records, lengths = zip(*single.values(), strict=True)
    first, t = records[0], tests[0].t
    alike = all(
        np.shape(test.t) == np.shape(t)
        and np.allclose(test.t, t, rtol=0, atol=first.interval / 2)
        and abs(one.start - first.start) < first.interval
        for test, one in zip(tests, records, strict=True)
    )
    if len(tests) < 2 or len(set(lengths)) < len(tests) or not alike:
        return None
    signals = {one.name: next(iter(one.signals.values())) for one in tests}
    places = dict(zip(signals, lengths, strict=True))
    note = "one material is taken for all of them, and for α and Q one coupling"
    return replace(tests[0], name="all lengths", signals=signals, positions=places, notes=(note,))
