"""A measured record laid beside a case: which signal is which receiver's, when, in what unit.

Receivers are matched by name, else by position. The record's clock may be late by a lag, and its
unit is its own: its values are scale × field(t − lag) + an offset of each receiver.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.records.of_pulse_test import PulseTestRecord
from wavesim.records.units import named_as, without_unit
from wavesim.simulation.bandlimited import taps, taps_at_end
from wavesim.simulation.simulation import Simulation

Float = NDArray[Any]

# A position is a receiver's within this part of the least distance between receivers, or a mm where
# there is one, and within that part of the least distance between positions.
_NEAR, _OF_APART = 0.05, 0.1
_ALONE = 1e-3
_FEWEST = 32


class MatchError(ValueError):
    """A record and a case do not go together; the message says why and what to do."""


@dataclass(frozen=True)
class Measured:
    """What was measured where a case has receivers.

    Attributes:
        names, positions: of the case's receivers that were found, m of them.
        field: the simulated field that the record is of, as :func:`field_and_rates` takes it.
        t: times, even, shape (nt,), s, on the record's clock.
        values: shape (nt, m), the record's unit.
        notes: what was matched to what, and left out.
    """

    names: tuple[str, ...]
    positions: tuple[float, ...]
    field: str
    t: Float
    values: Float
    notes: tuple[str, ...]

    @property
    def interval(self) -> float:
        """Δt, s."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)


def matched(
    record: PulseTestRecord, planned: Simulation, field: str | None, lag: float = 0.0
) -> Measured:
    """Lay a record beside a simulation.

    Args:
        record: what was measured.
        planned: what is simulated; with receivers.
        field: such as phi1, or u1_t, its rate; the macro-field that the first source drives where
            None.
        lag: by which the record's clock is late, as far as it is stated, s.

    Raises:
        MatchError: no receiver is found in the record, or the field is not simulated.
    """
    if not planned.receivers:
        raise MatchError("the case has no [[receivers]]: add those that were measured")
    name = field or _driven(planned)
    if field_and_rates(name)[0] not in planned.fields:
        raise MatchError(
            f"--field {name}: is not simulated; must be one of {', '.join(planned.fields)}, or its "
            "rate in time, as u1_t, or the rate of that, as u1_tt"
        )
    found, how = _pairs(record, planned)
    if not found:
        places = ", ".join(f"{n} at {x:g} m" for n, x in planned.receivers.items())
        raise MatchError(
            f"no receiver of the case ({places}) is in the record "
            f"({', '.join(_told(record))}): name columns as the receivers, or give --positions"
        )
    begin, end = lag, lag + planned.duration
    inside = (record.t >= begin) & (record.t <= end)
    if inside.sum() < _FEWEST:
        remedy = "--lag says by how much its clock is late, --time-unit what it is in"
        if len(record.t) < _FEWEST:
            remedy = "record longer, or sample faster"
        raise MatchError(
            f"the record goes from {record.t[0]:.4g} to {record.t[-1]:.4g} s, the case from "
            f"{begin:.4g} to {end:.4g} s: {inside.sum()} samples in both, at least {_FEWEST} are "
            f"needed: {remedy}"
        )
    t = record.t
    values = np.stack([np.asarray(record.signals[label], float) for label in found.values()], 1)
    notes = [*record.notes, f"receivers matched by {how}: " + ", ".join(
        f"{label!r} is {receiver!r}" for receiver, label in found.items())]  # fmt: skip
    left = [label for label in record.signals if label not in found.values()]
    if left:
        notes.append(f"columns {', '.join(map(repr, left))} are no receiver's, left out")
    positions = tuple(float(planned.receivers[n]) for n in found)
    return Measured(tuple(found), positions, name, t, values, tuple(notes))


def field_and_rates(name: str) -> tuple[str, int]:
    """A field, and how many times ∂/∂t is taken of it: u1_t is ∂u1/∂t, u1_tt ∂²u1/∂t²."""
    field, _, rates = name.rpartition("_")
    return (field, len(rates)) if rates and not rates.strip("t") else (name, 0)


def _driven(planned: Simulation) -> str:
    """The macro-field of the first source's block."""
    (block, *_) = planned.medium.family.excited([planned.sources[0].field])
    if not block.macro:
        return str(planned.sources[0].field)
    (name,) = block.macro[0]
    return str(name)


def _told(record: PulseTestRecord) -> list[str]:
    return [
        label if not np.isfinite(record.positions[label]) else
        f"{label} at {record.positions[label]:g} m"
        for label in record.signals
    ]  # fmt: skip


def _pairs(record: PulseTestRecord, planned: Simulation) -> tuple[dict[str, str], str]:
    """{receiver: column} and how they were found."""

    labels = list(record.signals)
    found: dict[str, str] = {}
    for receiver in planned.receivers:
        at = named_as(without_unit(receiver), labels)
        if len(at) > 1:
            raise MatchError(
                f"{len(at)} columns of the record ({', '.join(labels[i] for i in at)}) are named "
                f"as receiver {receiver!r} is: rename all but the one that is meant"
            )
        if at:
            found[receiver] = labels[at[0]]
    if found:
        return found, "name"
    places = {n: x for n, x in record.positions.items() if np.isfinite(x)}
    first = min(float(s.position) for s in planned.sources)
    ways = {
        how: _by_place(planned.receivers, {n: x + shift for n, x in places.items()})
        for shift, how in ((0.0, "position"), (first, "distance from the source"))
    }
    # A place of one receiver may be the distance of another: what finds more of them is meant.
    how = max(ways, key=lambda one: len(ways[one]))
    if ways[how]:
        return ways[how], how
    if len(record.signals) == 1 == len(planned.receivers):
        return {next(iter(planned.receivers)): next(iter(record.signals))}, "being the only ones"
    return {}, ""


def _by_place(receivers: Mapping[str, float], places: Mapping[str, float]) -> dict[str, str]:
    if not places:
        return {}
    x = np.sort(np.array(list(receivers.values())))
    near = _NEAR * float(np.min(np.diff(x))) if len(x) > 1 else _ALONE
    apart = np.diff(np.unique(list(places.values())))
    near = min(near, _OF_APART * float(apart.min())) if len(apart) else near
    found = {}
    for name, position in receivers.items():
        there = [label for label in places if abs(places[label] - position) <= near]
        if len(there) == 1:  # of several at one place it is not known which is meant
            found[name] = there[0]
    return found


def resampling(frames: int, interval: float, t: Float) -> Any:
    """Matrix from frames t_n = n Δt to values at times, between them by the band-limited sinc.

    Args:
        frames: how many there are.
        interval: Δt, s.
        t: times, shape (nt,), s; 0 outside the frames.

    Returns:
        Sparse, shape (nt, frames).
    """
    from scipy.sparse import csr_matrix  # slow to import, and only a comparison needs it

    columns, weights = taps(t / interval)
    late, last, at_end = taps_at_end(frames, t / interval)
    inside = (columns >= 0) & (columns < frames) & ~late[:, None]
    rows = np.broadcast_to(np.arange(len(t))[:, None], columns.shape)
    own = np.repeat(np.flatnonzero(late), len(last)), np.tile(last, int(late.sum()))
    numbers = np.concatenate([weights[inside], at_end.ravel()])
    places = [
        np.concatenate(both) for both in zip((rows[inside], columns[inside]), own, strict=True)
    ]
    return csr_matrix((numbers, tuple(places)), shape=(len(t), frames))
