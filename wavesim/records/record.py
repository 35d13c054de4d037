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
from wavesim.records.evenness import even
from wavesim.records.faults.clock import check_ascending, even_times, on_clock, one_clock
from wavesim.records.faults.examination import Raw, levels, samples, together
from wavesim.records.faults.fill_values import within_range
from wavesim.records.faults.finding import CURED, TAKEN_OUT, Finding, places
from wavesim.records.faults.gaps import (
    BRIDGED,
    FEWEST_FRAMES,
    bridged,
    whole_frames,
    without_first_zeros,
)
from wavesim.records.faults.unfit_receivers import PART

Float = NDArray[Any]
Mask = NDArray[np.bool_]

# Receivers even to this part of their spacing count as even.
_EVEN_RECEIVERS = 1e-3
# Positions are taken as rounded where their last digit is at most this part of the spacing.
_ROUNDED = 0.02
# A receiver that varies less than this part of the strongest is dead.
_DEAD = 1e-12
# A receiver with more than this part of its samples missing is left out.
_MOST_MISSING = 0.2
# No more than this part of the frames may be there twice.
_FRAMES_TWICE = 0.01
# A field is odd about a receiver where this part of its power is left of it and its mirror image.
_ODD = 0.1
# Spans of time (s) and place (m) within which squares and products are numbers still.
_LEAST, _GREATEST = 1e-30, 1e30


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
        leak: variance of what receivers' gains are still off by at each wavenumber (``faults/
            ring_misfits.py``), shape (nx,), –; empty where gains have not been looked at.
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
    leak: Float = field(default_factory=lambda: np.zeros(0))
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
        return len(self.x) > 1 and _is_even(self.x)

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
        return replace(
            self,
            x=self.x[kept],
            values=self.values[..., kept],
            labels=tuple(self.labels[j] for j in kept) if self.labels else (),
            quantum=self.quantum[kept] if len(self.quantum) else self.quantum,
            broken=self.broken[kept] if len(self.broken) else self.broken,
            clipped=self.clipped[kept] if len(self.clipped) else self.clipped,
            begun=self.begun[kept] if len(self.begun) else self.begun,
            misfit=self.misfit[kept] if len(self.misfit) else self.misfit,
            leak=np.zeros(0 if self.leak.any() or not len(self.leak) else len(kept)),
            whole=None if self.whole is None else self.whole[..., kept],
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
        trusted: whether it is a simulation's, in which no instrument's faults are looked for.

    Returns:
        The record; its findings say what was wrong and what was done.

    Raises:
        RecordError: it can't be used.
    """
    stored = np.asarray(values)
    values, t, x = _real(stored), np.array(t, float), np.array(x, float)
    if values.ndim == 2:
        values = values[None]
    found: list[Finding] = []
    _check_shapes(values, t, x, placed)
    values, t = one_clock(values, t, found)
    twice = np.r_[False, np.diff(t) == 0]
    twice[1:] &= ((values[:, 1:] == values[:, :-1]) | np.isnan(values[:, 1:])).all(axis=(0, 2))
    if 0 < twice.sum() <= _FRAMES_TWICE * len(t) and input is None:
        values, t = np.array(values[:, ~twice]), np.array(t[~twice])
        said = f"{int(twice.sum())} frames there twice, time and samples: one of each taken"
        where = "all receivers"
        found.append(Finding("frames twice", where, f"{int(twice.sum())} frames", CURED, said))
    check_ascending(t, storage[0])
    placed = placed or bool(np.isfinite(x).all())
    if len(labels) not in (0, len(x)):
        raise RecordError(f"labels: {len(labels)} for {len(x)} receivers; give one each")
    names_of = tuple(labels) or tuple(f"receiver {j}" for j in range(1, len(x) + 1))
    if placed:
        order = np.argsort(x, kind="stable")
        x, values = x[order], values[..., order]
        names_of = tuple(names_of[j] for j in order)
        _check_places(x)
    x, spacing_error = _snapped(x, storage[1], found) if placed else (x, 0.0)
    signal = None if input is None else np.atleast_1d(np.array(input, float))
    if signal is not None and len(signal) != len(t):
        raise RecordError(f"input: {len(signal)} samples for {len(t)} frames; give one each")
    if not trusted:
        values, t, signal = without_first_zeros(values, t, signal, found)
    frames = len(t)
    values, t = whole_frames(values, t, found)
    if signal is not None and len(t) != frames:
        raise RecordError("frames are missing, so that the input is not whole: give all frames")
    raw = None
    first_dead: tuple[Float, tuple[str, ...]] = (np.zeros(0), ())
    lost = np.zeros(len(x), bool)
    if not trusted:
        values = within_range(values, found)
        alive = _living(values, x, names_of, ring, still=False)
        if ring:
            lost = ~alive
            values[..., lost] = 0.0
            alive = np.ones(len(x), bool)
        first_dead = x[~alive], tuple(np.array(names_of, object)[~alive])
        values, x = values[..., alive], x[alive]
        names_of = tuple(name for name, a in zip(names_of, alive, strict=True) if a)
        raw = samples(values, t, x, names_of, found)
        if signal is not None and raw.held > 1:
            signal = signal[np.searchsorted(t, raw.t)]
        values, t = raw.values, raw.t
    channels, twice = _Channels.of(x, names_of, raw), np.zeros(len(x), bool)
    if raw is not None and raw.spare.any():
        if ring and not _is_even(x[~raw.spare]):
            twice = raw.spare
            values[..., twice] = 0.0
        else:
            values, x = values[..., ~raw.spare], x[~raw.spare]
            channels, lost = channels.take(~raw.spare), lost[~raw.spare]
            twice = twice[~raw.spare]
    alive = _living(values, x, channels.labels, ring, still=not (ring and trusted))
    _tell_dead(x, alive | twice, channels.labels, first_dead, found)
    if ring:
        lost = lost | ~alive
        _check_whole(x, lost, channels.labels)
    else:
        values, x, channels = values[..., alive], x[alive], channels.take(alive)
    quiet = np.zeros(values.shape[1:], bool)
    if not trusted:
        values, resting = levels(values, t, x, channels.labels, channels.quantum, ring, found)
        quiet = np.logical_and.reduce([one.mask for one in resting])
    values, missing, broken = bridged(values, t, x, channels.labels, quiet, found)
    whole = values.copy() if broken.any() else None
    values[:, missing] = 0.0
    cut = _cuts(missing, quiet)
    own = t
    values, t, missing, interval_error = even_times(values, t, missing, storage[0], found)
    if any(finding.what == "times uneven" for finding in found):
        whole = None
        signal = None if signal is None else on_clock(signal, own, t)
    if ring and not _is_even(x):
        raise RecordError(
            "ring: the receivers round a periodic bar must be evenly spaced; treat the record as "
            "a stretch instead, or give --spacing where they are"
        )
    within, place = np.zeros(len(x), bool), None
    odd = np.zeros(len(x), bool)
    if not trusted:
        seen, gone = (values, missing) if whole is None else (whole, np.zeros_like(missing))
        unsure = channels.flat | broken | cut
        mended, odd, within, place = together(
            seen, gone, t, x, channels.labels, channels.quantum, unsure, ring, lost,
            -np.inf if quiet_from is None else quiet_from,
            placed and len(x) > 1 and _is_even(x), found,
        )  # fmt: skip
        if mended.any:
            kept = ~mended.out if (~mended.out).sum() >= 2 else np.ones(len(x), bool)
            values = (values[..., mended.order] * mended.factor)[..., kept]
            if whole is not None:
                whole = (whole[..., mended.order] * mended.factor)[..., kept]
            x, channels, within, broken = x[kept], channels.take(kept), within[kept], broken[kept]
            odd = odd[kept]
    components = tuple(names) or tuple(f"u{i}" for i in range(len(values)))
    return Record(
        t,
        x,
        values,
        components,
        ring=ring,
        quiet_from=float(t[0]) if quiet_from is None else float(quiet_from),
        missing=missing,
        sources=tuple(float(s) for s in sources),
        notes=(*notes, *(f.said for f in found)),
        lattice=lattice,
        answer=answer,
        labels=channels.labels,
        input=signal,
        quantum=channels.quantum,
        interval_error=interval_error,
        spacing_error=spacing_error,
        broken=broken,
        whole=whole,
        clipped=channels.flat,
        begun=within,
        misfit=odd,
        source_seen=place if not sources else None,
        leak=np.zeros(len(x) if trusted and not ring else 0),
        driven=quiet_from is None,
        findings=tuple(found),
    )


def _real(values: Float) -> Float:
    if values.dtype.kind not in "fiubc":
        raise RecordError(f"values are no numbers (type {values.dtype})")
    if np.iscomplexobj(values):
        if np.abs(values.imag).max(initial=0.0) > 0:
            raise RecordError(
                "complex values: both parts can't be one real signal; give one real component "
                "(the real part of an analytic signal; a demodulated one multiplied back up to its "
                "carrier)"
            )
        values = values.real
    return np.array(values, float)


def _is_even(x: Float) -> bool:
    i = np.arange(len(x))
    off = x - x.mean() - np.polyfit(i, x, 1)[0] * (i - i.mean())
    return bool(np.abs(off).max() <= _EVEN_RECEIVERS * (x[-1] - x[0]) / (len(x) - 1))


def _snapped(x: Float, storage: float, found: list[Finding]) -> tuple[Float, float]:
    """Positions that are even to within their last digit, made even."""
    if len(x) < 4:
        return x, 0.0
    sequence = even(x, storage)
    if sequence is None or sequence.digit > _ROUNDED * sequence.step:
        return x, 0.0
    if sequence.off > 1e-9:
        found.append(
            Finding("positions rounded", "all receivers", f"to {sequence.digit:.2g} m", CURED,
                    f"positions are rounded to {sequence.digit:.2g} m: taken as even, "
                    f"{sequence.step:.9g} m apart")
        )  # fmt: skip
    return sequence.values(len(x)), sequence.error


def _check_shapes(values: Float, t: Float, x: Float, placed: bool) -> None:
    if t.ndim not in (1, 2) or x.ndim != 1:
        raise RecordError(
            f"t of shape {t.shape}, x of shape {x.shape}: must be (frames,) and (receivers,)"
        )
    if (
        values.ndim != 3
        or values.shape[1:] != (len(t), len(x))
        or (t.ndim == 2 and t.shape != values.shape[1:])
    ):
        raise RecordError(
            f"values of shape {values.shape}: must be (frames, receivers) = ({len(t)}, {len(x)}), "
            "or that for each component"
        )
    if len(t) < FEWEST_FRAMES:
        raise RecordError(
            f"{len(t)} frames: at least {FEWEST_FRAMES} are needed; lengthen the record or sample "
            "it more often"
        )
    if len(x) < (2 if placed else 1):
        raise RecordError(
            f"{len(x)} receiver: at least 2 are needed for a wavenumber, 3 where waves run both "
            "ways"
        )
    if not (np.isfinite(t).all() and (not placed or np.isfinite(x).all())):
        raise RecordError("t or x: holds values that are not finite; give every time and position")
    span, reach = np.ptp(t), np.ptp(x) if placed else 1.0
    if not (_LEAST < span < _GREATEST and (reach == 0 or _LEAST < reach < _GREATEST)):
        raise RecordError(
            f"t or x: times span {span:g} s, positions {reach:g} m; give them between {_LEAST:g} "
            f"and {_GREATEST:g}"
        )


def _check_places(x: Float) -> None:
    if len(x) > 1 and (np.diff(x) <= 0).any():
        twice = x[1:][np.diff(x) <= 0][0]
        raise RecordError(f"x = {twice:g} m: two receivers stand there; leave one out")


def _living(
    values: Float,
    x: Float,
    labels: tuple[str, ...],
    ring: bool,
    still: bool = True,
) -> Mask:
    """Which receivers say something, shape (nx,); those that stand still are dead if so wished."""
    finite = np.isfinite(values)
    size = np.nanmax(np.where(finite, np.abs(values), 0), axis=(0, 1))
    seen = ~(~finite).all(axis=(0, 2))
    if not seen.any():
        raise RecordError("no sample is finite: every receiver is dead or mostly missing")
    gone = (~finite[:, seen]).mean(axis=(0, 1)) > _MOST_MISSING
    varies = np.nanmax(np.where(finite, values, -np.inf), axis=1) - np.nanmin(
        np.where(finite, values, np.inf), axis=1
    )
    least = _DEAD * max(size.max(), 1e-300)
    dead: Mask = np.asarray(gone)
    if still:
        at_rest = np.nan_to_num(varies, nan=0, neginf=0).max(axis=0) <= least
        if ring and at_rest.any():
            # Where no wave has come, or none travels, many rest rightly.
            at_rest &= ~_nodes(values) & (at_rest.sum() <= max(1, PART * len(x)))
        dead = gone | at_rest
    if not dead.any():
        return ~dead
    where = places(x, dead, labels)
    least_living = min(2, len(x))
    if len(x) - dead.sum() < least_living:
        raise RecordError(
            f"{dead.sum()} of {len(x)} receivers are dead or mostly missing ({where}); at "
            f"least {least_living} must live"
        )
    return ~dead


def _cuts(missing: Mask, quiet: Mask) -> bool:
    """Whether frames are missing for longer than a spline bridges while a signal goes on, so that
    receivers have lost different parts of it, and their sizes say nothing."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], missing.astype(int), [0]]))).reshape(-1, 2)
    last = len(missing) - 1
    return any(
        stop - start > BRIDGED and not quiet[[max(start - 1, 0), min(stop, last)]].all()
        for start, stop in edges
    )


def _nodes(values: Float) -> Mask:
    """Receivers round a ring that a standing field, odd about them, leaves at rest, shape (nx,).

    Σ_d (u_{j+d} + u_{j−d})² / 2 = Σ_d u_d² + Σ_d u_{j+d} u_{j−d}, of which the last is the circular
    convolution of u with itself at 2j.
    """
    nx = values.shape[2]
    own, hat = np.zeros(nx), np.zeros(nx // 2 + 1, complex)
    for rows in (np.nan_to_num(row) for part in values for row in np.array_split(part, 16)):
        own += np.sum(rows**2, axis=0)
        hat += np.sum(np.fft.rfft(rows, axis=1) ** 2, axis=0)
    at = np.arange(nx)
    # What is its own mirror image tells nothing.
    itself = own + (np.roll(own, -(nx // 2)) if nx % 2 == 0 else 0.0)
    power = own.sum() - itself
    mirrored = np.fft.irfft(hat, nx)[2 * at % nx] - itself
    return np.asarray(power + mirrored < _ODD * power)


def _check_whole(x: Float, lost: Mask, labels: tuple[str, ...]) -> None:
    """Refuse a ring of which too many receivers are lost for the others to tell what they lack."""
    if lost.sum() > max(1, PART * len(x)):
        raise RecordError(
            f"{lost.sum()} of the ring's {len(x)} receivers can't be used "
            f"({places(x, lost, labels)}): no more than a quarter may be read from the others; "
            "record them again, or read what is there along a line, without --ring"
        )


def _tell_dead(
    x: Float,
    alive: Mask,
    labels: tuple[str, ...],
    before: tuple[Float, tuple[str, ...]],
    found: list[Finding],
) -> None:
    """One finding for all that are dead, with those left out before."""
    gone = np.r_[before[0], x[~alive]]
    if not len(gone):
        return
    names = (*before[1], *(label for label, a in zip(labels, alive, strict=True) if not a))
    order = np.argsort(gone, kind="stable")
    listed = tuple(str(names[j]) for j in order)
    # One more that is not meant: else it would read "all".
    where = places(np.r_[gone[order], np.inf], np.arange(len(gone)), listed)
    found.append(
        Finding("dead", where, f"{len(gone)} of {len(x) + len(before[0])}", TAKEN_OUT,
                f"{len(gone)} dead receivers left out ({where})")
    )  # fmt: skip


@dataclass(frozen=True)
class _Channels:
    """What is known of each receiver, left out and kept with it."""

    labels: tuple[str, ...]
    quantum: Float
    flat: Mask

    @staticmethod
    def of(x: Float, labels: tuple[str, ...], raw: Raw | None) -> _Channels:
        """Of a record as it was looked at; nothing is known of a trusted one."""
        if raw is None:
            return _Channels(labels, np.zeros(len(x)), np.zeros(len(x), bool))
        return _Channels(labels, raw.quantum, raw.flat)

    def take(self, kept: Mask) -> _Channels:
        """Of those that stay."""
        labels = tuple(label for label, k in zip(self.labels, kept, strict=True) if k)
        return _Channels(labels, self.quantum[kept], self.flat[kept])


__all__ = ["FEWEST_FRAMES", "Record", "RecordError", "record"]
