"""A space-time record, from wherever it comes, and what is done to it before it is used.

Readings want even times and finite values. What is wrong with a record is looked for first, fault
by fault (``faults/``); what can be cured is, and said in ``findings``; what can't be is refused
with a message that names value, limit and remedy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavesim.records.content import RecordError
from wavesim.records.faults import gaps, shapes
from wavesim.records.faults.clock import check_ascending, even_times, on_clock, one_clock
from wavesim.records.faults.dead import check_whole, living, tell_dead
from wavesim.records.faults.duplicates import without_frames_twice
from wavesim.records.faults.examination import levels, samples, together
from wavesim.records.faults.fill_values import within_range
from wavesim.records.faults.finding import TAKEN_OUT, Finding, places
from wavesim.records.faults.gaps import FEWEST_FRAMES

Float = NDArray[Any]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Record:
    """A space-time record of one or more components.

    Attributes:
        t: times, even, shape (nt,), s.
        x: receiver positions, ascending, shape (nx,), m; NaN where a pulse test does without.
        values: shape (C, nt, nx), any unit; finite, 0 at missing frames.
        names: of the components.
        ring: whether the receivers go evenly round a periodic bar, so that its wavenumbers are
            exact.
        quiet_from: time from which on no source acts, s.
        missing: frames that are missing, shape (nt,).
        sources: positions of sources, where known, m.
        notes: what was done to the record and assumed of it, a sentence each.
        lattice: whether the receivers are all the sites there are, so that k has no alias.
        answer: the truth, where the record is synthetic: {name: array}.
        labels: names of the receivers, as many.
        input: the source's signal, where the record holds it, shape (nt,), any unit.
        quantum: least step between a receiver's samples (LSB), shape (nx,), unit of the values; 0
            where they are not quantised. It is a noise of quantum/√12 at least.
        interval_error, spacing_error: standard error of the frames' interval over the interval, and
            of the receivers' spacing over the spacing, where rounding leaves them open, –.
        broken: receivers for whose gaps frames are missing, shape (nx,).
        whole: the values with those receivers' gaps and all else in its place; None where none are.
        clipped: receivers with flat tops, shape (nx,).
        begun: receivers at which the signal is there already when the record begins, shape (nx,).
        misfit: receivers round a ring that do not fit the waves of all others, shape (nx,).
        source_seen: where a source that nobody named stands among the receivers, by the earliest
            arrivals, m; None where none does.
        leak: variance of what receivers are off by in gain, place or clock, over the waves', over
            the number of receivers, –; None where that has not been looked at.
        driven: whether it is not known from when on no source acts.
        findings: what was wrong, and what was done.
    """

    t: Float
    x: Float
    values: Float
    names: tuple[str, ...] = ("u",)
    ring: bool = False
    quiet_from: float = 0.0
    missing: Mask = field(default_factory=lambda: np.zeros(0, bool))
    sources: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()
    lattice: bool = False
    answer: dict[str, Any] | None = None
    labels: tuple[str, ...] = ()
    input: Float | None = None
    quantum: Float = field(default_factory=lambda: np.zeros(0))
    interval_error: float = 0.0
    spacing_error: float = 0.0
    broken: Mask = field(default_factory=lambda: np.zeros(0, bool))
    whole: Float | None = None
    clipped: Mask = field(default_factory=lambda: np.zeros(0, bool))
    begun: Mask = field(default_factory=lambda: np.zeros(0, bool))
    misfit: Mask = field(default_factory=lambda: np.zeros(0, bool))
    source_seen: float | None = None
    leak: float | None = None
    driven: bool = False
    findings: tuple[Finding, ...] = ()

    @property
    def interval(self) -> float:
        """Time between frames, s."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    @property
    def spacing(self) -> float:
        """Mean distance between receivers, m."""
        return float(self.x[-1] - self.x[0]) / max(len(self.x) - 1, 1)

    @property
    def even(self) -> bool:
        """Whether the receivers are evenly spaced."""
        return len(self.x) > 1 and shapes.is_even(self.x)

    @property
    def aperture(self) -> float:
        """Length that the receivers cover, m; for a ring its circumference."""
        return self.spacing * (len(self.x) if self.ring else len(self.x) - 1)

    @property
    def noise(self) -> float:
        """Standard deviation of a white noise with the level of the highest tenth in frequency."""
        window = np.hanning(len(self.t))
        spectrum = np.abs(np.fft.rfft(self.values * window[:, None], axis=1)) ** 2
        top = spectrum[:, -max(4, spectrum.shape[1] // 10) : -1]
        return float(np.sqrt(np.median(top) / np.log(2) / np.sum(window**2)))

    def component(self, index: int) -> Record:
        """The record of one component alone."""
        one = slice(index, index + 1)
        whole = None if self.whole is None else self.whole[one]
        return replace(self, values=self.values[one], names=self.names[one], whole=whole)

    def receivers(self, kept: Any) -> Record:
        """The record of some receivers, by mask or number."""
        kept = np.arange(len(self.x))[np.asarray(kept)]
        names = ("quantum", "broken", "clipped", "begun", "misfit")
        own = {name: v[kept] for name in names if len(v := getattr(self, name))}
        return replace(
            self,
            x=self.x[kept],
            values=self.values[..., kept],
            labels=tuple(self.labels[j] for j in kept) if self.labels else (),
            leak=None if self.leak else self.leak,
            whole=None if self.whole is None else self.whole[..., kept],
            **own,
        )

    def with_finding(self, finding: Finding) -> Record:
        """The record with one more finding, and its note."""
        return replace(self, findings=(*self.findings, finding), notes=(*self.notes, finding.said))

    def without_gaps(self) -> Record:
        """Without the receivers for whose gaps frames are missing, where at least two others are.

        Methods that need every frame take this; those that fit around missing ones need not.
        """
        if self.whole is None or not self.broken.any() or (~self.broken).sum() < 2:
            return self
        gone: Mask = np.asarray(~np.isfinite(self.whole[..., ~self.broken]).all(axis=(0, 2)))
        if gone.sum() >= self.missing.sum():
            return self
        kept = replace(self, values=self.whole, missing=gone, whole=None).receivers(~self.broken)
        where = places(self.x, self.broken, self.labels)
        return kept.with_finding(
            Finding("gaps", where, f"{int(self.missing.sum())} frames", TAKEN_OUT,
                    f"receivers with gaps left out, so that all frames are there ({where})")
        )  # fmt: skip

    def since(self, time: float) -> Record:
        """The record from a time on, s."""
        first = int(np.searchsorted(self.t, time - 1e-9 * self.interval))
        if len(self.t) - first < FEWEST_FRAMES:
            raise RecordError(
                f"from t = {time:.4g} s on the record has {max(0, len(self.t) - first)} frames; "
                f"at least {FEWEST_FRAMES} are needed: lengthen the record, or name an earlier time"
            )
        return replace(
            self,
            t=self.t[first:],
            values=self.values[:, first:],
            missing=self.missing[first:] if len(self.missing) else self.missing,
            input=None if self.input is None else self.input[first:],
            whole=None if self.whole is None else self.whole[:, first:],
        )


def record(
    values: ArrayLike,
    t: ArrayLike,
    x: ArrayLike,
    names: Sequence[str] = (),
    ring: bool = False,
    quiet_from: float | None = None,
    sources: Sequence[float] = (),
    answer: dict[str, Any] | None = None,
    lattice: bool = False,
    labels: Sequence[str] = (),
    input: ArrayLike | None = None,
    storage: tuple[float, float] = (0.0, 0.0),
    notes: Sequence[str] = (),
    placed: bool = True,
    trusted: bool = False,
    as_recorded: bool = False,
) -> Record:
    """A record from arrays, looked over, and cured where that can be done.

    Args:
        values: shape (nt, nx) or (C, nt, nx); NaN where a sample is missing.
        t: times, ascending, shape (nt,), s; or (nt, nx) where each channel has its own.
        x: receiver positions, shape (nx,), in any order, m.
        names: of the components.
        ring: whether the receivers go evenly round a periodic bar.
        quiet_from: time from which on no source acts, s; not known where None.
        sources: positions of sources, m.
        answer: the truth, where it is known.
        lattice: whether the receivers are all the sites there are.
        labels: names of the receivers.
        input: the source's signal, shape (nt,).
        storage: least distance between numbers as times and positions were stored, s and m.
        notes: what was assumed of it.
        placed: whether receivers must have positions, and there must be two.
        trusted: whether it is a simulation's array, taken over, without an instrument's faults.
        as_recorded: whether channels along a line are not held against each other.

    Returns:
        The record; its findings say what was wrong and what was done.

    Raises:
        RecordError: it can't be used.
    """
    if as_recorded and ring:
        raise RecordError(
            "as_recorded: only along a line can channels be taken as they are; round a ring each "
            "fault would show at all wavenumbers: leave it out, or leave out ring"
        )
    stored = np.asarray(values)
    values, t, x = shapes.real(stored, not trusted), np.array(t, float), np.array(x, float)
    if values.ndim == 2:
        values = values[None]
    found: list[Finding] = []
    shapes.check_shapes(values, t, x, placed)
    values, t = one_clock(values, t, found)
    if input is None:
        values, t = without_frames_twice(values, t, found)
    check_ascending(t, storage[0])
    placed = placed or bool(np.isfinite(x).all())
    names_of = shapes.named(labels, len(x))
    if placed:
        order = np.argsort(x, kind="stable")
        if (order[1:] < order[:-1]).any():
            values = values[..., order]
        x = x[order]
        names_of = tuple(names_of[j] for j in order)
        shapes.check_places(x)
    x, spacing_error = shapes.snapped(x, storage[1], found) if placed else (x, 0.0)
    signal = None if input is None else np.atleast_1d(np.array(input, float))
    if signal is not None and len(signal) != len(t):
        raise RecordError(f"input: {len(signal)} samples for {len(t)} frames; give one each")
    if not trusted:
        values, t, signal = gaps.without_first_zeros(values, t, signal, found)
    frames = len(t)
    values, t = gaps.whole_frames(values, t, found)
    if signal is not None and len(t) != frames:
        raise RecordError("frames are missing, so that the input is not whole: give all frames")
    nil = np.zeros(len(x), bool)
    now = Record(
        t,
        x,
        values,
        tuple(names) or tuple(f"u{i}" for i in range(len(values))),
        ring=ring,
        quiet_from=float(t[0]) if quiet_from is None else float(quiet_from),
        sources=tuple(float(s) for s in sources),
        lattice=lattice,
        answer=answer,
        labels=names_of,
        quantum=np.zeros(len(x)),
        spacing_error=spacing_error,
        clipped=nil,
        misfit=nil,
        leak=0.0 if trusted and not ring else None,
        driven=quiet_from is None,
    )
    spare, grain = nil, storage[0]
    if not trusted:
        now, spare, held = _sampled(replace(now, values=within_range(values, found)), found)
        signal = signal[np.searchsorted(t, now.t)] if signal is not None and held > 1 else signal
        if held % 1:
            grain = max(grain, (t[-1] - t[0]) / (len(t) - 1))
    alive = living(now.values, now.x, now.labels, ring, still=not (ring and trusted))
    tell_dead(now.x, alive | spare, now.labels, found)
    if ring:
        now = replace(now, misfit=now.misfit | ~alive)
        check_whole(now.x, now.misfit, now.labels)
    else:
        now = now.receivers(alive)
    values, t, x, known = now.values, now.t, now.x, (now.labels, now.quantum)
    quiet = np.zeros(values.shape[1:], bool)
    if not trusted:
        values, resting = levels(values, t, x, *known, ring, found)
        quiet = np.logical_and.reduce([one.mask for one in resting])
    values, missing, broken = gaps.bridged(values, t, x, now.labels, quiet, found)
    whole = values.copy() if broken.any() else None
    values[:, missing] = 0.0
    unsure = now.clipped | broken | gaps.cut_apart(missing, quiet)
    own = t
    values, t, missing, interval_error = even_times(values, t, missing, grain, found)
    if any(finding.what == "times uneven" for finding in found):
        whole = None
        signal = None if signal is None else on_clock(signal, own, t)
    if ring:
        shapes.check_round(x)
    now = replace(now, t=t, values=values, whole=whole, broken=broken, missing=missing,
                  input=signal, interval_error=interval_error)  # fmt: skip
    if not trusted:
        seen, gone = (values, missing) if whole is None else (whole, np.zeros_like(missing))
        mended, odd, within, place = together(
            seen, gone, t, x, *known, unsure, ring, now.misfit,
            -np.inf if quiet_from is None else quiet_from,
            placed and len(x) > 1 and shapes.is_even(x), as_recorded, found,
        )  # fmt: skip
        now = replace(now, begun=within, misfit=odd, source_seen=place if not sources else None)
        if mended.any:
            kept = ~mended.out if (~mended.out).sum() >= 2 else np.ones(len(x), bool)
            right = now.values[..., mended.order] * mended.factor
            whole = None if whole is None else whole[..., mended.order] * mended.factor
            now = replace(now, values=right, whole=whole).receivers(kept)
    else:
        now = replace(now, begun=np.zeros(len(x), bool))
    return replace(now, notes=(*notes, *(f.said for f in found)), findings=tuple(found))


def _sampled(now: Record, found: list[Finding]) -> tuple[Record, Mask, float]:
    """Samples looked at as they were recorded, of receivers that have most of them.

    Returns:
        The record; which receivers, round a ring, hold another's; for how many frames each sample
        was held.
    """
    alive = living(now.values, now.x, now.labels, now.ring, still=False)
    if now.ring:
        now.values[..., ~alive] = 0.0
        now = replace(now, misfit=~alive)
    else:
        tell_dead(now.x, alive, now.labels, found, "mostly missing")
        now = now.receivers(alive)
    known = now.values, now.t, now.x, now.labels, now.ring
    values, t, held, quantum, flat, spare = samples(*known, found)
    now = replace(now, values=values, t=t, quantum=quantum, clipped=flat)
    if now.ring and spare.any() and not shapes.is_even(now.x[~spare]):
        values[..., spare] = 0.0
        return now, spare, held
    return now.receivers(~spare), np.zeros(int((~spare).sum()), bool), held


__all__ = ["FEWEST_FRAMES", "Record", "RecordError", "record"]
